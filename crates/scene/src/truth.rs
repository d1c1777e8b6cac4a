//! True values of the mission, for `truth.json`.

use std::collections::BTreeMap;

use serde::Serialize;

use super::{
    arc::Arc,
    drawn::{DayErrors, Flown},
    error_sources::SceneErrors,
    laser::{CROSSOVER_AMPLITUDE_M, CROSSOVER_PERIOD_S, Shot},
    orbit::Orbit,
    plan::{Look, PlannedImage},
    profile_shift::ProfileShift,
    versions::Version,
};
use areograph_base::{body::MARS_IAU2000, time::Et, units::SECONDS_PER_MS};
use areograph_config::{usual_altimeter, usual_instrument};
use areograph_geom::{
    attitude::{make_continuous, spice_quaternion},
    body_rotation::body_matrix,
    pushbroom::Pose,
};

/// Epochs of an image: the ends of 30 equal intervals.
const EPOCHS: u32 = 31;

/// All true values.
#[derive(Debug, Serialize)]
pub(super) struct Truth<'a> {
    pub made_by: &'static str,
    pub synthetic: &'static str,
    pub orbit: &'static str,
    pub table_2: &'static str,
    pub seed: u64,
    pub errors: SceneErrors,
    pub errors_rule: &'static str,
    pub errors_drawn: Vec<DrawnTruth<'a>>,
    pub biases: Biases,
    pub crossover: Crossover,
    pub frame_model: &'static str,
    pub images: Vec<ImageTruth<'a>>,
    pub files: Vec<FileTruth>,
    pub profiles: Vec<ProfileTruth<'a>>,
    pub tie_rule: &'static str,
    pub ties: Vec<TiesTruth<'a>>,
    pub wide_angle_rule: &'static str,
    pub wide_angle: Vec<ContextTruth>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub rendered: Vec<RenderedTruth<'a>>,
}

/// True values of a rendered image.
#[derive(Debug, Serialize)]
pub(super) struct RenderedTruth<'a> {
    image: &'a str,
    coder: &'static str,
    /// Incidence angle of the Sun over the site.
    sun_incidence_deg: f64,
    /// Azimuth of the Sun, from north to east.
    sun_azimuth_deg: f64,
}

impl<'a> RenderedTruth<'a> {
    /// An image under a Sun at this incidence angle and azimuth, degrees.
    pub(super) const fn new(
        image: &PlannedImage<'a>,
        coder: &'static str,
        [sun_incidence_deg, sun_azimuth_deg]: [f64; 2],
    ) -> Self {
        Self {
            image: image.id,
            coder,
            sun_incidence_deg,
            sun_azimuth_deg,
        }
    }
}

/// The errors of the day of one image.
#[derive(Debug, Serialize)]
pub(super) struct DrawnTruth<'a> {
    image: &'a str,
    #[serde(flatten)]
    errors: DayErrors,
}

impl<'a> DrawnTruth<'a> {
    /// The values drawn for a day.
    pub(super) fn of(flown: &Flown<'a>) -> Self {
        Self {
            image: flown.arc.image.id,
            errors: flown.errors.clone(),
        }
    }
}

/// Poses of a camera.
#[derive(Debug, Serialize)]
pub(super) struct Poses {
    epochs_et_s: Vec<f64>,
    position_iau2000_m: Vec<[f64; 3]>,
    camera_to_mars_quaternion_wxyz: Vec<[f64; 4]>,
}

impl Poses {
    /// These poses, in order of time.
    pub(super) fn of(poses: &[(Et, Pose)]) -> Self {
        let mut quaternions: Vec<[f64; 4]> = poses
            .iter()
            .map(|(_, pose)| spice_quaternion(&pose.mars_to_camera.transpose()))
            .collect();
        make_continuous(&mut quaternions);
        Self {
            epochs_et_s: poses.iter().map(|(et, _)| et.seconds()).collect(),
            position_iau2000_m: poses
                .iter()
                .map(|(_, pose)| pose.position_m.into())
                .collect(),
            camera_to_mars_quaternion_wxyz: quaternions,
        }
    }
}

/// Injected time errors.
#[derive(Debug, Serialize)]
pub(super) struct Biases {
    ck_bias_s: f64,
    ck_rule: &'static str,
    mola_clock_bias_s: f64,
    mola_clock_sign: &'static str,
    mola_clock_rule: &'static str,
}

