//! Ground control points in a TIFF, by `GeoTIFF` 1.0: tie points without a scale, in geographic coordinates on the sphere of the body's maps.

use std::io::{Seek, Write};

use tiff::{
    TiffResult,
    encoder::{DirectoryEncoder, TiffKindStandard},
    tags::Tag,
};

use areograph_pds::control_table::ImageControl;

/// Numbers of a point: sample, line, 0, longitude, latitude, height.
const NUMBERS: usize = 6;

/// Bytes of the points in a file.
pub(super) fn bytes_of(control: &ImageControl) -> u64 {
    (control.points.len() * NUMBERS * size_of::<f64>()) as u64
}

/// Adds the points and their coordinate system to a picture.
pub(super) fn write<W: Write + Seek>(
    directory: &mut DirectoryEncoder<'_, W, TiffKindStandard>,
    control: &ImageControl,
) -> TiffResult<()> {
    let points = control.points.iter().flat_map(|point| {
        [
            point.sample,
            point.line,
            0.0,
            point.longitude_deg,
            point.latitude_deg,
            point.height_m,
        ]
    });
    let points: Vec<f64> = points.collect();
    let map = control.body.map();
    let name = format!("{}|", map.crs);
    let length = u16::try_from(name.len()).unwrap_or(u16::MAX);
    let user = 32_767;
    // Version and number of keys; geographic coordinates, areas; a sphere of its own, its name, degrees, both half-axes.
    let keys: [[u16; 4]; 10] = [
        [1, 1, 0, 9],
        [1024, 0, 1, 2],
        [1025, 0, 1, 1],
        [2048, 0, 1, user],
        [2049, 34_737, length, 0],
        [2050, 0, 1, user],
        [2054, 0, 1, 9102],
        [2056, 0, 1, user],
        [2057, 34_736, 1, 0],
        [2058, 34_736, 1, 0],
    ];
    directory.write_tag(Tag::ModelTiepointTag, points.as_slice())?;
    directory.write_tag(Tag::GeoKeyDirectoryTag, keys.concat().as_slice())?;
    directory.write_tag(Tag::GeoDoubleParamsTag, [map.radius_m].as_slice())?;
    directory.write_tag(Tag::GeoAsciiParamsTag, name.as_str())
}
