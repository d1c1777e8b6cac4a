//! The adjustment as a stage: identifiers, blunders, modes of MOLA's image coordinates, refusals; and the
//! formal covariance against the scatter of many runs.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "helpers of tests may fail loudly"
)]

use crate::common;
use areograph_testing::recipe;

use std::sync::atomic::AtomicBool;

use areograph::{
    config::AdjustmentConfig,
    error::Kind,
    footprints::{AdjustmentModel, FootprintImageCoordinates},
    frames::Position,
    geom::{
        bundle::{BundleOptions, Network, View, solve},
        oriented_camera::OrientedCamera,
        pushbroom::{
            CorrectedOrientation, Detector, Distortion, EulerPolynomial, OrientationCorrection,
            Projector, Sighting,
        },
        robust::RobustWeight,
        statistics::BAARDA_LIMIT,
    },
    stages::{
        adjust::{
            AdjustImage, Adjusted, LaserShot, LaserShots, ObservationType, PointKind,
            RejectionReason, ShotRange, adjust,
        },
        intersect::{IntersectOptions, IntersectedTies, intersect_ties},
    },
    ties::{KnownGround, TieMeasure, TiePoint},
};
use nalgebra::{Matrix3, Vector2, Vector3};
use recipe::{HALF_SWATH_PX, Normals, Recipe, Simulated, project};

/// Nobody stops the tests.
static RUN_ON: AtomicBool = AtomicBool::new(false);

const NAMES: [&str; 2] = ["E02-00665", "E02-01453"];

/// What the recipe starts from.
type Initial = CorrectedOrientation<EulerPolynomial>;

struct Site {
    simulated: Simulated<EulerPolynomial>,
    images: Vec<AdjustImage<Initial>>,
    shots: LaserShots,
    ties: Vec<TiePoint>,
}

fn oriented_camera<M>(
    simulated: &Simulated<EulerPolynomial>,
    image: usize,
    orientation: M,
) -> OrientedCamera<M> {
    let entry = &simulated.network.images[image];
    OrientedCamera {
        id: NAMES[image].to_owned(),
        orientation,
        detector: Detector {
            focal_length_px: entry.focal_length_px,
            boresight_sample: HALF_SWATH_PX,
            sample_sense: -1.0,
            samples: 2.0 * HALF_SWATH_PX,
            distortion: Distortion::NONE,
        },
        line_times: common::line_times(2.0 * entry.half_lines, entry.line_period_s),
    }
}

impl Site {
    fn of(recipe: Recipe) -> Self {
        let simulated = recipe.simulate();
        let network = &simulated.network;
        let images: Vec<AdjustImage<Initial>> = network
            .images
            .iter()
            .enumerate()
            .map(|(index, image)| AdjustImage {
                oriented_camera: oriented_camera(&simulated, index, image.base),
                line_period_s: image.line_period_s,
                sigmas: image.sigmas,
                time_bias_sigma_s: 0.0,
                turn_rad_s: Vector3::zeros(),
                expected_m: Vector3::zeros(),
                line_delay: None,
                pass: None,
                laser_axes: None,
            })
            .collect();
        let shots = LaserShots {
            profiles: (10_496..)
                .take(network.range_bias_sigmas_m.len())
                .map(|orbit: u32| orbit.to_string())
                .collect(),
            profile_sigmas_m: vec![Vector3::zeros(); network.range_bias_sigmas_m.len()],
            shots: network
                .ranges
                .iter()
                .map(|range| LaserShot {
                    profile: range.profile,
                    row: u32::try_from(range.point).unwrap(),
                    ground: Position::new(network.points[range.point].ground_m),
                    range: Some(ShotRange {
                        to_laser_m: Vector3::zeros(),
                        image: range.image,
                        x_lines: range.x_lines,
                        range_m: range.range_m,
                    }),
                    also: Vec::new(),
                })
                .collect(),
            surface: None,
        };
        let ties = (simulated.shots..network.points.len())
            .map(|point| TiePoint {
                id: format!("T{point}"),
                known: None,
                measures: network
                    .views
                    .iter()
                    .filter(|view| view.point == point)
                    .map(|view| TieMeasure {
                        image: view.image,
                        line: view.x_lines + network.images[view.image].half_lines,
                        sample: images[view.image]
                            .oriented_camera
                            .detector
                            .sample(view.y_px),
                        sigma_px: None,
                    })
                    .collect(),
            })
            .collect();
        Self {
            simulated,
            images,
            shots,
            ties,
        }
    }