impl Biases {
    /// Those of every mission.
    pub(super) fn injected() -> Self {
        Self {
            ck_bias_s: usual_instrument().pointing.ck_bias_s,
            ck_rule: "the attitude of true time t is stored in the C-kernel at t + ck_bias_s",
            mola_clock_bias_s: usual_altimeter().clock_bias_s,
            mola_clock_sign: "late",
            mola_clock_rule: "true time = tag - mola_clock_bias_s, in all files; coordinates are valid at the true time",
        }
    }
}

impl Crossover {
    /// That of every mission.
    pub(super) const fn injected() -> Self {
        Self {
            amplitude_m: CROSSOVER_AMPLITUDE_M,
            period_s: CROSSOVER_PERIOD_S,
            rule: "in the files, ground and spacecraft are too high by the residual, amplitude_m sin(2 pi et / period_s) at \
                the mid-point of the frame; radii are the values before its subtraction",
        }
    }
}

/// Injected crossover residual.
#[derive(Debug, Serialize)]
pub(super) struct Crossover {
    amplitude_m: f64,
    period_s: f64,
    rule: &'static str,
}

/// One image.
#[derive(Debug, Serialize)]
pub(super) struct ImageTruth<'a> {
    id: &'a str,
    site: &'a str,
    start_et_s: f64,
    line_period_s: f64,
    lines_header: u32,
    lines_delivered: u32,
    look: &'static str,
    emission_deg: Option<f64>,
    /// By the times of the label, the orbit `gsfc` and the attitude of the C-kernel, one entry per epoch.
    #[serde(flatten)]
    poses: Poses,
    /// Each family's orbit minus `gsfc` along the radial, along-track and cross-track axes of `gsfc`, metres, one
    /// entry per epoch.
    orbit_radial_along_cross_m: BTreeMap<&'static str, Vec<[f64; 3]>>,
}

/// One PEDR file.
#[derive(Debug, Serialize)]
pub(super) struct FileTruth {
    pub file: String,
    pub datum: &'static str,
    pub frames: u64,
    pub shots_ground: u64,
    pub shots_cloud: u64,
    pub shots_missing: u64,
    /// Shots that the linear frame model misplaces by more than 0.2 m.
    pub shots_beyond_frame_model: u64,
    /// Lowest |latitude| of such shots in nadir-pointing frames, degrees.
    pub beyond_frame_model_from_latitude_deg: Option<f64>,
}

/// A shot that met the ground, with the position of its record.
#[derive(Debug, Clone, Copy)]
pub(super) struct KeptShot {
    /// Record of the file, counted from 1 with the label records.
    pub record: u32,
    /// Shot in the frame, 1 to 20.
    pub shot: u8,
    /// The true values.
    pub truth: Shot,
}

/// A wide-angle image in `truth.json`.
#[derive(Debug, Serialize)]
pub(super) struct ContextTruth {
    pub id: &'static str,
    pub camera: &'static str,
    pub start_et_s: f64,
    pub line_period_s: f64,
    pub lines: u32,
    #[serde(flatten)]
    pub poses: Poses,
    /// Shots of the PEDR file of the image's day inside the image.
    pub shots: Vec<ContextShot>,
}

/// Image coordinates of a shot; lines and samples are 0 at the outer edge of the first one.
#[derive(Debug, Serialize)]
pub(super) struct ContextShot {
    pub record: u32,
    pub shot: u8,
    pub line: f64,
    pub sample: f64,
}

/// The shots of one file in one window.
#[derive(Debug, Serialize)]
pub(super) struct ProfileTruth<'a> {
    pub window: String,
    pub image: Option<&'a str>,
    pub file: String,
    /// Its offset in the file, of profiles without an image; the errors of an image contain the others.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub profile_shift: Option<ProfileShift>,
    pub orbit_differences: BTreeMap<&'static str, OrbitDifference>,
    /// Largest distance between the linear frame model and the intended position of a shot in the file, metres, before
    /// rounding.
    pub frame_error_max_m: f64,
    /// Record of the file, counted from 1 with the label, one entry per shot that met the ground.
    pub record: Vec<u32>,
    pub shot: Vec<u8>,
    pub et_s: Vec<f64>,
    pub ground_iau2000_m: Vec<[f64; 3]>,
}

