//! Shots of many sites inside a region, from their published footprints.

use std::{
    fs::File,
    io::{BufWriter, Write as _},
    path::{Path, PathBuf},
    sync::{Arc, atomic::AtomicBool},
};

use arrow_array::{
    Array, ArrayRef, BooleanArray, Float64Array, Int32Array, RecordBatch, StringArray, UInt32Array,
};
use arrow_schema::{DataType, Field, Schema, SchemaRef};
use arrow_select::filter::filter_record_batch;
use parquet::{
    arrow::{
        ArrowWriter,
        arrow_reader::{ParquetRecordBatchReader, ParquetRecordBatchReaderBuilder},
    },
    basic::{Compression, ZstdLevel},
    file::{metadata::KeyValue, properties::WriterProperties},
};
use serde_json::{Map, Value, json};
use tempfile::NamedTempFile;

use crate::{
    error::{Cause, Error, IoError, Kind, Locate, Result, Stopped},
    geom::window::Region,
    store::publish::read_manifest,
    units::RADIANS_PER_DEGREE,
};

/// The product that is searched.
const FOOTPRINTS: &str = "footprints.parquet";
/// Columns that say where a shot hit the ground.
const PLACE: [&str; 2] = ["longitude_deg", "latitude_deg"];
/// Column in front of those of the product: the site.
const SITE: &str = "site";

/// Why shots cannot be searched.
#[derive(Debug, thiserror::Error)]
enum ShotsError {
    /// No such format.
    #[error("the format {0} is none; expected csv, geojson or parquet")]
    Format(String),
    /// A region without an inside.
    #[error(
        "a polygon of {0} corners; expected 3 or more, longitudes -180 to 360 and latitudes -90 to 90 degrees"
    )]
    Polygon(usize),
    /// Not a run.
    #[error("holds no products")]
    NoRun,
    /// Not what this program writes, or what a library refuses.
    #[error("cannot be {0}")]
    Parquet(String),
}

impl Cause for ShotsError {
    fn kind(&self) -> Kind {
        match self {
            Self::Format(_) | Self::Polygon(_) => Kind::Configuration,
            Self::NoRun | Self::Parquet(_) => Kind::Input,
        }
    }

    fn advice(&self) -> String {
        match self {
            Self::Format(_) | Self::Polygon(_) => "ask otherwise",
            Self::NoRun => "run the site",
            Self::Parquet(_) => {
                "products of another version of areograph have to be made again by this one"
            }
        }
        .to_owned()
    }
}

fn refused<E: std::fmt::Display>(action: &'static str) -> impl Fn(E) -> Error {
    move |error| ShotsError::Parquet(format!("{action}: {error}")).into()
}

/// What a search asks for.
#[derive(Debug, Clone, Copy)]
pub(super) struct Search<'a> {
    /// Folders of runs, searched in this order.
    pub(super) runs: &'a [PathBuf],
    /// Corners of a polygon: east longitude and areocentric latitude, degrees.
    pub(super) polygon: &'a [[f64; 2]],
    /// Most rows.
    pub(super) rows_max: u64,
    /// `csv`, `geojson` or `parquet`.
    pub(super) format: &'a str,
    /// The file of the answer.
    pub(super) into: &'a Path,
}

/// Writes the shots inside a polygon and says how many there are, and whether there are no more.
///
/// # Errors
/// No region, no such format; a run that is none; what the disk refuses; [`Stopped`].
pub(super) fn search(search: &Search<'_>, stop: &AtomicBool) -> Result<(u64, bool)> {
    let region = region(search.polygon)?;
    let folder = search.into.parent().unwrap_or(Path::new("."));
    let file = tempfile::Builder::new()
        .prefix(".partial-")
        .tempfile_in(folder)
        .map_err(IoError::on("create a file"))
        .in_file(folder)?;
    let mut answer = Writer::new(search.format, file)?;
    let mut left = search.rows_max;
    let mut complete = true;
    for run in search.runs {
        let path = run.join(FOOTPRINTS);
        let Some((site, batches)) = open(run, &path)? else {
            continue;
        };
        for batch in batches {
            Stopped::check(stop)?;
            let batch = batch.map_err(refused("read as Parquet")).in_file(&path)?;
            let found = inside(&batch, &region).in_file(&path)?;
            let rows = (found.num_rows() as u64).min(left);
            complete &= rows == found.num_rows() as u64;
            left -= rows;
            let found = found.slice(0, usize::try_from(rows).unwrap_or(usize::MAX));
            let found = with_site(&found, &site).in_file(&path)?;
            answer.write(&found).in_file(search.into)?;
            if !complete {
                break;
            }
        }
        if !complete {
            break;
        }
    }
    answer.finish(search.into)?;
    Ok((search.rows_max - left, complete))
}

