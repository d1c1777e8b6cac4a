//! Rendered images against the cameras of the tie points: both images of a pair show the same ground at its ties.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "places within an image of some thousand lines"
)]

mod matching;

use super::*;
use crate::{
    arc::Arc,
    drawn::DayErrors,
    error_sources::SceneErrors,
    plan::{IMAGES, PlannedImage, SITES, Site},
};
use areograph_base::time::Et;
use areograph_config::built_in_instruments;
use areograph_geom::statistics::Summary;
use areograph_pds::image_file::{ImageFile, LineState};

/// Half the edge of a chip, pixels.
const HALF: i32 = 12;

/// The start of an image to a second.
fn start(image: &PlannedImage) -> Et {
    let utc = |text| chrono::NaiveDateTime::parse_from_str(text, "%Y-%m-%dT%H:%M:%S%.f").unwrap();
    let since = utc(image.utc_start) - utc("2000-01-01T12:00:00");
    // Leap seconds since 1999, and the offset of terrestrial time from atomic time.
    Et::from_seconds(since.num_milliseconds() as f64 * 1e-3 + 64.2)
}

fn flown(site: &str) -> Vec<Flown<'static>> {
    let of_site = IMAGES.iter().filter(|image| image.site.id == site);
    let fly = |image| {
        let arc = Arc::new(image, start(image), 1_200.0).unwrap();
        let errors = DayErrors::draw(&SceneErrors::demo(), &arc, 1);
        Flown { arc, errors }
    };
    of_site.map(fly).collect()
}

/// The interpolated value of an image at a position.
fn number_at(rendering: &Rendering<'_>, line: f64, sample: f64) -> f64 {
    let (top, left) = ((line - 0.5).floor(), (sample - 0.5).floor());
    let (down, right) = (line - 0.5 - top, sample - 0.5 - left);
    let (line, sample) = (top as u32, left as u32);
    let four = rendering
        .pixels(line..line + 2, sample..sample + 2)
        .unwrap();
    let four: Vec<f64> = four.into_iter().map(f64::from).collect();
    let upper = four[0] + right * (four[1] - four[0]);
    let lower = four[2] + right * (four[3] - four[2]);
    upper + down * (lower - upper)
}

/// Correlation of two lists of values.
fn correlation(one: &[f64], other: &[f64]) -> f64 {
    let [one, other] = [one, other].map(|numbers| {
        let of = Summary::of(numbers);
        numbers
            .iter()
            .map(|number| (number - of.mean) / of.standard_deviation)
            .collect::<Vec<_>>()
    });
    let products: Vec<f64> = one.iter().zip(&other).map(|(a, b)| a * b).collect();
    Summary::of(&products).mean
}

#[test]
fn both_images_of_a_pair_show_the_same_ground_where_ties_say() {
    let site = SITES[0];
    let days = flown(site.id);
    let terrain = Terrain::new(1, &SITES.map(Site::direction), SceneErrors::demo().relief);
    let pair = [0, 1].map(|image| Rendering::new(&days[image], &terrain, 1).unwrap());
    let projector = pair[1].image.projector().unwrap();
    let (mut aligned, mut shifted) = (Vec::new(), Vec::new());
    for step in 1..8 {
        let middle = [
            pair[0].image.oriented_camera.lines() * f64::from(step) / 8.0,
            0.5 * pair[0].image.oriented_camera.detector.samples,
        ];
        let ground_m = pair[0]
            .image
            .ground_m(&terrain, middle[0], middle[1])
            .unwrap();
        let Some(_) = pair[1].image.measure(&projector, &ground_m) else {
            continue;
        };
        let mut numbers = [Vec::new(), Vec::new(), Vec::new()];
        for down in (-HALF..=HALF).step_by(2) {
            for right in (-HALF..=HALF).step_by(2) {
                let [line, sample] = [
                    middle[0].floor() + f64::from(down) + 0.5,
                    middle[1].floor() + f64::from(right) + 0.5,
                ];
                let ground_m = pair[0].image.ground_m(&terrain, line, sample).unwrap();
                let Some(seen) = pair[1].image.measure(&projector, &ground_m) else {
                    continue;
                };
                numbers[0].push(number_at(&pair[0], line, sample));
                numbers[1].push(number_at(&pair[1], seen.line, seen.sample));
                numbers[2].push(number_at(&pair[1], seen.line + 9.0, seen.sample));
            }
        }
        assert!(numbers[0].len() > 100);
        aligned.push(correlation(&numbers[0], &numbers[1]));
        shifted.push(correlation(&numbers[0], &numbers[2]));
    }
    println!("{aligned:?}\n{shifted:?}");
    assert!(aligned.len() >= 4);
    // Two pixels of noise of 1, contrasts of 10 and more; blending between pixels takes some of the finest.
    assert!(
        aligned.iter().all(|correlation| *correlation > 0.8),
        "{aligned:?}"
    );
    // Nine lines farther the ground is different.
    assert!(Summary::of(&shifted).mean < 0.5, "{shifted:?}");
}

#[test]
fn strips_join_without_a_seam() {
    let days = flown(SITES[0].id);
    let terrain = Terrain::new(1, &SITES.map(Site::direction), SceneErrors::demo().relief);
    let rendering = Rendering::new(&days[0], &terrain, 1).unwrap();
    let whole = rendering.pixels(60..68, 0..32).unwrap();
    let parts = [60..64, 64..68].map(|lines| rendering.pixels(lines, 0..32).unwrap());
    assert_eq!(whole, parts.concat());
}

