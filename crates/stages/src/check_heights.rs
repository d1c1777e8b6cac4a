//! Heights of tie points above the ground between MOLA's shots.
//!
//! Tie points measure the along-track parallax; across-track errors of the images become height errors that tie points
//! do not reveal. The altimeter does.

use std::sync::atomic::AtomicBool;

use nalgebra::{Vector2, Vector3};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{
    adjust::{Adjusted, PointKind},
    convert_datum::Converted,
    group_profiles::Profile,
    intersect::IntersectedTies,
    mola_surface::MolaShots,
};
use areograph_base::{
    error::Result,
    footprints::Footprints,
    frames::{BodyFixed, Position},
};
use areograph_config::MolaSurfaceConfig;
use areograph_geom::{
    statistics::Summary,
    surface::{MeanHeight, PlaceHeight, SurfaceOptions},
};
use areograph_store::{
    stage::{Input, Inputs, Output, Round, Stage},
    stage_inputs,
};

/// A tie point nearer to a shot than this counts as controlled by it, metres.
const NEAR_SHOT_M: f64 = 1_000.0;
/// Of more tie points than this, an even selection is used for their common error, which has a term for every pair.
const IN_COMMON_MAX: usize = 1_000;

/// Heights of the tie points of a site with one orientation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct HeightCheck {
    /// Figures of the surface, or the reason why there is none.
    pub surface: std::result::Result<SurfaceFigures, String>,
    /// Every tie point that is compared, in the order of the tie points.
    pub ties: Vec<TieHeight>,
    /// Heights above the surface, metres.
    pub above_m: Summary,
    /// Standard deviation of their mean due to the surface only, metres: neighbours share its errors.
    pub mean_sigma_m: f64,
    /// Tie points within a kilometre of a shot.
    pub near_shots: usize,
    /// The two profiles whose separate surfaces at the tie points contradict each other most; `None` for a single
    /// profile.
    pub apart: Option<ProfilesApart>,
}

/// Surface with which heights are compared.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SurfaceFigures {
    /// Shots.
    pub shots: usize,
    /// Number of profiles to which these shots belong.
    pub profiles: usize,
    /// Root mean square difference of heights 300 m apart, metres.
    pub roughness_m: f64,
    /// Root mean square slope, per axis, at the tie points, metres per metre.
    pub slope: f64,
}

/// A tie point and the ground under it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct TieHeight {
    /// Index of the tie point.
    pub tie: usize,
    /// Its position.
    pub ground: Position<BodyFixed>,
    /// Its height above the ellipsoid along the radius, metres.
    pub height_m: f64,
    /// Height of the surface there, metres.
    pub surface_m: f64,
    /// Standard deviation of the surface height, metres.
    pub surface_sigma_m: f64,
    /// Distance of the nearest shot in plan, metres.
    pub nearest_shot_m: f64,
}

impl TieHeight {
    /// Height above the surface, metres.
    #[must_use]
    pub fn above_m(&self) -> f64 {
        self.height_m - self.surface_m
    }
}

/// Surfaces of two profiles at the same tie points.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ProfilesApart {
    /// Identifiers.
    pub profiles: [String; 2],
    /// Mean height of the first surface above the second, metres.
    pub mean_m: f64,
    /// Standard deviation of `mean_m`, metres.
    pub sigma_m: f64,
    /// Number of pairs of profiles that were compared.
    pub pairs: usize,
}

impl ProfilesApart {
    /// The difference in its standard deviations, without its sign.
    #[must_use]
    pub fn sigmas(&self) -> f64 {
        self.mean_m.abs() / self.sigma_m
    }

    /// The limit that the worst of all pairs exceeds by chance as often as one pair exceeds `one_pair`, both in
    /// standard deviations: the tail of the normal distribution falls like exp(−z²/2).
    #[must_use]
    pub fn limit(&self, one_pair: f64) -> f64 {
        let pairs = self.pairs.max(1) as f64;
        one_pair.hypot((2.0 * pairs.ln()).sqrt())
    }
}

/// The points whose heights are checked.
#[derive(Debug, Clone, Copy)]
pub enum CheckedPoints<'a> {
    /// Intersections of rays with one orientation.
    Intersected(&'a Output<IntersectedTies>),
    /// Points of the adjustment.
    Adjusted(&'a Output<Adjusted>),
}

impl Input for CheckedPoints<'_> {
    fn add_to(&self, field: &str, inputs: &mut Inputs) {
        match self {
            Self::Intersected(points) => points.add_to(field, inputs),
            Self::Adjusted(points) => points.add_to(field, inputs),
        }
    }
}

impl CheckedPoints<'_> {
    /// Every point with the index of its tie point.
    fn all(&self) -> Result<Vec<(usize, Position<BodyFixed>)>> {
        Ok(match self {
            Self::Intersected(points) => {
                let points = points.value()?.points.iter();
                points.map(|point| (point.tie, point.ground)).collect()
            }
            Self::Adjusted(points) => {
                let points = points.value()?.points.iter();
                let ties = points.filter(|point| point.kind == PointKind::Tie);
                ties.map(|point| (point.index, point.ground)).collect()
            }
        })
    }
}

