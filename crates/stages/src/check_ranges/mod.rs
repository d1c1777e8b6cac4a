//! Three-way range check: measured range, the file's own orbit and the kernels' orbit against each other.
//!
//! | residual | tests |
//! |---|---|
//! | range − \|PEDR spacecraft − footprint\| | the decoding of the file |
//! | PEDR spacecraft − SPK spacecraft | the kernels |
//! | range − \|SPK spacecraft − footprint\| | Table 3 of Shan et al. 2005 |
//!
//! Geometric states only: the range is to the spacecraft's centre of mass, so there is no lever arm,
//! and ISIS's apparent positions would be 0.14 km off.

mod figures;
mod orbit;
mod residuals;
mod scan;
mod tables;

use std::sync::atomic::AtomicBool;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::{convert_datum::Converted, group_profiles::Profile, spacecraft_grid::SpacecraftGrid};
use areograph_base::{
    altimetry::MolaClock,
    column::Column,
    error::{Cause, Result},
    footprints::{Footprint, Footprints},
    frames::BodyFixed,
    time::{Et, Interval, Intervals},
    watch::Watch,
};
use areograph_config::RangeCheckConfig;
use areograph_geom::{
    range_residuals::RangeResiduals,
    statistics::{Summary, Trend, outliers},
    surface::NADIR_MAX_RAD,
};
use areograph_spice::{KernelView, Session, Trajectory};
use areograph_store::{
    stage::{Output, Stage},
    stage_inputs,
};

pub use figures::RangeFigures;
pub use residuals::ShotResiduals;
pub use scan::{BiasScan, ScannedRadius};
pub use tables::{CheckTableRanges, Spacecraft, check_table_ranges};

/// Residuals of every shot, and statistics of every profile.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RangeCheck {
    /// Residuals, ordered by profile, then by time.
    pub shots: ShotResiduals,
    /// One entry per profile, in the order of the profiles.
    pub profiles: Vec<ProfileRanges>,
    /// Largest error of the tabulated trajectory against the kernels, metres.
    pub trajectory_error_m: f64,
}

stage_inputs! {
    /// Footprints, profiles, limits, the clock of MOLA, and the kernels of the trajectory.
    pub struct CheckRanges<'a> {
        /// Footprints in the frame of the products.
        pub converted: &'a Output<Converted>,
        /// Profiles.
        pub profiles: &'a Output<Vec<Profile>>,
        /// Kernels that positions may depend on.
        pub kernels: &'a KernelView,
        /// The clock of MOLA.
        pub altimeter_clock: &'a MolaClock,
        /// Limits, and settings for the scan of clock biases.
        pub range_check: &'a RangeCheckConfig,
    }
}

impl Stage for CheckRanges<'_> {
    const NAME: &'static str = "check_ranges";
    const METHOD: u32 = 16;
    type Output = RangeCheck;
    stage_inputs!(fingerprint);

    fn run(&self, stop: &AtomicBool) -> Result<RangeCheck> {
        self.run_watched(stop.into())
    }

    fn run_watched(&self, watch: Watch<'_>) -> Result<RangeCheck> {
        let profiles = self.profiles.value()?;
        let reach_s = trajectory_reach_s(self.range_check, self.altimeter_clock);
        let intervals: Vec<Interval> = profiles.iter().map(|profile| profile.interval).collect();
        check_ranges(
            &self.converted.value()?.footprints,
            profiles,
            &trajectory(self.kernels.session()?, &intervals, reach_s)?,
            self.altimeter_clock,
            self.range_check,
            watch,
        )
    }

    /// Checks the coverage of positions for every profile; one finding for all covered profiles.
    fn examine(&self) -> Vec<Result<String>> {
        let profiles = self.profiles.get().map_or(&[][..], Vec::as_slice);
        let (mut covered, mut shots, mut found) = (0, 0, Vec::new());
        for profile in profiles {
            let session = self.kernels.session();
            match session.and_then(|session| session.require_position(profile.interval)) {
                Ok(()) => {
                    covered += 1;
                    shots += profile.rows.len();
                }
                Err(failure) => found.push(Err(failure)),
            }
        }
        let of = profiles.len();
        let finding = format!("{covered} of {of} profiles ({shots} shots): position covered");
        found.extend((of > 0).then_some(Ok(finding)));
        found
    }
}

