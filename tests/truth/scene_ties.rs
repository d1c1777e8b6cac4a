//! Tie points of the synthetic mission: the cameras that measured them meet on the true ground, and the
//! cameras that labels and kernels tell miss each other by about one spacing of MOLA's footprints.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "helpers of tests may fail loudly"
)]

use crate::common;

use std::{collections::BTreeMap, fs};

use areograph::{
    config::{Document as _, SiteConfig, usual_instrument},
    geom::{
        ellipsoid::spherical_to_xyz_m,
        intersection::Weighting,
        oriented_camera::OrientedCamera,
        pushbroom::{Detector, Pose, Projector, SampledOrientation},
    },
    line_times::LineTimes,
    pds::ties::read_ties,
    spice::{KernelSet, Session},
    stages::{
        intersect::{IntersectOptions, IntersectedPoint, IntersectedTies, intersect_ties},
        sample_orientation::{Orientation, sample_orientation},
        tag_times::{ImageTimes, tag_times},
    },
    ties::TiePoint,
};
use common::{mission::mission, number};
use nalgebra::Vector3;
use serde_json::Value;

const SITES: [&str; 3] = ["eos_chasma", "gusev_crater", "isidis"];
/// The noise of the measurements.
const NOISE: Weighting = Weighting::Line {
    along_lines: 1.0,
    across_px: 1.0,
};
/// Radius of Mars at low latitudes, metres: good to 0.3 %.
const RADIUS_M: f64 = 3.39e6;

fn truth() -> Value {
    serde_json::from_slice(&fs::read(mission().join("truth.json")).unwrap()).unwrap()
}

fn vector(value: &Value) -> Vector3<f64> {
    Vector3::from_fn(|axis, _| number(&value[axis]))
}

/// A site with its two images.
struct Pair {
    config: SiteConfig,
    times: Vec<ImageTimes>,
    session: Session,
    truth: Value,
    ties: Vec<TiePoint>,
}

impl Pair {
    fn of(site: &str, orbit: &str) -> Self {
        let config = SiteConfig::load(&mission().join(format!("sites/{site}.toml")))
            .unwrap()
            .config;
        let metakernel = mission().join(format!("kernels/{orbit}.tm"));
        let session = Session::open(&KernelSet::from_metakernel(&metakernel).unwrap()).unwrap();
        let times = tag_times(&config.images, &session).unwrap();
        let file = read_ties(&mission().join(format!("ties/{site}.csv"))).unwrap();
        assert_eq!((file.ignored, file.complaints.len()), (0, 0));
        let all = truth();
        let mut own = all["ties"].as_array().unwrap().iter();
        let index_of = |name: &str| times.iter().position(|image| image.id == name);
        let ties = file.ties.into_iter();
        let ties = ties.map(|tie| tie.in_images(index_of, |name| panic!("{name}")));
        let ties = ties.collect();
        Self {
            config,
            times,
            session,
            truth: own.find(|ties| ties["site"] == site).unwrap().clone(),
            ties,
        }
    }

    fn orientation(&self, times: &ImageTimes) -> Orientation {
        let config = &self.config;
        sample_orientation(
            &self.session,
            times,
            &config.kernels,
            &config.pointing,
            &config.orientation,
        )
        .unwrap()
    }

    fn image(
        times: &ImageTimes,
        orientation: &Orientation,
        aside_m: Vector3<f64>,
    ) -> OrientedCamera<SampledOrientation> {
        let poses: Vec<(f64, Pose)> = orientation
            .samples
            .iter()
            .map(|sample| {
                let mut pose = sample.pose();
                pose.position_m += aside_m;
                (sample.line_offset, pose)
            })
            .collect();
        OrientedCamera {
            id: times.id.clone(),
            orientation: SampledOrientation::new(&poses).unwrap(),
            detector: Detector::new(
                usual_instrument(),
                times.crosstrack_summing,
                times.first_detector,
                times.samples,
            ),
            line_times: times.line_times.clone(),
        }
    }

    /// The images as labels and kernels tell them.
    fn as_told(&self) -> Vec<OrientedCamera<SampledOrientation>> {
        let image = |times| Self::image(times, &self.orientation(times), Vector3::zeros());
        self.times.iter().map(image).collect()
    }

