//! The range check of shots of tables: measured range against the table's own spacecraft, and against the spacecraft of
//! images with its laser, where one was exposed at that time, or else against that of the kernels, where they cover it.
//!
//! `ImageTimes::has_laser` marks such images. No other stage after `search_footprints` distinguishes tables from PEDR
//! files.

use std::sync::atomic::AtomicBool;

use super::{
    ProfileRanges, RangeCheck, ShotResiduals, TRAJECTORY_MARGIN_S, TRAJECTORY_TOLERANCE_M,
    statistics,
};
use crate::{
    altimetry::MolaClock,
    body::Body,
    config::RangeCheckConfig,
    error::{Result, Stopped},
    footprints::Footprints,
    frames::{BodyFixed, Position},
    geom::{
        orbit_axes::radial_along_cross,
        range_residuals::{
            RangeResiduals, SpacecraftState, footprint, own_spacecraft, range_residual_m,
        },
        statistics::{Summary, outliers},
    },
    spice::{KernelRole, KernelView, Trajectory},
    stage::{InOrder, Output, Stage},
    stage_inputs,
    stages::{convert_datum::Converted, group_profiles::Profile, tag_times::ImageTimes},
    time::{Et, Intervals},
};

stage_inputs! {
    /// Footprints of tables, profiles, limits, and the images whose spacecraft has the laser.
    pub struct CheckTableRanges<'a> {
        /// Footprints in the frame of the products.
        pub converted: &'a Output<Converted>,
        /// Profiles.
        pub profiles: &'a Output<Vec<Profile>>,
        /// The images.
        pub images: InOrder<'a, Output<ImageTimes>>,
        /// Kernels that positions may depend on.
        pub kernels: &'a KernelView,
        /// The clock of the altimeter.
        pub mola_clock: &'a MolaClock,
        /// Limits.
        pub range_check: &'a RangeCheckConfig,
    }
}

impl Stage for CheckTableRanges<'_> {
    const NAME: &'static str = "check_ranges";
    const METHOD: u32 = 3;
    type Output = RangeCheck;
    stage_inputs!(fingerprint);

    fn run(&self, stop: &AtomicBool) -> Result<RangeCheck> {
        let images = self.images.0.iter().map(Output::value);
        let images = images.collect::<Result<Vec<_>>>()?;
        check_table_ranges(
            &self.converted.value()?.footprints,
            self.profiles.value()?,
            &images,
            self.trajectory()?.as_ref(),
            self.mola_clock,
            self.range_check,
            stop,
        )
    }
}

impl CheckTableRanges<'_> {
    /// The orbit of the spacecraft with the laser, as far as the kernels cover the shots; `None` where they cover none, and
    /// at other bodies.
    fn trajectory(&self) -> Result<Option<Trajectory>> {
        let body = self.converted.value()?.footprints.body;
        let Some(kernels) = self.kernels.kernels() else {
            return Ok(None);
        };
        let has_orbit = kernels
            .kernels()
            .iter()
            .any(|of| of.role == KernelRole::Spk);
        if body != Body::Mars || !has_orbit {
            return Ok(None);
        }
        let session = self.kernels.session()?;
        let reach_s = self.mola_clock.bias_s + TRAJECTORY_MARGIN_S;
        let profiles = self.profiles.value()?.iter();
        let shots = Intervals::union_of(profiles.map(|of| of.interval.padded(reach_s)));
        let covered = shots.intersection(&session.coverage()?.spk);
        if covered.as_slice().is_empty() {
            return Ok(None);
        }
        let trajectory = session.trajectory(&covered, TRAJECTORY_TOLERANCE_M)?;
        Ok(Some(trajectory))
    }
}

/// Checks the ranges of every profile against the spacecraft of the table, and against that of support data.
///
/// Residuals exist for shots that support data or kernels cover; the table's own spacecraft is judged by all shots.
///
/// # Errors
/// [`Stopped`].
pub fn check_table_ranges(
    footprints: &Footprints<BodyFixed>,
    profiles: &[Profile],
    images: &[&ImageTimes],
    kernels: Option<&Trajectory>,
    clock: &MolaClock,
    limits: &RangeCheckConfig,
    stop: &AtomicBool,
) -> Result<RangeCheck> {
    let mut shots = ShotResiduals::default();
    let mut checked = Vec::with_capacity(profiles.len());
    for (index, profile) in (0_u32..).zip(profiles) {
        Stopped::check(stop)?;
        let first = shots.len();
        for row in &profile.rows {
            let shot = footprints.row(*row as usize);
            let at = clock.spacecraft_time(shot.et_tag_s);
            let of_images = images.iter().find_map(|image| spacecraft(image, at));
            let of_kernels = || {
                let (position, velocity_m_s) = kernels?.state(at)?;
                Some(SpacecraftState::of(at, &position, &velocity_m_s))
            };
            if let Some(spacecraft) = of_images.or_else(of_kernels) {
                shots.push(index, *row, &RangeResiduals::of(&shot, &spacecraft));
            }
        }
        let flags = outliers(&shots.range_minus_distance_m[first..], limits.outlier_sigma);
        shots.outlier.extend(flags);
        let mut ranges = statistics(profile, &shots, first, None, footprints);
        by_own_spacecraft(&mut ranges, footprints, profile, limits);
        let explain = || {
            "support data or kernels hold a different orbit from the table's, or its times or radii are others".to_owned()
        };
        ranges.invalid_because = ranges.figures().broken_limits(limits, explain);
        checked.push(ranges);
    }
    Ok(RangeCheck {
        shots,
        profiles: checked,
        trajectory_error_m: 0.0,
    })
}

/// The spacecraft of an image with the laser at an instant, within the time of its support data.
fn spacecraft(image: &ImageTimes, at: Et) -> Option<SpacecraftState> {
    let support = image.support.as_ref().filter(|support| support.has_laser)?;
    let tables = &support.tables;
    if !tables.span().contains(at) {
        return None;
    }
    let (position_m, velocity_m_s) = tables.position.at(at.seconds());
    let rotation = &tables.body_rotation;
    let to_body = rotation.constant * rotation.at(at.seconds()).0;
    Some(SpacecraftState {
        position: Position::new(to_body * position_m),
        axes: to_body * radial_along_cross(&position_m, &velocity_m_s),
    })
}

/// Adds the table's own spacecraft to the statistics of a profile, by all of its shots.
fn by_own_spacecraft(
    ranges: &mut ProfileRanges,
    footprints: &Footprints<BodyFixed>,
    profile: &Profile,
    limits: &RangeCheckConfig,
) {
    let residuals = profile.rows.iter().map(|row| {
        let shot = footprints.row(*row as usize);
        let ground = footprint(&shot, shot.radius_m);
        range_residual_m(shot.range_m, &own_spacecraft(&shot), &ground)
    });
    let residuals_m: Vec<f64> = residuals.collect();
    let flags = outliers(&residuals_m, limits.outlier_sigma);
    let kept = residuals_m.iter().zip(flags).filter(|(_, is)| !is);
    let kept: Vec<f64> = kept.map(|(residual_m, _)| *residual_m).collect();
    ranges.decoding_m = Summary::of(&residuals_m);
    ranges.decoding_without_outliers_m = Summary::of(&kept).mean;
}
