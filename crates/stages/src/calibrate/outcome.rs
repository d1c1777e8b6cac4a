//! Assembles the result of a calibration.

use nalgebra::{DMatrix, Vector3};

use super::{
    error::CalibrateError,
    geometry::{Laboratory, Orbit},
    measure::Squares,
    read::OrbitPoint,
    result::{
        CameraResult, HeldBack, ImageResult, PointKind, PointResult, Scatter, Scattered, Value,
    },
    support::calibrated,
};
use areograph_base::error::Result;
use areograph_geom::{
    calibration::{CalibrationState, GroundPoint, Missed, TookPart},
    ellipsoid::local_axes,
};
use areograph_pds::isd::SupportSource;

/// Places at which look directions are compared, `s′`.
const COMPARED_AT: [f64; 3] = [-1.0, 0.0, 1.0];
/// Minimum number of coordinates that are free to differ.
const FREE_MIN: f64 = 1.0;

/// A completed calibration.
pub(super) struct Outcome<'a> {
    /// The support data of each line.
    pub(super) support: &'a [SupportSource<'a>],
    pub(super) names: &'a [String],
    pub(super) orbit: &'a Orbit,
    pub(super) laboratory: &'a Laboratory,
    pub(super) points: &'a [OrbitPoint],
    pub(super) pixels: &'a [f64],
    pub(super) state: &'a CalibrationState,
    pub(super) covariance: &'a DMatrix<f64>,
}

/// The drift of the orbit with standard deviations, including the effect of its constant error of `orbit_bias_m`.
pub(super) fn drift(
    state: &CalibrationState,
    covariance: &DMatrix<f64>,
    orbit: &Orbit,
    orbit_bias_m: f64,
) -> [Value; 3] {
    let first = state.layout().len() - 3;
    let turned_m = orbit.turned_m_per_line(orbit_bias_m);
    [0, 1, 2].map(|axis| {
        let variance = covariance[(first + axis, first + axis)].max(0.0);
        Value {
            value: state.drift_m_per_line[axis],
            sigma: variance.sqrt().hypot(turned_m[axis]),
        }
    })
}

/// `None` where the points have no redundancy.
fn scattered(of: Missed) -> Option<Scattered> {
    (of.free >= FREE_MIN).then(|| Scattered {
        sigmas: (of.square / of.expected).sqrt(),
        coordinates: of.free,
    })
}

