//! Orthoimages (`stages/rectify_images`), offsets between them (`stages/compare_orthoimages`) and their mosaic
//! (`stages/mosaic_images`): files, section of the page.

mod comparison;
mod mosaic;
mod products;
mod section;

pub(super) use self::mosaic::{before as mosaic_before, best as best_mosaic};
use super::Capability;
use crate::products::ORTHOIMAGE_OFFSETS;

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
    judge: None,
    count: None,
};
