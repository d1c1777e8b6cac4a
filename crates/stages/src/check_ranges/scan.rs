//! The clock correction that minimises the spread of the range residuals of a profile.
//!
//! Shifting the spacecraft by a time `c` changes the residual of shot `k` by about `c` times the rate of its line of
//! sight. A common change does not alter the spread, so a profile determines the bias only when that rate varies along
//! it: well when the spacecraft holds an inertial attitude off nadir (about 3 m/s²), hardly at nadir (below 0.03 m/s²).
//! The uncertainty reflects this.
//!
//! Over a revolution the error of the file's orbit is a wave in the residuals that masks a bias. Crossovers remove most
//! of it: radii corrected by them are scanned as well, and used where they reduce the spread.

use nalgebra::{Matrix3, SMatrix, SVector, Vector3};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::spacecraft_grid::SpacecraftGrid;
use areograph_base::{
    body::Body,
    footprints::Footprint,
    frames::{BodyFixed, Position},
    time::Et,
};
use areograph_config::{RangeCheckConfig, SCAN_STEPS_MAX};
use areograph_geom::{
    body_rotation::body_rotation,
    range_residuals::{footprint, own_spacecraft, range_residual_m},
    statistics::{Trend, mean_and_deviation},
};

/// Fewest shots for a meaningful scan.
const SHOTS_MIN: usize = 10;

/// Largest half widths of scans interpolated from five and from seven residuals of each shot, seconds.
const NARROW_S: [f64; 2] = [0.5, 2.0];

/// Half the time over which the rate of a line of sight is measured, seconds.
const RATE_STEP_S: f64 = 0.01;

/// Corrected radii are used when their least spread is below this share of the least spread of raw radii: reductions by
/// chance, or where crossovers carry no information, are smaller.
const CALMER: f64 = 0.98;

/// Radius of footprints.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum ScannedRadius {
    /// As ranges give it.
    #[default]
    Raw,
    /// Corrected by crossovers.
    Crossover,
}

impl ScannedRadius {
    /// Its name.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Raw => "raw",
            Self::Crossover => "crossover",
        }
    }
}

/// Spread of range − distance against the assumed clock correction.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct BiasScan {
    /// Radius of the footprints.
    pub radius: ScannedRadius,
    /// Assumed corrections, seconds added to the tags.
    pub correction_s: Vec<f64>,
    /// Standard deviation of range − distance at each, metres.
    pub spread_m: Vec<f64>,
    /// Correction of least spread, refined by a parabola through the variance, seconds.
    ///
    /// `None` when the least spread lies at an end of the scan.
    pub best_s: Option<f64>,
    /// Standard uncertainty of `best_s`, seconds: from the remaining residuals with the correlation of
    /// neighbours, and from the uncertainty of the orbit.
    pub uncertainty_s: Option<f64>,
}

impl BiasScan {
    /// Scans a profile by its shots in IAU 2000, without outliers, in time order; `None` for fewer than ten.
    #[must_use]
    pub(crate) fn of(
        shots: &[Footprint],
        grid: &SpacecraftGrid<'_>,
        limits: &RangeCheckConfig,
    ) -> Option<Self> {
        if shots.len() < SHOTS_MIN {
            return None;
        }
        let sighted: Vec<Sighted> = shots.iter().map(Sighted::of).collect();
        let [mut raw, mut crossover] =
            [ScannedRadius::Raw, ScannedRadius::Crossover].map(Self::empty);
        let corrections: Vec<f64> = corrections(limits).collect();
        let half_width_s = corrections.last().copied().unwrap_or(0.0);
        let interpolated = match NARROW_S.map(|narrow_s| half_width_s <= narrow_s) {
            [true, _] => interpolated_spreads_m::<5>(&sighted, grid, &corrections),
            [_, true] => interpolated_spreads_m::<7>(&sighted, grid, &corrections),
            _ => None,
        };
        let spreads_m = interpolated.unwrap_or_else(|| spreads_m(&sighted, grid, &corrections));
        for (correction_s, spreads_m) in corrections.into_iter().zip(spreads_m) {
            // Corrections beyond the coverage of the kernels are omitted.
            for (scan, spread_m) in [&mut raw, &mut crossover]
                .into_iter()
                .zip(spreads_m.into_iter().flatten())
            {
                scan.correction_s.push(correction_s);
                scan.spread_m.push(spread_m);
            }
        }
        let is_calmer = crossover.least_spread_m() < CALMER * raw.least_spread_m();
        let mut scan = if is_calmer { crossover } else { raw };
        scan.best_s = best_s(&scan);
        scan.uncertainty_s = scan
            .best_s
            .and_then(|best_s| uncertainty_s(shots, &sighted, scan.radius, grid, best_s));
        Some(scan)
    }

