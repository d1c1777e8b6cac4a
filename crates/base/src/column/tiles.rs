//! Bytes on the cells of a grid, in square tiles.

use std::{fmt, ops::Range, sync::Arc};

use serde::{Deserialize, Deserializer, Serialize, Serializer, de, ser::SerializeStruct as _};

use super::kept::Kept;
use crate::packed::TakenBytes;

/// Edge of a tile, cells.
pub const TILE: usize = 256;

/// Bytes on the cells of a grid, row by row, in square tiles of which few are in memory.
///
/// All tiles of a process beyond [`MEMORY_BYTES`](super::MEMORY_BYTES) lie in an unnamed temporary file; a tile of zeros takes no
/// room. A clone shares the tiles. A tile that the temporary file does not return ends the task by unwinding; see
/// [`lost_values`](super::lost_values).
///
/// ```
/// use areograph_base::column::Tiles;
///
/// let tiles = Tiles::of([2, 3], &[1, 2, 3, 4, 5, 6]);
/// assert_eq!(tiles.window(&(0..2), &(1..3)), [2, 3, 5, 6]);
/// assert_eq!(tiles.bytes(), [1, 2, 3, 4, 5, 6]);
/// ```
#[derive(Clone, Default)]
pub struct Tiles {
    /// Rows and columns.
    size: [usize; 2],
    /// Row by row.
    tiles: Vec<Tile>,
}

/// The bytes of a tile, row by row; `None` where all are zero.
#[derive(Clone, Default)]
pub struct Tile(Option<Arc<Kept>>);

impl Tile {
    /// A tile with these bytes.
    #[must_use]
    pub fn of(bytes: Vec<u8>) -> Self {
        let is_empty = bytes.iter().all(|byte| *byte == 0);
        Self((!is_empty).then(|| Arc::new(Kept::new(bytes))))
    }
}

/// Rows and columns of the tiles of a grid of this size, row by row.
#[must_use]
pub fn spans(size: [usize; 2]) -> Vec<[Range<usize>; 2]> {
    let axis = |axis: usize| {
        let starts = (0..size[axis]).step_by(TILE);
        starts.map(move |start| start..size[axis].min(start + TILE))
    };
    let rows = axis(0);
    rows.flat_map(|rows| axis(1).map(move |columns| [rows.clone(), columns]))
        .collect()
}

impl Tiles {
    /// These bytes, row by row.
    ///
    /// # Panics
    /// If there are fewer bytes than cells.
    #[must_use]
    pub fn of(size: [usize; 2], bytes: &[u8]) -> Self {
        let tile = |[rows, columns]: [Range<usize>; 2]| {
            let row = |row: usize| &bytes[row * size[1]..][columns.clone()];
            Tile::of(rows.flat_map(row).copied().collect())
        };
        Self {
            size,
            tiles: spans(size).into_iter().map(tile).collect(),
        }
    }

    /// These tiles, in the order of [`spans`].
    ///
    /// # Panics
    /// If there are fewer or more tiles.
    #[must_use]
    pub fn of_tiles(size: [usize; 2], tiles: Vec<Tile>) -> Self {
        assert_eq!(tiles.len(), count(size), "tiles of {size:?}");
        Self { size, tiles }
    }

    /// Rows and columns.
    #[must_use]
    pub const fn size(&self) -> [usize; 2] {
        self.size
    }

