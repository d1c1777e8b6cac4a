//! Pointing of a laser on the bus of the cameras in simultaneous images.

use std::collections::BTreeMap;

use nalgebra::{Matrix3, Vector2, Vector3};

use super::{
    boresight::{BoresightSummary, SpotsOfImage},
    boresight_prior::prior_of,
    error::AdjustError,
    input::{AdjustImage, LaserShot, LaserShots, ShotRange},
    network::{Assembled, projector},
    relief::ProfileOffset,
    words::unknown_in_words,
};
use areograph_config::AdjustmentConfig;
use areograph_geom::{
    boresight::{BoresightAngles, BoresightInformation},
    bundle::{
        AdjustedBus, Adjustment, CommonBus, Estimate, RecordedProfile, Residual, SharedRotation,
        Spot, Unknown, View,
    },
    ellipsoid::local_axes,
    pushbroom::{ExteriorOrientation, Projector},
    statistics::Summary,
    surface::with_across_track,
};

/// Standard deviation of a single spot in its image beyond the errors that all spots share, focal-plane pixels: jitter
/// and interpolation of attitudes. The recorded footprint has a separate error.
const SPOT_SIGMA_PX: f64 = 0.5;
/// Share of the attitude error of the bus that coordinates of PEDR files contain, and its standard deviation: they are computed
/// from telemetry of the same attitude, and crossovers remove an unknown part of its error. A roll of 0.4 mrad is 160 m on the
/// ground, and coordinates of files have 100 m (Neumann et al. 2001), so that the share is below 0.6 at nadir. The values are a
/// choice; missions with shares up to 0.4 at nadir and 1 off nadir test them (`tests/truth/truth/stated.rs`).
const ATTITUDE_IN_FILES: [f64; 2] = [0.25, 0.25];
/// Index of the constant rotation about the camera's x axis, which moves an image across its track.
const ROLL: usize = 9;

/// Adds the spots of all shots with a range to the network, or returns the reason if none exist.
pub(super) fn add_spots<M: ExteriorOrientation>(
    assembled: &mut Assembled<&M>,
    images: &[AdjustImage<M>],
    shots: &LaserShots,
    config: &AdjustmentConfig,
) -> Result<Result<(), String>, AdjustError> {
    if images.iter().any(|image| image.laser_axes.is_none()) {
        return Ok(Err(
            "the altimeter file does not state the beam direction (beam.bus)".to_owned(),
        ));
    }
    let profile_of: BTreeMap<usize, usize> = assembled
        .profiles
        .iter()
        .enumerate()
        .map(|(place, profile)| (profile.index, place))
        .collect();
    let projectors = images
        .iter()
        .map(|image| projector(image, &image.oriented_camera.orientation));
    let projectors = projectors.collect::<Result<Vec<_>, _>>()?;
    let (mut spots, mut recorded) = (Vec::new(), Vec::new());
    let mut middles_m = vec![Vector3::zeros(); assembled.profiles.len()];
    for (point, shot) in shots.shots.iter().enumerate() {
        let Some(profile) = profile_of.get(&shot.profile) else {
            continue;
        };
        recorded.push((point, *profile));
        middles_m[*profile] += shot.ground.xyz_m;
        let ranges = shot.range.iter().chain(&shot.also);
        spots.extend(ranges.filter_map(|range| {
            let projector = &projectors[range.image];
            spot_of(&images[range.image], projector, point, range)
        }));
    }
    if spots.is_empty() {
        return Ok(Err(
            "no image was exposed during a profile, so the laser mounting gives no observations"
                .to_owned(),
        ));
    }
    let profiles = assembled.profiles.iter().zip(&middles_m);
    let profiles = profiles.map(|(profile, middle_m)| {
        let axes = local_axes(middle_m);
        let shared = shared_rotation(images, shots, profile.index, &axes);
        RecordedProfile {
            surface_profile: profile.index,
            axes,
            sigma_m: shift_sigmas_m(images, shots, profile.index, shared.as_ref()),
            shared,
        }
    });
    let boresight = prior_of(images, shots, &spots, config)?;
    assembled.network.common_bus = Some(CommonBus {
        boresight: boresight.angles,
        line_time_sigma_s: config.boresight_line_time_sigma_s.unwrap_or(f64::INFINITY),
        profiles: profiles.collect(),
        recorded,
        spots,
    });
    assembled.boresight = Some(boresight);
    Ok(Ok(()))
}

