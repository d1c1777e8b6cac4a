//! Statistics of an adjustment, for its report and tables.

use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{
    components::{component, tie_components, variance_factor},
    error::AdjustError,
    height_summary::beyond_limit,
    input::AdjustImage,
    network::{Assembled, projector},
    point_errors::PointErrors,
    points::PointKind,
    words::unknown_in_words,
};
use areograph_base::{
    footprints::{AdjustmentModel, FootprintImageCoordinates},
    schema::{at, none_negative},
};
use areograph_config::AdjustmentConfig;
use areograph_geom::statistics::{BAARDA_LIMIT, unit_weight_limits};
use areograph_geom::{
    bundle::{Adjustment, Residual},
    pushbroom::{CorrectedOrientation, ExteriorOrientation},
    statistics::Summary,
};

/// The kinds of observation.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "snake_case")]
pub enum ObservationType {
    /// Image coordinates of tie points along the track.
    TieAlong,
    /// Image coordinates of tie points across the track; uncontrolled without heights above the MOLA surface.
    TieAcross,
    /// Heights of tie points above the MOLA surface.
    MolaHeight,
    /// Image coordinates of footprints.
    MolaImage,
    /// Ranges.
    MolaRange,
    /// A priori values of orientation unknowns.
    Orientation,
    /// Initial coordinates of footprints.
    MolaGround,
    /// Given coordinates of tie points.
    TieGround,
    /// Time and range biases, the attitude clock offset and, for a laser on the same bus, boresight angles, profile
    /// shifts and line times; all have the a priori value 0.
    Bias,
    /// Laser spots in simultaneous images, computed from the mounting.
    LaserSpot,
}

impl ObservationType {
    /// The kind in words, with terms of the site in braces.
    #[must_use]
    pub const fn words(self) -> &'static str {
        match self {
            Self::TieAlong => "tie points in images, along the track",
            Self::TieAcross => "tie points in images, across the track",
            Self::MolaHeight => "heights from the {altimeter} surface",
            Self::MolaImage => "image coordinates of {altimeter}",
            Self::MolaRange => "{altimeter} ranges",
            Self::Orientation => "initial orientation",
            Self::MolaGround => "ground coordinates of {altimeter}",
            Self::TieGround => "given coordinates of tie points",
            Self::Bias => "time and range biases",
            Self::LaserSpot => "laser spots in simultaneous images, from the mounting",
        }
    }
}

/// Residual statistics of one kind of observation.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct TypeSummary {
    /// The kind.
    pub kind: ObservationType,
    /// Scalar observations.
    pub observations: usize,
    /// Sum of the redundancy numbers of these observations.
    #[schemars(range(min = 0.0))]
    pub redundancy: f64,
    /// Contribution of these observations to the weighted sum of squares.
    #[schemars(range(min = 0.0))]
    pub weighted_squares: f64,
    /// `sqrt(weighted squares / redundancy)`: near 1 if the standard deviations are correct; 0 without redundancy.
    #[schemars(range(min = 0.0))]
    pub variance_component: f64,
    /// Interval that contains 99 % of the values of `variance_component` if the standard deviations are correct, from
    /// the χ² distribution; 0 if the redundancy is below 1. With robust weights or overestimated roughness, the value
    /// for heights may lie below this interval.
    #[schemars(transform = none_negative)]
    pub variance_component_limits: [f64; 2],
    /// Number of observations with a standardised residual above 3.29.
    pub beyond_limit: usize,
}

impl TypeSummary {
    /// Whether its residuals are larger than chance explains: its standard deviations are too small, or a model fails.
    #[must_use]
    pub fn is_above_chance(&self) -> bool {
        let [_, most] = self.variance_component_limits;
        // Written so that NaN counts.
        most > 0.0 && !(self.variance_component <= most)
    }

    /// Whether they are smaller: its standard deviations are larger than the scatter.
    #[must_use]
    pub fn is_below_chance(&self) -> bool {
        let [least, most] = self.variance_component_limits;
        most > 0.0 && self.variance_component < least
    }
}

/// Statistics of the coordinates of one kind of point.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct GroundSummary {
    /// Adjusted minus initial coordinates X, Y and Z, metres.
    pub corrections_m: [Summary; 3],
    /// A posteriori standard deviations of X, Y and Z, metres; for footprints, including the uncertainty of the shift
    /// of the profile.
    pub sigmas_m: [Summary; 3],
}

