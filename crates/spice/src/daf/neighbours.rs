//! States of an ephemeris checked against their neighbours: an orbit is smooth, and no force displaces a body for one
//! step of a table only.
//!
//! Every state is predicted by cubic Hermite interpolation between the one before and the one after. A single damaged
//! state departs from its prediction, and changes the predictions of its two neighbours by known shares of that, and no
//! others. A manoeuvre, a seam or noise does not: the complete pattern is required.

use nalgebra::Vector3;

use super::{Reader, layout::STATE, problem::Problem};

/// Neighbours used on either side.
const REACH: usize = 3;
/// States read at a time.
const CHUNK: usize = 4_096;
/// Ratio of the departure of a damaged state to the departures of undamaged states near it.
const STANDS_OUT: f64 = 100.0;
/// Departure that rounding may explain, as a share of the distance or speed.
const ROUNDING: f64 = 1e-9;
/// Negligible departure: a millimetre and a micrometre a second, in km and km/s.
const NEGLIGIBLE: [f64; 2] = [1e-6, 1e-9];
/// No body with an ephemeris is a tenth of a light year away, in km, while the adjacent states are nearer by this
/// factor.
const ABSURD_KM: f64 = 1e12;
const ABSURD_TIMES: f64 = 1e9;
/// Largest ratio of the steps around a state for which the shares below hold.
const UNEVEN_MAX: f64 = 1.2;
/// Share of its own departure that a damaged position, or velocity, adds to the departures of its neighbours: −1/2 and
/// 1/4 for even steps, and the tolerance for rounding, uneven steps and the orbit itself.
const PARTS: [f64; 2] = [-0.5, 0.25];
const PART_TOLERANCE: f64 = 0.15;

/// Deviation of a norm from those around it that exceeds the rounding of single precision.
const NORM_STANDS_OUT: f64 = 1e-6;

/// Reports the first quaternion whose norm differs from those around it: all may deviate, as stored numbers do, but a
/// single one is damaged.
pub(super) fn check_norms(norms: &[f64]) -> Result<(), String> {
    for (index, norm) in norms.iter().enumerate() {
        let last_five = norms.len().saturating_sub(5);
        let from = index.saturating_sub(2).min(last_five);
        let near = norms.iter().enumerate().skip(from).take(5);
        let others = near.filter(|(other, _)| *other != index);
        let (mut low, mut high, mut count) = (f64::INFINITY, f64::NEG_INFINITY, 0);
        for (_, other) in others {
            (low, high, count) = (low.min(*other), high.max(*other), count + 1);
        }
        let off = (norm - 0.5 * (low + high)).abs();
        if count >= 3 && off > NORM_STANDS_OUT && off > STANDS_OUT * (high - low) {
            return Err(format!(
                "quaternion {} has a norm of {norm:?}; neighbouring quaternions have a norm of {low:?}",
                index + 1
            ));
        }
    }
    Ok(())
}

/// Position of the states in a segment.
pub(super) struct States {
    pub(super) first_word: u64,
    pub(super) count: usize,
    pub(super) times: Times,
}

/// Their times.
#[derive(Clone, Copy)]
pub(super) enum Times {
    /// In a list that begins with this word.
    Listed(u64),
    /// A constant step, seconds.
    Every(f64),
}

struct State {
    time_s: f64,
    /// Position and velocity, km and km/s.
    parts: [Vector3<f64>; 2],
}

/// Reports the first state that contradicts its neighbours.
pub(super) fn check(reader: &mut Reader, states: &States) -> Result<(), Problem> {
    let mut first = 0;
    while first + 2 * REACH < states.count {
        let count = (CHUNK + 2 * REACH).min(states.count - first);
        let read = read(reader, states, first, count)?;
        for middle in REACH..count - REACH {
            let near = &read[middle - REACH..=middle + REACH];
            if let Some((place, size)) = absurd(near) {
                let record = first + middle - REACH + place + 1;
                return Err(
                    format!("record {record} contains {size:e}, unlike its neighbours").into(),
                );
            }
            if let Some(problem) = contradiction(near) {
                return Err(format!("record {} {problem}", first + middle + 1).into());
            }
        }
        first += CHUNK;
    }
    Ok(())
}

