//! Every limit of a site with its largest use: the basis of the verdict, as a table.

use super::{
    AdjustmentEvidence, Check, CheckKind,
    CheckOutcome::{self, Fail, Pass, Warning},
    Evidence, JudgedImage,
    adjustment::{HEIGHT_LOOSE_M, HEIGHT_OUTLIERS_FEW},
    beam, clock_limit_s,
};
use crate::{
    check_heights::HeightCheck, check_ranges::ProfileRanges, compare_pairs::PairComparison,
    orientation::InterpolationCheck,
};
use areograph_base::{terms::Terms, units::RADIANS_PER_ARCSECOND};
use areograph_config::LimitsConfig;
use areograph_geom::surface::WithheldScore;

/// More than this share of rejected tie points makes a site invalid.
const REJECTED_SHARE_FAIL: f64 = 0.5;

/// Altimeter clocks are off by a tenth of a second (MOLA: 0.117 s): a scan with a wider limit cannot distinguish that
/// from zero.
const CLOCK_BLIND_S: f64 = 0.1;

/// Withheld stretches may exceed the stated share by this many standard deviations of their number, and by one.
const CHANCE_SIGMAS: f64 = 3.0;

/// A quantity that is checked for each profile or image, with its function and its limit.
type Quantity<T> = (CheckKind, fn(&T) -> f64, f64);

/// All checks.
pub(super) fn checks(evidence: &Evidence<'_>) -> Vec<Check> {
    let mut checks = Vec::new();
    if let Some(footprints) = evidence.footprints {
        checks.push(Check::new(
            CheckKind::Footprints,
            "",
            footprints as f64,
            1.0,
            Fail,
        ));
    }
    if evidence.adjustment_failure.is_some() {
        checks.push(Check::without_number(CheckKind::AdjustmentMade, "", Fail));
    }
    let images = evidence.images.iter();
    let contradicted = images.filter(|image| image.contradictions().next().is_some());
    checks.extend(
        contradicted.map(|image| Check::without_number(CheckKind::Contradiction, image.id(), Fail)),
    );
    checks.extend(withheld(evidence));
    checks.extend(of_ranges(evidence));
    checks.extend(clock(evidence));
    checks.extend(beam::checks(evidence));
    let adjusted = evidence
        .adjustment
        .iter()
        .flat_map(|adjustment| adjustment.images);
    checks.extend(of_images(evidence, adjusted));
    if let Some(adjustment) = &evidence.adjustment {
        checks.extend(of_heights(adjustment, evidence));
        checks.extend(of_ties(adjustment, evidence));
    }
    checks.extend(evidence.findings.iter().flat_map(|of| of.checks.clone()));
    let skipped = evidence.complaints.len();
    if skipped > 0 {
        checks.push(Check::new(
            CheckKind::SkippedRecords,
            "",
            skipped as f64,
            0.0,
            Warning,
        ));
    }
    checks
}

/// Withheld profiles against the surface of the others; a few stretches more than stated are chance.
fn withheld(evidence: &Evidence<'_>) -> Option<Check> {
    let score = evidence.profiles.score?;
    let stretches = score.stretches as f64;
    let beyond = 1.0 - WithheldScore::INTERVALS[2];
    let chance = (beyond * (1.0 - beyond) / stretches).sqrt();
    let limit = beyond + CHANCE_SIGMAS * chance + 1.0 / stretches;
    let share = 1.0 - score.inside[2];
    Some(Check::of_share(
        CheckKind::WithheldStretches,
        format!("{} stretches", score.stretches),
        share,
        limit,
        Warning,
    ))
}

