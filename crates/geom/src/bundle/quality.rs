//! Covariances, residuals, redundancy numbers and correlations of the converged adjustment.

use nalgebra::{DMatrix, Matrix3, Vector3};
use rayon::prelude::*;

use super::{
    AdjustedImage, AdjustedPoint, Adjustment, ORIENTATION_UNKNOWNS, PointRejection, Residual,
    estimates::{estimate, of_bus, prior},
    factor::Factor,
    groups::{Group, PointGroups},
    layout::{Layout, Linearised},
    mean_parts::MeanParts,
    point_rows::PointRows,
    reduce::Settled,
    reduced_heights::ReducedHeights,
    relative::{Mean, against_profile},
    relief,
    unknowns::{State, Unknown},
};
use crate::{block_equations::BlockMatrix, pushbroom::ExteriorOrientation};

/// Correlations above this are reported.
const CORRELATION_REPORTED: f64 = 0.95;

/// The contribution of one point: its estimate, and a residual for each of its rows.
struct Judged {
    point: AdjustedPoint,
    residuals: Vec<Residual>,
}

/// Effect of observed heights on their points.
struct Controls {
    /// Index among the heights of each point that has one.
    of_point: Vec<Option<usize>>,
    /// `u` of each.
    turned: Vec<Vector3<f64>>,
    /// `Q Gᵀ Σ⁻¹`, one column per height, and `Σ⁻¹ − Σ⁻¹ G Q Gᵀ Σ⁻¹`.
    through: DMatrix<f64>,
    left: DMatrix<f64>,
}

/// Effect of an observed height on its point.
struct Control<'a> {
    turned: &'a Vector3<f64>,
    through: &'a [f64],
    left: f64,
}

impl Controls {
    fn of(reduced: &ReducedHeights, points: &[usize], of: usize, factor: &Factor) -> Option<Self> {
        let mut of_point = vec![None; of];
        for (index, point) in points.iter().enumerate() {
            of_point[*point] = Some(index);
        }
        let (through, left) = factor.through_heights()?;
        Some(Self {
            of_point,
            turned: reduced.turned.clone(),
            through,
            left,
        })
    }

    fn of_point(&self, point: usize) -> Option<Control<'_>> {
        let index = self.of_point[point]?;
        Some(Control {
            turned: &self.turned[index],
            left: self.left[(index, index)],
            through: column_of(&self.through, index),
        })
    }
}

/// The adjustment at convergence; the caller fills in observations, unknowns and history.
pub(super) fn judge<M: ExteriorOrientation>(
    layout: &Layout<'_, M>,
    settled: &Settled,
    groups: &PointGroups,
    fitness: &[Result<(), PointRejection>],
    factor: &Factor,
) -> Adjustment {
    let Settled { at, reduced } = settled;
    let state = &at.state;
    let cofactors = &factor.cofactors(&reduced.matrix);
    let heights = layout.heights.as_ref().zip(reduced.heights.as_ref());
    let controls =
        heights.and_then(|(of, reduced)| Controls::of(reduced, &of.points, fitness.len(), factor));
    let judged = judge_points(layout, at, groups, fitness, cofactors, controls.as_ref());
    let mut adjustment = Adjustment {
        images: (0..layout.network.images.len())
            .map(|image| judge_image(layout, state, image, cofactors))
            .collect(),
        points: Vec::with_capacity(judged.len()),
        views: vec![None; layout.network.views.len()],
        ranges: vec![None; layout.network.ranges.len()],
        range_biases_m: layout
            .columns
            .of_profile
            .iter()
            .map(|column| column.map(|column| estimate(state, cofactors, column)))
            .collect(),
        attitude_clock_s: layout
            .columns
            .attitude_clock
            .map(|column| estimate(state, cofactors, column)),
        common_bus: of_bus(layout, state, cofactors),
        heights: heights
            .zip(controls.as_ref())
            .map_or_else(Vec::new, |((of, reduced), controls)| {
                reduced.residuals(of, &controls.left)
            }),
        heights_settled: true,
        compared: Vec::new(),
        height_squares: 0.0,
        mean_cofactor_m2: None,
        mean_parts: None,
        relief: None,
        observations: 0,
        unknowns: 0,
        weighted_squares: 0.0,
        history: Vec::new(),
        correlated: correlated(layout, cofactors),
    };
    for (index, entry) in judged.into_iter().enumerate() {
        adjustment.points.push(entry.map(|judged| {
            let squares = judged.residuals.iter().map(Residual::weighted_square);
            adjustment.weighted_squares += squares.sum::<f64>();
            let mut residuals = judged.residuals.into_iter();
            for view in layout.views.of_key(index) {
                adjustment.views[*view] =
                    residuals.next().zip(residuals.next()).map(<[_; 2]>::from);
            }
            for spot in layout.spots.of_key(index) {
                let pair = residuals.next().zip(residuals.next()).map(<[_; 2]>::from);
                if let Some(bus) = &mut adjustment.common_bus {
                    bus.spots[*spot] = pair;
                }
            }
            for range in layout.ranges.of_key(index) {
                adjustment.ranges[*range] = residuals.next();
            }
            judged.point
        }));
    }
    for (column, sigma) in layout.columns.sigmas.iter().enumerate() {
        let off = layout.columns.off_prior(&state.corrections, column);
        adjustment.weighted_squares += (off / sigma).powi(2);
    }
    if let Some((of, reduced)) = heights {
        adjustment.height_squares = reduced.weighted_squares();
        adjustment.weighted_squares += adjustment.height_squares;
        if let Some(mean) = Mean::of(layout, at, &of.points, factor, reduced) {
            adjustment.mean_cofactor_m2 = Some(mean.cofactor_m2);
            adjustment.mean_parts = Some(MeanParts::of(layout, of, &mean));
            mean.compare(layout, at, &mut adjustment.points);
        }
        let left = controls.as_ref().map(|controls| &controls.left);
        adjustment.relief = relief::of_site(layout, settled, of, left);
    }
    adjustment
}

