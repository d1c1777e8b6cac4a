//! Orthoimages (`stages/rectify_images`): files, section of the page.

mod products;
mod section;

use super::Capability;

pub(super) static CAPABILITY: Capability = Capability {
    products: &[
        &products::ORTHOIMAGE,
        &products::SIGMAS,
        &products::DOCUMENT,
    ],
    section: section::SECTION,
    judge: None,
    count: None,
};
