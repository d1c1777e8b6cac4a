//! Long columns of numbers: packed in pieces, of which few are unpacked at a time.
//!
//! A site may have tens of millions of shots with about forty numbers each. A [`Column`] holds its values in pieces of
//! [`PIECE`] values, compressed without loss to a third or less. All pieces of a process beyond [`MEMORY_BYTES`] lie in
//! an unnamed temporary file. A value is read by [`Column::at`], which unpacks its piece; every thread keeps the last
//! pieces that it used. The values behind the last full pieces are not packed, so that small sites pack nothing.
//! [`Tiles`] hold bytes on a grid in the same way.
//!
//! ```
//! use areograph_base::column::Column;
//!
//! let mut et_s: Column<f64> = (0..100_000).map(|shot| f64::from(shot) / 10.0).collect();
//! et_s.push(1e6);
//! assert_eq!(et_s.at(70_000), 7_000.0);
//! assert_eq!(et_s.iter().last(), Some(1e6));
//! ```

mod kept;
mod tiles;
mod unpacked;

use std::{fmt, ops::Range, sync::Arc};

use rayon::prelude::*;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use self::{kept::Kept, unpacked::Unpacked};
pub use self::{
    kept::{MEMORY_BYTES, lost_values},
    tiles::{TILE, Tile, Tiles, spans},
};
use crate::packed::{self, Packed, TakenBytes};

/// Number of values of a piece.
pub const PIECE: usize = 1 << 14;
/// Number of pieces that are packed at once.
const PIECES_AT_ONCE: usize = 8;

/// A column of values.
///
/// A clone shares the packed pieces.
#[derive(Clone)]
pub struct Column<T> {
    pieces: Vec<Arc<Kept>>,
    /// The values behind the packed pieces.
    rest: Vec<T>,
}

impl<T> Default for Column<T> {
    fn default() -> Self {
        Self::new()
    }
}

impl<T> Column<T> {
    /// A column without values.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            pieces: Vec::new(),
            rest: Vec::new(),
        }
    }

    /// Number of values.
    #[must_use]
    pub const fn len(&self) -> usize {
        self.pieces.len() * PIECE + self.rest.len()
    }

    /// Whether it has no values.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.pieces.is_empty() && self.rest.is_empty()
    }
}

impl<T: Packed> Column<T> {
    /// The value in row `row`, counted from 0.
    ///
    /// # Panics
    /// If the row does not exist. If the temporary file does not return the piece, the task ends by unwinding; see
    /// [`lost_values`].
    #[must_use]
    pub fn at(&self, row: usize) -> T {
        match self.pieces.get(row / PIECE) {
            Some(piece) => Unpacked::value(piece, row % PIECE),
            None => self.rest[row - self.pieces.len() * PIECE],
        }
    }

    /// All values in order.
    #[must_use]
    pub const fn iter(&self) -> Values<'_, T> {
        Values {
            column: self,
            rows: 0..self.len(),
        }
    }

    /// Appends a value.
    pub fn push(&mut self, value: T) {
        self.rest.push(value);
        if self.rest.len() >= PIECES_AT_ONCE * PIECE {
            self.pack();
        }
    }

    /// Appends all values of `other`, which is then empty.
    pub fn append(&mut self, other: &mut Self) {
        let other = std::mem::take(other);
        if other.pieces.is_empty() && self.rest.len() + other.rest.len() < PIECES_AT_ONCE * PIECE {
            self.rest.extend(other.rest);
        } else {
            self.extend(&other);
        }
    }

    /// Removes and returns the values from row `row` on.
    ///
    /// # Panics
    /// If there are fewer values.
    #[must_use]
    pub fn split_off(&mut self, row: usize) -> Self {
        if let Some(row) = row.checked_sub(self.pieces.len() * PIECE) {
            return Self {
                pieces: Vec::new(),
                rest: self.rest.split_off(row),
            };
        }
        let behind = (row..self.len()).map(|row| self.at(row)).collect();
        *self = (0..row).map(|row| self.at(row)).collect();
        behind
    }

    /// The column with what `change` returns for the row and value of each.
    #[must_use]
    pub fn changed(&self, mut change: impl FnMut(usize, T) -> T) -> Self {
        let values = self.iter().enumerate();
        values.map(|(row, value)| change(row, value)).collect()
    }

    /// Packs all full pieces.
    fn pack(&mut self) {
        let full = self.rest.len() / PIECE * PIECE;
        let pieces = self.rest[..full].par_chunks_exact(PIECE);
        let packed: Vec<Option<Arc<Kept>>> = pieces
            .map(|values| Some(Arc::new(Kept::new(packed::piece(values).ok()?))))
            .collect();
        // Numbers of the types of columns can always be packed; otherwise they stay as they are.
        if let Some(packed) = packed.into_iter().collect::<Option<Vec<_>>>() {
            self.pieces.extend(packed);
            self.rest.drain(..full);
        }
    }
}

