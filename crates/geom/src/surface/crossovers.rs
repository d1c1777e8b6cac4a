//! Crossovers: places where two profiles measured the same ground.

use nalgebra::{Matrix2, Vector2, Vector3};
use rayon::prelude::*;

use super::{
    Placed, Plan, SharedErrors, SurfaceOptions, SurfaceShot, Variogram,
    variogram::{GAP, usual_step_m},
};
use crate::ellipsoid::height_m;

/// Edge of a cell in which segments of profiles are looked up, metres.
const CELL_M: f64 = 1_000.0;
/// Successive shots on either side of a segment whose differences give the roughness there.
const AROUND: usize = 4;

/// A place where two profiles cross.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Crossover {
    /// Their indices, ascending.
    pub profiles: [usize; 2],
    /// Factors of the errors that the shots of each share.
    pub shared: [SharedErrors; 2],
    /// Position, Mars-fixed, at the mean of both heights, metres.
    pub place_m: Vector3<f64>,
    /// Height from the first profile minus height from the second, each interpolated between two shots, metres.
    pub difference_m: f64,
    /// Standard deviation of this difference by the noise of four shots and by the ground between them, metres: without
    /// the errors that the shots of a profile share.
    pub sigma_m: f64,
    /// Expected change of the ground towards east and north, metres per metre, from the slopes along both profiles.
    pub slope: Vector2<f64>,
    /// Standard deviation of the difference by shifts of both profiles in plan that `slope` does not predict, metres.
    pub beyond_slope_m: f64,
    /// Root mean square slope along the two profiles, metres per metre: more certain than the slope across them.
    pub slope_along: f64,
}

/// A segment between two successive shots of a profile.
struct Segment {
    from: Placed,
    to: Placed,
    /// Index of its first shot.
    at: usize,
    /// Mean square difference of successive heights around it, without noise, m².
    rough_m2: f64,
    /// Slope along it, metres per metre, between shots this far apart, metres.
    slope: f64,
    slope_base_m: f64,
}

/// Every crossing of two profiles, in the order of the profiles.
///
/// `shots` are in their order along the profiles. Gaps of a profile are not crossed. Of each shot only the place in plan is
/// held, and of each segment only its cells: of millions of segments few cross another.
#[must_use]
pub fn crossovers(shots: &[SurfaceShot], options: &SurfaceOptions) -> Vec<Crossover> {
    let model = options.body.model();
    let plan = Plan::around(model, shots.iter().map(|shot| shot.ground_m));
    let tracks = Tracks {
        shots,
        plan_m: (shots.par_iter().map(|shot| plan.of(&shot.ground_m))).collect(),
        options,
    };
    let mut entries = tracks.entries();
    entries.par_sort_unstable();
    let of_cell = |inside: &[([i32; 2], u32)]| {
        let mut found = Vec::new();
        for (position, (own, first)) in inside.iter().enumerate() {
            for (_, second) in &inside[position + 1..] {
                let pair = [*first as usize, *second as usize];
                if let Some((shares, place)) = tracks.crossing(pair)
                    && cell(&place) == *own
                {
                    let [first, second] = pair.map(|at| tracks.segment(at));
                    found.push(crossover(shots, [&first, &second], shares, options));
                }
            }
        }
        found
    };
    let cells = entries.par_chunk_by(|one, next| one.0 == next.0);
    let mut found: Vec<Crossover> = cells.flat_map_iter(of_cell).collect();
    found.sort_by(|one, other| {
        let by_place = one.place_m.z.total_cmp(&other.place_m.z);
        one.profiles.cmp(&other.profiles).then(by_place)
    });
    found
}

/// Shots along profiles with their places in plan.
struct Tracks<'a> {
    shots: &'a [SurfaceShot],
    plan_m: Vec<Vector2<f64>>,
    options: &'a SurfaceOptions,
}

