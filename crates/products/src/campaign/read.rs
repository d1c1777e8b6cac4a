//! Reads the tables of a campaign for queries.

use std::{fs, path::Path, sync::Arc};

use ::parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use arrow_array::{ArrayRef, RecordBatch, StringArray};
use arrow_schema::{DataType, Field, Schema, SchemaRef};

use super::{PART, PHASE};
use crate::{error::ProductError, files::open};
use areograph_base::error::{Cause, IoError, Locate, Result};

/// Names of the tables.
const CAMPAIGN_TABLES: [&str; 4] = ["sites", "images", "pairs", "profiles"];

/// A table of a campaign.
#[derive(Debug, Clone)]
pub struct CampaignTable {
    /// Its name.
    pub name: &'static str,
    /// Its columns: the phase, then those of the files.
    pub schema: SchemaRef,
    /// Its rows, phase by phase.
    pub batches: Vec<RecordBatch>,
}

/// A folder that is not a table.
#[derive(Debug, thiserror::Error, Cause)]
enum TableError {
    #[error("contains no part of a table; expected folders {PHASE}=… with {PART}")]
    #[cause(Input: "name the folder `campaign` of complete results")]
    NoParts,
    #[error("has other columns than the first part of the table")]
    #[cause(Input: "publish the results of the campaign again")]
    Differs,
}

/// Whether a folder contains the tables of a campaign.
#[must_use]
pub fn is_campaign(folder: &Path) -> bool {
    CAMPAIGN_TABLES
        .iter()
        .all(|table| folder.join(table).is_dir())
}

/// Reads all tables of the campaign whose results are in `folder`.
///
/// # Errors
/// Missing, damaged or foreign files.
pub fn read_campaign_tables(folder: &Path) -> Result<Vec<CampaignTable>> {
    let tables = CAMPAIGN_TABLES.iter();
    tables.map(|name| read_table(folder, name)).collect()
}

fn read_table(folder: &Path, name: &'static str) -> Result<CampaignTable> {
    let folder = folder.join(name);
    let entries = fs::read_dir(&folder)
        .map_err(IoError::on("list"))
        .in_file(&folder)?;
    let mut phases = Vec::new();
    for entry in entries {
        let name = entry
            .map_err(IoError::on("list"))
            .in_file(&folder)?
            .file_name();
        let name = name.to_string_lossy().into_owned();
        let phase = name
            .strip_prefix(PHASE)
            .and_then(|rest| rest.strip_prefix('='));
        phases.extend(phase.map(|phase| (decoded(phase), folder.join(&name).join(PART))));
    }
    phases.sort_unstable();
    let mut table: Option<CampaignTable> = None;
    for (phase, path) in phases {
        let reader = ParquetRecordBatchReaderBuilder::try_new(open(&path)?)
            .map_err(ProductError::unreadable)
            .in_file(&path)?;
        let schema = with_phase(reader.schema());
        let table = table.get_or_insert_with(|| CampaignTable {
            name,
            schema: Arc::clone(&schema),
            batches: Vec::new(),
        });
        if table.schema.fields() != schema.fields() {
            return Err(TableError::Differs).in_file(path);
        }
        let batches = reader
            .build()
            .map_err(ProductError::unreadable)
            .in_file(&path)?;
        for batch in batches {
            let batch = batch.map_err(ProductError::unreadable).in_file(&path)?;
            let phases = StringArray::from(vec![phase.as_str(); batch.num_rows()]);
            let columns = [Arc::new(phases) as ArrayRef]
                .into_iter()
                .chain(batch.columns().iter().cloned());
            let batch = RecordBatch::try_new(Arc::clone(&table.schema), columns.collect())
                .map_err(ProductError::unreadable)
                .in_file(&path)?;
            table.batches.push(batch);
        }
    }
    table.ok_or(TableError::NoParts).in_file(folder)
}

/// The columns with the phase before them.
fn with_phase(schema: &SchemaRef) -> SchemaRef {
    let phase = Arc::new(Field::new(PHASE, DataType::Utf8, false));
    let fields = [phase].into_iter().chain(schema.fields().iter().cloned());
    Arc::new(Schema::new(fields.collect::<Vec<_>>()))
}

/// A phase from the name of its folder.
fn decoded(name: &str) -> String {
    let mut bytes = Vec::new();
    let mut rest = name.as_bytes();
    while let [first, tail @ ..] = rest {
        let digits = tail
            .get(..2)
            .and_then(|digits| std::str::from_utf8(digits).ok());
        let byte = digits.and_then(|digits| u8::from_str_radix(digits, 16).ok());
        let encoded = byte.filter(|_| *first == b'%');
        bytes.push(encoded.unwrap_or(*first));
        rest = if encoded.is_some() { &tail[2..] } else { tail };
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::in_folder_name;

    #[test]
    fn phases_come_back_from_names_of_folders() {
        for phase in ["E02", "MAPPING PHASE", "../a=b%", "%41", "Ω"] {
            assert_eq!(decoded(&in_folder_name(phase)), phase);
        }
        assert_eq!(decoded("50%"), "50%");
    }
}