/// Profiles that are checked at once, for each thread.
const PROFILES_OF_A_THREAD: usize = 2;
/// Seconds of trajectory beyond the reach of the scan of the clock bias.
const TRAJECTORY_MARGIN_S: f64 = 0.5;
/// The tabulated trajectory stays this close to the kernels, metres: a tenth of a PEDR centimetre.
const TRAJECTORY_TOLERANCE_M: f64 = 0.001;

/// Seconds beyond a profile for which the spacecraft's trajectory is tabulated.
#[must_use]
pub fn trajectory_reach_s(range_check: &RangeCheckConfig, altimeter_clock: &MolaClock) -> f64 {
    range_check.scan_half_width_s + altimeter_clock.bias_s + TRAJECTORY_MARGIN_S
}

/// Tabulates the spacecraft's trajectory over these intervals, `reach_s` beyond them as far as the kernels go.
///
/// # Errors
/// Kernels that do not cover an interval.
pub fn trajectory(session: &Session, intervals: &[Interval], reach_s: f64) -> Result<Trajectory> {
    for interval in intervals {
        session.require_position(*interval)?;
    }
    let reach = intervals.iter().map(|interval| interval.padded(reach_s));
    let covered = Intervals::union_of(reach).intersection(&session.coverage()?.spk);
    session.trajectory(&covered, TRAJECTORY_TOLERANCE_M)
}

impl RangeCheck {
    /// The check with these residuals of shots instead of its own.
    #[must_use]
    pub fn with_shots(&self, shots: ShotResiduals) -> Self {
        Self {
            shots,
            profiles: self.profiles.clone(),
            trajectory_error_m: self.trajectory_error_m,
        }
    }
}

/// Statistics of one profile.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ProfileRanges {
    /// Profile identifier.
    pub profile: String,
    /// Its shots; for some shots of tables only the table's own spacecraft is known.
    pub shots: u32,
    /// Median angle of its beam off nadir, radians.
    pub off_nadir_rad: f64,
    /// Range − distance (SPK spacecraft, footprint with raw radius), metres.
    pub range_minus_distance_m: Summary,
    /// Range − distance (SPK spacecraft, footprint with crossover-corrected radius), metres: the crossover correction
    /// moves the footprint, not the range.
    pub range_minus_distance_crossover_m: Summary,
    /// Range − distance (PEDR spacecraft, raw footprint), metres.
    pub decoding_m: Summary,
    /// PEDR spacecraft − SPK spacecraft along radial, along-track and cross-track axes, metres.
    pub spacecraft_m: [Summary; 3],
    /// Mean of range − distance without outliers, metres; a judged value.
    pub mean_without_outliers_m: f64,
    /// Mean of range − distance to the spacecraft position in the file without the same shots, metres; a judged value.
    pub decoding_without_outliers_m: f64,
    /// Linear trend of range − distance over time, metres per second.
    pub trend_m_s: Option<Trend>,
    /// Shots farther from the median than the configured number of robust standard deviations.
    pub outliers: u32,
    /// Scan over assumed clock biases; `None` when there are too few shots for one.
    pub scan: Option<BiasScan>,
    /// Reasons why the profile breaks the limits of the configuration; empty when it is valid, or too short to be
    /// judged.
    pub invalid_because: Vec<String>,
}

impl ProfileRanges {
    /// Whether it has enough shots to be judged: a window may clip a profile to a few shots.
    #[must_use]
    pub const fn is_judged(&self, limits: &RangeCheckConfig) -> bool {
        self.shots >= limits.shots_min
    }

    /// Largest |mean| of range − distance, metres.
    ///
    /// Tables without a spacecraft have radii corrected by crossovers: these move footprints by metres, for some orbits
    /// by tens of metres, but not the ranges, so that the limit for two orbits applies. Off nadir a part of an orbit's
    /// error across the track is along the beam: the profiles of Shan et al. 2005, Table 3, reach 25.4 m there.
    #[must_use]
    pub fn mean_max_m(&self, limits: &RangeCheckConfig) -> f64 {
        if self.decoding_m.n == 0 {
            limits.mean_max_m.max(limits.orbit_max_m)
        } else if self.is_off_nadir() {
            (limits.mean_max_m + limits.orbit_max_m * self.off_nadir_rad.sin()).ceil()
        } else {
            limits.mean_max_m
        }
    }

