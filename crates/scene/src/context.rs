//! Wide-angle images around two of the narrow-angle images, with their own site.
//!
//! Look directions of samples follow the formula of the instrument kernel word for word, and image coordinates of
//! points are solved for with it, independently of the camera models of the program.

use nalgebra::{Matrix2, Vector2, Vector3};

use super::{
    drawn::Flown,
    error::SceneError,
    kernels::wide_angle_metakernel,
    plan::{LOST_IMAGE, Site},
    random::Random,
    sites::{Label, SiteFile, SiteImage, SiteKernels, SiteTies, image_label, window},
    terrain::Terrain,
    ties::ties_name,
    truth::{ContextShot, ContextTruth, KeptShot, Poses},
    versions::FAMILIES,
};
use areograph_base::{
    error::Result,
    instruments::{DistortionModel, Instrument},
    ties::{TieMeasure, TiePoint},
    time::{Et, Interval},
    units::SECONDS_PER_MS,
};
use areograph_config::built_in_instruments;
use areograph_geom::{light_time::light_time_s, pushbroom::Pose};
use areograph_spice::Session;

/// The site of the images.
pub(super) static CONTEXT_SITE: Site<'static> = Site {
    id: "gusev_context",
    name: "Gusev crater, wide angle",
    latitude_deg: -14.6,
    longitude_deg: 175.3,
};
/// Half the window's extent in longitude and latitude, degrees.
const WINDOW_HALF_DEG: [f64; 2] = [1.5, 1.0];
/// Epochs of an image: the ends of 30 equal intervals.
const EPOCHS: u32 = 31;
/// Tie points of the two red images, and candidate points examined for them.
const TIES: [usize; 2] = [60, 2_000];
/// Standard deviation of a measurement, lines and samples.
const NOISE_PX: f64 = 0.2;
/// No tie point is nearer than this to the edge of an image, pixels.
const EDGE_PX: f64 = 5.0;
/// Steps of the search for a position, and the last of them in lines and samples: ET is rounded at 1e-7 of a line.
const STEPS_MAX: u32 = 30;
const LAST_STEP_PX: f64 = 1e-6;
/// Half the interval of its derivatives.
const SLOPE_STEP_PX: f64 = 0.5;

/// An image that is exposed around the middle of a narrow-angle one.
#[derive(Debug)]
pub(super) struct PlannedContext {
    /// Product id with `-` for `/`.
    pub id: &'static str,
    /// The narrow-angle image.
    pub around: &'static str,
    /// The camera.
    pub camera: &'static str,
    /// Exposure of a detector line, milliseconds.
    pub exposure_ms: f64,
    /// Detector lines and pixels summed.
    pub summing: u32,
    /// Lines.
    pub lines: u32,
    /// First detector pixel, counted from 0.
    pub first_detector: u32,
    /// Samples per line.
    pub samples: u32,
}

/// The images; line periods give square pixels at nadir. The last one is exposed while attitude is held.
pub(super) static CONTEXT_IMAGES: [PlannedContext; 3] = [
    PlannedContext {
        id: "E02-00666",
        around: "E02-00665",
        camera: "moc_wa_red",
        exposure_ms: 78.0,
        summing: 2,
        lines: 220,
        first_detector: 1_184,
        samples: 480,
    },
    PlannedContext {
        id: "E02-00667",
        around: "E02-00665",
        camera: "moc_wa_blue",
        exposure_ms: 78.0,
        summing: 1,
        lines: 440,
        first_detector: 1_440,
        samples: 480,
    },
    PlannedContext {
        id: "E02-01454",
        around: "E02-01453",
        camera: "moc_wa_red",
        exposure_ms: 76.0,
        summing: 1,
        lines: 440,
        first_detector: 1_424,
        samples: 480,
    },
];

/// A wide-angle image and its flight.
pub(super) struct ContextImage<'a> {
    plan: &'static PlannedContext,
    flown: &'a Flown<'a>,
    camera: &'static Instrument,
    sclk_start: String,
    start: Et,
}

