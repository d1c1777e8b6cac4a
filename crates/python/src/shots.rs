//! Shots of PEDR files and tables.

use std::{path::PathBuf, sync::atomic::AtomicBool};

use areograph::{
    altimetry::ShotFilter,
    config::{WindowConfig, window_of_box, window_of_polygon},
    error::Result,
    flow::{ShotRequest, ShotSearch, ShotSink},
    footprints::{AsRead, Footprints},
    pds::archive::{Judged, WindowLists},
    products::ShotBatches,
    time::{Et, Interval},
    units::RADIANS_PER_DEGREE,
};
use pyo3::{exceptions::PyValueError, prelude::*};
use serde_json::Value;

use super::{
    columns::Columns,
    failures::{exception, interruptible},
};

/// Edges of a window that contains every shot, degrees.
const EVERYWHERE_DEG: [f64; 4] = [0.0, 360.0, -90.0, 90.0];

/// Names of the columns of shots, in order.
#[pyfunction]
pub(crate) fn shot_columns() -> Vec<&'static str> {
    ShotBatches::names()
}

/// Values of a filter: classes, channels, attitude flags, largest off-nadir angle and season in degrees.
type FilterValues = (Vec<i16>, Vec<u8>, Vec<u16>, f64, [f64; 2]);

struct Batches(ShotBatches);

impl ShotSink for Batches {
    fn take(&mut self, shots: Footprints<AsRead>, windows: &WindowLists) -> Result<()> {
        self.0.push(shots, windows)
    }
}

/// Finds shots: the columns, and the statement of request and completeness as JSON.
///
/// * `boxes`, `polygons` – windows: west, east, south and north edge in degrees; `GeoJSON` files; without any, all shots
/// * `columns` – names of [`shot_columns`]
/// * `filter` – without one, every shot with a return
/// * `time_s` – first and last time tag, TDB seconds past J2000; an open end is infinite
/// * `check_all` – whether every record is checked, and not only those near the windows
#[pyfunction]
#[pyo3(signature = (paths, *, boxes, polygons, columns, filter, time_s, check_all))]
#[allow(clippy::too_many_arguments, reason = "keywords of one request")]
pub(crate) fn search_shots(
    py: Python<'_>,
    paths: Vec<PathBuf>,
    boxes: Vec<[f64; 4]>,
    polygons: Vec<PathBuf>,
    columns: Vec<String>,
    filter: Option<FilterValues>,
    time_s: Option<[f64; 2]>,
    check_all: bool,
) -> PyResult<(Columns, String)> {
    let windows = windows(&boxes, &polygons).map_err(|failure| exception(py, &failure))?;
    let filter = filter.map(filter_of);
    let time = time_s.map(|ends_s| ends_s.map(Et::from_seconds));
    if time.is_some_and(|[start, stop]| !(start <= stop)) {
        let message = "the interval of time is empty; expected the first time before the last";
        return Err(PyValueError::new_err(message));
    }
    let request = ShotRequest {
        paths: &paths,
        windows: &windows,
        filter: filter.as_ref(),
        time: time.map(|[start, stop]| Interval::new(start, stop)),
        judged: if check_all { Judged::All } else { Judged::Near },
        leap_seconds: None,
    };
    let (table, statement) = interruptible(py, |stop| find(request, columns, stop))?;
    Ok((table, statement.to_string()))
}

fn find(
    request: ShotRequest<'_>,
    columns: Vec<String>,
    stop: &AtomicBool,
) -> Result<(Columns, Value)> {
    let search = ShotSearch::open(request, stop)?;
    let ids = request.windows.iter().map(|window| window.id.clone());
    let batches = ShotBatches::new(columns, search.files().to_vec(), ids.collect());
    let mut batches = Batches(batches);
    let mut answer = search.run(stop, &mut batches)?;
    // An answer that lacks a file is no answer: the first failure stands for all, which the statement lists.
    if !answer.failures.is_empty() {
        return Err(answer.failures.swap_remove(0));
    }
    let (schema, batches) = batches.0.finish()?;
    Ok((Columns::new(schema, batches), answer.statement))
}

fn windows(boxes: &[[f64; 4]], polygons: &[PathBuf]) -> Result<Vec<WindowConfig>> {
    if boxes.is_empty() && polygons.is_empty() {
        return Ok(vec![window_of_box("everywhere", EVERYWHERE_DEG)?]);
    }
    let numbered = boxes.iter().enumerate();
    let boxes =
        numbered.map(|(index, edges_deg)| window_of_box(&format!("box{}", index + 1), *edges_deg));
    let polygons = polygons.iter().map(|path| window_of_polygon(path));
    boxes.chain(polygons).collect()
}

fn filter_of(
    (classes, channels, attitude_flags, off_nadir_max_deg, season_deg): FilterValues,
) -> ShotFilter {
    ShotFilter {
        classes,
        channels,
        attitude_flags,
        off_nadir_max_rad: off_nadir_max_deg * RADIANS_PER_DEGREE,
        solar_longitude_rad: season_deg.map(|degrees| degrees * RADIANS_PER_DEGREE),
    }
}