/// Every point, in the order of the network.
fn judge_points<M: ExteriorOrientation>(
    layout: &Layout<'_, M>,
    at: &Linearised,
    groups: &PointGroups,
    fitness: &[Result<(), PointRejection>],
    cofactors: &BlockMatrix,
    controls: Option<&Controls>,
) -> Vec<Result<Judged, PointRejection>> {
    let of_group = |group: &Group| -> Vec<Option<Judged>> {
        // The points of a group need only one small matrix of the cofactors.
        let local = cofactors.local(&group.blocks);
        let mut room = Room::default();
        let points = group.points.iter();
        points
            .map(|point| judge_point(layout, at, *point, &local, controls, &mut room))
            .collect()
    };
    let by_groups: Vec<Vec<Option<Judged>>> = groups.groups.par_iter().map(of_group).collect();
    let mut judged: Vec<Result<Judged, PointRejection>> = fitness
        .iter()
        .map(|fitness| Err(fitness.err().unwrap_or(PointRejection::Undetermined)))
        .collect();
    for (group, of_group) in groups.groups.iter().zip(by_groups) {
        for (point, found) in group.points.iter().zip(of_group) {
            judged[*point] = found.ok_or(PointRejection::Undetermined);
        }
    }
    judged
}

/// Workspace of one point, reused for the next.
#[derive(Default)]
struct Room {
    rows: PointRows,
    transformed: PointRows,
    /// Cofactors between the point, transformed by its triangle, and the shared unknowns of its rows.
    between: Vec<Vector3<f64>>,
}

/// One point, with the cofactors of the shared unknowns in its rows.
fn judge_point<M: ExteriorOrientation>(
    layout: &Layout<'_, M>,
    at: &Linearised,
    point: usize,
    cofactors: &DMatrix<f64>,
    controls: Option<&Controls>,
    room: &mut Room,
) -> Option<Judged> {
    let Room {
        rows,
        transformed,
        between,
    } = room;
    layout.fill(rows, at, point).ok()?;
    transformed.clone_from(rows);
    let inverse = transformed.eliminate().try_inverse()?;
    let coupling = [0, 1, 2].map(|row| transformed.row(row));
    between.clear();
    between.extend((0..cofactors.ncols()).map(|place| {
        let cofactors = column_of(cofactors, place);
        Vector3::from(coupling.map(|coupling| dot(cofactors, coupling)))
    }));
    // Cofactors of the point transformed by its triangle: the part that its rays leave undetermined, plus the part of
    // the shared unknowns, minus the part of an observed height.
    let mut transformed_cofactor = Matrix3::identity();
    for (place, between) in between.iter().enumerate() {
        transformed_cofactor += between * Vector3::from(coupling.map(|row| row[place])).transpose();
    }
    if let Some(control) = controls.and_then(|controls| controls.of_point(point)) {
        let through = Vector3::from(coupling.map(|row| {
            let columns = rows.columns().zip(row);
            columns
                .map(|(column, partial)| partial * control.through[column])
                .sum()
        }));
        let mixed = through * control.turned.transpose();
        let own = control.turned * control.turned.transpose();
        transformed_cofactor += mixed + mixed.transpose() - own * control.left;
        for (between, column) in between.iter_mut().zip(rows.columns()) {
            *between += control.turned * control.through[column];
        }
    }
    let residuals: Vec<Residual> = (0..rows.weights.len())
        .map(|row| {
            // The effects on the row of the point, of the shared unknowns, and of both together.
            let own = inverse.tr_mul(&rows.by_point[row]);
            let mut leverage = own.dot(&(transformed_cofactor * own));
            let partials = rows.row(row);
            for (place, between) in between.iter().enumerate() {
                let partial = partials[place];
                if partial != 0.0 {
                    let cofactors = column_of(cofactors, place);
                    let before = dot(&cofactors[..place], partials);
                    leverage += partial
                        * (2.0 * before + cofactors[place] * partial - 2.0 * between.dot(&own));
                }
            }
            residual_of(rows, row, leverage)
        })
        .collect();
    let priors = layout.network.points[point]
        .known
        .and_then(|_| residuals.last_chunk::<3>().copied());
    let cofactor_m2 = inverse * transformed_cofactor * inverse.transpose();
    // Cofactors between the point and the shared unknowns of its rows.
    let moved = |place: usize| -inverse * between[place];
    Some(Judged {
        point: AdjustedPoint {
            ground_m: at.state.points_m[point],
            cofactor_m2,
            relative_m2: against_profile(layout, point, rows, cofactors, moved)
                .map(|added_m2| cofactor_m2 + added_m2),
            priors,
        },
        residuals,
    })
}

