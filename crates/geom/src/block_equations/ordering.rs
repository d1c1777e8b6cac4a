//! An order of blocks in which those that occur together are close together.

use std::collections::VecDeque;

use super::BlockPattern;

/// In patterns of more blocks than this, those that meet more than half of the others come last: unknowns common to all
/// images. Among the images they would make the envelope as wide as the matrix; at its end each is a row.
const SHARED_LAST_ABOVE: usize = 16;

/// The reverse Cuthill–McKee order: the block at each position. Ties are broken by index. Blocks that most others meet
/// come last.
pub(super) fn order(pattern: &BlockPattern) -> Vec<usize> {
    let neighbours = neighbours(pattern);
    let mut order = Vec::with_capacity(neighbours.len());
    let is_shared = |block: &usize| {
        neighbours.len() > SHARED_LAST_ABOVE && 2 * neighbours[*block].len() > neighbours.len()
    };
    let mut is_taken: Vec<bool> = (0..neighbours.len())
        .map(|block| is_shared(&block))
        .collect();
    let mut by_degree: Vec<usize> = (0..neighbours.len()).collect();
    by_degree.sort_by_key(|block| neighbours[*block].len());
    for start in by_degree {
        if is_taken[start] {
            continue;
        }
        // A peripheral block of its component: the last of a breadth-first search from any block.
        let walk = breadth_first(&neighbours, start, &mut is_taken.clone());
        let end = walk.last().copied().unwrap_or(start);
        order.extend(breadth_first(&neighbours, end, &mut is_taken));
    }
    order.reverse();
    order.extend((0..neighbours.len()).filter(is_shared));
    order
}

/// The neighbours of each block, those with the fewest neighbours first.
fn neighbours(pattern: &BlockPattern) -> Vec<Vec<usize>> {
    let mut neighbours = vec![Vec::new(); pattern.blocks()];
    for block in 0..pattern.blocks() {
        for other in pattern.met(block) {
            if *other != block {
                neighbours[block].push(*other);
                neighbours[*other].push(block);
            }
        }
    }
    let degrees: Vec<usize> = neighbours.iter().map(Vec::len).collect();
    for list in &mut neighbours {
        list.sort_by_key(|block| (degrees[*block], *block));
    }
    neighbours
}

/// Blocks not yet taken that are connected with `start`, from near to far.
fn breadth_first(neighbours: &[Vec<usize>], start: usize, is_taken: &mut [bool]) -> Vec<usize> {
    let mut reached = Vec::new();
    let mut queue = VecDeque::from([start]);
    is_taken[start] = true;
    while let Some(block) = queue.pop_front() {
        reached.push(block);
        for next in &neighbours[block] {
            if !is_taken[*next] {
                is_taken[*next] = true;
                queue.push_back(*next);
            }
        }
    }
    reached
}
