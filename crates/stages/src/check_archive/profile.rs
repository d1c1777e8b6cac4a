//! Statistics of a profile of the archive.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::{
    ArchiveRules, LONGEST_S,
    rows::{CheckedShot, Task},
};
use crate::{
    check_ranges::{BiasScan, RangeFigures, ScannedRadius},
    group_profiles::Profile,
    spacecraft_grid::SpacecraftGrid,
};
use areograph_base::{
    footprints::Footprint,
    time::{Et, Interval},
    units::RADIANS_PER_DEGREE,
};
use areograph_geom::{range_residuals::RangeResiduals, statistics::Summary};
use areograph_pds::archive::spans;
use areograph_spice::Trajectory;

/// Shots of a revolution, for which room is made at once.
const REVOLUTION_SHOTS: usize = 71_000;
/// Shots of a profile that are scanned.
const SCANNED: usize = 400;
/// Places of a profile on a map.
const PLACES: usize = 40;
/// Upper ends of the bins of off-nadir angles, degrees; the last one has none.
const OFF_NADIR_DEG: [f64; 8] = [0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, f64::INFINITY];

/// Statistics of the part of one revolution in one file.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct ArchiveProfile {
    /// File name without folders.
    pub file: String,
    /// Orbit number as the file states it.
    pub orbit: u32,
    /// 1, and higher after pauses of more than 300 s.
    pub part: u32,
    /// First record with a shot, counted from 1 with the label.
    pub first_record: u32,
    /// Last record with a shot.
    pub last_record: u32,
    /// Corrected time of the first shot, ET seconds.
    pub start_et_s: f64,
    /// Corrected time of the last shot, ET seconds.
    pub stop_et_s: f64,
    /// Time tags of the first and the last shot, ET seconds.
    pub tags_et_s: [f64; 2],
    /// Time tags of the first and the last shot of every part without a missing frame, ET seconds.
    pub spans_et_s: Vec<[f64; 2]>,
    /// Shots that were checked.
    pub shots: u32,
    /// Number of shots without a spacecraft position in the kernels.
    pub not_covered: u32,
    /// Mean and largest off-nadir angle, radians.
    pub off_nadir_rad: [f64; 2],
    /// Range − |SPK spacecraft − raw footprint|, metres; all 0 without a checked shot.
    pub range_minus_distance_m: Summary,
    /// Mean of range − distance without outliers, metres.
    pub mean_without_outliers_m: f64,
    /// Shots farther from the median than the configured number of robust standard deviations.
    pub outliers: u32,
    /// Mean of range − distance to the crossover-corrected footprint, metres.
    pub crossover_mean_m: f64,
    /// Mean of range − |PEDR spacecraft − raw footprint|, metres.
    pub decoding_mean_m: f64,
    /// Mean of range − |PEDR spacecraft − raw footprint| without outliers, metres.
    pub decoding_without_outliers_m: f64,
    /// Mean of PEDR spacecraft − SPK spacecraft along radial, along-track and cross-track axes, metres.
    pub spacecraft_m: [f64; 3],
    /// Correction of time tags with which ranges spread least, seconds.
    pub best_correction_s: Option<f64>,
    /// Its standard uncertainty, seconds.
    pub correction_uncertainty_s: Option<f64>,
    /// Radius of the footprints with which ranges spread least.
    pub correction_radius: ScannedRadius,
    /// Largest of the judged figures as a share of its limit; `None` for a profile with too few shots to be judged.
    pub share_of_limits: Option<f64>,
    /// Limits that are broken, in words.
    pub invalid_because: Vec<String>,
    /// East longitude and latitude of some of the shots, IAU 2000, degrees.
    pub places_deg: Vec<[f64; 2]>,
}

/// Shots within a range of off-nadir angles, without the outliers of their profiles.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct OffNadirBin {
    /// Lower end of the range, degrees.
    pub from_deg: f64,
    /// Upper end of the range, degrees; infinite for the last bin.
    pub to_deg: f64,
    /// Shots.
    pub shots: u64,
    /// Sum of range − distance, metres.
    pub sum_m: f64,
    /// Sum of its squares.
    pub squares_m2: f64,
}

