//! The part of the flow that makes a terrain model.

use super::{
    driver::{Driver, Flow},
    outputs::Site,
    overlays::pixel_files,
};
use crate::stages::site_image::SiteImages;
use crate::{
    config::SiteConfig,
    stage::{Output, Stage as _},
    stages::{
        image_pixels::PixelFiles,
        map_surface::{AdjustmentOfImages, MapSurface, Surface},
    },
};

/// The terrain model of a pair of images with their best orientation; `None` for a site that requests none, or whose
/// adjustment failed.
pub(super) fn surface<D: Driver>(
    flow: &mut D,
    config: &SiteConfig,
    site: &Site,
) -> Flow<Option<Output<Surface>>> {
    if !config.surface.is_asked_for() || site.adjustment_failure.is_some() {
        return Ok(None);
    }
    let adjustment = site.adjustment.as_ref();
    let limits = &config.limits;
    let pixels = pixel_files(flow, MapSurface::NAME, config)?;
    let surface = flow.stage(&MapSurface {
        images: SiteImages(adjustment.map_or(&site.images, |of| &of.images)),
        model: &config.registration.model,
        pixels: PixelFiles(&pixels),
        converted: &site.converted,
        profiles: &site.profiles,
        surface: &config.surface,
        mola_surface: &config.mola_surface,
        adjusted: AdjustmentOfImages(adjustment.map(|of| &of.adjusted)),
        off_m: adjustment.map_or(&limits.height_before_max_m, |_| &limits.height_after_max_m),
    })?;
    Ok(Some(surface))
}
