//! `areograph pedr index` and `areograph pedr search` as their users call them.

#![allow(
    clippy::disallowed_methods,
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "helpers of tests fail as tests do"
)]

use areograph_testing::track;

use std::{
    fs,
    path::{Path, PathBuf},
    process::{Command, Output},
};

use areograph::body::Datum;
use arrow_array::RecordBatch;
use arrow_array::cast::AsArray as _;
use arrow_array::types::{Float32Type, Float64Type, UInt32Type};
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use serde_json::Value;
use track::{FRAMES, write};

const BOX: &str = "--box=-170,170,-60,60";

fn areograph(arguments: &[&str]) -> Output {
    let of_search: &[&str] = match arguments[0] {
        "search" => &["--json", "--wide"],
        _ => &[],
    };
    Command::new(env!("CARGO_BIN_EXE_areograph"))
        .args(["--quiet", "pedr"])
        .args(arguments)
        .args(of_search)
        .output()
        .expect("the program")
}

fn text(path: &Path) -> &str {
    path.to_str().expect("a path in UTF-8")
}

fn json(output: &Output) -> Value {
    serde_json::from_slice(&output.stdout).expect("JSON")
}

/// Files whose names are not in the order of their times.
fn archive(folder: &Path) -> PathBuf {
    let archive = folder.join("archive");
    fs::create_dir(&archive).expect("a writable folder");
    write(&archive.join("AP19030L.B"), Datum::Iau2000, 0, |_, _| ());
    write(
        &archive.join("ap19020k.b"),
        Datum::Iau1991,
        FRAMES / 2,
        |_, _| (),
    );
    archive
}

fn search(archive: &Path, out: &Path) -> Output {
    areograph(&["search", text(archive), BOX, "--out", text(out)])
}

fn batch(path: &Path) -> (RecordBatch, Value) {
    let builder = ParquetRecordBatchReaderBuilder::try_new(fs::File::open(path).unwrap()).unwrap();
    let metadata = builder
        .metadata()
        .file_metadata()
        .key_value_metadata()
        .unwrap()
        .clone();
    let told = metadata
        .iter()
        .find(|of| of.key == "areograph_search")
        .unwrap();
    let told = serde_json::from_str(told.value.as_deref().unwrap()).unwrap();
    let schema = builder.schema().clone();
    let batches: Vec<RecordBatch> = builder.build().unwrap().map(Result::unwrap).collect();
    let batch = arrow_select::concat::concat_batches(&schema, &batches).unwrap();
    (batch, told)
}

