//! No command replaces a file that areograph did not write as such a file itself; own earlier outputs are replaced.
#![allow(
    clippy::disallowed_methods,
    clippy::unwrap_used,
    reason = "helpers of tests work in temporary folders and may fail loudly"
)]

use std::{
    fs,
    path::Path,
    process::{Command, Output},
};

use areograph::{
    body::Datum,
    pds::image_file::{Coding, Predictor, encode},
};
use areograph_testing::track;

use crate::common::{
    case::Case,
    mission::{areograph, succeed},
    moc_file::new_image,
};

fn program(folder: &Path, arguments: &[&str]) -> Output {
    let mut command = areograph();
    command.current_dir(folder).arg("--quiet").args(arguments);
    command.output().unwrap()
}

/// The command is refused, and the file stays as it is.
fn assert_refused(folder: &Path, file: &str, arguments: &[&str]) {
    let before = fs::read(folder.join(file)).unwrap();
    let output = program(folder, arguments);
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{arguments:?}: {message}");
    assert!(
        message.contains(&format!("{file}: is ")),
        "{arguments:?}: {message}"
    );
    assert!(message.contains("what to do: "), "{message}");
    assert!(
        fs::read(folder.join(file)).unwrap() == before,
        "{arguments:?}"
    );
}

/// The command succeeds twice, and the second time over its own output.
fn assert_repeats(folder: &Path, arguments: &[&str]) {
    for time in ["first", "second"] {
        let output = program(folder, arguments);
        let message = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{time} {arguments:?}: {message}");
    }
}

/// Files of every kind that a command reads.
fn inputs(folder: &Path) -> Vec<&'static str> {
    let texts = [
        ("nav.tm", "KPL/MK\n\\begindata\n"),
        ("mgs.bsp", "DAF/SPK \u{2}"),
        ("image.lbl", "INSTRUMENT_ID = MOC-NA\nEND\n"),
        ("site.toml", "site = \"a\"\n"),
        ("ties.csv", "point_id,serial_number,sample,line\n"),
        ("page.html", "<!DOCTYPE html>\n<p>mine</p>\n"),
        (
            "shots.geojson",
            "{\"type\": \"FeatureCollection\", \"features\": []}\n",
        ),
        ("shots.parquet", "PAR1 mine PAR1"),
        ("dark.png", "\u{89}PNG\r\n\u{1a}\nSoftware"),
    ];
    for (name, text) in texts {
        fs::write(folder.join(name), text).unwrap();
    }
    let mut names = texts.map(|(name, _)| name).to_vec();
    track::write(&folder.join("ap19020l.b"), Datum::Iau2000, 0, |_, _| ());
    names.push("ap19020l.b");
    succeed(
        areograph()
            .current_dir(folder)
            .args(["--quiet", "pedr", "index", "."]),
    );
    names.push("areograph-pedr.index");
    names
}

const BOX: &str = "--box=-180,180,-60,60";

#[test]
fn a_search_replaces_only_its_own_answers() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    for file in inputs(folder) {
        let ending = Path::new(file).extension().unwrap().to_str().unwrap();
        let formats = match ending {
            "csv" | "geojson" | "parquet" => vec![ending],
            _ => vec!["csv", "geojson", "parquet"],
        };
        for format in formats {
            let search = [
                "pedr",
                "search",
                "ap19020l.b",
                BOX,
                "--format",
                format,
                "--out",
            ];
            let output = program(folder, &[&search[..], &[file]].concat());
            if file == "ap19020l.b" {
                // The input of this search; refused by name.
                assert_eq!(output.status.code(), Some(2));
                continue;
            }
            assert_refused(folder, file, &[&search[..], &[file]].concat());
        }
    }
    for out in ["a.parquet", "a.geojson", "a.csv"] {
        assert_repeats(folder, &["pedr", "search", "ap19020l.b", BOX, "--out", out]);
    }
    // A search for other shots as well.
    let other = [
        "pedr",
        "search",
        "ap19020l.b",
        "--box=0,170,-60,60",
        "--out",
        "a.csv",
    ];
    assert_repeats(folder, &other);
    // The request beside a table is a file of its own, and an answer that was edited is not one of areograph.
    fs::write(folder.join("b.csv.json"), "{\"areograph\": 1}").unwrap();
    let search = ["pedr", "search", "ap19020l.b", BOX, "--out"];
    assert_refused(folder, "b.csv.json", &[&search[..], &["b.csv"]].concat());
    let edited = fs::read_to_string(folder.join("a.csv")).unwrap() + "mine\n";
    fs::write(folder.join("a.csv"), edited).unwrap();
    assert_refused(folder, "a.csv", &[&search[..], &["a.csv"]].concat());
}

