//! The result of an adjustment, for reports, tables and storage.

use nalgebra::{DMatrix, Matrix3, Vector3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::{
    attitude_clock::prior_sigmas,
    boresight::BoresightSummary,
    common_bus,
    height_summary::{self, HeightSummary},
    input::AdjustImage,
    network::Assembled,
    point_errors::{PointErrors, SharedError},
    points::{PointKind, RejectedPoint},
    relief::{ReliefSummary, relief},
    split::OtherReading,
    summary::AdjustmentSummary,
};
use areograph_base::frames::{BodyFixed, Position};
use areograph_geom::{
    bundle::{AdjustedImage, Adjustment, ORIENTATION_UNKNOWNS, Residual, View},
    ellipsoid::local_axes,
    pushbroom::{CorrectedOrientation, ExteriorOrientation, OrientationCorrection, Sighting},
};

/// The adjusted site.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Adjusted {
    /// Statistics.
    pub summary: AdjustmentSummary,
    /// Heights of tie points above the MOLA surface; `None` where they are not observations.
    pub heights: Option<HeightSummary>,
    /// Horizontal position from relief; `None` where no surface has slopes.
    pub relief: Option<ReliefSummary>,
    /// Offset of the attitude clock with its standard deviation, seconds, where it is an unknown: the attitudes belong
    /// to a time later by this offset.
    pub attitude_clock_s: Option<(f64, f64)>,
    /// Boresight of a laser on the bus of the cameras, or the reason why it is not determined; `None` where it is not
    /// requested.
    pub boresight: Option<std::result::Result<BoresightSummary, String>>,
    /// Position of the tie points by the other reading of the along-track disagreement, or the reason why it is not
    /// determined; `None` where the disagreement is small.
    pub other_reading: Option<std::result::Result<OtherReading, String>>,
    /// Adjustment result of each image, in order.
    pub images: Vec<CorrectedImage>,
    /// Points with adjusted coordinates: shots, then tie points, each in order.
    pub points: Vec<CorrectedPoint>,
    /// Image coordinates of these points.
    pub views: Vec<ImageResidual>,
    /// Ranges of these points.
    pub ranges: Vec<RangeResidual>,
    /// Rejected points.
    pub rejected: Vec<RejectedPoint>,
    /// Weighted sum of squared residuals before each step and after the last step.
    pub weighted_squares: Vec<f64>,
}

impl Adjusted {
    /// Whether tie points in the image with this index took part: without any, its orientation is the a priori one.
    #[must_use]
    pub fn is_tied(&self, image: usize) -> bool {
        let mut views = self.views.iter();
        views.any(|view| view.kind == PointKind::Tie && view.image == image)
    }
}

/// An image with the correction of its orientation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CorrectedImage {
    /// Identifier.
    pub id: String,
    /// Coefficients of the correction at `[3·quantity + power]`, metres and radians: X, Y and Z position,
    /// rotations about the camera's x, y and z axis, each with powers 0, 1 and 2 of `t = x/half_lines`.
    pub correction: [f64; ORIENTATION_UNKNOWNS],
    /// Standard deviations of the camera at the exposure of its lines, line times included; 0 where held fixed.
    pub sigmas: [f64; ORIENTATION_UNKNOWNS],
    /// Covariance of these unknowns; rows and columns of unknowns that are held fixed are 0.
    pub covariance: DMatrix<f64>,
    /// Standard deviation of a delay of all lines, contained in `sigmas`, seconds; 0 where they contain no delay.
    pub line_time_sigma_s: f64,
    /// A priori values of the correction.
    pub expected: [f64; ORIENTATION_UNKNOWNS],
    /// A priori standard deviations of the correction; 0 where held fixed, infinite where free.
    pub prior_sigmas: [f64; ORIENTATION_UNKNOWNS],
    /// Bias of the line times with its standard deviation, seconds, where it is an unknown.
    pub time_bias_s: Option<(f64, f64)>,
    /// Time from line to line, seconds.
    pub line_period_s: f64,
    /// Half the number of lines.
    pub half_lines: f64,
}

/// An adjusted ground point.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CorrectedPoint {
    /// Shot or tie point.
    pub kind: PointKind,
    /// Row of the footprint, or index of the tie point.
    pub index: usize,
    /// Identifier.
    pub id: String,
    /// Initial position.
    pub initial: Position<BodyFixed>,
    /// Adjusted position.
    pub ground: Position<BodyFixed>,
    /// Covariance of the adjusted coordinates, m²: a priori variances times the summary's variance factor. For a tie
    /// point that fails the test against the surface but was kept, it includes the distance from the surface; for a
    /// footprint, the shift of its profile.
    pub covariance_m2: Matrix3<f64>,
    /// The error that tie points of the site, or footprints of the profile, have in common; `None` for tie points
    /// where no surface controls heights.
    pub shared: Option<SharedError>,
}

