//! Tie points of the images of a site, measured in images whose true times and positions differ from labels and kernels.

mod measured;
mod noise;

use std::path::Path;

use nalgebra::Vector3;

use self::measured::BLUNDER_PX;
use super::{
    drawn::Flown,
    error::SceneError,
    files::put,
    random::Random,
    terrain::Terrain,
    truth::{Poses, TieCameraTruth, TiesTruth},
};
use areograph_base::{error::Result, line_times::LineTimes, ties::TieMeasure, time::Et};
use areograph_config::usual_instrument;
use areograph_geom::{
    light_time::light_time_s,
    oriented_camera::OrientedCamera,
    pushbroom::{Detector, ExteriorOrientation, Pose, Projector, SampledOrientation},
};
use areograph_pds::ties::ties_table;

pub(super) use measured::{Tie, spoil};
pub(super) use noise::TieNoise;

/// Tie points of a site at laser shots, at most.
const TIES_AT_SHOTS: usize = 320;
/// Candidate positions of an image for one tie point.
const PLACES_PER_TIE: usize = 20;
/// No tie point is nearer to the edge of an image, pixels: blunders stay inside, plus noise of a pixel.
pub(super) const EDGE_PX: f64 = BLUNDER_PX[1] + 5.0;
/// Intervals between poses of an image, a tenth of a second each: where the rate of the bus changes, interpolation is
/// in error by 0.1 mm on the ground.
const INTERVALS: u32 = 160;
/// Intervals of an image with jitter, 2 to 5 ms each: a twentieth of the shortest period, for 2 mm on the ground.
const INTERVALS_OF_JITTER: u32 = 3_600;
/// Height tolerance for ranges of neighbouring pixels, metres: a thousandth of a pixel.
const NEIGHBOUR_M: f64 = 1e-3;
/// Lines for which `truth.json` contains the pose: the ends of 30 equal intervals.
const TOLD_POSES: u32 = 31;

/// The true image.
pub(super) struct TrueImage<'a> {
    pub(super) flown: &'a Flown<'a>,
    pub(super) oriented_camera: OrientedCamera<SampledOrientation>,
}

/// Tie points and laser shots of a site.
pub(super) struct TiesWanted<'a> {
    /// Tie points at random places.
    pub(super) count: u32,
    /// Their noise.
    pub(super) noise: TieNoise,
    /// Places of laser shots, IAU 2000, metres: those that two images show are tie points as well.
    pub(super) shots_m: &'a [Vector3<f64>],
}

impl<'a> TrueImage<'a> {
    /// The image of the day `flown`.
    pub(super) fn new(flown: &'a Flown<'a>, terrain: &Terrain) -> Result<Self> {
        let image = flown.arc.image;
        let intervals = if flown.errors.has_jitter() {
            INTERVALS_OF_JITTER
        } else {
            INTERVALS
        };
        let orientation = SampledOrientation::new(&poses(flown, terrain, intervals)?)
            .map_err(|error| no_camera(flown, &error))?;
        let calibrated = Detector::new(usual_instrument(), image.summing, 0, image.samples());
        let detector = Detector {
            focal_length_px: calibrated.focal_length_px * flown.errors.camera.focal_length_ratio,
            ..calibrated
        };
        Ok(Self {
            flown,
            oriented_camera: OrientedCamera {
                id: image.id.to_owned(),
                orientation,
                detector,
                line_times: LineTimes::even(
                    flown.arc.exposed.start,
                    image.lines_header,
                    image.line_period_s(),
                )?,
            },
        })
    }

