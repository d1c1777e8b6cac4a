//! Seam lines: which orthoimage each block of cells is taken from.
//!
//! An orthoimage keeps the ground that it shows alone, and the ground that lies clearly farther inside the image than in any
//! other. In the corridor between, the differences of overlapping images are flooded from these markers, the greatest
//! first: images meet where they differ least.
//!
//! # Source
//! Soille 2006, *Morphological image compositing*, IEEE Trans. Pattern Anal. Mach. Intell. 28(5): watershed of an image of
//! differences from markers; flooding by an ordered queue: Meyer 1991.

use std::collections::VecDeque;

/// Without an image.
pub(super) const NOBODY: u8 = u8::MAX;
/// An orthoimage keeps a block that is this many times as far inside it as in the next one.
const CLEARLY: f64 = 3.0;

/// Blocks of cells, row by row.
pub(super) struct Blocks {
    /// Rows and columns.
    pub(super) size: [usize; 2],
    /// Difference of the orthoimages that show a block, in any unit.
    pub(super) differences: Vec<u8>,
    /// The orthoimages that show most of it, by bits.
    pub(super) shown: Vec<Set>,
    /// The orthoimage that keeps it, or [`NOBODY`].
    pub(super) markers: Vec<u8>,
}

/// Some orthoimages.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Set(u64);

impl Set {
    /// Largest number of orthoimages.
    pub(super) const MOST: usize = 64;

    pub(super) const fn insert(&mut self, of: u8) {
        self.0 |= 1 << of;
    }

    pub(super) const fn has(self, of: u8) -> bool {
        self.0 & (1 << of) != 0
    }

    pub(super) fn each(self) -> impl Iterator<Item = u8> + Clone {
        (0..64).filter(move |of| self.has(*of))
    }
}

/// The orthoimage that keeps a block, by the distances from the edges of those that show it; or [`NOBODY`].
pub(super) fn marker(distances: &[(u8, f64)]) -> u8 {
    let best = distances
        .iter()
        .max_by(|one, other| one.1.total_cmp(&other.1));
    let Some((best, distance)) = best else {
        return NOBODY;
    };
    let others = distances.iter().filter(|(of, _)| of != best);
    let next = others.map(|(_, distance)| *distance).fold(0.0, f64::max);
    let is_clear = distances.len() == 1 || *distance > CLEARLY * next;
    if is_clear { *best } else { NOBODY }
}

impl Blocks {
    /// The orthoimage of every block; [`NOBODY`] where none shows it.
    pub(super) fn labels(&self) -> Vec<u8> {
        let mut flood = Flood {
            blocks: self,
            labels: self.markers.clone(),
            queues: vec![VecDeque::new(); 256],
        };
        for (at, marker) in self.markers.iter().enumerate() {
            if *marker != NOBODY {
                flood.queues[0].push_back(at);
            }
        }
        flood.run();
        // Ground that no marker reaches: images whose edges coincide.
        for at in 0..self.shown.len() {
            if flood.labels[at] == NOBODY
                && let Some(first) = self.shown[at].each().next()
            {
                flood.labels[at] = first;
                flood.queues[0].push_back(at);
                flood.run();
            }
        }
        flood.labels
    }
}

struct Flood<'a> {
    blocks: &'a Blocks,
    labels: Vec<u8>,
    /// Labelled blocks by the level at which their neighbours are reached: 0 for the greatest differences.
    queues: Vec<VecDeque<usize>>,
}

impl Flood<'_> {
    fn run(&mut self) {
        let mut level = 0;
        while level < self.queues.len() {
            let Some(at) = self.queues[level].pop_front() else {
                level += 1;
                continue;
            };
            let label = self.labels[at];
            for next in self.neighbours(at).into_iter().flatten() {
                if self.labels[next] == NOBODY && self.blocks.shown[next].has(label) {
                    self.labels[next] = label;
                    let own = usize::from(u8::MAX - self.blocks.differences[next]);
                    self.queues[own.max(level)].push_back(next);
                }
            }
        }
    }

    /// The four blocks beside a block.
    fn neighbours(&self, at: usize) -> [Option<usize>; 4] {
        let [rows, columns] = self.blocks.size;
        let [row, column] = [at / columns, at % columns];
        [
            (row > 0).then(|| at - columns),
            (column > 0).then(|| at - 1),
            (column + 1 < columns).then(|| at + 1),
            (row + 1 < rows).then(|| at + columns),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn both() -> Set {
        let mut set = Set::default();
        set.insert(0);
        set.insert(1);
        set
    }

    #[test]
    fn images_meet_where_they_differ_least() {
        let size = [40, 60];
        let valley = |row: usize| 20 + row / 2;
        let cells = || (0..size[0]).flat_map(|row| (0..size[1]).map(move |column| [row, column]));
        let blocks = Blocks {
            size,
            differences: cells()
                .map(|[row, column]| if column == valley(row) { 2 } else { 30 })
                .collect(),
            shown: vec![both(); size[0] * size[1]],
            markers: cells()
                .map(|[_, column]| match column {
                    0..10 => 0,
                    50.. => 1,
                    _ => NOBODY,
                })
                .collect(),
        };
        let labels = blocks.labels();
        for ([row, column], label) in cells().zip(labels) {
            if column != valley(row) {
                assert_eq!(label, u8::from(column > valley(row)), "{row} {column}");
            }
        }
    }

    #[test]
    fn no_block_is_of_an_image_that_does_not_show_it() {
        let one = |of: u8| {
            let mut set = Set::default();
            set.insert(of);
            set
        };
        // Shown by both, by none, by the second, by both; no marker but that of the ground of one alone.
        let shown = vec![both(), Set::default(), one(1), both()];
        let blocks = Blocks {
            size: [1, 4],
            differences: vec![5, 0, 0, 5],
            shown,
            markers: vec![NOBODY, NOBODY, 1, NOBODY],
        };
        assert_eq!(blocks.labels(), [0, NOBODY, 1, 1]);
        assert_eq!(Set::default().each().count(), 0);
        assert!(one(63).has(63) && !one(63).has(0));
    }

    #[test]
    fn an_image_keeps_what_lies_clearly_inside_it() {
        assert_eq!(marker(&[]), NOBODY);
        assert_eq!(marker(&[(7, 0.0)]), 7);
        assert_eq!(marker(&[(7, 20.0), (9, 100.0)]), 9);
        assert_eq!(marker(&[(7, 60.0), (9, 100.0)]), NOBODY);
    }
}
