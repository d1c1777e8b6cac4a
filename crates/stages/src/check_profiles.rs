//! Profiles of the altimeter against each other: crossovers, shifts, and the surface tested on withheld profiles.
//!
//! The surface between the shots gives a height and its standard deviation. To test both, every profile in turn is
//! withheld, predicted from the others, and compared.

use std::sync::atomic::AtomicBool;

use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{
    convert_datum::Converted,
    group_profiles::Profile,
    mola_surface::{CrossedProfiles, MolaShots},
};
use areograph_base::{
    error::Result,
    footprints::Footprints,
    frames::{BodyFixed, Position},
    minus::signed,
};
use areograph_config::MolaSurfaceConfig;
use areograph_geom::{
    statistics::Summary,
    surface::{Crossover, LeftOut, SurfaceOptions, Withheld, WithheldScore, withheld},
};
use areograph_store::{
    stage::{Output, Stage},
    stage_inputs,
};

/// The profiles of a site against each other.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct ProfileCheck {
    /// Every crossing of two profiles.
    pub crossovers: Vec<ProfileCrossover>,
    /// Differences at the crossovers of profiles that belong, metres.
    pub differences_m: Summary,
    /// Standard deviation of the radial error that the shots of a profile share, from crossovers and the a priori value, metres.
    pub profile_sigma_m: f64,
    /// Shifts of profiles with crossovers.
    pub shifts: Vec<ShiftedProfile>,
    /// Profiles that do not belong to the others; the surface does not use them.
    pub left_out: Vec<LeftOutProfile>,
    /// Stretches of profiles, predicted from the other profiles.
    pub stretches: Vec<WithheldStretch>,
    /// Quality of their prediction; `None` without any stretch.
    pub score: Option<WithheldScore>,
}

/// A crossing of two profiles.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ProfileCrossover {
    /// Indices of the profiles.
    pub profiles: [usize; 2],
    /// Position of the crossing, at the mean of both heights.
    pub ground: Position<BodyFixed>,
    /// Height from the first minus height from the second, metres.
    pub difference_m: f64,
    /// Standard deviation of the difference by noise and interpolation, metres.
    pub sigma_m: f64,
}

/// Shift of a profile.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ShiftedProfile {
    /// Identifier.
    pub profile: String,
    /// Crossovers.
    pub crossovers: usize,
    /// Offset of the recorded from the true position of the profile in east, north and height, metres.
    pub shift_m: [f64; 3],
    /// Covariance of the offset, m².
    pub covariance_m2: [[f64; 3]; 3],
}

/// A profile that is rejected because it contradicts the profiles that it crosses: it lies above or below them, or is misplaced.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct LeftOutProfile {
    /// Identifier.
    pub profile: String,
    /// Number of crossovers with other profiles.
    pub crossovers: usize,
    /// Identifiers of the profiles that it crosses.
    pub others: Vec<String>,
    /// Height of the profile above the others, metres.
    pub above_m: f64,
    /// Standard deviation of `above_m`, metres.
    pub sigma_m: f64,
    /// Robust root mean square of the height differences at its crossovers, each divided by its standard deviation,
    /// which includes the uncertainty of the shifts of both profiles; 1 is expected.
    pub misfit: f64,
    /// Whether the profile is misplaced horizontally; false if its mean height differs from that of the others by more
    /// than five standard deviations.
    pub misplaced: bool,
}

impl ProfileCheck {
    /// The remark on profiles that are left out, one sentence.
    #[must_use]
    pub fn remark(&self) -> Option<String> {
        let named = |misplaced: bool| {
            let profiles = self.left_out.iter();
            let named = profiles
                .filter(|profile| profile.misplaced == misplaced)
                .map(|profile| {
                    let others = profile.others.len();
                    let evidence = if misplaced {
                        format!("misfit {:.1}", profile.misfit)
                    } else {
                        format!("{} m", signed(profile.above_m, 1))
                    };
                    format!("{} ({evidence}, {others} profiles)", profile.profile)
                });
            named.collect::<Vec<_>>().join(", ")
        };
        let reasons = [
            (
                false,
                "profiles above or below all profiles that they cross",
            ),
            (true, "misplaced profiles"),
        ];
        let sentences = reasons.map(|(misplaced, reason)| {
            let named = named(misplaced);
            (!named.is_empty())
                .then(|| format!("{reason}, rejected for the surface between shots: {named}"))
        });
        let sentences: Vec<String> = sentences.into_iter().flatten().collect();
        (!sentences.is_empty()).then(|| sentences.join("; "))
    }
}

