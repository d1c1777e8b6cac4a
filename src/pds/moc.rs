//! Labels of MOC images, as archived by PDS and as ISIS writes them.

use std::{fs::File, io::Read, path::Path};

use super::label::{Entry, LABEL_BYTES_MAX, Label, LabelError, parse};
use crate::{
    error::{IoError, Locate, Result},
    image::ImageFields,
    instruments::{Instrument, LabelNames},
    units::SECONDS_PER_MS,
};

/// What the label of a MOC image says.
#[derive(Debug, Clone, PartialEq)]
pub struct MocLabel {
    /// Product, for example `M04/02852`.
    pub product_id: Option<String>,
    /// The camera that took it.
    pub instrument: Instrument,
    /// Times, exposure, summing and size.
    pub fields: ImageFields,
}

/// Reads a PDS3 label (attached or detached) or an ISIS label of an image by one of `cameras`.
///
/// # Errors
/// The system's refusal to read; no label; another instrument; a value that is not of its kind.
pub fn read_label(path: &Path, cameras: &[Instrument]) -> Result<MocLabel> {
    let mut bytes = Vec::new();
    File::open(path)
        .map_err(IoError::on("open"))
        .in_file(path)?
        .take(LABEL_BYTES_MAX as u64)
        .read_to_end(&mut bytes)
        .map_err(IoError::on("read"))
        .in_file(path)?;
    parse(&bytes)
        .and_then(|label| moc_label(&label, cameras))
        .in_file(path)
}

/// The fields of a parsed label; what it does not say stays `None`.
///
/// `lines_delivered` is never set: image data are compressed, so their length in bytes says nothing.
///
/// # Errors
/// An instrument that is not among `cameras`, or none; a value that is not of its kind.
pub fn moc_label(
    label: &Label,
    cameras: &[Instrument],
) -> std::result::Result<MocLabel, LabelError> {
    let instrument = camera(label, cameras)?;
    let lines = label
        .find_in("IMAGE", "LINES")
        .or_else(|| label.find_in("DIMENSIONS", "LINES"));
    let samples = label
        .find_in("IMAGE", "LINE_SAMPLES")
        .or_else(|| label.find_in("DIMENSIONS", "SAMPLES"));
    let first_detector = match label.find("EDIT_MODE_ID").filter(|entry| known(entry)) {
        Some(entry) => Some(count(entry, 0)?),
        None => optional_count(label.find("FIRSTLINESAMPLE"), 1)?.map(|first| first - 1),
    };
    let summing = |pds, isis| optional_count(either(label, pds, isis), 1);
    Ok(MocLabel {
        product_id: text(either(label, "PRODUCT_ID", "PRODUCTID")),
        instrument: instrument.clone(),
        fields: ImageFields {
            sclk_start: text(either(
                label,
                "SPACECRAFT_CLOCK_START_COUNT",
                "SPACECRAFTCLOCKCOUNT",
            )),
            utc_start: text(either(label, "START_TIME", "STARTTIME")),
            exposure_s: either(label, "LINE_EXPOSURE_DURATION", "LINEEXPOSUREDURATION")
                .map(exposure_s)
                .transpose()?,
            line_period_s: None,
            downtrack_summing: summing("DOWNTRACK_SUMMING", "DOWNTRACKSUMMING")?,
            crosstrack_summing: summing("CROSSTRACK_SUMMING", "CROSSTRACKSUMMING")?,
            lines_header: optional_count(lines, 1)?,
            lines_delivered: None,
            samples: optional_count(samples, 1)?,
            first_detector,
        },
    })
}

/// The first of `cameras` whose names the label has; a camera that is known without a filter takes any.
fn camera<'a>(
    label: &Label,
    cameras: &'a [Instrument],
) -> std::result::Result<&'a Instrument, LabelError> {
    let value = |pds, isis| either(label, pds, isis).map_or("", |entry| entry.value.as_str());
    let instrument = value("INSTRUMENT_ID", "INSTRUMENTID");
    let filter = value("FILTER_NAME", "FILTERNAME");
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
fn either<'a>(label: &'a Label, pds: &str, isis: &str) -> Option<&'a Entry> {
    let entry = label.find(pds).or_else(|| label.find(isis))?;
    known(entry).then_some(entry)
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
    let value = match &entry.unit {
        Some(unit) => format!("{} <{unit}>", entry.value),
        None => entry.value.clone(),
    };
    LabelError::Value {
        key: entry.key.clone(),
        value,
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

    fn read(text: &str) -> std::result::Result<MocLabel, LabelError> {
        moc_label(&parse(text.as_bytes()).unwrap(), built_in_instruments())
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
