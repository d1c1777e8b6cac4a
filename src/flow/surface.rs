//! The part of the flow that makes a terrain model, and orthoimages on it.

use super::{
    driver::{Driver, Flow},
    outputs::Site,
    overlays::pixel_files,
};
use crate::stages::site_image::SiteImages;
use crate::{
    config::SiteConfig,
    stage::{Round, Stage as _},
    stages::{
        adjust::Adjusted,
        image_pixels::PixelFiles,
        map_surface::{AdjustmentOfImages, MapSurface, Surface},
        rectify_images::{Orthoimage, RectifyImages},
    },
};

/// The terrain model of a pair of images with their best orientation, and orthoimages; not for a site that requests none, or whose
/// adjustment failed.
pub(super) fn surface<D: Driver>(flow: &mut D, config: &SiteConfig, site: &mut Site) -> Flow<()> {
    let Some(cell_m) = &config.surface.cell_m else {
        return Ok(());
    };
    if site.adjustment_failure.is_some() {
        return Ok(());
    }
    let adjusted = site.book.output::<Adjusted>(Round::Initial)?;
    let limits = &config.limits;
    let pixels = pixel_files(flow, MapSurface::NAME, config)?;
    let images = site.best_images()?;
    let images = SiteImages(&images);
    let (converted, profiles) = site.shots()?;
    let surface = flow.stage(&MapSurface {
        images,
        pixels: PixelFiles(&pixels),
        converted,
        profiles,
        cell_m,
        pair: &config.surface.images,
        laser_surface: &config.laser_surface,
        adjusted: AdjustmentOfImages(adjusted),
        off_m: adjusted.map_or(&limits.height_before_max_m, |_| &limits.height_after_max_m),
    })?;
    if let Some(cell_m) = &config.surface.orthoimage_cell_m {
        let orthoimages = flow.stage(&RectifyImages {
            images,
            pixels: PixelFiles(&pixels),
            surface: &surface,
            adjusted: AdjustmentOfImages(adjusted),
            cell_m,
        })?;
        let shown = |of: &Vec<Orthoimage>| of.iter().map(Orthoimage::without_cells).collect();
        site.book.enter_heavy(Round::Initial, orthoimages, shown)?;
    }
    let shown = Surface::without_model;
    Ok(site.book.enter_heavy(Round::Initial, surface, shown)?)
}
