//! Intersection of a Gusev-like pair: exact, with a line bias, with noise, and what is refused.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "helpers of tests may fail loudly"
)]

use crate::common;
use areograph_testing::recipe;

use areograph::{
    error::Kind,
    geom::{
        intersection::{Unintersected, Weighting},
        oriented_camera::OrientedCamera,
        pushbroom::{Detector, Distortion, EulerPolynomial},
    },
    stages::intersect::{IntersectOptions, IntersectedTies, TieRejection, intersect_ties},
    ties::{TieMeasure, TiePoint},
};
use nalgebra::Vector3;
use recipe::{Normals, Recipe};

fn images() -> Vec<OrientedCamera<EulerPolynomial>> {
    let scenes = recipe::pair(recipe::Recipe::GUSEV.place_deg);
    let names = ["nadir", "oblique"];
    scenes
        .iter()
        .zip(names)
        .map(|(scene, id)| OrientedCamera {
            id: id.to_owned(),
            orientation: scene.euler(2),
            detector: Detector {
                focal_length_px: scene.focal_length_px(),
                boresight_sample: recipe::HALF_SWATH_PX,
                sample_sense: -1.0,
                samples: 2.0 * recipe::HALF_SWATH_PX,
                distortion: Distortion::NONE,
            },
            line_times: common::line_times(f64::from(scene.lines), scene.line_period_s()),
        })
        .collect()
}

/// `count` exact ties and their true points; `error` is added to line and sample of each image.
fn ties(
    count: usize,
    mut error: impl FnMut(usize) -> (f64, f64),
) -> (Vec<TiePoint>, Vec<Vector3<f64>>) {
    let simulated = Recipe {
        ties: count,
        ..Recipe::EXACT
    }
    .simulate();
    let images = images();
    let points = simulated.points_m[simulated.shots..].to_vec();
    let ties = (0..count)
        .map(|tie| TiePoint {
            id: format!("tie {tie}"),
            known: None,
            measures: simulated
                .network
                .views
                .iter()
                .filter(|view| view.point == simulated.shots + tie)
                .map(|view| {
                    let (lines, pixels) = error(view.image);
                    let image = &images[view.image];
                    TieMeasure {
                        image: view.image,
                        line: view.x_lines + 0.5 * image.lines() + lines,
                        sample: image.detector.sample(view.y_px) + pixels,
                        sigma_px: None,
                    }
                })
                .collect(),
        })
        .collect();
    (ties, points)
}

fn intersected(ties: &[TiePoint], weighting: Weighting) -> IntersectedTies {
    let options = IntersectOptions {
        weighting,
        ..IntersectOptions::default()
    };
    intersect_ties(&images(), ties, &options).unwrap()
}

const FOCAL: Weighting = Weighting::Focal { sigma_px: 1.0 };
const LINE: Weighting = Weighting::Line {
    along_lines: 1.0,
    across_px: 1.0,
};

#[test]
fn exact_measurements_give_the_truth() {
    let (ties, truth) = ties(154, |_| (0.0, 0.0));
    let result = intersected(&ties, FOCAL);
    assert_eq!((result.points.len(), result.rejected.len()), (154, 0));
    for (point, truth) in result.points.iter().zip(&truth) {
        assert!((point.ground.xyz_m - truth).norm() < 1e-3); // metres
        for measure in &point.measures {
            assert!(measure.focal_along_px.abs() < 1e-6 && measure.focal_across_px.abs() < 1e-6);
            assert!(measure.reprojection_lines.abs() < 1e-6);
            assert!(measure.reprojection_px.abs() < 1e-6);
        }
        assert!(!point.outlier);
    }
}

/// Ground size of a pixel over that of a line: what shares a disagreement between the images.
fn ground_per_px_and_line(point_m: &Vector3<f64>, image: usize) -> (f64, f64) {
    let scenes = recipe::pair(recipe::Recipe::GUSEV.place_deg);
    let range_m = (scenes[image].pose(0.0).position_m - point_m).norm();
    let spacing_m = (scenes[image].boresight_ground_m(scenes[image].line_period_s())
        - scenes[image].boresight_ground_m(0.0))
    .norm();
    (range_m / scenes[image].focal_length_px(), spacing_m)
}

#[test]
fn a_line_bias_is_shared_as_the_weights_say() {
    for (weighting, focal) in [(FOCAL, true), (LINE, false)] {
        let (ties, _) = ties(154, |image| ([60.0, 0.0][image], 0.0));
        let result = intersected(&ties, weighting);
        let [first, second] = [0, 1].map(|image| result.images[image].reprojection);
        println!("{first:.4?}\n{second:.4?}\n{:.4?}", result.images[0].focal);
        assert!(first.along.mean > 0.0 && second.along.mean < 0.0);
        let middle = &result.points[77].ground.xyz_m;
        let [(g1, s1), (g2, s2)] = [0, 1].map(|image| ground_per_px_and_line(middle, image));
        let law = if focal {
            (g1 / g2).powi(2) * s2 / s1
        } else {
            s1 / s2
        };
        let share = -first.along.mean / second.along.mean;
        assert!((share / law - 1.0).abs() < 0.02, "{share} {law}");
        for image in &result.images {
            assert!(image.focal.along.standard_deviation < 0.1, "{image:?}");
            // Flight and detector are askew: the reprojection shows it, the focal plane does not.
            let askew = image.reprojection.across.mean / image.reprojection.along.mean;
            assert!((0.07..0.15).contains(&askew.abs()), "{askew}");
            let focal = image.focal.across.mean / image.focal.along.mean;
            assert!(focal.abs() < 0.014, "{focal}");
        }
    }
}