    /// The images as they were truly taken, by the truth's biases.
    fn as_taken(&self) -> Vec<OrientedCamera<SampledOrientation>> {
        let cameras = self.truth["cameras"].as_array().unwrap();
        let image = |(times, camera): (&ImageTimes, &Value)| {
            assert_eq!(camera["image"], times.id.as_str());
            let late_s = number(&camera["time_bias_lines"]) * times.line_times.mean_period_s();
            let taken = ImageTimes {
                line_times: LineTimes::even(
                    times.line_times.start().plus(late_s),
                    times.line_times.lines(),
                    times.line_times.mean_period_s(),
                )
                .unwrap(),
                ..times.clone()
            };
            Self::image(
                times,
                &self.orientation(&taken),
                vector(&camera["position_bias_m"]),
            )
        };
        self.times.iter().zip(cameras).map(image).collect()
    }

    /// The truth of each tie point.
    fn truth_of_ties(&self) -> BTreeMap<String, Value> {
        let ties = self.truth["ties"].as_array().unwrap();
        ties.iter()
            .map(|tie| (tie["id"].as_str().unwrap().to_owned(), tie.clone()))
            .collect()
    }

    /// Tie points that are no blunders.
    fn good(&self) -> Vec<TiePoint> {
        let truth = self.truth_of_ties();
        assert_eq!(truth.len(), self.ties.len());
        let mut good = self.ties.clone();
        good.retain(|tie| truth[&tie.id]["blunder"].is_null());
        good
    }

    /// Metres of ground from line to line.
    fn line_spacing_m(&self, image: usize) -> f64 {
        let samples = self.orientation(&self.times[image]).samples;
        let [first, last] = [&samples[0], &samples[samples.len() - 1]].map(|sample| {
            let ground = sample.boresight.unwrap();
            spherical_to_xyz_m(ground.longitude_rad, ground.latitude_rad, RADIUS_M)
        });
        (last - first).norm() / f64::from(self.times[image].line_times.lines())
    }
}

fn intersected(
    images: &[OrientedCamera<SampledOrientation>],
    ties: &[TiePoint],
    weighting: Weighting,
) -> IntersectedTies {
    let options = IntersectOptions {
        weighting,
        ..IntersectOptions::default()
    };
    let found = intersect_ties(images, ties, &options).unwrap();
    assert!(found.rejected.is_empty(), "{:?}", found.rejected);
    found
}

/// Squared distance of each point from its true place, in units of the noise's own covariance: 3 on average.
fn squares_off(found: &IntersectedTies, truth: &BTreeMap<String, Value>) -> Vec<f64> {
    let square = |point: &IntersectedPoint| {
        let ground_m = vector(&truth[&point.id]["ground_iau2000_m"]);
        let off_m = point.ground.xyz_m - ground_m;
        let covariance_m2 = point.covariance_m2 / found.sigma0.powi(2);
        off_m.dot(&(covariance_m2.try_inverse().unwrap() * off_m))
    };
    found.points.iter().map(square).collect()
}

#[test]
fn each_pair_has_154_ties_and_8_blunders() {
    for site in SITES {
        let pair = Pair::of(site, "nav");
        assert_eq!(pair.ties.len(), 154, "{site}");
        assert_eq!(pair.good().len(), 154 - 8, "{site}");
        for measure in pair.ties.iter().flat_map(|tie| &tie.measures) {
            let times = &pair.times[measure.image];
            assert!((0.0..f64::from(times.lines_delivered)).contains(&measure.line));
            assert!((0.0..f64::from(times.samples)).contains(&measure.sample));
        }
    }
}

#[test]
fn the_images_as_they_were_taken_meet_on_the_true_ground() {
    for site in SITES {
        let pair = Pair::of(site, "gsfc");
        let found = intersected(&pair.as_taken(), &pair.good(), NOISE);
        let squares = squares_off(&found, &pair.truth_of_ties());
        let mean_square = squares.iter().sum::<f64>() / squares.len() as f64;
        println!(
            "{site}: sigma0 {:.3}, mean square {mean_square:.3}",
            found.sigma0
        );
        // 146 redundant observations: 0.06, times three; 438 coordinates: 0.2, times four.
        assert!(
            (found.sigma0 - 1.0).abs() < 0.18,
            "{site}: {}",
            found.sigma0
        );
        assert!((mean_square - 3.0).abs() < 0.8, "{site}: {mean_square}");
        for image in &found.images {
            let along = &image.reprojection.along;
            // 0.7 lines over 146 points: 0.06, times four. Read without its bias, pointing would be 70 lines off at nadir.
            assert!(along.mean.abs() < 0.25, "{}: {along:?}", image.image);
        }
    }
}

