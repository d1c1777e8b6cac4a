//! The range check of an archive, against the truth of an invented one.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    clippy::disallowed_methods,
    clippy::float_cmp,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "helpers of tests work in temporary folders and may fail loudly; numbers that are compared are counts"
)]

use crate::common;

use std::{
    collections::BTreeMap,
    fs,
    ops::Range,
    os::unix::fs::symlink,
    path::{Path, PathBuf},
    process::Command,
    sync::{Arc, LazyLock, atomic::AtomicBool},
};

use areograph::{
    constants::SPACECRAFT,
    flow::{ArchiveRequest, Observer, StageEvent, Task, archive_filter, archive_limits},
    footprints::Footprint,
    geom::{
        orbit_axes::radial_along_cross,
        range_residuals::{RangeResiduals, SpacecraftState},
    },
    pds::pedr::{FieldGuard, Reader},
    scene::{ArchiveOptions, write_archive},
    spice::{KernelSet, Session, SpkSegment, State, write_spk},
    stages::check_archive::{ArchiveProfile, ArchiveRules, ArchiveSource, FileCheck, shots_of},
    time::Et,
    watch::Watch,
};
use common::{
    assert_keeps_schema,
    flows::run_observed,
    json,
    mission::{areograph, products, succeed},
};
use serde_json::Value;
use tempfile::TempDir;

/// Three files, each with a bad revolution of another kind.
static ARCHIVE: LazyLock<TempDir> = LazyLock::new(|| {
    let folder = tempfile::tempdir_in(env!("CARGO_TARGET_TMPDIR")).unwrap();
    let options = ArchiveOptions { seed: 1, days: 3 };
    write_archive(
        &folder.path().join("archive"),
        &options,
        Watch::from(&AtomicBool::new(false)),
    )
    .unwrap();
    folder
});

/// Its products.
static CHECKED: LazyLock<TempDir> = LazyLock::new(|| {
    let out = tempfile::tempdir_in(env!("CARGO_TARGET_TMPDIR")).unwrap();
    assert_eq!(ended(&mut qa(&pedr(), &kernels(), out.path())).0, 5);
    out
});

fn archive() -> PathBuf {
    ARCHIVE.path().join("archive")
}

fn pedr() -> PathBuf {
    archive().join("pedr")
}

fn kernels() -> PathBuf {
    archive().join("kernels/archive.tm")
}

fn qa(pedr: &Path, kernels: &Path, out: &Path) -> Command {
    let mut command = areograph();
    command.args(["--quiet", "pedr", "qa"]).arg(pedr);
    command.arg("--kernels").arg(kernels).arg("--out").arg(out);
    command
}

/// Exit code, standard output and standard error.
fn ended(command: &mut Command) -> (i32, String, String) {
    let output = command.output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    let code = output.status.code().unwrap();
    (code, text(output.stdout), text(output.stderr))
}

/// Rows of profiles.csv by `file/orbit`, their values by column; the last column, which has commas, is the last.
fn rows(out: &Path) -> BTreeMap<String, BTreeMap<String, String>> {
    let text = fs::read_to_string(out.join("profiles.csv")).unwrap();
    let mut lines = text.lines();
    let names: Vec<&str> = lines.next().unwrap().split(',').collect();
    let row = |line: &str| {
        let values = line.splitn(names.len(), ',').map(str::to_owned);
        let row: BTreeMap<String, String> = names
            .iter()
            .map(|name| (*name).to_owned())
            .zip(values)
            .collect();
        (format!("{}/{}", row["file"], row["orbit"]), row)
    };
    lines.map(row).collect()
}

fn number(row: &BTreeMap<String, String>, column: &str) -> f64 {
    row[column].trim_matches('"').parse().unwrap()
}

/// Whether two rows of a profile say the same. Tables of the trajectory begin where the file begins: of other neighbours
/// they differ by less than their bound of 1 mm, in fact by 1e-5 m.
fn agree(one: &BTreeMap<String, String>, other: &BTreeMap<String, String>) -> bool {
    one.iter().zip(other).all(
        |((name, a), (_, b))| match (a.parse::<f64>(), b.parse::<f64>()) {
            (Ok(a), Ok(b)) => (a - b).abs() < 1e-4,
            _ => a == b && !name.is_empty(),
        },
    )
}

fn bad_profiles() -> BTreeMap<String, Value> {
    let truth = json(&archive().join("truth.json"));
    let bad = truth["bad_profiles"].as_array().unwrap();
    bad.iter()
        .map(|of| {
            let id = format!("{}/{}", of["file"].as_str().unwrap(), of["orbit"]);
            (id, of["what"].clone())
        })
        .collect()
}

