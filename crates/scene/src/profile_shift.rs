//! Recorded position of the profile of a day in a PEDR file.

use nalgebra::{Matrix3, Rotation3, Vector3};
use serde::Serialize;

use super::{
    arc::Arc,
    error_sources::{AltimeterErrors, MISPLACED_M},
    plan::{Look, Site},
    random::Random,
    terrain::REFERENCE_RADIUS_M,
};
use areograph_base::body::MARS_IAU2000;
use areograph_geom::body_rotation::body_matrix;

/// Offset of a profile in the PEDR file from its true position.
#[derive(Debug, Clone, Serialize)]
pub(super) struct ProfileShift {
    /// Towards the east, the north and up, metres.
    pub east_north_radial_m: [f64; 3],
    /// Whether the profile lies elsewhere.
    pub is_misplaced: bool,
    /// The first two as a rotation of Mars.
    #[serde(skip)]
    rotation: Matrix3<f64>,
}

impl ProfileShift {
    /// No shift.
    pub(super) fn none() -> Self {
        Self {
            east_north_radial_m: [0.0; 3],
            is_misplaced: false,
            rotation: Matrix3::identity(),
        }
    }

    /// The shift of a profile near `site`, a direction.
    pub(super) fn near(site: &Vector3<f64>, east_north_radial_m: [f64; 3]) -> Self {
        let [east_m, north_m, _] = east_north_radial_m;
        let east = Vector3::z().cross(site).normalize();
        let north = site.cross(&east);
        let moved = east_m * east + north_m * north;
        let turn_rad = site.cross(&moved) / REFERENCE_RADIUS_M;
        Self {
            east_north_radial_m,
            is_misplaced: false,
            rotation: Rotation3::new(turn_rad).into_inner(),
        }
    }

    /// Draws the shift of the profile of a day.
    ///
    /// * `turn_rad` – attitude error in the middle of the image, about the axes of the bus
    pub(super) fn draw(
        sizes: &AltimeterErrors,
        arc: &Arc,
        turn_rad: Vector3<f64>,
        seed: u64,
    ) -> Self {
        let site = arc.image.site.direction();
        let beam = MiddleBeam::of(arc, &site);
        let [at_nadir, off_nadir] = sizes.attitude_share_max;
        let share_max = match arc.image.look {
            Look::Nadir => at_nadir,
            Look::Roll { .. } => off_nadir,
        };
        let moved = Moved {
            by_attitude_m: beam.moved_m(turn_rad),
            outward: beam.outward,
            share_max,
        };
        let mut random = Random::new(seed, &format!("profile {}", arc.image.id));
        Self::drawn(sizes, &site, &moved, &mut random)
    }

    /// Draws the shift of a pass at nadir over `site`.
    ///
    /// * `aside_m` – displacement of the end of the beam by the attitude error, IAU 2000
    pub(super) fn of_pass(
        sizes: &AltimeterErrors,
        site: &Site,
        aside_m: &Vector3<f64>,
        random: &mut Random,
    ) -> Self {
        let moved = Moved {
            by_attitude_m: *aside_m,
            outward: Vector3::zeros(),
            share_max: sizes.attitude_share_max[0],
        };
        Self::drawn(sizes, &site.direction(), &moved, random)
    }

    fn drawn(
        sizes: &AltimeterErrors,
        site: &Vector3<f64>,
        moved: &Moved,
        random: &mut Random,
    ) -> Self {
        let [mut east_m, mut north_m] = [0, 1].map(|_| sizes.plan_sigma_m * random.normal());
        let mut radial_m = sizes.radial_sigma_m * random.normal();
        let is_misplaced = random.between(0.0, 1.0) < sizes.misplaced_chance;
        if is_misplaced {
            let [least_m, most_m] = MISPLACED_M;
            let away_m = random.between(least_m, most_m);
            let (sin, cos) = random.between(0.0, std::f64::consts::TAU).sin_cos();
            (east_m, north_m) = (east_m + away_m * sin, north_m + away_m * cos);
        }
        let east = Vector3::z().cross(site).normalize();
        let north = site.cross(&east);
        // The files' coordinates lie where the attitude of the kernels has the beam.
        let moved_m = -random.between(0.0, moved.share_max) * moved.by_attitude_m;
        east_m += moved_m.dot(&east);
        north_m += moved_m.dot(&north);
        radial_m += moved.outward.dot(&(east_m * east + north_m * north));
        Self {
            is_misplaced,
            ..Self::near(site, [east_m, north_m, radial_m])
        }
    }

    /// Radial part, metres.
    pub(super) const fn radial_m(&self) -> f64 {
        self.east_north_radial_m[2]
    }

    /// The rotation from true directions to directions of the file, both IAU 2000.
    pub(super) const fn rotation(&self) -> &Matrix3<f64> {
        &self.rotation
    }

    /// Position of a point in the file, IAU 2000, metres.
    pub(super) fn applied(&self, ground_m: &Vector3<f64>) -> Vector3<f64> {
        let radius_m = ground_m.norm();
        self.rotation * ground_m * ((radius_m + self.radial_m()) / radius_m)
    }
}

/// Errors of a beam that coordinates of files contain in part.
struct Moved {
    /// Displacement of its end by the attitude error, IAU 2000, metres.
    by_attitude_m: Vector3<f64>,
    /// Horizontal part of its direction over the vertical one, IAU 2000.
    outward: Vector3<f64>,
    /// Largest share of the displacement that coordinates contain.
    share_max: f64,
}

