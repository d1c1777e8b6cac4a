//! Columns of numbers in stored outputs, compressed without loss.
//!
//! Each shot has about twenty numbers, and a run stores them several times. Compressing each column separately reduces
//! their size by a factor of 5 to 15. A field with `#[serde(with = "areograph_base::packed")]` is stored in the form that
//! [`serialize`] produces.

use std::{borrow::Cow, fmt};

use pco::{
    ChunkConfig,
    data_types::Number,
    errors::PcoError,
    standalone::{simple_compress, simple_decompress},
};
use rayon::prelude::*;
use serde::{Deserializer, Serializer, de, ser::Error as _};

/// Number of values that one thread compresses as a piece.
const PIECE: usize = 1 << 17;
/// Level of compression: half the time of the default level, 8, for some percent more bytes.
const LEVEL: usize = 4;
/// Size of an encoded count or length, bytes.
const LENGTH_BYTES: usize = 8;

/// A type whose values can be stored in a packed column.
pub trait Packed: Copy + Default + Send + Sync + 'static {
    /// The number.
    type Number: Number + Send;

    /// The value as a number.
    fn number(self) -> Self::Number;

    /// The value that this number represents.
    fn of(number: Self::Number) -> Self;
}

macro_rules! numbers {
    ($($kind:ty),*) => {
        $(impl Packed for $kind {
            type Number = Self;

            fn number(self) -> Self {
                self
            }

            fn of(number: Self) -> Self {
                number
            }
        })*
    };
}

numbers!(f64, i16, u8, u16, u32, u64);

impl Packed for bool {
    type Number = u8;

    fn number(self) -> u8 {
        u8::from(self)
    }

    fn of(number: u8) -> Self {
        number != 0
    }
}

/// Stores a column as bytes: the number of values, then the pieces, each preceded by its length.
///
/// The bytes depend on the values alone, not on the number of threads.
///
/// # Errors
/// Those of `serializer`.
pub fn serialize<T: Packed, S: Serializer>(column: &[T], serializer: S) -> Result<S::Ok, S::Error> {
    serialize_pieces(column.len(), std::iter::empty(), column, PIECE, serializer)
}

/// Stores `count` values: packed pieces, and behind them values that are packed in pieces of this size.
///
/// # Errors
/// Those of `serializer`.
pub(crate) fn serialize_pieces<'a, T: Packed, S: Serializer>(
    count: usize,
    pieces: impl Iterator<Item = Cow<'a, [u8]>>,
    rest: &[T],
    size: usize,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    let packed: Result<Vec<Vec<u8>>, _> = rest.par_chunks(size).map(piece).collect();
    let packed = packed.map_err(S::Error::custom)?;
    let mut bytes = length(count).to_vec();
    for piece in pieces.chain(packed.into_iter().map(Cow::Owned)) {
        bytes.extend(length(piece.len()));
        bytes.extend(&*piece);
    }
    serializer.serialize_bytes(&bytes)
}

/// Packs the values of a piece.
///
/// # Errors
/// None for the numbers of columns.
pub(crate) fn piece<T: Packed>(values: &[T]) -> Result<Vec<u8>, PcoError> {
    let numbers: Vec<T::Number> = values.iter().map(|value| value.number()).collect();
    let config = ChunkConfig::default().with_compression_level(LEVEL);
    simple_compress(&numbers, &config.with_enable_8_bit(true))
}

/// The values of a packed piece; `None` if it is damaged.
pub(crate) fn values<T: Packed>(piece: &[u8]) -> Option<Vec<T>> {
    let numbers: Vec<T::Number> = simple_decompress(piece).ok()?;
    Some(numbers.into_iter().map(T::of).collect())
}

/// Reads a column that [`serialize`] stored.
///
/// # Errors
/// Bytes that are not such a column; those of `deserializer`.
pub fn deserialize<'de, T: Packed, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<Vec<T>, D::Error> {
    deserializer.deserialize_byte_buf(TakenBytes(unpacked))
}

const fn length(count: usize) -> [u8; LENGTH_BYTES] {
    (count as u64).to_le_bytes()
}

