//! Valid rows, and every kind of invalid row.

use std::{fs::File, io::Write as _};

use super::*;
use areograph_base::{error::Kind, units::RADIANS_PER_DEGREE};

/// Columns of a table by name.
fn named() -> ShotColumns {
    let name = |name: &str| Some(name.to_owned());
    ShotColumns {
        et_s: name("et"),
        longitude_deg: name("lon"),
        latitude_deg: name("lat"),
        radius_km: name("radius"),
        range_km: name("range"),
        spacecraft_longitude_deg: name("sc_lon"),
        spacecraft_latitude_deg: name("sc_lat"),
        spacecraft_radius_km: name("sc_radius"),
        ..ShotColumns::default()
    }
}

const HEADER: &str = "et,lon,lat,radius,range,sc_lon,sc_lat,sc_radius";
const ROW: &str = "317845253.25,99.0,60.0,1735.0,57.0,99.0,60.0,1792.0";

type Rows = Vec<std::result::Result<ShotRow, RowComplaint>>;

fn read(text: impl AsRef<[u8]>, columns: &ShotColumns) -> Result<Rows> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("shots.csv");
    File::create(&path)
        .unwrap()
        .write_all(text.as_ref())
        .unwrap();
    let mut rows = Vec::new();
    let utc = |text: &str| match text {
        "2010-01-27" => Ok(Et::from_seconds(1.0)),
        _ => Err(ShotTableError::Empty.into()),
    };
    let columns = TableColumns::Assigned(columns.clone());
    read_shot_table(&path, &columns, Body::Moon, Some(&utc), |row| {
        rows.push(row);
        Ok(())
    })?;
    Ok(rows)
}

#[test]
fn columns_are_found_by_name_and_by_number() {
    let rows = read(format!("{HEADER}\n{ROW}\n"), &named()).unwrap();
    let [Ok(row)] = &rows[..] else {
        panic!("{rows:?}")
    };
    assert_eq!(row.line, 2);
    assert!((row.et_s - 317_845_253.25).abs() < 1e-9); // a quarter of a second is exact
    assert!((row.longitude_rad - 99.0 * RADIANS_PER_DEGREE).abs() < 1e-15);
    assert!((row.radius_m - 1_735_000.0).abs() < 1e-6 && (row.range_m - 57_000.0).abs() < 1e-6);
    let numbers = |column: &str| Some(column.to_owned());
    let numbered = ShotColumns {
        et_s: numbers("1"),
        longitude_deg: numbers("2"),
        latitude_deg: numbers("3"),
        radius_km: numbers("4"),
        range_km: numbers("5"),
        spacecraft_longitude_deg: numbers("6"),
        spacecraft_latitude_deg: numbers("7"),
        spacecraft_radius_km: numbers("8"),
        ..ShotColumns::default()
    };
    // With a header and without one.
    let same = read(format!("{HEADER}\n{ROW}\n"), &numbered).unwrap();
    assert_eq!(same, rows);
    let first = read(format!("{ROW}\n"), &numbered).unwrap();
    assert_eq!(first[0].as_ref().unwrap().line, 1);
}

#[test]
fn other_units_times_and_heights_give_the_same_shot() {
    let name = |name: &str| Some(name.to_owned());
    let columns = ShotColumns {
        et_s: None,
        utc: name("et"),
        radius_km: None,
        height_m: name("radius"),
        range_km: None,
        range_m: name("range"),
        spacecraft_radius_km: None,
        spacecraft_radius_m: name("sc_radius"),
        ..named()
    };
    let row = "2010-01-27,-261.0,60.0,-2400.0,57000.0,99.0,60.0,1792000.0";
    let rows = read(format!("{HEADER}\n{row}\n"), &columns).unwrap();
    let row = rows[0].as_ref().unwrap();
    assert!((row.et_s - 1.0).abs() < 1e-12); // as the closure says
    // Above 1737.4 km.
    assert!((row.radius_m - 1_735_000.0).abs() < 1e-6);
    assert!((row.range_m - 57_000.0).abs() < 1e-6);
    let late = "yesterday,99.0,60.0,-2400.0,57000.0,99.0,60.0,1792000.0";
    let rows = read(
        format!("{HEADER}\n{late}\n2010-01-27,99,60,-2400,57000,99,60,1792000\n"),
        &columns,
    );
    let rows = rows.unwrap();
    let complaint = rows[0].as_ref().unwrap_err();
    assert!(
        complaint
            .text
            .starts_with("utc (column 1) is \"yesterday\"; expected UTC"),
        "{complaint:?}"
    );
}

