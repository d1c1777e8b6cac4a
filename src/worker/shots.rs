//! Shots of many sites inside a region, from their published footprints.

use std::{
    fs::{self, File},
    io::ErrorKind,
    path::{Path, PathBuf},
    sync::{Arc, atomic::AtomicBool},
};

use arrow_array::{Array, ArrayRef, BooleanArray, Float64Array, RecordBatch, StringArray};
use arrow_schema::{DataType, Field, Schema, SchemaRef};
use arrow_select::filter::filter_record_batch;
use parquet::arrow::arrow_reader::{ParquetRecordBatchReader, ParquetRecordBatchReaderBuilder};
use serde_json::Value;

use crate::{
    error::{Cause, Error, IoError, Locate, Result, Stopped},
    geom::window::Region,
    products::{RowsFormat, RowsWriter},
    store::{manifest::Manifest, publish::MANIFEST},
    units::RADIANS_PER_DEGREE,
};

/// The product that is searched.
const FOOTPRINTS: &str = "footprints.parquet";
/// Columns with the position of a shot on the ground.
const PLACE: [&str; 2] = ["longitude_deg", "latitude_deg"];
/// Column before the columns of the product: the site.
const SITE: &str = "site";

/// Reasons why a search for shots is impossible.
#[derive(Debug, thiserror::Error, Cause)]
enum ShotsError {
    /// Unknown format.
    #[error("unknown format {0}; expected csv, geojson or parquet")]
    #[cause(Configuration: "correct the format or the polygon")]
    Format(String),
    /// A region without area.
    #[error(
        "the polygon has {0} corners; expected 3 or more, longitudes -180 to 360 and latitudes -90 to 90 degrees"
    )]
    #[cause(like = Format)]
    Polygon(usize),
    /// A folder without a run.
    #[error("contains no products")]
    #[cause(Input: "run the site")]
    NoRun,
    /// A manifest that is not one of areograph.
    #[error("the manifest cannot be read: {0}")]
    #[cause(Input: "restore the run from a copy, or run the site again")]
    Manifest(serde_json::Error),
    /// A product that this program did not write, or that a library rejects.
    #[error("cannot be {0}")]
    #[cause(Input: "if another version of areograph wrote the products, regenerate them with this version")]
    Parquet(String),
}

fn refused<E: std::fmt::Display>(action: &'static str) -> impl Fn(E) -> Error {
    move |error| ShotsError::Parquet(format!("{action}: {error}")).into()
}

/// Request of a search.
#[derive(Debug, Clone, Copy)]
pub(super) struct Search<'a> {
    /// Folders of runs, searched in this order.
    pub(super) runs: &'a [PathBuf],
    /// Corners of a polygon: east longitude and areocentric latitude, degrees.
    pub(super) polygon: &'a [[f64; 2]],
    /// Maximum number of rows.
    pub(super) rows_max: u64,
    /// `csv`, `geojson` or `parquet`.
    pub(super) format: &'a str,
    /// The output file.
    pub(super) into: &'a Path,
}

/// Writes the shots inside a polygon; returns their number, and whether they are complete.
///
/// # Errors
/// Invalid region or format; a folder without a run; write errors; [`Stopped`].
pub(super) fn search(search: &Search<'_>, stop: &AtomicBool) -> Result<(u64, bool)> {
    let region = region(search.polygon)?;
    let mut answer = Answer::new(search.format, search.into)?;
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
            answer.write(found)?;
            if !complete {
                break;
            }
        }
        if !complete {
            break;
        }
    }
    answer.finish()?;
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

/// The site of a run and its footprints; `None` for a site without footprints.
fn open(run: &Path, path: &Path) -> Result<Option<(String, ParquetRecordBatchReader)>> {
    let manifest = manifest_of(run)?;
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

fn manifest_of(run: &Path) -> Result<Manifest> {
    let path = run.join(MANIFEST);
    let bytes = match fs::read(&path) {
        Err(error) if error.kind() == ErrorKind::NotFound => {
            return Err(ShotsError::NoRun).in_file(run);
        }
        read => read.map_err(IoError::on("read")).in_file(&path)?,
    };
    serde_json::from_slice(&bytes)
        .map_err(ShotsError::Manifest)
        .in_file(path)
}

/// The rows whose shots lie inside.
fn inside(batch: &RecordBatch, region: &Region) -> Result<RecordBatch> {
    let [longitude, latitude] = PLACE.map(|name| {
        let column = batch.column_by_name(name);
        column.and_then(|column| column.as_any().downcast_ref::<Float64Array>())
    });
    let (Some(longitude), Some(latitude)) = (longitude, latitude) else {
        let what = format!("searched: no numeric columns {}", PLACE.join(" and "));
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

/// The rows with a leading column that names their site.
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

/// An answer; its first rows determine its columns.
struct Answer<'a> {
    format: RowsFormat,
    into: &'a Path,
    begun: Option<(RowsWriter, SchemaRef)>,
}

impl<'a> Answer<'a> {
    fn new(format: &str, into: &'a Path) -> Result<Self> {
        let format = match format {
            "csv" => RowsFormat::Csv,
            "geojson" => RowsFormat::GeoJson,
            "parquet" => RowsFormat::Parquet,
            other => return Err(ShotsError::Format(other.to_owned()).into()),
        };
        Ok(Self {
            format,
            into,
            begun: None,
        })
    }

    fn begin(&mut self, schema: &SchemaRef) -> Result<&mut RowsWriter> {
        let (writer, _) = match &mut self.begun {
            Some(begun) => begun,
            begun @ None => {
                let bare = Arc::new(Schema::new(schema.fields().clone()));
                let writer = RowsWriter::create(self.into, self.format, bare)?;
                begun.insert((writer, SchemaRef::clone(schema)))
            }
        };
        Ok(writer)
    }

    fn write(&mut self, batch: RecordBatch) -> Result<()> {
        self.begin(&batch.schema())?.write(batch)
    }

    /// Completes the answer and gives it its name. Without runs it is empty.
    fn finish(mut self) -> Result<()> {
        let empty = Schema::new(vec![Field::new(SITE, DataType::Utf8, false)]);
        self.begin(&Arc::new(empty))?;
        if let Some((file, schema)) = self.begun {
            let notes = match self.format {
                RowsFormat::Parquet => notes(&schema),
                RowsFormat::Csv | RowsFormat::GeoJson => Vec::new(),
            };
            file.finish(notes)?;
        }
        Ok(())
    }
}

/// The metadata of the footprints, except the box of a single site.
fn notes(schema: &Schema) -> Vec<(&str, String)> {
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
        (&**key, text)
    });
    metadata.collect()
}
