//! The verdict on a match.

use super::{
    result::{HeldOut, UnitResult, Widened},
    similarity::Similarity,
};
use crate::judge::{
    Check, CheckKind,
    CheckOutcome::{Fail, Pass, Warning},
    Verdict,
};

/// Minimum number of units: the control points that a calibration needs, and as many withheld ones.
const UNITS_MIN: usize = 10;
/// Smallest share of the matching units that must agree with each other: few chance shifts do.
const AGREE_MIN: f64 = 0.5;
/// Concordance treats a bias as a misfit and moves to where there is less of it: on synthetic ground a bias of 0.4 of
/// the relief displaces shifts by more than a cell (median), where correlation is off by less than half
/// (`tests/stages/match_laser.rs`). Up to this share of the relief a bias costs half a per cent of similarity; the
/// limit never exceeds this many metres (the fact sheet's limit).
const BIAS_SHARE: f64 = 0.1;
const BIAS_MAX_M: f64 = 100.0;
/// Widening of standard deviations above which a remark states it.
const WIDENED_MAX: f64 = 2.0;
/// Difference between the two spheres in use for Mars, and tolerance within which a bias is attributed to it, metres.
const SPHERES_M: [f64; 2] = [190.0, 25.0];

/// The held-out shots of all kept units.
pub(super) fn pooled(units: &[UnitResult]) -> Option<HeldOut> {
    let held_out = units.iter().filter(|unit| unit.is_kept());
    let held_out: Vec<HeldOut> = held_out.filter_map(|unit| unit.held_out).collect();
    let shots: usize = held_out.iter().map(|of| of.shots).sum();
    let rms = |of: fn(&HeldOut) -> f64| {
        let squares = held_out
            .iter()
            .map(|one| one.shots as f64 * of(one).powi(2));
        (squares.sum::<f64>() / shots as f64).sqrt()
    };
    (shots > 0).then(|| HeldOut {
        shots,
        before_m: rms(|of| of.before_m),
        after_m: rms(|of| of.after_m),
    })
}

/// The largest bias, median over units by correlation, at which concordance is usable, metres; for the median relief of
/// these units.
pub(super) fn bias_limit_m(relief_m: f64) -> f64 {
    (BIAS_SHARE * relief_m).min(BIAS_MAX_M)
}

/// The evidence on which a match is judged.
pub(super) struct Evidence<'a> {
    pub(super) units: &'a [UnitResult],
    /// Units that match, before rejection of those that do not agree with the others.
    pub(super) matching: usize,
    pub(super) similarity: Similarity,
    /// Median of model minus laser by correlation, and the largest bias at which concordance is usable, metres.
    pub(super) located_m: Option<[f64; 2]>,
    /// Whether the measure was chosen by this bias.
    pub(super) is_auto: bool,
    pub(super) held_out: Option<HeldOut>,
    pub(super) widened: Option<Widened>,
    /// Limit on held-out shots.
    pub(super) limit_m: f64,
    /// Whether the reference radius of the model's heights is stated.
    pub(super) radius_is_stated: bool,
    pub(super) complaints: u64,
}

/// Judges a match.
pub(super) fn judge(of: &Evidence<'_>) -> Verdict {
    let kept = of.units.iter().filter(|unit| unit.is_kept()).count();
    let (mut reasons, mut remarks) = (Vec::new(), Vec::new());
    if kept < UNITS_MIN {
        reasons.push(format!(
            "{kept} of {} units are kept; expected at least {UNITS_MIN}: see the reasons for the rejection of the other units",
            of.units.len()
        ));
    }
    let matching = of.matching;
    if (kept as f64) < AGREE_MIN * matching as f64 {
        reasons.push(format!(
            "{kept} of {matching} matching units agree with each other; expected at least half: the other units match \
             by chance, and the agreeing units may also match by chance"
        ));
    }
    if let Some(held_out) = &of.held_out
        && !(held_out.after_m <= of.limit_m)
    {
        reasons.push(format!(
            "{} held-out shots differ from the model by {:.1} m (root mean square, bias removed); expected at most {} m",
            held_out.shots, held_out.after_m, of.limit_m
        ));
    }
    if let Some(located_m) = of.located_m {
        let (wrong, doubt) = bias(located_m, of);
        reasons.extend(wrong);
        remarks.extend(doubt);
    }
    remarks.extend(of.widened.and_then(scattered));
    let refused = of.units.len() - kept;
    if refused > 0 {
        remarks.push(format!(
            "units rejected, with reasons: {refused} of {}",
            of.units.len()
        ));
    }
    if of.complaints > 0 {
        remarks.push(format!(
            "records and points skipped or rejected, with reasons: {}",
            of.complaints
        ));
    }
    Verdict::of(reasons, remarks, checks(of, kept))
}

fn checks(of: &Evidence<'_>, kept: usize) -> Vec<Check> {
    let mut checks = vec![Check::new(
        CheckKind::UnitsKept,
        "",
        kept as f64,
        UNITS_MIN as f64,
        Fail,
    )];
    if of.matching > 0 {
        let share = kept as f64 / of.matching as f64;
        checks.push(Check::of_share(
            CheckKind::UnitsAgree,
            "",
            share,
            AGREE_MIN,
            Fail,
        ));
    }
    checks.extend(of.held_out.map(|held_out| {
        Check::new(
            CheckKind::HeldOutShots,
            "",
            held_out.after_m,
            of.limit_m,
            Fail,
        )
    }));
    checks.extend(of.located_m.map(|[bias_m, limit_m]| {
        // Correlation is insensitive to bias.
        let broken = match of.similarity {
            Similarity::Ccc => Fail,
            Similarity::Pearson if of.is_auto => Warning,
            _ => Pass,
        };
        Check::new(CheckKind::ModelBias, "", bias_m, limit_m, broken)
    }));
    checks
}

/// The remark that units scatter far more than their shots predict, if they do.
fn scattered(widened: Widened) -> Option<String> {
    let Widened { shift, bias } = widened;
    (shift.max(bias) > WIDENED_MAX).then(|| {
        format!(
            "shifts and biases of units scatter more than predicted from their shots (shifts {shift:.1} times, biases \
             {bias:.1} times): the shots of a unit share a model error; standard deviations are multiplied by these \
             factors"
        )
    })
}

/// Reason and remark on a bias.
fn bias([bias_m, limit_m]: [f64; 2], of: &Evidence<'_>) -> (Option<String>, Option<String>) {
    let lies = format!(
        "the bias of the model is {bias_m:.0} m (median of the kept units, from correlation)"
    );
    let [apart_m, near_m] = SPHERES_M;
    if !of.radius_is_stated && (bias_m.abs() - apart_m).abs() <= near_m {
        let wrong = format!(
            "{lies}: the spheres of 3396000 m and 3396190 m, both in use as height references for Mars, differ by this \
             amount; state the sphere with --radius-m"
        );
        return (Some(wrong), None);
    }
    let is_beyond = bias_m.abs() > limit_m;
    match of.similarity {
        Similarity::Ccc if is_beyond => {
            let wrong = format!(
                "{lies}, and concordance does not remove it: a bias beyond {limit_m:.0} m distorts the shifts; check \
                 the reference sphere of the heights, or use --similarity auto"
            );
            (Some(wrong), None)
        }
        Similarity::Pearson if of.is_auto => {
            let doubt = format!(
                "{lies}, more than the {limit_m:.0} m up to which concordance is usable: units were matched by correlation, which \
                 is insensitive to bias"
            );
            (None, Some(doubt))
        }
        _ => (None, None),
    }
}
