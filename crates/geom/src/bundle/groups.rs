//! Points grouped by the shared unknowns that their rows contain: a group's equations are one small dense matrix.

use std::sync::Arc;

use super::layout::Layout;
use crate::{block_equations::BlockPattern, pushbroom::ExteriorOrientation};

/// Points of a group; larger sets are divided. Fixed, so that sums do not depend on the number of threads.
const GROUP_MAX: usize = 256;

/// Points whose rows contain the same shared unknowns.
pub(super) struct Group {
    /// Blocks of these unknowns, ascending.
    pub(super) blocks: Vec<usize>,
    /// The points, ascending.
    pub(super) points: Vec<usize>,
}

/// The points that are used.
pub(super) struct PointGroups {
    /// All of them, ascending.
    pub(super) points: Vec<usize>,
    /// All points by groups.
    pub(super) groups: Vec<Group>,
    /// Pattern of the blocks that occur together.
    pub(super) pattern: Arc<BlockPattern>,
}

impl PointGroups {
    pub(super) fn of<M: ExteriorOrientation>(layout: &Layout<'_, M>, points: Vec<usize>) -> Self {
        let mut by_blocks: Vec<(Vec<usize>, usize)> = points
            .iter()
            .map(|point| (layout.blocks_of(*point), *point))
            .collect();
        by_blocks.sort_unstable();
        let mut groups: Vec<Group> = Vec::new();
        for (blocks, point) in by_blocks {
            match groups.last_mut() {
                Some(group) if group.blocks == blocks && group.points.len() < GROUP_MAX => {
                    group.points.push(point);
                }
                _ => groups.push(Group {
                    blocks,
                    points: vec![point],
                }),
            }
        }
        let connected: Vec<[usize; 2]> = layout.columns.connected_blocks().collect();
        let cliques = groups.iter().map(|group| group.blocks.as_slice());
        let cliques = cliques.chain(connected.iter().map(<[_; 2]>::as_slice));
        Self {
            pattern: BlockPattern::of(layout.columns.blocks.clone(), cliques),
            points,
            groups,
        }
    }
}
