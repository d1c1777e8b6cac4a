//! Changes of sound inputs: the vocabulary of the rows. A change that changes nothing fails.

use serde::Deserialize;
use serde_json::Value;

use super::{
    common::case::Case,
    kernels::{self, Attitude, Orbit, Shots},
    text::{Number, Rows, Table, number_after, with_times},
};

/// A change of the files of a row.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub(super) enum Change {
    /// Every occurrence of a text.
    Replace {
        file: String,
        from: String,
        to: String,
    },
    /// Lines that begin so, after blanks.
    RemoveLines { file: String, starting: String },
    /// A text at the end.
    Append { file: String, text: String },
    /// The first number after a text.
    Number {
        file: String,
        after: String,
        number: Number,
    },
    /// The contents of two files, each in place of the other.
    Exchange { files: [String; 2] },
    /// A file in place of another, or beside.
    Copy { from: String, to: String },
    /// A file of the project's own.
    CopyOfProject { from: String, to: String },
    /// Numbers of a column of a table.
    Column {
        file: String,
        column: String,
        number: Number,
        #[serde(default)]
        rows: Rows,
    },
    /// Two columns of a table, exchanged.
    ExchangeColumns {
        file: String,
        columns: [String; 2],
        #[serde(default)]
        rows: Rows,
    },
    /// Columns of the chosen rows, each row with the values of another chosen row so many behind.
    Roll {
        file: String,
        columns: Vec<String>,
        by: usize,
        #[serde(default)]
        rows: Rows,
    },
    /// A number of the chosen rows becomes that of the first.
    Hold {
        file: String,
        column: String,
        #[serde(default)]
        rows: Rows,
    },
    /// The chosen rows are left out.
    Drop {
        file: String,
        #[serde(default)]
        rows: Rows,
    },
    /// A key of a TOML file; tables are made as needed, members of arrays go by their number.
    Set {
        file: String,
        key: String,
        value: toml::Value,
    },
    /// A key of a TOML file, removed.
    Remove { file: String, key: String },
    /// Numbers below a place of a JSON file (`/instrument_position/positions`), all of them or one in so many.
    Json {
        file: String,
        at: String,
        #[serde(default)]
        number: Option<Number>,
        #[serde(default)]
        one_in: Option<usize>,
        #[serde(default)]
        text: Option<String>,
        #[serde(default)]
        remove: bool,
    },
    /// Quaternions below a place of a JSON file, turned about an axis.
    JsonTurn {
        file: String,
        at: String,
        axis: [f64; 3],
        mrad: f64,
    },
    /// The part of a JSON file at a place, exchanged with that of another.
    JsonExchange { files: [String; 2], at: String },
    /// Start and stop of a label by whole seconds within the same day, with its clock.
    LabelTimes {
        file: String,
        seconds: i64,
        #[serde(default)]
        utc_alone: bool,
    },
    /// The C-kernel.
    Attitude(Attitude),
    /// States of an SPK.
    Orbit(Orbit),
    /// Fields of the frames of a PEDR file.
    Pedr(Shots),
    /// The first bytes of a file alone.
    Truncate { file: String, bytes: usize },
}

fn text(case: &Case, file: &str) -> String {
    String::from_utf8(case.read(file)).unwrap()
}

/// Numbers below a value, in order.
fn leaves<'a>(value: &'a mut Value, found: &mut Vec<&'a mut Value>) {
    match value {
        Value::Array(values) => values.iter_mut().for_each(|value| leaves(value, found)),
        Value::Object(values) => values.values_mut().for_each(|value| leaves(value, found)),
        Value::Number(_) => found.push(value),
        _ => {}
    }
}

/// The value at a key `table.key` or `array.0.key`, with tables made as needed, and the name of its last part.
fn parent<'a>(table: &'a mut toml::Value, key: &str) -> (&'a mut toml::Value, String) {
    let mut parts: Vec<&str> = key.split('.').collect();
    let last = parts.pop().unwrap().to_owned();
    let mut at = table;
    for part in parts {
        at = match at {
            toml::Value::Array(values) => &mut values[part.parse::<usize>().unwrap()],
            toml::Value::Table(values) => values
                .entry(part)
                .or_insert_with(|| toml::Value::Table(toml::Table::new())),
            other => panic!("{key}: {other} has no {part}"),
        };
    }
    (at, last)
}

impl Change {
    /// Makes the change in the folder of the case.
    pub(super) fn make(&self, case: &Case, row: &str) {
        match self {
            Self::Exchange {
                files: [one, other],
            } => {
                let content = case.read(one);
                assert_ne!(content, case.read(other), "{row}: {one} and {other}");
                case.write(one, case.read(other));
                case.write(other, content);
            }
            Self::Copy { from, to } => case.write(to, case.read(from)),
            Self::CopyOfProject { from, to } => {
                case.write(
                    to,
                    std::fs::read(super::common::checkout().join(from)).unwrap(),
                );
            }
            Self::JsonExchange { files, at } => exchange_parts(case, files, at),
            Self::Attitude(change) => change.make(case),
            Self::Orbit(change) => change.make(case),
            Self::Pedr(change) => change.make(case),
            Self::Truncate { file, bytes } => case.truncate(file, *bytes),
            _ => {
                let (file, changed) = self.text(case);
                assert!(
                    changed.as_bytes() != case.read(file),
                    "{row}: nothing of {file} is changed"
                );
                case.write(file, changed);
            }
        }
    }