#[test]
fn bad_revolutions_are_found_and_no_other_is() {
    let rows = rows(CHECKED.path());
    let bad = bad_profiles();
    assert_eq!((rows.len(), bad.len()), (36, 3));
    for (id, row) in &rows {
        let is_told = !row["invalid_because"].is_empty();
        assert_eq!(is_told, bad.contains_key(id), "{id}: {row:?}");
    }
    let least_bad = bad.keys().map(|id| number(&rows[id], "share_of_limits"));
    let least_bad = least_bad.fold(f64::INFINITY, f64::min);
    let good = rows.iter().filter(|(id, _)| !bad.contains_key(*id));
    for (id, row) in good {
        assert!(number(row, "share_of_limits") < 0.1 * least_bad, "{id}");
        // Noise of 1 m, steps of 0.375 m and the crossover residual of 0.57 m (root mean square) make 1.16 m; of 60,000
        // shots the NMAD is known to 1 %, and the residual is no noise.
        assert!((number(row, "nmad_m") - 1.16).abs() < 0.05, "{id}");
        // 0.8 m of crossover over 2.4 of its periods leave 0.11 m.
        assert!(number(row, "mean_m").abs() < 0.15, "{id}");
        assert!(number(row, "crossover_mean_m").abs() < 0.03, "{id}");
        assert!(number(row, "decoding_mean_m").abs() < 0.03, "{id}");
    }
    for (id, what) in &bad {
        let row = &rows[id];
        let near = |column: &str, value: f64, within: f64| {
            let found = number(row, column);
            assert!((found - value).abs() < within, "{id} {column}: {found}");
        };
        if let Some(range_m) = what["range_m"].as_f64() {
            near("decoding_mean_m", range_m, 0.03);
            near("mean_m", range_m, 0.15);
        } else if let Some(orbit_m) = what["orbit_m"].as_f64() {
            near("spacecraft_radial_m", orbit_m, 0.15);
            near("mean_m", orbit_m, 0.15);
        } else {
            // Late tags: the spacecraft of the kernels has flown on, 3.38 km/s.
            let late_s = what["time_s"].as_f64().unwrap();
            near("spacecraft_along_m", -3_380.0 * late_s, 20.0);
        }
    }
}

#[test]
fn the_clock_is_found_within_its_uncertainty() {
    let truth = json(&archive().join("truth.json"));
    let bias_s = truth["mola_clock_bias_s"].as_f64().unwrap();
    let bad = bad_profiles();
    let (mut squares, mut sigmas_s) = (Vec::new(), Vec::new());
    for (id, row) in rows(CHECKED.path()) {
        let late_s = bad.get(&id).and_then(|what| what["time_s"].as_f64());
        let error_s = number(&row, "best_correction_s") + bias_s + late_s.unwrap_or(0.0);
        let sigma_s = number(&row, "best_correction_sigma_s");
        // The wave of the crossover residual is over the whole revolution.
        assert_eq!(row["best_correction_radius"], "crossover", "{id}");
        // Informative: a revolution tells the clock to some hundredths of a second.
        assert!(sigma_s < 0.05, "{id}: {sigma_s}");
        sigmas_s.push(sigma_s);
        assert!(error_s.abs() < 4.0 * sigma_s, "{id}: {error_s} ±{sigma_s}");
        squares.push((error_s / sigma_s).powi(2));
    }
    // Most of them to some milliseconds: the wave of the crossover residual does not count in them.
    sigmas_s.sort_by(f64::total_cmp);
    assert!(sigmas_s[18] < 0.005, "{}", sigmas_s[18]);
    // Of 36 normal numbers the root mean square lies within 0.7 to 1.4 in all but 0.3 % of cases. The uncertainty is the
    // larger of two estimates, and so a little too large: over the 180 profiles of 15 days the root mean square is 0.87.
    let rms = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
    assert!((0.6..1.4).contains(&rms), "{rms}");
}

/// The rules of the command.
macro_rules! rules {
    ($rules:ident) => {
        let (limits, filter) = (archive_limits(), archive_filter());
        let clock = areograph::altimetry::MolaClock {
            bias_s: 0.117,
            sign: areograph::altimetry::TagSign::Late,
            scope: areograph::altimetry::BiasScope::SpkLookup,
            source: String::new(),
        };
        let $rules = ArchiveRules {
            clock: &clock,
            limits: &limits,
            filter: &filter,
        };
    };
}

/// The profiles of a file, by the stage itself.
fn checked(path: &Path, session: &Session, rules: &ArchiveRules<'_>) -> Vec<ArchiveProfile> {
    let source = Arc::new(ArchiveSource::open(path).unwrap());
    let mut check = FileCheck::new(Arc::clone(&source), *rules);
    let mut found = None;
    for rows in source.loads() {
        found = check
            .add(&source.load(rows, session, rules).unwrap())
            .unwrap();
    }
    found.unwrap().profiles
}

