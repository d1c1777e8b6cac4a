//! Files that are those of an image, and others.

use std::{fs::File, io::Write as _, path::PathBuf};

use super::*;
use crate::tag_times::StartFrom;
use areograph_base::{body::Body, line_times::LineTimes, time::Et};
use areograph_config::usual_instrument;
use areograph_pds::{
    image_file::{Coding, NewImage, encode},
    pixel_file::Pyramid,
};

const SAMPLES: u32 = 64;
/// Lines that were received, and lines that were exposed.
const LINES: [u32; 2] = [160, 176];

fn times(id: &str) -> ImageTimes {
    ImageTimes {
        id: id.to_owned(),
        body: Body::Mars,
        instrument: usual_instrument().clone(),
        line_times: LineTimes::even(Et::from_seconds(0.0), LINES[1], 1e-3).unwrap(),
        start_from: StartFrom::Sclk,
        sclk_start: Some("610472061:131".to_owned()),
        utc_start: String::new(),
        exposure_s: 5e-4,
        downtrack_summing: 2,
        crosstrack_summing: 2,
        lines_delivered: LINES[0],
        samples: SAMPLES,
        first_detector: 0,
        has_stop_time: true,
        support: None,
        notes: Vec::new(),
        remarks: Vec::new(),
    }
}

/// Pixel values of which exactly one is 0.
fn pixels() -> Vec<u8> {
    let number = |place: u32| u8::try_from((place / 7 + place % SAMPLES * 3) % 251 + 1).unwrap();
    let mut pixels: Vec<u8> = (0..LINES[0] * SAMPLES).map(number).collect();
    pixels[20 * SAMPLES as usize + 33] = 0;
    pixels
}

fn archive(pixels: &[u8]) -> Vec<u8> {
    let image = NewImage {
        product_id: "M01/00123",
        instrument: [&usual_instrument().label.instrument, ""],
        clock: (610_472_061, 131),
        utc: ["1999-05-06T15:33:58.13", "1999-05-06T15:34:05.16"],
        exposure_s: 5e-4,
        summing: 2,
        first_detector: 0,
        samples: SAMPLES,
        pixels,
        coding: Coding::Raw,
    };
    encode(&image).unwrap()
}

fn png(pixels: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let lines = u32::try_from(pixels.len()).unwrap() / SAMPLES;
    let mut encoder = png::Encoder::new(&mut bytes, SAMPLES, lines);
    encoder.set_color(png::ColorType::Grayscale);
    let mut writer = encoder.write_header().unwrap();
    writer.write_image_data(pixels).unwrap();
    writer.finish().unwrap();
    bytes
}

fn tiff(pixels: &[u8]) -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    let mut encoder = tiff::encoder::TiffEncoder::new(&mut bytes).unwrap();
    let lines = u32::try_from(pixels.len()).unwrap() / SAMPLES;
    encoder
        .write_image::<tiff::encoder::colortype::Gray8>(SAMPLES, lines, pixels)
        .unwrap();
    bytes.into_inner()
}

/// A cube as ISIS writes them, with further groups of its label.
fn cube(pixels: &[u8], groups: &str) -> Vec<u8> {
    let lines = pixels.len() / SAMPLES as usize;
    let mut bytes = format!(
        "Object = IsisCube\nObject = Core StartByte = 2049 Format = BandSequential\n\
         Group = Dimensions Samples = {SAMPLES} Lines = {lines} Bands = 1 End_Group\n\
         Group = Pixels Type = UnsignedByte ByteOrder = Lsb Base = 0 Multiplier = 1 End_Group\nEnd_Object\n{groups}\nEnd_Object\nEnd\n"
    )
    .into_bytes();
    bytes.resize(2048, b' ');
    bytes.extend(pixels);
    bytes
}

/// Groups of a label that name camera, clock and product.
fn of_the_camera() -> String {
    format!(
        "Group = Instrument SpacecraftName = MARS_GLOBAL_SURVEYOR InstrumentId = {} TargetName = Mars \
         SpacecraftClockCount = 610472061:131 End_Group\nGroup = Archive ProductId = M01/00123 End_Group",
        usual_instrument().label.instrument
    )
}

struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn write(&self, name: &str, bytes: &[u8]) -> PathBuf {
        let path = self.0.path().join(name);
        File::create(&path).unwrap().write_all(bytes).unwrap();
        path
    }

    /// The error for a file as the pixels of an image.
    fn refusal(&self, bytes: &[u8], times: &ImageTimes) -> String {
        let opened = open_pixels(&self.write("pixels", bytes), times);
        opened.map(|_| ()).unwrap_err().to_string()
    }
}

#[test]
fn every_kind_of_file_gives_the_same_pixels_to_be_matched() {
    let (folder, pixels) = (Folder::new(), pixels());
    let pyramid = |bytes: &[u8]| {
        let file = open_pixels(&folder.write("pixels", bytes), &times("M01-00123")).unwrap();
        Pyramid::of(&file).unwrap()
    };
    let archive = pyramid(&archive(&pixels));
    let window =
        |pyramid: &Pyramid, level, line| pyramid.window(level, [line, 20], [12, 30]).unwrap();
    for (kind, bytes) in [
        ("PNG", png(&pixels)),
        ("TIFF", tiff(&pixels)),
        ("cube", cube(&pixels, &of_the_camera())),
        ("cube of another camera", cube(&pixels, "")),
    ] {
        let other = pyramid(&bytes);
        assert_eq!(other.halvings(), archive.halvings(), "{kind}");
        let levels = [(0, 100), (0, 2), (1, 40), (1, 60)];
        for (level, line) in levels {
            let expected = window(&archive, level, line);
            assert_eq!(
                window(&other, level, line),
                expected,
                "{kind} {level} {line}"
            );
        }
        // A dark pixel of the camera is valid; in other files 0 denotes a missing pixel.
        for (level, line) in [(0, 15), (1, 5)] {
            let level_samples = 20 >> level;
            let at = [line, level_samples];
            let whole = |pyramid: &Pyramid| pyramid.window(level, at, [12, 20]).unwrap();
            assert!(whole(&archive).is_some(), "{kind} {level}");
            assert!(whole(&other).is_none(), "{kind} {level}");
        }
    }
}

