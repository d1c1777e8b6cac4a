//! Patches of synthetic ground with known positions.

#![allow(clippy::cast_possible_truncation, reason = "numbers of a byte")]

use nalgebra::{Matrix2, Vector2};

use super::*;

/// Random numbers of a test, the same every time.
struct Random(u64);

impl Random {
    /// 0 to 1.
    fn unit(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.unit()).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.unit()).cos()
    }
}

/// Ground of plane waves, 5 to 60 pixels long.
struct Ground(Vec<[f64; 4]>);

impl Ground {
    fn new(random: &mut Random) -> Self {
        let wave = |_| {
            let length = random.between(5.0_f64.ln(), 60.0_f64.ln()).exp();
            let (sin, cos) = random.between(0.0, std::f64::consts::TAU).sin_cos();
            let wave_number = std::f64::consts::TAU / length;
            let phase = random.between(0.0, std::f64::consts::TAU);
            [
                wave_number * sin,
                wave_number * cos,
                phase,
                0.25 * length.sqrt(),
            ]
        };
        Self((0..30).map(wave).collect())
    }

    fn at(&self, place: &Vector2<f64>) -> f64 {
        let waves = self.0.iter();
        waves
            .map(|[line, sample, phase, height]| {
                height * (line * place.x + sample * place.y + phase).sin()
            })
            .sum()
    }

    /// Bytes of an image whose positions lie at `warp` on the ground.
    fn image(
        &self,
        first: [i64; 2],
        size: [usize; 2],
        warp: impl Fn(&Vector2<f64>) -> Vector2<f64>,
        [offset, gain, noise]: [f64; 3],
        random: &mut Random,
    ) -> Patch {
        let mut values = Vec::new();
        for line in 0..size[0] {
            for sample in 0..size[1] {
                let place = Vector2::new(
                    first[0] as f64 + line as f64 + 0.5,
                    first[1] as f64 + sample as f64 + 0.5,
                );
                let number = offset + gain * self.at(&warp(&place)) + noise * random.normal();
                values.push(number.round().clamp(0.0, 255.0) as f32);
            }
        }
        Patch {
            first,
            size,
            values,
        }
    }
}

/// An affine distortion like that between a nadir image and one from the side.
fn distortion(random: &mut Random) -> Affine {
    let mut element = |mean: f64| mean + random.between(-0.15, 0.15);
    let matrix = Matrix2::new(element(1.0), element(0.0), element(0.0), element(1.0));
    Affine {
        from: Vector2::new(100.5, 200.5),
        to: Vector2::new(700.0 + random.unit(), 400.0 + random.unit()),
        matrix,
    }
}

/// A template of the first image and a window of the second, smoothed, with the distortion between them.
fn pair(random: &mut Random, noise: f64) -> (Patch, Patch, Affine) {
    let (ground, truth) = (Ground::new(random), distortion(random));
    let here = ground.image(
        [84, 184],
        [33, 33],
        |place| *place,
        [120.0, 4.0, noise],
        random,
    );
    let inverse = truth.inverse().unwrap();
    let there = ground.image(
        [665, 365],
        [72, 72],
        |place| inverse.apply(place),
        [100.0, 3.0, noise],
        random,
    );
    (here.smoothed(), there.smoothed(), truth)
}

/// Starts with the error that a search by whole pixels leaves.
fn start(truth: &Affine, random: &mut Random) -> Affine {
    let off = Vector2::new(random.between(-0.7, 0.7), random.between(-0.7, 0.7));
    let turn = Matrix2::from_fn(|_, _| random.between(-0.01, 0.01));
    Affine {
        to: truth.to + off,
        matrix: truth.matrix + turn,
        ..*truth
    }
}

