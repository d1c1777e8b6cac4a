//! Tables: a column's name, unit, meaning, type and place in each format are declared once, and every format is
//! written and checked from that.
//!
//! ```text
//! column("range_m", Unit::Metre, "one-way range", |shot: &Shot| shot.range_m).in_gis().in_dbase("range_m", 12, 3)
//! ```

use std::{borrow::Cow, fmt, ops::Range};

use arrow_array::{BinaryArray, StringArray, builder::StringBuilder};
use rayon::prelude::*;

use super::error::ProductError;
use areograph_base::{terms::Terms, utc::Utc};

/// Rows whose values are in memory at once.
pub(super) const ROWS_AT_ONCE: usize = 65_536;
/// Rows that a thread converts into text at once, and tasks of a wave, whose text, 3 MB a thread, is in memory.
pub(super) const ROWS_OF_A_TASK: usize = 2_048;
const TASKS_OF_A_THREAD: usize = 4;

/// Unit of a column; names of areograph's columns end in it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Unit {
    /// A name, a number without a unit, or a flag.
    None,
    Metre,
    Kilometre,
    Second,
    Millisecond,
    Degree,
    Arcsecond,
    Radian,
    /// Lines of the image.
    Line,
    /// Pixels of the image.
    Pixel,
}

impl Unit {
    /// The symbol, as in PDS4 and in texts.
    pub(super) const fn symbol(self) -> Option<&'static str> {
        Some(match self {
            Self::None => return None,
            Self::Metre => "m",
            Self::Kilometre => "km",
            Self::Second => "s",
            Self::Millisecond => "ms",
            Self::Degree => "deg",
            Self::Arcsecond => "arcsec",
            Self::Radian => "rad",
            Self::Line => "line",
            Self::Pixel => "pixel",
        })
    }
}

/// Type of a column's values.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Real,
    Natural,
    Integer,
    Flag,
    /// An instant of UTC.
    Time,
    Text,
    /// Texts, joined by semicolons except in Parquet.
    List,
    /// Only Parquet has such columns.
    Bytes,
}

/// Selection of attributes of points for GIS formats.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Gis {
    No,
    /// In the order of the columns.
    Yes,
    /// After all others.
    Last,
}

/// A field of a dBASE table, whose names have ten letters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct DbaseField {
    pub(super) name: &'static str,
    /// Digits of a number; texts are as wide as the longest.
    pub(super) width: u8,
    pub(super) decimals: u8,
}

/// Meaning of a column.
#[derive(Debug, Clone, PartialEq)]
pub struct Meaning {
    pub(super) name: &'static str,
    pub(super) unit: Unit,
    /// With terms of the site in braces, until the table is described in them.
    pub(super) description: Cow<'static, str>,
    pub(super) kind: Kind,
    /// Whether rows may lack a value.
    pub(super) optional: bool,
    /// Decimals in text formats for external readers; else as many as reproduce the number.
    pub(super) decimals: Option<usize>,
    /// Least and greatest value of a count.
    pub(super) limits: Option<[u32; 2]>,
    pub(super) dbase: Option<DbaseField>,
    gis: Gis,
}

impl Meaning {
    /// Describes the column in the terms of a site.
    fn describe_in(&mut self, terms: &Terms<'_>) {
        self.description = Cow::Owned(terms.fill(&self.description).into_owned());
    }
}

/// Returns the values of rows.
type Gather<R> = dyn Fn(&[R]) -> Values + Send + Sync;

/// A column of a table whose rows are `R`.
pub(super) struct Column<R> {
    meaning: Meaning,
    values: Box<Gather<R>>,
}

/// The column `name`, whose value in a row is given by `of`.
pub(super) fn column<R, T: Cell>(
    name: &'static str,
    unit: Unit,
    description: &'static str,
    of: impl Fn(&R) -> T + Send + Sync + 'static,
) -> Column<R> {
    Column {
        meaning: Meaning {
            name,
            unit,
            description: Cow::Borrowed(description),
            kind: T::KIND,
            optional: T::OPTIONAL,
            decimals: None,
            limits: None,
            dbase: None,
            gis: Gis::No,
        },
        values: Box::new(move |rows| T::gather(rows.iter().map(&of).collect())),
    }
}

/// The column `name` of texts, each of which `append` writes; cheaper than a text of its own for every row.
pub(super) fn text_column<R>(
    name: &'static str,
    description: &'static str,
    append: impl Fn(&R, &mut StringBuilder) -> fmt::Result + Send + Sync + 'static,
) -> Column<R> {
    let gather = move |rows: &[R]| {
        let mut texts = StringBuilder::with_capacity(rows.len(), 0);
        for row in rows {
            // Writing to memory cannot fail.
            let _infallible = append(row, &mut texts);
            texts.append_value("");
        }
        Values::Text(texts.finish())
    };
    Column {
        values: Box::new(gather),
        ..column(name, Unit::None, description, |_: &R| String::new())
    }
}

