//! Stereo lines of a camera over undulating ground, in a circular orbit: true geometry and support data.

use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};
use serde_json::{Value, json};

use areograph_base::{body::MARS_IAU2000, time::Et, units::METRES_PER_KM};
use areograph_geom::{
    attitude::continuous_quaternions,
    body_rotation::{body_matrix, spin_rad_s},
    calibration::{LineCamera, Offset},
};

/// Lines of a long image, and samples of a full line.
pub(super) const LONG: [u32; 2] = [20_000, 2_584];
/// Focal length and pixel of the HRSC, millimetres, pixels summed by two.
const FOCAL_MM: f64 = 175.0;
const PIXEL_MM: f64 = 0.014;
/// Line on the ground, metres.
const LINE_M: f64 = 27.0;
/// Height of the orbit, radius of the sphere under it, metres.
const HEIGHT_M: f64 = 350_000.0;
const SPHERE_M: f64 = 3_396_000.0;
/// Gravity of Mars, m³/s².
const GRAVITY_M3_S2: f64 = 4.282_837e13;
/// Waves of the ground: height and length, metres.
const WAVES: [[f64; 2]; 2] = [[600.0, 83_000.0], [300.0, 31_000.0]];
/// Nodes of the tables: a second apart, from a few seconds before to a few seconds after the image.
const NODE_S: f64 = 1.0;
const AROUND_S: f64 = 5.0;
/// Distance of the Sun, which has no effect here, metres.
const SUN_M: f64 = 2.2e11;
/// Steps in the search for the image coordinates.
const STEPS: usize = 20;

/// A line of the camera.
pub(super) struct StereoLine {
    /// Its name.
    pub(super) name: &'static str,
    /// Forward pitch in the laboratory geometry.
    pub(super) pitch_deg: f64,
    /// Its true mounting.
    pub(super) offset: Offset,
    /// Differences of the look angles from the laboratory's, at the last sample: of m₁, n₁ and n₂.
    pub(super) errors: [f64; 3],
}

/// Errors of the support data of an orbit, Mars-fixed.
pub(super) struct OrbitError {
    /// Metres.
    pub(super) bias_m: [f64; 3],
    /// Metres per line period from the middle.
    pub(super) drift_m_per_line: [f64; 3],
}

impl OrbitError {
    fn at(&self, after_lines: f64) -> Vector3<f64> {
        Vector3::from(self.bias_m) + Vector3::from(self.drift_m_per_line) * after_lines
    }
}

/// An orbit over one stretch of ground.
pub(super) struct Orbit {
    pub(super) name: String,
    /// Time of the pass over the middle of the stretch, ET seconds.
    pub(super) start_et_s: f64,
    /// East longitude and latitude of the middle.
    pub(super) longitude_deg: f64,
    pub(super) latitude_deg: f64,
    /// Lines and samples of its images.
    pub(super) size: [u32; 2],
    /// Whether the spacecraft is yawed to compensate for the rotation of the ground: lines minutes apart then see the
    /// same ground also with a narrow swath.
    pub(super) is_steered: bool,
    /// True minus support data.
    pub(super) error: OrbitError,
}

/// True pose of a line while it is exposed, Mars-fixed.
pub(super) struct TruePose {
    /// Metres.
    pub(super) position_m: Vector3<f64>,
    /// From the camera's own axes.
    pub(super) to_mars: Matrix3<f64>,
}

impl StereoLine {
    /// From the axes across, along and down to the camera: z in the look direction, y along the samples.
    fn mounting(&self) -> Matrix3<f64> {
        let (sin, cos) = self.pitch_deg.to_radians().sin_cos();
        let (y, z) = (Vector3::x(), Vector3::new(0.0, sin, cos));
        Matrix3::from_rows(&[y.cross(&z).transpose(), y.transpose(), z.transpose()])
    }

    /// Tangent of a pixel.
    pub(super) fn pixel() -> f64 {
        PIXEL_MM / FOCAL_MM
    }

    /// Ages the line: a change of roll between lines that look forward and backward, by `roll` tangents, half of it in each; yaw
    /// and scale change by half of this at the edge of the image.
    ///
    /// * `half` – half the samples of a line
    pub(super) fn age(&mut self, roll: f64, half: f64) {
        let sense = if self.pitch_deg == 0.0 {
            0.0
        } else {
            self.pitch_deg.signum()
        };
        self.offset.phi_rad -= sense * 0.5 * roll;
        self.offset.kappa_rad -= sense * 0.25 * roll / (half * Self::pixel());
        self.errors[0] -= sense * 0.25 * roll;
    }

