//! The synthetic attitude: nadir pointing, held inertially while an off-nadir image is taken.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

use super::orbit::{Orbit, OrbitState};
use areograph_base::{
    instruments::Instrument,
    time::{Et, Interval},
};
use areograph_geom::{
    attitude::{self, matrix_of_rotation_vector, rotation_vector},
    body_rotation::frame_rotation_1,
};

/// Seconds between attitude samples, as in the mission's C-kernels.
pub(super) const CK_STEP_S: f64 = 4.0;
/// Seconds that an off-nadir attitude is held before and after its image.
const HOLD_MARGIN_S: f64 = 40.0;
/// Seconds of the slew from nadir to the held attitude, and back.
const SLEW_S: f64 = 240.0;

/// Matrix from bus to camera: the in-flight mounting, as in `kernels.example/moc.ti`.
pub(super) fn bus_to_camera(camera: &Instrument) -> Matrix3<f64> {
    attitude::bus_to_camera(&camera.mounting)
}

/// Matrix from J2000 to the bus that looks at the centre of Mars: +Z down, flight along −X.
pub(super) fn nadir_attitude(state: &OrbitState) -> Matrix3<f64> {
    let z = -state.position_m.normalize();
    let y = z.cross(&-state.velocity_m_s).normalize();
    let x = y.cross(&z);
    Matrix3::from_rows(&[x.transpose(), y.transpose(), z.transpose()])
}

/// Matrix from J2000 to the bus rolled out of nadir; positive angles look east of a northbound track.
pub(super) fn rolled_attitude(state: &OrbitState, roll_rad: f64) -> Matrix3<f64> {
    frame_rotation_1(roll_rad) * nadir_attitude(state)
}

/// An attitude that is held inertially around an image.
#[derive(Debug, Clone)]
pub(super) struct Hold {
    /// Time of exposure of the image.
    pub image: Interval,
    /// From J2000 to the bus.
    pub attitude: Matrix3<f64>,
}

impl Hold {
    /// 0 when pointing at nadir, 1 when held, smooth to the second derivative in between.
    fn weight(&self, et: Et) -> f64 {
        let outside_s = (self.image.start.since(et)).max(et.since(self.image.stop));
        let slewed = 1.0 - ((outside_s - HOLD_MARGIN_S) / SLEW_S).clamp(0.0, 1.0);
        slewed.powi(3) * (10.0 + slewed * (6.0 * slewed - 15.0))
    }
}

/// One attitude sample.
#[derive(Debug, Clone, Copy)]
pub(super) struct AttitudeSample {
    /// True time.
    pub et: Et,
    /// From J2000 to the bus; the quaternion's active rotation is that matrix.
    pub j2000_to_bus: UnitQuaternion<f64>,
    /// Angular velocity of the bus in J2000 components, radians per second.
    pub rate_rad_s: Vector3<f64>,
}

/// Attitude over an arc: samples every [`CK_STEP_S`], with uniform rotation in between.
///
/// A type 3 C-kernel interpolates its samples in this way, so the kernel *is* the truth, whatever the angular
/// acceleration.
#[derive(Debug, Clone)]
pub(super) struct Attitude {
    samples: Vec<AttitudeSample>,
}

impl Attitude {
    /// Attitude over `span`, with the hold of an off-nadir image if there is one.
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a span has about ten thousand samples"
    )]
    pub(super) fn new(orbit: &Orbit, hold: Option<&Hold>, span: Interval) -> Self {
        let count = (span.duration_s() / CK_STEP_S).ceil() as usize + 1;
        let at = |index: f64| span.start.plus(CK_STEP_S * index);
        let samples = (0..count)
            .map(|index| {
                let index = index as f64;
                let before = attitude_at(orbit, hold, at(index - 1.0));
                let after = attitude_at(orbit, hold, at(index + 1.0));
                AttitudeSample {
                    et: at(index),
                    j2000_to_bus: quaternion(&attitude_at(orbit, hold, at(index))),
                    rate_rad_s: rotation_vector(&(after.transpose() * before)) / (2.0 * CK_STEP_S),
                }
            })
            .collect();
        Self { samples }
    }

    /// The samples in order of time.
    pub(super) fn samples(&self) -> &[AttitudeSample] {
        &self.samples
    }

    /// Matrix from J2000 to the bus at `et`; outside the span the nearest interval is extrapolated.
    pub(super) fn j2000_to_bus(&self, et: Et) -> Matrix3<f64> {
        let after = self
            .samples
            .partition_point(|sample| sample.et <= et)
            .clamp(1, self.samples.len() - 1);
        let (from, to) = (&self.samples[after - 1], &self.samples[after]);
        let share = et.since(from.et) / to.et.since(from.et);
        let step = (to.j2000_to_bus * from.j2000_to_bus.inverse()).scaled_axis();
        (UnitQuaternion::from_scaled_axis(step * share) * from.j2000_to_bus)
            .to_rotation_matrix()
            .into_inner()
    }
}