#[test]
fn every_format_has_the_same_rows_in_the_order_of_time() {
    let folder = tempfile::tempdir().unwrap();
    let archive = archive(folder.path());
    let [parquet, csv, geojson] =
        ["found.parquet", "found.csv", "found.geojson"].map(|name| folder.path().join(name));
    for out in [&parquet, &csv, &geojson] {
        let output = search(&archive, out);
        assert!(
            output.status.success(),
            "{}",
            String::from_utf8_lossy(&output.stderr)
        );
    }
    let counted = json(&areograph(&["search", text(&archive), BOX]));
    let (batch, told) = batch(&parquet);
    assert_eq!(told, counted);
    let rows = batch.num_rows();
    assert!(rows > 5_000 && told["rows"] == rows && told["complete"] == true);
    assert_eq!(told["in_order_of_time"], true);
    let column = |name: &str| batch.column_by_name(name).unwrap().clone();
    let times = column("et_tag_s")
        .as_primitive::<Float64Type>()
        .values()
        .to_vec();
    assert!(times.is_sorted());
    let (files, records) = (column("source_file"), column("record"));
    let (files, records) = (
        files.as_string::<i32>(),
        records.as_primitive::<UInt32Type>(),
    );
    assert_eq!(
        (files.value(0), files.value(rows - 1)),
        ("AP19030L.B", "ap19020k.b")
    );
    let (boxes, points, longitudes) = (column("bbox"), column("geometry"), column("longitude_deg"));
    let side = |name: &str| {
        let sides = boxes.as_struct().column_by_name(name).unwrap();
        sides.as_primitive::<Float32Type>().clone()
    };
    let [west, south, east, north] = ["xmin", "ymin", "xmax", "ymax"].map(side);
    for row in 0..rows {
        // Well-known binary: byte order, type, two coordinates.
        let point = &points.as_binary::<i32>().value(row)[5..];
        let [x, y] =
            [&point[..8], &point[8..]].map(|axis| f64::from_le_bytes(axis.try_into().unwrap()));
        for (axis, least, most) in [(x, &west, &east), (y, &south, &north)] {
            let (least, most) = (f64::from(least.value(row)), f64::from(most.value(row)));
            assert!((least..=most).contains(&axis), "row {row}: {axis}");
            // Two neighbours in single precision, below 256 degrees.
            assert!(
                most - least <= 2.0_f64.powi(-16),
                "row {row}: {least} {most}"
            );
        }
        let longitude = longitudes.as_primitive::<Float64Type>().value(row);
        // Degrees of either turn, to their rounding.
        let turns = (longitude - x) / 360.0;
        assert!(
            (turns - turns.round()).abs() < 1e-11,
            "row {row}: {longitude} {x}"
        );
        assert!((-170.0..=170.0).contains(&x));
    }
    let mut reader = csv::Reader::from_path(&csv).unwrap();
    let names = reader.headers().unwrap().clone();
    let place = |name: &str| names.iter().position(|of| of == name).unwrap();
    let (file, record) = (place("source_file"), place("record"));
    let lines: Vec<csv::StringRecord> = reader.records().map(Result::unwrap).collect();
    assert_eq!(lines.len(), rows);
    let document: Value = serde_json::from_slice(&fs::read(&geojson).unwrap()).unwrap();
    let features = document["features"].as_array().unwrap();
    assert_eq!(
        (features.len(), &document["areograph_search"]),
        (rows, &told)
    );
    for (row, (line, feature)) in lines.iter().zip(features).enumerate() {
        assert_eq!(&line[file], files.value(row));
        assert_eq!(line[record], records.value(row).to_string());
        assert_eq!(feature["properties"]["source_file"], files.value(row));
        assert_eq!(feature["properties"]["record"], records.value(row));
    }
    let beside: Value =
        serde_json::from_slice(&fs::read(folder.path().join("found.csv.json")).unwrap()).unwrap();
    assert_eq!(beside, told);
}

#[test]
fn an_index_changes_no_byte_and_is_brought_up_to_date() {
    let folder = tempfile::tempdir().unwrap();
    let archive = archive(folder.path());
    let [without, with] = ["without.parquet", "with.parquet"].map(|name| folder.path().join(name));
    assert!(search(&archive, &without).status.success());
    let index = |arguments: &[&str]| {
        let output = areograph(&[&["index", text(&archive)], arguments].concat());
        let said = String::from_utf8_lossy(&output.stdout).into_owned();
        (
            output.status.code(),
            said + &String::from_utf8_lossy(&output.stderr),
        )
    };
    let (code, said) = index(&[]);
    assert!(
        code == Some(0) && said.contains("2 files of ") && said.contains("2 of them read now"),
        "{said}"
    );
    assert!(search(&archive, &with).status.success());
    assert!(fs::read(&without).unwrap() == fs::read(&with).unwrap());
    let (code, said) = index(&[]);
    assert!(
        code == Some(0) && said.contains(" 0 of them read now, 0 removed"),
        "{said}"
    );
    assert_eq!(index(&["--verify"]).0, Some(0));
    // One file more, and one that is none.
    write(
        &archive.join("ap19040l.b"),
        Datum::Iau2000,
        FRAMES,
        |_, _| (),
    );
    fs::File::create(archive.join("empty.b")).unwrap();
    fs::remove_file(archive.join("AP19030L.B")).unwrap();
    let (code, said) = index(&[]);
    assert!(
        code == Some(3) && said.contains("2 files of ") && said.contains("1 removed"),
        "{said}"
    );
    assert!(said.contains("empty.b: no valid record"), "{said}");
}

