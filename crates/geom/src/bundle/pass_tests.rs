//! A priori values of images of one pass.

use nalgebra::DMatrix;

use super::{
    BundleError, BundleOptions, CommonPass, Network,
    layout::Layout,
    solve,
    tests::{layout, network},
};
use crate::pushbroom::{EulerPolynomial, ExteriorOrientation};

/// Constant unknowns of an image.
const CONSTANTS: usize = 6;
/// A priori standard deviations of positions, metres, and rotations, radians, of `network`.
const SIGMAS: [f64; 2] = [100.0, 2.6e-4];

/// The first images as a pass whose errors have this correlation.
fn pass(images: usize, correlation: f64) -> CommonPass {
    let covariance = |row: usize, column: usize| {
        let [constant, other] = [row % CONSTANTS, column % CONSTANTS];
        let variance = SIGMAS[constant / 3].powi(2);
        match (constant == other, row == column) {
            (false, _) => 0.0,
            (true, true) => variance,
            (true, false) => correlation * variance,
        }
    };
    let size = images * CONSTANTS;
    CommonPass {
        images: (0..images).collect(),
        covariance: DMatrix::from_fn(size, size, covariance),
    }
}

/// Information of the a priori values, from their rows.
fn information(layout: &Layout<'_, EulerPolynomial>) -> DMatrix<f64> {
    let columns = &layout.columns;
    let mut sum = DMatrix::zeros(columns.len(), columns.len());
    for (column, sigma) in columns.sigmas.iter().enumerate() {
        for (row, factor) in columns.prior_terms(column) {
            for (other, of_other) in columns.prior_terms(column) {
                sum[(row, other)] += factor * of_other / sigma.powi(2);
            }
        }
    }
    sum
}

#[test]
fn the_information_of_a_pass_is_the_inverse_of_its_covariance() {
    let mut network = network();
    // A rotation of the second image is held; a position of the third is free.
    network.images[1].sigmas[12] = 0.0;
    network.images[2].sigmas[3] = f64::INFINITY;
    let mut of_pass = pass(3, 0.9);
    // Different standard deviations, and a correlation of different quantities.
    for at in 0..of_pass.covariance.nrows() {
        let factor = 1.0 + at as f64 / 10.0;
        of_pass.covariance.row_mut(at).scale_mut(factor);
        of_pass.covariance.column_mut(at).scale_mut(factor);
    }
    let mixed = 0.2 * (of_pass.covariance[(0, 0)] * of_pass.covariance[(10, 10)]).sqrt();
    of_pass.covariance[(0, 10)] = mixed;
    of_pass.covariance[(10, 0)] = mixed;
    network.passes = vec![of_pass.clone()];
    let (layout, ..) = layout(&network);
    let of_image = &layout.columns.of_image;
    let used = (0..18).filter_map(|at| {
        let column = of_image[at / CONSTANTS][3 * (at % CONSTANTS)]?;
        let is_free = (at / CONSTANTS, at % CONSTANTS) == (2, 1);
        (!is_free).then_some((at, column))
    });
    let used: Vec<(usize, usize)> = used.collect();
    assert_eq!(used.len(), 16);
    let found = information(&layout);
    let covariance = |row: usize, column: usize| of_pass.covariance[(used[row].0, used[column].0)];
    let expected = DMatrix::from_fn(16, 16, covariance).try_inverse().unwrap();
    for row in 0..16 {
        for column in 0..16 {
            let size = (expected[(row, row)] * expected[(column, column)]).sqrt();
            let found = found[(used[row].1, used[column].1)];
            // Rounding of an inverse whose correlations are 0.9.
            assert!(
                (found - expected[(row, column)]).abs() < 1e-9 * size,
                "{row} {column}"
            );
        }
    }
}

/// Standard deviation of the tie point in the middle of the first two images, across the plane of its rays, from ties alone and with
/// known rotations, metres.
fn across_rays_sigma_m(passes: Vec<CommonPass>) -> f64 {
    let mut network: Network<_> = network();
    network.images.truncate(2);
    network.views.retain(|view| view.image < 2);
    network.ranges.clear();
    for point in &mut network.points {
        point.known = None;
    }
    for image in &mut network.images {
        image.time_bias_sigma_s = 0.0;
        image.sigmas[9..].fill(0.0);
    }
    network.passes = passes;
    let adjustment = solve(&network, &BundleOptions::default()).unwrap();
    let middle = adjustment.points[4].as_ref().unwrap();
    let rays =
        [0, 1].map(|image| middle.ground_m - network.images[image].base.pose(0.0).position_m);
    let across = rays[0].cross(&rays[1]).normalize();
    across.dot(&(middle.cofactor_m2 * across)).sqrt()
}

#[test]
fn images_of_one_pass_do_not_average_their_common_error() {
    // Two images with 100 m each; 0.5 % allows for the noise of ties, 3 m, and for rays that meet the point off the middle line.
    for (passes, expected_m) in [
        (Vec::new(), 100.0 * f64::sqrt(0.5)),
        (vec![pass(2, 0.5)], 100.0 * f64::sqrt(0.75)),
        (vec![pass(2, 0.9999)], 100.0),
    ] {
        let sigma_m = across_rays_sigma_m(passes);
        assert!(
            (sigma_m / expected_m - 1.0).abs() < 5e-3,
            "{sigma_m} {expected_m}"
        );
    }
}

#[test]
fn correlations_without_an_inverse_are_refused() {
    let mut network = network();
    network.passes = vec![pass(2, 1.5)];
    let refused = solve(&network, &BundleOptions::default()).unwrap_err();
    assert!(
        matches!(refused, BundleError::Value { value, .. } if value < 0.0),
        "{refused}"
    );
    network.passes = vec![CommonPass {
        images: vec![0, 7],
        ..pass(2, 0.5)
    }];
    let refused = solve(&network, &BundleOptions::default()).unwrap_err();
    assert!(
        matches!(refused, BundleError::Unmatched { .. }),
        "{refused}"
    );
    network.passes = vec![CommonPass {
        images: vec![0, 1, 2],
        ..pass(2, 0.5)
    }];
    let refused = solve(&network, &BundleOptions::default()).unwrap_err();
    assert!(matches!(refused, BundleError::Value { .. }), "{refused}");
}
