//! Footprints and tie points as they are drawn on images, against images in which their true ground is painted: what is painted
//! comes from the truth's cameras alone.
#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "places within an image of some thousand lines"
)]

use std::{collections::BTreeMap, fs, path::Path};

use areograph::{
    config::usual_instrument,
    geom::pushbroom::{Detector, ExteriorOrientation as _, Projector},
    pds::image_file::{Coding, NewImage, encode},
};
use base64::{Engine as _, engine::general_purpose::STANDARD};
use nalgebra::{Vector2, Vector3};
use serde_json::Value;

use super::{
    common::{
        case::Case,
        json,
        mission::{mission, succeed},
        page::csv,
    },
    misregistration::{TRANSFORMED_M, true_camera, true_footprints_m},
    table, vector,
};

const SITE: &str = "isidis";
/// Lines that came down and samples of both images.
const LINES: usize = 7_680;
const SAMPLES: usize = 1024;
/// Radius of a painted crater, pixels: more than marks reach.
const CRATER: f64 = 10.0;
/// Numbers of the ground and of a crater.
const DN: [u8; 2] = [90, 250];
/// Colours of marks.
const BEFORE: [u8; 3] = [0x56, 0xB4, 0xE9];
const AFTER: [u8; 3] = [0xFF, 0x9F, 0x1C];
const MEASURED: [u8; 3] = [0xF7, 0xF7, 0x3B];

/// Line and sample where a camera of the truth shows points.
fn true_places(camera: &Value, ground_m: impl Iterator<Item = Vector3<f64>>) -> Vec<[f64; 2]> {
    let (orientation, lines) = true_camera(camera);
    let projector = Projector::new(&orientation, lines).unwrap();
    let detector = Detector::new(usual_instrument(), 2, 0, u32::try_from(SAMPLES).unwrap());
    let place = |ground_m: Vector3<f64>| {
        let x = projector.project(&ground_m).unwrap().x;
        let camera_m = orientation.pose(x).camera_vector_m(&ground_m);
        let focal_px = detector.focal_px(&camera_m).unwrap();
        [x + 0.5 * lines, detector.sample(focal_px.y)]
    };
    ground_m.map(place).collect()
}

/// An image of even ground with a crater at every place, as the archive has images.
fn painted(id: &str, places: &[[f64; 2]]) -> Vec<u8> {
    let mut pixels = vec![DN[0]; LINES * SAMPLES];
    for [line, sample] in places {
        let rows = ((line - CRATER).max(0.0) as usize)
            ..((line + CRATER + 1.0).max(0.0) as usize).min(LINES);
        for row in rows {
            let columns = ((sample - CRATER).max(0.0) as usize)
                ..((sample + CRATER + 1.0).max(0.0) as usize).min(SAMPLES);
            for column in columns {
                let off = [row as f64 + 0.5 - line, column as f64 + 0.5 - sample];
                if off[0].hypot(off[1]) <= CRATER {
                    pixels[row * SAMPLES + column] = DN[1];
                }
            }
        }
    }
    let clock = if id == "E02-01301" {
        (669_166_528, 118)
    } else {
        (669_788_295, 103)
    };
    let image = NewImage {
        product_id: &id.replace('-', "/"),
        instrument: ["MOC-NA", ""],
        clock,
        utc: ["2001-03-15T23:34:57.72", "2001-03-15T23:35:05.00"],
        exposure_s: 0.000_482_1,
        summing: 2,
        first_detector: 0,
        samples: u32::try_from(SAMPLES).unwrap(),
        pixels: &pixels,
        coding: Coding::Raw,
    };
    encode(&image).unwrap()
}

/// Red, green and blue of a picture.
struct Picture {
    width: usize,
    pixels: Vec<[u8; 3]>,
}

