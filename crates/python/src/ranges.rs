//! Measured ranges against distances from the spacecraft of kernels.

use std::path::PathBuf;

use areograph::{
    altimetry::MolaClock,
    config::usual_altimeter,
    error::{Cause, Result, Stopped},
    footprints::Footprint,
    geom::range_residuals::{RangeResiduals, SpacecraftState},
    spice::{KernelSet, Session},
    stages::{check_ranges::trajectory, group_profiles::Profile},
    time::{Et, Interval},
    units::RADIANS_PER_DEGREE,
};
use nalgebra::Vector3;
use pyo3::prelude::*;
use rayon::prelude::*;

use super::{
    columns::{Columns, arrays, numbers},
    failures::{interruptible, usage},
    kernels::{Names, provenance},
};

/// Columns of shots that [`range_residuals`] takes, in this order.
pub(crate) const RANGE_COLUMNS: [&str; 10] = [
    "et_tag_s",
    "longitude_deg",
    "latitude_deg",
    "radius_m",
    "radius_crossover_m",
    "range_m",
    "spacecraft_longitude_deg",
    "spacecraft_latitude_deg",
    "spacecraft_radius_m",
    "nadir_by_range",
];
/// Seconds of trajectory beyond a piece.
const MARGIN_S: f64 = 0.5;
/// Residuals of a shot of unknown time.
const UNKNOWN: RangeResiduals = RangeResiduals {
    range_minus_distance_m: f64::NAN,
    range_minus_distance_crossover_m: f64::NAN,
    decoding_m: f64::NAN,
    spacecraft_m: Vector3::new(f64::NAN, f64::NAN, f64::NAN),
};

/// A shot of columns in degrees and metres.
fn shot(columns: &[Vec<f64>; 10], row: usize) -> Footprint {
    let value = |column: usize| columns[column][row];
    let angle_rad = |column: usize| value(column) * RADIANS_PER_DEGREE;
    Footprint {
        et_tag_s: value(0),
        et_s: value(0),
        longitude_rad: angle_rad(1),
        latitude_rad: angle_rad(2),
        radius_m: value(3),
        radius_crossover_m: value(4),
        range_m: value(5),
        spacecraft_longitude_rad: angle_rad(6),
        spacecraft_latitude_rad: angle_rad(7),
        spacecraft_radius_m: value(8),
        // Residuals do not use these.
        orbit: 0,
        file: 0,
        record: 0,
        shot: 0,
        areoid_radius_m: 0.0,
        off_nadir_rad: 0.0,
        channel: 0,
        class: 0,
        attitude_flag: 0,
        orbit_quality: 0,
        windows: 0,
    }
}

/// Residuals of every shot, metres, in the order of the shots, with the kernels.
///
/// * `columns` – those of shots, in this order: time tag; longitude, latitude and both radii of the footprint; range;
///   longitude, latitude and radius of the spacecraft in the file; whether this position is nadir by range
/// * `clock_bias_s` – seconds by which time tags are late; by default the bias of MOLA's clock
///
/// # Errors
/// Kernels that do not cover a shot, or cannot be read; columns of other types or lengths.
#[pyfunction]
#[pyo3(signature = (columns, kernels, clock_bias_s=None))]
pub(crate) fn range_residuals(
    py: Python<'_>,
    columns: [Bound<'_, PyAny>; 10],
    kernels: Vec<PathBuf>,
    clock_bias_s: Option<f64>,
) -> PyResult<(Columns, Names, f64)> {
    let columns = arrays(py, RANGE_COLUMNS, columns.each_ref())?;
    let bias_s = clock_bias_s.unwrap_or(usual_altimeter().clock_bias_s);
    let max_s = MolaClock::BIAS_MAX_S;
    if !(bias_s.abs() <= max_s) {
        return Err(usage(format!(
            "clock_bias_s is {bias_s}; expected -{max_s} to {max_s}"
        )));
    }
    let (residuals, kernels) = interruptible(py, |stop| {
        let set = KernelSet::named(&kernels)?;
        let session = Session::open(&set)?;
        let clock = MolaClock::late_by(bias_s, String::new());
        let times: Vec<Et> = columns[0]
            .iter()
            .map(|tag_s| clock.spacecraft_time(*tag_s))
            .collect();
        let trajectory = trajectory(&session, &pieces(&times), MARGIN_S)?;
        Stopped::check(stop)?;
        let residuals = |row: usize| {
            let at = times[row];
            if !at.seconds().is_finite() {
                return Ok((f64::NAN, UNKNOWN));
            }
            let (position, velocity_m_s) = trajectory.state(at).ok_or(Outside(at))?;
            let spacecraft = SpacecraftState::of(at, &position, &velocity_m_s);
            let shot = shot(&columns, row);
            let mut residuals = RangeResiduals::of(&shot, &spacecraft);
            // A flag as a number.
            if columns[9][row] > 0.5 {
                residuals.forget_own();
            }
            Ok((shot.range_m - residuals.range_minus_distance_m, residuals))
        };
        let residuals: Result<Vec<(f64, RangeResiduals)>> =
            (0..times.len()).into_par_iter().map(residuals).collect();
        Ok((residuals?, provenance(&set)))
    })?;
    let column =
        |of: fn(&(f64, RangeResiduals)) -> f64| numbers(residuals.iter().map(of).collect());
    let columns = Columns::of([
        ("distance_m", column(|(distance_m, _)| *distance_m)),
        (
            "range_minus_distance_m",
            column(|(_, of)| of.range_minus_distance_m),
        ),
        (
            "range_minus_distance_crossover_m",
            column(|(_, of)| of.range_minus_distance_crossover_m),
        ),
        ("decoding_m", column(|(_, of)| of.decoding_m)),
        ("spacecraft_radial_m", column(|(_, of)| of.spacecraft_m.x)),
        ("spacecraft_along_m", column(|(_, of)| of.spacecraft_m.y)),
        ("spacecraft_cross_m", column(|(_, of)| of.spacecraft_m.z)),
    ]);
    Ok((columns?, kernels, bias_s))
}

/// A shot outside the tabulated trajectory.
#[derive(Debug, thiserror::Error, Cause)]
#[error("no spacecraft position at the shot time {0}")]
#[cause(Coverage: "name a spacecraft ephemeris (SPK) that covers the shots")]
struct Outside(Et);

/// Intervals that contain the shots.
fn pieces(times: &[Et]) -> Vec<Interval> {
    let known = times.iter().filter(|at| at.seconds().is_finite());
    let mut sorted: Vec<Et> = known.copied().collect();
    sorted.sort_by(|a, b| a.seconds().total_cmp(&b.seconds()));
    let pieces = sorted.chunk_by(|a, b| b.since(*a) <= Profile::PAUSE_S);
    pieces
        .map(|piece| Interval::new(piece[0], piece[piece.len() - 1]))
        .collect()
}
