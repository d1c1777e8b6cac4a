//! `surface.json`.

use std::{borrow::Cow, collections::BTreeMap};

use schemars::JsonSchema;
use serde::Serialize;

use super::{contour_interval::contour_interval_m, joint_document::JointDocument};
use crate::{
    geom::statistics::Summary,
    products::Context,
    stages::map_surface::{ProfileOnSurface, Surface},
    units::RADIANS_PER_DEGREE,
};

/// Definitions of the numbers, for readers of the file.
const DEFINITIONS: [(&str, &str); 7] = [
    (
        "cells",
        "common: cells that both images show according to their orientation; filled: cells with a height; unfilled: cells \
         without a height, by reason: flat (no texture), missing (lines or pixels), edge (of an image), unlike (no correlation), \
         ambiguous (two heights correlate), unsettled (no convergence), one_way (different heights with the other image as \
         the template), uncertain (standard deviation too large), alone (contradicted by surrounding cells)",
    ),
    (
        "sigma_m",
        "root mean square of the standard deviations in surface_sigma.tif (one cell relative to the others): from match \
         residuals, jitter_m and smoothing_m",
    ),
    (
        "jitter_m",
        "standard deviation due to relative jitter of the images: scatter of their shifts across the parallax, which \
         heights do not affect, without the scatter of the matches",
    ),
    (
        "smoothing_m",
        "standard deviation of the height of a point relative to the mean of the compared square, from the relief of the \
         model over two and four squares",
    ),
    (
        "common_sigma_m",
        "standard deviation of the offset common to all heights, from the adjustment of the images; omitted if not \
         determined",
    ),
    (
        "mola_minus_surface",
        "radius of a footprint minus the model radius at its position, interpolated between the four nearest cells, metres; \
         all: profiles at nadir, because attitude errors change the heights of other profiles; if fewer than 10 shots at \
         nadir lie on the model, all profiles; attitude_sigma_m: standard deviation of the change due to attitude errors \
         (0 at nadir), in the statistics of all shots the largest; spread_sigmas: NMAD of the differences from their median \
         (with profiles off nadir, from the median of each profile), each divided by its standard deviation, which contains \
         the uncertainties of height, shot, profile, and position on slopes",
    ),
    (
        "mola_takes_part",
        "whether {altimeter} controlled heights in the adjustment: then the mean difference is not an independent test, but the \
         spread about it is",
    ),
];

#[derive(Serialize, JsonSchema)]
#[schemars(
    title = "Terrain model of a site",
    description = "surface.json of areograph: derivation of surface_above_sphere.tif from pairs of images, statistics of its cells, and \
         differences between footprints and model. Metres and degrees; unknown values are omitted."
)]
pub(super) struct Document<'a> {
    #[schemars(extend("const" = "areograph surface 1"))]
    format: &'static str,
    site: &'a str,
    #[schemars(length(min = 1))]
    definitions: Vec<Definition>,
    /// Identifiers of the images; of both images of a single pair.
    images: Vec<&'a str>,
    /// Pairs of images, where there are several; the numbers outside are sums of cells and means over all pairs.
    #[serde(skip_serializing_if = "Option::is_none")]
    joint: Option<JointDocument<'a>>,
    /// Whether too few cells matched to be significant: then there is no `surface_above_sphere.tif`.
    refused: bool,
    matching: Matching,
    cells: Cells,
    heights: Heights,
    mola_minus_surface: Shots<'a>,
}

#[derive(Serialize, JsonSchema)]
struct Definition {
    of: &'static str,
    is: Cow<'static, str>,
}

#[derive(Serialize, JsonSchema)]
struct Matching {
    /// Edge of the samples of the ground at which the images were compared.
    #[schemars(extend("exclusiveMinimum" = 0))]
    sample_m: f64,
    /// Edge of the square that was compared for one height.
    #[schemars(extend("exclusiveMinimum" = 0))]
    compared_m: f64,
    /// Angle between the rays of both images in the middle of the common ground.
    convergence_deg: f64,
    /// Height difference that corresponds to one pixel of parallax in the coarser image.
    height_of_pixel_m: f64,
    /// Median correlation.
    correlation: f64,
    /// Median distance between the images on the ground, perpendicular to the parallax: the residual error of their
    /// orientations.
    across_parallax_m: f64,
}