    fn starts(&self) -> IntersectedTies {
        let images: Vec<_> = self
            .images
            .iter()
            .map(|image| image.oriented_camera.clone())
            .collect();
        intersect_ties(&images, &self.ties, &IntersectOptions::default()).unwrap()
    }

    fn adjust(&self, options: &AdjustmentConfig) -> areograph::error::Result<Adjusted> {
        adjust(
            &self.images,
            &self.shots,
            &self.ties,
            &self.starts(),
            0.0,
            options,
            &RUN_ON,
        )
    }
}

const HUBER: RobustWeight = RobustWeight::Huber {
    limit: RobustWeight::HUBER_LIMIT,
};

/// The published model, but no tie point is rejected.
fn every_tie() -> AdjustmentConfig {
    AdjustmentConfig {
        model: AdjustmentModel::Published,
        blunder_limit: None,
        ..AdjustmentConfig::default()
    }
}

/// Standard deviations that agree with noise of one line and one pixel.
fn matched(site: &Site) -> AdjustmentConfig {
    AdjustmentConfig {
        tie_sigma_px: [focal_px_per_line(&site.simulated, 0), 1.0],
        ..every_tie()
    }
}

fn focal_px_per_line(simulated: &Simulated<EulerPolynomial>, image: usize) -> f64 {
    let truth = oriented_camera(simulated, image, simulated.orientations[image]);
    truth.focal_px_per_line(0.0, &simulated.points_m[simulated.shots])
}

#[test]
fn the_stage_gives_what_the_geometry_gives() {
    let site = Site::of(Recipe {
        mola_views: 532,
        ..Recipe::GUSEV
    });
    let direct = solve(&site.simulated.network, &BundleOptions::default()).unwrap();
    let adjusted = site.adjust(&every_tie()).unwrap();
    assert_eq!(
        adjusted.summary.degrees_of_freedom,
        direct.degrees_of_freedom()
    );
    assert!((adjusted.summary.sigma0 / direct.sigma0() - 1.0).abs() < 1e-9); // sums in another order
    assert!(adjusted.rejected.is_empty());
    let redundancy: f64 = adjusted
        .summary
        .types
        .iter()
        .map(|kind| kind.redundancy)
        .sum();
    assert!((redundancy - direct.degrees_of_freedom() as f64).abs() < 1e-6);
    let kinds: Vec<ObservationType> = adjusted
        .summary
        .types
        .iter()
        .map(|kind| kind.kind)
        .collect();
    assert_eq!(kinds.len(), 6, "{kinds:?}");
    for image in &adjusted.summary.images {
        println!("{image:.3?}");
        assert_eq!(image.tie_residuals_px[0].n, 154);
    }
    // Noise of ranges 7 m, of footprints 10 m: corrections by both.
    let range = adjusted.summary.types[3];
    assert!((0.6..1.1).contains(&range.variance_component), "{range:?}");
    assert!(adjusted.summary.ties.sigmas_m[0].mean > 0.0);
    for (first, second, coefficient) in &adjusted.summary.correlated {
        println!("{first} and {second}: {coefficient:.3}");
    }
}

#[test]
fn footprints_in_images_weigh_as_the_mode_says() {
    let site = Site::of(Recipe::GUSEV);
    let with = |footprint_image_coordinates| {
        site.adjust(&AdjustmentConfig {
            footprint_image_coordinates: Some(footprint_image_coordinates),
            ..every_tie()
        })
        .unwrap()
    };
    let [weighted, off, reproject] = [
        FootprintImageCoordinates::Weighted,
        FootprintImageCoordinates::Off,
        FootprintImageCoordinates::Reproject,
    ]
    .map(with);
    let views = weighted.views.len() - off.views.len();
    assert_eq!(
        weighted.summary.degrees_of_freedom,
        2 * views + off.summary.degrees_of_freedom
    );
    // The ballast makes the standard deviation of unit weight smaller.
    assert!(weighted.summary.sigma0 < off.summary.sigma0);
    assert_eq!(
        reproject.summary.degrees_of_freedom,
        off.summary.degrees_of_freedom
    );
    assert_eq!(reproject.images, off.images);
    assert_eq!(off.summary.images[0].mola_corrections[0].n, 0);
    let shifts = [0, 1].map(|image| reproject.summary.images[image].mola_corrections[0]);
    println!("{shifts:.3?}");
    assert!(shifts[0].n + shifts[1].n >= 430);
    assert!(shifts[0].mean * shifts[1].mean < 0.0);
}

