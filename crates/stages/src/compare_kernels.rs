//! Alternative kernels: the distance of the orbit and the attitude of each set from the mean of all.

use nalgebra::{Matrix3, Vector3};

use areograph_base::{
    body::Body,
    frames::{J2000, Position},
    time::{Et, Interval},
};
use areograph_geom::{
    attitude::{mean_rotation, rotation_vector},
    body_rotation::body_rotation,
    ellipsoid::ray_meets_ellipsoid,
    orbit_axes::radial_along_cross,
    polynomial::root_mean_square,
    statistics::Summary,
};
use areograph_spice::State;

/// Sets whose distances from the mean differ by less than this share of the least are equally close.
///
/// Two sets are equally far from their mean by definition: only rounding distinguishes them.
const TIE_SHARE: f64 = 1e-6;

/// Deviations of several sets from the mean of all, epoch by epoch: metres for orbits, radians for
/// attitudes.
#[derive(Debug, Clone, PartialEq)]
pub struct Comparison {
    /// Instants at which all sets were read.
    pub epochs: Vec<Et>,
    /// One entry per set, in the order given.
    pub deviations: Vec<Deviation>,
    /// Index of the set with the least root mean square distance; of equal ones the first.
    pub closest: usize,
    /// Indices of further sets that are as close as the closest.
    pub tied: Vec<usize>,
}

/// Root mean square distances of two sets within this ratio do not show which is better: they change as much with the
/// epochs that are compared.
const TOO_CLOSE: f64 = 1.1;
/// A set this many times as far from the mean as any other dominates the mean.
const FAR_BEYOND: f64 = 1.5;

/// Set minus mean.
#[derive(Debug, Clone, PartialEq)]
pub struct Deviation {
    /// The set.
    pub set: String,
    /// Radial, along-track and cross-track components (for a rotation, the rotation vector about these axes
    /// of the mean orbit), one entry per epoch.
    pub radial_along_cross: Vec<[f64; 3]>,
    /// Size of all components together.
    pub size: Size,
}

/// Size of some vectors, by component and in all.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Size {
    /// Statistics of the radial, the along-track and the cross-track component.
    pub components: [Summary; 3],
    /// Root mean square length.
    pub rms: f64,
    /// Largest length.
    pub max: f64,
}

/// Differences of attitudes, also on the ground.
#[derive(Debug, Clone, PartialEq)]
pub struct AttitudeComparison {
    /// Rotations from the mean attitude to the attitude of each set, radians.
    pub turns: Comparison,
    /// Epochs at which the mean boresight meets Mars.
    pub on_ground: Vec<Et>,
    /// For each set and each epoch of `on_ground`: angle between its boresight and the boresight of the mean attitude,
    /// times the distance to the ellipsoid, metres.
    pub ground_m: Vec<Vec<f64>>,
}

impl AttitudeComparison {
    /// Root mean square and largest distance on the ground, metres; `None` when no boresight meets Mars.
    #[must_use]
    pub fn ground_size_m(&self, set: usize) -> Option<[f64; 2]> {
        let ground_m = &self.ground_m[set];
        let max_m = ground_m.iter().copied().reduce(f64::max)?;
        Some([root_mean_square(ground_m), max_m])
    }
}

/// Attitude of the bus at an exposure, and the state of the spacecraft.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AttitudeSample {
    /// State relative to the centre of Mars.
    pub state: State,
    /// Matrix from J2000 to the bus.
    pub inertial_to_bus: Matrix3<f64>,
}

impl Comparison {
    fn new(epochs: &[Et], sets: impl IntoIterator<Item = (String, Vec<[f64; 3]>)>) -> Self {
        let deviations: Vec<Deviation> = sets
            .into_iter()
            .map(|(set, radial_along_cross)| Deviation {
                set,
                size: Size::of(&radial_along_cross),
                radial_along_cross,
            })
            .collect();
        let distances = || deviations.iter().map(|deviation| deviation.size.rms);
        let least = distances().fold(f64::INFINITY, f64::min);
        let mut close = distances()
            .enumerate()
            .filter(|(_, rms)| rms - least <= TIE_SHARE * least)
            .map(|(index, _)| index);
        let closest = close.next().unwrap_or_default();
        let tied = close.collect();
        Self {
            epochs: epochs.to_vec(),
            deviations,
            closest,
            tied,
        }
    }

    /// The set that is closest to the mean of all.
    #[must_use]
    pub fn closest(&self) -> &Deviation {
        &self.deviations[self.closest]
    }

    /// Sets so little farther from the mean than the closest that the rule cannot distinguish them.
    pub fn nearly_as_close(&self) -> impl Iterator<Item = &Deviation> {
        let limit = TOO_CLOSE * self.closest().size.rms;
        let others = self.deviations.iter().enumerate();
        let others =
            others.filter(|(index, _)| *index != self.closest && !self.tied.contains(index));
        others
            .map(|(_, of)| of)
            .filter(move |of| of.size.rms <= limit)
    }

