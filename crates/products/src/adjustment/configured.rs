//! Configuration of an adjustment, as repeated in its document.

use schemars::JsonSchema;
use serde::Serialize;

use crate::site::ImageProducts;
use areograph_base::{
    constants::SPACECRAFT,
    footprints::{AdjustmentModel, FootprintImageCoordinates},
    schema::{all_positive, none_negative},
};
use areograph_config::{
    AdjustmentConfig, OrientationPrior, PositionUnknowns, ReliefForPlan, RotationUnknowns,
};
use areograph_geom::robust::RobustWeight;

/// [`AdjustmentConfig`] without unset keys.
#[derive(Serialize, JsonSchema)]
#[allow(
    clippy::struct_excessive_bools,
    reason = "each is a separate key of the site file"
)]
pub(super) struct AdjustmentKeys<'a> {
    #[schemars(transform = all_positive)]
    tie_sigma_px: [f64; 2],
    model: AdjustmentModel,
    footprint_image_coordinates: FootprintImageCoordinates,
    #[schemars(transform = all_positive)]
    footprint_sigma_px: [f64; 2],
    #[schemars(range(min = 0.0))]
    footprint_margin_px: f64,
    #[schemars(extend("exclusiveMinimum" = 0))]
    ground_sigma_m: f64,
    #[schemars(extend("exclusiveMinimum" = 0))]
    range_sigma_m: f64,
    #[schemars(range(min = 0.0))]
    range_bias_sigma_m: f64,
    #[schemars(range(min = 0.0))]
    time_bias_sigma_s: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(transform = none_negative)]
    position_sigma_m: Option<[f64; 3]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(transform = none_negative)]
    rotation_sigma_rad: Option<[f64; 3]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0))]
    line_time_sigma_s: Option<f64>,
    position_unknowns: PositionUnknowns,
    rotation_unknowns: RotationUnknowns,
    orbit_of_pedr: bool,
    relief_for_plan: ReliefForPlan,
    attitude_clock: bool,
    #[schemars(extend("exclusiveMinimum" = 0))]
    attitude_clock_sigma_s: f64,
    #[schemars(extend("exclusiveMinimum" = 0))]
    attitude_clock_rotation_sigma_rad: f64,
    common_bus: bool,
    #[schemars(range(min = 0.0))]
    boresight_sigma_rad: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0))]
    boresight_line_time_sigma_s: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0))]
    position_sigma_nadir_m: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0))]
    position_sigma_off_nadir_m: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    robust: Option<&'a RobustWeight>,
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    blunder_limit: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    height_blunder_limit: Option<f64>,
    images: Vec<PriorKeys<'a>>,
}

#[derive(Serialize, JsonSchema)]
struct PriorKeys<'a> {
    id: &'a str,
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(transform = none_negative)]
    position_m: Option<[f64; 9]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(transform = none_negative)]
    rotation_rad: Option<[f64; 9]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    position_unknowns: Option<PositionUnknowns>,
    #[serde(skip_serializing_if = "Option::is_none")]
    rotation_unknowns: Option<RotationUnknowns>,
}

impl<'a> AdjustmentKeys<'a> {
    /// The keys; standard deviations that the spacecraft of the images determine are left out where these differ.
    pub(super) fn of(config: &'a AdjustmentConfig, images: &[ImageProducts<'_>]) -> Self {
        // JSON has no infinity.
        let number = |sigma: f64| sigma.min(f64::MAX);
        let is_of_surface = config.model == AdjustmentModel::MolaSurface;
        let mut spacecraft = images.iter().map(|of| of.times.instrument.spacecraft);
        let first = spacecraft.next().unwrap_or(*SPACECRAFT);
        let common = spacecraft.all(|other| other == first).then_some(first);
        let position_m = config
            .position_sigma_m
            .or_else(|| Some(config.position_sigma_m(common?)));
        let rotation_rad = config
            .rotation_sigma_rad
            .or_else(|| Some(config.rotation_sigma_rad(common?)));
        let published_m = (!is_of_surface).then(|| config.published_sigmas_m().map(number));
        let prior = |prior: &'a OrientationPrior| PriorKeys {
            id: &prior.id,
            position_m: prior.position_m.map(|sigmas| sigmas.map(number)),
            rotation_rad: prior.rotation_rad.map(|sigmas| sigmas.map(number)),
            position_unknowns: prior.position_unknowns,
            rotation_unknowns: prior.rotation_unknowns,
        };
        Self {
            tie_sigma_px: config.tie_sigma_px,
            model: config.model,
            footprint_image_coordinates: config.footprints_in_images(),
            footprint_sigma_px: config.footprint_sigma_px,
            footprint_margin_px: config.footprint_margin_px,
            ground_sigma_m: config.ground_sigma_m,
            range_sigma_m: config.range_sigma_m,
            range_bias_sigma_m: config.range_bias_m(),
            time_bias_sigma_s: config.time_bias_sigma_s,
            position_sigma_m: position_m
                .filter(|_| is_of_surface)
                .map(|of| of.map(number)),
            rotation_sigma_rad: rotation_rad
                .filter(|_| is_of_surface)
                .map(|of| of.map(number)),
            line_time_sigma_s: is_of_surface.then_some(config.line_time_sigma_s),
            position_unknowns: config.position_unknowns,
            rotation_unknowns: config.rotation_unknowns,
            orbit_of_pedr: config.orbit_of_pedr,
            relief_for_plan: config.relief_for_plan,
            attitude_clock: config.attitude_clock,
            attitude_clock_sigma_s: config.attitude_clock_sigma_s,
            attitude_clock_rotation_sigma_rad: config.attitude_clock_rotation_sigma_rad,
            common_bus: config.common_bus,
            boresight_sigma_rad: config.boresight_sigma_rad,
            boresight_line_time_sigma_s: config.boresight_line_time_sigma_s,
            position_sigma_nadir_m: published_m.map(|[nadir_m, _]| nadir_m),
            position_sigma_off_nadir_m: published_m.map(|[_, other_m]| other_m),
            robust: config.robust.as_ref(),
            blunder_limit: config.blunder_limit,
            height_blunder_limit: config.height_blunder_limit.filter(|_| is_of_surface),
            images: config.images.iter().map(prior).collect(),
        }
    }
}