/// One scalar observation after the adjustment.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ScalarResidual {
    /// Observed minus computed.
    pub value: f64,
    /// Redundancy number, `0..=1`.
    pub redundancy: f64,
    /// Residual over its own a priori standard deviation; `None` where no other observation controls it.
    pub standardised: Option<f64>,
}

/// A point in an image.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ImageResidual {
    /// Index of the point.
    pub point: usize,
    /// Index of the image.
    pub image: usize,
    /// Shot or tie point.
    pub kind: PointKind,
    /// Measured line, from the middle of the image.
    pub x_lines: f64,
    /// Measured place in the line, pixels from the principal point.
    pub y_px: f64,
    /// Along the track, focal-plane pixels.
    pub along_px: ScalarResidual,
    /// Across the track, focal-plane pixels.
    pub across_px: ScalarResidual,
    /// Standard deviations of the measurement along and across the track, focal-plane pixels.
    pub sigma_px: [f64; 2],
    /// Measured minus adjusted line and sample, lines and pixels of the image.
    pub in_image_px: [f64; 2],
}

/// A range.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RangeResidual {
    /// Index of the point.
    pub point: usize,
    /// Index of the image.
    pub image: usize,
    /// Index of the profile.
    pub profile: usize,
    /// Measured distance, metres.
    pub range_m: f64,
    /// Its residual, metres.
    pub residual_m: ScalarResidual,
}

impl Adjusted {
    /// Correction to the orientation of the image at index `image`.
    #[must_use]
    pub fn correction(&self, image: usize) -> OrientationCorrection {
        let entry = &self.images[image];
        let time_bias_s = entry.time_bias_s.map_or(0.0, |(bias_s, _)| bias_s);
        OrientationCorrection::of(
            &entry.correction,
            entry.half_lines,
            time_bias_s / entry.line_period_s,
        )
    }
}

impl CorrectedImage {
    /// Offset of the spacecraft in the PEDR file from the kernels, X, Y and Z, metres, where it is the image's a priori
    /// value.
    #[must_use]
    pub fn pedr_orbit_m(&self) -> Option<[f64; 3]> {
        let position_m = [0, 3, 6].map(|constant| self.expected[constant]);
        position_m
            .iter()
            .any(|metres| *metres != 0.0)
            .then_some(position_m)
    }
}

impl CorrectedPoint {
    /// Standard deviations in east, north and height, metres.
    #[must_use]
    pub fn local_sigmas_m(&self) -> [f64; 3] {
        self.local_roots_m(&self.covariance_m2)
    }

    /// Standard deviations without the error that the point shares with others; `None` where this error is not known.
    #[must_use]
    pub fn relative_sigmas_m(&self) -> Option<[f64; 3]> {
        let shared = self.shared.as_ref()?;
        Some(self.local_roots_m(&shared.relative_m2))
    }

    fn local_roots_m(&self, covariance_m2: &Matrix3<f64>) -> [f64; 3] {
        let to_local = local_axes(&self.ground.xyz_m);
        let local_m2 = to_local * covariance_m2 * to_local.transpose();
        // Rounding may leave the variance of a difference a little below 0.
        [0, 1, 2].map(|axis| local_m2[(axis, axis)].max(0.0).sqrt())
    }
}

impl From<Residual> for ScalarResidual {
    fn from(residual: Residual) -> Self {
        Self {
            value: residual.value,
            redundancy: residual.redundancy,
            standardised: residual.standardised(),
        }
    }
}

