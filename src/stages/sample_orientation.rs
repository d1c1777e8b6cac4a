//! Exterior orientation of an image: position and rotation of the camera at equally spaced epochs.

mod camera_tables;

use std::fmt;

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

use super::tag_times::ImageTimes;
use crate::{
    config::{KernelsConfig, OrientationConfig, PointingConfig},
    constants::MARS_IAU2000,
    error::Result,
    frames::{CameraFrame, J2000, MarsIau2000, Position, Rotation},
    geom::{
        attitude::{OmegaPhiKappa, make_continuous, spice_quaternion},
        ellipsoid::{Spherical, ray_meets_ellipsoid},
        mars_rotation::mars_rotation,
        statistics::largest,
    },
    instruments::Instrument,
    spice::{Attitude, Session},
    time::Et,
};
pub(super) use camera_tables::{Camera, Nodes, check_interpolation};

/// Time between the attitude samples of the mission's C-kernels, seconds: an attitude that is held for
/// longer is not explained by their spacing, and the bus turns by 0.2° meanwhile.
const ATTITUDE_SPACING_S: f64 = 4.0;
/// Intervals of the outline along the image: between two of them the track bends by centimetres.
const OUTLINE_INTERVALS: u32 = 10;

/// Orientation of one image.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Orientation {
    /// Image identifier.
    pub image: String,
    /// Samples over the whole header image, both ends included.
    pub samples: Vec<OrientationSample>,
    /// Outline of the delivered image on the IAU 2000 ellipsoid: along the first pixel's outer edge,
    /// back along the last one's, not closed. `None` when a corner sees no ground.
    pub outline: Option<Vec<GroundPoint>>,
    /// Tables for camera models, in J2000.
    pub tables: CameraTables,
    /// What the reader should know, one sentence each.
    pub notes: Vec<String>,
    /// Why the orientation is not to be trusted; empty when it is valid.
    pub invalid_because: Vec<String>,
}

/// Orientation of the camera at one epoch.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OrientationSample {
    /// Epoch.
    pub et: Et,
    /// Lines from the middle of the header image.
    pub line_offset: f64,
    /// Perspective centre in IAU 2000, metres (geometric: no light time, no aberration).
    pub position_m: [f64; 3],
    /// Rotation camera → IAU 2000, SPICE quaternion (w, x, y, z), continuous over the image.
    pub camera_to_mars: [f64; 4],
    /// The same rotation as ω, φ, κ.
    pub angles: OmegaPhiKappa,
    /// Where the boresight meets the IAU 2000 ellipsoid, if it does.
    pub boresight: Option<BoresightGround>,
}

/// A point on the ellipsoid.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct GroundPoint {
    /// East longitude, radians.
    pub longitude_rad: f64,
    /// Areocentric latitude, radians.
    pub latitude_rad: f64,
}

/// Ground point of the camera's boresight on the ellipsoid.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct BoresightGround {
    /// East longitude, radians.
    pub longitude_rad: f64,
    /// Areocentric latitude, radians.
    pub latitude_rad: f64,
    /// Distance from the camera, metres.
    pub range_m: f64,
    /// Angle at the ground between the ellipsoid's normal and the camera, radians.
    pub emission_rad: f64,
}

/// Uniform tables from a little before to a little after the image, as camera models want them.
///
/// Positions carry light time and stellar aberration (`LT+S`), as the tables of ISIS and ALE do.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CameraTables {
    /// Epochs, ET seconds.
    pub et_s: Vec<f64>,
    /// Mars to spacecraft, J2000, LT+S, metres.
    pub position_m: Vec<[f64; 3]>,
    /// Velocity, metres per second.
    pub velocity_m_s: Vec<[f64; 3]>,
    /// Mars to Sun, J2000, LT+S, metres, at the first and the last epoch.
    pub sun_position_m: [[f64; 3]; 2],
    /// Velocity of the Sun from Mars, metres per second, at the same epochs.
    pub sun_velocity_m_s: [[f64; 3]; 2],
    /// J2000 → bus, read with the pointing bias, (w, x, y, z), continuous.
    pub inertial_to_bus: Vec<[f64; 4]>,
    /// Angular velocity of the bus in J2000, radians per second.
    pub bus_angular_velocity_rad_s: Vec<[f64; 3]>,
    /// J2000 → IAU 2000, (w, x, y, z), continuous.
    pub inertial_to_mars: Vec<[f64; 4]>,
    /// Angular velocity of Mars in J2000, radians per second.
    pub mars_angular_velocity_rad_s: Vec<[f64; 3]>,
    /// Bus → camera by rows.
    pub bus_to_camera: [[f64; 3]; 3],
    /// How well the tables are interpolated over the image.
    pub interpolation: InterpolationCheck,
}

