//! `[[images]]`: labels, or the keys that replace them.

use std::path::PathBuf;

use serde::Deserialize;
use serde_json::json;

use areograph_base::{
    constants::SPACECRAFT,
    image::{
        CLOCK_STRING, IMAGE_DURATION_END_S, IMAGE_LINES_MIN, ImageFields, is_clock_string,
        line_period_agrees,
    },
    instruments::Instrument,
    units::SECONDS_PER_MS,
};

use super::{
    declare::{Declare, Keys, Many, declare_table, group, key},
    exposures::{ExposurePiece, ExposureRows, LINES_MAX, MILLISECONDS_MAX, line_times_of},
    forms::{Switch, Whole, above_to, identifier, matching, text, whole_from_to},
    instruments::CAMERA,
    paths::FILE,
};

/// Largest summing of the wide-angle cameras; the narrow-angle camera sums up to 8.
const SUMMING: Whole<u32> = whole_from_to(1, 127);
/// More than the detectors of any camera.
const DETECTORS_MAX: u32 = 8_192;

/// Images of a site.
pub(super) const IMAGES: Many = Many {
    further: &[&[
        " Without a label or support data, the required keys are `downtrack_summing`, `lines_header`, `samples`, and",
        " either `exposures` or a start (`sclk_start` or `utc_start`) with `exposure_ms` or `line_period_ms`.",
    ]],
    ..Many::ANY
};