#[derive(Serialize, JsonSchema)]
struct Cells {
    /// Edge.
    #[schemars(extend("exclusiveMinimum" = 0))]
    cell_m: f64,
    rows: usize,
    columns: usize,
    common: u32,
    filled: u32,
    unfilled: BTreeMap<&'static str, u32>,
}

#[derive(Serialize, JsonSchema)]
struct Heights {
    /// Radius of the sphere to which the heights of `surface_above_sphere.tif` refer.
    sphere_m: f64,
    /// Surface to which the heights of the report and of `surface_above_areoid.tif` or `surface_above_ellipsoid.tif` refer;
    /// omitted without shots.
    #[serde(skip_serializing_if = "Option::is_none")]
    reference: Option<&'static str>,
    /// Largest distance of this surface from its radius as shots state it.
    #[serde(skip_serializing_if = "Option::is_none")]
    reference_departure_m: Option<f64>,
    /// Largest standard deviation of this surface at the corners of the model: shots of a single profile do not determine its
    /// gradient across the profile.
    #[serde(skip_serializing_if = "Option::is_none")]
    reference_sigma_m: Option<f64>,
    #[schemars(range(min = 0.0))]
    sigma_m: f64,
    #[schemars(range(min = 0.0))]
    jitter_m: f64,
    #[schemars(range(min = 0.0))]
    smoothing_m: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    common_sigma_m: Option<f64>,
    /// Interval of the contours, metres: 1, 2 or 5 times a power of ten, at least 3.29 times `sigma_m` and 1/25 of the relief.
    #[schemars(extend("exclusiveMinimum" = 0))]
    contour_interval_m: f64,
}

#[derive(Serialize, JsonSchema)]
struct Shots<'a> {
    mola_takes_part: bool,
    all: Summary,
    #[schemars(range(min = 0.0))]
    attitude_sigma_m: f64,
    /// Root mean square of the standard deviations of the differences about their common offset.
    #[schemars(range(min = 0.0))]
    sigma_m: f64,
    #[schemars(range(min = 0.0))]
    spread_sigmas: f64,
    profiles: &'a [ProfileOnSurface],
}

impl<'a> Document<'a> {
    pub(super) fn of(of: &Context<'a>, surface: &'a Surface) -> Self {
        let account = &surface.account;
        let [rows, columns] = surface.model.heights.size;
        let terms = of.site.config.terms();
        let reference = account.reference.as_ref();
        let mut images = account.images.to_vec();
        if let Some(joint) = &account.joint {
            images = joint.pairs.iter().flat_map(|pair| pair.images).collect();
            images.sort_unstable();
            images.dedup();
        }
        let definitions = DEFINITIONS.iter().map(|(of, is)| Definition {
            of,
            is: terms.fill(is),
        });
        let unfilled = account.unfilled.iter();
        Self {
            format: "areograph surface 1",
            site: &of.site.config.site,
            definitions: definitions.collect(),
            images: images
                .iter()
                .map(|image| &*of.site.images[*image].times.id)
                .collect(),
            joint: account
                .joint
                .as_ref()
                .map(|joint| JointDocument::of(of.site, joint)),
            refused: account.is_refused,
            matching: Matching {
                sample_m: account.sample_m,
                compared_m: account.compared_m,
                convergence_deg: account.convergence_rad / RADIANS_PER_DEGREE,
                height_of_pixel_m: account.height_of_pixel_m,
                correlation: account.correlation,
                across_parallax_m: account.aside_m,
            },
            cells: Cells {
                cell_m: account.cell_m,
                rows,
                columns,
                common: account.cells,
                filled: account.filled,
                unfilled: unfilled.map(|(why, count)| (why.word(), *count)).collect(),
            },
            heights: Heights {
                sphere_m: surface.model.heights.radius_m,
                reference: reference.map(|_| terms.areoid()),
                reference_departure_m: reference.map(|of| of.departure_m),
                reference_sigma_m: reference.map(|of| of.sigma_m),
                sigma_m: account.sigma_m,
                jitter_m: account.jitter_m,
                smoothing_m: account.smoothing_m,
                common_sigma_m: account.common_sigma_m,
                contour_interval_m: contour_interval_m(account),
            },
            mola_minus_surface: Shots {
                mola_takes_part: account.shots_take_part,
                all: account.shots.above_m,
                attitude_sigma_m: account.shots.attitude_sigma_m,
                sigma_m: account.shots.sigma_m,
                spread_sigmas: account.shots.spread_sigmas,
                profiles: &account.shots.profiles,
            },
        }
    }
}