/// Mean error of the adjusted tie points without known coordinates, and of their heights, with the rms of errors over
/// standard deviations; metres.
fn tie_errors(site: &Site, adjusted: &Adjusted) -> (f64, f64, f64) {
    let ties = adjusted.points.iter();
    let ties = ties.filter(|point| point.kind == PointKind::Tie);
    let free: Vec<_> = ties
        .filter(|point| site.ties[point.index].known.is_none())
        .collect();
    let count = free.len() as f64;
    let (mut mean_m, mut mean_up_m, mut squares) = (Vector3::zeros(), 0.0, 0.0);
    for point in free {
        let truth_m = site.simulated.points_m[site.simulated.shots + point.index];
        let error_m = point.ground.xyz_m - truth_m;
        mean_m += error_m / count;
        mean_up_m += error_m.dot(&truth_m.normalize()) / count;
        let weight = point.covariance_m2.try_inverse().unwrap();
        squares += error_m.dot(&(weight * error_m)) / (3.0 * count);
    }
    (mean_m.norm(), mean_up_m.abs(), squares.sqrt())
}

#[test]
fn coordinates_that_are_known_place_the_rest() {
    let mut site = Site::of(Recipe::GUSEV);
    let options = AdjustmentConfig {
        footprint_image_coordinates: Some(FootprintImageCoordinates::Off),
        ..matched(&site)
    };
    let (without_m, ..) = tie_errors(&site, &site.adjust(&options).unwrap());
    // The recipe's images err along the flight by some hundred metres, and nothing says so.
    assert!(without_m > 30.0, "{without_m}");
    let controlled: Vec<usize> = (0..site.ties.len()).step_by(20).collect();
    let with = |site: &mut Site, covariance_m2: Option<Matrix3<f64>>, noise_m: f64| {
        let mut normals = Normals::new(3);
        for tie in &controlled {
            let truth_m = site.simulated.points_m[site.simulated.shots + tie];
            site.ties[*tie].known = Some(KnownGround {
                ground: Position::new(truth_m + noise_m * normals.vector()),
                covariance_m2,
            });
        }
        let adjusted = site.adjust(&options).unwrap();
        let ground = adjusted.summary.types.iter();
        let ground = ground.filter(|of| of.kind == ObservationType::TieGround);
        assert_eq!(
            ground.map(|of| of.observations).collect::<Vec<_>>(),
            [3 * controlled.len()]
        );
        tie_errors(site, &adjusted)
    };
    // Eight points of which each tells the parallax to some metres.
    let (fixed_m, _, fixed_z) = with(&mut site, None, 0.0);
    let (constrained_m, _, constrained_z) = with(&mut site, Some(Matrix3::identity() * 25.0), 5.0);
    println!("{without_m} {fixed_m} {fixed_z} {constrained_m} {constrained_z}");
    assert!(
        fixed_m < 10.0 && constrained_m < 10.0,
        "{fixed_m} {constrained_m}"
    );
    assert!((0.5..1.5).contains(&fixed_z), "{fixed_z}");
    assert!((0.5..1.5).contains(&constrained_z), "{constrained_z}");
    // Of some points only the height is known: the height comes right, the place stays.
    let up = site.simulated.points_m[site.simulated.shots].normalize();
    let heights_m2 = Matrix3::identity() * 1e8 - up * up.transpose() * (1e8 - 1.0);
    let (place_m, up_m, _) = with(&mut site, Some(heights_m2), 0.0);
    println!("{place_m} {up_m}");
    // Eight heights of 11 m by their own rays: 4 m, and what the rest of the site tilts by.
    assert!(up_m < 10.0 && place_m > 30.0, "{up_m} {place_m}");
}

