//! Labels of MOC images, as archived by PDS and as ISIS writes them.

use std::{fs::File, io::Read, path::Path};

use super::label::{Entry, LABEL_BYTES_MAX, Label, LabelError, parse};
use crate::{
    constants::{MARS_NAME, SPACECRAFT},
    error::{IoError, Locate, Result},
    image::{CLOCK_STRING, ImageFields, is_clock_string},
    instruments::{Instrument, LabelNames},
    units::SECONDS_PER_MS,
};

/// What the label of a MOC image says.
#[derive(Debug, Clone, PartialEq)]
pub struct ImageLabel {
    /// Product, for example `M04/02852`.
    pub product_id: Option<String>,
    /// The camera that took it.
    pub instrument: Instrument,
    /// Times, exposure, summing and size.
    pub fields: ImageFields,
    /// UTC of the end of the last line.
    pub utc_stop: Option<String>,
}

/// Reads a PDS3 label (attached or detached) or an ISIS label of an image by one of `cameras`.
///
/// # Errors
/// The system's refusal to read; no label, or a cut one; those of [`image_label`].
pub fn read_label(path: &Path, cameras: &[Instrument]) -> Result<ImageLabel> {
    let mut bytes = Vec::new();
    File::open(path)
        .map_err(IoError::on("open"))
        .in_file(path)?
        .take(LABEL_BYTES_MAX as u64)
        .read_to_end(&mut bytes)
        .map_err(IoError::on("read"))
        .in_file(path)?;
    let label = parse(&bytes).in_file(path)?;
    if !label.ended {
        return Err(LabelError::NoEnd).in_file(path);
    }
    image_label(&label, cameras).in_file(path)
}

/// The fields of a parsed label; what it does not say stays `None`.
///
/// `lines_delivered` is never set: image data are compressed, so their length in bytes says nothing.
///
/// # Errors
/// An instrument that is not among `cameras`, or none; an image of another spacecraft or target, or one that is
/// map-projected; a value that is not of its kind, or two values under one keyword.
pub fn image_label(
    label: &Label,
    cameras: &[Instrument],
) -> std::result::Result<ImageLabel, LabelError> {
    let instrument = camera(label, cameras)?;
    of_mars_by_mgs(label)?;
    as_taken(label)?;
    let size = |pds, isis| match label.only_in("IMAGE", pds)? {
        None => label.only_in("DIMENSIONS", isis),
        found => Ok(found),
    };
    let first_detector = match label.only("EDIT_MODE_ID")?.filter(|entry| known(entry)) {
        Some(entry) => Some(count(entry, 0)?),
        None => optional_count(label.only("FIRSTLINESAMPLE")?, 1)?.map(|first| first - 1),
    };
    let summing = |pds, isis| optional_count(either(label, pds, isis)?, 1);
    let sclk_start = either(
        label,
        "SPACECRAFT_CLOCK_START_COUNT",
        "SPACECRAFTCLOCKCOUNT",
    )?;
    Ok(ImageLabel {
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
    })
}

/// The MOC product that a name begins with, in capitals and without what stands between its parts: `E0202855` of
/// `E02-02855`, `E02/02855`, `e0202855.imq` and `E02_02855-nadir`; `None` for a name that names no product.
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

/// Mission phases that product identifiers do not count by months (as `M04`, `E02`).
const PHASES: [&str; 5] = ["AB1", "SP1", "SP2", "FHA", "CAL"];

/// Positions, attitudes and the shape of the target are those of MGS and Mars.
fn of_mars_by_mgs(label: &Label) -> std::result::Result<(), LabelError> {
    let required = [
        (
            ["SPACECRAFT_NAME", "SPACECRAFTNAME"],
            &*SPACECRAFT.label_name,
        ),
        (["TARGET_NAME", "TARGETNAME"], MARS_NAME),
    ];
    for ([pds, isis], expected) in required {
        if let Some(entry) = either(label, pds, isis)?
            && !entry.value.replace('_', " ").eq_ignore_ascii_case(expected)
        {
            return Err(other_image(&entry.key, &entry.value, expected));
        }
    }
    Ok(())
}

/// Lines and samples of a map are no places on a detector.
fn as_taken(label: &Label) -> std::result::Result<(), LabelError> {
    match projection(label) {
        Some(entry) => Err(other_image(
            "OBJECT",
            &entry.group,
            "the image as its camera took it, which no map projection describes",
        )),
        None => Ok(()),
    }
}

