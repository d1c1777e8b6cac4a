//! Tie points of an image pair, as images show them that were taken at other times and from other places
//! than labels and kernels say.

use std::path::Path;

use nalgebra::Vector3;

use super::{
    arc::Arc,
    error::SceneError,
    files::put,
    random::Random,
    terrain::Terrain,
    truth::{BlunderTruth, TieCameraTruth, TieTruth, TiesTruth},
};
use crate::{
    config::usual_instrument,
    constants::MARS_IAU2000,
    error::Result,
    geom::{
        mars_rotation::mars_matrix,
        oriented_camera::OrientedCamera,
        pushbroom::{Detector, ExteriorOrientation, Pose, Projector, SampledOrientation},
    },
    pds::ties::ties_table,
    ties::{TieMeasure, TiePoint},
};

/// Tie points of a pair, as many as the paper has at Gusev; fewer where the images hardly overlap.
const TIES: usize = 154;
/// Places of the first image that are looked at for one tie point.
const PLACES_PER_TIE: usize = 20;
/// No tie point is nearer to the edge of an image, pixels: blunders stay inside.
const EDGE_PX: f64 = BLUNDER_PX[1] + 5.0 * NOISE_PX;
/// Standard deviation of a measurement, lines and samples.
const NOISE_PX: f64 = 1.0;
/// One tie point of so many is a blunder, the first of them in the middle of the first so many.
const BLUNDER_EVERY: usize = 20;
/// Shortest and longest blunder, in any direction.
const BLUNDER_PX: [f64; 2] = [20.0, 100.0];
/// Standard deviation of the error of a camera's place along each axis, metres.
const POSITION_BIAS_M: f64 = 20.0;
/// Intervals between poses of an image, a tenth of a second each: where the bus changes its rate,
/// interpolation is off by 0.1 mm on the ground.
const INTERVALS: u32 = 160;

/// An image as it was truly taken.
struct TrueImage<'a> {
    arc: &'a Arc,
    position_bias_m: Vector3<f64>,
    oriented_camera: OrientedCamera<SampledOrientation>,
}

/// A point on the ground and where both images see it.
struct Tie {
    ground_m: Vector3<f64>,
    measures: [TieMeasure<String>; 2],
}

impl<'a> TrueImage<'a> {
    /// The image of `arc`, with an error of its place from `seed`.
    fn new(arc: &'a Arc, seed: u64) -> Result<Self> {
        let mut random = Random::new(seed, &format!("camera {}", arc.image.id));
        let position_bias_m = POSITION_BIAS_M * Vector3::from_fn(|_axis, _column| random.normal());
        let orientation = SampledOrientation::new(&poses(arc, &position_bias_m))
            .map_err(|error| no_camera(arc, &error))?;
        let detector = Detector::new(
            usual_instrument(),
            arc.image.summing,
            0,
            arc.image.samples(),
        );
        Ok(Self {
            arc,
            position_bias_m,
            oriented_camera: OrientedCamera {
                id: arc.image.id.to_owned(),
                orientation,
                detector,
                lines: f64::from(arc.image.lines_header),
            },
        })
    }

    fn projector(&self) -> Result<Projector<'_, SampledOrientation>> {
        let projector = Projector::new(
            &self.oriented_camera.orientation,
            self.oriented_camera.lines,
        );
        Ok(projector.map_err(|error| no_camera(self.arc, &error))?)
    }

    /// Line and sample at the far edges of where tie points may lie.
    fn extent_px(&self) -> [f64; 2] {
        let lines = f64::from(self.arc.image.lines_delivered);
        [lines, self.oriented_camera.detector.samples].map(|length| length - EDGE_PX)
    }

    /// The ground that a random place of the image shows.
    fn any_ground_m(&self, terrain: &Terrain, random: &mut Random) -> Option<Vector3<f64>> {
        let [line, sample] = self
            .extent_px()
            .map(|end_px| random.between(EDGE_PX, end_px));
        let (x_lines, _) = self.oriented_camera.focal_plane_coordinates(line, sample);
        let pose = self.oriented_camera.orientation.pose(x_lines);
        let camera = self.oriented_camera.detector.look(sample);
        let direction = pose.mars_to_camera.tr_mul(&camera).normalize();
        let range_m = terrain.range_m(&pose.position_m, &direction)?;
        Some(pose.position_m + range_m * direction)
    }

    /// Where the image shows a point, unless that is outside or too near to an edge.
    fn measure(
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
        let measure = TieMeasure {
            image: self.oriented_camera.id.clone(),
            line: seen.x + 0.5 * self.oriented_camera.lines,
            sample: self.oriented_camera.detector.sample(y_px),
        };
        let [line_end, sample_end] = self.extent_px();
        let inside = (EDGE_PX..line_end).contains(&measure.line)
            && (EDGE_PX..sample_end).contains(&measure.sample);
        inside.then_some(measure)
    }

    fn truth(&self) -> TieCameraTruth {
        TieCameraTruth {
            image: self.arc.image.id,
            time_bias_lines: self.arc.image.time_bias_lines,
            position_bias_m: self.position_bias_m.into(),
        }
    }
}

