//! The cumulative index of the camera: one row for every image of the mission, with corners and angles.
//!
//! Rows are quoted CSV. Names and positions of the columns come from the label beside the table (`.lbl`); without a
//! label, they follow the mapping mission.

use std::{
    fs::File,
    io::{BufRead as _, BufReader, Read as _},
    path::Path,
};

use chrono::NaiveDateTime;

use super::{
    index_columns::{self, Column, Fields},
    label::{LABEL_BYTES_MAX, parse},
    moc::product_named,
};
use areograph_base::{
    error::{Cause, IoError, Locate as _, Result},
    units::{METRES_PER_KM, RADIANS_PER_DEGREE, SECONDS_PER_MS},
};

/// Columns of the cumulative index of the mapping mission, in order.
const COLUMNS: [&str; 53] = [
    "VOLUME_ID",
    "FILE_SPECIFICATION_NAME",
    "PRODUCT_ID",
    "IMAGE_TIME",
    "INSTRUMENT_NAME",
    "FILTER_NAME",
    "LINE_SAMPLES",
    "LINES",
    "CROSSTRACK_SUMMING",
    "DOWNTRACK_SUMMING",
    "SCALED_PIXEL_WIDTH",
    "PIXEL_ASPECT_RATIO",
    "EMISSION_ANGLE",
    "INCIDENCE_ANGLE",
    "PHASE_ANGLE",
    "CENTER_LONGITUDE",
    "CENTER_LATITUDE",
    "UPPER_LEFT_LONGITUDE",
    "UPPER_LEFT_LATITUDE",
    "UPPER_RIGHT_LONGITUDE",
    "UPPER_RIGHT_LATITUDE",
    "LOWER_LEFT_LONGITUDE",
    "LOWER_LEFT_LATITUDE",
    "LOWER_RIGHT_LONGITUDE",
    "LOWER_RIGHT_LATITUDE",
    "MISSION_PHASE_NAME",
    "TARGET_NAME",
    "SPACECRAFT_CLOCK_START_COUNT",
    "FOCAL_PLANE_TEMPERATURE",
    "LINE_EXPOSURE_DURATION",
    "GAIN_MODE_ID",
    "OFFSET_MODE_ID",
    "EDIT_MODE_ID",
    "ENCODING_TYPE",
    "SCALED_IMAGE_WIDTH",
    "SCALED_IMAGE_HEIGHT",
    "SPACECRAFT_ALTITUDE",
    "TARGET_CENTER_DISTANCE",
    "SLANT_DISTANCE",
    "USAGE_NOTE",
    "NORTH_AZIMUTH",
    "SUB_SOLAR_AZIMUTH",
    "SUB_SOLAR_LONGITUDE",
    "SUB_SOLAR_LATITUDE",
    "SUB_SPACECRAFT_LONGITUDE",
    "SUB_SPACECRAFT_LATITUDE",
    "SOLAR_DISTANCE",
    "SOLAR_LONGITUDE",
    "LOCAL_TIME",
    "IMAGE_SKEW_ANGLE",
    "RATIONALE_DESC",
    "DATA_QUALITY_DESC",
    "ORBIT_NUMBER",
];

/// An image of the index. Angles are in radians; longitudes are east, though the index has them west.
#[derive(Debug, Clone, PartialEq)]
pub struct IndexedImage {
    /// Product, for example `M19/00850`.
    pub product_id: String,
    /// Volume of the archive, empty where the index does not state it.
    pub volume: String,
    /// Path on its volume.
    pub file: String,
    /// UTC of the start of the first line.
    pub utc_start: String,
    /// Mission phase, and number of the orbit in it.
    pub orbit: Option<(String, u32)>,
    /// Instrument and filter, as labels name them; empty where the index does not state them. The narrow-angle camera
    /// has no filter.
    pub instrument: [String; 2],
    /// Target, where the index states it.
    pub target: Option<String>,
    /// Spacecraft clock at the start of the first line.
    pub sclk_start: Option<String>,
    /// Samples of a line, and lines.
    pub size: [u32; 2],
    /// Pixels summed across and along the track, where the index states them.
    pub summing: [Option<u32>; 2],
    /// Exposure of one detector line, seconds.
    pub exposure_s: Option<f64>,
    /// First detector pixel, counted from 0.
    pub first_detector: Option<u32>,
    /// Width of a pixel on the ground, metres.
    pub pixel_m: Option<f64>,
    /// Angles at the centre: emission, incidence, phase.
    pub angles_rad: [Option<f64>; 3],
    /// Longitude and latitude of the centre.
    pub centre_rad: Option<[f64; 2]>,
    /// Corners in their order round the image: first line, first and last sample; last line, last and first sample.
    pub corners_rad: [Option<[f64; 2]>; 4],
    /// Width and height on the ground, metres: where the index does not state them, from the pixels, which are assumed
    /// square if it does not state their shape either.
    pub extent_m: [Option<f64>; 2],
    /// Height of the spacecraft, metres.
    pub altitude_m: Option<f64>,
    /// Longitude and latitude of the point below the Sun.
    pub sub_solar_rad: Option<[f64; 2]>,
    /// Longitude and latitude of the point below the spacecraft.
    pub sub_spacecraft_rad: Option<[f64; 2]>,
    /// Solar longitude of Mars.
    pub solar_longitude_rad: Option<f64>,
    /// Free text of the camera's team.
    pub rationale: String,
    /// `OK` or `ERRORS`; empty where the index does not state it.
    pub quality: String,
}