    /// Rotates the line with the spacecraft, degrees about the axes along the flight, across it and down.
    pub(super) fn turn(&mut self, [phi_deg, omega_deg, kappa_deg]: [f64; 3]) {
        self.offset.phi_rad += phi_deg.to_radians();
        self.offset.omega_rad += omega_deg.to_radians();
        self.offset.kappa_rad += kappa_deg.to_radians();
    }

    /// The true line, with `samples` samples.
    pub(super) fn truth(&self, samples: f64) -> LineCamera {
        let (sin, cos) = self.pitch_deg.to_radians().sin_cos();
        let [m1, n1, n2] = self.errors;
        LineCamera {
            offset: self.offset,
            m: vec![0.0, 0.5 * samples * PIXEL_MM / (FOCAL_MM * cos) + m1, 0.0],
            n: vec![sin / cos, n1, n2],
        }
    }
}

/// The axes of the spacecraft, as rows, in those across, along and down.
fn bus_axes() -> Matrix3<f64> {
    Matrix3::new(0.0, 1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 1.0)
}

impl Orbit {
    fn radius_m() -> f64 {
        SPHERE_M + HEIGHT_M
    }

    fn lines(&self) -> f64 {
        f64::from(self.size[0])
    }

    /// Samples of a line.
    pub(super) fn samples(&self) -> f64 {
        f64::from(self.size[1])
    }

    fn rate_rad_s() -> f64 {
        (GRAVITY_M3_S2 / Self::radius_m().powi(3)).sqrt()
    }

    /// Seconds between two lines.
    fn period_s() -> f64 {
        LINE_M / (Self::rate_rad_s() * SPHERE_M)
    }

    /// Position over the middle, along-track direction and orbit normal, J2000.
    fn frame(&self) -> Matrix3<f64> {
        let (sin_lon, cos_lon) = self.longitude_deg.to_radians().sin_cos();
        let (sin_lat, cos_lat) = self.latitude_deg.to_radians().sin_cos();
        let up = Vector3::new(cos_lat * cos_lon, cos_lat * sin_lon, sin_lat);
        let east = Vector3::new(-sin_lon, cos_lon, 0.0);
        // North, slightly against the rotation of Mars, as at an inclination of 87 degrees.
        let along = (up.cross(&east) - 0.05 * east).normalize();
        let to_mars = Self::to_mars(self.start_et_s);
        to_mars.transpose() * Matrix3::from_columns(&[up, along, up.cross(&along)])
    }

    pub(super) fn to_mars(et_s: f64) -> Matrix3<f64> {
        body_matrix(&MARS_IAU2000, Et::from_seconds(et_s))
    }

    /// Position and velocity of the support data, J2000 metres.
    fn state(&self, et_s: f64) -> [Vector3<f64>; 2] {
        let rate_rad_s = Self::rate_rad_s();
        let (sin, cos) = (rate_rad_s * (et_s - self.start_et_s)).sin_cos();
        let frame = self.frame();
        [
            frame * Vector3::new(cos, sin, 0.0) * Self::radius_m(),
            frame * Vector3::new(-sin, cos, 0.0) * (Self::radius_m() * rate_rad_s),
        ]
    }

    /// From J2000 to the axes across the flight, along it and down.
    fn axes(&self, et_s: f64) -> Matrix3<f64> {
        let [position_m, velocity_m_s] = self.state(et_s);
        let of_ground_m_s = if self.is_steered {
            spin_rad_s(&MARS_IAU2000).cross(&position_m)
        } else {
            Vector3::zeros()
        };
        let down = -position_m.normalize();
        let along = (velocity_m_s - of_ground_m_s).normalize();
        Matrix3::from_rows(&[
            along.cross(&down).transpose(),
            along.transpose(),
            down.transpose(),
        ])
    }

    /// Rotation rate of the spacecraft, J2000.
    fn turn_rad_s(&self, et_s: f64) -> Vector3<f64> {
        /// Half the interval over which it is computed, seconds.
        const SIDE_S: f64 = 0.5;
        if !self.is_steered {
            return self.frame().column(2) * Self::rate_rad_s();
        }
        let [before, here, after] = [-SIDE_S, 0.0, SIDE_S].map(|side_s| self.axes(et_s + side_s));
        let skew = (after - before).tr_mul(&here) / (2.0 * SIDE_S);
        Vector3::new(skew[(2, 1)], skew[(0, 2)], skew[(1, 0)])
    }

