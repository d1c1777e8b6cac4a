//! Shots of an archive as columns of a table that is queried: columns of `footprints.parquet` that need neither windows
//! nor kernels.

use std::{fmt, sync::Arc};

use arrow_array::{RecordBatch, RecordBatchOptions};
use arrow_schema::SchemaRef;

use super::{
    error::ProductError,
    footprints::{Shot, ShotNames, columns},
    parquet,
    table::Table,
};
use areograph_base::{
    error::Result,
    footprints::{AsRead, Footprints, SourceFile},
    terms::Terms,
};
use areograph_sql::Columns;
use areograph_stages::convert_datum::convert_at_tags;

/// Columns queried of a shot, in the order of the answer.
#[derive(Debug, Clone)]
pub struct ShotColumns {
    /// Indices among all columns.
    places: Vec<usize>,
    schema: SchemaRef,
}

/// Shots without windows and of unknown UTC.
struct Nameless;

impl ShotNames for Nameless {
    fn write_windows(&self, _row: usize, _out: &mut dyn fmt::Write) -> fmt::Result {
        Ok(())
    }
}

fn table(shots: Vec<Shot<'_>>) -> Table<'_> {
    Table::new(columns(), shots)
        .in_terms(&Terms::MARS)
        .without("utc")
        .without("windows")
}

impl Default for ShotColumns {
    fn default() -> Self {
        let table = table(Vec::new());
        Self {
            places: (0..table.columns().count()).collect(),
            schema: parquet::schema(&table),
        }
    }
}

impl Columns for ShotColumns {
    fn schema(&self) -> SchemaRef {
        SchemaRef::clone(&self.schema)
    }

    fn pick(&self, places: &[usize]) -> Arc<dyn Columns> {
        let places = places.iter().filter_map(|place| self.places.get(*place));
        let places: Vec<usize> = places.copied().collect();
        let schema = parquet::schema(&table(Vec::new()).pick(&places));
        Arc::new(Self { places, schema })
    }

    fn batch(&self, shots: Footprints<AsRead>, files: &[SourceFile]) -> Result<RecordBatch> {
        let rows = shots.len();
        if self.places.is_empty() {
            let rows = RecordBatchOptions::new().with_row_count(Some(rows));
            let batch = RecordBatch::try_new_with_options(self.schema(), Vec::new(), &rows);
            return Ok(batch.map_err(ProductError::refused("assemble columns"))?);
        }
        let shots = convert_at_tags(shots, files);
        let table = table(Shot::all_of(&shots, &Nameless)).pick(&self.places);
        Ok(parquet::record_batch(&table, &self.schema, 0..rows)?)
    }
}
