//! A calibration of the lines of a camera, from support data to its products: from tables by one stage, from pixels in
//! the rounds of `flow/calibration_rounds.rs`.

use super::{
    calibration_rounds::{Concluded, rounds},
    driver::{Driver, Flow},
    result::{ManifestEntry, ResultPublication, Written},
};
use crate::{
    config::CalibrationConfig,
    products::{CalibrationModel, CalibrationProducts, write_calibration_products},
    report::calibration_page,
    stage::Stage as _,
    stages::calibrate::{
        Calibrate, Calibration, CalibrationFiles, CalibrationKeys, PointKind, calibration_files,
    },
    store::manifest::figures,
};

/// Raised when the layout of the products of a calibration changes.
const METHOD: u32 = 16;

/// Calibrates the lines of a camera and publishes the products.
pub(super) fn calibration<D: Driver>(flow: &mut D, config: &CalibrationConfig) -> Flow<()> {
    let (result, model, has_further_stages) = if config.ties.matched {
        let Concluded { calibration, model } = rounds(flow, config)?;
        let is_pending = model.is_none();
        (calibration, model, is_pending)
    } else {
        let files = flow.hash(Calibrate::NAME, &calibration_files(config))?;
        let result = flow.stage(&Calibrate {
            calibration: CalibrationKeys(config),
            files: CalibrationFiles(&files),
        })?;
        (result, None, false)
    };
    flow.publish(&ResultPublication {
        written: Written {
            name: &config.calibration,
            file: &config.file,
            blake3: &config.blake3,
            keys: &config.keys,
            method: METHOD,
        },
        result: &result,
        has_further_stages,
        write: |staging: &_, result: &_| {
            let model = match &model {
                Some(of) => Some(CalibrationModel {
                    surface: &of.surface.value()?.model,
                    first: &of.control[0].value()?.found,
                    last: &of.control[1].value()?.found,
                    ties: &of.ties.value()?.points,
                }),
                None => None,
            };
            let page = calibration_page(config, result, model.as_ref())?;
            let products = CalibrationProducts {
                config,
                result,
                model,
                page: &page,
            };
            write_calibration_products(staging, &products)
        },
        entry: manifest_entry,
    })
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
