//! Shots found by a search of the archive, written as they arrive: the same columns as `footprints.parquet`.

use std::{
    fmt, mem,
    path::{Path, PathBuf},
    sync::Arc,
};

use arrow_array::{ArrayRef, Float32Array, RecordBatch, StructArray};
use arrow_schema::{DataType, Field, Fields, Schema, SchemaRef};
use serde_json::{Value, json};

use super::{
    coordinates::frame,
    error::ProductError,
    files::to_value,
    footprints::{Shot, ShotNames, columns, write_list},
    geoparquet::geo_metadata,
    parquet,
    rows_file::{GEOMETRY, RowsFormat, RowsWriter, SEARCH},
    table::{Meaning, Table},
};
use areograph_base::{
    body::Body,
    error::{Locate, Result},
    footprints::{AsRead, Footprints, SourceFile},
    frames::BodyFixed,
    terms::Terms,
};
use areograph_pds::archive::WindowLists;
use areograph_stages::convert_datum::convert_at_tags;
use areograph_store::{
    atomic,
    files::{Mark, MarkAt, require_own},
};

/// The column of the bounding box of each point, and its parts: readers of GeoParquet use it to skip rows. Single
/// precision, rounded outward, halves its size.
const BBOX: &str = "bbox";
const BBOX_PARTS: [&str; 4] = ["xmin", "ymin", "xmax", "ymax"];
/// Columns that shots are selected by: a search may keep several values of each, so that GIS has them too; and their
/// positions.
const ALSO_IN_GIS: [&str; 4] = ["channel", "return_class", "attitude_flag", GEOMETRY];

/// Shots that are written together: enough for all threads, few compared with the memory of a search.
const ROWS_AT_ONCE: usize = 32_768;

/// Some shots of a search, in order.
struct FoundShots<'a> {
    footprints: &'a Footprints<BodyFixed>,
    windows: &'a WindowLists,
    window_ids: &'a [String],
}

impl ShotNames for FoundShots<'_> {
    fn write_windows(&self, row: usize, out: &mut dyn fmt::Write) -> fmt::Result {
        let windows = self.windows.of(row).iter();
        let ids = windows.filter_map(|window| self.window_ids.get(*window as usize));
        write_list(ids.map(String::as_str), out)
    }
}

impl FoundShots<'_> {
    fn rows(&self) -> Vec<Shot<'_>> {
        Shot::all_of(self.footprints, self)
    }
}