/// Positions by CSPICE at every shot, the slow way.
#[test]
fn tabulated_positions_are_those_of_cspice_at_every_shot() {
    rules!(rules);
    let path = pedr().join("ap10013l.b");
    let session = Session::open(&KernelSet::from_metakernel(&kernels()).unwrap()).unwrap();
    let identity = ArchiveSource::open(&path).unwrap().identity();
    // The revolution that looks aside, by up to 18°.
    let profiles = checked(&path, &session, &rules);
    let aside = profiles
        .iter()
        .find(|of| of.off_nadir_rad[1] > 0.3)
        .unwrap();
    let shots = shots_of(&path, &identity, aside, &session, &rules).unwrap();
    assert_eq!(shots.len(), aside.shots as usize);
    let reader = Reader::open(&path).unwrap();
    let rows = 0..reader.head().record_count();
    let stretch = reader.stretch(rows.clone(), Vec::new()).unwrap();
    let mut frames = BTreeMap::new();
    for (row, frame) in stretch.frames(rows, FieldGuard::new(None)) {
        frames.insert(stretch.record_number(row), frame.unwrap());
    }
    let mut largest_m = 0.0_f64;
    for checked in shots.iter().step_by(7) {
        let shot: Footprint = frames[&checked.record].shot(checked.shot).unwrap();
        let at = rules.clock.spacecraft_time(shot.et_tag_s);
        let state = session.state(at).unwrap();
        let craft = SpacecraftState::of(at, &state.position, &state.velocity_m_s);
        let slow = RangeResiduals::of(&shot, &craft);
        let fast = checked.residuals.unwrap();
        let differences = [
            slow.range_minus_distance_m - fast.range_minus_distance_m,
            slow.range_minus_distance_crossover_m - fast.range_minus_distance_crossover_m,
            slow.decoding_m - fast.decoding_m,
            (slow.spacecraft_m - fast.spacecraft_m).norm(),
        ];
        largest_m = differences.iter().fold(largest_m, |a, b| a.max(b.abs()));
    }
    // A tenth of the bound that the product states: tables within 1 mm, and 1e-6 m for cubics within a frame.
    assert!(largest_m < 1e-4, "{largest_m}");
}

/// The same shots give the same figures in a site.
#[test]
fn a_site_has_the_same_means() {
    rules!(rules);
    let folder = tempfile::tempdir().unwrap();
    let path = pedr().join("ap10025l.b");
    let site = format!(
        "site = \"strip\"\n[kernels]\nmetakernel = {:?}\n[pedr]\nfiles = [{:?}]\n[[windows]]\nid = \"window\"\n\
         longitude_deg = [0.0, 359.0]\nlatitude_deg = [20.0, 30.0]\n",
        kernels(),
        path
    );
    let file = folder.path().join("strip.toml");
    fs::write(&file, site).unwrap();
    let out = folder.path().join("out");
    let mut run = areograph();
    run.args(["--quiet", "run"])
        .arg(&file)
        .arg("--out")
        .arg(&out);
    assert_eq!(ended(&mut run).0, 5); // the file has a bad revolution
    let ranges = json(&out.join("strip/ranges.json"));
    let session = Session::open(&KernelSet::from_metakernel(&kernels()).unwrap()).unwrap();
    let identity = ArchiveSource::open(&path).unwrap().identity();
    let mut compared = 0;
    for profile in checked(&path, &session, &rules) {
        let shots = shots_of(&path, &identity, &profile, &session, &rules).unwrap();
        let of_site = ranges["profiles"].as_array().unwrap().iter();
        for site in of_site.filter(|of| of["orbit"] == profile.orbit) {
            let [start_s, stop_s] =
                ["et_start_s", "et_stop_s"].map(|key| site[key].as_f64().unwrap());
            let within = |place: &[f64; 2]| {
                let [longitude, latitude] = place.map(f64::to_degrees);
                (0.0..=359.0).contains(&longitude) && (20.0..=30.0).contains(&latitude)
            };
            let own: Vec<f64> = shots
                .iter()
                .filter(|shot| (start_s..=stop_s).contains(&shot.et_s) && within(&shot.place_rad))
                .map(|shot| shot.residuals.unwrap().range_minus_distance_m)
                .collect();
            let expected = &site["range_minus_distance_m"];
            assert_eq!(expected["n"], own.len());
            let mean_m = own.iter().sum::<f64>() / own.len() as f64;
            // Two tables within 1 mm of one orbit, in fact within 1e-5 m.
            assert!((expected["mean"].as_f64().unwrap() - mean_m).abs() < 1e-5);
            compared += 1;
        }
    }
    assert_eq!(compared, ranges["profiles"].as_array().unwrap().len());
    assert!(compared > 20);
}

