//! The checks of both runs whose outcome changed.

use super::super::{
    checks::{limit, value},
    html::{Column, Markup, Table},
};
use crate::difference::RunDifference;
use areograph_stages::judge::{Check, CheckOutcome};

/// The table; empty if no outcome changed.
pub(super) fn changed(site: &RunDifference) -> Markup {
    let (a, b) = (&site.a.verdict.checks, &site.b.verdict.checks);
    // Products of older versions have no checks.
    if a.is_empty() || b.is_empty() {
        return Markup::default();
    }
    let mut rows = Vec::new();
    for after in b {
        let before = a.iter().find(|before| before.kind == after.kind);
        if before.is_none_or(|before| before.outcome != after.outcome) {
            rows.push((after.words(), before, Some(after)));
        }
    }
    let gone = a
        .iter()
        .filter(|before| b.iter().all(|after| after.kind != before.kind));
    rows.extend(gone.map(|before| (before.words(), Some(before), None)));
    if rows.is_empty() {
        return Markup::default();
    }
    let columns = &[Column::Text("check"), Column::Text("A"), Column::Text("B")];
    let mut table = Table::new("Checks that changed", columns);
    for (words, before, after) in rows {
        let fails = after.is_some_and(|check| check.outcome == CheckOutcome::Fail);
        let [before, after] = [before, after].map(|check| check.map_or("–".to_owned(), in_words));
        table.row(
            !fails,
            [words.into_owned().into(), before.into(), after.into()],
        );
    }
    table.finish()
}

/// Outcome, value and limit of a check in the form of pages, and its subject.
fn in_words(check: &Check) -> String {
    let word = match check.outcome {
        CheckOutcome::Fail => "fail",
        CheckOutcome::Warning => "warning",
        CheckOutcome::Pass => "pass",
    };
    let of = if check.subject.is_empty() {
        String::new()
    } else {
        format!(" ({})", check.subject)
    };
    match check.value {
        Some(_) => format!("{word}, {}{of}; limit {}", value(check), limit(check)),
        None => format!("{word}{of}"),
    }
}