impl<R> Column<R> {
    /// Printed with a fixed number of decimals.
    pub(super) const fn decimals(mut self, decimals: usize) -> Self {
        self.meaning.decimals = Some(decimals);
        self
    }

    /// A count within these limits.
    pub(super) const fn between(mut self, least: u32, greatest: u32) -> Self {
        self.meaning.limits = Some([least, greatest]);
        self
    }

    /// An attribute of points in GeoJSON and GeoPackage too.
    pub(super) const fn in_gis(mut self) -> Self {
        self.meaning.gis = Gis::Yes;
        self
    }

    /// An attribute of points in GeoJSON and GeoPackage, after the others.
    pub(super) const fn last_in_gis(mut self) -> Self {
        self.meaning.gis = Gis::Last;
        self
    }

    /// A field of the shapefile's table too, under this name.
    pub(super) const fn in_dbase(mut self, name: &'static str, width: u8, decimals: u8) -> Self {
        self.meaning.dbase = Some(DbaseField {
            name,
            width,
            decimals,
        });
        self
    }
}

/// Type of a column's values.
pub(super) trait Cell: Sized {
    const KIND: Kind;
    const OPTIONAL: bool = false;

    /// The values of successive rows.
    fn gather(cells: Vec<Self>) -> Values;
}

macro_rules! cells {
    ($($type:ty: $kind:ident;)*) => {
        $(impl Cell for $type {
            const KIND: Kind = Kind::$kind;

            fn gather(cells: Vec<Self>) -> Values {
                Values::$kind(cells)
            }
        })*

        /// Values of one type; none of the texts and bytes is missing.
        #[derive(Debug, PartialEq)]
        pub(super) enum Values {
            OptionalReal(Vec<Option<f64>>),
            Text(StringArray),
            Bytes(BinaryArray),
            $($kind(Vec<$type>),)*
        }
    };
}

cells! {
    f64: Real;
    u32: Natural;
    i32: Integer;
    bool: Flag;
    Utc: Time;
}

impl Cell for String {
    const KIND: Kind = Kind::Text;

    fn gather(cells: Vec<Self>) -> Values {
        Values::Text(StringArray::from_iter_values(cells))
    }
}

impl<const LENGTH: usize> Cell for [u8; LENGTH] {
    const KIND: Kind = Kind::Bytes;

    fn gather(cells: Vec<Self>) -> Values {
        Values::Bytes(BinaryArray::from_iter_values(cells))
    }
}

impl Cell for Option<f64> {
    const KIND: Kind = Kind::Real;
    const OPTIONAL: bool = true;

    fn gather(cells: Vec<Self>) -> Values {
        Values::OptionalReal(cells)
    }
}

impl Values {
    /// The first row that is not a finite number or a known instant.
    fn not_finite(&self) -> Option<usize> {
        match self {
            Self::Real(values) => values.iter().position(|value| !value.is_finite()),
            Self::OptionalReal(values) => {
                let infinite = |value: &Option<f64>| value.is_some_and(|value| !value.is_finite());
                values.iter().position(infinite)
            }
            Self::Time(values) => values.iter().position(|value| *value == Utc::UNKNOWN),
            _ => None,
        }
    }
}

/// Returns the values of some columns, by their declared places, in some rows.
type ValuesOf<'a> = dyn Fn(&[usize], Range<usize>) -> Vec<Values> + Sync + 'a;

/// Rows with the meanings of their columns; their values are computed piece by piece.
pub(super) struct Table<'a> {
    columns: Vec<(usize, Meaning)>,
    rows: usize,
    values: Box<ValuesOf<'a>>,
}