impl Picture {
    fn of(png: &[u8]) -> Self {
        let mut decoder = png::Decoder::new(std::io::Cursor::new(png));
        decoder.set_transformations(png::Transformations::EXPAND);
        let mut reader = decoder.read_info().unwrap();
        let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut bytes).unwrap();
        let pixels = bytes
            .chunks_exact(3)
            .map(|pixel| [pixel[0], pixel[1], pixel[2]]);
        Self {
            width: reader.info().width as usize,
            pixels: pixels.collect(),
        }
    }

    /// Middles of the pixels of a colour, columns and rows.
    fn places(&self, colour: [u8; 3]) -> impl Iterator<Item = Vector2<f64>> {
        let found = self.pixels.iter().enumerate();
        let found = found.filter(move |(_, pixel)| **pixel == colour);
        found.map(|(at, _)| {
            Vector2::new(
                (at % self.width) as f64 + 0.5,
                (at / self.width) as f64 + 0.5,
            )
        })
    }

    /// Mean place of the pixels of a colour within `reach` of a place, columns and rows.
    fn middle(&self, colour: [u8; 3], around: Vector2<f64>, reach: f64) -> Option<Vector2<f64>> {
        let places = self.pixels.iter().enumerate();
        let places = places
            .filter(|(_, pixel)| **pixel == colour)
            .map(|(at, _)| {
                Vector2::new(
                    (at % self.width) as f64 + 0.5,
                    (at / self.width) as f64 + 0.5,
                )
            });
        let near: Vec<_> = places
            .filter(|place| (place - around).norm() <= reach)
            .collect();
        (!near.is_empty()).then(|| near.iter().sum::<Vector2<f64>>() / near.len() as f64)
    }

    /// The middle of the crater nearest to a place, by its edges, which marks do not reach.
    fn crater(&self, around: Vector2<f64>) -> Option<Vector2<f64>> {
        let white = [255; 3];
        let mut reaches = (1..100).map(f64::from);
        let nearest = reaches.find_map(|reach| self.middle(white, around, reach))?;
        // From its rim to its middle.
        let middle = (0..6).fold(nearest, |place, _| self.extent(white, place, 1.5 * CRATER));
        Some(middle)
    }

    /// The middle between the outermost pixels of a colour around a place.
    fn extent(&self, colour: [u8; 3], around: Vector2<f64>, reach: f64) -> Vector2<f64> {
        let places = self
            .places(colour)
            .filter(|place| (place - around).norm() <= reach);
        let (low, high) = places.fold((around, around), |(low, high), place| {
            (low.inf(&place), high.sup(&place))
        });
        0.5 * (low + high)
    }
}

/// Pieces of the page by the text that describes them, and the metres of their pixels.
fn pieces(page: &str) -> BTreeMap<String, (Picture, f64)> {
    let figures = page.split("<figure class=\"place\"").skip(1);
    let mut pieces = BTreeMap::new();
    for figure in figures {
        let caption = figure.split("<figcaption>").nth(1).unwrap();
        let pixel_m = caption.split(" m per pixel").next().unwrap();
        let pixel_m: f64 = pixel_m.rsplit(' ').next().unwrap().parse().unwrap();
        for image in figure.split("src=\"data:image/png;base64,").skip(1) {
            let (data, rest) = image.split_once('"').unwrap();
            let alt = rest.split("alt=\"").nth(1).unwrap();
            let alt = alt.split('"').next().unwrap();
            let picture = Picture::of(&STANDARD.decode(data).unwrap());
            pieces.insert(alt.to_owned(), (picture, pixel_m));
        }
    }
    pieces
}

