//! Other orbits, to which the calibration is applied unchanged.

use nalgebra::{DMatrix, Vector2};

use super::{
    demands::{CONTROLS_MIN, belong_together, enough_ties},
    elsewhere::{CALIBRATION_SIGMAS, Noise, OFFSET_MAX},
    error::CalibrateError,
    geometry::{CameraImage, Laboratory, Orbit},
    measure::{Squares, figures},
    read::{OrbitPoint, PointSource, points_of},
    result::{ControlOffset, PointKind, ValidationResult},
    tables::Complaints,
};
use areograph_base::{body::Body, error::Result};
use areograph_config::{CalibrationConfig, ValidationConfig};
use areograph_geom::{
    calibration::{CalibrationState, Missed, TookPart},
    ellipsoid::local_axes,
};
use areograph_pds::isd::SupportSource;
use areograph_store::files::{file_name, hash_file};

/// Largest difference between the laboratory's geometry of two orbits, pixels: files are written with fifteen digits.
const MOUNTING_PX: f64 = 0.01;
/// Places at which it is compared, `s′`.
const COMPARED_AT: [f64; 3] = [-1.0, 0.0, 1.0];

/// The calibration orbit, to which other orbits are compared.
pub(super) struct Calibrated<'a> {
    pub(super) names: &'a [String],
    pub(super) orbit: &'a Orbit,
    pub(super) laboratory: &'a Laboratory,
    pub(super) state: &'a CalibrationState,
    pub(super) covariance: &'a DMatrix<f64>,
}

/// Figures of another orbit before and with the calibration.
pub(super) fn validate(
    config: &CalibrationConfig,
    of: &ValidationConfig,
    calibrated: &Calibrated<'_>,
    complaints: &mut Complaints,
) -> Result<(ValidationResult, Noise)> {
    of_its_own(config, of)?;
    let orbit = orbit(config.body, of, calibrated, complaints)?;
    let order = config.solution.order as usize;
    let laboratory = orbit.laboratory(calibrated.names, order)?;
    same_mounting(&of.id, calibrated, &laboratory, &orbit)?;
    let tables = PointSource::Tables {
        ties: &of.ties,
        control: &of.control,
        held_back_every: None,
    };
    let names = calibrated.names;
    let points = points_of(config, names, &orbit, &laboratory, &tables, complaints)?;
    enough_ties(&points, names)?;
    let controls = points.iter().filter(|of| of.is(PointKind::Control)).count();
    if controls < CONTROLS_MIN {
        return Err(CalibrateError::ThinValidation {
            orbit: of.id.clone(),
            found: controls,
            expected: CONTROLS_MIN,
        }
        .into());
    }
    let pixels: Vec<f64> = orbit.images.iter().map(CameraImage::pixel).collect();
    let unchanged = CalibrationState {
        cameras: calibrated.state.cameras.clone(),
        ..CalibrationState::default()
    };
    let noise = noise(&points, &unchanged);
    let result = ValidationResult {
        orbit: of.id.clone(),
        before: figures(&points, &laboratory.state, &pixels),
        after: figures(&points, &unchanged, &pixels),
        offsets: offsets(
            &points,
            &unchanged,
            names,
            noise,
            calibration_shares(&points, &unchanged, calibrated.covariance),
        ),
    };
    Ok((result, noise))
}

/// Mean offsets of control under a calibration: in plan in every camera, and in height.
fn offsets(
    points: &[OrbitPoint],
    state: &CalibrationState,
    names: &[String],
    noise: Noise,
    [plane_share, height_share]: [f64; 2],
) -> Vec<ControlOffset> {
    let mut planes = vec![Mean::default(); names.len()];
    let mut heights = Mean::default();
    for of in points.iter().filter(|point| point.is(PointKind::Control)) {
        let Some(known) = &of.point.known else {
            continue;
        };
        for sight in &of.point.sights {
            if let Some(seen_m) = sight.at_radius(state, known.place_m.norm()) {
                let off_m = local_axes(&known.place_m) * (seen_m - known.place_m);
                planes[sight.camera].add(off_m.xy());
            }
        }
        if let Ok(place_m) = of.point.unaided().place(state) {
            let above_m = place_m.norm() - known.place_m.norm();
            heights.add(Vector2::new(above_m, 0.0));
        }
    }
    let cameras = names.iter().zip(planes);
    let planes =
        cameras.map(|(name, mean)| mean.offset(Some(name.clone()), noise.plane_m, plane_share));
    let height = heights.offset(None, noise.height_m, height_share);
    planes.chain([height]).flatten().collect()
}

/// Variances of control in plan and in height by the errors of the cameras, over the variances of measurement and
/// laser: means over the points. The orbit has its own drift.
fn calibration_shares(
    points: &[OrbitPoint],
    state: &CalibrationState,
    covariance: &DMatrix<f64>,
) -> [f64; 2] {
    let mut of_cameras = covariance.clone();
    let drift = of_cameras.nrows() - 3;
    of_cameras.rows_mut(drift, 3).fill(0.0);
    of_cameras.columns_mut(drift, 3).fill(0.0);
    let (mut plane, mut height) = (Missed::default(), Missed::default());
    for of in points.iter().filter(|point| point.is(PointKind::Control)) {
        if let Ok(Some(misfit)) = of.point.misfit(state, &of_cameras, TookPart::No) {
            plane = plane.and(misfit.plane);
            height = height.and(misfit.height.unwrap_or_default());
        }
    }
    [plane, height].map(|of| (of.expected / of.free.max(1.0) - 1.0).max(0.0))
}