/// Interpolation between the nodes of [`CameraTables`], as camera models do it, against the kernels.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct InterpolationCheck {
    /// Largest distance between what both see of the same ground, image pixels.
    pub error_max_px: f64,
    /// Epochs that were compared.
    pub epochs: usize,
}

impl InterpolationCheck {
    /// Largest error that tables should have, image pixels: tables with more get more nodes.
    pub const LIMIT_PX: f64 = 0.01;

    /// Whether the error is below the limit.
    #[must_use]
    pub fn keeps_limit(&self) -> bool {
        self.error_max_px < Self::LIMIT_PX
    }
}

/// Samples the orientation of `image`.
///
/// Position and Mars rotation are those of the exposure; attitude is read where the pointing bias
/// says. `R(camera → Mars) = R(J2000 → Mars) · R(J2000 → bus)ᵀ · R(bus → camera)ᵀ`.
///
/// # Errors
/// Kernels that do not cover the image with its padding; the gap is named.
/// # Source
/// Shan et al. 2005, p. 99 (30 intervals) and eq. 1.
pub fn sample_orientation(
    session: &Session,
    image: &ImageTimes,
    kernels: &KernelsConfig,
    pointing: &PointingConfig,
    sampling: &OrientationConfig,
) -> Result<Orientation> {
    require_coverage(session, image, kernels, pointing)?;
    let reader = Reader {
        session,
        instrument: &image.instrument,
        pointing,
        tolerance_s: kernels.ck_tolerance_s,
    };
    let step_s = image.duration_s() / f64::from(sampling.intervals);
    let epochs = (0..=sampling.intervals).map(|k| image.start.plus(f64::from(k) * step_s));
    let epochs: Vec<Et> = epochs.collect();
    let samples = samples_at(image, &epochs, |et| reader.camera(et))?;
    let tables = camera_tables::camera_tables(&reader, image, kernels.padding_s)?;
    let nodes: Vec<Et> = tables.et_s.iter().copied().map(Et::from_seconds).collect();
    let held = reader.held_attitudes(epochs.iter().chain(&nodes))?;
    let far = held.as_ref().filter(|held| held.is_unexplained());
    Ok(Orientation {
        image: image.id.clone(),
        samples,
        outline: outline(image, |et| reader.camera(et))?,
        tables,
        invalid_because: far.map(HeldAttitudes::reason).into_iter().collect(),
        notes: held.iter().map(ToString::to_string).collect(),
    })
}

/// Attitudes that were read outside the C-kernels' intervals, where their last or next one is held.
struct HeldAttitudes {
    lookups: usize,
    of: usize,
    distance_max_s: f64,
}

impl HeldAttitudes {
    fn is_unexplained(&self) -> bool {
        // Written so that NaN counts.
        !(self.distance_max_s <= ATTITUDE_SPACING_S)
    }

    fn reason(&self) -> String {
        format!(
            "attitude held for up to {:.3} s beyond the C-kernels; limit {ATTITUDE_SPACING_S} s, the time between \
             their samples",
            self.distance_max_s
        )
    }
}

impl fmt::Display for HeldAttitudes {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            formatter,
            "{} of {} attitudes lie outside the C-kernels' intervals, up to {:.3} s; within \
             kernels.ck_tolerance_s the nearest one is held, though the bus turns",
            self.lookups, self.of, self.distance_max_s
        )
    }
}

/// Checks that position and attitude are covered over the image with its padding.
///
/// What is asked is what will be read: attitude at the exposures shifted by the pointing bias.
///
/// # Errors
/// A gap, named with its ends and the kernels beside it.
fn require_coverage(
    session: &Session,
    image: &ImageTimes,
    kernels: &KernelsConfig,
    pointing: &PointingConfig,
) -> Result<()> {
    let exposures = image.exposures();
    session.require_position(exposures.padded(kernels.padding_s))?;
    let (padding_s, tolerance_s) = (kernels.padding_s, kernels.ck_tolerance_s);
    session.require_attitude(exposures, pointing.ck_bias, padding_s, tolerance_s)
}

struct Reader<'a> {
    session: &'a Session,
    instrument: &'a Instrument,
    pointing: &'a PointingConfig,
    tolerance_s: f64,
}