impl<T: Packed> Extend<T> for Column<T> {
    fn extend<I: IntoIterator<Item = T>>(&mut self, values: I) {
        values.into_iter().for_each(|value| self.push(value));
    }
}

impl<'a, T: Packed> Extend<&'a T> for Column<T> {
    fn extend<I: IntoIterator<Item = &'a T>>(&mut self, values: I) {
        self.extend(values.into_iter().copied());
    }
}

impl<T: Packed> FromIterator<T> for Column<T> {
    fn from_iter<I: IntoIterator<Item = T>>(values: I) -> Self {
        let mut column = Self::new();
        column.extend(values);
        column
    }
}

impl<T: Packed> From<Vec<T>> for Column<T> {
    fn from(values: Vec<T>) -> Self {
        let mut column = Self {
            pieces: Vec::new(),
            rest: values,
        };
        column.pack();
        column
    }
}

impl<'a, T: Packed> IntoIterator for &'a Column<T> {
    type Item = T;
    type IntoIter = Values<'a, T>;

    fn into_iter(self) -> Values<'a, T> {
        self.iter()
    }
}

impl<T: Packed + PartialEq> PartialEq for Column<T> {
    fn eq(&self, other: &Self) -> bool {
        self.len() == other.len() && self.iter().eq(other)
    }
}

impl<T: Packed + fmt::Debug> fmt::Debug for Column<T> {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        to.debug_list().entries(self).finish()
    }
}

/// Values of a column in order.
#[derive(Clone)]
pub struct Values<'a, T> {
    column: &'a Column<T>,
    rows: Range<usize>,
}

impl<T: Packed> Iterator for Values<'_, T> {
    type Item = T;

    fn next(&mut self) -> Option<T> {
        self.rows.next().map(|row| self.column.at(row))
    }

    fn nth(&mut self, n: usize) -> Option<T> {
        self.rows.nth(n).map(|row| self.column.at(row))
    }

    fn size_hint(&self) -> (usize, Option<usize>) {
        self.rows.size_hint()
    }
}

impl<T: Packed> DoubleEndedIterator for Values<'_, T> {
    fn next_back(&mut self) -> Option<T> {
        self.rows.next_back().map(|row| self.column.at(row))
    }
}

impl<T: Packed> ExactSizeIterator for Values<'_, T> {}

/// Stored in the form of [`packed::serialize`], in pieces of [`PIECE`] values.
impl<T: Packed> Serialize for Column<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let kept = self.pieces.iter().map(|piece| piece.bytes());
        packed::serialize_pieces(self.len(), kept, &self.rest, PIECE, serializer)
    }
}

/// Every piece is unpacked once to verify it; pieces of [`PIECE`] values stay packed, and others are packed anew.
impl<'de, T: Packed> Deserialize<'de> for Column<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_byte_buf(TakenBytes(Self::of_stored))
    }
}