impl IndexedImage {
    /// The mission phase by which images are named, such as `E02`: months of the mapping mission. Without such a name, the
    /// phase that the index states, which is `MAPPING` or `EXTENDED` for years of images; empty if unknown.
    #[must_use]
    pub fn phase(&self) -> &str {
        const LETTERS: usize = 3;
        let of_index = self.orbit.as_ref().map_or("", |(phase, _)| phase);
        let is_named = product_named(&self.product_id).is_some();
        let name = is_named.then(|| self.product_id.get(..LETTERS)).flatten();
        name.unwrap_or(of_index)
    }

    /// The start of the first line, if it is a valid time.
    #[must_use]
    pub fn utc(&self) -> Option<NaiveDateTime> {
        let text = self.utc_start.trim_end_matches('Z');
        let formats = ["%Y-%m-%dT%H:%M:%S%.f", "%Y-%jT%H:%M:%S%.f"];
        formats
            .iter()
            .find_map(|format| NaiveDateTime::parse_from_str(text, format).ok())
    }
}

/// An invalid row.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BadRow {
    /// Line of the file, counted from 1.
    pub line: u64,
    /// The fault.
    pub text: String,
}

/// A parsed index.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ImageIndex {
    /// Its images in the order of the file.
    pub images: Vec<IndexedImage>,
    /// Rows that were left out.
    pub bad_rows: Vec<BadRow>,
    /// Whether the column names come from a label.
    pub has_label: bool,
}

