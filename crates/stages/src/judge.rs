//! The verdict on a site: the one place where it is made, with the findings of capabilities.
//!
//! Reasons, remarks and `checks` come from the same evidence and limits; for every limit the largest use is listed. The
//! manifest stores them; pages, messages and run comparisons show them and judge nothing.

mod adjustment;
mod beam;
mod checks;
mod corrections;
mod ranges;
mod untested;

use std::collections::BTreeMap;

pub use areograph_base::verdict::{Check, CheckKind, CheckOutcome, Verdict};
pub use beam::BeamEvidence;
pub use untested::NO_BEAM;

use super::{
    adjust::Adjusted,
    check_heights::HeightCheck,
    check_profiles::ProfileCheck,
    check_ranges::{BiasScan, RangeCheck},
    compare_pairs::PairComparison,
    fit_sensor_model::SensorModel,
    orientation::Orientation,
    read_ties::Ties,
    tag_times::{Disagreement, ImageTimes},
};
use areograph_base::{
    altimetry::GroundRadius,
    minus::{signed, with_minus},
    terms::Terms,
};
use areograph_config::{LimitsConfig, OrientationConfig, RangeCheckConfig};
use areograph_pds::archive::ShotRejection;

/// The evidence on which a site is judged.
#[derive(Debug, Clone, Copy)]
pub struct Evidence<'a> {
    /// The terms of sentences and checks.
    pub terms: Terms<'a>,
    /// Footprints in the windows; `None` for a site without PEDR files.
    pub footprints: Option<usize>,
    /// Shots in the windows that were rejected, by reason.
    pub rejected: &'a BTreeMap<ShotRejection, u64>,
    /// Which of two radii of the shots represents the ground; `None` where they have one radius.
    pub ground: Option<GroundRadius>,
    /// The limits of the configuration.
    pub limits: &'a LimitsConfig,
    /// Limits on ranges.
    pub range_limits: &'a RangeCheckConfig,
    /// Limits on sensor models.
    pub orientation_limits: &'a OrientationConfig,
    /// Ranges of every profile.
    pub ranges: &'a RangeCheck,
    /// The configured correction of the clock of MOLA, seconds.
    pub clock_correction_s: f64,
    /// The images with the orientation from the kernels.
    pub images: &'a [JudgedImage<'a>],
    /// The beam of the laser by the attitude of the images.
    pub beam: BeamEvidence<'a>,
    /// Faults of the kernels, one sentence each.
    pub warnings: &'a [String],
    /// Faults of skipped records, one sentence each.
    pub complaints: &'a [String],
    /// The profiles against each other.
    pub profiles: &'a ProfileCheck,
    /// The adjustment; `None` for a site without tie points.
    pub adjustment: Option<AdjustmentEvidence<'a>>,
    /// Findings that are declared outside this module, in order.
    pub findings: &'a [Findings],
    /// Reason why there is no adjustment although there are tie points.
    pub adjustment_failure: Option<&'a str>,
}

/// Findings of one capability on a site.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Findings {
    /// Reasons why the site is invalid, one sentence each.
    pub reasons: Vec<String>,
    /// Points that the reader must weigh although no limit is broken, one sentence each.
    pub remarks: Vec<String>,
    /// Its limits with their largest use.
    pub checks: Vec<Check>,
}

/// An image that is judged.
#[derive(Debug, Clone, Copy)]
pub struct JudgedImage<'a> {
    /// Its line times, with the disagreements of its label, clock and mounting.
    pub times: &'a ImageTimes,
    /// Its orientation.
    pub orientation: &'a Orientation,
    /// Its sensor models.
    pub model: &'a SensorModel,
}

impl<'a> JudgedImage<'a> {
    /// Identifier.
    pub(super) fn id(&self) -> &'a str {
        &self.times.id
    }

    /// The disagreements that make the site invalid.
    fn contradictions(&self) -> impl Iterator<Item = &'a Disagreement> {
        let all = self.times.remarks.iter();
        all.filter(|of| of.is_beyond_accuracy())
    }
}

/// The evidence on an adjustment.
#[derive(Debug, Clone, Copy)]
pub struct AdjustmentEvidence<'a> {
    /// The tie points.
    pub ties: &'a Ties,
    /// The adjustment.
    pub adjusted: &'a Adjusted,
    /// The images with their adjusted orientation.
    pub images: &'a [JudgedImage<'a>],
    /// Every pair with the orientation from the kernels.
    pub pairs: &'a [PairComparison],
    /// Every pair with the adjusted orientation.
    pub adjusted_pairs: &'a [PairComparison],
    /// Heights of tie points with the orientation from the kernels.
    pub heights: &'a HeightCheck,
    /// Heights of the adjusted tie points.
    pub adjusted_heights: &'a HeightCheck,
}

