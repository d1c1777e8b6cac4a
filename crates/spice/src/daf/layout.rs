//! Layout of the words of a segment, for each type of segment, from the counts at its end.
//!
//! Source: NAIF, SPK, CK and PCK Required Reading, one section for each type.

use super::whole;
use crate::role::KernelRole;

/// Entries of a time list between two entries of its directory.
pub(super) const DIRECTORY_STEP: usize = 100;
/// Difference lines of SPK type 1 (type 21 states the number itself).
const DIFFERENCES: usize = 15;
/// Largest degree of interpolation that CSPICE supports.
const DEGREE_MAX: usize = 27;
/// Words of a state: position and velocity.
pub(super) const STATE: usize = 6;

/// A segment: packets, then lists of times with their directories, then counts.
#[derive(Debug)]
pub(super) struct Layout {
    pub(super) packets: usize,
    pub(super) packet: Packet,
    pub(super) lists: Vec<List>,
    /// Words at the end that contain these counts.
    pub(super) tail: usize,
}

/// Content of one packet.
#[derive(Debug, Clone, Copy)]
pub(super) enum Packet {
    /// Numbers without further rules.
    Numbers(usize),
    /// Modified difference arrays with this number of difference lines.
    Differences(usize),
    /// Words of a record: mid-point and radius of a stretch of time, then Chebyshev coefficients.
    Chebyshev {
        words: usize,
        /// Start of the first stretch, ET seconds.
        begin_s: f64,
        length_s: f64,
    },
    /// Words of a packet, of which the first four are a quaternion.
    Quaternion(usize),
}

/// A list after the packets.
#[derive(Debug, Clone, Copy)]
pub(super) enum List {
    /// Increasing times.
    Times(usize),
    /// Entries that repeat every hundredth of the list with that index.
    Directory { of: usize, entries: usize },
}

impl Layout {
    /// Words of the complete segment.
    pub(super) fn words(&self) -> usize {
        let lists = self.lists.iter().map(|list| match list {
            List::Times(count) => *count,
            List::Directory { entries, .. } => *entries,
        });
        let packets = self.packets.saturating_mul(self.packet.words());
        lists.fold(packets.saturating_add(self.tail), usize::saturating_add)
    }
}

impl Packet {
    pub(super) const fn words(self) -> usize {
        match self {
            Self::Numbers(words) | Self::Quaternion(words) | Self::Chebyshev { words, .. } => words,
            // An epoch, the step sizes, a state, the differences of three axes, and four counts.
            Self::Differences(lines) => 4 * lines + 11,
        }
    }
}

/// The layout of a segment; `None` for types without a rule here.
///
/// * `kind` – its type
/// * `rates` – whether a CK has angular velocities
/// * `words` – number of words of the segment
/// * `tail` – its last words, at most eight
///
/// # Errors
/// The problem with the counts.
pub(super) fn layout(
    role: KernelRole,
    kind: i32,
    rates: bool,
    words: usize,
    tail: &[f64],
) -> Result<Option<Layout>, String> {
    let tail = Tail {
        words: tail,
        segment: words,
    };
    match (role, kind) {
        (KernelRole::Spk, 1) => differences(&tail, DIFFERENCES, 1),
        (KernelRole::Spk, 21) => {
            let lines = tail.count(2, "difference lines")?;
            differences(&tail, lines, 2)
        }
        (KernelRole::Spk, 2) | (KernelRole::Pck, 2 | 3) => chebyshev(&tail, 3),
        (KernelRole::Spk, 3) => chebyshev(&tail, STATE),
        (KernelRole::Spk, 5) => {
            tail.positive(2, "gravitational parameter")?;
            let states = tail.count(1, "states")?;
            Ok(discrete(
                Packet::Numbers(STATE),
                states,
                states / DIRECTORY_STEP,
                2,
            ))
        }
        (KernelRole::Spk, 8 | 12) => {
            let states = tail.count(1, "states")?;
            tail.degree(2, states)?;
            tail.positive(3, "step")?;
            Ok(Some(Layout {
                packets: states,
                packet: Packet::Numbers(STATE),
                lists: Vec::new(),
                tail: 4,
            }))
        }
        (KernelRole::Spk, 9 | 13) => {
            let states = tail.count(1, "states")?;
            tail.degree(2, states)?;
            Ok(discrete(
                Packet::Numbers(STATE),
                states,
                before_last(states),
                2,
            ))
        }
        (KernelRole::Spk, 18) => {
            let packets = tail.count(1, "packets")?;
            tail.degree(2, packets + 1)?;
            let size = tail.size_of_subtype(3, &[12, 6, 6])?;
            Ok(discrete(
                Packet::Numbers(size),
                packets,
                before_last(packets),
                3,
            ))
        }
        (KernelRole::Ck, 1) => {
            let pointings = tail.count(1, "pointings")?;
            Ok(discrete(
                quaternion(rates),
                pointings,
                before_last(pointings),
                1,
            ))
        }
        (KernelRole::Ck, 2) => arcs_of_constant_rate(words),
        (KernelRole::Ck, 3) => intervals(&tail, quaternion(rates), 2),
        (KernelRole::Ck, 5) => {
            let window = tail.count(3, "points of the window")?;
            if window > DEGREE_MAX + 1 {
                return Err(format!("an interpolation window of {window} points"));
            }
            tail.positive(5, "rate of the clock")?;
            let size = tail.size_of_subtype(4, &[8, 4, 14, 7])?;
            intervals(&tail, Packet::Quaternion(size), 5)
        }
        _ => Ok(None),
    }
}