fn read(
    reader: &mut Reader,
    states: &States,
    first: usize,
    count: usize,
) -> Result<Vec<State>, Problem> {
    let words = reader.words(states.first_word + (first * STATE) as u64, count * STATE)?;
    let times_s = match states.times {
        Times::Listed(word) => reader.words(word + first as u64, count)?,
        Times::Every(step_s) => (0..count).map(|index| index as f64 * step_s).collect(),
    };
    let (words, _) = words.as_chunks::<STATE>();
    let state = |(word, time_s): (&[f64; STATE], &f64)| State {
        time_s: *time_s,
        parts: [
            Vector3::new(word[0], word[1], word[2]),
            Vector3::new(word[3], word[4], word[5]),
        ],
    };
    Ok(words.iter().zip(&times_s).map(state).collect())
}

/// A state far beyond the others, whose number makes squares overflow: its index, and its largest number.
fn absurd(states: &[State]) -> Option<(usize, f64)> {
    let sizes = states
        .iter()
        .map(|state| state.parts[0].amax().max(state.parts[1].amax()));
    let sizes: Vec<f64> = sizes.collect();
    let place = (0..sizes.len()).max_by(|a, b| sizes[*a].total_cmp(&sizes[*b]))?;
    let others = sizes
        .iter()
        .enumerate()
        .filter(|(other, _)| *other != place);
    let largest = others.map(|(_, size)| *size).fold(0.0, f64::max);
    (sizes[place] > ABSURD_KM && sizes[place] / ABSURD_TIMES > largest)
        .then_some((place, sizes[place]))
}

/// The contradiction of the middle one of seven states with the others.
fn contradiction(states: &[State]) -> Option<String> {
    let steps_s = states
        .windows(2)
        .map(|pair| pair[1].time_s - pair[0].time_s);
    let (shortest_s, longest_s) = steps_s.fold((f64::INFINITY, 0.0), |(low, high), step_s| {
        (step_s.min(low), step_s.max(high))
    });
    if longest_s > UNEVEN_MAX * shortest_s {
        return None;
    }
    let departures: Vec<[Vector3<f64>; 2]> = states.windows(3).map(departure).collect();
    let middle = &states[REACH];
    [0, 1].into_iter().find_map(|part| {
        let of = |index: usize| departures[index][part];
        let (own, size) = (of(2), of(2).norm());
        let usual = of(0).norm().max(of(4).norm());
        let rounding = ROUNDING * middle.parts[part].norm() + NEGLIGIBLE[part];
        let spoils = |index: usize| (of(index) - PARTS[part] * own).norm() <= PART_TOLERANCE * size;
        let stands_out = size > STANDS_OUT * usual && size > rounding;
        (stands_out && spoils(1) && spoils(3)).then(|| {
            let (what, unit) = [
                ("lies {} km from", "km"),
                ("has a velocity {} km/s from", "km/s"),
            ][part];
            let what = what.replace("{}", &format!("{size:.6}"));
            format!("{what} the interpolation of its neighbours, which agree to {usual:.1e} {unit}")
        })
    })
}

