//! Tables as CSV files: shortest digits that give the same number back, or fixed decimals.

use std::{io::Write, path::Path};

use super::{
    error::ProductError,
    files::{create, finish, open},
    table::{Meaning, Table, Values},
};
use crate::error::{Error, IoError, Locate, Result};

/// Writes the columns of `table` that are no bytes, and reads them back.
///
/// # Errors
/// Numbers that are not finite; what the disk refuses; values that come back different.
pub(super) fn write(path: &Path, table: Table) -> Result<u64> {
    let table = table.for_text();
    let mut file = create(path)?;
    encode(&mut file, &table).in_file(path)?;
    finish(path, file)?;
    read_back(path, &table).in_file(path)?;
    Ok(table.rows() as u64)
}

fn encode(file: impl Write, table: &Table) -> Result<()> {
    let mut writer = csv::Writer::from_writer(file);
    write_names(&mut writer, table)?;
    write_rows(&mut writer, table)?;
    writer.flush().map_err(IoError::on("write"))?;
    Ok(())
}

/// Writes the names of the columns.
pub(super) fn write_names(writer: &mut csv::Writer<impl Write>, table: &Table) -> Result<()> {
    let names = table.columns().map(|column| column.name);
    writer.write_record(names).map_err(refused)
}

/// Writes the rows.
pub(super) fn write_rows(writer: &mut csv::Writer<impl Write>, table: &Table) -> Result<()> {
    for rows in table.pieces() {
        let values = table.values(rows.clone())?;
        for row in 0..rows.len() {
            let columns = table.columns().zip(&values);
            writer
                .write_record(columns.map(|(column, values)| cell(column, values, row)))
                .map_err(refused)?;
        }
    }
    Ok(())
}

/// The disk's refusal, or the library's.
fn refused(error: csv::Error) -> Error {
    let reason = error.to_string();
    match error.into_kind() {
        csv::ErrorKind::Io(source) => IoError::on("write")(source).into(),
        _ => ProductError::refused("encode CSV")(reason).into(),
    }
}

fn cell(column: &Meaning, values: &Values, row: usize) -> String {
    let number = |value: f64| match column.decimals {
        Some(decimals) => format!("{value:.decimals$}"),
        None => value.to_string(),
    };
    match values {
        Values::Real(values) => number(values[row]),
        Values::OptionalReal(values) => values[row].map_or_else(String::new, number),
        Values::Natural(values) => values[row].to_string(),
        Values::Integer(values) => values[row].to_string(),
        Values::Flag(values) => values[row].to_string(),
        Values::Text(values) => values[row].clone(),
        Values::Bytes(_) => String::new(),
    }
}

/// Whether `text` gives the value of `row` back.
fn holds(column: &Meaning, values: &Values, row: usize, text: &str) -> bool {
    let same = |value: f64| {
        let Ok(found) = text.parse::<f64>() else {
            return false;
        };
        let Some(decimals) = column.decimals else {
            return found.to_bits() == value.to_bits();
        };
        let digit = 10_f64.powi(-i32::try_from(decimals).unwrap_or(0));
        // Half a unit of the last digit, and the rounding of the comparison itself.
        (found - value).abs() <= 0.5 * digit + 4.0 * f64::EPSILON * value.abs()
    };
    match values {
        Values::Real(values) => same(values[row]),
        Values::OptionalReal(values) => values[row].map_or(text.is_empty(), same),
        _ => text == cell(column, values, row),
    }
}

fn read_back(path: &Path, table: &Table) -> Result<()> {
    let differs = |what: String| Err(ProductError::ReadBack { what }.into());
    let mut reader = csv::Reader::from_reader(open(path)?);
    let names = reader.headers().map_err(ProductError::unreadable)?;
    if !names.iter().eq(table.columns().map(|column| column.name)) {
        return differs("names of columns".to_owned());
    }
    let mut records = reader.records();
    for rows in table.pieces() {
        let values = table.values(rows.clone())?;
        for row in 0..rows.len() {
            let number = rows.start + row;
            let Some(record) = records.next() else {
                return differs(format!("{number} rows of {}", table.rows()));
            };
            let record = record.map_err(ProductError::unreadable)?;
            for (index, (column, values)) in table.columns().zip(&values).enumerate() {
                let text = record.get(index).unwrap_or_default();
                if !holds(column, values, row, text) {
                    return differs(format!(
                        "column {}, row {}: {text}",
                        column.name,
                        number + 1
                    ));
                }
            }
        }
    }
    if records.next().is_some() {
        return differs(format!("more than {} rows", table.rows()));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::products::{
        files::write_text,
        table::{Unit, column, tests::numbers},
    };

    type Row = (f64, &'static str, f64, Option<f64>);

    #[test]
    fn text_with_commas_and_numbers_with_all_digits_come_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("table.csv");
        let columns = vec![
            column("a_m", Unit::Metre, "", |row: &Row| row.0),
            column("b", Unit::None, "", |row: &Row| row.1.to_owned()),
            column("c_km", Unit::Kilometre, "", |row: &Row| row.2).decimals(6),
            column("d", Unit::None, "", |row: &Row| row.3),
            column("e", Unit::None, "", |_: &Row| vec![1_u8]),
        ];
        let rows = vec![
            (0.1 + 0.2, "x, \"y\"", 3_394.123_456_5, None),
            (-0.0, "", -1e-9, Some(1e300)),
        ];
        assert_eq!(write(&path, Table::new(columns, rows)).unwrap(), 2);
        let text = std::fs::read_to_string(&path).unwrap();
        assert!(text.starts_with("a_m,b,c_km,d\n0.30000000000000004,\"x, \"\"y\"\"\",3394.12345"));
    }

    #[test]
    fn a_changed_file_is_noticed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("table.csv");
        for (text, complaint) in [
            (
                "a_m\n1.5\n2.4\n",
                "read back differently: column a_m, row 2: 2.4",
            ),
            ("a_m\n1.5\n", "read back differently: 1 rows of 2"),
            (
                "a_m\n1.5\n2.5\n9\n",
                "read back differently: more than 2 rows",
            ),
        ] {
            write_text(&path, text).unwrap();
            let failure = read_back(&path, &numbers("a_m", vec![1.5, 2.5])).unwrap_err();
            assert_eq!(failure.cause.to_string(), complaint);
        }
    }
}