declare_table! {
    /// Images (optional): each has a label, keys for the image parameters, both, or support data. Keys written here
    /// take precedence over the label.
    pub struct ImageConfig: Deserialize {
        /// Identifier, unique in the site, and folder name. An identifier that begins with a product name, such as
        /// `E02-02855`, `m0402852_part` or `h5270_0000_ir2`, is accepted only with the label of that product.
        id: String = key(identifier())
            .required()
            .example(r#""E02-02855""#)
            .example_in(1, r#""M04-02852""#),
        /// PDS3 or ISIS label, attached or detached. For HRSC on Mars Express: the level-2 file of the archive
        /// (`h….img`), whose rows contain the line times, together with `instrument`; a label without its image also
        /// requires `exposures`. An HRSC file with fewer samples than detector elements requires `first_detector` (ISIS
        /// and ALE assume pixel 0).
        #[serde(skip)]
        label: Option<PathBuf> = key(FILE).example(r#""../labels/e0202855.lbl""#),
        /// File with the pixels of the image (.imq, .img, .cub, TIFF, PNG), which may be the file of the label. The
        /// report shows footprints and tie points on the image, and `ties.match` matches tie points in it. A file
        /// without a label must contain all lines. Two files without labels must differ in size if they are matched:
        /// the size distinguishes them.
        #[serde(skip)]
        pixels: Option<PathBuf> = key(FILE).unused(r#""../images/e0202855.imq""#),
        /// Alternatively, image support data (ISD) of the Community Sensor Model, as written by ALE: camera, line times
        /// and orientation of a line scanner, in place of a label and of keys for these parameters. The orientation is
        /// used unchanged: pointing bias, `light_time` and the orbit and attitude kernels do not apply to such an
        /// image.
        #[serde(skip)]
        isd: Option<PathBuf> = key(FILE).unused(r#""../isd/m0402852.json""#),
        /// Alternatively, an ISIS cube of a MOC image after `spiceinit`, whose label and tables give line times, camera
        /// and orientation, or a cube of a line scanner after `csminit`, whose camera model state gives them. The cube
        /// replaces orbit and attitude kernels, the label, and keys for these parameters. The orientation is used
        /// unchanged, as with support data; it contains the pointing bias of ISIS. A cropped or reduced cube represents
        /// the image of its own lines and samples (group `AlphaCube`). A map-projected cube represents the image before
        /// the projection, whose samples are not the pixels of the cube. To use the pixels of an unprojected cube, name
        /// the cube in `pixels` as well.
        #[serde(skip)]
        cube: Option<PathBuf> = key(FILE).unused(r#""../cubes/E0201461.cub""#),
        /// Whether the spacecraft of the support data carries the laser and its positions in the support data are
        /// geometric. These positions are then used for the ranges of shots fired during the exposure of the image.
        /// Only with support data.
        has_laser: bool = key(Switch).or(false).unused("true"),
        /// Camera of the image: `moc_na`, `moc_wa_red`, `moc_wa_blue`; a line of HRSC on Mars Express (`hrsc_nd`,
        /// `hrsc_s1`, `hrsc_s2`, `hrsc_p1`, `hrsc_p2`, `hrsc_ir`, `hrsc_gr`, `hrsc_bl`, `hrsc_re`); or the path of an
        /// instrument file as in `config/instruments`. The key is required with HRSC labels. Otherwise, the default is
        /// the MOC camera that the label names or, without a label, `moc_na`. The spacecraft of the camera determines
        /// clock, orbit and attitude.
        instrument: Option<Instrument> = key(CAMERA).example(r#""moc_na""#),
        /// Name of the image in tie point files and in files for ISIS. In tie point files, the default is the
        /// identifier; in networks and files for ISIS, it is the serial number that ISIS composes from the label, where
        /// this number is known. The clock reading of a serial number must agree with the image.
        serial_number: Option<String> =
            key(text()).example(r#""MGS/651158134:116/MOC-NA""#),
        /// Line times of an image with changing exposure, as with HRSC. Each piece consists of its first line (counted
        /// from 0), the start of that line in ephemeris time (TDB seconds past J2000), and the line period in
        /// milliseconds. ISIS stores line times in the table `LineScanTimes` (lines counted from 1), ALE in
        /// `line_scan_rate` (seconds from `center_ephemeris_time`). Requires `lines_header`; excludes `exposure_ms` and
        /// `line_period_ms`. A separate start time must agree with the pieces, and a gap of more than half a line
        /// between two pieces is reported.
        exposures: Option<Vec<ExposurePiece>> = key(ExposureRows)
            .unused("[[0, 255744599.027482, 12.800791], [6665, 255744684.345045, 13.227428]]"),
        /// Keys written in the configuration.
        fields: ImageFields = group(),
    }
    check is_complete
}

impl ImageConfig {
    /// The file with line times, exposure and orientation: support data, or an oriented cube.
    #[must_use]
    pub fn support(&self) -> Option<&PathBuf> {
        self.isd.as_ref().or(self.cube.as_ref())
    }

    /// The file with line times and exposure: that with the orientation too, or a label.
    #[must_use]
    pub fn source(&self) -> Option<&PathBuf> {
        self.support().or(self.label.as_ref())
    }

    /// The name of the image in tie point files.
    #[must_use]
    pub fn name_in_ties(&self) -> &str {
        self.serial_number.as_deref().unwrap_or(&self.id)
    }
}

declare_table! {
    /// Parameters of an image in the configuration.
    fill ImageFields {
        /// Spacecraft clock at the start of the first line, seconds:ticks with 256 ticks per second (":28" and ":028"
        /// are both 28/256 s). Preferred over UTC, which is rounded in labels (errors of 1.0 to 4.8 ms were found in
        /// five labels). A difference of more than 20 ms between clock and UTC is reported, and a difference of more
        /// than 1 s is refused. Not for Mars Express, because clock readings in its labels disagree with its clock
        /// kernels by seconds.
        sclk_start = key(matching(
            CLOCK_STRING,
            "^(1/)?[0-9]+[:.][0-9]+$",
            is_clock_string,
        )).example_in(1, r#""619971158:028""#),
        /// UTC at the start of the first line, used without `sclk_start`.
        utc_start = key(matching(
            "UTC such as 1999-08-24T14:12:13.64 or 1999-236T14:12:13.64",
            "^[0-9]{4}-([0-9]{2}-[0-9]{2}|[0-9]{3})T[0-9]{2}:[0-9]{2}:[0-9]{2}([.][0-9]{1,9})?Z?$",
            is_utc_string,
        )).unused_in(1, r#""1999-08-24T14:12:13.64""#),
        /// Exposure of one detector line (`LINE_EXPOSURE_DURATION`).
        exposure_s as "exposure_ms" = milliseconds("0.4821"),
        /// Time between two image lines: `exposure_ms` × `downtrack_summing`. Either `exposure_ms` or `line_period_ms`
        /// is sufficient; both, or one here and one in the label, must agree within the rounding of 0.0001 ms. The line
        /// period is the "Exposure Time" of Shan et al. 2005, Table 2.
        line_period_s as "line_period_ms" = milliseconds("3.8568"),
        /// Number of detector lines summed along the track (narrow angle: up to 8).
        downtrack_summing = key(SUMMING).example_in(1, "8"),
        /// Number of detector elements summed across the track.
        crosstrack_summing = key(SUMMING).example_in(1, "8"),
        /// Number of exposed lines according to the image header, for the time model; the exposure of all lines must
        /// take less than 600 s.
        lines_header = key(whole_from_to(IMAGE_LINES_MIN, LINES_MAX)).example_in(1, "1536"),
        /// Number of lines in the delivered file, if fewer than were exposed.
        lines_delivered = key(whole_from_to(1, LINES_MAX)).example_in(1, "1536"),
        /// Number of samples per line.
        samples = key(whole_from_to(1, DETECTORS_MAX)).example_in(1, "256"),
        /// First detector element, counted from 0 (`EDIT_MODE_ID`).
        first_detector = key(whole_from_to(0, DETECTORS_MAX - 1)).example_in(1, "0"),
    }
    check agree
}

fn milliseconds(example: &'static str) -> impl Declare<Value = Option<f64>> {
    key(above_to(0.0, MILLISECONDS_MAX))
        .example_in(1, example)
        .map(|value_ms| value_ms.map(|value_ms| value_ms * SECONDS_PER_MS))
}

/// Keys that replace a label.
const OF_FIELDS: [&str; 11] = [
    "exposures",
    "sclk_start",
    "utc_start",
    "exposure_ms",
    "line_period_ms",
    "downtrack_summing",
    "crosstrack_summing",
    "lines_header",
    "lines_delivered",
    "samples",
    "first_detector",
];

/// Without a label the keys must give what times and sensor model need: start, line period, summing, size.
fn is_complete(image: &ImageConfig, keys: &mut Keys<'_, '_>) {
    const NEEDS: [&[&str]; 5] = [
        &["sclk_start", "utc_start", "exposures"],
        &["exposure_ms", "line_period_ms", "exposures"],
        &["downtrack_summing"],
        &["lines_header"],
        &["samples"],
    ];
    keys.rule(|| {
        let needs = NEEDS.map(|ways| {
            let ways: Vec<_> = ways.iter().map(|way| json!({"required": [way]})).collect();
            json!({"anyOf": ways})
        });
        json!({"anyOf": [{"required": ["label"]}, {"required": ["isd"]}, {"required": ["cube"]}, {"allOf": needs}]})
    });
    let support = ["isd", "cube"].map(|key| keys.span_of(key).is_some());
    if support.contains(&true) {
        if support == [true; 2] {
            keys.refuse("cube", "either support data (isd) or a cube, not both");
        }
        let why = if support[0] {
            "the support data of images.isd replace this key"
        } else {
            "the label and tables of images.cube replace this key"
        };
        let of_label = ["label", "instrument"].into_iter();
        for key in of_label.chain(OF_FIELDS) {
            keys.unused(key, why);
        }
        return;
    }
    keys.unused(
        "has_laser",
        "the kernels give the positions of the spacecraft with the laser",
    );
    of_spacecraft(image, keys);
    of_pieces(image, keys);
    let lacking: Vec<String> = NEEDS
        .into_iter()
        .filter(|ways| !ways.iter().any(|way| keys.span_of(way).is_some()))
        .map(|ways| ways.join(" or "))
        .collect();
    if keys.span_of("label").is_none() && !lacking.is_empty() {
        let expected = format!(
            "a label, support data (isd) or an oriented cube, or else {}",
            lacking.join(", ")
        );
        keys.missing("label", &expected);
    }
}

/// The clock belongs to the spacecraft that carries the camera.
fn of_spacecraft(image: &ImageConfig, keys: &mut Keys<'_, '_>) {
    let named = image.instrument.as_ref().map(|camera| camera.spacecraft);
    let spacecraft = named.unwrap_or(&SPACECRAFT);
    let of = &spacecraft.full_name;
    if !spacecraft.labels_tell_clock {
        let expected = format!(
            "utc_start or exposures instead: clock readings in {of} labels disagree with the clock kernels by seconds"
        );
        keys.refuse("sclk_start", expected);
    }
}

/// Pieces of line times follow each other, and no other key contradicts them.
fn of_pieces(image: &ImageConfig, keys: &mut Keys<'_, '_>) {
    let Some(pieces) = &image.exposures else {
        return;
    };
    for key in ["exposure_ms", "line_period_ms"] {
        keys.refuse(
            key,
            "no such key: images.exposures states this quantity for every piece",
        );
    }
    // The values of a label are compared with them when it is read.
    let Some(lines) = image.fields.lines_header else {
        return;
    };
    match line_times_of(pieces, lines) {
        Err(wrong) => {
            let span = keys.span_of("exposures");
            keys.review()
                .problem(span, format!("images.exposures: {wrong}"));
        }
        Ok(times) if !(times.duration_s() < IMAGE_DURATION_END_S) => {
            let expected = format!(
                "less than {IMAGE_DURATION_END_S} s in all; these pieces take {:.1} s",
                times.duration_s()
            );
            keys.refuse("exposures", expected);
        }
        Ok(_) => {}
    }
}

/// Keys that are all written must agree.
fn agree(fields: &ImageFields, keys: &mut Keys<'_, '_>) {
    line_period(fields, keys);
    duration(fields, keys);
    if let (Some(header), Some(delivered)) = (fields.lines_header, fields.lines_delivered)
        && delivered > header
    {
        keys.refuse(
            "lines_delivered",
            format!("at most lines_header = {header}"),
        );
    }
    if keys.span_of("sclk_start").is_some() {
        keys.unused("utc_start", "sclk_start comes first");
    }
}

/// A period, an exposure and a summing that are all written must agree.
fn line_period(fields: &ImageFields, keys: &mut Keys<'_, '_>) {
    let (Some(period_s), Some(exposure_s), Some(summing)) = (
        fields.line_period_s,
        fields.exposure_s,
        fields.downtrack_summing,
    ) else {
        return;
    };
    if !line_period_agrees(period_s, exposure_s, summing) {
        let expected_ms = exposure_s * f64::from(summing) / SECONDS_PER_MS;
        keys.refuse(
            "line_period_ms",
            format!(
                "exposure_ms × downtrack_summing = {expected_ms:.4}, or only one of exposure_ms and line_period_ms"
            ),
        );
    }
}

/// Lines and line period that are both written must not make an endless image.
fn duration(fields: &ImageFields, keys: &mut Keys<'_, '_>) {
    let summed_s = || Some(fields.exposure_s? * f64::from(fields.downtrack_summing?));
    let period_s = fields.line_period_s.or_else(summed_s);
    let (Some(lines), Some(period_s)) = (fields.lines_header, period_s) else {
        return;
    };
    let duration_s = f64::from(lines) * period_s;
    if !(duration_s < IMAGE_DURATION_END_S) {
        let expected = format!(
            "less than {IMAGE_DURATION_END_S} s in all; {lines} lines of {:.4} ms take {duration_s:.1} s",
            period_s / SECONDS_PER_MS
        );
        keys.refuse("lines_header", expected);
    }
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
