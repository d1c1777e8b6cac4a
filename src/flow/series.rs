//! Calibrations of one camera in several orbits, compared with the calibration in use.

use std::path::{Path, PathBuf};

use nalgebra::{DMatrix, DVector};
use serde_json::{Value, json};

use crate::{
    error::{Cause, Locate as _, Result},
    geom::calibration::{
        Agreement, Estimate, LOOKS_AT, LineCamera, Lines, OrbitLooks, compare_orbits, parameters,
    },
    products::PublishedCalibration,
    report::{CalibrationSeries, SeriesOrbit},
    store::published::read_published,
};

/// Largest difference between the uncalibrated geometry of two orbits, pixels: files are written with fifteen digits.
const LABORATORY_PX: f64 = 0.01;
/// Calibrations whose images are closer in time than this are of the same orbit, seconds: an orbit takes hours, and its images
/// minutes.
const SAME_ORBIT_S: f64 = 1_800.0;

/// Reasons why calibrations are not compared.
#[derive(Debug, thiserror::Error, Cause)]
#[cause(Configuration)]
enum SeriesError {
    #[error("holds no calibration; expected the products of `areograph calibrate`")]
    #[cause("name folders of calibrations")]
    NoCalibration,
    #[error("the calibration {0} is invalid; expected a valid calibration as the one in use")]
    #[cause("name a valid calibration first; invalid ones after it are left out")]
    Invalid(String),
    #[error(
        "only one valid calibration; expected the calibration in use and those of other orbits"
    )]
    #[cause("calibrate images of further orbits")]
    Single,
    #[error("the lines are {found}; expected those of the calibration in use, {expected}")]
    #[cause("compare calibrations of the same lines of one camera, in the same order")]
    OtherLines { found: String, expected: String },
    #[error(
        "the uncalibrated look directions of {line} differ from those of the calibration in use by up to {off_px:.2} px; expected \
         at most {LABORATORY_PX} px"
    )]
    #[cause("calibrate from uncalibrated support data of one version of the camera's kernels")]
    OtherLaboratory { line: String, off_px: f64 },
    #[error(
        "its images are of the same orbit as those of {0}; expected one calibration of each orbit"
    )]
    #[cause("name one of the two folders")]
    SameOrbit(String),
    #[error("the standard deviations of the calibrations do not determine probabilities")]
    #[cause("calibrate again with a priori standard deviations similar to their defaults")]
    NotANumber,
}

/// Compares calibrations in `folders` with the first of them, which is in use.
///
/// # Errors
/// Products that are missing, damaged, or not of calibrations; calibrations of other lines, or of one orbit twice; an invalid
/// calibration in use; fewer than two valid calibrations.
pub fn calibration_series(folders: &[PathBuf]) -> Result<CalibrationSeries> {
    let (mut all, mut not_used): (Vec<PublishedCalibration>, _) = (Vec::new(), Vec::new());
    for folder in folders {
        let of = read(folder)?;
        if !of.verdict.valid {
            if all.is_empty() {
                return Err(SeriesError::Invalid(of.calibration)).in_file(folder);
            }
            not_used.push((of.calibration, "the calibration is invalid"));
            continue;
        }
        if let Some(first) = all.first() {
            same_camera(first, &of).in_file(folder)?;
        }
        let same = all
            .iter()
            .find(|other| (other.looks.middle_et_s - of.looks.middle_et_s).abs() < SAME_ORBIT_S);
        if let Some(same) = same {
            return Err(SeriesError::SameOrbit(same.calibration.clone())).in_file(folder);
        }
        all.push(of);
    }
    let [in_use, _, ..] = &all[..] else {
        return Err(SeriesError::Single.into());
    };
    let pixels = in_use.cameras.iter().map(|line| line.pixel_tangent);
    let pixel = pixels.fold(0.0, f64::max);
    let lines = in_use.looks.lines.iter().map(|line| line.sensor.clone());
    let lines: Vec<String> = lines.collect();
    let orbits: Vec<OrbitLooks> = all.iter().map(looks).collect();
    let series = compare_orbits(&orbits, 0, pixel).ok_or(SeriesError::NotANumber)?;
    let orbits = all.iter().map(|of| SeriesOrbit {
        calibration: of.calibration.clone(),
        et_s: of.looks.middle_et_s,
    });
    Ok(CalibrationSeries {
        orbits: orbits.collect(),
        lines,
        pixel,
        series,
        not_used,
    })
}

fn read(folder: &Path) -> Result<PublishedCalibration> {
    read_published(folder)?;
    if !PublishedCalibration::is_in(folder) {
        return Err(SeriesError::NoCalibration).in_file(folder);
    }
    PublishedCalibration::read(folder)
}