#[test]
fn measurements_weigh_by_their_own_standard_deviations() {
    const WORSE: f64 = 8.0;
    let mut site = Site::of(Recipe::GUSEV);
    let options = AdjustmentConfig {
        footprint_image_coordinates: Some(FootprintImageCoordinates::Off),
        ..matched(&site)
    };
    let mut normals = Normals::new(11);
    for tie in site.ties.iter_mut().step_by(3) {
        for measure in &mut tie.measures {
            measure.line += WORSE * normals.next();
            measure.sample += WORSE * normals.next();
        }
    }
    let alike = site.adjust(&options).unwrap();
    for tie in site.ties.iter_mut().step_by(3) {
        for measure in &mut tie.measures {
            measure.sigma_px = Some([WORSE.hypot(1.0); 2]);
        }
    }
    let weighed = site.adjust(&options).unwrap();
    let [alike, weighed] = [alike, weighed].map(|of| of.summary.tie_components[0]);
    println!("{alike} {weighed}");
    // sqrt((2·1 + 65)/3) = 4.7 and 1, along the track, of 154 redundancies.
    assert!(
        (3.5..6.0).contains(&alike) && (0.85..1.15).contains(&weighed),
        "{alike} {weighed}"
    );
}

#[test]
fn blunders_are_found_and_good_ties_kept() {
    const BLUNDERS: usize = 8; // 5 % of 154
    let runs = if common::long() { 5 } else { 2 };
    let (mut found, mut false_alarms, mut clean) = (0, 0, 0);
    for run in 0..runs {
        let mut site = Site::of(Recipe {
            seed: 100 + run,
            ..Recipe::GUSEV
        });
        let options = AdjustmentConfig {
            blunder_limit: Some(BAARDA_LIMIT),
            robust: Some(HUBER),
            ..matched(&site)
        };
        let good = site.adjust(&AdjustmentConfig {
            blunder_limit: None,
            robust: None,
            ..options.clone()
        });
        let mut normals = Normals::new(500 + run);
        let wrong: Vec<usize> = (0..BLUNDERS).map(|k| 19 * k + 3).collect();
        for tie in &wrong {
            // A match 15 to 100 lines away, and as far as that across.
            let measure = usize::from(normals.uniform() < 0.5);
            let sign = if normals.uniform() < 0.5 { -1.0 } else { 1.0 };
            let entry = &mut site.ties[*tie].measures[measure];
            entry.line += sign * (15.0 + 85.0 * normals.uniform());
            entry.sample += 50.0 * (normals.uniform() - 0.5);
        }
        let tested = site.adjust(&options).unwrap();
        for rejected in &tested.rejected {
            assert!(
                matches!(rejected.reason, RejectionReason::Blunder { .. }),
                "{rejected:?}"
            );
            let number: usize = rejected.id.trim_start_matches('T').parse().unwrap();
            if wrong.contains(&(number - site.simulated.shots)) {
                found += 1;
            } else {
                false_alarms += 1;
            }
        }
        clean += site.ties.len() - BLUNDERS;
        let rms_m = |adjusted: &Adjusted| {
            let errors = adjusted.points.iter().filter_map(|point| {
                let number: usize = point.id.strip_prefix('T')?.parse().unwrap();
                let good = !wrong.contains(&(number - site.simulated.shots));
                let truth_m = site.simulated.points_m[number];
                good.then(|| (point.ground.xyz_m - truth_m).norm_squared())
            });
            let errors: Vec<f64> = errors.collect();
            (errors.iter().sum::<f64>() / errors.len() as f64).sqrt()
        };
        let (with, without) = (rms_m(&tested), rms_m(&good.unwrap()));
        assert!(
            with < 1.2 * without,
            "{with} m, without blunders {without} m"
        );
    }
    println!("found {found}, false {false_alarms} of {clean}");
    assert!(
        f64::from(found) >= 0.95 * (runs as f64) * BLUNDERS as f64,
        "{found}"
    );
    assert!(
        f64::from(false_alarms) <= 0.01 * clean as f64,
        "{false_alarms}"
    );
}