impl Outcome<'_> {
    /// The cameras with their support data.
    pub(super) fn cameras(&self) -> Result<Vec<CameraResult>> {
        let layout = self.state.layout();
        let vector = self.state.vector();
        let value = |index: usize| Value {
            value: vector[index],
            sigma: self.covariance[(index, index)].max(0.0).sqrt(),
        };
        let mut cameras = Vec::new();
        for (camera, name) in self.names.iter().enumerate() {
            let image = &self.orbit.images[camera];
            let first = camera * layout.of_camera();
            let source = self.support[camera];
            let (isd, isd_left_px) = calibrated(source, self.orbit, camera, self.state)?;
            let powers = |from: usize| (from..=from + layout.order).map(value).collect();
            let laboratory = &self.laboratory.state.cameras[camera];
            let moved = COMPARED_AT.map(|s| {
                let look = self.state.cameras[camera].look(s);
                (look.xy() / look.z - laboratory.tangents(s)).norm()
            });
            cameras.push(CameraResult {
                camera: name.clone(),
                angles_rad: [0, 1, 2].map(|axis| value(first + axis)),
                m: powers(first + 3),
                n: powers(first + 4 + layout.order),
                laboratory: [laboratory.m.clone(), laboratory.n.clone()],
                laboratory_left_px: self.laboratory.left_px[camera],
                pixel: image.pixel(),
                samples: image.support.samples,
                moved_px: moved.into_iter().fold(0.0, f64::max) / image.pixel(),
                isd,
                isd_left_px,
            });
        }
        Ok(cameras)
    }

    /// Scatter of control of this kind; `None` without such points.
    ///
    /// # Errors
    /// A point that the calibrated cameras cannot see.
    pub(super) fn scatter(
        &self,
        kind: PointKind,
    ) -> std::result::Result<Option<Scatter>, CalibrateError> {
        let took_part = match kind {
            PointKind::HeldBack => TookPart::No,
            PointKind::Tie | PointKind::Control => TookPart::Yes,
        };
        let (mut plane, mut height, mut points) = (Missed::default(), Missed::default(), 0_u32);
        for of in self.points.iter().filter(|point| point.is(kind)) {
            let misfit = of.point.misfit(self.state, self.covariance, took_part);
            let misfit = misfit.map_err(|why| CalibrateError::Unseen {
                point: of.name.clone(),
                problem: why.to_string(),
            })?;
            let Some(misfit) = misfit else { continue };
            plane = plane.and(misfit.plane);
            height = height.and(misfit.height.unwrap_or_default());
            points += 1;
        }
        Ok((points > 0).then(|| Scatter {
            plane: scattered(plane),
            height: scattered(height),
        }))
    }

    /// Statistics of withheld control; `None` without such points.
    ///
    /// # Errors
    /// A point that the calibrated cameras cannot see.
    pub(super) fn held_back(&self) -> std::result::Result<Option<HeldBack>, CalibrateError> {
        let (mut plane, mut height) = (Squares::default(), Squares::default());
        let (mut sum_m, mut intersected, mut points) = (Vector3::zeros(), 0_u32, 0_u32);
        for of in self
            .points
            .iter()
            .filter(|point| point.is(PointKind::HeldBack))
        {
            points += 1;
            if let Some(off_m) = self.off_m(of) {
                plane.add(off_m.xy().norm());
                height.add(off_m.z);
                sum_m += off_m;
                intersected += 1;
            }
        }
        let Some(scatter) = self.scatter(PointKind::HeldBack)? else {
            return Ok(None);
        };
        let used = self.scatter(PointKind::Control)?;
        // Scatter above 1 shows that standard deviations are too small, in used or in withheld control.
        let wider = |of: fn(&Scatter) -> Option<Scattered>| {
            let both = [Some(scatter), used].into_iter().flatten();
            let sigmas = both.filter_map(|both| Some(of(&both)?.sigmas));
            sigmas.fold(1.0, f64::max)
        };
        let [wider_plane, wider_height] = [wider(|of| of.plane), wider(|of| of.height)];
        let (mut stated_plane, mut stated_height) = (Squares::default(), Squares::default());
        for of in self.points.iter().filter(|point| point.is(PointKind::Tie)) {
            if let Some([east, north, up]) = self.placed(of).and_then(|of| of.1) {
                stated_plane.add(east.hypot(north) * wider_plane);
                stated_height.add(up * wider_height);
            }
        }
        Ok(Some(HeldBack {
            points: points.into(),
            scatter,
            intersected: intersected.into(),
            plane_m: plane.rms(),
            height_m: height.rms(),
            mean_m: (intersected > 0).then(|| (sum_m / f64::from(intersected)).into()),
            accuracy_plane_m: stated_plane.rms(),
            accuracy_height_m: stated_height.rms(),
        }))
    }

    /// A point's position from its images only, and its standard deviations east, north and up, metres.
    fn placed(&self, of: &OrbitPoint) -> Option<(Vector3<f64>, Option<[f64; 3]>)> {
        let unaided: GroundPoint = of.point.unaided();
        let place_m = unaided.place(self.state).ok()?;
        let covariance = unaided.covariance_m2(self.state, self.covariance, &place_m);
        let sigma_m = covariance.ok().map(|covariance| {
            let axes = local_axes(&place_m);
            let local = axes * covariance * axes.transpose();
            [0, 1, 2].map(|axis| local[(axis, axis)].max(0.0).sqrt())
        });
        Some((place_m, sigma_m))
    }

    /// Intersected minus the laser's place, east, north and up, metres.
    fn off_m(&self, of: &OrbitPoint) -> Option<Vector3<f64>> {
        let known = of.point.known?;
        let place_m = of.point.unaided().place(self.state).ok()?;
        let off_m = local_axes(&known.place_m) * (place_m - known.place_m);
        Some(off_m)
    }

    pub(super) fn points(&self) -> Vec<PointResult> {
        let result = |of: &OrbitPoint| {
            let placed = self.placed(of).filter(|_| !of.left_out);
            let place = placed.map(|(place_m, _)| {
                let radius_m = place_m.norm();
                let latitude = (place_m.z / radius_m).clamp(-1.0, 1.0).asin();
                [place_m.y.atan2(place_m.x), latitude, radius_m]
            });
            PointResult {
                point: of.name.clone(),
                kind: of.kind,
                left_out: of.left_out,
                place,
                sigma_m: placed
                    .filter(|_| !of.may_be_off)
                    .and_then(|(_, sigma_m)| sigma_m),
                off_m: self.off_m(of).map(Into::into),
            }
        };
        self.points.iter().map(result).collect()
    }

    pub(super) fn images(&self) -> Vec<ImageResult> {
        let of_point = |of: &OrbitPoint| {
            let [before, after] =
                [&self.laboratory.state, self.state].map(|state| self.residuals_px(of, state));
            let of_image = |(index, measured): (usize, &super::tables::Measured)| ImageResult {
                point: of.name.clone(),
                kind: of.kind,
                camera: self.names[measured.camera].clone(),
                place: measured.place,
                left_out: of.left_out,
                before_px: before.as_ref().map(|before| before[index]),
                after_px: after.as_ref().map(|after| after[index]),
            };
            let images = of.measured.iter().enumerate().map(of_image);
            images.collect::<Vec<_>>()
        };
        self.points.iter().flat_map(of_point).collect()
    }

    /// Residuals of a point's images: at the laser's position where available, otherwise at the intersection.
    fn residuals_px(&self, of: &OrbitPoint, state: &CalibrationState) -> Option<Vec<[f64; 2]>> {
        let place_m = match &of.point.known {
            Some(known) => known.place_m,
            None => of.point.place(state).ok()?,
        };
        let residuals = of.point.residuals(state, &place_m).ok()?;
        let sights = of.point.sights.iter().zip(residuals);
        let px = sights.map(|(sight, residual)| (residual / self.pixels[sight.camera]).into());
        Some(px.collect())
    }
}