/// Residuals of one image.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ImageSummary {
    /// Identifier.
    pub image: String,
    /// Residuals of tie points, along and across the track, focal-plane pixels.
    pub tie_residuals_px: [Summary; 2],
    /// Adjusted minus initial image coordinates of footprints, lines and pixels; empty if
    /// `adjustment.footprint_image_coordinates` is "off".
    pub mola_corrections: [Summary; 2],
}

/// Statistics of an adjustment.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct AdjustmentSummary {
    /// Number of steps of the iteration.
    pub steps: usize,
    /// Degrees of freedom.
    pub degrees_of_freedom: usize,
    /// A posteriori standard deviation of unit weight over all observations. The value mixes unrelated kinds of
    /// observation; `tie_components` tests the tie points.
    #[schemars(range(min = 0.0))]
    pub sigma0: f64,
    /// Model of the adjustment.
    pub model: AdjustmentModel,
    /// Standard deviations of unit weight of tie points, along and across the track; 0 without redundancy.
    #[schemars(transform = none_negative)]
    pub tie_components: [f64; 2],
    /// Standard deviation of the scatter of tie points in addition to their own standard deviations, focal-plane
    /// pixels, from residuals along the track; image jitter causes such scatter. The standard deviations of tie points
    /// include this scatter along the track, and 1.4 times as much (at most 1.5 px) across it. The value is 0 if chance
    /// explains the residuals, or without a blunder limit.
    #[serde(default)]
    #[schemars(range(min = 0.0))]
    pub tie_scatter_px: f64,
    /// Factor by which the a priori variances are scaled in covariances: 1, or the square of the larger of
    /// `tie_components` if it shows that measurements are worse than configured. A good fit never reduces covariances.
    #[schemars(range(min = 1.0))]
    pub variance_factor: f64,
    /// Residual statistics of each kind of observation that occurs.
    pub types: Vec<TypeSummary>,
    /// Footprints.
    pub shots: GroundSummary,
    /// Tie points.
    pub ties: GroundSummary,
    /// Residual statistics of each image, in order.
    pub images: Vec<ImageSummary>,
    /// Range bias of each profile and its standard deviation, metres, if range biases are unknowns.
    #[schemars(transform = at("/items/prefixItems/2", "minimum", 0))]
    pub range_biases_m: Vec<(String, f64, f64)>,
    /// Pairs of unknowns of one image, or of images that share points, with a correlation of more than 0.95 in
    /// magnitude: the unknowns of a pair must not be interpreted individually.
    #[schemars(transform = at("/items/prefixItems/2", "minimum", -1.000_001))]
    #[schemars(transform = at("/items/prefixItems/2", "maximum", 1.000_001))]
    pub correlated: Vec<(String, String, f64)>,
}

pub(super) fn summarise<M: ExteriorOrientation>(
    images: &[AdjustImage<M>],
    assembled: &Assembled<&M>,
    adjustment: &Adjustment,
    errors: &[Option<PointErrors>],
    config: &AdjustmentConfig,
) -> Result<AdjustmentSummary, AdjustError> {
    let (shots, ties) = (0..assembled.shots, assembled.shots..assembled.points.len());
    let in_words = |unknown| unknown_in_words(unknown, images, &assembled.profiles);
    let biases = assembled.profiles.iter().zip(&adjustment.range_biases_m);
    Ok(AdjustmentSummary {
        steps: adjustment.steps(),
        degrees_of_freedom: adjustment.degrees_of_freedom(),
        sigma0: adjustment.sigma0(),
        model: config.model,
        tie_components: tie_components(assembled, adjustment),
        tie_scatter_px: assembled.tie_scatter_px,
        variance_factor: variance_factor(assembled, adjustment),
        types: types(assembled, adjustment),
        shots: ground(assembled, adjustment, errors, shots),
        ties: ground(assembled, adjustment, errors, ties),
        images: images
            .iter()
            .enumerate()
            .map(|(index, image)| {
                Ok(ImageSummary {
                    image: image.oriented_camera.id.clone(),
                    tie_residuals_px: tie_residuals(assembled, adjustment, index),
                    mola_corrections: if config.footprints_in_images()
                        == FootprintImageCoordinates::Off
                    {
                        [Summary::default(); 2]
                    } else {
                        mola_corrections(image, assembled, adjustment, index)?
                    },
                })
            })
            .collect::<Result<_, AdjustError>>()?,
        range_biases_m: biases
            .filter_map(|(profile, bias)| {
                let (value_m, root_m) = (*bias)?;
                Some((
                    profile.name.clone(),
                    value_m,
                    root_m * variance_factor(assembled, adjustment).sqrt(),
                ))
            })
            .collect(),
        correlated: adjustment
            .correlated
            .iter()
            .map(|(first, second, coefficient)| (in_words(*first), in_words(*second), *coefficient))
            .collect(),
    })
}

