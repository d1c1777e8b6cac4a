//! Automatic division of a net into bricks.

use std::collections::BTreeMap;

use super::net::Net;

/// Divides the pictures into bricks of at most about `size` pictures that share many points: the brick of every
/// picture, counted from 0 in the order of their first pictures.
///
/// A brick grows by the picture with most points in common with it, two at least. A remainder of fewer than half of
/// `size` joins the brick with most points in common.
#[must_use]
pub fn grow_bricks(net: &Net, size: usize) -> Vec<usize> {
    let shared = shared_points(net);
    let mut brick_of = vec![None; net.pictures];
    let mut bricks: Vec<Vec<usize>> = Vec::new();
    for start in 0..net.pictures {
        if brick_of[start].is_some() {
            continue;
        }
        let mut brick = vec![start];
        brick_of[start] = Some(bricks.len());
        let mut common: BTreeMap<usize, usize> = BTreeMap::new();
        let mut last = start;
        while brick.len() < size {
            for (other, count) in &shared[last] {
                *common.entry(*other).or_default() += count;
            }
            common.retain(|picture, _| brick_of[*picture].is_none());
            // The first of those with most points.
            let next = common.iter().rev().max_by_key(|(_, count)| **count);
            let Some((&next, _)) = next.filter(|(_, count)| **count >= 2) else {
                break;
            };
            brick_of[next] = Some(bricks.len());
            brick.push(next);
            last = next;
        }
        bricks.push(brick);
    }
    join_small(&shared, &mut bricks, &mut brick_of, size);
    numbered(&brick_of)
}

/// Joins bricks of fewer than half of `size` to those with which they have most in common.
fn join_small(
    shared: &[BTreeMap<usize, usize>],
    bricks: &mut [Vec<usize>],
    brick_of: &mut [Option<usize>],
    size: usize,
) {
    for brick in 0..bricks.len() {
        if 2 * bricks[brick].len() >= size {
            continue;
        }
        let mut common: BTreeMap<usize, usize> = BTreeMap::new();
        for (other, count) in bricks[brick].iter().flat_map(|picture| &shared[*picture]) {
            if let Some(of) = brick_of[*other].filter(|of| *of != brick) {
                *common.entry(of).or_default() += count;
            }
        }
        let best = common.iter().rev().max_by_key(|(_, count)| **count);
        let Some((&into, _)) = best.filter(|(_, count)| **count >= 2) else {
            continue;
        };
        let moved = std::mem::take(&mut bricks[brick]);
        for picture in &moved {
            brick_of[*picture] = Some(into);
        }
        bricks[into].extend(moved);
    }
}

/// Bricks counted from 0 in the order of their first pictures.
fn numbered(brick_of: &[Option<usize>]) -> Vec<usize> {
    let mut number: BTreeMap<Option<usize>, usize> = BTreeMap::new();
    let numbered = brick_of.iter().map(|brick| {
        let next = number.len();
        *number.entry(*brick).or_insert(next)
    });
    numbered.collect()
}

/// Number of points that every pair of pictures shares.
fn shared_points(net: &Net) -> Vec<BTreeMap<usize, usize>> {
    let mut shared = vec![BTreeMap::new(); net.pictures];
    for measured in net.by_point().iter() {
        for one in measured {
            for two in measured {
                let pair = [one, two].map(|index| net.measurements[*index].picture);
                if pair[0] != pair[1] {
                    *shared[pair[0]].entry(pair[1]).or_default() += 1;
                }
            }
        }
    }
    shared
}