#[test]
fn an_answer_that_is_not_whole_says_so_in_the_file_and_by_the_exit_code() {
    let folder = tempfile::tempdir().unwrap();
    let archive = archive(folder.path());
    let out = folder.path().join("found.parquet");
    assert!(search(&archive, &out).status.success());
    let (whole, _) = batch(&out);
    std::os::unix::fs::symlink("nowhere", archive.join("gone.b")).unwrap();
    let garbage = archive.join("ap00001l.b");
    std::io::Write::write_all(
        &mut fs::File::create(&garbage).unwrap(),
        &vec![b'x'; 100_000],
    )
    .unwrap();
    let output = search(&archive, &out);
    assert!(matches!(output.status.code(), Some(3 | 6)));
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(
        said.contains("gone.b") && said.contains("ap00001l.b: no valid record"),
        "{said}"
    );
    let (rows, told) = batch(&out);
    assert!(rows.columns() == whole.columns() && told["complete"] == false);
    assert_eq!(told["failures"].as_array().unwrap().len(), 2);
    fs::remove_file(archive.join("gone.b")).unwrap();
    // Records that cannot be read may have been in the window; a file that lost more than some is no archive file.
    let file = archive.join("AP19030L.B");
    let good = fs::read(&file).unwrap();
    fs::remove_file(&garbage).unwrap();
    for (records, code) in [(1, 0), (40, 3)] {
        let mut bytes = good.clone();
        let end = bytes.len();
        bytes[end - records * 776..].fill(0x5a);
        fs::write(&file, bytes).unwrap();
        let everywhere = "--box=0,360,-90,90";
        let output = areograph(&["search", text(&archive), everywhere, "--out", text(&out)]);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(code), "{said}");
        let (_, told) = batch(&out);
        assert!(
            told["complete"] == false && told["records_left_out"] == records,
            "{told}"
        );
        assert_eq!(said.contains("AP19030L.B: 40 of"), records == 40, "{said}");
    }
    fs::write(&file, good).unwrap();
    // The same shots under another name.
    fs::copy(archive.join("AP19030L.B"), archive.join("AP19031L.B")).unwrap();
    let output = search(&archive, &out);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(3), "{said}");
    assert!(said.contains("not in time order"), "{said}");
    assert_eq!(batch(&out).1["in_order_of_time"], false);
}

#[test]
fn what_cannot_be_asked_is_refused_with_a_way_out() {
    let folder = tempfile::tempdir().unwrap();
    let archive = archive(folder.path());
    let refused = |arguments: &[&str]| {
        let output = areograph(&[&["search", text(&archive)], arguments].concat());
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        String::from_utf8_lossy(&output.stderr).into_owned()
    };
    assert!(refused(&[]).contains("--box"));
    assert!(refused(&["--box=1,2,3"]).contains("four numbers"));
    assert!(refused(&["--box=1,2,4,3"]).contains("south below north"));
    assert!(refused(&[BOX, "--time", "yesterday"]).contains("write A..B"));
    assert!(refused(&[BOX, "--time", "5..1"]).contains("not a time interval"));
    assert!(refused(&[BOX, "--out", "found.xyz"]).contains("--format"));
    assert!(refused(&[BOX, "--format", "csv"]).contains("--out"));
    // The same box by the coordinates of older maps.
    let rows = |arguments: &[&str]| {
        let found = areograph(&[&["search", text(&archive)], arguments].concat());
        json(&found)["rows"].as_u64().unwrap()
    };
    let east = rows(&["--box=181,359,-60,60"]);
    assert!(east > 0);
    assert_eq!(rows(&["--box=179,1,-60,60", "--longitude", "west"]), east);
    assert_eq!(rows(&["--box=-179,-1,-60,60"]), east);
    let areographic = rows(&["--box=181,359,-60,60", "--latitude", "areographic"]);
    assert!(
        0 < areographic && areographic < east,
        "{areographic} {east}"
    );
    let alone = refused(&["--windows", "many.toml", "--longitude", "west"]);
    assert!(alone.contains("--box"), "{alone}");
    let empty = folder.path().join("empty");
    fs::create_dir(&empty).unwrap();
    let output = areograph(&["search", text(&empty), BOX]);
    assert_eq!(output.status.code(), Some(3));
    let all = json(&areograph(&[
        "search",
        text(&archive),
        BOX,
        "--time",
        "-20000000..-19996000",
    ]));
    let some = json(&areograph(&[
        "search",
        text(&archive),
        BOX,
        "--time",
        "..-19999000",
    ]));
    assert!(all["rows"].as_u64() > some["rows"].as_u64() && some["rows"].as_u64() > Some(0));
}

