//! Verdict on an adjustment: by MOLA first, then by agreement between the images, then by a priori values.

use super::{AdjustmentEvidence, Evidence, JudgedImage};
use crate::{
    adjust::{HEIGHTS_MIN, HeightSummary, ObservationType, PointKind, ReliefChoice, TypeSummary},
    compare_pairs::PairComparison,
};
use areograph_base::{footprints::AdjustmentModel, minus::signed, terms::Terms};
use areograph_config::LimitsConfig;
use areograph_geom::{
    readings::Cause,
    statistics::{NORMAL_MAD, median},
};

/// Mean heights with a larger standard deviation than this, metres, are hardly controlled.
pub(super) const HEIGHT_LOOSE_M: f64 = 20.0;
/// Craters between the profiles explain a smaller share of outliers among the tie points than this.
pub(super) const HEIGHT_OUTLIERS_FEW: f64 = 0.03;
/// A larger share of laser spots beyond their limit is not due to chance, which leaves one in a thousand there.
const SPOTS_BEYOND_FEW: f64 = 0.05;
/// Where tie points fit better than this share of their standard deviations, the limit of blunders is too wide. Points measured to
/// 0.2 px with the default standard deviation of 1 px are above it.
const TIES_LOOSE: f64 = 0.15;
/// Scatter of tie points in addition to their standard deviations, focal-plane pixels, that jitter rarely causes.
pub(super) const SCATTER_LARGE_PX: f64 = 1.0;
/// A mean height within this many of its standard deviations is no contradiction.
const HEIGHT_SIGMAS: f64 = 3.0;

