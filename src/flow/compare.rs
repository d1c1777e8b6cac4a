//! Rival sets of kernels, asked for the same instants one session after the other.

use std::fmt;

use crate::{
    error::{Fault, Kind, Place, Result},
    spice::{Coverage, KernelRole, KernelSet, Session, Wanted},
    stages::compare_kernels::{
        AttitudeComparison, AttitudeSample, Comparison, compare_attitudes, compare_orbits,
    },
    time::{Et, Interval, Intervals, PointingBias},
};

/// Seconds between epochs, as long as that makes no more than [`EPOCHS_MAX`].
const STEP_S: f64 = 1.0;
/// Most epochs at which orbits, or attitudes, are compared.
pub const EPOCHS_MAX: u32 = 10_000;
/// Instants at which clocks are compared.
const CLOCK_PROBES: usize = 100;
/// Clocks that differ by less read the same times, seconds: 3 cm of flight.
const CLOCK_TOLERANCE_S: f64 = 1e-5;

/// A complete set of kernels and its name.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RivalSet {
    /// Name.
    pub id: String,
    /// Its kernels.
    pub kernels: KernelSet,
}

/// What is compared.
#[derive(Debug, Clone, Copy)]
pub struct Request<'a> {
    /// The instants of interest; without them all that every set holds.
    pub wanted: Option<&'a Wanted>,
    /// How C-kernels are read.
    pub bias: PointingBias,
    /// Whether attitudes are compared too, as far as the sets hold any.
    pub attitudes: bool,
    /// Whether the spacecraft clocks must agree, even when no attitudes are compared.
    pub clocks: bool,
}

/// What a comparison found.
#[derive(Debug, Clone, PartialEq)]
pub struct Compared {
    /// Orbits: geometric positions relative to Mars.
    pub orbit: Comparison,
    /// Attitudes, unless there is nothing to compare.
    pub attitude: Option<AttitudeComparison>,
    /// First and last epoch of the orbits in UTC.
    pub utc: [String; 2],
    /// Instants that were of interest but that one set does not hold.
    pub left_out: Vec<LeftOut>,
    /// What a reader should know, one sentence each.
    pub notes: Vec<String>,
}

/// Time that a set does not hold, and that is therefore not compared.
#[derive(Debug, Clone, PartialEq)]
pub struct LeftOut {
    /// The set.
    pub set: String,
    /// `position` or `attitude`.
    pub what: &'static str,
    /// When.
    pub interval: Interval,
    /// The same in UTC.
    pub utc: [String; 2],
}

impl RivalSet {
    /// Where a failure of one set happened.
    fn stage(&self) -> String {
        format!("compare_kernels/{}", self.id)
    }
}

/// Sets that cannot be compared.
#[derive(Debug, thiserror::Error)]
enum CompareFault {
    #[error("no time at which all kernel sets hold the position of MGS; {held}")]
    NothingInCommon { held: String },
    #[error(
        "the clocks of the kernel sets {first} and {other} differ: {reading} is {apart_s} s later in {other}"
    )]
    Clocks {
        first: String,
        other: String,
        reading: String,
        apart_s: f64,
    },
}

impl Fault for CompareFault {
    fn kind(&self) -> Kind {
        match self {
            Self::NothingInCommon { .. } => Kind::Coverage,
            Self::Clocks { .. } => Kind::Input,
        }
    }

    fn advice(&self) -> String {
        match self {
            Self::NothingInCommon { .. } => {
                "see `areograph kernels coverage` for each set, and leave out the set that does not reach there"
            }
            Self::Clocks { .. } => {
                "give all sets the same leap-second (.tls) and spacecraft clock (.tsc) kernels: times of images rest on them"
            }
        }
        .to_owned()
    }
}

/// Compares the orbits, and where possible the attitudes, of at least two sets.
///
/// Instants that one set does not hold are left out, and listed.
///
/// # Errors
/// Sets without common time, sets whose clocks differ, and what a session says of its kernels.
pub fn compare_kernels(sets: &[RivalSet], request: &Request<'_>) -> Result<Compared> {
    let held = sets.iter().map(|set| coverage(set).in_stage(&set.stage()));
    let held: Vec<Coverage> = held.collect::<Result<_>>()?;
    let mut notes = Vec::new();

    let positions: Vec<Intervals> = held.iter().map(|coverage| coverage.spk.clone()).collect();
    let wanted = request.wanted.map(|wanted| &wanted.positions);
    let (common, mut gaps) = shared(wanted, &positions, "position");
    let epochs = equally_spaced(&common);
    if epochs.is_empty() {
        let held = sets.iter().zip(&positions).map(|(set, held)| {
            let held = wanted.map_or_else(|| held.clone(), |wanted| wanted.intersection(held));
            format!("{} holds {:.3} s", set.id, held.duration_s())
        });
        let of = wanted.map_or_else(String::new, |wanted| {
            format!(" of {:.3} s asked for", wanted.duration_s())
        });
        let held = held.collect::<Vec<_>>().join(", ") + &of;
        return Err(CompareFault::NothingInCommon { held }.into());
    }
    let (turn_epochs, more) = turn_epochs(sets, &held, request, &mut notes);
    gaps.extend(more);

    let first = Session::open(&sets[0].kernels)?;
    let hull = Interval::new(epochs[0], epochs[epochs.len() - 1]);
    let utc = utc_of(&first, hull)?;
    let left_out = gaps.into_iter().map(|(set, what, interval)| {
        Ok(LeftOut {
            set: sets[set].id.clone(),
            what,
            interval,
            utc: utc_of(&first, interval)?,
        })
    });
    let left_out = left_out.collect::<Result<_>>()?;
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
        let (states, samples) = ask().in_stage(&set.stage())?;
        orbits.push((set.id.clone(), states));
        attitudes.push((set.id.clone(), samples));
    }
    let attitude = (!turn_epochs.is_empty()).then(|| compare_attitudes(&turn_epochs, &attitudes));
    Ok(Compared {
        orbit: compare_orbits(&epochs, &orbits),
        attitude,
        utc,
        left_out,
        notes,
    })
}