/// Judges a site by its limits and by contradictions in its data.
#[must_use]
pub fn judge(evidence: &Evidence<'_>) -> Verdict {
    let mut checks = checks::checks(evidence);
    for check in &mut checks {
        check.name_in(&evidence.terms);
    }
    let verdict = Verdict::of(evidence.invalid_because(), evidence.remarks(), checks);
    let said = |sentence: String| with_minus(&sentence);
    Verdict {
        reasons: verdict.reasons.into_iter().map(said).collect(),
        remarks: verdict.remarks.into_iter().map(said).collect(),
        untested: untested::untested(evidence).into_iter().map(said).collect(),
        ..verdict
    }
}

impl Evidence<'_> {
    /// States why no footprint is in a window, and what to check.
    fn no_footprint(&self) -> String {
        if self.rejected.is_empty() {
            return "no footprint in any window: check the windows, and check that the shot files (pedr.files or \
                shots.files) belong to the site's orbits".to_owned();
        }
        let counts = self
            .rejected
            .iter()
            .map(|(reason, count)| format!("{count} ({reason})"));
        let counts: Vec<String> = counts.collect();
        let check = if self.rejected.contains_key(&ShotRejection::Spoiled) {
            "radii, ranges and positions of these shots contradict each other: check their units and reference sphere"
        } else {
            "check pedr.filter"
        };
        format!(
            "no footprint in any window, because all shots in the windows were rejected: {}; {check}",
            counts.join(", ")
        )
    }

    /// Reasons why the site is invalid, one sentence each; empty when it is valid.
    fn invalid_because(&self) -> Vec<String> {
        let mut reasons = Vec::new();
        if self.footprints == Some(0) {
            reasons.push(self.no_footprint());
        }
        for profile in &self.ranges.profiles {
            for reason in &profile.invalid_because {
                reasons.push(format!("profile {}: {reason}", profile.profile));
            }
        }
        reasons.extend(ranges::invalid_because(self));
        for image in self.images {
            let of_orientation = image.orientation.invalid_because.iter();
            let all = image
                .contradictions()
                .map(|of| &of.text)
                .chain(of_orientation);
            for reason in all.chain(&image.model.invalid_because) {
                reasons.push(format!("image {}: {reason}", image.id()));
            }
        }
        reasons.extend(beam::invalid_because(self));
        reasons.extend(
            self.adjustment
                .iter()
                .flat_map(|of| of.invalid_because(self)),
        );
        reasons.extend(self.findings.iter().flat_map(|of| of.reasons.clone()));
        let failed = self.adjustment_failure;
        reasons.extend(failed.map(|failure| format!("no adjustment: {failure}")));
        reasons
    }

    /// Points that the reader must weigh although no limit is broken, one sentence each.
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
            remarks.extend(notes.map(|note| format!("image {}: {note}", image.id())));
        }
        remarks.extend(ranges::remarks(self));
        remarks.extend(beam::remarks(self));
        let configured_s = self.clock_correction_s;
        for ranges in &self.ranges.profiles {
            let doubt = ranges
                .scan
                .as_ref()
                .and_then(|scan| doubt(scan, configured_s));
            remarks.extend(doubt.map(|doubt| format!("profile {}: {doubt}", ranges.profile)));
        }
        remarks.extend(self.adjustment.iter().flat_map(|of| of.remarks(self)));
        remarks.extend(self.findings.iter().flat_map(|of| of.remarks.clone()));
        remarks
    }
}

/// Differences from the configured clock correction below this get no remark, seconds: independent orbits differ by
/// tens of metres along the track, which the spacecraft covers in this time.
const CLOCK_DOUBT_S: f64 = 0.02;
/// The same limit in standard uncertainties; the larger of the two applies.
const CLOCK_DOUBT_SIGMA: f64 = 5.0;

/// Largest accepted distance of a scan with this uncertainty from the configured correction, seconds.
const fn clock_limit_s(uncertainty_s: f64) -> f64 {
    CLOCK_DOUBT_S.max(CLOCK_DOUBT_SIGMA * uncertainty_s)
}

/// The contradiction between a scan and the configured correction, if any.
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
