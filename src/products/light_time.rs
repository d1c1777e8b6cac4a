//! Which positions of cameras the products follow, for their readers.

use super::site::SiteProducts;
use crate::geom::light_time::LightTime;

/// The convention as a sentence.
pub(super) fn convention(light_time: LightTime) -> String {
    format!(
        "light time {}: positions of cameras are {}; ranges of shots are geometric",
        light_time.word(),
        light_time.positions()
    )
}

/// What Parquet files say of it beside their columns.
pub(super) fn metadata(site: &SiteProducts) -> Vec<(&'static str, String)> {
    vec![("light_time", convention(site.config.orientation.light_time))]
}