impl OffNadirBin {
    /// All bins, empty.
    #[must_use]
    pub fn all() -> Vec<Self> {
        let mut from_deg = 0.0;
        OFF_NADIR_DEG
            .into_iter()
            .map(|to_deg| Self {
                from_deg: std::mem::replace(&mut from_deg, to_deg),
                to_deg,
                shots: 0,
                sum_m: 0.0,
                squares_m2: 0.0,
            })
            .collect()
    }

    /// Adds the shots of another bin with the same angles.
    pub fn add(&mut self, other: &Self) {
        self.shots += other.shots;
        self.sum_m += other.sum_m;
        self.squares_m2 += other.squares_m2;
    }

    fn count(&mut self, residual_m: f64) {
        self.shots += 1;
        self.sum_m += residual_m;
        self.squares_m2 += residual_m * residual_m;
    }

    /// Mean and standard deviation of range − distance, metres; `None` for fewer than two shots.
    #[must_use]
    pub fn mean_and_deviation_m(&self) -> Option<[f64; 2]> {
        let n = self.shots as f64;
        (self.shots > 1).then(|| {
            let mean = self.sum_m / n;
            let variance = (self.squares_m2 - n * mean * mean) / (n - 1.0);
            [mean, variance.max(0.0).sqrt()]
        })
    }
}

/// The shots of a profile.
#[derive(Debug, Default)]
pub(super) struct Gathered {
    shots: Vec<CheckedShot>,
    samples: Vec<(usize, Footprint)>,
}

impl Gathered {
    pub(super) const fn is_empty(&self) -> bool {
        self.shots.is_empty()
    }

    /// Appends shots, and returns the profiles that have ended.
    pub(super) fn append(&mut self, task: Task) -> Vec<Self> {
        let mut done = Vec::new();
        let mut samples = task.samples.into_iter().peekable();
        for (index, shot) in task.shots.into_iter().enumerate() {
            if self.is_ended_by(&shot) {
                done.push(std::mem::take(self));
            }
            if self.shots.is_empty() {
                self.shots.reserve_exact(REVOLUTION_SHOTS);
            }
            if let Some((_, whole)) = samples.next_if(|(at, _)| *at == index) {
                self.samples.push((self.shots.len(), whole));
            }
            self.shots.push(shot);
        }
        done
    }

    /// Whether a shot belongs to another profile: also one that steps back in time, as in a misplaced block.
    fn is_ended_by(&self, next: &CheckedShot) -> bool {
        let (Some(first), Some(last)) = (self.shots.first(), self.shots.last()) else {
            return false;
        };
        next.orbit != last.orbit
            || next.et_s < last.et_s
            || next.et_s - last.et_s > Profile::PAUSE_S
            || next.et_s - first.et_s > LONGEST_S
    }
}

/// Sums over the shots of a profile that have residuals.
#[derive(Default)]
struct Sums {
    n: u32,
    /// Shots that are not outliers.
    kept: u32,
    crossover_m: f64,
    decoding_m: f64,
    spacecraft_m: Vector3<f64>,
    /// Without outliers.
    kept_range_m: f64,
    kept_decoding_m: f64,
}

impl Sums {
    fn add(&mut self, residuals: &RangeResiduals, is_outlier: bool) {
        self.n += 1;
        self.crossover_m += residuals.range_minus_distance_crossover_m;
        self.decoding_m += residuals.decoding_m;
        self.spacecraft_m += residuals.spacecraft_m;
        if !is_outlier {
            self.kept += 1;
            self.kept_range_m += residuals.range_minus_distance_m;
            self.kept_decoding_m += residuals.decoding_m;
        }
    }
}

