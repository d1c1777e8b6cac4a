//! The checks of the first screen: every limit of the site with the value that uses most of it, the worst first.

use super::{
    html::{Cell, Column, Markup, Table, counted, folded, folded_unless, html, link, list},
    numbers::{number, signed, whole},
    outcome::marked,
    section::Section,
};
use areograph_base::verdict::NOT_TESTED;
use areograph_products::SiteProducts;
use areograph_stages::judge::{Check, CheckOutcome};

/// The checks of a site, with links to the `sections` that have details; checks that pass are folded to a line.
pub(super) fn of_site(site: &SiteProducts, sections: &[&Section]) -> Markup {
    let checks = site.verdict.checks.iter().enumerate();
    let (passed, others): (Vec<_>, Vec<_>) =
        checks.partition(|(_, check)| check.outcome == CheckOutcome::Pass);
    let title = match others.len() {
        0 => format!("All {} pass", counted(passed.len(), "check")),
        _ => format!("{} pass", counted(passed.len(), "other check")),
    };
    html! {
        @if !others.is_empty() { (table(site, sections, "Checks", &others)) }
        @if !passed.is_empty() { (folded(&title, &table(site, sections, "Checks that pass", &passed))) }
    }
}

/// A table of some checks of a site with their indices.
fn table(
    site: &SiteProducts,
    sections: &[&Section],
    caption: &str,
    checks: &[(usize, &Check)],
) -> Markup {
    let mut table = empty(caption);
    for (index, check) in checks {
        let mut all = sections.iter();
        let more = all.find(|section| section.checks.contains(&check.kind));
        let more = more.filter(|section| (section.appears)(site));
        let what = more.map_or_else(
            || html! { (check.words()) },
            |section| link(&format!("#{}", section.anchor), &check.words()),
        );
        row(&mut table, check, &what, &place(*index));
    }
    table.finish()
}

/// The table of the checks of a net, a calibration or a match.
pub(super) fn listed(checks: &[Check]) -> Markup {
    let mut table = empty("Checks");
    for check in checks {
        row(&mut table, check, &html! { (check.words()) }, "");
    }
    table.finish()
}

fn empty(caption: &str) -> Table {
    Table::new(
        caption,
        &[
            Column::Text("result"),
            Column::Text("check"),
            Column::Number("value"),
            Column::Number("limit"),
        ],
    )
}

/// A check in a table: `what` is checked, and its `place` in the products.
fn row(table: &mut Table, check: &Check, what: &Markup, place: &str) {
    let subject = &check.subject;
    let traced = |text: String, at: &str| match place {
        "" => Cell::from(text),
        _ => Cell::from(text).traced(at),
    };
    table.row_of(
        place,
        check.outcome != CheckOutcome::Fail,
        [
            result(check.outcome),
            html! { (what) @if !subject.is_empty() { " " small { (subject) } } }.into(),
            traced(value(check), value_place(check)),
            traced(limit(check), "/limit"),
        ],
    );
}

/// Place of a check in the products.
pub(super) fn place(index: usize) -> String {
    format!("manifest.json#/verdict/checks/{index}")
}

/// Place of its value, below that: with the sign that is shown.
const fn value_place(check: &Check) -> &'static str {
    if check.kind.is_signed() {
        "/value"
    } else {
        "|/value"
    }
}

/// Mark and word of an outcome.
fn result(outcome: CheckOutcome) -> Cell {
    let word = match outcome {
        CheckOutcome::Fail => "fail",
        CheckOutcome::Warning => "warning",
        CheckOutcome::Pass => "pass",
    };
    marked(outcome, word).into()
}

/// The value found, with its unit; a dash if it is not a number.
pub(super) fn value(check: &Check) -> String {
    let Some(value) = check.value else {
        return "–".to_owned();
    };
    if check.unit.is_empty() {
        return whole(value.max(0.0) as u64);
    }
    let [decimals, _] = check.decimals();
    let text = if check.kind.is_signed() {
        signed(value, decimals)
    } else {
        number(value.abs(), decimals)
    };
    format!("{text} {}", check.unit)
}

/// The limit, with its unit; a dash without a number.
pub(super) fn limit(check: &Check) -> String {
    let Some(limit) = check.limit else {
        return "–".to_owned();
    };
    let bound = if check.kind.at_least() {
        "≥"
    } else if check.kind.is_signed() {
        "±"
    } else {
        "≤"
    };
    if check.unit.is_empty() {
        return format!("{bound} {}", whole(limit as u64));
    }
    let [_, decimals] = check.decimals();
    format!("{bound} {} {}", number(limit, decimals), check.unit)
}

/// Errors that no datum can show.
pub(super) fn untested(phrases: &[String]) -> Markup {
    // A verdict is read together with its reservations.
    folded_unless(true, NOT_TESTED, &list(phrases))
}

#[cfg(test)]
mod tests {
    use super::*;
    use areograph_stages::judge::CheckKind;

    fn check(kind: CheckKind, value: f64, limit: f64) -> Check {
        Check {
            kind,
            what: String::new(),
            outcome: CheckOutcome::Fail,
            subject: String::new(),
            value: Some(value),
            limit: Some(limit),
            unit: kind.unit().to_owned(),
        }
    }

    #[test]
    fn a_value_beyond_its_limit_is_never_written_like_it() {
        let close = check(CheckKind::RangeMean, -10.0004, 10.0);
        assert_eq!((&*value(&close), &*limit(&close)), ("−10.0004 m", "± 10 m"));
        let count = check(CheckKind::Shots, 19.0, 20.0);
        assert_eq!((&*value(&count), &*limit(&count)), ("19", "≥ 20"));
        let share = check(CheckKind::TiesRejected, 12.34, 10.0);
        assert_eq!((&*value(&share), &*limit(&share)), ("12.3 %", "≤ 10 %"));
        // A limit has its own number of digits.
        let sigma = check(CheckKind::TieResidualsAlong, 0.9, 1.25);
        assert_eq!((&*value(&sigma), &*limit(&sigma)), ("0.9 σ", "≤ 1.25 σ"));
        let pointing = check(CheckKind::PointingRmse, 2.0, 0.04);
        assert_eq!(&*limit(&pointing), "≤ 0.04 ″");
    }
}