    /// Exposure time of a line of a camera's image, ET seconds.
    pub(super) fn exposed_s(&self, line: &StereoLine, at_line: f64) -> f64 {
        self.first_s(line) + at_line * Self::period_s()
    }

    /// Exposure time of the first line of a camera's image, whose middle looks at the middle of the stretch.
    fn first_s(&self, line: &StereoLine) -> f64 {
        let ahead_rad = line.pitch_deg.to_radians().tan() * HEIGHT_M / SPHERE_M;
        self.start_et_s - ahead_rad / Self::rate_rad_s() - 0.5 * self.lines() * Self::period_s()
    }

    /// A ground point, Mars-fixed metres: `share` of the way along the stretch, and across it from -1 to 1.
    pub(super) fn ground(&self, share: f64, across: f64) -> Vector3<f64> {
        let along_m = (share - 0.5) * self.lines() * LINE_M;
        let across_m = across * 0.5 * self.samples() * PIXEL_MM / FOCAL_MM * HEIGHT_M;
        let (angle, side) = (along_m / SPHERE_M, across_m / SPHERE_M);
        let [across_axis, along_axis, down] = {
            let axes = self.axes(self.start_et_s);
            [0, 1, 2].map(|row| axes.row(row).transpose())
        };
        let frame = Self::to_mars(self.start_et_s)
            * Matrix3::from_columns(&[-down, along_axis, across_axis]);
        let local = Vector3::new(
            angle.cos() * side.cos(),
            angle.sin() * side.cos(),
            side.sin(),
        );
        let height_m: f64 = WAVES
            .iter()
            .map(|[high_m, long_m]| {
                let phase = std::f64::consts::TAU / long_m;
                high_m * (phase * along_m).sin() * (phase * across_m + 1.0).cos()
            })
            .sum();
        frame * local * (SPHERE_M + height_m)
    }

    /// True pose of a line at a line of its image.
    pub(super) fn true_pose(
        &self,
        line: &StereoLine,
        camera: &LineCamera,
        at_line: f64,
    ) -> TruePose {
        let period_s = Self::period_s();
        let et_s = self.exposed_s(line, at_line);
        let to_mars = Self::to_mars(et_s);
        // The images of all lines are centred on the middle of the stretch.
        let after_lines = (et_s - self.start_et_s) / period_s;
        let to_axes = self.axes(et_s) * to_mars.transpose();
        TruePose {
            position_m: to_mars * self.state(et_s)[0] + self.error.at(after_lines),
            to_mars: to_axes.transpose() * camera.offset.rotation(),
        }
    }

    /// Residual of a ground point seen by a line with a sample: tangents.
    fn missed(
        &self,
        line: &StereoLine,
        camera: &LineCamera,
        at: Vector2<f64>,
        place_m: &Vector3<f64>,
    ) -> Vector2<f64> {
        let pose = self.true_pose(line, camera, at.x);
        let seen = pose.to_mars.tr_mul(&(place_m - pose.position_m));
        seen.xy() / seen.z - camera.tangents(2.0 * at.y / self.samples() - 1.0)
    }

    /// True line and sample of a ground point in a line of the camera; `None` outside the image.
    pub(super) fn sees(&self, line: &StereoLine, place_m: &Vector3<f64>) -> Option<[f64; 2]> {
        let camera = line.truth(self.samples());
        let mut at = Vector2::new(0.5 * self.lines(), 0.5 * self.samples());
        for _ in 0..STEPS {
            let missed = |at: Vector2<f64>| self.missed(line, &camera, at, place_m);
            let by_line = missed(at + Vector2::x()) - missed(at - Vector2::x());
            let by_sample = missed(at + Vector2::y()) - missed(at - Vector2::y());
            let slope = Matrix2::from_columns(&[by_line, by_sample]) * 0.5;
            at -= slope.try_inverse()? * missed(at);
        }
        let inside = (5.0..self.lines() - 5.0).contains(&at.x)
            && (5.0..self.samples() - 5.0).contains(&at.y);
        inside.then(|| at.into())
    }

