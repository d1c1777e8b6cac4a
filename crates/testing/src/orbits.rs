//! Many images of the same ground from as many orbits, with shots and many tie points.

use areograph_geom::{
    bundle::{BundleImage, BundlePoint, KnownCoordinates, Network, Range, View},
    intersection::{IntersectionLimits, intersect},
    pushbroom::{
        CorrectedOrientation, Distortion, ExteriorOrientation, OrientationCorrection, Pose,
        Projector, SampledOrientation,
    },
};
use nalgebra::{Vector2, Vector3};

use super::{
    recipe::{HALF_SWATH_PX, Normals, RANGE_M, SHOT_INTERVAL_S, aimed, project, ray, sigmas},
    scene::{GUSEV, Scene},
};

/// Images of one place, each from a different orbit.
pub const ORBITS: usize = 20;
/// Orbits are evenly spaced from this far west to this far east of the place, degrees.
const FARTHEST_DEG: f64 = 2.45;
/// Step between the three images of a tie, in orbits: rays converge, and the images are connected in a ring.
const STEP: usize = 7;
/// One in this number of ties between two places is measured in images of both.
const LINKS: usize = 10;
/// Shots along the track of the image that looks down most steeply.
const SHOTS: usize = 120;

/// Images over consecutive places along the flight, half an image apart.
#[derive(Debug, Clone, Copy)]
pub struct Orbits {
    pub places: usize,
    /// Ties, evenly spread over the places.
    pub ties: usize,
    /// Standard deviation of their measurements, lines and pixels.
    pub noise: f64,
    /// Standard deviation of an error of all line times of an image, lines.
    pub shift_lines: f64,
    /// Standard deviation of a constant error of each image's position, metres.
    pub position_bias_m: f64,
}

/// An image with its true and its known orientation.
struct Flown {
    scene: Scene,
    truth: SampledOrientation,
    known: BundleImage<SampledOrientation>,
}

/// The lines of the samples of an orientation, 31 as in the flow.
pub fn instants(half_lines: f64) -> Vec<f64> {
    let samples = -15..=15;
    samples.map(|k| f64::from(k) / 15.0 * half_lines).collect()
}

/// The orientation through its samples.
pub fn sampled(orientation: &impl ExteriorOrientation, half_lines: f64) -> SampledOrientation {
    let samples: Vec<(f64, Pose)> = instants(half_lines)
        .into_iter()
        .map(|x| (x, orientation.pose(x)))
        .collect();
    SampledOrientation::new(&samples).unwrap()
}

impl Orbits {
    /// The network of these images; as many images as places times [`ORBITS`].
    pub fn network(&self) -> Network<SampledOrientation> {
        let mut normals = Normals::new(11);
        let mut nadir = GUSEV;
        let mut flown: Vec<Flown> = Vec::new();
        for _ in 0..self.places {
            for orbit in 0..ORBITS {
                flown.push(self.fly(&nadir, orbit, &mut normals));
            }
            // The next place is where this image ends.
            let end_m = nadir.boresight_ground_m(0.5 * nadir.duration_s).normalize();
            nadir.latitude_deg = end_m.z.asin().to_degrees();
            nadir.longitude_deg = end_m.y.atan2(end_m.x).to_degrees();
        }
        let mut network = Network {
            images: flown.iter().map(|image| image.known.clone()).collect(),
            ..Network::default()
        };
        for place in 0..self.places {
            shoot(&flown, place, &mut normals, &mut network);
        }
        let projectors: Vec<_> = flown
            .iter()
            .map(|image| Projector::new(&image.truth, f64::from(image.scene.lines)).unwrap())
            .collect();
        for tie in 0..self.ties {
            self.tie(tie, &flown, &projectors, &mut normals, &mut network);
        }
        network
    }

