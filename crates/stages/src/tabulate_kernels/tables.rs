//! States and attitudes of an adjusted image.

use nalgebra::{Matrix3, Vector3};

use super::{KernelReading, KernelTables, TabulateError, earlier, later};
use crate::{
    orientation::{Orientation, OrientationSample},
    tag_times::ImageTimes,
};
use areograph_base::{
    body::Body,
    error::Result,
    frames::{J2000, Position},
    time::{Et, Interval, PointingBias},
};
use areograph_geom::{
    attitude::continuous_quaternions,
    body_rotation::body_rotation,
    lagrange::lagrange,
    pushbroom::{ExteriorOrientation, Pose, SampledOrientation},
};
use areograph_spice::{Attitude, Session, State};

/// Longest time between two states around the image, seconds: degree 3 leaves nanometres of the orbit.
const STATE_STEP_S: f64 = 0.5;
/// Longest time between two attitudes beyond the camera tables, seconds.
const ATTITUDE_STEP_S: f64 = 0.5;
/// Attitudes nearer than this to one of a sample are left out, seconds.
const SAME_INSTANT_S: f64 = 1e-4;
/// Half the time over which the rotation of Mars is differentiated, seconds.
const HALF_DIFFERENCE_S: f64 = 0.5;

/// One image, and the original kernels.
pub(super) struct Source<'a> {
    pub(super) session: &'a Session,
    pub(super) times: &'a ImageTimes,
    /// Adjusted orientation.
    pub(super) orientation: &'a Orientation,
    /// How the readers of the new kernels compute cameras.
    pub(super) reading: KernelReading,
    pub(super) tolerance_s: f64,
    /// The bias of the run, at which the original kernels are read.
    pub(super) bias: PointingBias,
    /// The time that the CK covers.
    pub(super) attitude_span: Interval,
    /// The time that the SPK covers.
    pub(super) orbit_span: Interval,
}

/// Attitude of the bus at an exposure: from J2000, and its angular velocity in J2000.
#[derive(Clone, Copy)]
struct Node {
    exposure: Et,
    to_bus: Matrix3<f64>,
    rate_rad_s: Vector3<f64>,
}

