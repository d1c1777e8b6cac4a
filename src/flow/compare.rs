//! Comparison of rival kernel sets at the same instants, one session after the other.

mod answer;
mod clocks;
mod epochs;
mod uncovered;

use crate::{
    constants::SPACECRAFT,
    error::{Cause, Locate, Result},
    spice::{Coverage, KernelSet, RequiredCoverage, Session},
    stages::compare_kernels::{
        AttitudeComparison, AttitudeSample, Comparison, compare_attitudes, compare_orbits,
    },
    time::{Et, Interval, Intervals, PointingBias},
};

pub use answer::{Answer, comparison_schema};
pub use epochs::EPOCHS_MAX;
pub use uncovered::Uncovered;

use clocks::{check_clocks, read_clocks};
use epochs::{Gap, equally_spaced, shared, turn_epochs};

/// A complete set of kernels and its name.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RivalSet {
    /// Name.
    pub id: String,
    /// Its kernels.
    pub kernels: KernelSet,
}

/// Request of a comparison.
#[derive(Debug, Clone, Copy)]
pub struct Request<'a> {
    /// The calling stage; failures of one set are placed there, followed by `/` and the set.
    pub stage: &'static str,
    /// The instants of interest; without them all that every set covers.
    pub required: Option<&'a RequiredCoverage>,
    /// Pointing bias with which C-kernels are read.
    pub bias: PointingBias,
    /// Whether attitudes are compared too, as far as the sets hold any.
    pub attitudes: bool,
    /// Whether the spacecraft clocks must agree, even when no attitudes are compared.
    pub clocks: bool,
}

/// Result of a comparison.
#[derive(Debug, Clone, PartialEq)]
pub struct Compared {
    /// Orbits: geometric positions relative to Mars.
    pub orbit: Comparison,
    /// Attitudes, unless there is nothing to compare.
    pub attitude: Option<AttitudeComparison>,
    /// First and last epoch of the orbits in UTC.
    pub utc: [String; 2],
    /// Instants of interest that one set does not cover.
    pub uncovered: Vec<Uncovered>,
    /// Notes for the reader, one sentence each.
    pub notes: Vec<String>,
}

impl Request<'_> {
    /// Place of a failure of one set.
    fn stage_of(&self, set: &RivalSet) -> String {
        format!("{}/{}", self.stage, set.id)
    }
}

impl Compared {
    /// For each set the time that it does not cover: total, and the first intervals; one sentence each.
    #[must_use]
    pub fn uncovered_lines(&self) -> Vec<String> {
        uncovered::lines(&self.uncovered)
    }
}

/// Sets that cannot be compared.
#[derive(Debug, thiserror::Error, Cause)]
enum CompareError {
    #[error("kernel set {other} contains the same kernels as {first}")]
    #[cause(Configuration: "name each set once")]
    Same { first: String, other: String },
    #[error("the kernel sets have no common coverage of the position of {}; {held}", SPACECRAFT.name)]
    #[cause(Coverage: "see `areograph kernels coverage` for each set, and omit the set that does not cover this \
        time")]
    NothingInCommon { held: String },
    #[error(
        "the clocks of the kernel sets {first} and {other} differ: {reading} is {apart_s} s later in {other}"
    )]
    #[cause(Input: "give all sets the same leap-second (.tls) and spacecraft clock (.tsc) kernels: image times depend on \
        them")]
    Clocks {
        first: String,
        other: String,
        reading: String,
        apart_s: f64,
    },
}