/// An image of `pixels` decoded from its file, and its file.
fn read_back(flown: &Flown, pixels: &[u8], coder: Coder) -> (ImageFile, Vec<u8>) {
    let bytes = encoded(flown, pixels, "2000-01-01T00:00:00.00", coder).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("image.imq");
    File::create(&path).unwrap().write_all(&bytes).unwrap();
    decoded(&path)
}

/// An image without damage, and its pixels.
fn decoded(path: &Path) -> (ImageFile, Vec<u8>) {
    let image = ImageFile::open(path, built_in_instruments()).unwrap();
    let (mut strips, mut read) = (image.strips().unwrap(), Vec::new());
    while let Some(strip) = strips.next_strip().unwrap() {
        assert!(strip.states.iter().all(|state| *state == LineState::Good));
        read.extend(strip.pixels);
    }
    assert_eq!(
        (image.complaints().count(), strips.complaints().count()),
        (0, 0)
    );
    (image, read)
}

#[test]
fn codes_give_back_what_was_rendered_or_what_their_steps_leave_of_it() {
    const EDGE: usize = 16;
    let days = flown(SITES[0].id);
    let terrain = Terrain::new(1, &SITES.map(Site::direction), SceneErrors::demo().relief);
    let rendering = Rendering::new(&days[0], &terrain, 1).unwrap();
    let width = days[0].arc.image.samples() as usize;
    let pixels = rendering.pixels(0..160, 0..width as u32).unwrap();
    let (image, read) = read_back(&days[0], &pixels, Coder::Predictive);
    assert_eq!(read, pixels);
    let told = image.label().product_id.clone().unwrap().replace('/', "-");
    assert_eq!(told, days[0].arc.image.id);

    let (_, read) = read_back(&days[0], &pixels, Coder::Transform);
    assert_eq!(read.len(), pixels.len());
    let off = |at: usize| f64::from(read[at]) - f64::from(pixels[at]);
    let rms = |places: &mut dyn Iterator<Item = usize>| {
        let squares: Vec<f64> = places.map(|at| off(at).powi(2)).collect();
        (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
    };
    for block in 0..pixels.len() / (EDGE * EDGE) {
        let (row, column) = (block / (width / EDGE), block % (width / EDGE));
        let corner = (row * width + column) * EDGE;
        let rms = rms(&mut (0..EDGE * EDGE).map(|at| corner + at / EDGE * width + at % EDGE));
        // Half a step of two numbers in every cosine, half a step of a 255th of the range of means, whole numbers.
        assert!(rms <= 1.0 + 0.5 + 0.5, "block {block}: {rms}");
    }
    // Errors uniform over a step have a standard deviation of 0.58, those of whole numbers 0.29; less where little was
    // lost.
    let rms = rms(&mut (0..pixels.len()));
    println!("lost by the transform coder: {rms:.2} of 255");
    assert!((0.3..0.8).contains(&rms), "{rms}");
}

#[test]
fn three_detectors_of_two_kinds_leave_a_third_of_their_difference() {
    let days = flown(SITES[0].id);
    assert_eq!(days[0].arc.image.summing, 3);
    let terrain = Terrain::new(1, &SITES.map(Site::direction), SceneErrors::demo().relief);
    let rendering = Rendering::new(&days[0], &terrain, 1).unwrap();
    let width = days[0].arc.image.samples();
    let pixels = rendering.pixels(0..64, 0..width).unwrap();
    // A sample against the mean of its neighbours, so that the ground cancels.
    let mut sums = [0.0; 2];
    for line in pixels.chunks(width as usize) {
        for (at, three) in line.windows(3).enumerate() {
            let [left, here, right] = [0, 1, 2].map(|of| f64::from(three[of]));
            sums[at % 2] += here - 0.5 * (left + right);
        }
    }
    let each = f64::from(64 * (width - 2) / 2);
    let difference = 0.5 * (sums[0] - sums[1]) / each;
    println!("even minus odd samples: {difference:.3}");
    // The offset measured in M01/00115; noise of a number leaves 0.01 of 21 440 pairs, and the ground as much.
    assert!((difference - 0.32).abs() < 0.05, "{difference}");
}

#[test]
fn one_pair_is_of_two_seasons() {
    let terrain = Terrain::new(1, &SITES.map(Site::direction), SceneErrors::demo().relief);
    for site in SITES {
        let days = flown(site.id);
        let suns = [0, 1].map(|image| {
            let rendering = Rendering::new(&days[image], &terrain, 1).unwrap();
            rendering.sun_deg()
        });
        println!("{}: {suns:.1?}", site.id);
        // The local time of the orbit is half past two in the afternoon: the Sun is in the west, and not low.
        for [incidence_deg, azimuth_deg] in suns {
            assert!((30.0..55.0).contains(&incidence_deg), "{incidence_deg}");
            assert!((225.0..330.0).contains(&azimuth_deg), "{azimuth_deg}");
        }
        let turned_deg = (suns[0][1] - suns[1][1]).abs();
        let is_of_two = site.id == "gusev_crater";
        // Seven weeks change it by 14 degrees at most, half a year by 40.
        assert_eq!(turned_deg > 30.0, is_of_two, "{turned_deg}");
        assert_eq!(turned_deg < 20.0, !is_of_two, "{turned_deg}");
    }
}
