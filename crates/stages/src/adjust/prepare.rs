//! Input of the combined adjustment: images with their a priori values, and shots.

use std::collections::BTreeSet;

use nalgebra::{Matrix3, Vector3};

use super::{
    input::{
        AdjustImage, LaserShot, LaserShots, ShotRange, hold_powers, orientation_sigmas,
        sigmas_of_powers,
    },
    line_times::LineDelay,
};
use crate::{
    group_profiles::Profile, orientation::Orientation, register::ImageRegistration,
    tag_times::ImageTimes, turn::turn_rad_s,
};
use areograph_base::{
    footprints::{AdjustmentModel, Footprints},
    frames::{BodyFixed, Position},
    instruments::Altimeter,
    time::Et,
    units::RADIANS_PER_DEGREE,
};
use areograph_config::AdjustmentConfig;
use areograph_geom::{
    body_rotation::spin_rad_s, bundle::ORIENTATION_UNKNOWNS, ellipsoid::spherical_to_xyz_m,
    orbit_axes::radial_along_cross, oriented_camera::OrientedCamera,
    pushbroom::ExteriorOrientation, surface::LaserSurface,
};

/// Images that look within this angle of nadir are nadir images, radians: MOC looks straight down to about a degree, or
/// off nadir by ten degrees and more.
const NADIR_RAD: f64 = 5.0 * RADIANS_PER_DEGREE;

/// Images of a spacecraft belong to one pass if they follow each other within this time, seconds: lines of one camera show a place
/// within minutes, and the next orbit follows after an hour and more.
const SAME_PASS_S: f64 = 1_200.0;

/// An image before the adjustment.
#[derive(Debug, Clone)]
pub struct Candidate<'a, M> {
    /// Line times.
    pub times: &'a ImageTimes,
    /// Orientation samples.
    pub orientation: &'a Orientation,
    /// The form of the orientation that is adjusted.
    pub oriented_camera: OrientedCamera<M>,
    /// Image coordinates of the footprints.
    pub registration: &'a ImageRegistration,
    /// Offset of the spacecraft in the PEDR file from the kernels, radial, along and across the track, metres, where a
    /// profile was flown with the image.
    pub pedr_orbit_m: Option<Vector3<f64>>,
}

impl<M: ExteriorOrientation> Candidate<'_, M> {
    /// The image with its standard deviations, from the model or from the entry of `config` for this image.
    fn weighed(self, laser: &Altimeter, config: &AdjustmentConfig) -> AdjustImage<M> {
        let mut sigmas = match config.model {
            AdjustmentModel::MolaSurface => {
                let spacecraft = self.times.instrument.spacecraft;
                sigmas_of_powers(
                    &config.position_sigma_m(spacecraft),
                    &config.rotation_sigma_rad(spacecraft),
                )
            }
            AdjustmentModel::Published => self.published_sigmas(config),
        };
        let own = config.images.iter().find(|own| own.id == self.times.id);
        if let Some(own) = own {
            if let Some(position_m) = own.position_m {
                sigmas[..9].copy_from_slice(&position_m);
            }
            if let Some(rotation_rad) = own.rotation_rad {
                sigmas[9..].copy_from_slice(&rotation_rad);
            }
        }
        let position = own.and_then(|own| own.position_unknowns);
        let position = position.unwrap_or(config.position_unknowns);
        let rotation = own.and_then(|own| own.rotation_unknowns);
        let rotation = rotation.unwrap_or(config.rotation_unknowns);
        hold_powers(&mut sigmas, position, rotation);
        AdjustImage {
            turn_rad_s: turn_rad_s(&self.oriented_camera, self.times.body.model()),
            laser_axes: laser
                .axes_in_bus()
                .filter(|_| self.knows_bus())
                .map(|axes| {
                    let bus_to_camera = self.orientation.tables.bus_to_camera.matrix();
                    bus_to_camera * axes
                }),
            expected_m: self
                .pedr_orbit_m
                .filter(|_| config.orbit_of_pedr && self.knows_bus())
                .map_or_else(Vector3::zeros, |off_m| self.orbit_axes() * off_m),
            line_delay: Some(LineDelay::of(
                &self.oriented_camera.orientation,
                0.5 * self.oriented_camera.lines(),
                self.times.line_times.mean_period_s(),
                self.range_m(),
            )),
            oriented_camera: self.oriented_camera,
            line_period_s: self.times.line_times.mean_period_s(),
            sigmas,
            time_bias_sigma_s: config.time_bias_sigma_s,
            pass: None,
        }
    }

    /// Whether position and bus belong to the spacecraft with the laser: support data do not state whether their
    /// positions are geometric, and apparent positions differ by up to 330 m.
    const fn knows_bus(&self) -> bool {
        self.times.support.is_none()
    }

    /// Axes of the orbit in the middle of the image, Mars-fixed: radial, along the track and across it.
    fn orbit_axes(&self) -> Matrix3<f64> {
        let (pose, motion) = self.oriented_camera.orientation.pose_and_rate(0.0);
        let over_ground_m_s = motion.advance_m / self.times.line_times.mean_period_s();
        let velocity_m_s =
            over_ground_m_s + spin_rad_s(self.times.body.model()).cross(&pose.position_m);
        radial_along_cross(&pose.position_m, &velocity_m_s)
    }

    /// Position unknowns get the standard deviation of nadir or of other images; rotations get the angle that moves the
    /// ground as far: `σ/range` (Yoon & Shan 2004).
    fn published_sigmas(&self, config: &AdjustmentConfig) -> [f64; ORIENTATION_UNKNOWNS] {
        let pose = self.oriented_camera.orientation.pose(0.0);
        let look = pose.mars_to_camera.row(2).transpose();
        let [nadir_m, off_nadir_m] = config.published_sigmas_m();
        let position_m = if look.angle(&-pose.position_m) < NADIR_RAD {
            nadir_m
        } else {
            off_nadir_m
        };
        orientation_sigmas(position_m, position_m / self.range_m())
    }

    /// Distance from the camera to the ground in the middle of the image, metres; to the centre of Mars where the image
    /// sees no ground.
    fn range_m(&self) -> f64 {
        let middle = self
            .orientation
            .samples
            .get(self.orientation.samples.len() / 2);
        let ground = middle.and_then(|sample| sample.boresight);
        ground.map_or_else(
            || self.oriented_camera.orientation.pose(0.0).position_m.norm(),
            |ground| ground.range_m,
        )
    }
}

