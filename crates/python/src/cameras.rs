//! Cameras of line scanners by their support data.

use std::{f64::consts::FRAC_PI_2, sync::Arc};

use areograph::{
    body::Body,
    error::Result,
    frames::{BodyFixed, Position},
    geom::{
        ellipsoid::{Spherical, is_above_horizon, ray_meets_ellipsoid, spherical_to_xyz_m},
        pushbroom::ExteriorOrientation as _,
    },
    pds::isd::SupportSource,
    stages::line_camera::LineCamera,
    units::RADIANS_PER_DEGREE,
};
use arrow_array::{ArrayRef, BooleanArray};
use nalgebra::{Rotation3, UnitQuaternion, Vector3};
use pyo3::prelude::*;
use rayon::prelude::*;

use super::{
    columns::{Columns, arrays, numbers},
    failures::detached,
};

/// Largest difference between the radius of a body and that in support data, metres: other bodies differ by far more.
const RADIUS_M: f64 = 20_000.0;

/// A point that no line sees.
const UNSEEN: ([f64; 2], bool) = ([f64::NAN; 2], false);

/// An image of a line scanner by its support data (ISD of the Community Sensor Model).
#[pyclass(frozen, module = "areograph._native")]
pub(crate) struct Camera {
    camera: LineCamera,
    body: Body,
}

#[pymethods]
impl Camera {
    /// The camera of the text of support data.
    ///
    /// # Errors
    /// Text that is not the support data of a line scanner, or not of a body that areograph knows.
    #[new]
    fn new(py: Python<'_>, isd: &str) -> PyResult<Self> {
        detached(py, || {
            let source = SupportSource::Text(isd);
            let support = source.read()?;
            // Not all programs state the target; radii do, and the reader examines both.
            let is_target = |body: &Body| match support.target {
                Some(target) => target == i64::from(body.naif().body),
                None => (body.model().equatorial_radius_m - support.radii_m[0]).abs() < RADIUS_M,
            };
            let body = [Body::Mars, Body::Moon].into_iter().find(is_target);
            let body = body.unwrap_or(Body::Mars);
            let camera = LineCamera::of(SupportSource::Text(isd), "of the support data", body)?;
            Ok(Self { camera, body })
        })
    }

    /// Lines and samples of the image.
    #[getter]
    fn shape(&self) -> (u32, u32) {
        (self.camera.camera.line_times.lines(), self.camera.samples)
    }

    /// Line, sample and whether the image shows the point, of points in degrees and metres.
    ///
    /// # Errors
    /// Support data of a camera that sees no ground.
    fn project(
        &self,
        py: Python<'_>,
        longitude_deg: &Bound<'_, PyAny>,
        latitude_deg: &Bound<'_, PyAny>,
        radius_m: &Bound<'_, PyAny>,
    ) -> PyResult<Columns> {
        let names = ["longitude", "latitude", "radius"];
        let [longitudes_deg, latitudes_deg, radii_m] =
            arrays(py, names, [longitude_deg, latitude_deg, radius_m])?;
        let camera = &self.camera.camera;
        let seen = detached(py, || -> Result<Vec<([f64; 2], bool)>> {
            let projector = self.camera.projector()?;
            let see = |row: usize| {
                let [longitude_rad, latitude_rad] =
                    [longitudes_deg[row], latitudes_deg[row]].map(|deg| deg * RADIANS_PER_DEGREE);
                if latitude_rad.abs() > FRAC_PI_2 || !(radii_m[row] > 0.0) {
                    return None;
                }
                let point_m = spherical_to_xyz_m(longitude_rad, latitude_rad, radii_m[row]);
                let seen = projector.project(&point_m).ok()?;
                if !is_above_horizon(&camera.orientation.pose(seen.x).position_m, &point_m) {
                    return None;
                }
                let focal_px = camera.detector.focal_px(&seen.camera_m).ok()?;
                let line = camera.line_times.line_of_offset(seen.x);
                let sample = camera.detector.sample(focal_px.y);
                let is_shown = camera.shows(line, sample) && !camera.line_times.in_gap(seen.x);
                Some(([line, sample], is_shown))
            };
            let rows = (0..radii_m.len()).into_par_iter();
            Ok(rows.map(|row| see(row).unwrap_or(UNSEEN)).collect())
        })?;
        let valid = seen.iter().map(|(_, is_shown)| *is_shown);
        let valid: ArrayRef = Arc::new(valid.map(Some).collect::<BooleanArray>());
        let column = |of: usize| numbers(seen.iter().map(|(pixel, _)| pixel[of]).collect());
        Columns::of([("line", column(0)), ("sample", column(1)), ("valid", valid)])
    }