fn region(corners: &[[f64; 2]]) -> Result<Region> {
    use crate::geom::window::WindowShape;
    let possible = |[longitude, latitude]: &[f64; 2]| {
        (-180.0..=360.0).contains(longitude) && (-90.0..=90.0).contains(latitude)
    };
    if corners.len() < 3 || !corners.iter().all(possible) {
        return Err(ShotsError::Polygon(corners.len()).into());
    }
    let ring = corners
        .iter()
        .map(|corner| corner.map(|angle| angle * RADIANS_PER_DEGREE));
    Ok(Region::new(&WindowShape::Polygons {
        polygons: vec![vec![ring.collect()]],
    }))
}

/// The site of a run and its footprints; none of a site without any.
fn open(run: &Path, path: &Path) -> Result<Option<(String, ParquetRecordBatchReader)>> {
    let manifest = read_manifest(run).ok_or(ShotsError::NoRun).in_file(run)?;
    if !manifest
        .products
        .iter()
        .any(|product| product.path == FOOTPRINTS)
    {
        return Ok(None);
    }
    let file = File::open(path)
        .map_err(IoError::on("open"))
        .in_file(path)?;
    let batches = ParquetRecordBatchReaderBuilder::try_new(file)
        .and_then(ParquetRecordBatchReaderBuilder::build);
    let batches = batches.map_err(refused("read as Parquet")).in_file(path)?;
    Ok(Some((manifest.site, batches)))
}

/// The rows whose shot hit the ground inside.
fn inside(batch: &RecordBatch, region: &Region) -> Result<RecordBatch> {
    let [longitude, latitude] = PLACE.map(|name| {
        let column = batch.column_by_name(name);
        column.and_then(|column| column.as_any().downcast_ref::<Float64Array>())
    });
    let (Some(longitude), Some(latitude)) = (longitude, latitude) else {
        let what = format!("searched: no columns {} of numbers", PLACE.join(" and "));
        return Err(ShotsError::Parquet(what).into());
    };
    let radians = |degrees: f64| degrees * RADIANS_PER_DEGREE;
    let mask: BooleanArray = (0..batch.num_rows())
        .map(|row| {
            Some(region.contains(radians(longitude.value(row)), radians(latitude.value(row))))
        })
        .collect();
    filter_record_batch(batch, &mask).map_err(refused("searched"))
}

/// The same rows behind a column that names their site.
fn with_site(batch: &RecordBatch, site: &str) -> Result<RecordBatch> {
    let field = Field::new(SITE, DataType::Utf8, false);
    let fields = batch.schema();
    let fields = std::iter::once(Arc::new(field)).chain(fields.fields().iter().cloned());
    let schema = Schema::new_with_metadata(
        fields.collect::<Vec<_>>(),
        batch.schema().metadata().clone(),
    );
    let sites = StringArray::from_iter_values(std::iter::repeat_n(site, batch.num_rows()));
    let columns =
        std::iter::once(Arc::new(sites) as ArrayRef).chain(batch.columns().iter().cloned());
    RecordBatch::try_new(Arc::new(schema), columns.collect()).map_err(refused("searched"))
}

/// An answer that is being written; it gets its name when it is whole.
struct Writer {
    file: NamedTempFile,
    form: Form,
}

enum Form {
    Csv(Option<csv::Writer<File>>),
    GeoJson { out: BufWriter<File>, rows: u64 },
    Parquet(Option<ArrowWriter<File>>),
}

impl Writer {
    fn new(format: &str, file: NamedTempFile) -> Result<Self> {
        let form = match format {
            "csv" => Form::Csv(None),
            "geojson" => Form::GeoJson {
                out: BufWriter::new(again(&file)?),
                rows: 0,
            },
            "parquet" => Form::Parquet(None),
            other => return Err(ShotsError::Format(other.to_owned()).into()),
        };
        Ok(Self { file, form })
    }

    fn write(&mut self, batch: &RecordBatch) -> Result<()> {
        match &mut self.form {
            Form::Csv(writer) => {
                let fields = batch.schema();
                let columns: Vec<(&str, &ArrayRef)> = attributes(&fields, batch).collect();
                if writer.is_none() {
                    let mut first = csv::Writer::from_writer(again(&self.file)?);
                    first
                        .write_record(columns.iter().map(|(name, _)| name))
                        .map_err(refused("written as CSV"))?;
                    *writer = Some(first);
                }
                for row in 0..batch.num_rows() {
                    let values = columns.iter().map(|(_, column)| match value(column, row) {
                        Value::String(text) => text,
                        Value::Null => String::new(),
                        other => other.to_string(),
                    });
                    let written = writer.as_mut().map(|writer| writer.write_record(values));
                    written.transpose().map_err(refused("written as CSV"))?;
                }
            }
            Form::GeoJson { out, rows } => {
                write_features(out, rows, batch).map_err(IoError::on("write"))?;
            }
            Form::Parquet(writer) => {
                let writer = match writer {
                    Some(writer) => writer,
                    None => writer.insert(parquet_writer(again(&self.file)?, &batch.schema())?),
                };
                writer.write(batch).map_err(refused("written as Parquet"))?;
            }
        }
        Ok(())
    }

