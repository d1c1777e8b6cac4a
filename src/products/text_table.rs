//! Tables as CSV files: shortest digits that give the same number back, or fixed decimals.

use std::{io::Write, path::Path};

use super::{
    fault::ProductFault,
    files::{create, finish, open},
    table::{Column, Table, Values},
};
use crate::error::{Failure, IoFault, Place, Result};

/// Writes the columns of `table` that are no bytes, and reads them back.
///
/// # Errors
/// What the disk refuses; values that come back different.
pub(super) fn write(path: &Path, table: &Table) -> Result<u64> {
    let columns: Vec<&Column> = table
        .columns
        .iter()
        .filter(|column| !matches!(column.values, Values::Binary(_)))
        .collect();
    let mut file = create(path)?;
    encode(&mut file, &columns, table.rows()).in_file(path)?;
    finish(path, file)?;
    read_back(path, &columns, table.rows()).in_file(path)?;
    Ok(table.rows() as u64)
}

fn encode(file: impl Write, columns: &[&Column], rows: usize) -> Result<()> {
    let mut writer = csv::Writer::from_writer(file);
    writer
        .write_record(columns.iter().map(|column| column.name))
        .map_err(refused)?;
    for row in 0..rows {
        writer
            .write_record(columns.iter().map(|column| cell(&column.values, row)))
            .map_err(refused)?;
    }
    writer.flush().map_err(IoFault::on("write"))?;
    Ok(())
}

/// The disk's refusal, or the library's.
fn refused(error: csv::Error) -> Failure {
    let reason = error.to_string();
    match error.into_kind() {
        csv::ErrorKind::Io(source) => IoFault::on("write")(source).into(),
        _ => ProductFault::refused("encode CSV")(reason).into(),
    }
}

fn cell(values: &Values, row: usize) -> String {
    match values {
        Values::F64(values) => values[row].to_string(),
        Values::OptionalF64(values) => values[row].map_or(String::new(), |value| value.to_string()),
        Values::Fixed(values, decimals) => format!("{:.decimals$}", values[row]),
        Values::U32(values) => values[row].to_string(),
        Values::I32(values) => values[row].to_string(),
        Values::Bool(values) => values[row].to_string(),
        Values::Text(values) => values[row].clone(),
        Values::Binary(_) => String::new(),
    }
}

/// Whether `text` gives the value of `row` back.
fn holds(values: &Values, row: usize, text: &str) -> bool {
    let same = |value: f64| {
        text.parse::<f64>()
            .is_ok_and(|found| found.to_bits() == value.to_bits())
    };
    match values {
        Values::F64(values) => same(values[row]),
        Values::OptionalF64(values) => values[row].map_or(text.is_empty(), same),
        Values::Fixed(values, decimals) => {
            let value = values[row];
            let digit = 10_f64.powi(-i32::try_from(*decimals).unwrap_or(0));
            // Half a unit of the last digit, and the rounding of the comparison itself.
            let tolerance = 0.5 * digit + 4.0 * f64::EPSILON * value.abs();
            text.parse::<f64>()
                .is_ok_and(|found| (found - value).abs() <= tolerance)
        }
        _ => text == cell(values, row),
    }
}

fn read_back(path: &Path, columns: &[&Column], rows: usize) -> Result<()> {
    let mut reader = csv::Reader::from_reader(open(path)?);
    let mut found_rows = 0;
    for (row, record) in reader.records().enumerate() {
        let record = record.map_err(ProductFault::unreadable)?;
        for (index, column) in columns.iter().enumerate() {
            let text = record.get(index).unwrap_or_default();
            if row >= rows || !holds(&column.values, row, text) {
                return Err(ProductFault::ReadBack {
                    what: format!("column {}, row {}: {text}", column.name, row + 1),
                }
                .into());
            }
        }
        found_rows = row + 1;
    }
    if found_rows != rows {
        return Err(ProductFault::ReadBack {
            what: format!("{found_rows} rows of {rows}"),
        }
        .into());
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::products::files::write_text;

    #[test]
    fn text_with_commas_and_numbers_with_all_digits_come_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("table.csv");
        let table = Table::new(vec![
            Column::new("a_m", "", Values::F64(vec![0.1 + 0.2, -0.0])),
            Column::new(
                "b",
                "",
                Values::Text(vec!["x, \"y\"".into(), String::new()]),
            ),
            Column::new("c_km", "", Values::Fixed(vec![3_394.123_456_5, -1e-9], 6)),
            Column::new("d", "", Values::OptionalF64(vec![None, Some(1e300)])),
            Column::new("e", "", Values::Binary(vec![vec![1], vec![]])),
        ])
        .unwrap();
        assert_eq!(write(&path, &table).unwrap(), 2);
        let text = std::fs::read_to_string(&path).unwrap();
        assert!(text.starts_with("a_m,b,c_km,d\n0.30000000000000004,\"x, \"\"y\"\"\",3394.12345"));
    }

    #[test]
    fn a_changed_file_is_noticed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("table.csv");
        let column = Column::new("a_m", "", Values::F64(vec![1.5, 2.5]));
        for (text, complaint) in [
            (
                "a_m\n1.5\n2.4\n",
                "read back differently: column a_m, row 2: 2.4",
            ),
            ("a_m\n1.5\n", "read back differently: 1 rows of 2"),
            (
                "a_m\n1.5\n2.5\n9\n",
                "read back differently: column a_m, row 3: 9",
            ),
        ] {
            write_text(&path, text).unwrap();
            let failure = read_back(&path, &[&column], 2).unwrap_err();
            assert_eq!(failure.fault.to_string(), complaint);
        }
    }

    #[test]
    fn numbers_that_are_not_finite_make_no_table() {
        let column = Column::new("a_m", "", Values::F64(vec![1.0, f64::NAN]));
        let failure = Table::new(vec![column]).unwrap_err();
        assert_eq!(
            failure.fault.to_string(),
            "column a_m, row 2 of 2 is not a finite number"
        );
    }
}