impl Reader<'_> {
    fn attitude(&self, exposure: Et) -> Result<Attitude> {
        let lookup = self.pointing.ck_bias.lookup(exposure);
        self.session.attitude(lookup, exposure, self.tolerance_s)
    }

    /// How many of the attitudes at `exposures` lie outside the C-kernels' intervals, if any do.
    fn held_attitudes<'e>(
        &self,
        exposures: impl Iterator<Item = &'e Et>,
    ) -> Result<Option<HeldAttitudes>> {
        let distances_s = exposures
            .map(|exposure| Ok(self.attitude(*exposure)?.distance_s))
            .collect::<Result<Vec<f64>>>()?;
        let lookups = distances_s.iter().filter(|s| !(**s <= 0.0)).count();
        Ok((lookups > 0).then(|| HeldAttitudes {
            lookups,
            of: distances_s.len(),
            distance_max_s: largest(distances_s.iter().copied()).unwrap_or_default(),
        }))
    }

    fn inertial_to_camera(&self, exposure: Et) -> Result<Rotation<J2000, CameraFrame>> {
        let attitude = self.attitude(exposure)?;
        let mounting = self.session.mounting(self.instrument, exposure)?;
        Ok(mounting * attitude.inertial_to_bus)
    }

    /// Geometric position in IAU 2000 and the rotation from the camera to it.
    fn camera(&self, et: Et) -> Result<Camera> {
        let to_mars = mars_rotation::<MarsIau2000>(et);
        let position = to_mars.apply(&self.session.state(et)?.position);
        let camera_to_mars = to_mars * self.inertial_to_camera(et)?.inverse();
        Ok((position.xyz_m, *camera_to_mars.matrix()))
    }
}

impl OrientationSample {
    pub(super) fn new(image: &ImageTimes, et: Et, (position_m, camera_to_mars): &Camera) -> Self {
        Self {
            et,
            line_offset: image.line_offset(et),
            position_m: (*position_m).into(),
            camera_to_mars: spice_quaternion(camera_to_mars),
            angles: OmegaPhiKappa::from_camera_to_mars(camera_to_mars),
            boresight: boresight_ground(&Position::new(*position_m), camera_to_mars),
        }
    }
}

/// Samples with the camera that `camera` gives for their epochs; quaternions are continuous.
pub(super) fn samples_at(
    image: &ImageTimes,
    epochs: &[Et],
    camera: impl Fn(Et) -> Result<Camera>,
) -> Result<Vec<OrientationSample>> {
    let mut samples = epochs
        .iter()
        .map(|epoch| Ok(OrientationSample::new(image, *epoch, &camera(*epoch)?)))
        .collect::<Result<Vec<_>>>()?;
    let mut quaternions: Vec<[f64; 4]> = samples.iter().map(|s| s.camera_to_mars).collect();
    make_continuous(&mut quaternions);
    for (sample, quaternion) in samples.iter_mut().zip(quaternions) {
        sample.camera_to_mars = quaternion;
    }
    Ok(samples)
}

/// Outline of the delivered lines and samples, seen by the camera that `camera` gives for an instant.
pub(super) fn outline(
    image: &ImageTimes,
    camera: impl Fn(Et) -> Result<Camera>,
) -> Result<Option<Vec<GroundPoint>>> {
    let duration_s = f64::from(image.lines_delivered) * image.line_period_s;
    let step_s = duration_s / f64::from(OUTLINE_INTERVALS);
    let (mut first_edge, mut last_edge) = (Vec::new(), Vec::new());
    for k in 0..=OUTLINE_INTERVALS {
        let (position_m, camera_to_mars) = camera(image.start.plus(f64::from(k) * step_s))?;
        let position = Position::new(position_m);
        let [first, last] = swath_directions(image).map(|direction| {
            let ground = ray_meets_ellipsoid(&position, &(camera_to_mars * direction));
            ground.map(|ground| GroundPoint::of(&ground))
        });
        let (Some(first), Some(last)) = (first, last) else {
            return Ok(None);
        };
        first_edge.push(first);
        last_edge.push(last);
    }
    let back = last_edge.into_iter().rev();
    Ok(Some(first_edge.into_iter().chain(back).collect()))
}

impl GroundPoint {
    fn of(ground: &Position<MarsIau2000>) -> Self {
        let coordinates = Spherical::from_xyz_m(&ground.xyz_m);
        Self {
            longitude_rad: coordinates.longitude_rad,
            latitude_rad: coordinates.latitude.0,
        }
    }
}

/// Where the outer edges of the first and the last sample look, camera frame.
fn swath_directions(image: &ImageTimes) -> [Vector3<f64>; 2] {
    let detector = image.detector();
    [0.0, detector.samples].map(|sample| detector.look(sample))
}

fn boresight_ground(
    position: &Position<MarsIau2000>,
    camera_to_mars: &Matrix3<f64>,
) -> Option<BoresightGround> {
    let boresight = camera_to_mars * Vector3::z();
    let ground = ray_meets_ellipsoid(position, &boresight)?;
    let scale = Vector3::new(
        MARS_IAU2000.equatorial_radius_m.powi(-2),
        MARS_IAU2000.equatorial_radius_m.powi(-2),
        MARS_IAU2000.polar_radius_m.powi(-2),
    );
    let normal = ground.xyz_m.component_mul(&scale);
    let point = GroundPoint::of(&ground);
    Some(BoresightGround {
        longitude_rad: point.longitude_rad,
        latitude_rad: point.latitude_rad,
        range_m: position.distance_m(&ground),
        emission_rad: normal.angle(&-boresight),
    })
}
