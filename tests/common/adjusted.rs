//! Images of the synthetic mission and the real one, sampled from their kernels.

use std::{path::PathBuf, sync::LazyLock};

use areograph::{
    body::Body,
    body::MARS_IAU2000,
    config::{ImageConfig, KernelsConfig, OrientationConfig, PointingConfig, usual_instrument},
    frames::{BodyFixed, Position},
    geom::{body_rotation::body_matrix, ellipsoid::ray_meets_ellipsoid, light_time::LightTime},
    kernel_source::{KernelList, KernelSource},
    scene::{SceneErrors, SceneOptions, write_scene},
    spice::{KernelSet, Session},
    stages::{
        sample_orientation::{Orientation, sample_orientation},
        tag_times::{ImageTimes, tag_times},
    },
    time::Et,
};
use nalgebra::{Matrix3, Vector3};

use super::{m0402852_files, real_data};

const fn sampling(light_time: LightTime) -> OrientationConfig {
    OrientationConfig {
        intervals: 30,
        light_time,
        position_rmse_max_m: 1.0,
        pointing_rmse_max_rad: 1e-3,
    }
}

/// Days of half an hour: images and windows are all inside.
static MISSION: LazyLock<tempfile::TempDir> = LazyLock::new(|| {
    let folder = tempfile::tempdir().unwrap();
    let options = SceneOptions {
        seed: 5,
        day_s: 1_800.0,
        pairs: 1,
        passes: 0,
        ties: 154,
        ties_at_shots: false,
        errors: SceneErrors::demo(),
    };
    write_scene(&folder.path().join("mission"), &options).unwrap();
    folder
});

pub(crate) struct Image {
    pub(crate) set: KernelSet,
    pub(crate) kernels: KernelsConfig,
    pub(crate) pointing: PointingConfig,
    pub(crate) light_time: LightTime,
    pub(crate) times: ImageTimes,
    pub(crate) orientation: Orientation,
}

impl Image {
    fn new(set: KernelSet, id: &str, label: PathBuf, light_time: LightTime) -> Self {
        let kernels = KernelsConfig {
            source: KernelSource::Listed(KernelList::Files(Vec::new())),
            ..KernelsConfig::default()
        };
        let pointing = PointingConfig {
            ck_bias: Some(usual_instrument().pointing_bias()),
            source: None,
        };
        let session = Session::open(&set).unwrap();
        let config = ImageConfig {
            id: id.to_owned(),
            label: Some(label),
            ..ImageConfig::default()
        };
        let times = tag_times(&[config], &session).unwrap().remove(0);
        let orientation =
            sample_orientation(&session, &times, &kernels, &pointing, &sampling(light_time))
                .unwrap();
        Self {
            set,
            kernels,
            pointing,
            light_time,
            times,
            orientation,
        }
    }

    /// An image of the synthetic mission.
    pub(crate) fn of_scene(id: &str) -> Self {
        Self::of_scene_with(id, LightTime::Surface)
    }

    /// The same by a convention for light time.
    pub(crate) fn of_scene_with(id: &str, light_time: LightTime) -> Self {
        let mission = MISSION.path().join("mission");
        let set = KernelSet::from_metakernel(&mission.join("kernels/nav.tm")).unwrap();
        Self::new(
            set,
            id,
            mission.join(format!("labels/{id}.lbl")),
            light_time,
        )
    }

    /// Image M04/02852 on real kernels.
    pub(crate) fn real_with(test: &str, light_time: LightTime) -> Option<Self> {
        let folder = real_data("ale_mgs/m0402852", test)?;
        let files = m0402852_files(&folder);
        let set = KernelSet::from_files(&files).unwrap();
        Some(Self::new(
            set,
            "m04-02852",
            folder.join("m0402852_isis.lbl"),
            light_time,
        ))
    }

    /// The same image as other kernels have it.
    pub(crate) fn sampled_with(&self, set: &KernelSet) -> Orientation {
        let session = Session::open(set).unwrap();
        let Self {
            times,
            kernels,
            pointing,
            light_time,
            ..
        } = self;
        sample_orientation(&session, times, kernels, pointing, &sampling(*light_time)).unwrap()
    }
}

/// Position, metres, and rotation from the camera, both IAU 2000, as the kernels of `session` and the image's
/// convention for light time have them.
pub(crate) fn kernel_camera(
    session: &Session,
    image: &Image,
    et: Et,
) -> (Vector3<f64>, Matrix3<f64>) {
    kernel_camera_by(session, image, image.light_time, et)
}

/// The same by another convention.
pub(crate) fn kernel_camera_by(
    session: &Session,
    image: &Image,
    light_time: LightTime,
    et: Et,
) -> (Vector3<f64>, Matrix3<f64>) {
    let to_mars = body_matrix(&MARS_IAU2000, et);
    let lookup = image.pointing.bias_of(usual_instrument()).lookup(et);
    let attitude = session.attitude(lookup, et, 0.0).unwrap();
    let to_camera = session.mounting(usual_instrument(), et).unwrap() * attitude.inertial_to_bus;
    let to_inertial = to_camera.matrix().transpose();
    let geometric_m = session.state(et).unwrap().position.xyz_m;
    match light_time {
        LightTime::Support => unreachable!("kernels have no support data"),
        LightTime::None => (to_mars * geometric_m, to_mars * to_inertial),
        LightTime::Centre => {
            let seen_m = session.apparent_state(et).unwrap().position.xyz_m;
            (to_mars * seen_m, to_mars * to_inertial)
        }
        LightTime::Surface => {
            let position = Position::<BodyFixed>::new(to_mars * geometric_m);
            let boresight = to_mars * to_inertial.column(2);
            let ground = ray_meets_ellipsoid(Body::Mars.model(), &position, &boresight).unwrap();
            let left = et.plus(-position.distance_m(&ground) / 299_792_458.0);
            let to_mars = body_matrix(&MARS_IAU2000, left);
            let position_m = session.state(left).unwrap().position.xyz_m;
            (to_mars * position_m, to_mars * to_inertial)
        }
    }
}

/// Largest distance of positions, metres, and largest angle between rotations, radians, over all samples.
pub(crate) fn apart(a: &Orientation, b: &Orientation) -> (f64, f64) {
    assert_eq!(a.samples.len(), b.samples.len());
    let mut worst = (0.0_f64, 0.0_f64);
    for (a, b) in a.samples.iter().zip(&b.samples) {
        assert_eq!(a.et, b.et);
        let distance_m = a.position.distance_m(&b.position);
        let [a, b] = [a, b].map(|sample| sample.camera_to_mars.matrix());
        worst = (worst.0.max(distance_m), worst.1.max(angle_rad(a, b)));
    }
    worst
}

/// Angle between two rotations, radians.
pub(crate) fn angle_rad(a: &Matrix3<f64>, b: &Matrix3<f64>) -> f64 {
    let skew = a * b.transpose();
    0.5 * Vector3::new(
        skew[(2, 1)] - skew[(1, 2)],
        skew[(0, 2)] - skew[(2, 0)],
        skew[(1, 0)] - skew[(0, 1)],
    )
    .norm()
}
