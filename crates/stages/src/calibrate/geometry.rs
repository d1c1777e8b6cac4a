//! Images of the lines of a camera as the calibration sees them: poses in the axes of the spacecraft, look angles of the
//! laboratory.

use nalgebra::{Matrix3, Vector3};

use super::error::CalibrateError;
use areograph_base::{body::Body, error::Result, time::Et};
use areograph_geom::{
    calibration::{CalibrationState, GroundPoint, LineCamera, LinePose, Sight},
    polynomial::Polynomial,
    pushbroom::Detector,
};
use areograph_pds::isd::{ImageSupport, SupportSource};

/// Largest angle between an axis of the spacecraft and the direction that it represents, degrees: images are taken
/// looking down.
const AXIS_DEG: f64 = 40.0;
/// Places at which polynomials are fitted to the laboratory's look directions.
const FITTED_AT: u32 = 65;

/// An image of a line of the camera.
pub(super) struct CameraImage {
    pub(super) support: ImageSupport,
    pub(super) detector: Detector,
}

impl CameraImage {
    /// The image of `name`, which sees `body`.
    pub(super) fn read(source: SupportSource<'_>, name: &str, body: Body) -> Result<Self> {
        let support = source.read()?;
        source.located(support.sees(body, name))?;
        let detector = Detector::new(
            &support.instrument,
            support.crosstrack_summing,
            support.first_detector,
            support.samples,
        );
        Ok(Self { support, detector })
    }

    /// Tangent of a pixel.
    pub(super) fn pixel(&self) -> f64 {
        self.detector.focal_length_px.recip()
    }

    /// Lines and samples.
    pub(super) fn size(&self) -> [f64; 2] {
        [
            f64::from(self.support.line_times.lines()),
            self.detector.samples,
        ]
    }

    /// A sample as the argument of the look angles.
    pub(super) fn s(&self, sample: f64) -> f64 {
        2.0 * sample / self.detector.samples - 1.0
    }

    /// Remark where the support data disagree with the frame of `body`, in which laser points are assumed to be.
    pub(super) fn frame_remark(&self, body: Body, name: &str) -> Option<String> {
        self.support.tables.frame_remark(body, name, self.middle())
    }

    fn middle(&self) -> Et {
        self.support.line_times.middle()
    }
}

/// The images of one orbit, in the order of the cameras.
pub(super) struct Orbit {
    pub(super) images: Vec<CameraImage>,
    /// Radius of the ground, metres.
    pub(super) radius_m: f64,
    /// From the spacecraft's own axes to those across the flight, along it and down.
    pub(super) axes: Matrix3<f64>,
    /// Origin of the orbit's drift, ET seconds, and its unit, seconds.
    middle_s: f64,
    period_s: f64,
}

/// The laboratory's geometry as polynomials.
pub(super) struct Laboratory {
    pub(super) state: CalibrationState,
    /// Largest residual of the polynomials of every camera, pixels.
    pub(super) left_px: Vec<f64>,
}

impl Orbit {
    /// The orbit of these images, in the given axes or in the axes of the first image.
    pub(super) fn of(
        images: Vec<CameraImage>,
        body: Body,
        axes: Option<Matrix3<f64>>,
    ) -> std::result::Result<Self, CalibrateError> {
        let axes = axes.map_or_else(|| axes_of(&images[0]), Ok)?;
        let middles = images.iter().map(|image| image.middle().seconds());
        let middle_s = middles.sum::<f64>() / images.len() as f64;
        let period_s = images[0].support.line_times.mean_period_s();
        Ok(Self {
            images,
            radius_m: body.model().equatorial_radius_m,
            axes,
            middle_s,
            period_s,
        })
    }

    /// Pose of the spacecraft when a line was exposed.
    pub(super) fn pose(&self, camera: usize, line: f64) -> LinePose {
        let support = &self.images[camera].support;
        let et_s = support.line_times.et(line).seconds();
        let tables = &support.tables;
        let to_body = tables.body_rotation.constant * tables.body_rotation.at(et_s).0;
        let (position_m, _) = tables.position.at(et_s);
        let (to_bus, _) = tables.pointing.at(et_s);
        LinePose {
            position_m: to_body * position_m,
            body_to_axes: self.axes * to_bus * to_body.transpose(),
            after_lines: (et_s - self.middle_s) / self.period_s,
        }
    }

    /// Standard deviations along the body's axes of the apparent drift from a constant orbit error of `sigma_m` along
    /// each axis of the spacecraft, metres per line.
    ///
    /// Offset angles turn with the spacecraft and absorb errors that are constant in its axes. An orbit error that is
    /// constant in the body's axes is not, and leaves as much drift as these axes turn from line to line.
    pub(super) fn turned_m_per_line(&self, sigma_m: f64) -> Vector3<f64> {
        let [lines, _] = self.images[0].size();
        let [first, last] = [0.25, 0.75].map(|share| self.pose(0, share * lines));
        let apart_lines = last.after_lines - first.after_lines;
        let turned = (last.body_to_axes - first.body_to_axes) / apart_lines;
        let turn = turned.tr_mul(&first.body_to_axes);
        Vector3::from_fn(|axis, _| sigma_m * turn.row(axis).norm())
    }

