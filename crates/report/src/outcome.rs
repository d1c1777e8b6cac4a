//! Outcomes of checks in words and marks.

use super::html::{Markup, Tone, counted, html};
use areograph_stages::judge::{Check, CheckOutcome};

/// The number of checks with the worst outcome of `checks`, and whether all pass; empty without checks.
pub(super) fn outcomes<'a>(checks: impl Iterator<Item = &'a Check>) -> (Markup, bool) {
    let all: Vec<CheckOutcome> = checks.map(|check| check.outcome).collect();
    let of = |outcome| all.iter().filter(|of| **of == outcome).count();
    let [failed, warnings] = [CheckOutcome::Fail, CheckOutcome::Warning].map(of);
    let text = match (failed, warnings, all.len()) {
        (_, _, 0) => return (Markup::default(), true),
        (0, 0, 1) => "1 check passes".to_owned(),
        (0, 0, count) => format!("{count} checks pass"),
        (0, warnings, _) => counted(warnings, "warning"),
        (1, _, count) => format!("1 of {count} checks fails"),
        (failed, _, count) => format!("{failed} of {count} checks fail"),
    };
    let outcome = match (failed, warnings) {
        (0, 0) => CheckOutcome::Pass,
        (0, _) => CheckOutcome::Warning,
        _ => CheckOutcome::Fail,
    };
    (marked(outcome, &text), outcome == CheckOutcome::Pass)
}

/// Words in the colour of an outcome, behind its mark.
pub(super) fn marked(outcome: CheckOutcome, words: &str) -> Markup {
    let (tone, mark) = match outcome {
        CheckOutcome::Fail => (Tone::Bad, "✗"),
        CheckOutcome::Warning => (Tone::Remarks, "!"),
        CheckOutcome::Pass => (Tone::Good, "✓"),
    };
    html! { span.outcome.(tone.class()) { b aria-hidden="true" { (mark) } " " (words) } }
}
