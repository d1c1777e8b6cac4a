//! Points on the ground by the calibrated cameras.

use super::{CalibrationProducts, WriteCalibration, write_csv, write_parquet};
use crate::{
    coordinates::degrees,
    product::{Content, Declaration, Role},
    table::{Column, Table, Unit, column, meanings},
};
use areograph_base::terms::Terms;
use areograph_stages::calibrate::PointResult;

pub(super) static TABLE: Declaration<WriteCalibration> = Declaration {
    path: "points.parquet",
    what: "every tie and laser point located by the calibrated cameras, with standard deviations",
    readers: "scripts",
    rows: "points",
    role: Role::Data,
    content: Content::Table(|| meanings(&columns())),
    write: |path, of| write_parquet(path, of, &table(of)),
    uses: &[],
};

pub(super) static CSV: Declaration<WriteCalibration> = Declaration {
    path: "points.csv",
    what: "tie and laser points located by the calibrated cameras, as CSV",
    readers: "spreadsheets, scripts",
    rows: "points",
    role: Role::Data,
    content: Content::Table(|| meanings(&columns())),
    write: |path, of| write_csv(path, table(of)),
    uses: &[],
};

fn table<'a>(of: &CalibrationProducts<'a>) -> Table<'a> {
    let terms = Terms {
        body: of.config.body,
        ..Terms::MARS
    };
    Table::new(columns(), of.result.points.iter().collect()).in_terms(&terms)
}

type Row<'a> = &'a PointResult;

fn columns<'a>() -> Vec<Column<Row<'a>>> {
    let mut columns = vec![
        column("point", Unit::None, "name of the point", |row: &Row| {
            row.point.clone()
        }),
        column(
            "kind",
            Unit::None,
            "kind of point: tie, control (used) or held_back (withheld for validation)",
            |row: &Row| row.kind.word().to_owned(),
        ),
        column(
            "left_out",
            Unit::None,
            "whether the point was rejected; its position and standard deviations are then empty",
            |row: &Row| row.left_out,
        ),
        column(
            "longitude_deg",
            Unit::Degree,
            "east longitude of the intersected point, -180 to 180 degrees",
            |row: &Row| row.place.map(|place| degrees(place[0])),
        ),
        column(
            "latitude_deg",
            Unit::Degree,
            "{latitude} latitude of the intersected point, degrees",
            |row: &Row| row.place.map(|place| degrees(place[1])),
        ),
        column(
            "radius_m",
            Unit::Metre,
            "distance of the intersected point from the centre of the body, metres",
            |row: &Row| row.place.map(|place| place[2]),
        ),
    ];
    columns.extend(sigmas());
    columns.extend(offs());
    columns
}

/// Standard deviations.
fn sigmas<'a>() -> [Column<Row<'a>>; 3] {
    [
        column(
            "sigma_east_m",
            Unit::Metre,
            "standard deviation in east from measurement and calibration, metres; empty for a tie point whose height \
             test cannot detect errors of the usual size",
            |row: &Row| row.sigma_m.map(|sigma_m| sigma_m[0]),
        ),
        column(
            "sigma_north_m",
            Unit::Metre,
            "standard deviation in north from measurement and calibration, metres; empty where sigma_east_m is empty",
            |row: &Row| row.sigma_m.map(|sigma_m| sigma_m[1]),
        ),
        column(
            "sigma_up_m",
            Unit::Metre,
            "standard deviation of the height from measurement and calibration, metres; empty where \
             sigma_east_m is empty",
            |row: &Row| row.sigma_m.map(|sigma_m| sigma_m[2]),
        ),
    ]
}

/// Residuals of laser points.
fn offs<'a>() -> [Column<Row<'a>>; 3] {
    [
        column(
            "off_east_m",
            Unit::Metre,
            "intersected minus laser position of a laser point, east, metres",
            |row: &Row| row.off_m.map(|off_m| off_m[0]),
        ),
        column(
            "off_north_m",
            Unit::Metre,
            "intersected minus laser position of a laser point, north, metres",
            |row: &Row| row.off_m.map(|off_m| off_m[1]),
        ),
        column(
            "off_up_m",
            Unit::Metre,
            "intersected minus laser position of a laser point, up, metres",
            |row: &Row| row.off_m.map(|off_m| off_m[2]),
        ),
    ]
}