impl<'a> ContextImage<'a> {
    /// The images over their arcs; each begins at a clock reading.
    ///
    /// # Errors
    /// [`SceneError::NoCamera`] when the program does not know a camera; errors of the clock kernel.
    pub(super) fn all(days: &'a [Flown<'a>], session: &Session) -> Result<Vec<Self>> {
        let planned = CONTEXT_IMAGES.iter();
        planned
            .map(|plan| {
                let flown = days.iter().find(|flown| flown.arc.image.id == plan.around);
                let cameras = built_in_instruments().iter();
                let camera = cameras.into_iter().find(|camera| camera.id == plan.camera);
                let (Some(flown), Some(camera)) = (flown, camera) else {
                    return Err(SceneError::NoCamera {
                        image: plan.id.to_owned(),
                        error: format!("no {} around {}", plan.camera, plan.around),
                    }
                    .into());
                };
                let exposed = flown.arc.exposed;
                let middle = exposed.start.plus(0.5 * exposed.duration_s());
                let required = middle.plus(-0.5 * f64::from(plan.lines) * line_period_s(plan));
                let sclk = session.et_to_sclk(required)?;
                let sclk_start = sclk.trim().trim_start_matches("1/").to_owned();
                Ok(Self {
                    plan,
                    flown,
                    camera,
                    start: session.sclk_to_et(&sclk_start)?,
                    sclk_start,
                })
            })
            .collect()
    }

    /// Product id.
    pub(super) const fn id(&self) -> &'static str {
        self.plan.id
    }

    /// Whether it was taken on this day.
    pub(super) fn is_of(&self, flown: &Flown) -> bool {
        flown.arc.image.id == self.plan.around
    }

    fn exposed(&self) -> Interval {
        let duration_s = f64::from(self.plan.lines) * line_period_s(self.plan);
        Interval::new(self.start, self.start.plus(duration_s))
    }

    /// A detached PDS3 label.
    ///
    /// # Errors
    /// Errors of time conversion in the session.
    pub(super) fn label(&self, session: &Session) -> Result<String> {
        Ok(image_label(&Label {
            id: self.plan.id,
            mission_phase: "EXTENDED",
            instrument: &self.camera.label.instrument,
            filter: self.camera.label.filter.as_deref(),
            start: &session.et_to_utc(self.start)?,
            stop: &session.et_to_utc(self.exposed().stop)?,
            sclk_start: &self.sclk_start,
            exposure_ms: self.plan.exposure_ms,
            summing: self.plan.summing,
            first_detector: self.plan.first_detector,
            rationale: &format!("SYNTHETIC {}", CONTEXT_SITE.name),
            lines: self.plan.lines,
            samples: self.plan.samples,
        }))
    }

    /// True position of the camera, and its axes.
    fn pose(&self, et: Et) -> Pose {
        self.flown.camera_pose(self.camera, et, 0.0)
    }

    /// Origin of the straight rays to ground at distance `range_m`.
    fn seen_from(&self, et: Et, range_m: f64) -> Pose {
        self.flown
            .camera_pose(self.camera, et, light_time_s(range_m))
    }

    fn time_of(&self, line: f64) -> Et {
        self.start.plus(line * line_period_s(self.plan))
    }

    /// Unit vector of a sample coordinate in the camera's axes.
    ///
    /// # Source
    /// Radial distortion in `moc20.ti`, its program text; `P` counts pixel centres from 0.
    fn look(&self, sample: f64) -> Vector3<f64> {
        let DistortionModel::AnglePolynomial {
            coefficients_rad,
            scale,
        } = &self.camera.distortion
        else {
            return Vector3::z();
        };
        let detector = &self.camera.detector;
        let pixel =
            f64::from(self.plan.first_detector) + sample * f64::from(self.plan.summing) - 0.5;
        let across = scale * (pixel - (detector.boresight_px - 0.5)) / 1_000.0;
        let along = detector.along_track_px / 1_000.0;
        let r = across.hypot(along);
        let powers = (0_i32..).map(|index| r.powi(2 * index + 1));
        let terms = coefficients_rad.iter().zip(powers);
        // In the kernel the signs of the coefficients express the sense of the samples.
        let sense = detector.samples_along.sign();
        let phi: f64 = terms
            .map(|(coefficient, power)| -sense * coefficient * power)
            .sum();
        let (sin, cos) = phi.sin_cos();
        Vector3::new(phi.abs().sin() * along / r, -sin * across / r, cos)
    }

    /// Line and sample that see a point, by Newton's method with numerical derivatives; `None` where none exist near
    /// the image.
    fn place(&self, ground_m: &Vector3<f64>) -> Option<[f64; 2]> {
        let missed = |place: &Vector2<f64>| {
            let et = self.time_of(place.x);
            let range_m = (ground_m - self.flown.bus_position_m(et)).norm();
            let pose = self.seen_from(et, range_m);
            let seen = pose.mars_to_camera * (ground_m - pose.position_m);
            let look = self.look(place.y);
            seen.xy() / seen.z - look.xy() / look.z
        };
        let mut place =
            0.5 * Vector2::new(f64::from(self.plan.lines), f64::from(self.plan.samples));
        for _ in 0..STEPS_MAX {
            let slope = |step: Vector2<f64>| {
                (missed(&(place + step)) - missed(&(place - step))) / (2.0 * SLOPE_STEP_PX)
            };
            let slopes = Matrix2::from_columns(&[
                slope(SLOPE_STEP_PX * Vector2::x()),
                slope(SLOPE_STEP_PX * Vector2::y()),
            ]);
            let step = slopes.try_inverse()? * missed(&place);
            place -= step;
            if step.norm() < LAST_STEP_PX {
                return Some(place.into());
            }
        }
        None
    }

    fn shows(&self, [line, sample]: [f64; 2], edge_px: f64) -> bool {
        let inside = |value: f64, end: u32| (edge_px..=f64::from(end) - edge_px).contains(&value);
        inside(line, self.plan.lines) && inside(sample, self.plan.samples)
    }

    /// True exposure of the image, and image coordinates of the shots among `kept`.
    pub(super) fn truth(&self, kept: &[KeptShot]) -> ContextTruth {
        let step_s = self.exposed().duration_s() / f64::from(EPOCHS - 1);
        let epochs = (0..EPOCHS).map(|index| self.start.plus(step_s * f64::from(index)));
        let poses: Vec<(Et, Pose)> = epochs.map(|et| (et, self.pose(et))).collect();
        ContextTruth {
            id: self.plan.id,
            camera: self.plan.camera,
            start_et_s: self.start.seconds(),
            line_period_s: line_period_s(self.plan),
            lines: self.plan.lines,
            poses: Poses::of(&poses),
            shots: kept
                .iter()
                .filter_map(|kept| {
                    let place = self.place(&kept.truth.ground_m)?;
                    self.shows(place, 0.0).then(|| ContextShot {
                        record: kept.record,
                        shot: kept.shot,
                        line: place[0],
                        sample: place[1],
                    })
                })
                .collect(),
        }
    }
}

