//! Columns of index tables by their labels, and the fields of a row: rows are quoted CSV, or of fixed length.

use std::{borrow::Cow, collections::BTreeMap};

use crate::label::Label;

/// The fields of a row by the names of its columns.
pub type Fields<'a> = BTreeMap<&'a str, Cow<'a, str>>;

/// A column: its name and, where the label states it, its position in a row.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Column {
    /// Its name, in upper case.
    pub name: String,
    /// First byte, counted from 0, and the number of bytes.
    bytes: Option<(usize, usize)>,
}

impl Column {
    /// A column that only its order in the row places.
    #[must_use]
    pub fn named(name: &str) -> Self {
        Self {
            name: name.to_owned(),
            bytes: None,
        }
    }
}

/// The columns that a label describes, in its order.
#[must_use]
pub fn of_label(label: &Label) -> Vec<Column> {
    let in_columns = label.entries.iter().filter(|entry| entry.group == "COLUMN");
    let mut columns: BTreeMap<usize, BTreeMap<&str, &str>> = BTreeMap::new();
    for entry in in_columns {
        columns
            .entry(entry.block)
            .or_default()
            .insert(&entry.key, &entry.value);
    }
    let named = columns.values().filter_map(|entries| {
        let number = |key| {
            entries
                .get(key)
                .and_then(|value| value.parse::<usize>().ok())
        };
        let start = number("START_BYTE").and_then(|start| start.checked_sub(1));
        Some(Column {
            name: entries.get("NAME")?.to_ascii_uppercase(),
            bytes: start.zip(number("BYTES")),
        })
    });
    named.collect()
}

/// The fields of a row by the names of its columns, without quotes and blanks around them; a doubled quote within quotes is
/// one.
///
/// # Errors
/// The fault of the row.
pub fn fields<'a>(row: &'a [u8], columns: &'a [Column]) -> Result<Fields<'a>, String> {
    let row = std::str::from_utf8(row).map_err(|_| "not ASCII text".to_owned())?;
    let separated = separated(row);
    if separated.len() == columns.len() && separated.iter().all(|field| is_whole(field)) {
        let separated = separated.into_iter().map(unquoted);
        let names = columns.iter().map(|column| &*column.name);
        return Ok(names.zip(separated).collect());
    }
    // A quote within a text hides separators: column positions from the label resolve this.
    let by_place = columns
        .iter()
        .map(|column| Some((&*column.name, at_place(row, column.bytes?)?.into())));
    by_place
        .collect::<Option<_>>()
        .ok_or_else(|| match (separated.len(), columns.len()) {
            (found, expected) if found == expected => "a quote within a field".to_owned(),
            (found, expected) => format!("{found} fields; expected {expected}"),
        })
}

/// Content of a field that is quoted or contains no quotes.
fn unquoted(field: &str) -> Cow<'_, str> {
    let within = field
        .strip_prefix('"')
        .and_then(|rest| rest.strip_suffix('"'));
    let text = within.unwrap_or(field).trim();
    if text.contains("\"\"") {
        text.replace("\"\"", "\"").into()
    } else {
        text.into()
    }
}

/// The field at a position of the row, if separators enclose it.
fn at_place(row: &str, (start, length): (usize, usize)) -> Option<&str> {
    let end = start.checked_add(length)?;
    let field = row.get(start..end)?;
    let before = row[..start].trim_end_matches([' ', '"']);
    let after = row[end..].trim_start_matches([' ', '"']);
    let is_separated = (before.is_empty() || before.ends_with(','))
        && (after.is_empty() || after.starts_with(','));
    is_separated.then(|| field.trim_matches([' ', '"']))
}

/// Fields between commas that stand outside of quotes.
fn separated(row: &str) -> Vec<&str> {
    let mut is_quoted = false;
    let fields = row.split(|character| {
        is_quoted ^= character == '"';
        character == ',' && !is_quoted
    });
    fields.map(str::trim).collect()
}

/// Whether a field is quoted or contains no quotes.
fn is_whole(field: &str) -> bool {
    !field.contains('"') || (field.len() > 1 && field.starts_with('"') && field.ends_with('"'))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::label::parse;

    #[test]
    fn commas_within_quotes_separate_nothing() {
        assert_eq!(
            separated(r#""a, b  ", 1.5 ,"","c""#),
            [r#""a, b  ""#, "1.5", r#""""#, r#""c""#]
        );
    }

    #[test]
    fn a_doubled_quote_within_quotes_is_one() {
        assert_eq!(unquoted(r#""Cydonia, ""Face""""#), r#"Cydonia, "Face""#);
        assert_eq!(unquoted(r#""""Face"" ""#), r#""Face""#);
        assert_eq!(
            [r#""N/A ""#, r#""""#, "1.5"].map(unquoted),
            ["N/A", "", "1.5"]
        );
    }

    fn label_of(places: [(usize, usize); 2]) -> Vec<Column> {
        let [(first, first_bytes), (second, second_bytes)] = places;
        let text = format!(
            "OBJECT = TABLE\nOBJECT = COLUMN\nNAME = PRODUCT_ID\nSTART_BYTE = {first}\nBYTES = {first_bytes}\nEND_OBJECT = COLUMN\n\
             OBJECT = COLUMN\nNAME = LINES\nSTART_BYTE = {second}\nBYTES = {second_bytes}\nEND_OBJECT = COLUMN\nEND_OBJECT = TABLE\nEND\n"
        );
        of_label(&parse(text.as_bytes()).unwrap())
    }

    #[test]
    fn places_of_the_label_help_where_a_text_holds_a_quote() {
        let columns = label_of([(2, 4), (8, 3)]);
        let expected = BTreeMap::from([("PRODUCT_ID", "a\",b".into()), ("LINES", "12".into())]);
        assert_eq!(fields(br#""a",b",12 "#, &columns), Ok(expected));
        assert_eq!(
            fields(b"1,2,3", &columns),
            Err("3 fields; expected 2".to_owned())
        );
    }

    #[test]
    fn places_without_separators_are_not_believed() {
        // A row shifted by a byte against its label is split by its separators.
        let columns = label_of([(2, 4), (8, 3)]);
        let expected = BTreeMap::from([("PRODUCT_ID", "abc".into()), ("LINES", "127".into())]);
        assert_eq!(fields(br#""abc",127"#, &columns), Ok(expected));
        // With an extra quote as well, the row cannot be split.
        let refused = Err("1 fields; expected 2".to_owned());
        assert_eq!(fields(br#""abx"c",127"#, &columns), refused);
        let endless = label_of([(2, usize::MAX), (8, 3)]);
        let refused = Err("a quote within a field".to_owned());
        assert_eq!(fields(br#""a",b",12 "#, &endless), refused);
    }
}
