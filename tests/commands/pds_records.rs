//! No bad record passes as good: every bit of a record turned over, and no complaint of good ones.

#![allow(
    clippy::disallowed_methods,
    clippy::unwrap_used,
    reason = "helpers of tests may panic, and files in a temporary folder need no atomic writer"
)]

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
    sync::LazyLock,
};

use areograph::{
    footprints::Footprint,
    geom::ellipsoid::spherical_to_xyz_m,
    pds::pedr::{FieldGuard, File, LABEL_BYTES, RECORD_BYTES, Reason, Record},
    scene::{SceneErrors, SceneOptions, write_scene},
};

/// Days of half an hour: slews, images and windows are all inside.
const SHORT: SceneOptions = SceneOptions {
    seed: 3,
    day_s: 1_800.0,
    pairs: 1,
    passes: 0,
    ties: 154,
    ties_at_shots: false,
    errors: SceneErrors::demo(),
};

static SCENE: LazyLock<tempfile::TempDir> = LazyLock::new(|| {
    let folder = tempfile::tempdir().unwrap();
    write_scene(&folder.path().join("mission"), &SHORT).unwrap();
    folder
});

fn pedr_files() -> Vec<PathBuf> {
    let folder = SCENE.path().join("mission/pedr");
    let entries = fs::read_dir(folder).unwrap();
    let mut files: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
    files.sort();
    files
}

fn guard() -> FieldGuard {
    FieldGuard::new(Some(7.25))
}

/// All that is said of the records and shots of a file.
fn complaints(file: &File) -> Vec<String> {
    let mut said: Vec<String> = file
        .label_complaints()
        .iter()
        .map(ToString::to_string)
        .collect();
    for (row, frame) in file.frames(0..file.records().len(), guard()) {
        let error = match frame {
            Ok(frame) => frame.spoiled_shots().error().copied(),
            Err(error) => Some(error),
        };
        said.extend(error.map(|error| file.record_complaint(row, &error).to_string()));
    }
    said
}

#[test]
fn no_good_record_is_complained_of() {
    let files = pedr_files();
    assert!(files.len() >= 6);
    for path in files {
        let file = File::open(&path).unwrap();
        assert!(file.records().len() > 100);
        let said = complaints(&file);
        assert!(
            said.is_empty(),
            "{} complaints: {:#?}",
            said.len(),
            &said[..said.len().min(10)]
        );
    }
}

/// What a field can do to a shot when one of its bits is wrong and nobody complains.
#[derive(Clone, Copy, Default, PartialEq)]
struct Harm {
    footprint_m: f64,
    radius_m: f64,
    corrected_radius_m: f64,
    areoid_m: f64,
    range_m: f64,
    spacecraft_m: f64,
    time_s: f64,
    off_nadir_deg: f64,
    /// Of orbit number, channel, class, attitude flag, orbit model.
    labels: [bool; 5],
}

impl Harm {
    fn between(good: &Footprint, other: &Footprint) -> Self {
        let place =
            |longitude_rad, latitude_rad| spherical_to_xyz_m(longitude_rad, latitude_rad, 3.39e6);
        let craft = |shot: &Footprint| {
            spherical_to_xyz_m(
                shot.spacecraft_longitude_rad,
                shot.spacecraft_latitude_rad,
                shot.spacecraft_radius_m,
            )
        };
        let apart = |of: fn(&Footprint) -> f64| (of(good) - of(other)).abs();
        Self {
            footprint_m: (place(good.longitude_rad, good.latitude_rad)
                - place(other.longitude_rad, other.latitude_rad))
            .norm(),
            radius_m: apart(|shot| shot.radius_m),
            corrected_radius_m: apart(|shot| shot.radius_crossover_m - shot.radius_m),
            areoid_m: apart(|shot| shot.areoid_radius_m),
            range_m: apart(|shot| shot.range_m),
            spacecraft_m: (craft(good) - craft(other)).norm(),
            time_s: apart(|shot| shot.et_tag_s),
            off_nadir_deg: apart(|shot| shot.off_nadir_rad).to_degrees(),
            labels: [
                good.orbit != other.orbit,
                good.channel != other.channel,
                good.class != other.class,
                good.attitude_flag != other.attitude_flag,
                good.orbit_quality != other.orbit_quality,
            ],
        }
    }

