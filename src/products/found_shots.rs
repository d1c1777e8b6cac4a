//! Shots that a search of the archive finds, written as they come: the same columns as `footprints.parquet`.

use std::{
    fs::File,
    io::{BufWriter, Write},
    mem,
    path::{Path, PathBuf},
    sync::Arc,
};

use ::parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use arrow_array::{ArrayRef, Float64Array, RecordBatch, StructArray};
use arrow_schema::{DataType, Field, Fields, Schema, SchemaRef};
use serde_json::{Value, json};

use super::{
    coordinates::frame,
    error::ProductError,
    footprints::{Shot, ShotNames, columns},
    geojson,
    geoparquet::geo_metadata,
    gis::Features,
    parquet,
    parquet_file::ParquetFile,
    table::Table,
    text_table,
};
use crate::{
    body::Body,
    error::{IoError, Locate, Result},
    files::StagedFile,
    footprints::{AsRead, Footprints, SourceFile},
    frames::BodyFixed,
    pds::archive::WindowLists,
    stages::convert_datum::convert_at_tags,
};

/// The column of the bounding box of each point, and its parts: what readers of GeoParquet pass over rows by.
const BBOX: &str = "bbox";
const BBOX_PARTS: [&str; 4] = ["xmin", "ymin", "xmax", "ymax"];
/// What shots are chosen by: a search may keep several values of each, so that GIS has them too.
const FILTERED: [&str; 3] = ["channel", "class", "attitude_flag"];
/// The key of what was asked for, and how complete the answer is.
const SEARCH: &str = "areograph_search";

/// Shots that are written together: enough for all threads, little beside what a search has in memory.
const ROWS_AT_ONCE: usize = 32_768;

/// How shots are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ShotsFormat {
    /// GeoParquet 1.1 with bounding boxes.
    Parquet,
    /// Comma-separated values; what was asked for stands in a file beside it.
    Csv,
    /// GeoJSON points.
    GeoJson,
}

/// Some shots of a search, in their order.
struct FoundShots<'a> {
    footprints: &'a Footprints<BodyFixed>,
    windows: &'a WindowLists,
    window_ids: &'a [String],
}

impl ShotNames for FoundShots<'_> {
    fn windows(&self, row: usize) -> String {
        let windows = self.windows.of(row).iter();
        let ids = windows.filter_map(|window| self.window_ids.get(*window as usize));
        ids.map(String::as_str).collect::<Vec<_>>().join(";")
    }

    fn utc(&self, _row: usize) -> String {
        String::new()
    }
}

impl FoundShots<'_> {
    fn rows(&self) -> Vec<Shot<'_>> {
        Shot::all_of(self.footprints, self)
    }

    /// Without UTC, which a search without kernels does not know.
    fn table(&self) -> Table<'_> {
        Table::new(columns(), self.rows()).without("utc")
    }

    fn points_deg(&self) -> Vec<[f64; 2]> {
        self.rows().iter().map(Shot::point_deg).collect()
    }
}

/// A file of shots that is being written; it appears under its name when it is finished.
pub struct ShotsFile {
    file: StagedFile,
    writer: Writer,
    /// The files that shots are counted into.
    sources: Vec<SourceFile>,
    window_ids: Vec<String>,
    /// Shots that are not written yet, with their windows.
    pending: (Footprints<AsRead>, WindowLists),
    rows: u64,
    bounds: Option<[f64; 4]>,
}

/// The writer of a format.
enum Writer {
    Parquet(Box<ParquetShots>),
    Csv(BufWriter<File>),
    GeoJson(BufWriter<File>),
}