/// Standard deviations of the shift of a recorded profile in east, north and height, metres, about the part that follows the
/// rotation of its image (`shared`). Where none does, the attitude error that the profile shares is independent.
fn shift_sigmas_m<M>(
    images: &[AdjustImage<M>],
    shots: &LaserShots,
    profile: usize,
    shared: Option<&SharedRotation>,
) -> Vector3<f64> {
    let own_m = shots.profile_sigmas_m[profile];
    let of_profile = shots.shots.iter().filter(|shot| shot.profile == profile);
    let simultaneous: Vec<(&LaserShot, &ShotRange)> = of_profile
        .filter_map(|shot| Some((shot, shot.range.as_ref()?)))
        .collect();
    let (Some((first, _)), Some((last, _))) = (simultaneous.first(), simultaneous.last()) else {
        return own_m;
    };
    // Across the track alone: along it the standard deviations of rotations contain line times, which files do not share.
    let of_attitude_m = simultaneous
        .iter()
        .map(|(_, range)| range.range_m * images[range.image].sigmas[ROLL])
        .filter(|shift_m| shift_m.is_finite())
        .fold(0.0, f64::max);
    let ends_m = [&first.ground.xyz_m, &last.ground.xyz_m];
    let [share, sigma] = ATTITUDE_IN_FILES;
    let share = if shared.is_some() {
        sigma
    } else {
        share.hypot(sigma)
    };
    with_across_track(own_m, ends_m, share * of_attitude_m)
}

/// The part of a constant roll of its image by which a profile is recorded aside, along `axes`: a rotated bus meets ground farther
/// along the y axis of the camera, where the telemetry places the shot without the correction. `None` where several images were
/// exposed during the profile, whose rotations it could follow.
fn shared_rotation<M: ExteriorOrientation>(
    images: &[AdjustImage<M>],
    shots: &LaserShots,
    profile: usize,
    axes: &Matrix3<f64>,
) -> Option<SharedRotation> {
    let of_profile = shots.shots.iter().filter(|shot| shot.profile == profile);
    let mut ranges = of_profile.flat_map(|shot| shot.range.iter().chain(&shot.also));
    let range = ranges.next()?;
    let image = &images[range.image];
    if !image.sigmas[ROLL].is_finite() || ranges.any(|other| other.image != range.image) {
        return None;
    }
    let pose = image.oriented_camera.orientation.pose(range.x_lines);
    let beam = image.laser_axes?.column(2).into_owned();
    let by_roll_m = pose.mars_to_camera.tr_mul(&beam.cross(&Vector3::x())) * range.range_m;
    Some(SharedRotation {
        image: range.image,
        by_rotation_m: axes * by_roll_m * -ATTITUDE_IN_FILES[0],
    })
}

/// The spot of a shot in an image; `None` where it falls outside the image, as it may near an end.
fn spot_of<M: ExteriorOrientation>(
    image: &AdjustImage<M>,
    projector: &Projector<'_, M>,
    point: usize,
    range: &ShotRange,
) -> Option<Spot> {
    let (ground_m, by_boresight_m) = met(image, range)?;
    let seen = projector.project(&ground_m).ok()?;
    let focal_px = image
        .oriented_camera
        .detector
        .focal_px(&seen.camera_m)
        .ok()?;
    (seen.x.abs() <= 0.5 * image.oriented_camera.lines()).then(|| Spot {
        view: View {
            point,
            image: range.image,
            x_lines: seen.x,
            y_px: focal_px.y,
            sigma_px: Vector2::repeat(SPOT_SIGMA_PX),
        },
        by_boresight_m,
    })
}

/// Ground position of the laser beam by the initial orientation of `image`, and its change with the boresight angles.
fn met<M: ExteriorOrientation>(
    image: &AdjustImage<M>,
    range: &ShotRange,
) -> Option<(Vector3<f64>, [Vector3<f64>; 2])> {
    let axes = image.laser_axes?;
    let pose = image.oriented_camera.orientation.pose(range.x_lines);
    let on_mars_m = pose.mars_to_camera.tr_mul(&axes) * range.range_m;
    let laser_m = pose.position_m + range.to_laser_m;
    let [first_m, second_m, beam_m] = [0, 1, 2].map(|axis| on_mars_m.column(axis).into_owned());
    Some((laser_m + beam_m, [first_m, second_m]))
}