impl ArchiveProfile {
    /// Statistics of a profile that is not empty, still without its file, and its shots by off-nadir angle.
    pub(super) fn of(
        gathered: &Gathered,
        trajectory: &Trajectory,
        rules: &ArchiveRules<'_>,
    ) -> (Self, Vec<OffNadirBin>) {
        let shots = &gathered.shots;
        let residuals = shots.iter().filter_map(|shot| shot.residuals.as_ref());
        let range_m: Vec<f64> = residuals.map(|of| of.range_minus_distance_m).collect();
        let summary = Summary::of(&range_m);
        let limit_m = summary.outlier_limit_m(rules.limits.outlier_sigma);
        let is_outlier =
            |of: &RangeResiduals| summary.is_outlier(of.range_minus_distance_m, limit_m);
        let (scan, (sums, bins, off_nadir_rad)) = rayon::join(
            || scan(gathered, is_outlier, trajectory, rules),
            || sums(shots, is_outlier),
        );
        let [n, kept] = [sums.n, sums.kept].map(|count| f64::from(count.max(1)));
        let count = |of: usize| u32::try_from(of).unwrap_or(u32::MAX);
        let mut profile = Self {
            shots: summary.n,
            not_covered: count(shots.len()) - summary.n,
            off_nadir_rad,
            range_minus_distance_m: summary,
            mean_without_outliers_m: sums.kept_range_m / kept,
            outliers: sums.n - sums.kept,
            crossover_mean_m: sums.crossover_m / n,
            decoding_mean_m: sums.decoding_m / n,
            decoding_without_outliers_m: sums.kept_decoding_m / kept,
            spacecraft_m: (sums.spacecraft_m / n).into(),
            best_correction_s: scan.as_ref().and_then(|scan| scan.best_s),
            correction_uncertainty_s: scan.as_ref().and_then(|scan| scan.uncertainty_s),
            correction_radius: scan.map_or_else(ScannedRadius::default, |scan| scan.radius),
            places_deg: places_deg(gathered),
            ..Self::default()
        };
        if let (Some(first), Some(last)) = (shots.first(), shots.last()) {
            profile.orbit = first.orbit;
            (profile.first_record, profile.last_record) = (first.record, last.record);
            (profile.start_et_s, profile.stop_et_s) = (first.et_s, last.et_s);
            profile.tags_et_s = [first.et_tag_s, last.et_tag_s];
            let spans = spans(0, shots.iter().map(|shot| shot.et_tag_s));
            profile.spans_et_s = spans
                .iter()
                .map(|span| [span.first_s, span.last_s])
                .collect();
        }
        profile.judge(rules);
        (profile, bins)
    }

    fn judge(&mut self, rules: &ArchiveRules<'_>) {
        // A remnant of a profile at the edge of a file or of the kernels is not significant; remnants are counted
        // separately.
        if self.shots < rules.limits.shots_min.max(1) {
            return;
        }
        let figures = RangeFigures {
            n: self.shots,
            outliers: self.outliers,
            mean_m: [
                self.range_minus_distance_m.mean,
                self.mean_without_outliers_m,
            ],
            decoding_m: [self.decoding_mean_m, self.decoding_without_outliers_m],
            spacecraft_m: self.spacecraft_m,
        };
        self.share_of_limits = Some(figures.share_of_limits(rules.limits));
        let why = || "orbit, clock or datum differs from the kernels".to_owned();
        self.invalid_because = figures.broken_limits(rules.limits, why);
    }

    /// Whether the profile has enough shots for a comparison with the limits.
    #[must_use]
    pub const fn is_judged(&self) -> bool {
        self.share_of_limits.is_some()
    }

    /// `<file>/<orbit>`, with `.2`, `.3` … for later parts.
    #[must_use]
    pub fn id(&self) -> String {
        self.id_in(&self.file)
    }

    /// The identifier with a different name for the file.
    #[must_use]
    pub fn id_in(&self, file: &str) -> String {
        let part = if self.part > 1 {
            format!(".{}", self.part)
        } else {
            String::new()
        };
        format!("{file}/{}{part}", self.orbit)
    }
}