/// A stretch of a profile, predicted from the other profiles.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct WithheldStretch {
    /// Identifier of the profile.
    pub profile: String,
    /// Shots.
    pub shots: usize,
    /// Mean of measured minus predicted heights, metres.
    pub above_m: f64,
    /// Standard deviation of `above_m` according to the surface, metres.
    pub sigma_m: f64,
    /// Distance to the nearest shot of another profile, metres.
    pub nearest_shot_m: f64,
}

stage_inputs! {
    /// The shots, and their a priori uncertainties.
    pub struct CheckProfiles<'a> {
        /// Footprints in IAU 2000.
        pub converted: &'a Output<Converted>,
        /// Profiles.
        pub profiles: &'a Output<Vec<Profile>>,
        /// Uncertainties of the surface.
        pub laser_surface: &'a MolaSurfaceConfig,
    }
}

impl Stage for CheckProfiles<'_> {
    const NAME: &'static str = "check_profiles";
    const METHOD: u32 = 7;
    type Output = ProfileCheck;
    stage_inputs!(fingerprint);

    fn run(&self, _stop: &AtomicBool) -> Result<ProfileCheck> {
        let footprints = &self.converted.value()?.footprints;
        Ok(check_profiles(
            footprints,
            self.profiles.value()?,
            &self.laser_surface.options(footprints.body),
        ))
    }
}

/// Compares the profiles with each other at their crossovers, and each with the surface of the others.
#[must_use]
pub fn check_profiles(
    footprints: &Footprints<BodyFixed>,
    profiles: &[Profile],
    options: &SurfaceOptions,
) -> ProfileCheck {
    let (shots, crossed) = MolaShots::crossed(footprints, profiles, options);
    let stretches = withheld(&shots.shots, &shots.options(options));
    let score = WithheldScore::of(&stretches);
    let stretch = |of: Withheld| WithheldStretch {
        profile: profiles[of.profile].id.clone(),
        shots: of.shots,
        above_m: of.above_m,
        sigma_m: of.sigma_m,
        nearest_shot_m: of.nearest_m,
    };
    ProfileCheck {
        score,
        stretches: stretches.into_iter().map(stretch).collect(),
        ..described(&crossed, profiles, options)
    }
}

/// Compares the profiles with each other at their crossovers; no surface is tested.
#[must_use]
pub fn cross_profiles(
    footprints: &Footprints<BodyFixed>,
    profiles: &[Profile],
    options: &SurfaceOptions,
) -> ProfileCheck {
    let (_, crossed) = MolaShots::crossed(footprints, profiles, options);
    described(&crossed, profiles, options)
}

fn described(
    CrossedProfiles { crossovers, net }: &CrossedProfiles,
    profiles: &[Profile],
    options: &SurfaceOptions,
) -> ProfileCheck {
    let id = |profile: usize| profiles[profile].id.clone();
    let belonging = net.belonging(crossovers);
    let differences_m: Vec<f64> = belonging.iter().map(|of| of.difference_m).collect();
    let shifts = net
        .shifts(crossovers, options.profile_plan_sigma_m)
        .into_iter();
    let left_out = net.left_out.iter().map(|of: &LeftOut| LeftOutProfile {
        profile: id(of.profile),
        crossovers: of.crossovers,
        others: of.others.iter().map(|other| id(*other)).collect(),
        above_m: of.above_m,
        sigma_m: of.sigma_m,
        misfit: of.misfit,
        misplaced: !of.is_above(),
    });
    ProfileCheck {
        differences_m: Summary::of(&differences_m),
        profile_sigma_m: net.radial_sigma_m,
        shifts: shifts
            .map(|of| ShiftedProfile {
                profile: id(of.profile),
                crossovers: of.crossovers,
                shift_m: of.shift_m.into(),
                covariance_m2: of.covariance_m2.into(),
            })
            .collect(),
        left_out: left_out.collect(),
        crossovers: crossovers
            .iter()
            .map(|of: &Crossover| ProfileCrossover {
                profiles: of.profiles,
                ground: Position::new(Vector3::from(of.place_m)),
                difference_m: of.difference_m,
                sigma_m: of.sigma_m,
            })
            .collect(),
        ..ProfileCheck::default()
    }
}