/// Adjusted unknowns of laser and profiles.
pub(super) fn summarise<M: ExteriorOrientation>(
    images: &[AdjustImage<M>],
    assembled: &Assembled<&M>,
    adjustment: &Adjustment,
    variance_factor: f64,
) -> Option<BoresightSummary> {
    let bus = adjustment.common_bus.as_ref()?;
    let root = variance_factor.sqrt();
    let of_image = |(index, image): (usize, &AdjustImage<M>)| {
        let off = footprints_off(image, index, assembled);
        let of_axis = |axis: usize| -> Vec<f64> { off.iter().map(|pair| pair[axis]).collect() };
        SpotsOfImage {
            image: image.oriented_camera.id.clone(),
            spots: off.len(),
            line_time_s: bus.line_times_s[index]
                .map(|found| (found.value, found.root_cofactor * root)),
            footprints_off: [0, 1].map(|axis| Summary::of(&of_axis(axis))),
            beam: image.beam().map_or([0.0; 3], Into::into),
        }
    };
    let all = images.iter().enumerate().map(of_image);
    let (with, without): (Vec<_>, Vec<_>) = all.partition(|of| of.spots > 0);
    let profiles = assembled.profiles.iter().zip(&bus.profile_shifts_m);
    let angles_rad = bus.boresight_rad.map(|found| found.value);
    let prior = assembled.boresight.as_ref()?;
    let adjusted = BoresightAngles {
        angles_rad: angles_rad.into(),
        covariance_rad2: bus.boresight_cofactors * variance_factor,
    };
    Some(BoresightSummary {
        angles_rad,
        sigma_rad: adjusted.sigmas_rad(),
        covariance_rad2: adjusted.covariance_rad2,
        prior: prior.clone(),
        information: BoresightInformation::of(&adjusted, &prior.angles, variance_factor),
        images: with,
        profile_shifts: profiles
            .map(|(profile, shift)| ProfileOffset {
                profile: profile.name.clone(),
                shift_m: shift.map(|found| found.value),
                sigma_m: shift.map(|found| found.root_cofactor * root),
            })
            .collect(),
        without: without.into_iter().map(|image| image.image).collect(),
        farthest: farthest(images, assembled, bus),
    })
}

/// Footprints of an image's spots in its initial orientation, minus the spots.
fn footprints_off<M: ExteriorOrientation>(
    image: &AdjustImage<M>,
    index: usize,
    assembled: &Assembled<&M>,
) -> Vec<[f64; 2]> {
    let Ok(projector) = projector(image, &image.oriented_camera.orientation) else {
        return Vec::new();
    };
    let spots = assembled.network.common_bus.iter();
    let spots = spots.flat_map(|bus| &bus.spots).map(|spot| &spot.view);
    let off = spots.filter(|view| view.image == index).filter_map(|view| {
        let recorded_m = &assembled.network.points[view.point].ground_m;
        let seen = projector.project(recorded_m).ok()?;
        let focal_px = image
            .oriented_camera
            .detector
            .focal_px(&seen.camera_m)
            .ok()?;
        Some([seen.x - view.x_lines, focal_px.y - view.y_px])
    });
    off.collect()
}