fn of_ranges(evidence: &Evidence<'_>) -> Vec<Check> {
    let limits = evidence.range_limits;
    let judged = || {
        let profiles = evidence.ranges.profiles.iter();
        profiles.filter(|profile| profile.is_judged(limits))
    };
    let quantities: [Quantity<ProfileRanges>; 3] = [
        (
            CheckKind::RangeMean,
            |of| of.mean_without_outliers_m,
            limits.mean_max_m,
        ),
        (
            CheckKind::OrbitsApart,
            ProfileRanges::orbits_apart_m,
            limits.orbit_max_m,
        ),
        (
            CheckKind::Decoding,
            |of| of.decoding_without_outliers_m,
            limits.decoding_max_m,
        ),
    ];
    // Shots of tables may have only their own spacecraft position, or none.
    let measured = |kind: CheckKind, of: &ProfileRanges| match kind {
        CheckKind::OrbitsApart => of.spacecraft_m[0].n > 0,
        CheckKind::Decoding => of.decoding_m.n > 0,
        _ => of.range_minus_distance_m.n > 0,
    };
    let worst = |kind: CheckKind, value: &dyn Fn(&ProfileRanges) -> f64, limit: f64| {
        let profiles = judged().filter(|of| measured(kind, of));
        Check::worst(profiles.map(|of| {
            let limit = match kind {
                CheckKind::RangeMean => of.mean_max_m(limits),
                _ => limit,
            };
            Check::new(kind, &*of.profile, value(of), limit, Fail)
        }))
    };
    let mut checks: Vec<Option<Check>> = quantities
        .into_iter()
        .map(|(kind, value, limit)| worst(kind, &value, limit))
        .collect();
    let outliers = judged().filter(|of| of.is_tested()).map(|of| {
        let share = f64::from(of.outliers) / f64::from(of.shots.max(1));
        let limit = limits.outlier_share_max;
        Check::of_share(CheckKind::RangeOutliers, &*of.profile, share, limit, Fail)
    });
    checks.push(Check::worst(outliers));
    checks.extend(of_lengths(evidence));
    checks.into_iter().flatten().collect()
}

/// Whether a profile is long enough to be judged, and whether ranges are tested at all.
fn of_lengths(evidence: &Evidence<'_>) -> [Option<Check>; 2] {
    let profiles = &evidence.ranges.profiles;
    let tested = evidence.is_tested();
    let shots = evidence.longest_profile().map(|longest| {
        let least = f64::from(evidence.range_limits.shots_min);
        let broken = if tested { Fail } else { Warning };
        Check::new(
            CheckKind::Shots,
            &*longest.profile,
            f64::from(longest.shots),
            least,
            broken,
        )
    });
    let untested = (!tested && !profiles.is_empty()).then(|| {
        let subject = "not tested: no spacecraft position";
        Check::without_number(CheckKind::RangeMean, subject, Warning)
    });
    [untested, shots]
}

/// The clock correction by the ranges against the configured one.
fn clock(evidence: &Evidence<'_>) -> Option<Check> {
    let kind = CheckKind::ClockCorrection;
    let profiles = || evidence.ranges.profiles.iter();
    let scans = profiles().filter_map(|profile| {
        let scan = profile.scan.as_ref()?;
        let (best_s, uncertainty_s) = (scan.best_s?, scan.uncertainty_s?);
        let limit_s = clock_limit_s(uncertainty_s);
        let apart_s = best_s - evidence.clock_correction_s;
        // A limit as wide as the bias cannot detect that the bias was omitted.
        let is_blind = limit_s > CLOCK_BLIND_S && apart_s.abs() <= limit_s;
        (!is_blind).then(|| Check::new(kind, &*profile.profile, apart_s, limit_s, Warning))
    });
    let is_scanned = profiles().any(|profile| profile.scan.is_some());
    // Shots of one viewing direction hardly determine the clock: this is stated, without a warning.
    let silent =
        is_scanned.then(|| Check::without_number(kind, "not determined by these ranges", Pass));
    Check::worst(scans).or(silent)
}

