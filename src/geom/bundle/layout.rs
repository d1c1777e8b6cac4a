//! A network laid out for its adjustment: which observations belong to a point, and their weighted rows.

use std::ops::Range;

use nalgebra::Vector3;
use rayon::prelude::*;

use super::{
    Network, PointRejection,
    heights::Heights,
    point_rows::PointRows,
    rows::{self, Row},
    unknowns::{Columns, State},
};
use crate::geom::{
    pushbroom::{ExteriorOrientation, Unseen},
    robust::RobustWeight,
};

/// A point whose rows determine one direction this much worse than another counts as undetermined.
const DIRECTION_RATIO_MIN: f64 = 1e-6;

/// The rows of all views at a state: computed once, and used for the equations, the points and the covariances.
pub(super) struct Linearised {
    pub(super) state: State,
    views: Vec<Result<[Row; 2], Unseen>>,
}

/// A network laid out for its adjustment.
pub(super) struct Layout<'a, M> {
    pub(super) network: &'a Network<M>,
    pub(super) columns: Columns,
    /// Views and ranges of each point.
    pub(super) views: Lists,
    pub(super) ranges: Lists,
    pub(super) robust: Option<RobustWeight>,
    /// Heights that are observed.
    pub(super) heights: Option<Heights>,
    /// Focal pixels per line of each view, initially: the unit of its residual along the track.
    px_per_line: Vec<f64>,
    /// Initial position at the instant of each range.
    range_bases_m: Vec<Vector3<f64>>,
}

/// A list of indices for each key, one after the other in the same memory.
pub(super) struct Lists {
    starts: Vec<usize>,
    indices: Vec<usize>,
}

impl Lists {
    /// Lists of the positions at which each of `count` keys occurs, ascending.
    fn of(count: usize, keys: impl Iterator<Item = usize> + Clone) -> Self {
        let mut starts = vec![0; count + 1];
        for key in keys.clone() {
            starts[key + 1] += 1;
        }
        for key in 0..count {
            starts[key + 1] += starts[key];
        }
        let mut next = starts.clone();
        let mut indices = vec![0; starts[count]];
        for (index, key) in keys.enumerate() {
            indices[next[key]] = index;
            next[key] += 1;
        }
        Self { starts, indices }
    }

    pub(super) fn of_key(&self, key: usize) -> &[usize] {
        &self.indices[self.starts[key]..self.starts[key + 1]]
    }
}

impl<'a, M: ExteriorOrientation> Layout<'a, M> {
    pub(super) fn of(network: &'a Network<M>) -> Self {
        let points = network.points.len();
        let views = network.views.par_iter();
        let ranges = network.ranges.iter();
        Self {
            columns: Columns::of(network),
            views: Lists::of(points, network.views.iter().map(|view| view.point)),
            ranges: Lists::of(points, network.ranges.iter().map(|range| range.point)),
            robust: None,
            heights: None,
            px_per_line: views
                .map(|view| {
                    let ground_m = &network.points[view.point].ground_m;
                    rows::initial_px_per_line(&network.images[view.image], view, ground_m)
                })
                .collect(),
            range_bases_m: ranges
                .map(|range| {
                    network.images[range.image]
                        .base
                        .pose(range.x_lines)
                        .position_m
                })
                .collect(),
            network,
        }
    }

    /// The rows of the view at `index`.
    pub(super) fn view_rows(&self, state: &State, index: usize) -> Result<[Row; 2], Unseen> {
        let view = &self.network.views[index];
        rows::of_view(
            &self.network.images[view.image],
            &state.orientations[view.image],
            self.px_per_line[index],
            view,
            &state.points_m[view.point],
        )
    }

    /// The row of the range at `index`.
    pub(super) fn range_row(&self, state: &State, index: usize) -> Row {
        let range = &self.network.ranges[index];
        rows::of_range(
            &self.network.images[range.image],
            &state.orientations[range.image],
            &self.range_bases_m[index],
            range,
            state.range_biases_m[range.profile],
            &state.points_m[range.point],
        )
    }

    /// The rows of all views at `state`.
    pub(super) fn linearise(&self, state: State) -> Linearised {
        let views = (0..self.network.views.len()).into_par_iter();
        let views = views.map(|index| self.view_rows(&state, index));
        Linearised {
            views: views.collect(),
            state,
        }
    }