    /// Ends the answer and gives it its name. One without any run is empty.
    fn finish(self, into: &Path) -> Result<()> {
        match self.form {
            Form::Csv(writer) => {
                let flushed = writer.map(|mut writer| writer.flush());
                flushed
                    .transpose()
                    .map_err(IoError::on("write"))
                    .in_file(into)?;
            }
            Form::GeoJson { mut out, rows } => {
                let begin = if rows == 0 { BEGIN } else { "" };
                write!(out, "{begin}\n]}}\n")
                    .and_then(|()| out.flush())
                    .map_err(IoError::on("write"))
                    .in_file(into)?;
            }
            Form::Parquet(writer) => {
                let none = Schema::new(vec![Field::new(SITE, DataType::Utf8, false)]);
                let empty = || parquet_writer(again(&self.file)?, &none);
                let closed = writer
                    .map_or_else(empty, Ok)
                    .and_then(|writer| writer.close().map_err(refused("written as Parquet")));
                closed.in_file(into)?;
            }
        }
        self.file
            .persist(into)
            .map_err(|error| IoError::on("rename into place")(error.error))
            .in_file(into)?;
        Ok(())
    }
}

/// The same open file.
fn again(file: &NamedTempFile) -> std::result::Result<File, IoError> {
    file.as_file().try_clone().map_err(IoError::on("write"))
}

/// With the metadata of the footprints, but for the box of those of one site.
fn parquet_writer(file: File, schema: &Schema) -> Result<ArrowWriter<File>> {
    let metadata = schema.metadata().iter().map(|(key, text)| {
        let mut geo: Value = serde_json::from_str(text).unwrap_or_default();
        let boxes = geo
            .pointer_mut("/columns/geometry")
            .and_then(Value::as_object_mut);
        let changed = boxes.and_then(|geometry| geometry.remove("bbox")).is_some();
        let text = if changed {
            geo.to_string()
        } else {
            text.clone()
        };
        KeyValue::new(key.clone(), text)
    });
    let properties = WriterProperties::builder()
        .set_created_by(concat!("areograph ", env!("CARGO_PKG_VERSION")).to_owned())
        .set_compression(Compression::ZSTD(ZstdLevel::default()))
        .set_key_value_metadata(Some(metadata.collect()))
        .build();
    let bare = Arc::new(Schema::new(schema.fields().clone()));
    ArrowWriter::try_new(file, bare, Some(properties)).map_err(refused("written as Parquet"))
}

/// How an answer in GeoJSON begins.
const BEGIN: &str = "{\"type\":\"FeatureCollection\",\"crs\":{\"type\":\"name\",\"properties\":{\"name\":\"urn:ogc:def:crs:IAU:2015:49900\"}},\"features\":[";

fn write_features(
    out: &mut impl std::io::Write,
    rows: &mut u64,
    batch: &RecordBatch,
) -> std::io::Result<()> {
    let fields = batch.schema();
    let columns: Vec<(&str, &ArrayRef)> = attributes(&fields, batch).collect();
    for row in 0..batch.num_rows() {
        let properties: Map<String, Value> = columns
            .iter()
            .map(|(name, column)| ((*name).to_owned(), value(column, row)))
            .collect();
        let [longitude, latitude] = PLACE.map(|name| {
            properties
                .get(name)
                .and_then(Value::as_f64)
                .unwrap_or_default()
        });
        let signed = if longitude >= 180.0 {
            longitude - 360.0
        } else {
            longitude
        };
        let feature = json!({
            "type": "Feature",
            "geometry": { "type": "Point", "coordinates": [signed, latitude] },
            "properties": properties,
        });
        let before = if *rows == 0 { BEGIN } else { "," };
        write!(out, "{before}\n{feature}")?;
        *rows += 1;
    }
    Ok(())
}

/// Columns that are no geometry, by name.
fn attributes<'a>(
    fields: &'a SchemaRef,
    batch: &'a RecordBatch,
) -> impl Iterator<Item = (&'a str, &'a ArrayRef)> {
    let named = fields.fields().iter().zip(batch.columns());
    named
        .filter(|(field, _)| *field.data_type() != DataType::Binary)
        .map(|(field, column)| (&**field.name(), column))
}

/// What a column holds in a row.
fn value(column: &ArrayRef, row: usize) -> Value {
    if column.is_null(row) {
        return Value::Null;
    }
    let column = column.as_any();
    let real = column
        .downcast_ref::<Float64Array>()
        .map(|of| json!(of.value(row)));
    let natural = || {
        column
            .downcast_ref::<UInt32Array>()
            .map(|of| json!(of.value(row)))
    };
    let integer = || {
        column
            .downcast_ref::<Int32Array>()
            .map(|of| json!(of.value(row)))
    };
    let flag = || {
        column
            .downcast_ref::<BooleanArray>()
            .map(|of| json!(of.value(row)))
    };
    let text = || {
        column
            .downcast_ref::<StringArray>()
            .map(|of| json!(of.value(row)))
    };
    real.or_else(natural)
        .or_else(integer)
        .or_else(flag)
        .or_else(text)
        .unwrap_or_default()
}