const fn quaternion(rates: bool) -> Packet {
    Packet::Quaternion(if rates { 7 } else { 4 })
}

/// Entries of a directory that does not repeat the last time of its list.
const fn before_last(times: usize) -> usize {
    times.saturating_sub(1) / DIRECTORY_STEP
}

#[allow(
    clippy::unnecessary_wraps,
    reason = "the same signature for all layouts"
)]
fn discrete(packet: Packet, packets: usize, entries: usize, tail: usize) -> Option<Layout> {
    Some(Layout {
        packets,
        packet,
        lists: vec![List::Times(packets), List::Directory { of: 0, entries }],
        tail,
    })
}

fn differences(tail: &Tail, lines: usize, words: usize) -> Result<Option<Layout>, String> {
    let records = tail.count(1, "records")?;
    let packet = Packet::Differences(lines);
    Ok(discrete(packet, records, records / DIRECTORY_STEP, words))
}

fn chebyshev(tail: &Tail, components: usize) -> Result<Option<Layout>, String> {
    let records = tail.count(1, "records")?;
    let words = tail.count(2, "words of a record")?;
    if words < 2 + components || (words - 2) % components != 0 {
        return Err(format!(
            "records of {words} words for {components} components"
        ));
    }
    let length_s = tail.positive(3, "length of a record")?;
    let packet = Packet::Chebyshev {
        words,
        begin_s: tail.word_before_end(4)?,
        length_s,
    };
    Ok(Some(Layout {
        packets: records,
        packet,
        lists: Vec::new(),
        tail: 4,
    }))
}

/// Pointings and the intervals of their interpolation, at the end of CK types 3 and 5.
fn intervals(tail: &Tail, packet: Packet, words: usize) -> Result<Option<Layout>, String> {
    let pointings = tail.count(1, "pointings")?;
    let intervals = tail.count(2, "intervals")?;
    if intervals > pointings {
        return Err(format!("{intervals} intervals of {pointings} pointings"));
    }
    Ok(Some(Layout {
        packets: pointings,
        packet,
        lists: vec![
            List::Times(pointings),
            List::Directory {
                of: 0,
                entries: before_last(pointings),
            },
            List::Times(intervals),
            List::Directory {
                of: 2,
                entries: before_last(intervals),
            },
        ],
        tail: words,
    }))
}

/// CK type 2 states no count: the number of records follows from the number of words.
fn arcs_of_constant_rate(words: usize) -> Result<Option<Layout>, String> {
    const EACH: usize = 10;
    let of = |records: usize| EACH * records + before_last(records);
    let near = words * 100 / 1_001;
    let records = (near.saturating_sub(1)..=near + 1)
        .find(|records| of(*records) == words)
        .ok_or_else(|| format!("{words} words, which is not a whole number of records"))?;
    Ok(Some(Layout {
        packets: records,
        packet: Packet::Quaternion(8),
        lists: vec![
            List::Times(records),
            List::Times(records),
            List::Directory {
                of: 0,
                entries: before_last(records),
            },
        ],
        tail: 0,
    }))
}

/// The last words of a segment.
struct Tail<'a> {
    words: &'a [f64],
    segment: usize,
}