    /// The set that pulls the mean towards itself: of three or more sets, the one far beyond all others.
    #[must_use]
    pub fn pulls_the_mean(&self) -> Option<&Deviation> {
        let mut sets: Vec<&Deviation> = self.deviations.iter().collect();
        sets.sort_by(|one, other| other.size.rms.total_cmp(&one.size.rms));
        match sets.as_slice() {
            [far, next, _, ..] if far.size.rms > FAR_BEYOND * next.size.rms => Some(far),
            _ => None,
        }
    }

    /// The set that decides which is closest by pulling the mean: without it another set is closest, or the choice is
    /// undetermined.
    #[must_use]
    pub fn decided_by(&self) -> Option<&Deviation> {
        let far = self.pulls_the_mean()?;
        let mut others: Vec<usize> = (0..self.deviations.len()).collect();
        others.retain(|index| self.deviations[*index].set != far.set);
        // Two sets are equally far from their own mean.
        if others.len() < 3 {
            return Some(far);
        }
        // The mean of the others lies that far on the other side of the mean of all.
        let rms = |index: &usize| {
            let of = self.deviations[*index].radial_along_cross.iter();
            let both = of.zip(&far.radial_along_cross);
            let count = others.len() as f64;
            rms(both.map(|(of, far)| Vector3::from(*of) + Vector3::from(*far) / count))
        };
        let closest = others.iter().min_by(|a, b| rms(a).total_cmp(&rms(b)));
        (closest != Some(&self.closest)).then_some(far)
    }

    /// The set that is closest to the mean within a part of the time, with its root mean square distance and the
    /// distance of the set that is closest over all; `None` where they are the same.
    #[must_use]
    pub fn closer_within(&self, span: Interval) -> Option<(&Deviation, [f64; 2])> {
        let within = |of: &Deviation| {
            let vectors = self.epochs.iter().zip(&of.radial_along_cross);
            let inside = vectors.filter(|(et, _)| span.contains(**et));
            rms(inside.map(|(_, vector)| Vector3::from(*vector)))
        };
        let own = within(self.closest());
        let each = self.deviations.iter().map(|of| (of, within(of)));
        let (least, least_rms) = each.min_by(|one, other| one.1.total_cmp(&other.1))?;
        (least_rms < (1.0 - TIE_SHARE) * own).then_some((least, [least_rms, own]))
    }

    /// Every pair of sets once, by index, the earlier first.
    pub fn pairs(&self) -> impl Iterator<Item = (usize, usize)> + use<> {
        let count = self.deviations.len();
        (0..count).flat_map(move |first| (first + 1..count).map(move |second| (first, second)))
    }

    /// Sets that are as close to the mean as the closest.
    pub fn tied_sets(&self) -> impl Iterator<Item = &str> {
        let tied = self.tied.iter();
        tied.map(|index| &*self.deviations[*index].set)
    }

    /// Set `second` minus set `first`, both by index; of turns to first order in the angles.
    #[must_use]
    pub fn difference(&self, first: usize, second: usize) -> Size {
        let [first, second] =
            [first, second].map(|index| &self.deviations[index].radial_along_cross);
        let differences: Vec<[f64; 3]> = first
            .iter()
            .zip(second)
            .map(|(first, second)| std::array::from_fn(|axis| second[axis] - first[axis]))
            .collect();
        Size::of(&differences)
    }
}

/// Root mean square length.
fn rms(vectors: impl Iterator<Item = Vector3<f64>>) -> f64 {
    root_mean_square(&vectors.map(|vector| vector.norm()).collect::<Vec<_>>())
}

impl Size {
    fn of(vectors: &[[f64; 3]]) -> Self {
        let component = |axis: usize| -> Vec<f64> { vectors.iter().map(|v| v[axis]).collect() };
        let lengths: Vec<f64> = vectors.iter().map(|v| Vector3::from(*v).norm()).collect();
        Self {
            components: [0, 1, 2].map(|axis| Summary::of(&component(axis))),
            rms: root_mean_square(&lengths),
            max: lengths.into_iter().fold(0.0, f64::max),
        }
    }
}