#[test]
fn products_keep_their_schemas_and_lead_to_the_shots() {
    let out = CHECKED.path();
    assert_keeps_schema(&json(&out.join("archive.json")), "archive_ranges");
    assert_keeps_schema(&json(&out.join("manifest.json")), "manifest");
    let page = fs::read_to_string(out.join("report/index.html")).unwrap();
    let links: Vec<&str> = page.split("href=\"../").skip(1).collect();
    assert_eq!(links.len(), 12);
    for link in links {
        assert!(out.join(link.split('"').next().unwrap()).is_file());
    }
    // The command line of the worst profile finds its shots, and no others.
    let command = page.split("areograph pedr search").nth(1).unwrap();
    let command = command.split('\n').next().unwrap().replace('\'', "");
    let arguments = command.split_whitespace().map(|argument| match argument {
        "parquet" => "count",
        other => other,
    });
    let arguments: Vec<&str> = arguments
        .take_while(|argument| *argument != "--out")
        .collect();
    let found = succeed(
        areograph()
            .args(["--quiet", "pedr", "search", "--json"])
            .args(arguments),
    );
    let found: Value = serde_json::from_slice(&found.stdout).unwrap();
    let rows = rows(out);
    let worst = rows
        .values()
        .max_by(|a, b| number(a, "share_of_limits").total_cmp(&number(b, "share_of_limits")));
    assert_eq!(
        found["rows"].as_f64().unwrap(),
        number(worst.unwrap(), "shots")
    );
}

#[test]
fn any_number_of_threads_gives_the_same_bytes() {
    let one = tempfile::tempdir().unwrap();
    let mut command = qa(&pedr(), &kernels(), one.path());
    assert_eq!(ended(command.args(["--threads", "1"])).0, 5);
    assert_eq!(products(one.path()), products(CHECKED.path()));
}

/// Number of files whose results are stored in a folder of products.
fn stored(out: &Path) -> usize {
    let entries = fs::read_dir(out.join(".cache")).into_iter().flatten();
    let names = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap());
    names
        .filter(|name| name.starts_with("check_archive+"))
        .count()
}

#[test]
fn a_killed_check_goes_on_and_ends_the_same() {
    let out = tempfile::tempdir().unwrap();
    let mut child = qa(&pedr(), &kernels(), out.path()).spawn().unwrap();
    while stored(out.path()) == 0 && child.try_wait().unwrap().is_none() {
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(!out.path().join("manifest.json").exists());
    let kept = stored(out.path());
    assert!((1..3).contains(&kept), "{kept}");
    let planned = |word: &str| {
        let mut command = areograph();
        command.args(["-v", "pedr", "qa", "--plan"]).arg(pedr());
        command.arg("--kernels").arg(kernels());
        let (code, plan, _) = ended(command.arg("--out").arg(out.path()));
        assert_eq!(code, 0);
        let file = format!("{word}  check_archive/");
        plan.lines().filter(|line| line.contains(&file)).count()
    };
    assert_eq!([planned("keep"), planned("run ")], [kept, 3 - kept]);
    assert_eq!(ended(&mut qa(&pedr(), &kernels(), out.path())).0, 5);
    assert_eq!([planned("keep"), planned("run ")], [3, 0]);
    assert_eq!(products(out.path()), products(CHECKED.path()));
    // Once more: everything stands.
    let (_, answer, _) = ended(&mut qa(&pedr(), &kernels(), out.path()));
    assert!(
        answer.starts_with("archive: INVALID, nothing changed"),
        "{answer}"
    );
}

#[test]
fn damaged_files_are_told_and_the_rest_is_checked() {
    let folder = tempfile::tempdir().unwrap();
    let files = folder.path().join("pedr");
    fs::create_dir(&files).unwrap();
    symlink(pedr().join("ap10013l.b"), files.join("ap10013l.b")).unwrap();
    let whole = fs::read(pedr().join("ap10001l.b")).unwrap();
    fs::write(files.join("ap10001l.b"), &whole[..20_000_000]).unwrap();
    fs::write(files.join("ap19999l.b"), "no PEDR file\n".repeat(2_000)).unwrap();
    fs::write(files.join("ap19998l.b"), "").unwrap();
    symlink("nowhere", files.join("ap19997l.b")).unwrap();
    let out = folder.path().join("out");
    let (code, answer, told) = ended(&mut qa(&files, &kernels(), &out));
    assert_eq!(code, 5);
    for name in ["ap19999l.b", "ap19998l.b", "ap19997l.b"] {
        assert!(told.contains(name), "{told}");
    }
    assert!(
        answer.contains("invalid: 3 files or folders could not be read: "),
        "{answer}"
    );
    let document = json(&out.join("archive.json"));
    assert_eq!(document["failures"].as_array().unwrap().len(), 3);
    assert_eq!(document["files"].as_array().unwrap().len(), 2);
    assert_eq!(document["files"][0]["complaint_count"], 1); // bytes after the last whole record
    let (found, whole) = (rows(&out), rows(CHECKED.path()));
    for (id, row) in found.iter().filter(|(id, _)| id.starts_with("ap10013l")) {
        assert!(agree(row, &whole[id]), "{id}");
    }
    assert!(agree(&found["ap10001l.b/2"], &whole["ap10001l.b/2"]));
}

/// A file of two days takes two loads; a revolution lies across their border.
#[test]
fn a_file_that_is_longer_than_a_load_says_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let files = folder.path().join("pedr");
    fs::create_dir(&files).unwrap();
    let [mut bytes, next] =
        ["ap10001l.b", "ap10013l.b"].map(|name| fs::read(pedr().join(name)).unwrap());
    bytes.extend_from_slice(&next[7_760..]); // without its label
    assert!(bytes.len() > 7_760 + 776 * 65_536);
    fs::write(files.join("ap10001l.b"), bytes).unwrap();
    let out = folder.path().join("out");
    assert_eq!(ended(&mut qa(&files, &kernels(), &out)).0, 5);
    let (found, whole) = (rows(&out), rows(CHECKED.path()));
    assert_eq!(found.len(), 24);
    for row in found.values() {
        let other = whole.values().find(|of| of["orbit"] == row["orbit"]);
        let (mut row, mut other) = (row.clone(), other.unwrap().clone());
        // The scan takes other shots where records have other numbers.
        for column in [
            "file",
            "first_record",
            "last_record",
            "best_correction_s",
            "best_correction_sigma_s",
        ] {
            row.remove(column);
            other.remove(column);
        }
        assert!(agree(&row, &other), "{row:?} {other:?}");
    }
}