    pub(super) fn projector(&self) -> Result<Projector<'_, SampledOrientation>> {
        let projector = Projector::new(
            &self.oriented_camera.orientation,
            self.oriented_camera.lines(),
        );
        Ok(projector.map_err(|error| no_camera(self.flown, &error))?)
    }

    /// Direction that a sample sees, in the camera.
    fn look(&self, sample: f64) -> Vector3<f64> {
        let detector = &self.oriented_camera.detector;
        let pixels = f64::from(usual_instrument().detector.pixels);
        let from_middle = sample / detector.samples - 0.5;
        let bend_px = self.flown.errors.camera.bend_px * (2.0 * from_middle).powi(2);
        let ahead = bend_px * detector.samples / pixels / detector.focal_length_px;
        detector.look(sample) + Vector3::new(ahead, 0.0, 0.0)
    }

    /// Largest line and sample of a tie point.
    pub(super) fn extent_px(&self) -> [f64; 2] {
        let lines = f64::from(self.flown.arc.image.lines_delivered);
        [lines, self.oriented_camera.detector.samples].map(|length| length - EDGE_PX)
    }

    /// The ground at a random position of the image.
    fn any_ground_m(&self, terrain: &Terrain, random: &mut Random) -> Option<Vector3<f64>> {
        let [line, sample] = self
            .extent_px()
            .map(|end_px| random.between(EDGE_PX, end_px));
        self.ground_m(terrain, line, sample)
    }

    /// The ground at a position of the image.
    pub(super) fn ground_m(
        &self,
        terrain: &Terrain,
        line: f64,
        sample: f64,
    ) -> Option<Vector3<f64>> {
        let (x_lines, _) = self.oriented_camera.focal_plane_coordinates(line, sample);
        let pose = self.oriented_camera.orientation.pose(x_lines);
        let camera = self.look(sample);
        let direction = pose.mars_to_camera.tr_mul(&camera).normalize();
        let range_m = terrain.range_m(&pose.position_m, &direction)?;
        Some(pose.position_m + range_m * direction)
    }

    /// The ground at some neighbouring samples of a line, to a millimetre: each range starts from those before it.
    pub(super) fn ground_of_line_m(
        &self,
        terrain: &Terrain,
        line: f64,
        samples: impl Iterator<Item = f64>,
    ) -> Vec<Option<Vector3<f64>>> {
        let (x_lines, _) = self.oriented_camera.focal_plane_coordinates(line, 0.0);
        let pose = self.oriented_camera.orientation.pose(x_lines);
        let mut before: [Option<f64>; 2] = [None; 2];
        let ground = samples.map(|sample| {
            let camera = self.look(sample);
            let direction = pose.mars_to_camera.tr_mul(&camera).normalize();
            let range_m = match before {
                [Some(last_m), Some(earlier_m)] => {
                    let start_m = 2.0 * last_m - earlier_m;
                    terrain.range_near_m(&pose.position_m, &direction, start_m, NEIGHBOUR_M)
                }
                _ => terrain.range_m(&pose.position_m, &direction),
            };
            before = [range_m, before[0]];
            range_m.map(|range_m| pose.position_m + range_m * direction)
        });
        ground.collect()
    }

    /// Line at which the bent detector sees a point, from the middle; `x_lines` is the line at which a straight
    /// detector sees it.
    fn bent_line(&self, x_lines: f64, sample: f64, ground_m: &Vector3<f64>) -> f64 {
        let ahead = |x_lines: f64| {
            let camera_m = self.oriented_camera.orientation.pose(x_lines);
            let camera_m = camera_m.camera_vector_m(ground_m);
            camera_m.x / camera_m.z
        };
        // A line later the point has moved by as much as anywhere near.
        x_lines
            + (self.look(sample).x / self.look(sample).z) / (ahead(x_lines + 1.0) - ahead(x_lines))
    }

    /// Image coordinates of a point, unless outside or too near to an edge.
    pub(super) fn measure(
        &self,
        projector: &Projector<'_, SampledOrientation>,
        ground_m: &Vector3<f64>,
    ) -> Option<TieMeasure<String>> {
        let seen = projector.project(ground_m).ok()?;
        let y_px = self
            .oriented_camera
            .detector
            .focal_px(&seen.camera_m)
            .ok()?
            .y;
        let sample = self.oriented_camera.detector.sample(y_px);
        let measure = TieMeasure {
            image: self.oriented_camera.id.clone(),
            line: self.bent_line(seen.x, sample, ground_m) + 0.5 * self.oriented_camera.lines(),
            sample,
            sigma_px: None,
        };
        let [line_end, sample_end] = self.extent_px();
        let inside = (EDGE_PX..line_end).contains(&measure.line)
            && (EDGE_PX..sample_end).contains(&measure.sample);
        inside.then_some(measure)
    }

    /// Focal-plane pixels of a line in the middle of the image.
    fn focal_px_per_line(&self, terrain: &Terrain) -> Result<f64> {
        let camera = &self.oriented_camera;
        let [line, sample] = [camera.lines(), camera.detector.samples].map(|length| 0.5 * length);
        let et_s = exposed(self.flown, line).seconds();
        let ground_m = self.ground_m(terrain, line, sample);
        let ground_m = ground_m.ok_or(SceneError::BeamMisses { et_s })?;
        Ok(camera.focal_px_per_line(0.0, &ground_m))
    }

    fn truth(&self, terrain: &Terrain) -> Result<TieCameraTruth<'a>> {
        let errors = &self.flown.errors;
        let lines = self.oriented_camera.lines();
        let step = lines / f64::from(TOLD_POSES - 1);
        let told: Vec<f64> = (0..TOLD_POSES).map(|row| step * f64::from(row)).collect();
        let times: Vec<Et> = told.iter().map(|line| exposed(self.flown, *line)).collect();
        let light_times_s = times
            .iter()
            .map(|et| seen_after_s(self.flown, terrain, *et));
        let light_time_s = light_times_s.collect::<Result<_>>()?;
        let times = times.into_iter();
        let poses: Vec<(Et, Pose)> = times.map(|et| (et, pose(self.flown, et, 0.0))).collect();
        Ok(TieCameraTruth {
            image: self.flown.arc.image.id,
            time_bias_lines: errors.time_bias_lines,
            position_bias_m: (errors.bus_position_m + errors.camera_position_m).into(),
            focal_px_per_line: self.focal_px_per_line(terrain)?,
            line: told,
            light_time_s,
            poses: Poses::of(&poses),
        })
    }
}