    fn numbers(&self) -> [f64; 8] {
        [
            self.footprint_m,
            self.radius_m,
            self.corrected_radius_m,
            self.areoid_m,
            self.range_m,
            self.spacecraft_m,
            self.time_s,
            self.off_nadir_deg,
        ]
    }

    fn grow(&mut self, other: &Self) {
        self.footprint_m = self.footprint_m.max(other.footprint_m);
        self.radius_m = self.radius_m.max(other.radius_m);
        self.corrected_radius_m = self.corrected_radius_m.max(other.corrected_radius_m);
        self.areoid_m = self.areoid_m.max(other.areoid_m);
        self.range_m = self.range_m.max(other.range_m);
        self.spacecraft_m = self.spacecraft_m.max(other.spacecraft_m);
        self.time_s = self.time_s.max(other.time_s);
        self.off_nadir_deg = self.off_nadir_deg.max(other.off_nadir_deg);
        for (label, other) in self.labels.iter_mut().zip(other.labels) {
            *label |= other;
        }
    }
}

/// The returned shots of a file that nothing is said against, by row and shot.
fn kept(file: &File) -> BTreeMap<(usize, u8), Footprint> {
    let mut kept = BTreeMap::new();
    for (row, frame) in file.frames(0..file.records().len(), guard()) {
        let Ok(frame) = frame else { continue };
        let spoiled = frame.spoiled_shots();
        let shots = (1..=20).filter(|shot| !spoiled.contains(*shot));
        let shots = shots
            .filter_map(|shot| frame.shot(shot))
            .filter(|shot| shot.range_m > 0.0);
        kept.extend(shots.map(|shot| ((row, shot.shot), shot)));
    }
    kept
}

/// An excerpt of a file: its label and some records around `row`.
fn excerpt(bytes: &[u8], row: usize) -> Vec<u8> {
    let at = |row: usize| LABEL_BYTES + row * RECORD_BYTES;
    [&bytes[..LABEL_BYTES], &bytes[at(row - ROW)..at(row + ROW)]].concat()
}

/// Row of the record under test in an excerpt.
const ROW: usize = 12;

/// Fields of a record by their first byte, with the names of the table in docs/records.md.
const FIELDS: [(usize, &str); 45] = include!("../pds_records/fields.in");

fn field_of(byte: usize) -> &'static str {
    FIELDS
        .iter()
        .rev()
        .find(|(first, _)| *first <= byte)
        .unwrap()
        .1
}

/// The records whose bits are turned over: at nadir, off nadir, with a cloud and a shot that was lost.
fn records_under_test() -> Vec<(PathBuf, Vec<u8>)> {
    let wanted: [fn(&Record) -> bool; 3] = [
        |record| record.off_nadir_microdegrees.get() < 500_000,
        |record| record.off_nadir_microdegrees.get() > 10_000_000,
        |record| {
            let returned = record.range_cm.map(|range| range.get() > 0);
            let cloud = record
                .class
                .iter()
                .zip(returned)
                .any(|(class, back)| back && class.get() == 0);
            cloud && returned.contains(&false)
        },
    ];
    let files = pedr_files();
    wanted
        .iter()
        .map(|wanted| {
            let found = files.iter().find_map(|path| {
                let file = File::open(path).unwrap();
                let rows = file.records().len();
                let row = (ROW..rows - ROW).find(|row| wanted(&file.records()[*row]))?;
                Some((path.clone(), excerpt(&fs::read(path).unwrap(), row)))
            });
            found.unwrap()
        })
        .collect()
}