#[test]
fn tables_indexes_and_manual_pages_replace_only_their_own() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    inputs(folder);
    let tab = ["pedr", "tab", "ap19020l.b", "--per-shot", "--out", "tables"];
    assert_repeats(folder, &tab);
    let table = fs::read_dir(folder.join("tables")).unwrap();
    let table = table.map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let table = table
        .filter(|name| !name.starts_with('.'))
        .collect::<Vec<_>>()
        .concat();
    let table = format!("tables/{table}");
    fs::write(folder.join(&table), "1 2 3\n").unwrap();
    assert_refused(folder, &table, &tab);

    assert_repeats(folder, &["pedr", "index", "."]);
    fs::write(folder.join("areograph-pedr.index"), "an index of mine").unwrap();
    assert_refused(folder, "./areograph-pedr.index", &["pedr", "index", "."]);

    fs::create_dir(folder.join("man")).unwrap();
    assert_repeats(folder, &["man", "man"]);
    assert!(folder.join("man/areograph-run.1").is_file());
    fs::write(folder.join("man/areograph-run.1"), "notes").unwrap();
    fs::remove_file(folder.join("man/areograph.1")).unwrap();
    assert_refused(folder, "man/areograph-run.1", &["man", "man"]);
    assert!(!folder.join("man/areograph.1").exists());
}

#[test]
fn pictures_replace_only_their_own() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let coding = Coding::Predictive {
        predictor: Predictor::X,
        table: 3,
    };
    let pixels = vec![90; 640 * 320];
    let image = new_image(640, 1, &pixels, coding);
    fs::write(folder.join("image.imq"), encode(&image).unwrap()).unwrap();
    for out in ["a.png", "a.tif"] {
        let extract = [
            "image",
            "extract",
            "image.imq",
            "--out",
            out,
            "--mask",
            "mask.png",
        ];
        assert_repeats(folder, &extract);
        // An edited picture keeps neither mark nor bytes.
        for bytes in [b"\x89PNG\r\n\x1a\n mine".as_slice(), b"II*\0 mine"] {
            fs::write(folder.join(out), bytes).unwrap();
            assert_refused(folder, out, &extract);
        }
    }
    fs::write(folder.join("mask.png"), "mine").unwrap();
    let extract = [
        "image",
        "extract",
        "image.imq",
        "--out",
        "b.png",
        "--mask",
        "mask.png",
    ];
    assert_refused(folder, "mask.png", &extract);
    assert!(!folder.join("b.png").exists());
}

fn run(case: &Case, arguments: &[&str]) -> String {
    let mut command: Command = case.run();
    command.args(arguments);
    case.outcome(command)
}

#[test]
fn a_run_replaces_only_products_and_pages() {
    let case = Case::new();
    fs::create_dir_all(case.path("out/case")).unwrap();
    // Refused before any stage runs.
    case.write("out/index.html", "my page");
    let refused = run(&case, &[]);
    assert!(
        refused.starts_with("exit 2\nerror: out/index.html: is a file"),
        "{refused}"
    );
    assert!(!case.path("out/case/.lock").exists());
    fs::remove_file(case.path("out/index.html")).unwrap();
    // Files in the places of products, a manifest of another program, a folder of incomplete files.
    for file in ["footprints.parquet", "manifest.json"] {
        let path = format!("out/case/{file}");
        case.write(&path, "{\"name\": \"mine\"}");
        for arguments in [&[][..], &["--force"]] {
            let refused = run(&case, arguments);
            let expected =
                format!("exit 2\nerror: case/publish: {path}: occupies the path of a product");
            assert!(refused.starts_with(&expected), "{refused}");
            assert_eq!(case.read(&path), b"{\"name\": \"mine\"}");
            assert!(!case.path("out/case/ranges.json").exists());
        }
        fs::remove_file(case.path(&path)).unwrap();
    }
    fs::create_dir_all(case.path("out/case/.staging")).unwrap();
    case.write("out/case/.staging/notes.txt", "mine");
    let refused = run(&case, &[]);
    assert!(refused.starts_with("exit 6\n"), "{refused}");
    assert_eq!(case.read("out/case/.staging/notes.txt"), b"mine");
    fs::remove_dir_all(case.path("out/case/.staging")).unwrap();
    case.write("out/case/notes.txt", "mine");
    case.write("out/case/.lock", "mine");
    assert!(run(&case, &[]).starts_with("exit 0\n"));
    for file in ["out/case/notes.txt", "out/case/.lock"] {
        assert_eq!(case.read(file), b"mine", "{file}");
    }
}

#[test]
fn products_heal_without_their_manifest() {
    let case = Case::new();
    assert!(run(&case, &[]).starts_with("exit 0\n"));
    let products = || crate::common::mission::products(&case.path("out/case"));
    let whole = products();
    let manifest = "out/case/manifest.json";
    let spoil: [(&str, &dyn Fn()); 4] = [
        ("lost", &|| fs::remove_file(case.path(manifest)).unwrap()),
        ("cut", &|| case.truncate(manifest, 3_000)),
        ("lost with the cache", &|| {
            fs::remove_file(case.path(manifest)).unwrap();
            fs::remove_dir_all(case.path("out/case/.cache")).unwrap();
        }),
        ("damaged product", &|| {
            case.write("out/case/ranges.json", "{}");
        }),
    ];
    for (what, spoil) in spoil {
        spoil();
        let outcome = run(&case, &[]);
        assert!(outcome.starts_with("exit 0\n"), "{what}: {outcome}");
        assert!(products().keys().eq(whole.keys()), "{what}");
        let ranges = Path::new("ranges.json");
        assert!(products().get(ranges) == whole.get(ranges), "{what}");
    }
}
