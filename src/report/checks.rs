//! The table of the first screen: every limit of the site with what uses most of it, the worst first.

use super::{
    adjustment, heights,
    html::{Cell, Column, Table, Tone, escape, link},
    images, misregistration, notes,
    numbers::{number, signed, whole},
    ranges, scan,
    section::Section,
    selection, timeline,
};
use crate::{
    products::SiteProducts,
    stages::judge::{Check, CheckKind, CheckOutcome},
};

/// The table of the checks of a site.
pub(super) fn table(site: &SiteProducts) -> String {
    let mut table = Table::new(
        "Checks",
        &[
            Column::Text("result"),
            Column::Text("check"),
            Column::Number("value"),
            Column::Number("limit"),
        ],
    );
    for check in &site.verdict.checks {
        let words = check.kind.words();
        let more = section(check.kind).filter(|section| (section.appears)(site));
        let mut what = more.map_or_else(
            || escape(words),
            |section| link(&format!("#{}", section.anchor), words),
        );
        if !check.subject.is_empty() {
            what += &format!(" <small>{}</small>", escape(&check.subject));
        }
        table.row(
            check.outcome != CheckOutcome::Fail,
            [
                result(check.outcome),
                Cell::Html(what),
                value(check).into(),
                limit(check).into(),
            ],
        );
    }
    table.finish()
}

/// Mark and word of an outcome.
fn result(outcome: CheckOutcome) -> Cell {
    let (tone, mark, word) = match outcome {
        CheckOutcome::Fail => (Tone::Bad, "✗", "fail"),
        CheckOutcome::Warning => (Tone::Remarks, "!", "warning"),
        CheckOutcome::Pass => (Tone::Good, "✓", "pass"),
    };
    Cell::Html(format!(
        "<span class=\"outcome {}\"><b aria-hidden=\"true\">{mark}</b> {word}</span>",
        tone.class()
    ))
}

/// What was found, with its unit; a dash where it is no number.
pub(super) fn value(check: &Check) -> String {
    let Some(value) = check.value else {
        return "–".to_owned();
    };
    if check.unit.is_empty() {
        return whole(value.max(0.0) as u64);
    }
    let text = if is_signed(check.kind) {
        signed(value, decimals(check))
    } else {
        number(value.abs(), decimals(check))
    };
    format!("{text} {}", check.unit)
}

fn limit(check: &Check) -> String {
    let Some(limit) = check.limit else {
        return "–".to_owned();
    };
    let (bound, unit) = (
        if check.kind.at_least() {
            "≥ "
        } else if is_signed(check.kind) {
            "± "
        } else {
            "≤ "
        },
        &check.unit,
    );
    if unit.is_empty() {
        return format!("{bound}{}", whole(limit as u64));
    }
    // Limits are written by people: their digits end where zeros begin.
    let text = number(limit, decimals(check));
    let text = if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.')
    } else {
        &text
    };
    format!("{bound}{text} {unit}")
}

/// Decimals by which values near the limit can be told apart from it.
fn decimals(check: &Check) -> usize {
    let small = check.value.is_some_and(|value| value.abs() < 1.0);
    let least = match check.kind {
        CheckKind::ParallaxAfter | CheckKind::PointingRmse if small => 2,
        CheckKind::ClockCorrection | CheckKind::TableError => 4,
        CheckKind::RangeMean | CheckKind::Decoding | CheckKind::PositionRmse => 2,
        _ => 1,
    };
    let (Some(value), Some(limit)) = (check.value, check.limit) else {
        return least;
    };
    // A value beyond its limit is never written like it.
    let apart = |decimals: &usize| number(value.abs(), *decimals) != number(limit, *decimals);
    (least..8).find(apart).unwrap_or(least)
}

/// Whether both signs happen.
const fn is_signed(kind: CheckKind) -> bool {
    matches!(
        kind,
        CheckKind::HeightAfter
            | CheckKind::HeightBefore
            | CheckKind::RangeMean
            | CheckKind::Decoding
            | CheckKind::ClockCorrection
            | CheckKind::ParallaxAfter
            | CheckKind::ParallaxBefore
            | CheckKind::ProfilesApart
    )
}

/// The section that tells more.
const fn section(kind: CheckKind) -> Option<&'static Section> {
    Some(match kind {
        CheckKind::Footprints => &selection::SECTION,
        CheckKind::AdjustmentMade | CheckKind::Contradiction => return None,
        CheckKind::HeightAfter
        | CheckKind::HeightBefore
        | CheckKind::HeightOutliers
        | CheckKind::ProfilesApart
        | CheckKind::HeightSigma
        | CheckKind::Boresight => &heights::SECTION,
        CheckKind::RangeMean
        | CheckKind::OrbitsApart
        | CheckKind::Decoding
        | CheckKind::RangeOutliers
        | CheckKind::Shots => &ranges::SECTION,
        CheckKind::ClockCorrection => &scan::SECTION,
        CheckKind::ParallaxAfter | CheckKind::ParallaxBefore => &misregistration::SECTION,
        CheckKind::TieResidualsAlong
        | CheckKind::TieResidualsAcross
        | CheckKind::TiesRejected
        | CheckKind::TiesUsed
        | CheckKind::Correction => &adjustment::SECTION,
        CheckKind::PositionRmse | CheckKind::PointingRmse | CheckKind::TableError => {
            &images::SECTION
        }
        CheckKind::Attitude => &timeline::SECTION,
        CheckKind::SkippedRecords => &notes::SECTION,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(kind: CheckKind, value: f64, limit: f64) -> Check {
        Check {
            kind,
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
    }
}
