//! `[[images]]`: labels, or the keys that stand in for them.

use std::ops::Range;

use toml::Spanned;

use crate::{
    image::{IMAGE_DURATION_END_S, IMAGE_LINES_MIN, ImageFields, line_period_agrees},
    units::SECONDS_PER_MS,
};

use super::{
    super::{
        problems::Review,
        raw::{Entry, RawImage},
        site::ImageConfig,
    },
    no_repeats,
    values::{Accept, Target},
};

/// Longest exposure or line period, milliseconds: a hundred times those of the camera.
const MILLISECONDS_MAX: f64 = 1_000.0;
/// Largest summing of the wide-angle cameras; the narrow-angle camera sums up to 8.
const SUMMING_MAX: u32 = 127;
/// Beyond every image of the mission, so that line counts cannot make a run endless.
const LINES_MAX: u32 = 1_000_000;
/// Beyond the detectors of all three cameras.
const DETECTORS_MAX: u32 = 4_096;

pub(super) fn images(
    raw: Entry<Vec<Spanned<RawImage>>>,
    review: &mut Review<'_>,
) -> Vec<ImageConfig> {
    let raw = raw.map(Spanned::into_inner).unwrap_or_default();
    no_repeats(
        "images.id",
        raw.iter().map(|image| image.get_ref().id.as_ref()),
        review,
    );
    if raw
        .iter()
        .any(|image| image.get_ref().serial_number.is_some())
    {
        let names = raw.iter().map(|image| {
            let keys = image.get_ref();
            keys.serial_number.as_ref().or(keys.id.as_ref())
        });
        no_repeats("images.serial_number", names, review);
    }
    raw.iter().map(|raw| image(raw, review)).collect()
}

fn image(raw: &Spanned<RawImage>, review: &mut Review<'_>) -> ImageConfig {
    let keys = raw.get_ref();
    let id = review.identifier("images.id", &keys.id, Some(raw.span()), true);
    let label = keys
        .label
        .as_ref()
        .map(|path| review.existing("images.label", path, Target::File));
    let instrument = keys
        .instrument
        .as_ref()
        .and_then(|written| review.instrument(written));
    let fields = fields(keys, review);
    if label.is_none() {
        complete(raw.span(), keys, review);
    }
    line_period(keys, &fields, review);
    duration(keys, &fields, review);
    if let (Some(header), Some(delivered), Some(written)) = (
        fields.lines_header,
        fields.lines_delivered,
        &keys.lines_delivered,
    ) && delivered > header
    {
        let expected = format!("at most lines_header = {header}");
        review.refuse(written.span(), "images.lines_delivered", expected);
    }
    if let (Some(_), Some(utc)) = (&keys.sclk_start, &keys.utc_start) {
        review.warn(
            utc.span(),
            "images.utc_start is never used: sclk_start comes first".to_owned(),
        );
    }
    let serial_number = keys
        .serial_number
        .is_some()
        .then(|| review.text("images.serial_number", &keys.serial_number, ""));
    ImageConfig {
        id,
        label,
        instrument,
        serial_number,
        fields,
    }
}