/// Compares orbits along the radial, along-track and cross-track axes of their mean.
///
/// * `orbits` – name and geometric states relative to Mars of every set, one state per epoch; at least
///   one set
///
/// # Source
/// Shan et al. 2005, data preparation: of the orbit solutions, the navigation team's was chosen, which lies closest to
/// the mean of all.
#[must_use]
pub fn compare_orbits(epochs: &[Et], orbits: &[(String, Vec<State>)]) -> Comparison {
    let means: Vec<State> = (0..epochs.len())
        .map(|epoch| mean_state(orbits.iter().map(|(_, states)| &states[epoch])))
        .collect();
    let deviations = orbits.iter().map(|(set, states)| {
        let apart = states.iter().zip(&means).map(|(state, mean)| {
            let apart_m = state.position.xyz_m - mean.position.xyz_m;
            (axes(mean).transpose() * apart_m).into()
        });
        (set.clone(), apart.collect())
    });
    Comparison::new(epochs, deviations)
}

/// Compares attitudes: turns about the axes of the mean orbit, and metres on the ground.
///
/// The boresight is the bus's +Z, which the narrow-angle camera follows to a quarter of a degree: the range to the
/// ground hardly depends on that.
///
/// * `attitudes` – name and samples of every set, one sample per epoch; at least one set
#[must_use]
pub fn compare_attitudes(
    epochs: &[Et],
    attitudes: &[(String, Vec<AttitudeSample>)],
) -> AttitudeComparison {
    let mut turns: Vec<Vec<[f64; 3]>> = vec![Vec::with_capacity(epochs.len()); attitudes.len()];
    let mut ground_m: Vec<Vec<f64>> = vec![Vec::new(); attitudes.len()];
    let mut on_ground = Vec::new();
    for (index, epoch) in epochs.iter().enumerate() {
        let samples = || attitudes.iter().map(|(_, samples)| &samples[index]);
        let state = mean_state(samples().map(|sample| &sample.state));
        let matrices: Vec<Matrix3<f64>> = samples().map(|sample| sample.inertial_to_bus).collect();
        let mean = mean_rotation(&matrices);
        let range_m = ground_range_m(*epoch, &state.position, &boresight(&mean));
        if range_m.is_some() {
            on_ground.push(*epoch);
        }
        for (set, matrix) in matrices.iter().enumerate() {
            // The turn of the bus's axes, in J2000 components.
            let turn_rad = rotation_vector(&(matrix.transpose() * mean));
            turns[set].push((axes(&state).transpose() * turn_rad).into());
            let angle_rad = angle_rad(&boresight(matrix), &boresight(&mean));
            ground_m[set].extend(range_m.map(|range_m| range_m * angle_rad));
        }
    }
    let named = attitudes.iter().map(|(set, _)| set.clone()).zip(turns);
    AttitudeComparison {
        turns: Comparison::new(epochs, named),
        on_ground,
        ground_m,
    }
}

fn axes(state: &State) -> Matrix3<f64> {
    radial_along_cross(&state.position.xyz_m, &state.velocity_m_s)
}

fn mean_state<'a>(states: impl ExactSizeIterator<Item = &'a State>) -> State {
    let share = 1.0 / states.len() as f64;
    let (mut position_m, mut velocity_m_s) = (Vector3::zeros(), Vector3::zeros());
    for state in states {
        position_m += share * state.position.xyz_m;
        velocity_m_s += share * state.velocity_m_s;
    }
    State {
        position: Position::new(position_m),
        velocity_m_s,
    }
}

/// The bus's +Z in J2000.
fn boresight(inertial_to_bus: &Matrix3<f64>) -> Vector3<f64> {
    inertial_to_bus.row(2).transpose()
}

/// Angle between two unit vectors, exact for small ones.
fn angle_rad(a: &Vector3<f64>, b: &Vector3<f64>) -> f64 {
    a.cross(b).norm().atan2(a.dot(b))
}

/// Distance from `position` along a unit vector to the ellipsoid of IAU 2000, metres.
fn ground_range_m(et: Et, position: &Position<J2000>, direction: &Vector3<f64>) -> Option<f64> {
    let to_mars = body_rotation(Body::Mars, et);
    let origin = to_mars.apply(position);
    let hit = ray_meets_ellipsoid(Body::Mars.model(), &origin, &(to_mars.matrix() * direction))?;
    Some(hit.distance_m(&origin))
}

#[cfg(test)]
mod tests {
    use super::*;
    use areograph_geom::attitude::matrix_of_rotation_vector;

    fn state(position_m: Vector3<f64>) -> State {
        State {
            position: Position::new(position_m),
            velocity_m_s: Vector3::new(0.0, 3.4e3, 0.0),
        }
    }

    fn orbit(name: &str, apart_m: [f64; 3]) -> (String, Vec<State>) {
        let position_m = Vector3::new(3.78e6, 0.0, 0.0) + Vector3::from(apart_m);
        (name.to_owned(), vec![state(position_m); 2])
    }

    const EPOCHS: [f64; 2] = [3.9e7, 3.9e7 + 1.0];

    fn epochs() -> Vec<Et> {
        EPOCHS.map(Et::from_seconds).to_vec()
    }

