//! The part of the flow that reads pixels.

use super::{
    driver::{Driver, Flow},
    outputs::Site,
};
use crate::stages::site_image::SiteImages;
use crate::{
    config::{ImageConfig, SiteConfig},
    files::HashedFile,
    stage::{Output, Stage as _},
    stages::{
        image_pixels::PixelFiles,
        lay_overlays::{LayOverlays, MeasuredTies, Overlays},
    },
};

/// The pixel file of every image, which a stage is about to read.
pub(super) fn pixel_files<D: Driver>(
    flow: &mut D,
    stage: &'static str,
    config: &SiteConfig,
) -> Flow<Vec<Option<HashedFile>>> {
    let hash = |image: &ImageConfig| Ok(flow.hash(stage, image.pixels.as_slice())?.pop());
    config.images.iter().map(hash).collect()
}

/// Overlays of footprints and tie points on images with pixels; `None` for a site without pixels.
pub(super) fn overlays<D: Driver>(
    flow: &mut D,
    config: &SiteConfig,
    site: &Site,
) -> Flow<Option<Output<Overlays>>> {
    if config.images.iter().all(|image| image.pixels.is_none()) {
        return Ok(None);
    }
    let pixels = pixel_files(flow, LayOverlays::NAME, config)?;
    let adjustment = site.adjustment.as_ref();
    let measured = site.ties.as_ref().zip(site.intersection.as_ref());
    let overlays = flow.stage(&LayOverlays {
        images: SiteImages(&site.images),
        adjusted_images: SiteImages(adjustment.map_or(&[], |of| &of.images)),
        model: &config.registration.model,
        pixels: PixelFiles(&pixels),
        converted: &site.converted,
        profiles: &site.profiles,
        ties: measured.map(|(ties, initial)| MeasuredTies {
            ties,
            intersected: &initial.intersected,
            adjusted: adjustment.map(|of| (&of.adjusted, &of.intersection.intersected)),
        }),
    })?;
    Ok(Some(overlays))
}
