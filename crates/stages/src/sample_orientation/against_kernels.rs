//! Support data of an image against kernels that are loaded beside them: two statements of one orientation.

use nalgebra::Vector3;

use crate::{
    orientation::{Camera, CameraReader, CameraTables, Nodes},
    tag_times::ImageTimes,
};
use areograph_base::{body::Body, error::Result, units::METRES_PER_KM};
use areograph_config::{KernelsConfig, PointingConfig, all_instruments};
use areograph_geom::{ellipsoid::range_to_ellipsoid_m, light_time::LightTime};
use areograph_spice::{KernelRole, KernelView};

/// Boresights may differ by this much, radians: four times the 0.4 mrad to which attitudes are known a priori, so that
/// adjusted support data remain within it.
const BORESIGHT_RAD: f64 = 1.6e-3;
/// Positions may differ by this much, metres: four times the 50 m between families of orbits.
const POSITION_M: f64 = 200.0;

/// The contradiction of the support data of `image` with `kernels`, in the middle of the image; `None` where they agree,
/// and where the kernels do not contain position and attitude of its spacecraft at that time.
///
/// The camera is the built-in one with the NAIF numbers of the file. Support data do not state their convention for light
/// time: the one that agrees best counts.
pub(super) fn contradiction(
    image: &ImageTimes,
    kernels: &KernelView,
    coverage: &KernelsConfig,
    pointing: &PointingConfig,
) -> Result<Option<String>> {
    let Some(support) = image.support.as_ref() else {
        return Ok(None);
    };
    let mut cameras = all_instruments().iter();
    let camera = cameras.find(|of| {
        let naif = &image.instrument.naif;
        of.naif.instrument == naif.instrument && support.is_of(of.spacecraft)
    });
    let has = |role| {
        let kernels = kernels.kernels();
        kernels.is_some_and(|of| of.kernels().iter().any(|kernel| kernel.role == role))
    };
    let Some(camera) =
        camera.filter(|_| image.body == Body::Mars && has(KernelRole::Spk) && has(KernelRole::Ck))
    else {
        return Ok(None);
    };
    let session = kernels.session()?.of(camera.spacecraft);
    let middle = image.middle();
    let own = Nodes::new(&CameraTables::of_support(&support.tables)).camera(middle);
    let of_convention = |light_time| {
        let reader = CameraReader {
            session: &session,
            instrument: camera,
            bias: pointing.bias_of(camera),
            tolerance_s: coverage.ck_tolerance_s,
            light_time,
        };
        // Kernels that do not cover the image state nothing of it.
        reader.camera(middle).ok()
    };
    let conventions = LightTime::WORDS.into_iter();
    let cameras = conventions.filter_map(|(_, light_time)| of_convention(light_time));
    let differences = cameras.map(|of_kernels| Difference::of(&own, &of_kernels));
    let nearest = differences.min_by(|a, b| a.position_m.total_cmp(&b.position_m));
    Ok(nearest.and_then(|of| of.contradiction(&own, image.body)))
}

/// Difference of two cameras.
struct Difference {
    position_m: f64,
    boresight_rad: f64,
}

impl Difference {
    fn of(one: &Camera, other: &Camera) -> Self {
        let [first, second] = [one, other].map(|camera| camera.to_mars.matrix() * Vector3::z());
        Self {
            position_m: one.position.distance_m(&other.position),
            boresight_rad: first.cross(&second).norm().atan2(first.dot(&second)),
        }
    }

    fn contradiction(&self, own: &Camera, body: Body) -> Option<String> {
        // Written so that NaN contradicts.
        if self.position_m <= POSITION_M && self.boresight_rad <= BORESIGHT_RAD {
            return None;
        }
        let boresight = own.to_mars.matrix() * Vector3::z();
        let range_m = range_to_ellipsoid_m(body.model(), &own.position, &boresight);
        Some(format!(
            "support data and kernels contradict each other in its middle: boresights differ by {:.2} mrad, {:.2} km on the \
             ground, expected at most {:.2} mrad, and positions by {:.0} m, expected at most {POSITION_M} m; check which of \
             them are those of the image, or load no orbit and attitude of its spacecraft",
            1e3 * self.boresight_rad,
            self.boresight_rad * range_m / METRES_PER_KM,
            1e3 * BORESIGHT_RAD,
            self.position_m
        ))
    }
}