#[test]
fn pixels_of_another_image_are_refused() {
    let (folder, pixels) = (Folder::new(), pixels());
    let own = times("M01-00123");
    let files = [archive(&pixels), cube(&pixels, &of_the_camera())];
    for file in &files {
        let message = folder.refusal(file, &times("M01-00124"));
        assert!(
            message.contains("to product M01/00123; expected M0100124"),
            "{message}"
        );
        let later = ImageTimes {
            sclk_start: Some("610472063:131".to_owned()),
            ..times("of a free name")
        };
        let message = folder.refusal(file, &later);
        assert!(
            message.contains("begins at clock 610472061:131; expected 610472063:131"),
            "{message}"
        );
        let narrow = ImageTimes {
            samples: 80,
            ..own.clone()
        };
        let message = folder.refusal(file, &narrow);
        assert!(
            message.contains("64 samples in a line; expected 80"),
            "{message}"
        );
        let short = ImageTimes {
            line_times: LineTimes::even(Et::from_seconds(0.0), 144, 1e-3).unwrap(),
            ..own.clone()
        };
        let message = folder.refusal(file, &short);
        assert!(
            message.contains("160 lines; expected at most 144"),
            "{message}"
        );
    }
    let map = format!(
        "{}\nGroup = Mapping ProjectionName = Sinusoidal End_Group",
        of_the_camera()
    );
    let message = folder.refusal(&cube(&pixels, &map), &own);
    assert!(message.contains("map-projected"), "{message}");
    // With a label the last lines may be missing; without one it is unknown which are.
    let less = &pixels[..144 * SAMPLES as usize];
    for file in [archive(less), cube(less, &of_the_camera())] {
        assert!(open_pixels(&folder.write("pixels", &file), &own).is_ok());
    }
    for file in [png(less), tiff(less), cube(less, "")] {
        let message = folder.refusal(&file, &own);
        assert!(
            message.contains("144 lines; expected 160 or 176, because there is no label"),
            "{message}"
        );
    }
}

#[test]
fn pictures_that_may_be_exchanged_are_not_matched() {
    let (folder, pixels) = (Folder::new(), pixels());
    let (one, two) = (times("M01-00123"), times("M01-00124"));
    let hashed = |name: &str, bytes: &[u8]| {
        Some(HashedFile {
            path: folder.write(name, bytes),
            bytes: 0,
            blake3: String::new(),
        })
    };
    let files = [
        hashed("one.png", &png(&pixels)),
        hashed("two.tif", &tiff(&pixels)),
    ];
    let message = PixelFiles(&files)
        .of_distinct_images(&[&one, &two])
        .unwrap_err()
        .to_string();
    assert!(
        message.contains(
            "images M01-00123 and M01-00124: both pixel files have 160 lines of 64 samples"
        ),
        "{message}"
    );
    // Pictures need no label, and one label distinguishes the two.
    assert!(PixelFiles(&files).opened(&[&one, &two]).is_ok());
    let files = [hashed("one.imq", &archive(&pixels)), files[1].clone()];
    assert!(PixelFiles(&files).of_distinct_images(&[&one, &two]).is_ok());
}

#[test]
fn a_label_and_fragments_of_two_images_are_refused() {
    let (folder, pixels) = (Folder::new(), pixels());
    let own = archive(&pixels);
    let other = String::from_utf8_lossy(&own[..2048]).replace("M01/00123", "M01/00124");
    let mixed = [other.as_bytes(), &own[2048..]].concat();
    let message = folder.refusal(&mixed, &times("M01-00124"));
    assert!(
        message.contains("fragment 0, byte 2048: the label states PRODUCT_ID = M01/00124; the fragments state image 123"),
        "{message}"
    );
}

#[test]
fn lines_beyond_those_delivered_are_refused() {
    let folder = Folder::new();
    let less = ImageTimes {
        lines_delivered: 144,
        ..times("M01-00123")
    };
    // Between the received and the exposed lines: neither.
    for file in [archive(&pixels()), cube(&pixels(), &of_the_camera())] {
        let message = folder.refusal(&file, &less);
        assert!(
            message.contains(
                "160 lines; expected at most 144, the number of lines received of 176 (lines_delivered)"
            ),
            "{message}"
        );
    }
    // Every line that was exposed: in a complete file all were received; else some may be empty.
    let all = vec![80; (LINES[1] * SAMPLES) as usize];
    let message = folder.refusal(&archive(&all), &times("M01-00123"));
    assert!(
        message.contains("176 lines; expected at most 160"),
        "{message}"
    );
    let whole = archive(&all);
    for file in [
        whole[..8192].to_vec(),
        cube(&all, &of_the_camera()),
        png(&all),
    ] {
        let path = folder.write("pixels", &file);
        assert!(open_pixels(&path, &times("M01-00123")).is_ok());
    }
}
