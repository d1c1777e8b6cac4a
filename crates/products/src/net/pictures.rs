//! Pictures on the map.

use super::{NetProducts, WriteNet, write_csv, write_parquet};
use crate::{
    coordinates::degrees,
    product::{Content, Declaration, Role},
    table::{Column, Table, Unit, column, meanings},
};
use areograph_stages::triangulate::PictureResult;

pub(super) static TABLE: Declaration<WriteNet> = Declaration {
    path: "pictures.parquet",
    what: "the four coefficients, scale, angle and position of every picture",
    readers: "scripts",
    rows: "pictures",
    role: Role::Data,
    content: Content::Table(|| meanings(&columns())),
    write: |path, of| write_parquet(path, of, &table(of)),
    uses: &[],
};

pub(super) static CSV: Declaration<WriteNet> = Declaration {
    path: "pictures.csv",
    what: "coefficients, scale, angle and position of every picture, as CSV",
    readers: "spreadsheets, scripts",
    rows: "pictures",
    role: Role::Data,
    content: Content::Table(|| meanings(&columns())),
    write: |path, of| write_csv(path, table(of)),
    uses: &[],
};

fn table<'a>(of: &NetProducts<'a>) -> Table<'a> {
    Table::new(columns(), of.result.pictures.iter().collect())
}

fn columns<'a>() -> Vec<Column<&'a PictureResult>> {
    type Row<'a> = &'a PictureResult;
    vec![
        column("picture", Unit::None, "name of the picture", |row: &Row| {
            row.picture.clone()
        }),
        column(
            "brick",
            Unit::None,
            "name of the brick that contains the picture",
            |row: &Row| row.brick.clone(),
        ),
        column(
            "p",
            Unit::None,
            "P of X = P x − Q y + A, Y = P y + Q x + B (eq. 3 of Arthur & McMacken 1977), metres per unit of the picture",
            |row: &Row| row.coefficients[0],
        ),
        column("q", Unit::None, "Q, metres per unit", |row: &Row| {
            row.coefficients[1]
        }),
        column("a_m", Unit::Metre, "A, metres", |row: &Row| {
            row.coefficients[2]
        }),
        column("b_m", Unit::Metre, "B, metres", |row: &Row| {
            row.coefficients[3]
        }),
        column(
            "metres_per_unit",
            Unit::None,
            "length of a picture unit on the map, metres",
            |row: &Row| row.coefficients[0].hypot(row.coefficients[1]),
        ),
        column(
            "angle_deg",
            Unit::Degree,
            "angle from east to the picture's x axis, anticlockwise, degrees",
            |row: &Row| degrees(row.angle_rad),
        ),
        column(
            "sigma_scale",
            Unit::None,
            "standard deviation of the scale (as a fraction of the scale), equal to that of the angle (radians)",
            |row: &Row| row.sigma_scale,
        ),
        column(
            "x_m",
            Unit::Metre,
            "east coordinate of the middle of the measured points on the map, metres",
            |row: &Row| row.centre_m[0],
        ),
        column(
            "y_m",
            Unit::Metre,
            "north coordinate of the middle of the measured points on the map, metres",
            |row: &Row| row.centre_m[1],
        ),
        column(
            "longitude_deg",
            Unit::Degree,
            "east longitude of the middle of the measured points, -180 to 180 degrees",
            |row: &Row| degrees(row.centre_rad[0]),
        ),
        column(
            "latitude_deg",
            Unit::Degree,
            "areocentric latitude of the middle of the measured points, degrees",
            |row: &Row| degrees(row.centre_rad[1]),
        ),
        column(
            "sigma_m",
            Unit::Metre,
            "standard deviation of x_m and of y_m, metres",
            |row: &Row| row.sigma_m,
        ),
        column(
            "ties",
            Unit::None,
            "number of points that the picture shares with other pictures",
            |row: &Row| row.ties,
        ),
        column(
            "deviation_rms_m",
            Unit::Metre,
            "root mean square, per coordinate, of the deviations of the picture's ties from their means, metres",
            |row: &Row| row.deviation_rms_m,
        ),
        column(
            "projection_floor_m",
            Unit::Metre,
            "projection floor: departure of an orthographic picture of this size from a similarity on the map, metres; lower \
             limit for any adjustment",
            |row: &Row| row.projection_floor_m,
        ),
    ]
}
