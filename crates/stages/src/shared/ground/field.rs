//! Numbers of cells as a field: between cells, without holes, smoothed.

/// A number of every cell, row by row.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Field {
    /// Rows and columns.
    pub(crate) size: [usize; 2],
    pub(crate) values: Vec<f32>,
}

impl Field {
    /// A field with one number everywhere.
    pub(crate) fn even(size: [usize; 2], value: f32) -> Self {
        Self {
            size,
            values: vec![value; size[0] * size[1]],
        }
    }

    /// The number between four cells, beyond the edge the number of the cells at the edge; rows and columns count from
    /// the middle of the first cell.
    fn between(&self, row: f64, column: f64) -> f32 {
        let [row, column] =
            [(row, 0), (column, 1)].map(|(at, axis)| Between::of(at, self.size[axis]));
        let rows = row
            .ends
            .map(|at| &self.values[at * self.size[1]..][..self.size[1]]);
        let [upper, lower] = rows.map(|row| column.of_row(row));
        upper + row.share * (lower - upper)
    }

    /// The field in cells of half the edge, of which there are `size`.
    pub(crate) fn doubled(&self, size: [usize; 2]) -> Self {
        let place = |at: usize| 0.5 * at as f64 - 0.25;
        let cells = (0..size[0]).flat_map(|row| (0..size[1]).map(move |column| (row, column)));
        Self {
            size,
            values: cells
                .map(|(row, column)| self.between(place(row), place(column)))
                .collect(),
        }
    }

    /// The field with its holes (NaN) filled from coarser and coarser means around them; 0 where there is no number at
    /// all.
    pub(crate) fn filled(mut self) -> Self {
        if self.values.iter().all(|value| !value.is_nan()) {
            return self;
        }
        if self.size.iter().all(|length| *length <= 1) {
            self.values.fill(0.0);
            return self;
        }
        let coarse = self.means().filled();
        let [_, columns] = self.size;
        for (at, value) in self.values.iter_mut().enumerate() {
            if value.is_nan() {
                let place = |cell: usize| 0.5 * cell as f64 - 0.25;
                *value = coarse.between(place(at / columns), place(at % columns));
            }
        }
        self
    }

    /// Means of two cells by two, of those that have a number.
    fn means(&self) -> Self {
        let size = self.size.map(|length| length.div_ceil(2));
        let mut sums = vec![[0.0_f32; 2]; size[0] * size[1]];
        for (at, value) in self.values.iter().enumerate() {
            if !value.is_nan() {
                let [row, column] = [at / self.size[1], at % self.size[1]];
                let sum = &mut sums[row / 2 * size[1] + column / 2];
                *sum = [sum[0] + value, sum[1] + 1.0];
            }
        }
        // A cell without a number has 0/0.
        let values = sums.into_iter().map(|[sum, count]| sum / count).collect();
        Self { size, values }
    }

    /// Means over squares of `2 half + 1` cells, less of them at the edge.
    pub(crate) fn smoothed(&self, half: usize) -> Self {
        let [rows, columns] = self.size;
        let across = means_of_runs(&self.values, rows, [columns, 1], half);
        Self {
            size: self.size,
            values: means_of_runs(&across, columns, [rows, columns], half),
        }
    }
}

/// A place between two cells of a row or column.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Between {
    ends: [usize; 2],
    share: f32,
}

impl Between {
    /// At a place of `count` cells, 0 in the middle of the first one; beyond the edge at the cell at the edge.
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped to the field just before; numbers keep the precision of the field"
    )]
    pub(crate) fn of(at: f64, count: usize) -> Self {
        let at = at.clamp(0.0, (count - 1) as f64);
        let first = (at as usize).min(count.saturating_sub(2));
        Self {
            ends: [first, (first + 1).min(count - 1)],
            share: (at - first as f64) as f32,
        }
    }

    /// The number there.
    pub(crate) fn of_row(&self, row: &[f32]) -> f32 {
        let [one, other] = self.ends.map(|at| row[at]);
        one + self.share * (other - one)
    }

    /// The row of a field at this place between two rows, at the cells that `columns` need.
    pub(crate) fn row_of(&self, field: &Field, columns: &[Self], row: &mut [f32]) {
        let ends = [columns.first(), columns.last()];
        let [Some(first), Some(last)] = ends else {
            return;
        };
        let span = first.ends[0]..last.ends[1] + 1;
        let width = field.size[1];
        let [above, below] = self
            .ends
            .map(|at| &field.values[at * width..][span.clone()]);
        let rows = above.iter().zip(below);
        for (number, (above, below)) in row[span.clone()].iter_mut().zip(rows) {
            *number = above + self.share * (below - above);
        }
    }
}

/// Means along `runs` rows (step 1) or columns (step of a row) of `length` numbers each.
#[allow(
    clippy::cast_possible_truncation,
    reason = "the precision of the field is kept"
)]
fn means_of_runs(values: &[f32], runs: usize, [length, step]: [usize; 2], half: usize) -> Vec<f32> {
    let mut means = vec![0.0; values.len()];
    for run in 0..runs {
        let first = if step == 1 { run * length } else { run };
        let at = |place: usize| first + place * step;
        let mut sum = 0.0_f64;
        let (mut from, mut to) = (0, 0);
        for place in 0..length {
            let end = (place + half + 1).min(length);
            while to < end {
                sum += f64::from(values[at(to)]);
                to += 1;
            }
            while from + half < place {
                sum -= f64::from(values[at(from)]);
                from += 1;
            }
            means[at(place)] = (sum / (to - from) as f64) as f32;
        }
    }
    means
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A plane over rows and columns.
    fn plane(size: [usize; 2]) -> Field {
        let cells = (0..size[0]).flat_map(|row| (0..size[1]).map(move |column| [row, column]));
        Field {
            size,
            values: cells
                .map(|[row, column]| 3.0 * row as f32 - 2.0 * column as f32)
                .collect(),
        }
    }

    #[test]
    fn a_plane_stays_a_plane() {
        let field = plane([9, 14]);
        let fine = field.doubled([18, 28]);
        // Half a cell of the coarse field is one of the fine one; rounding.
        assert!((fine.between(8.5, 11.5) - field.between(4.0, 5.5)).abs() < 1e-4);
        let smooth = field.smoothed(2);
        for row in 2..7 {
            for column in 2..12 {
                let at = row * 14 + column;
                assert!((smooth.values[at] - field.values[at]).abs() < 1e-4);
            }
        }
    }

    #[test]
    fn holes_are_closed_from_around_and_known_numbers_stay() {
        let whole = plane([16, 16]);
        let mut holed = whole.clone();
        for row in 5..9 {
            holed.values[row * 16 + 6..row * 16 + 10].fill(f32::NAN);
        }
        let filled = holed.clone().filled();
        for (at, value) in filled.values.iter().enumerate() {
            if holed.values[at].is_nan() {
                // Within the change of the plane over the hole and a cell around it.
                assert!((value - whole.values[at]).abs() < 15.0, "{value}");
            } else {
                assert_eq!(value.to_bits(), whole.values[at].to_bits());
            }
        }
        let nothing = Field::even([3, 4], f32::NAN).filled();
        assert_eq!(nothing, Field::even([3, 4], 0.0));
    }
}