/// The site of a pair whose images have a crater at the true place of every footprint and tie point that the page shows, and the
/// true places of all footprints in either image.
fn painted_case(truth: &Value) -> (Case, Vec<BTreeMap<u32, [f64; 2]>>) {
    let case = Case::pair();
    let mut sites = truth["ties"].as_array().unwrap().iter();
    let own = sites.find(|of| of["site"] == SITE).unwrap();
    let cameras = own["cameras"].as_array().unwrap();
    for camera in cameras {
        let id = camera["image"].as_str().unwrap();
        case.write(&format!("{id}.imq"), painted(id, &[]));
        let label = format!("label = \"labels/{id}.lbl\"\n");
        case.replace(
            "site.toml",
            &label,
            &format!("{label}pixels = \"{id}.imq\"\n"),
        );
    }
    // What is shown depends on places alone.
    succeed(&mut case.run());
    let page = String::from_utf8(case.read("out/isidis/report/overlays.html")).unwrap();
    let footprints = table(&case.path("out/isidis/footprints.parquet"));
    let all_m = true_footprints_m(truth, &footprints);
    let is_shown = |row: &u32| page.contains(&format!("Row {row} of footprints.parquet"));
    let shots_m = all_m
        .iter()
        .filter(|(row, _)| is_shown(row))
        .map(|(_, ground_m)| *ground_m);
    let ties = own["ties"].as_array().unwrap().iter();
    let ties =
        ties.filter(|tie| page.contains(&format!("Tie point {}", tie["id"].as_str().unwrap())));
    let ties_m = ties.map(|tie| vector(&tie["ground_iau2000_m"]));
    let shown_m: Vec<Vector3<f64>> = shots_m.chain(ties_m).collect();
    let mut places = Vec::new();
    for camera in cameras {
        let id = camera["image"].as_str().unwrap();
        let craters = true_places(camera, shown_m.iter().copied());
        case.write(&format!("{id}.imq"), painted(id, &craters));
        let all = true_places(camera, all_m.values().copied());
        places.push(all_m.keys().copied().zip(all).collect());
    }
    (case, places)
}

/// Titles and rows of the footprints of the page.
fn shown_footprints(page: &str) -> Vec<(String, u32)> {
    let figures = page.split("<figure class=\"place\"").skip(1);
    let footprint = |figure: &str| {
        let title = figure.split("<h3>").nth(1)?.split("</h3>").next()?;
        let row = figure.split("Row ").nth(1)?.split(' ').next()?;
        Some((title.to_owned(), row.parse().ok()?))
    };
    figures.filter_map(footprint).collect()
}

/// How far a mark is from the crater next to it, metres towards east and south.
fn off_m((picture, pixel_m): &(Picture, f64), mark: [u8; 3]) -> Option<Vector2<f64>> {
    let middle = Vector2::repeat(0.5 * picture.width as f64);
    let mark = picture.middle(mark, middle, f64::INFINITY)?;
    let crater = picture.crater(mark)?;
    Some((mark - crater) * *pixel_m)
}

#[test]
fn drawn_footprints_lie_on_the_same_true_ground_in_both_images_after_the_adjustment() {
    let truth = json(&mission().join("truth.json"));
    let (case, places) = painted_case(&truth);
    succeed(&mut case.run());
    let folder = case.path("out/isidis");
    let page = fs::read_to_string(folder.join("report/overlays.html")).unwrap();
    assert!(page.len() < 5_000_000, "{} bytes", page.len());
    let pieces = pieces(&page);
    let ids = ["E02-01301", "E02-02016"];
    let footprints = shown_footprints(&page);
    // Where the image ends in a crater its middle cannot be seen.
    let is_whole = |row: &u32| {
        places.iter().all(|places| {
            let [line, sample] = places[row];
            let is_inside = |at: f64, end: usize| (12.0..end as f64 - 12.0).contains(&at);
            is_inside(line, LINES) && is_inside(sample, SAMPLES)
        })
    };
    let footprints = footprints
        .iter()
        .filter(|(_, row)| is_whole(row))
        .map(|(name, _)| name);
    let (mut count, mut apart_m) = (0, Vec::new());
    for name in footprints {
        let [one, other] = ids.map(|id| &pieces[&format!("{name} in {id}")]);
        let [after_m, before_m] = [AFTER, BEFORE].map(|mark| {
            let [one_m, other_m] = [one, other].map(|piece| off_m(piece, mark).unwrap());
            println!("{name}: {one_m:?} {other_m:?}");
            one_m - other_m
        });
        println!(
            "{name}: {:.1} m apart before, {:.1} m after",
            before_m.norm(),
            after_m.norm()
        );
        apart_m.push((name, before_m, after_m, one.1));
        count += 1;
    }
    assert!(count >= 3, "{count} footprints");
    for (name, before_m, after_m, pixel_m) in apart_m {
        // Both marks and both craters are placed to half a pixel at worst, and footprints fall as far apart as tie points allow.
        assert!(
            after_m.norm() < TRANSFORMED_M + 2.0 * pixel_m,
            "{name}: {after_m}"
        );
        // The labels are off by 60 lines against each other, 230 m.
        assert!(before_m.norm() > 60.0, "{name}: {before_m}");
    }
    ties_of_the_page(&truth, &pieces, ids);
    strips(&folder, ids, &places);
    let page = fs::read_to_string(folder.join("report/index.html")).unwrap();
    let painted =
        shown_footprints(&fs::read_to_string(folder.join("report/overlays.html")).unwrap());
    for (id, places) in ids.iter().zip(&places) {
        let craters: Vec<[f64; 2]> = painted.iter().map(|(_, row)| places[row]).collect();
        picture_on_the_axes(&page, id, &craters);
    }
}

