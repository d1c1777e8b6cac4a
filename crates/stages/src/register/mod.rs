//! Registration: which line and sample of an image sees each footprint.
//!
//! Every profile is projected into every image, not only into the one exposed with it. Production is Newton's method;
//! the published iterations run beside it on the same points, so that their cost and convergence are known for this
//! site.

mod isis;
mod methods;
mod points;

use std::{collections::BTreeMap, sync::atomic::AtomicBool};

use nalgebra::Vector3;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{
    convert_datum::Converted, fit_sensor_model::SensorModel, group_profiles::Profile,
    orientation::Orientation, oriented::OrientedImage, tag_times::ImageTimes,
};
use areograph_base::{error::Result, footprints::Footprints, frames::BodyFixed, watch::Watch};
use areograph_config::RegistrationConfig;
use areograph_geom::{
    ellipsoid::{is_above_horizon, spherical_to_xyz_m},
    pushbroom::{CameraModel, ExteriorOrientation, Projector, Unseen},
    statistics::Summary,
};
use areograph_store::{
    stage::{Output, Round, Stage},
    stage_inputs,
};

use isis::IsisImage;
pub use methods::{Method, MethodRun};
pub use points::{PointOnImage, ProfileOnImage, RegisteredPoints};

/// Points between two checks for a stop by the user.
const POINTS_AT_ONCE: usize = 65_536;

/// The footprints of a site in one image.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ImageRegistration {
    /// Image identifier.
    pub image: String,
    /// The orientation with which points were projected.
    pub model: CameraModel,
    /// Points that have a line, ordered by profile, then by shot.
    pub points: RegisteredPoints,
    /// Points without a line, by reason.
    pub rejected: BTreeMap<String, u64>,
    /// One entry per profile, in the order of the profiles.
    pub profiles: Vec<ProfileOnImage>,
    /// The published iterations on the points within the image's lines.
    pub methods: Vec<MethodRun>,
    /// The other models against `model`, on the points within the image's lines.
    pub models: Vec<ModelDifference>,
}

impl ImageRegistration {
    /// The registration without its points.
    #[must_use]
    pub fn without_points(&self) -> Self {
        self.with_points(RegisteredPoints::default())
    }

    /// The registration with these points instead of its own.
    #[must_use]
    pub fn with_points(&self, points: RegisteredPoints) -> Self {
        Self {
            image: self.image.clone(),
            model: self.model,
            points,
            rejected: self.rejected.clone(),
            profiles: self.profiles.clone(),
            methods: self.methods.clone(),
            models: self.models.clone(),
        }
    }

    /// Whether a footprint has a line in the image or beyond its ends.
    #[must_use]
    pub fn has_points(&self) -> bool {
        self.profiles.iter().any(|profile| profile.points > 0)
    }
}

/// Differences between another model and the model in use, for the same image at the same points.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ModelDifference {
    /// The other model.
    pub model: CameraModel,
    /// Line of the other model minus line of the model in use.
    pub lines: Summary,
    /// Sample of the other model minus sample of the model in use.
    pub samples: Summary,
}

/// Reasons why a footprint has no place in an image.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
enum FootprintRejection {
    #[error(transparent)]
    Unseen(#[from] Unseen),
    /// Mars is between camera and point.
    #[error("beyond the horizon")]
    BeyondHorizon,
}

stage_inputs! {
    /// One image with its orientation, and the footprints.
    pub struct Register<'a> {
        /// Identifier of the image.
        pub image: &'a str,
        /// Round of the orientation.
        pub round: Round,
        /// Its line times.
        pub times: &'a Output<ImageTimes>,
        /// Its orientation.
        pub orientation: &'a Output<Orientation>,
        /// Its sensor models.
        pub model: &'a Output<SensorModel>,
        /// Footprints in IAU 2000.
        pub converted: &'a Output<Converted>,
        /// Profiles.
        pub profiles: &'a Output<Vec<Profile>>,
        /// Model to project with, and the published iterations.
        pub registration: &'a RegistrationConfig,
    }
}

impl Stage for Register<'_> {
    const NAME: &'static str = "register";
    const METHOD: u32 = 4;
    type Output = ImageRegistration;
    stage_inputs!(fingerprint);

    fn part(&self) -> Option<String> {
        self.round.part_of(self.image)
    }

    fn run(&self, stop: &AtomicBool) -> Result<ImageRegistration> {
        self.run_watched(stop.into())
    }

    fn run_watched(&self, watch: Watch<'_>) -> Result<ImageRegistration> {
        register(
            self.times.value()?,
            self.orientation.value()?,
            self.model.value()?,
            &self.converted.value()?.footprints,
            self.profiles.value()?,
            self.registration,
            watch,
        )
    }
}

