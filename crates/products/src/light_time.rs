//! Convention of camera positions in the products, for their readers.

use super::site::{ImageProducts, SiteProducts};
use areograph_geom::light_time::LightTime;

/// The convention of the site as a sentence; images of support data have their own positions.
pub(super) fn convention(site: &SiteProducts) -> String {
    let light_time = site.config.orientation.light_time;
    let (supported, others): (Vec<&ImageProducts>, Vec<&ImageProducts>) = site
        .images
        .iter()
        .partition(|image| image.times.support.is_some());
    let of_run = format!(
        "light time {}: positions of cameras are {}",
        light_time.word(),
        light_time.positions()
    );
    let ids: Vec<&str> = supported.iter().map(|image| &*image.times.id).collect();
    let positions = match (ids.is_empty(), others.is_empty()) {
        (true, _) => of_run,
        (false, true) => format!(
            "positions of cameras are {}",
            LightTime::Support.positions()
        ),
        (false, false) => format!(
            "{of_run}; of {} {}",
            ids.join(", "),
            LightTime::Support.positions()
        ),
    };
    let choice = site.footprints.ground_choice();
    let radii = choice.map_or_else(String::new, |of| {
        format!("; radii of the ground are those {}", of.words())
    });
    format!("{positions}; ranges of shots are geometric{radii}")
}

/// The convention in the metadata of Parquet files.
pub(super) fn metadata(site: &SiteProducts) -> Vec<(&'static str, String)> {
    vec![("light_time", convention(site))]
}
