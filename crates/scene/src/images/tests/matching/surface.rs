//! A terrain model of rendered images against their ground.

use std::{fs, path::Path};

use crate::terrain::Terrain;
use areograph_base::body::Body;
use areograph_geom::{ellipsoid::spherical_to_xyz_m, height_grid::HeightGrid, statistics::Summary};
use areograph_pds::terrain_model::{HeightsAbove, read_terrain_model};

/// Planimetric error of the scene's adjusted orientations on an axis, metres: `laser_surface.plan_sigma_m`.
const PLAN_M: f64 = 130.0;

/// A terrain model of a site, its standard deviations, and its document.
pub(super) struct Published {
    heights: HeightGrid,
    sigmas_m: Vec<f32>,
    document: serde_json::Value,
}

impl Published {
    pub(super) fn of(products: &Path) -> Self {
        let read = |name: &str| {
            let above = HeightsAbove::default();
            read_terrain_model(&products.join(name), Body::Mars, above).unwrap()
        };
        let document = fs::read(products.join("surface.json")).unwrap();
        Self {
            heights: read("surface_above_sphere.tif"),
            sigmas_m: read("surface_sigma.tif").heights_m,
            document: serde_json::from_slice(&document).unwrap(),
        }
    }

    fn stated(&self, pointer: &str) -> f64 {
        self.document.pointer(pointer).unwrap().as_f64().unwrap()
    }

    /// Compares every height with the ground.
    pub(super) fn hold_against(&self, terrain: &Terrain) {
        let grid = &self.heights;
        let columns = grid.size[1];
        let truth_m = |cell: [f64; 2]| {
            let [longitude_rad, latitude_rad] = grid.place_rad(cell);
            terrain.radius_m(&spherical_to_xyz_m(longitude_rad, latitude_rad, 1.0)) - grid.radius_m
        };
        let (mut errors_m, mut rises) = (Vec::new(), Vec::new());
        for (at, height_m) in grid.heights_m.iter().enumerate() {
            assert_eq!(height_m.is_nan(), self.sigmas_m[at].is_nan());
            if height_m.is_nan() {
                continue;
            }
            let cell = [(at / columns) as f64, (at % columns) as f64];
            let here_m = truth_m(cell);
            errors_m.push(f64::from(*height_m) - here_m);
            let [east_m, north_m] = grid.cell_m();
            rises.push((truth_m([cell[0], cell[1] + 1.0]) - here_m) / east_m);
            rises.push((truth_m([cell[0] + 1.0, cell[1]]) - here_m) / north_m);
        }
        let error_m = Summary::of(&errors_m);
        let slope = (rises.iter().map(|of| of * of).sum::<f64>() / rises.len() as f64).sqrt();
        let sigma_m = self.stated("/heights/sigma_m");
        let common_m = self.stated("/heights/common_sigma_m");
        let expected_m = sigma_m.hypot(PLAN_M * slope);
        println!(
            "terrain model: {error_m:.2?}, stated {sigma_m:.2} m and {common_m:.2} m in common, slope {slope:.3}, expected {expected_m:.2} m; {}",
            self.document
        );
        // The stated uncertainty of all heights together, plus the effect of the unknown planimetry on the mean slope.
        assert!(
            error_m.median.abs() <= 3.0 * common_m.hypot(PLAN_M * slope / 3.0),
            "{error_m:?}"
        );
        assert!(
            error_m.standard_deviation <= 2.0 * expected_m,
            "{error_m:?}"
        );
        assert!(error_m.n > 5_000, "{error_m:?}");
        // The altimeter and the truth agree on the heights.
        let by_shots_m = self.stated("/mola_minus_surface/all/median");
        let apart_m = (by_shots_m + error_m.median).abs();
        assert!(apart_m <= 3.0 * common_m.max(expected_m), "{by_shots_m}");
    }
}
