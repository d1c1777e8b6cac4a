//! Brightness of an orthoimage or a mosaic in larger cells, for display.

use areograph_base::column::{Tiles, spans};
use serde::{Deserialize, Serialize};

/// Cells along the longer side of an orthoimage on a page.
pub(crate) const LOOK: usize = 1_000;

/// An orthoimage in larger cells.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct OrthoimageLook {
    /// Rows and columns.
    pub size: [usize; 2],
    /// Mean brightness, row by row; 0 where there is none.
    pub brightness: Vec<u8>,
}

impl OrthoimageLook {
    /// In cells so large that no side has more than [`LOOK`] of them.
    pub(crate) fn of(cells: &Tiles) -> Self {
        let [rows, columns] = cells.size();
        let step = rows.max(columns).div_ceil(LOOK).max(1);
        let size = [rows.div_ceil(step), columns.div_ceil(step)];
        let mut sums = vec![[0_u32; 2]; size[0] * size[1]];
        for [rows, columns] in spans([rows, columns]) {
            let Some(pixels) = cells.filled_window(&rows, &columns) else {
                continue;
            };
            for (row, pixels) in rows.zip(pixels.chunks_exact(columns.len())) {
                for (column, pixel) in columns.clone().zip(pixels) {
                    if *pixel > 0 {
                        let [sum, count] = &mut sums[row / step * size[1] + column / step];
                        *sum += u32::from(*pixel);
                        *count += 1;
                    }
                }
            }
        }
        let mean = |[sum, count]: &[u32; 2]| u8::try_from(sum / (*count).max(1)).unwrap_or(u8::MAX);
        Self {
            size,
            brightness: sums.iter().map(mean).collect(),
        }
    }
}