fn coverage(set: &RivalSet) -> Result<Coverage> {
    let session = Session::open(&set.kernels)?;
    Ok(session.coverage()?.clone())
}

/// Epochs at which attitudes are compared, none when the notes say why not, and what sets lack.
fn turn_epochs(
    sets: &[RivalSet],
    held: &[Coverage],
    request: &Request<'_>,
    notes: &mut Vec<String>,
) -> (Vec<Et>, Vec<Gap>) {
    // C-kernels count another time than exposures.
    let shift_s = -request.bias.seconds();
    let turned: Vec<Intervals> = held
        .iter()
        .map(|coverage| coverage.ck.shifted(shift_s))
        .collect();
    if !request.attitudes || !may_turn(sets, &turned, notes) {
        return (Vec::new(), Vec::new());
    }
    let wanted = request
        .wanted
        .map(|wanted| wanted.attitudes.shifted(shift_s));
    let (common, gaps) = shared(wanted.as_ref(), &turned, "attitude");
    let positions: Vec<Intervals> = held.iter().map(|coverage| coverage.spk.clone()).collect();
    let epochs = equally_spaced(&common.intersection(&held_by_all(&positions)));
    if epochs.is_empty() {
        notes.push("attitudes are not compared: the sets hold none in common".to_owned());
    }
    (epochs, gaps)
}

/// Whether there are attitudes that may differ; if not, the notes say why.
fn may_turn(sets: &[RivalSet], turned: &[Intervals], notes: &mut Vec<String>) -> bool {
    let without: Vec<&str> = sets
        .iter()
        .zip(turned)
        .filter(|(_, held)| held.as_slice().is_empty())
        .map(|(set, _)| &*set.id)
        .collect();
    let kernels = |set: &RivalSet| -> Vec<String> {
        let kernels = set.kernels.kernels().iter();
        let of_attitude = kernels.filter(|kernel| kernel.role == KernelRole::Ck);
        of_attitude.map(|kernel| kernel.blake3.clone()).collect()
    };
    let because = if !without.is_empty() {
        format!("no attitude in {}", without.join(", "))
    } else if sets
        .windows(2)
        .all(|two| kernels(&two[0]) == kernels(&two[1]))
    {
        "all sets have the same C-kernels".to_owned()
    } else {
        return true;
    };
    notes.push(format!("attitudes are not compared: {because}"));
    false
}

/// Index of a set, what it lacks, and when.
type Gap = (usize, &'static str, Interval);

/// The instants of interest that all sets hold, and for each set those that it does not hold.
///
/// Without stated interest, what any set holds is of interest.
fn shared(
    wanted: Option<&Intervals>,
    held: &[Intervals],
    what: &'static str,
) -> (Intervals, Vec<Gap>) {
    let of_any = || Intervals::union_of(held.iter().flat_map(Intervals::as_slice).copied());
    let wanted = wanted.map_or_else(of_any, Intervals::clone);
    let gaps = held.iter().enumerate().flat_map(|(set, held)| {
        let gaps = wanted.without(held);
        let gaps: Vec<Gap> = gaps
            .as_slice()
            .iter()
            .map(|gap| (set, what, *gap))
            .collect();
        gaps
    });
    let gaps = gaps.collect();
    (wanted.intersection(&held_by_all(held)), gaps)
}

fn held_by_all(held: &[Intervals]) -> Intervals {
    let (first, others) = match held {
        [] => return Intervals::default(),
        [first, others @ ..] => (first.clone(), others),
    };
    others
        .iter()
        .fold(first, |common, next| common.intersection(next))
}

/// The middles of equal parts of the time in `intervals`, a second long or as long as the limit needs.
///
/// Each epoch stands for the same time, so that means over epochs are means over time, and none lies
/// at an end, where kernels round.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a whole number from 0 to the limit"
)]
fn equally_spaced(intervals: &Intervals) -> Vec<Et> {
    let total_s = intervals.duration_s();
    let count = (total_s / STEP_S).ceil().min(f64::from(EPOCHS_MAX)) as usize;
    let step_s = total_s / count.max(1) as f64;
    let mut epochs = Vec::with_capacity(count);
    let mut passed_s = 0.0;
    for interval in intervals.as_slice() {
        let next_s = passed_s + interval.duration_s();
        while epochs.len() < count {
            let at_s = (epochs.len() as f64 + 0.5) * step_s;
            if at_s > next_s {
                break;
            }
            epochs.push(interval.start.plus(at_s - passed_s));
        }
        passed_s = next_s;
    }
    epochs
}

