//! Images of Shan et al. 2005 from first principles: a circular two-body orbit over a rotating sphere.

use areograph_base::units::RADIANS_PER_DEGREE;
use areograph_geom::{
    attitude::{OmegaPhiKappa, rotation_vector, unwrap_angles},
    body_rotation::frame_rotation_3,
    polynomial::Polynomial,
    pushbroom::{
        EulerPolynomial, FixedPoint, FrameFirst, Limits, Pose, RotationVectorPolynomial,
        VectorPolynomial,
    },
};
use nalgebra::{Matrix3, Rotation3, Unit, Vector3};

/// Gravity parameter of Mars, m³/s².
pub const GRAVITY: f64 = 4.282_837e13;
/// Distance of the spacecraft from the centre of Mars at the sites, metres.
pub const ORBIT_RADIUS_M: f64 = 3_776_300.0;
/// Inclination of the orbit, degrees.
pub const INCLINATION_DEG: f64 = 92.9;
/// Rotation rate of Mars, radians per second.
const MARS_RATE_RAD_S: f64 = 7.088_218e-5;
/// Radius of the ground, metres.
pub const GROUND_RADIUS_M: f64 = 3_395_800.0;
/// Focal length over the detector's pitch, as in the papers (3500 mm, 13 µm).
const FOCAL_LENGTH_DETECTORS: f64 = 3_500.0 / 0.013;

/// Attitude of the camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Held {
    /// Rotating with the orbit, towards nadir.
    Nadir,
    /// Fixed inertially, this many degrees to the side.
    Inertial { roll_deg: f64 },
}

/// Termination of the published iterations: the papers' tolerance.
pub const PAPER: Limits = Limits {
    tolerance_lines: 0.1,
    steps_max: 100,
};

/// Cost of the published iterations on some points.
#[derive(Debug, Clone, Copy)]
pub struct Iterations {
    /// Mean evaluations of the frame-first iteration.
    pub frame_first: f64,
    /// Mean evaluations of the fixed point.
    pub fixed_point: f64,
    /// Largest difference of their lines.
    pub apart_lines: f64,
}

/// One image.
#[derive(Debug, Clone, Copy)]
pub struct Scene {
    pub latitude_deg: f64,
    pub longitude_deg: f64,
    pub lines: u32,
    pub duration_s: f64,
    pub summing: f64,
    pub held: Held,
}

/// Gusev, E02-00665.
pub const GUSEV: Scene = Scene {
    latitude_deg: -14.6,
    longitude_deg: 175.3,
    lines: 10_496,
    duration_s: 15.179,
    summing: 2.0,
    held: Held::Nadir,
};

/// Eos, E02-02855.
pub const EOS_NADIR: Scene = Scene {
    latitude_deg: -13.4,
    longitude_deg: -41.65,
    lines: 9_856,
    duration_s: 17.818,
    summing: 3.0,
    held: Held::Nadir,
};

/// Eos, E04-01275.
pub const EOS_OBLIQUE: Scene = Scene {
    latitude_deg: -13.4,
    longitude_deg: -44.05,
    lines: 8_064,
    duration_s: 9.719,
    summing: 2.0,
    held: Held::Inertial { roll_deg: 16.1 },
};

impl Scene {
    /// Focal length in image pixels.
    pub fn focal_length_px(&self) -> f64 {
        FOCAL_LENGTH_DETECTORS / self.summing
    }

    /// Half the width of the image, pixels: 2048 detectors.
    pub fn half_swath_px(&self) -> f64 {
        1_024.0 / self.summing
    }

    pub fn line_period_s(&self) -> f64 {
        self.duration_s / f64::from(self.lines)
    }

    /// Outward, forward and out of the orbit's plane, inertial, `at_s` seconds from the middle.
    fn orbit_axes(&self, at_s: f64) -> [Vector3<f64>; 3] {
        let (latitude, longitude) = (
            self.latitude_deg * RADIANS_PER_DEGREE,
            self.longitude_deg * RADIANS_PER_DEGREE,
        );
        let up = Vector3::new(
            latitude.cos() * longitude.cos(),
            latitude.cos() * longitude.sin(),
            latitude.sin(),
        );
        let east = Vector3::z().cross(&up).normalize();
        let north = up.cross(&east);
        let sin_azimuth = (INCLINATION_DEG * RADIANS_PER_DEGREE).cos() / latitude.cos();
        let forward = north * (1.0 - sin_azimuth * sin_azimuth).sqrt() + east * sin_azimuth;
        let angle = (GRAVITY / ORBIT_RADIUS_M.powi(3)).sqrt() * at_s;
        let (sin, cos) = angle.sin_cos();
        [
            up * cos + forward * sin,
            forward * cos - up * sin,
            up.cross(&forward),
        ]
    }

    /// The exact pose `at_s` seconds from the middle of the image.
    pub fn pose(&self, at_s: f64) -> Pose {
        let to_fixed = frame_rotation_3(MARS_RATE_RAD_S * at_s);
        let [up, ..] = self.orbit_axes(at_s);
        // The camera flies along its −X and looks along +Z.
        let to_camera = |[up, forward, normal]: [Vector3<f64>; 3]| {
            Matrix3::from_rows(&[-forward.transpose(), normal.transpose(), -up.transpose()])
        };
        let inertial_to_camera = match self.held {
            Held::Nadir => to_camera(self.orbit_axes(at_s)),
            Held::Inertial { roll_deg } => {
                let axis = Unit::new_normalize(Vector3::x());
                let roll = Rotation3::from_axis_angle(&axis, roll_deg * RADIANS_PER_DEGREE);
                roll.matrix() * to_camera(self.orbit_axes(0.0))
            }
        };
        Pose {
            position_m: to_fixed * (up * ORBIT_RADIUS_M),
            mars_to_camera: inertial_to_camera * to_fixed.transpose(),
        }
    }

