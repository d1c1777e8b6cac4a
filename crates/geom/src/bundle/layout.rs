//! A network prepared for its adjustment: the observations of each point, and their weighted rows.

use std::ops::Range;

use nalgebra::{Matrix3, Vector2, Vector3};
use rayon::prelude::*;

use super::{
    Network, ORIENTATION_UNKNOWNS, PointRejection, Spot, View,
    heights::Heights,
    point_rows::PointRows,
    rows::{self, Row},
    spots::{self, Pointing, SpotRow},
    unknowns::{Columns, State},
};
use crate::{
    pushbroom::{ExteriorOrientation, Unseen},
    robust::RobustWeight,
};

/// Fewest points or views of a task: to give fewer of them to another thread takes as long as to compute them.
pub(super) const OF_A_TASK: usize = 256;

/// A point whose rows determine one direction this much worse than another is undetermined.
const DIRECTION_RATIO_MIN: f64 = 1e-6;

/// The rows of all views at a state, computed once for the equations, the points and the covariances.
pub(super) struct Linearised {
    pub(super) state: State,
    views: Vec<Result<[Row; 2], Unseen>>,
}

/// A network prepared for its adjustment.
pub(super) struct Layout<'a, M> {
    pub(super) network: &'a Network<M>,
    pub(super) columns: Columns,
    /// Views and ranges of each point.
    pub(super) views: Lists,
    pub(super) ranges: Lists,
    /// Spots of each point.
    pub(super) spots: Lists,
    /// Profile that each point is recorded with, where its recorded position may be offset.
    profile_of_point: Vec<Option<usize>>,
    pub(super) robust: Option<RobustWeight>,
    /// Observed heights.
    pub(super) heights: Option<Heights>,
    /// Focal pixels per line of each view, initially: the unit of its residual along the track.
    px_per_line: Vec<f64>,
    /// Focal pixels per line of each spot, initially.
    spot_px_per_line: Vec<f64>,
    /// Motion of each spot with the boresight angles; a spot whose point is not seen is not used.
    spot_by_boresight: Vec<[Vector2<f64>; 2]>,
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
        let bus = network.common_bus.as_ref();
        let spots = bus.map_or(&[][..], |bus| &bus.spots);
        let mut profile_of_point = vec![None; points];
        for (point, profile) in bus.iter().flat_map(|bus| &bus.recorded) {
            profile_of_point[*point] = Some(*profile);
        }
        let px_per_line = |view: &View| {
            let ground_m = &network.points[view.point].ground_m;
            rows::initial_px_per_line(&network.images[view.image], view, ground_m)
        };
        let by_boresight = |spot: &Spot| {
            let image = &network.images[spot.view.image];
            let ground_m = &network.points[spot.view.point].ground_m;
            let moved = spots::by_boresight(image, spot, px_per_line(&spot.view), ground_m);
            moved.unwrap_or_default()
        };
        Self {
            columns: Columns::of(network),
            views: Lists::of(points, network.views.iter().map(|view| view.point)),
            ranges: Lists::of(points, network.ranges.iter().map(|range| range.point)),
            spots: Lists::of(points, spots.iter().map(|spot| spot.view.point)),
            profile_of_point,
            robust: None,
            heights: None,
            px_per_line: views.map(px_per_line).collect(),
            spot_by_boresight: spots.iter().map(by_boresight).collect(),
            spot_px_per_line: spots.iter().map(|spot| px_per_line(&spot.view)).collect(),
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
        let views = views
            .with_min_len(OF_A_TASK)
            .map(|index| self.view_rows(&state, index));
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
        let spots = self.spots.of_key(point);
        let is_seen = !(views.is_empty() && spots.is_empty());
        let clock = columns.attitude_clock.filter(|_| is_seen);
        let of_clock = clock.map(|column| column..column + 1);
        let of_ranges = self.ranges.of_key(point).iter().flat_map(|range| {
            let range = &self.network.ranges[*range];
            let of_profile = columns.profiles[range.profile].clone();
            [columns.images[range.image].clone(), of_profile]
        });
        let bus = self.network.common_bus.as_ref();
        let seen_in = move |spot: &usize| Some(bus?.spots[*spot].view.image);
        let of_spots = spots.iter().filter_map(seen_in);
        let of_spots = of_spots.map(|image| columns.images[image].clone());
        let [first, last] = columns.boresight;
        let of_boresight = first.zip(last).filter(|_| !spots.is_empty());
        let of_boresight = of_boresight.map(|(first, last)| first..last + 1);
        let of_record = self.profile_of_point[point];
        let of_record = of_record.map(|profile| columns.profiles[profile].clone());
        of_views
            .chain(of_ranges)
            .chain(of_clock)
            .chain(of_spots)
            .chain(of_boresight)
            .chain(of_record)
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
                self.by_clock(rows, row, image, factor);
            }
        }
        for spot in self.spots.of_key(point) {
            self.push_spot(rows, state, *spot)?;
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
            // The recorded position: the true position plus the shift of the point's profile.
            let recorded_m = state.points_m[point] + self.shift_m(state, point);
            let from_initial_m = self.network.points[point].ground_m - recorded_m;
            for (axis, sigma_m) in known.axes.row_iter().zip(&known.sigma_m) {
                let by_point: Vector3<f64> = axis.transpose() / *sigma_m;
                let misclosure = by_point.dot(&from_initial_m);
                rows.cost += misclosure * misclosure;
                rows.push(by_point, misclosure, (*sigma_m, 1.0));
                self.by_shift(rows, point, &by_point);
            }
        }
        Ok(())
    }

    fn shift_m(&self, state: &State, point: usize) -> Vector3<f64> {
        let profile = self.profile_of_point[point];
        profile.map_or_else(Vector3::zeros, |profile| state.profile_shifts_m[profile])
    }

    /// East, north and up of the profile that records a point, and the columns of its shift.
    pub(super) fn shift_of(&self, point: usize) -> Option<(Matrix3<f64>, [Option<usize>; 3])> {
        let profile = self.profile_of_point[point]?;
        let bus = self.network.common_bus.as_ref()?;
        let axes = bus.profiles[profile].axes;
        Some((axes, self.columns.shift_of_profile[profile]))
    }

    /// Sets the derivatives by the shift of the point's profile in the last row, one of its coordinates.
    fn by_shift(&self, rows: &mut PointRows, point: usize, by_point: &Vector3<f64>) {
        let Some((axes, columns)) = self.shift_of(point) else {
            return;
        };
        let along = axes * by_point;
        for (column, along) in columns.iter().zip(&along) {
            if let Some(column) = column {
                rows.set_last(*column, *along);
            }
        }
    }

    /// The rows of the spot at `index`; `None` without spots.
    pub(super) fn spot_rows(
        &self,
        state: &State,
        index: usize,
    ) -> Result<Option<[SpotRow; 2]>, Unseen> {
        let bus = self.network.common_bus.as_ref();
        let spot = bus.map(|bus| {
            let spot = &bus.spots[index];
            let image = spot.view.image;
            let pointing = Pointing {
                px_per_line: self.spot_px_per_line[index],
                late_s: state.line_times_s[image],
                boresight_rad: state.boresight_rad,
                by_boresight: self.spot_by_boresight[index],
            };
            spots::of_spot(
                &self.network.images[image],
                &state.orientations[image],
                spot,
                &pointing,
                &state.points_m[spot.view.point],
            )
        });
        spot.transpose()
    }

    /// Appends the rows of the spot at `index`.
    fn push_spot(&self, rows: &mut PointRows, state: &State, index: usize) -> Result<(), Unseen> {
        let columns = &self.columns;
        let bus = self.network.common_bus.as_ref();
        let image = bus.map_or(0, |bus| bus.spots[index].view.image);
        for spot in self.spot_rows(state, index)?.iter().flatten() {
            let row = &spot.row;
            rows.cost += (row.misclosure / row.sigma).powi(2);
            rows.push_observed(row, &columns.of_image[image], 1.0);
            self.by_clock(rows, row, image, 1.0);
            let [first, second] = columns.boresight;
            let [by_first, by_second] = spot.by_boresight;
            let time_bias = columns.of_image[image][ORIENTATION_UNKNOWNS];
            let line_time = columns.line_time_of_image[image];
            let own = [
                (first, by_first),
                (second, by_second),
                (line_time, spot.by_line_time),
                (time_bias, spot.by_time),
            ];
            for (column, partial) in own {
                if let Some(column) = column {
                    rows.set_last(column, partial / row.sigma);
                }
            }
        }
        Ok(())
    }

    /// Sets the derivative by the attitude clock in the last row, one of `image`.
    fn by_clock(&self, rows: &mut PointRows, row: &Row, image: usize, factor: f64) {
        let clock = self.network.attitude_clock.as_ref();
        if let (Some(clock), Some(column)) = (clock, self.columns.attitude_clock) {
            let partial = row.by_rotation.dot(&clock.turns_rad_s[image]);
            rows.set_last(column, partial * factor.sqrt() / row.sigma);
        }
    }

    /// Factor of a view's weights, and its part of the minimised sum.
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

    /// Reason why `point` cannot be adjusted, from its rows at the start.
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
        // Written so that NaN is rejected.
        if singular_values.min() > DIRECTION_RATIO_MIN * singular_values.max() {
            Ok(())
        } else {
            Err(PointRejection::Undetermined)
        }
    }
}