    /// Whether there is no cell.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.tiles.is_empty()
    }

    /// The bytes of these rows and columns, row by row.
    ///
    /// # Panics
    /// If the grid ends before.
    #[must_use]
    pub fn window(&self, rows: &Range<usize>, columns: &Range<usize>) -> Vec<u8> {
        assert!(rows.end <= self.size[0] && columns.end <= self.size[1]);
        let mut bytes = vec![0; rows.len() * columns.len()];
        self.each_in(rows, columns, |[down, across], tile| {
            let (rows_in, columns_in) = (overlap(rows, &down), overlap(columns, &across));
            for row in rows_in {
                let from = (row - down.start) * across.len() + columns_in.start - across.start;
                let to = (row - rows.start) * columns.len() + columns_in.start - columns.start;
                bytes[to..][..columns_in.len()].copy_from_slice(&tile[from..][..columns_in.len()]);
            }
        });
        bytes
    }

    /// The bytes of these rows and columns; `None` if all are in tiles of zeros, or if they are none.
    #[must_use]
    pub fn filled_window(&self, rows: &Range<usize>, columns: &Range<usize>) -> Option<Vec<u8>> {
        let has_some = self
            .places(rows, columns)
            .any(|at| self.tiles[at].0.is_some());
        has_some.then(|| self.window(rows, columns))
    }

    /// All bytes, row by row.
    #[must_use]
    pub fn bytes(&self) -> Vec<u8> {
        self.window(&(0..self.size[0]), &(0..self.size[1]))
    }

    /// Number of cells of every value.
    #[must_use]
    pub fn counts(&self) -> [u64; 256] {
        let mut counts = [0; 256];
        counts[0] = (self.size[0] * self.size[1]) as u64;
        self.each_in(&(0..self.size[0]), &(0..self.size[1]), |_, tile| {
            for byte in tile {
                counts[usize::from(*byte)] += 1;
            }
            counts[0] -= tile.len() as u64;
        });
        counts
    }

    /// Calls `take` with the rows, columns and bytes of every tile that is not empty and has some of these cells.
    fn each_in(
        &self,
        rows: &Range<usize>,
        columns: &Range<usize>,
        mut take: impl FnMut([Range<usize>; 2], &[u8]),
    ) {
        let across = self.size[1].div_ceil(TILE);
        for at in self.places(rows, columns) {
            if let Some(kept) = &self.tiles[at].0 {
                let [down, right] = [at / across * TILE, at % across * TILE];
                let span = |axis: usize, start: usize| start..self.size[axis].min(start + TILE);
                take([span(0, down), span(1, right)], &kept.bytes());
            }
        }
    }

    /// Places of the tiles that have some of these cells.
    fn places(
        &self,
        rows: &Range<usize>,
        columns: &Range<usize>,
    ) -> impl Iterator<Item = usize> + use<> {
        let across = self.size[1].div_ceil(TILE);
        let span = |of: &Range<usize>| {
            let start = of.start / TILE;
            let end = of.end.div_ceil(TILE);
            start..if of.is_empty() { start } else { end }
        };
        let (down, right) = (span(rows), span(columns));
        down.flat_map(move |row| right.clone().map(move |column| row * across + column))
    }
}

fn overlap(one: &Range<usize>, other: &Range<usize>) -> Range<usize> {
    one.start.max(other.start)..one.end.min(other.end)
}

/// Number of tiles of a grid.
fn count(size: [usize; 2]) -> usize {
    size[0].div_ceil(TILE) * size[1].div_ceil(TILE)
}

impl PartialEq for Tiles {
    fn eq(&self, other: &Self) -> bool {
        let mut tiles = self.tiles.iter().zip(&other.tiles);
        self.size == other.size
            && tiles.all(|(one, other)| match (&one.0, &other.0) {
                (Some(one), Some(other)) => one.bytes() == other.bytes(),
                (one, other) => one.is_none() && other.is_none(),
            })
    }
}

impl Eq for Tiles {}

impl fmt::Debug for Tiles {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [rows, columns] = self.size;
        write!(to, "Tiles of {rows} by {columns} cells")
    }
}

impl Serialize for Tile {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let bytes = self.0.as_ref().map(|kept| kept.bytes());
        serializer.serialize_bytes(&bytes.unwrap_or_default())
    }
}

impl<'de> Deserialize<'de> for Tile {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_byte_buf(TakenBytes(|bytes: &[u8]| Some(Self::of(bytes.to_vec()))))
    }
}

impl Tile {
    /// Whether it has this number of bytes, or none of them.
    fn is_of(&self, cells: usize) -> bool {
        self.0.as_ref().is_none_or(|kept| kept.length() == cells)
    }
}

/// As size and tiles, of which empty ones have no bytes.
impl Serialize for Tiles {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut fields = serializer.serialize_struct("Tiles", 2)?;
        fields.serialize_field("size", &self.size)?;
        fields.serialize_field("tiles", &self.tiles)?;
        fields.end()
    }
}