#[test]
fn every_bad_row_is_told_with_its_line_and_the_good_ones_are_kept() {
    let bad = [
        (
            "x,99.0,60.0,1735.0,57.0,99.0,60.0,1792.0",
            "et_s (column 1) is \"x\"; expected a number",
        ),
        (
            "1.0,721.0,60.0,1735.0,57.0,99.0,60.0,1792.0",
            "longitude_deg (column 2) is \"721.0\"; expected a number from -360 to 720",
        ),
        (
            "1.0,99.0,-91,1735.0,57.0,99.0,60.0,1792.0",
            "latitude_deg (column 3) is \"-91\"; expected a number from -90 to 90",
        ),
        (
            "1.0,99.0,60.0,1735000.0,57.0,99.0,60.0,1792.0",
            "radius_km (column 4) is \"1735000.0\"; expected a number from 1650.53 to 1824.27",
        ),
        (
            "1.0,99.0,60.0,1735.0,0,99.0,60.0,1792.0",
            "range_km (column 5) is \"0\"; expected a number above 0, at most 10000",
        ),
        (
            "1.0,99.0,60.0,1735.0,NaN,99.0,60.0,1792.0",
            "range_km (column 5) is \"NaN\"; expected a number",
        ),
        (
            "1.0,99.0,60.0,1735.0,57.0,99.0",
            "the row has 6 columns; expected spacecraft_latitude_deg in column 7",
        ),
        (
            "1.0,99.0,60.0,1735.0,157.0,99.0,60.0,1792.0",
            "the range is 157000 m; expected the distance between spacecraft and footprint, 57000 m, within 2570 m",
        ),
    ];
    let mut text = format!("{HEADER}\n{ROW}\n");
    for (row, _) in bad {
        text.extend([row, "\n"]);
    }
    let rows = read(&text, &named()).unwrap();
    assert_eq!(rows.len(), bad.len() + 1);
    assert!(rows[0].is_ok());
    for ((line, row), (_, expected)) in (3..).zip(&rows[1..]).zip(bad) {
        let complaint = row.as_ref().unwrap_err();
        assert_eq!((complaint.line, &*complaint.text), (line, expected));
    }
}

#[test]
fn lines_with_ends_of_two_characters_are_counted() {
    let rows = read(format!("{HEADER}\r\n\r\n{ROW}\r\nx\r\n"), &named()).unwrap();
    let line = |row: &std::result::Result<ShotRow, RowComplaint>| match row {
        Ok(row) => row.line,
        Err(complaint) => complaint.line,
    };
    let lines: Vec<u32> = rows.iter().map(line).collect();
    assert_eq!(lines, [3, 4]);
}

#[test]
fn tables_that_hold_no_shot_are_refused() {
    let refused = |text: &str, expected: &str| {
        let failure = read(text, &named()).unwrap_err();
        assert_eq!(failure.kind(), Kind::Input);
        let told = failure.to_string();
        assert!(
            told.contains("shots.csv: ") && told.contains(expected),
            "{told}"
        );
    };
    refused("", "it has no rows");
    refused(&format!("{HEADER}\n"), "it has no rows");
    refused(
        "a,b\n1,2\n",
        "unknown column \"et\" (shots.columns.et_s); the first row contains a, b",
    );
    let metres = ROW.replace("1735.0", "1735000");
    refused(
        &format!("{HEADER}\n{metres}\n{metres}\n"),
        "none of its 2 rows is a valid shot; line 2: radius_km",
    );
    let bytes = [HEADER.as_bytes(), &[b'\n', 0xff, 0xfe, b'\n']].concat();
    let told = read(bytes, &named()).unwrap_err().to_string();
    assert!(told.contains("the table cannot be read"), "{told}");
}
