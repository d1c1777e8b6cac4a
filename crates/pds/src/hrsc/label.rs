//! Labels of HRSC images, as archived by PDS and as ISIS writes them.

use crate::{
    image_label::{
        ImageLabel, as_taken, camera, damage, either, known, of_mars, optional_count, other_image,
        text, value_error,
    },
    label::{Label, LabelError},
};
use areograph_base::{constants::Spacecraft, image::ImageFields, instruments::Instrument};

/// The detector that is not a line: the Super Resolution Channel takes frames.
const FRAME_CAMERA: &str = "MEX_HRSC_SRC";
/// Processing level of calibrated images that are not map-projected.
const LEVEL: &str = "2";
/// Macropixel sizes: detector lines and pixels that the camera can sum.
const MACRO_PIXELS: [&str; 4] = ["1", "2", "4", "8"];

/// Whether this is the label of an HRSC image, of any line.
pub(crate) fn is_hrsc(label: &Label) -> bool {
    let mut entries = label.entries.iter();
    entries.any(|entry| {
        matches!(&*entry.key, "INSTRUMENT_ID" | "INSTRUMENTID")
            && entry.value.eq_ignore_ascii_case("HRSC")
    })
}

/// The fields of a parsed label of an image by one of `cameras`; missing values are `None`, among them the line times.
///
/// Clock counts are left out: they differ by seconds from the clock kernels (`labels_tell_clock` of the spacecraft).
///
/// # Errors
/// A frame of the Super Resolution Channel; a line that is not among `cameras`; an image of another spacecraft or target,
/// of another level, or one that is map-projected; an invalid value, or two values under one keyword.
pub(super) fn image_label(label: &Label, cameras: &[Instrument]) -> Result<ImageLabel, LabelError> {
    const DETECTOR: [&str; 2] = ["DETECTOR_ID", "DETECTORID"];
    if let Some(entry) = either(label, DETECTOR[0], DETECTOR[1])?
        && entry.value.eq_ignore_ascii_case(FRAME_CAMERA)
    {
        let expected = "one of the nine detector lines; the frame camera (SRC) is not supported";
        return Err(other_image(&entry.key, &entry.value, expected));
    }
    let instrument = camera(label, cameras, DETECTOR)?;
    let spacecraft: &'static Spacecraft = instrument.spacecraft;
    for keys in [
        ["INSTRUMENT_HOST_NAME", "SPACECRAFTNAME"],
        ["SPACECRAFT_NAME", "SPACECRAFTNAME"],
    ] {
        of_mars(label, keys, &spacecraft.label_name)?;
    }
    let level = label
        .only("PROCESSING_LEVEL_ID")?
        .filter(|entry| known(entry));
    if let Some(entry) = level.filter(|entry| entry.value != LEVEL) {
        let expected = "2, the image as taken by the camera (h…2.IMG); higher levels are maps";
        return Err(other_image(&entry.key, &entry.value, expected));
    }
    as_taken(label)?;
    let summing = match either(label, "MACROPIXEL_SIZE", "SUMMING")? {
        Some(entry) if !MACRO_PIXELS.contains(&&*entry.value) => {
            return Err(value_error(entry, "1, 2, 4 or 8"));
        }
        entry => optional_count(entry, 1)?,
    };
    let size = |pds, isis| match label.only_in("IMAGE", pds)? {
        None => optional_count(label.only_in("DIMENSIONS", isis)?, 1),
        found => optional_count(found, 1),
    };
    let samples = size("LINE_SAMPLES", "SAMPLES")?;
    // SAMPLE_FIRST_PIXEL counts pixels differently from the kernels: it is 76 for a line that has all 5184.
    let is_whole = summing
        .zip(samples)
        .is_some_and(|(summing, samples)| summing * samples == instrument.detector.pixels);
    Ok(ImageLabel {
        product_id: text(either(label, "PRODUCT_ID", "PRODUCTID")?),
        instrument: instrument.clone(),
        fields: ImageFields {
            utc_start: text(either(label, "START_TIME", "STARTTIME")?),
            downtrack_summing: summing,
            crosstrack_summing: summing,
            lines_header: size("LINES", "LINES")?,
            samples,
            first_detector: is_whole.then_some(0),
            ..ImageFields::default()
        },
        utc_stop: text(either(label, "STOP_TIME", "STOPTIME")?),
        lines: None,
        // Its clock counts are not used.
        remarks: damage(label, true),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::label::parse;
    use areograph_config::all_instruments;

    const GOOD: &str = "INSTRUMENT_ID = HRSC\nDETECTOR_ID = MEX_HRSC_S2\nINSTRUMENT_HOST_NAME = \"MARS EXPRESS\"\n\
        PROCESSING_LEVEL_ID = 2\nSPACECRAFT_CLOCK_START_COUNT = 1/0150552525.07284\nTARGET_NAME = MARS\n\
        START_TIME = 2008-02-08T12:08:53.843Z\nMACROPIXEL_SIZE = 2\nOBJECT = IMAGE\nLINES = 7\nLINE_SAMPLES = 2592\n\
        END_OBJECT\nEND\n";

    fn read(text: &str) -> Result<ImageLabel, LabelError> {
        image_label(&parse(text.as_bytes()).unwrap(), all_instruments())
    }

    #[test]
    fn a_label_tells_line_size_and_start_but_no_clock() {
        let label = read(GOOD).unwrap();
        assert_eq!(label.instrument.id, "hrsc_s2");
        let expected = ImageFields {
            utc_start: Some("2008-02-08T12:08:53.843Z".to_owned()),
            downtrack_summing: Some(2),
            crosstrack_summing: Some(2),
            lines_header: Some(7),
            samples: Some(2592),
            first_detector: Some(0),
            ..ImageFields::default()
        };
        assert_eq!(label.fields, expected);
        // A part of the line whose start is not stated.
        let part = read(&GOOD.replace("2592", "2584")).unwrap();
        assert_eq!(part.fields.first_detector, None);
        // Unknown values are left out, whatever their keyword.
        for (from, to) in [
            ("START_TIME = 2008-02-08T12:08:53.843Z", "START_TIME = UNK"),
            ("MACROPIXEL_SIZE = 2", "MACROPIXEL_SIZE = UNK"),
            ("PROCESSING_LEVEL_ID = 2", "PROCESSING_LEVEL_ID = \"N/A\""),
            ("LINES = 7", "LINES = UNK"),
        ] {
            assert!(GOOD.contains(from));
            assert!(read(&GOOD.replace(from, to)).is_ok(), "{to}");
        }
    }

    #[test]
    fn images_of_other_kinds_are_refused_with_what_was_expected() {
        for (from, to, expected) in [
            (
                "_S2",
                "_SRC",
                "DETECTOR_ID is \"MEX_HRSC_SRC\"; expected one of the nine detector lines",
            ),
            (
                "_S2",
                "_S3",
                "instrument is \"HRSC MEX_HRSC_S3\"; expected MOC-NA",
            ),
            (
                "ID = 2",
                "ID = 3",
                "PROCESSING_LEVEL_ID is \"3\"; expected 2",
            ),
            (
                "ID = 2",
                "ID = \"3A\"",
                "PROCESSING_LEVEL_ID is \"3A\"; expected 2",
            ),
            (
                "SIZE = 2",
                "SIZE = 3",
                "MACROPIXEL_SIZE is \"3\"; expected 1, 2, 4 or 8",
            ),
            (
                "SIZE = 2",
                "SIZE = 16",
                "MACROPIXEL_SIZE is \"16\"; expected 1, 2, 4 or 8",
            ),
            (
                "= MARS\n",
                "= PHOBOS\n",
                "TARGET_NAME is \"PHOBOS\"; expected MARS",
            ),
            ("MARS EXPRESS", "VENUS EXPRESS", "expected MARS EXPRESS"),
            (
                "LINES = 7",
                "LINES = 7 OBJECT = IMAGE_MAP_PROJECTION A = 1 END_OBJECT",
                "OBJECT is \"IMAGE_MAP_PROJECTION\"",
            ),
        ] {
            assert!(GOOD.contains(from), "{from}");
            let told = read(&GOOD.replace(from, to)).unwrap_err().to_string();
            assert!(told.contains(expected), "{to}: {told}");
        }
    }
}
