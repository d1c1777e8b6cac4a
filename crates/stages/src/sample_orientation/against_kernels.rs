//! Support data of an image against kernels that are loaded beside them: two statements of one orientation.

use nalgebra::Vector3;

use crate::{
    orientation::{Camera, CameraReader, CameraTables, Nodes},
    tag_times::ImageTimes,
};
use areograph_base::{body::Body, error::Error, units::METRES_PER_KM};
use areograph_config::{KernelsConfig, PointingConfig, all_instruments};
use areograph_geom::{ellipsoid::range_to_ellipsoid_m, light_time::LightTime};
use areograph_spice::{KernelRole, KernelView};

/// Boresights may differ by this much, radians: four times the 0.4 mrad to which attitudes are known a priori, so that
/// adjusted support data remain within it.
const BORESIGHT_RAD: f64 = 1.6e-3;
/// Positions may differ by this much, metres: four times the 50 m between families of orbits.
const POSITION_M: f64 = 200.0;

/// Support data compared with the kernels beside them.
#[derive(Debug, Default)]
pub(super) struct Comparison {
    /// Their contradiction; `None` where they agree, and where they are not compared.
    pub(super) contradiction: Option<String>,
    /// Reason why they are not compared although the kernels hold the spacecraft.
    pub(super) note: Option<String>,
}

impl Comparison {
    /// No comparison: the kernels cannot be read at the time of the image, which is no fault of its support data.
    fn missing(failure: &Error) -> Self {
        Self {
            contradiction: None,
            note: Some(format!(
                "its support data are not compared with the kernels: {}",
                failure.cause
            )),
        }
    }
}

/// Compares the support data of `image` with `kernels` in the middle of the image; kernels without position and
/// attitude of its spacecraft allow no comparison.
///
/// The camera is the built-in one with the NAIF numbers of the file. Support data do not state their convention for light
/// time: the one that agrees best counts.
pub(super) fn compare(
    image: &ImageTimes,
    kernels: &KernelView,
    coverage: &KernelsConfig,
    pointing: &PointingConfig,
) -> Comparison {
    let Some(support) = image.support.as_ref() else {
        return Comparison::default();
    };
    let mut cameras = all_instruments().iter();
    let camera = cameras.find(|camera| {
        let naif = &image.instrument.naif;
        camera.naif.instrument == naif.instrument && support.is_of(camera.spacecraft)
    });
    let has = |role| {
        let kernels = kernels.kernels();
        kernels.is_some_and(|set| set.kernels().iter().any(|kernel| kernel.role == role))
    };
    let Some(camera) =
        camera.filter(|_| image.body == Body::Mars && has(KernelRole::Spk) && has(KernelRole::Ck))
    else {
        return Comparison::default();
    };
    let session = match kernels.session() {
        Ok(session) => session.of(camera.spacecraft),
        Err(failure) => return Comparison::missing(&failure),
    };
    match session.coverage() {
        Ok(held) if held.spk.as_slice().is_empty() || held.ck.as_slice().is_empty() => {
            return Comparison::default();
        }
        Ok(_) => {}
        Err(failure) => return Comparison::missing(&failure),
    }
    let middle = image.middle();
    let own = Nodes::new(&CameraTables::of_support(&support.tables)).camera(middle);
    let mut nearest: Option<Difference> = None;
    let mut failure = None;
    for (_, light_time) in LightTime::WORDS {
        let reader = CameraReader {
            session: &session,
            instrument: camera,
            bias: pointing.bias_of(camera),
            tolerance_s: coverage.ck_tolerance_s,
            light_time,
        };
        match reader.camera(middle) {
            Ok(of_kernels) => {
                let difference = Difference::of(&own, &of_kernels);
                if (nearest.as_ref())
                    .is_none_or(|least| difference.position_m.total_cmp(&least.position_m).is_lt())
                {
                    nearest = Some(difference);
                }
            }
            Err(error) => failure = failure.or(Some(error)),
        }
    }
    match (nearest, failure) {
        (Some(nearest), _) => Comparison {
            contradiction: nearest.contradiction(&own, image.body),
            note: None,
        },
        (None, Some(failure)) => Comparison::missing(&failure),
        (None, None) => Comparison::default(),
    }
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
            "support data and kernels contradict each other in the middle of the image: boresights differ by {:.2} \
             mrad ({:.2} km on the ground; expected at most {:.2} mrad) and positions by {:.0} m (expected at most \
             {POSITION_M} m); check which of the two belongs to the image, or omit the orbit and attitude kernels of \
             its spacecraft",
            1e3 * self.boresight_rad,
            self.boresight_rad * range_m / METRES_PER_KM,
            1e3 * BORESIGHT_RAD,
            self.position_m
        ))
    }
}