#[test]
fn every_bit_of_a_record_is_harmless_or_complained_of() {
    let documented = documented();
    let mut harms = vec![Harm::default(); FIELDS.len()];
    for (path, bytes) in records_under_test() {
        let open = |bytes: Vec<u8>| File::from_bytes(bytes, &path);
        let good = open(bytes.clone());
        assert_eq!(complaints(&good), Vec::<String>::new());
        let good = kept(&good);
        for bit in 0..8 * RECORD_BYTES {
            let mut spoiled = bytes.clone();
            spoiled[LABEL_BYTES + ROW * RECORD_BYTES + bit / 8] ^= 0x80 >> (bit % 8);
            let spoiled = open(spoiled);
            let now = kept(&spoiled);
            let field = FIELDS
                .iter()
                .rposition(|(first, _)| *first <= bit / 8)
                .unwrap();
            for (place, shot) in &good {
                match now.get(place) {
                    Some(now) => harms[field].grow(&Harm::between(shot, now)),
                    None => assert_eq!(
                        place.0,
                        ROW,
                        "bit {bit} ({}): lost a good shot",
                        field_of(bit / 8)
                    ),
                }
            }
            // A shot that came back from nothing has no good values to be held against.
            let invented = now.keys().any(|place| !good.contains_key(place));
            assert!(
                !invented,
                "bit {bit} ({}): a shot without a return",
                field_of(bit / 8)
            );
        }
    }
    let mut beyond = Vec::new();
    for ((_, name), harm) in FIELDS.iter().zip(&harms) {
        let Some(limits) = documented.iter().find(|(field, ..)| field == name) else {
            beyond.push(format!(
                "{name}: not in the table; {:?} {:?}",
                harm.numbers(),
                harm.labels
            ));
            continue;
        };
        let kept = harm
            .numbers()
            .iter()
            .zip(&limits.1)
            .all(|(found, limit)| found <= limit);
        if !kept || harm.labels.contains(&true) != limits.2 {
            beyond.push(format!(
                "{name}: {:?} {:?}; documented {limits:?}",
                harm.numbers(),
                harm.labels
            ));
        }
    }
    assert!(beyond.is_empty(), "{beyond:#?}");
}

/// The table of docs/records.md: field, what is not noticed, whether a label may change.
fn documented() -> Vec<(String, [f64; 8], bool)> {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/records.md");
    let page = fs::read_to_string(page).unwrap_or_default();
    let rows = page.lines().filter_map(|line| {
        let cells: Vec<&str> = line.split('|').map(str::trim).collect();
        let [
            _,
            _,
            field,
            footprint,
            radius,
            corrected,
            areoid,
            range,
            craft,
            time,
            angle,
            label,
            _,
        ] = cells[..]
        else {
            return None;
        };
        let number = |cell: &str| {
            if cell.is_empty() {
                Some(1e-6)
            } else {
                cell.parse().ok()
            }
        };
        let mut limits = [0.0; 8];
        for (limit, cell) in limits.iter_mut().zip([
            footprint, radius, corrected, areoid, range, craft, time, angle,
        ]) {
            *limit = number(cell)?;
        }
        Some((field.to_owned(), limits, !label.is_empty()))
    });
    rows.collect()
}

/// A file with some records changed: the whole of the first mapping file of the scene.
fn changed(change: impl Fn(&mut Vec<Record>)) -> File {
    let path = &pedr_files()[1];
    let bytes = fs::read(path).unwrap();
    let mut records = Record::slice_of(&bytes[LABEL_BYTES..]).to_vec();
    change(&mut records);
    let mut bytes = bytes[..LABEL_BYTES].to_vec();
    bytes.extend(records.iter().flat_map(Record::to_bytes));
    File::from_bytes(bytes, path)
}

/// Records that are complained of, with the reasons.
fn told(file: &File) -> Vec<(u32, Reason)> {
    file.frames(0..file.records().len(), guard())
        .filter_map(|(row, frame)| Some((file.record_number(row), frame.err()?.reason())))
        .collect()
}

/// Moves both times of a record.
fn shift(record: &mut Record, seconds: i32) {
    record.time_s.set(record.time_s.get() + f64::from(seconds));
    record.time_whole_s.set(record.time_whole_s.get() + seconds);
}

#[test]
fn times_out_of_step_are_found_at_both_ends_and_in_pairs() {
    for rows in [
        vec![0],
        vec![0, 1],
        vec![400],
        vec![400, 401],
        vec![899],
        vec![898, 899],
    ] {
        // Into 2017; by an hour; back by a minute; by half an hour.
        for seconds in [500_000_000, 3_600, -60, 1_800] {
            let file = changed(|records| {
                records.truncate(900);
                for row in &rows {
                    shift(&mut records[*row], seconds);
                }
            });
            let found: Vec<u32> = told(&file).into_iter().map(|(record, _)| record).collect();
            let expected: Vec<u32> = rows.iter().map(|row| file.record_number(*row)).collect();
            assert_eq!(found, expected, "rows {rows:?} by {seconds} s");
        }
    }
}

