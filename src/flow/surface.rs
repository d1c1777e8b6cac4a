//! The part of the flow that makes a terrain model, orthoimages on it, and their mosaic.

use super::{
    driver::{Driver, Flow},
    outputs::Site,
    overlays::pixel_files,
};
use crate::stages::site_image::SiteImages;
use crate::{
    config::SiteConfig,
    error::Result,
    files::HashedFile,
    stage::{InOrder, Output, Round, Stage as _},
    stages::{
        adjust::Adjusted,
        compare_orthoimages::{CompareOrthoimages, OrthoimageOffsets},
        image_pixels::PixelFiles,
        interpolate_shots::{InterpolateShots, ShotModel},
        join_surfaces::JoinSurfaces,
        map_surface::{AdjustmentOfImages, MapSurface, Surface},
        mosaic_images::{Mosaic, MosaicImages},
        rectify_images::{GroundModel, Orthoimage, RectifyImages},
    },
    store::book::Book,
};

/// The terrain model of all pairs of images with their best orientation, and orthoimages on it, or on the ground between shots if the
/// site requests no terrain model; not for a site that requests none of them, or whose adjustment failed.
pub(super) fn surface<D: Driver>(flow: &mut D, config: &SiteConfig, site: &mut Site) -> Flow<()> {
    let wish = &config.surface;
    if wish.cell_m.is_none() && wish.orthoimage_cell_m.is_none()
        || site.adjustment_failure.is_some()
    {
        return Ok(());
    }
    if let Some(cell_m) = &wish.cell_m {
        let pixels = pixel_files(flow, MapSurface::NAME, config)?;
        let surface = terrain(flow, config, site, (&pixels, cell_m))?;
        orthoimages(
            flow,
            config,
            site,
            (&pixels, GroundModel::Terrain(&surface)),
        )?;
        let shown = Surface::without_model;
        return Ok(site.book.enter_heavy(Round::Initial, surface, shown)?);
    }
    let pixels = pixel_files(flow, RectifyImages::NAME, config)?;
    let (converted, profiles) = site.shots()?;
    let model = flow.stage(&InterpolateShots {
        images: SiteImages(&site.best_images()?),
        pixels: PixelFiles(&pixels),
        converted,
        profiles,
        laser_surface: &config.laser_surface,
    })?;
    orthoimages(flow, config, site, (&pixels, GroundModel::Shots(&model)))?;
    let shown = ShotModel::without_cells;
    Ok(site.book.enter_heavy(Round::Initial, model, shown)?)
}

/// The terrain model with cells of this edge.
fn terrain<D: Driver>(
    flow: &mut D,
    config: &SiteConfig,
    site: &Site,
    (pixels, cell_m): (&[Option<HashedFile>], &f64),
) -> Flow<Output<Surface>> {
    let adjusted = site.book.output::<Adjusted>(Round::Initial)?;
    let limits = &config.limits;
    let images = site.best_images()?;
    let images = SiteImages(&images);
    let (converted, profiles) = site.shots()?;
    let pairs = pairs(config);
    let is_of_all = &(pairs.len() > 1);
    let surface_of = |pair: &Option<[String; 2]>| {
        flow.stage(&MapSurface {
            images,
            pixels: PixelFiles(pixels),
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
    match surfaces.pop() {
        Some(surface) if surfaces.is_empty() => Ok(surface),
        last => {
            surfaces.extend(last);
            flow.stage(&JoinSurfaces {
                surfaces: InOrder(&surfaces),
                converted,
                profiles,
                laser_surface: &config.laser_surface,
            })
        }
    }
}

/// Orthoimages on these heights, where the site requests them, and their mosaic.
fn orthoimages<D: Driver>(
    flow: &mut D,
    config: &SiteConfig,
    site: &mut Site,
    (pixels, surface): (&[Option<HashedFile>], GroundModel<'_>),
) -> Flow<()> {
    let Some(cell_m) = &config.surface.orthoimage_cell_m else {
        return Ok(());
    };
    let adjusted = site.book.output::<Adjusted>(Round::Initial)?;
    let before = adjusted.is_some() && config.surface.orthoimages_before;
    let before = before.then(|| site.images()).transpose()?;
    let before = before.as_ref().map(|of| (Round::Initial, SiteImages(of)));
    let images = site.best_images()?;
    let best = adjusted.map_or(Round::Initial, |_| Round::Adjusted);
    let rounds = before.into_iter().chain([(best, SiteImages(&images))]);
    let mut made = Vec::new();
    for (round, images) in rounds {
        let orthoimages = flow.stage(&RectifyImages {
            images,
            pixels: PixelFiles(pixels),
            surface,
            adjusted: AdjustmentOfImages(adjusted),
            priors: &config.adjustment,
            round,
            cell_m,
        })?;
        made.push(of_orthoimages(
            flow,
            config,
            (round, images),
            surface,
            orthoimages,
        )?);
    }
    for of in made {
        of.enter(&mut site.book)?;
    }
    Ok(())
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

/// Orthoimages of one orientation, and what is made of them.
struct Made {
    round: Round,
    orthoimages: Output<Vec<Orthoimage>>,
    offsets: Output<Vec<OrthoimageOffsets>>,
    mosaic: Option<Output<Option<Mosaic>>>,
}

/// The offsets of orthoimages, and their mosaic if it is requested.
fn of_orthoimages<D: Driver>(
    flow: &mut D,
    config: &SiteConfig,
    (round, images): (Round, SiteImages<'_>),
    surface: GroundModel<'_>,
    orthoimages: Output<Vec<Orthoimage>>,
) -> Flow<Made> {
    let offsets = flow.stage(&CompareOrthoimages {
        round,
        orthoimages: &orthoimages,
    })?;
    let mosaic = if config.surface.mosaic {
        Some(flow.stage(&MosaicImages {
            round,
            images,
            surface,
            orthoimages: &orthoimages,
            offsets: &offsets,
            balance: &config.surface.mosaic_balance,
        })?)
    } else {
        None
    };
    Ok(Made {
        round,
        orthoimages,
        offsets,
        mosaic,
    })
}

impl Made {
    fn enter(self, book: &mut Book) -> Result<()> {
        let shown = |of: &Vec<Orthoimage>| of.iter().map(Orthoimage::without_cells).collect();
        book.enter_heavy(self.round, self.orthoimages, shown)?;
        book.enter(self.round, self.offsets)?;
        if let Some(mosaic) = self.mosaic {
            let shown = |of: &Option<Mosaic>| of.as_ref().map(Mosaic::without_cells);
            book.enter_heavy(self.round, mosaic, shown)?;
        }
        Ok(())
    }
}
