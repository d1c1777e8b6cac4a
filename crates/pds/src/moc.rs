//! Labels of MOC images, as archived by PDS and as ISIS writes them.

use super::{
    image_label::{
        CLOCK_KEY, ImageLabel, as_taken, camera, count, damage, either, known, of_mars,
        optional_count, text, value_error,
    },
    label::{Entry, Label, LabelError},
};
use areograph_base::{
    constants::SPACECRAFT,
    image::{CLOCK_STRING, ImageFields, is_clock_string},
    instruments::Instrument,
    units::SECONDS_PER_MS,
};

/// The fields of a parsed label; missing ones are `None`.
///
/// `lines_delivered` is never set: image data are compressed, so their length in bytes does not determine it.
///
/// # Errors
/// An instrument that is not among `cameras`, or none; an image of another spacecraft or target, or one that is
/// map-projected; a value that is not of its kind, or two values under one keyword.
pub fn image_label(label: &Label, cameras: &[Instrument]) -> Result<ImageLabel, LabelError> {
    let read = label_of_camera(label, cameras)?;
    as_taken(label)?;
    Ok(read)
}

/// Reads the label of an image that may be map-projected.
pub(super) fn label_of_camera(
    label: &Label,
    cameras: &[Instrument],
) -> Result<ImageLabel, LabelError> {
    let instrument = camera(label, cameras, ["FILTER_NAME", "FILTERNAME"])?;
    let spacecraft = ["SPACECRAFT_NAME", "SPACECRAFTNAME"];
    of_mars(label, spacecraft, &SPACECRAFT.label_name)?;
    let size = |pds, isis| match label.only_in("IMAGE", pds)? {
        None => label.only_in("DIMENSIONS", isis),
        found => Ok(found),
    };
    let first_detector = match label.only("EDIT_MODE_ID")?.filter(|entry| known(entry)) {
        Some(entry) => Some(count(entry, 0)?),
        None => optional_count(label.only("FIRSTLINESAMPLE")?, 1)?.map(|first| first - 1),
    };
    let summing = |pds, isis| optional_count(either(label, pds, isis)?, 1);
    let sclk_start = either(label, CLOCK_KEY, "SPACECRAFTCLOCKCOUNT")?;
    Ok(ImageLabel {
        remarks: damage(label, sclk_start.is_some()),
        product_id: text(either(label, "PRODUCT_ID", "PRODUCTID")?),
        instrument: instrument.clone(),
        fields: ImageFields {
            sclk_start: sclk_start.map(clock).transpose()?,
            utc_start: text(either(label, "START_TIME", "STARTTIME")?),
            exposure_s: either(label, "LINE_EXPOSURE_DURATION", "LINEEXPOSUREDURATION")?
                .map(exposure_s)
                .transpose()?,
            line_period_s: None,
            downtrack_summing: summing("DOWNTRACK_SUMMING", "DOWNTRACKSUMMING")?,
            crosstrack_summing: summing("CROSSTRACK_SUMMING", "CROSSTRACKSUMMING")?,
            lines_header: optional_count(size("LINES", "LINES")?, 1)?,
            lines_delivered: None,
            samples: optional_count(size("LINE_SAMPLES", "SAMPLES")?, 1)?,
            first_detector,
        },
        utc_stop: text(either(label, "STOP_TIME", "STOPTIME")?),
        lines: None,
    })
}

/// The MOC product at the start of a name, in capitals and without separators: `E0202855` of `E02-02855`, `E02/02855`,
/// `e0202855.imq` and `E02_02855-nadir`; `None` if the name contains no product.
#[must_use]
pub fn product_named(name: &str) -> Option<String> {
    const LENGTH: usize = 8;
    let mut product = String::new();
    let mut rest = name.chars().peekable();
    while product.len() < LENGTH {
        match rest.next()? {
            '-' | '/' | '_' => {}
            other if other.is_ascii_alphanumeric() => product.push(other.to_ascii_uppercase()),
            _ => return None,
        }
    }
    let (phase, number) = product.split_at(3);
    let digits = |text: &str| text.bytes().all(|byte| byte.is_ascii_digit());
    let months =
        phase.starts_with(|first: char| first.is_ascii_alphabetic()) && digits(&phase[1..]);
    let is_product = (months || PHASES.contains(&phase))
        && digits(number)
        && !rest.peek().is_some_and(char::is_ascii_digit);
    is_product.then_some(product)
}

/// Mission phases whose product identifiers are not counted by months (as `M04`, `E02`).
const PHASES: [&str; 5] = ["AB1", "SP1", "SP2", "FHA", "CAL"];

fn clock(entry: &Entry) -> Result<String, LabelError> {
    let value = entry.value.clone();
    is_clock_string(&value)
        .then_some(value)
        .ok_or_else(|| value_error(entry, CLOCK_STRING))
}