/// Measurements whose standard deviations lack the jitter of the images: it is found, no good tie point is lost to it, and
/// blunders are found all the same.
#[test]
fn scatter_beyond_the_standard_deviations_is_no_blunder() {
    const JITTER_PX: f64 = 0.3;
    const OWN_PX: f64 = 0.06;
    let mut site = Site::of(Recipe {
        ties: 300,
        tie_noise: 0.0,
        ..Recipe::GUSEV
    });
    let per_line = focal_px_per_line(&site.simulated, 0);
    let mut normals = Normals::new(17);
    let noise_px = JITTER_PX.hypot(OWN_PX);
    for tie in &mut site.ties {
        for measure in &mut tie.measures {
            measure.line += noise_px * normals.next() / per_line;
            measure.sample += noise_px * normals.next();
            measure.sigma_px = Some([OWN_PX / per_line, OWN_PX]);
        }
    }
    let options = AdjustmentConfig {
        blunder_limit: Some(BAARDA_LIMIT),
        ..every_tie()
    };
    let adjusted = site.adjust(&options).unwrap();
    let found_px = adjusted.summary.tie_scatter_px;
    // A median of 300 residuals: 7 %, times four.
    assert!((found_px / JITTER_PX - 1.0).abs() < 0.28, "{found_px} px");
    // Chance puts 0.6 of 600 residuals beyond the limit, and a few more where the scatter is found too small.
    assert!(adjusted.rejected.len() <= 3, "{:?}", adjusted.rejected);
    let wrong: Vec<usize> = (0..15).map(|place| 20 * place + 7).collect();
    for tie in &wrong {
        site.ties[*tie].measures[1].line += 6.0;
    }
    let adjusted = site.adjust(&options).unwrap();
    let rejected: Vec<usize> = adjusted.rejected.iter().map(|point| point.index).collect();
    assert!(
        wrong.iter().all(|tie| rejected.contains(tie)),
        "{rejected:?}"
    );
    assert!(rejected.len() <= wrong.len() + 3, "{rejected:?}");
    // Standard deviations that explain the residuals stay.
    for measure in site.ties.iter_mut().flat_map(|tie| &mut tie.measures) {
        measure.sigma_px = Some([noise_px / per_line, noise_px]);
    }
    let adjusted = site.adjust(&options).unwrap();
    assert!(adjusted.summary.tie_scatter_px.abs() < f64::EPSILON);
}

#[test]
fn blunders_that_leave_no_common_solution_are_found() {
    let mut site = Site::of(Recipe {
        ties: if common::long() { 2_000 } else { 1_000 },
        tie_noise: 0.3,
        ..Recipe::GUSEV
    });
    let mut normals = Normals::new(5);
    let mut wrong = Vec::new();
    // Every twentieth match is lost: steps over the plain sum of squares swing about for ever.
    for (index, tie) in site.ties.iter_mut().enumerate().step_by(20) {
        let error_lines = 100.0 * normals.next();
        tie.measures[1].line += error_lines;
        tie.measures[1].sample += 100.0 * normals.next();
        // Smaller ones may look like noise, of 1 px in two images.
        if error_lines.abs() > 10.0 {
            wrong.push(index);
        }
    }
    let adjusted = site.adjust(&AdjustmentConfig {
        blunder_limit: Some(BAARDA_LIMIT),
        ..every_tie()
    });
    let adjusted = adjusted.unwrap();
    let rejected: Vec<usize> = adjusted.rejected.iter().map(|point| point.index).collect();
    let found = wrong.iter().filter(|tie| rejected.contains(*tie)).count();
    assert!(
        found as f64 >= 0.98 * wrong.len() as f64,
        "{found} of {}",
        wrong.len()
    );
    let good = rejected
        .iter()
        .filter(|tie| !tie.is_multiple_of(20))
        .count();
    // 0.2 %.
    assert!(500 * good <= site.ties.len(), "{good} good ties were lost");
}