    /// Intersection of the boresight with the ground `at_s` seconds from the middle.
    pub fn boresight_ground_m(&self, at_s: f64) -> Vector3<f64> {
        let pose = self.pose(at_s);
        let ray = pose.mars_to_camera.row(2).transpose();
        let towards = pose.position_m.dot(&ray);
        let depth = towards * towards - pose.position_m.norm_squared() + GROUND_RADIUS_M.powi(2);
        pose.position_m + ray * (-towards - depth.sqrt())
    }

    /// `count` ground points under the boresight about the middle of the image, `spacing_m` apart.
    pub fn profile_m(&self, count: u32, spacing_m: f64) -> Vec<Vector3<f64>> {
        let speed_m_s = (self.boresight_ground_m(0.5) - self.boresight_ground_m(-0.5)).norm();
        (0..count)
            .map(|shot| {
                let from_middle = f64::from(shot) - 0.5 * f64::from(count - 1);
                self.boresight_ground_m(from_middle * spacing_m / speed_m_s)
            })
            .collect()
    }

    /// Both iterations of second order, on points that both find.
    pub fn iterations(&self, points_m: &[Vector3<f64>], limits: &Limits) -> Iterations {
        let model = self.euler(2);
        let frame_first = FrameFirst::new(&model, self.focal_length_px()).unwrap();
        let fixed_point = FixedPoint::new(&model, self.focal_length_px()).unwrap();
        let (mut a, mut b, mut apart_lines) = (0, 0, 0.0_f64);
        for point in points_m {
            let by_a = frame_first.solve(point, limits, |_| {}).unwrap();
            let by_b = fixed_point.solve(point, limits, |_| {}).unwrap();
            a += by_a.evaluations;
            b += by_b.evaluations;
            apart_lines = apart_lines.max((by_a.x - by_b.x).abs());
        }
        let count = points_m.len() as f64;
        Iterations {
            frame_first: f64::from(a) / count,
            fixed_point: f64::from(b) / count,
            apart_lines,
        }
    }

    /// Residuals of polynomials through the samples' positions, root mean square, metres.
    pub fn position_rmse_m(&self, order: usize) -> Vector3<f64> {
        let samples = self.samples();
        let x: Vec<f64> = samples.iter().map(|sample| sample.0).collect();
        Vector3::from_fn(|axis, _| {
            let y: Vec<f64> = samples.iter().map(|s| s.1.position_m[axis]).collect();
            Polynomial::fit(&x, &y, order).unwrap().rmse
        })
    }

    /// Poses at the 31 instants of the paper.
    pub fn samples(&self) -> Vec<(f64, Pose)> {
        (0..=30)
            .map(|k| {
                let share = f64::from(k) / 30.0 - 0.5;
                (
                    share * f64::from(self.lines),
                    self.pose(share * self.duration_s),
                )
            })
            .collect()
    }

    fn fitted(
        &self,
        order: usize,
        values: impl Fn(&[(f64, Pose)], usize) -> Vec<f64>,
    ) -> VectorPolynomial {
        let samples = self.samples();
        let x: Vec<f64> = samples.iter().map(|sample| sample.0).collect();
        let fits = [0, 1, 2].map(|axis| {
            let fit = Polynomial::fit(&x, &values(&samples, axis), order).unwrap();
            fit.polynomial
        });
        VectorPolynomial::of([&fits[0], &fits[1], &fits[2]])
    }

    fn path_m(&self, order: usize) -> VectorPolynomial {
        self.fitted(order, |samples, axis| {
            samples.iter().map(|s| s.1.position_m[axis]).collect()
        })
    }

    /// The model of the papers, fitted to the samples.
    pub fn euler(&self, order: usize) -> EulerPolynomial {
        let angles = |samples: &[(f64, Pose)], axis: usize| {
            let mut angles: Vec<f64> = samples
                .iter()
                .map(|(_, pose)| {
                    let camera_to_mars = pose.mars_to_camera.transpose();
                    let angles = OmegaPhiKappa::from_camera_to_mars(&camera_to_mars);
                    [angles.omega_rad, angles.phi_rad, angles.kappa_rad][axis]
                })
                .collect();
            unwrap_angles(&mut angles);
            angles
        };
        EulerPolynomial {
            path_m: self.path_m(order),
            angles_rad: self.fitted(order, angles),
        }
    }

    /// The model without gimbal lock.
    pub fn rotation_vector(&self) -> RotationVectorPolynomial {
        let reference = self.samples()[15].1.mars_to_camera;
        RotationVectorPolynomial {
            path_m: self.path_m(2),
            vector_rad: self.fitted(2, |samples, axis| {
                samples
                    .iter()
                    .map(|s| rotation_vector(&(s.1.mars_to_camera * reference.transpose()))[axis])
                    .collect()
            }),
            reference,
        }
    }
}