#[test]
fn least_squares_finds_places_within_what_it_states() {
    let mut random = Random(11);
    let (mut within, mut tried, mut squares) = (0, 0, [0.0; 2]);
    for _ in 0..200 {
        let (template, other, truth) = pair(&mut random, 1.5);
        let matched = match_least_squares(&template, &other, &start(&truth, &mut random)).unwrap();
        let error = matched.affine.to - truth.apply(&matched.affine.from);
        tried += 2;
        for axis in 0..2 {
            // Interpolation leaves two hundredths of a pixel, as the test below shows.
            let sigma = matched.covariance_px2[(axis, axis)].sqrt().hypot(0.02);
            squares[axis] += (error[axis] / sigma).powi(2);
            within += i32::from(error[axis].abs() <= 3.0 * sigma);
        }
        assert!(error.norm() < 0.3, "{error}"); // pixels
        assert!(matched.correlation > 0.9);
    }
    // 99 of 100 within three standard deviations, and these neither too small nor too large by half.
    assert!(within * 100 >= tried * 99, "{within} of {tried}");
    for sum in squares {
        let normalised = (sum / 200.0_f64).sqrt();
        assert!((0.6..1.4).contains(&normalised), "{normalised}");
    }
}

#[test]
fn without_noise_interpolation_and_whole_numbers_leave_two_hundredths_of_a_pixel() {
    let mut random = Random(12);
    for _ in 0..50 {
        let (template, other, truth) = pair(&mut random, 0.0);
        let matched = match_least_squares(&template, &other, &start(&truth, &mut random)).unwrap();
        let error = matched.affine.to - truth.apply(&matched.affine.from);
        assert!(error.amax() < 0.02, "{error}"); // pixels: a third of what the search adds to each standard deviation
        let turned = (matched.affine.matrix - truth.matrix).amax();
        assert!(turned < 0.005, "{turned}"); // a tenth of a pixel at the edge of the template
    }
}

#[test]
fn least_squares_says_why_it_finds_nothing() {
    let mut random = Random(13);
    let (template, other, truth) = pair(&mut random, 1.0);
    let away = Affine {
        to: truth.to + Vector2::new(40.0, 0.0),
        ..truth
    };
    assert_eq!(
        match_least_squares(&template, &other, &away),
        Err(LeastSquaresFailure::Outside)
    );
    let flat = Patch {
        values: vec![80.0; other.values.len()],
        ..other.clone()
    };
    assert_eq!(
        match_least_squares(&template, &flat, &truth),
        Err(LeastSquaresFailure::Undetermined)
    );
    // Other ground is not found, or correlates poorly.
    for _ in 0..20 {
        let (_, elsewhere, _) = pair(&mut random, 1.0);
        if let Ok(matched) = match_least_squares(&template, &elsewhere, &truth) {
            assert!(matched.correlation < 0.7, "{}", matched.correlation);
        }
    }
}

#[test]
fn a_search_finds_the_pixel_and_tells_of_a_second_place() {
    let mut random = Random(14);
    let ground = Ground::new(&mut random);
    let light = [120.0, 4.0, 1.0];
    let area = ground.image([0, 0], [60, 80], |place| *place, light, &mut random);
    let template = ground.image([17, 42], [21, 21], |place| *place, light, &mut random);
    let peak = search(&template, &area).unwrap();
    assert_eq!(peak.at, [17, 42]);
    // Ground of waves resembles itself elsewhere too, but much less.
    assert!(peak.correlation > 0.9 && peak.second < 0.8, "{peak:?}");
    // The same ground twice, 30 samples apart.
    let twice = ground.image(
        [0, 0],
        [21, 60],
        |place| Vector2::new(place.x, place.y % 30.0),
        light,
        &mut random,
    );
    let template = ground.image([0, 4], [21, 21], |place| *place, light, &mut random);
    let peak = search(&template, &twice).unwrap();
    assert!(peak.second > 0.85 * peak.correlation, "{peak:?}");
    let flat = Patch {
        values: vec![7.0; area.values.len()],
        ..area.clone()
    };
    assert_eq!(search(&flat, &area), None);
    assert_eq!(search(&area, &template), None);
}