    /// `limits` for this profile.
    fn limits(&self, limits: &RangeCheckConfig) -> RangeCheckConfig {
        RangeCheckConfig {
            mean_max_m: self.mean_max_m(limits),
            ..limits.clone()
        }
    }

    /// Whether its beam is turned off nadir.
    #[must_use]
    pub fn is_off_nadir(&self) -> bool {
        self.off_nadir_rad > NADIR_MAX_RAD
    }

    /// Whether its ranges are compared with any position of the spacecraft.
    #[must_use]
    pub const fn is_tested(&self) -> bool {
        self.range_minus_distance_m.n > 0 || self.decoding_m.n > 0
    }

    /// Shots whose residuals are known.
    #[must_use]
    pub const fn measured(&self) -> usize {
        self.range_minus_distance_m.n as usize
    }

    /// Mean distance between the spacecraft positions of the file and of the kernels, metres.
    #[must_use]
    pub fn orbits_apart_m(&self) -> f64 {
        self.figures().orbits_apart_m()
    }

    /// The figures that are judged.
    #[must_use]
    pub fn figures(&self) -> RangeFigures {
        RangeFigures {
            n: self.shots,
            outliers: self.outliers,
            mean_m: [
                self.range_minus_distance_m.mean,
                self.mean_without_outliers_m,
            ],
            decoding_m: [self.decoding_m.mean, self.decoding_without_outliers_m],
            spacecraft_m: self.spacecraft_m.each_ref().map(|axis| axis.mean),
        }
    }
}

/// A shot outside the tabulated trajectory.
#[derive(Debug, thiserror::Error, Cause)]
#[error("profile {profile}: no spacecraft position at the shot time {at}")]
#[cause(Coverage: "add a spacecraft ephemeris (SPK) that covers the PEDR files")]
struct OutsideTrajectory {
    profile: String,
    at: Et,
}

/// Checks the ranges of every profile against `trajectory`.
///
/// `watch` is checked before every profile, and counts shots.
///
/// # Errors
/// A shot whose time the trajectory does not cover; [`Stopped`](areograph_base::error::Stopped).
/// # Source
/// Shan et al. 2005, Table 3; the limits are a choice of areograph, as the paper states none.
pub fn check_ranges<'a>(
    footprints: &Footprints<BodyFixed>,
    profiles: &[Profile],
    trajectory: &Trajectory,
    clock: &MolaClock,
    limits: &RangeCheckConfig,
    watch: impl Into<Watch<'a>>,
) -> Result<RangeCheck> {
    let watch = watch.into();
    watch.announce(profiles.iter().map(|profile| profile.rows.len()).sum());
    let check = |(index, profile): (usize, &Profile)| {
        watch.check()?;
        let index = u32::try_from(index).unwrap_or(u32::MAX);
        let found = check_profile(footprints, index, profile, trajectory, clock, limits)?;
        watch.step(profile.rows.len() as u64, "shots");
        Ok(found)
    };
    let mut shots = ShotResiduals::default();
    let mut checked = Vec::with_capacity(profiles.len());
    // Profiles are checked in waves: only the residuals of one wave are held twice.
    let numbered: Vec<(usize, &Profile)> = profiles.iter().enumerate().collect();
    for wave in numbered.chunks(PROFILES_OF_A_THREAD * rayon::current_num_threads()) {
        let found: Vec<Result<(ShotResiduals, ProfileRanges)>> =
            wave.par_iter().copied().map(check).collect();
        for found in found {
            let (of_profile, ranges) = found?;
            shots.append(of_profile);
            checked.push(ranges);
        }
    }
    Ok(RangeCheck {
        shots,
        profiles: checked,
        trajectory_error_m: trajectory.max_error_m(),
    })
}