impl<'a> Table<'a> {
    /// The table of `count` rows, each created from its index when its values are computed.
    pub(super) fn of<R: Sync + 'a>(
        columns: Vec<Column<R>>,
        count: usize,
        row: impl Fn(usize) -> R + Sync + 'a,
    ) -> Self {
        Self {
            columns: meanings(&columns).into_iter().enumerate().collect(),
            rows: count,
            values: Box::new(move |places, range| {
                let rows: Vec<R> = range.map(&row).collect();
                gather(&columns, places, &rows)
            }),
        }
    }

    /// The table of these rows.
    pub(super) fn new<R: Sync + 'a>(columns: Vec<Column<R>>, rows: Vec<R>) -> Self {
        Self {
            columns: meanings(&columns).into_iter().enumerate().collect(),
            rows: rows.len(),
            values: Box::new(move |places, range| gather(&columns, places, &rows[range])),
        }
    }

    /// With descriptions in the terms of a site.
    pub(super) fn in_terms(mut self, terms: &Terms<'_>) -> Self {
        for (_, column) in &mut self.columns {
            column.describe_in(terms);
        }
        self
    }

    /// With only the columns of text formats.
    pub(super) fn for_text(self) -> Self {
        self.keep(|column| column.kind != Kind::Bytes)
    }

    /// With only the attributes of GeoJSON and GeoPackage.
    pub(super) fn for_gis(mut self) -> Self {
        self.columns
            .sort_by_key(|(_, column)| column.gis == Gis::Last);
        self.keep(|column| column.gis != Gis::No)
    }

    /// With these columns among the attributes of GeoJSON too.
    pub(super) fn also_in_gis(mut self, names: &[&str]) -> Self {
        for (_, column) in &mut self.columns {
            if column.gis == Gis::No && names.contains(&column.name) {
                column.gis = Gis::Yes;
            }
        }
        self
    }

    /// With only the fields of dBASE, numbers first.
    pub(super) fn for_dbase(mut self) -> Self {
        self.columns
            .sort_by_key(|(_, column)| matches!(column.kind, Kind::Text | Kind::List | Kind::Time));
        self.keep(|column| column.dbase.is_some())
    }

    /// Without the column of that name.
    pub(super) fn without(self, name: &str) -> Self {
        self.keep(|column| column.name != name)
    }

    /// With only the columns at these indices, in this order; the table must have them.
    #[cfg(feature = "sql")]
    pub(super) fn pick(mut self, places: &[usize]) -> Self {
        self.columns = places
            .iter()
            .map(|place| self.columns[*place].clone())
            .collect();
        self
    }

    /// With only the columns that are required.
    pub(super) fn keep(mut self, required: impl Fn(&Meaning) -> bool) -> Self {
        self.columns.retain(|(_, column)| required(column));
        self
    }

    /// Meanings of the columns, in order.
    pub(super) fn columns(&self) -> impl Iterator<Item = &Meaning> {
        self.columns.iter().map(|(_, column)| column)
    }

    pub(super) const fn rows(&self) -> usize {
        self.rows
    }

    /// The values of some rows, which the table must have, column by column.
    ///
    /// # Errors
    /// A number that is not finite, which no reader could use.
    pub(super) fn values(
        &self,
        rows: Range<usize>,
    ) -> std::result::Result<Vec<Values>, ProductError> {
        let places: Vec<usize> = self.columns.iter().map(|(place, _)| *place).collect();
        let values = (self.values)(&places, rows.clone());
        let bad = self.columns().zip(&values).find_map(|(column, values)| {
            let row = rows.start + values.not_finite()? + 1;
            Some(format!(
                "column {}, row {row} of {}",
                column.name, self.rows
            ))
        });
        match bad {
            None => Ok(values),
            Some(what) => Err(ProductError::NotFinite { what }),
        }
    }

    /// All rows in pieces that fit into memory.
    pub(super) fn pieces(&self) -> impl Iterator<Item = Range<usize>> + use<> {
        pieces(self.rows, ROWS_AT_ONCE)
    }

    /// All rows in waves of small pieces, each of which is for one thread.
    pub(super) fn waves(&self) -> impl Iterator<Item = Vec<Range<usize>>> + use<> {
        let tasks = TASKS_OF_A_THREAD * rayon::current_num_threads();
        let mut small = pieces(self.rows, ROWS_OF_A_TASK).peekable();
        std::iter::from_fn(move || {
            small.peek()?;
            Some(small.by_ref().take(tasks).collect())
        })
    }
}

/// The values of the columns at these places in some rows.
fn gather<R: Sync>(columns: &[Column<R>], places: &[usize], rows: &[R]) -> Vec<Values> {
    let columns = places.par_iter().map(|place| &columns[*place]);
    columns.map(|column| (column.values)(rows)).collect()
}

/// `rows` rows in pieces of at most this size.
pub(super) fn pieces(rows: usize, size: usize) -> impl Iterator<Item = Range<usize>> {
    (0..rows)
        .step_by(size)
        .map(move |start| start..rows.min(start + size))
}

/// Meanings of columns, independent of the rows.
pub(super) fn meanings<R>(columns: &[Column<R>]) -> Vec<Meaning> {
    columns
        .iter()
        .map(|column| column.meaning.clone())
        .collect()
}

mod lists;
#[cfg(test)]
pub(super) mod tests;