impl Tracks<'_> {
    /// Each segment in every cell of its bounding box, by the index of its first shot.
    fn entries(&self) -> Vec<([i32; 2], u32)> {
        let places = self.shots.iter().zip(&self.plan_m);
        let longest_m = GAP * usual_step_m(places.map(|(shot, plan_m)| (shot.profile, *plan_m)));
        let is_segment = |at: &usize| {
            let length_m = (self.plan_m[at + 1] - self.plan_m[*at]).norm();
            self.shots[*at].profile == self.shots[at + 1].profile
                && length_m > 0.0
                && length_m <= longest_m
        };
        let segments = || (0..self.shots.len().saturating_sub(1)).filter(is_segment);
        let bounds = |at: usize| {
            let [one, other] = [cell(&self.plan_m[at]), cell(&self.plan_m[at + 1])];
            [0, 1].map(|axis| one[axis].min(other[axis])..=one[axis].max(other[axis]))
        };
        let cells = |at: usize| {
            let [east, north] = bounds(at);
            east.flat_map(move |east| north.clone().map(move |north| [east, north]))
        };
        // Counted first: these are the most numerous values of a large site.
        let count = segments().map(|at| cells(at).count()).sum();
        let mut entries = Vec::with_capacity(count);
        for (at, first) in segments().filter_map(|at| Some((at, u32::try_from(at).ok()?))) {
            entries.extend(cells(at).map(|cell| (cell, first)));
        }
        entries
    }

    fn placed(&self, at: usize) -> Placed {
        let (shot, model) = (&self.shots[at], self.options.body.model());
        Placed {
            plan_m: self.plan_m[at],
            height_m: height_m(model, &shot.ground_m).0,
            profile: shot.profile,
            shared: shot.shared(self.options.profile_sigma_m),
        }
    }

    /// The segment from the shot with this index to the next one.
    fn segment(&self, at: usize) -> Segment {
        let profile = self.shots[at].profile;
        let is_own = |at: &usize| self.shots.get(*at).is_some_and(|of| of.profile == profile);
        let before = (at.saturating_sub(AROUND)..at).rev().take_while(is_own);
        let first = before.last().unwrap_or(at);
        let behind = (first..first + 2 * AROUND + 2).take_while(is_own);
        let around: Vec<Placed> = behind.map(|at| self.placed(at)).collect();
        let squares = around
            .windows(2)
            .map(|pair| (pair[1].height_m - pair[0].height_m).powi(2));
        let mean_m2 = squares.sum::<f64>() / (around.len() - 1) as f64;
        let [from, to] = [self.placed(at), self.placed(at + 1)];
        let length_m = (to.plan_m - from.plan_m).norm();
        let wide = [
            at.checked_sub(1).filter(is_own).unwrap_or(at),
            Some(at + 2).filter(is_own).unwrap_or(at + 1),
        ];
        let wide = wide.map(|at| self.placed(at));
        let wide_m = (wide[1].plan_m - wide[0].plan_m).norm().max(length_m);
        Segment {
            from,
            to,
            at,
            rough_m2: (mean_m2 - 2.0 * self.options.shot_sigma_m.powi(2)).max(0.0),
            slope: (wide[1].height_m - wide[0].height_m) / wide_m,
            slope_base_m: wide_m,
        }
    }

    /// Shares of the segments from two shots of different profiles at which they cross, and the place.
    fn crossing(&self, pair: [usize; 2]) -> Option<([f64; 2], Vector2<f64>)> {
        let [first, second] = pair;
        if self.shots[first].profile == self.shots[second].profile {
            return None;
        }
        let [along, across] = pair.map(|at| self.plan_m[at + 1] - self.plan_m[at]);
        let apart = self.plan_m[second] - self.plan_m[first];
        let cross = along.perp(&across);
        let shares = [apart.perp(&across) / cross, apart.perp(&along) / cross];
        // Parallel segments have infinite shares, or NaN.
        let inside = shares.iter().all(|share| (0.0..1.0).contains(share));
        inside.then(|| (shares, self.plan_m[first] + along * shares[0]))
    }
}

