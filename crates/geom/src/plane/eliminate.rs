//! Sparse orthogonal decomposition: pictures are eliminated one by one, each by reflections of the rows that touch it.
//!
//! The order is by least degree, so that in a net of many pictures a front stays small. The remaining rows of a
//! picture are a triangle over its neighbours, which is kept until the first of them is eliminated: no row is squared,
//! as in normal equations, and the triangular factor is available for the covariances.

use nalgebra::{Complex, Matrix2, Vector2};

type Number = Complex<f64>;

/// Below this share of its column a pivot is rounding: the unknown is free.
const FREE: f64 = 1e-10;

/// Rows over the same pictures, which are identified by their positions in the order of elimination, ascending.
pub(super) struct Rows {
    pub(super) pictures: Vec<usize>,
    /// Row by row: two numbers per picture, then the right-hand side.
    pub(super) values: Vec<Number>,
    /// The first column of each row that is not 0, ascending.
    pub(super) leads: Vec<usize>,
}

impl Rows {
    fn width(&self) -> usize {
        2 * self.pictures.len() + 1
    }
}

/// Two rows of the triangular factor.
#[derive(Debug)]
pub(super) struct Step {
    pub(super) own: Matrix2<Number>,
    /// Pictures eliminated later that the rows touch, ascending, and the block of each.
    pub(super) later: Vec<(usize, Matrix2<Number>)>,
    value: Vector2<Number>,
}

/// The order in which pictures are eliminated: always one with the fewest neighbours, the first of them by index.
pub(super) fn order_of_least_degree(mut neighbours: Vec<Vec<usize>>) -> Vec<usize> {
    let count = neighbours.len();
    let mut by_degree: std::collections::BTreeSet<(usize, usize)> = neighbours
        .iter()
        .enumerate()
        .map(|(picture, of)| (of.len(), picture))
        .collect();
    let mut order = Vec::with_capacity(count);
    while let Some((_, picture)) = by_degree.pop_first() {
        order.push(picture);
        let around = std::mem::take(&mut neighbours[picture]);
        for &other in &around {
            by_degree.remove(&(neighbours[other].len(), other));
            neighbours[other] = union(&neighbours[other], &around, [picture, other]);
            by_degree.insert((neighbours[other].len(), other));
        }
    }
    order
}

/// The union of two ascending lists, without some elements.
fn union(one: &[usize], two: &[usize], without: [usize; 2]) -> Vec<usize> {
    let mut both = Vec::with_capacity(one.len() + two.len());
    let (mut i, mut j) = (0, 0);
    while i < one.len() || j < two.len() {
        let next = match (one.get(i), two.get(j)) {
            (Some(a), Some(b)) => *a.min(b),
            (Some(a), None) => *a,
            (None, Some(b)) => *b,
            (None, None) => break,
        };
        i += usize::from(one.get(i) == Some(&next));
        j += usize::from(two.get(j) == Some(&next));
        if !without.contains(&next) {
            both.push(next);
        }
    }
    both
}

/// The triangular factor of `rows` over `count` pictures.
///
/// # Errors
/// The position of a picture that the rows leave free.
pub(super) fn factorise(count: usize, rows: Vec<Rows>) -> Result<Vec<Step>, usize> {
    let sizes = column_norms(count, &rows);
    let mut waiting: Vec<Vec<Rows>> = (0..count).map(|_| Vec::new()).collect();
    for rows in rows {
        let first = rows.pictures[0];
        waiting[first].push(rows);
    }
    let mut steps = Vec::with_capacity(count);
    for place in 0..count {
        let parts = std::mem::take(&mut waiting[place]);
        let mut front = Front::assemble(&parts);
        drop(parts);
        front.reduce();
        if !front.holds_first(&sizes[place]) {
            return Err(place);
        }
        let (step, rest) = front.split();
        if let Some(rest) = rest {
            let first = rest.pictures[0];
            waiting[first].push(rest);
        }
        steps.push(step);
    }
    Ok(steps)
}

/// The solution by position in the order of elimination.
pub(super) fn substitute(steps: &[Step]) -> Vec<Vector2<Number>> {
    let mut unknowns = vec![Vector2::zeros(); steps.len()];
    for (place, step) in steps.iter().enumerate().rev() {
        let later = step.later.iter();
        let known = later.fold(step.value, |value, (other, block)| {
            value - block * unknowns[*other]
        });
        unknowns[place] = inverse_of_triangle(&step.own) * known;
    }
    unknowns
}

/// The inverse of an upper triangle whose diagonal is not 0.
pub(super) fn inverse_of_triangle(of: &Matrix2<Number>) -> Matrix2<Number> {
    let (first, second) = (of[(0, 0)].inv(), of[(1, 1)].inv());
    Matrix2::new(
        first,
        -first * of[(0, 1)] * second,
        Number::new(0.0, 0.0),
        second,
    )
}

