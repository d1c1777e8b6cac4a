//! Instants at which rival sets are compared, and the gaps of each set.

use super::{Request, RivalSet};
use crate::{
    spice::{Coverage, KernelRole},
    time::{Et, Interval, Intervals},
};

/// Seconds between epochs, unless their number exceeds [`EPOCHS_MAX`].
const STEP_S: f64 = 1.0;
/// Maximum number of epochs at which orbits, or attitudes, are compared.
pub const EPOCHS_MAX: u32 = 10_000;

/// Epochs at which attitudes are compared, and gaps of the sets; without epochs the notes state why.
pub(super) fn turn_epochs(
    sets: &[RivalSet],
    held: &[Coverage],
    request: &Request<'_>,
    notes: &mut Vec<String>,
) -> (Vec<Et>, Vec<Gap>) {
    // The time of C-kernels is shifted against the time of exposures.
    let shift_s = -request.bias.seconds();
    let turned: Vec<Intervals> = held
        .iter()
        .map(|coverage| coverage.ck.shifted(shift_s))
        .collect();
    if !request.attitudes || !may_turn(sets, &turned, notes) {
        return (Vec::new(), Vec::new());
    }
    let required = request
        .required
        .map(|required| required.attitudes.shifted(shift_s));
    let (common, gaps) = shared(required.as_ref(), &turned, "attitude");
    let positions: Vec<Intervals> = held.iter().map(|coverage| coverage.spk.clone()).collect();
    let epochs = equally_spaced(&common.intersection(&held_by_all(&positions)));
    if epochs.is_empty() {
        notes.push("attitudes are not compared: the sets have no attitudes in common".to_owned());
    }
    (epochs, gaps)
}

/// Whether attitudes may differ; if not, the notes state why.
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

/// Index of a set, the missing quantity, and the interval.
pub(super) type Gap = (usize, &'static str, Interval);

/// The instants of interest that all sets cover, and for each set those that it does not cover.
///
/// Without a request, all instants that any set covers are of interest.
pub(super) fn shared(
    required: Option<&Intervals>,
    held: &[Intervals],
    what: &'static str,
) -> (Intervals, Vec<Gap>) {
    let of_any = || Intervals::union_of(held.iter().flat_map(Intervals::as_slice).copied());
    let required = required.map_or_else(of_any, Intervals::clone);
    let gaps = held.iter().enumerate().flat_map(|(set, held)| {
        let gaps = required.without(held);
        let gaps: Vec<Gap> = gaps
            .as_slice()
            .iter()
            .map(|gap| (set, what, *gap))
            .collect();
        gaps
    });
    let gaps = gaps.collect();
    (required.intersection(&held_by_all(held)), gaps)
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

/// The middles of equal parts of the time in `intervals`, a second long or as long as the limit requires.
///
/// Each epoch represents the same time, so that means over epochs are means over time, and none lies at an end, where
/// kernels round.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a whole number from 0 to the limit"
)]
pub(super) fn equally_spaced(intervals: &Intervals) -> Vec<Et> {
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
