//! Corrections of orientations beyond what their a priori standard deviations allow.

use super::{
    AdjustmentEvidence, Check, CheckKind,
    CheckOutcome::{Fail, Pass, Warning},
    adjustment::SCATTER_LARGE_PX,
};
use crate::adjust::CorrectedImage;
use areograph_config::LimitsConfig;
use areograph_geom::bundle::Unknown;

/// Drift and bend of the attitude up to this multiple of the limit are a remark: tie points determine them to a tenth of their
/// a priori standard deviation, and residuals of C-kernels to a parabola (Shan et al. 2005, Table 4) exceed it.
const DRIFT_MULTIPLE: f64 = 1.5;
/// Rotations follow the nine coefficients of the position.
const FIRST_ROTATION: usize = 9;

/// The largest correction of an image.
pub(super) struct LargestCorrection<'a> {
    /// Identifier of the image.
    image: &'a str,
    /// The unknown, of image 0.
    unknown: Unknown,
    /// The correction in its standard deviations.
    sigmas: f64,
    /// Multiple of the limit beyond which it makes the site invalid.
    multiple: f64,
}

/// Whether a coefficient is of a drift or bend of the attitude.
const fn is_drift(coefficient: usize) -> bool {
    coefficient >= FIRST_ROTATION && !coefficient.is_multiple_of(3)
}

impl LargestCorrection<'_> {
    /// Written so that NaN exceeds every limit.
    fn is_within(&self, limit: f64) -> bool {
        self.sigmas <= limit
    }

    pub(super) fn check(&self, limits: &LimitsConfig) -> Check {
        let limit = limits.correction_max_sigma;
        let largest = self.multiple * limit;
        let mut check = Check::new(
            CheckKind::Correction,
            self.image,
            self.sigmas,
            largest,
            Fail,
        );
        if check.outcome == Pass && !self.is_within(limit) {
            check.outcome = Warning;
        }
        check
    }
}

impl AdjustmentEvidence<'_> {
    /// Of each image the largest correction of position and constant rotation, and the largest drift or bend of its attitude.
    pub(super) fn largest_corrections(&self) -> impl Iterator<Item = LargestCorrection<'_>> {
        // Ties that contradict each other do not determine a drift.
        let is_scattered = self.adjusted.summary.tie_scatter_px > SCATTER_LARGE_PX;
        let of_drift = if is_scattered { 1.0 } else { DRIFT_MULTIPLE };
        let largest = |image: &CorrectedImage, drift: bool| -> Option<(f64, usize)> {
            let off = image.correction.iter().zip(&image.expected);
            let off = off.map(|(value, expected)| value - expected);
            let corrections = off.zip(&image.prior_sigmas).enumerate();
            let known = corrections.filter(|(index, (_, sigma))| {
                **sigma > 0.0 && sigma.is_finite() && is_drift(*index) == drift
            });
            let sigmas = known.map(|(index, (value, sigma))| ((value / sigma).abs(), index));
            sigmas.max_by(|one, other| one.0.total_cmp(&other.0))
        };
        self.adjusted.images.iter().flat_map(move |image| {
            let found = [(false, 1.0), (true, of_drift)].map(|(drift, multiple)| {
                let (sigmas, coefficient) = largest(image, drift)?;
                Some(LargestCorrection {
                    image: &image.id,
                    unknown: Unknown::Orientation {
                        image: 0,
                        coefficient,
                    },
                    sigmas,
                    multiple,
                })
            });
            found.into_iter().flatten()
        })
    }

    /// Reasons why corrections make the site invalid, one sentence each.
    pub(super) fn corrected_too_far(&self, limits: &LimitsConfig) -> Vec<String> {
        let limit = limits.correction_max_sigma;
        let far = self.largest_corrections();
        let far = far.filter(|of| !of.is_within(of.multiple * limit));
        let far = far.map(|of| {
            format!(
                "image {}: the adjustment corrects its {} by {:.1} standard deviations; expected at most {}; check its \
                 time and kernels, and pointing.ck_bias_s",
                of.image,
                of.unknown.quantity(),
                of.sigmas,
                of.multiple * limit
            )
        });
        far.collect()
    }

    /// Remarks on drift and bend of attitudes beyond the limit.
    pub(super) fn drifts(&self, limits: &LimitsConfig) -> Vec<String> {
        let limit = limits.correction_max_sigma;
        let drifts = self.largest_corrections();
        let drifts = drifts.filter(|of| !of.is_within(limit) && of.is_within(of.multiple * limit));
        let drifts = drifts.map(|of| {
            format!(
                "image {}: the adjustment corrects its {} by {:.1} standard deviations (usually at most {limit}): the \
                 attitude drifts by more than assumed, or the label states a wrong time or summing",
                of.image,
                of.unknown.quantity(),
                of.sigmas
            )
        });
        drifts.collect()
    }
}