#[test]
fn orientations_left_free_converge_or_are_refused_by_name() {
    let mut outcomes = Vec::new();
    for sigma_m in [1e4, f64::INFINITY] {
        for footprints in [
            FootprintImageCoordinates::Weighted,
            FootprintImageCoordinates::Off,
        ] {
            let mut site = Site::of(Recipe::GUSEV);
            site.images[0].sigmas = recipe::sigmas(sigma_m);
            let outcome = site.adjust(&AdjustmentConfig {
                position_sigma_nadir_m: Some(sigma_m),
                footprint_image_coordinates: Some(footprints),
                ..every_tie()
            });
            if let Err(error) = &outcome {
                let message = error.to_string();
                let named = format!("adjustment.position_sigma_nadir_m = {sigma_m} and");
                assert!(message.contains(&named), "{message}");
            }
            outcomes.push(outcome.is_ok());
        }
    }
    // Footprints in the images hold what nothing else holds.
    assert!(outcomes[0] && outcomes[2], "{outcomes:?}");
}

#[test]
fn across_the_track_a_pair_does_not_control_itself() {
    let site = Site::of(Recipe::GUSEV);
    let adjusted = site.adjust(&every_tie()).unwrap();
    for view in adjusted
        .views
        .iter()
        .filter(|view| view.kind == PointKind::Tie)
    {
        let [along, across] = [view.along_px, view.across_px].map(|axis| axis.redundancy);
        // Height takes up nearly all of an error across the track.
        assert!(
            across < 0.02 && (0.2..0.8).contains(&along),
            "{along} {across}"
        );
    }
}

#[test]
fn what_does_not_fit_together_is_refused() {
    let site = Site::of(Recipe::GUSEV);
    let starts = site.starts();
    let run = |images: &[AdjustImage<Initial>],
               shots: &LaserShots,
               ties: &[TiePoint],
               options: &AdjustmentConfig| {
        let failure = adjust(images, shots, ties, &starts, 0.0, options, &RUN_ON).unwrap_err();
        assert_eq!(failure.kind().exit_code(), 3);
        println!("{failure}");
        failure.to_string()
    };
    let plain = every_tie();

    let mut shots = site.shots.clone();
    shots.shots[3].range.as_mut().unwrap().image = 7;
    let message = run(&site.images, &shots, &site.ties, &plain);
    assert!(
        message.contains("range 3 belongs to image 7, which is not in the network"),
        "{message}"
    );
    shots.clone_from(&site.shots);
    shots.shots[4].row = 5;
    assert!(run(&site.images, &shots, &site.ties, &plain).contains("10496:5"));
    let mut ties = site.ties.clone();
    ties[0].measures[0].image = 7;
    let failure = adjust(
        &site.images,
        &site.shots,
        &ties,
        &starts,
        0.0,
        &plain,
        &RUN_ON,
    )
    .unwrap_err();
    assert_eq!(failure.kind(), Kind::Bug);
    assert!(
        failure.to_string().contains("measured in image 7"),
        "{failure}"
    );

    // Free orientations and nothing but ties: neither place nor scale.
    let mut free = site.images.clone();
    for image in &mut free {
        image.sigmas = [f64::INFINITY; 18];
    }
    let message = run(&free, &LaserShots::default(), &site.ties, &plain);
    assert!(
        message.contains("singular") && message.contains("of image E02-0"),
        "{message}"
    );

    // A footprint 5 km off, between good ones, with 10 m to its name.
    shots.clone_from(&site.shots);
    shots.shots[60].ground.xyz_m.x += 5_000.0;
    let message = run(&site.images, &shots, &site.ties, &plain);
    assert!(message.contains("contradicts"), "{message}");
    assert!(
        message.contains("the footprint of shot 10496:60"),
        "{message}"
    );

    // Values that are none are told with what they belong to.
    let mut negative = site.images.clone();
    negative[1].sigmas[4] = -1.0;
    let message = run(&negative, &site.shots, &site.ties, &plain);
    assert!(
        message
            .contains("the standard deviation of an orientation unknown of image E02-01453 is -1"),
        "{message}"
    );
    shots.clone_from(&site.shots);
    shots.shots[7].range.as_mut().unwrap().range_m = f64::NAN;
    let message = run(&site.images, &shots, &site.ties, &plain);
    assert!(
        message.contains("the range of shot 10496:7 is NaN"),
        "{message}"
    );
    let nowhere = AdjustmentConfig {
        tie_sigma_px: [1.0, 0.0],
        ..plain.clone()
    };
    let message = run(&site.images, &site.shots, &site.ties, &nowhere);
    assert!(
        message.contains("of tie point T266 in image E02-00665 is 0"),
        "{message}"
    );
    let unknown = AdjustmentConfig {
        range_bias_sigma_m: Some(f64::NAN),
        ..plain.clone()
    };
    let message = run(&site.images, &site.shots, &site.ties, &unknown);
    assert!(message.contains("of profile 10496 is NaN"), "{message}");
    assert!(!run(&[], &LaserShots::default(), &[], &plain).is_empty());
}

