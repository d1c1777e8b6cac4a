//! Jitter in the adjustment of a small network.

use super::{
    BundleOptions, HeightControl, Jitter,
    height_tests::{CONTROLLED, surface_with},
    solve,
    tests::network,
};
use crate::surface::SurfaceOptions;

/// Standard deviations of the position by relief, metres, and of the mean height, with a jitter of this size.
fn sigmas_m(sigma_rad: f64) -> ([f64; 2], f64) {
    let mut network = network();
    let options = SurfaceOptions {
        uses_relief: true,
        ..SurfaceOptions::default()
    };
    network.heights = Some(HeightControl {
        surface: surface_with(&network, 35.0, &options),
        jitter: (sigma_rad > 0.0).then_some(Jitter {
            sigma_rad,
            time_s: 1.0,
        }),
        compared: Vec::new(),
        observed: CONTROLLED.collect(),
    });
    let adjusted = solve(&network, &BundleOptions::default()).unwrap();
    let mean_m2 = adjusted.mean_cofactor_m2.unwrap();
    (adjusted.relief.unwrap().sigma_m, mean_m2.trace().sqrt())
}

#[test]
fn relief_determines_the_position_less_the_more_the_attitude_oscillates() {
    let [steady, little, much] = [0.0, 1e-5, 1e-4].map(sigmas_m);
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
