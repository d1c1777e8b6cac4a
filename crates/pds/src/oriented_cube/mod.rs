//! ISIS cubes after `spiceinit`: label, and tables of position, attitude, rotation of the target and Sun, as a source of line
//! times and orientation of MOC images without kernels; and cubes after `csminit`, by the state of their camera model.
//!
//! `spiceinit` writes the same tables whether ISIS or ALE computed them. A state is read as the support data that it
//! was made of (module `state`). The following applies to tables.
//!
//! The result is an [`ImageSupport`], as for image support data: no later stage distinguishes them, and no correction is
//! applied to positions and attitudes; ISIS positions and attitudes contain the pointing bias of the camera.
//! Differences are:
//!
//! - the camera is the built-in one that the label names, with areograph's optics;
//! - a cube may show a part of the camera's image (`AlphaCube`: crop, reduce). Line times and samples belong to the
//!   part;
//! - of a map-projected cube, tables and `AlphaCube` belong to the image before the projection, and so do line times;
//!   its pixels do not.
//!
//! The first line begins with the clock of `NaifKeywords`, where ISIS kept it as ET, else with the position table, which ISIS
//! makes from the first to the last line of the image that `spiceinit` was given: the complete image, or the part.
//!
//! # Source
//! `Cube`, `Table`, `AlphaCube`, `SpicePosition`, `SpiceRotation`, `Spice::getClockTime` and `MocNarrowAngleCamera` of ISIS.

mod error;
mod motion;
mod part;
mod state;
#[cfg(test)]
mod state_tests;
mod table;
#[cfg(test)]
mod tests;

use std::{fs::File, path::Path};

pub use self::part::{Part, PartOfAxis};
use self::{
    error::CubeError,
    motion::{rotations, span_s, states},
    table::Table,
};
use super::{
    image_label::{ImageLabel, projection},
    isd::{ImageSupport, SupportTables},
    label::Label,
    moc,
    pixel_file::is_cube,
    read_label::Labelled,
};
use areograph_base::{
    body::Body,
    error::{Locate as _, Result},
    image::IMAGE_DURATION_END_S,
    instruments::Instrument,
    line_times::LineTimes,
    time::Et,
};

/// Durations that differ by less than this share are of the same lines: ISIS writes epochs with all digits, and in most
/// images a line is more than this share.
const SAME_SPAN: f64 = 1e-6;
/// Keywords of clock counts that ISIS converted to ET.
const CLOCK_PREFIX: &str = "CLOCK_ET_";
const COMPUTED: &str = "_COMPUTED";

/// An oriented cube.
#[derive(Debug, Clone, PartialEq)]
pub struct OrientedCube {
    /// Times, camera and tables of the part.
    pub support: ImageSupport,
    /// The label of the image; `None` of a cube with the state of another camera than MOC.
    pub label: Option<ImageLabel>,
    /// The part of the camera's image.
    pub part: Part,
    /// Name of its map projection, if it has one.
    pub projection: Option<String>,
    /// Source of its orientation.
    pub orientation: Orientation,
}

/// Source of a cube's orientation.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Orientation {
    /// Tables of `spiceinit`.
    Tables,
    /// The state of a camera model, by `csminit`.
    State {
        /// Name of the model.
        model: String,
        /// The plugin that provides it.
        plugin: String,
    },
}

/// Whether a file is an ISIS cube, oriented or not.
///
/// # Errors
/// The file cannot be read.
pub fn is_cube_file(path: &Path) -> Result<bool> {
    let labelled = Labelled::open(path)?;
    let label = super::label::parse(&labelled.start);
    Ok(label.is_ok_and(|label| is_cube(&label)))
}

/// Reads an ISIS cube of an image by one of `cameras`, or one with the state of any line scanner.
///
/// # Errors
/// The file cannot be read; another file; a cube without tables of `spiceinit` and without a state; an invalid label, part, table
/// or state; tables that do not cover the image; a state of a different model, size or image.
pub fn read_oriented_cube(path: &Path, cameras: &[Instrument]) -> Result<OrientedCube> {
    let labelled = Labelled::open(path)?;
    let label = super::label::parse(&labelled.start)
        .map_err(|_| CubeError::NotACube)
        .in_file(path)?;
    read(&label, &labelled.file, cameras).in_file(path)
}