    const fn empty(radius: ScannedRadius) -> Self {
        Self {
            radius,
            correction_s: Vec::new(),
            spread_m: Vec::new(),
            best_s: None,
            uncertainty_s: None,
        }
    }

    /// The least of its spreads, metres.
    fn least_spread_m(&self) -> f64 {
        self.spread_m.iter().copied().fold(f64::INFINITY, f64::min)
    }
}

/// Spreads with the raw and the corrected radius at every correction, metres; `None` beyond the coverage of the kernels.
type Spreads = Vec<Option<[f64; 2]>>;

/// Spreads by the residuals at every correction.
fn spreads_m(sighted: &[Sighted], grid: &SpacecraftGrid<'_>, corrections: &[f64]) -> Spreads {
    let spread_m = |correction_s: &f64| {
        let residual = |shot: &Sighted| shot.residuals_m(grid, *correction_s);
        let residuals: Option<Vec<[f64; 2]>> = sighted.iter().map(residual).collect();
        residuals.map(|residuals| {
            [0, 1].map(|which| {
                let residuals: Vec<f64> =
                    residuals.iter().map(|residual| residual[which]).collect();
                mean_and_deviation(&residuals)[1]
            })
        })
    };
    corrections.par_iter().map(spread_m).collect()
}

/// Spreads from residuals at `NODES` corrections: as a function of the correction, the residual of a shot is
/// nearly a polynomial, and the variance of residuals at any correction follows from their covariances at the nodes.
///
/// The line of sight turns by `v c / R`, at most 0.014 and 0.06 radians within [`NARROW_S`] (4.7 km/s at a range of 170 km,
/// the lowest periapsis): the interpolation errors with five and seven nodes are below 1e-5 m.
/// `None` for a scan of few steps, or kernels that do not cover every node.
fn interpolated_spreads_m<const NODES: usize>(
    sighted: &[Sighted],
    grid: &SpacecraftGrid<'_>,
    corrections: &[f64],
) -> Option<Spreads> {
    let half_width_s = corrections.last().copied()?;
    if corrections.len() <= NODES {
        return None;
    }
    let nodes_s: [f64; NODES] = std::array::from_fn(|node| {
        -half_width_s * (std::f64::consts::PI * node as f64 / (NODES - 1) as f64).cos()
    });
    let at_nodes = |shot: &Sighted| {
        let mut residuals_m = [[0.0; NODES]; 2];
        for (node, correction_s) in nodes_s.iter().enumerate() {
            let of_node = shot.residuals_m(grid, *correction_s)?;
            residuals_m[0][node] = of_node[0];
            residuals_m[1][node] = of_node[1];
        }
        Some(residuals_m)
    };
    let residuals_m: Option<Vec<[[f64; NODES]; 2]>> = sighted.par_iter().map(at_nodes).collect();
    let residuals_m = residuals_m?;
    let covariances_m2 = [0, 1].map(|which| covariance_m2::<NODES>(&residuals_m, which));
    let at = |correction_s: &f64| {
        let weights = SVector::from(lagrange_weights(&nodes_s, *correction_s));
        let spread_m = |covariance_m2: &SMatrix<f64, NODES, NODES>| {
            let variance_m2 = weights.dot(&(covariance_m2 * weights));
            // Rounding of a spread of zero; NaN stays.
            if variance_m2 < 0.0 {
                0.0
            } else {
                variance_m2.sqrt()
            }
        };
        Some(covariances_m2.each_ref().map(spread_m))
    };
    Some(corrections.iter().map(at).collect())
}