/// A column of a matrix.
fn column_of(matrix: &DMatrix<f64>, column: usize) -> &[f64] {
    &matrix.as_slice()[column * matrix.nrows()..(column + 1) * matrix.nrows()]
}

/// Sum of products over the length of the first.
fn dot(first: &[f64], second: &[f64]) -> f64 {
    first.iter().zip(second).map(|(a, b)| a * b).sum()
}

fn residual_of(rows: &PointRows, row: usize, leverage: f64) -> Residual {
    let (sigma, weight_factor) = rows.weights[row];
    let misclosure = rows.row(row)[rows.width - 1];
    Residual {
        value: misclosure * sigma / weight_factor.sqrt(),
        sigma,
        // Rounding may leave it a little outside.
        redundancy: (1.0 - leverage).clamp(0.0, 1.0),
        weight_factor,
    }
}

fn judge_image<M: ExteriorOrientation>(
    layout: &Layout<'_, M>,
    state: &State,
    image: usize,
    cofactors: &BlockMatrix,
) -> AdjustedImage {
    let columns = &layout.columns.of_image[image];
    // A correction is an unknown of the image plus, for rotations, the rotation by the attitude clock.
    let shares = |coefficient: usize| {
        let clock = layout.network.attitude_clock.as_ref();
        let turn_rad_s = match clock {
            Some(clock) if coefficient >= 9 && coefficient.is_multiple_of(3) => {
                clock.turns_rad_s[image][coefficient / 3 - 3]
            }
            _ => 0.0,
        };
        let own = columns[coefficient].map(|column| (column, 1.0));
        let of_clock = layout.columns.attitude_clock;
        own.into_iter()
            .chain(of_clock.map(|column| (column, turn_rad_s)))
    };
    let between = |row: usize, column: usize| -> f64 {
        let pairs = shares(row).flat_map(|row| shares(column).map(move |column| (row, column)));
        let cofactors = pairs.filter_map(|((row, by_row), (column, by_column))| {
            Some(by_row * by_column * cofactors.element(row, column)?)
        });
        cofactors.fold(0.0, |sum, cofactor| sum + cofactor)
    };
    AdjustedImage {
        correction: state.orientations[image],
        cofactors: DMatrix::from_fn(ORIENTATION_UNKNOWNS, ORIENTATION_UNKNOWNS, between),
        priors: std::array::from_fn(|coefficient| {
            prior(layout, state, cofactors, columns[coefficient]?)
        }),
        time_bias_s: columns[ORIENTATION_UNKNOWNS].map(|column| estimate(state, cofactors, column)),
    }
}

/// Correlations of unknowns that occur together: of one image, and of images that share points.
fn correlated<M: ExteriorOrientation>(
    layout: &Layout<'_, M>,
    cofactors: &BlockMatrix,
) -> Vec<(Unknown, Unknown, f64)> {
    let deviations: Vec<f64> = cofactors.diagonal().into_iter().map(f64::sqrt).collect();
    let unknowns = &layout.columns.unknowns;
    let pattern = cofactors.pattern();
    let mut pairs = Vec::new();
    for right in 0..pattern.blocks() {
        for left in pattern.met(right) {
            let Some(block) = cofactors.block(*left, right) else {
                continue;
            };
            for (row, first) in pattern.columns(*left).enumerate() {
                for (column, second) in pattern.columns(right).enumerate() {
                    let coefficient =
                        block[(row, column)] / (deviations[first] * deviations[second]);
                    if first < second && coefficient.abs() > CORRELATION_REPORTED {
                        pairs.push((first, second, coefficient));
                    }
                }
            }
        }
    }
    pairs.sort_by_key(|(first, second, _)| (*first, *second));
    pairs
        .into_iter()
        .map(|(first, second, coefficient)| (unknowns[first], unknowns[second], coefficient))
        .collect()
}
