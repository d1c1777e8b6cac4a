//! Observation equations of spots: the position of a shot in an image according to the mounting against the projection
//! of its footprint.

use nalgebra::{Vector2, Vector3};

use super::{
    BundleImage, ORIENTATION_UNKNOWNS, Spot,
    rows::{self, Row},
};
use crate::pushbroom::{ExteriorOrientation, OrientationCorrection, Unseen};

/// Parameters of a spot besides its image and its point.
#[derive(Clone, Copy)]
pub(super) struct Pointing {
    /// Focal-plane pixels of a line.
    pub(super) px_per_line: f64,
    /// Delay of line times against the shots, seconds.
    pub(super) late_s: f64,
    /// Boresight angles.
    pub(super) boresight_rad: [f64; 2],
    /// Motion of the spot with each of these, see [`by_boresight`].
    pub(super) by_boresight: [Vector2<f64>; 2],
}

/// One row of a spot.
#[derive(Clone, Copy)]
pub(super) struct SpotRow {
    /// As if the spot were a view.
    pub(super) row: Row,
    /// By the boresight angles.
    pub(super) by_boresight: [f64; 2],
    /// By the delay of line times.
    pub(super) by_line_time: f64,
    /// By the time bias of the image.
    pub(super) by_time: f64,
}

/// Motion of a spot along and across the track with each boresight angle, pixels per radian: in the initial
/// orientation, as for its position.
pub(super) fn by_boresight<M: ExteriorOrientation>(
    image: &BundleImage<M>,
    spot: &Spot,
    px_per_line: f64,
    ground_m: &Vector3<f64>,
) -> Result<[Vector2<f64>; 2], Unseen> {
    let none = OrientationCorrection::of(&[0.0; ORIENTATION_UNKNOWNS], image.half_lines, 0.0);
    let [along, across] = rows::of_view(image, &none, px_per_line, &spot.view, ground_m)?;
    Ok(spot
        .by_boresight_m
        .map(|moved_m| Vector2::new(along.by_point.dot(&moved_m), across.by_point.dot(&moved_m))))
}

/// The rows of a spot whose footprint is at `ground_m`, along the track and across it.
///
/// The spot moves in the image with the ground point that the laser meets; where lines were exposed later than stated,
/// it is in an earlier line.
pub(super) fn of_spot<M: ExteriorOrientation>(
    image: &BundleImage<M>,
    correction: &OrientationCorrection,
    spot: &Spot,
    pointing: &Pointing,
    ground_m: &Vector3<f64>,
) -> Result<[SpotRow; 2], Unseen> {
    let px_per_line = pointing.px_per_line;
    let [along, across] = rows::of_view(image, correction, px_per_line, &spot.view, ground_m)?;
    let px_per_s = px_per_line / image.line_period_s;
    let late_px = px_per_line * correction.time_shift_lines + px_per_s * pointing.late_s;
    let axes = [(0, along, px_per_s, late_px), (1, across, 0.0, 0.0)];
    Ok(axes.map(|(axis, mut row, px_per_s, late_px)| {
        let moved = pointing.by_boresight.map(|moved_px| moved_px[axis]);
        let turned = moved.iter().zip(&pointing.boresight_rad);
        row.misclosure += late_px + turned.map(|(by, angle)| by * angle).sum::<f64>();
        SpotRow {
            by_boresight: moved.map(|by| -by),
            by_line_time: -px_per_s,
            // The image moves with its times, and the line of the shot as well.
            by_time: row.by_time - px_per_s,
            row,
        }
    }))
}