/// True exposure time of a line, counted from the outer edge of the first one.
fn exposed(flown: &Flown, line: f64) -> Et {
    let arc = &flown.arc;
    let exposed_s = (line + flown.errors.time_bias_lines) * arc.image.line_period_s();
    arc.exposed.start.plus(exposed_s)
}

/// True pose of the camera, or the origin of its straight rays after a light time.
fn pose(flown: &Flown, exposure: Et, light_time_s: f64) -> Pose {
    let mut pose = flown.camera_pose(usual_instrument(), exposure, light_time_s);
    pose.position_m += flown.errors.camera_position_m;
    pose
}

/// Light time from the ground on the boresight, seconds: within the narrow swath it changes by less than the time in
/// which MGS flies a centimetre.
fn seen_after_s(flown: &Flown, terrain: &Terrain, exposure: Et) -> Result<f64> {
    let pose = pose(flown, exposure, 0.0);
    let boresight = pose.mars_to_camera.row(2).transpose();
    let range_m = terrain.range_m(&pose.position_m, &boresight);
    let et_s = exposure.seconds();
    Ok(light_time_s(
        range_m.ok_or(SceneError::BeamMisses { et_s })?,
    ))
}

/// Lines from the middle with the poses that see the ground along straight rays.
fn poses(flown: &Flown, terrain: &Terrain, intervals: u32) -> Result<Vec<(f64, Pose)>> {
    let lines = f64::from(flown.arc.image.lines_header);
    (0..=intervals)
        .map(|index| {
            let line = lines * f64::from(index) / f64::from(intervals);
            let exposure = exposed(flown, line);
            let pose = pose(flown, exposure, seen_after_s(flown, terrain, exposure)?);
            Ok((line - 0.5 * lines, pose))
        })
        .collect()
}

fn no_camera(flown: &Flown, error: &dyn std::error::Error) -> SceneError {
    SceneError::NoCamera {
        image: flown.arc.image.id.to_owned(),
        error: error.to_string(),
    }
}

