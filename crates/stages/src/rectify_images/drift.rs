//! Horizontal errors due to the orientation of an image: what all its places share, and what changes along it.

use nalgebra::{DMatrix, Matrix2xX, Vector2, Vector3};

use crate::{adjust::CorrectedImage, image_view::View};
use areograph_base::constants::Spacecraft;
use areograph_config::AdjustmentConfig;
use areograph_geom::{bundle::ORIENTATION_UNKNOWNS, ellipsoid::local_axes};

/// Lines at which the error is computed, from the first to the last one, and places along each of them.
const LINES: u32 = 17;
const SAMPLES: [f64; 3] = [0.0, 0.5, 1.0];

/// What is known of the orientation of an image.
#[derive(Debug)]
pub(super) struct OrientationErrors {
    /// Covariance of its unknowns, metres and radians, with powers of lines from the middle in parts of `half_lines`.
    covariance: DMatrix<f64>,
    half_lines: f64,
}

/// Standard deviations of horizontal positions, metres.
#[derive(Debug, Clone, Copy)]
pub(super) struct PlanSigmas {
    /// Of the mean of all places, east and north.
    pub(super) shared_m: [f64; 2],
    /// Of a place about this mean, both axes together, root mean square over the image.
    pub(super) drift_m: f64,
}

impl OrientationErrors {
    /// By the adjustment.
    pub(super) fn adjusted(image: &CorrectedImage) -> Self {
        Self {
            covariance: image.covariance.clone(),
            half_lines: image.half_lines,
        }
    }

    /// Of an orientation from the kernels: the standard deviations with which an adjustment would begin.
    pub(super) fn a_priori(
        view: &View<'_>,
        priors: &AdjustmentConfig,
        spacecraft: &Spacecraft,
    ) -> Self {
        let position_m = priors.position_sigma_m(spacecraft);
        let rotation_rad = priors.rotation_sigma_rad(spacecraft);
        let sigma = |unknown: usize, _: usize| {
            let of = if unknown < ORIENTATION_UNKNOWNS / 2 {
                position_m
            } else {
                rotation_rad
            };
            of[unknown % 3].powi(2)
        };
        let variances = DMatrix::from_fn(ORIENTATION_UNKNOWNS, 1, sigma);
        Self {
            covariance: DMatrix::from_diagonal(&variances.column(0).into_owned()),
            half_lines: 0.5 * view.camera.lines(),
        }
    }

    /// Their effect on horizontal positions in `view`; the ground is a sphere of `radius_m`.
    pub(super) fn plan_sigmas(&self, view: &View<'_>, radius_m: f64) -> PlanSigmas {
        let step = |line: u32| 2.0 * f64::from(line) / f64::from(LINES - 1) - 1.0;
        let places = (0..LINES).flat_map(|line| SAMPLES.map(|share| [step(line), share]));
        let effects = places.filter_map(|place| effect(view, self.half_lines, place, radius_m));
        let effects: Vec<Matrix2xX<f64>> = effects.collect();
        let count = effects.len().max(1) as f64;
        let zero = Matrix2xX::zeros(ORIENTATION_UNKNOWNS);
        let mean = effects.iter().fold(zero, |sum, of| sum + of) / count;
        let variances_m2 =
            |of: &Matrix2xX<f64>| (of * &self.covariance * of.transpose()).diagonal();
        let about_m2 = effects.iter().map(|of| variances_m2(&(of - &mean)).sum());
        let sigma_m = |variance_m2: f64| variance_m2.max(0.0).sqrt();
        let shared_m2 = variances_m2(&mean);
        PlanSigmas {
            shared_m: [sigma_m(shared_m2[0]), sigma_m(shared_m2[1])],
            drift_m: sigma_m(about_m2.sum::<f64>() / count),
        }
    }
}

/// Horizontal displacement of the ground at `t`, from −1 to 1 along the image, and `share` of its line, by each unknown of its orientation: east and
/// north, metres per unit.
fn effect(
    view: &View<'_>,
    half_lines: f64,
    [t, share]: [f64; 2],
    radius_m: f64,
) -> Option<Matrix2xX<f64>> {
    let x_lines = t * half_lines;
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
    use super::*;
    use crate::invented_pair::{HEIGHT_M, Invented, LINES as IMAGE_LINES, RADIUS_M};

    /// The effect of this standard deviation of one unknown.
    fn of_unknown(unknown: usize, sigma: f64) -> PlanSigmas {
        let folder = tempfile::tempdir().unwrap();
        let pyramid = Invented::pyramid(folder.path(), &vec![9; (IMAGE_LINES * 256) as usize]);
        let camera = Invented::camera(0, [0.0; 2]);
        let view = Invented::view(&camera, &pyramid);
        let mut covariance = DMatrix::zeros(ORIENTATION_UNKNOWNS, ORIENTATION_UNKNOWNS);
        covariance[(unknown, unknown)] = sigma * sigma;
        let errors = OrientationErrors {
            covariance,
            half_lines: 0.5 * f64::from(IMAGE_LINES),
        };
        errors.plan_sigmas(&view, RADIUS_M)
    }

    #[test]
    fn drifts_displace_the_ends_and_constants_do_not() {
        // t is even between −1 and 1 at 17 lines: √(Σt²/17) = 0.6124.
        let even = 0.6124;
        // A drift of 10 µrad in roll from 380 km, and of 5 m of the position along the track.
        for (unknown, sigma, expected_m) in [(10, 1e-5, even * 3.8), (7, 5.0, even * 5.0)] {
            let found_m = of_unknown(unknown, sigma).drift_m;
            // A hundredth: the ground is a sphere.
            assert!(
                (found_m / expected_m - 1.0).abs() < 0.01,
                "{unknown}: {found_m} {expected_m}"
            );
        }
        assert!((HEIGHT_M - 380e3).abs() < 1.0);
        // 100 m towards the ground and across the track, and 0.4 mrad of roll at 380 km.
        for (unknown, sigma, shared_m) in [(0, 100.0, 0.0), (3, 100.0, 100.0), (9, 4e-4, 152.0)] {
            let found = of_unknown(unknown, sigma);
            assert!(found.drift_m < 0.1, "{unknown}: {found:?}");
            let [east_m, north_m] = found.shared_m;
            // A hundredth: the ground is a sphere.
            assert!(
                (east_m.hypot(north_m) - shared_m).abs() < 1.5,
                "{unknown}: {found:?}"
            );
        }
    }
}