/// Differences of one family's orbit from the truth over a profile.
#[derive(Debug, Serialize)]
pub(super) struct OrbitDifference {
    /// At the middle of the image, metres.
    pub radial_along_cross_m: [f64; 3],
    /// Mean of range minus distance from this family's spacecraft to the footprint, metres.
    pub expected_range_minus_distance_mean_m: f64,
}

/// The tie points of one site.
#[derive(Debug, Serialize)]
pub(super) struct TiesTruth<'a> {
    pub site: &'a str,
    /// The images, in the order of time.
    pub cameras: Vec<TieCameraTruth<'a>>,
    /// In the order of the file.
    pub ties: Vec<TieTruth>,
}

/// True exposure of an image.
#[derive(Debug, Serialize)]
pub(super) struct TieCameraTruth<'a> {
    pub image: &'a str,
    pub time_bias_lines: f64,
    pub position_bias_m: [f64; 3],
    /// Focal-plane pixels of a line in the middle of the image.
    pub focal_px_per_line: f64,
    /// Lines, 0 at the outer edge of the first one, with the poses in which they were truly exposed.
    pub line: Vec<f64>,
    /// Light time from the ground on the boresight, one entry per line.
    pub light_time_s: Vec<f64>,
    #[serde(flatten)]
    pub poses: Poses,
}

/// One tie point.
#[derive(Debug, Serialize)]
pub(super) struct TieTruth {
    pub id: String,
    pub ground_iau2000_m: [f64; 3],
    pub blunder: Option<BlunderTruth>,
}

/// A measurement displaced by a blunder.
#[derive(Debug, Serialize)]
pub(super) struct BlunderTruth {
    pub image: String,
    pub line_error: f64,
    pub sample_error: f64,
}

impl Truth<'_> {
    /// The true values common to all missions; images, files and profiles are added later.
    pub(super) fn new(seed: u64, errors: &SceneErrors) -> Self {
        Self {
            made_by: "areograph scene",
            synthetic: "all values are invented, except that ids, times, summing, lines, line periods and emission angles of \
                the narrow-angle images follow Shan et al. 2005",
            table_2: "Emission angles are from Shan et al. 2005, Table 2, measured at the ground. For E04-01275, the \
                table reports 7424 header lines, for which the first-order RMSE in Table 4 would be 9.7 m instead of \
                the published 11.45 m. Here the image has 8064 lines, of which 7424 are delivered.",
            orbit: "image positions belong to the orbit gsfc (kernels/gsfc.tm), which is true except for errors_drawn; nav \
                (used by the site files) and ipng differ from gsfc by orbit_differences",
            seed,
            errors: *errors,
            errors_rule: "Members of errors are standard deviations and ranges; members of errors_drawn are values drawn from \
                them for the day of each image. Lines were exposed time_bias_lines later than the label states. The true \
                attitude of the bus is the C-kernel attitude without its bias, attitude_clock_s later, rotated by attitude: the \
                matrix from J2000 to the bus is exp([e]x) times the C-kernel matrix, with e = constant + linear x + quadratic \
                x^2 + jitter and x = (et - middle) / half_image, held beyond -4 and 4. bus_position_m (camera and laser) and \
                camera_position_m (camera only) are added to the orbit gsfc, IAU 2000. The laser points boresight_rad from +Z \
                of the bus towards its X and Y throughout the mission. east_north_radial_m is the position of the shots in the \
                PEDR file minus their true position. The spacecraft position in the file is the position in gsfc, moved along \
                the beam until ranges agree with the ground in the file.",
            errors_drawn: Vec::new(),
            biases: Biases::injected(),
            crossover: Crossover::injected(),
            frame_model: "Latitude and longitude vary linearly within a PEDR frame. Near the poles, during slews and \
                on steep ground off nadir, a frame cannot represent 20 true footprints to 0.2 m; frames do not include \
                jitter. The numbers of affected shots are under files, the largest errors under profiles.",
            images: Vec::new(),
            files: Vec::new(),
            profiles: Vec::new(),
            tie_rule: "Line n of an image was exposed at the time that its label gives for line n + time_bias_lines, \
                from the position of the orbit gsfc at that time plus position_bias_m (IAU 2000), with the true \
                attitude of that time (errors_rule). Line, position and quaternion of a camera describe its true \
                poses. The camera records light that left the ground light_time_s before the exposure, with the \
                positions of camera and Mars at that instant and the attitude of the exposure (light time and \
                aberration). Tie points are measured in such images, at ground_iau2000_m. The position bias relative \
                to nav is position_bias_m minus the orbit difference of nav. Lines and samples of measurements contain \
                noise (tie_noise_px under errors) and blunders.",
            ties: Vec::new(),
            wide_angle_rule: "Wide-angle images are exposed at the times of their labels, from the true position of the bus \
                 with its true attitude. The light time of each point is applied. Lines and samples of shots follow the \
                 formula of the instrument kernel moc20.ti.",
            wide_angle: Vec::new(),
            rendered: Vec::new(),
        }
    }
}