fn types<M>(assembled: &Assembled<M>, adjustment: &Adjustment) -> Vec<TypeSummary> {
    let views = assembled.network.views.iter().zip(&adjustment.views);
    let of_views = |kind: PointKind| -> Vec<[Residual; 2]> {
        let required = views
            .clone()
            .filter(|(view, _)| assembled.kind(view.point) == kind);
        required.filter_map(|(_, residuals)| *residuals).collect()
    };
    let ties = of_views(PointKind::Tie);
    let of_axis = |axis: usize| ties.iter().map(|pair| pair[axis]).collect();
    let orientations = adjustment.images.iter().flat_map(|image| image.priors);
    let of_grounds = |kind: PointKind| -> Vec<Residual> {
        let points = adjustment.points.iter().enumerate();
        let required = points.filter(|(point, _)| assembled.kind(*point) == kind);
        required
            .filter_map(|(_, outcome)| outcome.as_ref().ok()?.priors)
            .flatten()
            .collect()
    };
    let all = [
        (ObservationType::TieAlong, of_axis(0)),
        (ObservationType::TieAcross, of_axis(1)),
        (
            ObservationType::MolaImage,
            of_views(PointKind::Shot).into_iter().flatten().collect(),
        ),
        (
            ObservationType::MolaRange,
            adjustment.ranges.iter().flatten().copied().collect(),
        ),
        (
            ObservationType::Orientation,
            orientations.flatten().collect(),
        ),
        (ObservationType::MolaGround, of_grounds(PointKind::Shot)),
        (ObservationType::TieGround, of_grounds(PointKind::Tie)),
        (ObservationType::Bias, biases(assembled, adjustment)),
        (ObservationType::LaserSpot, spots(adjustment)),
    ];
    let plain = all.into_iter();
    let plain = plain.filter(|(_, residuals)| !residuals.is_empty());
    let plain = plain.map(|(kind, residuals)| of_type(kind, &residuals));
    plain.chain(of_heights(adjustment)).collect()
}

/// Heights, whose weighted sum of squares cannot be split: their errors are correlated.
fn of_heights(adjustment: &Adjustment) -> Option<TypeSummary> {
    let redundancy = adjustment
        .heights
        .iter()
        .map(|height| height.redundancy)
        .sum();
    (!adjustment.heights.is_empty()).then(|| TypeSummary {
        kind: ObservationType::MolaHeight,
        observations: adjustment.heights.len(),
        redundancy,
        weighted_squares: adjustment.height_squares,
        variance_component: component(adjustment.height_squares, redundancy),
        variance_component_limits: unit_weight_limits(redundancy).unwrap_or_default(),
        beyond_limit: beyond_limit(&adjustment.heights),
    })
}

/// Residuals of spots of a laser on the same bus.
fn spots(adjustment: &Adjustment) -> Vec<Residual> {
    let spots = adjustment.common_bus.iter().flat_map(|bus| &bus.spots);
    spots.flatten().flatten().copied().collect()
}

/// Residuals of time and range biases, of the attitude clock, and of the unknowns of a laser on the same bus; the
/// initial values are 0.
fn biases<M>(assembled: &Assembled<M>, adjustment: &Adjustment) -> Vec<Residual> {
    let images = assembled.network.images.iter().zip(&adjustment.images);
    let times = images.map(|(image, adjusted)| (image.time_bias_sigma_s, adjusted.time_bias_s));
    let ranges = assembled.network.range_bias_sigmas_m.iter().copied();
    let ranges = ranges.zip(adjustment.range_biases_m.iter().copied());
    let clock = assembled.network.attitude_clock.iter();
    let clock = clock.map(|clock| (clock.sigma_s, adjustment.attitude_clock_s));
    let biases = times.chain(ranges).chain(clock);
    let weighted = biases.filter(|(sigma, _)| sigma.is_finite());
    let weighted = weighted.filter_map(|(sigma, estimate)| {
        let (bias, root_cofactor) = estimate?;
        Some(Residual {
            value: -bias,
            sigma,
            redundancy: (1.0 - (root_cofactor / sigma).powi(2)).clamp(0.0, 1.0),
            weight_factor: 1.0,
        })
    });
    let of_bus = adjustment.common_bus.iter().flat_map(|bus| {
        let shifts = bus.profile_shifts_m.iter().flatten();
        let times = bus.line_times_s.iter().flatten();
        let unknowns = bus.boresight_rad.iter().chain(shifts).chain(times);
        unknowns.filter_map(|unknown| unknown.prior)
    });
    weighted.chain(of_bus).collect()
}

