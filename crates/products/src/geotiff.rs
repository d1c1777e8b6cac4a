//! Numbers on a grid as a cloud-optimised `GeoTIFF`: tables of all sizes first, then tiles from the smallest size to
//! full size, so that a viewer needs only the beginning and the tiles that it shows. Tiles are compressed with deflate.
//!
//! The TIFF library writes tables after their data; here they precede them and are therefore written by this module.

mod fields;
mod number;

use std::{borrow::Cow, io::Write as _, path::Path};

use flate2::{Compression, write::ZlibEncoder};
use rayon::prelude::*;

use self::fields::{Field, long, table};
use super::{
    error::ProductError,
    files::{read_bytes, write_bytes},
};
use areograph_base::{
    body::{Body, MapSphere},
    error::{Locate as _, Result},
    units::RADIANS_PER_DEGREE,
};
use areograph_geom::{
    conformal_map::{ConformalMap, Projection},
    height_grid::HeightGrid,
};

pub use number::Number;

/// Edge of a tile, cells.
const TILE: usize = 256;
/// Signals to GDAL that tables come first; 32 and its own bytes counted from its third line.
const LAYOUT: &str = "LAYOUT=IFDS_BEFORE_DATA\nKNOWN_INCOMPATIBLE_EDITION=NO\n ";

/// Contents of a file.
pub struct GeoTiff<'a, N> {
    /// Grid of the cells; its heights are not written.
    pub grid: &'a HeightGrid,
    /// Latitude at which cells are as wide as high, radians.
    pub parallel_rad: f64,
    /// The body whose sphere the grid is of.
    pub body: Body,
    /// The map where it is not equirectangular; then angles of the grid are distances on the map in parts of the radius of the grid.
    pub conformal: Option<&'a ConformalMap>,
    /// Meaning of the numbers, in words, which readers show as the name of the band.
    pub what: &'a str,
    /// Unit of the numbers, as in `m`; empty without one.
    pub unit: &'a str,
    /// The surface from which heights are counted where it is not the sphere of the map, as in `MOLA areoid`; empty for
    /// other numbers.
    pub vertical: &'a str,
    /// Row by row.
    pub numbers: &'a [N],
}

/// One size of the numbers.
struct Size<'a, N: Clone> {
    rows: usize,
    columns: usize,
    numbers: Cow<'a, [N]>,
}

