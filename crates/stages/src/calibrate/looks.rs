//! Look directions of the lines, for the comparison of calibrations of several orbits.

use super::{
    error::CalibrateError,
    geometry::{CameraImage, Orbit},
    outcome::Outcome,
    result::{LineLooks, Looks},
};
use areograph_config::APrioriConfig;
use areograph_geom::calibration::{LOOKS_AT, Sight, look_changes, orbit_in_looks};

impl Outcome<'_> {
    /// Changes of the look directions from the laboratory, with the errors that they contain.
    ///
    /// # Errors
    /// A line that does not see the ground.
    pub(super) fn looks(&self, known: &APrioriConfig) -> Result<Looks, CalibrateError> {
        let (changes, covariance) =
            look_changes(&self.laboratory.state, self.state, self.covariance);
        let of_line = changes.len() / self.names.len();
        let mut by_orbit: [Vec<f64>; 6] = Default::default();
        for camera in 0..self.names.len() {
            let depth_m = LOOKS_AT.map(|s| self.depth_m(camera, s));
            if depth_m.iter().any(Option::is_none) {
                return Err(CalibrateError::LooksUp {
                    camera: self.names[camera].clone(),
                });
            }
            let looks = LOOKS_AT.map(|s| self.state.cameras[camera].turned(s));
            let errors = orbit_in_looks(looks, depth_m.map(Option::unwrap_or_default));
            for (index, (column, error)) in by_orbit.iter_mut().zip(errors).enumerate() {
                let sigma = if index < 3 {
                    known.orbit_bias_m
                } else {
                    known.angle_rad
                };
                column.extend(error.map(|of| of * sigma));
            }
        }
        let lines = self.orbit.images.iter().enumerate();
        let line = |(camera, image): (usize, &CameraImage)| {
            let first = camera * of_line;
            LineLooks {
                sensor: image.support.instrument.name.clone(),
                changes: std::array::from_fn(|at| changes[first + at]),
            }
        };
        Ok(Looks {
            middle_et_s: self.orbit.middle_s(),
            lines: lines.map(line).collect(),
            covariance: (covariance.row_iter())
                .map(|row| row.iter().copied().collect())
                .collect(),
            by_orbit: by_orbit.into(),
        })
    }

    /// Distance of the ground below the spacecraft where a line looks in the middle of its image, metres.
    fn depth_m(&self, camera: usize, s: f64) -> Option<f64> {
        let Orbit {
            images, radius_m, ..
        } = self.orbit;
        let [lines, _] = images[camera].size();
        let pose = self.orbit.pose(camera, 0.5 * lines);
        let sight = Sight {
            camera,
            pose,
            s,
            sigma: [1.0, 1.0],
        };
        let ground_m = sight.at_radius(self.state, *radius_m)?;
        let depth_m = (pose.body_to_axes * (ground_m - pose.position_m)).z;
        (depth_m > 0.0).then_some(depth_m)
    }
}