impl ShotsFile {
    /// Begins the file `path`.
    ///
    /// * `sources` – the files that shots are counted into
    /// * `window_ids` – identifiers of the windows
    ///
    /// # Errors
    /// What the disk refuses.
    pub fn create(
        path: &Path,
        format: ShotsFormat,
        sources: Vec<SourceFile>,
        window_ids: Vec<String>,
    ) -> Result<Self> {
        let file = StagedFile::create(path)?;
        let handle = file.writer()?;
        let empty = Table::new(columns(), Vec::new()).without("utc");
        let writer = match format {
            ShotsFormat::Parquet => {
                let writer = ParquetShots::new(handle, &empty.for_parquet()).in_file(path)?;
                Writer::Parquet(Box::new(writer))
            }
            ShotsFormat::Csv => {
                let mut writer = BufWriter::new(handle);
                text_table::write_names(&mut writer, &empty.for_text()).in_file(path)?;
                Writer::Csv(writer)
            }
            ShotsFormat::GeoJson => {
                let features = Features::of_footprints(Body::Mars, "shots", "", Vec::new(), empty);
                let head = geojson::head(&features).in_file(path)?;
                let mut writer = BufWriter::new(handle);
                let written = writer.write_all(head.as_bytes());
                written.map_err(IoError::on("write")).in_file(path)?;
                Writer::GeoJson(writer)
            }
        };
        Ok(Self {
            file,
            writer,
            sources,
            window_ids,
            pending: (Footprints::new(Vec::new()), WindowLists::default()),
            rows: 0,
            bounds: None,
        })
    }

    /// Appends shots with their windows.
    ///
    /// # Errors
    /// Numbers that are not finite; what the disk refuses.
    pub fn write(&mut self, footprints: Footprints<AsRead>, windows: &WindowLists) -> Result<()> {
        self.pending.0.append(footprints);
        self.pending.1.append(windows);
        while self.pending.0.len() >= ROWS_AT_ONCE {
            let (footprints, windows) = &mut self.pending;
            let left = (
                footprints.split_off(ROWS_AT_ONCE),
                windows.split_off(ROWS_AT_ONCE),
            );
            self.write_pending()?;
            self.pending = left;
        }
        Ok(())
    }

    /// Writes the shots that are not written yet, and leaves none.
    fn write_pending(&mut self) -> Result<()> {
        let empty = (Footprints::new(Vec::new()), WindowLists::default());
        let (footprints, windows) = mem::replace(&mut self.pending, empty);
        if footprints.is_empty() {
            return Ok(());
        }
        let footprints = convert_at_tags(footprints, &self.sources);
        let shots = FoundShots {
            footprints: &footprints,
            windows: &windows,
            window_ids: &self.window_ids,
        };
        let points_deg = shots.points_deg();
        let is_first = self.rows == 0;
        self.rows += points_deg.len() as u64;
        for [east, north] in &points_deg {
            let [west, south, eastern, northern] =
                self.bounds.unwrap_or([*east, *north, *east, *north]);
            self.bounds = Some([
                west.min(*east),
                south.min(*north),
                eastern.max(*east),
                northern.max(*north),
            ]);
        }
        let path = self.file.path();
        match &mut self.writer {
            Writer::Parquet(writer) => {
                let table = shots.table().for_parquet();
                writer.write(&table, &points_deg).in_file(path)
            }
            Writer::Csv(writer) => {
                text_table::write_rows(writer, &shots.table().for_text()).in_file(path)
            }
            Writer::GeoJson(writer) => {
                let points = points_deg.iter().map(|[east, north]| [*east, *north, 0.0]);
                let table = shots.table().also_in_gis(&FILTERED).for_gis();
                let features =
                    Features::of_footprints(Body::Mars, "shots", "", points.collect(), table);
                let separator = if is_first { "" } else { geojson::SEPARATOR };
                let separated = writer.write_all(separator.as_bytes());
                separated.map_err(IoError::on("write")).in_file(path)?;
                geojson::write_features(writer, &features).in_file(path)
            }
        }
    }

