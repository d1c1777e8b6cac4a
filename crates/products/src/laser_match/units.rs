//! Units of laser shots: results of their search, and why they are kept or not.

use super::{WriteMatch, natural, write_parquet};
use crate::{
    coordinates::{degrees, signed_longitude_deg},
    product::{Content, Declaration, Role},
    table::{Column, Meaning, Table, Unit, column, meanings},
    text_table,
};
use areograph_base::units::wrap_two_pi;
use areograph_stages::match_laser::{LaserMatch, UnitResult};

/// Content of the table.
pub(crate) const WHAT: &str = "units of laser shots: shift, validation by withheld shots, and the reason for rejection of units that are \
                               not kept";

pub(super) static TABLE: Declaration<WriteMatch> = Declaration {
    path: "units.parquet",
    what: WHAT,
    readers: "scripts",
    rows: "units",
    role: Role::Data,
    content: Content::Table(meaning),
    write: |path, of| write_parquet(path, of, &table(of.result)),
    uses: &[],
};

pub(super) static CSV: Declaration<WriteMatch> = Declaration {
    path: "units.csv",
    what: "units of laser shots, as CSV",
    readers: "spreadsheets, scripts",
    rows: "units",
    role: Role::Data,
    content: Content::Table(meaning),
    write: |path, of| text_table::write(path, table(of.result)),
    uses: &[],
};

pub(crate) fn meaning() -> Vec<Meaning> {
    meanings(&columns())
}

/// The units of a match.
pub(crate) fn table(of: &LaserMatch) -> Table<'_> {
    Table::new(columns(), of.units.iter().collect())
}

type Row<'a> = &'a UnitResult;

fn columns<'a>() -> Vec<Column<Row<'a>>> {
    let mut columns = vec![
        column("unit", Unit::None, "number of the unit", |row: &Row| {
            natural(row.unit)
        }),
        column(
            "kept",
            Unit::None,
            "whether the unit is kept and has a control point",
            |row: &Row| row.is_kept(),
        ),
        column(
            "longitude_deg",
            Unit::Degree,
            "east longitude of the middle of the unit, -180 to 180 degrees",
            |row: &Row| signed_longitude_deg(wrap_two_pi(row.place_rad[0])),
        ),
        column(
            "latitude_deg",
            Unit::Degree,
            "areocentric latitude of the middle of the unit, degrees",
            |row: &Row| degrees(row.place_rad[1]),
        ),
        column("shots", Unit::None, "number of shots", |row: &Row| {
            natural(row.shots)
        }),
        column(
            "strips",
            Unit::None,
            "number of passes with shots of the unit",
            |row: &Row| natural(row.strips),
        ),
        column(
            "radius_m",
            Unit::Metre,
            "largest distance of a shot from the middle of the unit, metres",
            |row: &Row| row.radius_m,
        ),
        column(
            "relief_m",
            Unit::Metre,
            "standard deviation of the laser heights of the unit, metres",
            |row: &Row| row.relief_m,
        ),
    ];
    columns.extend(shifts());
    columns.extend(deviations());
    columns.extend(judged());
    columns
}

/// Offset of the model from the laser.
fn shifts<'a>() -> [Column<Row<'a>>; 6] {
    [
        column(
            "shift_east_cells",
            Unit::None,
            "eastward offset of the model from the laser, cells",
            |row: &Row| row.found.map(|found| found.shift_cells[0]),
        ),
        column(
            "shift_north_cells",
            Unit::None,
            "northward offset of the model from the laser, cells",
            |row: &Row| row.found.map(|found| found.shift_cells[1]),
        ),
        column(
            "shift_east_m",
            Unit::Metre,
            "eastward offset of the model from the laser, metres in the middle of the model",
            |row: &Row| row.found.map(|found| found.shift_m[0]),
        ),
        column(
            "shift_north_m",
            Unit::Metre,
            "northward offset of the model from the laser, metres in the middle of the model",
            |row: &Row| row.found.map(|found| found.shift_m[1]),
        ),
        column(
            "shift_longitude_deg",
            Unit::Degree,
            "offset of the model from the laser in longitude, degrees",
            |row: &Row| row.found.map(|found| degrees(found.shift_rad[0])),
        ),
        column(
            "shift_latitude_deg",
            Unit::Degree,
            "offset of the model from the laser in latitude, degrees",
            |row: &Row| row.found.map(|found| degrees(found.shift_rad[1])),
        ),
    ]
}

/// Precision of the offset.
fn deviations<'a>() -> [Column<Row<'a>>; 3] {
    [
        column(
            "sigma_east_m",
            Unit::Metre,
            "standard deviation of the eastward shift, from the omission of single shots, scaled by the scatter of \
             all units, metres",
            |row: &Row| row.found.and_then(|found| Some(found.sigma?.shift_m[0])),
        ),
        column(
            "sigma_north_m",
            Unit::Metre,
            "standard deviation of the northward shift, from the omission of single shots, scaled by the scatter of \
             all units, metres",
            |row: &Row| row.found.and_then(|found| Some(found.sigma?.shift_m[1])),
        ),
        column(
            "sigma_bias_m",
            Unit::Metre,
            "standard deviation of `bias_m`, from the omission of single shots, scaled by the scatter of all units, \
             metres",
            |row: &Row| row.found.and_then(|found| Some(found.sigma?.bias_m)),
        ),
    ]
}

fn judged<'a>() -> [Column<Row<'a>>; 9] {
    [
        column(
            "score",
            Unit::None,
            "similarity at the best whole-cell shift, by the measure that the report states",
            |row: &Row| row.found.map(|found| found.score),
        ),
        column(
            "contrast",
            Unit::None,
            "ratio of the best similarity to the mean of all positive similarities",
            |row: &Row| row.found.map(|found| found.contrast),
        ),
        column(
            "bias_m",
            Unit::Metre,
            "mean height difference of the shifted model and the laser, model minus laser, over the used shots, metres",
            |row: &Row| row.found.map(|found| found.bias_m),
        ),
        column(
            "held_out_shots",
            Unit::None,
            "number of shots withheld from the search; 0 if the model has too few heights at these shots",
            |row: &Row| row.held_out.map_or(0, |held_out| natural(held_out.shots)),
        ),
        column(
            "held_out_before_m",
            Unit::Metre,
            "root mean square of model minus laser heights at the withheld shots without the shift, about the bias of \
             the used shots, metres",
            |row: &Row| row.held_out.map(|held_out| held_out.before_m),
        ),
        column(
            "held_out_after_m",
            Unit::Metre,
            "root mean square of model minus laser heights at the withheld shots with the shift, about the bias of \
             the used shots, metres",
            |row: &Row| row.held_out.map(|held_out| held_out.after_m),
        ),
        column(
            "ccc_before",
            Unit::None,
            "concordance (Li et al. 2023, eq. 18) of model and laser heights at the withheld shots without the shift",
            |row: &Row| row.concordance[0],
        ),
        column(
            "ccc_after",
            Unit::None,
            "concordance of model and laser heights at the withheld shots with the shift",
            |row: &Row| row.concordance[1],
        ),
        column(
            "refused_because",
            Unit::None,
            "reason why the unit is not kept; empty if it is kept",
            |row: &Row| row.refused_because.clone(),
        ),
    ]
}
