//! The verdict on a site: the one place where it is made.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{
    adjust::{Adjusted, CorrectedImage, PointKind},
    check_heights::HeightCheck,
    check_ranges::{BiasScan, RangeCheck},
    compare_pairs::PairComparison,
    fit_sensor_model::SensorModel,
    orientation::Orientation,
    read_ties::Ties,
};
use crate::{config::LimitsConfig, footprints::AdjustmentModel};

/// Whether the products keep the limits of the configuration.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Verdict {
    /// No limit is broken.
    pub valid: bool,
    /// Every broken limit, with its profile or image.
    pub reasons: Vec<String>,
    /// What a reader must weigh although no limit is broken.
    pub remarks: Vec<String>,
}

impl Verdict {
    /// The verdict in one word or three, as every message and page has it.
    #[must_use]
    pub const fn word(&self) -> &'static str {
        match (self.valid, self.remarks.as_slice()) {
            (false, _) => "INVALID",
            (true, []) => "valid",
            (true, _) => "valid with remarks",
        }
    }
}

/// What is known of a site when it is judged.
#[derive(Debug, Clone, Copy)]
pub struct Evidence<'a> {
    /// Footprints in the windows; `None` for a site without PEDR files.
    pub footprints: Option<usize>,
    /// The limits of the configuration.
    pub limits: &'a LimitsConfig,
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

/// Fewer tie points than this near shots leave their height to what is known of orbit and attitude.
const NEAR_SHOTS_FEW: usize = 20;
/// A mean height within this many of its standard deviations is no contradiction.
const HEIGHT_SIGMAS: f64 = 3.0;
/// Names of the quantities that an orientation is corrected by.
const CORRECTED: [&str; 6] = [
    "position along X",
    "position along Y",
    "position along Z",
    "rotation about the camera's x axis",
    "rotation about the camera's y axis",
    "rotation about the camera's z axis",
];

impl AdjustmentEvidence<'_> {
    /// Why the adjusted orientation is invalid, one sentence per reason: what MOLA says first, then what images say of
    /// each other, then what was known beforehand.
    fn invalid_because(&self, limits: &LimitsConfig) -> Vec<String> {
        let mut invalid = self.heights_off(limits);
        let reasons = |image: &JudgedImage| -> Vec<String> {
            let id = image.id;
            // What is wrong with the orientation of the kernels is told with it.
            let of_model = image.model.invalid_because.iter();
            of_model
                .map(|reason| format!("adjusted image {id}: {reason}"))
                .collect()
        };
        invalid.extend(self.images.iter().flat_map(reasons));
        let (left_out, ties) = (self.left_out(), self.ties.multi_image());
        if 2 * left_out > ties {
            invalid.push(format!(
                "adjustment: {left_out} of {ties} tie points were rejected; ties.parquet says why"
            ));
        }
        let rounds = [
            ("before", self.pairs, limits.parallax_before_max_m),
            ("after", self.adjusted_pairs, limits.parallax_after_max_m),
        ];
        for (round, pairs, limit_m) in rounds {
            for pair in pairs.iter().filter(|pair| !is_together(pair, limit_m)) {
                invalid.push(format!(
                    "tie points of {} and {} lie {:.1} m apart along the flight {round} the adjustment, expected at most \
                     {limit_m} m",
                    pair.images[0], pair.images[1], pair.along_track_parallax_m
                ));
            }
        }
        invalid.extend(self.corrected_too_far(limits));
        invalid
    }

    /// What MOLA says against the heights of tie points.
    fn heights_off(&self, limits: &LimitsConfig) -> Vec<String> {
        let after_max_m = limits
            .height_after_max_m
            .max(HEIGHT_SIGMAS * self.adjusted_heights.mean_sigma_m);
        let rounds = [
            ("before", self.heights, limits.height_before_max_m),
            ("after", self.adjusted_heights, after_max_m),
        ];
        let mut reasons = Vec::new();
        for (round, check, limit_m) in rounds {
            // Written so that NaN counts.
            if check.surface.is_ok() && !(check.above_m.median.abs() <= limit_m) {
                reasons.push(format!(
                    "tie points lie {:+.1} m from the MOLA surface {round} the adjustment (median of {}), expected at most \
                     {limit_m:.1} m",
                    check.above_m.median, check.above_m.n
                ));
            }
        }
        if let Some(apart) = &self.heights.apart {
            let sigmas = apart.mean_m.abs() / apart.sigma_m;
            if !(sigmas <= limits.profiles_apart_max_sigma) {
                reasons.push(format!(
                    "profiles {} and {} contradict each other: at the tie points their surfaces lie {:.1} m apart on \
                     average, {sigmas:.1} standard deviations, expected at most {}",
                    apart.profiles[0],
                    apart.profiles[1],
                    apart.mean_m.abs(),
                    limits.profiles_apart_max_sigma
                ));
            }
        }
        reasons
    }

    /// Corrections of orientations that what was known of them does not allow.
    fn corrected_too_far(&self, limits: &LimitsConfig) -> Vec<String> {
        let largest = |image: &CorrectedImage| -> Option<(f64, usize)> {
            let corrections = image.correction.iter().zip(&image.prior_sigmas).enumerate();
            let known = corrections.filter(|(_, (_, sigma))| **sigma > 0.0 && sigma.is_finite());
            let sigmas = known.map(|(index, (value, sigma))| ((value / sigma).abs(), index));
            sigmas.max_by(|one, other| one.0.total_cmp(&other.0))
        };
        let far = self.adjusted.images.iter().filter_map(|image| {
            let (sigmas, index) = largest(image)?;
            (!(sigmas <= limits.correction_max_sigma)).then(|| {
                format!(
                    "image {}: the adjustment corrects its {} by {sigmas:.1} standard deviations, expected at most {}; check \
                     its time, its kernels and pointing.ck_bias_s",
                    image.id,
                    CORRECTED[index / 3],
                    limits.correction_max_sigma
                )
            })
        });
        far.collect()
    }

    /// Tie points that took part in the adjustment.
    fn taken(&self) -> usize {
        let points = self.adjusted.points.iter();
        points.filter(|point| point.kind == PointKind::Tie).count()
    }

    /// Tie points that join images and yet took no part.
    fn left_out(&self) -> usize {
        self.ties.multi_image().saturating_sub(self.taken())
    }

    /// Whether the images of every pair place tie points together after the adjustment, and most of these took
    /// part in it.
    #[must_use]
    pub fn images_agree(&self, limits: &LimitsConfig) -> bool {
        let limit_m = limits.parallax_after_max_m;
        2 * self.left_out() <= self.ties.multi_image()
            && !self.adjusted_pairs.is_empty()
            && self
                .adjusted_pairs
                .iter()
                .all(|pair| is_together(pair, limit_m))
    }

    /// What a reader must weigh, one sentence each.
    fn remarks(&self, limits: &LimitsConfig) -> Vec<String> {
        let mut remarks = Vec::new();
        match &self.heights.surface {
            Err(reason) => remarks.push(format!(
                "heights of tie points are not controlled by MOLA ({reason}): they are known as well as orbit and attitude \
                 beforehand, to some 500 m"
            )),
            Ok(_) if self.heights.near_shots < NEAR_SHOTS_FEW => remarks.push(format!(
                "only {} tie points lie within a kilometre of a shot: their heights are known little better than orbit and \
                 attitude beforehand",
                self.heights.near_shots
            )),
            Ok(_) => {}
        }
        if self.adjusted.summary.model == AdjustmentModel::Published {
            remarks.push(
                "the adjustment follows the published model (adjustment.model): its heights are not controlled, and its \
                 standard deviations are those of agreement between the images"
                    .to_owned(),
            );
        }
        let (left_out, ties) = (self.left_out(), self.ties.multi_image());
        let share = limits.rejected_share_max;
        if left_out as f64 > share * ties as f64 && 2 * left_out <= ties {
            remarks.push(format!(
                "{left_out} of {ties} tie points were rejected by the adjustment; ties.parquet says why"
            ));
        }
        let taken = self.taken();
        if taken < limits.ties_min as usize {
            remarks.push(format!(
                "only {taken} tie points took part in the adjustment, expected at least {}",
                limits.ties_min
            ));
        }
        let [along, _] = self.adjusted.summary.tie_components;
        if !(along <= limits.sigma0_max) {
            remarks.push(format!(
                "residuals of the tie points along the track are {along:.2} times what adjustment.tie_sigma_px expects: \
                 measurements are worse than configured, or a model does not hold"
            ));
        }
        remarks
    }
}

