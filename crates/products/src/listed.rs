//! Products that a site will have, before they are written: for the report, which links to them.

use super::{
    adjusted_kernels,
    exchange::{adjusted::LIDAR, stac::ITEM},
    page::OVERLAYS,
    product::{Declaration, Write},
    site::{Listed, SiteProducts},
};
use areograph_stages::adjust::PointKind;

/// Those of `declarations` that `site` has, in the order in which they are written, without files of which there are many.
#[must_use]
pub fn listed(site: &SiteProducts, declarations: &[&'static Declaration]) -> Vec<Listed> {
    let terms = site.config.terms();
    let declared = declarations
        .iter()
        .filter(|declaration| has(site, declaration));
    let paths = declared.flat_map(|declaration| {
        let images = |is_there: &dyn Fn(usize) -> bool| -> Vec<Option<usize>> {
            let images = 0..site.images.len();
            images.filter(|index| is_there(*index)).map(Some).collect()
        };
        let images = match declaration.write {
            Write::Image(_) | Write::AdjustedImage(_) => images(&|_| true),
            Write::WithAnother => images(&|index| adjusted_kernels::has(site, declaration, index)),
            Write::ImageWhere { has, .. } => images(&|index| has(site, index)),
            _ => vec![None],
        };
        images.into_iter().map(|image| Listed {
            path: declaration.path_of(image.map_or("", |index| &site.images[index].times.id)),
            image,
            what: terms.fill(declaration.what),
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
    if declaration.path == OVERLAYS.path {
        return site.overlays.is_some();
    }
    match declaration.write {
        Write::Site(_) | Write::Image(_) | Write::ImageWhere { .. } => true,
        Write::Where { has, .. } => has(site),
        Write::Matched(_) => site
            .geometric
            .is_some_and(|geometric| !geometric.ties.matched.is_empty()),
        Write::Many { .. } => false,
        Write::Footprints(format, _) => site.has_footprints_in(format),
        Write::Ties(_) => site.geometric.is_some(),
        Write::Adjustment(_) | Write::AdjustedImage(_) | Write::WithAnother | Write::Several(_) => {
            adjusted.is_some()
        }
    }
}
