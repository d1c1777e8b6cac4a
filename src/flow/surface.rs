//! The part of the flow that makes a terrain model, and orthoimages on it.

use super::{
    driver::{Driver, Flow},
    outputs::Site,
    overlays::pixel_files,
};
use crate::stages::site_image::SiteImages;
use crate::{
    config::SiteConfig,
    stage::{InOrder, Round, Stage as _},
    stages::{
        adjust::Adjusted,
        image_pixels::PixelFiles,
        join_surfaces::JoinSurfaces,
        map_surface::{AdjustmentOfImages, MapSurface, Surface},
        rectify_images::{Orthoimage, RectifyImages},
    },
};

/// The terrain model of all pairs of images with their best orientation, and orthoimages; not for a site that requests none, or whose
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
    let pairs = pairs(config);
    let is_of_all = &(pairs.len() > 1);
    let surface_of = |pair: &Option<[String; 2]>| {
        flow.stage(&MapSurface {
            images,
            pixels: PixelFiles(&pixels),
            converted,
            profiles,
            cell_m,
            pair,
            is_of_all,
            laser_surface: &config.laser_surface,
            adjusted: AdjustmentOfImages(adjusted),
            off_m: adjusted.map_or(&limits.height_before_max_m, |_| &limits.height_after_max_m),
        })
    };
    let mut surfaces = pairs.iter().map(surface_of).collect::<Flow<Vec<_>>>()?;
    let surface = match surfaces.pop() {
        Some(surface) if surfaces.is_empty() => surface,
        last => {
            surfaces.extend(last);
            flow.stage(&JoinSurfaces {
                surfaces: InOrder(&surfaces),
                converted,
                profiles,
                laser_surface: &config.laser_surface,
            })?
        }
    };
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

/// The named pair, or all pairs of more than two images with pixels; of fewer images, the stage finds the pair.
fn pairs(config: &SiteConfig) -> Vec<Option<[String; 2]>> {
    let with_pixels = config.images.iter().filter(|image| image.pixels.is_some());
    let ids: Vec<&String> = with_pixels.map(|image| &image.id).collect();
    if config.surface.images.is_some() || ids.len() <= 2 {
        return vec![config.surface.images.clone()];
    }
    let of_first = |(index, first): (usize, &&String)| {
        let first = (*first).clone();
        let others = ids[index + 1..].iter();
        others
            .map(move |second| Some([first.clone(), (*second).clone()]))
            .collect::<Vec<_>>()
    };
    ids.iter().enumerate().flat_map(of_first).collect()
}
