//! The cumulative index of a campaign, `cumindex.tab`, with its label: the columns of the mapping mission.

use std::{fmt::Write as _, path::Path};

use super::super::files::put;
use areograph_base::error::Result;

/// Form of a column.
#[derive(Debug, Clone, Copy)]
enum Form {
    /// Text of this many characters in quotes.
    Text(usize),
    /// Whole number.
    Whole(usize),
    /// Number with decimals.
    Real(usize, usize),
}

/// Columns in order: name and form. Source: label of `cumindex.tab` of the mapping mission.
const COLUMNS: [(&str, Form); 53] = [
    ("VOLUME_ID", Form::Text(9)),
    ("FILE_SPECIFICATION_NAME", Form::Text(19)),
    ("PRODUCT_ID", Form::Text(12)),
    ("IMAGE_TIME", Form::Text(22)),
    ("INSTRUMENT_NAME", Form::Text(6)),
    ("FILTER_NAME", Form::Text(4)),
    ("LINE_SAMPLES", Form::Whole(4)),
    ("LINES", Form::Whole(6)),
    ("CROSSTRACK_SUMMING", Form::Whole(2)),
    ("DOWNTRACK_SUMMING", Form::Whole(3)),
    ("SCALED_PIXEL_WIDTH", Form::Real(7, 2)),
    ("PIXEL_ASPECT_RATIO", Form::Real(5, 2)),
    ("EMISSION_ANGLE", Form::Real(6, 2)),
    ("INCIDENCE_ANGLE", Form::Real(6, 2)),
    ("PHASE_ANGLE", Form::Real(6, 2)),
    ("CENTER_LONGITUDE", Form::Real(6, 2)),
    ("CENTER_LATITUDE", Form::Real(6, 2)),
    ("UPPER_LEFT_LONGITUDE", Form::Real(6, 2)),
    ("UPPER_LEFT_LATITUDE", Form::Real(6, 2)),
    ("UPPER_RIGHT_LONGITUDE", Form::Real(6, 2)),
    ("UPPER_RIGHT_LATITUDE", Form::Real(6, 2)),
    ("LOWER_LEFT_LONGITUDE", Form::Real(6, 2)),
    ("LOWER_LEFT_LATITUDE", Form::Real(6, 2)),
    ("LOWER_RIGHT_LONGITUDE", Form::Real(6, 2)),
    ("LOWER_RIGHT_LATITUDE", Form::Real(6, 2)),
    ("MISSION_PHASE_NAME", Form::Text(10)),
    ("TARGET_NAME", Form::Text(8)),
    ("SPACECRAFT_CLOCK_START_COUNT", Form::Text(16)),
    ("FOCAL_PLANE_TEMPERATURE", Form::Real(5, 1)),
    ("LINE_EXPOSURE_DURATION", Form::Real(9, 4)),
    ("GAIN_MODE_ID", Form::Text(3)),
    ("OFFSET_MODE_ID", Form::Text(3)),
    ("EDIT_MODE_ID", Form::Whole(5)),
    ("ENCODING_TYPE", Form::Text(12)),
    ("SCALED_IMAGE_WIDTH", Form::Real(8, 2)),
    ("SCALED_IMAGE_HEIGHT", Form::Real(8, 2)),
    ("SPACECRAFT_ALTITUDE", Form::Real(8, 2)),
    ("TARGET_CENTER_DISTANCE", Form::Real(8, 2)),
    ("SLANT_DISTANCE", Form::Real(8, 2)),
    ("USAGE_NOTE", Form::Text(4)),
    ("NORTH_AZIMUTH", Form::Real(6, 2)),
    ("SUB_SOLAR_AZIMUTH", Form::Real(6, 2)),
    ("SUB_SOLAR_LONGITUDE", Form::Real(6, 2)),
    ("SUB_SOLAR_LATITUDE", Form::Real(6, 2)),
    ("SUB_SPACECRAFT_LONGITUDE", Form::Real(6, 2)),
    ("SUB_SPACECRAFT_LATITUDE", Form::Real(6, 2)),
    ("SOLAR_DISTANCE", Form::Real(11, 1)),
    ("SOLAR_LONGITUDE", Form::Real(6, 2)),
    ("LOCAL_TIME", Form::Real(5, 2)),
    ("IMAGE_SKEW_ANGLE", Form::Real(6, 2)),
    ("RATIONALE_DESC", Form::Text(80)),
    ("DATA_QUALITY_DESC", Form::Text(6)),
    ("ORBIT_NUMBER", Form::Whole(5)),
];
/// Name of the table; its label has the ending `lbl`.
const TABLE: &str = "cumindex.tab";
const LABEL: &str = "cumindex.lbl";