/// A file that is not an index.
#[derive(Debug, thiserror::Error, Cause)]
#[cause(Input: "give cumindex.tab (or imgindex.tab) of an archive volume, with its .lbl beside it")]
enum NoIndex {
    #[error("the label does not define the column {0}")]
    Column(&'static str),
    #[error("no row describes an image; line {line}: {text}")]
    Rows { line: u64, text: String },
    #[error("the table is empty")]
    Empty,
}

/// Longest accepted row; rows of the archive have about 520 bytes.
const ROW_BYTES_MAX: u64 = 1 << 16;

/// Reads an index, with the label beside it if one exists.
///
/// # Errors
/// The file cannot be read; a label without required columns; no row that describes an image.
pub fn read_index(path: &Path) -> Result<ImageIndex> {
    let labelled = label_beside(path)
        .map(|label| read_columns(&label))
        .transpose()?;
    let mut index = ImageIndex {
        has_label: labelled.is_some(),
        ..ImageIndex::default()
    };
    let columns =
        labelled.unwrap_or_else(|| COLUMNS.iter().map(|name| Column::named(name)).collect());
    let file = File::open(path)
        .map_err(IoError::on("open"))
        .in_file(path)?;
    let mut file = BufReader::new(file);
    let mut bytes = Vec::new();
    for line in 1.. {
        bytes.clear();
        let mut row = (&mut file).take(ROW_BYTES_MAX);
        let length = row
            .read_until(b'\n', &mut bytes)
            .map_err(IoError::on("read"))
            .in_file(path)?;
        if length == 0 {
            break;
        }
        while matches!(bytes.last(), Some(b'\r' | b'\n')) {
            bytes.pop();
        }
        if bytes.trim_ascii().is_empty() {
            continue;
        }
        match index_columns::fields(&bytes, &columns).and_then(|fields| image(&fields)) {
            Ok(image) => index.images.push(image),
            Err(text) => index.bad_rows.push(BadRow { line, text }),
        }
    }
    match (index.images.is_empty(), index.bad_rows.first()) {
        (true, Some(BadRow { line, text })) => {
            let (line, text) = (*line, text.clone());
            Err(NoIndex::Rows { line, text }).in_file(path)
        }
        (true, None) => Err(NoIndex::Empty).in_file(path),
        (false, _) => Ok(index),
    }
}

/// The label beside a table, its ending in the same case.
fn label_beside(path: &Path) -> Option<std::path::PathBuf> {
    let endings = ["lbl", "LBL"].into_iter();
    endings
        .map(|ending| path.with_extension(ending))
        .find(|label| label.is_file() && label != path)
}

fn read_columns(path: &Path) -> Result<Vec<Column>> {
    let mut bytes = Vec::new();
    let file = File::open(path)
        .map_err(IoError::on("open"))
        .in_file(path)?;
    let mut start = file.take(LABEL_BYTES_MAX as u64);
    start
        .read_to_end(&mut bytes)
        .map_err(IoError::on("read"))
        .in_file(path)?;
    let columns = index_columns::of_label(&parse(&bytes).in_file(path)?);
    for needed in [
        "PRODUCT_ID",
        "IMAGE_TIME",
        "LINES",
        "LINE_SAMPLES",
        "CENTER_LONGITUDE",
        "CENTER_LATITUDE",
    ] {
        if !columns.iter().any(|column| column.name == needed) {
            return Err(NoIndex::Column(needed)).in_file(path);
        }
    }
    Ok(columns)
}

/// The image of a row, by the names of its columns.
fn image(fields: &Fields<'_>) -> std::result::Result<IndexedImage, String> {
    let text = |key: &str| fields.get(key).map(|text| &**text).unwrap_or_default();
    let known = |key: &str| {
        let value = Some(text(key));
        value.filter(|value| !matches!(*value, "" | "N/A" | "UNK" | "NULL" | "UNKNOWN"))
    };
    let number = |key: &str| {
        known(key)
            .and_then(|value| value.parse().ok())
            .filter(|value: &f64| value.is_finite())
    };
    let angle = |key: &str| number(key).map(|degrees| degrees * RADIANS_PER_DEGREE);
    let place = |corner: &str| {
        let longitude_deg = number(&format!("{corner}_LONGITUDE"))?;
        let latitude_deg = number(&format!("{corner}_LATITUDE"))?;
        let is_place =
            (-360.0..=360.0).contains(&longitude_deg) && (-90.0..=90.0).contains(&latitude_deg);
        is_place.then(|| {
            [(-longitude_deg).rem_euclid(360.0), latitude_deg]
                .map(|degrees| degrees * RADIANS_PER_DEGREE)
        })
    };
    let natural = |key: &str| known(key).and_then(|value| value.parse::<u32>().ok());
    let count = |key: &str| {
        let value = natural(key).filter(|count| *count > 0);
        value.ok_or_else(|| format!("{key} is {:?}; expected a count from 1", text(key)))
    };
    let positive = |key: &str| number(key).filter(|value| *value > 0.0);
    let product_id =
        known("PRODUCT_ID").ok_or("PRODUCT_ID is empty; expected a product identifier")?;
    let size = [count("LINE_SAMPLES")?, count("LINES")?];
    let pixel_m = positive("SCALED_PIXEL_WIDTH");
    let line_m = pixel_m.map(|width_m| width_m * positive("PIXEL_ASPECT_RATIO").unwrap_or(1.0));
    let extent_m = |key: &str, step_m: Option<f64>, steps: u32| {
        let stated = positive(key).map(|extent_km| extent_km * METRES_PER_KM);
        stated.or_else(|| Some(step_m? * f64::from(steps)))
    };
    let phase = known("MISSION_PHASE_NAME").map(str::to_owned);
    Ok(IndexedImage {
        product_id: product_id.to_owned(),
        volume: known("VOLUME_ID").unwrap_or_default().to_owned(),
        file: text("FILE_SPECIFICATION_NAME").to_owned(),
        utc_start: text("IMAGE_TIME").to_owned(),
        orbit: phase.zip(natural("ORBIT_NUMBER")),
        instrument: ["INSTRUMENT_NAME", "FILTER_NAME"]
            .map(|key| known(key).unwrap_or_default().to_owned()),
        target: known("TARGET_NAME").map(str::to_owned),
        sclk_start: known("SPACECRAFT_CLOCK_START_COUNT").map(str::to_owned),
        size,
        summing: ["CROSSTRACK_SUMMING", "DOWNTRACK_SUMMING"]
            .map(|key| natural(key).filter(|summing| *summing > 0)),
        exposure_s: number("LINE_EXPOSURE_DURATION")
            .map(|milliseconds| milliseconds * SECONDS_PER_MS),
        first_detector: natural("EDIT_MODE_ID"),
        pixel_m,
        angles_rad: ["EMISSION_ANGLE", "INCIDENCE_ANGLE", "PHASE_ANGLE"].map(angle),
        centre_rad: place("CENTER"),
        corners_rad: ["UPPER_LEFT", "UPPER_RIGHT", "LOWER_RIGHT", "LOWER_LEFT"].map(place),
        extent_m: [
            extent_m("SCALED_IMAGE_WIDTH", pixel_m, size[0]),
            extent_m("SCALED_IMAGE_HEIGHT", line_m, size[1]),
        ],
        altitude_m: positive("SPACECRAFT_ALTITUDE").map(|km| km * METRES_PER_KM),
        sub_solar_rad: place("SUB_SOLAR"),
        sub_spacecraft_rad: place("SUB_SPACECRAFT"),
        solar_longitude_rad: angle("SOLAR_LONGITUDE"),
        rationale: text("RATIONALE_DESC").to_owned(),
        quality: text("DATA_QUALITY_DESC").to_owned(),
    })
}
