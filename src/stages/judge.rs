//! The verdict on a site: the one place where it is made.
//!
//! Reasons, remarks and `checks` come from the same evidence and limits; of every limit the largest use is listed. The
//! manifest holds them, and pages, messages and differences of runs show them; none of these judges by itself.

mod adjustment;
mod checks;
mod surface;

pub use areograph_base::verdict::{Check, CheckKind, CheckOutcome, Verdict};

use super::{
    adjust::Adjusted,
    check_heights::HeightCheck,
    check_ranges::{BiasScan, RangeCheck},
    compare_pairs::PairComparison,
    fit_sensor_model::SensorModel,
    map_surface::SurfaceAccount,
    orientation::Orientation,
    read_ties::Ties,
};
use crate::{
    config::{LimitsConfig, OrientationConfig, RangeCheckConfig},
    wording::{Wording, signed, with_minus},
};

/// What is known of a site when it is judged.
#[derive(Debug, Clone, Copy)]
pub struct Evidence<'a> {
    /// The words of sentences and checks.
    pub wording: Wording<'a>,
    /// Footprints in the windows; `None` for a site without PEDR files.
    pub footprints: Option<usize>,
    /// The limits of the configuration.
    pub limits: &'a LimitsConfig,
    /// Those on ranges.
    pub range_limits: &'a RangeCheckConfig,
    /// Those on sensor models.
    pub orientation_limits: &'a OrientationConfig,
    /// Ranges of every profile.
    pub ranges: &'a RangeCheck,
    /// The configured correction of the clock of MOLA, seconds.
    pub clock_correction_s: f64,
    /// The images with the orientation of the kernels.
    pub images: &'a [JudgedImage<'a>],
    /// What is wrong with the kernels, one sentence each.
    pub warnings: &'a [String],
    /// What was wrong with skipped records, one sentence each.
    pub complaints: &'a [String],
    /// The adjustment; nothing for a site without tie points.
    pub adjustment: Option<AdjustmentEvidence<'a>>,
    /// The terrain model of a pair; nothing for a site that asks for none.
    pub surface: Option<&'a SurfaceAccount>,
    /// Why there is no adjustment although there are tie points.
    pub adjustment_failure: Option<&'a str>,
}

/// An image that is judged.
#[derive(Debug, Clone, Copy)]
pub struct JudgedImage<'a> {
    /// Identifier.
    pub id: &'a str,
    /// Its orientation.
    pub orientation: &'a Orientation,
    /// Its sensor models.
    pub model: &'a SensorModel,
}

/// What is known of an adjustment.
#[derive(Debug, Clone, Copy)]
pub struct AdjustmentEvidence<'a> {
    /// The tie points.
    pub ties: &'a Ties,
    /// The adjustment.
    pub adjusted: &'a Adjusted,
    /// The images with their adjusted orientation.
    pub images: &'a [JudgedImage<'a>],
    /// Every pair with the orientation of the kernels.
    pub pairs: &'a [PairComparison],
    /// Every pair with the adjusted orientation.
    pub adjusted_pairs: &'a [PairComparison],
    /// Heights of tie points with the orientation of the kernels.
    pub heights: &'a HeightCheck,
    /// Heights of the adjusted tie points.
    pub adjusted_heights: &'a HeightCheck,
}

/// Judges a site by its limits and by what contradicts itself.
#[must_use]
pub fn judge(evidence: &Evidence<'_>) -> Verdict {
    let mut checks = checks::checks(evidence);
    for check in &mut checks {
        check.say(&evidence.wording);
    }
    let verdict = Verdict::of(evidence.invalid_because(), evidence.remarks(), checks);
    let said = |sentence: String| with_minus(&evidence.wording.of(sentence));
    Verdict {
        reasons: verdict.reasons.into_iter().map(said).collect(),
        remarks: verdict.remarks.into_iter().map(said).collect(),
        ..verdict
    }
}

impl Evidence<'_> {
    /// Why the site is invalid, one sentence per reason; empty when it is valid.
    fn invalid_because(&self) -> Vec<String> {
        let mut reasons = Vec::new();
        if self.footprints == Some(0) {
            reasons.push(
                "no footprint in any window: look at windows and pedr.filter, and whether pedr.files are of the site's orbits"
                    .to_owned(),
            );
        }
        for profile in &self.ranges.profiles {
            for reason in &profile.invalid_because {
                reasons.push(format!("profile {}: {reason}", profile.profile));
            }
        }
        for image in self.images {
            let of_orientation = image.orientation.invalid_because.iter();
            for reason in of_orientation.chain(&image.model.invalid_because) {
                reasons.push(format!("image {}: {reason}", image.id));
            }
        }
        reasons.extend(
            self.adjustment
                .iter()
                .flat_map(|of| of.invalid_because(self.limits)),
        );
        reasons.extend(surface::invalid_because(self));
        let failed = self.adjustment_failure;
        reasons.extend(failed.map(|failure| format!("no adjustment: {failure}")));
        reasons
    }

    /// What a reader must weigh although no limit is broken, one sentence each.
    fn remarks(&self) -> Vec<String> {
        let mut remarks = self.warnings.to_vec();
        match self.complaints {
            [] => {}
            [only] => remarks.push(format!("skipped records: {only}")),
            [first, rest @ ..] => remarks.push(format!(
                "skipped records: {first} (and {} more)",
                rest.len()
            )),
        }
        for image in self.images {
            let notes = image.orientation.notes.iter();
            remarks.extend(notes.map(|note| format!("image {}: {note}", image.id)));
        }
        let configured_s = self.clock_correction_s;
        for ranges in &self.ranges.profiles {
            let doubt = ranges
                .scan
                .as_ref()
                .and_then(|scan| doubt(scan, configured_s));
            remarks.extend(doubt.map(|doubt| format!("profile {}: {doubt}", ranges.profile)));
        }
        remarks.extend(
            self.adjustment
                .iter()
                .flat_map(|of| of.remarks(self.limits)),
        );
        remarks.extend(surface::remarks(self));
        remarks
    }
}

/// Differences from the configured clock correction below this are not remarked on, seconds: rival orbits
/// differ by tens of metres along the track, which the spacecraft flies in this time.
const CLOCK_DOUBT_S: f64 = 0.02;
/// Nor are those below so many standard uncertainties.
const CLOCK_DOUBT_SIGMA: f64 = 5.0;

/// How far a scan with this uncertainty may be from the configured correction, seconds.
const fn clock_limit_s(uncertainty_s: f64) -> f64 {
    CLOCK_DOUBT_S.max(CLOCK_DOUBT_SIGMA * uncertainty_s)
}

/// What a scan says against the configured correction.
fn doubt(scan: &BiasScan, configured_s: f64) -> Option<String> {
    let (best_s, uncertainty_s) = (scan.best_s?, scan.uncertainty_s?);
    let apart_s = (best_s - configured_s).abs();
    // Written so that NaN counts.
    (!(apart_s <= clock_limit_s(uncertainty_s))).then(|| {
        format!(
            "its ranges fit a clock correction of {} ± {uncertainty_s:.4} s, not the configured {} s",
            signed(best_s, 4),
            signed(configured_s, 3)
        )
    })
}