fn fields(keys: &RawImage, review: &mut Review<'_>) -> ImageFields {
    let milliseconds = Accept::AboveTo(0.0, MILLISECONDS_MAX);
    let seconds = |review: &mut Review<'_>, key: &str, raw: &Entry<f64>| {
        review
            .optional_number(key, raw.as_ref(), milliseconds)
            .map(|value_ms| value_ms * SECONDS_PER_MS)
    };
    let whole = |review: &mut Review<'_>, key: &str, raw: &Entry<i64>, low, high| {
        review.whole::<u32>(key, raw.as_ref(), low, high)
    };
    ImageFields {
        sclk_start: checked(
            "images.sclk_start",
            keys.sclk_start.as_ref(),
            is_clock_string,
            "a spacecraft clock `seconds:ticks` with ticks below 256, such as 619971158:028",
            review,
        ),
        utc_start: checked(
            "images.utc_start",
            keys.utc_start.as_ref(),
            is_utc_string,
            "UTC such as 1999-08-24T14:12:13.64 or 1999-236T14:12:13.64",
            review,
        ),
        exposure_s: seconds(review, "images.exposure_ms", &keys.exposure_ms),
        line_period_s: seconds(review, "images.line_period_ms", &keys.line_period_ms),
        downtrack_summing: whole(
            review,
            "images.downtrack_summing",
            &keys.downtrack_summing,
            1,
            SUMMING_MAX,
        ),
        crosstrack_summing: whole(
            review,
            "images.crosstrack_summing",
            &keys.crosstrack_summing,
            1,
            SUMMING_MAX,
        ),
        lines_header: whole(
            review,
            "images.lines_header",
            &keys.lines_header,
            IMAGE_LINES_MIN,
            LINES_MAX,
        ),
        lines_delivered: whole(
            review,
            "images.lines_delivered",
            &keys.lines_delivered,
            1,
            LINES_MAX,
        ),
        samples: whole(review, "images.samples", &keys.samples, 1, DETECTORS_MAX),
        first_detector: whole(
            review,
            "images.first_detector",
            &keys.first_detector,
            0,
            DETECTORS_MAX - 1,
        ),
    }
}

/// The text of `key` when `accept` takes it.
fn checked(
    key: &str,
    raw: Option<&Spanned<String>>,
    accept: fn(&str) -> bool,
    expected: &str,
    review: &mut Review<'_>,
) -> Option<String> {
    let raw = raw?;
    if accept(raw.get_ref()) {
        return Some(raw.get_ref().clone());
    }
    review.refuse(raw.span(), key, expected);
    None
}

/// Without a label the keys must give what times and sensor model need: start, line period, summing, size.
fn complete(table: Range<usize>, keys: &RawImage, review: &mut Review<'_>) {
    let needs = [
        (
            keys.sclk_start.is_some() || keys.utc_start.is_some(),
            "sclk_start or utc_start",
        ),
        (
            keys.line_period_ms.is_some() || keys.exposure_ms.is_some(),
            "exposure_ms or line_period_ms",
        ),
        (keys.downtrack_summing.is_some(), "downtrack_summing"),
        (keys.lines_header.is_some(), "lines_header"),
        (keys.samples.is_some(), "samples"),
    ];
    let lacking: Vec<&str> = needs
        .iter()
        .filter(|(given, _)| !given)
        .map(|(_, need)| *need)
        .collect();
    if !lacking.is_empty() {
        review.missing(
            Some(table),
            "images.label",
            format!("a label, or also {}", lacking.join(", ")),
        );
    }
}

/// A period, an exposure and a summing that are all written must agree.
fn line_period(keys: &RawImage, fields: &ImageFields, review: &mut Review<'_>) {
    let (Some(written), Some(period_s), Some(exposure_s), Some(summing)) = (
        &keys.line_period_ms,
        fields.line_period_s,
        fields.exposure_s,
        fields.downtrack_summing,
    ) else {
        return;
    };
    if !line_period_agrees(period_s, exposure_s, summing) {
        let expected_ms = exposure_s * f64::from(summing) / SECONDS_PER_MS;
        review.refuse(
            written.span(),
            "images.line_period_ms",
            format!("exposure_ms × downtrack_summing = {expected_ms:.4}, or only one of them"),
        );
    }
}

/// Lines and line period that are both written must not make an endless image.
fn duration(keys: &RawImage, fields: &ImageFields, review: &mut Review<'_>) {
    let summed_s = || Some(fields.exposure_s? * f64::from(fields.downtrack_summing?));
    let (Some(written), Some(lines), Some(period_s)) = (
        &keys.lines_header,
        fields.lines_header,
        fields.line_period_s.or_else(summed_s),
    ) else {
        return;
    };
    let duration_s = f64::from(lines) * period_s;
    if !(duration_s < IMAGE_DURATION_END_S) {
        let expected = format!(
            "less than {IMAGE_DURATION_END_S} s in all; {lines} lines of {:.4} ms take {duration_s:.1} s",
            period_s / SECONDS_PER_MS
        );
        review.refuse(written.span(), "images.lines_header", expected);
    }
}