#[test]
fn texture_is_found_where_it_is_and_not_in_noise() {
    let mut random = Random(15);
    let ground = Ground::new(&mut random);
    // Ground only around line 60, sample 90; only noise elsewhere.
    let mut image = ground.image(
        [0, 0],
        [120, 160],
        |place| *place,
        [120.0, 4.0, 0.0],
        &mut random,
    );
    for line in 0..120_usize {
        for sample in 0..160_usize {
            if line.abs_diff(60) > 20 || sample.abs_diff(90) > 20 {
                image.values[line * 160 + sample] = 120.0;
            }
        }
    }
    for value in &mut image.values {
        *value += random.normal() as f32;
    }
    let noise = noise_dn(&image).unwrap();
    assert!((noise - 1.0).abs() < 0.3, "{noise}"); // grey values: texture adds some
    let found = texture(&image, 15, noise).unwrap();
    assert!(
        (found.at[0] - 60).abs() <= 8 && (found.at[1] - 90).abs() <= 8,
        "{found:?}"
    );
    assert!(found.sigma_px < 0.05);
    let only_noise = Patch {
        values: image
            .values
            .iter()
            .map(|_| 100.0 + 3.0 * random.normal() as f32)
            .collect(),
        ..image
    };
    let left = texture(&only_noise, 15, noise_dn(&only_noise).unwrap());
    assert!(left.is_none_or(|found| found.sigma_px > 0.2), "{left:?}");
}

#[test]
fn smoothing_takes_what_alternates_and_keeps_slopes() {
    let values = (0..20 * 20).map(|pixel| {
        let (line, sample) = (pixel / 20, pixel % 20);
        2.0 * line as f32 + 3.0 * sample as f32 + if sample % 2 == 0 { 4.0 } else { 0.0 }
    });
    let patch = Patch {
        first: [5, 7],
        size: [20, 20],
        values: values.collect(),
    };
    let smoothed = patch.smoothed();
    assert_eq!((smoothed.first, smoothed.size), ([6, 8], [18, 18]));
    let between = smoothed.between(&Vector2::new(15.25, 16.75)).unwrap();
    let expected = 2.0 * (15.25 - 5.5) + 3.0 * (16.75 - 7.5) + 2.0;
    assert!((between.value - expected).abs() < 1e-5, "{between:?}"); // grey values in single precision
    assert!((between.slope[0] - 2.0).abs() < 1e-5 && (between.slope[1] - 3.0).abs() < 1e-5);
    assert_eq!(smoothed.between(&Vector2::new(6.4, 16.0)), None);
}

#[test]
fn many_numbers_are_those_of_single_places() {
    let mut random = Random(9);
    let size = [23, 31];
    let mut values: Vec<f32> = (0..size[0] * size[1])
        .map(|_| random.between(0.0, 255.0).round() as f32)
        .collect();
    values[11 * 31 + 17] = f32::NAN;
    let patch = Patch {
        first: [-40, 1_000],
        size,
        values,
    };
    // Also beyond every edge, on whole pixels, nowhere, and not a multiple of the numbers that are computed together.
    let mut places: Vec<[f32; 2]> = (0..4_001)
        .map(|_| [25.0, 33.0].map(|end| random.between(-2.0, end) as f32))
        .collect();
    let whole =
        (0..23_u8).flat_map(|line| (0..31_u8).map(move |sample| [line, sample].map(f32::from)));
    places.extend(whole);
    places.push([f32::NAN, 5.0]);
    let [lines, samples] =
        [0, 1].map(|axis| -> Vec<f32> { places.iter().map(|place| place[axis]).collect() });
    let mut numbers = vec![0.0; places.len()];
    patch.numbers([&lines, &samples], &mut numbers);
    let mut known = 0;
    for (place, number) in places.iter().zip(numbers) {
        let [line, sample] = place.map(f64::from);
        let place = Vector2::new(line + 0.5 - 40.0, sample + 0.5 + 1_000.0);
        let expected = patch
            .between(&place)
            .map_or(f64::NAN, |between| between.value);
        // Grey values up to 255 and places up to 31 in single precision.
        let is_equal = (f64::from(number) - expected).abs() < 2e-3;
        assert!(
            is_equal || (number.is_nan() && expected.is_nan()),
            "{place:?}: {number}, {expected}"
        );
        known += usize::from(is_equal);
    }
    assert!(known > 2_500 && known < places.len());
}
