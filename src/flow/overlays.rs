//! The part of the flow that reads pixels.

use super::{
    driver::{Driver, Flow},
    outputs::Site,
};
use crate::stages::site_image::{SiteImage, SiteImages};
use crate::{
    config::{ImageConfig, SiteConfig},
    files::HashedFile,
    stage::{Round, Stage as _},
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

/// Overlays of footprints and tie points on images with pixels; not for a site without pixels.
pub(super) fn overlays<D: Driver>(flow: &mut D, config: &SiteConfig, site: &mut Site) -> Flow<()> {
    if config.images.iter().all(|image| image.pixels.is_none()) {
        return Ok(());
    }
    let pixels = pixel_files(flow, LayOverlays::NAME, config)?;
    let book = &site.book;
    let measured = book.output(Round::Initial)?;
    let measured = measured.zip(book.output(Round::Initial)?);
    let adjusted = book.output(Round::Initial)?;
    let adjusted = adjusted.zip(book.output(Round::Adjusted)?);
    let (converted, profiles) = site.shots()?;
    let overlays = flow.stage(&LayOverlays {
        images: SiteImages(&site.images()?),
        adjusted_images: SiteImages(&SiteImage::all(book, Round::Adjusted)?),
        pixels: PixelFiles(&pixels),
        converted,
        profiles,
        ties: measured.map(|(ties, intersected)| MeasuredTies {
            ties,
            intersected,
            adjusted,
        }),
    })?;
    let shown = Overlays::without_views;
    Ok(site.book.enter_heavy(Round::Initial, overlays, shown)?)
}