/// On the first screen, craters of the image lie at their true lines and samples, by the axes on which footprints are drawn.
fn picture_on_the_axes(page: &str, id: &str, craters: &[[f64; 2]]) {
    let name = format!("{}-with-its-footprints", id.to_lowercase());
    let figure = page
        .split(&format!("<figure id=\"{name}\""))
        .nth(1)
        .unwrap();
    let svg = figure.split("</svg>").next().unwrap();
    let number = |element: &str, key: &str| -> f64 {
        let value = element.split(&format!(" {key}=\"")).nth(1).unwrap();
        value.split('"').next().unwrap().parse().unwrap()
    };
    // The first panel is the image: its dots come first, in the order of the data.
    let drawn = csv(page, &name).into_iter().skip(1);
    let drawn: Vec<[f64; 2]> = drawn
        .take_while(|row| row[0] == "sample")
        .map(|row| [row[2].parse().unwrap(), row[3].parse().unwrap()])
        .collect();
    let dots = svg.split("<circle").skip(1).take(drawn.len());
    let dots: Vec<[f64; 2]> = dots
        .map(|dot| [number(dot, "cx"), number(dot, "cy")])
        .collect();
    assert!(drawn.len() > 100, "{id}: {} dots", drawn.len());
    let scale = |axis: usize| {
        let by = |one: &usize, other: &usize| drawn[*one][axis].total_cmp(&drawn[*other][axis]);
        let [low, high] = [
            (0..drawn.len()).min_by(by).unwrap(),
            (0..drawn.len()).max_by(by).unwrap(),
        ];
        let factor = (dots[high][axis] - dots[low][axis]) / (drawn[high][axis] - drawn[low][axis]);
        (dots[low][axis] - factor * drawn[low][axis], factor)
    };
    let axes = [scale(0), scale(1)];
    let image = svg.split("<image").nth(1).unwrap();
    let data = image
        .split("base64,")
        .nth(1)
        .unwrap()
        .split('"')
        .next()
        .unwrap();
    let mut decoder = png::Decoder::new(std::io::Cursor::new(STANDARD.decode(data).unwrap()))
        .read_info()
        .unwrap();
    let mut pixels = vec![0; decoder.output_buffer_size().unwrap()];
    let frame = decoder.next_frame(&mut pixels).unwrap();
    let [width, height] = [frame.width, frame.height].map(|count| count as usize);
    let grey = |line: f64, sample: f64| {
        let [x, y] =
            [(axes[0], line), (axes[1], sample)].map(|((zero, factor), at)| zero + factor * at);
        let column = (x - number(image, "x")) / number(image, "width") * width as f64;
        let row = (y - number(image, "y")) / number(image, "height") * height as f64;
        let is_inside =
            (0.0..width as f64).contains(&column) && (0.0..height as f64).contains(&row);
        is_inside.then(|| f64::from(pixels[4 * (row as usize * width + column as usize)]))
    };
    let mean = |line_off: f64, sample_off: f64| {
        let greys = craters
            .iter()
            .filter_map(|[line, sample]| grey(line + line_off, sample + sample_off));
        let greys: Vec<f64> = greys.collect();
        assert!(greys.len() >= 3, "{id}: {} craters", greys.len());
        greys.iter().sum::<f64>() / greys.len() as f64
    };
    let at_craters = mean(0.0, 0.0);
    // A crater of 20 pixels covers two pixels of the picture; dots are drawn to a unit, ten lines or six samples.
    for beside in [
        mean(60.0, 0.0),
        mean(-60.0, 0.0),
        mean(0.0, 100.0),
        mean(0.0, -100.0),
    ] {
        assert!(
            at_craters > beside + 120.0,
            "{id}: {at_craters} at craters, {beside} beside them"
        );
    }
}

