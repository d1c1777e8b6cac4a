//! Tables of shots against what pedr2tab printed, and without its slips.

#![allow(
    clippy::disallowed_methods,
    clippy::unwrap_used,
    reason = "helpers of tests may panic"
)]

use crate::common;

use std::{fs, path::Path};

use areograph::{
    pds::{
        pedr::{File, LABEL_BYTES, Record},
        pedr_table::{Preferences, Rules, Table, Variant},
    },
    scene::{SceneErrors, SceneOptions, write_scene},
};

/// Files whose values are drawn at random, in the order of the list that both variants of the program were given:
/// frames with and without parallax, a version without residuals, then one with.
const FILES: [&str; 3] = ["AP00002L.B", "AP00005J.B", "AP00006L.B"];

fn data(name: &str) -> Vec<u8> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/pedr_table");
    fs::read(folder.join(name)).unwrap()
}

fn preferences(text: &str) -> Preferences {
    Preferences::parse(text)
}

fn table(files: &[File], preferences: &Preferences, variant: Variant, rules: Rules) -> String {
    let mut table = Table::new(preferences.clone(), variant, rules);
    let mut out = Vec::new();
    table.write_headings(&mut out).unwrap();
    for file in files {
        table.write(file, &mut out).unwrap();
    }
    String::from_utf8(out).unwrap()
}

/// The expected tables were printed by both variants of the program, compiled with gfortran 12.2.
#[test]
fn tables_are_those_of_the_program_to_the_byte() {
    let files = FILES.map(|name| File::from_bytes(data(name), Path::new(name)));
    let text = String::from_utf8(data("PEDR2TAB.PRM")).unwrap();
    for (variant, expected) in [(Variant::Team, "team.TAB"), (Variant::Usgs, "usgs.TAB")] {
        let printed = table(&files, &preferences(&text), variant, Rules::Program);
        let expected = String::from_utf8(data(expected)).unwrap();
        for (line, (printed, expected)) in printed.lines().zip(expected.lines()).enumerate() {
            assert_eq!(printed, expected, "{variant:?}, line {}", line + 1);
        }
        assert!(printed == expected, "{variant:?}: another number of lines");
        assert!(printed.lines().count() > 60);
    }
}

/// Runs `pedr tab` in a folder with the files, the preferences and a list; exit code and what it said.
fn run_tab(folder: &Path, list: &str, arguments: &[&str]) -> (Option<i32>, String) {
    for name in FILES.iter().chain(&["PEDR2TAB.PRM"]) {
        fs::write(folder.join(name), data(name)).unwrap();
    }
    fs::write(folder.join("FILELIST"), list).unwrap();
    let mut command = common::mission::areograph();
    command
        .current_dir(folder)
        .args(["--quiet", "pedr", "tab"])
        .args(arguments);
    let output = command.output().unwrap();
    let said = [output.stdout, output.stderr].concat();
    (output.status.code(), String::from_utf8(said).unwrap())
}

#[test]
fn the_command_takes_the_places_of_the_program() {
    let folder = tempfile::tempdir().unwrap();
    let list = FILES.join("\n");
    let (code, said) = run_tab(folder.path(), &list, &[]);
    assert_eq!(code, Some(0), "{said}");
    let table = || fs::read(folder.path().join("BIG.TAB")).unwrap();
    assert!(table() == data("team.TAB"));
    let (code, _) = run_tab(folder.path(), &list, &["FILELIST", "--variant", "usgs"]);
    assert!(code == Some(0) && table() == data("usgs.TAB"));

    // The list ends at a file that is not there: the table as far as it goes, and an error.
    let broken = format!("{}\nno PEDR\nap09999l.b\n{}\n", FILES[0], FILES[1]);
    let (code, said) = run_tab(folder.path(), &broken, &[]);
    assert_eq!(code, Some(3), "{said}");
    assert!(
        said.contains("skipping \"no PEDR\"") && said.contains("ap09999l.b: cannot open"),
        "{said}"
    );
    let expected = data("team.TAB");
    assert!(table().len() < expected.len() && expected.starts_with(&table()));
    assert!(!folder.path().join("BIG.TAB.part").exists());

    // One file, one table of its own.
    let own = "T\nT\nF\nF\nF\nF\nF\nF\nF\nF\nT\nT\nF, 'x.TXT'\n";
    fs::write(folder.path().join("own.prm"), own).unwrap();
    let (code, said) = run_tab(folder.path(), "", &[FILES[0], "--preferences", "own.prm"]);
    assert_eq!(code, Some(0), "{said}");
    assert!(
        said.contains("own.prm: ends after line 13; expected a number of degrees"),
        "{said}"
    );
    let table = fs::read_to_string(folder.path().join("AP00002L.TXT")).unwrap();
    assert!(table.starts_with("long_East lat_North") && table.lines().all(|line| line.len() == 56));
}

