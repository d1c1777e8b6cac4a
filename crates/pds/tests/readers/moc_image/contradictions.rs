//! Labels and fragments of one file that belong to different images.

use std::{fs, path::PathBuf};

use areograph_config::built_in_instruments;
use areograph_pds::image_file::{Coding, Complaint, ImageFile, encode};

use areograph_testing::{moc_file::new_image, real_data};

const SAMPLES: u32 = 640;
/// Bytes of the label.
const LABEL: usize = 2048;

/// The file with a value of its label overwritten by another of the same length.
fn edited(bytes: &[u8], key: &str, value: &str) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    let label = String::from_utf8(bytes[..LABEL].to_vec()).unwrap();
    let line = label
        .find(&format!("\r\n{key} "))
        .or_else(|| label.find(&format!("\n{key} ")));
    let line = line.or_else(|| label.find(&format!(" {key} "))).unwrap();
    let equals = line + label[line..].find('=').unwrap() + 1;
    let start = equals
        + label[equals..]
            .find(|letter: char| letter != ' ' && letter != '"')
            .unwrap();
    bytes[start..start + value.len()].copy_from_slice(value.as_bytes());
    bytes
}

/// Complaints about a file, and contradictions between its label and its fragments.
fn told(bytes: &[u8]) -> (Vec<String>, Vec<String>) {
    let folder = tempfile::tempdir().unwrap();
    let path: PathBuf = folder.path().join("image.imq");
    fs::write(&path, bytes).unwrap();
    let image = ImageFile::open(&path, built_in_instruments()).unwrap();
    let text = |complaint: &Complaint| complaint.to_string();
    let complaints = image.complaints().kept().iter().map(text).collect();
    (
        complaints,
        image.contradictions().iter().map(text).collect(),
    )
}

fn image(lines: usize, pixel: u8) -> Vec<u8> {
    encode(&new_image(
        SAMPLES,
        3,
        &vec![pixel; lines * SAMPLES as usize],
        Coding::Raw,
    ))
    .unwrap()
}

#[test]
fn a_label_of_the_real_image_that_is_changed_contradicts_its_fragments() {
    let test = "a_label_of_the_real_image_that_is_changed_contradicts_its_fragments";
    let Some(path) = real_data("asp_moc/M0100115.imq", test) else {
        return;
    };
    let bytes = fs::read(path).unwrap();
    assert_eq!(told(&bytes), (Vec::new(), Vec::new()));
    for (key, value, said) in [
        (
            "SPACECRAFT_CLOCK_START_COUNT",
            "669321585:006",
            "the fragments state 610472061:131",
        ),
        (
            "PRODUCT_ID",
            "M01/00999",
            "M01/00999; the fragments state image 115",
        ),
        ("LINES", "4096", "4096; the fragments state 4864 lines"),
        (
            "LINE_EXPOSURE_DURATION",
            "0.5821",
            "0.5821 ms; the fragments state 0.4821 ms",
        ),
        // A unit of the line clock is the rounding of printed values.
        (
            "LINE_EXPOSURE_DURATION",
            "0.4823",
            "0.4823 ms; the fragments state 0.4821 ms",
        ),
    ] {
        let (complaints, contradictions) = told(&edited(&bytes, key, value));
        assert_eq!(complaints, contradictions);
        let [only] = &contradictions[..] else {
            panic!("{key}: {contradictions:?}");
        };
        let start = format!("fragment 0, byte 2048: the label states {key} = ");
        assert!(only.starts_with(&start) && only.ends_with(said), "{only}");
    }
    let rounded = edited(&bytes, "LINE_EXPOSURE_DURATION", "0.4822");
    assert_eq!(told(&rounded), (Vec::new(), Vec::new()));
}

#[test]
fn fragments_behind_the_label_of_another_image_are_noticed() {
    let own = image(1344, 80);
    assert_eq!(told(&own), (Vec::new(), Vec::new()));
    let pixels = vec![90; 1360 * SAMPLES as usize];
    let mut other = new_image(SAMPLES, 3, &pixels, Coding::Raw);
    other.product_id = "M01/00200";
    other.clock = (610_480_000, 7);
    other.first_detector = 16;
    let other = encode(&other).unwrap();
    let mixed = [&own[..LABEL], &other[LABEL..]].concat();
    let (_, contradictions) = told(&mixed);
    let expected = [
        "SPACECRAFT_CLOCK_START_COUNT = 610472061:131; the fragments state 610480000:007",
        "PRODUCT_ID = M01/00123; the fragments state image 200",
        "LINES = 1344; the fragments state 1360 lines",
        "EDIT_MODE_ID = 0; the fragments state 16 as first detector",
    ];
    let expected =
        expected.map(|statement| format!("fragment 0, byte 2048: the label states {statement}"));
    assert_eq!(contradictions, expected);
}

#[test]
fn the_lines_of_a_label_may_be_those_that_came_down() {
    let whole = edited(&image(1344, 80), "LINES", "1216");
    let (_, contradictions) = told(&whole);
    assert_eq!(contradictions.len(), 1, "{contradictions:?}");
    // Truncated within its last fragment, which is the first to show it.
    let cut = &whole[..whole.len() - 100_000];
    assert!(told(cut).1.is_empty());
    let more = edited(&image(1344, 80), "LINES", "1472");
    let cut = &more[..more.len() - 100_000];
    assert_eq!(told(cut).1.len(), 1);
}

#[test]
fn a_header_that_is_damaged_itself_is_no_witness() {
    let mut bytes = image(1344, 80);
    // The number of the image in the first header, whose checksum byte is then wrong; the next fragments belong to
    // another image.
    bytes[LABEL + 1] ^= 1;
    assert!(told(&bytes).1.is_empty());
}

#[test]
fn fragments_of_another_image_behind_a_cut_one_are_told_as_such() {
    let own = image(1344, 80);
    let pixels = vec![90; 640 * SAMPLES as usize];
    let mut other = new_image(SAMPLES, 3, &pixels, Coding::Raw);
    other.product_id = "M01/00200";
    other.clock = (610_480_000, 7);
    let other = encode(&other).unwrap();
    // One fragment, and one frame around it.
    let cut = LABEL + 245_760 + 63;
    let mixed = [&own[..cut], &other[LABEL..]].concat();
    let (complaints, contradictions) = told(&mixed);
    assert!(contradictions.is_empty(), "{contradictions:?}");
    let skipped = format!(
        "byte {cut}: no fragment header of this image; {} bytes were skipped",
        other.len() - LABEL
    );
    assert!(complaints.contains(&skipped), "{complaints:?}");
    let end = format!(
        "byte {}: the file ends here, and no fragment is marked as the last",
        mixed.len()
    );
    assert!(complaints.contains(&end), "{complaints:?}");
}