/// Sum of offsets.
#[derive(Debug, Clone, Copy, Default)]
struct Mean {
    sum_m: Vector2<f64>,
    count: u32,
}

impl Mean {
    fn add(&mut self, off_m: Vector2<f64>) {
        self.sum_m += off_m;
        self.count += 1;
    }

    /// The mean with its limit; `None` without points or without their standard deviation.
    ///
    /// * `share` – variance by the calibration over the variance of a point
    fn offset(
        self,
        camera: Option<String>,
        point_sigma_m: Option<f64>,
        share: f64,
    ) -> Option<ControlOffset> {
        let point_sigma_m = point_sigma_m.filter(|_| self.count > 0)?;
        let count = f64::from(self.count);
        let calibration_sigma_m = point_sigma_m * share.sqrt();
        Some(ControlOffset {
            camera,
            offset_m: self.sum_m.norm() / count,
            point_sigma_m,
            mean_sigma_m: point_sigma_m / count.sqrt(),
            calibration_sigma_m,
            limit_m: (OFFSET_MAX * point_sigma_m).hypot(CALIBRATION_SIGMAS * calibration_sigma_m),
        })
    }
}

/// Checks that an orbit shares no file with the calibration, by content.
fn of_its_own(config: &CalibrationConfig, of: &ValidationConfig) -> Result<()> {
    let cameras = config.cameras.iter().map(|camera| &camera.isd);
    let own = cameras
        .chain(&config.ties.files)
        .chain(&config.control.files);
    let own = own
        .map(|path| Ok(hash_file(path)?.0))
        .collect::<Result<Vec<String>>>()?;
    for path in of.isd.iter().chain(&of.ties).chain(&of.control) {
        if own.contains(&hash_file(path)?.0) {
            return Err(CalibrateError::SameFile {
                orbit: of.id.clone(),
                file: file_name(path),
            }
            .into());
        }
    }
    Ok(())
}

/// Figures of control from the noise of measurement and laser only.
fn noise(points: &[OrbitPoint], state: &CalibrationState) -> Noise {
    let (mut plane, mut height) = (Squares::default(), Squares::default());
    let parameters = state.layout().len();
    let exact = DMatrix::zeros(parameters, parameters);
    for of in points.iter().filter(|point| point.is(PointKind::Control)) {
        let Some(known) = &of.point.known else {
            continue;
        };
        // Rows are axes over their standard deviations.
        let [east_m, north_m, up_m] =
            [0, 1, 2].map(|axis| known.whitening.row(axis).norm().recip());
        for sight in &of.point.sights {
            let range_m = (known.place_m - sight.pose.position_m).norm();
            let [across, along] = sight.sigma.map(|sigma| sigma * range_m);
            plane.add(east_m.hypot(north_m).hypot(across.hypot(along)));
        }
        if let Ok(covariance) = of
            .point
            .unaided()
            .covariance_m2(state, &exact, &known.place_m)
        {
            let up = known.place_m.normalize();
            height.add((up.dot(&(covariance * up))).max(0.0).sqrt().hypot(up_m));
        }
    }
    Noise {
        plane_m: plane.rms(),
        height_m: height.rms(),
    }
}

/// The images of another orbit, each with the camera whose sensor it names.
fn orbit(
    body: Body,
    of: &ValidationConfig,
    calibrated: &Calibrated<'_>,
    complaints: &mut Complaints,
) -> Result<Orbit> {
    let mut found: Vec<CameraImage> = Vec::new();
    for path in &of.isd {
        found.push(CameraImage::read(SupportSource::File(path), &of.id, body)?);
    }
    let mut images = Vec::new();
    for (image, camera) in calibrated.orbit.images.iter().zip(calibrated.names) {
        let sensor = &image.support.instrument.name;
        let at = found
            .iter()
            .position(|other| other.support.instrument.name == *sensor);
        let at = at.ok_or_else(|| CalibrateError::NoSupport {
            orbit: of.id.clone(),
            sensor: sensor.clone(),
            camera: camera.clone(),
        })?;
        images.push(found.swap_remove(at));
    }
    for other in found {
        complaints.tell(format!(
            "validation {}: support data of {} are not used, because they match no camera of the calibration, or match \
             a camera that already has support data",
            of.id, other.support.instrument.name
        ));
    }
    belong_together(&images, calibrated.names)?;
    Ok(Orbit::of(images, body, Some(calibrated.orbit.axes))?)
}

fn same_mounting(
    id: &str,
    calibrated: &Calibrated<'_>,
    laboratory: &Laboratory,
    orbit: &Orbit,
) -> std::result::Result<(), CalibrateError> {
    let both = calibrated
        .laboratory
        .state
        .cameras
        .iter()
        .zip(&laboratory.state.cameras);
    for (index, (here, there)) in both.enumerate() {
        let off = COMPARED_AT.map(|s| (here.tangents(s) - there.tangents(s)).norm());
        let off_px = off.into_iter().fold(0.0, f64::max) / orbit.images[index].pixel();
        if !(off_px <= MOUNTING_PX) {
            return Err(CalibrateError::OtherMounting {
                orbit: id.to_owned(),
                camera: calibrated.names[index].clone(),
                off_px,
                limit_px: MOUNTING_PX,
            });
        }
    }
    Ok(())
}