#[test]
fn what_kernels_do_not_cover_is_told() {
    let folder = tempfile::tempdir().unwrap();
    // The same archive, but for its last two days, has the same kernels for the first.
    let first = folder.path().join("first");
    write_archive(
        &first,
        &ArchiveOptions { seed: 1, days: 1 },
        Watch::from(&AtomicBool::new(false)),
    )
    .unwrap();
    let out = folder.path().join("out");
    let told = "23 of 36 profiles could not be checked, and 1 only in part";
    let mut command = qa(&pedr(), &first.join("kernels/archive.tm"), &out);
    let (code, answer, _) = ended(&mut command);
    assert_eq!(code, 5);
    let is_told = |answer: &str, word: &str| {
        let mut lines = answer.lines();
        lines.any(|line| line.trim().starts_with(word) && line.contains(told))
    };
    assert!(is_told(&answer, "invalid:"), "{answer}");
    // Allowed, it no longer counts, whatever else is wrong.
    let (_, answer, _) = ended(command.arg("--allow-uncovered"));
    assert!(is_told(&answer, "remark:"), "{answer}");
    assert!(!is_told(&answer, "invalid:"), "{answer}");
    let rows = rows(&out);
    let not_checked = rows.values().filter(|row| row["mean_m"].is_empty()).count();
    assert_eq!(not_checked, 23);
    let manifest = json(&out.join("manifest.json"));
    let lost = rows
        .values()
        .map(|row| number(row, "not_covered"))
        .sum::<f64>();
    assert_eq!(
        manifest["counts"]["shots_not_covered"].as_f64().unwrap(),
        lost
    );
    assert_eq!(manifest["counts"]["profiles_not_covered"], 23);
    // Shots without a position do not keep those that have one from being scanned.
    let partly = |row: &&BTreeMap<String, String>| {
        !row["mean_m"].is_empty() && number(row, "not_covered") > 0.0
    };
    let partly: Vec<_> = rows.values().filter(partly).collect();
    assert_eq!(partly.len(), 1);
    assert!(!partly[0]["best_correction_s"].is_empty());
    // What is covered is as before.
    let whole = self::rows(CHECKED.path());
    let same = rows
        .iter()
        .filter(|(id, row)| agree(row, &whole[*id]))
        .count();
    assert_eq!(same, 12);
}

/// Records of the first file, counted from 0 without its label, of a revolution without fault, that many.
fn sound_records(count: usize) -> Range<usize> {
    let bad = bad_profiles();
    let rows = rows(CHECKED.path());
    let sound = rows.iter().find(|(id, row)| {
        let [first, last] = ["first_record", "last_record"].map(|name| number(row, name));
        row["file"] == "ap10001l.b" && !bad.contains_key(*id) && last - first > count as f64
    });
    let first = number(sound.unwrap().1, "first_record") as usize - 11;
    first..first + count
}

/// Writes a file of some records of the first file, after a label of which a byte that says nothing is `mark`.
fn write_records(path: &Path, records: impl IntoIterator<Item = usize>, mark: u8) {
    let whole = fs::read(pedr().join("ap10001l.b")).unwrap();
    let (label, data) = whole.split_at(7_760);
    let mut bytes = label.to_vec();
    // The label is padded with blanks.
    bytes[7_000] = mark;
    for record in records {
        bytes.extend_from_slice(&data[776 * record..776 * (record + 1)]);
    }
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    fs::write(path, bytes).unwrap();
}