#[test]
fn preferences_are_read_as_fortran_reads_lists() {
    let defaults = Preferences::default();
    let whole = "T\n.false. group 0\n2*T\nnot read\n\n\nF\n";
    let read = preferences(whole);
    assert!(read.ended.is_some() && read.headings && !read.groups[0] && read.groups[1]);
    assert_eq!(read.groups[2], defaults.groups[2]);
    let text = "T\n T\nF\nF\nF\nF\nF\nF\nF\nF\nT\nT\nT , 'it''s.DAT' rest\n-1.5d1\n,\n/\n 9e1\n169.8944472\n";
    let read = preferences(text);
    assert!(read.ended.is_none() && read.one_table);
    assert_eq!(read.table_name, "it's.DAT");
    // An empty value and a slash leave what was there.
    assert_eq!(
        (read.longitude_deg, read.latitude_deg),
        ([-15.0, 360.0], [-90.0, 90.0])
    );
    let ratio = 1.0 - 1.0 / 169.894_447_2;
    assert!((read.axes_squared - 1.0 / (ratio * ratio)).abs() < 1e-15); // rounding
    assert_eq!(preferences("").groups, defaults.groups);
}

/// A file of the synthetic mission, some of its records changed.
fn file(change: impl Fn(&mut Vec<Record>)) -> File {
    let folder = tempfile::tempdir().unwrap();
    let scene = folder.path().join("mission");
    let options = SceneOptions {
        seed: 3,
        day_s: 600.0,
        pairs: 1,
        passes: 0,
        ties: 154,
        ties_at_shots: false,
        errors: SceneErrors::demo(),
    };
    write_scene(&scene, &options).unwrap();
    let bytes = fs::read(scene.join("pedr/ap19117l.b")).unwrap();
    let mut records = Record::slice_of(&bytes[LABEL_BYTES..]).to_vec();
    change(&mut records);
    let mut bytes = bytes[..LABEL_BYTES].to_vec();
    bytes.extend(records.iter().flat_map(Record::to_bytes));
    File::from_bytes(bytes, Path::new("AP19117L.B"))
}

#[test]
fn rules_differ_where_the_program_slips_and_nowhere_else() {
    let all = preferences("T\n");
    let both = |file: &File, preferences: &Preferences| {
        [Rules::Program, Rules::PerShot].map(|rules| {
            table(
                std::slice::from_ref(file),
                preferences,
                Variant::Team,
                rules,
            )
        })
    };
    let good = file(|_| ());
    let [program, per_shot] = both(&good, &all);
    assert!(program == per_shot && program.lines().count() > 1_000);

    // A window: whole frames by their mid-point, or every shot by itself.
    let latitude_deg = |line: &str| line[9..19].trim().parse::<f64>().unwrap();
    let middle = latitude_deg(program.lines().nth(program.lines().count() / 2).unwrap());
    let window = Preferences {
        latitude_deg: [middle - 0.5, middle + 0.5],
        ..all.clone()
    };
    let [program, per_shot] = both(&good, &window);
    let outside = |table: &str| {
        let lines = table.lines().skip(2).map(latitude_deg);
        lines
            .filter(|latitude| (latitude - middle).abs() > 0.5 + 1e-5)
            .count()
    };
    assert!(outside(&program) > 0);
    assert_eq!(outside(&per_shot), 0);

    // A frame without residual: the program goes on subtracting the last one.
    let gated = file(|records| {
        for record in &mut records[60..] {
            record.orbit_quality.set(1);
        }
    });
    let [program, per_shot] = both(&gated, &all);
    let radius_m = |table: &str| {
        table.lines().last().unwrap()[40..52]
            .trim()
            .parse::<f64>()
            .unwrap()
    };
    let last = gated.records().last().unwrap();
    let raw_m = f64::from(last.shot_radius_cm[19].get()) * 0.01;
    assert!((radius_m(&per_shot) - raw_m).abs() < 1e-6); // whole centimetres are printed
    assert!((radius_m(&program) - raw_m).abs() > 0.02);

    // A bad record is printed, or left out.
    let bad = file(|records| records[30].mid_radius_cm.set(0));
    let [program, per_shot] = both(&bad, &all);
    let lost = program.lines().count() - per_shot.lines().count();
    assert!((1..=20).contains(&lost), "{lost} lines");
}