/// A tie point that truth calls a blunder is measured beside its crater in the image that truth names, and on it in the other.
fn ties_of_the_page(truth: &Value, pieces: &BTreeMap<String, (Picture, f64)>, ids: [&str; 2]) {
    let mut sites = truth["ties"].as_array().unwrap().iter();
    let own = sites.find(|of| of["site"] == SITE).unwrap();
    let mut count = 0;
    for tie in own["ties"].as_array().unwrap() {
        let blunder = &tie["blunder"];
        let (name, is_blunder) = (tie["id"].as_str().unwrap(), !blunder.is_null());
        let rejected = if is_blunder { ", rejected" } else { "" };
        for id in ids {
            let Some(piece) = pieces.get(&format!("Tie point {name}{rejected} in {id}")) else {
                continue;
            };
            // Measured with a noise of a pixel; the largest of some hundred is below five of these, and a half is rounding.
            let off_px = off_m(piece, MEASURED).map_or(f64::INFINITY, |off| off.norm() / piece.1);
            let is_off = off_px > 5.5;
            assert_eq!(
                is_off,
                is_blunder && blunder["image"] == id,
                "{name} in {id}: {off_px} px"
            );
            count += 1;
        }
    }
    assert!(count >= 12, "{count} pieces");
}

/// In the whole images, too, adjusted marks are as far from their true places in one image as in the other.
fn strips(folder: &Path, ids: [&str; 2], places: &[BTreeMap<u32, [f64; 2]>]) {
    let mut means_m = Vec::new();
    // Metres of a line: nominal, 3.3 m and 4.4 m in table 2 of Shan et al. 2005.
    for ((id, places), line_m) in ids.iter().zip(places).zip([3.3, 4.4]) {
        let picture =
            Picture::of(&fs::read(folder.join(format!("images/{id}/overlay.png"))).unwrap());
        let reduction = (SAMPLES as f64 / picture.width as f64).round();
        let mut rows = Vec::new();
        for place in places.values() {
            let place = Vector2::new(place[1], place[0]);
            let others = places
                .values()
                .map(|other| (Vector2::new(other[1], other[0]) - place).norm());
            // Marks of neighbours do not reach there.
            let is_alone = others.filter(|apart| *apart < 18.0 * reduction).count() == 1;
            let mark = picture
                .middle(AFTER, place / reduction, 7.0)
                .filter(|_| is_alone);
            rows.extend(mark.map(|mark| (mark - place / reduction).y));
        }
        assert!(rows.len() > 20, "{id}: {} marks", rows.len());
        let mean = rows.iter().sum::<f64>() / rows.len() as f64;
        means_m.push(mean * reduction * line_m);
    }
    // Rounding to a pixel of three lines averages out over twenty marks to a tenth of it.
    assert!(
        (means_m[0] - means_m[1]).abs() < TRANSFORMED_M + 6.0,
        "{means_m:?} m"
    );
}
