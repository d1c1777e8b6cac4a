//! The terrain model of a site (`stages/map_surface`, `stages/join_surfaces`): files, section of the page, findings, counts.

mod contour_interval;
mod document;
mod findings;
mod joint;
mod joint_document;
mod products;
mod relief;
mod section;

use super::Capability;
use crate::{error::Result, stage::Round, stages::map_surface::Surface, store::book::Book};

pub(super) use products::{Band, significant_surface, write_map};

pub(super) static CAPABILITY: Capability = Capability {
    products: &[
        &products::ABOVE_SPHERE,
        &products::ABOVE_AREOID,
        &products::ABOVE_ELLIPSOID,
        &products::SIGMAS,
        &joint::PAIRS,
        &joint::FILLED_ABOVE_SPHERE,
        &joint::FILLED_ABOVE_AREOID,
        &joint::FILLED_SIGMAS,
        &relief::HILLSHADE,
        &relief::SLOPES,
        &relief::CONTOURS,
        &products::DOCUMENT,
    ],
    section: section::SECTION,
    judge: Some(findings::findings),
    count: Some(counts),
};

fn counts(book: &Book) -> Result<Vec<(&'static str, u64)>> {
    let surface = book.find::<Surface>(Round::Initial)?;
    Ok(surface.map_or_else(Vec::new, |surface| {
        let account = &surface.account;
        vec![
            ("surface_cells", u64::from(account.cells)),
            ("surface_filled", u64::from(account.filled)),
        ]
    }))
}
