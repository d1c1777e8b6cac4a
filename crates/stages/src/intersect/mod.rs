//! Ground points of tie points, from images whose orientation is held fixed.
//!
//! Two kinds of residual are distinguished. The *focal* residual is measured in an image's focal plane, in pixels. The
//! *reprojection* residual is the measured place minus the place at which the image sees the intersected point, in
//! lines and pixels; Shan et al. 2005 report it in their Table 5.

mod statistics;

use std::{collections::BTreeSet, sync::atomic::AtomicBool};

use nalgebra::{Matrix3, Vector2};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::{read_ties::Ties, site_image::SiteImages};
use crate::oriented::OrientedImage;
use areograph_base::{
    body::Body,
    error::{Cause, Result},
    frames::{BodyFixed, Position},
    ties::{TiePoint, require_images},
};
use areograph_config::IntersectionConfig;
use areograph_geom::{
    intersection::{Intersection, IntersectionLimits, Ray, Unintersected, Weighting, intersect},
    oriented_camera::OrientedCamera,
    pushbroom::{ExteriorOrientation, Projector, Unseen},
};
use areograph_store::{
    stage::{Output, Round, Stage},
    stage_inputs,
};

pub use statistics::{ImageResiduals, Residuals2};

/// Options of an intersection.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct IntersectOptions {
    /// Weights of the measurements.
    pub weighting: Weighting,
    /// Limits beyond which intersections are rejected.
    pub limits: IntersectionLimits,
}

impl IntersectOptions {
    /// As configured, on `body`.
    #[must_use]
    pub fn on(body: Body, config: &IntersectionConfig) -> Self {
        Self {
            weighting: config.weighting,
            limits: IntersectionLimits {
                convergence_min_rad: config.convergence_min_rad,
                ..IntersectionLimits::on(body)
            },
        }
    }
}

impl Default for IntersectOptions {
    fn default() -> Self {
        Self::on(Body::Mars, &IntersectionConfig::default())
    }
}

/// All points, with the statistics of the images.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct IntersectedTies {
    /// Points, in the order of the tie points.
    pub points: Vec<IntersectedPoint>,
    /// Tie points without a ground point, in order.
    pub rejected: Vec<RejectedTie>,
    /// Standard deviation of unit weight over all points; 1 without redundancy.
    pub sigma0: f64,
    /// Statistics of each image, in the order of the images.
    pub images: Vec<ImageResiduals>,
}

/// A ground point.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct IntersectedPoint {
    /// Index of the tie point.
    pub tie: usize,
    /// Its identifier.
    pub id: String,
    /// Its position.
    pub ground: Position<BodyFixed>,
    /// Covariance of its coordinates with the common standard deviation of unit weight, m².
    pub covariance_m2: Matrix3<f64>,
    /// Angle between the two rays that differ most, radians.
    pub convergence_rad: f64,
    /// Residuals of its measurements.
    pub measures: Vec<MeasureResidual>,
    /// Whether a reprojection residual is an outlier among the residuals of other points in its image. With two images
    /// it is undetermined which of the two measurements is wrong.
    pub outlier: bool,
}

/// Residuals of one measurement.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct MeasureResidual {
    /// Index of the image.
    pub image: usize,
    /// Measured line from the middle of the image.
    pub x_lines: f64,
    /// Measured focal coordinate across the track, pixels.
    pub y_px: f64,
    /// Along the track, focal-plane pixels.
    pub focal_along_px: f64,
    /// Across the track, focal-plane pixels.
    pub focal_across_px: f64,
    /// Measured minus projected line.
    pub reprojection_lines: f64,
    /// Measured minus projected focal coordinate across the track, pixels.
    pub reprojection_px: f64,
}

/// A tie point without a ground point.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RejectedTie {
    /// Index of the tie point.
    pub tie: usize,
    /// Its identifier.
    pub id: String,
    /// The reason.
    pub reason: TieRejection,
}