impl<T: Packed> Column<T> {
    /// The column of these stored bytes; `None` if they are damaged.
    fn of_stored(bytes: &[u8]) -> Option<Self> {
        let (count, pieces) = packed::split(bytes)?;
        let part = |bytes: &&[u8]| {
            let values: Vec<T> = packed::values(bytes)?;
            Some(if values.len() == PIECE {
                Self {
                    pieces: vec![Arc::new(Kept::new(bytes.to_vec()))],
                    rest: Vec::new(),
                }
            } else {
                Self {
                    pieces: Vec::new(),
                    rest: values,
                }
            })
        };
        let parts: Option<Vec<Self>> = pieces.par_iter().map(part).collect();
        let mut column = Self::new();
        for mut part in parts? {
            if column.rest.is_empty() && part.rest.is_empty() {
                column.pieces.append(&mut part.pieces);
            } else {
                column.append(&mut part);
            }
        }
        (column.len() == count).then_some(column)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbers(count: usize) -> Vec<f64> {
        (0..count)
            .map(|row| -1.1e7 + (row * row) as f64 / 7.0)
            .collect()
    }

    const COUNTS: [usize; 8] = [
        0,
        1,
        PIECE - 1,
        PIECE,
        PIECE + 1,
        8 * PIECE - 1,
        8 * PIECE,
        9 * PIECE + 5,
    ];

    #[test]
    fn values_are_those_of_a_vector_across_pieces() {
        for count in COUNTS {
            let values = numbers(count);
            let pushed: Column<f64> = values.iter().copied().collect();
            let whole = Column::from(values.clone());
            assert_eq!(pushed.len(), count);
            assert_eq!(pushed.is_empty(), count == 0);
            assert_eq!(whole.pieces.len(), count / PIECE);
            assert!(pushed == whole, "{count}");
            assert!(whole.iter().eq(values.iter().copied()), "{count}");
            // Against the order of the rows, and in strides of more than a piece.
            assert!(whole.iter().rev().eq(values.iter().rev().copied()));
            let stride = PIECE + 3;
            let strided = whole.iter().step_by(stride);
            assert!(strided.eq(values.iter().step_by(stride).copied()));
            for row in [0, PIECE - 1, PIECE, count.saturating_sub(1)] {
                if row < count {
                    assert_eq!(whole.at(row).to_bits(), values[row].to_bits());
                }
            }
        }
    }

    #[test]
    fn threads_read_the_same_values() {
        let values = numbers(5 * PIECE + 1);
        let column = Column::from(values.clone());
        let read: Vec<f64> = (0..values.len())
            .into_par_iter()
            .map(|row| column.at(row))
            .collect();
        assert_eq!(read, values);
    }

    #[test]
    fn more_columns_than_a_thread_keeps_are_read_row_by_row() {
        let columns: Vec<Column<u32>> = (0..100_u32)
            .map(|first| (first..first + 16_400).collect())
            .collect();
        for row in [0, 1, PIECE - 1, PIECE, PIECE + 15] {
            for (first, column) in columns.iter().enumerate() {
                assert_eq!(column.at(row) as usize, first + row);
            }
        }
    }

    #[test]
    fn columns_are_joined_divided_and_changed() {
        for (count, row) in [
            (3, 0),
            (3, 3),
            (PIECE + 5, PIECE),
            (5 * PIECE, PIECE + 1),
            (5 * PIECE + 7, 5 * PIECE + 2),
        ] {
            let values = numbers(count);
            let mut first = Column::from(values.clone());
            let mut second = first.split_off(row);
            assert!(first.iter().eq(values[..row].iter().copied()), "{row}");
            assert!(second.iter().eq(values[row..].iter().copied()), "{row}");
            first.append(&mut second);
            assert!(second.is_empty() && first == Column::from(values.clone()));
            let changed = first.changed(|at, value| if at == row { 0.5 } else { value });
            let differs =
                (0..count).filter(|at| changed.at(*at).to_bits() != values[*at].to_bits());
            assert!(differs.eq((row..count).take(1)), "{row} of {count}");
        }
    }

    /// Stored in pieces of another length.
    #[derive(Serialize)]
    struct Long(#[serde(with = "crate::packed")] Vec<f64>);

    #[test]
    fn stored_columns_come_back_and_damaged_ones_are_refused() {
        for count in COUNTS {
            let column = Column::from(numbers(count));
            let bytes = postcard::to_stdvec(&column).unwrap();
            let found: Column<f64> = postcard::from_bytes(&bytes).unwrap();
            assert!(found == column, "{count}");
            assert_eq!(found.pieces.len(), column.pieces.len());
            // However the values came in, their stored form is one.
            let pushed: Column<f64> = column.iter().collect();
            assert_eq!(postcard::to_stdvec(&pushed).unwrap(), bytes, "{count}");
            let cut: Result<Column<f64>, _> = postcard::from_bytes(&bytes[..bytes.len() - 1]);
            assert!(cut.is_err(), "{count}");
        }
        // Longer pieces are packed anew.
        let values = numbers(9 * PIECE + 5);
        let bytes = postcard::to_stdvec(&Long(values.clone())).unwrap();
        let found: Column<f64> = postcard::from_bytes(&bytes).unwrap();
        assert!(found == Column::from(values));
        // The count states one value more than is stored.
        let bytes = postcard::to_stdvec(&Column::from(numbers(2 * PIECE))).unwrap();
        let place = (0..bytes.len())
            .find(|at| bytes[*at..].starts_with(&(2 * PIECE as u64).to_le_bytes()))
            .unwrap();
        let mut more = bytes;
        more[place] += 1;
        assert!(postcard::from_bytes::<Column<f64>>(&more).is_err());
    }
}