/// The unknown that is farthest from its a priori value.
///
/// The standardised residual of an a priori value measures the contradiction: all unknowns that contradict each other
/// in one direction show the same value.
fn farthest<M>(
    images: &[AdjustImage<M>],
    assembled: &Assembled<&M>,
    bus: &AdjustedBus,
) -> Option<(String, f64)> {
    let standardised = |found: &Estimate| found.prior.as_ref().and_then(Residual::standardised);
    let angles = bus.boresight_rad.iter().enumerate();
    let angles = angles.map(|(axis, found)| (Unknown::Boresight { axis }, standardised(found)));
    let shifts = bus.profile_shifts_m.iter().enumerate();
    let shifts = shifts.flat_map(|(profile, shift)| {
        let axes = shift.iter().enumerate();
        axes.map(move |(axis, found)| {
            (Unknown::ProfileShift { profile, axis }, standardised(found))
        })
    });
    // A free unknown contradicts nothing, but the delay of lines is bounded.
    let late = |found: &Estimate| match found.prior {
        None => Some(found.value / found.root_cofactor.hypot(assembled.plausible_delay_s)),
        Some(_) => standardised(found),
    };
    let times = bus.line_times_s.iter().enumerate();
    let times = times
        .filter_map(|(image, found)| Some((Unknown::LineTime { image }, late(found.as_ref()?))));
    let all = angles.chain(shifts).chain(times);
    let tested = all.filter_map(|(unknown, standardised)| Some((unknown, standardised?.abs())));
    let farthest = tested.max_by(|one, other| one.1.total_cmp(&other.1));
    farthest.map(|(unknown, sigmas)| {
        let words = unknown_in_words(unknown, images, &assembled.profiles);
        let words = words.trim_start_matches("the ").to_owned();
        (words, sigmas)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        adjust::{input::LaserShot, orientation_sigmas},
        invented_pair::{HEIGHT_M, Invented},
    };
    use areograph_base::frames::Position;
    use areograph_geom::{
        oriented_camera::OrientedCamera,
        pushbroom::{CorrectedOrientation, OrientationCorrection, SampledOrientation},
    };

    type Rotated = AdjustImage<CorrectedOrientation<SampledOrientation>>;

    const ROLL_RAD: f64 = 1e-5;

    /// A camera whose bus is rotated about the camera's x axis, with a laser on its optical axis.
    fn image(number: usize, roll_rad: f64) -> Rotated {
        let camera = Invented::camera(number, [0.0; 2]);
        let mut correction = OrientationCorrection::of(&[0.0; 18], 0.5 * camera.lines(), 0.0);
        correction.rotation_rad[0].x = roll_rad;
        let base = camera.orientation;
        AdjustImage {
            oriented_camera: OrientedCamera {
                id: camera.id,
                orientation: CorrectedOrientation { base, correction },
                detector: camera.detector,
                line_times: camera.line_times,
            },
            line_period_s: 1.4e-3,
            sigmas: orientation_sigmas(25.0, 4e-4),
            time_bias_sigma_s: 0.0,
            expected_m: Vector3::zeros(),
            turn_rad_s: Vector3::zeros(),
            line_delay: None,
            pass: None,
            laser_axes: Some(Matrix3::identity()),
        }
    }

    /// Two shots of a profile, fired while these images were exposed.
    fn shots(images: &[Rotated], exposed: &[usize]) -> LaserShots {
        let shot = |row: u32| {
            let mut ranges = exposed.iter().map(|image| ShotRange {
                image: *image,
                x_lines: 100.0 * f64::from(row),
                to_laser_m: Vector3::zeros(),
                range_m: HEIGHT_M,
            });
            let range = ranges.next();
            let (ground_m, _) = met(&images[0], range.as_ref().unwrap()).unwrap();
            LaserShot {
                profile: 0,
                row,
                ground: Position::new(ground_m),
                range,
                also: ranges.collect(),
            }
        };
        LaserShots {
            profiles: vec!["a/1".to_owned()],
            profile_sigmas_m: vec![Vector3::repeat(10.0)],
            shots: vec![shot(0), shot(1)],
            surface: None,
        }
    }

    #[test]
    fn a_profile_is_recorded_where_a_bus_without_the_correction_would_point() {
        let images = [image(0, 0.0)];
        let shots = shots(&images, &[0]);
        let range = shots.shots[0].range.as_ref().unwrap();
        let ground_m = |image: &Rotated| met(image, range).unwrap().0;
        // Towards the true place, the ground moves with the correction; the recorded place lacks a share of this.
        let moved_m = ground_m(&image(0, ROLL_RAD)) - ground_m(&images[0]);
        let axes = local_axes(&ground_m(&images[0]));
        let shared = shared_rotation(&images, &shots, 0, &axes).unwrap();
        let expected_m = axes * moved_m * -ATTITUDE_IN_FILES[0];
        let off_m = (shared.by_rotation_m * ROLL_RAD - expected_m).norm();
        assert!(expected_m.norm() > 0.9, "{expected_m}");
        // The second order of the rotation: 380 km times half of its square.
        assert!(off_m < 1e-4, "{} {expected_m}", shared.by_rotation_m);
    }

    #[test]
    fn a_profile_that_could_follow_two_images_follows_neither_and_is_less_certain() {
        let images = [image(0, 0.0), image(1, 0.0)];
        let east_m = |exposed: &[usize]| {
            let shots = shots(&images, exposed);
            let axes = local_axes(&shots.shots[0].ground.xyz_m);
            let shared = shared_rotation(&images, &shots, 0, &axes);
            let sigmas_m = shift_sigmas_m(&images, &shots, 0, shared.as_ref());
            (shared.is_some(), sigmas_m.x)
        };
        // 0.4 mrad from 380 km, and 10 m of its own.
        let of_share_m = |share: f64| f64::hypot(10.0, share * 4e-4 * HEIGHT_M);
        let [share, sigma] = ATTITUDE_IN_FILES;
        for (exposed, expected) in [
            (&[0][..], (true, of_share_m(sigma))),
            (&[0, 1], (false, of_share_m(share.hypot(sigma)))),
        ] {
            let (follows, sigma_m) = east_m(exposed);
            assert_eq!(follows, expected.0, "{exposed:?}");
            // A centimetre: the track is not exactly north.
            assert!(
                (sigma_m - expected.1).abs() < 0.01,
                "{sigma_m} {expected:?}"
            );
        }
    }
}