/// The length at the start of `bytes`, and the bytes that follow it.
fn split_length(bytes: &[u8]) -> Option<(usize, &[u8])> {
    let (length, rest) = bytes.split_first_chunk::<LENGTH_BYTES>()?;
    Some((usize::try_from(u64::from_le_bytes(*length)).ok()?, rest))
}

/// The number of values of a stored column, and its packed pieces.
pub(crate) fn split(bytes: &[u8]) -> Option<(usize, Vec<&[u8]>)> {
    let (count, mut rest) = split_length(bytes)?;
    let mut pieces = Vec::new();
    while !rest.is_empty() {
        let (length, behind) = split_length(rest)?;
        let (piece, behind) = behind.split_at_checked(length)?;
        pieces.push(piece);
        rest = behind;
    }
    Some((count, pieces))
}

fn unpacked<T: Packed>(bytes: &[u8]) -> Option<Vec<T>> {
    let (count, pieces) = split(bytes)?;
    let pieces: Vec<Vec<T>> = pieces.into_par_iter().map(values).collect::<Option<_>>()?;
    let values = pieces.concat();
    (values.len() == count).then_some(values)
}

/// Visitor of bytes that makes a value of them, `None` if they are damaged, without a copy of them.
pub(crate) struct TakenBytes<F>(pub(crate) F);

impl<T, F: FnOnce(&[u8]) -> Option<T>> de::Visitor<'_> for TakenBytes<F> {
    type Value = T;

    fn expecting(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        to.write_str("the bytes of a column")
    }

    fn visit_bytes<E: de::Error>(self, bytes: &[u8]) -> Result<T, E> {
        self.0(bytes).ok_or_else(|| E::custom("a stored column is damaged"))
    }
}

#[cfg(test)]
mod tests {
    use serde::{Deserialize, Serialize};

    use super::*;

    #[derive(Debug, PartialEq, Serialize, Deserialize)]
    struct Columns {
        #[serde(with = "super")]
        et_s: Vec<f64>,
        #[serde(with = "super")]
        row: Vec<u32>,
        #[serde(with = "super")]
        inside: Vec<bool>,
    }

    fn columns(count: u32) -> Columns {
        Columns {
            et_s: (0..count)
                .map(|row| -1.1e7 + f64::from(row) / 10.0)
                .collect(),
            row: (0..count).collect(),
            inside: (0..count).map(|row| row % 7 == 0).collect(),
        }
    }

    #[test]
    fn columns_come_back_bit_for_bit_and_smaller() {
        let pieces = u32::try_from(PIECE).unwrap();
        for count in [0, 1, pieces, pieces + 1, 2 * pieces + 5] {
            let columns = columns(count);
            let bytes = postcard::to_stdvec(&columns).unwrap();
            assert_eq!(postcard::from_bytes::<Columns>(&bytes).unwrap(), columns);
            // 13 bytes of plain numbers in each row.
            assert!(bytes.len() < 3 * 64 + 3 * count as usize, "{}", bytes.len());
        }
        let odd = [
            f64::NAN,
            -0.0,
            f64::NEG_INFINITY,
            f64::MIN_POSITIVE / 3.0,
            0.1,
        ];
        let columns = Columns {
            et_s: odd.to_vec(),
            ..columns(0)
        };
        let bytes = postcard::to_stdvec(&columns).unwrap();
        let found: Columns = postcard::from_bytes(&bytes).unwrap();
        assert_eq!(
            found.et_s.iter().map(|of| of.to_bits()).collect::<Vec<_>>(),
            odd.map(f64::to_bits)
        );
    }

    #[test]
    fn a_damaged_column_is_an_error() {
        let bytes = postcard::to_stdvec(&columns(100)).unwrap();
        let cut = &bytes[..bytes.len() - 1];
        assert!(postcard::from_bytes::<Columns>(cut).is_err());
        // The count states one value more than is stored.
        let mut more = bytes;
        let count = more.windows(8).position(|of| of == length(100)).unwrap();
        more[count] = 101;
        let error = postcard::from_bytes::<Columns>(&more);
        assert_eq!(error, Err(postcard::Error::SerdeDeCustom));
    }
}
