//! Images of one pass: they share the errors of its orbit and attitude, and have errors of their own.
//!
//! Of the constant unknowns of an image, errors of the line times and changes of the errors during the pass are its own: a pass
//! shows several images, lines of one camera or the narrow and the wide angle, some seconds to minutes apart. Everything else is
//! common. With the a priori standard deviation `σ` of a position or a rotation and that of its change within half an image
//! (the linear power) `σ₁`, the common variance is `σ² − σ₁²`, less the rotation by a delay of the lines
//! ([`LineDelay`](super::LineDelay)). Independent images of one pass would determine their common error by their number.
//!
//! Common errors are constant in Mars-fixed axes; the axes of the bus turn against these by 3° in a minute.

use nalgebra::{DMatrix, Matrix3};

use super::input::AdjustImage;
use areograph_geom::{
    bundle::{BundleImage, CommonPass, ORIENTATION_UNKNOWNS},
    pushbroom::ExteriorOrientation,
};

/// Constant unknowns of an image.
const CONSTANTS: usize = ORIENTATION_UNKNOWNS / 3;
/// Least own part of a standard deviation, as a share: without one, the a priori covariance has no inverse.
const OWN_SHARE_MIN: f64 = 0.01;

/// Factors of the common errors of an image: its constant position and rotation are these times independent errors of variance 1.
struct Common {
    position_m: Matrix3<f64>,
    rotation_rad: Matrix3<f64>,
}

/// Symmetric root of a symmetric matrix; negative eigenvalues count as 0.
fn root(matrix: &Matrix3<f64>) -> Matrix3<f64> {
    let eigen = matrix.symmetric_eigen();
    let roots = eigen.eigenvalues.map(|value| value.max(0.0).sqrt());
    eigen.eigenvectors * Matrix3::from_diagonal(&roots) * eigen.eigenvectors.transpose()
}

/// Common standard deviation of a quantity whose constant and linear powers have these; 0 where it is fixed or free.
fn common_sigma(constant: f64, linear: f64) -> f64 {
    if !constant.is_finite() || constant <= 0.0 {
        return 0.0;
    }
    let own = linear.max(OWN_SHARE_MIN * constant).min(constant);
    (constant * constant - own * own).sqrt()
}

impl Common {
    /// * `delay_s` – standard deviation of a delay of all lines that is no unknown
    fn of<M: ExteriorOrientation>(
        image: &BundleImage<&M>,
        of_site: &AdjustImage<M>,
        delay_s: f64,
    ) -> Self {
        let sigma = |quantity: usize| {
            common_sigma(image.sigmas[3 * quantity], image.sigmas[3 * quantity + 1])
        };
        let diagonal = |first: usize| {
            Matrix3::from_diagonal(&[0, 1, 2].map(|axis| sigma(first + axis)).into())
        };
        let mut rotation_rad2 = diagonal(3).pow(2);
        if let Some(delay) = of_site.line_delay.as_ref().filter(|_| delay_s > 0.0) {
            let turn_rad = delay.constant_turn_rad(delay_s, &image.sigmas);
            rotation_rad2 -= turn_rad * turn_rad.transpose();
        }
        let mars_to_camera = image.base.pose(0.0).mars_to_camera;
        // In Mars-fixed axes, where the errors of two images are the same.
        let rotation_rad = root(&(mars_to_camera.transpose() * rotation_rad2 * mars_to_camera));
        Self {
            position_m: diagonal(0),
            rotation_rad: mars_to_camera * rotation_rad,
        }
    }
}

/// The passes with two or more images.
///
/// * `delay_s` – standard deviation of a delay of all lines of an image that is no unknown, seconds
pub(super) fn common_passes<M: ExteriorOrientation>(
    images: &[BundleImage<&M>],
    of_site: &[AdjustImage<M>],
    delay_s: f64,
) -> Vec<CommonPass> {
    let mut passes: Vec<usize> = of_site.iter().filter_map(|image| image.pass).collect();
    passes.sort_unstable();
    passes.dedup();
    let of_pass = passes.into_iter().map(|pass| {
        let indices = 0..of_site.len();
        indices
            .filter(|index| of_site[*index].pass == Some(pass))
            .collect()
    });
    of_pass
        .filter(|indices: &Vec<usize>| indices.len() > 1)
        .map(|indices| CommonPass {
            covariance: covariance(&indices, images, of_site, delay_s),
            images: indices,
        })
        .collect()
}

