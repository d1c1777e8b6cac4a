//! Orthoimages (`stages/rectify_images`), offsets between them (`stages/compare_orthoimages`) and their mosaic
//! (`stages/mosaic_images`): files, section of the page.

mod comparison;
mod mosaic;
mod products;
mod section;

pub(super) use self::mosaic::{before as mosaic_before, best as best_mosaic};
use super::Capability;
use crate::{
    config::SiteConfig,
    error::Result,
    products::ORTHOIMAGE_OFFSETS,
    stage::Round,
    stages::{interpolate_shots::ShotModel, judge::Findings, map_surface::Surface},
    store::book::Book,
};

pub(super) static CAPABILITY: Capability = Capability {
    products: &[
        &products::ORTHOIMAGE,
        &products::BEFORE,
        &products::SIGMAS,
        &products::DOCUMENT,
        &ORTHOIMAGE_OFFSETS,
        &mosaic::MOSAIC,
        &mosaic::SOURCES,
        &mosaic::BEFORE,
        &mosaic::SOURCES_BEFORE,
        &mosaic::DOCUMENT,
    ],
    section: section::SECTION,
    judge: Some(withheld),
    count: None,
};

/// The reason why a site has no orthoimages although it requests some.
fn withheld(config: &SiteConfig, book: &Book) -> Result<Findings> {
    let shots = book.find::<ShotModel>(Round::Initial)?;
    let no_shots = shots.and_then(|shots| shots.model.as_ref().err());
    let terrain = book.find::<Surface>(Round::Initial)?;
    let is_refused = terrain.is_some_and(|terrain| terrain.model().is_none());
    let remark = if let Some(reason) = no_shots {
        Some(format!(
            "orthoimages are withheld, because the ground between shots is not known: {reason}"
        ))
    } else if is_refused && config.surface.orthoimage_cell_m.is_some() {
        Some(
            "orthoimages are withheld with the terrain model; without surface.cell_m, they lie on the ground between shots"
                .to_owned(),
        )
    } else {
        None
    };
    Ok(Findings {
        remarks: remark.into_iter().collect(),
        ..Findings::default()
    })
}
