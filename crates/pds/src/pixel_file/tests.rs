//! Damaged files of every kind: no panic, and memory independent of the sizes that they state.

use std::{io::Write as _, sync::LazyLock};

use proptest::{collection::vec, prelude::*, sample::Index};
use tiff::encoder::{Compression, DeflateLevel, TiffEncoder, colortype::Gray8};

use super::*;
use crate::image_file::{Coding, NewImage, Predictor, Transform, encode};
use areograph_config::built_in_instruments;

const SAMPLES: usize = 64;
const LINES: usize = 160;

/// A file of each kind with the same pixels.
static WHOLE: LazyLock<Vec<Vec<u8>>> = LazyLock::new(|| {
    let pixels: Vec<u8> = (0..LINES * SAMPLES)
        .map(|place| u8::try_from((place / 7 + place % SAMPLES * 3) % 251).unwrap())
        .collect();
    let predictive = Coding::Predictive {
        predictor: Predictor::Y,
        table: 1,
    };
    let cosines = Coding::Transform {
        transform: Transform::Cosine,
        groups: 2,
        spacing: 48,
    };
    let archive = [Coding::Raw, predictive, cosines].map(|coding| {
        let image = NewImage {
            product_id: "M01/00123",
            instrument: ["MOC-NA", ""],
            clock: (610_472_061, 131),
            utc: ["1999-05-06T15:33:58.13", "1999-05-06T15:34:05.16"],
            exposure_s: 0.000_482_1,
            summing: 3,
            first_detector: 0,
            samples: 64,
            pixels: &pixels,
            coding,
        };
        encode(&image).unwrap()
    });
    let mut cube = b"Object = IsisCube Object = Core StartByte = 513 Format = BandSequential\n\
        Group = Dimensions Samples = 32 Lines = 160 Bands = 1 End_Group\n\
        Group = Pixels Type = SignedWord ByteOrder = Lsb Base = 0 Multiplier = 1 End_Group End_Object End_Object\nEnd\n"
        .to_vec();
    cube.resize(512, b' ');
    cube.extend(&pixels);
    let mut png = Vec::new();
    let mut encoder = png::Encoder::new(&mut png, 64, 160);
    encoder.set_color(png::ColorType::Grayscale);
    encoder
        .write_header()
        .unwrap()
        .write_image_data(&pixels)
        .unwrap();
    let tiffs = [
        Compression::Uncompressed,
        Compression::Lzw,
        Compression::Deflate(DeflateLevel::Balanced),
    ]
    .map(|compression| {
        let mut tiff = std::io::Cursor::new(Vec::new());
        let encoder = TiffEncoder::new(&mut tiff).unwrap();
        encoder
            .with_compression(compression)
            .with_predictor(tiff::encoder::Predictor::Horizontal)
            .write_image::<Gray8>(64, 160, &pixels)
            .unwrap();
        tiff.into_inner()
    });
    archive
        .into_iter()
        .chain([cube, png])
        .chain(tiffs)
        .collect()
});

/// Lines and largest strip of a file, pixels; `None` for a rejected file.
fn read(bytes: &[u8]) -> Option<(usize, usize)> {
    let mut file = tempfile::NamedTempFile::new().unwrap();
    file.write_all(bytes).unwrap();
    let image = PixelFile::open(file.path(), built_in_instruments()).ok()?;
    let mut strips = image.strips().ok()?;
    let (mut lines, mut largest) = (0, 0);
    while let Ok(Some(strip)) = strips.next_strip() {
        assert_eq!(strip.first_line as usize, lines);
        lines += strip.states.len();
        largest = largest.max(strip.pixels.len());
    }
    assert!(lines <= image.lines() as usize);
    Some((lines, largest))
}

#[test]
fn whole_files_of_every_kind_are_read() {
    for (kind, bytes) in WHOLE.iter().enumerate() {
        let (lines, largest) = read(bytes).unwrap();
        assert_eq!(lines, LINES, "kind {kind}");
        assert!(largest <= LINES * SAMPLES, "kind {kind}");
    }
}

proptest! {
    #[test]
    fn any_damaged_file_of_pixels_is_read_in_bounds(
        kind in 0..8_usize,
        changes in vec((any::<Index>(), any::<u8>()), 0..8),
        header in vec((0..640_usize, any::<u8>()), 0..4),
        cut in any::<Option<Index>>(),
        doubled in any::<Option<(Index, Index)>>(),
    ) {
        let mut bytes = WHOLE[kind].clone();
        for (at, value) in changes {
            let at = at.index(bytes.len());
            bytes[at] = value;
        }
        for (at, value) in header {
            bytes[at] = value;
        }
        if let Some((from, to)) = doubled {
            let [from, to] = [from, to].map(|at| at.index(bytes.len()));
            let part = bytes[from.min(to)..from.max(to)].to_vec();
            bytes.splice(to..to, part).for_each(drop);
        }
        if let Some(cut) = cut {
            bytes.truncate(cut.index(bytes.len()));
        }
        if let Some((_, largest)) = read(&bytes) {
            prop_assert!(largest <= 1 << 24, "{largest} pixels at a time");
        }
    }
}