fn of_type(kind: ObservationType, residuals: &[Residual]) -> TypeSummary {
    let redundancy: f64 = residuals.iter().map(|residual| residual.redundancy).sum();
    let weighted_squares: f64 = residuals.iter().map(Residual::weighted_square).sum();
    let beyond = |residual: &&Residual| {
        let standardised = residual.standardised();
        standardised.is_some_and(|value| value.abs() > BAARDA_LIMIT)
    };
    TypeSummary {
        kind,
        observations: residuals.len(),
        redundancy,
        weighted_squares,
        variance_component: component(weighted_squares, redundancy),
        variance_component_limits: unit_weight_limits(redundancy).unwrap_or_default(),
        beyond_limit: residuals.iter().filter(beyond).count(),
    }
}

fn ground<M>(
    assembled: &Assembled<M>,
    adjustment: &Adjustment,
    errors: &[Option<PointErrors>],
    points: std::ops::Range<usize>,
) -> GroundSummary {
    let found: Vec<(Vector3<f64>, Vector3<f64>)> = points
        .filter_map(|point| {
            let adjusted = adjustment.points[point].as_ref().ok()?;
            let correction_m = adjusted.ground_m - assembled.network.points[point].ground_m;
            let sigma_m = errors[point]?.covariance_m2.diagonal().map(f64::sqrt);
            Some((correction_m, sigma_m))
        })
        .collect();
    let summary = |values: Vec<f64>| Summary::of(&values);
    GroundSummary {
        corrections_m: [0, 1, 2].map(|axis| summary(found.iter().map(|(m, _)| m[axis]).collect())),
        sigmas_m: [0, 1, 2].map(|axis| summary(found.iter().map(|(_, m)| m[axis]).collect())),
    }
}

fn tie_residuals<M>(
    assembled: &Assembled<M>,
    adjustment: &Adjustment,
    image: usize,
) -> [Summary; 2] {
    let views = assembled.network.views.iter().zip(&adjustment.views);
    let residuals: Vec<[f64; 2]> = views
        .filter(|(view, _)| view.image == image && assembled.kind(view.point) == PointKind::Tie)
        .filter_map(|(_, residuals)| Some((*residuals)?.map(|residual| residual.value)))
        .collect();
    by_axis(&residuals)
}

/// Adjusted footprints in the adjusted orientation, minus their initial image coordinates.
fn mola_corrections<M: ExteriorOrientation>(
    image: &AdjustImage<M>,
    assembled: &Assembled<&M>,
    adjustment: &Adjustment,
    index: usize,
) -> Result<[Summary; 2], AdjustError> {
    let orientation = CorrectedOrientation {
        base: &image.oriented_camera.orientation,
        correction: adjustment.images[index].correction,
    };
    let projector = projector(image, &orientation)?;
    let corrections: Vec<[f64; 2]> = assembled
        .mola
        .iter()
        .filter(|view| view.image == index)
        .filter_map(|view| {
            let point = adjustment.points[view.point].as_ref().ok()?;
            let seen = projector.project(&point.ground_m).ok()?;
            let focal = image
                .oriented_camera
                .detector
                .focal_px(&seen.camera_m)
                .ok()?;
            Some([seen.x - view.x_lines, focal.y - view.y_px])
        })
        .collect();
    Ok(by_axis(&corrections))
}

fn by_axis(pairs: &[[f64; 2]]) -> [Summary; 2] {
    [0, 1].map(|axis| {
        let values: Vec<f64> = pairs.iter().map(|pair| pair[axis]).collect();
        Summary::of(&values)
    })
}