/// Lines from the middle with true poses: those that the label's time would give, `time_bias_lines` later,
/// and `position_bias_m` aside.
fn poses(arc: &Arc, position_bias_m: &Vector3<f64>) -> Vec<(f64, Pose)> {
    let lines = f64::from(arc.image.lines_header);
    (0..=INTERVALS)
        .map(|index| {
            let line = lines * f64::from(index) / f64::from(INTERVALS);
            let exposed_s = (line + arc.image.time_bias_lines) * arc.image.line_period_s();
            let et = arc.exposed.start.plus(exposed_s);
            let orbit_m = mars_matrix(&MARS_IAU2000, et) * arc.orbit.state(et).position_m;
            let pose = Pose {
                position_m: orbit_m + position_bias_m,
                mars_to_camera: arc.camera_to_mars(et).transpose(),
            };
            (line - 0.5 * lines, pose)
        })
        .collect()
}

fn no_camera(arc: &Arc, error: &dyn std::error::Error) -> SceneError {
    SceneError::NoCamera {
        image: arc.image.id.to_owned(),
        error: error.to_string(),
    }
}

/// Writes the tie points of a site's images, the first two of `arcs`, into `folder`.
///
/// # Errors
/// [`SceneError::NoCamera`]; the system's refusal to write.
pub(super) fn write_ties(
    folder: &Path,
    [first, second]: [&Arc; 2],
    terrain: &Terrain,
    seed: u64,
) -> Result<TiesTruth> {
    let site = first.image.site.id;
    let pair = [TrueImage::new(first, seed)?, TrueImage::new(second, seed)?];
    let mut random = Random::new(seed, &format!("ties {site}"));
    let exact = exact_ties(&pair, terrain, &mut random)?;
    let (measured, truth) = spoil(exact, &mut random);
    put(&folder.join(ties_name(site)), &ties_table(&measured))?;
    Ok(TiesTruth {
        site,
        cameras: pair.each_ref().map(TrueImage::truth),
        ties: truth,
    })
}

/// Name of the file of a site.
pub(super) fn ties_name(site: &str) -> String {
    format!("{site}.csv")
}

