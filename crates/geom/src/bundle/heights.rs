//! Observed heights: the surface under the points, and its uncertainty.

use nalgebra::{DMatrix, DVector, Vector3};

use super::unknowns::State;
use crate::{
    ellipsoid::height_m,
    surface::{LaserSurface, SurfaceHeights},
};

/// Observed heights, as of the last evaluation of the surface.
#[derive(Clone)]
pub(super) struct Heights {
    /// Their points.
    pub(super) points: Vec<usize>,
    /// Positions of the points then.
    places_m: Vec<Vector3<f64>>,
    pub(super) surface: SurfaceHeights,
    /// Profiles of the surface with their own unknown shift and its columns, where heights depend on planimetry.
    pub(super) shared: Vec<(usize, [Option<usize>; 3])>,
    /// Inflation of each variance because its residual is too large for it.
    pub(super) inflation_m2: DVector<f64>,
}

/// Points that moved by less than this keep their surface, metres: a hundredth of a metre in height on a slope of 1 %.
const MOVED_M: f64 = 1.0;
/// Degrees of freedom of Student's distribution for the weights of heights: craters between the profiles give the
/// errors of a surface longer tails than the normal distribution has.
const STUDENT_FREEDOM: f64 = 4.0;

impl Heights {
    /// The surface under the `points` that take part; where heights depend on planimetry, `shared` profiles have their
    /// own unknowns.
    pub(super) fn at(
        surface: &LaserSurface,
        points: Vec<usize>,
        shared: Vec<(usize, [Option<usize>; 3])>,
        state: &State,
    ) -> Self {
        let places_m: Vec<Vector3<f64>> = points.iter().map(|at| state.points_m[*at]).collect();
        Self {
            surface: predicted(surface, &places_m, &shared),
            shared,
            inflation_m2: DVector::zeros(points.len()),
            places_m,
            points,
        }
    }

    /// Re-evaluates the surface at the current points; returns whether they had moved.
    pub(super) fn follow(&mut self, surface: &LaserSurface, state: &State) -> bool {
        let places_m: Vec<Vector3<f64>> =
            self.points.iter().map(|at| state.points_m[*at]).collect();
        let moved = places_m.iter().zip(&self.places_m);
        let moved = moved.map(|(now, before)| (now - before).norm());
        if moved.fold(0.0, f64::max) < MOVED_M {
            return false;
        }
        self.surface = predicted(surface, &places_m, &self.shared);
        self.places_m = places_m;
        true
    }

    /// Positions of the points at the last evaluation of the surface, metres.
    pub(super) fn places_m(&self) -> &[Vector3<f64>] {
        &self.places_m
    }

    /// Covariance of the observed heights, robust weights included, m².
    pub(super) fn covariance_m2(&self) -> DMatrix<f64> {
        let mut covariance_m2 = self.surface.covariance_m2.clone();
        for (index, inflation_m2) in self.inflation_m2.iter().enumerate() {
            covariance_m2[(index, index)] += inflation_m2;
        }
        covariance_m2
    }

    /// Height of the point at `index` above the surface, metres, and its change with the point.
    pub(super) fn difference_m(&self, state: &State, index: usize) -> (f64, Vector3<f64>) {
        let place_m = &state.points_m[self.points[index]];
        let (height_m, by_point) = height_m(self.surface.body.model(), place_m);
        let difference_m = height_m - self.surface.heights_m[index];
        match &self.surface.relief {
            None => (difference_m, by_point),
            Some(relief) => {
                let by_place = relief.by_place[index];
                let moved_m = place_m - self.places_m[index];
                let shifted = self.by_shared(index);
                let shifted_m: f64 = shifted
                    .map(|(column, by_shift)| by_shift * state.corrections[column])
                    .sum();
                let difference_m = difference_m - by_place.dot(&moved_m) - shifted_m;
                (difference_m, by_point - by_place)
            }
        }
    }

    /// Change of the height at `index`, as measured minus predicted, with profile shifts that are separate unknowns,
    /// and the columns of these.
    pub(super) fn by_shared(&self, index: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        let profiles = self
            .surface
            .relief
            .iter()
            .flat_map(|relief| &relief.profiles);
        profiles.flat_map(move |profile| {
            let mut shared = self.shared.iter();
            let columns = shared.find(|(surface_profile, _)| *surface_profile == profile.profile);
            let columns = columns.map_or([None; 3], |(_, columns)| *columns);
            let by_shift: [f64; 3] = profile.by_shift.column(index).into_owned().into();
            let pairs = columns.into_iter().zip(by_shift);
            pairs.filter_map(|(column, by_shift)| Some((column?, by_shift)))
        })
    }

    /// The heights without the planimetric information of slopes, and without its uncertainty.
    pub(super) fn without_plan(&self) -> Self {
        let mut heights = self.clone();
        heights.surface.relief = None;
        heights.shared.clear();
        heights.surface.covariance_m2 = heights.surface.without_plan_m2.clone();
        heights
    }

    /// Robust weights from the part of each height that the rays leave undetermined; returns the largest change of a
    /// standard deviation, metres.
    pub(super) fn reweigh(
        &mut self,
        misclosures_m: &DVector<f64>,
        ray_variances_m2: &DVector<f64>,
    ) -> f64 {
        let mut changed_m = 0.0_f64;
        for (index, of_rays_m) in misclosures_m.iter().enumerate() {
            let variance_m2 = self.surface.covariance_m2[(index, index)] + ray_variances_m2[index];
            let weight =
                (STUDENT_FREEDOM + 1.0) / (STUDENT_FREEDOM + of_rays_m * of_rays_m / variance_m2);
            let inflation_m2 = variance_m2 * (1.0 / weight.min(1.0) - 1.0);
            let before_m2 = self.inflation_m2[index];
            changed_m = changed_m.max(
                ((variance_m2 + inflation_m2).sqrt() - (variance_m2 + before_m2).sqrt()).abs(),
            );
            self.inflation_m2[index] = inflation_m2;
        }
        changed_m
    }
}

/// The surface at some positions; its errors do not include the effect of shifts of `shared` profiles.
fn predicted(
    surface: &LaserSurface,
    places_m: &[Vector3<f64>],
    shared: &[(usize, [Option<usize>; 3])],
) -> SurfaceHeights {
    let mut heights = surface.predict(places_m);
    let Some(relief) = &heights.relief else {
        return heights;
    };
    let is_shared = |profile: usize| shared.iter().any(|(of, _)| *of == profile);
    let profiles = relief.profiles.iter().enumerate();
    for (at, profile) in profiles.filter(|(_, of)| is_shared(of.profile)) {
        let own_m2 = relief.covariance_m2.fixed_view::<3, 3>(3 * at, 3 * at);
        heights.covariance_m2 -= profile.by_shift.tr_mul(&(own_m2 * &profile.by_shift));
    }
    heights
}