    /// Longitude and latitude in degrees and radius in metres where the rays of image positions meet the ellipsoid, or
    /// the spheres of these radii; NaN where a ray meets nothing, or the position is outside the image.
    #[pyo3(signature = (line, sample, radius_m=None))]
    fn intersect(
        &self,
        py: Python<'_>,
        line: &Bound<'_, PyAny>,
        sample: &Bound<'_, PyAny>,
        radius_m: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Columns> {
        let (pixels, radii_m) = match radius_m {
            Some(radius_m) => {
                let [lines, samples, radii_m] =
                    arrays(py, ["line", "sample", "radius"], [line, sample, radius_m])?;
                ([lines, samples], Some(radii_m))
            }
            None => (arrays(py, ["line", "sample"], [line, sample])?, None),
        };
        let camera = &self.camera.camera;
        let meet = |row: usize| {
            let [line, sample] = [pixels[0][row], pixels[1][row]];
            if !camera.shows(line, sample) {
                return None;
            }
            let ray = camera.ray(line, sample);
            let (from_m, direction) = (ray.position_m, ray.direction());
            let ground_m = if let Some(radii_m) = &radii_m {
                meets_sphere(&from_m, &direction, radii_m[row])?
            } else {
                let from = Position::<BodyFixed>::new(from_m);
                ray_meets_ellipsoid(self.body.model(), &from, &direction)?.xyz_m
            };
            let ground = Spherical::from_xyz_m(&ground_m);
            let degrees = |angle_rad: f64| angle_rad / RADIANS_PER_DEGREE;
            Some([
                degrees(ground.longitude_rad),
                degrees(ground.latitude.0),
                ground_m.norm(),
            ])
        };
        let ground: Vec<[f64; 3]> = py.detach(|| {
            let rows = (0..pixels[0].len()).into_par_iter();
            rows.map(|row| meet(row).unwrap_or([f64::NAN; 3])).collect()
        });
        let column = |of: usize| numbers(ground.iter().map(|point| point[of]).collect());
        Columns::of([
            ("longitude_deg", column(0)),
            ("latitude_deg", column(1)),
            ("radius_m", column(2)),
        ])
    }

    /// Time, position and attitude at lines: ET seconds; body-fixed metres; quaternion from camera to body, scalar first.
    fn poses(&self, py: Python<'_>, line: &Bound<'_, PyAny>) -> PyResult<Columns> {
        let [lines] = arrays(py, ["line"], [line])?;
        let camera = &self.camera.camera;
        let poses: Vec<[f64; 8]> = lines
            .iter()
            .map(|line| {
                let pose = camera
                    .orientation
                    .pose(camera.line_times.offset_of_line(*line));
                let to_body = Rotation3::from_matrix_unchecked(pose.mars_to_camera.transpose());
                let turn = UnitQuaternion::from_rotation_matrix(&to_body);
                let [x_m, y_m, z_m] = pose.position_m.into();
                let et_s = camera.line_times.et(*line).seconds();
                [et_s, x_m, y_m, z_m, turn.w, turn.i, turn.j, turn.k]
            })
            .collect();
        let names = ["et_s", "x_m", "y_m", "z_m", "q_w", "q_x", "q_y", "q_z"];
        let columns = names.into_iter().enumerate();
        Columns::of(
            columns.map(|(of, name)| (name, numbers(poses.iter().map(|pose| pose[of]).collect()))),
        )
    }
}

/// The first point of a ray on a sphere around the centre of the body.
fn meets_sphere(
    from_m: &Vector3<f64>,
    direction: &Vector3<f64>,
    radius_m: f64,
) -> Option<Vector3<f64>> {
    let along_m = -from_m.dot(direction);
    let square_m2 = radius_m * radius_m - (from_m.norm_squared() - along_m * along_m);
    let away_m = along_m - square_m2.sqrt();
    // Written so that NaN is rejected too.
    (radius_m > 0.0 && away_m > 0.0).then(|| from_m + away_m * direction)
}
