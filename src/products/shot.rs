//! A shot as tables for GIS have it.

use serde::Serialize;

use super::site::SiteProducts;

/// Attributes of a footprint under the names of its columns: metres, TDB seconds past J2000.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Shot {
    pub(super) et_s: f64,
    pub(super) utc: String,
    pub(super) orbit: u32,
    pub(super) source_file: String,
    pub(super) record: u32,
    pub(super) shot: u8,
    pub(super) radius_m: f64,
    pub(super) radius_crossover_m: f64,
    pub(super) topography_m: f64,
    pub(super) range_m: f64,
    pub(super) windows: String,
}

impl Shot {
    /// The shot in `row` of the site's footprints.
    pub(super) fn of(site: &SiteProducts, row: usize) -> Self {
        let shot = site.footprints.row(row);
        Self {
            et_s: shot.et_s,
            utc: site.utc[row].clone(),
            orbit: shot.orbit,
            source_file: site.file_name(shot.file),
            record: shot.record,
            shot: shot.shot,
            radius_m: shot.radius_m,
            radius_crossover_m: shot.radius_crossover_m,
            topography_m: shot.topography_m(),
            range_m: shot.range_m,
            windows: site.window_ids(shot.windows),
        }
    }
}

#[cfg(test)]
pub(super) fn example(shot: u8, et_s: f64) -> Shot {
    Shot {
        et_s,
        utc: "1999-08-24T14:12:13.000".to_owned(),
        orbit: 9019,
        source_file: "a\n\"b\" 'c'.b".to_owned(),
        record: 11,
        shot,
        radius_m: 3_394_000.12,
        radius_crossover_m: 3_394_001.37,
        topography_m: -1_498.63,
        range_m: 380_000.1,
        windows: String::new(),
    }
}