impl Tail<'_> {
    /// The word `place` words before the end, from 1.
    fn word_before_end(&self, place: usize) -> Result<f64, String> {
        let index = self.words.len().checked_sub(place);
        index.map(|index| self.words[index]).ok_or_else(|| {
            format!(
                "{} words, too few for the type of the segment",
                self.segment
            )
        })
    }

    /// A count: at least one, and no more than the segment has words.
    fn count(&self, place: usize, what: &str) -> Result<usize, String> {
        let value = self.word_before_end(place)?;
        whole(value)
            .filter(|count| (1..=self.segment).contains(count))
            .ok_or_else(|| {
                format!(
                    "its number of {what} is {value:?}, in a segment of {} words",
                    self.segment
                )
            })
    }

    fn positive(&self, place: usize, what: &str) -> Result<f64, String> {
        let value = self.word_before_end(place)?;
        if value.is_finite() && value > 0.0 {
            return Ok(value);
        }
        Err(format!("its {what} is {value:?}"))
    }

    /// A degree of interpolation, or of Hermite interpolation half of it, less than the number of `states`.
    fn degree(&self, place: usize, states: usize) -> Result<(), String> {
        let degree = self.word_before_end(place)?;
        let possible = |degree: &usize| *degree <= DEGREE_MAX && *degree < states;
        if whole(degree).as_ref().is_some_and(possible) {
            return Ok(());
        }
        Err(format!(
            "interpolation of degree {degree:?} over {states} states"
        ))
    }

    fn size_of_subtype(&self, place: usize, sizes: &[usize]) -> Result<usize, String> {
        let value = self.word_before_end(place)?;
        let subtype = whole(value).and_then(|subtype| sizes.get(subtype));
        subtype
            .copied()
            .ok_or_else(|| format!("its subtype is {value:?}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Words that a segment of that type and those counts has.
    fn words(role: KernelRole, kind: i32, rates: bool, segment: usize, tail: &[f64]) -> usize {
        let found = layout(role, kind, rates, segment, tail).unwrap();
        found.unwrap().words()
    }

    #[test]
    fn layouts_are_those_of_required_reading() {
        let spk = |kind, tail: &[f64]| words(KernelRole::Spk, kind, false, 100_000, tail);
        assert_eq!(spk(1, &[200.0]), 71 * 200 + 200 + 2 + 1);
        assert_eq!(spk(21, &[25.0, 200.0]), 111 * 200 + 200 + 2 + 2);
        assert_eq!(spk(2, &[0.0, 60.0, 35.0, 10.0]), 35 * 10 + 4);
        assert_eq!(spk(3, &[0.0, 60.0, 38.0, 10.0]), 38 * 10 + 4);
        assert_eq!(spk(5, &[4.0e4, 200.0]), 7 * 200 + 2 + 2);
        assert_eq!(spk(8, &[0.0, 60.0, 7.0, 200.0]), 6 * 200 + 4);
        assert_eq!(spk(13, &[7.0, 200.0]), 7 * 200 + 1 + 2);
        assert_eq!(spk(13, &[7.0, 201.0]), 7 * 201 + 2 + 2);
        assert_eq!(spk(18, &[1.0, 8.0, 200.0]), 7 * 200 + 1 + 3);
        let ck = |kind, rates, tail: &[f64]| words(KernelRole::Ck, kind, rates, 100_000, tail);
        assert_eq!(ck(1, true, &[200.0]), 8 * 200 + 1 + 1);
        assert_eq!(ck(3, true, &[110.0, 200.0]), 8 * 200 + 1 + 110 + 1 + 2);
        assert_eq!(ck(3, false, &[10.0, 200.0]), 5 * 200 + 1 + 10 + 2);
        assert_eq!(
            ck(5, true, &[1e-4, 3.0, 4.0, 10.0, 200.0]),
            8 * 200 + 1 + 10 + 5
        );
    }

    #[test]
    fn ck_type_2_is_counted_from_its_words() {
        for records in [1, 99, 100, 101, 102, 5_000, 50_001] {
            let total = 10 * records + (records - 1) / 100;
            assert_eq!(words(KernelRole::Ck, 2, true, total, &[]), total);
        }
        assert!(layout(KernelRole::Ck, 2, true, 25, &[]).is_err());
    }

    #[test]
    fn counts_that_cannot_be_are_told() {
        let spk =
            |kind, tail: &[f64]| layout(KernelRole::Spk, kind, false, 1_000, tail).unwrap_err();
        assert_eq!(
            spk(13, &[7.0, f64::NAN]),
            "its number of states is NaN, in a segment of 1000 words"
        );
        assert_eq!(
            spk(13, &[7.0]),
            "1000 words, too few for the type of the segment"
        );
        assert_eq!(
            spk(2, &[0.0, 60.0, 36.0, 10.0]),
            "records of 36 words for 3 components"
        );
        assert_eq!(spk(8, &[0.0, -60.0, 7.0, 20.0]), "its step is -60.0");
        assert_eq!(spk(18, &[3.0, 8.0, 20.0]), "its subtype is 3.0");
        assert!(
            layout(KernelRole::Spk, 15, false, 16, &[])
                .unwrap()
                .is_none()
        );
    }
}
