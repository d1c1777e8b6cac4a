//! Orientation samples of an image.

use std::path::Path;

use arrow_array::Array as _;

use super::{ReadError, columns};
use areograph_base::{
    error::{Locate, Result},
    frames::{BodyFixed, Position},
    time::Et,
};

/// A row of `orientation.parquet`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SampleRow {
    /// Epoch.
    pub et: Et,
    /// Line offset from the middle of the header image, lines.
    pub line_offset: f64,
    /// Perspective centre.
    pub position: Position<BodyFixed>,
    /// Rotation camera → IAU 2000, SPICE quaternion (w, x, y, z).
    pub camera_to_mars: [f64; 4],
    /// Distance of the boresight's ground point, metres, if the boresight meets the ellipsoid.
    pub boresight_range_m: Option<f64>,
}

/// Reads `orientation.parquet`, which has two rows or more.
///
/// # Errors
/// As [`super::read_footprints`].
pub fn read_samples(path: &Path) -> Result<Vec<SampleRow>> {
    const NAMES: [&str; 9] = [
        "et_s",
        "line_offset",
        "x_m",
        "y_m",
        "z_m",
        "quaternion_w",
        "quaternion_x",
        "quaternion_y",
        "quaternion_z",
    ];
    const RANGE: &str = "boresight_range_m";
    let mut rows = Vec::new();
    columns::read(path, &[&NAMES[..], &[RANGE]].concat(), |batch| {
        let mut columns = Vec::with_capacity(NAMES.len());
        for name in NAMES {
            columns.push(batch.numbers(name)?);
        }
        let ranges = batch.optional_numbers(RANGE)?;
        rows.extend((0..batch.rows()).map(|row| {
            let value = |column: usize| columns[column].value(row);
            SampleRow {
                et: Et::from_seconds(value(0)),
                line_offset: value(1),
                position: Position::new([value(2), value(3), value(4)].into()),
                camera_to_mars: [value(5), value(6), value(7), value(8)],
                boresight_range_m: ranges.is_valid(row).then(|| ranges.value(row)),
            }
        }));
        Ok(())
    })?;
    if rows.len() < 2 {
        return Err(ReadError::TooFew { found: rows.len() }).in_file(path);
    }
    Ok(rows)
}