fn crossover(
    shots: &[SurfaceShot],
    segments: [&Segment; 2],
    shares: [f64; 2],
    options: &SurfaceOptions,
) -> Crossover {
    let (mut heights_m, mut variance_m2) = ([0.0; 2], 0.0);
    let mut place_m = Vector3::zeros();
    for ((segment, share), height_m) in segments.iter().zip(shares).zip(&mut heights_m) {
        let rest = 1.0 - share;
        *height_m = rest * segment.from.height_m + share * segment.to.height_m;
        let [from, to] = [segment.at, segment.at + 1].map(|at| shots[at].ground_m);
        place_m += 0.5 * (rest * from + share * to);
        let noise = rest * rest + share * share;
        // Of ground with this exponent about the line between two of its points.
        let exponent = 2.0 * Variogram::HURST;
        let of_ground = rest * share.powf(exponent) + share * rest.powf(exponent) - rest * share;
        variance_m2 += noise * options.shot_sigma_m.powi(2) + of_ground * segment.rough_m2;
    }
    let (slope, beyond_slope_m) = expected_slope(segments, options);
    let profiles = segments.map(|segment| segment.from.profile);
    let shared = segments.map(|segment| segment.from.shared);
    let (profiles, shared, sign) = if profiles[0] < profiles[1] {
        (profiles, shared, 1.0)
    } else {
        ([profiles[1], profiles[0]], [shared[1], shared[0]], -1.0)
    };
    Crossover {
        profiles,
        shared,
        place_m,
        difference_m: sign * (heights_m[0] - heights_m[1]),
        sigma_m: variance_m2.sqrt(),
        slope,
        beyond_slope_m,
        slope_along: (0.5 * segments.map(|of| of.slope.powi(2)).iter().sum::<f64>()).sqrt(),
    }
}

/// Best linear prediction of the change of the ground with a shift by the slopes along two segments, metres per metre to the east and
/// north, and the standard deviation of the difference by shifts of both profiles that it does not predict, metres.
///
/// Both slopes are treated as centred on the crossing. The slopes between shots `L` apart in the directions `u₁` and `u₂`, at the
/// angle θ, have the variance `2 γ(L) / L²` and the covariance `2 (γ(L cos ½θ) − γ(L sin ½θ)) / L²`; noise of the shots adds to the
/// variance. Their covariance with the change under a small shift `s` is `2 γ′(½L) uᵢ·s / L`. Profiles that cross at a small angle
/// determine the slope across them poorly.
///
/// # Source
/// Linear prediction from increments: Cressie 1993, Statistics for spatial data, chapter 3.
fn expected_slope(segments: [&Segment; 2], options: &SurfaceOptions) -> (Vector2<f64>, f64) {
    let along = segments.map(|of| of.to.plan_m - of.from.plan_m);
    let length_m = 0.5 * (along[0].norm() + along[1].norm());
    let rough_m2 = 0.5 * (segments[0].rough_m2 + segments[1].rough_m2);
    let of_unit = Variogram { roughness_m: 1.0 };
    let variogram = Variogram {
        roughness_m: (rough_m2 / (2.0 * of_unit.at(length_m))).sqrt(),
    };
    let base_m = 0.5 * (segments[0].slope_base_m + segments[1].slope_base_m);
    let [first, second] = along.map(|along| along.normalize());
    let variance = 2.0 * (variogram.at(base_m) + options.shot_sigma_m.powi(2)) / base_m.powi(2);
    let [cosine_m2, sine_m2] =
        [first + second, first - second].map(|of| variogram.at(0.5 * base_m * of.norm()));
    let between = 2.0 * (cosine_m2 - sine_m2) / base_m.powi(2);
    let covariance = Matrix2::new(variance, between, between, variance);
    // γ′(d) = 2H γ(d) / d, for `d` = ½L.
    let by_shift = 8.0 * Variogram::HURST * variogram.at(0.5 * base_m) / base_m.powi(2);
    let with_shift = Matrix2::from_columns(&[first, second]) * by_shift;
    let prediction = with_shift * covariance.try_inverse().unwrap_or_default();
    let slopes = Vector2::new(segments[0].slope, segments[1].slope);
    // The difference depends on the shift of one profile against the other, on each axis.
    let [one, other] = segments.map(|of| of.from.shared.plan);
    let apart_m = options.profile_plan_sigma_m * one.hypot(other);
    let all_m2 = 2.0 * variogram.at(std::f64::consts::SQRT_2 * apart_m);
    let predicted_m2 = (prediction * with_shift.transpose()).trace() * apart_m.powi(2);
    (prediction * slopes, (all_m2 - predicted_m2).max(0.0).sqrt())
}