/// Columns of shots in a format: without UTC, which is unknown in a search without kernels.
fn table(rows: Vec<Shot<'_>>, format: RowsFormat) -> Table<'_> {
    let table = Table::new(columns(), rows)
        .in_terms(&Terms::MARS)
        .without("utc");
    match format {
        RowsFormat::Parquet => table,
        RowsFormat::Csv => table.for_text().with_joined_lists(),
        RowsFormat::GeoJson => table
            .also_in_gis(&ALSO_IN_GIS)
            .for_gis()
            .with_joined_lists(),
    }
}

/// Shots that wait until there are enough of them, with their windows.
struct Pending(Footprints<AsRead>, WindowLists);

impl Default for Pending {
    fn default() -> Self {
        Self(Footprints::new(Vec::new()), WindowLists::default())
    }
}

impl Pending {
    fn append(&mut self, footprints: Footprints<AsRead>, windows: &WindowLists) {
        self.0.append(footprints);
        self.1.append(windows);
    }

    /// The first shots, at most `ROWS_AT_ONCE`, if there are `at_least` of them.
    fn take(&mut self, at_least: usize) -> Option<(Footprints<AsRead>, WindowLists)> {
        let rows = self.0.len();
        (rows >= at_least.max(1)).then(|| {
            let first = rows.min(ROWS_AT_ONCE);
            let left = Self(self.0.split_off(first), self.1.split_off(first));
            let Self(footprints, windows) = mem::replace(self, left);
            (footprints, windows)
        })
    }
}

/// Shots of a search as record batches in memory.
pub struct ShotBatches {
    columns: Vec<String>,
    schema: SchemaRef,
    sources: Vec<SourceFile>,
    window_ids: Vec<String>,
    pending: Pending,
    batches: Vec<RecordBatch>,
}

impl ShotBatches {
    /// No shots yet.
    ///
    /// * `columns` – names of [`Self::names`]; their order has no effect, unknown names are omitted
    /// * `sources` – the files that shots are counted into
    /// * `window_ids` – identifiers of the windows
    #[must_use]
    pub fn new(columns: Vec<String>, sources: Vec<SourceFile>, window_ids: Vec<String>) -> Self {
        let table =
            table(Vec::new(), RowsFormat::Parquet).keep(|column| is_among(column, &columns));
        let geo = geo_metadata(Body::Mars, None, None).to_string();
        let frame = frame(Body::Mars).to_owned();
        let notes = [("geo".to_owned(), geo), ("frame".to_owned(), frame)];
        let schema = Schema::clone(&parquet::schema(&table)).with_metadata(notes.into());
        Self {
            columns,
            schema: Arc::new(schema),
            sources,
            window_ids,
            pending: Pending::default(),
            batches: Vec::new(),
        }
    }

    /// All columns, in order: those of `footprints.parquet` without UTC.
    #[must_use]
    pub fn names() -> Vec<&'static str> {
        let table = table(Vec::new(), RowsFormat::Parquet);
        table.columns().map(|column| column.name).collect()
    }

    /// Appends shots with their windows.
    ///
    /// # Errors
    /// Numbers that are not finite.
    pub fn push(&mut self, footprints: Footprints<AsRead>, windows: &WindowLists) -> Result<()> {
        self.pending.append(footprints, windows);
        while let Some((footprints, windows)) = self.pending.take(ROWS_AT_ONCE) {
            self.assemble(footprints, &windows)?;
        }
        Ok(())
    }

    fn assemble(&mut self, footprints: Footprints<AsRead>, windows: &WindowLists) -> Result<()> {
        let footprints = convert_at_tags(footprints, &self.sources);
        let shots = FoundShots {
            footprints: &footprints,
            windows,
            window_ids: &self.window_ids,
        };
        let table =
            table(shots.rows(), RowsFormat::Parquet).keep(|column| is_among(column, &self.columns));
        self.batches.push(parquet::record_batch(
            &table,
            &self.schema,
            0..table.rows(),
        )?);
        Ok(())
    }

    /// The schema, with the metadata of `GeoParquet`, and all shots.
    ///
    /// # Errors
    /// As [`Self::push`].
    pub fn finish(mut self) -> Result<(SchemaRef, Vec<RecordBatch>)> {
        if let Some((footprints, windows)) = self.pending.take(1) {
            self.assemble(footprints, &windows)?;
        }
        Ok((self.schema, self.batches))
    }
}

/// Whether a column has one of these names.
fn is_among(column: &Meaning, names: &[String]) -> bool {
    names.iter().any(|name| name == column.name)
}

/// A file of shots that is being written; it is renamed to its final name when finished.
///
/// Parquet is GeoParquet 1.1 with bounding boxes; the query is written to a file beside CSV.
pub struct ShotsFile {
    path: PathBuf,
    rows: RowsWriter,
    format: RowsFormat,
    schema: SchemaRef,
    /// The files that shots are counted into.
    sources: Vec<SourceFile>,
    window_ids: Vec<String>,
    pending: Pending,
    bounds: Option<[f64; 4]>,
}

impl ShotsFile {
    /// Creates the file `path`.
    ///
    /// * `sources` – the files that shots are counted into
    /// * `window_ids` – identifiers of the windows
    ///
    /// # Errors
    /// Errors of the disk; a file that is not an earlier answer of a search.
    pub fn create(
        path: &Path,
        format: RowsFormat,
        sources: Vec<SourceFile>,
        window_ids: Vec<String>,
    ) -> Result<Self> {
        if format == RowsFormat::Csv {
            require_own(&beside(path), &REQUEST)?;
        }
        let bare = parquet::schema(&table(Vec::new(), format));
        let schema = match format {
            RowsFormat::Parquet => with_bbox(&bare),
            RowsFormat::Csv | RowsFormat::GeoJson => bare,
        };
        Ok(Self {
            path: path.to_owned(),
            rows: RowsWriter::replacing(path, format, SchemaRef::clone(&schema))?,
            format,
            schema,
            sources,
            window_ids,
            pending: Pending::default(),
            bounds: None,
        })
    }

    /// Appends shots with their windows.
    ///
    /// # Errors
    /// Numbers that are not finite; errors of the disk.
    pub fn write(&mut self, footprints: Footprints<AsRead>, windows: &WindowLists) -> Result<()> {
        self.pending.append(footprints, windows);
        while let Some((footprints, windows)) = self.pending.take(ROWS_AT_ONCE) {
            self.write_rows(footprints, &windows)?;
        }
        Ok(())
    }

