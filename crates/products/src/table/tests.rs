//! Tests of tables.

use super::*;

/// A table of numbers only.
pub(crate) fn numbers(name: &'static str, values: Vec<f64>) -> Table<'static> {
    Table::new(
        vec![column(name, Unit::Metre, "", |value: &f64| *value)],
        values,
    )
}

#[test]
fn numbers_that_are_not_finite_are_named_and_refused() {
    let table = numbers("a_m", vec![1.0, f64::NAN]);
    assert_eq!(
        table.values(1..2).unwrap_err().to_string(),
        "column a_m, row 2 of 2 is not a finite number"
    );
    assert_eq!(table.values(0..1).unwrap(), [Values::Real(vec![1.0])]);
    let columns = vec![column("utc", Unit::None, "", |utc: &Utc| *utc)];
    let table = Table::new(columns, vec![Utc::from_microseconds(0), Utc::UNKNOWN]);
    let refused = table.values(0..2).unwrap_err().to_string();
    assert!(refused.contains("column utc, row 2 of 2"), "{refused}");
}

#[test]
fn formats_get_their_columns_in_their_order() {
    let table = || {
        let none = |name| column(name, Unit::None, "", |(): &()| String::new());
        let columns = vec![
            none("text").in_dbase("text", 0, 0).last_in_gis(),
            column("bytes", Unit::None, "", |(): &()| [1_u8]),
            column("number_m", Unit::Metre, "", |(): &()| 1.0).in_dbase("number", 5, 1),
            column("utc", Unit::None, "", |(): &()| Utc::from_microseconds(0)).in_gis(),
        ];
        Table::new(columns, vec![()])
    };
    let names = |table: Table| {
        table
            .columns()
            .map(|column| column.name)
            .collect::<Vec<_>>()
    };
    assert_eq!(names(table()), ["text", "bytes", "number_m", "utc"]);
    assert_eq!(names(table().for_text()), ["text", "number_m", "utc"]);
    assert_eq!(names(table().for_gis()), ["utc", "text"]);
    assert_eq!(names(table().for_dbase()), ["number_m", "text"]);
    let text = [Values::Real(vec![1.0]), Values::Text(vec![""].into())];
    assert_eq!(table().for_dbase().values(0..1).unwrap(), text);
}
