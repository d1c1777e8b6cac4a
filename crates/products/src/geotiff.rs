//! Numbers on a grid as a cloud-optimised `GeoTIFF`: tables of all sizes first, then tiles from the smallest size to
//! full size, so that a viewer needs only the beginning and the tiles that it shows. Without compression, for readers
//! that require it.
//!
//! The TIFF library writes tables after their data; here they precede them and are therefore written by this module.

use areograph_base::{
    body::{Body, MapSphere},
    units::RADIANS_PER_DEGREE,
};
use areograph_geom::height_grid::HeightGrid;

/// Edge of a tile, cells.
const TILE: usize = 256;
/// Signals to GDAL that tables come first; 32 and its own bytes counted from its third line.
const LAYOUT: &str = "LAYOUT=IFDS_BEFORE_DATA\nKNOWN_INCOMPATIBLE_EDITION=NO\n ";

/// Types of values.
const ASCII: u16 = 2;
const SHORT: u16 = 3;
const LONG: u16 = 4;
const DOUBLE: u16 = 12;

/// A kind of number in a file.
pub trait Number: Copy {
    /// Bits, and format of the sample: 1 without a sign, 3 with decimals.
    const LAYOUT: [usize; 2];
    /// Cells without a number, as readers of the file find them.
    const NO_DATA: &'static str;
    /// A cell without a number.
    const NONE: Self;

    /// Whether the cell has no number.
    fn is_none(self) -> bool;

    /// The mean of numbers, of which there is at least one.
    fn mean(numbers: impl Iterator<Item = Self> + Clone) -> Self;

    /// Appends its bytes in the file.
    fn append(self, bytes: &mut Vec<u8>);
}

/// Numbers in metres; NaN without a number.
impl Number for f32 {
    const LAYOUT: [usize; 2] = [32, 3];
    const NO_DATA: &'static str = "-32768";
    const NONE: Self = Self::NAN;

    fn is_none(self) -> bool {
        self.is_nan()
    }

    fn mean(numbers: impl Iterator<Item = Self> + Clone) -> Self {
        let count: Self = numbers.clone().map(|_| 1.0).sum();
        numbers.sum::<Self>() / count
    }

    fn append(self, bytes: &mut Vec<u8>) {
        let number = if self.is_nan() { -32_768.0 } else { self };
        bytes.extend(number.to_le_bytes());
    }
}

/// Brightness from 1 on; 0 without one.
impl Number for u8 {
    const LAYOUT: [usize; 2] = [8, 1];
    const NO_DATA: &'static str = "0";
    const NONE: Self = 0;

    fn is_none(self) -> bool {
        self == 0
    }

    fn mean(numbers: impl Iterator<Item = Self> + Clone) -> Self {
        let count: u32 = numbers.clone().map(|_| 1).sum();
        let sum: u32 = numbers.map(u32::from).sum();
        Self::try_from((sum + count / 2) / count).unwrap_or(Self::MAX)
    }

    fn append(self, bytes: &mut Vec<u8>) {
        bytes.push(self);
    }
}

/// Contents of a file.
pub struct GeoTiff<'a, N> {
    /// Grid of the cells; its heights are not written.
    pub grid: &'a HeightGrid,
    /// Latitude at which cells are as wide as high, radians.
    pub parallel_rad: f64,
    /// The body whose sphere the grid is of.
    pub body: Body,
    /// Meaning of the numbers, in words.
    pub what: &'a str,
    /// Row by row.
    pub numbers: &'a [N],
}

/// A field of a table.
struct Field {
    tag: u16,
    kind: u16,
    count: usize,
    bytes: Vec<u8>,
}

/// One size of the numbers.
struct Size<N> {
    rows: usize,
    columns: usize,
    numbers: Vec<N>,
}

