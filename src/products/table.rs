//! Columns with names and meanings: what Parquet and CSV files are written from and checked against.

use super::fault::ProductFault;
use crate::error::Result;

/// A table, all columns of one length.
#[derive(Debug)]
pub(super) struct Table {
    pub(super) columns: Vec<Column>,
}

/// A column; its name ends in its unit.
#[derive(Debug)]
pub(super) struct Column {
    pub(super) name: &'static str,
    pub(super) description: &'static str,
    pub(super) values: Values,
}

/// Values of one kind.
#[derive(Debug)]
pub(super) enum Values {
    F64(Vec<f64>),
    /// Numbers that may be missing.
    OptionalF64(Vec<Option<f64>>),
    /// Numbers that CSV prints with a fixed number of decimals, for other people's readers.
    Fixed(Vec<f64>, usize),
    U32(Vec<u32>),
    I32(Vec<i32>),
    Bool(Vec<bool>),
    Text(Vec<String>),
    /// Bytes; CSV has no such columns.
    Binary(Vec<Vec<u8>>),
}

impl Values {
    pub(super) const fn len(&self) -> usize {
        match self {
            Self::F64(values) | Self::Fixed(values, _) => values.len(),
            Self::OptionalF64(values) => values.len(),
            Self::U32(values) => values.len(),
            Self::I32(values) => values.len(),
            Self::Bool(values) => values.len(),
            Self::Text(values) => values.len(),
            Self::Binary(values) => values.len(),
        }
    }

    /// The first row that is not a finite number.
    fn not_finite(&self) -> Option<usize> {
        match self {
            Self::F64(values) | Self::Fixed(values, _) => {
                values.iter().position(|value| !value.is_finite())
            }
            Self::OptionalF64(values) => values
                .iter()
                .position(|value| value.is_some_and(|value| !value.is_finite())),
            _ => None,
        }
    }
}

impl Column {
    pub(super) const fn new(name: &'static str, description: &'static str, values: Values) -> Self {
        Self {
            name,
            description,
            values,
        }
    }
}

impl Table {
    /// The table, its lengths and numbers checked.
    ///
    /// # Errors
    /// Columns of different length, numbers that are not finite.
    pub(super) fn new(columns: Vec<Column>) -> Result<Self> {
        let table = Self { columns };
        let rows = table.rows();
        for column in &table.columns {
            if column.values.len() != rows {
                return Err(ProductFault::Inconsistent {
                    what: format!("rows of column {}", column.name),
                    found: column.values.len(),
                    expected: rows,
                }
                .into());
            }
            if let Some(row) = column.values.not_finite() {
                return Err(ProductFault::NotFinite {
                    what: format!("column {}, row {} of {rows}", column.name, row + 1),
                }
                .into());
            }
        }
        Ok(table)
    }

    pub(super) fn rows(&self) -> usize {
        self.columns.first().map_or(0, |column| column.values.len())
    }
}
