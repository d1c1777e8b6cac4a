//! Two invented cameras over invented ground: every tie point is held against where the second camera truly sees what the
//! first one saw.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "numbers of a byte"
)]

use std::{fs::File, io::Write as _, path::Path};

use nalgebra::{Matrix3, Vector2, Vector3};

use super::*;
use crate::{
    body::Body,
    config::usual_instrument,
    geom::{
        oriented_camera::OrientedCamera,
        pushbroom::{Detector, ExteriorOrientation, Pose, SampledOrientation},
    },
    line_times::LineTimes,
    pds::pixel_file::{PixelFile, Pyramid},
    ties::Unmatched,
    time::Et,
};

const RADIUS_M: f64 = 3_390_000.0;
const HEIGHT_M: f64 = 380_000.0;
const LINES: u32 = 1_280;
const SAMPLES: u32 = 256;
/// Of the first camera and of the second, metres.
const LINE_SPACING_M: [f64; 2] = [4.4, 4.0];
/// How far east of the ground they fly, metres.
const EAST_M: [f64; 2] = [0.0, 120_000.0];

/// Hills that MOLA does not show: height above the sphere at a place, metres.
fn hill_m(place_m: &Vector3<f64>) -> f64 {
    15.0 * (place_m.z / 400.0).sin() + 10.0 * ((place_m.y + 0.3 * place_m.z) / 260.0).cos()
}

/// Brightness of a place: plane waves 15 to 300 m long.
fn brightness(place_m: &Vector3<f64>, waves: &[[f64; 5]]) -> f64 {
    let of_wave = |wave: &[f64; 5]| {
        let phase = wave[0] * place_m.x + wave[1] * place_m.y + wave[2] * place_m.z + wave[3];
        wave[4] * phase.sin()
    };
    waves.iter().map(of_wave).sum()
}

struct Random(u64);

impl Random {
    fn unit(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }
}

fn waves(seed: u64) -> Vec<[f64; 5]> {
    let mut random = Random(seed);
    let mut wave = || {
        let length_m = 15.0 * 20.0_f64.powf(random.unit());
        let (height, around) = (2.0 * random.unit() - 1.0, 6.3 * random.unit());
        let side = (1.0 - height * height).sqrt();
        let number = std::f64::consts::TAU / length_m;
        [
            number * side * around.cos(),
            number * side * around.sin(),
            number * height,
            6.3 * random.unit(),
            2.0 * length_m.powf(0.35),
        ]
    };
    (0..24).map(|_| wave()).collect()
}

/// A camera that flies north and looks at the ground below the first one; `off_m` away from there, north and east.
fn camera(number: usize, off_m: [f64; 2]) -> OrientedCamera<SampledOrientation> {
    let poses: Vec<(f64, Pose)> = (0..=30)
        .map(|step| {
            let x_lines = f64::from(LINES) * (f64::from(step) / 30.0 - 0.5);
            let north_m = x_lines * LINE_SPACING_M[number] + off_m[0];
            let target_m = Vector3::new(RADIUS_M, off_m[1], north_m);
            let position_m = Vector3::new(RADIUS_M + HEIGHT_M, EAST_M[number] + off_m[1], north_m);
            let look = (target_m - position_m).normalize();
            let along = Vector3::z();
            let across = look.cross(&along).normalize();
            let rows = [across.cross(&look), across, look].map(|row| row.transpose());
            let pose = Pose {
                position_m,
                mars_to_camera: Matrix3::from_rows(&rows),
            };
            (x_lines, pose)
        })
        .collect();
    OrientedCamera {
        id: ["one", "two"][number].to_owned(),
        orientation: SampledOrientation::new(&poses).unwrap(),
        detector: Detector::new(usual_instrument(), 2, 768, SAMPLES),
        line_times: LineTimes::even(Et::from_seconds(0.0), LINES, 1.4e-3).unwrap(),
    }
}

/// The ground that a place of a camera truly shows.
fn ground_m(camera: &OrientedCamera<SampledOrientation>, place: &Vector2<f64>) -> Vector3<f64> {
    let (x_lines, _) = camera.focal_plane_coordinates(place.x, place.y);
    let pose = camera.orientation.pose(x_lines);
    let look = pose
        .mars_to_camera
        .tr_mul(&camera.detector.look(place.y))
        .normalize();
    let mut range_m = HEIGHT_M;
    for _ in 0..8 {
        let at_m = pose.position_m + range_m * look;
        let above_m = at_m.norm() - RADIUS_M - hill_m(&at_m);
        range_m += above_m / -look.dot(&at_m.normalize());
    }
    pose.position_m + range_m * look
}