#[test]
fn every_shot_counts_once() {
    let folder = tempfile::tempdir().unwrap();
    let (files, out) = (folder.path().join("pedr"), folder.path().join("out"));
    let records = sound_records(1_200);
    let (first, second) = (
        records.start..records.start + 600,
        records.start + 600..records.end,
    );
    for (name, records) in [("a", &first), ("backup", &first), ("b", &second)] {
        let path = files.join(name).join("ap10001l.b");
        write_records(&path, records.clone(), b' ');
    }
    // The folder twice, and a file by itself.
    let mut command = qa(&files, &kernels(), &out);
    command.arg(&files).arg(files.join("b/ap10001l.b"));
    let (code, answer, told) = ended(&mut command);
    assert_eq!(code, 0, "{answer} {told}");
    assert!(
        answer.contains("copies of other files, counted once: 1"),
        "{answer}"
    );
    let document = json(&out.join("archive.json"));
    assert_eq!(document["copies"].as_array().unwrap().len(), 1);
    let found = rows(&out);
    // Two files of the same name with other shots: told apart in the table, and in the names of files.
    assert_eq!(found.len(), 2);
    for folder in ["/a/ap10001l.b", "/b/ap10001l.b"] {
        assert!(found.values().any(|row| row["file"].ends_with(folder)));
    }
    assert_eq!(fs::read_dir(out.join("shots")).unwrap().count(), 2);
    let shots: f64 = found.values().map(|row| number(row, "shots")).sum();
    let manifest = json(&out.join("manifest.json"));
    assert_eq!(manifest["counts"]["shots"].as_f64().unwrap(), shots);

    // Another version of half of them.
    let version = files.join("c/ap10001l.b");
    write_records(&version, first.start + 300..first.end, b'x');
    let (code, answer, told) = ended(&mut command);
    assert_eq!(code, 5);
    assert!(
        answer.contains("1 file or folder could not be read"),
        "{answer}"
    );
    for part in [
        "c/ap10001l.b",
        "a/ap10001l.b",
        "contains shots of orbit",
        "only one of the two",
    ] {
        assert!(told.contains(part), "{part}: {told}");
    }
    let manifest = json(&out.join("manifest.json"));
    assert!(manifest["counts"]["shots"].as_f64().unwrap() <= shots);
}

/// A block at the wrong place steps back in time: its shots are checked with their own times.
#[test]
fn a_displaced_block_is_checked_and_the_times_of_profiles_are_true() {
    rules!(rules);
    let folder = tempfile::tempdir().unwrap();
    let records = sound_records(1_500);
    let at = |from: usize, to: usize| records.start + from..records.start + to;
    let [whole, moved] = ["whole", "moved"].map(|name| folder.path().join(name).join("ap10001l.b"));
    write_records(&whole, at(0, 1_500), b' ');
    let parts = [at(0, 500), at(600, 1_000), at(500, 600), at(1_000, 1_500)];
    write_records(&moved, parts.into_iter().flatten(), b' ');
    let session = Session::open(&KernelSet::from_metakernel(&kernels()).unwrap()).unwrap();
    let [whole, found] = [&whole, &moved].map(|path| checked(path, &session, &rules));
    let shots = |of: &[ArchiveProfile]| of.iter().map(|of| of.shots).sum::<u32>();
    // Of the block the first record is complained of, and its shots left out.
    let lost = shots(&whole) - shots(&found);
    assert!((1..=20).contains(&lost), "{lost}");
    assert_eq!(whole.len(), 1);
    // What the block follows, the block, and what comes 800 s after it, more than a pause.
    assert_eq!(found.len(), 3);
    assert_eq!(found[0].start_et_s, whole[0].start_et_s);
    assert_eq!(found[2].stop_et_s, whole[0].stop_et_s);
    assert!(found[1].stop_et_s < found[0].stop_et_s);
    let identity = ArchiveSource::open(&moved).unwrap().identity();
    for profile in &found {
        assert!(profile.start_et_s < profile.stop_et_s);
        let shots = shots_of(&moved, &identity, profile, &session, &rules).unwrap();
        assert_eq!(shots.len(), profile.shots as usize);
    }
}

/// The request of the command.
macro_rules! request {
    ($request:ident, $pedr:expr, $kernels:expr) => {
        let (paths, kernels) = ([$pedr.clone()], $kernels);
        let $request = ArchiveRequest {
            paths: &paths,
            kernels: &kernels,
            clock: areograph::altimetry::MolaClock {
                bias_s: 0.117,
                sign: areograph::altimetry::TagSign::Late,
                scope: areograph::altimetry::BiasScope::SpkLookup,
                source: String::new(),
            },
            allow_uncovered: false,
            workers: None,
        };
    };
}

/// Acts when so many files were checked.
struct AtFile<F>(F);

