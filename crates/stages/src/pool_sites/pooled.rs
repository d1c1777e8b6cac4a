//! Results of many sites in the form of the tables of Shan et al. 2005.

use schemars::JsonSchema;
use serde::Serialize;

use super::rows::{ImageRow, PairRow, PairState, ProfileRow, RangeStatistics};
use areograph_base::units::{RADIANS_PER_ARCSECOND, RADIANS_PER_DEGREE, SECONDS_PER_MS};
use areograph_geom::{
    polynomial,
    robust_mean::{Observation, RobustMean},
    statistics::Summary,
    uncertainty::ResidualMoments,
};

/// Root mean square; `None` without values.
fn root_mean_square(values: impl IntoIterator<Item = f64>) -> Option<f64> {
    let values: Vec<f64> = values.into_iter().collect();
    (!values.is_empty()).then(|| polynomial::root_mean_square(&values))
}

fn count(count: usize) -> u32 {
    u32::try_from(count).unwrap_or(u32::MAX)
}

/// Images (Table 2 of Shan et al. 2005), over the images for which each value is known.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct ImagesPooled {
    /// Images of valid sites, each once.
    pub images: u32,
    /// Emission at the centre, degrees.
    pub emission_deg: Summary,
    /// Exposure of one detector line, milliseconds.
    pub exposure_ms: Summary,
    /// Distance of successive lines on the ground, metres.
    pub line_spacing_m: Summary,
    /// Width of a pixel on the ground, metres.
    pub pixel_size_m: Summary,
    /// Median distance of successive footprints of the simultaneous profile, metres.
    pub shot_spacing_m: Summary,
    /// Footprints that the delivered image shows.
    pub footprints_inside: Summary,
}

impl ImagesPooled {
    pub(super) fn of(images: &[&ImageRow]) -> Self {
        let oriented = || images.iter().filter_map(|image| image.oriented.as_ref());
        let of = |values: Vec<Option<f64>>| {
            Summary::of(&values.into_iter().flatten().collect::<Vec<f64>>())
        };
        let degrees = |radians: f64| radians / RADIANS_PER_DEGREE;
        Self {
            images: count(images.len()),
            emission_deg: of(images
                .iter()
                .map(|image| image.emission_rad.map(degrees))
                .collect()),
            exposure_ms: of(images
                .iter()
                .map(|image| image.exposure_s.map(|seconds| seconds / SECONDS_PER_MS))
                .collect()),
            line_spacing_m: of(oriented().map(|image| image.line_spacing_m).collect()),
            pixel_size_m: of(oriented().map(|image| image.pixel_size_m).collect()),
            shot_spacing_m: of(oriented().map(|image| image.shot_spacing_m).collect()),
            footprints_inside: of(oriented()
                .map(|image| Some(f64::from(image.inside)))
                .collect()),
        }
    }
}

/// Range minus distance over many profiles (Table 3 of Shan et al. 2005), outliers and rejected profiles included.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct RangesPooled {
    /// Profiles with shots.
    pub profiles: u32,
    /// Shots.
    pub shots: u64,
    /// Mean over all shots, metres.
    pub mean_m: f64,
    /// Standard deviation over all shots, metres.
    #[schemars(range(min = 0.0))]
    pub deviation_m: f64,
    /// Standard deviation within profiles, metres: root of the mean variance, weighted by degrees of freedom.
    #[schemars(range(min = 0.0))]
    pub within_profiles_m: f64,
    /// Means of the profiles, metres.
    pub means_m: Summary,
}

impl RangesPooled {
    /// `None` without shots.
    pub(super) fn of(profiles: &[RangeStatistics]) -> Option<Self> {
        let used = || profiles.iter().filter(|of| of.n > 0);
        let shots: f64 = used().map(|of| f64::from(of.n)).sum();
        if shots <= 0.0 {
            return None;
        }
        let mean_m = used().map(|of| f64::from(of.n) * of.mean_m).sum::<f64>() / shots;
        let freedom = |of: &RangeStatistics| f64::from(of.n) - 1.0;
        let within: f64 = used().map(|of| freedom(of) * of.deviation_m.powi(2)).sum();
        let between: f64 = used()
            .map(|of| f64::from(of.n) * (of.mean_m - mean_m).powi(2))
            .sum();
        let means: Vec<f64> = used().map(|of| of.mean_m).collect();
        let spare: f64 = used().map(freedom).sum();
        Some(Self {
            profiles: count(means.len()),
            shots: used().map(|of| u64::from(of.n)).sum(),
            mean_m,
            deviation_m: ((within + between) / (shots - 1.0).max(1.0)).sqrt(),
            within_profiles_m: (within / spare.max(1.0)).sqrt(),
            means_m: Summary::of(&means),
        })
    }