#[allow(
    clippy::cast_possible_truncation,
    reason = "a site is a few hundred cells across"
)]
fn cell(place_m: &Vector2<f64>) -> [i32; 2] {
    [place_m.x, place_m.y].map(|component_m| (component_m / CELL_M).floor() as i32)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Expected slope and what it leaves, of segments that cross at this angle on either side of north, on ground of this roughness, with
    /// these slopes along them.
    fn expected(angle_rad: f64, rough_m: f64, slopes: [f64; 2]) -> (Vector2<f64>, f64) {
        let placed = |plan_m: Vector2<f64>, profile: usize| Placed {
            plan_m,
            height_m: 0.0,
            profile,
            shared: SharedErrors::LEAST,
        };
        let half_rad = 0.5 * angle_rad;
        let ends = [half_rad, -half_rad]
            .map(|angle_rad| 150.0 * Vector2::new(angle_rad.sin(), angle_rad.cos()));
        let shots: Vec<[Placed; 2]> = ends
            .iter()
            .enumerate()
            .map(|(profile, end_m)| [placed(-end_m, profile), placed(*end_m, profile)])
            .collect();
        let segment = |index: usize| Segment {
            from: shots[index][0],
            to: shots[index][1],
            at: 2 * index,
            rough_m2: rough_m.powi(2),
            slope: slopes[index],
            slope_base_m: 900.0,
        };
        expected_slope([&segment(0), &segment(1)], &SurfaceOptions::default())
    }

    #[test]
    fn the_ground_across_two_profiles_is_known_the_less_the_smaller_their_angle() {
        let right = std::f64::consts::FRAC_PI_2;
        // Perpendicular slopes are independent: 2H · 2^(1 − 2H) of each by the variogram, less by noise of 1 m.
        let (slope, left_m) = expected(right, 10.0, [0.02, 0.0]);
        let share = 1.4 * 2_f64.powf(-0.4);
        let along = Vector2::new((0.5 * right).sin(), (0.5 * right).cos());
        assert!((slope - 0.02 * share * along).norm() < 2e-4, "{slope}");
        // Slopes that differ along two profiles of a small angle would mean a steep slope across them; noise explains them as well.
        let (across, left_narrow_m) = expected(0.01, 10.0, [0.001, -0.001]);
        assert!(across.x.abs() < 0.05 && across.y.abs() < 1e-9, "{across}");
        assert!(
            left_narrow_m > left_m && left_m > 0.0,
            "{left_narrow_m} {left_m}"
        );
        // All of the ground's change under the shift of one profile against the other, at most.
        let all_m = 10.0 * (2.0 * 70.0 / 300.0_f64).powf(Variogram::HURST);
        assert!(left_narrow_m < all_m, "{left_narrow_m} {all_m}");
    }

    #[test]
    fn flat_ground_has_no_expected_slope() {
        let (slope, left_m) = expected(0.5, 0.0, [0.0, 0.0]);
        assert!(slope.norm() < 1e-12 && left_m < 1e-12, "{slope} {left_m}");
    }
}