impl<F> std::fmt::Debug for AtFile<F> {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        out.write_str("AtFile")
    }
}

impl<F: Fn(u64) + Sync> Observer for AtFile<F> {
    fn hear(&self, _stage: &str, event: &StageEvent<'_>) {
        if let StageEvent::Counts(count) = event {
            self.0(count.done);
        }
    }
}

#[test]
fn what_was_checked_with_a_kernel_that_changed_is_not_stored() {
    let folder = tempfile::tempdir().unwrap();
    let own = folder.path().join("kernels");
    fs::create_dir(&own).unwrap();
    for entry in fs::read_dir(archive().join("kernels")).unwrap() {
        let path = entry.unwrap().path();
        fs::copy(&path, own.join(path.file_name().unwrap())).unwrap();
    }
    let files = folder.path().join("pedr");
    let records = sound_records(600);
    for (part, name) in ["ap10001l.b", "ap10002l.b"].into_iter().enumerate() {
        let start = records.start + 300 * part;
        write_records(&files.join(name), start..start + 300, b' ');
    }
    let out = folder.path().join("out");
    request!(request, files, own.join("archive.tm"));
    let mut found = fs::read_dir(&own)
        .unwrap()
        .map(|entry| entry.unwrap().path());
    let leap_seconds = found.find(|path| path.extension().is_some_and(|of| of == "tls"));
    let leap_seconds = leap_seconds.unwrap();
    // While the second file is checked, a kernel that it may depend on changes.
    let change = AtFile(|files| {
        if files == 1 {
            let text = fs::read_to_string(&leap_seconds).unwrap() + "\nA comment.\n";
            fs::write(&leap_seconds, text).unwrap();
        }
    });
    let stop = AtomicBool::new(false);
    let ran = run_observed(Task::Archive(&request), &out, &change, &stop);
    let failure = ran.unwrap_err().to_string();
    assert!(
        failure.contains("the file changed while it was in use"),
        "{failure}"
    );
    assert_eq!(stored(&out), 1);
}

/// One file is replaced before it is checked, another one goes away after it was.
#[test]
fn files_that_change_or_go_away_are_told_and_do_not_end_the_check() {
    let folder = tempfile::tempdir().unwrap();
    let files = folder.path().join("pedr");
    let records = sound_records(900);
    let names = ["ap10001l.b", "ap10002l.b", "ap10003l.b"].map(|name| files.join(name));
    for (part, path) in names.iter().enumerate() {
        let start = records.start + 300 * part;
        write_records(path, start..start + 300, b' ');
    }
    let out = folder.path().join("out");
    request!(request, files, kernels());
    let meddle = AtFile(|done| {
        if done == 0 {
            let other = files.join("other");
            fs::copy(&names[1], &other).unwrap();
            fs::rename(other, &names[1]).unwrap();
        } else if done == 3 {
            fs::remove_file(&names[0]).unwrap();
        }
    });
    let stop = AtomicBool::new(false);
    let outcome = run_observed(Task::Archive(&request), &out, &meddle, &stop).unwrap();
    let told: Vec<String> = outcome.left_out.iter().map(ToString::to_string).collect();
    assert_eq!(told.len(), 2, "{told:#?}");
    assert!(
        told[0].contains("ap10002l.b") && told[0].contains("changed"),
        "{told:#?}"
    );
    assert!(told[1].contains("ap10001l.b"), "{told:#?}");
    assert!(!outcome.manifest().unwrap().verdict.valid);
    assert_eq!(rows(&out).len(), 2);
    // The profile stands in the page, without a link.
    let page = fs::read_to_string(out.join("report/index.html")).unwrap();
    assert!(page.contains("ap10001l.b/"));
    assert_eq!(page.matches("href=\"../shots").count(), 1);
}

#[test]
fn a_file_that_does_not_open_does_not_hide_the_others() {
    let folder = tempfile::tempdir().unwrap();
    let records = sound_records(40);
    let names = ["a.b", "missing.b", "c.b"].map(|name| folder.path().join(name));
    for path in [&names[0], &names[2]] {
        write_records(path, records.clone(), b' ');
    }
    let mut command = areograph();
    command
        .args(["--quiet", "pedr", "info", "--json"])
        .args(&names);
    let (code, answer, told) = ended(&mut command);
    assert_eq!(code, 3);
    assert!(told.contains("missing.b"), "{told}");
    let answers: Value = serde_json::from_str(&answer).unwrap();
    assert_eq!(answers.as_array().unwrap().len(), 2);
    // A PEDR file has positions of its own.
    for file in answers.as_array().unwrap() {
        assert!(file.get("nadir_by_range").is_none(), "{file}");
        assert!(file["range_minus_distance_m"].is_object(), "{file}");
    }
}

