//! Notes for readers of support data, which camera models ignore.

use super::{
    View,
    document::{Interpolation, KernelName, Provenance},
};
use crate::site::SiteProducts;
use areograph_base::instruments::DistortionModel;
use areograph_geom::pushbroom::Distortion;
use areograph_stages::{sample_orientation::InterpolationCheck, tag_times::ImageTimes};
use areograph_store::stage::Round;

/// Notes for readers of this file; camera models ignore them.
pub(super) fn provenance<'a>(site: &SiteProducts<'a>, view: &View<'a>) -> Provenance<'a> {
    let times = view.times;
    let interpolation = &view.tables.interpolation;
    let detector = times.detector();
    let distortion = if detector.distortion == Distortion::NONE {
        let source = times.support.as_ref();
        let source = source.map_or("the instrument kernel states", |_| "the support data state");
        format!("optical_distortion: none, as {source}")
    } else if let DistortionModel::Transverse { .. } = times.instrument.distortion {
        let calibration = times.instrument.calibration.as_ref();
        let source = calibration.map_or_else(
            || "the support data state".to_owned(),
            |of| format!("the calibration {} gives", of.calibration),
        );
        format!("optical_distortion: as {source}")
    } else {
        let fit = detector.radial_fit(&times.instrument);
        format!(
            "optical_distortion: the three radial coefficients that fit the camera best over the samples of this \
             image; residuals are at most {:.1e} pixels",
            fit.error_max_px,
        )
    };
    // A list, as two kernels may have one name.
    let kernels = site.kernels.iter();
    let kernels = kernels.map(|kernel| KernelName {
        blake3: &kernel.blake3,
        name: &kernel.name,
    });
    Provenance {
        configuration_blake3: &site.config.blake3,
        detector_line_exposure_s: times.exposure_s,
        interpolation: Interpolation {
            epochs_compared_with_kernels: interpolation.epochs,
            error_max_px: interpolation.error_max_px,
            limit_px: InterpolationCheck::LIMIT_PX,
            method: "Lagrange interpolation over uniform nodes, as in usgscsm, of positions and of camera quaternions \
                     rotated to the body; eighth order inside, lower towards the ends",
            within_limit: interpolation.keeps_limit(),
        },
        kernels: kernels.collect(),
        light_time: view.light_time,
        line_period_s: times.line_times.mean_period_s(),
        lines_header: times.line_times.lines(),
        notes: vec![
            "line_scan_rate: seconds per image line (summing included), from the top edge of the first line"
                .to_owned(),
            format!(
                "detector coordinates count from the detector's edge: centre at sample {}, starting_detector_sample \
                 from 0, so that the centre of the first sample is 0.5 * summing + starting_detector_sample",
                times.instrument.detector.boresight_px,
            ),
            distortion,
            format!(
                "instrument_position: {}{}; reading programs must not add light time or aberration{}",
                view.light_time.convention.positions(),
                view.convention,
                match view.round {
                    Round::Initial | Round::Matching => "",
                    Round::Adjusted => "; the correction and the shift of line times in ../../adjustment.json are \
                                        included",
                },
            ),
            format!(
                "instrument_pointing: attitude of each epoch {}{}",
                attitude_source(times),
                match view.round {
                    Round::Initial | Round::Matching => "",
                    Round::Adjusted => {
                        ", rotated by the correction and shifted with the lines; the attitude belongs to \
                         instrument_position, from which tie points do not separate it along the track"
                    }
                },
            ),
            "image_lines: number of delivered lines; lines_header lines were exposed".to_owned(),
        ],
        site: &site.config.site,
        start_from: times.start_from,
        utc_start: &times.utc_start,
        version: env!("CARGO_PKG_VERSION"),
    }
}

/// Source of attitudes, as a clause for readers.
fn attitude_source(times: &ImageTimes) -> String {
    match &times.support {
        Some(support) => format!("from the support data {}", support.name),
        None => format!(
            "read from the C-kernel at epoch + INS{}_CK_TIME_BIAS",
            times.instrument.naif.instrument
        ),
    }
}
