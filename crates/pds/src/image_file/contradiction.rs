//! Contradictions between a label and the fragments that follow it.

use super::{
    complaint::{Complaint, Fault},
    fragment::Fragments,
    header::Header,
};
use crate::{image_label::ImageLabel, moc::product_named};

/// Name, in labels, of the only camera whose line-clock unit is known.
const NARROW_ANGLE: &str = "MOC-NA";
/// Unit of that line clock, seconds.
const LINE_CLOCK_S: f64 = 1e-7;
/// Tolerance between line clock and label, units: labels state exposures to a unit, and either may be rounded or
/// truncated.
const LINE_CLOCKS_APART_MAX: f64 = 1.0;

/// Every contradiction, with the fragment used for comparison; empty when no fragment is sound.
///
/// Gain and offset are not compared: they may change within an image.
pub(super) fn contradictions(label: &ImageLabel, fragments: &Fragments) -> Vec<Complaint> {
    let Some(witness) = fragments.witness else {
        return Vec::new();
    };
    let header = &witness.header;
    let found = [
        clock(label, header),
        product(label, header),
        lines(label, header, fragments.are_complete()),
        number(
            "LINE_SAMPLES",
            label.fields.samples,
            header.width(),
            "samples",
        ),
        number(
            "EDIT_MODE_ID",
            label.fields.first_detector,
            header.first_detector(),
            "as first detector",
        ),
        exposure(label, header),
    ];
    let complaint = |what| Complaint {
        fragment: Some(witness.number),
        offset: witness.at,
        line: None,
        what,
    };
    found.into_iter().flatten().map(complaint).collect()
}

/// Label and header have the same clock string, to 1/256 s.
fn clock(label: &ImageLabel, header: &Header) -> Option<Fault> {
    let written = label.fields.sclk_start.as_ref()?;
    let [ticks, seconds @ ..] = header.clock();
    (clock_bytes(written)? != header.clock()).then(|| Fault::Contradiction {
        key: "SPACECRAFT_CLOCK_START_COUNT",
        label: written.clone(),
        fragment: format!("{}:{ticks:03}", u32::from_le_bytes(seconds)),
    })
}

/// The number of the image within its month; other phases number images differently.
fn product(label: &ImageLabel, header: &Header) -> Option<Fault> {
    let written = label.product_id.as_ref()?;
    let product = product_named(written)?;
    let (phase, digits) = product.split_at(3);
    let is_month = phase[1..].bytes().all(|byte| byte.is_ascii_digit());
    // Headers have 16 bits for five digits.
    let number = digits.parse::<u16>().ok().filter(|_| is_month)?;
    (number != header.image()).then(|| Fault::Contradiction {
        key: "PRODUCT_ID",
        label: written.clone(),
        fragment: format!("image {}", header.image()),
    })
}

/// The label may count only the lines transmitted; for a complete image these are all lines.
fn lines(label: &ImageLabel, header: &Header, are_complete: bool) -> Option<Fault> {
    let written = label.fields.lines_header?;
    let is_possible = written < header.total_lines() && !are_complete;
    let stated = (!is_possible).then_some(written);
    number("LINES", stated, header.total_lines(), "lines")
}

fn number(key: &'static str, label: Option<u32>, header: u32, what: &str) -> Option<Fault> {
    let label = label.filter(|label| *label != header)?;
    Some(Fault::Contradiction {
        key,
        label: label.to_string(),
        fragment: format!("{header} {what}"),
    })
}

fn exposure(label: &ImageLabel, header: &Header) -> Option<Fault> {
    let written_s = label.fields.exposure_s?;
    let units = header.line_clock();
    let is_known = label.instrument.label.instrument == NARROW_ANGLE && units > 0;
    let apart = (written_s / LINE_CLOCK_S - f64::from(units)).abs();
    // The tolerance of a millionth of a unit covers the division.
    let is_other = is_known && apart > LINE_CLOCKS_APART_MAX + 1e-6;
    let in_ms = |seconds: f64| format!("{:.4} ms", seconds * 1e3);
    is_other.then(|| Fault::Contradiction {
        key: "LINE_EXPOSURE_DURATION",
        label: in_ms(written_s),
        fragment: in_ms(f64::from(units) * LINE_CLOCK_S),
    })
}

/// A clock string in header format: ticks, then seconds from the least significant byte on.
pub(super) fn clock_bytes(clock: &str) -> Option<[u8; 5]> {
    let count = clock.split_once('/').map_or(clock, |(_, count)| count);
    let (seconds, ticks) = count.split_once([':', '.'])?;
    let [first, second, third, fourth] = seconds.parse::<u32>().ok()?.to_le_bytes();
    Some([ticks.parse().ok()?, first, second, third, fourth])
}