fn line_period_s(plan: &PlannedContext) -> f64 {
    plan.exposure_ms * SECONDS_PER_MS * f64::from(plan.summing)
}

/// Whether a point in radians lies in the site's window.
pub(super) fn in_window(longitude_rad: f64, latitude_rad: f64) -> bool {
    CONTEXT_SITE.holds(longitude_rad, latitude_rad, WINDOW_HALF_DEG)
}

/// Tie points of the first and the last image, measured with noise.
pub(super) fn context_ties(
    images: &[ContextImage<'_>],
    terrain: &Terrain,
    seed: u64,
) -> Vec<TiePoint<String>> {
    let (Some(first), Some(second)) = (images.first(), images.last()) else {
        return Vec::new();
    };
    let mut random = Random::new(seed, "ties of wide-angle images");
    let [count, tried] = TIES;
    let mut ties: Vec<TiePoint<String>> = Vec::with_capacity(count);
    for _ in 0..tried {
        let line = random.between(EDGE_PX, f64::from(first.plan.lines) - EDGE_PX);
        let sample = random.between(EDGE_PX, f64::from(first.plan.samples) - EDGE_PX);
        let look = first.look(sample);
        let ground = |pose: &Pose| {
            let direction = pose.mars_to_camera.tr_mul(&look);
            let range_m = terrain.range_m(&pose.position_m, &direction)?;
            Some((range_m, pose.position_m + range_m * direction))
        };
        let et = first.time_of(line);
        let Some((range_m, _)) = ground(&first.pose(et)) else {
            continue;
        };
        let Some((_, ground_m)) = ground(&first.seen_from(et, range_m)) else {
            continue;
        };
        let seen = second.place(&ground_m);
        let Some(other) = seen.filter(|place| second.shows(*place, EDGE_PX)) else {
            continue;
        };
        let mut measured = |image: &ContextImage<'_>, [line, sample]: [f64; 2]| TieMeasure {
            image: image.plan.id.to_owned(),
            line: line + NOISE_PX * random.normal(),
            sample: sample + NOISE_PX * random.normal(),
            sigma_px: None,
        };
        ties.push(TiePoint {
            id: format!("tie-{:03}", ties.len() + 1),
            known: None,
            measures: vec![measured(first, [line, sample]), measured(second, other)],
        });
        if ties.len() == count {
            break;
        }
    }
    ties
}

/// The site file of the images: PEDR files of their days and of one without an image, rival orbits to choose from.
pub(super) fn context_site(images: &[ContextImage<'_>]) -> SiteFile<'static> {
    let days = images.iter().map(|image| image.flown.arc.image);
    let mut pedr: Vec<String> = days
        .chain([&LOST_IMAGE])
        .map(|image| format!("../pedr/{}", image.pedr_name()))
        .collect();
    pedr.dedup();
    let rivals = FAMILIES.map(|family| {
        let metakernel = format!("../kernels/{}", wide_angle_metakernel(family));
        (family, metakernel)
    });
    SiteFile {
        id: CONTEXT_SITE.id,
        description: format!("{}, synthetic", CONTEXT_SITE.name),
        kernels: SiteKernels::Rivals(rivals),
        pedr,
        ties: Some(SiteTies {
            file: format!("../ties/{}", ties_name(CONTEXT_SITE.id)),
            note: "The noise of these tie points has a standard deviation of 0.2 pixels."
                .to_owned(),
            sigma_px: [NOISE_PX; 2],
        }),
        windows: vec![window(&CONTEXT_SITE, WINDOW_HALF_DEG)],
        images: images
            .iter()
            .map(|image| SiteImage {
                id: image.plan.id.to_owned(),
                label: format!("../labels/{}.lbl", image.plan.id),
                lines_delivered: None,
                pixels: None,
            })
            .collect(),
    }
}
