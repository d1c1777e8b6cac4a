//! Image support data (ISD) of the Community Sensor Model, as ALE writes and usgscsm reads them: camera, line times and
//! tables of positions and rotations of a line scanner.
//!
//! Numbers are interpreted as in usgscsm. The first line and the first sample have their centres at 0.5; a row
//! `[line, time, period]` of `line_scan_rate` holds from that line coordinate on, and there
//! `t = centre + time + period · (coordinate − line + 0.5)`.
//!
//! Support data replace label and kernels of an image, and no later stage distinguishes them. They become the camera
//! (turned about its boresight until the line lies along Y), line times and tables. `ImageTimes::support` carries
//! these, and `sample_orientation` puts them on the uniform grid of `CameraTables`, as usgscsm does. Nothing is applied
//! to them (`LightTime::Support`), and no SPICE kernels follow from them.

mod camera;
mod document;
mod rewrite;
mod state;
mod tables;
mod target;

use std::{borrow::Cow, fs, path::Path};

use serde::{Deserialize, Serialize};
use serde_json::Value;

use self::{
    camera::{Samples, camera},
    document::{IsdError, Object},
    tables::span,
};
pub use self::{
    rewrite::{LineCurve, LineOptics},
    tables::{Rotations, States},
    target::ForeignBody,
};
pub(crate) use self::{
    state::{StateError, support_of_state},
    tables::neighbour_rates_rad_s,
};
use super::file_size::SizedFile;
use areograph_base::{
    error::{Error, IoError, Locate, Result},
    image::{IMAGE_DURATION_END_S, IMAGE_LINES_MIN},
    instruments::Instrument,
    line_times::{LinePiece, LineTimes},
    time::{Et, Interval},
    units::METRES_PER_KM,
};

/// Largest accepted file: a node for each of 52 000 lines gives 20 MB, and a document takes ten times its file size in
/// memory.
const BYTES_MAX: u64 = 1 << 26;
/// Limits of line and sample numbers, beyond every camera.
const LINES_MAX: u32 = 10_000_000;
const SAMPLES_MAX: u32 = 1_000_000;
const SUMMING_MAX: u32 = 1_000;
/// Key of the calibration that support data are the result of, of its camera and of its verdict.
pub const CALIBRATED_BY: &str = "areograph_calibration";
/// The verdict of a calibration whose cameras can be used.
pub const VALID: &str = "valid";
/// Member of the calibration: whether it was determined in another orbit than that of the image.
pub const APPLIED: &str = "is_of_other_orbit";
/// Line scanners, the only supported cameras.
pub(crate) const LINE_SCANNER: &str = "USGS_ASTRO_LINE_SCANNER_SENSOR_MODEL";
/// Ephemeris times, seconds: five centuries around J2000.
const ET_S: [f64; 2] = [-1e10, 1e10];
/// Radii of a target, kilometres.
const RADIUS_KM: [f64; 2] = [0.1, 1e6];

/// Contents of the support data of a line scanner.
#[derive(Debug, Clone, PartialEq)]
pub struct ImageSupport {
    /// The camera, its axes rotated about the boresight where the line would not be parallel to Y.
    pub instrument: Instrument,
    /// Exposure times of lines.
    pub line_times: LineTimes,
    /// Samples in a line.
    pub samples: u32,
    /// First detector pixel, counted from 0.
    pub first_detector: u32,
    /// Detector lines summed into a line.
    pub downtrack_summing: u32,
    /// Detector pixels summed into a sample.
    pub crosstrack_summing: u32,
    /// Equatorial and polar radius of the target, metres.
    pub radii_m: [f64; 2],
    /// NAIF code of the target, where it is stated.
    pub target: Option<i64>,
    /// Name of the spacecraft.
    pub platform: String,
    /// Identifier of the image, where it is stated.
    pub identifier: Option<String>,
    /// Positions and rotations.
    pub tables: SupportTables,
}

/// Positions and attitudes of the spacecraft over the time of an image.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SupportTables {
    /// The spacecraft.
    pub position: States,
    /// The Sun.
    pub sun: States,
    /// Attitude of the bus; the constant rotation leads to the camera.
    pub pointing: Rotations,
    /// Rotation of the target.
    pub body_rotation: Rotations,
}

