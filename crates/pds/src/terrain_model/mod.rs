//! Terrain models: `GeoTIFF` of one band, heights above a sphere in metres, evenly spaced in longitude and latitude.

mod keys;

use std::{fs::File, io::BufReader, path::Path};

use tiff::{decoder::Decoder, tags::Tag};

use self::keys::{GeoKeys, Map};
use super::pixel_file::tiff_rows;
use areograph_base::{
    body::Body,
    error::{Cause, IoError, Locate as _, Result},
};
use areograph_geom::height_grid::HeightGrid;

/// Largest model that is read, cells: half a gigabyte in memory.
const CELLS_MAX: u64 = 1 << 27;
/// Largest distance of heights from the sphere, metres: Olympus Mons is 21 km high, and −32768 stands for no height.
const HEIGHT_MAX_M: f64 = 30_000.0;
/// Tolerance of a radius against the body's radius, as a share.
const RADIUS_SHARE: f64 = 0.02;
/// Tolerance of equal radii, metres: files round them.
const SAME_RADIUS_M: f64 = 0.5;

/// Stated reference sphere of heights.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct HeightsAbove {
    /// Its radius, metres; without one, the sphere of the file applies.
    pub radius_m: Option<f64>,
    /// Whether it intentionally differs from the sphere of the file's map.
    pub apart: bool,
}

/// Reason for the rejection of a terrain model.
#[derive(Debug, Clone, PartialEq, thiserror::Error, Cause)]
#[cause(Input)]
pub enum TerrainModelError {
    /// Its library rejects it, or a tag.
    #[error("{0}")]
    #[cause(
        "give a complete GeoTIFF of one band, uncompressed or with LZW or deflate compression (gdal_translate -co \
         COMPRESS=DEFLATE), cut to the required area (-projwin)"
    )]
    Tiff(String),
    /// An error in its georeference.
    #[error("{what}: {found}; expected {expected}")]
    #[cause(
        "give heights on a grid of longitude and latitude, or in an equirectangular map of a sphere, in degrees or metres: \
         gdalwarp -t_srs '+proj=eqc +R=3396190 +units=m'"
    )]
    Georeference {
        /// The tag or key.
        what: &'static str,
        /// Value found.
        found: String,
        /// Value expected.
        expected: &'static str,
    },
    /// Too many cells.
    #[error("{rows} rows of {columns} cells; expected at most {CELLS_MAX} cells")]
    #[cause(like = Tiff)]
    TooLarge {
        /// Rows.
        rows: u32,
        /// Columns.
        columns: u32,
    },
    /// The radius is unknown.
    #[error("no key defines the reference sphere of the heights")]
    #[cause("state the radius with --radius-m; models of Mars refer to 3396000 m or 3396190 m")]
    NoRadius,
    /// Two different radii.
    #[error(
        "the map sphere has a radius of {of_file} m; the stated radius of the heights is {given} m"
    )]
    #[cause(
        "omit --radius-m, or add --heights-apart if the heights refer to a sphere other than the map sphere"
    )]
    TwoRadii {
        /// By the file.
        of_file: f64,
        /// As stated.
        given: f64,
    },
    /// The sphere of a different body.
    #[error(
        "the sphere has a radius of {found} m; expected the radius of {body}, {expected} m, within 2 %"
    )]
    #[cause("give a terrain model of this body, with the radius in metres")]
    OtherBody {
        /// Its radius.
        found: f64,
        /// The body.
        body: &'static str,
        /// Its expected radius.
        expected: f64,
    },
    /// Heights above a surface other than a sphere.
    #[error(
        "the file states a vertical system, from which its heights are counted; expected heights above the sphere of the map"
    )]
    #[cause(
        "give heights above the sphere (areograph writes surface_above_sphere.tif), or state the radius of their sphere \
         with --radius-m"
    )]
    Vertical,
    /// A value that cannot be a height.
    #[error(
        "row {row}, column {column} (from 0) has the height {value}; expected a height within {HEIGHT_MAX_M} m of the sphere"
    )]
    #[cause(
        "set the no-data value of the file (gdal_edit.py -a_nodata), and give heights in metres"
    )]
    NoHeight {
        /// Row.
        row: usize,
        /// Column.
        column: usize,
        /// The number.
        value: f64,
    },
    /// No cell has a height.
    #[error("no cell has a height")]
    #[cause("check the file and its no-data value")]
    Empty,
}