    fn fly(&self, nadir: &Scene, orbit: usize, normals: &mut Normals) -> Flown {
        let share = 2.0 * orbit as f64 / (ORBITS as f64 - 1.0) - 1.0;
        let scene = aimed(nadir, FARTHEST_DEG * share);
        let half_lines = 0.5 * f64::from(scene.lines);
        let flight = scene.euler(2);
        let mut bias =
            OrientationCorrection::of(&[0.0; 18], half_lines, self.shift_lines * normals.next());
        bias.position_m[0] = normals.vector() * self.position_bias_m;
        let late = CorrectedOrientation {
            base: flight,
            correction: bias,
        };
        Flown {
            scene,
            truth: sampled(&flight, half_lines),
            known: BundleImage {
                base: sampled(&late, half_lines),
                half_lines,
                line_period_s: scene.line_period_s(),
                focal_length_px: scene.focal_length_px(),
                distortion: Distortion::NONE,
                sigmas: sigmas(100.0),
                time_bias_sigma_s: 0.0,
            },
        }
    }

    /// A tie in three images; one in [`LINKS`] is in two images of its place and in one of the next.
    fn tie(
        &self,
        tie: usize,
        flown: &[Flown],
        projectors: &[Projector<'_, SampledOrientation>],
        normals: &mut Normals,
        network: &mut Network<SampledOrientation>,
    ) {
        let place = tie * self.places / self.ties;
        let first = tie % ORBITS;
        let links = (tie / ORBITS).is_multiple_of(LINKS) && place + 1 < self.places;
        let images = [0, 1, 2].map(|step| {
            let orbit = (first + step * STEP) % ORBITS;
            (place + usize::from(links && step == 2)) * ORBITS + orbit
        });
        loop {
            let scene = &flown[images[0]].scene;
            let at_s = (normals.uniform() - 0.5) * scene.duration_s;
            let pose = scene.pose(at_s);
            let below_m = scene.boresight_ground_m(at_s);
            let across = (2.0 * normals.uniform() - 1.0) * HALF_SWATH_PX / scene.focal_length_px();
            let aside_m = below_m + pose.mars_to_camera.row(1).transpose() * (across * RANGE_M);
            let point_m = aside_m.normalize() * (below_m.norm() + 150.0 * normals.next());
            let seen = images.map(|image| {
                project(
                    &projectors[image],
                    network.images[image].focal_length_px,
                    &point_m,
                )
            });
            let inside = seen.iter().zip(images).all(|((x_lines, y_px), image)| {
                x_lines.abs() < network.images[image].half_lines && y_px.abs() < HALF_SWATH_PX
            });
            if !inside {
                continue;
            }
            let measured = seen.map(|(x_lines, y_px)| {
                (
                    x_lines + self.noise * normals.next(),
                    y_px + self.noise * normals.next(),
                )
            });
            let rays: Vec<_> = images
                .iter()
                .zip(measured)
                .map(|(image, (x_lines, y_px))| ray(&network.images[*image], x_lines, y_px))
                .collect();
            let start = intersect(&rays, &IntersectionLimits::default()).unwrap();
            for (image, (x_lines, y_px)) in images.into_iter().zip(measured) {
                network.views.push(View {
                    point: network.points.len(),
                    image,
                    x_lines,
                    y_px,
                    sigma_px: Vector2::new(1.0, 1.0),
                });
            }
            network.points.push(BundlePoint {
                ground_m: start.ground_m,
                known: None,
            });
            return;
        }
    }
}

/// Shots along the track of the middle image of a place, with ranges from there.
fn shoot(
    flown: &[Flown],
    place: usize,
    normals: &mut Normals,
    network: &mut Network<SampledOrientation>,
) {
    let image = place * ORBITS + ORBITS / 2;
    let Flown { scene, truth, .. } = &flown[image];
    for shot in 0..SHOTS {
        let at_s = (shot as f64 - 0.5 * (SHOTS as f64 - 1.0)) * SHOT_INTERVAL_S;
        let ground_m = scene.boresight_ground_m(at_s);
        let point_m = ground_m + ground_m.normalize() * (50.0 * normals.next());
        let x_lines = at_s / scene.line_period_s();
        let distance_m = (truth.pose(x_lines).position_m - point_m).norm();
        network.ranges.push(Range {
            point: network.points.len(),
            image,
            x_lines,
            to_laser_m: Vector3::zeros(),
            range_m: distance_m + 7.0 * normals.next(),
            sigma_m: 10.0,
            profile: place,
        });
        network.points.push(BundlePoint {
            ground_m: point_m + normals.vector() * 10.0,
            known: Some(KnownCoordinates::of_sigmas(Vector3::repeat(10.0))),
        });
    }
    network.range_bias_sigmas_m.push(0.0);
}
