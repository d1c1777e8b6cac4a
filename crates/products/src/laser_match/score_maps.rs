//! Score maps: the similarity of laser and model heights over all shifts of a unit.

use super::{WriteMatch, natural, write_parquet};
use crate::{
    product::{Content, Declaration, Role},
    table::{Column, Meaning, Table, Unit, column, meanings},
};
use areograph_stages::match_laser::{LaserMatch, SimilaritySurface};

pub(super) static TABLE: Declaration<WriteMatch> = Declaration {
    path: "score_maps.parquet",
    what: WHAT,
    readers: "scripts",
    rows: "shifts",
    role: Role::Data,
    content: Content::Table(meaning),
    write: |path, of| write_parquet(path, of, &table(of.result)),
    uses: &[],
};

pub(crate) const WHAT: &str = "similarity of the heights of laser and terrain model over the shifts of every searched unit (Li et al. 2023, figure 7)";

/// Meanings of the columns.
pub(crate) fn meaning() -> Vec<Meaning> {
    meanings(&columns())
}

/// The score maps of a match.
pub(crate) fn table(of: &LaserMatch) -> Table<'_> {
    let maps = of.units.iter().filter_map(|unit| {
        let map = unit.similarity.as_ref()?;
        let (side, reach) = (i64::from(map.side()), i64::from(map.reach));
        let step = i64::from(map.step_cells);
        let rows = map.levels.iter().zip(0..).filter_map(move |(level, at)| {
            let share = SimilaritySurface::share(*level)?;
            Some(Row {
                unit: unit.unit,
                // Rows run southwards.
                shift_cells: [(at % side - reach) * step, (reach - at / side) * step],
                similarity: 1.0 - (1.0 - share).powi(2),
            })
        });
        Some(rows)
    });
    Table::new(columns(), maps.flatten().collect())
}

/// A shift of a unit.
struct Row {
    unit: usize,
    shift_cells: [i64; 2],
    similarity: f64,
}

fn columns() -> Vec<Column<Row>> {
    vec![
        column("unit", Unit::None, "number of the unit", |row: &Row| {
            natural(row.unit)
        }),
        column(
            "shift_east_cells",
            Unit::None,
            "shift of the ground in the model towards the east, cells",
            |row: &Row| row.shift_cells[0] as f64,
        ),
        column(
            "shift_north_cells",
            Unit::None,
            "shift of the ground in the model towards the north, cells",
            |row: &Row| row.shift_cells[1] as f64,
        ),
        column(
            "similarity",
            Unit::None,
            "similarity of the heights at this shift, in 255 levels; 0 also for smaller values. For searches of more than 70 cells, the \
             best of the neighbouring shifts",
            |row: &Row| row.similarity,
        ),
    ]
}