/// `[partition/]seconds[:ticks]`, the two fields of the MGS clock (32 bits and 1/256 s).
fn is_clock_string(text: &str) -> bool {
    let digits = |part: &str| !part.is_empty() && part.bytes().all(|byte| byte.is_ascii_digit());
    let (partition, count) = text.split_once('/').unwrap_or(("1", text));
    let (seconds, ticks) = count.split_once([':', '.']).unwrap_or((count, "0"));
    let below = |part: &str, limit: u64| {
        digits(part) && part.parse::<u64>().is_ok_and(|value| value < limit)
    };
    partition == "1" && below(seconds, 1 << 32) && below(ticks, 256)
}

/// `YYYY-MM-DDThh:mm:ss[.fff][Z]`, or with the day of the year `YYYY-DDD`.
///
/// Only the form; leap seconds and month lengths are for the leap-second kernel.
fn is_utc_string(text: &str) -> bool {
    let text = text.strip_suffix('Z').unwrap_or(text);
    let Some((date, time)) = text.split_once('T') else {
        return false;
    };
    let date: Vec<&str> = date.split('-').collect();
    let time: Vec<&str> = time.split(':').collect();
    let date_fits = match date[..] {
        [year, month, day] => {
            whole(year, 4, 1990..=2050) && whole(month, 2, 1..=12) && whole(day, 2, 1..=31)
        }
        [year, day] => whole(year, 4, 1990..=2050) && whole(day, 3, 1..=366),
        _ => false,
    };
    let time_fits = match time[..] {
        [hour, minute, second] => {
            let (second, fraction) = second.split_once('.').unwrap_or((second, "0"));
            whole(hour, 2, 0..=23)
                && whole(minute, 2, 0..=59)
                && whole(second, 2, 0..=60)
                && (1..=9).contains(&fraction.len())
                && fraction.bytes().all(|byte| byte.is_ascii_digit())
        }
        _ => false,
    };
    date_fits && time_fits
}

/// Whether `text` is a number of `width` digits within `range`.
fn whole(text: &str, width: usize, range: std::ops::RangeInclusive<u32>) -> bool {
    text.len() == width
        && text.bytes().all(|byte| byte.is_ascii_digit())
        && text.parse().is_ok_and(|value| range.contains(&value))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clock_strings_have_seconds_and_256ths() {
        for good in [
            "619971158:28",
            "619971158.028",
            "1/0844996544.086",
            "619971158",
        ] {
            assert!(is_clock_string(good), "{good}");
        }
        for bad in [
            "",
            "4294967296:0",
            "1:256",
            "2/1:1",
            "1:",
            "a:1",
            "1:1:1",
            "-1:1",
            "1:+1",
        ] {
            assert!(!is_clock_string(bad), "{bad}");
        }
    }

    #[test]
    fn utc_strings_have_the_forms_of_labels() {
        for good in [
            "1999-08-24T14:12:13.64",
            "1999-236T14:12:13",
            "1998-12-31T23:59:60.5Z",
        ] {
            assert!(is_utc_string(good), "{good}");
        }
        for bad in [
            "",
            "1999-08-24",
            "1999-13-24T14:12:13",
            "1999-08-24T24:12:13",
            "1999-08-24T14:12:61",
            "1999-8-24T14:12:13",
            "1999-08-24T14:12:13.",
            "1999-000T14:12:13",
            "99-08-24T14:12:13",
            "1999-08-24 14:12:13",
            "1999-08-24T1é:12:13",
        ] {
            assert!(!is_utc_string(bad), "{bad}");
        }
    }
}