    /// The file of text and its new content.
    fn text(&self, case: &Case) -> (&str, String) {
        match self {
            Self::Replace { file, from, to } => (file, text(case, file).replace(from, to)),
            Self::RemoveLines { file, starting } => {
                let old = text(case, file);
                let kept = old.split_inclusive('\n');
                let kept = kept.filter(|line| !line.trim_start().starts_with(starting));
                (file, kept.collect())
            }
            Self::Append { file, text: more } => (file, text(case, file) + more),
            Self::Number {
                file,
                after,
                number,
            } => {
                let old = text(case, file);
                let [before, value, rest] = number_after(&old, after);
                let value: f64 = value.replace(['d', 'D'], "e").parse().unwrap();
                (file, format!("{before}{}{rest}", number.of(value)))
            }
            Self::LabelTimes {
                file,
                seconds,
                utc_alone,
            } => (file, with_times(&text(case, file), *seconds, *utc_alone)),
            Self::Set { file, key, value } => {
                let mut table: toml::Value = toml::from_str(&text(case, file)).unwrap();
                let (at, last) = parent(&mut table, key);
                at.as_table_mut().unwrap().insert(last, value.clone());
                (file, toml::to_string(&table).unwrap())
            }
            Self::Remove { file, key } => {
                let mut table: toml::Value = toml::from_str(&text(case, file)).unwrap();
                let (at, last) = parent(&mut table, key);
                match at {
                    toml::Value::Array(values) => drop(values.remove(last.parse().unwrap())),
                    at => drop(at.as_table_mut().unwrap().remove(&last).unwrap()),
                }
                (file, toml::to_string(&table).unwrap())
            }
            Self::Json { file, .. } | Self::JsonTurn { file, .. } => {
                let mut document: Value = serde_json::from_str(&text(case, file)).unwrap();
                self.json(&mut document);
                (file, document.to_string())
            }
            Self::Column { file, .. }
            | Self::ExchangeColumns { file, .. }
            | Self::Roll { file, .. }
            | Self::Hold { file, .. }
            | Self::Drop { file, .. } => {
                let mut table = Table::of(&text(case, file));
                self.table(&mut table);
                (file, table.text())
            }
            _ => panic!("{self:?} is no change of a text"),
        }
    }

    fn table(&self, table: &mut Table) {
        match self {
            Self::Column {
                column,
                number,
                rows,
                ..
            } => {
                let column = table.column(column);
                for row in table.chosen(rows) {
                    let cell = &mut table.rows[row][column];
                    *cell = number.of(cell.parse().unwrap()).to_string();
                }
            }
            Self::ExchangeColumns { columns, rows, .. } => {
                let [one, other] = columns.each_ref().map(|name| table.column(name));
                for row in table.chosen(rows) {
                    table.rows[row].swap(one, other);
                }
            }
            Self::Roll {
                columns, by, rows, ..
            } => {
                let chosen = table.chosen(rows);
                for column in columns
                    .iter()
                    .map(|name| table.column(name))
                    .collect::<Vec<_>>()
                {
                    let cells = chosen.iter().map(|row| table.rows[*row][column].clone());
                    let mut cells: Vec<String> = cells.collect();
                    cells.rotate_right(*by);
                    for (row, cell) in chosen.iter().zip(cells) {
                        table.rows[*row][column] = cell;
                    }
                }
            }
            Self::Hold { column, rows, .. } => {
                let (column, chosen) = (table.column(column), table.chosen(rows));
                let held = table.rows[chosen[0]][column].clone();
                for row in chosen {
                    table.rows[row][column].clone_from(&held);
                }
            }
            Self::Drop { rows, .. } => {
                for row in table.chosen(rows).into_iter().rev() {
                    table.rows.remove(row);
                }
            }
            _ => panic!("{self:?} is no change of a table"),
        }
    }

    fn json(&self, document: &mut Value) {
        match self {
            Self::Json {
                at, remove: true, ..
            } => {
                let (parent, last) = at.rsplit_once('/').unwrap();
                let parent = document
                    .pointer_mut(parent)
                    .unwrap()
                    .as_object_mut()
                    .unwrap();
                parent.remove(last).unwrap();
            }
            Self::Json {
                at,
                number,
                one_in,
                text,
                ..
            } => {
                let value = document
                    .pointer_mut(at)
                    .unwrap_or_else(|| panic!("no {at}"));
                if let Some(text) = text {
                    *value = Value::from(text.as_str());
                }
                let mut found = Vec::new();
                leaves(value, &mut found);
                if let Some(number) = number {
                    for value in found.into_iter().step_by(one_in.unwrap_or(1)) {
                        let changed = number.of(value.as_f64().unwrap());
                        // Whole numbers stay so.
                        *value = if value.is_f64() || changed.fract().abs() > 0.0 {
                            Value::from(changed)
                        } else {
                            serde_json::from_str(&format!("{changed:.0}")).unwrap()
                        };
                    }
                }
            }
            Self::JsonTurn { at, axis, mrad, .. } => {
                for quaternion in document.pointer_mut(at).unwrap().as_array_mut().unwrap() {
                    let parts = [0, 1, 2, 3].map(|part| super::common::number(&quaternion[part]));
                    let turned = kernels::turned(parts, *axis, *mrad);
                    *quaternion = Value::from(turned.to_vec());
                }
            }
            _ => panic!("{self:?} is no change of a JSON file"),
        }
    }
}

fn exchange_parts(case: &Case, files: &[String; 2], at: &str) {
    let mut documents = files
        .each_ref()
        .map(|file| serde_json::from_str::<Value>(&text(case, file)).unwrap());
    let [one, other] = &mut documents;
    std::mem::swap(one.pointer_mut(at).unwrap(), other.pointer_mut(at).unwrap());
    for (file, document) in files.iter().zip(&documents) {
        case.write(file, document.to_string());
    }
}