/// Support data, in a file or in memory.
#[derive(Debug, Clone, Copy)]
pub enum SupportSource<'a> {
    /// A file.
    File(&'a Path),
    /// Their text.
    Text(&'a str),
}

impl SupportSource<'_> {
    /// Reads the support data of a line scanner.
    ///
    /// # Errors
    /// The file cannot be read; invalid JSON; a different kind of camera, or an unknown distortion; a key that is
    /// missing or has an invalid value; tables that do not cover the image.
    pub fn read(self) -> Result<ImageSupport> {
        self.located(self.text().and_then(|text| parse(&text)))
    }

    /// A result with the file that it concerns.
    ///
    /// # Errors
    /// The same failure, with its place.
    pub fn located<T, E>(self, result: std::result::Result<T, E>) -> Result<T>
    where
        std::result::Result<T, E>: Locate<T>,
        E: Into<Error>,
    {
        match self {
            Self::File(path) => result.in_file(path),
            Self::Text(_) => result.map_err(Into::into),
        }
    }

    fn text(&self) -> Result<Cow<'_, [u8]>> {
        let path = match self {
            Self::File(path) => path,
            Self::Text(text) => return Ok(Cow::Borrowed(text.as_bytes())),
        };
        let bytes = fs::metadata(path).map_err(IoError::on("read"))?.len();
        if bytes > BYTES_MAX {
            let max = BYTES_MAX;
            return Err(IsdError::TooLarge { bytes, max }.into());
        }
        SizedFile::SupportData.require(path)?;
        Ok(Cow::Owned(fs::read(path).map_err(IoError::on("read"))?))
    }
}

/// Reads the support data of a line scanner from a file.
///
/// # Errors
/// As [`SupportSource::read`].
pub fn read_isd(path: &Path) -> Result<ImageSupport> {
    SupportSource::File(path).read()
}

fn parse(text: &[u8]) -> Result<ImageSupport> {
    let value: Value = serde_json::from_slice(text).map_err(|error| {
        // A position in the text is more specific than the kind of the unexpected value.
        IsdError::NotJson(error.to_string())
    })?;
    support_of(&Object::document(&value)?)
}

/// The support data of a document.
fn support_of(document: &Object<'_>) -> Result<ImageSupport> {
    let model = document.text("name_model")?;
    if model != LINE_SCANNER {
        return Err(document.refused("name_model", LINE_SCANNER).into());
    }
    let samples = Samples {
        crosstrack_summing: document.whole("detector_sample_summing", [1, SUMMING_MAX])?,
        downtrack_summing: document.whole("detector_line_summing", [1, SUMMING_MAX])?,
        first_detector: document.whole("starting_detector_sample", [0, SAMPLES_MAX])?,
        samples: document.whole("image_samples", [1, SAMPLES_MAX])?,
    };
    let line_times = line_times(document)?;
    let radii_m = radii_m(document)?;
    let mut pointing = Rotations::of(document, "instrument_pointing")?;
    let (instrument, turn) = camera(document, samples, &pointing.constant)?;
    pointing.constant = turn * pointing.constant;
    let tables = SupportTables {
        position: States::of(document, "instrument_position", radii_m[1])?,
        sun: States::of(document, "sun_position", radii_m[1])?,
        pointing,
        body_rotation: Rotations::of(document, "body_rotation")?,
    };
    tables.reach_over(document, &line_times)?;
    Ok(ImageSupport {
        instrument,
        line_times,
        samples: samples.samples,
        first_detector: samples.first_detector,
        downtrack_summing: samples.downtrack_summing,
        crosstrack_summing: samples.crosstrack_summing,
        radii_m,
        target: target(document)?,
        platform: document.text("name_platform")?.to_owned(),
        // An identifier of a different kind, as a number, names no product.
        identifier: document.text("image_identifier").ok().map(str::to_owned),
        tables,
    })
}