    /// The support data of a line's image, from the laboratory and the kernels.
    pub(super) fn support_data(&self, line: &StereoLine) -> String {
        let period_s = Self::period_s();
        let first_s = self.first_s(line);
        let half_s = 0.5 * self.lines() * period_s;
        let nodes = ((2.0 * (half_s + AROUND_S)) / NODE_S).ceil();
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "some hundred seconds"
        )]
        let et_s: Vec<f64> = (0..=nodes as u32)
            .map(|node| first_s - AROUND_S + f64::from(node) * NODE_S)
            .collect();
        let bus = et_s.iter().map(|et_s| bus_axes() * self.axes(*et_s));
        let mars = et_s.iter().map(|et_s| Self::to_mars(*et_s));
        let spin = spin_rad_s(&MARS_IAU2000);
        let ends = [et_s[0], et_s[et_s.len() - 1]];
        let states = et_s.iter().map(|et_s| self.state(*et_s));
        let sun = ends.map(|_| [Vector3::x() * SUN_M, Vector3::zeros()]);
        let number = match line.pitch_deg {
            ahead if ahead > 0.0 => -41_211,
            behind if behind < 0.0 => -41_212,
            _ => -41_213,
        };
        let mounting = (line.mounting() * bus_axes().transpose()).transpose();
        let rates: Vec<[f64; 3]> = et_s
            .iter()
            .map(|et_s| self.turn_rad_s(*et_s).into())
            .collect();
        let mut pointing = rotation(&et_s, bus, &rates, -41_000);
        pointing["constant_frames"] = json!([number, -41_000]);
        pointing["constant_rotation"] = json!(mounting.as_slice());
        let document = json!({
            "isis_camera_version": 1,
            "image_identifier": format!("{}_{}", self.name, line.name),
            "image_lines": self.size[0],
            "image_samples": self.size[1],
            "name_platform": "SYNTHETIC ORBITER",
            "name_sensor": format!("STEREO LINE {}", line.name.to_uppercase()),
            "reference_height": {"maxheight": 1_000, "minheight": -1_000, "unit": "m"},
            "name_model": "USGS_ASTRO_LINE_SCANNER_SENSOR_MODEL",
            "interpolation_method": "lagrange",
            "line_scan_rate": [[0.5, -half_s, period_s]],
            "starting_ephemeris_time": first_s,
            "center_ephemeris_time": first_s + half_s,
            "radii": {
                "semimajor": MARS_IAU2000.equatorial_radius_m / METRES_PER_KM,
                "semiminor": MARS_IAU2000.polar_radius_m / METRES_PER_KM,
                "unit": "km",
            },
            "body_rotation": rotation(&et_s, mars, &vec![spin.into(); et_s.len()], 10_014),
            "instrument_pointing": pointing,
            "naif_keywords": {"BODY_CODE": 499},
            "detector_sample_summing": 1,
            "detector_line_summing": 1,
            "focal_length_model": {"focal_length": FOCAL_MM},
            "detector_center": {"line": 0.0, "sample": 0.5 * self.samples()},
            "focal2pixel_lines": [0.0, PIXEL_MM.recip(), 0.0],
            "focal2pixel_samples": [0.0, 0.0, PIXEL_MM.recip()],
            "optical_distortion": {"radial": {"coefficients": [0.0, 0.0, 0.0]}},
            "starting_detector_line": 0,
            "starting_detector_sample": 0,
            "instrument_position": positions(&et_s, states),
            "sun_position": positions(&ends, sun.into_iter()),
        });
        serde_json::to_string(&document).unwrap_or_default() + "\n"
    }
}

fn rotation(
    et_s: &[f64],
    from_j2000: impl Iterator<Item = Matrix3<f64>>,
    rates_rad_s: &[[f64; 3]],
    frame: i32,
) -> Value {
    let matrices: Vec<Matrix3<f64>> = from_j2000.collect();
    let quaternions = continuous_quaternions(matrices.iter());
    json!({
        "time_dependent_frames": [frame, 1],
        "ck_table_start_time": et_s[0],
        "ck_table_end_time": et_s[et_s.len() - 1],
        "ck_table_original_size": et_s.len(),
        "ephemeris_times": et_s,
        "quaternions": quaternions,
        "angular_velocities": rates_rad_s,
        "reference_frame": 1,
    })
}

fn positions(et_s: &[f64], states: impl Iterator<Item = [Vector3<f64>; 2]>) -> Value {
    let km = |of: Vector3<f64>| -> [f64; 3] { (of / METRES_PER_KM).into() };
    let (positions, velocities): (Vec<_>, Vec<_>) = states
        .map(|[position_m, velocity_m_s]| (km(position_m), km(velocity_m_s)))
        .unzip();
    json!({
        "spk_table_start_time": et_s[0],
        "spk_table_end_time": et_s[et_s.len() - 1],
        "spk_table_original_size": et_s.len(),
        "ephemeris_times": et_s,
        "positions": positions,
        "velocities": velocities,
        "reference_frame": 1,
    })
}