#[test]
fn noise_comes_out_as_simulated_and_as_the_covariance_says() {
    const TIES: usize = 3_000;
    let mut normals = Normals::new(3);
    let (ties, truth) = ties(TIES, |_| (normals.next(), normals.next()));
    let near = |value: f64, expected: f64| {
        assert!((value / expected - 1.0).abs() < 0.1, "{value} {expected}");
    };
    let focal = intersected(&ties, FOCAL);
    // Standard deviations of a prototype: lines, then focal-plane pixels.
    for (image, (lines, focal_px)) in focal.images.iter().zip([(0.71, 1.11), (0.73, 1.19)]) {
        near(image.reprojection.along.standard_deviation, lines);
        near(image.focal.along.standard_deviation, focal_px);
        // Height absorbs what lies across the track; prototypes of the pair found 0.072 to 0.087 px.
        let across_px = image.reprojection.across.standard_deviation;
        assert!((0.065..0.095).contains(&across_px), "{across_px}");
    }
    let line = intersected(&ties, LINE);
    // Noise and weights agree: one standard deviation of unit weight.
    near(line.sigma0, 1.0);
    let mut squares = 0.0;
    // Noise takes a few of the outermost out of their image.
    assert!(line.rejected.len() < TIES / 200);
    let truth: std::collections::BTreeMap<&str, &Vector3<f64>> =
        ties.iter().map(|tie| tie.id.as_str()).zip(&truth).collect();
    for point in &line.points {
        let error = point.ground.xyz_m - truth[point.id.as_str()];
        let covariance = point.covariance_m2;
        squares += error.dot(&(covariance.try_inverse().unwrap() * error)) / 3.0;
    }
    near((squares / line.points.len() as f64).sqrt(), 1.0);
    // Five robust standard deviations: one in three thousand on a line, a few more beside it.
    let outliers = line.points.iter().filter(|point| point.outlier).count();
    assert!(outliers < TIES / 100, "{outliers}");
}

#[test]
fn what_cannot_be_intersected_is_counted() {
    let (mut ties, _) = ties(6, |_| (0.0, 0.0));
    ties[0].measures.truncate(1);
    ties[1].measures[1] = ties[1].measures[0].clone();
    ties[2].id = ties[3].id.clone();
    ties[4].measures[0].sample = f64::NAN;
    ties[5].measures.clear();
    let result = intersected(&ties, FOCAL);
    let reasons: Vec<TieRejection> = result.rejected.iter().map(|tie| tie.reason).collect();
    assert_eq!(
        reasons,
        [
            TieRejection::Rays(Unintersected::FewRays { rays: 1 }),
            TieRejection::TwiceInImage,
            TieRejection::Duplicate,
            TieRejection::NotFinite,
            TieRejection::Rays(Unintersected::FewRays { rays: 0 }),
        ]
    );
    assert_eq!(result.points.len(), 1);

    let mut unknown = ties;
    unknown[3].measures[0].image = 2;
    let failure = intersect_ties(&images(), &unknown, &IntersectOptions::default()).unwrap_err();
    assert_eq!(failure.kind(), Kind::Bug);
    assert!(
        failure
            .to_string()
            .contains("image 2, counted from 0; expected an image below 2")
    );
}

#[test]
fn an_image_with_itself_gives_no_height() {
    let (mut ties, _) = ties(3, |_| (0.0, 0.0));
    let mut twice = images();
    twice[1] = OrientedCamera {
        id: "oblique".to_owned(),
        ..twice[0].clone()
    };
    for tie in &mut ties {
        tie.measures[1] = TieMeasure {
            image: 1,
            ..tie.measures[0].clone()
        };
    }
    let result = intersect_ties(&twice, &ties, &IntersectOptions::default()).unwrap();
    assert!(result.points.is_empty());
    for tie in &result.rejected {
        let parallel = matches!(
            tie.reason,
            TieRejection::Rays(Unintersected::NearParallel { .. })
        );
        assert!(parallel, "{tie:?}");
    }
}

#[test]
fn places_outside_the_image_are_no_measurements() {
    let (ties, _) = ties(1, |_| (0.0, 0.0));
    let images = images();
    let samples = images[0].detector.samples;
    for (line, sample) in [
        (images[0].lines() + 1.0, 10.0),
        (-1.0, 10.0),
        (10.0, samples + 1.0),
        (10.0, -1.0),
    ] {
        let mut ties = ties.clone();
        (ties[0].measures[0].line, ties[0].measures[0].sample) = (line, sample);
        let result = intersect_ties(&images, &ties, &IntersectOptions::default()).unwrap();
        assert_eq!(result.rejected[0].reason, TieRejection::OutsideImage);
    }
}
