//! The error of the adjusted orientation that changes along an image: places near its ends against its middle.

use nalgebra::{Matrix2xX, Vector2, Vector3};

use crate::{adjust::CorrectedImage, image_view::View};
use areograph_geom::{bundle::ORIENTATION_UNKNOWNS, ellipsoid::local_axes};

/// Lines at which the error is computed, from the first to the last one, and places along each of them.
const LINES: u32 = 17;
const SAMPLES: [f64; 3] = [0.0, 0.5, 1.0];

/// Standard deviation of the horizontal position of a place about the mean of all places, both axes together, root mean square
/// over the image, metres, from the covariance of the orientation of `image`; the ground is a sphere of `radius_m`.
pub(super) fn drift_m(view: &View<'_>, image: &CorrectedImage, radius_m: f64) -> f64 {
    let step = |line: u32| 2.0 * f64::from(line) / f64::from(LINES - 1) - 1.0;
    let places = (0..LINES).flat_map(|line| SAMPLES.map(|share| [step(line), share]));
    let effects = places.filter_map(|place| effect(view, image, place, radius_m));
    let effects: Vec<Matrix2xX<f64>> = effects.collect();
    let Some(first) = effects.first() else {
        return 0.0;
    };
    let count = effects.len() as f64;
    let zero = Matrix2xX::zeros(first.ncols());
    let mean = effects.iter().fold(zero, |sum, of| sum + of) / count;
    let variances_m2 = effects.iter().map(|of| {
        let about = of - &mean;
        (&about * &image.covariance * about.transpose()).trace()
    });
    (variances_m2.sum::<f64>() / count).max(0.0).sqrt()
}

/// Horizontal displacement of the ground at `t`, from −1 to 1 along the image, and `share` of its line, by each unknown of its orientation: east and
/// north, metres per unit.
fn effect(
    view: &View<'_>,
    image: &CorrectedImage,
    [t, share]: [f64; 2],
    radius_m: f64,
) -> Option<Matrix2xX<f64>> {
    let x_lines = t * image.half_lines;
    let line = view.camera.line_times.line_of_offset(x_lines);
    let place = Vector2::new(line, share * view.camera.detector.samples);
    let ground_m = view.on_sphere_m(&place, radius_m)?;
    let pose = view.camera.orientation.pose(x_lines);
    let ray_m = ground_m - pose.position_m;
    let in_camera_m = pose.mars_to_camera * ray_m;
    let up = ground_m.normalize();
    let axes = local_axes(&ground_m);
    let columns = (0..ORIENTATION_UNKNOWNS).map(|unknown| {
        let axis = Vector3::ith(unknown / 3 % 3, 1.0);
        let moved_m = if unknown < ORIENTATION_UNKNOWNS / 2 {
            axis
        } else {
            // A rotation of the camera by θ rotates its rays by −θ.
            -pose.mars_to_camera.tr_mul(&axis.cross(&in_camera_m))
        };
        // Along the ray back to the height of the ground.
        let level_m = moved_m - ray_m * (moved_m.dot(&up) / ray_m.dot(&up));
        let power = i32::try_from(unknown % 3).unwrap_or_default();
        (axes * level_m).xy() * t.powi(power)
    });
    Some(Matrix2xX::from_columns(&columns.collect::<Vec<_>>()))
}

#[cfg(test)]
mod tests {
    use nalgebra::DMatrix;

    use super::*;
    use crate::invented_pair::{HEIGHT_M, Invented, LINES as IMAGE_LINES, RADIUS_M};

    /// The drift by this standard deviation of one unknown.
    fn of_unknown(unknown: usize, sigma: f64) -> f64 {
        let folder = tempfile::tempdir().unwrap();
        let pyramid = Invented::pyramid(folder.path(), &vec![9; (IMAGE_LINES * 256) as usize]);
        let camera = Invented::camera(0, [0.0; 2]);
        let view = Invented::view(&camera, &pyramid);
        let mut covariance = DMatrix::zeros(ORIENTATION_UNKNOWNS, ORIENTATION_UNKNOWNS);
        covariance[(unknown, unknown)] = sigma * sigma;
        let image = CorrectedImage {
            id: "one".to_owned(),
            correction: [0.0; ORIENTATION_UNKNOWNS],
            sigmas: [0.0; ORIENTATION_UNKNOWNS],
            covariance,
            line_time_sigma_s: 0.0,
            expected: [0.0; ORIENTATION_UNKNOWNS],
            prior_sigmas: [0.0; ORIENTATION_UNKNOWNS],
            time_bias_s: None,
            line_period_s: 1.4e-3,
            half_lines: 0.5 * f64::from(IMAGE_LINES),
        };
        drift_m(&view, &image, RADIUS_M)
    }

    #[test]
    fn drifts_displace_the_ends_and_constants_do_not() {
        // t is even between −1 and 1 at 17 lines: √(Σt²/17) = 0.6124.
        let even = 0.6124;
        // A drift of 10 µrad in roll from 380 km, and of 5 m of the position along the track.
        for (unknown, sigma, expected_m) in [(10, 1e-5, even * 3.8), (7, 5.0, even * 5.0)] {
            let found_m = of_unknown(unknown, sigma);
            // A hundredth: the ground is a sphere.
            assert!(
                (found_m / expected_m - 1.0).abs() < 0.01,
                "{unknown}: {found_m} {expected_m}"
            );
        }
        assert!((HEIGHT_M - 380e3).abs() < 1.0);
        // 100 m towards the ground and across the track, and 0.4 mrad of roll.
        for (unknown, sigma) in [(0, 100.0), (3, 100.0), (9, 4e-4)] {
            let found_m = of_unknown(unknown, sigma);
            assert!(found_m < 0.1, "{unknown}: {found_m}");
        }
    }
}
