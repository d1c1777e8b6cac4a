//! Comma-separated tables with a header line: valid rows, and complaints about the others.

use std::{fs, path::Path};

use areograph_base::error::{Cause, IoError, Kind, Locate, Result};

/// Rows of a file, and complaints about the rejected ones.
#[derive(Debug, Clone, PartialEq)]
pub struct Rows<T> {
    /// Rows in order.
    pub rows: Vec<T>,
    /// Invalid rows: line of the file from 1, and the expected content.
    pub complaints: Vec<(u64, String)>,
}

/// A file that is not such a table.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub(super) enum TableError {
    #[error("column {column} is missing; expected the columns {expected}")]
    Column {
        column: &'static str,
        expected: &'static str,
    },
    #[error("the unit of column {column} is unknown; expected the columns {expected}")]
    Unit {
        column: String,
        expected: &'static str,
    },
    #[error("the table cannot be read: {0}")]
    Table(String),
    #[error("none of its rows can be read ({rows} in all); line {line}: {text}")]
    Unreadable {
        rows: usize,
        line: u64,
        text: String,
    },
}

/// The error with the file that describes the columns.
#[derive(Debug, thiserror::Error)]
#[error("{error}")]
struct Refused {
    error: TableError,
    example: &'static str,
}

impl Cause for Refused {
    fn kind(&self) -> Kind {
        Kind::Input
    }

    fn advice(&self) -> String {
        match self.error {
            TableError::Unit { .. } => {
                "give the coordinates in one of these units, and state the unit in the column name"
                    .to_owned()
            }
            _ => format!(
                "give a comma-separated table with a header line; {} describes its columns",
                self.example
            ),
        }
    }
}

/// Reads a table whose rows `take`, made from the header, converts to values.
///
/// `example` is the file that describes the columns.
///
/// # Errors
/// The file cannot be read; missing columns; a table without a readable row.
pub(super) fn read_rows<T, F>(
    path: &Path,
    example: &'static str,
    take: impl Fn(&csv::StringRecord) -> std::result::Result<F, TableError>,
) -> Result<Rows<T>>
where
    F: Fn(&csv::StringRecord) -> std::result::Result<T, String>,
{
    let bytes = fs::read(path).map_err(IoError::on("read")).in_file(path)?;
    parse(&bytes, take)
        .map_err(|error| Refused { error, example })
        .in_file(path)
}

fn parse<T, F>(
    bytes: &[u8],
    take: impl Fn(&csv::StringRecord) -> std::result::Result<F, TableError>,
) -> std::result::Result<Rows<T>, TableError>
where
    F: Fn(&csv::StringRecord) -> std::result::Result<T, String>,
{
    let mut reader = csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .comment(Some(b'#'))
        .from_reader(bytes);
    let header = reader
        .headers()
        .map_err(|error| TableError::Table(error.to_string()))?;
    let take = take(&header.clone())?;
    let (mut rows, mut complaints) = (Vec::new(), Vec::new());
    for record in reader.into_records() {
        let (line, taken) = match &record {
            Ok(record) => (record.position(), take(record)),
            Err(error) => (error.position(), Err(error.to_string())),
        };
        match taken {
            Ok(row) => rows.push(row),
            Err(text) => complaints.push((line.map_or(0, csv::Position::line), text)),
        }
    }
    match complaints.first() {
        Some((line, text)) if rows.is_empty() => Err(TableError::Unreadable {
            rows: complaints.len(),
            line: *line,
            text: text.clone(),
        }),
        _ => Ok(Rows { rows, complaints }),
    }
}

/// Positions of these columns in the header.
pub(super) fn columns<const N: usize>(
    header: &csv::StringRecord,
    names: [&'static str; N],
    expected: &'static str,
) -> std::result::Result<[usize; N], TableError> {
    let mut places = [0; N];
    for (place, column) in places.iter_mut().zip(names) {
        let found = header.iter().position(|column_name| column_name == column);
        *place = found.ok_or(TableError::Column { column, expected })?;
    }
    Ok(places)
}

/// The text of a required column, or `expected`.
pub(super) fn name(
    row: &csv::StringRecord,
    column: usize,
    expected: &str,
) -> std::result::Result<String, String> {
    match row.get(column) {
        Some(name) if !name.is_empty() => Ok(name.to_owned()),
        _ => Err(expected.to_owned()),
    }
}

/// Finite numbers of columns.
pub(super) fn numbers(
    row: &csv::StringRecord,
    columns: &[usize],
) -> std::result::Result<Vec<f64>, String> {
    let number = |column: &usize| {
        let text = row.get(*column).unwrap_or_default();
        let number = text.parse().ok().filter(|number: &f64| number.is_finite());
        number.ok_or_else(|| format!("{text:?} is not a number"))
    };
    columns.iter().map(number).collect()
}
