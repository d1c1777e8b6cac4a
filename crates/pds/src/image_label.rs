//! Fields and value formats that labels of all cameras share.

use super::label::{Entry, Label, LabelError};
use areograph_base::{
    constants::MARS_NAME,
    image::ImageFields,
    instruments::{Instrument, LabelNames},
    line_times::LinePiece,
};

/// Fields of the label of an image.
#[derive(Debug, Clone, PartialEq)]
pub struct ImageLabel {
    /// Product, for example `M04/02852` or `H5270_0000_IR2.IMG`.
    pub product_id: Option<String>,
    /// The camera that took it.
    pub instrument: Instrument,
    /// Times, exposure, summing and size.
    pub fields: ImageFields,
    /// UTC of the end of the last line.
    pub utc_stop: Option<String>,
    /// Line times, where each row of the file has its own.
    pub lines: Option<RowTimes>,
    /// Text that is not a statement, and a keyword that only resembles the clock's, one sentence each.
    pub remarks: Vec<String>,
}

/// Keyword of the clock count of the first line.
pub(super) const CLOCK_KEY: &str = "SPACECRAFT_CLOCK_START_COUNT";
/// Letters in which a damaged keyword differs from it.
const CLOCK_KEY_DAMAGE: usize = 2;

/// Damage of a label that was read; `has_clock` – whether it states the clock count.
pub(super) fn damage(label: &Label, has_clock: bool) -> Vec<String> {
    let unread = label.unread.iter().map(|unread| {
        format!(
            "line {} of the label does not have the form KEY = value: {:?}",
            unread.line, unread.text
        )
    });
    let mut remarks: Vec<String> = unread.collect();
    let resembles = |entry: &&Entry| {
        let pairs = entry.key.chars().zip(CLOCK_KEY.chars());
        let differing = pairs.filter(|(found, expected)| found != expected).count();
        entry.key.len() == CLOCK_KEY.len() && (1..=CLOCK_KEY_DAMAGE).contains(&differing)
    };
    let resembling = label.entries.iter().find(resembles);
    if !has_clock && (resembling.is_some() || !remarks.is_empty()) {
        let instead = resembling.map_or_else(String::new, |entry| format!(", but {}", entry.key));
        remarks.push(format!(
            "the damaged label states no {CLOCK_KEY}{instead}: without the key sclk_start, the start time is taken from \
             START_TIME, which is truncated to 10 ms"
        ));
    }
    remarks
}

/// Line times of an image from its rows.
#[derive(Debug, Clone, PartialEq)]
pub struct RowTimes {
    /// Number of lines.
    pub lines: u32,
    /// Pieces with one line period each, in order; gaps may separate them. Empty where the rows contain no times.
    pub pieces: Vec<LinePiece>,
    /// Faults of these times, one sentence each.
    pub remarks: Vec<String>,
}

/// The first of `cameras` whose names the label has, the filter under its PDS3 or its ISIS keyword; a camera that is
/// known without a filter matches any.
pub(super) fn camera<'a>(
    label: &Label,
    cameras: &'a [Instrument],
    [pds, isis]: [&str; 2],
) -> Result<&'a Instrument, LabelError> {
    let value = |pds, isis| {
        let entry = either(label, pds, isis)?;
        Ok(entry.map_or("", |entry| entry.value.as_str()))
    };
    let instrument = value("INSTRUMENT_ID", "INSTRUMENTID")?;
    let filter = value(pds, isis)?;
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

/// Checks that the image is of Mars, by this spacecraft, whose keywords are given: positions, attitudes and the
/// target's shape are theirs.
pub(super) fn of_mars(
    label: &Label,
    spacecraft: [&str; 2],
    expected: &'static str,
) -> Result<(), LabelError> {
    let required = [
        (spacecraft, expected),
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

/// Rejects map-projected images: lines and samples of a map are not places on a detector.
pub(super) fn as_taken(label: &Label) -> Result<(), LabelError> {
    match projection(label) {
        Some(entry) => Err(other_image(
            "OBJECT",
            &entry.group,
            "the image as taken by the camera, without a map projection",
        )),
        None => Ok(()),
    }
}

/// An entry of the map projection of an image, if it has one.
pub(super) fn projection(label: &Label) -> Option<&Entry> {
    let mut entries = label.entries.iter();
    entries.find(|entry| ["IMAGE_MAP_PROJECTION", "MAPPING"].contains(&&*entry.group))
}

pub(super) fn other_image(key: &str, value: &str, expected: &'static str) -> LabelError {
    LabelError::OtherImage {
        key: key.to_owned(),
        value: value.to_owned(),
        expected,
    }
}

/// The entry under its PDS3 or its ISIS keyword, unless its value is marked as unknown.
pub(super) fn either<'a>(
    label: &'a Label,
    pds: &str,
    isis: &str,
) -> Result<Option<&'a Entry>, LabelError> {
    let entry = match label.only(pds)? {
        None => label.only(isis)?,
        found => found,
    };
    Ok(entry.filter(|entry| known(entry)))
}

/// Whether the entry has a value other than the words for unknown values.
pub(super) fn known(entry: &Entry) -> bool {
    !matches!(
        entry.value.to_ascii_uppercase().as_str(),
        "" | "UNK" | "N/A" | "NULL"
    )
}

pub(super) fn text(entry: Option<&Entry>) -> Option<String> {
    entry.map(|entry| entry.value.clone())
}

pub(super) fn value_error(entry: &Entry, expected: &'static str) -> LabelError {
    LabelError::Value {
        key: entry.key.clone(),
        value: entry.written(),
        expected,
    }
}

pub(super) fn count(entry: &Entry, least: u32) -> Result<u32, LabelError> {
    entry
        .value
        .parse()
        .ok()
        .filter(|count| (least..=1_000_000).contains(count))
        .ok_or_else(|| {
            value_error(
                entry,
                if least == 0 {
                    "a count from 0"
                } else {
                    "a count from 1"
                },
            )
        })
}

pub(super) fn optional_count(entry: Option<&Entry>, least: u32) -> Result<Option<u32>, LabelError> {
    entry
        .filter(|entry| known(entry))
        .map(|entry| count(entry, least))
        .transpose()
}