/// What the program says of a search that it must refuse, of the command line.
fn refused(archive: &Path, arguments: &[&str]) -> String {
    let output = areograph(&[&["search", text(archive), BOX], arguments].concat());
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{arguments:?}: {said}");
    said
}

#[test]
fn nothing_that_is_read_is_written_over() {
    let folder = tempfile::tempdir().unwrap();
    let archive = archive(folder.path());
    let file = archive.join("AP19030L.B");
    let before = fs::read(&file).unwrap();
    for name in ["AP19030L.B", "../archive/AP19030L.B", "linked.b"] {
        let out = archive.join(name);
        if name == "linked.b" {
            fs::hard_link(&file, &out).unwrap();
        }
        let said = refused(&archive, &["--format", "csv", "--out", text(&out)]);
        assert!(
            said.contains("would be written over") && said.contains("AP19030L.B"),
            "{said}"
        );
    }
    fs::remove_file(archive.join("linked.b")).unwrap();
    assert!(fs::read(&file).unwrap() == before);
    // Files that say what to search for; the answer to CSV has a second file.
    let polygon = folder.path().join("found.csv.json");
    let ring = r#"{"type":"Polygon","coordinates":[[[0,0],[10,0],[10,10],[0,0]]]}"#;
    fs::write(&polygon, ring).unwrap();
    for out in ["found.csv.json", "found.csv"] {
        let out = folder.path().join(out);
        let said = refused(
            &archive,
            &["--polygon", text(&polygon), "--out", text(&out)],
        );
        assert!(said.contains("would be written over"), "{said}");
    }
    assert_eq!(fs::read_to_string(&polygon).unwrap(), ring);
    assert!(!folder.path().join("found.csv").exists());
}

#[test]
fn only_a_file_takes_the_place_of_a_file() {
    let folder = tempfile::tempdir().unwrap();
    let archive = archive(folder.path());
    let place = |name: &str| folder.path().join(name);
    let made = Command::new("mkfifo").arg(place("pipe.csv")).status();
    assert!(made.unwrap().success());
    let _socket = std::os::unix::net::UnixListener::bind(place("socket.csv")).unwrap();
    fs::write(place("old.csv"), "old").unwrap();
    std::os::unix::fs::symlink("old.csv", place("link.csv")).unwrap();
    fs::create_dir(place("folder.csv")).unwrap();
    for what in ["pipe", "socket", "link", "folder"] {
        let out = place(&format!("{what}.csv"));
        let before = fs::symlink_metadata(&out).unwrap().file_type();
        let said = refused(&archive, &["--out", text(&out)]);
        assert!(
            said.contains(&format!("{what}.csv: is a {what}; expected a file")),
            "{said}"
        );
        assert_eq!(fs::symlink_metadata(&out).unwrap().file_type(), before);
    }
    assert_eq!(fs::read_to_string(place("old.csv")).unwrap(), "old");
    // Of files, only one that areograph wrote, and an empty one.
    let said = refused(&archive, &["--out", text(&place("old.csv"))]);
    assert!(said.contains("old.csv: is "), "{said}");
    assert_eq!(fs::read_to_string(place("old.csv")).unwrap(), "old");
    fs::write(place("old.csv"), "").unwrap();
    for answer in ["first", "second"] {
        let found = search(&archive, &place("old.csv"));
        assert!(found.status.success(), "{answer}");
        assert!(fs::read_to_string(place("old.csv")).unwrap().len() > 3);
    }
}

