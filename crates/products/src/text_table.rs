//! Tables as CSV files: shortest digits that reproduce the number, or fixed decimals.

use std::{fmt, io::Write, ops::Range, path::Path};

use csv::StringRecord;
use rayon::prelude::*;

use super::{
    error::ProductError,
    files::{create, finish, open},
    table::{Meaning, Table, Values},
};
use areograph_base::error::{Error, IoError, Locate, Result};

/// Writes the columns of `table` except columns of bytes, and reads them back.
///
/// # Errors
/// Numbers that are not finite; errors of the disk; values that are read back differently.
pub(super) fn write(path: &Path, table: Table) -> Result<u64> {
    let table = table.for_text();
    let mut file = create(path)?;
    encode(&mut file, &table).in_file(path)?;
    finish(path, file)?;
    read_back(path, &table).in_file(path)?;
    Ok(table.rows() as u64)
}

fn encode(file: &mut (impl Write + Send), table: &Table) -> Result<()> {
    let names: Vec<&str> = table.columns().map(|column| column.name).collect();
    write_names(file, &names)?;
    write_rows(file, table)
}

/// Writes the names of the columns.
pub(super) fn write_names(file: &mut impl Write, names: &[&str]) -> Result<()> {
    let mut writer = csv::Writer::from_writer(file);
    writer.write_record(names).map_err(refused)?;
    writer.flush().map_err(IoError::on("write"))?;
    Ok(())
}

/// Writes the rows.
fn write_rows(file: &mut (impl Write + Send), table: &Table) -> Result<()> {
    let encoded = |wave: Vec<Range<usize>>| -> Vec<Result<Vec<u8>>> {
        let rows = wave.into_par_iter();
        rows.map(|rows| rows_as_text(table, rows)).collect()
    };
    let mut waves = table.waves();
    let mut texts = waves.next().map(encoded);
    while let Some(written) = texts {
        // While one wave is written, the next one becomes text.
        let wave = waves.next();
        let (result, next) = rayon::join(
            || written.into_iter().try_for_each(|text| put(file, &text?)),
            || wave.map(encoded),
        );
        result?;
        texts = next;
    }
    Ok(())
}

fn put(file: &mut impl Write, text: &[u8]) -> Result<()> {
    Ok(file.write_all(text).map_err(IoError::on("write"))?)
}

/// Some rows of the table, which it must have.
fn rows_as_text(table: &Table, rows: Range<usize>) -> Result<Vec<u8>> {
    let values = table.values(rows.clone())?;
    let decimals = table.columns().map(|column| column.decimals);
    let columns: Vec<_> = decimals.zip(&values).collect();
    Ok(values_as_text(&columns, rows.len()))
}

/// The first rows of these columns, each with the decimals of its numbers.
pub(super) fn values_as_text(columns: &[(Option<usize>, &Values)], rows: usize) -> Vec<u8> {
    /// Enough for most columns.
    const CELL_BYTES: usize = 16;
    let mut text = Vec::with_capacity(rows * columns.len() * CELL_BYTES);
    for row in 0..rows {
        for (place, (decimals, values)) in columns.iter().enumerate() {
            if place > 0 {
                text.push(b',');
            }
            if let Values::Text(texts) = values {
                put_quoted(&mut text, texts.value(row).as_bytes(), columns.len());
            } else {
                put_cell(&mut text, *decimals, values, row);
            }
        }
        text.push(b'\n');
    }
    text
}

/// Appends the field of a row of `columns` columns, in quotes where RFC 4180 requires them, and where a row would be an
/// empty line.
fn put_quoted(text: &mut Vec<u8>, field: &[u8], columns: usize) {
    let is_empty_row = columns == 1 && field.is_empty();
    if !is_empty_row && !field.iter().any(|byte| b",\"\r\n".contains(byte)) {
        return text.extend_from_slice(field);
    }
    text.push(b'"');
    for byte in field {
        if *byte == b'"' {
            text.push(b'"');
        }
        text.push(*byte);
    }
    text.push(b'"');
}

/// An error of the disk, or the library's.
fn refused(error: csv::Error) -> Error {
    let reason = error.to_string();
    match error.into_kind() {
        csv::ErrorKind::Io(source) => IoError::on("write")(source).into(),
        _ => ProductError::refused("encode CSV")(reason).into(),
    }
}

/// Appends the text of a value.
fn put_cell(text: &mut Vec<u8>, decimals: Option<usize>, values: &Values, row: usize) {
    let put = |text: &mut Vec<u8>, value: fmt::Arguments<'_>| {
        // Writing to a vector cannot fail.
        let _infallible = text.write_fmt(value);
    };
    let number = |text: &mut Vec<u8>, value: f64| match decimals {
        Some(decimals) => put(text, format_args!("{value:.decimals$}")),
        None => put_shortest(text, value),
    };
    match values {
        Values::Real(values) => number(text, values[row]),
        Values::OptionalReal(values) => {
            if let Some(value) = values[row] {
                number(text, value);
            }
        }
        Values::Natural(values) => put_whole(text, values[row]),
        Values::Integer(values) => put_whole(text, values[row]),
        Values::Flag(values) => put(text, format_args!("{}", values[row])),
        Values::Time(values) => put(text, format_args!("{}Z", values[row])),
        Values::Text(values) => text.extend_from_slice(values.value(row).as_bytes()),
        Values::Bytes(_) => {}
    }
}

