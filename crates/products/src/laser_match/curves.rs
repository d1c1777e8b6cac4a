//! Elevation curves: heights of the laser, of the terrain model, and of the shifted model along every pass.

use std::collections::BTreeMap;

use super::{WriteMatch, natural, write_parquet};
use crate::{
    coordinates::{degrees, signed_longitude_deg},
    product::{Content, Declaration, Role},
    table::{Column, Meaning, Table, Unit, column, meanings},
};
use areograph_base::units::wrap_two_pi;
use areograph_stages::match_laser::{LaserMatch, PassShot};

pub(super) static TABLE: Declaration<WriteMatch> = Declaration {
    path: "elevation_curves.parquet",
    what: "elevation curves: heights of the laser, of the terrain model and of the shifted model at every shot within the \
           extent of the model, with distances along the pass (Li et al. 2023, figures 8 and 9)",
    readers: "scripts",
    rows: "shots",
    role: Role::Data,
    content: Content::Table(|| meanings(&columns())),
    write: |path, of| write_parquet(path, of, &Table::new(columns(), rows(of.result, None))),
    uses: &[],
};

/// A shot of a pass; for calibrations, with the height of the model of the first round.
pub(crate) struct Row<'a> {
    pass: usize,
    shot: &'a PassShot,
    first_m: Option<f64>,
}

/// The shots of all passes of a match, with heights of the model that `first` was matched with.
pub(crate) fn rows<'a>(of: &'a LaserMatch, first: Option<&LaserMatch>) -> Vec<Row<'a>> {
    let first = first.into_iter().flat_map(|first| &first.passes);
    let first_m: BTreeMap<&str, f64> = first
        .flat_map(|pass| &pass.shots)
        .filter_map(|shot| Some((&*shot.name, shot.model_m?)))
        .collect();
    let passes = of.passes.iter();
    let rows = passes.flat_map(|pass| pass.shots.iter().map(|shot| (pass.pass, shot)));
    rows.map(|(pass, shot)| Row {
        pass,
        shot,
        first_m: first_m.get(&*shot.name).copied(),
    })
    .collect()
}

/// The columns of a calibration: with the model of the first round.
pub(crate) fn columns_of_rounds<'a>() -> Vec<Column<Row<'a>>> {
    let mut columns = columns();
    columns.push(column(
        "first_round_model_height_m",
        Unit::Metre,
        "height of the terrain model of the first round, before any laser control was used, at the laser's position, above \
         the sphere that the file metadata state as heights_above_m, metres; empty where that model has no height",
        |row: &Row| row.first_m,
    ));
    columns
}

/// Meanings of these.
pub(crate) fn meaning_of_rounds() -> Vec<Meaning> {
    meanings(&columns_of_rounds())
}

fn columns<'a>() -> Vec<Column<Row<'a>>> {
    let mut columns = shots();
    columns.extend(heights());
    columns
}

fn shots<'a>() -> Vec<Column<Row<'a>>> {
    vec![
        column(
            "laser_pass",
            Unit::None,
            "number of the pass, in the order of time",
            |row: &Row| natural(row.pass),
        ),
        column(
            "shot_name",
            Unit::None,
            "PEDR file, record and number of the shot",
            |row: &Row| row.shot.name.clone(),
        ),
        column(
            "distance_m",
            Unit::Metre,
            "distance along the pass from its first shot over the terrain model, on the sphere above which heights are given, \
             metres",
            |row: &Row| row.shot.distance_m,
        ),
        column(
            "longitude_deg",
            Unit::Degree,
            "east longitude from the laser, IAU 2000, -180 to 180 degrees",
            |row: &Row| signed_longitude_deg(wrap_two_pi(row.shot.place_rad[0])),
        ),
        column(
            "latitude_deg",
            Unit::Degree,
            "areocentric latitude from the laser, degrees",
            |row: &Row| degrees(row.shot.place_rad[1]),
        ),
        column(
            "unit",
            Unit::None,
            "number of the unit of the shot; 0 outside units",
            |row: &Row| row.shot.unit.map_or(0, natural),
        ),
        column(
            "withheld",
            Unit::None,
            "whether the shot was withheld from the search for the shift of its unit",
            |row: &Row| row.shot.is_held_out,
        ),
    ]
}

/// Heights, all above one sphere.
fn heights<'a>() -> [Column<Row<'a>>; 3] {
    [
        column(
            "laser_height_m",
            Unit::Metre,
            "height of the shot from the laser above the sphere that the file metadata state as heights_above_m, metres",
            |row: &Row| row.shot.laser_m,
        ),
        column(
            "model_height_m",
            Unit::Metre,
            "height of the terrain model at the laser's position (bilinear between cells), before the match, above the \
             sphere that the file metadata state as heights_above_m, metres; empty where the model has no height",
            |row: &Row| row.shot.model_m,
        ),
        column(
            "shifted_model_height_m",
            Unit::Metre,
            "height of the terrain model at the laser's position plus the shift of the unit, above the sphere that the file \
             metadata state as heights_above_m, metres; the bias of the unit is not removed; empty outside kept units",
            |row: &Row| row.shot.shifted_model_m,
        ),
    ]
}
