//! Jitter and common noise in the adjustment of a small network.

use super::{
    BundleOptions, CommonNoise, HeightControl, Jitter,
    height_tests::{CONTROLLED, surface_with},
    solve,
    tests::network,
};
use crate::surface::SurfaceOptions;

/// Standard deviations of the position by relief, metres, and of the mean height, with these errors.
fn sigmas_m(jitter: Option<Jitter>, common_noise: Option<CommonNoise>) -> ([f64; 2], f64) {
    let mut network = network();
    let options = SurfaceOptions {
        uses_relief: true,
        ..SurfaceOptions::default()
    };
    network.heights = Some(HeightControl {
        surface: surface_with(&network, 35.0, &options),
        jitter,
        common_noise,
        compared: Vec::new(),
        observed: CONTROLLED.collect(),
    });
    let adjusted = solve(&network, &BundleOptions::default()).unwrap();
    let mean_m2 = adjusted.mean_cofactor_m2.unwrap();
    (adjusted.relief.unwrap().sigma_m, mean_m2.trace().sqrt())
}

#[test]
fn relief_determines_the_position_less_the_more_the_attitude_oscillates() {
    let jitter = |sigma_rad| Jitter {
        sigma_rad,
        time_s: 1.0,
    };
    let steady = sigmas_m(None, None);
    let [little, much] = [1e-5, 1e-4].map(|sigma_rad| sigmas_m(Some(jitter(sigma_rad)), None));
    for axis in 0..2 {
        let [steady_m, little_m, much_m] = [steady, little, much].map(|of| of.0[axis]);
        assert!(
            steady_m < little_m && little_m < much_m,
            "{steady_m} {little_m} {much_m}"
        );
    }
    // The mean is less certain as well, but not by the jitter itself: the orientation contains its slow part.
    assert!(much.1 > steady.1 && much.1 < 2.0 * steady.1, "{much:?}");
}

#[test]
fn relief_determines_the_position_less_where_neighbours_err_alike() {
    let common = |share| {
        let reach_m = 1_000.0;
        sigmas_m(None, Some(CommonNoise { share, reach_m }))
    };
    let [apart, half, alike] = [0.0, 0.5, 0.9].map(common);
    let independent = sigmas_m(None, None);
    for axis in 0..2 {
        let [apart_m, half_m, alike_m] = [apart, half, alike].map(|of| of.0[axis]);
        assert!(
            (apart_m - independent.0[axis]).abs() < 1e-6 * apart_m,
            "{apart_m}"
        ); // rounding
        assert!(
            apart_m < half_m && half_m < alike_m,
            "{apart_m} {half_m} {alike_m}"
        );
    }
}