/// Projects all profiles into `image`.
///
/// Footprints have the radius before the crossover correction, as in the products' x, y and z. `watch` is checked
/// between blocks of points, and counts them. With an orientation that sees no ground, all points are rejected.
///
/// # Errors
/// Samples that do not form an orientation; [`Stopped`](areograph_base::error::Stopped).
/// # Source
/// Shan et al. 2005, eq. 3 and 4; Shan, Lee & Yoon 2002.
pub fn register<'a>(
    image: &ImageTimes,
    orientation: &Orientation,
    model: &SensorModel,
    footprints: &Footprints<BodyFixed>,
    profiles: &[Profile],
    config: &RegistrationConfig,
    watch: impl Into<Watch<'a>>,
) -> Result<ImageRegistration> {
    let watch = watch.into();
    let camera = OrientedImage::of(image, orientation, model)?;
    let mut shots = (0_u32..)
        .zip(profiles)
        .flat_map(|(profile, of)| of.rows.iter().map(move |row| (profile, *row)));
    let projector = camera.projector();
    let isis = IsisImage::of(image, orientation)?;
    let isis_projector = isis.projector();
    let mut points = RegisteredPoints::default();
    let mut rejected = BTreeMap::new();
    watch.announce(profiles.iter().map(|profile| profile.rows.len()).sum());
    loop {
        let block: Vec<(u32, u32)> = shots.by_ref().take(POINTS_AT_ONCE).collect();
        if block.is_empty() {
            break;
        }
        watch.check()?;
        let placed: Vec<_> = block
            .par_iter()
            .map(|(_, row)| {
                let projector = projector.as_ref().map_err(|unseen| *unseen)?;
                let point_m = ground_m(footprints, *row);
                let point = camera.place(projector, &point_m)?;
                let place = isis_projector.as_ref();
                let [isis_line, isis_sample] =
                    place.map_or(isis::UNSEEN, |projector| isis.place(projector, &point_m));
                Ok::<_, FootprintRejection>(PointOnImage {
                    isis_line,
                    isis_sample,
                    ..point
                })
            })
            .collect();
        for ((profile, row), placed) in block.iter().zip(placed) {
            match placed {
                Ok(point) => points.push(*profile, *row, &point),
                Err(reject) => *rejected.entry(reject.to_string()).or_insert(0) += 1,
            }
        }
        watch.step(block.len() as u64, "points");
    }
    let on_lines = points.on_lines();
    let ground: Vec<Vector3<f64>> = on_lines
        .iter()
        .map(|index| ground_m(footprints, points.row.at(*index)))
        .collect();
    let methods = methods::run(&camera, &ground, config, watch)?;
    points.count(Method::FrameFirst, &on_lines, &methods);
    points.count(Method::FixedPoint, &on_lines, &methods);
    Ok(ImageRegistration {
        image: image.id.clone(),
        model: camera.model,
        profiles: points::on_image(&points, profiles.len()),
        models: camera.differences(camera.model, &points, &on_lines, &ground),
        methods: methods.into_iter().map(|(run, _)| run).collect(),
        points,
        rejected,
    })
}

/// Position of a footprint, metres.
fn ground_m(footprints: &Footprints<BodyFixed>, row: u32) -> Vector3<f64> {
    let row = row as usize;
    spherical_to_xyz_m(
        footprints.longitude_rad.at(row),
        footprints.latitude_rad.at(row),
        footprints.ground_radius_m(row),
    )
}

impl OrientedImage<'_> {
    /// Line and sample of a point.
    fn place(
        &self,
        projector: &Projector<'_, dyn ExteriorOrientation>,
        point_m: &Vector3<f64>,
    ) -> std::result::Result<PointOnImage, FootprintRejection> {
        let solution = projector.project(point_m)?;
        let pose = projector.model().pose(solution.x);
        if !is_above_horizon(&pose.position_m, point_m) {
            return Err(FootprintRejection::BeyondHorizon);
        }
        let focal_px = self.detector.focal_px(&pose.camera_vector_m(point_m));
        let focal_px = focal_px.map_err(|_| Unseen::BehindCamera)?;
        let line_times = &self.image.line_times;
        let line = line_times.line_of_offset(solution.x);
        let sample = self.detector.sample(focal_px.y);
        let delivered = 0.0..=f64::from(self.image.lines_delivered);
        Ok(PointOnImage {
            line,
            sample,
            line_offset: solution.x,
            y_px: focal_px.y,
            range_m: solution.camera_m.norm(),
            isis_line: isis::UNSEEN[0],
            isis_sample: isis::UNSEEN[1],
            residual_px: self.detector.missed_px(&focal_px),
            step_lines: solution.step_lines,
            evaluations: solution.evaluations,
            inside: delivered.contains(&line)
                && !line_times.in_gap(solution.x)
                && (0.0..=self.detector.samples).contains(&sample),
            extrapolated: solution.x.abs() > 0.5 * self.lines(),
        })
    }

    /// The models other than `production` on the points `on_lines`, which lie at `ground`.
    fn differences(
        &self,
        production: CameraModel,
        points: &RegisteredPoints,
        on_lines: &[usize],
        ground: &[Vector3<f64>],
    ) -> Vec<ModelDifference> {
        let others = CameraModel::WORDS.map(|(_, model)| model).into_iter();
        let difference = |model| {
            let projector = self.projector_of(model).ok()?;
            let apart: Vec<Option<(f64, f64)>> = ground
                .par_iter()
                .zip(on_lines)
                .map(|(point_m, index)| {
                    let other = self.place(&projector, point_m).ok()?;
                    Some((
                        other.line - points.line.at(*index),
                        other.sample - points.sample.at(*index),
                    ))
                })
                .collect();
            let (lines, samples): (Vec<f64>, Vec<f64>) = apart.into_iter().flatten().unzip();
            Some(ModelDifference {
                model,
                lines: Summary::of(&lines),
                samples: Summary::of(&samples),
            })
        };
        others
            .filter(|model| *model != production)
            .filter_map(difference)
            .collect()
    }
}