/// Compares the orbits, and where possible the attitudes, of at least two sets.
///
/// Instants that one set does not cover are left out, and listed.
///
/// # Errors
/// Sets without common time, sets whose clocks differ, and failures of a session with its kernels.
pub fn compare_kernels(sets: &[RivalSet], request: &Request<'_>) -> Result<Compared> {
    let held = sets
        .iter()
        .map(|set| coverage(set).in_stage(&request.stage_of(set)));
    let held: Vec<Coverage> = held.collect::<Result<_>>()?;
    let mut notes = Vec::new();

    let positions: Vec<Intervals> = held.iter().map(|coverage| coverage.spk.clone()).collect();
    let required = request.required.map(|required| &required.positions);
    let (common, mut gaps) = shared(required, &positions, "position");
    let epochs = equally_spaced(&common);
    if epochs.is_empty() {
        return Err(nothing_in_common(sets, &positions, required).into());
    }
    let (turn_epochs, more) = turn_epochs(sets, &held, request, &mut notes);
    gaps.extend(more);

    let first = Session::open(&sets[0].kernels)?;
    let hull = Interval::new(epochs[0], epochs[epochs.len() - 1]);
    let utc = utc_of(&first, hull)?;
    let uncovered = gaps.into_iter().map(|gap| uncovered(sets, gap, &first));
    let uncovered = uncovered.collect::<Result<_>>()?;
    let readings = read_clocks(&first, &epochs, request.clocks || !turn_epochs.is_empty())?;
    drop(first);

    let (mut orbits, mut attitudes) = (Vec::new(), Vec::new());
    for set in sets {
        let ask = || -> Result<_> {
            let session = Session::open(&set.kernels)?;
            check_clocks(&session, &readings, [&sets[0].id, &set.id])?;
            let states = epochs.iter().map(|et| session.state(*et));
            let sample = |et: &Et| attitude_sample(&session, request.bias, *et);
            let samples = turn_epochs.iter().map(sample);
            Ok((
                states.collect::<Result<_>>()?,
                samples.collect::<Result<_>>()?,
            ))
        };
        let (states, samples) = ask().in_stage(&request.stage_of(set))?;
        orbits.push((set.id.clone(), states));
        attitudes.push((set.id.clone(), samples));
    }
    let attitude = (!turn_epochs.is_empty()).then(|| compare_attitudes(&turn_epochs, &attitudes));
    Ok(Compared {
        orbit: compare_orbits(&epochs, &orbits),
        attitude,
        utc,
        uncovered,
        notes,
    })
}

/// Covered time of interest of each set, where the sets have none in common.
fn nothing_in_common(
    sets: &[RivalSet],
    positions: &[Intervals],
    required: Option<&Intervals>,
) -> CompareError {
    let held = sets.iter().zip(positions).map(|(set, held)| {
        let held = required.map_or_else(|| held.clone(), |required| required.intersection(held));
        format!("{} covers {:.3} s", set.id, held.duration_s())
    });
    let of = required.map_or_else(String::new, |required| {
        format!(" of {:.3} s requested", required.duration_s())
    });
    CompareError::NothingInCommon {
        held: held.collect::<Vec<_>>().join(", ") + &of,
    }
}

fn uncovered(
    sets: &[RivalSet],
    (set, what, interval): Gap,
    session: &Session,
) -> Result<Uncovered> {
    Ok(Uncovered {
        set: sets[set].id.clone(),
        what,
        interval,
        utc: utc_of(session, interval)?,
    })
}

/// Ensures that no set is named twice: a set compared with itself looks like agreement.
///
/// # Errors
/// Two sets with the same files in the same order.
pub fn require_different(sets: &[RivalSet]) -> Result<()> {
    let hashes = |set: &RivalSet| -> Vec<String> {
        let kernels = set.kernels.kernels().iter();
        kernels.map(|kernel| kernel.blake3.clone()).collect()
    };
    let all: Vec<Vec<String>> = sets.iter().map(hashes).collect();
    for (other, set) in sets.iter().enumerate() {
        if let Some(first) = all[..other].iter().position(|hashes| *hashes == all[other]) {
            let (first, other) = (sets[first].id.clone(), set.id.clone());
            return Err(CompareError::Same { first, other }.into());
        }
    }
    Ok(())
}

fn coverage(set: &RivalSet) -> Result<Coverage> {
    let session = Session::open(&set.kernels)?;
    Ok(session.coverage()?.clone())
}

fn attitude_sample(session: &Session, bias: PointingBias, et: Et) -> Result<AttitudeSample> {
    let attitude = session.attitude(bias.lookup(et), et, 0.0)?;
    Ok(AttitudeSample {
        state: session.state(et)?,
        inertial_to_bus: *attitude.inertial_to_bus.matrix(),
    })
}

fn utc_of(session: &Session, interval: Interval) -> Result<[String; 2]> {
    Ok([
        session.et_to_utc(interval.start)?,
        session.et_to_utc(interval.stop)?,
    ])
}
