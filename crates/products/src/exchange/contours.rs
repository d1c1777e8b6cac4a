//! Contours of a terrain model as lines in a GeoPackage.

use std::path::Path;

use super::geopackage::{Geometries, Layer, write_layer};
use crate::{
    coordinates::frame,
    product::Context,
    table::{Table, Unit, column},
};
use areograph_base::{error::Result, units::RADIANS_PER_DEGREE};
use areograph_geom::{contours::Contour, height_grid::HeightGrid};

/// Table of the GeoPackage.
pub(super) const LAYER: &str = "contours";
/// Every so manyth contour is an index contour.
const INDEX: i64 = 5;

/// Contours of a grid.
pub struct ContourLayer<'a> {
    /// The grid, to whose rows and columns they refer.
    pub grid: &'a HeightGrid,
    /// The contours.
    pub contours: &'a [Contour],
    /// Difference between their heights, metres.
    pub interval_m: f64,
    /// Surface above which they are.
    pub surface: &'a str,
}

/// Writes contours and reads them back; returns their number.
///
/// # Errors
/// Errors of the disk or SQLite; rows that are read back differently.
#[allow(
    clippy::cast_possible_truncation,
    reason = "a small number of intervals"
)]
pub fn write_contours(path: &Path, of: &Context, layer: &ContourLayer) -> Result<u64> {
    let site = of.site;
    let place_deg = |cell: &[f64; 2]| {
        let place_rad = layer.grid.place_rad(*cell);
        place_rad.map(|of| of / RADIANS_PER_DEGREE)
    };
    let lines = layer.contours.iter();
    let lines = lines.map(|contour| contour.cells.iter().map(place_deg).collect());
    let interval_m = layer.interval_m;
    let columns = vec![
        column(
            "height_m",
            Unit::Metre,
            "height of the contour, metres",
            |contour: &&Contour| contour.height_m,
        )
        .in_gis(),
        column(
            "is_index",
            Unit::None,
            "whether it is an index contour, one of five",
            move |contour: &&Contour| (contour.height_m / interval_m).round() as i64 % INDEX == 0,
        )
        .in_gis(),
    ];
    let rows: Vec<&Contour> = layer.contours.iter().collect();
    let description = format!(
        "contours of the terrain model every {interval_m} m, heights in metres above the {}",
        layer.surface
    );
    let layer = Layer {
        name: &site.config.site,
        table: LAYER,
        description,
        newest_utc: site.newest_utc(),
        body: site.config.body,
        frame: frame(site.config.body),
        geometries: Geometries::Lines(lines.collect()),
        attributes: Table::new(columns, rows).for_gis(),
    };
    write_layer(path, &layer)
}