#[test]
fn blunders_are_where_the_truth_says() {
    /// One good point in a hundred thousand is farther off.
    const SQUARE_MAX: f64 = 25.9;
    for site in SITES {
        let pair = Pair::of(site, "gsfc");
        let (images, truth) = (pair.as_taken(), pair.truth_of_ties());
        let square = |tie: &TiePoint| {
            // A single point has a standard deviation of unit weight of its own, which is taken out again.
            let found = intersected(&images, std::slice::from_ref(tie), NOISE);
            squares_off(&found, &truth)[0]
        };
        for tie in &pair.ties {
            let blunder = &truth[&tie.id]["blunder"];
            assert_eq!(
                square(tie) < SQUARE_MAX,
                blunder.is_null(),
                "{site} {}",
                tie.id
            );
            if blunder.is_null() {
                continue;
            }
            let [line, sample] = [&blunder["line_error"], &blunder["sample_error"]].map(number);
            let length_px = line.hypot(sample);
            assert!((20.0..100.0).contains(&length_px), "{blunder}");
            let mut corrected = tie.clone();
            for measure in &mut corrected.measures {
                if blunder["image"] == pair.times[measure.image].id.as_str() {
                    measure.line -= line;
                    measure.sample -= sample;
                }
            }
            assert!(square(&corrected) < SQUARE_MAX, "{site} {}", tie.id);
        }
    }
}

/// Mean of how many lines after its true ground each image as told has its tie points.
fn shifts_lines(pair: &Pair, images: &[OrientedCamera<SampledOrientation>]) -> [f64; 2] {
    let truth = pair.truth_of_ties();
    let good = pair.good();
    [0, 1].map(|index| {
        let image = &images[index];
        let projector = Projector::new(&image.orientation, image.lines()).unwrap();
        let shifts = good.iter().map(|tie| {
            let ground_m = vector(&truth[&tie.id]["ground_iau2000_m"]);
            let measure = tie.measures.iter().find(|measure| measure.image == index);
            let (x_lines, _) = image.focal_plane_coordinates(measure.unwrap().line, 0.0);
            x_lines - projector.project(&ground_m).unwrap().x
        });
        shifts.sum::<f64>() / good.len() as f64
    })
}

#[test]
fn the_images_as_told_miss_each_other_by_about_a_footprint_spacing() {
    for site in SITES {
        let pair = Pair::of(site, "nav");
        let images = pair.as_told();
        let focal = IntersectOptions::default().weighting;
        let found = intersected(&images, &pair.good(), focal);
        let along = [0, 1].map(|image| found.images[image].reprojection.along);
        let spacing_m = [0, 1].map(|image| pair.line_spacing_m(image));
        let apart_m = along[0].mean.abs() * spacing_m[0] + along[1].mean.abs() * spacing_m[1];
        println!(
            "{site}: M_x1 {:.2} ± {:.2}, M_x2 {:.2} ± {:.2} lines of {:.3} and {:.3} m: {apart_m:.1} m",
            along[0].mean,
            along[0].standard_deviation,
            along[1].mean,
            along[1].standard_deviation,
            spacing_m[0],
            spacing_m[1]
        );
        // Signs of Shan et al. 2005, Table 5.
        let first = if site == "isidis" { 1.0 } else { -1.0 };
        assert!(
            first * along[0].mean > 0.0 && first * along[1].mean < 0.0,
            "{site}"
        );
        // The same table: 225 m to 271 m; errors of place of 20 m an axis and image move that by 28 m.
        assert!((190.0..330.0).contains(&apart_m), "{site}: {apart_m} m");
        // What is on the ground falls as far apart in the two images: MOLA's misregistration.
        let shifts = shifts_lines(&pair, &images);
        let ground_apart_m = (shifts[0] * spacing_m[0] - shifts[1] * spacing_m[1]).abs();
        println!("  true ground falls {shifts:.2?} lines off, {ground_apart_m:.1} m apart");
        // Two ways to the same number, which agree to 2 % (the flights are not quite parallel).
        assert!(
            (apart_m / ground_apart_m - 1.0).abs() < 0.02,
            "{apart_m} {ground_apart_m}"
        );
    }
}