fn rendered(camera: &OrientedCamera<SampledOrientation>, waves: &[[f64; 5]], seed: u64) -> Vec<u8> {
    let mut random = Random(seed);
    let places = (0..LINES).flat_map(|line| (0..SAMPLES).map(move |sample| [line, sample]));
    let number = |[line, sample]: [u32; 2]| {
        let place = Vector2::new(f64::from(line) + 0.5, f64::from(sample) + 0.5);
        let noise = 2.0 * (random.unit() + random.unit() + random.unit() - 1.5);
        let dn = 120.0 + brightness(&ground_m(camera, &place), waves) + noise;
        dn.round().clamp(0.0, 255.0) as u8
    };
    places.map(number).collect()
}

/// A `.img` file with these pixels.
fn pyramid(folder: &Path, pixels: &[u8]) -> Pyramid {
    let label = format!(
        "PDS_VERSION_ID = PDS3\r\nRECORD_BYTES = 2048\r\n^IMAGE = 2\r\nINSTRUMENT_ID = \"{}\"\r\nOBJECT = IMAGE\r\n\
         LINES = {LINES}\r\nLINE_SAMPLES = {SAMPLES}\r\nSAMPLE_BITS = 8\r\nEND_OBJECT = IMAGE\r\nEND\r\n",
        usual_instrument().label.instrument
    );
    let mut bytes = label.into_bytes();
    bytes.resize(2048, b' ');
    bytes.extend_from_slice(pixels);
    let path = folder.join("pixels.img");
    File::create(&path).unwrap().write_all(&bytes).unwrap();
    let file = PixelFile::open(&path, std::slice::from_ref(usual_instrument())).unwrap();
    Pyramid::of(&file).unwrap()
}

