//! Image coordinates of ground points in the images of the model, by the same support data.

use super::result::MatchedPoint;
use crate::line_camera::LineCamera;
use areograph_base::error::Result;
use areograph_geom::ellipsoid::spherical_to_xyz_m;

/// Enters lines and samples into `points`, where an image shows the model's position of a point.
///
/// # Errors
/// A camera that sees no ground.
pub(super) fn enter(cameras: &[LineCamera], points: &mut [MatchedPoint]) -> Result<()> {
    for of in cameras {
        let (projector, camera) = (of.projector()?, &of.camera);
        for point in &mut *points {
            let [longitude_rad, latitude_rad, radius_m] = point.model;
            let place_m = spherical_to_xyz_m(longitude_rad, latitude_rad, radius_m);
            let seen = projector.project(&place_m).ok().and_then(|seen| {
                let focal_px = camera.detector.focal_px(&seen.camera_m).ok()?;
                let line = camera.line_times.line_of_offset(seen.x);
                let sample = camera.detector.sample(focal_px.y);
                camera.shows(line, sample).then_some([line, sample])
            });
            point.in_images.push(seen);
        }
    }
    Ok(())
}

/// Points that an image does not show, in words.
pub(super) fn unseen(images: &[String], points: &[MatchedPoint]) -> Vec<String> {
    let pairs = points.iter().flat_map(|point| {
        images
            .iter()
            .zip(&point.in_images)
            .map(move |of| (point, of))
    });
    let unseen = pairs.filter(|(_, (_, seen))| seen.is_none());
    unseen
        .map(|(point, (image, _))| {
            format!(
                "point {} of unit {} is not in image {image}",
                point.name, point.unit
            )
        })
        .collect()
}
