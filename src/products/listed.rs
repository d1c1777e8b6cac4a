//! What a site's products will be, before they are written: for the report, which links to them.

use super::{
    exchange::{adjusted::LIDAR, stac::ITEM},
    figures::FIGURE,
    product::{Declaration, Write},
    registry::PRODUCTS,
    site::SiteProducts,
};
use crate::stages::adjust::PointKind;

/// A product that a site has.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Listed {
    /// Path below the site's folder.
    pub path: String,
    /// What the file holds.
    pub what: &'static str,
    /// Who reads it.
    pub readers: &'static str,
}

/// The products of `site` in the order in which they are written, without the figures of its report.
#[must_use]
pub fn listed(site: &SiteProducts) -> Vec<Listed> {
    let declared = PRODUCTS.iter().filter(|declaration| has(site, declaration));
    let paths = declared.flat_map(|declaration| {
        let images: Vec<&str> = match declaration.write {
            Write::Image(_) | Write::AdjustedImage(_) | Write::WithAnother => {
                site.images.iter().map(|image| &*image.times.id).collect()
            }
            _ => vec![""],
        };
        images.into_iter().map(|image| Listed {
            path: declaration.path_of(image),
            what: declaration.what,
            readers: declaration.readers,
        })
    });
    paths.collect()
}

fn has(site: &SiteProducts, declaration: &Declaration) -> bool {
    let adjusted = site.adjustment().map(|(_, adjustment)| adjustment.adjusted);
    if declaration.path == ITEM.path {
        let outlines = site.images.iter().map(|image| &image.orientation.outline);
        return !site.footprints.is_empty() || outlines.flatten().next().is_some();
    }
    if declaration.path == LIDAR.path {
        let mut points = adjusted.iter().flat_map(|adjusted| &adjusted.points);
        return points.any(|point| point.kind == PointKind::Shot);
    }
    match declaration.write {
        Write::Site(_) | Write::Image(_) => true,
        Write::OfPage(_) => declaration.path != FIGURE.path,
        Write::Footprints(_) => !site.footprints.is_empty(),
        Write::Ties(_) => site.geometric.is_some(),
        Write::Adjustment(_) | Write::AdjustedImage(_) | Write::WithAnother | Write::Several(_) => {
            adjusted.is_some()
        }
    }
}