    /// Columns of the images and profiles that the rows of `point` contain, in the order of these.
    fn columns_of(&self, point: usize) -> impl Iterator<Item = Range<usize>> + '_ {
        let columns = &self.columns;
        let views = self.views.of_key(point);
        let of_views = views
            .iter()
            .map(|view| columns.images[self.network.views[*view].image].clone());
        let clock = columns.attitude_clock.filter(|_| !views.is_empty());
        let of_clock = clock.map(|column| column..column + 1);
        let of_ranges = self.ranges.of_key(point).iter().flat_map(|range| {
            let range = &self.network.ranges[*range];
            let bias = columns.of_profile[range.profile].map_or(0..0, |column| column..column + 1);
            [columns.images[range.image].clone(), bias]
        });
        of_views.chain(of_ranges).chain(of_clock)
    }

    /// Blocks of the unknowns that the rows of `point` contain, ascending.
    pub(super) fn blocks_of(&self, point: usize) -> Vec<usize> {
        let columns = self.columns_of(point).filter(|columns| !columns.is_empty());
        let mut blocks: Vec<usize> = columns
            .map(|columns| self.columns.block_of(columns.start))
            .collect();
        blocks.sort_unstable();
        blocks.dedup();
        blocks
    }

    /// Fills `rows` with the rows of `point`.
    pub(super) fn fill(
        &self,
        rows: &mut PointRows,
        at: &Linearised,
        point: usize,
    ) -> Result<(), Unseen> {
        let state = &at.state;
        let (views, ranges) = (self.views.of_key(point), self.ranges.of_key(point));
        let columns = &self.columns;
        rows.begin(self.columns_of(point));
        for view in views {
            let pair = at.views[*view]?;
            let (factor, cost) = self.robust_factor(&pair);
            rows.cost += cost;
            let image = self.network.views[*view].image;
            for row in &pair {
                rows.push_observed(row, &columns.of_image[image], factor);
                let clock = self.network.attitude_clock.as_ref();
                if let (Some(clock), Some(column)) = (clock, columns.attitude_clock) {
                    let partial = row.by_rotation.dot(&clock.turns_rad_s[image]);
                    rows.set_last(column, partial * factor.sqrt() / row.sigma);
                }
            }
        }
        for index in ranges {
            let range = &self.network.ranges[*index];
            let row = self.range_row(state, *index);
            rows.cost += (row.misclosure / row.sigma).powi(2);
            rows.push_observed(&row, &columns.of_image[range.image], 1.0);
            if let Some(column) = columns.of_profile[range.profile] {
                rows.set_last(column, 1.0 / row.sigma);
            }
        }
        if let Some(known) = &self.network.points[point].known {
            let from_initial_m = self.network.points[point].ground_m - state.points_m[point];
            for (axis, sigma_m) in known.axes.row_iter().zip(&known.sigma_m) {
                let by_point: Vector3<f64> = axis.transpose() / *sigma_m;
                let misclosure = by_point.dot(&from_initial_m);
                rows.cost += misclosure * misclosure;
                rows.push(by_point, misclosure, (*sigma_m, 1.0));
            }
        }
        Ok(())
    }

    /// Factor of a view's weights, and its part of the sum that is made small.
    fn robust_factor(&self, pair: &[Row; 2]) -> (f64, f64) {
        let squares: f64 = pair
            .iter()
            .map(|row| (row.misclosure / row.sigma).powi(2))
            .sum();
        match self.robust {
            None => (1.0, squares),
            Some(weight) => {
                let z = (0.5 * squares).sqrt();
                (weight.factor(z), 4.0 * weight.cost(z))
            }
        }
    }

    /// Why `point` cannot take part, from its rows at the start.
    pub(super) fn fitness(
        &self,
        rows: &mut PointRows,
        start: &Linearised,
        point: usize,
    ) -> Result<(), PointRejection> {
        self.fill(rows, start, point)
            .map_err(|unseen| match unseen {
                Unseen::BehindCamera => PointRejection::BehindCamera,
                _ => PointRejection::Unseen,
            })?;
        if rows.weights.len() < 3 {
            return Err(PointRejection::Undetermined);
        }
        // The triangle has the singular values of the rows.
        let singular_values = rows.eliminate().singular_values();
        // Written so that NaN is refused.
        if singular_values.min() > DIRECTION_RATIO_MIN * singular_values.max() {
            Ok(())
        } else {
            Err(PointRejection::Undetermined)
        }
    }
}