fn column_norms(count: usize, rows: &[Rows]) -> Vec<[f64; 2]> {
    let mut squares = vec![[0.0; 2]; count];
    for rows in rows {
        for row in rows.values.chunks_exact(rows.width()) {
            for (picture, pair) in rows.pictures.iter().zip(row.chunks_exact(2)) {
                squares[*picture][0] += pair[0].norm_sqr();
                squares[*picture][1] += pair[1].norm_sqr();
            }
        }
    }
    squares.iter().map(|of| of.map(f64::sqrt)).collect()
}

/// All rows that touch a picture, dense, column by column.
struct Front {
    pictures: Vec<usize>,
    rows: usize,
    values: Vec<Number>,
    leads: Vec<usize>,
}

impl Front {
    fn assemble(parts: &[Rows]) -> Self {
        let mut pictures: Vec<usize> = parts
            .iter()
            .flat_map(|part| part.pictures.iter().copied())
            .collect();
        pictures.sort_unstable();
        pictures.dedup();
        let columns: Vec<Vec<usize>> = parts
            .iter()
            .map(|part| {
                let places = part.pictures.iter();
                let places = places.map(|picture| pictures.partition_point(|of| of < picture));
                places
                    .flat_map(|place| [2 * place, 2 * place + 1])
                    .collect()
            })
            .collect();
        let mut order: Vec<(usize, usize, usize)> = Vec::new();
        for (index, part) in parts.iter().enumerate() {
            let leads = part.leads.iter().enumerate();
            order.extend(leads.map(|(row, lead)| (columns[index][*lead], index, row)));
        }
        order.sort_unstable();
        let (rows, right) = (order.len(), 2 * pictures.len());
        let mut values = vec![Number::new(0.0, 0.0); rows * (right + 1)];
        for (row, (_, index, of)) in order.iter().enumerate() {
            let part = &parts[*index];
            let from = &part.values[of * part.width()..(of + 1) * part.width()];
            for (column, value) in columns[*index].iter().chain([&right]).zip(from) {
                values[column * rows + row] = *value;
            }
        }
        Self {
            pictures,
            rows,
            values,
            leads: order.iter().map(|(lead, ..)| *lead).collect(),
        }
    }

    /// Transforms the rows into a staircase by reflections; a row is processed from its first number on.
    fn reduce(&mut self) {
        let right = 2 * self.pictures.len();
        let (mut next, mut end) = (0, 0);
        let mut leads = Vec::new();
        for column in 0..right {
            while end < self.rows && self.leads[end] <= column {
                end += 1;
            }
            if end > next && self.reflect(column, next, end) {
                leads.push(column);
                next += 1;
            }
        }
        self.leads = leads;
    }

    /// Reflects rows `from..to` so that `column` is non-zero only in the first of them; false where it was zero.
    fn reflect(&mut self, column: usize, from: usize, to: usize) -> bool {
        let (head, tail) = self.values.split_at_mut((column + 1) * self.rows);
        let axis = &mut head[column * self.rows + from..column * self.rows + to];
        let size = axis.iter().map(Complex::norm_sqr).sum::<f64>().sqrt();
        if !(size > 0.0) {
            return false;
        }
        if axis.len() == 1 {
            return true;
        }
        let first = axis[0].norm();
        let phase = if first > 0.0 {
            axis[0] / first
        } else {
            Number::new(1.0, 0.0)
        };
        axis[0] += phase * size;
        let factor = 1.0 / (size * (size + first));
        for column in tail.chunks_exact_mut(self.rows) {
            let column = &mut column[from..to];
            let pairs = axis.iter().zip(&*column);
            let share = pairs.map(|(a, c)| a.conj() * c).sum::<Number>() * factor;
            for (value, of) in column.iter_mut().zip(&*axis) {
                *value -= share * of;
            }
        }
        axis.fill(Number::new(0.0, 0.0));
        axis[0] = -phase * size;
        true
    }

    fn at(&self, row: usize, column: usize) -> Number {
        self.values[column * self.rows + row]
    }

    /// Whether the first picture's two pivots exceed the rounding of its columns.
    fn holds_first(&self, sizes: &[f64; 2]) -> bool {
        self.leads.starts_with(&[0, 1]) && (0..2).all(|k| self.at(k, k).norm() > FREE * sizes[k])
    }

    /// The two rows of the first picture, and the rest over the others.
    fn split(self) -> (Step, Option<Rows>) {
        let block = |column: usize| {
            Matrix2::new(
                self.at(0, column),
                self.at(0, column + 1),
                self.at(1, column),
                self.at(1, column + 1),
            )
        };
        let right = 2 * self.pictures.len();
        let later = self.pictures.iter().enumerate().skip(1);
        let step = Step {
            own: block(0),
            later: later
                .map(|(index, picture)| (*picture, block(2 * index)))
                .collect(),
            value: Vector2::new(self.at(0, right), self.at(1, right)),
        };
        // Also without a row: the neighbours are connected from now on.
        let rest = (self.pictures.len() > 1).then(|| Rows {
            pictures: self.pictures[1..].to_vec(),
            values: (2..self.leads.len())
                .flat_map(|row| (2..=right).map(move |column| (row, column)))
                .map(|(row, column)| self.at(row, column))
                .collect(),
            leads: self.leads[2..].iter().map(|lead| lead - 2).collect(),
        });
        (step, rest)
    }
}