/// A text by which a clock is read.
enum Reading {
    Utc(String),
    Sclk(String),
}

impl Reading {
    fn et(&self, session: &Session) -> Result<Et> {
        match self {
            Self::Utc(text) => session.utc_to_et(text),
            Self::Sclk(text) => session.sclk_to_et(text),
        }
    }
}

impl fmt::Display for Reading {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Utc(text) => write!(formatter, "UTC {text}"),
            Self::Sclk(text) => write!(formatter, "clock {text}"),
        }
    }
}

/// Clock readings over `epochs`, with the instants that they mean to the set of `session`.
fn read_clocks(session: &Session, epochs: &[Et], spacecraft: bool) -> Result<Vec<(Reading, Et)>> {
    let step = epochs.len().div_ceil(CLOCK_PROBES).max(1);
    let mut readings = Vec::new();
    for et in epochs.iter().step_by(step) {
        readings.push(Reading::Utc(session.et_to_utc(*et)?));
        if spacecraft {
            readings.push(Reading::Sclk(session.et_to_sclk(*et)?));
        }
    }
    let meant = readings.into_iter().map(|reading| {
        let et = reading.et(session)?;
        Ok((reading, et))
    });
    meant.collect()
}

/// Makes sure that the clocks of the set `other` mean the same instants.
fn check_clocks(
    session: &Session,
    readings: &[(Reading, Et)],
    [first, other]: [&str; 2],
) -> Result<()> {
    for (reading, et) in readings {
        let apart_s = reading.et(session)?.since(*et);
        if apart_s.abs() > CLOCK_TOLERANCE_S {
            return Err(CompareFault::Clocks {
                first: first.to_owned(),
                other: other.to_owned(),
                reading: reading.to_string(),
                apart_s,
            }
            .into());
        }
    }
    Ok(())
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

#[cfg(test)]
mod tests {
    use super::*;

    fn intervals(ends_s: &[[f64; 2]]) -> Intervals {
        Intervals::union_of(
            ends_s.iter().map(|[start, stop]| {
                Interval::new(Et::from_seconds(*start), Et::from_seconds(*stop))
            }),
        )
    }

    #[test]
    fn epochs_stand_for_equal_parts_of_the_time_and_keep_the_limit() {
        let seconds = |intervals: &Intervals| -> Vec<f64> {
            let epochs = equally_spaced(intervals);
            epochs.iter().map(|et| et.seconds()).collect()
        };
        assert_eq!(
            seconds(&intervals(&[[0.0, 2.0], [10.0, 11.0]])),
            [0.5, 1.5, 10.5]
        );
        assert_eq!(seconds(&intervals(&[[0.0, 0.5]])), [0.25]);
        assert!(seconds(&intervals(&[])).is_empty());
        assert!(seconds(&intervals(&[[3.0, 3.0]])).is_empty());
        let long = seconds(&intervals(&[[0.0, 5e4], [1e5, 1.5e5]]));
        assert_eq!(long.len(), 10_000);
        assert!((long[0] - 5.0).abs() < 1e-9 && (long[9_999] - 149_995.0).abs() < 1e-6); // rounding
        assert_eq!(long.iter().filter(|et| **et > 9e4).count(), 5_000);
    }

    #[test]
    fn what_one_set_lacks_is_left_out_and_listed() {
        let held = [
            intervals(&[[0.0, 10.0]]),
            intervals(&[[4.0, 6.0], [8.0, 20.0]]),
        ];
        let gaps_s = |gaps: &[Gap]| -> Vec<(usize, f64, f64)> {
            let ends = |gap: &Gap| (gap.0, gap.2.start.seconds(), gap.2.stop.seconds());
            gaps.iter().map(ends).collect()
        };
        let (common, gaps) = shared(None, &held, "position");
        assert_eq!(common, intervals(&[[4.0, 6.0], [8.0, 10.0]]));
        assert_eq!(
            gaps_s(&gaps),
            [(0, 10.0, 20.0), (1, 0.0, 4.0), (1, 6.0, 8.0)]
        );
        let (common, gaps) = shared(Some(&intervals(&[[5.0, 7.0]])), &held, "position");
        assert_eq!(common, intervals(&[[5.0, 6.0]]));
        assert_eq!(gaps_s(&gaps), [(1, 6.0, 7.0)]);
    }
}