#[test]
fn shots_that_stand_twice_in_a_file_count_once() {
    // A block written twice; a download resumed too early; frames that overlap by half.
    let repeated = changed(|records| {
        let block = records[300..320].to_vec();
        records.splice(600..600, block);
    });
    assert_eq!(told(&repeated).len(), 20);
    assert!(
        told(&repeated)
            .iter()
            .all(|(record, reason)| { *reason == Reason::Repeated && (611..631).contains(record) })
    );
    let resumed = changed(|records| {
        let rest = records[440..].to_vec();
        records.truncate(450);
        records.extend(rest);
    });
    assert_eq!(told(&resumed).len(), 10);
    let overlapping = changed(|records| {
        let mut half = records[500];
        half.time_s.set(half.time_s.get() + 1.0);
        half.time_whole_s.set(half.time_whole_s.get() + 1);
        records.insert(501, half);
    });
    assert_eq!(told(&overlapping), [(512, Reason::Repeated)]);
    let text = {
        let frame = overlapping.frames(501..502, guard()).next().unwrap().1;
        frame.unwrap_err().to_string()
    };
    assert!(
        text.ends_with(
            "repeats the shots of record 511; expected every shot once, in frames at least 1.9 s apart"
        ),
        "{text}"
    );
}

#[test]
fn a_jump_for_good_is_not_complained_of() {
    // As where one orbit solution ends and the next begins: 300 m along the track.
    let file = changed(|records| {
        for record in &mut records[450..] {
            let latitude = record.spacecraft_latitude_microdegrees.get();
            record
                .spacecraft_latitude_microdegrees
                .set(latitude + 5_000);
        }
    });
    assert_eq!(told(&file), []);
    // And where all is other than expected, nothing is said of any record by its neighbours.
    let file = changed(|records| {
        for record in records {
            let change = record.areoid_radius_change_cm.get();
            record.areoid_radius_change_cm.set(40_000 - change);
        }
    });
    assert_eq!(told(&file), []);
}

#[test]
fn the_residual_is_no_ramp_at_the_first_frame_without_one() {
    let file = changed(|records| {
        for record in records.iter_mut() {
            record.crossover_residual_cm.set(300);
        }
        for record in &mut records[450..] {
            record.orbit_quality.set(1);
        }
    });
    let corrections: Vec<f64> = file
        .frames(449..451, guard())
        .flat_map(|(_, frame)| {
            let frame = frame.unwrap();
            [1, 20].map(|shot| {
                let shot = frame.shot(shot).unwrap();
                shot.radius_m - shot.radius_crossover_m
            })
        })
        .collect();
    // Metres; centimetres are exact but for the rounding of a sum of 3e6.
    for (found_m, expected_m) in corrections.iter().zip([3.0, 3.0, 0.0, 0.0]) {
        assert!((found_m - expected_m).abs() < 1e-8, "{corrections:?}");
    }
}

#[test]
fn counts_add_up_and_ranges_are_those_of_the_file_itself() {
    let file = changed(|records| {
        let index = (0..20).find(|shot| records[200].returned(*shot)).unwrap();
        let range_cm = records[200].range_cm[index].get();
        records[200].range_cm[index].set(range_cm + 100_000);
        records[300].clock_frequency_hz.set(1);
        records[301].attitude_flag.set(3);
    });
    let (counts, complaints) = file.count();
    assert_eq!(complaints.len(), 2, "{complaints:?}");
    let text = complaints[0].to_string();
    assert!(
        text.contains("record 211: range of shot")
            && text.contains("m apart; expected agreement within"),
        "{text}"
    );
    assert_eq!(
        (counts.records, counts.spoiled_shots),
        (file.records().len() as u64, 1)
    );
    assert_eq!(counts.shots, 20 * counts.good_records);
    assert_eq!(counts.good_records, counts.records - 1);
    let judged = counts.shots - counts.without_return - counts.spoiled_shots;
    assert_eq!(counts.shots_by_class.values().sum::<u64>(), judged);
    assert_eq!(counts.shots_by_channel.values().sum::<u64>(), judged);
    assert_eq!(counts.shots_by_attitude_flag.values().sum::<u64>(), judged);
    assert_eq!(counts.shots_by_orbit_model.values().sum::<u64>(), judged);
    assert_eq!(
        counts.records_by_orbit.values().sum::<u64>(),
        counts.good_records
    );
    let unknown = counts.shots_by_attitude_flag[&3];
    let [ground, other] = [
        &counts.ground_range_minus_distance_m,
        &counts.other_range_minus_distance_m,
    ];
    assert_eq!(u64::from(ground.n + other.n), judged - unknown);
    // A microdegree is 0.06 m, a range is told to 0.01 m.
    assert!(ground.mean.abs() < 0.03 && ground.nmad < 0.06, "{ground:?}");
}

