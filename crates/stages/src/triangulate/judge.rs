//! The verdict on a net.

use super::{
    result::{BrickResult, ControlResult, Seams, Totals},
    scales::Scales,
};
use crate::judge::{
    Check, CheckKind,
    CheckOutcome::{Fail, Warning},
    Verdict,
};

/// Largest share of blunders in a valid net.
const REMOVED_MAX: f64 = 0.1;

/// The evidence on which a net is judged.
pub(super) struct Evidence<'a> {
    pub(super) totals: &'a Totals,
    pub(super) bricks: &'a [BrickResult],
    pub(super) seams: Option<&'a Seams>,
    pub(super) controls: &'a [ControlResult],
    pub(super) scales: &'a Scales,
    pub(super) measurements: usize,
    pub(super) complaints: u64,
    pub(super) remarks: &'a [String],
}

/// Largest share of flagged measurements in a good net: two in a thousand exceed the limit by chance.
const FLAGGED_MAX: f64 = 0.01;

/// A net is invalid without redundancy, with too many blunders, or on controls of another scale or shape.
pub(super) fn judge(of: &Evidence) -> Verdict {
    let totals = of.totals;
    let mut reasons = Vec::new();
    if totals.redundancy == 0 {
        reasons.push(
            "the net has no redundancy: erroneous measurements cannot be distinguished from correct ones"
                .to_owned(),
        );
    }
    if totals.removed as f64 > REMOVED_MAX * of.measurements as f64 {
        reasons.push(format!(
            "{} of {} measurements were rejected as blunders; expected at most a tenth",
            totals.removed, of.measurements
        ));
    }
    reasons.extend(of.scales.reasons());
    Verdict {
        untested: untested(of),
        ..Verdict::of(reasons, remarks(of), checks(of))
    }
}

/// Errors that no datum of the net can show.
fn untested(of: &Evidence) -> Vec<String> {
    let shared =
        "an error in position or direction that all controls share (no other control is available)";
    let stretch = of.scales.stretch_max().map(|limit| {
        format!(
            "a stretch of the controls of up to {:.1} % (within their standard deviations)",
            100.0 * limit
        )
    });
    [shared.to_owned()].into_iter().chain(stretch).collect()
}

/// Minimum number of controls for identifying a gross error of one of them.
const CONTROLS_MIN: usize = 5;
/// Seams wider than this many standard deviations of a measurement indicate a bent brick.
const SEAMS_SIGMA: f64 = 3.0;

fn checks(of: &Evidence) -> Vec<Check> {
    let share = |count: u64| count as f64 / of.measurements.max(1) as f64;
    let count = |kind, found: usize, limit: usize, broken| {
        Check::new(kind, "", found as f64, limit as f64, broken)
    };
    let totals = of.totals;
    let refused = of.controls.iter().filter(|control| !control.kept).count();
    let mut checks = vec![
        Check::new(
            CheckKind::Redundancy,
            "",
            totals.redundancy as f64,
            1.0,
            Fail,
        ),
        Check::of_share(
            CheckKind::MeasurementsRemoved,
            "",
            share(totals.removed),
            REMOVED_MAX,
            Fail,
        ),
        Check::of_share(
            CheckKind::MeasurementsFlagged,
            "",
            share(totals.flagged),
            FLAGGED_MAX,
            Warning,
        ),
        count(
            CheckKind::ControlsKept,
            of.controls.len() - refused,
            CONTROLS_MIN,
            Warning,
        ),
        count(CheckKind::ControlsRefused, refused, 0, Warning),
    ];
    checks.extend(of.seams.zip(totals.tie_sigma_m).map(|(seams, sigma_m)| {
        let [x, y] = seams.rms_m;
        Check::new(
            CheckKind::Seams,
            "",
            x.max(y),
            SEAMS_SIGMA * sigma_m,
            Warning,
        )
    }));
    checks.extend(of.scales.checks());
    checks
}

fn remarks(of: &Evidence) -> Vec<String> {
    let totals = of.totals;
    let mut remarks = of.remarks.to_vec();
    let mut say = |when: bool, text: String| {
        if when {
            remarks.push(text);
        }
    };
    let blundered: Vec<&str> = of
        .bricks
        .iter()
        .filter(|brick| brick.removed > 0)
        .map(|brick| &*brick.brick)
        .collect();
    say(
        totals.removed > 0,
        format!(
            "measurements rejected as blunders: {}, in bricks: {}",
            totals.removed,
            blundered.join(", ")
        ),
    );
    say(
        totals.flagged as f64 > FLAGGED_MAX * of.measurements as f64,
        format!(
            "{} measurements in use deviate by more than 3.5 robust standard deviations",
            totals.flagged
        ),
    );
    let rejected: Vec<&str> = of
        .controls
        .iter()
        .filter(|control| !control.kept)
        .map(|control| &*control.point)
        .collect();
    say(
        !rejected.is_empty(),
        format!("controls rejected by SCALE: {}", rejected.join(", ")),
    );
    let kept = of.controls.len() - rejected.len();
    say(
        kept < CONTROLS_MIN,
        format!("{kept} controls: a gross error in one of them cannot be identified"),
    );
    say(
        kept == 2 && of.controls.iter().all(|control| control.sigma_m.is_none()),
        "two controls without standard deviations: standard deviations of points are relative to these controls".to_owned(),
    );
    say(
        of.complaints > 0,
        format!("rows of tables skipped: {}", of.complaints),
    );
    if let (Some(seams), Some(sigma_m)) = (of.seams, totals.tie_sigma_m) {
        let [x, y] = seams.rms_m;
        say(
            x.max(y) > SEAMS_SIGMA * sigma_m,
            format!(
                "bricks differ at their seams by {:.1} m (root mean square), but measurements within bricks have a \
                 standard deviation of {sigma_m:.1} m: a brick may be distorted; one_shot adjusts all pictures at once",
                x.max(y)
            ),
        );
    }
    remarks.extend(of.scales.remarks());
    remarks
}
