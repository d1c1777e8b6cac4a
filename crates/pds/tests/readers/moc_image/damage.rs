//! Images written by the test, intact and damaged.

use std::{
    fs,
    path::{Path, PathBuf},
};

use areograph_config::built_in_instruments;
use areograph_pds::image_file::{Coding, ImageFile, LineState, Predictor, Transform, encode};

use areograph_testing::moc_file::{bytes_read, new_image, peak_memory};

/// Size of the image: more than three fragments.
const SAMPLES: usize = 640;
const LINES: usize = 1344;

/// Reproducible random numbers.
struct Random(u64);

impl Random {
    fn below(&mut self, end: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut bits = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        bits = (bits ^ (bits >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        usize::try_from((bits ^ (bits >> 31)) % end as u64).unwrap()
    }
}

/// Hills with noise, such that a fragment covers less than half of the image.
fn picture() -> Vec<u8> {
    let mut random = Random(7);
    let pixel = |line: usize, sample: usize, noise: usize| {
        let hills = (line as f64 / 37.0).sin() * 50.0 + (sample as f64 / 23.0).cos() * 40.0;
        (118.0 + hills + noise as f64) as u8
    };
    (0..LINES * SAMPLES)
        .map(|number| pixel(number / SAMPLES, number % SAMPLES, random.below(24)))
        .collect()
}

fn encoded(pixels: &[u8], coding: Coding) -> Vec<u8> {
    let samples = u32::try_from(SAMPLES).unwrap();
    encode(&new_image(samples, 3, pixels, coding)).unwrap()
}

const PREDICTED: Coding = Coding::Predictive {
    predictor: Predictor::X,
    table: 5,
};

const COSINES: Coding = Coding::Transform {
    transform: Transform::Cosine,
    groups: 3,
    spacing: 64,
};

/// Result of reading: pixels, states, complaints; `None` for a rejected file.
type Found = Option<(Vec<u8>, Vec<LineState>, Vec<String>)>;

fn read(folder: &Path, bytes: &[u8]) -> Found {
    let path = folder.join("damaged.imq");
    fs::write(&path, bytes).unwrap();
    let image = ImageFile::open(&path, built_in_instruments()).ok()?;
    let mut strips = image.strips().unwrap();
    let (mut pixels, mut states) = (Vec::new(), Vec::new());
    while let Some(strip) = strips.next_strip().unwrap() {
        assert_eq!(strip.first_line as usize, states.len());
        assert_eq!(
            strip.pixels.len(),
            strip.states.len() * strip.samples as usize
        );
        // 4080 samples of 128 lines, or a fragment of the transform coder with 16384 blocks.
        assert!(strip.pixels.len() <= 1 << 22);
        // Memory does not follow a header that states gigabytes.
        if pixels.len() < 1 << 22 {
            pixels.extend(strip.pixels);
        }
        states.extend(strip.states);
    }
    assert!(states.len() <= image.layout().lines as usize);
    let complaints = image
        .complaints()
        .kept()
        .iter()
        .chain(strips.complaints().kept());
    Some((
        pixels,
        states,
        complaints.map(ToString::to_string).collect(),
    ))
}

/// Where fragments begin, and the end of the last one.
fn fragments(bytes: &[u8]) -> Vec<usize> {
    let mut places = vec![2048];
    loop {
        let at = places[places.len() - 1];
        let Some(length) = bytes.get(at + 58..at + 62) else {
            return places;
        };
        match u32::from_le_bytes(length.try_into().unwrap()) {
            0 => return places,
            length => places.push(at + 63 + length as usize),
        }
    }
}

/// The file without one of its fragments.
fn without(bytes: &[u8], fragment: usize) -> Vec<u8> {
    let places = fragments(bytes);
    [&bytes[..places[fragment]], &bytes[places[fragment + 1]..]].concat()
}

#[test]
fn lossless_codings_give_back_every_pixel() {
    let folder = tempfile::tempdir().unwrap();
    let truth = picture();
    let mut codings = vec![Coding::Raw];
    for predictor in [Predictor::X, Predictor::Y, Predictor::Xy] {
        codings.extend((0..7).map(|table| Coding::Predictive { predictor, table }));
    }
    for coding in codings {
        let (pixels, states, complaints) = read(folder.path(), &encoded(&truth, coding)).unwrap();
        assert!(pixels == truth, "{coding:?}");
        assert!(states.iter().all(|state| *state == LineState::Good));
        assert!(complaints.is_empty(), "{coding:?}: {complaints:?}");
    }
}

#[test]
fn cosines_give_back_pixels_within_their_quantisation() {
    let folder = tempfile::tempdir().unwrap();
    let truth = picture();
    for (groups, spacing) in [(1, 16), (3, 64), (8, 160)] {
        let coding = Coding::Transform {
            transform: Transform::Cosine,
            groups,
            spacing,
        };
        let bytes = encoded(&truth, coding);
        let (pixels, _, complaints) = read(folder.path(), &bytes).unwrap();
        assert!(complaints.is_empty(), "{complaints:?}");
        let squares = truth
            .iter()
            .zip(&pixels)
            .map(|(a, b)| f64::from(a.abs_diff(*b)).powi(2));
        let rms = (squares.sum::<f64>() / truth.len() as f64).sqrt();
        // In orthonormal units the step is spacing/16, and no coefficient is off by more than half of it; rounding
        // to whole numbers, and that of the mean, add up to 0.5 each.
        let limit = f64::from(spacing) / 32.0 + 1.0;
        assert!(
            rms <= limit,
            "spacing {spacing}: rms {rms}, at most {limit}"
        );
        // Coarse steps lose information; otherwise nothing was quantised.
        assert!(spacing == 16 || rms > 0.5, "spacing {spacing}: rms {rms}");
        assert!(bytes.len() < truth.len());
    }
}

#[test]
fn a_lost_fragment_leaves_its_lines_out_and_the_others_in_their_places() {
    let folder = tempfile::tempdir().unwrap();
    let truth = picture();
    for (coding, good_min) in [(PREDICTED, 700), (COSINES, 800), (Coding::Raw, 900)] {
        let whole = encoded(&truth, coding);
        let count = fragments(&whole).len() - 1;
        assert!(count >= 3, "{count} fragments");
        for lost in 0..count - 1 {
            let (pixels, states, complaints) = read(folder.path(), &without(&whole, lost)).unwrap();
            let at = format!("{coding:?} without fragment {lost}: {complaints:?}");
            assert_eq!(states.len(), LINES, "{at}");
            let good = (0..LINES).filter(|line| states[*line] == LineState::Good);
            let good: Vec<usize> = good.collect();
            assert!(
                good.len() >= good_min && states[LINES - 1] == LineState::Good,
                "{}, {at}",
                good.len()
            );
            if coding != COSINES {
                for line in good {
                    let range = line * SAMPLES..(line + 1) * SAMPLES;
                    assert!(pixels[range.clone()] == truth[range], "line {line}, {at}");
                }
            }
            let expected = format!(
                "fragment {}, byte {}: the preceding fragment is missing",
                lost + 1,
                fragments(&whole)[lost]
            );
            assert!(complaints.contains(&expected), "{at}");
        }
    }
}

#[test]
fn a_flipped_byte_spoils_its_block_only() {
    let folder = tempfile::tempdir().unwrap();
    let truth = picture();
    let whole = encoded(&truth, PREDICTED);
    let mut bytes = whole.clone();
    bytes[400_000] ^= 0x24;
    let (pixels, states, complaints) = read(folder.path(), &bytes).unwrap();
    assert!(
        complaints
            .iter()
            .any(|text| text.contains("the checksum byte is wrong")),
        "{complaints:?}"
    );
    assert!(
        complaints
            .iter()
            .any(|text| text.contains("CHECKSUM is 16#")),
        "{complaints:?}"
    );
    assert_eq!(states.len(), LINES);
    let wrong = (0..LINES).filter(|line| {
        let range = line * SAMPLES..(line + 1) * SAMPLES;
        pixels[range.clone()] != truth[range]
    });
    let wrong: Vec<usize> = wrong.collect();
    assert!(!wrong.is_empty() && wrong.len() < 128, "{wrong:?}");
    assert!(wrong.iter().all(|line| states[*line] == LineState::Suspect));
    // Only the lines of the damaged fragment, out of more than three, are suspect.
    assert!(
        states
            .iter()
            .filter(|state| **state == LineState::Good)
            .count()
            > LINES / 2
    );
}

#[test]
fn a_cut_file_gives_the_lines_that_are_there() {
    let folder = tempfile::tempdir().unwrap();
    let truth = picture();
    for coding in [PREDICTED, Coding::Raw] {
        let whole = encoded(&truth, coding);
        let places = fragments(&whole);
        for cut in [
            places[2],
            places[2] + 30,
            places[1] + 100_000,
            places[2] - 1,
        ] {
            let (pixels, states, complaints) = read(folder.path(), &whole[..cut]).unwrap();
            assert!(states.len() > 100 && states.len() < LINES);
            assert!(pixels[..] == truth[..pixels.len()]);
            assert!(
                complaints
                    .iter()
                    .any(|text| text.contains("the header states 1344")),
                "{complaints:?}"
            );
            assert!(
                complaints.iter().any(|text| text.contains("the file ends")),
                "{complaints:?}"
            );
        }
    }
}

/// Applies damage: bits, bytes, stretches that are cut out, zeroed or repeated, missing fragments, truncation.
fn damage(bytes: &mut Vec<u8>, random: &mut Random) {
    let from = if random.below(8) == 0 { 0 } else { 2048 };
    for _ in 0..=random.below(4) {
        let at = from + random.below(bytes.len() - from);
        let until = (at + 1 + random.below(3_000)).min(bytes.len());
        match random.below(9) {
            0 | 1 => bytes[at] ^= 1 << random.below(8),
            2 => bytes[at] = random.below(256).to_le_bytes()[0],
            3 => bytes[at..until].fill(0),
            4 => drop(bytes.drain(at..until)),
            5 => bytes
                .splice(at..at, bytes[at..until].to_vec())
                .for_each(drop),
            6 => bytes.truncate(at.max(2048)),
            // Headers, where damage is most misleading.
            7 => {
                let places = fragments(bytes);
                let header = places[random.below(places.len())] + random.below(62);
                if let Some(byte) = bytes.get_mut(header) {
                    *byte = random.below(256).to_le_bytes()[0];
                }
            }
            _ => {
                let places = fragments(bytes);
                if places.len() > 2 && *places.last().unwrap() <= bytes.len() {
                    *bytes = without(bytes, random.below(places.len() - 1));
                }
            }
        }
        if bytes.len() < 4096 {
            return;
        }
    }
}

#[test]
fn damaged_files_never_panic_and_lines_called_good_are_good() {
    if !areograph_testing::alone() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let truth = picture();
    let mut random = Random(20);
    let (mut refused, mut good, mut wrong) = (0, 0, 0);
    let codings = [PREDICTED, COSINES, Coding::Raw];
    let whole = codings.map(|coding| encoded(&truth, coding));
    let true_pixels = [0, 1, 2].map(|number| read(folder.path(), &whole[number]).unwrap().0);
    let before = peak_memory();
    for number in 0..500 {
        let mut bytes = whole[number % 3].clone();
        damage(&mut bytes, &mut random);
        let Some((pixels, states, _)) = read(folder.path(), &bytes) else {
            refused += 1;
            continue;
        };
        let lines = pixels
            .chunks(SAMPLES)
            .zip(true_pixels[number % 3].chunks(SAMPLES));
        for ((line, true_line), state) in lines.zip(&states) {
            if *state == LineState::Good {
                good += 1;
                wrong += usize::from(line != true_line);
            }
        }
    }
    let grown = peak_memory().saturating_sub(before);
    println!(
        "{refused} files refused; {good} good lines, {wrong} of them wrong; {grown} bytes more memory"
    );
    assert!(refused < 50);
    // Two or three faults in a file of four fragments: more than a third of all lines remains good.
    assert!(good > 500 * LINES / 3, "{good}");
    // Only sums of bytes reveal damage: two changes may cancel.
    assert!(
        wrong * 1000 <= good,
        "{wrong} of {good} good lines are wrong"
    );
    // The pixels kept by this test, and a strip.
    assert!(grown < 64 << 20, "{grown} bytes");
}

/// A `.imq` file of 4 MB with a header every 62 bytes, each with a length that ends a byte beyond another one.
fn headers_only(folder: &Path) -> (PathBuf, u64) {
    let picture = vec![7; 16 * SAMPLES];
    let whole = encoded(&picture, Coding::Raw);
    let mut bytes = whole[..2048].to_vec();
    let header = &whole[2048..2110];
    for number in 0..65_000_u32 {
        let mut header = header.to_vec();
        header[13] = 0;
        header[2..4].copy_from_slice(&number.to_le_bytes()[..2]);
        let after = 62 * (32_000 + number % 97) - 62;
        header[58..62].copy_from_slice(&after.to_le_bytes());
        bytes.extend(header);
    }
    let path = folder.join("headers.imq");
    fs::write(&path, &bytes).unwrap();
    (path, bytes.len() as u64)
}

#[test]
fn a_file_of_nothing_but_headers_is_read_a_few_times_only() {
    let folder = tempfile::tempdir().unwrap();
    let (path, size) = headers_only(folder.path());
    let before = bytes_read();
    let image = ImageFile::open(&path, built_in_instruments()).unwrap();
    let read = bytes_read() - before;
    // The label's CHECKSUM, the windows of the search, the header of each and the one where it ends, and sums.
    assert!(read < 6 * size, "{read} bytes of {size}");
    assert!(image.complaints().count() > 0);
}

#[test]
fn a_small_file_cannot_claim_gigabytes_of_lines() {
    let folder = tempfile::tempdir().unwrap();
    let picture = vec![7; 16 * SAMPLES];
    for coding in [PREDICTED, COSINES, Coding::Raw] {
        let mut bytes = encoded(&picture, coding);
        let at = 2048;
        // 65535 × 16 lines of 4080 samples, the only fragment the last of very many.
        bytes[at + 2..at + 4].copy_from_slice(&65_000_u16.to_le_bytes());
        bytes[at + 4..at + 6].copy_from_slice(&65_000_u16.to_le_bytes());
        bytes[at + 40..at + 42].copy_from_slice(&65_535_u16.to_le_bytes());
        bytes[at + 43] = 255;
        let end = fragments(&bytes)[1];
        let sum: u64 = bytes[at..end - 1].iter().map(|byte| u64::from(*byte)).sum();
        bytes[end - 1] = 255 - u8::try_from((sum + 254) % 255 + 1).unwrap();
        let (_, states, complaints) = read(folder.path(), &bytes).unwrap();
        // 64 times what a byte can hold: 8 pixels, or 107 of the transform coder.
        let most = bytes.len() * 64 * 108 / 4080;
        assert!(states.len() <= most + 16, "{coding:?}: {}", states.len());
        let mut told = complaints.iter();
        assert!(
            told.any(|text| text.contains("the header states 1048560 lines")),
            "{complaints:?}"
        );
    }
}