#[test]
fn filters_that_keep_nothing_and_formats_at_odds_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let archive = archive(folder.path());
    for value in ["0", "5", "1,2,5"] {
        assert!(refused(&archive, &["--channels", value]).contains("1..=4"));
    }
    for value in ["nan", "-1", "0", "90.1", "inf"] {
        let said = refused(&archive, &["--off-nadir-max-deg", value]);
        assert!(
            said.contains("expected a number above 0, up to 90"),
            "{said}"
        );
    }
    let said = refused(&archive, &["--classes", "0", "1"]);
    assert!(
        said.contains("\"1\" is not a file") && said.contains("--classes 0,1"),
        "{said}"
    );
    let rows = |classes: &str| {
        let found = areograph(&["search", text(&archive), BOX, "--classes", classes]);
        json(&found)["rows"].as_u64().unwrap()
    };
    assert!(rows("0,1") > rows("1"));
    let out = folder.path().join("shots.parquet");
    let said = refused(&archive, &["--format", "csv", "--out", text(&out)]);
    assert!(
        said.contains("the extension does not match --format csv"),
        "{said}"
    );
    let said = refused(&archive, &["--format", "count", "--out", text(&out)]);
    assert!(said.contains("omit --out"), "{said}");
    assert!(!out.exists());
}

#[test]
fn geojson_has_what_shots_are_chosen_by() {
    let folder = tempfile::tempdir().unwrap();
    let archive = archive(folder.path());
    let out = folder.path().join("found.geojson");
    let all = ["--classes", "0,1", "--channels", "1,2,3,4"];
    let output = areograph(
        &[
            &["search", text(&archive), BOX, "--out", text(&out)],
            &all[..],
        ]
        .concat(),
    );
    assert!(output.status.success());
    let document: Value = serde_json::from_slice(&fs::read(&out).unwrap()).unwrap();
    let features = document["features"].as_array().unwrap();
    let count = |key: &str, value: u64| {
        let with = features.iter().filter(|of| of["properties"][key] == value);
        with.count()
    };
    let (ground, other) = (count("return_class", 1), count("return_class", 0));
    assert!(ground > 0 && other > 0 && ground + other == features.len());
    let channels: usize = (1..=4).map(|channel| count("channel", channel)).sum();
    let flags: usize = (0..=1).map(|flag| count("attitude_flag", flag)).sum();
    assert_eq!([channels, flags], [features.len(); 2]);
}

#[test]
fn complaints_are_told_in_a_line() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("ap19030l.b");
    let said = |spoilt: u32| {
        write(&file, Datum::Iau2000, 0, |number, record| {
            if (100..100 + spoilt).contains(&number) {
                record.clock_frequency_hz.set(7);
            }
        });
        let output = Command::new(env!("CARGO_BIN_EXE_areograph"))
            .args([
                "pedr",
                "search",
                text(&file),
                BOX,
                "--check-all",
                "--json",
                "--wide",
            ])
            .output()
            .unwrap();
        let told = json(&output);
        assert_eq!(
            told["complaints"]["frequency"].as_u64().unwrap_or(0),
            u64::from(spoilt)
        );
        String::from_utf8(output.stderr).unwrap()
    };
    let bad = said(3);
    assert!(
        bad.contains(" 3 complaints") && bad.contains("`first_complaints`"),
        "{bad}"
    );
    assert!(!said(0).contains("complaints"));
}
