//! The range check of shots of tables: measured range against the table's own spacecraft, and against the spacecraft of
//! images with its laser, where one was exposed at that time, or else against the kernels' spacecraft, where they cover
//! it.
//!
//! A table without positions of the spacecraft (`states_spacecraft`) is compared with the kernels alone, where these
//! cover a profile; else its ranges are not tested.
//!
//! `ImageTimes::has_laser` marks images with the laser. No other stage after `search_footprints` distinguishes tables
//! from PEDR files.

use std::sync::atomic::AtomicBool;

use super::{
    ProfileRanges, RangeCheck, ShotResiduals, TRAJECTORY_TOLERANCE_M, statistics,
    trajectory_reach_s,
};
use crate::{
    convert_datum::Converted, group_profiles::Profile, spacecraft_grid::state,
    tag_times::ImageTimes,
};
use areograph_base::{
    altimetry::MolaClock,
    body::Body,
    error::{Result, Stopped},
    footprints::Footprints,
    frames::{BodyFixed, Position},
    time::{Et, Interval, Intervals},
};
use areograph_config::RangeCheckConfig;
use areograph_geom::{
    orbit_axes::radial_along_cross,
    range_residuals::{
        RangeResiduals, SpacecraftState, footprint, own_spacecraft, range_residual_m,
        states_spacecraft,
    },
    statistics::{Summary, outliers},
};
use areograph_spice::{KernelRole, KernelView, Trajectory};
use areograph_store::{
    stage::{InOrder, Output, Stage},
    stage_inputs,
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
        pub altimeter_clock: &'a MolaClock,
        /// Limits.
        pub range_check: &'a RangeCheckConfig,
    }
}

impl Stage for CheckTableRanges<'_> {
    const NAME: &'static str = "check_ranges";
    const METHOD: u32 = 7;
    type Output = RangeCheck;
    stage_inputs!(fingerprint);

    fn run(&self, stop: &AtomicBool) -> Result<RangeCheck> {
        let images = self.images.0.iter().map(Output::value);
        let images = images.collect::<Result<Vec<_>>>()?;
        let profiles = self.profiles.value()?;
        let reach_s = trajectory_reach_s(self.range_check, self.altimeter_clock);
        check_table_ranges(
            &self.converted.value()?.footprints,
            profiles,
            Spacecraft {
                images: &images,
                kernels: self.trajectory(reach_s)?.as_ref(),
            },
            self.altimeter_clock,
            self.range_check,
            stop,
        )
    }
}

impl CheckTableRanges<'_> {
    /// The orbit of the spacecraft with the laser over the profiles that the kernels cover; `None` where they cover
    /// none, and at other bodies.
    fn trajectory(&self, reach_s: f64) -> Result<Option<Trajectory>> {
        let body = self.converted.value()?.footprints.body;
        let all = self.kernels.kernels().map_or(&[][..], |set| set.kernels());
        let has_orbit = all.iter().any(|kernel| kernel.role == KernelRole::Spk);
        if body != Body::Mars || !has_orbit {
            return Ok(None);
        }
        let session = self.kernels.session()?;
        let held = &session.coverage()?.spk;
        let profiles = self.profiles.value()?.iter();
        let reach = profiles.map(|profile| profile.interval.padded(reach_s));
        let is_held = |interval: &Interval| {
            let open = Intervals::union_of([*interval]).without(held);
            open.as_slice().is_empty()
        };
        let covered = Intervals::union_of(reach.filter(is_held));
        let tabulated = session.trajectory(&covered, TRAJECTORY_TOLERANCE_M)?;
        Ok((!covered.as_slice().is_empty()).then_some(tabulated))
    }
}

/// Spacecraft positions from sources other than the tables.
#[derive(Debug, Clone, Copy)]
pub struct Spacecraft<'a> {
    /// Images, some of which may have the laser.
    pub images: &'a [&'a ImageTimes],
    /// The trajectory from the kernels, where they cover profiles.
    pub kernels: Option<&'a Trajectory>,
}

/// Checks the ranges of every profile against the spacecraft of the table, and against the spacecraft of support data
/// or kernels.
///
/// Residuals exist for shots that support data or kernels cover; the table's own spacecraft is judged by all shots.
///
/// # Errors
/// [`Stopped`].
pub fn check_table_ranges(
    footprints: &Footprints<BodyFixed>,
    profiles: &[Profile],
    spacecraft: Spacecraft<'_>,
    clock: &MolaClock,
    limits: &RangeCheckConfig,
    stop: &AtomicBool,
) -> Result<RangeCheck> {
    let mut shots = ShotResiduals::default();
    let mut checked = Vec::with_capacity(profiles.len());
    for (index, profile) in (0_u32..).zip(profiles) {
        Stopped::check(stop)?;
        let mut of_profile = ShotResiduals::default();
        for row in &profile.rows {
            let shot = footprints.row(*row as usize);
            let at = clock.spacecraft_time(shot.et_tag_s);
            if let Some(state) = spacecraft.state(at) {
                let mut residuals = RangeResiduals::of(&shot, &state);
                if !states_spacecraft(footprints, *row as usize) {
                    residuals.forget_own();
                }
                of_profile.push(index, *row, &residuals);
            }
        }
        let residuals_m: Vec<f64> = of_profile.range_minus_distance_m.iter().collect();
        of_profile.outlier = outliers(&residuals_m, limits.outlier_sigma).into();
        let mut ranges = statistics(profile, &of_profile, None, footprints);
        shots.append(of_profile);
        by_own_spacecraft(&mut ranges, footprints, profile, limits);
        let explain = || {
            "the orbit in support data or kernels differs from the orbit in the table, or times or radii in the table \
             are incorrect".to_owned()
        };
        ranges.invalid_because = ranges
            .figures()
            .broken_limits(&ranges.limits(limits), explain);
        checked.push(ranges);
    }
    Ok(RangeCheck {
        shots,
        profiles: checked,
        trajectory_error_m: spacecraft.kernels.map_or(0.0, Trajectory::max_error_m),
    })
}

impl Spacecraft<'_> {
    /// The spacecraft at an instant, if known: by an image, else by the kernels.
    fn state(&self, at: Et) -> Option<SpacecraftState> {
        let of_image = self.images.iter().find_map(|image| of_image(image, at));
        of_image.or_else(|| state(at, self.kernels?))
    }
}

/// The spacecraft of an image with the laser at an instant, within the time of its support data.
fn of_image(image: &ImageTimes, at: Et) -> Option<SpacecraftState> {
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

/// Adds the table's own spacecraft to the statistics of a profile, by all of its shots that have one.
fn by_own_spacecraft(
    ranges: &mut ProfileRanges,
    footprints: &Footprints<BodyFixed>,
    profile: &Profile,
    limits: &RangeCheckConfig,
) {
    let rows = profile.rows.iter().map(|row| *row as usize);
    let stated = rows.filter(|row| states_spacecraft(footprints, *row));
    let residuals = stated.map(|row| {
        let shot = footprints.row(row);
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