    fn write_rows(&mut self, footprints: Footprints<AsRead>, windows: &WindowLists) -> Result<()> {
        let footprints = convert_at_tags(footprints, &self.sources);
        let shots = FoundShots {
            footprints: &footprints,
            windows,
            window_ids: &self.window_ids,
        };
        let rows = shots.rows();
        let points_deg: Vec<[f64; 2]> = rows.iter().map(Shot::point_deg).collect();
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
        let table = table(rows, self.format);
        let path = &self.path;
        let bare = parquet::schema(&table);
        let mut batch = parquet::record_batch(&table, &bare, 0..table.rows()).in_file(path)?;
        if self.format == RowsFormat::Parquet {
            batch = with_boxes(&batch, &self.schema, &points_deg).in_file(path)?;
        }
        self.rows.write(batch)
    }

    /// Ends the file with `search`, the query and the completeness of its answer, and gives it its name.
    ///
    /// # Errors
    /// Errors of the disk; a file that is read back with another number of rows.
    pub fn finish(mut self, search: &Value) -> Result<u64> {
        if let Some((footprints, windows)) = self.pending.take(1) {
            self.write_rows(footprints, &windows)?;
        }
        let mut notes = vec![(SEARCH, search.to_string())];
        match self.format {
            RowsFormat::Parquet => {
                let geo = geo_metadata(Body::Mars, self.bounds, Some(covering())).to_string();
                let frame = frame(Body::Mars).to_owned();
                notes.splice(0..0, [("geo", geo), ("frame", frame)]);
            }
            RowsFormat::Csv => {
                let beside = beside(&self.path);
                let text = format!("{:#}\n", to_value(search).in_file(&beside)?);
                atomic::replace(&beside, text.as_bytes(), REQUEST)?;
            }
            RowsFormat::GeoJson => {}
        }
        self.rows.finish(notes)
    }
}

/// The file of the request beside a CSV.
fn beside(path: &Path) -> PathBuf {
    let mut beside = path.as_os_str().to_owned();
    beside.push(".json");
    PathBuf::from(beside)
}

/// Mark by which an earlier such file is recognised.
const REQUEST: Mark = Mark {
    what: "the request of an earlier search",
    at: MarkAt::Content(is_request),
};

fn is_request(path: &Path) -> bool {
    let text = std::fs::read_to_string(path).unwrap_or_default();
    let request: Value = serde_json::from_str(&text).unwrap_or_default();
    request["areograph"].is_string() && request["all_records_judged"].is_boolean()
}

/// These columns and the bounding box.
fn with_bbox(schema: &SchemaRef) -> SchemaRef {
    let bbox = Arc::new(Field::new(BBOX, DataType::Struct(bbox_fields()), false));
    let fields = schema.fields().iter().cloned().chain([bbox]);
    Arc::new(Schema::new(fields.collect::<Fields>()))
}

fn bbox_fields() -> Fields {
    let part = |name: &str| Field::new(name, DataType::Float32, false);
    BBOX_PARTS.map(part).to_vec().into()
}

/// These rows with the bounding box of each.
fn with_boxes(
    batch: &RecordBatch,
    schema: &SchemaRef,
    points_deg: &[[f64; 2]],
) -> std::result::Result<RecordBatch, ProductError> {
    let side = |axis: usize, rounded: fn(f64) -> f32| -> ArrayRef {
        let values = points_deg.iter().map(|point| rounded(point[axis]));
        Arc::new(Float32Array::from_iter_values(values))
    };
    let parts = vec![
        side(0, below),
        side(1, below),
        side(0, above),
        side(1, above),
    ];
    let boxes = StructArray::try_new(bbox_fields(), parts, None);
    let boxes: ArrayRef = Arc::new(boxes.map_err(ProductError::refused("assemble columns"))?);
    let arrays = batch.columns().iter().cloned().chain([boxes]).collect();
    RecordBatch::try_new(Arc::clone(schema), arrays)
        .map_err(ProductError::refused("assemble columns"))
}

/// The nearest single-precision number that is not above `value`.
#[expect(clippy::cast_possible_truncation, reason = "the rounding is corrected")]
fn below(value: f64) -> f32 {
    let nearest = value as f32;
    if f64::from(nearest) > value {
        return nearest.next_down();
    }
    nearest
}

/// The nearest single-precision number that is not below `value`.
fn above(value: f64) -> f32 {
    -below(-value)
}

/// Columns of the bounding box of each row.
fn covering() -> Value {
    let covering = BBOX_PARTS.map(|part| (part.to_owned(), json!([BBOX, part])));
    let covering: serde_json::Map<String, Value> = covering.into_iter().collect();
    json!({ "bbox": covering })
}
