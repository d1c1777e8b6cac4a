//! Points in the images, with their residuals.

use super::{CalibrationProducts, WriteCalibration, write_csv, write_parquet};
use crate::{
    product::{Content, Declaration, Role},
    table::{Column, Table, Unit, column, meanings},
};
use areograph_stages::calibrate::ImageResult;

pub(super) static TABLE: Declaration<WriteCalibration> = Declaration {
    path: "residuals.parquet",
    what: "every image position with its residuals before and after the calibration",
    readers: "scripts",
    rows: "image positions",
    role: Role::Data,
    content: Content::Table(|| meanings(&columns())),
    write: |path, of| write_parquet(path, of, &table(of)),
    uses: &[],
};

pub(super) static CSV: Declaration<WriteCalibration> = Declaration {
    path: "residuals.csv",
    what: "image positions with their residuals, as CSV",
    readers: "spreadsheets, scripts",
    rows: "image positions",
    role: Role::Data,
    content: Content::Table(|| meanings(&columns())),
    write: |path, of| write_csv(path, table(of)),
    uses: &[],
};

fn table<'a>(of: &CalibrationProducts<'a>) -> Table<'a> {
    Table::new(columns(), of.result.images.iter().collect())
}

fn columns<'a>() -> Vec<Column<&'a ImageResult>> {
    type Row<'a> = &'a ImageResult;
    vec![
        column("point", Unit::None, "name of the point", |row: &Row| {
            row.point.clone()
        }),
        column(
            "kind",
            Unit::None,
            "kind of point: tie, control (used) or held_back (withheld for validation)",
            |row: &Row| row.kind.word().to_owned(),
        ),
        column("camera", Unit::None, "line of the camera", |row: &Row| {
            row.camera.clone()
        }),
        column(
            "line",
            Unit::Line,
            "measured line coordinate, 0 at the outer edge of the first line",
            |row: &Row| row.place[0],
        ),
        column(
            "sample",
            Unit::Pixel,
            "measured sample coordinate, 0 at the outer edge of the first sample",
            |row: &Row| row.place[1],
        ),
        column(
            "left_out",
            Unit::None,
            "whether the point was rejected",
            |row: &Row| row.left_out,
        ),
        column(
            "before_across_px",
            Unit::Pixel,
            "position computed with the uncalibrated camera (for a laser point, from its given coordinates) minus \
             measured position, across the flight, pixels",
            |row: &Row| row.before_px.map(|before_px| before_px[0]),
        ),
        column(
            "before_along_px",
            Unit::Pixel,
            "position computed with the uncalibrated camera (for a laser point, from its given coordinates) minus \
             measured position, along the flight, pixels",
            |row: &Row| row.before_px.map(|before_px| before_px[1]),
        ),
        column(
            "after_across_px",
            Unit::Pixel,
            "position computed with the calibrated camera and orbit (for a laser point, from its given coordinates) \
             minus measured position, across the flight, pixels",
            |row: &Row| row.after_px.map(|after_px| after_px[0]),
        ),
        column(
            "after_along_px",
            Unit::Pixel,
            "position computed with the calibrated camera and orbit (for a laser point, from its given coordinates) \
             minus measured position, along the flight, pixels",
            |row: &Row| row.after_px.map(|after_px| after_px[1]),
        ),
    ]
}