    #[test]
    fn deviations_from_the_mean_by_hand() {
        // x is radial, y along, z across; the mean is (1, 0, 10).
        let orbits = [
            orbit("a", [0.0, 0.0, 0.0]),
            orbit("b", [3.0, 0.0, 20.0]),
            orbit("c", [0.0, 0.0, 10.0]),
        ];
        let found = compare_orbits(&epochs(), &orbits);
        let expected = [[-1.0, 0.0, -10.0], [2.0, 0.0, 10.0], [-1.0, 0.0, 0.0]];
        for (deviation, expected) in found.deviations.iter().zip(expected) {
            for found in &deviation.radial_along_cross {
                let apart_m = (Vector3::from(*found) - Vector3::from(expected)).norm();
                assert!(apart_m < 1e-4, "{found:?} {expected:?}"); // axes turn by 10 m in 3780 km
            }
        }
        assert_eq!(found.closest().set, "c");
        assert!(found.tied.is_empty());
        assert!((found.closest().size.rms - 1.0).abs() < 1e-4); // as above
        let difference = found.difference(0, 1);
        assert!((difference.rms - 409_f64.sqrt()).abs() < 1e-4); // 3² + 20²
        assert!((difference.components[2].mean - 20.0).abs() < 1e-4);
    }

    #[test]
    fn a_set_may_be_too_close_to_call_and_another_pull_the_mean() {
        let found = compare_orbits(
            &epochs(),
            &[
                orbit("nav", [0.0, 0.0, 0.0]),
                orbit("ipng", [0.0, 1.5, 0.0]),
                orbit("gsfc", [0.0, 0.2, 30.0]),
            ],
        );
        // The mean lies 10 m from two of them and 20 m from the third.
        let close: Vec<&str> = found.nearly_as_close().map(|of| &*of.set).collect();
        assert_eq!(close.len(), 1, "{close:?}");
        assert_eq!(found.pulls_the_mean().map(|of| &*of.set), Some("gsfc"));
        let alone = compare_orbits(
            &epochs(),
            &[
                orbit("a", [0.0; 3]),
                orbit("b", [1.0, 0.0, 0.0]),
                orbit("c", [8.0, 0.0, 0.0]),
            ],
        );
        assert_eq!(alone.nearly_as_close().count(), 0);
    }

    #[test]
    fn two_sets_are_equally_close_and_the_first_stands() {
        let orbits = [
            orbit("a", [0.1, 0.2, 7.3]),
            orbit("b", [-3.0, 0.7, 20.0 / 3.0]),
        ];
        let found = compare_orbits(&epochs(), &orbits);
        assert_eq!((found.closest, &*found.tied), (0, &[1][..]));
    }

    #[test]
    fn a_turn_about_the_track_moves_the_ground_by_angle_times_range() {
        // +Z of the bus looks down (−x), its X flies back (−y).
        let (x, y, z) = (Vector3::x(), Vector3::y(), Vector3::z());
        let nadir: Matrix3<f64> = Matrix3::from_columns(&[-y, z, -x]).transpose();
        let at = state(Vector3::new(3.78e6, 0.0, 0.0));
        let turn_rad = 1e-3;
        let turned = |sign: f64| {
            let turn = matrix_of_rotation_vector(&Vector3::new(0.0, sign * turn_rad, 0.0));
            AttitudeSample {
                state: at,
                inertial_to_bus: nadir * turn.transpose(),
            }
        };
        let attitudes =
            [("a", 1.0), ("b", -1.0)].map(|(name, sign)| (name.to_owned(), vec![turned(sign); 2]));
        let found = compare_attitudes(&epochs(), &attitudes);
        let [radial, along, cross] = found.turns.deviations[0].radial_along_cross[0];
        assert!((along - turn_rad).abs() < 1e-12, "{along}"); // rounding
        assert!(radial.abs() < 1e-12 && cross.abs() < 1e-12);
        assert_eq!(found.on_ground, epochs());
        // From 3780 km to a surface between 3376.2 and 3396.19 km, a milliradian.
        let ground_m = found.ground_m[1][0];
        assert!((383.8..403.9).contains(&ground_m), "{ground_m}");
    }

    #[test]
    fn a_boresight_into_space_has_no_ground() {
        let up = AttitudeSample {
            state: state(Vector3::new(0.0, 0.0, 3.78e6)),
            inertial_to_bus: Matrix3::identity(),
        };
        let attitudes = ["a", "b"].map(|name| (name.to_owned(), vec![up; 2]));
        let found = compare_attitudes(&epochs(), &attitudes);
        assert!(found.on_ground.is_empty() && found.ground_m[0].is_empty());
        assert_eq!(found.turns.deviations[0].size.rms.to_bits(), 0);
    }
}