fn read(label: &Label, file: &File, cameras: &[Instrument]) -> Result<OrientedCube> {
    if !is_cube(label) {
        Err(CubeError::NotACube)?;
    }
    if !label.ended {
        Err(CubeError::NoEnd)?;
    }
    if let Some(cube) = state::read(label, file, cameras)? {
        return Ok(cube);
    }
    let of_image = moc::label_of_camera(label, cameras)?;
    let size =
        [of_image.fields.lines_header, of_image.fields.samples].map(Option::unwrap_or_default);
    let part = Part::of(label, size)?;
    let body = Body::Mars;
    let model = body.model();
    let radii_m = [model.equatorial_radius_m, model.polar_radius_m];
    let [position, pointing, rotation, sun] = [
        "InstrumentPosition",
        "InstrumentPointing",
        "BodyRotation",
        "SunPosition",
    ]
    .map(|name| required(label, file, name));
    let (position, pointing) = (position?, pointing?);
    let tables = SupportTables {
        position: states(&position, radii_m[1])?,
        sun: states(&sun?, radii_m[1])?,
        pointing: rotations(&pointing)?,
        body_rotation: rotations(&rotation?)?,
    };
    let (line_times, factor) = line_times(label, &of_image, &part, span_s(&position, "SPK")?)?;
    reach(&tables, &line_times)?;
    let summing = Summing::of(&of_image, &part)?;
    let support = ImageSupport {
        instrument: of_image.instrument.clone(),
        line_times,
        samples: part.samples.count,
        first_detector: summing.first_detector,
        downtrack_summing: summing.downtrack * factor,
        crosstrack_summing: summing.crosstrack,
        radii_m,
        target: Some(i64::from(body.naif().body)),
        platform: of_image.instrument.spacecraft.label_name.clone(),
        identifier: of_image.product_id.clone(),
        tables,
    };
    Ok(OrientedCube {
        support,
        label: Some(of_image),
        part,
        projection: projection_name(label),
        orientation: Orientation::Tables,
    })
}

/// Name of the map projection, if there is one.
fn projection_name(label: &Label) -> Option<String> {
    let entry = projection(label)?;
    let name = label_text(label, &entry.group, "PROJECTIONNAME");
    Some(name.unwrap_or("unnamed").to_owned())
}

fn required(label: &Label, file: &File, name: &'static str) -> Result<Table> {
    let found = Table::read(label, file, name)?;
    Ok(found.ok_or(CubeError::NoTable { name })?)
}

/// The first value of a key in a group, both in upper case.
fn label_text<'a>(label: &'a Label, group: &str, key: &str) -> Option<&'a str> {
    let mut entries = label.entries.iter();
    let found = entries.find(|entry| entry.group == group && entry.key == key);
    found.map(|entry| &*entry.value)
}

/// A value of the label that the image cannot do without.
fn missing(key: &'static str, expected: &str) -> CubeError {
    CubeError::Label {
        group: "Instrument",
        key,
        value: String::new(),
        expected: expected.to_owned(),
    }
}

/// Line times of the part, and lines of the image for one of the part.
fn line_times(
    label: &Label,
    of_image: &ImageLabel,
    part: &Part,
    [first_s, last_s]: [f64; 2],
) -> Result<(LineTimes, u32)> {
    let fields = &of_image.fields;
    let exposure_s = fields
        .exposure_s
        .ok_or_else(|| missing("LineExposureDuration", "milliseconds"))?;
    let summing = fields
        .downtrack_summing
        .ok_or_else(|| missing("DowntrackSumming", "a count from 1"))?;
    let lines = part.lines;
    let period_s = exposure_s * f64::from(summing);
    let to_part_s = f64::from(lines.first) * period_s;
    let part_period_s = period_s * f64::from(lines.factor);
    let whole_s = f64::from(lines.whole) * period_s;
    let part_s = f64::from(lines.count) * part_period_s;
    let table_s = last_s - first_s;
    let spans = |duration_s: f64| (table_s - duration_s).abs() <= SAME_SPAN * duration_s;
    let start_s = match computed_clock_s(label, fields.sclk_start.as_deref()) {
        Some(whole_start_s) => whole_start_s + to_part_s,
        None if spans(whole_s) => first_s + to_part_s,
        None if spans(part_s) => first_s,
        None => Err(CubeError::Span {
            table_s,
            whole_s,
            part_s,
        })?,
    };
    if !(part_s < IMAGE_DURATION_END_S) {
        let expected = format!("lines that take less than {IMAGE_DURATION_END_S} s in total");
        Err(CubeError::Label {
            group: "AlphaCube",
            key: "BetaLines",
            value: lines.count.to_string(),
            expected,
        })?;
    }
    let times = LineTimes::even(Et::from_seconds(start_s), lines.count, part_period_s)?;
    Ok((times, lines.factor))
}