/// Images and shots for the adjustment.
///
/// A shot enters if it falls within an image's lines and within the margin of `config` beside it, or if it was fired
/// while an image was exposed; only then with its range. A shot in two windows counts once.
///
/// # Source
/// Yoon & Shan 2004: ranges only in the simultaneous image.
#[must_use]
pub fn prepare_adjustment<M: ExteriorOrientation>(
    candidates: Vec<Candidate<'_, M>>,
    footprints: &Footprints<BodyFixed>,
    profiles: &[Profile],
    surface: Option<LaserSurface>,
    laser: &Altimeter,
    config: &AdjustmentConfig,
) -> (Vec<AdjustImage<M>>, LaserShots) {
    let mut near = BTreeSet::new();
    for candidate in &candidates {
        let points = &candidate.registration.points;
        let samples = -config.footprint_margin_px
            ..=f64::from(candidate.times.samples) + config.footprint_margin_px;
        let seen = (0..points.len()).filter(|index| {
            !points.extrapolated.at(*index) && samples.contains(&points.sample.at(*index))
        });
        near.extend(seen.map(|index| points.row.at(index)));
    }
    let images = candidates.iter();
    let images: Vec<_> = images
        .map(|image| (image.times, image.orientation))
        .collect();
    let mut taken = BTreeSet::new();
    let mut shots = Vec::new();
    for (index, profile) in profiles.iter().enumerate() {
        for row in &profile.rows {
            let mut ranges = ranges_of(footprints, *row, &images).into_iter();
            let range = ranges.next();
            if (range.is_some() || near.contains(row)) && taken.insert(*row) {
                let at = *row as usize;
                shots.push(LaserShot {
                    profile: index,
                    row: *row,
                    ground: Position::new(spherical_to_xyz_m(
                        footprints.longitude_rad.at(at),
                        footprints.latitude_rad.at(at),
                        footprints.ground_radius_m(at),
                    )),
                    range,
                    also: ranges.collect(),
                });
            }
        }
    }
    let passes = match config.model {
        AdjustmentModel::MolaSurface => passes(candidates.iter().map(|of| of.times)),
        AdjustmentModel::Published => vec![None; candidates.len()],
    };
    let weighed = candidates.into_iter().zip(passes);
    let weighed = weighed.map(|(candidate, pass)| AdjustImage {
        pass,
        ..candidate.weighed(laser, config)
    });
    let count = profiles.len();
    let profiles = profiles.iter().map(|profile| profile.id.clone()).collect();
    let shots = LaserShots {
        profiles,
        profile_sigmas_m: vec![Vector3::zeros(); count],
        shots,
        surface,
    };
    (weighed.collect(), shots)
}

/// The pass of each image, by number: images of one spacecraft that follow each other within a fraction of its orbit.
fn passes<'a>(times: impl Iterator<Item = &'a ImageTimes>) -> Vec<Option<usize>> {
    let times = times.map(|times| {
        let platform = times.support.as_ref().map(|support| &*support.platform);
        let spacecraft = platform.unwrap_or(&times.instrument.spacecraft.full_name);
        (spacecraft, times.line_times.middle())
    });
    let times: Vec<(&str, Et)> = times.collect();
    let mut order: Vec<usize> = (0..times.len()).collect();
    order.sort_by(|one, other| {
        let [one, other] = [&times[*one], &times[*other]];
        let by_time = one.1.seconds().total_cmp(&other.1.seconds());
        one.0.cmp(other.0).then(by_time)
    });
    let mut passes = vec![None; times.len()];
    let mut pass = 0;
    for (at, index) in order.iter().enumerate() {
        let before = at.checked_sub(1).map(|before| times[order[before]]);
        let (spacecraft, middle) = times[*index];
        let is_next = before
            .is_some_and(|(of, before)| of == spacecraft && middle.since(before) <= SAME_PASS_S);
        pass += usize::from(!is_next);
        passes[*index] = Some(pass);
    }
    passes
}

