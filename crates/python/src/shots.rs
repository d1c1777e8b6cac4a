//! Shots of PEDR files and tables.

use std::{ops::RangeInclusive, path::PathBuf, sync::atomic::AtomicBool};

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
use pyo3::prelude::*;
use serde_json::Value;

use super::{
    columns::Columns,
    failures::{exception, interruptible, usage},
};

/// Edges of a window that contains every shot, degrees.
const EVERYWHERE_DEG: [f64; 4] = [0.0, 360.0, -90.0, 90.0];

/// Names of the columns of shots, in order.
#[pyfunction]
pub(crate) fn shot_columns() -> Vec<&'static str> {
    ShotBatches::names()
}

/// Values of a filter: classes, channels, attitude flags, largest off-nadir angle and season in degrees.
type FilterValues = (Vec<i64>, Vec<i64>, Vec<i64>, f64, [f64; 2]);

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
    let filter = filter.map(filter_of).transpose()?;
    let time = time_s.map(|ends_s| ends_s.map(Et::from_seconds));
    if time.is_some_and(|[start, stop]| !(start <= stop)) {
        return Err(usage(format!(
            "t0 and t1 are {time_s:?} seconds past J2000; expected t0 no later than t1"
        )));
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

/// The filter, within the limits of the command line.
///
/// # Errors
/// The first value beyond its limits.
fn filter_of(
    (classes, channels, attitude_flags, off_nadir_max_deg, season_deg): FilterValues,
) -> PyResult<ShotFilter> {
    if !(off_nadir_max_deg > 0.0 && off_nadir_max_deg <= ShotFilter::OFF_NADIR_LIMIT_DEG) {
        return Err(usage(format!(
            "max_off_nadir_deg is {off_nadir_max_deg}; expected a number above 0, up to {}",
            ShotFilter::OFF_NADIR_LIMIT_DEG
        )));
    }
    if !season_deg.iter().all(|edge| (0.0..=360.0).contains(edge)) {
        return Err(usage(format!(
            "solar_longitude_deg is {season_deg:?}; expected two longitudes from 0 to 360 degrees, such as (330, 30)"
        )));
    }
    let [first, last] = ShotFilter::CHANNELS;
    let of_channels = i64::from(first)..=i64::from(last);
    Ok(ShotFilter {
        classes: codes(
            "classes",
            &classes,
            i64::from(i16::MIN)..=i64::from(i16::MAX),
        )?,
        channels: codes("channels", &channels, of_channels)?,
        attitude_flags: codes("attitude_flags", &attitude_flags, 0..=i64::from(u16::MAX))?,
        off_nadir_max_rad: off_nadir_max_deg * RADIANS_PER_DEGREE,
        solar_longitude_rad: season_deg.map(|degrees| degrees * RADIANS_PER_DEGREE),
    })
}

/// Codes within their limits.
fn codes<T: TryFrom<i64>>(
    name: &str,
    codes: &[i64],
    within: RangeInclusive<i64>,
) -> PyResult<Vec<T>> {
    let code = |code: &i64| {
        let found = within.contains(code).then(|| T::try_from(*code).ok());
        found.flatten().ok_or_else(|| {
            let (first, last) = (within.start(), within.end());
            usage(format!(
                "{name} contains {code}; expected {first} to {last}"
            ))
        })
    };
    codes.iter().map(code).collect()
}
