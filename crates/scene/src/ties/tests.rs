//! Tie points of synthetic pairs against the flight and the ground from which they were computed.

use super::*;
use crate::{
    arc::Arc,
    drawn::DayErrors,
    error_sources::{Roughness, SceneErrors},
    plan::{IMAGES, PlannedImage, SITES, Site},
};
use areograph_geom::intersection::{IntersectionLimits, Ray, intersect};

/// Tie points of a pair.
const TIES: u32 = 154;
const ROUGH: SceneErrors = SceneErrors::realistic(Roughness::Rough);

fn flown(image: &'static PlannedImage, errors: &SceneErrors, seed: u64) -> Flown<'static> {
    let arc = Arc::new(image, Et::from_seconds(3.9e7), 1_200.0).unwrap();
    let errors = DayErrors::draw(errors, &arc, seed);
    Flown { arc, errors }
}

fn days(site: &str, errors: &SceneErrors, seed: u64) -> Vec<Flown<'static>> {
    let of_site = IMAGES.iter().filter(|image| image.site.id == site);
    of_site.map(|image| flown(image, errors, seed)).collect()
}

fn terrain(seed: u64, errors: &SceneErrors) -> Terrain {
    Terrain::new(seed, &SITES.map(Site::direction), errors.relief)
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
    let cases = SITES.iter().flat_map(|site| {
        let seeds = [1, 2, 3, 4, 5, 6].map(|seed| (seed, SceneErrors::demo()));
        let rough = [(1, ROUGH), (2, ROUGH)];
        seeds.into_iter().chain(rough).map(move |case| (site, case))
    });
    for (site, (seed, errors)) in cases {
        let days = days(site.id, &errors, seed);
        let terrain = terrain(seed, &errors);
        let pair = [0, 1].map(|image| TrueImage::new(&days[image], &terrain).unwrap());
        let ties = exact_ties(&pair, TIES, &terrain, &mut Random::new(seed, "test")).unwrap();
        println!("{} seed {seed}: {} ties", site.id, ties.len());
        assert_eq!(ties.len(), TIES as usize, "{} seed {seed}", site.id);
        for tie in &ties {
            let height_m = tie.ground_m.norm() - terrain.radius_m(&tie.ground_m.normalize());
            assert!(height_m.abs() < 1e-4, "{height_m}"); // metres; rays end 0.01 mm from the ground
            let rays = [0, 1].map(|image| ray(&pair[image], &tie.measures[image].1));
            let met = intersect(&rays, &IntersectionLimits::default()).unwrap();
            let off_m = (met.ground_m - tie.ground_m).norm();
            assert!(off_m < 1e-3, "{off_m} m"); // intersection itself stops at 0.1 mm
        }
    }
}

#[test]
fn poses_between_those_of_the_flight_are_those_of_the_flight() {
    let cases = IMAGES.iter().flat_map(|image| {
        // Rotations, radians: 1e-9 is 0.4 mm on the ground, 6e-9 of jitter 2 mm.
        [(image, SceneErrors::demo(), 1e-9), (image, ROUGH, 6e-9)]
    });
    for (image, errors, turn_max_rad) in cases {
        let flown = flown(image, &errors, 1);
        let terrain = terrain(1, &errors);
        let camera = TrueImage::new(&flown, &terrain).unwrap();
        for share in [0.123, 0.345, 0.567, 0.789] {
            let line = share * camera.oriented_camera.lines();
            let x_lines = line - 0.5 * camera.oriented_camera.lines();
            let pose = camera.oriented_camera.orientation.pose(x_lines);
            let exposure = exposed(&flown, line);
            let light_time_s = seen_after_s(&flown, &terrain, exposure).unwrap();
            let true_pose = super::pose(&flown, exposure, light_time_s);
            let off_m = (pose.position_m - true_pose.position_m).norm();
            // As the kernels themselves; relief of 30 m between two poses is seen 0.3 mm off.
            assert!(off_m < 5e-4, "{} {off_m} m", image.id);
            let turned = pose.mars_to_camera * true_pose.mars_to_camera.transpose();
            let off_rad = (turned - nalgebra::Matrix3::identity()).abs().max();
            assert!(off_rad < turn_max_rad, "{} {off_rad} rad", image.id);
        }
    }
}

#[test]
fn noise_and_blunders_are_as_told() {
    // 616 numbers: 0.03 of their deviation, times three; of common errors some waves of an image alone.
    for (noise_px, common, within) in [(1.0, 0.0, 0.1), (0.22, 0.0, 0.1), (1.0, 0.5, 0.3)] {
        noise_and_blunders_are_as_told_with(noise_px, common, within);
    }
}

fn noise_and_blunders_are_as_told_with(noise_px: f64, common: f64, within: f64) {
    let days = days("isidis", &SceneErrors::demo(), 1);
    let terrain = terrain(1, &SceneErrors::demo());
    let pair = [0, 1].map(|image| TrueImage::new(&days[image], &terrain).unwrap());
    let exact = exact_ties(&pair, TIES, &terrain, &mut Random::new(1, "test")).unwrap();
    let required: Vec<Vec<(usize, TieMeasure<String>)>> =
        exact.iter().map(|tie| tie.measures.clone()).collect();
    let noise = TieNoise {
        sigma_px: noise_px,
        common,
    };
    let (measured, truth) = spoil(exact, pair.len(), noise, &mut Random::new(1, "noise"));
    let (mut squares, mut count) = (0.0, 0.0);
    for ((tie, truth), required) in measured.iter().zip(&truth).zip(&required) {
        assert_eq!(tie.id, truth.id);
        for (measure, (_, required)) in tie.measures.iter().zip(required) {
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
    assert!((sigma_px / noise_px - 1.0).abs() < within, "{sigma_px}");
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

/// The bent line sees a point of the ground where it measures it, and elsewhere than a straight one.
#[test]
fn a_bent_line_sees_the_ground_that_it_measures() {
    let mut days = days("isidis", &SceneErrors::demo(), 1);
    let terrain = terrain(1, &SceneErrors::demo());
    let straight = TrueImage::new(&days[0], &terrain).unwrap();
    let (line, sample) = (2_000.0, 150.0);
    let beside_m = straight.ground_m(&terrain, line, sample).unwrap();
    let at_end = (2.0 * (sample / straight.oriented_camera.detector.samples - 0.5)).powi(2);
    drop(straight);
    days[0].errors.camera.bend_px = 4.0;
    let image = TrueImage::new(&days[0], &terrain).unwrap();
    let ground_m = image.ground_m(&terrain, line, sample).unwrap();
    let measured = image
        .measure(&image.projector().unwrap(), &ground_m)
        .unwrap();
    // Terrain is met to millimetres, a thousandth of a pixel.
    let off_px = [measured.line - line, measured.sample - sample];
    // The sample is that of the straight line two lines before: the flight is turned by some degrees against the columns.
    assert!(
        off_px[0].abs() < 0.01 && off_px[1].abs() < 0.2,
        "{off_px:?}"
    );
    let apart_m = (ground_m - beside_m).norm();
    // Four pixels of the detector of 1.5 m at the ends.
    let pixel_m = 1.5;
    assert!(
        (apart_m / (4.0 * pixel_m * at_end) - 1.0).abs() < 0.3,
        "{apart_m}"
    );
}