    /// Of all shots of these profiles, which share none.
    pub(super) fn of_all(profiles: &[&ProfileRow]) -> Option<Self> {
        Self::of(&profiles.iter().map(|of| of.ranges).collect::<Vec<_>>())
    }

    /// Of their shots in simultaneous images.
    pub(super) fn of_images(profiles: &[&ProfileRow]) -> Option<Self> {
        Self::of(&profiles.iter().map(|of| of.in_image).collect::<Vec<_>>())
    }
}

/// Residuals of polynomials about orientations (Table 4 of Shan et al. 2005): roots of mean squares over the images.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct RmsePooled {
    /// Order of the polynomials.
    #[schemars(range(min = 1, max = 2))]
    pub order: u8,
    /// Images.
    pub images: u32,
    /// X, Y and Z, metres.
    pub position_m: [f64; 3],
    /// ω, φ and κ, arc seconds.
    pub angles_arcsec: [f64; 3],
}

impl RmsePooled {
    /// Both orders; empty without images.
    pub(super) fn of(images: &[&ImageRow]) -> Vec<Self> {
        let of_order = |(place, order): (usize, u8)| {
            let oriented = images.iter().filter_map(|image| image.oriented.as_ref());
            let rmse: Vec<_> = oriented.map(|image| image.rmse[place]).collect();
            let position =
                |axis: usize| root_mean_square(rmse.iter().map(|of| of.position_m[axis]));
            let angle = |axis: usize| root_mean_square(rmse.iter().map(|of| of.angles_rad[axis]));
            Some(Self {
                order,
                images: count(rmse.len()),
                position_m: [position(0)?, position(1)?, position(2)?],
                angles_arcsec: [angle(0)?, angle(1)?, angle(2)?]
                    .map(|radians| radians / RADIANS_PER_ARCSECOND),
            })
        };
        [(0, 1), (1, 2)].into_iter().filter_map(of_order).collect()
    }
}

/// Reprojection residuals of tie points (Table 5 of Shan et al. 2005): roots of mean squares over the pairs.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct ResidualsPooled {
    /// Pairs.
    pub pairs: u32,
    /// Tie points of all pairs.
    pub ties: u64,
    /// In the first and the second image.
    pub images: [ImageResidualsPooled; 2],
}

/// Reprojection residuals in one image of the pairs.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct ImageResidualsPooled {
    /// Mean over the pairs of the means along the track, lines.
    pub mean_along_lines: f64,
    /// Root mean square of `√(M² + σ²)` along the track, lines.
    pub size_along_lines: f64,
    /// Mean over the pairs of the means across the track, pixels.
    pub mean_across_px: f64,
    /// Root mean square of `√(M² + σ²)` across the track, pixels.
    pub size_across_px: f64,
}

impl ResidualsPooled {
    /// `None` without pairs.
    pub(super) fn of(states: &[&PairState]) -> Option<Self> {
        let image = |at: usize| {
            let moments: Vec<ResidualMoments> = states.iter().map(|of| of.residuals[at]).collect();
            let mean = |of: fn(&ResidualMoments) -> f64| {
                moments.iter().map(of).sum::<f64>() / moments.len() as f64
            };
            Some(ImageResidualsPooled {
                mean_along_lines: mean(|of| of.mean_x),
                size_along_lines: root_mean_square(moments.iter().map(ResidualMoments::size_x))?,
                mean_across_px: mean(|of| of.mean_y),
                size_across_px: root_mean_square(moments.iter().map(ResidualMoments::size_y))?,
            })
        };
        Some(Self {
            pairs: count(states.len()),
            ties: states.iter().map(|of| u64::from(of.ties)).sum(),
            images: [image(0)?, image(1)?],
        })
    }
}