impl<N: Number> GeoTiff<'_, N> {
    /// The file.
    #[must_use]
    pub fn encoded(&self) -> Vec<u8> {
        let sizes = self.sizes();
        let head = format!(
            "GDAL_STRUCTURAL_METADATA_SIZE={:06} bytes\n{LAYOUT}",
            LAYOUT.len()
        );
        let mut bytes = b"II\x2a\0".to_vec();
        let first = (8 + head.len()).next_multiple_of(2);
        bytes.extend(long(first));
        bytes.extend(head.as_bytes());
        bytes.resize(first, 0);
        // Offsets of tiles depend on the length of the tables, not the other way round.
        let nowhere: Vec<usize> = vec![0; sizes.len()];
        let tables = self.tables(&sizes, first, &nowhere);
        let mut at = first + tables.len();
        let mut begins = nowhere;
        for (begin, size) in begins.iter_mut().zip(&sizes).rev() {
            *begin = at;
            at += size.tiles() * tile_bytes::<N>();
        }
        bytes.extend(self.tables(&sizes, first, &begins));
        for size in sizes.iter().rev() {
            size.append(&mut bytes);
        }
        bytes
    }

    /// The numbers, and their means over 2 by 2, 4 by 4 … cells until one tile holds them.
    fn sizes(&self) -> Vec<Size<N>> {
        let [rows, columns] = self.grid.size;
        let mut sizes = vec![Size {
            rows,
            columns,
            numbers: self.numbers.to_vec(),
        }];
        while let Some(last) = sizes.last()
            && last.rows.max(last.columns) > TILE
        {
            sizes.push(last.halved());
        }
        sizes
    }

    /// Tables of all sizes, which begin at the byte `at`.
    fn tables(&self, sizes: &[Size<N>], at: usize, begins: &[usize]) -> Vec<u8> {
        let mut bytes = Vec::new();
        for (number, (size, begin)) in sizes.iter().zip(begins).enumerate() {
            let mut fields = size.fields(*begin, number > 0);
            if number == 0 {
                fields.extend(self.fields());
            }
            fields.push(Field::text(42_113, N::NO_DATA));
            fields.sort_by_key(|field| field.tag);
            let is_last = number + 1 == sizes.len();
            bytes.extend(table(&fields, at + bytes.len(), is_last));
        }
        bytes
    }

    /// Description of the file's data, and its georeference.
    fn fields(&self) -> Vec<Field> {
        let MapSphere { crs, datum, .. } = self.body.map();
        let radius_m = self.grid.radius_m;
        let [west_rad, _, _, north_rad] = self.grid.edges_rad();
        let cell_m = self.grid.cell_rad[1] * radius_m;
        let place_m = [west_rad * self.parallel_rad.cos(), north_rad].map(|of| of * radius_m);
        let names = format!("Equirectangular {}|{crs}|", self.body.names().name);
        let split = names.find('|').map_or(0, |at| at + 1);
        // Map, areas, a name; sphere, its name, degrees, both half-axes, meridian; map, its kind, metres, parallel,
        // longitude.
        let user = 32_767;
        let keys: [[usize; 4]; 16] = [
            [1, 1, 0, 15],
            [1024, 0, 1, 1],
            [1025, 0, 1, 1],
            [2048, 0, 1, user],
            [2049, 34_737, names.len() - split, split],
            [2050, 0, 1, user],
            [2054, 0, 1, 9102],
            [2056, 0, 1, user],
            [2057, 34_736, 1, 0],
            [2058, 34_736, 1, 0],
            [2061, 34_736, 1, 2],
            [3072, 0, 1, user],
            [3073, 34_737, split, 0],
            [3075, 0, 1, 17],
            [3076, 0, 1, 9001],
            [3078, 34_736, 1, 1],
        ];
        let rest: [[usize; 4]; 3] = [
            [3082, 34_736, 1, 2],
            [3083, 34_736, 1, 2],
            [3088, 34_736, 1, 2],
        ];
        let mut keys: Vec<[usize; 4]> = keys.into_iter().chain(rest).collect();
        keys[0][3] = keys.len() - 1;
        let numbers = [radius_m, self.parallel_rad / RADIANS_PER_DEGREE, 0.0];
        vec![
            Field::text(270, &format!("{}; sphere {datum}, {radius_m} m", self.what)),
            Field::doubles(33_550, &[cell_m, cell_m, 0.0]),
            Field::doubles(33_922, &[0.0, 0.0, 0.0, place_m[0], place_m[1], 0.0]),
            Field::shorts(34_735, &keys.concat()),
            Field::doubles(34_736, &numbers),
            Field::text(34_737, &names),
        ]
    }
}

