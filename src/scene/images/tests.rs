//! Rendered images against the cameras of the tie points: both images of a pair show the same ground where its ties say.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "places within an image of some thousand lines"
)]

mod matching;

use super::*;
use crate::{
    geom::statistics::Summary,
    scene::{
        arc::Arc,
        drawn::DayErrors,
        error_sources::SceneErrors,
        plan::{IMAGES, SITES, Site},
    },
    time::Et,
};

/// Half the edge of a chip, pixels.
const HALF: i32 = 12;

fn flown(site: &str) -> Vec<Flown> {
    let of_site = IMAGES.iter().filter(|image| image.site.id == site);
    let fly = |image| {
        let arc = Arc::new(image, Et::from_seconds(3.9e7), 1_200.0).unwrap();
        let errors = DayErrors::draw(&SceneErrors::demo(), &arc, 1);
        Flown { arc, errors }
    };
    of_site.map(fly).collect()
}

/// The number that an image has at a place, between its pixels.
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

/// Correlation of two lists of numbers.
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
    // Nine lines farther it is other ground.
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
    // The code gives back what was rendered, with the label of the plan.
    let pixels = rendering
        .pixels(0..16, 0..days[0].arc.image.samples())
        .unwrap();
    let bytes = encoded(&days[0], &pixels, "2000-01-01T00:00:00.00").unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("image.imq");
    File::create(&path).unwrap().write_all(&bytes).unwrap();
    let image =
        crate::pds::image_file::ImageFile::open(&path, crate::config::built_in_instruments())
            .unwrap();
    let strip = image.strips().unwrap().next_strip().unwrap().unwrap();
    assert_eq!(strip.pixels, pixels);
    let told = image.label().product_id.clone().unwrap().replace('/', "-");
    assert_eq!(told, days[0].arc.image.id);
}