    /// Middle of the images, ET seconds.
    pub(super) const fn middle_s(&self) -> f64 {
        self.middle_s
    }

    /// Shift of the orbit at an instant, J2000, metres.
    pub(super) fn shift_m(
        &self,
        camera: usize,
        state: &CalibrationState,
        et_s: f64,
    ) -> Vector3<f64> {
        let body = &self.images[camera].support.tables.body_rotation;
        let to_body = body.constant * body.at(et_s).0;
        to_body.tr_mul(&state.drift_m((et_s - self.middle_s) / self.period_s))
    }

    /// The sight of a place in an image, with standard deviations of line and sample in pixels.
    pub(super) fn sight(
        &self,
        laboratory: &CalibrationState,
        camera: usize,
        [line, sample]: [f64; 2],
        [sigma_line, sigma_sample]: [f64; 2],
    ) -> Sight {
        let image = &self.images[camera];
        let at = |line: f64| Sight {
            camera,
            pose: self.pose(camera, line),
            s: image.s(sample),
            sigma: [1.0, 1.0],
        };
        // A line moves the ground in the focal plane by about a pixel; two lines give the exact amount.
        let sights = [at(line - 0.5), at(line + 0.5)].to_vec();
        let per_line = sights[0]
            .at_radius(laboratory, self.radius_m)
            .and_then(|place_m| {
                let lines = GroundPoint {
                    sights,
                    known: None,
                };
                let residuals = lines.residuals(laboratory, &place_m).ok()?;
                Some((residuals[1] - residuals[0]).norm())
            })
            .unwrap_or_else(|| image.pixel());
        Sight {
            sigma: [sigma_sample * image.pixel(), sigma_line * per_line],
            ..at(line)
        }
    }

    /// The laboratory's look directions as polynomials of an order.
    pub(super) fn laboratory(
        &self,
        names: &[String],
        order: usize,
    ) -> std::result::Result<Laboratory, CalibrateError> {
        let mut laboratory = Laboratory {
            state: CalibrationState::default(),
            left_px: Vec::new(),
        };
        for (image, name) in self.images.iter().zip(names) {
            let looks_up = || CalibrateError::LooksUp {
                camera: name.clone(),
            };
            let to_axes = self.axes * image.support.tables.pointing.constant.transpose();
            let (mut s, mut across, mut along) = (Vec::new(), Vec::new(), Vec::new());
            for index in 0..FITTED_AT {
                let sample = image.detector.samples * f64::from(index) / f64::from(FITTED_AT - 1);
                let look = to_axes * image.detector.look(sample);
                if !(look.z > 0.0) {
                    return Err(looks_up());
                }
                s.push(image.s(sample));
                across.push(look.x / look.z);
                along.push(look.y / look.z);
            }
            let fit = |tangents: &[f64]| Polynomial::fit(&s, tangents, order).ok_or_else(looks_up);
            let (across, along) = (fit(&across)?, fit(&along)?);
            let left = across
                .residuals
                .iter()
                .zip(&along.residuals)
                .map(|(a, b)| a.hypot(*b));
            laboratory
                .left_px
                .push(left.fold(0.0, f64::max) / image.pixel());
            laboratory.state.cameras.push(LineCamera {
                m: across.polynomial.coefficients().to_vec(),
                n: along.polynomial.coefficients().to_vec(),
                ..LineCamera::default()
            });
        }
        Ok(laboratory)
    }
}

/// The axes of the spacecraft, forwards or backwards, that are nearest to across the flight, along it and down.
fn axes_of(image: &CameraImage) -> std::result::Result<Matrix3<f64>, CalibrateError> {
    let et_s = image.middle().seconds();
    let tables = &image.support.tables;
    let (position_m, velocity_m_s) = tables.position.at(et_s);
    let (to_bus, _) = tables.pointing.at(et_s);
    let down = nearest_axis(&(to_bus * -position_m.normalize()), "nadir")?;
    let level =
        velocity_m_s - position_m * (velocity_m_s.dot(&position_m) / position_m.norm_squared());
    let along = nearest_axis(&(to_bus * level.normalize()), "the flight")?;
    let across = along.cross(&down);
    Ok(Matrix3::from_rows(&[
        across.transpose(),
        along.transpose(),
        down.transpose(),
    ]))
}

fn nearest_axis(
    direction: &Vector3<f64>,
    what: &'static str,
) -> std::result::Result<Vector3<f64>, CalibrateError> {
    let at = direction.iamax();
    if !(direction[at].abs() > AXIS_DEG.to_radians().cos()) {
        return Err(CalibrateError::NoAxis {
            what,
            limit_deg: AXIS_DEG,
        });
    }
    let mut axis = Vector3::zeros();
    axis[at] = direction[at].signum();
    Ok(axis)
}
