//! `areograph image info`.

use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::{Value, json};

use crate::{
    cli::{
        files::{IMAGES, expand},
        output,
    },
    config::{all_instruments, built_in_instruments},
    error::Error,
    pds::{
        image_file::{Coding, Complaint, Complaints, ImageFile, Statistics},
        oriented_cube::{Orientation, OrientedCube, PartOfAxis, is_cube_file, read_oriented_cube},
        pixel_file::PixelFile,
    },
    units::SECONDS_PER_MS,
};

/// Shows label, size, coding, statistics, and all errors of each image file.
///
/// Cubes, TIFF and PNG files may replace images of the archive. Values other than bytes are scaled, the smallest to 1 and
/// the largest to 255, and statistics refer to the scaled values.
///
/// Statistics and the hash refer to the decoded 8-bit pixels in the order of the file; missing lines are excluded. A
/// line is suspect if it comes from damaged data, or if its place in the image is unknown. A damaged file is not a
/// failure as long as part of it can be read. For an ISIS cube, `cube` states the part of the camera's image, the
/// map projection, and whether its tables or the state of its camera model orient the image (`images.cube`), or why
/// they do not. `exposures` are the line times in an HRSC file, in the form of `images.exposures`: first line, its start in
/// ET seconds, line period in milliseconds.
#[derive(Debug, Args)]
#[command(after_help = "Example: areograph image info e0202855.imq --json")]
pub(super) struct Arguments {
    /// Image files of the archive (.imq, .img; of HRSC level 2), ISIS cubes, TIFF or PNG of one band of grey; folders or
    /// globs of them.
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// Complaints shown for a file; all are counted.
const COMPLAINTS_PRINTED: usize = 20;

pub(super) fn run(arguments: &Arguments) -> Result<(), Error> {
    let (mut answers, mut failures) = (Vec::new(), Vec::new());
    for path in &expand(&arguments.files, &IMAGES)? {
        match info(path) {
            Ok(answer) if arguments.json => answers.push(answer),
            Ok(answer) => print(&answer),
            Err(failure) => failures.push(failure),
        }
    }
    if arguments.json {
        output::json(&answers.into());
    }
    // Every file is shown first; the caller reports the last failure.
    let last = failures.pop();
    failures.iter().for_each(output::error);
    last.map_or(Ok(()), Err)
}

fn info(path: &Path) -> Result<Value, Error> {
    let image = PixelFile::open(path, all_instruments())?;
    let mut strips = image.strips()?;
    let (mut statistics, mut lines) = (Statistics::default(), 0);
    while let Some(strip) = strips.next_strip()? {
        lines += strip.states.len();
        statistics.add(&strip);
    }
    let pixels = statistics.finish();
    let archive = image.archive();
    let label = image.label();
    let fields = label.map(|label| label.fields.clone()).unwrap_or_default();
    let value = |key: &str| archive.and_then(|image| image.value(key));
    let opened = archive.map(ImageFile::complaints);
    let (decoded, decoded_count) = strips.complaints();
    let texts = opened.into_iter().flat_map(Complaints::kept).chain(decoded);
    let rows = label.and_then(|label| label.lines.as_ref());
    let of_rows = rows.map_or_else(Vec::new, |rows| rows.remarks.clone());
    let pieces = rows.into_iter().flat_map(|rows| &rows.pieces).map(|piece| {
        let period_ms = piece.period_s / SECONDS_PER_MS;
        json!([piece.first_line, piece.start.seconds(), period_ms])
    });
    let pieces: Vec<Value> = pieces.collect();
    let milliseconds = |seconds: Option<f64>| seconds.map(|seconds| seconds / SECONDS_PER_MS);
    Ok(json!({
        "file": path,
        "cube": cube(path)?,
        "product_id": label.and_then(|label| label.product_id.clone()),
        "instrument": label.map(|label| &label.instrument.id),
        "sclk_start": fields.sclk_start,
        "utc_start": fields.utc_start,
        "exposure_ms": milliseconds(fields.exposure_s),
        "exposures": rows.map(|_| pieces),
        "downtrack_summing": fields.downtrack_summing,
        "crosstrack_summing": fields.crosstrack_summing,
        "first_detector": fields.first_detector,
        "gain_mode_id": value("GAIN_MODE_ID"),
        "offset_mode_id": value("OFFSET_MODE_ID"),
        "gain_changes": archive.map(|image| image.layout().gain_changes),
        "rationale": value("RATIONALE_DESC"),
        "coding": image.other_kind().unwrap_or_else(|| coding(archive.and_then(|image| image.layout().coding))),
        "fragments": archive.map(|image| image.layout().fragments),
        "lines": lines,
        "samples": image.samples(),
        "lines_in_header": image.lines(),
        "lines_in_label": fields.lines_header,
        "lines_good": pixels.lines_good,
        "lines_suspect": pixels.lines_suspect,
        "lines_missing": pixels.lines_missing,
        "numbers_of_1_and_255": strips.range(),
        "minimum": pixels.minimum,
        "maximum": pixels.maximum,
        "mean": pixels.mean,
        "standard_deviation": pixels.standard_deviation,
        "median": pixels.median,
        "distinct_values": pixels.distinct,
        "zeros": pixels.zeros,
        "pixels_blake3": pixels.blake3,
        "complaint_count": opened.map_or(0, Complaints::count) + decoded_count + of_rows.len() as u64,
        "complaints": texts.map(Complaint::to_string).chain(of_rows).collect::<Vec<_>>(),
    }))
}

/// Description of a cube; `None` for a different file.
fn cube(path: &Path) -> Result<Option<Value>, Error> {
    if !is_cube_file(path)? {
        return Ok(None);
    }
    Ok(Some(
        match read_oriented_cube(path, built_in_instruments()) {
            Ok(cube) => described(&cube),
            Err(failure) => json!({ "oriented": false, "because": failure.cause.to_string() }),
        },
    ))
}

fn described(cube: &OrientedCube) -> Value {
    let support = &cube.support;
    let times = &support.line_times;
    let axis = |axis: &PartOfAxis| json!({ "of": axis.whole, "first": axis.first + 1, "count": axis.count, "summed": axis.factor });
    json!({
        "oriented": true,
        "orientation": match &cube.orientation {
            Orientation::Tables => "tables of spiceinit".to_owned(),
            Orientation::State { model, plugin } => format!("camera model state from csminit: {model}, {plugin}"),
        },
        "instrument": support.instrument.id,
        "product_id": support.identifier,
        "start_et_s": times.start().seconds(),
        "line_period_ms": times.mean_period_s() / SECONDS_PER_MS,
        "lines": axis(&cube.part.lines),
        "samples": axis(&cube.part.samples),
        "projection": cube.projection,
        "notes": cube.notes(),
    })
}

fn coding(coding: Option<Coding>) -> String {
    match coding {
        None => "raster".to_owned(),
        Some(Coding::Raw) => "raw".to_owned(),
        Some(Coding::Predictive { predictor, table }) => {
            format!("predictive, {predictor:?}, table {table}")
        }
        Some(Coding::Transform {
            transform,
            groups,
            spacing,
        }) => format!("{transform:?} transform, {groups} groups, step {spacing}").to_lowercase(),
    }
}

/// The answer as a table.
fn print(answer: &Value) {
    for (key, value) in answer.as_object().into_iter().flatten() {
        match value {
            Value::Array(texts) if texts.iter().all(Value::is_string) => {
                for text in texts.iter().take(COMPLAINTS_PRINTED) {
                    output::line(format_args!("  {}", text.as_str().unwrap_or_default()));
                }
            }
            Value::Null => {}
            Value::String(text) => output::line(format_args!("{key:24}{text}")),
            value => output::line(format_args!("{key:24}{value}")),
        }
    }
}