/// Something of the map projection of an image that has one.
pub(super) fn projection(label: &Label) -> Option<&Entry> {
    let mut entries = label.entries.iter();
    entries.find(|entry| ["IMAGE_MAP_PROJECTION", "MAPPING"].contains(&&*entry.group))
}

fn other_image(key: &str, value: &str, expected: &'static str) -> LabelError {
    LabelError::OtherImage {
        key: key.to_owned(),
        value: value.to_owned(),
        expected,
    }
}

/// The first of `cameras` whose names the label has; a camera that is known without a filter takes any.
fn camera<'a>(
    label: &Label,
    cameras: &'a [Instrument],
) -> std::result::Result<&'a Instrument, LabelError> {
    let value = |pds, isis| {
        let entry = either(label, pds, isis)?;
        Ok(entry.map_or("", |entry| entry.value.as_str()))
    };
    let instrument = value("INSTRUMENT_ID", "INSTRUMENTID")?;
    let filter = value("FILTER_NAME", "FILTERNAME")?;
    let fits = |names: &LabelNames| {
        let own_filter = names.filter.as_deref().unwrap_or(filter);
        names.instrument.eq_ignore_ascii_case(instrument) && own_filter.eq_ignore_ascii_case(filter)
    };
    let found = cameras.iter().find(|camera| fits(&camera.label));
    found.ok_or_else(|| LabelError::Instrument {
        found: format!("{instrument} {filter}").trim().to_owned(),
        known: cameras
            .iter()
            .map(|camera| camera.label.to_string())
            .collect(),
    })
}

/// The entry under its PDS3 keyword or its ISIS keyword, unless it says that the value is not known.
fn either<'a>(
    label: &'a Label,
    pds: &str,
    isis: &str,
) -> std::result::Result<Option<&'a Entry>, LabelError> {
    let entry = match label.only(pds)? {
        None => label.only(isis)?,
        found => found,
    };
    Ok(entry.filter(|entry| known(entry)))
}

/// Whether the entry has a value and not one of the words for "none".
fn known(entry: &Entry) -> bool {
    !matches!(
        entry.value.to_ascii_uppercase().as_str(),
        "" | "UNK" | "N/A" | "NULL"
    )
}

fn text(entry: Option<&Entry>) -> Option<String> {
    entry.map(|entry| entry.value.clone())
}

fn error(entry: &Entry, expected: &'static str) -> LabelError {
    LabelError::Value {
        key: entry.key.clone(),
        value: entry.written(),
        expected,
    }
}

fn count(entry: &Entry, least: u32) -> std::result::Result<u32, LabelError> {
    entry
        .value
        .parse()
        .ok()
        .filter(|count| (least..=1_000_000).contains(count))
        .ok_or_else(|| {
            error(
                entry,
                if least == 0 {
                    "a count from 0"
                } else {
                    "a count from 1"
                },
            )
        })
}

fn optional_count(
    entry: Option<&Entry>,
    least: u32,
) -> std::result::Result<Option<u32>, LabelError> {
    entry
        .filter(|entry| known(entry))
        .map(|entry| count(entry, least))
        .transpose()
}

fn clock(entry: &Entry) -> std::result::Result<String, LabelError> {
    let value = entry.value.clone();
    is_clock_string(&value)
        .then_some(value)
        .ok_or_else(|| error(entry, CLOCK_STRING))
}

/// The exposure in seconds; the archive writes milliseconds, with or without the unit.
fn exposure_s(entry: &Entry) -> std::result::Result<f64, LabelError> {
    const EXPECTED: &str = "milliseconds above 0, below 1000";
    let milliseconds = match entry.unit.as_deref() {
        None | Some("ms" | "msec" | "millisecond" | "milliseconds") => entry.value.parse().ok(),
        Some(_) => None,
    };
    milliseconds
        .filter(|ms: &f64| 0.0 < *ms && *ms < 1_000.0)
        .map(|ms| ms * SECONDS_PER_MS)
        .ok_or_else(|| error(entry, EXPECTED))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::built_in_instruments;

    fn read(text: &str) -> std::result::Result<ImageLabel, LabelError> {
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
                "LINE_EXPOSURE_DURATION stands in the label as \"0.4821\" and as \"0.4821 <s>\"; expected one value",
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
                "OBJECT is \"IMAGE_MAP_PROJECTION\"; expected the image as its camera took it, which no map \
                 projection describes",
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