fn is_together(pair: &PairComparison, limit_m: f64) -> bool {
    // Written so that NaN counts as apart.
    pair.along_track_parallax_m.abs() <= limit_m
}

/// Judges a site by its limits and by what contradicts itself.
#[must_use]
pub fn judge(evidence: &Evidence<'_>) -> Verdict {
    let reasons = evidence.invalid_because();
    Verdict {
        valid: reasons.is_empty(),
        reasons,
        remarks: evidence.remarks(),
    }
}

impl Evidence<'_> {
    /// Why the site is invalid, one sentence per reason; empty when it is valid.
    fn invalid_because(&self) -> Vec<String> {
        let mut reasons = Vec::new();
        if self.footprints == Some(0) {
            reasons.push("no footprint in any window".to_owned());
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
        let images = self
            .images
            .iter()
            .filter(|image| image.model.near_gimbal_lock);
        remarks.extend(images.map(|image| {
            format!(
                "image {}: |cos φ| falls to {:.3}, where ω and κ are poorly determined; use the rotation-vector form",
                image.id, image.model.cos_phi_min
            )
        }));
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
        remarks
    }
}

/// Differences from the configured clock correction below this are not remarked on, seconds: rival orbits
/// differ by tens of metres along the track, which the spacecraft flies in this time.
const CLOCK_DOUBT_S: f64 = 0.02;
/// Nor are those below so many standard uncertainties.
const CLOCK_DOUBT_SIGMA: f64 = 5.0;

/// What a scan says against the configured correction.
fn doubt(scan: &BiasScan, configured_s: f64) -> Option<String> {
    let (best_s, uncertainty_s) = (scan.best_s?, scan.uncertainty_s?);
    let apart_s = (best_s - configured_s).abs();
    (apart_s > CLOCK_DOUBT_S && apart_s > CLOCK_DOUBT_SIGMA * uncertainty_s).then(|| {
        format!(
            "its ranges fit a clock correction of {best_s:+.4} ± {uncertainty_s:.4} s, not the configured \
             {configured_s:+.3} s"
        )
    })
}