/// Appends a whole number.
fn put_whole(text: &mut Vec<u8>, value: impl itoa::Integer) {
    text.extend_from_slice(itoa::Buffer::new().format(value).as_bytes());
}

/// Appends the fewest digits that reproduce a finite number, without an exponent: the same as in JSON.
fn put_shortest(text: &mut Vec<u8>, value: f64) {
    let mut buffer = zmij::Buffer::new();
    let digits = buffer.format_finite(value);
    // An exponent has at most three digits and a sign.
    let has_exponent = digits.bytes().rev().take(5).any(|byte| byte == b'e');
    if has_exponent {
        let _infallible = write!(text, "{value}");
    } else {
        text.extend_from_slice(digits.strip_suffix(".0").unwrap_or(digits).as_bytes());
    }
}

/// Whether `text` reproduces the value of `row`.
fn holds(column: &Meaning, values: &Values, row: usize, text: &str, cell: &mut Vec<u8>) -> bool {
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
        _ => {
            cell.clear();
            put_cell(cell, column.decimals, values, row);
            text.as_bytes() == cell
        }
    }
}

fn read_back(path: &Path, table: &Table) -> Result<()> {
    let differs = |what: String| Err(ProductError::ReadBack { what }.into());
    let mut reader = csv::Reader::from_reader(open(path)?);
    let names = reader.headers().map_err(ProductError::unreadable)?;
    if !names.iter().eq(table.columns().map(|column| column.name)) {
        return differs("names of columns".to_owned());
    }
    let mut records = reader.into_records();
    for wave in table.waves() {
        let mut read = Vec::with_capacity(wave.len());
        for rows in wave {
            let found: std::result::Result<Vec<_>, _> = records.by_ref().take(rows.len()).collect();
            read.push((rows, found.map_err(ProductError::unreadable)?));
        }
        let compared: Vec<Result<()>> = read
            .into_par_iter()
            .map(|(rows, found)| compare(table, rows, &found))
            .collect();
        compared.into_iter().collect::<Result<()>>()?;
    }
    if records.next().is_some() {
        return differs(format!("more than {} rows", table.rows()));
    }
    Ok(())
}

/// Checks that the rows were read back unchanged.
fn compare(table: &Table, rows: Range<usize>, found: &[StringRecord]) -> Result<()> {
    let differs = |what: String| Err(ProductError::ReadBack { what }.into());
    let values = table.values(rows.clone())?;
    let mut cell = Vec::new();
    for (row, number) in rows.enumerate() {
        let Some(record) = found.get(row) else {
            return differs(format!("{number} rows of {}", table.rows()));
        };
        for (index, (column, values)) in table.columns().zip(&values).enumerate() {
            let text = record.get(index).unwrap_or_default();
            if !holds(column, values, row, text, &mut cell) {
                let (name, number) = (column.name, number + 1);
                return differs(format!("column {name}, row {number}: {text}"));
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
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
            column("e", Unit::None, "", |_: &Row| [1_u8]),
        ];
        let rows = vec![
            (0.1 + 0.2, "x, \"y\"", 3_394.123_456_5, None),
            (-0.0, "", -1e-9, Some(1e300)),
            (1.0, "two\r\nlines", 1.0, None),
        ];
        assert_eq!(write(&path, Table::new(columns, rows)).unwrap(), 3);
        let text = std::fs::read_to_string(&path).unwrap();
        assert!(text.starts_with("a_m,b,c_km,d\n0.30000000000000004,\"x, \"\"y\"\"\",3394.12345"));
    }

    #[test]
    fn the_fewest_digits_give_the_number_back_without_an_exponent() {
        let bits = (0..20_000_u64).map(|n| n.wrapping_mul(0x9E37_79B9_7F4A_7C15));
        let any = bits.map(f64::from_bits).filter(|value| value.is_finite());
        let plain = [
            0.0, -0.0, 1.0, -2.5, 1e15, 1e16, 1e17, 1e22, 1e-4, 1e-5, 1e-6,
        ];
        for value in any.chain(plain) {
            let mut text = Vec::new();
            put_shortest(&mut text, value);
            let text = String::from_utf8(text).unwrap();
            assert_eq!(text.parse::<f64>().unwrap().to_bits(), value.to_bits());
            // Either of two that are equally short and near is acceptable.
            let display = value.to_string();
            assert_eq!(text.len(), display.len(), "{text} {display}");
            assert!(!text.contains('e'));
        }
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