/// Residuals and statistics of a profile.
fn check_profile(
    footprints: &Footprints<BodyFixed>,
    index: u32,
    profile: &Profile,
    trajectory: &Trajectory,
    clock: &MolaClock,
    limits: &RangeCheckConfig,
) -> Result<(ShotResiduals, ProfileRanges)> {
    let reach_s = trajectory_reach_s(limits, clock);
    let grid = SpacecraftGrid::over(trajectory, profile.interval.padded(reach_s));
    let residuals = |row: &u32| {
        let shot = footprints.row(*row as usize);
        let at = clock.spacecraft_time(shot.et_tag_s);
        let spacecraft = grid.state(at).ok_or(at)?;
        Ok(RangeResiduals::of(&shot, &spacecraft))
    };
    let of_shots: Vec<std::result::Result<RangeResiduals, Et>> =
        profile.rows.par_iter().map(residuals).collect();
    let mut shots = ShotResiduals::default();
    for (row, residuals) in profile.rows.iter().zip(of_shots) {
        let residuals = residuals.map_err(|at| OutsideTrajectory {
            profile: profile.id.clone(),
            at,
        })?;
        shots.push(index, *row, &residuals);
    }
    let residuals_m: Vec<f64> = shots.range_minus_distance_m.iter().collect();
    let is_outlier = outliers(&residuals_m, limits.outlier_sigma);
    let kept: Vec<Footprint> = (profile.rows.iter().zip(&is_outlier))
        .filter(|(_, is_outlier)| !**is_outlier)
        .map(|(row, _)| footprints.row(*row as usize))
        .collect();
    shots.outlier = is_outlier.into();
    let scan = BiasScan::of(&kept, &grid, limits);
    let mut ranges = statistics(profile, &shots, scan, footprints);
    let explain = || orbit::cause(footprints, profile, trajectory, clock, limits.orbit_max_m);
    ranges.invalid_because = ranges
        .figures()
        .broken_limits(&ranges.limits(limits), explain);
    Ok((shots, ranges))
}

/// Statistics of the profile with these shots, not judged yet.
fn statistics(
    profile: &Profile,
    shots: &ShotResiduals,
    scan: Option<BiasScan>,
    footprints: &Footprints<BodyFixed>,
) -> ProfileRanges {
    let summary = |column: &Column<f64>| Summary::of(&column.iter().collect::<Vec<_>>());
    // Shots of tables may have no spacecraft position; where the kernels are not finite, range − distance is not
    // either.
    let of_own = |column: &Column<f64>| {
        let known = column.iter().filter(|of| !of.is_nan());
        Summary::of(&known.collect::<Vec<_>>())
    };
    let start = profile.interval.start;
    let since_s = |row: u32| Et::from_seconds(footprints.et_s.at(row as usize)).since(start);
    let seconds: Vec<f64> = shots.row.iter().map(since_s).collect();
    let residuals_m: Vec<f64> = shots.range_minus_distance_m.iter().collect();
    let outliers = shots.outlier.iter().filter(|flag| *flag).count();
    // A single wrong record must not decide the verdict on all others; their number has a separate limit.
    let mean_without = |column: &Column<f64>| {
        let kept = column.iter().zip(&shots.outlier);
        let kept: Vec<f64> = kept.filter(|(_, is)| !is).map(|(m, _)| m).collect();
        Summary::of(&kept).mean
    };
    ProfileRanges {
        profile: profile.id.clone(),
        off_nadir_rad: profile.off_nadir_rad(footprints),
        shots: u32::try_from(profile.rows.len()).unwrap_or(u32::MAX),
        range_minus_distance_m: summary(&shots.range_minus_distance_m),
        range_minus_distance_crossover_m: summary(&shots.range_minus_distance_crossover_m),
        decoding_m: summary(&shots.decoding_m),
        spacecraft_m: [
            of_own(&shots.spacecraft_radial_m),
            of_own(&shots.spacecraft_along_m),
            of_own(&shots.spacecraft_cross_m),
        ],
        mean_without_outliers_m: mean_without(&shots.range_minus_distance_m),
        decoding_without_outliers_m: mean_without(&shots.decoding_m),
        trend_m_s: Trend::of(&seconds, &residuals_m),
        outliers: u32::try_from(outliers).unwrap_or(u32::MAX),
        scan,
        invalid_because: Vec::new(),
    }
}