impl<'a> ImageTruth<'a> {
    /// Orientation of the arc's image according to the kernels, and the differences of the rival orbits.
    pub(super) fn of(arc: &Arc<'a>, versions: &[Version]) -> Self {
        let image = arc.image;
        let step_s = arc.exposed.duration_s() / f64::from(EPOCHS - 1);
        let epochs: Vec<_> = (0..EPOCHS)
            .map(|index| arc.exposed.start.plus(step_s * f64::from(index)))
            .collect();
        let pose = |et: Et| Pose {
            position_m: body_matrix(&MARS_IAU2000, et) * arc.orbit.state(et).position_m,
            mars_to_camera: arc.camera_to_mars(et).transpose(),
        };
        let poses: Vec<(Et, Pose)> = epochs.iter().map(|et| (*et, pose(*et))).collect();
        let (look, emission_deg) = match image.look {
            Look::Nadir => ("nadir", None),
            Look::Roll { emission_deg, .. } => ("off nadir, held inertially", Some(emission_deg)),
        };
        Self {
            id: image.id,
            site: image.site.id,
            start_et_s: arc.exposed.start.seconds(),
            line_period_s: image.exposure_ms * SECONDS_PER_MS * f64::from(image.summing),
            lines_header: image.lines_header,
            lines_delivered: image.lines_delivered,
            look,
            emission_deg,
            poses: Poses::of(&poses),
            orbit_radial_along_cross_m: versions
                .iter()
                .map(|version| {
                    let off = epochs
                        .iter()
                        .map(|et| version.radial_along_cross_m(*et).into());
                    (version.family, off.collect())
                })
                .collect(),
        }
    }
}

impl OrbitDifference {
    /// Differences of the versions of an orbit from the truth over the shots of a profile, by family.
    pub(super) fn of(
        versions: &[Version; 3],
        orbit: &Orbit,
        kept: &[KeptShot],
    ) -> BTreeMap<&'static str, Self> {
        let difference = |version: &Version| {
            let differences_m = kept.iter().map(|kept| {
                let KeptShot { truth, .. } = kept;
                let rival_m =
                    body_matrix(&MARS_IAU2000, truth.et) * version.position_m(orbit, truth.et);
                truth.range_m - (rival_m - truth.told_ground_m).norm()
            });
            let difference = Self {
                radial_along_cross_m: version.offset_m.into(),
                // 0 of no shots.
                expected_range_minus_distance_mean_m: differences_m.sum::<f64>()
                    / kept.len().max(1) as f64,
            };
            (version.family, difference)
        };
        versions.iter().map(difference).collect()
    }
}

impl ProfileTruth<'_> {
    /// The kept shots of one file in one window.
    pub(super) fn new(window: &str, file: &str, kept: &[KeptShot]) -> Self {
        Self {
            window: window.to_owned(),
            image: None,
            file: file.to_owned(),
            profile_shift: None,
            orbit_differences: BTreeMap::new(),
            frame_error_max_m: kept
                .iter()
                .map(|kept| kept.truth.frame_error_m)
                .fold(0.0, f64::max),
            record: kept.iter().map(|kept| kept.record).collect(),
            shot: kept.iter().map(|kept| kept.shot).collect(),
            et_s: kept.iter().map(|kept| kept.truth.et.seconds()).collect(),
            ground_iau2000_m: kept.iter().map(|kept| kept.truth.ground_m.into()).collect(),
        }
    }
}