/// Tie points spread over the ground that both images show, measured without error.
fn exact_ties(
    pair: &[TrueImage<'_>; 2],
    terrain: &Terrain,
    random: &mut Random,
) -> Result<Vec<Tie>> {
    let projectors = [pair[0].projector()?, pair[1].projector()?];
    let tie = |_place| {
        let ground_m = pair[0].any_ground_m(terrain, random)?;
        let first = pair[0].measure(&projectors[0], &ground_m)?;
        let second = pair[1].measure(&projectors[1], &ground_m)?;
        Some(Tie {
            ground_m,
            measures: [first, second],
        })
    };
    let places = 0..TIES * PLACES_PER_TIE;
    Ok(places.filter_map(tie).take(TIES).collect())
}

/// Adds noise to all measurements, and blunders to a few.
fn spoil(ties: Vec<Tie>, random: &mut Random) -> (Vec<TiePoint<String>>, Vec<TieTruth>) {
    let spoilt = ties.into_iter().enumerate().map(|(index, tie)| {
        let id = format!("tie-{:03}", index + 1);
        let mut measures = tie.measures.to_vec();
        for measure in &mut measures {
            measure.line += NOISE_PX * random.normal();
            measure.sample += NOISE_PX * random.normal();
        }
        let blunder =
            (index % BLUNDER_EVERY == BLUNDER_EVERY / 2).then(|| blunder(&mut measures, random));
        let truth = TieTruth {
            id: id.clone(),
            ground_iau2000_m: tie.ground_m.into(),
            blunder,
        };
        (TiePoint { id, measures }, truth)
    });
    spoilt.unzip()
}

/// Moves one of the measurements far away.
fn blunder(measures: &mut [TieMeasure<String>], random: &mut Random) -> BlunderTruth {
    let image = usize::from(random.between(0.0, 1.0) < 0.5);
    let [least_px, most_px] = BLUNDER_PX;
    let length_px = random.between(least_px, most_px);
    let (sin, cos) = random.between(0.0, std::f64::consts::TAU).sin_cos();
    let [line_error, sample_error] = [length_px * cos, length_px * sin];
    let measure = &mut measures[image];
    measure.line += line_error;
    measure.sample += sample_error;
    BlunderTruth {
        image: measure.image.clone(),
        line_error,
        sample_error,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        geom::intersection::{IntersectionLimits, Ray, intersect},
        scene::plan::{IMAGES, SITES, Site},
        time::Et,
    };

    fn arcs(site: &str) -> Vec<Arc> {
        let of_site = IMAGES.iter().filter(|image| image.site.id == site);
        of_site
            .map(|image| Arc::new(image, Et::from_seconds(3.9e7), 1_200.0).unwrap())
            .collect()
    }

    fn terrain(seed: u64) -> Terrain {
        Terrain::new(seed, &SITES.map(Site::direction))
    }

    fn ray(image: &TrueImage<'_>, measure: &TieMeasure<String>) -> Ray {
        let (x_lines, focal_px) = image
            .oriented_camera
            .focal_plane_coordinates(measure.line, measure.sample);
        let pose = image.oriented_camera.orientation.pose(x_lines);
        Ray {
            position_m: pose.position_m,
            mars_to_camera: pose.mars_to_camera,
            focal_length_px: image.oriented_camera.detector.focal_length_px,
            focal_px,
            along_sigma_px: 1.0,
            across_sigma_px: 1.0,
        }
    }

    #[test]
    fn exact_ties_lie_on_the_ground_and_meet_there() {
        for (site, seed) in SITES
            .iter()
            .flat_map(|site| [1, 2, 3, 4, 5, 6].map(|s| (site, s)))
        {
            let arcs = arcs(site.id);
            let pair = [0, 1].map(|image| TrueImage::new(&arcs[image], seed).unwrap());
            let terrain = terrain(seed);
            let ties = exact_ties(&pair, &terrain, &mut Random::new(seed, "test")).unwrap();
            println!("{} seed {seed}: {} ties", site.id, ties.len());
            assert_eq!(ties.len(), TIES, "{} seed {seed}", site.id);
            for tie in &ties {
                let height_m = tie.ground_m.norm() - terrain.radius_m(&tie.ground_m.normalize());
                assert!(height_m.abs() < 1e-4, "{height_m}"); // metres; rays end 0.01 mm from the ground
                let rays = [0, 1].map(|image| ray(&pair[image], &tie.measures[image]));
                let met = intersect(&rays, &IntersectionLimits::default()).unwrap();
                let off_m = (met.ground_m - tie.ground_m).norm();
                assert!(off_m < 1e-3, "{off_m} m"); // intersection itself stops at 0.1 mm
            }
        }
    }

    #[test]
    fn poses_between_those_of_the_arc_are_those_of_the_arc() {
        for image in &IMAGES {
            let arc = Arc::new(image, Et::from_seconds(3.9e7), 1_200.0).unwrap();
            let camera = TrueImage::new(&arc, 1).unwrap();
            for share in [0.123, 0.345, 0.567, 0.789] {
                let line = share * camera.oriented_camera.lines;
                let x_lines = line - 0.5 * camera.oriented_camera.lines;
                let pose = camera.oriented_camera.orientation.pose(x_lines);
                let exposed_s = (line + image.time_bias_lines) * image.line_period_s();
                let et = arc.exposed.start.plus(exposed_s);
                let orbit_m = mars_matrix(&MARS_IAU2000, et) * arc.orbit.state(et).position_m;
                let off_m = (pose.position_m - orbit_m - camera.position_bias_m).norm();
                assert!(off_m < 1e-4, "{} {off_m} m", image.id); // as the kernels themselves
                let turned = pose.mars_to_camera * arc.camera_to_mars(et);
                let off_rad = (turned - nalgebra::Matrix3::identity()).abs().max();
                assert!(off_rad < 1e-9, "{} {off_rad} rad", image.id); // 0.4 mm on the ground
            }
        }
    }

    #[test]
    fn noise_and_blunders_are_as_told() {
        let arcs = arcs("isidis");
        let pair = [0, 1].map(|image| TrueImage::new(&arcs[image], 1).unwrap());
        let exact = exact_ties(&pair, &terrain(1), &mut Random::new(1, "test")).unwrap();
        let required: Vec<[TieMeasure<String>; 2]> =
            exact.iter().map(|tie| tie.measures.clone()).collect();
        let (measured, truth) = spoil(exact, &mut Random::new(1, "noise"));
        let (mut squares, mut count) = (0.0, 0.0);
        for ((tie, truth), required) in measured.iter().zip(&truth).zip(&required) {
            assert_eq!(tie.id, truth.id);
            for (measure, required) in tie.measures.iter().zip(required) {
                let told = truth
                    .blunder
                    .as_ref()
                    .filter(|told| told.image == measure.image);
                let [line_error, sample_error] =
                    told.map_or([0.0; 2], |told| [told.line_error, told.sample_error]);
                for noise in [
                    measure.line - required.line - line_error,
                    measure.sample - required.sample - sample_error,
                ] {
                    squares += noise * noise;
                    count += 1.0;
                }
            }
        }
        let sigma_px = f64::sqrt(squares / count);
        assert!((sigma_px - NOISE_PX).abs() < 0.1, "{sigma_px}"); // 616 numbers: 0.03 px, times three
        let blunders: Vec<f64> = truth
            .iter()
            .filter_map(|tie| tie.blunder.as_ref())
            .map(|blunder| blunder.line_error.hypot(blunder.sample_error))
            .collect();
        assert_eq!(blunders.len(), 8); // 5 % of 154
        assert!(
            blunders.iter().all(|px| (20.0..100.0).contains(px)),
            "{blunders:?}"
        );
    }
}