#[test]
fn tables_take_neither_the_place_of_each_other_nor_of_an_input() {
    let folder = tempfile::tempdir().unwrap();
    let place = |name: &str| folder.path().join(name);
    fs::create_dir(place("other")).unwrap();
    fs::write(place("other/AP00002L.B"), data(FILES[1])).unwrap();
    let one_each = "T\nT\nF\nF\nF\nF\nF\nF\nF\nF\nT\nT\nF, 'x.TAB'\n";
    fs::write(place("own.prm"), one_each).unwrap();
    let own = ["--preferences", "own.prm"];
    let (code, said) = run_tab(folder.path(), "AP00002L.B\nother/AP00002L.B\n", &own);
    assert_eq!(code, Some(2), "{said}");
    assert!(
        said.contains("AP00002L.TAB: would be the table of AP00002L.B and of other/AP00002L.B"),
        "{said}"
    );
    assert!(!place("AP00002L.TAB").exists());

    // The extension of each table, the name of the one table, and the list itself.
    fs::write(place("b.prm"), one_each.replace("x.TAB", "x.B")).unwrap();
    let one = one_each.replace("F, 'x.TAB'", "T, 'AP00005J.B'");
    fs::write(place("one.prm"), &one).unwrap();
    fs::write(place("list.prm"), one.replace("AP00005J.B", "FILELIST")).unwrap();
    fs::write(place("self.prm"), one.replace("AP00005J.B", "self.prm")).unwrap();
    for preferences in ["b.prm", "one.prm", "list.prm", "self.prm"] {
        let before = fs::read(place(preferences)).unwrap();
        let list = FILES.join("\n");
        let (code, said) = run_tab(folder.path(), &list, &["--preferences", preferences]);
        assert_eq!(code, Some(2), "{said}");
        assert!(said.contains("would be written over"), "{said}");
        for name in FILES {
            assert!(
                fs::read(place(name)).unwrap() == data(name),
                "{preferences}"
            );
        }
        assert_eq!(fs::read_to_string(place("FILELIST")).unwrap(), list);
        assert!(fs::read(place(preferences)).unwrap() == before);
    }
}

#[test]
fn preferences_that_are_named_are_there_and_their_faults_have_a_line() {
    let folder = tempfile::tempdir().unwrap();
    let (code, said) = run_tab(folder.path(), "", &[FILES[0], "--preferences", "typo.prm"]);
    assert_eq!(code, Some(3), "{said}");
    assert!(said.contains("typo.prm: cannot read"), "{said}");
    assert!(!folder.path().join("AP00002L.TAB").exists());
    // The usual ones may be absent.
    fs::create_dir(folder.path().join("bare")).unwrap();
    fs::write(folder.path().join("bare/AP00002L.B"), data(FILES[0])).unwrap();
    let mut command = common::mission::areograph();
    command.current_dir(folder.path().join("bare"));
    let output = command.args(["pedr", "tab", FILES[0]]).output().unwrap();
    assert!(output.status.success());
    assert!(folder.path().join("bare/AP00002L.TAB").exists());

    let told = |text: &str| {
        let ended = preferences(text).ended;
        ended.map_or_else(String::new, |ended| ended.to_string())
    };
    assert_eq!(
        told("T\nT\nmaybe\n"),
        "line 3 contains \"maybe\"; expected T or F"
    );
    assert_eq!(told("T\nT"), "ends after line 2; expected T or F");
    let limits = "T\n12*T\n".to_owned() + &"T\n".repeat(10) + "T 'x.TAB'\n-360.\nnan\n";
    assert_eq!(
        told(&limits.replacen("12*T", "T", 1)),
        "line 15 contains \"nan\"; expected a number of degrees"
    );
}

#[test]
fn a_window_whose_west_is_above_its_east_crosses_the_end_of_the_turn() {
    let whole = preferences("T\n");
    let file = file(|_| ());
    let lines = |longitude_deg: [f64; 2]| -> Vec<String> {
        let window = Preferences {
            longitude_deg,
            ..whole.clone()
        };
        let table = table(
            std::slice::from_ref(&file),
            &window,
            Variant::Team,
            Rules::PerShot,
        );
        table.lines().skip(2).map(str::to_owned).collect()
    };
    let longitude_deg = |line: &String| line[..9].trim().parse::<f64>().unwrap();
    let all = lines([0.0, 360.0]);
    let (west_deg, east_deg) = (
        all.iter().map(longitude_deg).fold(360.0, f64::min),
        all.iter().map(longitude_deg).fold(0.0, f64::max),
    );
    let middle_deg = 0.5 * (west_deg + east_deg);
    // From the middle of the track across 0° to just west of it: what lies east of the middle.
    let across = lines([middle_deg, west_deg - 1.0]);
    let east: Vec<String> = all
        .iter()
        .filter(|line| longitude_deg(line) > middle_deg)
        .cloned()
        .collect();
    assert!(!east.is_empty() && east.len() < all.len());
    assert_eq!(across, east);
    assert_eq!(lines([350.0, 349.0]).len(), all.len());
}
