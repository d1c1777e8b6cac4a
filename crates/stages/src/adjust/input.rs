//! Input of an adjustment: images with their a priori values, and laser shots.

use nalgebra::{Matrix3, Vector3};

use super::line_times::LineDelay;
use areograph_base::frames::{BodyFixed, Position};
use areograph_config::{PositionUnknowns, RotationUnknowns};
use areograph_geom::{
    bundle::{BundleImage, ORIENTATION_UNKNOWNS},
    oriented_camera::OrientedCamera,
    surface::LaserSurface,
};

/// An image with the a priori values of its orientation.
#[derive(Debug, Clone, PartialEq)]
pub struct AdjustImage<M> {
    /// Initial orientation and detector.
    pub oriented_camera: OrientedCamera<M>,
    /// Time from line to line, seconds.
    pub line_period_s: f64,
    /// Standard deviation of each orientation unknown, see [`orientation_sigmas`]; infinite leaves it free,
    /// 0 holds it fixed.
    pub sigmas: [f64; ORIENTATION_UNKNOWNS],
    /// Standard deviation of a bias of the line times, seconds; 0 for no such unknown.
    pub time_bias_sigma_s: f64,
    /// Number of its pass, whose orbit and attitude err alike in all images; `None` where images are independent.
    pub pass: Option<usize>,
    /// Expected offset from its initial position, Mars-fixed, metres.
    pub expected_m: Vector3<f64>,
    /// Rotation rate relative to inertial space, camera components, radians per second.
    pub turn_rad_s: Vector3<f64>,
    /// Effect of a delay of all lines, where line times may err without being an unknown.
    pub line_delay: Option<LineDelay>,
    /// Axes of a laser on the same bus, camera components, where the laser's file states them: as columns the
    /// directions of the two boresight angles, and the beam.
    pub laser_axes: Option<Matrix3<f64>>,
}

impl<M> AdjustImage<M> {
    /// The image as the network has it.
    pub(super) fn bundle_image(&self) -> BundleImage<&M> {
        BundleImage {
            base: &self.oriented_camera.orientation,
            half_lines: 0.5 * self.oriented_camera.lines(),
            line_period_s: self.line_period_s,
            focal_length_px: self.oriented_camera.detector.focal_length_px,
            distortion: self.oriented_camera.detector.distortion,
            sigmas: self.sigmas,
            time_bias_sigma_s: self.time_bias_sigma_s,
        }
    }

    /// Direction of the beam of a laser on the same bus, camera components.
    pub(super) fn beam(&self) -> Option<Vector3<f64>> {
        Some(self.laser_axes?.column(2).into_owned())
    }
}

/// Standard deviations of an image's unknowns from one for positions and one for rotations.
///
/// All powers of `t`, in units of half the image, get the same standard deviation.
#[must_use]
pub fn orientation_sigmas(position_m: f64, angle_rad: f64) -> [f64; ORIENTATION_UNKNOWNS] {
    std::array::from_fn(|index| if index < 9 { position_m } else { angle_rad })
}

/// Standard deviations of an image's unknowns from one for each of the three powers of `t`, equal on all axes.
#[must_use]
pub(super) fn sigmas_of_powers(
    position_m: &[f64; 3],
    rotation_rad: &[f64; 3],
) -> [f64; ORIENTATION_UNKNOWNS] {
    std::array::from_fn(|index| {
        let of_power = if index < 9 { position_m } else { rotation_rad };
        of_power[index % 3]
    })
}

/// Holds fixed the coefficients of an image's position and rotation that are not unknowns.
pub(super) fn hold_powers(
    sigmas: &mut [f64; ORIENTATION_UNKNOWNS],
    position: PositionUnknowns,
    rotation: RotationUnknowns,
) {
    for (index, sigma) in sigmas.iter_mut().enumerate() {
        let powers = if index < 9 {
            position.powers()
        } else {
            rotation.powers()
        };
        if index % 3 >= powers {
            *sigma = 0.0;
        }
    }
}

/// The laser shots of an adjustment.
#[derive(Debug, Clone, Default)]
pub struct LaserShots {
    /// Identifiers of the site's profiles, in order.
    pub profiles: Vec<String>,
    /// Standard deviations of the offset of each profile as recorded, in east, north and height, metres; its footprints
    /// share it.
    pub profile_sigmas_m: Vec<Vector3<f64>>,
    /// Shots, each row once.
    pub shots: Vec<LaserShot>,
    /// The ground between all shots of the site, where it controls the heights of tie points.
    pub surface: Option<LaserSurface>,
}

/// A laser shot.
#[derive(Debug, Clone, PartialEq)]
pub struct LaserShot {
    /// Index of its profile.
    pub profile: usize,
    /// Row of its footprint.
    pub row: u32,
    /// Footprint.
    pub ground: Position<BodyFixed>,
    /// Its range, where an image was exposed from the same orbit at that instant.
    pub range: Option<ShotRange>,
    /// The same range from other images that were exposed at that instant: it is observed once, but seen in all of them.
    pub also: Vec<ShotRange>,
}

/// Range of a shot that was fired while an image was exposed.
#[derive(Debug, Clone, PartialEq)]
pub struct ShotRange {
    /// Index of the image.
    pub image: usize,
    /// Instant of the shot as a line from the middle of that image.
    pub x_lines: f64,
    /// From the perspective centre at that instant to the spacecraft, IAU 2000, metres: ranges are geometric.
    pub to_laser_m: Vector3<f64>,
    /// Distance, metres.
    pub range_m: f64,
}

impl LaserShots {
    /// Name of a shot in messages and products: its profile and its row.
    #[must_use]
    pub fn name(&self, shot: &LaserShot) -> String {
        format!("{}:{}", self.profiles[shot.profile], shot.row)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_hold_the_powers_above_them() {
        let held = |position, rotation| {
            let mut sigmas = sigmas_of_powers(&[25.0, 0.2, 0.1], &[4e-4, 1e-5, f64::INFINITY]);
            hold_powers(&mut sigmas, position, rotation);
            let powers = |of: &[f64]| of.chunks(3).map(<[f64]>::to_vec).collect::<Vec<_>>();
            (powers(&sigmas[..9]), powers(&sigmas[9..]))
        };
        let (position, rotation) = held(PositionUnknowns::Velocity, RotationUnknowns::Angles);
        assert_eq!(position, vec![vec![25.0, 0.2, 0.0]; 3]);
        assert_eq!(rotation, vec![vec![4e-4, 0.0, 0.0]; 3]);
        let (position, rotation) = held(PositionUnknowns::None, RotationUnknowns::Acceleration);
        assert_eq!(position, vec![vec![0.0; 3]; 3]);
        assert_eq!(rotation, vec![vec![4e-4, 1e-5, f64::INFINITY]; 3]);
    }
}
