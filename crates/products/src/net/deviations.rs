//! Deviations of all measurements, the largest first.

use super::{NetProducts, WriteNet, write_csv, write_parquet};
use crate::{
    product::{Content, Declaration, Role},
    table::{Column, Table, Unit, column, meanings},
};
use areograph_stages::triangulate::MeasurementResult;

pub(super) static TABLE: Declaration<WriteNet> = Declaration {
    path: "deviations.parquet",
    what: "measurements with deviations, the largest first; blunders are marked",
    readers: "scripts",
    rows: "measurements",
    role: Role::Data,
    content: Content::Table(|| meanings(&columns())),
    write: |path, of| write_parquet(path, of, &table(of)),
    uses: &[],
};

pub(super) static CSV: Declaration<WriteNet> = Declaration {
    path: "deviations.csv",
    what: "measurements with deviations, as CSV",
    readers: "spreadsheets, scripts",
    rows: "measurements",
    role: Role::Data,
    content: Content::Table(|| meanings(&columns())),
    write: |path, of| write_csv(path, table(of)),
    uses: &[],
};

fn table<'a>(of: &NetProducts<'a>) -> Table<'a> {
    let mut rows: Vec<&MeasurementResult> = of.result.measurements.iter().collect();
    rows.sort_by(|one, two| two.length_m().total_cmp(&one.length_m()));
    Table::new(columns(), rows)
}

fn columns<'a>() -> Vec<Column<&'a MeasurementResult>> {
    type Row<'a> = &'a MeasurementResult;
    vec![
        column("point", Unit::None, "name of the point", |row: &Row| {
            row.point.clone()
        }),
        column("picture", Unit::None, "name of the picture", |row: &Row| {
            row.picture.clone()
        }),
        column(
            "brick_dx_m",
            Unit::Metre,
            "east deviation within the brick: image minus mean of the point, metres; missing if the point is on one \
             picture of the brick",
            |row: &Row| Some(row.in_brick?.x_m),
        ),
        column(
            "brick_dy_m",
            Unit::Metre,
            "north deviation within the brick: image minus mean of the point, metres; missing if the point is on one \
             picture of the brick",
            |row: &Row| Some(row.in_brick?.y_m),
        ),
        column(
            "dx_m",
            Unit::Metre,
            "east deviation in the whole net: image minus mean of the point, metres",
            |row: &Row| row.deviation.x_m,
        ),
        column(
            "dy_m",
            Unit::Metre,
            "north deviation in the whole net: image minus mean of the point, metres",
            |row: &Row| row.deviation.y_m,
        ),
        column(
            "redundancy",
            Unit::None,
            "redundancy number: share of a measurement error that appears in the deviation, 0 to 1",
            |row: &Row| row.redundancy,
        ),
        column(
            "flagged",
            Unit::None,
            "whether the deviation exceeds 3.5 robust standard deviations of the deviations in its brick",
            |row: &Row| row.flagged,
        ),
        column(
            "removed",
            Unit::None,
            "whether the measurement was rejected as a blunder",
            |row: &Row| row.removed,
        ),
        column(
            "x_m",
            Unit::Metre,
            "east coordinate of the point on the map, metres",
            |row: &Row| row.place_m[0],
        ),
        column(
            "y_m",
            Unit::Metre,
            "north coordinate of the point on the map, metres",
            |row: &Row| row.place_m[1],
        ),
        column(
            "picture_x",
            Unit::None,
            "measured x, corrected for the film, units of the picture",
            |row: &Row| row.at[0],
        ),
        column(
            "picture_y",
            Unit::None,
            "measured y (upwards), corrected for the film, units of the picture",
            |row: &Row| row.at[1],
        ),
    ]
}