impl AdjustmentEvidence<'_> {
    /// Reasons why the adjusted orientation is invalid, one sentence each: MOLA first, then agreement between the
    /// images, then a priori values.
    pub(super) fn invalid_because(&self, evidence: &Evidence<'_>) -> Vec<String> {
        let limits = evidence.limits;
        let mut invalid = self.heights_off(evidence);
        let reasons = |image: &JudgedImage| -> Vec<String> {
            let id = image.id();
            // Faults of the orientation from the kernels are reported with it.
            let of_model = image.model.invalid_because.iter();
            of_model
                .map(|reason| format!("adjusted image {id}: {reason}"))
                .collect()
        };
        invalid.extend(self.images.iter().flat_map(reasons));
        let (left_out, ties) = (self.left_out(), self.ties.multi_image());
        if 2 * left_out > ties {
            invalid.push(format!(
                "adjustment: {left_out} of {ties} tie points were rejected; ties.parquet states the reasons"
            ));
        }
        let rounds = [
            ("before", self.pairs, limits.parallax_before_max_m),
            ("after", self.adjusted_pairs, limits.parallax_after_max_m),
        ];
        let parted = self.parted();
        if !parted.is_empty() {
            invalid.push(format!(
                "no tie point of {} was used in the adjustment: check the labels of these images, and the tie points \
                 in ties.parquet",
                parted.join("; ")
            ));
        }
        let heights = self.adjusted.heights.iter();
        let spread =
            heights.filter(|heights| !(heights.beyond_share() <= limits.height_outliers_max));
        invalid.extend(spread.map(|heights| heights_beyond(heights, &evidence.terms)));
        for (round, pairs, limit_m) in rounds {
            for pair in pairs.iter().filter(|pair| !is_together(pair, limit_m)) {
                invalid.push(format!(
                    "tie-point positions from {} and {} differ by {:.1} m along the flight {round} the adjustment; \
                     expected at most {limit_m} m",
                    pair.images[0], pair.images[1], pair.along_track_parallax_m
                ));
            }
        }
        invalid.extend(self.corrected_too_far(limits));
        invalid.extend(self.laser_elsewhere(limits));
        invalid
    }

    /// A laser that contradicts its mounting or its profile.
    fn laser_elsewhere(&self, limits: &LimitsConfig) -> Option<String> {
        let boresight = self.adjusted.boresight.as_ref()?.as_ref().ok()?;
        let (unknown, sigmas) = boresight.farthest.as_ref()?;
        let limit = limits.correction_max_sigma;
        // Written so that NaN counts.
        (!(*sigmas <= limit)).then(|| {
            format!(
                "laser and images contradict each other: the {unknown} differs by {sigmas:.1} standard deviations from \
                 its a priori value; expected at most {limit}; check beam.bus of the altimeter, altimeter_clock and \
                 the image times, or omit adjustment.common_bus"
            )
        })
    }

    /// Images without laser control, where `adjustment.common_bus` is set.
    fn laser_missing(&self) -> Option<String> {
        match self.adjusted.boresight.as_ref()? {
            Err(reason) => Some(format!("adjustment.common_bus has no effect: {reason}")),
            Ok(boresight) if !boresight.without.is_empty() => Some(format!(
                "adjustment.common_bus does not control {}: no shot of a profile was fired during the exposure",
                boresight.without.join(", ")
            )),
            Ok(_) => None,
        }
    }

    /// The laser spots in the images, if so many do not fit that some shots must be wrong.
    pub(super) fn spots_beyond(&self) -> Option<&TypeSummary> {
        let mut types = self.adjusted.summary.types.iter();
        let spots = types.find(|of| of.kind == ObservationType::LaserSpot)?;
        let few = SPOTS_BEYOND_FEW * spots.observations as f64;
        (spots.beyond_limit as f64 > few).then_some(spots)
    }

    /// Spots that do not fit.
    fn spots_spoiled(&self) -> Option<String> {
        self.spots_beyond().map(|spots| {
            format!(
                "residuals of {} of {} image coordinates of laser spots exceed 3.29 standard deviations: some shots \
                 are recorded at a wrong position, or profiles and line times are less accurate than configured",
                spots.beyond_limit, spots.observations
            )
        })
    }

    /// The limit on heights after the adjustment, at least `HEIGHT_SIGMAS` standard deviations of their mean.
    pub(super) fn height_after_max_m(&self, limits: &LimitsConfig) -> f64 {
        let by_chance_m = HEIGHT_SIGMAS * self.adjusted_heights.mean_sigma_m;
        limits.height_after_max_m.max(by_chance_m)
    }

    /// Contradictions between MOLA and the heights of tie points.
    fn heights_off(&self, evidence: &Evidence<'_>) -> Vec<String> {
        let (limits, altimeter) = (evidence.limits, evidence.terms.altimeter);
        let after_max_m = self.height_after_max_m(limits);
        let rounds = [
            ("before", self.heights, limits.height_before_max_m),
            ("after", self.adjusted_heights, after_max_m),
        ];
        let mut reasons = Vec::new();
        for (round, check, limit_m) in rounds {
            // Written so that NaN counts.
            if check.surface.is_ok() && !(check.above_m.median.abs() <= limit_m) {
                reasons.push(format!(
                    "tie points lie {} m above the {altimeter} surface {round} the adjustment (median of {}); expected \
                     at most ±{limit_m:.1} m",
                    signed(check.above_m.median, 1),
                    check.above_m.n
                ));
            }
        }
        if let Some(apart) = &self.heights.apart {
            let (sigmas, limit) = (apart.sigmas(), apart.limit(limits.profiles_apart_max_sigma));
            if !(sigmas <= limit) {
                reasons.push(format!(
                    "profiles {} and {} contradict each other: their surfaces at the tie points differ by {:.1} m on \
                     average, {sigmas:.1} standard deviations; expected at most {limit:.1}",
                    apart.profiles[0],
                    apart.profiles[1],
                    apart.mean_m.abs(),
                ));
            }
        }
        reasons
    }

    /// Remarks on heights that MOLA controls, but not well.
    fn heights_loose(&self, evidence: &Evidence<'_>) -> Vec<String> {
        let Some(heights) = &self.adjusted.heights else {
            return Vec::new();
        };
        let (limits, altimeter) = (evidence.limits, evidence.terms.altimeter);
        let mut remarks = Vec::new();
        if !heights.settled {
            remarks.push(format!(
                "heights of tie points, and the {altimeter} surface under them, had not converged when the adjustment \
                 ended: these heights are less certain than stated"
            ));
        }
        let [_, _, up_m] = heights.mean_sigma_m;
        if !(up_m <= HEIGHT_LOOSE_M) {
            remarks.push(format!(
                "{altimeter} controls heights only to ±{up_m:.0} m: the tie points lie far from its shots, or the a priori \
                 standard deviations in laser_surface are large"
            ));
        }
        let share = heights.beyond_share();
        if share > HEIGHT_OUTLIERS_FEW && share <= limits.height_outliers_max {
            remarks.push(heights_beyond(heights, &evidence.terms));
        }
        if heights.compared < HEIGHTS_MIN {
            remarks.push(format!(
                "{} tie points are too few for the detection of blunders from their heights",
                heights.compared
            ));
        }
        remarks
    }

    /// Tie points used in the adjustment.
    pub(super) fn taken(&self) -> usize {
        let points = self.adjusted.points.iter();
        points.filter(|point| point.kind == PointKind::Tie).count()
    }

    /// Tie points that join images, but took no part.
    pub(super) fn left_out(&self) -> usize {
        self.ties.multi_image().saturating_sub(self.taken())
    }

    /// Standard deviation of unit weight of tie points along and across the track; `None` where they fit, but without
    /// redundancy.
    pub(super) fn axes(&self) -> impl Iterator<Item = Option<f64>> {
        let summary = &self.adjusted.summary;
        let kinds = [ObservationType::TieAlong, ObservationType::TieAcross];
        kinds
            .into_iter()
            .zip(summary.tie_components)
            .map(|(kind, found)| {
                let of_kind = summary.types.iter().find(|of| of.kind == kind);
                let is_untested =
                    found <= 1.0 && of_kind.is_none_or(|of_kind| of_kind.redundancy < 1.0);
                (!is_untested).then_some(found)
            })
    }

    /// Median residual of tie points along the track over its expectation, where it is so small that blunders stay undetected. The
    /// median resists these.
    fn loose_ties(&self) -> Option<f64> {
        let ties = self.adjusted.views.iter();
        let along = ties.filter(|view| view.kind == PointKind::Tie);
        let mut sizes: Vec<f64> = along
            .filter_map(|view| view.along_px.standardised.map(f64::abs))
            .collect();
        if sizes.is_empty() {
            return None;
        }
        let found = NORMAL_MAD * median(&mut sizes);
        (found < TIES_LOOSE).then_some(found)
    }

    /// Kinds of observation other than tie points with enough redundancy for a test.
    pub(super) fn other_components(&self) -> impl Iterator<Item = &TypeSummary> {
        let types = self.adjusted.summary.types.iter();
        let others = types.filter(|of| {
            !matches!(
                of.kind,
                ObservationType::TieAlong | ObservationType::TieAcross
            )
        });
        others.filter(|of| of.variance_component_limits[1] > 0.0)
    }

    /// Kinds of observation whose residuals are larger than chance explains.
    fn components_above(&self, terms: &Terms<'_>) -> impl Iterator<Item = String> {
        let above = self.other_components().filter(|of| of.is_above_chance());
        above.map(|of| {
            let [_, most] = of.variance_component_limits;
            format!(
                "the variance component of {} is {:.2}, by chance at most {most:.2}: the a priori standard deviations \
                 are too small, or a model is incorrect",
                terms.fill(of.kind.words()),
                of.variance_component
            )
        })
    }

    /// Images without a tie point in the adjustment.
    pub(super) fn untied(&self) -> Vec<String> {
        let images = self.adjusted.images.iter().enumerate();
        images
            .filter(|(index, _)| !self.adjusted.is_tied(*index))
            .map(|(_, image)| image.id.clone())
            .collect()
    }

    /// Pairs of images none of whose tie points took part.
    pub(super) fn parted(&self) -> Vec<String> {
        let is_adjusted = |pair: &PairComparison| {
            self.adjusted_pairs
                .iter()
                .any(|adjusted_pair| adjusted_pair.images == pair.images)
        };
        let pairs = self.pairs.iter().filter(|pair| !is_adjusted(pair));
        pairs.map(|pair| pair.images.join(" and ")).collect()
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

    /// The decision on the cause of along-track disagreements that positions depend on, one sentence.
    fn cause_of_disagreement(&self, evidence: &Evidence<'_>) -> Option<String> {
        let by_clock = self.adjusted.attitude_clock_s.is_some();
        let readings = evidence.beam.adjustment.readings.as_ref();
        let is_used = self.adjusted.summary.model == AdjustmentModel::MolaSurface;
        let Some(readings) = readings.filter(|_| is_used) else {
            return by_clock.then(|| {
                "positions depend on adjustment.attitude_clock, an interpretation of the disagreement between the \
                 images that no measurement tests; the report also gives the other interpretation"
                    .to_owned()
            });
        };
        let (pairs, supports, decides) = match readings.pairs {
            1 => ("1 pair of images".to_owned(), "supports", "does not decide"),
            pairs => (
                format!("{pairs} pairs of images"),
                "support",
                "do not decide",
            ),
        };
        // Of a supported cause it is positive.
        let odds = readings.log_odds_of_supported() / std::f64::consts::LN_10;
        Some(match readings.supported {
            Some(Cause::AttitudeClock) => format!(
                "positions depend on adjustment.readings: {pairs} {supports} one offset of the attitude clock (odds 10^{odds:.1} to 1); the \
                 report also gives the other interpretation"
            ),
            Some(Cause::SingleImages) => format!(
                "positions depend on adjustment.readings: {pairs} {supports} independent errors of single images (odds 10^{odds:.1} to 1)"
            ),
            None => format!(
                "positions depend on adjustment.readings: {pairs} {decides} the cause of along-track disagreements, \
                 and all images are treated as equally likely to be in error"
            ),
        })
    }

    /// Points that the reader must weigh, one sentence each.
    pub(super) fn remarks(&self, evidence: &Evidence<'_>) -> Vec<String> {
        let limits = evidence.limits;
        let mut remarks = Vec::new();
        let both = self.heights.surface.as_ref();
        match both.and(self.adjusted_heights.surface.as_ref()) {
            Err(reason) => remarks.push(format!(
                "{} does not control heights of tie points ({reason}): these heights are only as accurate as the a \
                 priori orbit and attitude",
                evidence.terms.altimeter
            )),
            Ok(_) => remarks.extend(self.heights_loose(evidence)),
        }
        if self.adjusted.summary.model == AdjustmentModel::Published {
            remarks.push(
                "the adjustment follows the published model (adjustment.model): heights are not controlled, and \
                 standard deviations state only the agreement between the images; across the track, the adjustment \
                 departs from Yoon & Shan 2004 (decision 0010)"
                    .to_owned(),
            );
        }
        remarks.extend(self.cause_of_disagreement(evidence));
        if let Some(Ok(found)) = &self.adjusted.boresight {
            remarks.extend(found.prior.remark());
            remarks.push(
                "across-track positions depend on adjustment.common_bus, which assumes that footprints do not contain \
                 the attitude error of these kernels: footprints computed with the same attitude would agree with the \
                 kernels whatever this error"
                    .to_owned(),
            );
        }
        if let Some(ReliefChoice::Failed(reason)) =
            self.adjusted.relief.as_ref().map(|of| &of.choice)
        {
            remarks.push(format!(
                "the horizontal position does not use relief, because the adjustment with relief failed: {reason}"
            ));
        }
        remarks.extend(self.laser_missing());
        remarks.extend(self.spots_spoiled());
        let (left_out, ties) = (self.left_out(), self.ties.multi_image());
        let share = limits.rejected_share_max;
        if left_out as f64 > share * ties as f64 && 2 * left_out <= ties {
            remarks.push(format!(
                "{left_out} of {ties} tie points were rejected in the adjustment; ties.parquet states the reasons"
            ));
        }
        let taken = self.taken();
        if taken < limits.ties_min as usize {
            remarks.push(format!(
                "only {taken} tie points were used in the adjustment; expected at least {}",
                limits.ties_min
            ));
        }
        for (found, axis) in self.axes().zip(["along", "across"]) {
            match found {
                // Written so that NaN counts.
                Some(found) if !(found <= limits.sigma0_max) => remarks.push(format!(
                    "the variance component of tie points {axis} the track is {found:.2}; expected at most {}: \
                     measurements are less accurate than configured (adjustment.tie_sigma_px), or a model is incorrect",
                    limits.sigma0_max
                )),
                Some(_) => {}
                None => remarks.push(format!(
                    "tie points have no redundancy {axis} the track: blunders in that direction remain undetected"
                )),
            }
        }
        remarks.extend(self.loose_ties().map(|found| {
            format!(
                "standardised residuals of tie points along the track have a robust standard deviation of {found:.2}; \
                 expected at least {TIES_LOOSE}: blunders of tie points may remain; configure smaller standard \
                 deviations"
            )
        }));
        let scatter_px = self.adjusted.summary.tie_scatter_px;
        if scatter_px > SCATTER_LARGE_PX {
            remarks.push(format!(
                "tie points scatter by {scatter_px:.1} px in addition to their stated standard deviations; attitude \
                 jitter usually causes less than 0.8 px: measurements are less accurate than stated"
            ));
        }
        remarks.extend(self.drifts(limits));
        remarks.extend(self.components_above(&evidence.terms));
        for image in self.untied() {
            remarks.push(format!(
                "image {image} has no tie point in the adjustment: no measurement tests or corrects its orientation"
            ));
        }
        remarks
    }
}

fn is_together(pair: &PairComparison, limit_m: f64) -> bool {
    // Written so that NaN counts as apart.
    pair.along_track_parallax_m.abs() <= limit_m
}

fn heights_beyond(heights: &HeightSummary, terms: &Terms<'_>) -> String {
    let rejected = match heights.rejected {
        0 => String::new(),
        count => format!(", {count} more were rejected for this reason"),
    };
    format!(
        "{} of {} tie points lie farther from the {} surface than their standard deviations allow{rejected}: \
         across-track measurement errors shift heights by more than stated; height_check.parquet lists these points",
        heights.beyond_limit, heights.compared, terms.altimeter
    )
}
