//! Differences in the position of an image between the conventions for light time.

use nalgebra::{Vector2, Vector3};

use crate::orientation::CameraReader;
use crate::{
    orientation::{Camera, LightTimeEffect, OtherConvention},
    tag_times::ImageTimes,
};
use areograph_base::{
    error::Result,
    frames::{BodyFixed, Position},
};
use areograph_geom::{
    ellipsoid::{range_to_ellipsoid_m, ray_meets_ellipsoid},
    light_time::{LightTime, light_time_s},
};

impl CameraReader<'_> {
    /// Effect of the convention in the middle of `image`.
    pub(super) fn effect(&self, image: &ImageTimes) -> Result<LightTimeEffect> {
        let (own, model) = (self.camera(image.middle())?, image.body.model());
        let boresight = own.to_mars.matrix() * Vector3::z();
        let ground = ray_meets_ellipsoid(model, &own.position, &boresight);
        let mut others = Vec::new();
        for (_, convention) in LightTime::WORDS {
            if let Some(ground) = ground.filter(|_| convention != self.light_time) {
                others.extend(self.other(convention, image, &ground)?);
            }
        }
        Ok(LightTimeEffect {
            convention: self.light_time,
            light_time_s: light_time_s(range_to_ellipsoid_m(model, &own.position, &boresight)),
            others,
        })
    }

    /// Place that another convention gives `ground`, which the boresight meets in the middle of `image`; `None` where
    /// its boresight misses the ground.
    fn other(
        &self,
        convention: LightTime,
        image: &ImageTimes,
        ground: &Position<BodyFixed>,
    ) -> Result<Option<OtherConvention>> {
        let reader = self.with(convention);
        let camera = |lines: f64| -> Result<Camera> {
            reader.camera(
                image
                    .line_times
                    .et(image.line_times.line(image.middle()) + lines),
            )
        };
        let middle = camera(0.0)?;
        let boresight = middle.to_mars.matrix() * Vector3::z();
        let Some(met) = ray_meets_ellipsoid(image.body.model(), &middle.position, &boresight)
        else {
            return Ok(None);
        };
        // One secant over a line: over ten lines the track bends by 1e-4 of a line.
        let missed = off_boresight(&middle, ground).x;
        let lines = missed / (missed - off_boresight(&camera(1.0)?, ground).x);
        let detector = image.detector();
        let across_px = -detector.focal_length_px * off_boresight(&camera(lines)?, ground).y;
        Ok(Some(OtherConvention {
            convention,
            ground_m: met.distance_m(ground),
            lines,
            samples: detector.sample(across_px) - detector.sample(0.0),
        }))
    }
}

/// Offset of a point from the boresight of a camera, along its x and y, in focal lengths.
fn off_boresight(camera: &Camera, point: &Position<BodyFixed>) -> Vector2<f64> {
    let away_m = point.xyz_m - camera.position.xyz_m;
    let seen_m = camera.to_mars.matrix().tr_mul(&away_m);
    seen_m.xy() / seen_m.z
}
