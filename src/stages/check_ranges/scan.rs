//! Which clock correction makes the range residuals of a profile spread least?
//!
//! Shifting the spacecraft by a time `c` changes the residual of shot `k` by about `c` times the rate
//! of its line of sight. A common change leaves the spread alone, so a profile tells the bias only
//! when that rate varies along it: strongly when the spacecraft holds still in inertial space while
//! it looks off nadir (about 3 m/s²), hardly at nadir (below 0.03 m/s²). The uncertainty says which.

use serde::{Deserialize, Serialize};

use super::residuals::{ShotResiduals, raw_footprint};
use crate::{
    config::RangeCheckConfig,
    footprints::Footprints,
    frames::{MarsIau2000, Position},
    geom::{mars_rotation::mars_rotation, statistics::Summary},
    spice::Trajectory,
    time::Et,
};

/// Fewest shots that make a scan worth reading.
const SHOTS_MIN: usize = 10;

/// Most steps on either side of zero.
const STEPS_MAX: u32 = 10_000;

/// Spread of range − distance against the assumed clock correction.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct BiasScan {
    /// Assumed corrections, seconds added to the tags.
    pub correction_s: Vec<f64>,
    /// Standard deviation of range − distance at each, metres.
    pub spread_m: Vec<f64>,
    /// Correction of least spread, refined by a parabola through the variance, seconds.
    ///
    /// `None` when the least spread lies at an end of the scan.
    pub best_s: Option<f64>,
    /// Standard uncertainty of `best_s`, seconds, were the remaining residuals white noise.
    pub uncertainty_s: Option<f64>,
}

/// Scans the profile whose shots begin at `first`, its outliers left out.
pub(super) fn scan(
    footprints: &Footprints<MarsIau2000>,
    shots: &ShotResiduals,
    first: usize,
    trajectory: &Trajectory,
    limits: &RangeCheckConfig,
) -> Option<BiasScan> {
    let kept: Vec<(f64, f64, Position<MarsIau2000>)> = (first..shots.len())
        .filter(|shot| !shots.outlier[*shot])
        .map(|shot| {
            let footprint = footprints.row(shots.row[shot] as usize);
            (
                footprint.et_tag_s,
                footprint.range_m,
                raw_footprint(&footprint),
            )
        })
        .collect();
    if kept.len() < SHOTS_MIN {
        return None;
    }
    let mut scan = BiasScan {
        correction_s: Vec::new(),
        spread_m: Vec::new(),
        best_s: None,
        uncertainty_s: None,
    };
    for correction_s in corrections(limits) {
        let residuals: Option<Vec<f64>> = kept
            .iter()
            .map(|(tag_s, range_m, footprint)| {
                let at = Et::from_seconds(tag_s + correction_s);
                let spacecraft = mars_rotation::<MarsIau2000>(at).apply(&trajectory.position(at)?);
                Some(range_m - spacecraft.distance_m(footprint))
            })
            .collect();
        // Corrections that lead out of the kernels are left out.
        if let Some(residuals) = residuals {
            scan.correction_s.push(correction_s);
            scan.spread_m
                .push(Summary::of(&residuals).standard_deviation);
        }
    }
    refine(&mut scan, kept.len());
    Some(scan)
}

/// Corrections from `-half_width` to `+half_width`, symmetric about zero.
fn corrections(limits: &RangeCheckConfig) -> impl Iterator<Item = f64> {
    let (half_width_s, step_s) = (limits.scan_half_width_s, limits.scan_step_s);
    let side: Vec<f64> = (1..=STEPS_MAX)
        .map(|k| f64::from(k) * step_s)
        .take_while(|correction| *correction <= half_width_s * (1.0 + 1e-12))
        .collect();
    let negative: Vec<f64> = side.iter().rev().map(|correction| -correction).collect();
    negative.into_iter().chain([0.0]).chain(side)
}

/// Parabola through the three least variances: its minimum, and from its curvature the uncertainty.
fn refine(scan: &mut BiasScan, shots: usize) {
    let Some(least) =
        (0..scan.spread_m.len()).min_by(|a, b| scan.spread_m[*a].total_cmp(&scan.spread_m[*b]))
    else {
        return;
    };
    if least == 0 || least + 1 >= scan.spread_m.len() {
        return;
    }
    let variance = |index: usize| scan.spread_m[index].powi(2);
    let step_s = scan.correction_s[least + 1] - scan.correction_s[least];
    let (before, at, after) = (variance(least - 1), variance(least), variance(least + 1));
    let curvature = (before - 2.0 * at + after) / (2.0 * step_s * step_s);
    let slope = (after - before) / (2.0 * step_s);
    if !(curvature > 0.0) {
        return;
    }
    let offset_s = -slope / (2.0 * curvature);
    let remaining = (at - curvature * offset_s * offset_s).max(0.0);
    scan.best_s = Some(scan.correction_s[least] + offset_s);
    scan.uncertainty_s = Some((remaining / (curvature * shots as f64)).sqrt());
}