/// Equatorial and polar radius.
fn radii_m(document: &Object<'_>) -> std::result::Result<[f64; 2], IsdError> {
    let radii = document.object("radii")?;
    let unit = radii.text("unit")?;
    let metres = match unit {
        "km" => METRES_PER_KM,
        "m" => 1.0,
        _ => return Err(radii.refused("unit", "km or m")),
    };
    let limits = RADIUS_KM.map(|km| km * METRES_PER_KM / metres);
    let equatorial = radii.number("semimajor", limits)?;
    let polar = radii.number("semiminor", [limits[0], equatorial])?;
    Ok([equatorial * metres, polar * metres])
}

/// NAIF code of the target, which ALE writes beside the camera.
fn target(document: &Object<'_>) -> std::result::Result<Option<i64>, IsdError> {
    const KEY: &str = "BODY_CODE";
    if !document.has("naif_keywords") {
        return Ok(None);
    }
    let keywords = document.object("naif_keywords")?;
    keywords.has(KEY).then(|| keywords.code(KEY)).transpose()
}

/// Line times from the rows of `line_scan_rate`.
fn line_times(document: &Object<'_>) -> Result<LineTimes> {
    const KEY: &str = "line_scan_rate";
    let lines = document.whole("image_lines", [IMAGE_LINES_MIN, LINES_MAX])?;
    let centre_s = document.number("center_ephemeris_time", ET_S)?;
    let start_s = document.number("starting_ephemeris_time", ET_S)?;
    let rows = document.rows::<3>(KEY)?;
    let mut pieces = Vec::with_capacity(rows.len());
    for [line, time_s, period_s] in rows {
        let first = line.floor();
        if !(0.0..f64::from(lines)).contains(&first) {
            let expected = format!("rows that begin within the {lines} lines of image_lines");
            return Err(document.refused(KEY, expected).into());
        }
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "within the lines of the image, as checked above"
        )]
        let first_line = first as u32;
        let start = Et::from_seconds(centre_s + time_s + period_s * (first - line + 0.5));
        pieces.push(LinePiece {
            first_line,
            start,
            period_s,
        });
    }
    let times = LineTimes::of_pieces(lines, &pieces)?;
    let late_s = times.start().seconds() - start_s;
    // Written so that NaN is rejected too.
    if !(late_s.abs() <= times.mean_period_s()) {
        let expected = format!(
            "the time of the first line according to line_scan_rate and center_ephemeris_time, {:.6} s, within one \
             line period",
            times.start().seconds()
        );
        return Err(document.refused("starting_ephemeris_time", expected).into());
    }
    if !(times.duration_s() < IMAGE_DURATION_END_S) {
        let expected = format!(
            "less than {IMAGE_DURATION_END_S} s in total; {lines} lines take {:.1} s",
            times.duration_s()
        );
        return Err(document.refused(KEY, expected).into());
    }
    Ok(times)
}

impl SupportTables {
    /// Checks that every table covers the image, extended by a line at both ends.
    fn reach_over(
        &self,
        document: &Object<'_>,
        times: &LineTimes,
    ) -> std::result::Result<(), IsdError> {
        let exposed = times.interval();
        let of_tables = [
            ("instrument_position", &self.position.et_s),
            ("instrument_pointing", &self.pointing.et_s),
            ("body_rotation", &self.body_rotation.et_s),
        ];
        for (key, et_s) in of_tables {
            let [first, last] = span(et_s).map(Et::from_seconds);
            let held = Interval::new(first, last).padded(times.mean_period_s());
            if !(held.contains(exposed.start) && held.contains(exposed.stop)) {
                let expected = format!(
                    "epochs that cover the whole image, which was exposed from ET {} s to {} s",
                    exposed.start.seconds(),
                    exposed.stop.seconds()
                );
                return Err(document.object(key)?.refused("ephemeris_times", expected));
            }
        }
        Ok(())
    }

    /// First and last instant with both positions and attitudes.
    #[must_use]
    pub fn span(&self) -> Interval {
        let [position, pointing] =
            [&self.position.et_s, &self.pointing.et_s].map(|et_s| span(et_s));
        Interval::new(
            Et::from_seconds(position[0].max(pointing[0])),
            Et::from_seconds(position[1].min(pointing[1])),
        )
    }
}