/// What becomes of two images with these pixels, the second of which is believed to look `off_m` farther north and east.
fn matched(pixels: [&[u8]; 2], off_m: [f64; 2], most_m: f64) -> Matched {
    let folder = tempfile::tempdir().unwrap();
    let pyramids = pixels.map(|pixels| pyramid(folder.path(), pixels));
    let cameras = [camera(0, [0.0; 2]), camera(1, off_m)];
    let view = |number: usize| {
        let OrientedCamera {
            id,
            orientation,
            detector,
            line_times,
        } = &cameras[number];
        let camera = OrientedCamera {
            id: id.clone(),
            orientation: orientation as &(dyn ExteriorOrientation + 'static),
            detector: *detector,
            line_times: line_times.clone(),
        };
        (number, View::through(camera, &pyramids[number]).unwrap())
    };
    let (first, second) = (view(0), view(1));
    let shots = (-30..=30).map(|shot| {
        let place_m = Vector3::new(RADIUS_M, 0.0, 300.0 * f64::from(shot));
        RADIUS_M * place_m.normalize()
    });
    let heights = Heights::at(Body::Mars, shots.collect());
    let margin = Margin::within(2, most_m);
    let never = AtomicBool::new(false);
    let matched = match_pair([&first, &second], &heights, &margin, (&never).into());
    matched.unwrap().unwrap()
}

/// Differences from where the second camera truly sees what the first one sees, over their standard deviations.
fn errors_px(matched: &Matched) -> Vec<[[f64; 2]; 2]> {
    let cameras = [camera(0, [0.0; 2]), camera(1, [0.0; 2])];
    let folder = tempfile::tempdir().unwrap();
    let blank = pyramid(folder.path(), &vec![0; (LINES * SAMPLES) as usize]);
    let truth = OrientedCamera {
        id: "two".to_owned(),
        orientation: &cameras[1].orientation as &(dyn ExteriorOrientation + 'static),
        detector: cameras[1].detector,
        line_times: cameras[1].line_times.clone(),
    };
    let truth = View::through(truth, &blank).unwrap();
    let ties = matched.ties.iter();
    ties.map(|[first, second]| {
        let place = Vector2::new(first.line, first.sample);
        let seen = truth.place(&ground_m(&cameras[0], &place)).unwrap();
        let error = [second.line - seen.x, second.sample - seen.y];
        // Either image has half of the variance, and pixels of nearly the same size.
        let sigmas = second.sigma_px.unwrap().map(|sigma| sigma * 2.0_f64.sqrt());
        [error, [error[0] / sigmas[0], error[1] / sigmas[1]]]
    })
    .collect()
}

fn pair_of_images() -> [Vec<u8>; 2] {
    [0, 1].map(|number| rendered(&camera(number, [0.0; 2]), &waves(5), number as u64 + 1))
}

#[test]
fn matched_places_are_within_what_they_state_and_other_images_give_none() {
    let [one, two] = pair_of_images();
    let good = matched([&one, &two], [110.0, -70.0], 250.0);
    let errors = errors_px(&good);
    println!("{:?}", good.account);
    // Of what both images show whole, nearly all.
    let edge = good.account.unmatched[&Unmatched::Edge];
    assert!(
        good.account.ties * 5 >= (good.account.cells - edge) * 4,
        "{:?}",
        good.account
    );
    let [parts, with_ties] = good.account.parts;
    assert!(with_ties * 10 >= parts * 9, "{:?}", good.account);
    for axis in 0..2 {
        let square: f64 = errors.iter().map(|[error, _]| error[axis].powi(2)).sum();
        let rms = (square / errors.len() as f64).sqrt();
        let within = errors
            .iter()
            .filter(|[_, normalised]| normalised[axis].abs() <= 3.0);
        let within = within.count();
        println!(
            "axis {axis}: rms {rms:.3}, {within} of {} within",
            errors.len()
        );
        assert!(rms <= 0.3, "{rms}"); // pixels
        assert!(
            within * 100 >= errors.len() * 99,
            "{within} of {}",
            errors.len()
        );
    }
    // The same bytes whatever the number of threads.
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .unwrap();
    let alone = pool.install(|| matched([&one, &two], [110.0, -70.0], 250.0));
    assert_eq!(alone.account, good.account);
    assert_eq!(alone.ties, good.ties);

    let line = |pixels: &[u8], number: u32| {
        let samples = SAMPLES as usize;
        pixels[number as usize * samples..][..samples].to_vec()
    };
    let mirrored: Vec<u8> = (0..LINES)
        .flat_map(|number| line(&two, number).into_iter().rev().collect::<Vec<_>>())
        .collect();
    let mut random = Random(9);
    let noise: Vec<u8> = two
        .iter()
        .map(|_| (100.0 + 20.0 * random.unit()) as u8)
        .collect();
    let elsewhere = rendered(&camera(1, [0.0; 2]), &waves(6), 2);
    // Exchanged pixels are refused by their labels: nothing else could tell them from orientations that err.
    for (what, first, second) in [
        ("mirrored", &one, &mirrored),
        ("of another place", &one, &elsewhere),
        ("noise", &one, &noise),
    ] {
        let found = matched([first, second], [0.0; 2], 250.0);
        println!(
            "{what}: {} of {}: {}",
            found.account.ties,
            found.account.cells,
            found.account.reasons()
        );
        assert!(
            found.account.is_refused && found.ties.is_empty(),
            "{what}: {:?}",
            found.account
        );
    }
    let flat = vec![90; one.len()];
    let found = matched([&flat, &two], [0.0; 2], 250.0);
    assert_eq!(
        found.account.unmatched[&Unmatched::Flat],
        found.account.cells
    );
    // What never came down is counted, and the rest is matched.
    let lines = LINES * 6 / 10;
    let found = matched([&one, &two[..(lines * SAMPLES) as usize]], [0.0; 2], 250.0);
    assert!(found.account.ties >= 80, "{:?}", found.account);
    assert!(
        found.account.unmatched[&Unmatched::Missing] > 50,
        "{:?}",
        found.account
    );
    let last = found
        .ties
        .iter()
        .map(|[_, second]| second.line)
        .fold(0.0, f64::max);
    assert!(last < f64::from(lines), "{last}");
    // Two seconds of flight: no ground is where it is expected.
    let late = matched([&one, &two], [2_800.0, 0.0], 250.0);
    assert!(late.ties.is_empty(), "{:?}", late.account);
}