impl<N: Number> Size<N> {
    fn across(&self) -> [usize; 2] {
        [self.rows.div_ceil(TILE), self.columns.div_ceil(TILE)]
    }

    fn tiles(&self) -> usize {
        let [down, across] = self.across();
        down * across
    }

    /// Layout of the numbers in the file, from the byte `begin` on.
    fn fields(&self, begin: usize, is_reduced: bool) -> Vec<Field> {
        let bytes = tile_bytes::<N>();
        let [bits, format] = N::LAYOUT;
        let begins: Vec<usize> = (0..self.tiles()).map(|tile| begin + tile * bytes).collect();
        vec![
            Field::longs(254, &[usize::from(is_reduced)]),
            Field::longs(256, &[self.columns]),
            Field::longs(257, &[self.rows]),
            // Not compressed, the least black, one of a cell.
            Field::shorts(258, &[bits]),
            Field::shorts(259, &[1]),
            Field::shorts(262, &[1]),
            Field::shorts(277, &[1]),
            Field::shorts(339, &[format]),
            Field::shorts(322, &[TILE]),
            Field::shorts(323, &[TILE]),
            Field::longs(324, &begins),
            Field::longs(325, &vec![bytes; self.tiles()]),
        ]
    }

    fn number(&self, row: usize, column: usize) -> N {
        if row < self.rows && column < self.columns {
            self.numbers[row * self.columns + column]
        } else {
            N::NONE
        }
    }

    /// Appends the tiles.
    fn append(&self, bytes: &mut Vec<u8>) {
        let [down, across] = self.across();
        for tile in 0..down * across {
            let [top, left] = [tile / across * TILE, tile % across * TILE];
            for row in top..top + TILE {
                for column in left..left + TILE {
                    self.number(row, column).append(bytes);
                }
            }
        }
    }

    /// Means of two by two cells, of those that have a number.
    fn halved(&self) -> Self {
        let (rows, columns) = (self.rows.div_ceil(2), self.columns.div_ceil(2));
        let mut numbers = Vec::with_capacity(rows * columns);
        for row in 0..rows {
            for column in 0..columns {
                let four = [[0, 0], [0, 1], [1, 0], [1, 1]]
                    .map(|[down, right]| self.number(2 * row + down, 2 * column + right));
                let known = four.iter().copied().filter(|number| !number.is_none());
                let is_empty = known.clone().next().is_none();
                numbers.push(if is_empty { N::NONE } else { N::mean(known) });
            }
        }
        Self {
            rows,
            columns,
            numbers,
        }
    }
}

/// Bytes of a tile.
const fn tile_bytes<N: Number>() -> usize {
    TILE * TILE * N::LAYOUT[0] / 8
}

impl Field {
    fn of(tag: u16, kind: u16, count: usize, bytes: Vec<u8>) -> Self {
        Self {
            tag,
            kind,
            count,
            bytes,
        }
    }

    fn shorts(tag: u16, numbers: &[usize]) -> Self {
        let bytes = numbers.iter().flat_map(|number| {
            let [low, high, ..] = long(*number);
            [low, high]
        });
        Self::of(tag, SHORT, numbers.len(), bytes.collect())
    }

    fn longs(tag: u16, numbers: &[usize]) -> Self {
        let bytes = numbers.iter().flat_map(|number| long(*number));
        Self::of(tag, LONG, numbers.len(), bytes.collect())
    }