/// Misregistration of footprints over many pairs.
///
/// A mean has a sign: the image with the larger emission minus the other one, so that the order of the images of a pair
/// does not matter. Pairs with equal or unknown emissions have no such sign and are not part of means.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct MisregistrationPooled {
    /// Pairs with footprints in both images.
    pub pairs: u32,
    /// Footprints of these pairs.
    pub footprints: u64,
    /// Root mean square along the track, lines.
    pub along_rms_lines: f64,
    /// Root mean square along the track, metres.
    pub along_rms_m: f64,
    /// Root mean square along the track in distances of successive footprints (MOLA GSD).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub along_rms_spacings: Option<f64>,
    /// Root mean square across the track, pixels.
    pub across_rms_px: f64,
    /// Root mean square across the track, metres.
    pub across_rms_m: f64,
    /// Mean along the track, metres.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub along_mean_m: Option<RobustMean>,
    /// Mean across the track, metres.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub across_mean_m: Option<RobustMean>,
}

impl MisregistrationPooled {
    /// Of the state of each pair that `of` selects; `None` without footprints.
    ///
    /// * `pairs` – with the group of each: pairs of different groups share neither an image nor an orbit
    pub(super) fn of<'a>(
        pairs: &[(&'a PairRow, usize)],
        of: fn(&'a PairRow) -> Option<&'a PairState>,
    ) -> Option<Self> {
        let found: Vec<_> = pairs
            .iter()
            .filter_map(|(pair, group)| Some((*pair, *group, of(pair)?.misregistration?)))
            .collect();
        let mean = |value: &dyn Fn(usize) -> f64| {
            let each = found.iter().enumerate();
            let each = each.filter_map(|(at, (pair, group, _))| {
                Some(Observation {
                    value: pair.sense()? * value(at),
                    factor: 1.0,
                    group: *group,
                })
            });
            RobustMean::of(&each.collect::<Vec<_>>())
        };
        let spacings = found.iter().filter_map(|(_, _, of)| of.along_spacings);
        Some(Self {
            pairs: count(found.len()),
            footprints: found
                .iter()
                .map(|(_, _, of)| u64::from(of.footprints))
                .sum(),
            along_rms_lines: root_mean_square(found.iter().map(|(_, _, of)| of.along_lines))?,
            along_rms_m: root_mean_square(found.iter().map(|(_, _, of)| of.along_m.value))?,
            along_rms_spacings: root_mean_square(spacings),
            across_rms_px: root_mean_square(found.iter().map(|(_, _, of)| of.across_px))?,
            across_rms_m: root_mean_square(found.iter().map(|(_, _, of)| of.across_m.value))?,
            along_mean_m: mean(&|at| found[at].2.along_m.value),
            across_mean_m: mean(&|at| found[at].2.across_m.value),
        })
    }
}

/// Heights of tie points above the laser surface over many pairs.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct HeightsPooled {
    /// Pairs.
    pub pairs: u32,
    /// Tie points of all pairs.
    pub ties: u64,
    /// Root mean square of the means of the pairs, metres.
    pub means_rms_m: f64,
    /// Root mean square over all tie points, metres.
    pub rms_m: f64,
    /// Mean of the means, metres.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mean_m: Option<RobustMean>,
}

impl HeightsPooled {
    /// `None` without heights.
    pub(super) fn of<'a>(
        pairs: &[(&'a PairRow, usize)],
        of: fn(&'a PairRow) -> Option<&'a PairState>,
    ) -> Option<Self> {
        let found: Vec<_> = pairs
            .iter()
            .filter_map(|(pair, group)| Some((*group, of(pair)?.heights?)))
            .collect();
        let ties: f64 = found.iter().map(|(_, of)| f64::from(of.n)).sum();
        let squares: f64 = found
            .iter()
            .map(|(_, of)| f64::from(of.n) * of.rms_m.powi(2))
            .sum();
        let means = found.iter().map(|(group, of)| Observation {
            value: of.mean_m,
            factor: 1.0,
            group: *group,
        });
        Some(Self {
            pairs: count(found.len()),
            ties: found.iter().map(|(_, of)| u64::from(of.n)).sum(),
            means_rms_m: root_mean_square(found.iter().map(|(_, of)| of.mean_m))?,
            rms_m: (squares / ties).sqrt(),
            mean_m: RobustMean::of(&means.collect::<Vec<_>>()),
        })
    }
}