#[test]
fn ties_without_a_ground_point_are_listed() {
    let mut site = Site::of(Recipe::GUSEV);
    site.ties[0].measures.truncate(1);
    let adjusted = site.adjust(&every_tie()).unwrap();
    assert_eq!(adjusted.rejected.len(), 1);
    assert_eq!(adjusted.rejected[0].id, site.ties[0].id);
    assert_eq!(adjusted.rejected[0].reason, RejectionReason::NotIntersected);
}

/// One draw of every observation from its own standard deviation about the truth.
fn draw(
    simulated: &Simulated<EulerPolynomial>,
    views: &[View],
    normals: &mut Normals,
) -> Network<Initial> {
    let mut network = simulated.network.clone();
    for (image, truth) in network.images.iter_mut().zip(&simulated.orientations) {
        let errors = image.sigmas.map(|sigma| sigma * normals.next());
        image.base = CorrectedOrientation {
            base: *truth,
            correction: OrientationCorrection::of(&errors, image.half_lines, 0.0),
        };
    }
    for range in &mut network.ranges {
        let orientation = &simulated.orientations[range.image];
        let position_m = orientation.path_m.value(range.x_lines);
        let distance_m = (position_m - simulated.points_m[range.point]).norm();
        range.range_m = distance_m + range.sigma_m * normals.next();
    }
    for (point, truth_m) in network.points.iter_mut().zip(&simulated.points_m) {
        // Ties start anywhere near; footprints are observed.
        let sigma_m = point
            .known
            .map_or(Vector3::repeat(1.0), |known| known.sigma_m);
        point.ground_m = truth_m + normals.vector().component_mul(&sigma_m);
    }
    network.views = views.to_vec();
    for view in &mut network.views {
        let lines = view.sigma_px.x / focal_px_per_line(simulated, view.image);
        view.x_lines += lines * normals.next();
        view.y_px += view.sigma_px.y * normals.next();
    }
    network
}

#[test]
fn the_formal_covariance_is_the_scatter_where_the_model_is_exact() {
    const RUNS: u32 = 800;
    let simulated = Recipe {
        ties: 16,
        shots: [12, 12],
        mola_views: 48,
        ..Recipe::EXACT
    }
    .simulate();
    // Image coordinates of footprints are measured here, not computed.
    let mut views = simulated.network.views.clone();
    for view in &mut views {
        let image = &simulated.network.images[view.image];
        let truth =
            Projector::new(&simulated.orientations[view.image], 2.0 * image.half_lines).unwrap();
        let point_m = &simulated.points_m[view.point];
        (view.x_lines, view.y_px) = project(&truth, image.focal_length_px, point_m);
        if view.point >= simulated.shots {
            view.sigma_px = Vector2::new(focal_px_per_line(&simulated, view.image), 1.0);
        }
    }
    let mut normals = Normals::new(11);
    let mut orientation = [[0.0; 18]; 2];
    let mut ties = [0.0; 3];
    let mut sigma0 = 0.0;
    for _ in 0..RUNS {
        let network = draw(&simulated, &views, &mut normals);
        let adjustment = solve(&network, &BundleOptions::default()).unwrap();
        sigma0 += adjustment.sigma0().powi(2) / f64::from(RUNS);
        for (image, adjusted) in adjustment.images.iter().enumerate() {
            let wrong = network.images[image].base.correction.coefficients();
            let found = adjusted.correction.coefficients();
            for (index, sum) in orientation[image].iter_mut().enumerate() {
                // What is added should undo what was wrong; rotations of 1e-3 rad as good as commute.
                let error = found[index] + wrong[index];
                *sum += error * error / adjusted.cofactors[(index, index)] / f64::from(RUNS);
            }
        }
        for tie in simulated.shots..simulated.points_m.len() {
            let found = adjustment.points[tie].unwrap();
            let error_m = found.ground_m - simulated.points_m[tie];
            for (axis, sum) in ties.iter_mut().enumerate() {
                let cofactor_m2 = found.cofactor_m2[(axis, axis)];
                *sum += error_m[axis].powi(2) / cofactor_m2 / (16.0 * f64::from(RUNS));
            }
        }
    }
    println!("σ0² {sigma0}, ties {ties:.3?}, orientation {orientation:.3?}");
    // A standard deviation from 800 runs is known to 2.5 %: 10 % is four of them.
    let close = |square: f64| assert!((square.sqrt() - 1.0).abs() < 0.1, "{square}");
    ties.into_iter().for_each(close);
    orientation.into_iter().flatten().for_each(close);
    close(sigma0);
}