/// Reasons for the rejection of a tie point.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, thiserror::Error)]
#[serde(rename_all = "snake_case")]
pub enum TieRejection {
    /// Its rays give no point.
    #[error("{0}")]
    Rays(Unintersected),
    /// An image cannot see the intersected point.
    #[error("an image does not show the intersected point")]
    Unseen,
    /// Another tie point before it has the same identifier.
    #[error("an earlier tie point has the same identifier")]
    Duplicate,
    /// Two of its measurements are in one image.
    #[error("it is measured twice in one image")]
    TwiceInImage,
    /// A measurement lies outside its image.
    #[error("a measurement lies outside its image")]
    OutsideImage,
    /// A measurement is not a finite number.
    #[error("a measurement is not a finite number")]
    NotFinite,
}

/// An orientation that sees no ground.
#[derive(Debug, Clone, PartialEq, thiserror::Error, Cause)]
#[error("image {image} shows no ground according to its orientation: {unseen}")]
#[cause(Input: "check the orientation samples of the image")]
struct BlindImage {
    image: String,
    unseen: Unseen,
}

/// A measurement in focal coordinates.
#[derive(Debug, Clone, Copy)]
struct ImagePoint {
    image: usize,
    x_lines: f64,
    focal_px: Vector2<f64>,
}

stage_inputs! {
    /// The images with one orientation, and the tie points.
    pub struct Intersect<'a> {
        /// Round of the orientation.
        pub round: Round,
        /// The images.
        pub images: SiteImages<'a>,
        /// Tie points.
        pub ties: &'a Output<Ties>,
        /// Weights and limits.
        pub intersection: &'a IntersectionConfig,
    }
}

impl Stage for Intersect<'_> {
    const NAME: &'static str = "intersect";
    type Output = IntersectedTies;
    stage_inputs!(fingerprint);

    fn part(&self) -> Option<String> {
        self.round.part()
    }

    fn run(&self, _stop: &AtomicBool) -> Result<IntersectedTies> {
        let oriented = self.images.oriented()?;
        let images: Vec<_> = oriented
            .iter()
            .map(OrientedImage::oriented_camera)
            .collect();
        let body = oriented
            .first()
            .map_or(Body::Mars, |image| image.image.body);
        intersect_ties(
            &images,
            &self.ties.value()?.points,
            &IntersectOptions::on(body, self.intersection),
        )
    }
}

/// Intersects all tie points.
///
/// # Errors
/// Measurements in unknown images; orientations that see no ground. Single points that cannot be intersected are listed
/// instead.
pub fn intersect_ties<M: ExteriorOrientation>(
    images: &[OrientedCamera<M>],
    ties: &[TiePoint],
    options: &IntersectOptions,
) -> Result<IntersectedTies> {
    let places = places(images, ties)?;
    let projectors: Vec<Projector<'_, M>> = images
        .iter()
        .map(|image| {
            let projector = Projector::new(&image.orientation, image.lines());
            let projector = projector.map_err(|unseen| BlindImage {
                image: image.id.clone(),
                unseen,
            });
            Ok(projector?.through(image.detector.distortion))
        })
        .collect::<std::result::Result<_, BlindImage>>()?;
    let found: Vec<std::result::Result<(IntersectedPoint, Intersection), TieRejection>> = ties
        .par_iter()
        .enumerate()
        .zip(&places)
        .map(|(tie, places)| {
            let places = places.as_ref().map_err(|reject| *reject)?;
            intersect_one(images, &projectors, tie, places, options)
        })
        .collect();
    Ok(summarise(images, ties, found))
}

/// Measurements of each tie point, or the reason for its rejection.
fn places<M: ExteriorOrientation>(
    images: &[OrientedCamera<M>],
    ties: &[TiePoint],
) -> Result<Vec<std::result::Result<Vec<ImagePoint>, TieRejection>>> {
    require_images(ties, images.len())?;
    let mut used = BTreeSet::new();
    let places = ties.iter().map(|tie| {
        let seen_in: BTreeSet<usize> = tie.measures.iter().map(|measure| measure.image).collect();
        if !used.insert(tie.id.as_str()) {
            return Err(TieRejection::Duplicate);
        }
        if seen_in.len() < tie.measures.len() {
            return Err(TieRejection::TwiceInImage);
        }
        tie.measures
            .iter()
            .map(|measure| {
                let image = measure.image;
                let (x_lines, focal_px) =
                    images[image].focal_plane_coordinates(measure.line, measure.sample);
                if !(x_lines.is_finite() && focal_px.y.is_finite()) {
                    return Err(TieRejection::NotFinite);
                }
                if !images[image].shows(measure.line, measure.sample) {
                    return Err(TieRejection::OutsideImage);
                }
                Ok(ImagePoint {
                    image,
                    x_lines,
                    focal_px,
                })
            })
            .collect()
    });
    Ok(places.collect())
}

