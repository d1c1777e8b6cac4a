//! Verdict on all ranges of a site: by the profiles that are long enough, where the spacecraft is known.

use super::Evidence;
use crate::check_ranges::ProfileRanges;
use areograph_base::{altimetry::GroundRadius, minus::signed};
use areograph_config::RangeCheckConfig;

/// Short profiles named in a remark; all are counted.
const NAMED_MAX: usize = 3;

impl Evidence<'_> {
    /// Whether any range is compared with a position of the spacecraft.
    pub(super) fn is_tested(&self) -> bool {
        self.ranges.profiles.iter().any(ProfileRanges::is_tested)
    }

    /// The longest profile whose ranges are tested, the first of equal ones; where none is tested, the longest of all.
    pub(super) fn longest_profile(&self) -> Option<&ProfileRanges> {
        let is_tested = self.is_tested();
        let profiles = self.ranges.profiles.iter();
        let compared = profiles.filter(|profile| profile.is_tested() || !is_tested);
        compared.reduce(|longest, profile| {
            if profile.shots > longest.shots {
                profile
            } else {
                longest
            }
        })
    }
}

/// A site none of whose profiles is long enough to be judged.
pub(super) fn invalid_because(evidence: &Evidence<'_>) -> Option<String> {
    let limits = evidence.range_limits;
    let longest = evidence.longest_profile()?;
    (evidence.is_tested() && !longest.is_judged(limits)).then(|| {
        format!(
            "no profile is long enough to be judged: the longest profile with tested ranges, {}, has {} shots; \
             expected at least {}",
            longest.profile, longest.shots, limits.shots_min
        )
    })
}

/// Profiles that are not judged or not tested.
pub(super) fn remarks(evidence: &Evidence<'_>) -> Vec<String> {
    let (profiles, limits) = (&evidence.ranges.profiles, evidence.range_limits);
    let mut remarks = Vec::new();
    let untested = profiles
        .iter()
        .filter(|profile| !profile.is_tested())
        .count();
    if untested > 0 {
        let whose = if untested == profiles.len() {
            "No range is tested".to_owned()
        } else {
            format!(
                "The ranges of {untested} of {} profiles are not tested",
                profiles.len()
            )
        };
        remarks.push(format!(
            "{whose}: the tables contain no spacecraft position, and no kernels cover the shots"
        ));
    }
    let short: Vec<&ProfileRanges> = profiles
        .iter()
        .filter(|profile| !profile.is_judged(limits))
        .collect();
    if !short.is_empty() && short.len() < profiles.len() {
        let shots: u32 = short.iter().map(|of| of.shots).sum();
        let named = short.iter().take(NAMED_MAX).map(|of| &*of.profile);
        let more = if short.len() > NAMED_MAX { ", …" } else { "" };
        remarks.push(format!(
            "profiles with fewer than {} shots, which are not judged: {} with {shots} shots ({}{more})",
            limits.shots_min,
            short.len(),
            named.collect::<Vec<_>>().join(", ")
        ));
    }
    remarks.extend(
        profiles
            .iter()
            .filter_map(|profile| far_off(profile, limits)),
    );
    if evidence.ground == Some(GroundRadius::Corrected) {
        remarks.extend(corrected_too_far(profiles, limits));
    }
    remarks
}

/// Crossover corrections of profiles at nadir that are larger than errors of an orbit, which they correct: the ranges, which take
/// no part in them, confirm the uncorrected radii.
fn corrected_too_far(profiles: &[ProfileRanges], limits: &RangeCheckConfig) -> Vec<String> {
    let correction_m = |of: &ProfileRanges| {
        let [raw, corrected] = [
            of.range_minus_distance_m,
            of.range_minus_distance_crossover_m,
        ];
        corrected.mean - raw.mean
    };
    // Radii of tables without a spacecraft are corrected already; ranges beyond their own limit confirm nothing.
    let profiles = profiles.iter().filter(|of| {
        of.is_judged(limits)
            && !of.is_off_nadir()
            && of.decoding_m.n > 0
            && of.range_minus_distance_m.n > 0
            && of.range_minus_distance_crossover_m.n > 0
            && of.mean_without_outliers_m.abs() <= limits.mean_max_m
    });
    let corrected: Vec<(String, f64)> = profiles
        .map(|of| (format!("profile {}", of.profile), correction_m(of)))
        .collect();
    let count = corrected.len() as f64;
    let sum_m: f64 = corrected.iter().map(|(_, correction_m)| correction_m).sum();
    let all = (
        format!("{count} profiles at nadir, on average"),
        sum_m / count,
    );
    let limit_m = limits.mean_max_m;
    // The limit is one of single orbits, whose errors are independent.
    let single = corrected.into_iter().map(|of| (of, limit_m));
    let tested = single.chain((count > 1.0).then(|| (all, limit_m / count.sqrt())));
    let far = tested.filter(|((_, correction_m), limit_m)| !(correction_m.abs() <= *limit_m));
    far.map(|((subject, correction_m), limit_m)| {
        format!(
            "{subject}: the crossover correction changes radii by {} m, whereas ranges confirm the uncorrected radii; expected at \
             most ±{limit_m:.1} m, the limit for an orbit error (range_check.mean_max_m): check the unit of the crossover residuals, \
             or use uncorrected radii (pedr.crossover)",
            signed(correction_m, 1)
        )
    })
    .collect()
}

/// A profile whose mean is beyond the limit, but does not make the site invalid: it is too short, off nadir, or its radii are
/// corrected by crossovers.
fn far_off(of: &ProfileRanges, limits: &RangeCheckConfig) -> Option<String> {
    let mean_m = of.mean_without_outliers_m;
    let why = if !of.is_judged(limits) {
        "not judged"
    } else if of.decoding_m.n == 0 {
        "radii corrected by crossovers"
    } else {
        "off nadir, where the across-track orbit error contributes"
    };
    let is_open = of.invalid_because.is_empty()
        && (!of.is_judged(limits) || of.mean_max_m(limits) > limits.mean_max_m);
    // Written so that NaN counts.
    (is_open && of.measured() > 0 && !(mean_m.abs() <= limits.mean_max_m)).then(|| {
        format!(
            "profile {}, {why}: mean of range − distance {} m from {} shots; limit ±{} m",
            of.profile,
            signed(mean_m, 3),
            of.measured(),
            limits.mean_max_m
        )
    })
}

#[cfg(test)]
mod tests;