/// Writes the tie points of the images of a site into `folder`, measured with noise.
///
/// * `days` – its images in order of time: a pair, or several one after the other
///
/// # Errors
/// [`SceneError::NoCamera`]; errors of writing.
pub(super) fn write_ties<'a>(
    folder: &Path,
    days: &[&'a Flown<'a>],
    terrain: &Terrain,
    wanted: &TiesWanted<'_>,
    seed: u64,
) -> Result<TiesTruth<'a>> {
    let site = days.first().map_or("", |flown| flown.arc.image.site.id);
    let images = days.iter().map(|flown| TrueImage::new(flown, terrain));
    let images = images.collect::<Result<Vec<_>>>()?;
    let mut random = Random::new(seed, &format!("ties {site}"));
    let mut exact = exact_ties(&images, wanted.count, terrain, &mut random)?;
    exact.extend(ties_at_shots(&images, terrain, wanted.shots_m)?);
    let (measured, truth) = spoil(exact, images.len(), wanted.noise, &mut random);
    put(&folder.join(ties_name(site)), &ties_table(&measured))?;
    let cameras = images.iter().map(|image| image.truth(terrain));
    Ok(TiesTruth {
        site,
        cameras: cameras.collect::<Result<_>>()?,
        ties: truth,
    })
}

/// Name of the file of a site.
pub(super) fn ties_name(site: &str) -> String {
    format!("{site}.csv")
}

fn projectors<'a>(images: &'a [TrueImage<'_>]) -> Result<Vec<Projector<'a, SampledOrientation>>> {
    images.iter().map(TrueImage::projector).collect()
}

/// The tie point at a place, measured without error in all images that show it; `None` unless two or more do.
fn tie(
    images: &[TrueImage<'_>],
    projectors: &[Projector<'_, SampledOrientation>],
    ground_m: Vector3<f64>,
) -> Option<Tie> {
    let seen = images.iter().zip(projectors).enumerate();
    let measures = seen.filter_map(|(index, (image, projector))| {
        Some((index, image.measure(projector, &ground_m)?))
    });
    let measures: Vec<_> = measures.collect();
    (measures.len() > 1).then_some(Tie { ground_m, measures })
}

/// `count` tie points distributed over the common ground of images in pairs, measured without error.
pub(super) fn exact_ties(
    images: &[TrueImage<'_>],
    count: u32,
    terrain: &Terrain,
    random: &mut Random,
) -> Result<Vec<Tie>> {
    let projectors = projectors(images)?;
    let (count, pairs) = (count as usize, images.len().div_ceil(2).max(1));
    // Places are those of the first images of all pairs in turn.
    let tie = |place: usize| {
        let ground_m = images[2 * (place % pairs)].any_ground_m(terrain, random)?;
        tie(images, &projectors, ground_m)
    };
    let places = 0..count * PLACES_PER_TIE;
    Ok(places.filter_map(tie).take(count).collect())
}

/// Tie points at some of the places `shots_m` that two images show, evenly selected, measured without error.
fn ties_at_shots(
    images: &[TrueImage<'_>],
    terrain: &Terrain,
    shots_m: &[Vector3<f64>],
) -> Result<Vec<Tie>> {
    let projectors = projectors(images)?;
    let tie = |shot_m: &Vector3<f64>| {
        // The first image of a pair that shows the shot shows this ground.
        let first = images.iter().zip(&projectors).step_by(2);
        let ground_m = first.filter_map(|(image, projector)| {
            let at = image.measure(projector, shot_m)?;
            image.ground_m(terrain, at.line, at.sample)
        });
        tie(images, &projectors, { ground_m }.next()?)
    };
    let all: Vec<Tie> = shots_m.iter().filter_map(tie).collect();
    let step = all.len().div_ceil(TIES_AT_SHOTS).max(1);
    Ok(all.into_iter().step_by(step).collect())
}

#[cfg(test)]
mod tests;