#[test]
fn the_result_is_kept_and_read_back() {
    let mut site = Site::of(Recipe::GUSEV);
    for image in &mut site.images {
        image.time_bias_sigma_s = 0.05;
    }
    let adjusted = site.adjust(&every_tie()).unwrap();
    let bytes = postcard::to_stdvec(&adjusted).unwrap();
    assert_eq!(postcard::from_bytes::<Adjusted>(&bytes).unwrap(), adjusted);
    // The corrected orientation puts the adjusted ties where they were measured, up to their residuals.
    for (index, image) in site.images.iter().enumerate() {
        let orientation = CorrectedOrientation {
            base: image.oriented_camera.orientation,
            correction: adjusted.correction(index),
        };
        let ties = adjusted
            .views
            .iter()
            .filter(|view| view.image == index && view.kind == PointKind::Tie);
        for view in ties {
            let ground_m = adjusted.points[view.point].ground.xyz_m;
            let seen = Sighting::near(
                &orientation,
                &Distortion::NONE,
                view.x_lines,
                &ground_m,
                1e-3,
            )
            .unwrap();
            let seen = seen.solution;
            let focal = image
                .oriented_camera
                .detector
                .focal_px(&seen.camera_m)
                .unwrap();
            // Lines count as pixels at the initial point: its height differs by less than 1 km in 400 km.
            let lines_px = (view.x_lines - seen.x)
                * image
                    .oriented_camera
                    .focal_px_per_line(view.x_lines, &ground_m);
            let difference_px = (lines_px - view.along_px.value).abs();
            assert!(
                difference_px < 5e-3 * lines_px.abs() + 1e-6,
                "{difference_px} {lines_px}"
            );
            // Half a million pixels of focal length times rounding of positions of 4e6 m.
            assert!((focal.y + view.across_px.value - view.y_px).abs() < 1e-6);
        }
        let entry = &adjusted.images[index];
        assert!(entry.sigmas.iter().all(|sigma| *sigma > 0.0));
        // No observation enlarges a variance; measurements worse than configured enlarge all.
        let largest_s = 0.05 * adjusted.summary.variance_factor.sqrt();
        assert!(entry.time_bias_s.unwrap().1 < largest_s);
    }
    let tie = adjusted.points.last().unwrap();
    let sigma_m = (0..3).map(|axis| tie.covariance_m2[(axis, axis)].sqrt());
    assert!(sigma_m.fold(0.0, f64::max) < 100.0);
}

#[test]
fn threads_do_not_change_a_bit() {
    let site = Site::of(Recipe {
        ties: 400,
        ..Recipe::GUSEV
    });
    let options = AdjustmentConfig {
        robust: Some(HUBER),
        ..every_tie()
    };
    let starts = site.starts();
    let bytes = [1, 8].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        let adjusted = pool
            .install(|| {
                adjust(
                    &site.images,
                    &site.shots,
                    &site.ties,
                    &starts,
                    0.0,
                    &options,
                    &RUN_ON,
                )
            })
            .unwrap();
        postcard::to_stdvec(&adjusted).unwrap()
    });
    assert!(bytes[0] == bytes[1]);
}