/// The exposure in seconds; the archive writes milliseconds, with or without the unit.
fn exposure_s(entry: &Entry) -> Result<f64, LabelError> {
    const EXPECTED: &str = "milliseconds above 0, below 1000";
    let milliseconds = match entry.unit.as_deref() {
        None | Some("ms" | "msec" | "millisecond" | "milliseconds") => entry.value.parse().ok(),
        Some(_) => None,
    };
    milliseconds
        .filter(|ms: &f64| 0.0 < *ms && *ms < 1_000.0)
        .map(|ms| ms * SECONDS_PER_MS)
        .ok_or_else(|| value_error(entry, EXPECTED))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::label::parse;
    use areograph_config::built_in_instruments;

    fn read(text: &str) -> Result<ImageLabel, LabelError> {
        image_label(&parse(text.as_bytes()).unwrap(), built_in_instruments())
    }

    #[test]
    fn values_that_are_not_of_their_kind_are_refused_with_what_was_expected() {
        let cases = [
            (
                "DOWNTRACK_SUMMING = 0",
                "DOWNTRACK_SUMMING is \"0\"; expected a count from 1",
            ),
            (
                "LINE_EXPOSURE_DURATION = 0.4821 <SECONDS>",
                "LINE_EXPOSURE_DURATION is \"0.4821 <seconds>\"; expected milliseconds above 0, below 1000",
            ),
            (
                "LINE_EXPOSURE_DURATION = NaN",
                "LINE_EXPOSURE_DURATION is \"NaN\"; expected milliseconds above 0, below 1000",
            ),
            (
                "SPACECRAFT_CLOCK_START_COUNT = \"669788295:256\"",
                "SPACECRAFT_CLOCK_START_COUNT is \"669788295:256\"; expected a spacecraft clock `seconds:ticks` with \
                 ticks below 256, such as 619971158:028",
            ),
            (
                "LINE_EXPOSURE_DURATION = 0.4821\nLINE_EXPOSURE_DURATION = 0.4821 <S>",
                "LINE_EXPOSURE_DURATION appears in the label as \"0.4821\" and as \"0.4821 <s>\"; expected one value",
            ),
            (
                "SPACECRAFT_NAME = MARS_OBSERVER",
                "SPACECRAFT_NAME is \"MARS_OBSERVER\"; expected MARS GLOBAL SURVEYOR",
            ),
            (
                "TARGETNAME = Phobos",
                "TARGETNAME is \"Phobos\"; expected MARS",
            ),
            (
                "OBJECT = IMAGE_MAP_PROJECTION\nMAP_SCALE = 1\nEND_OBJECT",
                "OBJECT is \"IMAGE_MAP_PROJECTION\"; expected the image as taken by the camera, without a \
                 map projection",
            ),
            (
                "EDIT_MODE_ID = \"-1\"",
                "EDIT_MODE_ID is \"-1\"; expected a count from 0",
            ),
            (
                "OBJECT = IMAGE\nLINES = many\nEND_OBJECT",
                "LINES is \"many\"; expected a count from 1",
            ),
        ];
        for (line, message) in cases {
            let found = read(&format!("INSTRUMENT_ID = \"MOC-NA\"\n{line}\nEND\n"));
            assert_eq!(found.unwrap_err().to_string(), message);
        }
    }

    #[test]
    fn other_instruments_are_refused_and_unknown_values_left_out() {
        let refused = |text: &str| read(text).unwrap_err().to_string();
        let expected = "expected MOC-NA, MOC-WA RED or MOC-WA BLUE";
        for (text, found) in [
            ("INSTRUMENT_ID = MOC-WA\n", "MOC-WA"),
            (
                "INSTRUMENT_ID = MOC-WA\nFILTER_NAME = GREEN\n",
                "MOC-WA GREEN",
            ),
            ("LINES = 3\n", ""),
        ] {
            assert_eq!(
                refused(text),
                format!("instrument is {found:?}; {expected}")
            );
        }
        let label =
            read("INSTRUMENT_ID = MOC-NA\nSTART_TIME = UNK\nPRODUCT_ID = \"N/A\"\n").unwrap();
        assert_eq!(
            (label.product_id, label.fields),
            (None, ImageFields::default())
        );
    }

    #[test]
    fn products_are_known_by_their_names_however_they_are_written() {
        for (name, product) in [
            ("E02/02855", Some("E0202855")),
            ("E02-02855", Some("E0202855")),
            ("e0202855.imq", Some("E0202855")),
            ("E02_02855-2", Some("E0202855")),
            ("AB-1-024/01", Some("AB102401")),
            ("sp246804", Some("SP246804")),
            ("E02-028551", None),
            ("E02-285", None),
            ("image", None),
            ("img00001", None),
            ("nadir 12345", None),
            ("é02-02855", None),
        ] {
            assert_eq!(product_named(name).as_deref(), product, "{name}");
        }
    }

    #[test]
    fn instrument_and_filter_tell_the_cameras_apart() {
        for (text, id) in [
            ("INSTRUMENT_ID = \"MOC-NA\"\n", "moc_na"),
            ("INSTRUMENTID = MOC-NA\nFILTERNAME = BROAD_BAND\n", "moc_na"),
            (
                "INSTRUMENT_ID = MOC-WA\nFILTER_NAME = \"RED\"\n",
                "moc_wa_red",
            ),
            ("INSTRUMENTID = MOC-WA\nFILTERNAME = Blue\n", "moc_wa_blue"),
        ] {
            assert_eq!(read(text).unwrap().instrument.id, id);
        }
    }
}