/// Reads a terrain model of `body` into memory.
///
/// # Errors
/// The file cannot be read; not such a `GeoTIFF`; no radius of the sphere, or two; no height.
pub fn read_terrain_model(path: &Path, body: Body, above: HeightsAbove) -> Result<HeightGrid> {
    let tags = Tags::read(path)?;
    tags.grid(path, body, above).in_file(path)
}

/// Tags of a file beside its numbers.
struct Tags {
    /// Rows and columns.
    size: [u32; 2],
    keys: GeoKeys,
    /// Width and height of a cell in units of the map.
    scale: Vec<f64>,
    /// Column, row, unused, x, y, unused.
    tie: Vec<f64>,
    no_data: Option<f64>,
}

impl Tags {
    fn read(path: &Path) -> Result<Self> {
        let file = File::open(path)
            .map_err(IoError::on("open"))
            .in_file(path)?;
        let read = || -> std::result::Result<Self, TerrainModelError> {
            let refused = |error: tiff::TiffError| TerrainModelError::Tiff(error.to_string());
            let mut decoder = Decoder::new(BufReader::new(file)).map_err(refused)?;
            let (columns, rows) = decoder.dimensions().map_err(refused)?;
            let mut numbers = |tag: Tag| -> std::result::Result<Vec<f64>, TerrainModelError> {
                let value = decoder.find_tag(tag).map_err(refused)?;
                let numbers = value
                    .map(tiff::decoder::ifd::Value::into_f64_vec)
                    .transpose();
                Ok(numbers.map_err(refused)?.unwrap_or_default())
            };
            let (scale, tie) = (
                numbers(Tag::ModelPixelScaleTag)?,
                numbers(Tag::ModelTiepointTag)?,
            );
            let doubles = numbers(Tag::GeoDoubleParamsTag)?;
            let directory = decoder.find_tag(Tag::GeoKeyDirectoryTag).map_err(refused)?;
            let directory = directory.map(tiff::decoder::ifd::Value::into_u16_vec);
            let directory = directory.transpose().map_err(refused)?.unwrap_or_default();
            let no_data = decoder.find_tag(Tag::GdalNodata).map_err(refused)?;
            let no_data = no_data.map(tiff::decoder::ifd::Value::into_string);
            let no_data = no_data.transpose().map_err(refused)?;
            let no_data = no_data.map(|text| no_data_of(&text)).transpose()?;
            Ok(Self {
                size: [rows, columns],
                keys: GeoKeys::of(&directory, &doubles)?,
                scale,
                tie,
                no_data,
            })
        };
        read().in_file(path)
    }

    fn grid(&self, path: &Path, body: Body, above: HeightsAbove) -> Result<HeightGrid> {
        let [rows, columns] = self.size;
        if u64::from(rows) * u64::from(columns) > CELLS_MAX {
            return Err(TerrainModelError::TooLarge { rows, columns }.into());
        }
        if self.keys.is_vertical() && above.radius_m.is_none() {
            return Err(TerrainModelError::Vertical.into());
        }
        let of_file = self.keys.radius_m()?;
        let radius_m = radius_m(of_file, above)?;
        let names = body.names();
        for found in [Some(radius_m), of_file].into_iter().flatten() {
            let expected = body.model().equatorial_radius_m;
            if !((found / expected - 1.0).abs() <= RADIUS_SHARE) {
                let body = &names.in_text;
                return Err(TerrainModelError::OtherBody {
                    found,
                    body,
                    expected,
                }
                .into());
            }
        }
        let (first_rad, cell_rad) = self.placed(&self.keys.map(of_file.unwrap_or(radius_m))?)?;
        Ok(HeightGrid {
            size: [rows as usize, columns as usize],
            first_rad,
            cell_rad,
            radius_m,
            heights_m: self.heights(path)?,
        })
    }