/// Assembles the result; points without adjusted coordinates are only in `rejected`.
pub(super) fn collect<M: ExteriorOrientation>(
    images: &[AdjustImage<M>],
    assembled: Assembled<&M>,
    adjustment: Adjustment,
    (summary, errors): (AdjustmentSummary, &[Option<PointErrors>]),
    profiles: &[String],
    other_reading: Option<std::result::Result<OtherReading, String>>,
) -> Adjusted {
    let mut index_of = vec![None; assembled.points.len()];
    let mut points = Vec::with_capacity(assembled.points.len());
    let variance = summary.variance_factor;
    for (point, outcome) in adjustment.points.iter().enumerate() {
        let (Ok(found), Some(errors)) = (outcome, &errors[point]) else {
            continue;
        };
        index_of[point] = Some(points.len());
        points.push(CorrectedPoint {
            kind: assembled.kind(point),
            index: assembled.points[point].index,
            id: assembled.points[point].name.clone(),
            initial: Position::new(assembled.network.points[point].ground_m),
            ground: Position::new(found.ground_m),
            covariance_m2: errors.covariance_m2,
            shared: errors.shared,
        });
    }
    let views = assembled.network.views.par_iter().zip(&adjustment.views);
    let ranges = assembled.network.ranges.iter().zip(&adjustment.ranges);
    Adjusted {
        heights: height_summary::heights(&assembled, &adjustment),
        images: corrected_images(images, &assembled, &adjustment, variance),
        other_reading,
        boresight: match &assembled.no_spots {
            Some(reason) => Some(Err(reason.clone())),
            None => common_bus::summarise(images, &assembled, &adjustment, variance).map(Ok),
        },
        attitude_clock_s: adjustment
            .attitude_clock_s
            .map(|(offset_s, root_s)| (offset_s, root_s * variance.sqrt())),
        relief: relief(&assembled, &adjustment, variance, profiles),
        views: views
            .filter_map(|(view, residuals)| {
                let [along, across] = (*residuals)?;
                let ground_m = &adjustment.points[view.point].as_ref().ok()?.ground_m;
                let correction = &adjustment.images[view.image].correction;
                Some(ImageResidual {
                    point: index_of[view.point]?,
                    image: view.image,
                    kind: assembled.kind(view.point),
                    x_lines: view.x_lines,
                    y_px: view.y_px,
                    along_px: along.into(),
                    across_px: across.into(),
                    sigma_px: view.sigma_px.into(),
                    in_image_px: in_image_px(&images[view.image], correction, view, ground_m)?,
                })
            })
            .collect(),
        ranges: ranges
            .filter_map(|(range, residual)| {
                Some(RangeResidual {
                    point: index_of[range.point]?,
                    image: range.image,
                    profile: assembled.profiles[range.profile].index,
                    range_m: range.range_m,
                    residual_m: (*residual)?.into(),
                })
            })
            .collect(),
        points,
        rejected: assembled.rejected,
        weighted_squares: adjustment.history,
        summary,
    }
}

/// Measured minus adjusted line and sample of a view of `ground_m`.
fn in_image_px<M: ExteriorOrientation>(
    image: &AdjustImage<M>,
    correction: &OrientationCorrection,
    view: &View,
    ground_m: &Vector3<f64>,
) -> Option<[f64; 2]> {
    let camera = &image.oriented_camera;
    let orientation = CorrectedOrientation {
        base: &camera.orientation,
        correction: *correction,
    };
    let detector = &camera.detector;
    let distortion = &detector.distortion;
    let seen = Sighting::near(
        &orientation,
        distortion,
        view.x_lines,
        ground_m,
        LAST_STEP_LINES,
    );
    let seen = seen.ok()?.solution;
    let focal_px = detector.focal_px(&seen.camera_m).ok()?;
    Some([
        view.x_lines - seen.x,
        detector.sample(view.y_px) - detector.sample(focal_px.y),
    ])
}

/// A step below this many lines finds the line of a view to 1e-7 lines.
const LAST_STEP_LINES: f64 = 1e-3;

/// Coefficients of an orientation with this offset, metres.
fn expected(position_m: &Vector3<f64>) -> [f64; ORIENTATION_UNKNOWNS] {
    let mut coefficients = [0.0; ORIENTATION_UNKNOWNS];
    for (constant, metres) in coefficients.iter_mut().step_by(3).zip(position_m) {
        *constant = *metres;
    }
    coefficients
}

fn corrected_images<M>(
    images: &[AdjustImage<M>],
    assembled: &Assembled<&M>,
    adjustment: &Adjustment,
    variance_factor: f64,
) -> Vec<CorrectedImage> {
    let delay_sigma_s = assembled.unseen_delay_s;
    let root = variance_factor.sqrt();
    let found = images.iter().zip(&adjustment.images).enumerate();
    let corrected = |(index, (image, adjusted)): (usize, (&AdjustImage<M>, &AdjustedImage))| {
        let prior_sigmas = prior_sigmas(&assembled.network, index);
        let mut covariance = &adjusted.cofactors * variance_factor;
        let delay = image.line_delay.as_ref().filter(|_| delay_sigma_s > 0.0);
        let delay = delay.map(|of| of.added(delay_sigma_s, &adjusted.cofactors, &prior_sigmas));
        let line_time_sigma_s = delay.map_or(0.0, |(added, sigma_s)| {
            covariance += added;
            sigma_s
        });
        CorrectedImage {
            id: image.oriented_camera.id.clone(),
            correction: adjusted.correction.coefficients(),
            sigmas: std::array::from_fn(|unknown| covariance[(unknown, unknown)].max(0.0).sqrt()),
            covariance,
            line_time_sigma_s,
            expected: expected(&image.expected_m),
            prior_sigmas,
            time_bias_s: adjusted
                .time_bias_s
                .map(|(bias_s, root_s)| (bias_s, root * root_s)),
            line_period_s: image.line_period_s,
            half_lines: adjusted.correction.half_lines,
        }
    };
    found.map(corrected).collect()
}
