//! Tables of an orientation for camera models, and the interpolation between their nodes.

use nalgebra::{Matrix3, Vector3, Vector4};
use serde::{Deserialize, Serialize};

use areograph_base::{
    body::Body,
    frames::{BodyFixed, CameraFrame, J2000, Position, Rotation, SpacecraftBus},
    time::Et,
};
use areograph_geom::{
    attitude::{continuous_quaternions, matrix_of_spice_quaternion},
    body_rotation::spin_rad_s,
    lagrange::lagrange,
};

/// Uniform tables from a little before to a little after the image, as camera models require.
///
/// Positions follow the same convention as the samples, see [`super::LightTimeEffect`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CameraTables {
    /// Epochs, ET seconds.
    pub et_s: Vec<f64>,
    /// Mars to the spacecraft, from where straight rays start, J2000, metres.
    pub position_m: Vec<Vector3<f64>>,
    /// Velocity, metres per second.
    pub velocity_m_s: Vec<Vector3<f64>>,
    /// Mars to Sun, J2000, LT+S, metres, at the first and the last epoch.
    pub sun_position_m: [Vector3<f64>; 2],
    /// Velocity of the Sun from Mars, metres per second, at the same epochs.
    pub sun_velocity_m_s: [Vector3<f64>; 2],
    /// J2000 → bus, read with the pointing bias.
    pub inertial_to_bus: Vec<Rotation<J2000, SpacecraftBus>>,
    /// Angular velocity of the bus in J2000, radians per second.
    pub bus_angular_velocity_rad_s: Vec<Vector3<f64>>,
    /// J2000 → body-fixed, for the ground that is seen.
    pub inertial_to_mars: Vec<Rotation<J2000, BodyFixed>>,
    /// Angular velocity of Mars in J2000, radians per second.
    pub mars_angular_velocity_rad_s: Vec<Vector3<f64>>,
    /// Bus → camera, at the first epoch.
    pub bus_to_camera: Rotation<SpacecraftBus, CameraFrame>,
    /// Interpolation error of the tables over the image.
    pub interpolation: InterpolationCheck,
}

/// Interpolation between the nodes of [`CameraTables`], as camera models do it, against the kernels.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct InterpolationCheck {
    /// Largest distance between the image coordinates of the same ground by both, image pixels.
    pub error_max_px: f64,
    /// Epochs that were compared; 0 for tables of support data, which have no reference.
    pub epochs: usize,
}

impl CameraTables {
    /// Spin of a body in J2000: its rate along its pole (the pole's own motion is 1e-14 rad/s).
    pub(crate) fn spin_rad_s(body: Body, inertial_to_body: &Matrix3<f64>) -> Vector3<f64> {
        inertial_to_body.tr_mul(&spin_rad_s(body.model()))
    }

    /// The tables without their nodes, which occupy most of the memory of an image.
    #[must_use]
    pub fn without_nodes(&self) -> Self {
        Self {
            et_s: Vec::new(),
            position_m: Vec::new(),
            velocity_m_s: Vec::new(),
            inertial_to_bus: Vec::new(),
            bus_angular_velocity_rad_s: Vec::new(),
            inertial_to_mars: Vec::new(),
            mars_angular_velocity_rad_s: Vec::new(),
            ..*self
        }
    }
}

impl InterpolationCheck {
    /// Largest acceptable error of tables, image pixels: tables with a larger one get more nodes.
    pub const LIMIT_PX: f64 = 0.01;

    /// Whether the error is below the limit.
    #[must_use]
    pub fn keeps_limit(&self) -> bool {
        self.error_max_px < Self::LIMIT_PX
    }
}

/// Position and rotation of the camera at one instant.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Camera {
    /// Perspective centre.
    pub(crate) position: Position<BodyFixed>,
    /// Rotation to the axes of Mars.
    pub(crate) to_mars: Rotation<CameraFrame, BodyFixed>,
}

/// The nodes as a camera model uses them: rotated to Mars first, then interpolated.
pub(crate) struct Nodes {
    start_s: f64,
    step_s: f64,
    position_m: Vec<Vector3<f64>>,
    /// Quaternions (w, x, y, z), continuous.
    camera_to_mars: Vec<Vector4<f64>>,
}

impl Nodes {
    /// Nodes of `tables`, which hold two or more.
    pub(crate) fn new(tables: &CameraTables) -> Self {
        let bus_to_camera = tables.bus_to_camera.matrix();
        let rotations = || tables.inertial_to_mars.iter().map(Rotation::matrix);
        let camera_to_mars: Vec<Matrix3<f64>> = rotations()
            .zip(&tables.inertial_to_bus)
            .map(|(to_mars, to_bus)| to_mars * (bus_to_camera * to_bus.matrix()).transpose())
            .collect();
        let quaternions = continuous_quaternions(&camera_to_mars).into_iter();
        let last = tables.et_s.len() - 1;
        Self {
            start_s: tables.et_s[0],
            step_s: (tables.et_s[last] - tables.et_s[0]) / last as f64,
            position_m: rotations()
                .zip(&tables.position_m)
                .map(|(to_mars, position_m)| to_mars * position_m)
                .collect(),
            camera_to_mars: quaternions.map(Vector4::from).collect(),
        }
    }

    /// The camera between the nodes.
    pub(crate) fn camera(&self, et: Et) -> Camera {
        let at = (et.seconds() - self.start_s) / self.step_s;
        camera(
            lagrange(&self.position_m, at),
            lagrange(&self.camera_to_mars, at),
            et,
        )
    }

    /// The camera of every node.
    pub(super) fn cameras(&self) -> impl Iterator<Item = Camera> {
        let nodes = self.position_m.iter().zip(&self.camera_to_mars);
        nodes.enumerate().map(|(node, (position_m, to_mars))| {
            let et_s = self.start_s + node as f64 * self.step_s;
            camera(*position_m, *to_mars, Et::from_seconds(et_s))
        })
    }

    /// Every second node, from the first or the second on.
    pub(super) fn every_second(&self, first: usize) -> Self {
        fn half<T: Copy>(all: &[T], first: usize) -> Vec<T> {
            all.iter().skip(first).step_by(2).copied().collect()
        }
        Self {
            start_s: self.start_s + first as f64 * self.step_s,
            step_s: 2.0 * self.step_s,
            position_m: half(&self.position_m, first),
            camera_to_mars: half(&self.camera_to_mars, first),
        }
    }
}

fn camera(position_m: Vector3<f64>, to_mars: Vector4<f64>, et: Et) -> Camera {
    Camera {
        position: Position::new(position_m),
        to_mars: Rotation::new(matrix_of_spice_quaternion(to_mars.into()), et),
    }
}
