//! The table of laser control that `areograph calibrate` reads: image coordinates of points with laser positions.

use super::WriteMatch;
use crate::{
    coordinates::{degrees, signed_longitude_deg},
    product::{Content, Declaration, Role},
    table::{Column, Meaning, Table, Unit, column, meanings},
    text_table,
};
use areograph_base::units::wrap_two_pi;
use areograph_stages::match_laser::{LaserMatch, MatchedPoint};

pub(super) static CONTROL: Declaration<WriteMatch> = Declaration {
    path: "control.csv",
    what: "the control points in the images given with `--isd`, for `[control] files` of a calibration",
    readers: "areograph calibrate",
    rows: "image positions",
    role: Role::Data,
    content: Content::Table(meaning),
    write: |path, of| text_table::write(path, table(of.result)),
    uses: &[],
};

/// The table of the control points of a match.
pub(crate) fn table(of: &LaserMatch) -> Table<'_> {
    Table::new(columns(), rows(of))
}

/// Meanings of its columns.
pub(crate) fn meaning() -> Vec<Meaning> {
    meanings(&columns())
}

/// A point in an image.
struct Row<'a> {
    point: &'a MatchedPoint,
    image: &'a str,
    place: [f64; 2],
}

fn rows(of: &LaserMatch) -> Vec<Row<'_>> {
    let mut rows = Vec::new();
    for point in &of.points {
        for (image, place) in of.images.iter().zip(&point.in_images) {
            rows.extend(place.map(|place| Row {
                point,
                image,
                place,
            }));
        }
    }
    rows
}

fn columns<'a>() -> Vec<Column<Row<'a>>> {
    vec![
        column("point", Unit::None, "name of the point", |row: &Row| {
            row.point.name.clone()
        }),
        column("camera", Unit::None, "name of the image", |row: &Row| {
            row.image.to_owned()
        }),
        column(
            "line",
            Unit::Line,
            "image line of the position in the model, 0 at the outer edge of the first line",
            |row: &Row| row.place[0],
        ),
        column(
            "sample",
            Unit::Pixel,
            "image sample of the position in the model, 0 at the outer edge of the first sample",
            |row: &Row| row.place[1],
        ),
        column(
            "longitude_deg",
            Unit::Degree,
            "east longitude from the laser, -180 to 180 degrees",
            |row: &Row| signed_longitude_deg(wrap_two_pi(row.point.laser[0])),
        ),
        column(
            "latitude_deg",
            Unit::Degree,
            "areocentric latitude from the laser, degrees",
            |row: &Row| degrees(row.point.laser[1]),
        ),
        column(
            "radius_m",
            Unit::Metre,
            "distance from the centre of Mars according to the laser, metres",
            |row: &Row| row.point.laser[2],
        ),
        column(
            "sigma_matching_horizontal_m",
            Unit::Metre,
            "standard deviation from the matching of a horizontal coordinate, root mean square of east and north, \
             metres; calibrations add the laser's own error",
            |row: &Row| row.point.sigma_horizontal_m(),
        ),
        column(
            "sigma_matching_vertical_m",
            Unit::Metre,
            "standard deviation from the matching of the radius, metres; calibrations add the laser's own error",
            |row: &Row| row.point.sigma_m[2],
        ),
    ]
}