impl Source<'_> {
    pub(super) fn tables(&self) -> Result<KernelTables> {
        let nodes = self.nodes()?;
        let ticks = nodes.iter().map(|node| {
            let lookup = self.reading.bias.lookup(node.exposure);
            self.session.et_to_ticks(lookup.kernel_time())
        });
        let flown = self.flown()?;
        let epochs = self.epochs_of_states(&flown)?;
        Ok(KernelTables {
            ticks: ticks.collect::<Result<_>>()?,
            quaternions: continuous_quaternions(nodes.iter().map(|node| &node.to_bus)),
            rates_rad_s: nodes.iter().map(|node| node.rate_rad_s.into()).collect(),
            states: self.states(&epochs, &flown)?,
            epochs,
        })
    }

    /// Instant and position of the spacecraft for each sample.
    fn flown(&self) -> Result<Vec<(Et, Position<J2000>)>> {
        let samples = self.orientation.samples.iter();
        let flown = samples.map(|sample| sample.flown(self.session, self.reading.light_time));
        flown.collect()
    }

    /// Corrections of geometric positions by the adjustment in IAU 2000, metres, over ET.
    fn difference(&self, flown: &[(Et, Position<J2000>)]) -> Result<SampledOrientation> {
        let mut samples = Vec::new();
        for (et, position) in flown {
            let original = self.session.state(*et)?.position;
            let to_mars = body_rotation(Body::Mars, *et);
            let pose = Pose {
                position_m: to_mars.matrix() * (position.xyz_m - original.xyz_m),
                mars_to_camera: Matrix3::identity(),
            };
            samples.push((et.seconds(), pose));
        }
        let difference = SampledOrientation::new(&samples);
        let refused = |source| TabulateError::Samples {
            image: self.times.id.clone(),
            source,
        };
        Ok(difference.map_err(refused)?)
    }

    fn states(&self, epochs: &[Et], flown: &[(Et, Position<J2000>)]) -> Result<Vec<State>> {
        let difference = self.difference(flown)?;
        let mut states = Vec::new();
        for et in epochs {
            let original = self.session.state(*et)?;
            let (pose, motion) = difference.pose_and_rate(et.seconds());
            let from_mars = |et: Et| body_rotation(Body::Mars, et).matrix().transpose();
            let [before, after] =
                [-HALF_DIFFERENCE_S, HALF_DIFFERENCE_S].map(|s| from_mars(et.plus(s)));
            let turning_per_s = (after - before) / (2.0 * HALF_DIFFERENCE_S);
            states.push(State {
                position: Position::new(original.position.xyz_m + from_mars(*et) * pose.position_m),
                velocity_m_s: original.velocity_m_s
                    + from_mars(*et) * motion.advance_m
                    + turning_per_s * pose.position_m,
            });
        }
        Ok(states)
    }

    /// The epochs of the samples, between which the difference is one cubic, and steps around them.
    fn epochs_of_states(&self, flown: &[(Et, Position<J2000>)]) -> Result<Vec<Et>> {
        let known = self.known_orbit()?;
        let mut epochs: Vec<Et> = flown.iter().map(|(et, _)| *et).collect();
        if let (Some(first), Some(last)) = (epochs.first().copied(), epochs.last().copied()) {
            epochs.extend(steps_beyond(first, known.start, STATE_STEP_S));
            epochs.extend(steps_beyond(last, known.stop, STATE_STEP_S));
        }
        epochs.sort_by(|a, b| a.seconds().total_cmp(&b.seconds()));
        Ok(epochs)
    }

    /// The part of the span that the original kernels cover.
    fn known_orbit(&self) -> Result<Interval> {
        let exposed = self.times.exposures();
        self.session.require_position(exposed)?;
        let mut known = self.orbit_span;
        let held = self.session.coverage()?.spk.as_slice().iter();
        for held in held.filter(|held| held.contains(exposed.start)) {
            known.start = later(known.start, held.start);
            known.stop = earlier(known.stop, held.stop);
        }
        Ok(known)
    }

    fn original(&self, exposure: Et) -> Result<Attitude> {
        let lookup = self.bias.lookup(exposure);
        self.session.attitude(lookup, exposure, self.tolerance_s)
    }

    /// Attitudes at their exposures, in order.
    fn nodes(&self) -> Result<Vec<Node>> {
        let mut nodes = self.known_attitudes();
        if let (Some(first), Some(last)) = (nodes.first().copied(), nodes.last().copied()) {
            nodes.extend(self.continued(&first, self.attitude_span.start)?);
            nodes.extend(self.continued(&last, self.attitude_span.stop)?);
        }
        nodes.sort_by(|a, b| a.exposure.seconds().total_cmp(&b.exposure.seconds()));
        Ok(nodes)
    }

    /// Attitudes at the samples, and at the nodes of the camera tables between them.
    fn known_attitudes(&self) -> Vec<Node> {
        let Orientation {
            samples,
            tables,
            light_time,
            ..
        } = self.orientation;
        let is_own = light_time.convention == self.reading.light_time;
        let last = tables.et_s.len().saturating_sub(1);
        let bus_to_camera = tables.bus_to_camera.matrix();
        let start_s = tables.et_s.first().copied().unwrap_or_default();
        let step_s =
            (tables.et_s.last().copied().unwrap_or_default() - start_s) / last.max(1) as f64;
        let of_sample = |sample: &OrientationSample| {
            let to_mars = sample.mars_seen(self.reading.light_time);
            let mars_to_camera = sample.pose().mars_to_camera;
            let at = (sample.et.seconds() - start_s) / step_s;
            Node {
                exposure: sample.et,
                to_bus: bus_to_camera.transpose() * mars_to_camera * to_mars.matrix(),
                rate_rad_s: lagrange(&tables.bus_angular_velocity_rad_s, at),
            }
        };
        let of_table = |row: usize| {
            let exposure = Et::from_seconds(tables.et_s[row]);
            let mut to_bus = *tables.inertial_to_bus[row].matrix();
            if !is_own {
                // The same attitude to Mars, which these readers rotate to the exposure.
                let to_mars = body_rotation(Body::Mars, exposure);
                to_bus *= tables.inertial_to_mars[row].matrix().transpose() * to_mars.matrix();
            }
            Node {
                exposure,
                to_bus,
                rate_rad_s: tables.bus_angular_velocity_rad_s[row],
            }
        };
        let is_sample = |et_s: f64| {
            let mut samples = samples.iter();
            samples.any(|sample| (sample.et.seconds() - et_s).abs() < SAME_INSTANT_S)
        };
        let rows = (0..tables.et_s.len()).filter(|row| !is_sample(tables.et_s[*row]));
        let mut nodes: Vec<Node> = rows
            .map(of_table)
            .chain(samples.iter().map(of_sample))
            .collect();
        nodes.retain(|node| self.attitude_span.contains(node.exposure));
        nodes.sort_by(|a, b| a.exposure.seconds().total_cmp(&b.exposure.seconds()));
        nodes
    }

    /// The original motion from `end` on, rotated by the correction of the adjustment there; without `end` itself.
    fn continued(&self, end: &Node, limit: Et) -> Result<Vec<Node>> {
        let original = self.original(end.exposure)?.inertial_to_bus;
        let turned = end.to_bus * original.matrix().transpose();
        steps_beyond(end.exposure, limit, ATTITUDE_STEP_S)
            .map(|exposure| {
                let original = self.original(exposure)?;
                Ok(Node {
                    exposure,
                    to_bus: turned * original.inertial_to_bus.matrix(),
                    rate_rad_s: original.angular_velocity_rad_s,
                })
            })
            .collect()
    }
}

/// Instants from `end`, without itself, to `limit`, at most `step_s` apart; empty where the two are the same.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "padding has a few dozen steps"
)]
fn steps_beyond(end: Et, limit: Et, step_s: f64) -> impl Iterator<Item = Et> {
    let length_s = limit.since(end);
    let count = if length_s.abs() < SAME_INSTANT_S {
        0
    } else {
        (length_s.abs() / step_s).ceil() as usize
    };
    (1..=count).map(move |index| end.plus(length_s * (index as f64 / count as f64)))
}
