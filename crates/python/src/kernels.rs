//! Spacecraft states and comparisons from kernels.

use std::{path::PathBuf, sync::Arc};

use areograph::{
    body::Body,
    config::usual_instrument,
    error::{Cause, Result},
    flow::{Answer, Request, RivalSet, compare_kernels as compare, require_different},
    geom::body_rotation::{body_rotation, spin_rad_s},
    spice::{KernelSet, RequiredCoverage, Session},
    time::{Et, Interval, Intervals},
};
use arrow_array::{ArrayRef, StringArray};
use nalgebra::Vector3;
use pyo3::prelude::*;
use serde_json::json;

use super::{
    columns::{Columns, arrays, numbers},
    failures::{detached, interruptible},
};

/// Names of kernels with their BLAKE3.
pub(crate) type Names = Vec<(String, String)>;

/// Name and BLAKE3 of every kernel.
pub(crate) fn provenance(kernels: &KernelSet) -> Names {
    let kernels = kernels.kernels().iter();
    kernels
        .map(|kernel| (kernel.file_name(), kernel.blake3.clone()))
        .collect()
}

/// The instants of times in UTC, TDB seconds past J2000.
#[pyfunction]
pub(crate) fn utc_to_et(
    py: Python<'_>,
    utc: Vec<String>,
    kernels: Vec<PathBuf>,
) -> PyResult<Vec<f64>> {
    detached(py, || {
        let session = Session::open(&KernelSet::named(&kernels)?)?;
        let seconds = |utc: &String| Ok(session.utc_to_et(utc)?.seconds());
        utc.iter().map(seconds).collect()
    })
}

/// Geometric states of MGS relative to Mars, metres and metres per second, with UTC and the kernels.
#[pyfunction]
pub(crate) fn spacecraft_states(
    py: Python<'_>,
    et_s: &Bound<'_, PyAny>,
    kernels: Vec<PathBuf>,
    body_fixed: bool,
) -> PyResult<(Columns, Names)> {
    let [et_s] = arrays(py, ["et"], [et_s])?;
    let (states, utc, kernels) = interruptible(py, |stop| {
        let set = KernelSet::named(&kernels)?;
        let session = Session::open(&set)?;
        let mut states: [Vec<f64>; 6] = Default::default();
        let mut utc = Vec::with_capacity(et_s.len());
        for et_s in &et_s {
            areograph::error::Stopped::check(stop)?;
            let et = Et::from_seconds(*et_s);
            let state = session.state(et)?;
            let (position_m, velocity_m_s) = if body_fixed {
                let rotation = body_rotation(Body::Mars, et);
                let position_m = rotation.apply(&state.position).xyz_m;
                let spin: Vector3<f64> = spin_rad_s(Body::Mars.model());
                let velocity_m_s = rotation.matrix() * state.velocity_m_s - spin.cross(&position_m);
                (position_m, velocity_m_s)
            } else {
                (state.position.xyz_m, state.velocity_m_s)
            };
            for (column, value) in states
                .iter_mut()
                .zip(position_m.iter().chain(&velocity_m_s))
            {
                column.push(*value);
            }
            utc.push(session.et_to_utc(et)?);
        }
        Ok((states, utc, provenance(&set)))
    })?;
    let names = ["x_m", "y_m", "z_m", "vx_m_s", "vy_m_s", "vz_m_s"];
    let mut columns: Vec<(&str, ArrayRef)> = names.into_iter().zip(states.map(numbers)).collect();
    columns.push(("utc", Arc::new(StringArray::from(utc))));
    Ok((Columns::of(columns)?, kernels))
}

/// An interval of time that ends before it begins.
#[derive(Debug, thiserror::Error, Cause)]
#[error("t0 is {first} and t1 is {last}; expected t0 earlier than t1")]
#[cause(Configuration: "exchange t0 and t1")]
struct Backwards {
    first: String,
    last: String,
}

/// Compares kernel sets over an interval of UTC, else over all that they share: the answer as JSON, and the kernels of each
/// set.
#[pyfunction]
pub(crate) fn compare_kernels(
    py: Python<'_>,
    sets: Vec<(String, Vec<PathBuf>)>,
    utc: Option<[String; 2]>,
) -> PyResult<(String, Vec<Names>)> {
    interruptible(py, |_| {
        let sets = sets.into_iter().map(|(id, paths)| {
            let kernels = KernelSet::named(&paths)?;
            Ok(RivalSet { id, kernels })
        });
        let sets: Vec<RivalSet> = sets.collect::<Result<_>>()?;
        let bias = usual_instrument().pointing_bias();
        let required = utc.map(|[first, last]| {
            let session = Session::open(&sets[0].kernels)?;
            let span = Interval::new(session.utc_to_et(&first)?, session.utc_to_et(&last)?);
            if span.start >= span.stop {
                return Err(Backwards { first, last }.into());
            }
            let span = Intervals::union_of([span]);
            Ok(RequiredCoverage {
                attitudes: span.shifted(bias.seconds()),
                positions: span,
                ..RequiredCoverage::default()
            })
        });
        let required = required
            .transpose()
            .map_err(|failure: areograph::error::Error| failure)?;
        require_different(&sets)?;
        let request = Request {
            stage: "compare_kernels",
            required: required.as_ref(),
            bias,
            attitudes: true,
            clocks: false,
        };
        let compared = compare(&sets, &request)?;
        let kernels = sets.iter().map(|set| provenance(&set.kernels));
        Ok((json!(Answer::of(&compared)).to_string(), kernels.collect()))
    })
}