/// The complaints of a label after a change of its text.
fn label_said(from: &str, to: &str) -> Vec<String> {
    assert_eq!(from.len(), to.len());
    let path = &pedr_files()[1];
    let bytes = fs::read(path).unwrap();
    let label = String::from_utf8(bytes[..LABEL_BYTES].to_vec()).unwrap();
    assert!(label.contains(from));
    let label = label.replace(from, to).into_bytes();
    let file = File::from_bytes(
        [&label, &bytes[LABEL_BYTES..]].concat(),
        Path::new("ap19019k.b"),
    );
    assert_eq!(told(&file), []);
    file.label_complaints()
        .iter()
        .map(|complaint| complaint.text.clone())
        .collect()
}

#[test]
fn labels_that_are_not_those_of_a_pedr_are_complained_of_and_no_record_is_lost() {
    for (from, to, said) in [
        (
            "CCSD3ZF0",
            "CCSD3ZF9",
            "the label does not begin with CCSD3ZF0, unlike the labels of archive files",
        ),
        (
            "RECORD_BYTES = 776",
            "RECORD_BYTES = 512",
            "RECORD_BYTES of the label is 512; expected 776",
        ),
        (
            "LABEL_RECORDS = 10",
            "LABEL_RECORDS = 11",
            "LABEL_RECORDS of the label is 11; expected 10",
        ),
        (
            "RECORD_TYPE = FIXED_LENGTH",
            "RECORD_TYPE = UNDEFINED   ",
            "RECORD_TYPE of the label is UNDEFINED; expected FIXED_LENGTH",
        ),
        (
            "LABEL_RECORDS =",
            "LABEL_RECORDZ =",
            "the label has no LABEL_RECORDS; expected 10",
        ),
        (
            "MGS-M-MOLA-3-PEDR-L1A-V1.0",
            "MGS-M-MOLA-5-IEGDR-L3-V1.0",
            "DATA_SET_ID of the label is MGS-M-MOLA-5-IEGDR-L3-V1.0; expected MGS-M-MOLA-3-PEDR-L1A-..., as in every PEDR",
        ),
    ] {
        assert_eq!(label_said(from, to), [said]);
    }
    // Without its label, the file begins with its first record.
    let bytes = fs::read(&pedr_files()[1]).unwrap();
    let file = File::from_bytes(bytes[LABEL_BYTES..].to_vec(), Path::new("ap19019k.b"));
    assert_eq!(
        file.records().len(),
        (bytes.len() - LABEL_BYTES) / RECORD_BYTES
    );
    assert_eq!(told(&file), []);
    assert_eq!(file.record_number(0), 1);
    let said: Vec<&str> = file
        .label_complaints()
        .iter()
        .map(|complaint| complaint.text.as_str())
        .collect();
    assert!(
        said.contains(&"records begin after 0 label records; expected 10 label records"),
        "{said:?}"
    );
}

#[test]
fn files_that_are_nearly_pedr_are_named_for_what_they_are() {
    let bytes = fs::read(&pedr_files()[1]).unwrap();
    let why = |bytes: Vec<u8>| {
        let file = File::from_bytes(bytes, Path::new("ap19019k.b"));
        file.require_records().unwrap_err().to_string()
    };
    let compressed = bytes[4..20_000].iter().map(|byte| byte ^ 0x5a);
    let gzip = [0x1f, 0x8b, 8, 0].into_iter().chain(compressed).collect();
    assert!(why(gzip).contains("compressed with gzip"));
    let mut swapped = bytes.clone();
    for record in swapped[LABEL_BYTES..].chunks_mut(RECORD_BYTES) {
        for (field, length) in [(0, 4), (4, 4), (552, 8), (644, 4)] {
            record[field..field + length].reverse();
        }
    }
    assert!(why(swapped).contains("the records are little-endian"));
    let mut text = bytes[..LABEL_BYTES].to_vec();
    text.extend(
        "  12.34567  45.67890  1234.56 \r\n"
            .bytes()
            .cycle()
            .take(10 * RECORD_BYTES),
    );
    assert!(why(text).contains("the file contains text, like an ASCII PEDR"));
}
