//! Tables of a cube: rows of numbers, described in its label.
//!
//! # Source
//! `Table` of ISIS (class documentation): fields of a record follow each other in the byte order of the table, byte
//! numbers count from 1.

use std::{fmt::Display, fs::File, os::unix::fs::FileExt as _};

use super::error::CubeError;
use crate::label::Label;
use areograph_base::error::{IoError, Result};

/// Largest table, bytes: a row of eight numbers for each of 52 000 lines takes 3 MB.
pub(super) const BYTES_MAX: u64 = 1 << 26;
/// Bytes of a number.
const DOUBLE: usize = 8;

/// A table of numbers.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Table {
    pub(super) name: String,
    /// Keywords of its description, upper case, with their values.
    keywords: Vec<(String, String)>,
    /// Names of its fields.
    pub(super) fields: Vec<String>,
    /// A row for each record.
    pub(super) rows: Vec<Vec<f64>>,
}

impl Table {
    /// The table `name` of a cube; `None` if it has none.
    ///
    /// # Errors
    /// An invalid description; a file that is too short for it; the system's refusal to read.
    pub(super) fn read(label: &Label, file: &File, name: &str) -> Result<Option<Self>> {
        let Some(mut table) = described(label, name) else {
            return Ok(None);
        };
        let columns = table.fields.len() as u64;
        let records = table.count("RECORDS")?;
        let bytes = table.count("BYTES")?;
        let start = table.count("STARTBYTE")?;
        let expected = records
            .saturating_mul(columns)
            .saturating_mul(DOUBLE as u64);
        if records == 0 || start == 0 || bytes != expected || bytes > BYTES_MAX {
            let expected = format!(
                "{expected} bytes for {records} records of {columns} numbers, at most {BYTES_MAX} bytes"
            );
            Err(table.refused("Bytes", bytes, expected))?;
        }
        let is_lsb = match table.keyword("BYTEORDER").to_ascii_lowercase().as_str() {
            "lsb" => true,
            "msb" => false,
            other => Err(table.refused("ByteOrder", other, "Lsb or Msb"))?,
        };
        let content = read_bytes(file, &table.object(), [start, bytes])?;
        let (numbers, _) = content.as_chunks::<DOUBLE>();
        let number = |bytes: &[u8; DOUBLE]| {
            if is_lsb {
                f64::from_le_bytes(*bytes)
            } else {
                f64::from_be_bytes(*bytes)
            }
        };
        let rows = numbers.chunks(table.fields.len());
        table.rows = rows.map(|row| row.iter().map(number).collect()).collect();
        let all = table.rows.iter().enumerate();
        for (row, numbers) in all {
            if let Some(number) = numbers.iter().find(|number| !number.is_finite()) {
                let expected = format!("finite numbers; the invalid number is in record {row}");
                return Err(table.refused("Records", number, expected).into());
            }
        }
        Ok(Some(table))
    }

    /// Its description in messages.
    fn object(&self) -> String {
        format!("table {}", self.name)
    }

    /// The value of a keyword (upper case); empty without it.
    pub(super) fn keyword(&self, key: &str) -> &str {
        let mut found = self.keywords.iter().filter(|(name, _)| name == key);
        found.next().map_or("", |(_, value)| value)
    }

    /// The numbers of a keyword with a list; `None` without it.
    ///
    /// # Errors
    /// Another number of them, or text.
    pub(super) fn numbers(
        &self,
        key: &str,
        count: usize,
    ) -> std::result::Result<Option<Vec<f64>>, CubeError> {
        let text = self.keyword(key);
        if text.is_empty() {
            return Ok(None);
        }
        let numbers = text.split(',').map(|number| number.trim().parse().ok());
        let numbers: Option<Vec<f64>> = numbers.collect();
        let numbers = numbers.filter(|numbers| {
            numbers.len() == count && numbers.iter().all(|number| number.is_finite())
        });
        match numbers {
            Some(numbers) => Ok(Some(numbers)),
            None => Err(self.refused(key, text, format!("{count} numbers"))),
        }
    }

    /// The whole numbers of a keyword with a list; empty without it.
    pub(super) fn codes(&self, key: &str) -> std::result::Result<Vec<i64>, CubeError> {
        let text = self.keyword(key);
        let codes = text
            .split(',')
            .map(str::trim)
            .filter(|code| !code.is_empty());
        let codes: Option<Vec<i64>> = codes.map(|code| code.parse().ok()).collect();
        codes.ok_or_else(|| self.refused(key, text, "codes of frames"))
    }

    #[allow(
        clippy::needless_pass_by_value,
        reason = "words and numbers that messages show"
    )]
    pub(super) fn refused(
        &self,
        key: &str,
        value: impl Display,
        expected: impl Display,
    ) -> CubeError {
        CubeError::Table {
            object: self.object(),
            key: key.to_owned(),
            value: value.to_string(),
            expected: expected.to_string(),
        }
    }

    fn count(&self, key: &'static str) -> std::result::Result<u64, CubeError> {
        let text = self.keyword(key);
        let count = text.parse().ok();
        count.ok_or_else(|| self.refused(key, format!("{text:?}"), "a count"))
    }
}

/// The bytes of an object, from its `[StartByte, Bytes]`, which the caller has limited to [`BYTES_MAX`] from byte 1 on.
pub(super) fn read_bytes(file: &File, object: &str, [start, bytes]: [u64; 2]) -> Result<Vec<u8>> {
    let found = file.metadata().map_err(IoError::on("read"))?.len();
    let needed = start.saturating_add(bytes) - 1;
    if needed > found {
        Err(CubeError::Short {
            object: object.to_owned(),
            needed,
            found,
        })?;
    }
    let mut content = vec![0; usize::try_from(bytes).unwrap_or_default()];
    file.read_exact_at(&mut content, start - 1)
        .map_err(IoError::on("read"))?;
    Ok(content)
}

/// The description of a table, without its rows.
fn described(label: &Label, name: &str) -> Option<Table> {
    let is_named = |entry: &&crate::label::Entry| {
        entry.group == "TABLE" && entry.key == "NAME" && entry.value.eq_ignore_ascii_case(name)
    };
    let first = label.entries.iter().position(|entry| is_named(&entry))?;
    let block = label.entries[first].block;
    let own = label.entries.iter().filter(|entry| entry.block == block);
    let keywords = own.map(|entry| (entry.key.clone(), entry.value.clone()));
    // Fields are groups inside of the table, and follow its keywords.
    let after = label.entries.iter().filter(|entry| entry.block > block);
    let fields: Vec<&crate::label::Entry> =
        after.take_while(|entry| entry.group == "FIELD").collect();
    let values = |key: &str| {
        let values = fields.iter().filter(|entry| entry.key == key);
        values.map(|entry| entry.value.clone()).collect::<Vec<_>>()
    };
    let are_numbers = values("TYPE")
        .iter()
        .all(|kind| kind.eq_ignore_ascii_case("double"))
        && values("SIZE").iter().all(|size| size == "1");
    Some(Table {
        name: name.to_owned(),
        keywords: keywords.collect(),
        // Without fields of numbers the number of bytes never fits.
        fields: if are_numbers {
            values("NAME")
        } else {
            Vec::new()
        },
        rows: Vec::new(),
    })
}
