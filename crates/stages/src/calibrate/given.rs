//! Points that were measured from pixels in this run, not read from tables.

use crate::match_laser::MatchedPoint;
use areograph_base::ties::TiePoint;
use areograph_geom::{calibration::KnownPlace, ellipsoid::spherical_to_xyz_m};

use super::tables::{ControlSigma, Measured, MeasuredPoint, known_place};

/// Tie points, control, and withheld control; images by the index of their camera.
#[derive(Debug, Clone, Default)]
pub(super) struct GivenPoints {
    /// Tie points.
    pub(super) ties: Vec<TiePoint>,
    /// Laser points that are used.
    pub(super) control: Vec<MatchedPoint>,
    /// Withheld laser points.
    pub(super) held_back: Vec<MatchedPoint>,
}

/// Tie points, with their own standard deviations where available.
pub(super) fn ties(given: &[TiePoint], sigma_px: f64) -> Vec<MeasuredPoint> {
    let measured = |point: &TiePoint| {
        let measures = point.measures.iter().map(|measure| Measured {
            camera: measure.image,
            place: [measure.line, measure.sample],
            sigma_px: measure.sigma_px.unwrap_or([sigma_px; 2]),
        });
        let mut measured: Vec<Measured> = measures.collect();
        measured.sort_by_key(|of| of.camera);
        MeasuredPoint {
            name: point.id.clone(),
            measured,
            known: None,
        }
    };
    given.iter().map(measured).collect()
}

/// Control points in all images that show them; those that no image shows are left out.
pub(super) fn control(given: &[MatchedPoint], sigma: ControlSigma) -> Vec<MeasuredPoint> {
    let measured = |point: &MatchedPoint| {
        let images = point.in_images.iter().enumerate();
        let measured = images.filter_map(|(camera, seen)| {
            Some(Measured {
                camera,
                place: (*seen)?,
                sigma_px: [sigma.image_px; 2],
            })
        });
        let [longitude_rad, latitude_rad, radius_m] = point.laser;
        let place_m = spherical_to_xyz_m(longitude_rad, latitude_rad, radius_m);
        // Errors of laser and matching.
        let horizontal_m = sigma.horizontal_m.hypot(point.sigma_horizontal_m());
        let vertical_m = sigma.vertical_m.hypot(point.sigma_m[2]);
        let known: KnownPlace = known_place(place_m, [horizontal_m, vertical_m]);
        MeasuredPoint {
            name: point.name.clone(),
            measured: measured.collect(),
            known: Some(known),
        }
    };
    let points = given.iter().map(measured);
    points.filter(|point| !point.measured.is_empty()).collect()
}
