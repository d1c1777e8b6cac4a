//! The worst rows of a campaign, and sites without a valid result, each with a link to its page.

use crate::{
    html::{Cell, Column, Markup, Table, html, link, paragraph},
    numbers::{signed, whole},
};
use areograph_stages::pool_sites::{CampaignRows, PairRow, ProfileRow, SiteRow, SiteState};

/// Rows of a list.
const LISTED: usize = 10;
/// Letters of a reason; the table of sites has all of it.
const REASON_LETTERS: usize = 240;

/// The pairs with the largest misregistration and the profiles with the largest absolute mean of range − distance.
pub(super) fn worst(rows: &CampaignRows) -> Markup {
    html! { (pairs(&rows.pairs)) (profiles(&rows.profiles)) }
}

/// A site, linked to a part of its page.
fn page_of(site: &str, anchor: &str) -> Cell {
    link(&format!("../{site}/report/index.html#{anchor}"), site).into()
}

/// The rows with the largest values, in order; equal ones as they come.
fn largest<R>(rows: &[R], of: impl Fn(&R) -> Option<f64>) -> Vec<&R> {
    let mut ranked: Vec<(f64, &R)> = rows
        .iter()
        .filter_map(|row| Some((of(row)?.abs(), row)))
        .collect();
    ranked.sort_by(|one, other| other.0.total_cmp(&one.0));
    ranked
        .into_iter()
        .take(LISTED)
        .map(|(_, row)| row)
        .collect()
}

fn along_m(pair: &PairRow) -> Option<f64> {
    Some(pair.before.misregistration?.along_m.value)
}

fn pairs(rows: &[PairRow]) -> Markup {
    let worst = largest(rows, along_m);
    if worst.is_empty() {
        return paragraph("No pair of images has footprints in both images.");
    }
    let mut table = Table::new(
        "Pairs with the largest misregistration along the track before the adjustment",
        &[
            Column::Text("site"),
            Column::Text("images"),
            Column::Text("phase"),
            Column::Text("verdict of the site"),
            Column::Number("before, m"),
            Column::Number("σ, m"),
            Column::Number("shot spacings"),
            Column::Number("after, m"),
            Column::Number("convergence, degrees"),
        ],
    );
    for pair in worst {
        let before = pair.before.misregistration;
        let after = pair.after.as_ref().and_then(|after| after.misregistration);
        let text = |value: Option<f64>, decimals: usize| {
            Cell::from(value.map_or_else(|| "–".to_owned(), |value| signed(value, decimals)))
        };
        table.row(
            pair.is_valid,
            [
                page_of(&pair.site, "tie-points-and-misregistration"),
                pair.images.join(" and ").into(),
                (&pair.phases[0]).into(),
                pair.verdict.into(),
                text(before.map(|of| of.along_m.value), 1),
                Cell::from(
                    before
                        .and_then(|of| of.along_m.sigma)
                        .map_or_else(|| "–".to_owned(), |sigma| format!("{sigma:.1}")),
                ),
                text(before.and_then(|of| of.along_spacings), 2),
                text(after.map(|of| of.along_m.value), 1),
                format!("{:.1}", pair.convergence_rad.to_degrees()).into(),
            ],
        );
    }
    table.finish()
}

fn profiles(rows: &[ProfileRow]) -> Markup {
    let worst = largest(rows, |row| {
        row.is_judged.then_some(row.mean_without_outliers_m)
    });
    if worst.is_empty() {
        return paragraph("No profile has enough shots to be judged.");
    }
    let mut table = Table::new(
        "Profiles with the largest absolute mean of range − distance",
        &[
            Column::Text("site"),
            Column::Text("profile"),
            Column::Text("image"),
            Column::Text("phase"),
            Column::Number("shots"),
            Column::Number("mean without outliers, m"),
            Column::Number("standard deviation, m"),
            Column::Number("outliers"),
            Column::Text("invalid or rejected"),
        ],
    );
    for profile in worst {
        let reasons = [&profile.invalid_because, &profile.rejected_because];
        let reasons: Vec<&str> = reasons
            .into_iter()
            .filter(|reason| !reason.is_empty())
            .map(String::as_str)
            .collect();
        table.row(
            reasons.is_empty(),
            [
                page_of(&profile.site, "range-check"),
                (&profile.profile).into(),
                (&profile.image).into(),
                (&profile.phase).into(),
                whole(profile.ranges.n).into(),
                signed(profile.mean_without_outliers_m, 2).into(),
                format!("{:.2}", profile.ranges.deviation_m).into(),
                whole(profile.outliers).into(),
                shortened(&reasons.join("; ")).into(),
            ],
        );
    }
    table.finish()
}

/// The first sites of each state that is not valid, with the reason.
pub(super) fn not_valid(rows: &CampaignRows) -> Markup {
    let states = [
        (SiteState::Failed, "Last run failed"),
        (SiteState::Absent, "Without products"),
        (SiteState::Unusable, "Products that cannot be used"),
        (SiteState::Published, "Invalid"),
    ];
    html! {
        @for (state, heading) in states {
            (of_state(rows.sites.iter().filter(|site| site.state == state && !site.is_valid).collect(), heading))
        }
    }
}

fn of_state(sites: Vec<&SiteRow>, heading: &str) -> Markup {
    if sites.is_empty() {
        return Markup::default();
    }
    let count = sites.len();
    let mut table = Table::new(
        &format!("{heading}: {}", whole(count)),
        &[
            Column::Text("site"),
            Column::Text("phase"),
            Column::Text("reason"),
        ],
    );
    for site in sites.into_iter().take(LISTED) {
        let reason = if site.failure.is_empty() {
            site.reasons.join("; ")
        } else {
            site.failure.clone()
        };
        let name: Cell = match site.state {
            SiteState::Published => page_of(&site.site, ""),
            _ => (&site.site).into(),
        };
        table.row(
            false,
            [name, (&site.phase).into(), shortened(&reason).into()],
        );
    }
    html! {
        (table.finish())
        @if count > LISTED { p { "The first " (LISTED) " of " (whole(count)) "; sites.csv has all of them." } }
    }
}

fn shortened(text: &str) -> String {
    if text.chars().count() <= REASON_LETTERS {
        return text.to_owned();
    }
    let start: String = text.chars().take(REASON_LETTERS).collect();
    format!("{start}…")
}