/// The sampled attitude.
fn attitude_at(orbit: &Orbit, hold: Option<&Hold>, et: Et) -> Matrix3<f64> {
    let nadir = nadir_attitude(&orbit.state(et));
    let Some(hold) = hold else { return nadir };
    let weight = hold.weight(et);
    if weight <= 0.0 {
        return nadir;
    }
    let nadir_to_held = rotation_vector(&(hold.attitude * nadir.transpose()));
    matrix_of_rotation_vector(&(weight * nadir_to_held)) * nadir
}

fn quaternion(matrix: &Matrix3<f64>) -> UnitQuaternion<f64> {
    UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(*matrix))
}

#[cfg(test)]
mod tests {
    use super::*;
    use areograph_base::units::RADIANS_PER_DEGREE;
    use areograph_config::usual_instrument;

    fn orbit() -> Orbit {
        Orbit::new(Et::from_seconds(3.7e7), 1.0, 1.3)
    }

    fn span() -> Interval {
        Interval::new(
            Et::from_seconds(3.7e7 - 600.0),
            Et::from_seconds(3.7e7 + 600.0),
        )
    }

    #[test]
    fn the_mounting_is_the_published_matrix() {
        let published = Matrix3::new(
            0.999_994_283_9,
            0.003_139_080_4,
            0.001_256_281_1, //
            -0.003_141_585_0,
            0.999_993_071_7,
            0.001_996_732_7, //
            -0.001_250_004_5,
            -0.002_000_668_0,
            0.999_997_217_4,
        );
        assert!((bus_to_camera(usual_instrument()) - published).abs().max() < 1e-10); // ten published digits
    }

    #[test]
    fn nadir_pointing_flies_along_minus_x_and_turns_a_twentieth_of_a_degree_a_second() {
        let attitude = Attitude::new(&orbit(), None, span());
        let et = Et::from_seconds(3.7e7 + 12.0); // a sample
        let state = orbit().state(et);
        let bus = attitude.j2000_to_bus(et);
        let nadir = bus * -state.position_m.normalize();
        assert!((nadir - Vector3::z()).norm() < 1e-14);
        let flight = bus * state.velocity_m_s.normalize();
        assert!(flight.x < -0.9999 && flight.y.abs() < 1e-14);
        let rate_deg_s = attitude.samples()[10].rate_rad_s.norm() / RADIANS_PER_DEGREE;
        assert!((rate_deg_s - 0.0509).abs() < 0.001, "{rate_deg_s}"); // 360 deg in 1.96 h, e = 0.008
        // The rate points along the orbit's normal.
        let normal = state.position_m.cross(&state.velocity_m_s).normalize();
        assert!(attitude.samples()[10].rate_rad_s.normalize().dot(&normal) > 1.0 - 1e-6);
    }

    #[test]
    fn an_off_nadir_image_is_held_and_the_slew_is_smooth() {
        let middle = Et::from_seconds(3.7e7);
        let hold = Hold {
            image: Interval::new(middle.plus(-6.0), middle.plus(6.0)),
            attitude: rolled_attitude(&orbit().state(middle), 0.3),
        };
        let attitude = Attitude::new(&orbit(), Some(&hold), span());
        for seconds in [-40.0, -6.0, 0.0, 6.0, 40.0] {
            let held = attitude.j2000_to_bus(middle.plus(seconds));
            assert!((held - hold.attitude).abs().max() < 1e-14, "{seconds}");
        }
        let early = attitude.j2000_to_bus(middle.plus(-500.0));
        let nadir = nadir_attitude(&orbit().state(middle.plus(-500.0)));
        assert!((early - nadir).abs().max() < 1e-7); // uniform rotation between samples
        let fastest_deg_s = attitude
            .samples()
            .iter()
            .map(|sample| sample.rate_rad_s.norm() / RADIANS_PER_DEGREE)
            .fold(0.0, f64::max);
        assert!(fastest_deg_s < 0.35, "{fastest_deg_s}"); // within the capability of MGS
    }
}