/// The range of a shot from every image that was exposed at its instant; see [`exposed`].
fn ranges_of(
    footprints: &Footprints<BodyFixed>,
    row: u32,
    images: &[(&ImageTimes, &Orientation)],
) -> Vec<ShotRange> {
    let instant = Et::from_seconds(footprints.et_s.at(row as usize));
    let times: Vec<&ImageTimes> = images.iter().map(|(times, _)| *times).collect();
    let ranges = exposed(&times, instant).into_iter().map(|image| {
        let (times, orientation) = images[image];
        let x_lines = times.line_offset(instant);
        ShotRange {
            image,
            x_lines,
            to_laser_m: orientation.to_spacecraft_m(x_lines),
            range_m: footprints.range_m.at(row as usize),
        }
    });
    ranges.collect()
}

/// The images that were exposed at an instant, sorted by line period whatever their order in the site file: the image
/// with the shortest lines places a shot most finely.
fn exposed(images: &[&ImageTimes], instant: Et) -> Vec<usize> {
    let meanwhile = images.iter().enumerate();
    let meanwhile =
        meanwhile.filter(|(_, times)| times.has_laser() && times.exposures().contains(instant));
    let mut meanwhile: Vec<(usize, &&ImageTimes)> = meanwhile.collect();
    meanwhile.sort_by(|(_, one), (_, other)| {
        let [period_s, other_s] = [one, other].map(|times| times.line_times.mean_period_s());
        period_s
            .total_cmp(&other_s)
            .then_with(|| one.id.cmp(&other.id))
    });
    meanwhile.into_iter().map(|(image, _)| image).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tag_times::StartFrom;
    use areograph_base::{body::Body, line_times::LineTimes};
    use areograph_config::{all_instruments, usual_instrument};

    fn image(id: &str, start_s: f64, lines: u32, period_s: f64) -> ImageTimes {
        ImageTimes {
            id: id.to_owned(),
            body: Body::Mars,
            instrument: usual_instrument().clone(),
            line_times: LineTimes::even(Et::from_seconds(start_s), lines, period_s).unwrap(),
            start_from: StartFrom::Sclk,
            sclk_start: None,
            utc_start: String::new(),
            exposure_s: period_s,
            downtrack_summing: 1,
            crosstrack_summing: 1,
            lines_delivered: lines,
            samples: 512,
            first_detector: 0,
            has_stop_time: true,
            support: None,
            notes: Vec::new(),
            remarks: Vec::new(),
        }
    }

    #[test]
    fn a_shot_belongs_to_every_image_of_its_instant_and_its_range_to_the_finest() {
        let context = image("context", 0.0, 400, 0.1);
        let narrow = image("narrow", 10.0, 10_000, 1e-3);
        let twin = image("another", 10.0, 10_000, 1e-3);
        let later = image("later", 60.0, 10_000, 1e-3);
        let ids = |images: &[&ImageTimes], instant_s: f64| {
            let found = exposed(images, Et::from_seconds(instant_s)).into_iter();
            found
                .map(|image| images[image].id.clone())
                .collect::<Vec<_>>()
        };
        for images in [
            [&context, &narrow, &twin, &later],
            [&later, &twin, &narrow, &context],
        ] {
            assert_eq!(ids(&images, 15.0), ["another", "narrow", "context"]);
            assert_eq!(ids(&images, 5.0), ["context"]);
            assert!(ids(&images, 50.0).is_empty());
        }
        // An image from another spacecraft never counts.
        let mut elsewhere = image("elsewhere", 0.0, 400, 0.1);
        let mut cameras = all_instruments().iter();
        let other = cameras.find(|camera| !camera.spacecraft.has_laser());
        elsewhere.instrument = other.unwrap().clone();
        assert!(ids(&[&elsewhere], 15.0).is_empty());
    }

    #[test]
    fn images_of_one_spacecraft_within_minutes_are_of_one_pass() {
        let orbit_s = 7_056.0;
        let narrow = image("narrow", 100.0, 10_000, 1e-3);
        let context = image("context", 90.0, 400, 0.1);
        let next = image("next", 100.0 + orbit_s, 10_000, 1e-3);
        let mut elsewhere = image("elsewhere", 100.0, 400, 0.1);
        let mut cameras = all_instruments().iter();
        let other = cameras.find(|camera| !camera.spacecraft.has_laser());
        elsewhere.instrument = other.unwrap().clone();
        // Whatever their order in the site file.
        let of_images = passes([&next, &narrow, &elsewhere, &context].into_iter());
        let [next, narrow, elsewhere, context] = of_images[..] else {
            panic!("{of_images:?}");
        };
        assert_eq!(narrow, context);
        assert!(next != narrow && elsewhere != narrow && elsewhere != next);
        assert!(of_images.iter().all(Option::is_some));
    }
}