fn of_images<'a>(
    evidence: &'a Evidence<'_>,
    adjusted: impl Iterator<Item = &'a JudgedImage<'a>>,
) -> Vec<Check> {
    let images: Vec<(String, &JudgedImage)> = evidence
        .images
        .iter()
        .map(|image| (image.id().to_owned(), image))
        .chain(adjusted.map(|image| (format!("{}, adjusted", image.id()), image)))
        .collect();
    let limits = evidence.orientation_limits;
    let quantities: [Quantity<JudgedImage>; 3] = [
        (
            CheckKind::PositionRmse,
            |image| image.model.misfit.position_rmse_m,
            limits.position_rmse_max_m,
        ),
        (
            CheckKind::PointingRmse,
            |image| image.model.misfit.pointing_rmse_rad / RADIANS_PER_ARCSECOND,
            limits.pointing_rmse_max_rad / RADIANS_PER_ARCSECOND,
        ),
        (
            CheckKind::TableError,
            |image| image.orientation.tables.interpolation.error_max_px,
            InterpolationCheck::LIMIT_PX,
        ),
    ];
    let mut checks: Vec<Check> = quantities
        .into_iter()
        .filter_map(|(kind, value, limit)| {
            // Where the tables are the only source, their interpolation has no reference.
            let known = |image: &JudgedImage| {
                kind != CheckKind::TableError || image.orientation.tables.interpolation.epochs > 0
            };
            let each = images.iter().filter(|(_, image)| known(image));
            Check::worst(each.map(|(id, of)| Check::new(kind, &**id, value(of), limit, Fail)))
        })
        .collect();
    let attitudes = evidence.images.iter().map(|image| {
        let outcome = if !image.orientation.invalid_because.is_empty() {
            Fail
        } else if image.orientation.notes.is_empty() {
            Pass
        } else {
            Warning
        };
        Check::without_number(CheckKind::Attitude, image.id(), outcome)
    });
    checks.extend(Check::worst(attitudes));
    checks
}

fn of_heights(of: &AdjustmentEvidence<'_>, evidence: &Evidence<'_>) -> Vec<Check> {
    let (limits, altimeter) = (evidence.limits, evidence.terms.altimeter);
    let median = |kind: CheckKind, check: &HeightCheck, limit_m: f64| match &check.surface {
        Ok(_) => {
            let takes_part = kind == CheckKind::HeightAfter && of.adjusted.heights.is_some();
            let subject = if takes_part {
                format!("{altimeter} takes part")
            } else {
                String::new()
            };
            Check::new(kind, subject, check.above_m.median, limit_m, Fail)
        }
        Err(_) => Check::without_number(kind, format!("no {altimeter} surface"), Warning),
    };
    let mut checks = vec![
        median(
            CheckKind::HeightBefore,
            of.heights,
            limits.height_before_max_m,
        ),
        median(
            CheckKind::HeightAfter,
            of.adjusted_heights,
            of.height_after_max_m(limits),
        ),
    ];
    if let Some(apart) = &of.heights.apart {
        checks.push(Check::new(
            CheckKind::ProfilesApart,
            apart.profiles.join(" and "),
            apart.mean_m / apart.sigma_m,
            apart.limit(limits.profiles_apart_max_sigma),
            Fail,
        ));
    }
    if let Some(heights) = &of.adjusted.heights {
        let share = heights.beyond_share();
        let limit = limits.height_outliers_max;
        let mut outliers = Check::of_share(CheckKind::HeightOutliers, "", share, limit, Fail);
        if outliers.outcome == Pass && share > HEIGHT_OUTLIERS_FEW {
            outliers.outcome = Warning;
        }
        checks.push(outliers);
        let [_, _, up_m] = heights.mean_sigma_m;
        checks.push(Check::new(
            CheckKind::HeightSigma,
            "",
            up_m,
            HEIGHT_LOOSE_M,
            Warning,
        ));
    }
    checks
}