    /// Middle of the first cell, and size of the cells, radians.
    fn placed(&self, map: &Map) -> std::result::Result<([f64; 2], [f64; 2]), TerrainModelError> {
        let of_scale = |found: &[f64]| TerrainModelError::Georeference {
            what: "ModelPixelScale and ModelTiepoint",
            found: format!("{found:?}"),
            expected: "a positive cell size and one tie point: a map that is neither rotated nor mirrored",
        };
        let (Some([width, height]), Some([column, row, _, x, y, _])) =
            (self.scale.first_chunk::<2>(), self.tie.first_chunk::<6>())
        else {
            return Err(of_scale(&[]));
        };
        // Written so that NaN is rejected too.
        let are_sizes = [width, height]
            .iter()
            .all(|size| **size > 0.0 && size.is_finite());
        if !are_sizes || self.tie.len() != 6 || !self.tie.iter().all(|value| value.is_finite()) {
            return Err(of_scale(&self.scale));
        }
        let half = if self.keys.is_point() { 0.0 } else { 0.5 };
        let first = map.place_rad([x + (half - column) * width, y - (half - row) * height]);
        let cell_rad = [width * map.rad_per_unit[0], height * map.rad_per_unit[1]];
        let [rows, columns] = self.size.map(f64::from);
        let south_rad = first[1] - rows * cell_rad[1];
        let quarter = std::f64::consts::FRAC_PI_2 + cell_rad[1];
        let is_on_globe = columns * cell_rad[0] <= std::f64::consts::TAU * 1.000_001
            && first[1] <= quarter
            && south_rad >= -quarter;
        if !is_on_globe {
            return Err(TerrainModelError::Georeference {
                what: "extent",
                found: format!(
                    "latitudes {:.3} to {:.3} degrees, {:.3} degrees of longitude",
                    south_rad.to_degrees(),
                    first[1].to_degrees(),
                    (columns * cell_rad[0]).to_degrees()
                ),
                expected: "a part of the globe",
            });
        }
        Ok((first, cell_rad))
    }

    #[allow(
        clippy::cast_possible_truncation,
        reason = "heights within 30 km of the sphere are rounded to 2 mm"
    )]
    fn heights(&self, path: &Path) -> Result<Vec<f32>> {
        let columns = self.size[1] as usize;
        let mut rows = tiff_rows(path)?;
        let mut heights_m: Vec<f32> = Vec::new();
        while let Some(numbers) = rows.next_rows()? {
            for value in numbers {
                let is_none =
                    value.is_nan() || self.no_data.is_some_and(|none| is_same(value, none));
                if !is_none && !(value.abs() <= HEIGHT_MAX_M) {
                    let (row, column) = (heights_m.len() / columns, heights_m.len() % columns);
                    return Err(TerrainModelError::NoHeight { row, column, value }.into());
                }
                heights_m.push(if is_none { f32::NAN } else { value as f32 });
            }
        }
        if heights_m.iter().all(|height_m| height_m.is_nan()) {
            return Err(TerrainModelError::Empty.into());
        }
        Ok(heights_m)
    }
}

/// Whether two numbers are equal in 32-bit precision.
fn is_same(value: f64, other: f64) -> bool {
    (value - other).abs() <= 1e-6 * other.abs()
}

fn no_data_of(text: &str) -> std::result::Result<f64, TerrainModelError> {
    let text = text.trim_matches(['\0', ' ']);
    text.parse().map_err(|_| TerrainModelError::Georeference {
        what: "GDAL_NODATA",
        found: format!("{text:?}"),
        expected: "a number",
    })
}

/// The radius, which must be unambiguous.
fn radius_m(
    of_file: Option<f64>,
    above: HeightsAbove,
) -> std::result::Result<f64, TerrainModelError> {
    match (of_file, above.radius_m) {
        (None, None) => Err(TerrainModelError::NoRadius),
        (Some(of_file), Some(given)) if !above.apart && (of_file - given).abs() > SAME_RADIUS_M => {
            Err(TerrainModelError::TwoRadii { of_file, given })
        }
        (of_file, given) => given.or(of_file).ok_or(TerrainModelError::NoRadius),
    }
}