stage_inputs! {
    /// Tie points on the ground, and the shots.
    pub struct CheckHeights<'a> {
        /// Orientation from which the points come.
        pub round: Round,
        /// The points.
        pub points: CheckedPoints<'a>,
        /// Footprints in IAU 2000.
        pub converted: &'a Output<Converted>,
        /// Profiles.
        pub profiles: &'a Output<Vec<Profile>>,
        /// Uncertainties of the surface.
        pub laser_surface: &'a MolaSurfaceConfig,
    }
}

impl Stage for CheckHeights<'_> {
    const NAME: &'static str = "check_heights";
    const METHOD: u32 = 8;
    type Output = HeightCheck;
    stage_inputs!(fingerprint);

    fn part(&self) -> Option<String> {
        self.round.part()
    }

    fn run(&self, _stop: &AtomicBool) -> Result<HeightCheck> {
        let footprints = &self.converted.value()?.footprints;
        Ok(check_heights(
            &self.points.all()?,
            footprints,
            self.profiles.value()?,
            &self.laser_surface.options(footprints.body),
        ))
    }
}

/// Compares tie points, each with its index, with the surface of all shots.
#[must_use]
pub fn check_heights(
    points: &[(usize, Position<BodyFixed>)],
    footprints: &Footprints<BodyFixed>,
    profiles: &[Profile],
    options: &SurfaceOptions,
) -> HeightCheck {
    let places_m: Vec<Vector3<f64>> = points.iter().map(|(_, ground)| ground.xyz_m).collect();
    let shots = MolaShots::of(footprints, profiles, options);
    let surface = match shots.surface(&places_m, options) {
        Ok(surface) => surface,
        Err(error) => return HeightCheck::without_surface(error.to_string()),
    };
    if points.is_empty() {
        return HeightCheck::without_surface("no tie point has a ground point".to_owned());
    }
    let found = surface.predict_each(&places_m);
    let height =
        |((tie, ground), found): (&(usize, Position<BodyFixed>), &PlaceHeight)| TieHeight {
            tie: *tie,
            ground: *ground,
            height_m: surface.height_m(&ground.xyz_m).0,
            surface_m: found.height_m,
            surface_sigma_m: found.sigma_m,
            nearest_shot_m: found.nearest_m,
        };
    let ties: Vec<TieHeight> = points.iter().zip(&found).map(height).collect();
    let step = places_m.len().div_ceil(IN_COMMON_MAX).max(1);
    let places_m: Vec<Vector3<f64>> = places_m.into_iter().step_by(step).collect();
    let slopes: Vec<Vector2<f64>> = found.iter().step_by(step).map(|of| of.slope).collect();
    let above_m: Vec<f64> = ties.iter().map(TieHeight::above_m).collect();
    let near = ties.iter().filter(|tie| tie.nearest_shot_m < NEAR_SHOT_M);
    HeightCheck {
        surface: Ok(SurfaceFigures {
            shots: surface.shots(),
            profiles: surface.profiles().len(),
            roughness_m: surface.variogram().roughness_m,
            slope: slope(&slopes),
        }),
        above_m: Summary::of(&above_m),
        mean_sigma_m: surface.predict_mean(&places_m).variance_m2.sqrt(),
        near_shots: near.count(),
        apart: apart(&shots, &places_m, profiles, options),
        ties,
    }
}

impl HeightCheck {
    fn without_surface(reason: String) -> Self {
        Self {
            surface: Err(reason),
            ties: Vec::new(),
            above_m: Summary::default(),
            mean_sigma_m: 0.0,
            near_shots: 0,
            apart: None,
        }
    }
}

/// Root mean square slope on an axis.
fn slope(slopes: &[Vector2<f64>]) -> f64 {
    let squares = slopes.iter().map(|slope| 0.5 * slope.norm_squared());
    (squares.sum::<f64>() / slopes.len().max(1) as f64).sqrt()
}

/// The two of the separate profile surfaces that contradict each other most.
fn apart(
    shots: &MolaShots,
    places_m: &[Vector3<f64>],
    profiles: &[Profile],
    options: &SurfaceOptions,
) -> Option<ProfilesApart> {
    let alone = shots.by_profile();
    let found: Vec<(&str, MeanHeight)> = alone
        .par_iter()
        .filter_map(|(index, shots)| {
            let surface = shots.surface(places_m, options).ok()?;
            Some((&*profiles[*index].id, surface.predict_mean(places_m)))
        })
        .collect();
    let count = found.len() * found.len().saturating_sub(1) / 2;
    let pairs = found.iter().enumerate().flat_map(|(index, (id, one))| {
        let others = found[index + 1..].iter();
        others.map(move |(other_id, other)| ProfilesApart {
            profiles: [id, other_id].map(|id| (*id).to_owned()),
            mean_m: one.height_m - other.height_m,
            sigma_m: (one.variance_m2 + other.variance_m2).sqrt(),
            pairs: count,
        })
    });
    // Of equal pairs the first: profiles with most shots.
    pairs.reduce(|worst, pair| {
        if pair.sigmas().total_cmp(&worst.sigmas()).is_gt() {
            pair
        } else {
            worst
        }
    })
}