/// A value of a row.
#[derive(Debug, Clone)]
pub(super) enum Value {
    /// Text.
    Text(String),
    /// A number in the unit of its column.
    Number(f64),
}

/// The row of an image: values in the order of the columns.
#[derive(Debug, Clone)]
pub(super) struct Row(Vec<Value>);

impl Row {
    /// A row of values by the names of their columns, in order; a column without a value is empty.
    pub(super) fn new(values: Vec<(&'static str, Value)>) -> Self {
        let mut values = values.into_iter().peekable();
        let row = COLUMNS.iter().map(|(column, _)| {
            let next = values.next_if(|(name, _)| name == column);
            next.map_or_else(|| Value::Text(String::new()), |(_, value)| value)
        });
        Self(row.collect())
    }

    /// The row with another value of a column.
    pub(super) fn with(mut self, column: &str, value: &Value) -> Self {
        let names = COLUMNS.iter().map(|(name, _)| name);
        for (own, _) in self
            .0
            .iter_mut()
            .zip(names)
            .filter(|(_, name)| **name == column)
        {
            own.clone_from(value);
        }
        self
    }

    /// First part of the product identifier.
    pub(super) fn phase(&self) -> &str {
        let place = COLUMNS.iter().position(|(name, _)| *name == "PRODUCT_ID");
        let product_id = place.and_then(|place| match &self.0[place] {
            Value::Text(text) => text.split('/').next(),
            Value::Number(_) => None,
        });
        product_id.unwrap_or_default()
    }

    /// The line of the table, without its end.
    pub(super) fn line(&self) -> String {
        let fields = self.0.iter().zip(COLUMNS);
        let fields: Vec<String> = fields
            .map(|(value, (_, form))| field(value, form))
            .collect();
        fields.join(",")
    }
}

fn field(value: &Value, form: Form) -> String {
    match (value, form) {
        (Value::Text(text), Form::Text(width)) => {
            let text: String = text.chars().take(width).collect();
            format!("\"{text:<width$}\"")
        }
        (Value::Number(number), Form::Whole(width)) => format!("{number:>width$.0}"),
        (Value::Number(number), Form::Real(width, decimals)) => {
            // No zero is negative.
            let rounded: f64 = format!("{number:.decimals$}").parse().unwrap_or(*number);
            format!("{:>width$.decimals$}", rounded + 0.0)
        }
        (Value::Text(text), Form::Whole(width) | Form::Real(width, _)) => format!("{text:>width$}"),
        (Value::Number(number), Form::Text(width)) => format!("\"{number:<width$}\""),
    }
}

/// Writes table and label into `folder`.
///
/// # Errors
/// Errors of writing.
pub(super) fn write_index(folder: &Path, lines: &[String]) -> Result<()> {
    let mut table = String::new();
    for line in lines {
        table.push_str(line);
        table.push_str("\r\n");
    }
    put(&folder.join(TABLE), &table)?;
    put(&folder.join(LABEL), &label(lines.len()))
}

fn label(rows: usize) -> String {
    let mut columns = String::new();
    // Bytes count from 1; a text begins after its quote.
    let mut start = 1;
    for (number, (name, form)) in (1..).zip(COLUMNS) {
        let (kind, quote, bytes) = match form {
            Form::Text(width) => ("CHARACTER", 1, width),
            Form::Whole(width) => ("ASCII_INTEGER", 0, width),
            Form::Real(width, _) => ("ASCII_REAL", 0, width),
        };
        let _infallible = write!(
            columns,
            "  OBJECT = COLUMN\r\n    COLUMN_NUMBER = {number}\r\n    NAME = {name}\r\n    DATA_TYPE = {kind}\r\n    \
             START_BYTE = {}\r\n    BYTES = {bytes}\r\n  END_OBJECT = COLUMN\r\n",
            start + quote
        );
        start += bytes + 2 * quote + 1;
    }
    // The last column has no comma, and a row ends in two bytes.
    let row_bytes = start + 1 - 1;
    let count = COLUMNS.len();
    format!(
        "PDS_VERSION_ID = PDS3\r\nRECORD_TYPE = STREAM\r\n\
         NOTE = \"SYNTHETIC: written by areograph scene; no image file exists\"\r\n\
         ^TABLE = \"CUMINDEX.TAB\"\r\nOBJECT = TABLE\r\n  INTERCHANGE_FORMAT = ASCII\r\n  ROWS = {rows}\r\n  \
         COLUMNS = {count}\r\n  ROW_BYTES = {row_bytes}\r\n{columns}END_OBJECT = TABLE\r\nEND\r\n"
    )
}