impl<N: Number + Send + Sync> GeoTiff<'_, N> {
    /// The file.
    #[must_use]
    pub fn encoded(&self) -> Vec<u8> {
        let sizes = self.sizes();
        let tiles: Vec<Vec<Vec<u8>>> = sizes.iter().map(Size::compressed).collect();
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
        let mut places: Vec<Vec<[usize; 2]>> = tiles
            .iter()
            .map(|tiles| tiles.iter().map(|tile| [0, tile.len()]).collect())
            .collect();
        let mut at = first + self.tables(&sizes, first, &places).len();
        for [begin, length] in places.iter_mut().rev().flatten() {
            *begin = at;
            at += *length;
        }
        bytes.extend(self.tables(&sizes, first, &places));
        bytes.reserve(at - bytes.len());
        for tile in tiles.into_iter().rev().flatten() {
            bytes.extend_from_slice(&tile);
        }
        bytes
    }

    /// The numbers, and their means over 2 by 2, 4 by 4 … cells until one tile holds them.
    fn sizes(&self) -> Vec<Size<'_, N>> {
        let [rows, columns] = self.grid.size;
        let mut sizes = vec![Size {
            rows,
            columns,
            numbers: self.numbers.into(),
        }];
        while let Some(last) = sizes.last()
            && last.rows.max(last.columns) > TILE
        {
            sizes.push(last.halved());
        }
        sizes
    }

    /// Tables of all sizes, which begin at the byte `at`; `places` are offsets and lengths of tiles.
    fn tables(&self, sizes: &[Size<'_, N>], at: usize, places: &[Vec<[usize; 2]>]) -> Vec<u8> {
        let mut bytes = Vec::new();
        for (number, (size, places)) in sizes.iter().zip(places).enumerate() {
            let mut fields = size.fields(places, number > 0);
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
        let [west_rad, _, _, north_rad] = self.grid.edges_rad();
        let cell_m = self.grid.cell_rad[1] * self.grid.radius_m;
        let place_m = [west_rad * self.parallel_rad.cos(), north_rad];
        let place_m = place_m.map(|of| of * self.grid.radius_m);
        let MapKeys {
            sphere,
            keys,
            numbers,
            names,
        } = self.map_keys();
        vec![
            Field::text(270, &format!("{}; {sphere}", self.what)),
            Field::doubles(33_550, &[cell_m, cell_m, 0.0]),
            Field::doubles(33_922, &[0.0, 0.0, 0.0, place_m[0], place_m[1], 0.0]),
            Field::shorts(34_735, &keys.concat()),
            Field::doubles(34_736, &numbers),
            Field::text(34_737, &names),
            Field::text(42_112, &self.metadata()),
        ]
    }

    /// The coordinate system.
    fn map_keys(&self) -> MapKeys {
        let MapSphere { crs, datum, .. } = self.body.map();
        let (of_map, of_sphere, sphere, radius_m) = match self.conformal {
            None => {
                let radius_m = self.grid.radius_m;
                (
                    format!("Equirectangular {}|", self.body.names().name),
                    format!("{crs}|"),
                    format!("sphere {datum}, {radius_m} m"),
                    radius_m,
                )
            }
            Some(map) => {
                let radius_m = map.radius_m;
                let name = match map.projection {
                    Projection::Mercator => "Mercator|",
                    Projection::Stereographic => "Stereographic|",
                };
                let sphere = format!("sphere of {radius_m} m");
                (name.to_owned(), format!("{sphere}|"), sphere, radius_m)
            }
        };
        let of_heights = format!("height above the {}|", self.vertical);
        let (split, end) = (of_map.len(), of_map.len() + of_sphere.len());
        // Map, areas, a name; sphere, its name, degrees, both half-axes, meridian; map, its kind, metres, parallel,
        // longitude.
        let user = 32_767;
        let kind = match self.conformal.map(|map| map.projection) {
            None => 17,
            Some(Projection::Mercator) => 7,
            Some(Projection::Stereographic) => 14,
        };
        let first: [[usize; 4]; 15] = [
            [1, 1, 0, 15],
            [1024, 0, 1, 1],
            [1025, 0, 1, 1],
            [2048, 0, 1, user],
            [2049, 34_737, of_sphere.len(), split],
            [2050, 0, 1, user],
            [2054, 0, 1, 9102],
            [2056, 0, 1, user],
            [2057, 34_736, 1, 0],
            [2058, 34_736, 1, 0],
            [2061, 34_736, 1, 2],
            [3072, 0, 1, user],
            [3073, 34_737, split, 0],
            [3075, 0, 1, kind],
            [3076, 0, 1, 9001],
        ];
        let rest: &[[usize; 4]] = match self.conformal.map(|map| map.projection) {
            // Parallel, false eastings and northings, longitude of the middle.
            None => &[
                [3078, 34_736, 1, 1],
                [3082, 34_736, 1, 2],
                [3083, 34_736, 1, 2],
                [3088, 34_736, 1, 2],
            ],
            // Parallel of true scale, longitude and latitude of the origin, false eastings and northings.
            Some(Projection::Mercator) => &[
                [3078, 34_736, 1, 1],
                [3080, 34_736, 1, 3],
                [3081, 34_736, 1, 2],
                [3082, 34_736, 1, 2],
                [3083, 34_736, 1, 2],
            ],
            // False eastings and northings, longitude and latitude of the centre, scale there.
            Some(Projection::Stereographic) => &[
                [3082, 34_736, 1, 2],
                [3083, 34_736, 1, 2],
                [3088, 34_736, 1, 3],
                [3089, 34_736, 1, 1],
                [3093, 34_736, 1, 4],
            ],
        };
        // A vertical system: its own, with a name and a datum, metres.
        let vertical: [[usize; 4]; 4] = [
            [4096, 0, 1, user],
            [4097, 34_737, of_heights.len(), end],
            [4098, 0, 1, user],
            [4099, 0, 1, 9001],
        ];
        let has_vertical = !self.vertical.is_empty();
        let vertical = vertical.into_iter().filter(|_| has_vertical);
        let keys = first.into_iter().chain(rest.iter().copied());
        let mut keys: Vec<[usize; 4]> = keys.chain(vertical).collect();
        // Vertical systems are part of GeoTIFF 1.1.
        keys[0][2] = usize::from(has_vertical);
        keys[0][3] = keys.len() - 1;
        let parallel_rad = self
            .conformal
            .map_or(self.parallel_rad, |map| map.latitude_rad);
        let mut numbers = vec![radius_m, parallel_rad / RADIANS_PER_DEGREE, 0.0];
        if let Some(map) = self.conformal {
            numbers.extend([map.longitude_rad / RADIANS_PER_DEGREE, 1.0]);
        }
        MapKeys {
            sphere,
            keys,
            numbers,
            names: of_map + &of_sphere + if has_vertical { &of_heights } else { "" },
        }
    }
}

/// A coordinate system as keys of the file, with the numbers and names to which they refer.
struct MapKeys {
    /// The sphere, in words.
    sphere: String,
    keys: Vec<[usize; 4]>,
    numbers: Vec<f64>,
    names: String,
}

/// Writes a file and reads it back; returns the number of its cells with a number.
///
/// # Errors
/// Errors of the disk; a file that reads back differently.
pub fn write_raster<N: Number + Send + Sync>(path: &Path, file: &GeoTiff<'_, N>) -> Result<u64> {
    let bytes = file.encoded();
    write_bytes(path, &bytes)?;
    if read_bytes(path)? != bytes {
        let what = format!("{} bytes of {}", bytes.len(), file.what);
        return Err(ProductError::ReadBack { what }).in_file(path);
    }
    let known = file.numbers.iter().filter(|number| !number.is_none());
    Ok(known.count() as u64)
}

impl<N> GeoTiff<'_, N> {
    /// Name and unit of the band, as GDAL reads them.
    fn metadata(&self) -> String {
        let item = |name: &str, role: &str, text: &str| {
            format!("<Item name=\"{name}\" sample=\"0\" role=\"{role}\">{text}</Item>\n")
        };
        let mut items = item("DESCRIPTION", "description", self.what);
        if !self.unit.is_empty() {
            items += &item("UNITTYPE", "unittype", self.unit);
        }
        format!("<GDALMetadata>\n{items}</GDALMetadata>\n")
    }
}