fn intersect_one<M: ExteriorOrientation>(
    images: &[OrientedCamera<M>],
    projectors: &[Projector<'_, M>],
    (index, tie): (usize, &TiePoint),
    places: &[ImagePoint],
    options: &IntersectOptions,
) -> std::result::Result<(IntersectedPoint, Intersection), TieRejection> {
    let (along_sigma_px, across_sigma_px) = match options.weighting {
        Weighting::Focal { sigma_px } => (sigma_px, sigma_px),
        Weighting::Line { across_px, .. } => (1.0, across_px),
    };
    let mut rays: Vec<Ray> = places
        .iter()
        .map(|place| {
            let OrientedCamera {
                orientation,
                detector,
                ..
            } = &images[place.image];
            let pose = orientation.pose(place.x_lines);
            Ray {
                position_m: pose.position_m,
                mars_to_camera: pose.mars_to_camera,
                focal_length_px: detector.focal_length_px,
                focal_px: place.focal_px,
                along_sigma_px,
                across_sigma_px: across_sigma_px * detector.focal_px_per_sample(place.focal_px.y),
            }
        })
        .collect();
    let mut point = intersect(&rays, &options.limits).map_err(TieRejection::Rays)?;
    if let Weighting::Line { along_lines, .. } = options.weighting {
        // The length of a line in focal-plane pixels depends on the range of this point.
        for (sight, place) in rays.iter_mut().zip(places) {
            let image = &images[place.image];
            let rate_px = image.focal_px_per_line(place.x_lines, &point.ground_m);
            sight.along_sigma_px = along_lines * rate_px;
        }
        point = intersect(&rays, &options.limits).map_err(TieRejection::Rays)?;
    }
    let measures = places
        .iter()
        .zip(&point.residuals_px)
        .map(|(place, focal)| {
            let image = &images[place.image];
            let seen = projectors[place.image].project(&point.ground_m).ok()?;
            let y_px = image.detector.focal_px(&seen.camera_m).ok()?.y;
            Some(MeasureResidual {
                image: place.image,
                x_lines: place.x_lines,
                y_px: place.focal_px.y,
                focal_along_px: focal.x,
                focal_across_px: focal.y,
                reprojection_lines: place.x_lines - seen.x,
                reprojection_px: place.focal_px.y - y_px,
            })
        })
        .collect::<Option<Vec<_>>>()
        .ok_or(TieRejection::Unseen)?;
    let found = IntersectedPoint {
        tie: index,
        id: tie.id.clone(),
        ground: Position::new(point.ground_m),
        covariance_m2: point.cofactor_m2,
        convergence_rad: point.convergence_rad,
        measures,
        outlier: false,
    };
    Ok((found, point))
}

fn summarise<M>(
    images: &[OrientedCamera<M>],
    ties: &[TiePoint],
    found: Vec<std::result::Result<(IntersectedPoint, Intersection), TieRejection>>,
) -> IntersectedTies {
    let (mut points, mut rejected) = (Vec::new(), Vec::new());
    let (mut squares, mut redundancy) = (0.0, 0_usize);
    for ((index, tie), outcome) in ties.iter().enumerate().zip(found) {
        match outcome {
            Ok((point, intersection)) => {
                squares += intersection.weighted_squares;
                redundancy += intersection.redundancy();
                points.push(point);
            }
            Err(reason) => rejected.push(RejectedTie {
                tie: index,
                id: tie.id.clone(),
                reason,
            }),
        }
    }
    let sigma0 = if redundancy > 0 {
        (squares / redundancy as f64).sqrt()
    } else {
        1.0
    };
    for point in &mut points {
        point.covariance_m2 *= sigma0 * sigma0;
    }
    statistics::mark_outliers(&mut points, images.len());
    let images = images
        .iter()
        .enumerate()
        .map(|(index, image)| ImageResiduals::of(&image.id, index, &points))
        .collect();
    IntersectedTies {
        points,
        rejected,
        sigma0,
        images,
    }
}