/// ET seconds of the clock count of the label, as ISIS converted it: the bytes of the number in hexadecimal digits.
fn computed_clock_s(label: &Label, sclk: Option<&str>) -> Option<f64> {
    let sclk = sclk?;
    let mut entries = label.entries.iter();
    let found = entries.find(|entry| {
        let rest = entry.key.strip_prefix(CLOCK_PREFIX);
        let rest = rest.and_then(|rest| rest.strip_suffix(COMPUTED));
        rest.is_some_and(|rest| rest.ends_with(sclk))
    })?;
    let digits = found.value.as_bytes();
    let mut bytes = [0; 8];
    if digits.len() != 2 * bytes.len() {
        return None;
    }
    for (byte, pair) in bytes.iter_mut().zip(digits.chunks_exact(2)) {
        let pair = std::str::from_utf8(pair).ok()?;
        *byte = u8::from_str_radix(pair, 16).ok()?;
    }
    Some(f64::from_le_bytes(bytes)).filter(|et_s| et_s.is_finite())
}

/// Detector pixels of the part.
struct Summing {
    downtrack: u32,
    crosstrack: u32,
    first_detector: u32,
}

impl Summing {
    fn of(of_image: &ImageLabel, part: &Part) -> std::result::Result<Self, CubeError> {
        let fields = &of_image.fields;
        let downtrack = fields
            .downtrack_summing
            .ok_or_else(|| missing("DowntrackSumming", "a count from 1"))?;
        let crosstrack = fields.crosstrack_summing.unwrap_or(downtrack);
        let first = fields.first_detector.unwrap_or_default();
        let pixels = of_image.instrument.detector.pixels;
        let of_whole = u64::from(first) + u64::from(part.samples.whole) * u64::from(crosstrack);
        if of_whole > u64::from(pixels) {
            return Err(CubeError::Label {
                group: "AlphaCube",
                key: "AlphaSamples",
                value: part.samples.whole.to_string(),
                expected: format!(
                    "samples of {crosstrack} pixels, beginning with pixel {first}, within the {pixels} pixels of {}",
                    of_image.instrument.name
                ),
            });
        }
        Ok(Self {
            downtrack,
            crosstrack: crosstrack * part.samples.factor,
            first_detector: first + part.samples.first * crosstrack,
        })
    }
}

/// Checks that every table covers the image, extended by a line at both ends.
fn reach(tables: &SupportTables, times: &LineTimes) -> std::result::Result<(), CubeError> {
    let exposed = times.interval();
    for (table, et_s) in [
        ("InstrumentPosition", &tables.position.et_s),
        ("InstrumentPointing", &tables.pointing.et_s),
        ("BodyRotation", &tables.body_rotation.et_s),
    ] {
        let (first_s, last_s) = (et_s[0], et_s[et_s.len() - 1]);
        let [start_s, stop_s] = [exposed.start, exposed.stop].map(Et::seconds);
        let beyond_s = times.mean_period_s();
        // Written so that NaN is refused.
        if !(first_s - beyond_s <= start_s && stop_s <= last_s + beyond_s) {
            return Err(CubeError::Reach {
                table,
                first_s,
                last_s,
                start_s,
                stop_s,
            });
        }
    }
    Ok(())
}

impl OrientedCube {
    /// Notes on the kind of the cube, one sentence each.
    #[must_use]
    pub fn notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        let axis = |name: &str, axis: &PartOfAxis| {
            let end = axis.first + axis.factor * axis.count;
            let factor = match axis.factor {
                1 => String::new(),
                factor => format!(", {factor} in one"),
            };
            (!axis.is_whole()).then(|| {
                format!(
                    "{name} {} to {end} of {}{factor}",
                    axis.first + 1,
                    axis.whole
                )
            })
        };
        let parts = [
            axis("lines", &self.part.lines),
            axis("samples", &self.part.samples),
        ];
        let parts: Vec<String> = parts.into_iter().flatten().collect();
        if !parts.is_empty() {
            notes.push(format!(
                "the cube contains a part of the camera image: {}",
                parts.join("; ")
            ));
        }
        if let Orientation::State { model, plugin } = &self.orientation {
            notes.push(format!(
                "the cube contains the state of a camera model from csminit ({model}, {plugin}), in the body-fixed frame: \
                 the rotation of the body as in the products is used"
            ));
        }
        notes.extend(self.projection.as_ref().map(|name| {
            format!(
                "the cube is map-projected ({name}): times and orientation belong to the image before the projection, \
                 and the pixels of the cube are not samples of that image"
            )
        }));
        notes
    }
}