/// Sums of all shots, the shots by off-nadir angle, and the mean and the largest angle, radians.
fn sums(
    shots: &[CheckedShot],
    is_outlier: impl Fn(&RangeResiduals) -> bool,
) -> (Sums, Vec<OffNadirBin>, [f64; 2]) {
    let mut bins = OffNadirBin::all();
    let mut sums = Sums::default();
    let (mut off_nadir_sum, mut largest) = (0.0, 0.0_f64);
    for shot in shots {
        let off_nadir_rad = shot.off_nadir_rad.abs();
        off_nadir_sum += off_nadir_rad;
        largest = largest.max(off_nadir_rad);
        let Some(residuals) = &shot.residuals else {
            continue;
        };
        let is_outlier = is_outlier(residuals);
        sums.add(residuals, is_outlier);
        let off_nadir_deg = off_nadir_rad / RADIANS_PER_DEGREE;
        let bin = bins.iter_mut().find(|bin| off_nadir_deg < bin.to_deg);
        if let Some(bin) = bin.filter(|_| !is_outlier) {
            bin.count(residuals.range_minus_distance_m);
        }
    }
    let mean = off_nadir_sum / shots.len().max(1) as f64;
    (sums, bins, [mean, largest])
}

/// Scans a few hundred shots that are not outliers, and for which the kernels hold all positions that the scan needs.
fn scan(
    gathered: &Gathered,
    is_outlier: impl Fn(&RangeResiduals) -> bool,
    trajectory: &Trajectory,
    rules: &ArchiveRules<'_>,
) -> Option<BiasScan> {
    let reach_s = rules.limits.scan_half_width_s;
    let is_reached = |shot: &Footprint| {
        let at = Et::from_seconds(shot.et_tag_s);
        let mut ends = [-reach_s, reach_s].into_iter();
        ends.all(|late_s| trajectory.position(at.plus(late_s)).is_some())
    };
    let kept = gathered.samples.iter().filter(|(at, shot)| {
        let residuals = gathered.shots[*at].residuals.as_ref();
        residuals.is_some_and(|residuals| !is_outlier(residuals)) && is_reached(shot)
    });
    let kept: Vec<Footprint> = kept.map(|(_, shot)| *shot).collect();
    let step = kept.len().div_ceil(SCANNED).max(1);
    let thinned: Vec<Footprint> = kept.into_iter().step_by(step).collect();
    let [first, last] = [thinned.first()?, thinned.last()?].map(|shot| shot.et_tag_s);
    let tags = Interval::new(Et::from_seconds(first), Et::from_seconds(last));
    let grid = SpacecraftGrid::over(trajectory, tags.padded(rules.limits.scan_half_width_s));
    BiasScan::of(&thinned, &grid, rules.limits)
}

fn places_deg(gathered: &Gathered) -> Vec<[f64; 2]> {
    let step = gathered.samples.len().div_ceil(PLACES).max(1);
    let samples = gathered.samples.iter().step_by(step);
    samples
        .map(|(_, shot)| [shot.longitude_rad, shot.latitude_rad].map(|of| of / RADIANS_PER_DEGREE))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use areograph_base::altimetry::{BiasScope, MolaClock, ShotFilter, TagSign};
    use areograph_config::RangeCheckConfig;

    #[test]
    fn too_few_shots_are_not_judged_whatever_they_say() {
        let (limits, filter) = (
            RangeCheckConfig::default(),
            ShotFilter {
                classes: Vec::new(),
                channels: Vec::new(),
                attitude_flags: Vec::new(),
                off_nadir_max_rad: 0.0,
                solar_longitude_rad: ShotFilter::ALL_SEASONS,
            },
        );
        let clock = MolaClock {
            bias_s: 0.0,
            sign: TagSign::Late,
            scope: BiasScope::SpkLookup,
            source: String::new(),
        };
        let rules = ArchiveRules {
            clock: &clock,
            limits: &limits,
            filter: &filter,
        };
        let judged = |shots: u32| {
            let mut profile = ArchiveProfile {
                shots,
                mean_without_outliers_m: -500.0,
                ..ArchiveProfile::default()
            };
            profile.judge(&rules);
            (profile.is_judged(), profile.invalid_because.len())
        };
        assert_eq!(judged(limits.shots_min - 1), (false, 0));
        assert_eq!(judged(limits.shots_min), (true, 1));
        assert_eq!(judged(0), (false, 0));
    }
}
