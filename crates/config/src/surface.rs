//! `[surface]`.

use serde::Deserialize;
use serde_json::json;

use super::{
    declare::{Keys, declare_table, key},
    forms::{Switch, above_to, identifier, several},
};

declare_table! {
    /// A terrain model that areograph computes from all pairs of images with `pixels`, with the adjusted orientation if
    /// there is one: `surface_above_sphere.tif`, its standard deviations, and its comparison with the altimeter. Without `cell_m`,
    /// no terrain model is computed, and orthoimages are on the ground between the altimeter's shots.
    pub struct SurfaceConfig: Deserialize {
        /// Edge of a cell of the terrain model, usually three pixels of the coarser image; each height refers to a
        /// square of 17 by 17 pixels. Cells smaller than a pixel are refused. For cells larger than six pixels, images
        /// are compared at a coarser resolution, which is faster.
        cell_m: Option<f64> = key(above_to(0.0, 1e5)).unused("15.0"),
        /// Edge of a cell of orthoimages, usually the ground size of an image pixel. Orthoimages are computed from every image with
        /// `pixels`, in an adjusted site from those with tie points; without this key, none is computed.
        orthoimage_cell_m: Option<f64> = key(above_to(0.0, 1e5)).unused("5.0"),
        /// Whether orthoimages, and their mosaic, are also computed with the orientation from the kernels, for comparison with
        /// the adjusted ones: `orthoimage_before.tif`. Without an adjustment, this key has no effect.
        orthoimages_before: bool = key(Switch).or(false).unused("true"),
        /// Whether orthoimages are joined in one map, `mosaic.tif`, with seams where overlapping images differ least.
        mosaic: bool = key(Switch).or(false).unused("true"),
        /// Whether a gain and an offset for each orthoimage balance the tones of the mosaic.
        mosaic_balance: bool = key(Switch).or(true).unused("false"),
        /// Identifiers of the two images if a single pair is used although more than two images of the site have `pixels`.
        images: Option<[String; 2]> = key(several(identifier(), "identifiers of two images")).unused(r#"["m0402852", "m0403104"]"#),
        /// Whether to write another terrain model, `surface_filled_*.tif`, with interpolated heights in holes of up to 16
        /// cells, with larger standard deviations.
        filled: bool = key(Switch).or(false),
    }
    check a_cell_is_given
}

/// Keys that need orthoimages.
const OF_ORTHOIMAGES: [&str; 3] = ["orthoimages_before", "mosaic", "mosaic_balance"];

/// A requested terrain model has a cell size, and a mosaic has orthoimages.
fn a_cell_is_given(surface: &SurfaceConfig, keys: &mut Keys<'_, '_>) {
    keys.rule(|| {
        json!({"dependentRequired": {
            "images": ["cell_m"],
            "orthoimages_before": ["orthoimage_cell_m"],
            "mosaic": ["orthoimage_cell_m"],
            "mosaic_balance": ["orthoimage_cell_m"],
        }})
    });
    if surface.images.is_some() && keys.span_of("cell_m").is_none() {
        keys.missing(
            "cell_m",
            "the edge of a cell of the terrain model in metres (or no key images)",
        );
    }
    let needs_orthoimages = OF_ORTHOIMAGES.iter().any(|key| keys.span_of(key).is_some());
    if needs_orthoimages && keys.span_of("orthoimage_cell_m").is_none() {
        keys.missing(
            "orthoimage_cell_m",
            "the edge of a cell of orthoimages in metres",
        );
    }
}
