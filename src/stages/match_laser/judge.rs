//! The verdict on a match.

use super::{
    result::{HeldOut, UnitResult, Widened},
    similarity::Similarity,
};
use crate::stages::judge::{
    Check, CheckKind,
    CheckOutcome::{Fail, Pass, Warning},
    Verdict,
};

/// Fewest units: so many control points a calibration needs, and as many to hold back.
const UNITS_MIN: usize = 10;
/// Share of the units that match by themselves which must agree with each other: of shifts by chance few do.
const AGREE_MIN: f64 = 0.5;
/// Concordance takes a bias for a misfit, and moves to where there is less of it: on synthetic ground a bias of 0.4 of the relief
/// drives shifts off by more than a cell (median), where correlation is off by less than half (`tests/stages/match_laser.rs`). Up to this share of the relief
/// a bias costs half a per cent of similarity; and never beyond so many metres (the fact sheet's limit).
const BIAS_SHARE: f64 = 0.1;
const BIAS_MAX_M: f64 = 100.0;
/// Standard deviations are widened so many times without a word.
const WIDENED_MAX: f64 = 2.0;
/// What the two spheres in use for Mars differ by, and how near a bias is to be taken for it, metres.
const SPHERES_M: [f64; 2] = [190.0, 25.0];

/// Of all kept units the shots that were held out.
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

/// The largest bias, median over units by correlation, at which concordance sees where the model lies, metres; for the median
/// relief of these units.
pub(super) fn bias_limit_m(relief_m: f64) -> f64 {
    (BIAS_SHARE * relief_m).min(BIAS_MAX_M)
}

/// What is known of a match when it is judged.
pub(super) struct Evidence<'a> {
    pub(super) units: &'a [UnitResult],
    /// Units that match by themselves, before those were refused that do not agree with the others.
    pub(super) matching: usize,
    pub(super) similarity: Similarity,
    /// Median of model minus laser by correlation, and the largest at which concordance sees something, metres.
    pub(super) located_m: Option<[f64; 2]>,
    /// Whether the measure was chosen by it.
    pub(super) is_auto: bool,
    pub(super) held_out: Option<HeldOut>,
    pub(super) widened: Option<Widened>,
    /// Limit on held-out shots.
    pub(super) limit_m: f64,
    /// Whether somebody said what heights of the model count from.
    pub(super) radius_is_stated: bool,
    pub(super) complaints: u64,
}

/// Judges a match.
pub(super) fn judge(of: &Evidence<'_>) -> Verdict {
    let kept = of.units.iter().filter(|unit| unit.is_kept()).count();
    let (mut reasons, mut remarks) = (Vec::new(), Vec::new());
    if kept < UNITS_MIN {
        reasons.push(format!(
            "{kept} of {} units are kept; expected at least {UNITS_MIN}: see the reasons of the others",
            of.units.len()
        ));
    }
    let matching = of.matching;
    if (kept as f64) < AGREE_MIN * matching as f64 {
        reasons.push(format!(
            "of {matching} units that match {kept} agree with each other; expected half of them: the others match by chance, and so \
             may these"
        ));
    }
    if let Some(held_out) = &of.held_out
        && !(held_out.after_m <= of.limit_m)
    {
        reasons.push(format!(
            "{} shots that were held out differ from the model by {:.1} m (root mean square, bias removed); expected at most {} m",
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
            "units that are not kept, with reasons: {refused} of {}",
            of.units.len()
        ));
    }
    if of.complaints > 0 {
        remarks.push(format!(
            "records and points left out, with reasons: {}",
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
        // Correlation sees no bias.
        let broken = match of.similarity {
            Similarity::Ccc => Fail,
            Similarity::Pearson if of.is_auto => Warning,
            _ => Pass,
        };
        Check::new(CheckKind::ModelBias, "", bias_m, limit_m, broken)
    }));
    checks
}

/// That units scatter far more than their shots say, if they do.
fn scattered(widened: Widened) -> Option<String> {
    let Widened { shift, bias } = widened;
    (shift.max(bias) > WIDENED_MAX).then(|| {
        format!(
            "units scatter more than their shots say, shifts {shift:.1} times and biases {bias:.1} times: the model errs in common over \
             the shots of a unit; standard deviations are so much wider"
        )
    })
}

/// What is wrong with a bias, and what is doubtful.
fn bias([bias_m, limit_m]: [f64; 2], of: &Evidence<'_>) -> (Option<String>, Option<String>) {
    let lies =
        format!("the model lies {bias_m:.0} m off the laser (median of units, by correlation)");
    let [apart_m, near_m] = SPHERES_M;
    if !of.radius_is_stated && (bias_m.abs() - apart_m).abs() <= near_m {
        let wrong = format!(
            "{lies}: the spheres of 3396000 m and 3396190 m, above either of which heights of Mars are given, differ by as much; \
             say with --radius-m which it is"
        );
        return (Some(wrong), None);
    }
    let is_beyond = bias_m.abs() > limit_m;
    match of.similarity {
        Similarity::Ccc if is_beyond => {
            let wrong = format!(
                "{lies}, and concordance takes heights as they are: beyond {limit_m:.0} m it drives shifts aside; check what heights \
                 count from, or take --similarity auto"
            );
            (Some(wrong), None)
        }
        Similarity::Pearson if of.is_auto => {
            let doubt = format!(
                "{lies}, more than the {limit_m:.0} m up to which concordance can be asked: units were matched by correlation, which \
                 sees no bias"
            );
            (None, Some(doubt))
        }
        _ => (None, None),
    }
}