/// An archive whose kernels cover none of it is not valid.
#[test]
fn kernels_of_another_time_do_not_pass() {
    let folder = tempfile::tempdir().unwrap();
    let first = folder.path().join("first");
    write_archive(
        &first,
        &ArchiveOptions { seed: 1, days: 1 },
        Watch::from(&AtomicBool::new(false)),
    )
    .unwrap();
    let last = folder.path().join("pedr");
    fs::create_dir(&last).unwrap();
    symlink(pedr().join("ap10025l.b"), last.join("ap10025l.b")).unwrap();
    let out = folder.path().join("out");
    let (code, answer, _) = ended(&mut qa(&last, &first.join("kernels/archive.tm"), &out));
    assert_eq!(code, 5);
    assert!(answer.contains("no shot could be checked"), "{answer}");
}

/// No profile of the archive passes with kernels whose spacecraft flies elsewhere.
fn assert_displaced_kernels_do_not_pass(radial_along_cross_m: [f64; 3]) {
    let folder = tempfile::tempdir().unwrap();
    let kernels = displaced(&folder.path().join("kernels"), radial_along_cross_m);
    let out = folder.path().join("out");
    assert_eq!(ended(&mut qa(&pedr(), &kernels, &out)).0, 5);
    assert_no_profile_passes(&out);
}

fn assert_no_profile_passes(out: &Path) {
    let rows = rows(out);
    assert!(rows.values().all(|row| !row["invalid_because"].is_empty()));
}

#[test]
fn kernels_300_m_beside_the_orbit_do_not_pass() {
    assert_displaced_kernels_do_not_pass([0.0, 0.0, 300.0]);
}

#[test]
fn kernels_300_m_above_the_orbit_do_not_pass() {
    assert_displaced_kernels_do_not_pass([300.0, 0.0, 0.0]);
}

#[test]
fn another_clock_does_not_pass() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let mut command = qa(&pedr(), &kernels(), &out);
    assert_eq!(ended(command.args(["--clock-bias-s", "0"])).0, 5);
    assert_no_profile_passes(&out);
}

/// The kernels of the archive, their spacecraft moved.
fn displaced(folder: &Path, radial_along_cross_m: [f64; 3]) -> PathBuf {
    fs::create_dir(folder).unwrap();
    for entry in fs::read_dir(archive().join("kernels")).unwrap() {
        let path = entry.unwrap().path();
        fs::copy(&path, folder.join(path.file_name().unwrap())).unwrap();
    }
    let (epochs, states) = {
        let session = Session::open(&KernelSet::from_metakernel(&kernels()).unwrap()).unwrap();
        let span = session.coverage().unwrap().spk.as_slice()[0];
        let count = (span.duration_s() / 60.0) as usize;
        let epochs: Vec<Et> = (0..=count)
            .map(|n| span.start.plus(60.0 * n as f64))
            .collect();
        let states = epochs.iter().map(|et| {
            let State {
                mut position,
                velocity_m_s,
            } = session.state(*et).unwrap();
            let axes = radial_along_cross(&position.xyz_m, &velocity_m_s);
            position.xyz_m += axes * nalgebra::Vector3::from(radial_along_cross_m);
            State {
                position,
                velocity_m_s,
            }
        });
        let states: Vec<State> = states.collect();
        (epochs, states)
    };
    let segment = SpkSegment {
        target: SPACECRAFT.naif,
        centre: 4,
        name: "displaced",
        degree: 7,
        epochs: &epochs,
        states: &states,
    };
    let spk = folder.join("mgs_archive_scene.bsp");
    fs::remove_file(&spk).unwrap();
    write_spk(&spk, &[segment], "displaced").unwrap();
    folder.join("archive.tm")
}

#[test]
fn the_archive_has_no_complaint_and_all_kinds_of_shots() {
    let paths: Vec<PathBuf> = ["ap10001l.b", "ap10013l.b", "ap10025l.b"]
        .iter()
        .map(|name| pedr().join(name))
        .collect();
    let told = succeed(
        areograph()
            .args(["--quiet", "pedr", "info", "--json"])
            .args(&paths),
    );
    let told: Value = serde_json::from_slice(&told.stdout).unwrap();
    for file in told.as_array().unwrap() {
        assert_eq!(file["complaints"], Value::Array(Vec::new()), "{file}");
        assert_eq!(file["orbits"].as_array().unwrap().len(), 12);
        let channels = file["counts"]["by_channel"].as_object();
        assert!(channels.is_none_or(|of| of.len() == 4), "{file}");
    }
}

#[test]
fn the_same_archive_has_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let again = folder.path().join("again");
    let mut command = areograph();
    command
        .env("RAYON_NUM_THREADS", "1")
        .args(["--quiet", "scene", "archive", "--days", "1"]);
    succeed(command.arg(&again));
    let [one, other] = [archive(), again].map(|of| fs::read(of.join("pedr/ap10001l.b")).unwrap());
    assert!(one == other);
}