fn of_ties(of: &AdjustmentEvidence<'_>, evidence: &Evidence<'_>) -> Vec<Check> {
    let limits = evidence.limits;
    let apart = |kind: CheckKind, pairs: &[PairComparison], limit_m: f64| {
        Check::worst(pairs.iter().map(|pair| {
            let name = pair.images.join(" and ");
            Check::new(kind, name, pair.along_track_parallax_m, limit_m, Fail)
        }))
    };
    let mut checks: Vec<Check> = [
        apart(
            CheckKind::ParallaxBefore,
            of.pairs,
            limits.parallax_before_max_m,
        ),
        apart(
            CheckKind::ParallaxAfter,
            of.adjusted_pairs,
            limits.parallax_after_max_m,
        ),
    ]
    .into_iter()
    .flatten()
    .collect();
    let axes = [CheckKind::TieResidualsAlong, CheckKind::TieResidualsAcross];
    checks.extend(of.axes().zip(axes).map(|(axis, kind)| match axis {
        Some(found) => Check::new(kind, "", found, limits.sigma0_max, Warning),
        None => Check::without_number(kind, "untested: no redundancy", Warning),
    }));
    checks.extend(components(of, &evidence.terms));
    checks.extend(joined(of));
    let share = of.left_out() as f64 / of.ties.multi_image().max(1) as f64;
    let broken = if share > REJECTED_SHARE_FAIL {
        Fail
    } else {
        Warning
    };
    checks.push(rejected(share, limits.rejected_share_max, broken));
    checks.push(Check::new(
        CheckKind::TiesUsed,
        "",
        of.taken() as f64,
        f64::from(limits.ties_min),
        Warning,
    ));
    let corrections = of.largest_corrections().map(|of| of.check(limits));
    checks.extend(Check::worst(corrections));
    checks.extend(boresight(of, limits));
    checks
}

/// The variance component, among the other kinds of observation, that uses the largest share of what chance explains.
/// The subject also has the components below their interval: these are no fault, but the page shows them.
fn components(of: &AdjustmentEvidence<'_>, terms: &Terms<'_>) -> Option<Check> {
    let kind = CheckKind::VarianceComponents;
    let below: Vec<String> = of
        .other_components()
        .filter(|found| found.is_below_chance())
        .map(|found| {
            let [least, _] = found.variance_component_limits;
            let value = found.variance_component;
            format!(
                "{} {value:.3}, by chance at least {least:.2}",
                terms.fill(found.kind.words())
            )
        })
        .collect();
    let tested = of.other_components().map(|found| {
        let [_, most] = found.variance_component_limits;
        Check::new(
            kind,
            terms.fill(found.kind.words()),
            found.variance_component,
            most,
            Warning,
        )
    });
    let mut check = Check::worst(tested)?;
    if !below.is_empty() {
        check.subject.push_str("; below their interval: ");
        check.subject.push_str(&below.join("; "));
    }
    Some(check)
}

/// Numbers of images and pairs that the adjustment joins, and those that it does not join.
fn joined(of: &AdjustmentEvidence<'_>) -> [Check; 2] {
    let check = |kind: CheckKind, all: usize, without: &[String], broken: CheckOutcome| {
        let subject = match without {
            [] => String::new(),
            without => format!("not {}", without.join(", ")),
        };
        let joined = (all - without.len()) as f64;
        Check::new(kind, subject, joined, all as f64, broken)
    };
    let (images, pairs) = (of.adjusted.images.len(), of.pairs.len());
    [
        check(CheckKind::ImagesJoined, images, &of.untied(), Warning),
        check(CheckKind::PairsJoined, pairs, &of.parted(), Fail),
    ]
}

/// The boresight of the laser, where `adjustment.common_bus` is set.
fn boresight(of: &AdjustmentEvidence<'_>, limits: &LimitsConfig) -> Option<Check> {
    let Ok(found) = of.adjusted.boresight.as_ref()? else {
        return Some(Check::without_number(CheckKind::Boresight, "", Warning));
    };
    let is_clear = found.without.is_empty() && of.spots_beyond().is_none();
    let Some((unknown, sigmas)) = found.farthest.as_ref() else {
        return (!is_clear).then(|| Check::without_number(CheckKind::Boresight, "", Warning));
    };
    let limit = limits.correction_max_sigma;
    let mut check = Check::new(CheckKind::Boresight, unknown, *sigmas, limit, Fail);
    if check.outcome == Pass && !is_clear {
        check.outcome = Warning;
    }
    Some(check)
}

/// Rejected tie points: a share above the limit is a warning, more than half a failure, whatever the limit.
fn rejected(share: f64, limit: f64, broken: CheckOutcome) -> Check {
    let mut check = Check::of_share(CheckKind::TiesRejected, "", share, limit, broken);
    if broken == Fail {
        check.outcome = Fail;
    }
    check
}
