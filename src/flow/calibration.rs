//! A calibration of the lines of a camera, from support data and tables to its products.
//!
//! `flow/single.rs` contains the common part of this flow and the flow of a net; `flow/calibration_loop.rs` is the
//! calibration from pixels.

use std::path::Path;

use super::{
    calibration_loop::CalibrationLoop,
    out::check_out_path,
    single::{ManifestEntry, Single, SingleOutcome, made},
};
use crate::{
    config::CalibrationConfig,
    error::Result,
    products::{CalibrationProducts, write_calibration_products},
    report::calibration_page,
    stages::calibrate::{
        Calibrate, Calibration, CalibrationFiles, CalibrationKeys, PointKind, calibration_files,
    },
    store::manifest::figures,
};

/// Raised when the layout of the products of a calibration changes.
const METHOD: u32 = 7;

/// Calibrates the lines of a camera and publishes the products in `<out>/<calibration>`, if an input has changed
/// since the last run.
///
/// # Errors
/// Files that cannot be read, points that do not fit the support data, write errors; earlier products then remain.
pub fn run_calibration(
    config: &CalibrationConfig,
    out: &Path,
    force: bool,
) -> Result<SingleOutcome> {
    check_out_path(out)?;
    let single = Single {
        name: &config.calibration,
        file: &config.file,
        blake3: &config.blake3,
        keys: &config.keys,
        method: METHOD,
        folder: out.join(&config.calibration),
        force,
    };
    single.run(
        &calibration_files(config),
        |hashed, cache, stop| {
            let (calibration, files) = (CalibrationKeys(config), CalibrationFiles(hashed));
            if config.ties.matched {
                let rounds = CalibrationLoop { calibration, files };
                return made(&rounds, cache, stop);
            }
            made(&Calibrate { calibration, files }, cache, stop)
        },
        |staging, result| {
            let page = calibration_page(config, result)?;
            let products = CalibrationProducts {
                config,
                result,
                page: &page,
            };
            write_calibration_products(staging, &products)
        },
        manifest_entry,
    )
}

/// Content of the manifest of a calibration.
fn manifest_entry(result: &Calibration) -> ManifestEntry<'_> {
    let count = |kind: PointKind| {
        let of = result.points.iter().filter(|of| of.kind == kind);
        of.count() as u64
    };
    let left_out = result.points.iter().filter(|of| of.left_out);
    let mut stated = Vec::new();
    if let Some(last) = result.steps.last() {
        let worst_px = last.figures.ties.worst_px();
        stated.extend(worst_px.map(|of| (figures::TIE_RESIDUAL_RMS_PX, of)));
    }
    let height_m = result.held_back.as_ref().and_then(|of| of.height_m);
    stated.extend(height_m.map(|of| (figures::HELD_BACK_HEIGHT_RMS_M, of)));
    ManifestEntry {
        verdict: &result.verdict,
        counts: vec![
            ("cameras", result.cameras.len() as u64),
            ("ties", count(PointKind::Tie)),
            ("controls", count(PointKind::Control)),
            ("held_back_controls", count(PointKind::HeldBack)),
            ("left_out", left_out.count() as u64),
            ("unseen_directions", u64::from(result.tie_sight.unseen)),
        ],
        figures: stated,
        complaints: (&result.complaints, result.complaint_count),
    }
}