impl<'de> Deserialize<'de> for Tiles {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        #[derive(Deserialize)]
        #[serde(rename = "Tiles")]
        struct Stored {
            size: [usize; 2],
            tiles: Vec<Tile>,
        }
        let Stored { size, tiles } = Stored::deserialize(deserializer)?;
        let mut of_spans = tiles.iter().zip(spans(size));
        let is_whole = tiles.len() == count(size)
            && of_spans.all(|(tile, [rows, columns])| tile.is_of(rows.len() * columns.len()));
        let damaged = || de::Error::custom("stored tiles are damaged");
        is_whole.then_some(Self { size, tiles }).ok_or_else(damaged)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Three by two tiles, the last ones smaller; one of them is empty.
    const SIZE: [usize; 2] = [2 * TILE + 9, TILE + 70];

    fn bytes() -> Vec<u8> {
        let cell = |at: usize| {
            let [row, column] = [at / SIZE[1], at % SIZE[1]];
            let is_empty = row < TILE && column >= TILE;
            if is_empty {
                0
            } else {
                u8::try_from((row * 7 + column * 3) % 256).unwrap()
            }
        };
        (0..SIZE[0] * SIZE[1]).map(cell).collect()
    }

    #[test]
    fn windows_have_the_bytes_of_their_cells_across_tiles() {
        let bytes = bytes();
        let tiles = Tiles::of(SIZE, &bytes);
        assert_eq!((tiles.size(), tiles.is_empty()), (SIZE, false));
        assert_eq!(tiles.bytes(), bytes);
        for (rows, columns) in [
            (250..600_usize.min(SIZE[0]), 100..300),
            (0..1, 0..1),
            (5..5, 0..9),
            (SIZE[0] - 1..SIZE[0], 0..SIZE[1]),
        ] {
            let row = |row: usize| bytes[row * SIZE[1]..][columns.clone()].to_vec();
            let expected: Vec<u8> = rows.clone().flat_map(row).collect();
            assert_eq!(
                tiles.window(&rows, &columns),
                expected,
                "{rows:?} {columns:?}"
            );
        }
        assert_eq!(tiles.filled_window(&(3..40), &(TILE..TILE + 2)), None);
        assert_eq!(tiles.filled_window(&(3..3), &(0..2)), None);
        let filled = tiles.filled_window(&(3..4), &(TILE - 1..TILE + 1)).unwrap();
        assert_eq!(filled, [bytes[3 * SIZE[1] + TILE - 1], 0]);
        let mut counts = [0; 256];
        for byte in &bytes {
            counts[usize::from(*byte)] += 1;
        }
        assert_eq!(tiles.counts(), counts);
        let made = spans(SIZE)
            .into_iter()
            .map(|[rows, columns]| Tile::of(tiles.window(&rows, &columns)));
        assert_eq!(Tiles::of_tiles(SIZE, made.collect()), tiles);
        let mut other = bytes;
        other[9] ^= 1;
        assert_ne!(Tiles::of(SIZE, &other), tiles);
    }

    #[test]
    fn stored_tiles_come_back_and_damaged_ones_are_refused() {
        let tiles = Tiles::of(SIZE, &bytes());
        let stored = postcard::to_stdvec(&tiles).unwrap();
        let found: Tiles = postcard::from_bytes(&stored).unwrap();
        assert_eq!(found, tiles);
        assert!(stored.len() < SIZE[0] * SIZE[1] - TILE * 60);
        let none: Tiles =
            postcard::from_bytes(&postcard::to_stdvec(&Tiles::default()).unwrap()).unwrap();
        assert!(none.is_empty() && none.bytes().is_empty());
        // The size is not that of the tiles.
        let other = Tiles {
            size: [SIZE[0] - 1, SIZE[1]],
            ..tiles.clone()
        };
        let fewer = Tiles {
            size: [TILE, SIZE[1]],
            ..tiles
        };
        for damaged in [other, fewer] {
            let stored = postcard::to_stdvec(&damaged).unwrap();
            assert!(postcard::from_bytes::<Tiles>(&stored).is_err());
        }
    }
}