impl<N: Number + Send + Sync> Size<'_, N> {
    fn across(&self) -> [usize; 2] {
        [self.rows.div_ceil(TILE), self.columns.div_ceil(TILE)]
    }

    /// Layout of the numbers in the file, with offsets and lengths of tiles.
    fn fields(&self, places: &[[usize; 2]], is_reduced: bool) -> Vec<Field> {
        let [bits, format] = N::LAYOUT;
        let [begins, lengths]: [Vec<usize>; 2] =
            [0, 1].map(|of| places.iter().map(|place| place[of]).collect());
        vec![
            Field::longs(254, &[usize::from(is_reduced)]),
            Field::longs(256, &[self.columns]),
            Field::longs(257, &[self.rows]),
            // Deflate, the least black, one of a cell.
            Field::shorts(258, &[bits]),
            Field::shorts(259, &[8]),
            Field::shorts(262, &[1]),
            Field::shorts(277, &[1]),
            Field::shorts(317, &[N::PREDICTOR]),
            Field::shorts(339, &[format]),
            Field::shorts(322, &[TILE]),
            Field::shorts(323, &[TILE]),
            Field::longs(324, &begins),
            Field::longs(325, &lengths),
        ]
    }

    fn number(&self, row: usize, column: usize) -> N {
        if row < self.rows && column < self.columns {
            self.numbers[row * self.columns + column]
        } else {
            N::NONE
        }
    }

    /// The tiles, row by row.
    fn compressed(&self) -> Vec<Vec<u8>> {
        let [down, across] = self.across();
        let tile = |tile: usize| {
            let [top, left] = [tile / across * TILE, tile % across * TILE];
            let mut encoder = ZlibEncoder::new(Vec::new(), Compression::default());
            for row in top..top + TILE {
                let numbers: Vec<N> = (left..left + TILE)
                    .map(|column| self.number(row, column))
                    .collect();
                // Writing to memory cannot fail.
                let _ = encoder.write_all(&N::predicted(&numbers));
            }
            encoder.finish().unwrap_or_default()
        };
        (0..down * across).into_par_iter().map(tile).collect()
    }

    /// Means of two by two cells, of those that have a number.
    fn halved(&self) -> Size<'static, N> {
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
        Size {
            rows,
            columns,
            numbers: numbers.into(),
        }
    }
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
            conformal: None,
            what: "numbers",
            unit: "m",
            vertical: "",
            numbers: &numbers,
        };
        let bytes = tiff.encoded();
        let mut decoder = Decoder::new(Cursor::new(&bytes)).unwrap();
        let sizes = [(300, 600), (150, 300), (75, 150)];
        let (mut begins, mut tables) = (Vec::new(), Vec::new());
        for (number, size) in sizes.into_iter().enumerate() {
            assert_eq!(decoder.dimensions().unwrap(), size);
            tables.push(decoder.ifd_pointer().unwrap().0);
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
        assert!(tables.iter().all(|table| *table < begins[2]));
    }
}