/// Departure of the middle one of three states from the interpolation of the others.
fn departure(states: &[State]) -> [Vector3<f64>; 2] {
    let [before, own, behind] = states else {
        return Default::default();
    };
    let length_s = behind.time_s - before.time_s;
    let u = (own.time_s - before.time_s) / length_s;
    let ([r0, v0], [r1, v1]) = (before.parts, behind.parts);
    // Relative to the first position, so that a distant origin costs no precision.
    let (chord, (v0, v1)) = (r1 - r0, (v0 * length_s, v1 * length_s));
    let square = u * u;
    let cube = square * u;
    let position =
        chord * (3.0 * square - 2.0 * cube) + v0 * (cube - 2.0 * square + u) + v1 * (cube - square);
    let velocity = chord * (6.0 * (u - square))
        + v0 * (3.0 * square - 4.0 * u + 1.0)
        + v1 * (3.0 * square - 2.0 * u);
    [
        own.parts[0] - r0 - position,
        own.parts[1] - velocity / length_s,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An orbit like MGS's, sampled every `step_s`.
    fn orbit(step_s: f64) -> Vec<State> {
        let (radius_km, rate) = (3_780.0, 8.9e-4);
        let state = |index: u8| {
            let time_s = f64::from(index) * step_s;
            let (sine, cosine) = (rate * time_s).sin_cos();
            State {
                time_s,
                parts: [
                    Vector3::new(cosine, sine, 0.3 * sine) * radius_km,
                    Vector3::new(-sine, cosine, 0.3 * cosine) * radius_km * rate,
                ],
            }
        };
        (0..20).map(state).collect()
    }

    fn contradicted(states: &[State]) -> Vec<usize> {
        let found = states.windows(7).zip(REACH..);
        found
            .filter(|(states, _)| contradiction(states).is_some())
            .map(|(_, index)| index)
            .collect()
    }

    #[test]
    fn one_state_aside_is_told_and_only_that_one() {
        for part in [0, 1] {
            for axis in 0..3 {
                let mut states = orbit(60.0);
                assert_eq!(contradicted(&states), [0; 0]);
                states[9].parts[part][axis] += [0.5, 0.1][part];
                assert_eq!(contradicted(&states), [9], "part {part}, axis {axis}");
            }
        }
    }

    #[test]
    fn a_state_beyond_the_sky_is_told_at_the_ends_too() {
        for index in 0..7 {
            let mut states = orbit(60.0);
            assert_eq!(absurd(&states[..7]), None);
            states[index].parts[index % 2][index % 3] = -1e300;
            assert_eq!(absurd(&states[..7]), Some((index, 1e300)));
        }
    }

    #[test]
    fn one_norm_that_stands_out_is_told() {
        let rounded: Vec<f64> = (0..20)
            .map(|index| 1.0 + 3e-8 * f64::from(index % 5))
            .collect();
        assert_eq!(check_norms(&rounded), Ok(()));
        for index in 0..rounded.len() {
            let mut norms = rounded.clone();
            norms[index] += 1e-4;
            let told = check_norms(&norms).unwrap_err();
            assert!(
                told.starts_with(&format!("quaternion {} has", index + 1)),
                "{told}"
            );
        }
        // Half of them stored in a different precision.
        let halves: Vec<f64> = (0..20)
            .map(|index| if index < 10 { 1.0 } else { 1.0 + 1e-4 })
            .collect();
        assert_eq!(check_norms(&halves), Ok(()));
        assert_eq!(check_norms(&[1.0, 1.0, 1.1]), Ok(()));
    }

    #[test]
    fn manoeuvres_seams_and_noise_are_no_damage() {
        let mut manoeuvre = orbit(60.0);
        let begun_s = 9.3 * 60.0;
        for state in manoeuvre.iter_mut().skip(10) {
            let speed = Vector3::new(0.02, -0.01, 0.03);
            state.parts[0] += speed * (state.time_s - begun_s);
            state.parts[1] += speed;
        }
        assert_eq!(contradicted(&manoeuvre), [0; 0]);
        let mut at_a_state = orbit(60.0);
        for state in at_a_state.iter_mut().skip(9) {
            let speed = Vector3::new(0.02, -0.01, 0.03);
            state.parts[0] += speed * (state.time_s - 9.0 * 60.0);
            state.parts[1] += speed;
        }
        assert_eq!(contradicted(&at_a_state), [0; 0]);
        let mut seam = orbit(60.0);
        for state in seam.iter_mut().skip(10) {
            state.parts[0].x += 1.0;
        }
        assert_eq!(contradicted(&seam), [0; 0]);
        let mut noise = orbit(60.0);
        for (index, state) in noise.iter_mut().enumerate() {
            state.parts[0].y += 0.5 * ((index * 7 % 5) as f64 - 2.0);
        }
        assert_eq!(contradicted(&noise), [0; 0]);
        let mut without_velocities = orbit(60.0);
        for state in &mut without_velocities {
            state.parts[1] = Vector3::zeros();
        }
        assert_eq!(contradicted(&without_velocities), [0; 0]);
    }
}