    fn doubles(tag: u16, numbers: &[f64]) -> Self {
        let bytes = numbers.iter().flat_map(|number| number.to_le_bytes());
        Self::of(tag, DOUBLE, numbers.len(), bytes.collect())
    }

    fn text(tag: u16, text: &str) -> Self {
        let bytes: Vec<u8> = text.bytes().chain([0]).collect();
        Self::of(tag, ASCII, bytes.len(), bytes)
    }
}

/// A table at the byte `at`, followed by values that do not fit into it; then the next one.
fn table(fields: &[Field], at: usize, is_last: bool) -> Vec<u8> {
    let head = 2 + 12 * fields.len() + 4;
    let mut bytes = long(fields.len())[..2].to_vec();
    let mut behind: Vec<u8> = Vec::new();
    for field in fields {
        bytes.extend(field.tag.to_le_bytes());
        bytes.extend(field.kind.to_le_bytes());
        bytes.extend(long(field.count));
        if field.bytes.len() <= 4 {
            bytes.extend(&field.bytes);
            bytes.resize(bytes.len() + 4 - field.bytes.len(), 0);
        } else {
            bytes.extend(long(at + head + behind.len()));
            behind.extend(&field.bytes);
            behind.resize(behind.len().next_multiple_of(2), 0);
        }
    }
    let next = if is_last { 0 } else { at + head + behind.len() };
    bytes.extend(long(next));
    bytes.extend(behind);
    bytes
}

/// Four bytes of a number; the largest grid has 100 MB.
fn long(number: usize) -> [u8; 4] {
    u32::try_from(number).unwrap_or(u32::MAX).to_le_bytes()
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use tiff::decoder::Decoder;

    use super::*;

    #[test]
    fn tables_stand_before_tiles_and_overviews_are_means() {
        let grid = HeightGrid {
            size: [600, 300],
            first_rad: [1.0, 0.2],
            cell_rad: [1e-6, 1e-6],
            radius_m: 3_396_190.0,
            heights_m: Vec::new(),
        };
        let mut numbers: Vec<f32> = (0..600 * 300).map(|at| (at / 300) as f32).collect();
        numbers[0] = f32::NAN;
        let tiff = GeoTiff {
            grid: &grid,
            parallel_rad: 0.2,
            body: Body::Mars,
            what: "numbers",
            numbers: &numbers,
        };
        let bytes = tiff.encoded();
        let first_tile = bytes.len() - (3 * 2 + 2 + 1) * TILE * TILE * 4;
        let mut decoder = Decoder::new(Cursor::new(&bytes)).unwrap();
        let sizes = [(300, 600), (150, 300), (75, 150)];
        let mut begins = Vec::new();
        for (number, size) in sizes.into_iter().enumerate() {
            assert_eq!(decoder.dimensions().unwrap(), size);
            let at = decoder.ifd_pointer().unwrap().0;
            assert!(usize::try_from(at).unwrap() < first_tile);
            let offsets = decoder
                .get_tag_u64_vec(tiff::tags::Tag::TileOffsets)
                .unwrap();
            begins.push(offsets[0]);
            let tiff::decoder::DecodingResult::F32(tile) = decoder.read_chunk(0).unwrap() else {
                panic!("{number}");
            };
            // A cell without a number stays empty in the full size, and is not counted in means.
            let expected = [-32_768.0, 0.5 * (1.0 + 1.0) * 2.0 / 3.0, 1.5];
            assert!((tile[0] - expected[number]).abs() < 0.1, "{}", tile[0]);
            // A row farther south is one more, or two, or four.
            let width = usize::try_from(size.0).unwrap().min(TILE);
            let rise = tile[41 * width] - tile[40 * width];
            assert!((rise - (1 << number) as f32).abs() < 1e-4, "{rise}");
            if number < 2 {
                decoder.next_image().unwrap();
            }
        }
        assert!(!decoder.more_images());
        assert!(begins[0] > begins[1] && begins[1] > begins[2]);
    }
}