/// Checks that calibrations are of the same lines with the same uncalibrated geometry.
fn same_camera(
    in_use: &PublishedCalibration,
    of: &PublishedCalibration,
) -> std::result::Result<(), SeriesError> {
    let names = |of: &PublishedCalibration| {
        let lines = of.looks.lines.iter().map(|line| &*line.sensor);
        format!("{} of {}", lines.collect::<Vec<_>>().join(", "), of.body)
    };
    let (found, expected) = (names(of), names(in_use));
    if found != expected {
        return Err(SeriesError::OtherLines { found, expected });
    }
    let lines = in_use.cameras.iter().zip(&of.cameras);
    for ((here, there), line) in lines.zip(&of.looks.lines) {
        let [here_line, there_line] = [here, there].map(|of| {
            let [m, n] = of.laboratory.clone();
            LineCamera {
                m,
                n,
                ..LineCamera::default()
            }
        });
        let off = LOOKS_AT.map(|s| (here_line.tangents(s) - there_line.tangents(s)).norm());
        let off_px = off.into_iter().fold(0.0, f64::max) / here.pixel_tangent;
        // Written so that NaN is refused.
        if !(off_px <= LABORATORY_PX) {
            return Err(SeriesError::OtherLaboratory {
                line: line.sensor.clone(),
                off_px,
            });
        }
    }
    Ok(())
}

fn looks(of: &PublishedCalibration) -> OrbitLooks {
    let looks = &of.looks;
    let changes: Vec<f64> = looks.lines.iter().flat_map(|line| line.changes).collect();
    let numbers = changes.len();
    let covariance = looks.covariance.iter().flatten().copied();
    let by_orbit = looks.by_orbit.iter().flatten().copied();
    OrbitLooks {
        et_s: looks.middle_et_s,
        changes: DVector::from_vec(changes),
        covariance: DMatrix::from_row_iterator(numbers, numbers, covariance),
        orbit: DMatrix::from_iterator(numbers, looks.by_orbit.len(), by_orbit),
    }
}

/// The answer for scripts.
#[must_use]
pub fn series_answer(of: &CalibrationSeries) -> Value {
    let in_px = |estimate: Estimate| json!({"value": estimate.value / of.pixel, "sigma": estimate.sigma / of.pixel});
    let named = parameters(of.lines.len());
    let name = |index: usize| {
        let (lines, parameter) = named[index];
        match lines {
            Lines::Common => json!({"parameter": parameter.word(), "lines": "common"}),
            Lines::Relative(line) => json!({
                "parameter": parameter.word(),
                "lines": "relative",
                "line": of.lines[line],
                "to": of.lines[0],
            }),
        }
    };
    let orbits = of.orbits.iter().zip(&of.series.orbits).skip(1);
    let orbits = orbits.map(|(orbit, change)| {
        let changes = change.changes.iter().enumerate().map(|(index, estimate)| {
            let mut row = name(index);
            row["change_px"] = in_px(*estimate);
            row
        });
        json!({
            "calibration": orbit.calibration,
            "middle_et_s": orbit.et_s,
            "agreement": agreement_word(change.agreement),
            "together_sigmas": change.together_sigmas,
            "changes": changes.collect::<Vec<_>>(),
        })
    });
    let drifts = of.series.drifts.iter().enumerate().map(|(index, drift)| {
        let mut row = name(index);
        let per_year = |estimate: Estimate| Estimate {
            value: estimate.value * CalibrationSeries::YEAR_S,
            sigma: estimate.sigma * CalibrationSeries::YEAR_S,
        };
        row["px_per_year"] = in_px(per_year(drift.rate));
        row["until_last_px"] = in_px(drift.until_last);
        if let Some(after_s) = drift.relevant_after_s {
            row["limit_reached_et_s"] = json!(of.orbits[0].et_s + after_s);
        }
        row
    });
    let not_used = of.not_used.iter();
    let not_used = not_used.map(|(what, reason)| json!({"calibration": what, "reason": reason}));
    let mut answer = json!({
        "in_use": of.orbits[0].calibration,
        "recalibrate": of.recalibrate(),
        "orbits": orbits.collect::<Vec<_>>(),
        "drifts": drifts.collect::<Vec<_>>(),
        "not_used": not_used.collect::<Vec<_>>(),
        "areograph": env!("CARGO_PKG_VERSION"),
    });
    if let Some(scatter) = of.series.scatter {
        answer["scatter"] = json!(scatter);
    }
    answer
}

/// A decision in JSON.
const fn agreement_word(of: Agreement) -> &'static str {
    match of {
        Agreement::Agrees => "agrees",
        Agreement::Changed => "changed",
        Agreement::Recalibrate => "recalibrate",
    }
}