/// Sample covariance of the residuals at the nodes.
fn covariance_m2<const NODES: usize>(
    residuals_m: &[[[f64; NODES]; 2]],
    which: usize,
) -> SMatrix<f64, NODES, NODES> {
    let of_shots = || residuals_m.iter().map(|of| SVector::from(of[which]));
    let mean = of_shots().sum::<SVector<f64, NODES>>() / residuals_m.len() as f64;
    let products = of_shots().map(|residuals| {
        let deviation = residuals - mean;
        deviation * deviation.transpose()
    });
    products.sum::<SMatrix<f64, NODES, NODES>>() / (residuals_m.len() - 1) as f64
}

/// Factors of the values at `nodes` in the value of their polynomial at `at`.
fn lagrange_weights<const NODES: usize>(nodes: &[f64; NODES], at: f64) -> [f64; NODES] {
    std::array::from_fn(|own| {
        let others = nodes.iter().enumerate().filter(|(other, _)| *other != own);
        others
            .map(|(_, node)| (at - node) / (nodes[own] - node))
            .product()
    })
}

/// The quantities of a shot that do not depend on the correction.
struct Sighted {
    tag: Et,
    range_m: f64,
    /// With the raw and the corrected radius.
    footprints: [Position<BodyFixed>; 2],
}

impl Sighted {
    fn of(shot: &Footprint) -> Self {
        let direction = footprint(shot, 1.0).xyz_m;
        Self {
            tag: Et::from_seconds(shot.et_tag_s),
            range_m: shot.range_m,
            footprints: [shot.radius_m, shot.radius_crossover_m]
                .map(|radius_m| Position::new(radius_m * direction)),
        }
    }

    /// Range − distance to both footprints.
    fn residuals_m(&self, grid: &SpacecraftGrid<'_>, correction_s: f64) -> Option<[f64; 2]> {
        let spacecraft = grid.position(self.tag.plus(correction_s))?;
        let footprints = self.footprints.each_ref();
        Some(footprints.map(|of| range_residual_m(self.range_m, &spacecraft, of)))
    }
}

/// Corrections from `-half_width` to `+half_width`, symmetric about zero.
fn corrections(limits: &RangeCheckConfig) -> impl Iterator<Item = f64> {
    let (half_width_s, step_s) = (limits.scan_half_width_s, limits.scan_step_s);
    let side: Vec<f64> = (1..=SCAN_STEPS_MAX)
        .map(|k| f64::from(k) * step_s)
        .take_while(|correction| *correction <= half_width_s * (1.0 + 1e-12))
        .collect();
    let negative: Vec<f64> = side.iter().rev().map(|correction| -correction).collect();
    negative.into_iter().chain([0.0]).chain(side)
}

/// Minimum of the parabola through the three least variances.
fn best_s(scan: &BiasScan) -> Option<f64> {
    let least =
        (0..scan.spread_m.len()).min_by(|a, b| scan.spread_m[*a].total_cmp(&scan.spread_m[*b]))?;
    if least == 0 || least + 1 >= scan.spread_m.len() {
        return None;
    }
    let variance = |index: usize| scan.spread_m[index].powi(2);
    let step_s = scan.correction_s[least + 1] - scan.correction_s[least];
    let (before, at, after) = (variance(least - 1), variance(least), variance(least + 1));
    let curvature = (before - 2.0 * at + after) / (2.0 * step_s * step_s);
    let slope = (after - before) / (2.0 * step_s);
    (curvature > 0.0).then(|| scan.correction_s[least] - slope / (2.0 * curvature))
}

