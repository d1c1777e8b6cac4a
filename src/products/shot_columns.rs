//! Shots of an archive as columns of a table that is queried: those of `footprints.parquet` that need neither windows
//! nor kernels.

use arrow_array::{RecordBatch, RecordBatchOptions};
use arrow_schema::SchemaRef;

use super::{
    error::ProductError,
    footprints::{Shot, ShotNames, columns},
    parquet,
    table::Table,
};
use crate::{error::Result, footprints::Footprints, frames::BodyFixed};

/// What is asked of a shot, in the order of the answer.
#[derive(Debug, Clone)]
pub struct ShotColumns {
    /// Places among all columns.
    places: Vec<usize>,
    schema: SchemaRef,
}

/// Shots that no window was asked for, of unknown UTC.
struct Nameless;

impl ShotNames for Nameless {
    fn windows(&self, _row: usize) -> String {
        String::new()
    }

    fn utc(&self, _row: usize) -> String {
        String::new()
    }
}

fn table(shots: Vec<Shot<'_>>) -> Table<'_> {
    Table::new(columns(), shots)
        .for_parquet()
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

impl ShotColumns {
    /// Those at these places alone, in this order.
    #[must_use]
    pub fn pick(&self, places: &[usize]) -> Self {
        let places = places.iter().filter_map(|place| self.places.get(*place));
        let places: Vec<usize> = places.copied().collect();
        let schema = parquet::schema(&table(Vec::new()).pick(&places));
        Self { places, schema }
    }

    /// Names and types; units and descriptions are the fields' metadata.
    #[must_use]
    pub fn schema(&self) -> SchemaRef {
        SchemaRef::clone(&self.schema)
    }

    /// The values of these shots.
    ///
    /// # Errors
    /// A number that is not finite.
    pub fn batch(&self, footprints: &Footprints<BodyFixed>) -> Result<RecordBatch> {
        let rows = footprints.len();
        if self.places.is_empty() {
            let rows = RecordBatchOptions::new().with_row_count(Some(rows));
            let batch = RecordBatch::try_new_with_options(self.schema(), Vec::new(), &rows);
            return Ok(batch.map_err(ProductError::refused("assemble columns"))?);
        }
        let table = table(Shot::all_of(footprints, &Nameless)).pick(&self.places);
        Ok(parquet::record_batch(&table, &self.schema, 0..rows)?)
    }
}
