//! The configuration as its file has it: nothing checked but the type of each value.
//!
//! Every key is optional here, so that missing keys are reported together with all other problems.
//! The structs stay plain because `Spanned` does not pass through flattened or tagged types.

use serde::Deserialize;
use toml::Spanned;

/// A value of the file and where it stands; `None` when its key is absent.
pub(super) type Entry<T> = Option<Spanned<T>>;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawSite {
    pub(super) site: Entry<String>,
    pub(super) description: Option<String>,
    pub(super) kernels: Entry<RawKernels>,
    pub(super) pointing: Entry<RawPointing>,
    pub(super) mola_clock: Entry<RawMolaClock>,
    pub(super) pedr: Entry<RawPedr>,
    pub(super) windows: Entry<Vec<Spanned<RawWindow>>>,
    pub(super) images: Entry<Vec<Spanned<RawImage>>>,
    pub(super) range_check: Entry<RawRangeCheck>,
    pub(super) orientation: Entry<RawOrientation>,
    pub(super) registration: Entry<RawRegistration>,
    pub(super) ties: Entry<RawTies>,
    pub(super) intersection: Entry<RawIntersection>,
    pub(super) adjustment: Entry<RawAdjustment>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawKernels {
    pub(super) metakernel: Entry<String>,
    pub(super) files: Entry<Vec<Spanned<String>>>,
    pub(super) root: Entry<String>,
    pub(super) sets: Entry<Vec<Spanned<RawKernelSet>>>,
    pub(super) spk_family: Entry<String>,
    pub(super) ck_quality: Entry<Vec<Spanned<String>>>,
    pub(super) pinned: Entry<Vec<Spanned<String>>>,
    pub(super) ck_tolerance_s: Entry<f64>,
    pub(super) padding_s: Entry<f64>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawKernelSet {
    pub(super) id: Entry<String>,
    pub(super) metakernel: Entry<String>,
    pub(super) files: Entry<Vec<Spanned<String>>>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawPointing {
    pub(super) ck_bias_s: Entry<f64>,
    pub(super) source: Entry<String>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawMolaClock {
    pub(super) bias_s: Entry<f64>,
    pub(super) sign: Entry<String>,
    pub(super) scope: Entry<String>,
    pub(super) source: Entry<String>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawPedr {
    pub(super) files: Entry<Vec<Spanned<String>>>,
    pub(super) datum: Entry<String>,
    pub(super) filter: Option<RawFilter>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawFilter {
    pub(super) classes: Entry<Vec<Spanned<i64>>>,
    pub(super) channels: Entry<Vec<Spanned<i64>>>,
    pub(super) attitude_flags: Entry<Vec<Spanned<i64>>>,
    pub(super) off_nadir_max_deg: Entry<f64>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawWindow {
    pub(super) id: Entry<String>,
    pub(super) longitude_deg: Entry<Vec<Spanned<f64>>>,
    pub(super) latitude_deg: Entry<Vec<Spanned<f64>>>,
    pub(super) polygon: Entry<String>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawImage {
    pub(super) id: Entry<String>,
    pub(super) label: Entry<String>,
    pub(super) instrument: Entry<String>,
    pub(super) serial_number: Entry<String>,
    pub(super) sclk_start: Entry<String>,
    pub(super) utc_start: Entry<String>,
    pub(super) exposure_ms: Entry<f64>,
    pub(super) line_period_ms: Entry<f64>,
    pub(super) downtrack_summing: Entry<i64>,
    pub(super) crosstrack_summing: Entry<i64>,
    pub(super) lines_header: Entry<i64>,
    pub(super) lines_delivered: Entry<i64>,
    pub(super) samples: Entry<i64>,
    pub(super) first_detector: Entry<i64>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawRangeCheck {
    pub(super) mean_max_m: Entry<f64>,
    pub(super) outlier_sigma: Entry<f64>,
    pub(super) outlier_share_max: Entry<f64>,
    pub(super) shots_min: Entry<i64>,
    pub(super) decoding_max_m: Entry<f64>,
    pub(super) scan_half_width_s: Entry<f64>,
    pub(super) scan_step_s: Entry<f64>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawOrientation {
    pub(super) intervals: Entry<i64>,
    pub(super) position_rmse_max_m: Entry<f64>,
    pub(super) pointing_rmse_max_arcsec: Entry<f64>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawRegistration {
    pub(super) model: Entry<String>,
    pub(super) tolerance_lines: Entry<f64>,
    pub(super) steps_max: Entry<i64>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawTies {
    pub(super) files: Entry<Vec<Spanned<String>>>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawIntersection {
    pub(super) weighting: Entry<String>,
    pub(super) sigma_px: Entry<f64>,
    pub(super) sigma_lines: Entry<f64>,
    pub(super) convergence_min_deg: Entry<f64>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawAdjustment {
    pub(super) tie_sigma_px: Entry<Vec<Spanned<f64>>>,
    pub(super) mola_image: Entry<String>,
    pub(super) mola_sigma_px: Entry<Vec<Spanned<f64>>>,
    pub(super) mola_margin_px: Entry<f64>,
    pub(super) ground_sigma_m: Entry<f64>,
    pub(super) range_sigma_m: Entry<f64>,
    pub(super) range_bias_sigma_m: Entry<f64>,
    pub(super) time_bias_sigma_ms: Entry<f64>,
    pub(super) nadir_sigma_m: Entry<f64>,
    pub(super) off_nadir_sigma_m: Entry<f64>,
    pub(super) robust: Entry<String>,
    pub(super) robust_limit: Entry<f64>,
    pub(super) blunder_limit: Entry<f64>,
    pub(super) images: Entry<Vec<Spanned<RawOrientationPrior>>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawOrientationPrior {
    pub(super) id: Entry<String>,
    pub(super) position_m: Entry<Vec<Spanned<f64>>>,
    pub(super) rotation_arcsec: Entry<Vec<Spanned<f64>>>,
}