/// Unit vectors as columns: along the velocity, across the orbit, and at right angles to both.
///
/// The first is the direction of flight itself and not, as elsewhere, perpendicular to the radius: an orbit with a
/// constant time error is shifted along it, and must appear as such.
fn track_axes(position: &Vector3<f64>, velocity: &Vector3<f64>) -> Matrix3<f64> {
    let along = velocity.normalize();
    let cross = position.cross(velocity).normalize();
    Matrix3::from_columns(&[along, cross, along.cross(&cross)])
}

/// Standard uncertainty of the best correction.
///
/// The best correction is the slope of the residuals over the rates of their lines of sight. It is uncertain by the
/// scatter about that line, and by the orbit: moved by a constant vector it changes the residuals by the vector's
/// component along each line of sight, and a metre along the track cannot be separated from 0.3 ms. The orbit
/// uncertainty is taken from the across-track difference from the orbit of the PEDR file, assumed equal in all
/// directions: along the track the two also differ by the error of the correction itself. An orbit error that changes
/// along the profile leaves a slope too, estimated by the slope of that difference; for corrected radii, by the part of
/// it that the crossovers leave. Over a window they hardly remove any: a nadir profile, whose rates vary by a tenth of
/// a metre per second, would otherwise attribute a slope of millimetres per second to the clock.
fn uncertainty_s(
    shots: &[Footprint],
    sighted: &[Sighted],
    radius: ScannedRadius,
    grid: &SpacecraftGrid<'_>,
    best_s: f64,
) -> Option<f64> {
    let corrections_s = [best_s - RATE_STEP_S, best_s, best_s + RATE_STEP_S];
    let which = radius as usize;
    let mut residuals_m = Vec::with_capacity(shots.len());
    let mut rates_m_s = Vec::with_capacity(shots.len());
    let mut directions: [Vec<f64>; 3] = std::array::from_fn(|_| Vec::with_capacity(shots.len()));
    let mut orbit_difference_m = Vector3::zeros();
    let mut sighted_differences_m = Vec::with_capacity(shots.len());
    for (shot, sighted) in shots.iter().zip(sighted) {
        let residual = |step: usize| {
            let residuals = sighted.residuals_m(grid, corrections_s[step]);
            residuals.map(|of| of[which])
        };
        let change_m = residual(2)? - residual(0)?;
        residuals_m.push(residual(1)?);
        rates_m_s.push(change_m / (2.0 * RATE_STEP_S));
        let at = sighted.tag.plus(best_s);
        let (position, velocity_m_s) = grid.trajectory().state(at)?;
        let to_mars = body_rotation(Body::Mars, at);
        let to_track =
            track_axes(&position.xyz_m, &velocity_m_s).transpose() * to_mars.matrix().transpose();
        let spacecraft_m = to_mars.apply(&position).xyz_m;
        let ground_m = sighted.footprints[which].xyz_m;
        let sight = (spacecraft_m - ground_m).normalize();
        let direction = to_track * sight;
        for (axis, component) in directions.iter_mut().zip(&direction) {
            axis.push(*component);
        }
        let difference_m = to_track * (own_spacecraft(shot).xyz_m - spacecraft_m);
        orbit_difference_m += difference_m;
        // The range belongs to the spacecraft of the file and the raw radius.
        let corrected_m = ground_m - sighted.footprints[0].xyz_m;
        sighted_differences_m
            .push(difference_m.yz().dot(&direction.yz()) + corrected_m.dot(&sight));
    }
    let noise_s = Trend::of(&rates_m_s, &residuals_m)?.uncertainty;
    let mut seconds_per_metre = Vector3::zeros();
    for (sensitivity, axis) in seconds_per_metre.iter_mut().zip(&directions) {
        *sensitivity = Trend::of(&rates_m_s, axis)?.slope;
    }
    let difference_m = orbit_difference_m / shots.len() as f64;
    let across_m = difference_m.y.hypot(difference_m.z) / f64::sqrt(2.0);
    let orbit_s = seconds_per_metre.norm() * across_m;
    let change_s = Trend::of(&rates_m_s, &sighted_differences_m)?.slope;
    Some(noise_s.hypot(orbit_s).hypot(change_s))
}
