//! Frames in order of time, each shot once: outlying times, repeated blocks, resumed downloads.

use std::collections::BTreeMap;

use super::bounds::APART_S;

/// This many successive records with continuous times are a misplaced block rather than outlying times.
const BLOCK: usize = 4;

/// Fault in the position of a record.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Misplaced {
    /// Its time does not fit those around it.
    Order,
    /// The record in this row has the same shots.
    Repeats(usize),
}

/// Whether these frames are in order of time without common shots; then none of them is misplaced.
pub(super) fn in_order(times_s: impl IntoIterator<Item = f64>) -> bool {
    let mut last_s = f64::NEG_INFINITY;
    times_s.into_iter().all(|time_s| {
        let follows = time_s - last_s >= APART_S;
        last_s = time_s;
        follows
    })
}

/// The rows whose times do not fit into the chronology of the file; `None` stands for a record without a valid time.
///
/// The longest chain of successive frames without common shots is kept. Of a misplaced block without repeated shots
/// only the first record is reported: the others are valid.
pub(super) fn misplaced(times_s: &[Option<f64>]) -> BTreeMap<usize, Misplaced> {
    let sound: Vec<(usize, f64)> = times_s
        .iter()
        .enumerate()
        .filter_map(|(row, time_s)| Some((row, (*time_s)?)))
        .collect();
    if in_order(sound.iter().map(|(_, time_s)| *time_s)) {
        return BTreeMap::new();
    }
    let kept = longest_chain(&sound);
    let mut found = BTreeMap::new();
    let mut block: Vec<(usize, f64)> = Vec::new();
    for (index, (row, time_s)) in sound.iter().enumerate() {
        if kept.binary_search(&index).is_ok() {
            tell(&mut found, &mut block);
            continue;
        }
        // Kept frames are in order of time: the first one that could share a shot.
        let at = kept.partition_point(|kept| sound[*kept].1 <= time_s - APART_S);
        match kept.get(at).map(|kept| sound[*kept]) {
            Some((first, kept_s)) if kept_s < time_s + APART_S => {
                tell(&mut found, &mut block);
                found.insert(*row, Misplaced::Repeats(first));
            }
            _ => {
                if block
                    .last()
                    .is_some_and(|(_, last_s)| time_s - last_s < APART_S)
                {
                    tell(&mut found, &mut block);
                }
                block.push((*row, *time_s));
            }
        }
    }
    tell(&mut found, &mut block);
    found
}

/// Enters successive records that are out of order, and clears them.
fn tell(found: &mut BTreeMap<usize, Misplaced>, block: &mut Vec<(usize, f64)>) {
    let told = if block.len() < BLOCK { block.len() } else { 1 };
    found.extend(
        block
            .iter()
            .take(told)
            .map(|(row, _)| (*row, Misplaced::Order)),
    );
    block.clear();
}

/// Indices of a longest chain of times that are `APART_S` or more apart; of several chains, the one with the earliest
/// records.
fn longest_chain(sound: &[(usize, f64)]) -> Vec<usize> {
    // By length of chain, the index that ends one earliest; and for every index, its predecessor in its chain.
    let mut ends: Vec<usize> = Vec::new();
    let mut before: Vec<Option<usize>> = Vec::with_capacity(sound.len());
    for (index, (_, time_s)) in sound.iter().enumerate() {
        let length = ends.partition_point(|end| sound[*end].1 <= time_s - APART_S);
        before.push(length.checked_sub(1).map(|shorter| ends[shorter]));
        match ends.get(length) {
            None => ends.push(index),
            Some(end) if *time_s < sound[*end].1 => ends[length] = index,
            Some(_) => {}
        }
    }
    let mut chain = Vec::with_capacity(ends.len());
    let mut next = ends.last().copied();
    while let Some(index) = next {
        chain.push(index);
        next = before[index];
    }
    chain.reverse();
    chain
}

#[cfg(test)]
mod tests {
    use super::*;
    use Misplaced::{Order, Repeats};

    /// Faults of frames at these multiples of 2 s.
    fn said(frames: &[f64]) -> Vec<(usize, Misplaced)> {
        let times_s: Vec<Option<f64>> = frames.iter().map(|frame| Some(2.0 * frame)).collect();
        misplaced(&times_s).into_iter().collect()
    }

    #[test]
    fn the_wild_time_is_found_and_not_its_neighbours() {
        assert!(said(&[1.0, 2.0, 3.0, 4.0]).is_empty());
        assert!(said(&[1.0, 2.0, 300.0, 301.0]).is_empty());
        assert_eq!(said(&[1.0, 2.0, 99.0, 3.0, 4.0]), [(2, Order)]);
        assert_eq!(said(&[1.0, 2.0, 0.0, 3.0, 4.0]), [(2, Order)]);
        assert_eq!(said(&[99.0, 2.0, 3.0]), [(0, Order)]);
        assert_eq!(said(&[1.0, 2.0, -8.0]), [(2, Order)]);
        assert_eq!(
            said(&[1.0, 2.0, 70.0, 99.0, 3.0, 4.0, 5.0]),
            [(2, Order), (3, Order)]
        );
        assert_eq!(said(&[99.0, 98.0, 3.0, 4.0, 5.0]), [(0, Order), (1, Order)]);
    }

    #[test]
    fn every_shot_counts_once() {
        assert_eq!(said(&[1.0, 2.0, 2.0, 3.0]), [(2, Repeats(1))]);
        assert_eq!(said(&[1.0, 1.5, 2.0, 3.0]), [(1, Repeats(0))]);
        // A download that was resumed two frames too early.
        let resumed = [1.0, 2.0, 3.0, 4.0, 3.0, 4.0, 5.0, 6.0];
        assert_eq!(said(&resumed), [(4, Repeats(2)), (5, Repeats(3))]);
        // A duplicate block, and one that overwrote another.
        assert_eq!(said(&[1.0, 2.0, 1.0, 2.0, 3.0]).len(), 2);
        assert_eq!(
            said(&[1.0, 2.0, 3.0, 1.0, 2.0, 6.0, 7.0]),
            [(3, Repeats(0)), (4, Repeats(1))]
        );
    }

    #[test]
    fn of_a_block_out_of_place_only_the_start_is_told() {
        let swapped = [6.0, 7.0, 8.0, 9.0, 1.0, 2.0, 3.0, 4.0, 5.0];
        assert_eq!(said(&swapped), [(0, Order)]);
    }

    #[test]
    fn records_without_a_time_are_passed_over() {
        let times_s = [Some(2.0), None, Some(4.0), Some(3.0), Some(6.0)];
        let found: Vec<_> = misplaced(&times_s).into_iter().collect();
        assert_eq!(found, [(3, Repeats(0))]);
    }
}
