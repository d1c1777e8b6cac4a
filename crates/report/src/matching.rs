//! Tie points measured by areograph: the number of places tried, and their outcomes.

use super::{
    html::{Column, Markup, Table, html},
    misregistration::PAIRS_TABLED,
    numbers::whole,
    plots::label,
    section::Section,
};
use areograph_base::ties::MatchedPair;
use areograph_products::SiteProducts;
use areograph_stages::read_ties::Ties;

pub(super) const SECTION: Section = Section {
    title: "Matching of tie points",
    anchor: "matching-of-tie-points",
    checks: &[],
    appears: |site| matched(site).is_some(),
    write: |site| {
        Ok(matched(site)
            .map(|ties| write(site, ties))
            .unwrap_or_default())
    },
};

fn matched<'a>(site: &SiteProducts<'a>) -> Option<&'a Ties> {
    let ties = site.geometric?.ties;
    (!ties.matched.is_empty()).then_some(ties)
}

/// The pairs with a row each: all of a few, and of many first those that are refused, then those with the fewest tie
/// points.
fn tabled(pairs: &[MatchedPair]) -> Vec<&MatchedPair> {
    let mut tabled: Vec<(usize, &MatchedPair)> = pairs.iter().enumerate().collect();
    if pairs.len() > PAIRS_TABLED {
        tabled.sort_by_key(|(index, pair)| (!pair.is_refused, pair.ties, *index));
        tabled.truncate(PAIRS_TABLED);
        tabled.sort_by_key(|(index, _)| *index);
    }
    tabled.into_iter().map(|(_, pair)| pair).collect()
}

fn some_of_all(all: &[MatchedPair], tabled: &[&MatchedPair]) -> Markup {
    html! {
        @if tabled.len() < all.len() {
            p {
                "The table lists " (tabled.len()) " of " (whole(all.len()))
                " pairs: rejected pairs first, then pairs with the fewest tie points."
            }
        }
    }
}

fn write(site: &SiteProducts, ties: &Ties) -> Markup {
    let mut table = Table::new(
        "Matched pairs",
        &[
            Column::Text("images"),
            Column::Number("cells of common ground"),
            Column::Number("tie points"),
            Column::Number("parts with tie points"),
            Column::Number("searched within (m)"),
            Column::Number("σ line (lines)"),
            Column::Number("σ sample (px)"),
            Column::Number("correlation"),
            Column::Text("cells without a tie point"),
        ],
    );
    let matched = tabled(&ties.matched);
    for pair in &matched {
        let [first, second] = pair.images.map(|image| &site.images[image].times.id);
        let [parts, with_ties] = pair.parts;
        table.row(
            !pair.is_refused,
            [
                format!("{first}, {second}").into(),
                whole(pair.cells).into(),
                whole(if pair.is_refused { 0 } else { pair.ties }).into(),
                format!("{with_ties} of {parts}").into(),
                label(pair.reach_m, 0).into(),
                label(pair.sigma_px[0], 3).into(),
                label(pair.sigma_px[1], 3).into(),
                label(pair.correlation, 2).into(),
                pair.reasons().into(),
            ],
        );
    }
    html! {
        p {
            "In each cell of common ground, the point with the strongest texture was matched to the other image and back. \
             σ: medians \
             of the standard deviations of single matches, in the second image. The table shows the second pass, \
             which started from the adjusted orientation."
        }
        (some_of_all(&ties.matched, &matched))
        (table.finish())
    }
}