fn covariance<M: ExteriorOrientation>(
    indices: &[usize],
    images: &[BundleImage<&M>],
    of_site: &[AdjustImage<M>],
    delay_s: f64,
) -> DMatrix<f64> {
    let common = indices
        .iter()
        .map(|index| Common::of(&images[*index], &of_site[*index], delay_s));
    let common: Vec<Common> = common.collect();
    let size = CONSTANTS * indices.len();
    let mut covariance = DMatrix::zeros(size, size);
    for (one, of_one) in common.iter().enumerate() {
        for (other, of_other) in common.iter().enumerate() {
            let at = [CONSTANTS * one, CONSTANTS * other];
            if one == other {
                for constant in 0..CONSTANTS {
                    let sigma = images[indices[one]].sigmas[3 * constant];
                    covariance[(at[0] + constant, at[1] + constant)] = sigma * sigma;
                }
                continue;
            }
            let positions_m2 = of_one.position_m * of_other.position_m.transpose();
            let rotations_rad2 = of_one.rotation_rad * of_other.rotation_rad.transpose();
            covariance
                .fixed_view_mut::<3, 3>(at[0], at[1])
                .copy_from(&positions_m2);
            let mut rotations = covariance.fixed_view_mut::<3, 3>(at[0] + 3, at[1] + 3);
            rotations.copy_from(&rotations_rad2);
        }
    }
    covariance
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        adjust::{LineDelay, input::sigmas_of_powers},
        invented_pair::{HEIGHT_M, Invented},
    };
    use areograph_geom::pushbroom::SampledOrientation;
    use nalgebra::Vector3;

    /// Standard deviations of the constant and linear powers, metres and radians.
    const POSITION_M: [f64; 3] = [25.0, 0.2, 0.1];
    const ROTATION_RAD: [f64; 3] = [4e-4, 1e-5, 1e-5];
    const DELAY_S: f64 = 0.045;

    fn image(number: usize, pass: Option<usize>) -> AdjustImage<SampledOrientation> {
        let oriented_camera = Invented::camera(number, [0.0; 2]);
        let line_period_s = 1.4e-3;
        let half_lines = 0.5 * oriented_camera.lines();
        AdjustImage {
            line_delay: Some(LineDelay::of(
                &oriented_camera.orientation,
                half_lines,
                line_period_s,
                HEIGHT_M,
            )),
            oriented_camera,
            line_period_s,
            sigmas: sigmas_of_powers(&POSITION_M, &ROTATION_RAD),
            time_bias_sigma_s: 0.0,
            pass,
            expected_m: Vector3::zeros(),
            turn_rad_s: Vector3::zeros(),
            laser_axes: None,
        }
    }

    fn passes(of: &[AdjustImage<SampledOrientation>], delay_s: f64) -> Vec<CommonPass> {
        let images: Vec<_> = of.iter().map(AdjustImage::bundle_image).collect();
        common_passes(&images, of, delay_s)
    }

    #[test]
    fn only_images_of_one_pass_are_correlated() {
        let of = |passes: [Option<usize>; 3]| [0, 1, 1].into_iter().zip(passes);
        let images = |passes: [Option<usize>; 3]| -> Vec<_> {
            of(passes)
                .map(|(number, pass)| image(number, pass))
                .collect()
        };
        assert!(passes(&images([Some(1), Some(2), None]), DELAY_S).is_empty());
        let found = passes(&images([Some(1), Some(2), Some(1)]), DELAY_S);
        assert_eq!(found.len(), 1);
        assert_eq!(found[0].images, [0, 2]);
    }

    #[test]
    fn a_pass_shares_all_but_line_times_and_changes() {
        let images = [image(0, Some(1)), image(0, Some(1))];
        let [pass] = &passes(&images, DELAY_S)[..] else {
            panic!("one pass");
        };
        let correlation = |row: usize, column: usize| {
            let variances = pass.covariance[(row, row)] * pass.covariance[(column, column)];
            pass.covariance[(row, column)] / variances.sqrt()
        };
        for axis in 0..3 {
            // The own part is the least one, 1 % of 25 m.
            assert!((correlation(axis, CONSTANTS + axis) - (1.0 - 1e-4)).abs() < 1e-9);
            // Metres and radians as configured.
            assert!((pass.covariance[(axis, axis)].sqrt() - 25.0).abs() < 1e-12);
            assert!((pass.covariance[(3 + axis, 3 + axis)].sqrt() - 4e-4).abs() < 1e-15);
        }
        // Line times are seen as a rotation about one axis: its share of the variance is that of the image alone.
        let turn_rad = images[0].line_delay.as_ref().unwrap();
        let turn_rad = turn_rad.constant_turn_rad(DELAY_S, &images[0].sigmas);
        let own = ROTATION_RAD[1].powi(2) + turn_rad.norm_squared();
        let trace: f64 = (3..6).map(|axis| correlation(axis, CONSTANTS + axis)).sum();
        let expected = 3.0 - (own + 2.0 * ROTATION_RAD[1].powi(2)) / ROTATION_RAD[0].powi(2);
        assert!(own > 0.5 * ROTATION_RAD[0].powi(2), "{own}");
        // Relative; a turn about an axis between those of the camera changes the sum by rounding alone.
        assert!((trace - expected).abs() < 1e-9, "{trace} {expected}");
        // Without a delay, rotations are common like positions.
        let [pass] = &passes(&images, 0.0)[..] else {
            panic!("one pass");
        };
        let shared = pass.covariance[(4, 10)] / ROTATION_RAD[0].powi(2);
        assert!(
            (shared - (1.0 - (1e-5_f64 / 4e-4).powi(2))).abs() < 1e-9,
            "{shared}"
        );
    }

    #[test]
    fn quantities_without_a_weight_are_not_common() {
        let sigma = common_sigma;
        assert!(sigma(0.0, 0.0) <= 0.0 && sigma(f64::INFINITY, 1.0) <= 0.0);
        // As uncertain within an image as between passes.
        assert!(sigma(25.0, 25.0) <= 0.0 && sigma(25.0, f64::INFINITY) <= 0.0);
        assert!((sigma(5.0, 3.0) - 4.0).abs() < 1e-12);
    }
}