/// The beam in the middle of an image, according to the kernels.
struct MiddleBeam {
    /// From the bus to IAU 2000.
    bus_to_mars: Matrix3<f64>,
    range_m: f64,
    up: Vector3<f64>,
    /// Horizontal part of its direction over the vertical one: the tangent of the angle off nadir, IAU 2000.
    outward: Vector3<f64>,
}

impl MiddleBeam {
    fn of(arc: &Arc, up: &Vector3<f64>) -> Self {
        let middle = arc.exposed.start.plus(0.5 * arc.exposed.duration_s());
        let mars = body_matrix(&MARS_IAU2000, middle);
        let bus_to_mars = mars * arc.attitude.j2000_to_bus(middle).transpose();
        let beam = bus_to_mars * Vector3::z();
        let down = -beam.dot(up);
        let height_m = arc.orbit.state(middle).position_m.norm() - REFERENCE_RADIUS_M;
        Self {
            bus_to_mars,
            range_m: height_m / down,
            up: *up,
            outward: (beam + down * up) / down,
        }
    }

    /// Displacement of the end of the beam on the ground by a rotation of the bus, radians about its axes; metres.
    fn moved_m(&self, turn_rad: Vector3<f64>) -> Vector3<f64> {
        // The true matrix to the bus is exp([e]×) times the kernels' matrix.
        let by_turn = self.bus_to_mars * (Vector3::z().cross(&turn_rad)) * self.range_m;
        let along = self.bus_to_mars * Vector3::z();
        // Along the beam down to level ground.
        by_turn + along * (by_turn.dot(&self.up) / -along.dot(&self.up))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        drawn::{AttitudeError, DayErrors, Flown},
        error_sources::{Roughness, SceneErrors},
        plan::{IMAGES, PlannedImage},
    };
    use areograph_base::time::Et;

    fn arc(image: &'static PlannedImage) -> Arc<'static> {
        Arc::new(image, Et::from_seconds(3.9e7), 600.0).unwrap()
    }

    /// A file computed from the attitude of the kernels alone has its shots where the beam of the kernels ends, and off nadir
    /// as much too high as that beam is turned outwards.
    #[test]
    fn files_lie_where_their_attitude_has_the_beam() {
        let errors = SceneErrors {
            altimeter: AltimeterErrors {
                plan_sigma_m: 0.0,
                radial_sigma_m: 0.0,
                boresight_sigma_rad: 0.0,
                boresight_rad: None,
                attitude_share_max: [1.0; 2],
                ..SceneErrors::realistic(Roughness::Plains).altimeter
            },
            ..SceneErrors::realistic(Roughness::Plains)
        };
        for (seed, image) in [(5, &IMAGES[0]), (6, &IMAGES[1]), (7, &IMAGES[3])] {
            let arc = arc(image);
            let drawn = DayErrors::draw(&errors, &arc, seed);
            let middle = arc.exposed.start.plus(0.5 * arc.exposed.duration_s());
            let mars = body_matrix(&MARS_IAU2000, middle);
            let by_kernels = mars * arc.attitude.j2000_to_bus(middle).tr_mul(&Vector3::z());
            let range_m = MiddleBeam::of(&arc, &image.site.direction()).range_m;
            let shift = drawn.profile_shift.clone();
            let flown = Flown { arc, errors: drawn };
            let beam = mars
                * flown
                    .turned_by(AttitudeError::steady_at, middle)
                    .tr_mul(&Vector3::z());
            let off_m = range_m * (by_kernels - beam);
            let up = image.site.direction();
            let east = Vector3::z().cross(&up).normalize();
            let north = up.cross(&east);
            let drawn_m = Vector3::from(shift.east_north_radial_m);
            let full_m = Vector3::new(off_m.dot(&east), off_m.dot(&north), off_m.dot(&up));
            // Horizontal and vertical parts belong together; the share is drawn, and level ground lies along the beam, up to a
            // fifth farther at 22 degrees.
            let share = drawn_m.xy().norm() / full_m.xy().norm();
            assert!((0.05..1.25).contains(&share), "{}: {share}", image.id);
            let apart_m = (drawn_m - share * full_m).norm();
            assert!(
                apart_m < 0.25 * drawn_m.norm(),
                "{}: {drawn_m} {full_m}",
                image.id
            );
        }
    }

    #[test]
    fn a_profile_moves_east_north_and_up() {
        let site = IMAGES[0].site.direction();
        let shift = ProfileShift::near(&site, [70.0, -30.0, 2.0]);
        let east = Vector3::z().cross(&site).normalize();
        let north = site.cross(&east);
        // At the site, and 30 km to the north of it.
        for away_rad in [0.0, 0.009_f64] {
            let up = away_rad.cos() * site + away_rad.sin() * north;
            let moved_m = shift.applied(&(REFERENCE_RADIUS_M * up)) - REFERENCE_RADIUS_M * up;
            assert!((moved_m.dot(&east) - 70.0).abs() < 0.1, "{moved_m}"); // meridians converge by 0.1 %
            assert!(
                (moved_m.dot(&up.cross(&east)) + 30.0).abs() < 0.1,
                "{moved_m}"
            );
            assert!((moved_m.dot(&up) - 2.0).abs() < 0.01, "{moved_m}"); // the plane of the shift: 1 mm
        }
    }
}
