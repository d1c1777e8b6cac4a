//! Control points: positions by the laser and in the model.

use super::{MatchProducts, WriteMatch, natural, write_parquet};
use crate::{
    coordinates::{degrees, signed_longitude_deg},
    product::{Content, Declaration, Role},
    table::{Column, Table, Unit, column, meanings},
    text_table,
};
use areograph_base::units::wrap_two_pi;
use areograph_stages::match_laser::MatchedPoint;

pub(super) static TABLE: Declaration<WriteMatch> = Declaration {
    path: "control_points.parquet",
    what: "laser control points of the kept units, with positions from the laser and in the model",
    readers: "scripts",
    rows: "points",
    role: Role::Data,
    content: Content::Table(|| meanings(&columns())),
    write: |path, of| write_parquet(path, of, &table(of)),
    uses: &[],
};

pub(super) static CSV: Declaration<WriteMatch> = Declaration {
    path: "control_points.csv",
    what: "laser control points of the kept units, as CSV",
    readers: "spreadsheets, scripts",
    rows: "points",
    role: Role::Data,
    content: Content::Table(|| meanings(&columns())),
    write: |path, of| text_table::write(path, table(of)),
    uses: &[],
};

fn table<'a>(of: &MatchProducts<'a>) -> Table<'a> {
    Table::new(columns(), of.result.points.iter().collect())
}

type Row<'a> = &'a MatchedPoint;

fn columns<'a>() -> Vec<Column<Row<'a>>> {
    vec![
        column(
            "point",
            Unit::None,
            "PEDR file, record and number of the used shot of the unit whose height residual is closest to the unit's \
             bias",
            |row: &Row| row.name.clone(),
        ),
        column("unit", Unit::None, "number of the unit", |row: &Row| {
            natural(row.unit)
        }),
        column(
            "longitude_deg",
            Unit::Degree,
            "east longitude from the laser, IAU 2000, -180 to 180 degrees",
            |row: &Row| signed_longitude_deg(wrap_two_pi(row.laser[0])),
        ),
        column(
            "latitude_deg",
            Unit::Degree,
            "areocentric latitude from the laser, degrees",
            |row: &Row| degrees(row.laser[1]),
        ),
        column(
            "radius_m",
            Unit::Metre,
            "distance from the centre of Mars according to the laser, metres",
            |row: &Row| row.laser[2],
        ),
        column(
            "model_longitude_deg",
            Unit::Degree,
            "east longitude of the same ground in the model: the laser's position plus the shift of the unit",
            |row: &Row| signed_longitude_deg(wrap_two_pi(row.model[0])),
        ),
        column(
            "model_latitude_deg",
            Unit::Degree,
            "areocentric latitude of the same ground in the model: the laser's position plus the shift of the unit",
            |row: &Row| degrees(row.model[1]),
        ),
        column(
            "model_radius_m",
            Unit::Metre,
            "distance of the terrain model from the centre of Mars at the shifted position, metres",
            |row: &Row| row.model[2],
        ),
        column(
            "sigma_east_m",
            Unit::Metre,
            "standard deviation of model minus laser towards east, from the matching only, metres",
            |row: &Row| row.sigma_m[0],
        ),
        column(
            "sigma_north_m",
            Unit::Metre,
            "standard deviation of model minus laser towards north, from the matching only, metres",
            |row: &Row| row.sigma_m[1],
        ),
        column(
            "sigma_up_m",
            Unit::Metre,
            "standard deviation of model minus laser in height, from the matching only, metres",
            |row: &Row| row.sigma_m[2],
        ),
    ]
}