    /// Ends the file with `search`, what was asked for and how complete the answer is, and gives it its name.
    ///
    /// # Errors
    /// What the disk refuses; a file that comes back with another number of rows.
    pub fn finish(mut self, search: &Value) -> Result<u64> {
        self.write_pending()?;
        let path = self.file.path();
        let refused = |error| IoError::on("write")(error);
        match self.writer {
            Writer::Parquet(writer) => {
                let metadata = vec![
                    (
                        "geo",
                        geo_metadata(Body::Mars, self.bounds, Some(covering())).to_string(),
                    ),
                    ("frame", frame(Body::Mars).to_owned()),
                    (SEARCH, search.to_string()),
                ];
                writer.finish(metadata).in_file(path)?;
                require_rows(self.file.reader()?, self.rows).in_file(path)?;
            }
            Writer::Csv(mut writer) => {
                writer.flush().map_err(refused).in_file(path)?;
                let mut beside = path.as_os_str().to_owned();
                beside.push(".json");
                let beside = PathBuf::from(beside);
                super::files::write_json(&beside, search)?;
            }
            Writer::GeoJson(mut writer) => {
                let tail = format!("\n],\n\"{SEARCH}\": {search}\n}}\n");
                let written = writer.write_all(tail.as_bytes());
                written
                    .and_then(|()| writer.flush())
                    .map_err(refused)
                    .in_file(path)?;
            }
        }
        self.file.finish()?;
        Ok(self.rows)
    }
}

/// Parquet with a bounding box for each shot.
struct ParquetShots {
    writer: ParquetFile<File>,
    schema: SchemaRef,
}

impl ParquetShots {
    fn new(file: File, table: &Table<'_>) -> Result<Self> {
        let fields = parquet::schema(table).fields().clone();
        let bbox = Arc::new(Field::new(BBOX, DataType::Struct(bbox_fields()), false));
        let fields = fields.iter().cloned().chain([bbox]);
        let schema = Arc::new(Schema::new(fields.collect::<Fields>()));
        let writer = ParquetFile::new(file, Arc::clone(&schema));
        Ok(Self {
            writer: writer.map_err(parquet::refused)?,
            schema,
        })
    }

    fn write(&mut self, table: &Table<'_>, points_deg: &[[f64; 2]]) -> Result<()> {
        let batch = with_boxes(table, &self.schema, points_deg)?;
        self.writer.write(&batch).map_err(parquet::refused)
    }

    fn finish(self, metadata: Vec<(&str, String)>) -> Result<()> {
        self.writer.finish(metadata).map_err(parquet::refused)
    }
}

fn bbox_fields() -> Fields {
    let part = |name: &str| Field::new(name, DataType::Float64, false);
    BBOX_PARTS.map(part).to_vec().into()
}

/// The rows of the table with the bounding box of each.
fn with_boxes(
    table: &Table<'_>,
    schema: &SchemaRef,
    points_deg: &[[f64; 2]],
) -> std::result::Result<RecordBatch, ProductError> {
    let bare = parquet::schema(table);
    let batch = parquet::record_batch(table, &bare, 0..table.rows())?;
    let axis = |axis: usize| -> ArrayRef {
        let values = points_deg.iter().map(|point| point[axis]);
        Arc::new(Float64Array::from_iter_values(values))
    };
    let (x, y) = (axis(0), axis(1));
    let parts = vec![Arc::clone(&x), Arc::clone(&y), x, y];
    let boxes = StructArray::try_new(bbox_fields(), parts, None);
    let boxes: ArrayRef = Arc::new(boxes.map_err(ProductError::refused("assemble columns"))?);
    let arrays = batch.columns().iter().cloned().chain([boxes]).collect();
    RecordBatch::try_new(Arc::clone(schema), arrays)
        .map_err(ProductError::refused("assemble columns"))
}

/// Reads back how many rows the file has.
fn require_rows(file: File, rows: u64) -> Result<()> {
    let reader =
        ParquetRecordBatchReaderBuilder::try_new(file).map_err(ProductError::unreadable)?;
    let found = reader.metadata().file_metadata().num_rows();
    if u64::try_from(found).is_ok_and(|found| found == rows) {
        return Ok(());
    }
    let what = format!("{found} rows of {rows}");
    Err(ProductError::ReadBack { what }.into())
}

/// Where each row has its bounding box.
fn covering() -> Value {
    let covering = BBOX_PARTS.map(|part| (part.to_owned(), json!([BBOX, part])));
    let covering: serde_json::Map<String, Value> = covering.into_iter().collect();
    json!({ "bbox": covering })
}
