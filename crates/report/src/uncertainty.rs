//! The budget of eq. 5 to 9 of Shan et al. 2005: the distance between the two footprints of one point.

use super::{
    html::{Cell, Column, Markup, Table, counted, folded, html},
    misregistration::BeforeAfter,
    plots::label,
    section::Section,
    source::untraced,
};
use areograph_geom::uncertainty::{GroundPart, UncertaintyBudget};
use areograph_products::GeometricProducts;
use areograph_stages::pool_sites::BudgetsPooled;

pub(super) const SECTION: Section = Section {
    title: "Appendix: uncertainty budget of Shan et al. 2005",
    anchor: "gap-of-footprints",
    checks: &[],
    appears: |site| {
        let pairs = site.geometric.as_ref().map(|geometric| geometric.pairs);
        pairs.is_some_and(|pairs| !pairs.is_empty())
    },
    write: |site| Ok(site.geometric.as_ref().map(write).unwrap_or_default()),
};

fn write(geometric: &GeometricProducts) -> Markup {
    let pairs = BeforeAfter::all(geometric);
    let before = pairs
        .iter()
        .filter_map(|pair| pair.before.budget.clone().ok());
    let before: Vec<UncertaintyBudget> = before.collect();
    let pairs = BeforeAfter::tabled(pairs);
    let body = html! {
        (BeforeAfter::some_of_all(geometric))
        (rows(TITLE, COLUMNS, (&pairs, &before), as_published))
        p { (WORDS) }
        (rows(SIGNED_TITLE, SIGNED_COLUMNS, (&pairs, &before), by_equation_5))
        p { (SIGNED_WORDS) }
        @for pair in &pairs { (without_budget(pair)) }
    };
    folded("The budget by eq. 5 to 9", &body)
}

/// The equations as the paper computes with them.
const TITLE: &str =
    "Distance between the two footprints of a point (eq. 5 to 9 of Shan et al. 2005)";
const COLUMNS: &[Column] = &[
    Column::Text("pair"),
    Column::Text("adjustment"),
    Column::Number("observed misregistration, px"),
    Column::Number("by orientation, px"),
    Column::Number("by footprints, px"),
    Column::Number("in plan, m"),
    Column::Number("in height, m"),
    Column::Number("in height by eq. 7, m"),
];
const WORDS: &str = "As in Shan et al. 2005: D = √(M² + σ²) of the reprojection residuals. Across the track, the paper averages \
                     where its eq. 7 adds squares; both results are stated. Known flaw: eq. 7 adds the means of both images \
                     in quadrature, although means of opposite sign add up in eq. 5; eq. 6 assigns the remainder to the \
                     footprints. This remainder is not the accuracy of the altimeter: error-free shots also leave one.";

/// Title of the budget by eq. 5.
const SIGNED_TITLE: &str = "The same with Δ = Δ1 − Δ2 of every tie point (eq. 5)";
const SIGNED_COLUMNS: &[Column] = &[
    Column::Text("pair"),
    Column::Text("adjustment"),
    Column::Number("observed misregistration, px"),
    Column::Number("by orientation, px"),
    Column::Number("not by orientation, mean, px"),
    Column::Number("in plan, m"),
    Column::Number("in height, m"),
];
const SIGNED_WORDS: &str = "Means keep their signs. Not by orientation: mean misregistration of the footprints that the mean of the \
                            tie points does not explain; for several pairs, the root mean square. A planimetric footprint error \
                            moves both projections alike and is not visible here. The table states the agreement of \
                            two images, not accuracy.";

/// A row for each state of each of these pairs with a budget, and one of the budgets of all pairs before the adjustment.
fn rows<const N: usize>(
    title: &str,
    columns: &'static [Column],
    (pairs, before): (&[BeforeAfter], &[UncertaintyBudget]),
    cells: fn(&UncertaintyBudget, bool) -> [Cell; N],
) -> Markup {
    let mut table = Table::new(title, columns);
    for pair in pairs {
        for (index, (state, found)) in pair.states().enumerate() {
            if let Ok(budget) = &found.budget {
                let head = [Cell::from(pair.name()), state.into()];
                let cells = head.into_iter().chain(cells(budget, index == 0));
                table.row_of(&pair.place(state), true, cells);
            }
        }
    }
    if before.len() > 1 {
        pooled(&mut table, before, cells);
    }
    table.finish()
}

/// A row of all `budgets` before the adjustment; no product has its numbers.
fn pooled<const N: usize>(
    table: &mut Table,
    budgets: &[UncertaintyBudget],
    cells: fn(&UncertaintyBudget, bool) -> [Cell; N],
) {
    if let Some(budget) = UncertaintyBudget::pooled(budgets) {
        let pairs = counted(budgets.len(), "pair");
        let head = [Cell::from(format!("all: {pairs}")), "before".into()];
        table.row(
            true,
            head.into_iter().chain(cells(&budget, true).map(untraced)),
        );
    }
}

/// The budget of the pairs of the sites with a budget before their adjustments, as the paper pools its three.
pub(super) fn of_sites(budgets: &[UncertaintyBudget]) -> Markup {
    if budgets.len() < 2 {
        return Markup::default();
    }
    let mut published = Table::new(TITLE, COLUMNS);
    pooled(&mut published, budgets, as_published);
    let mut signed = Table::new(SIGNED_TITLE, SIGNED_COLUMNS);
    pooled(&mut signed, budgets, by_equation_5);
    let body = html! {
        (published.finish())
        p { (WORDS) }
        (signed.finish())
        p { (SIGNED_WORDS) }
    };
    folded(
        "Uncertainty budget of Shan et al. 2005, sites with a budget",
        &body,
    )
}

/// The budgets of a campaign, squares averaged over its pairs.
pub(super) fn of_campaign(budgets: &BudgetsPooled) -> Markup {
    let mut published = Table::new(TITLE, COLUMNS);
    let mut signed = Table::new(SIGNED_TITLE, SIGNED_COLUMNS);
    let all = (budgets.pairs, Some(&budgets.all), "all");
    let observed = (
        budgets.observed_pairs,
        budgets.observed.as_ref(),
        "with footprints in both images",
    );
    for (pairs, budget, which) in [all, observed] {
        if let Some(budget) = budget {
            let head = || {
                let pairs = counted(pairs as usize, "pair");
                [Cell::from(format!("{which}: {pairs}")), "before".into()].into_iter()
            };
            published.row(true, head().chain(as_published(budget, true).map(untraced)));
            signed.row(
                true,
                head().chain(by_equation_5(budget, true).map(untraced)),
            );
        }
    }
    html! {
        (published.finish())
        p { (WORDS) }
        (signed.finish())
        p { (SIGNED_WORDS) }
    }
}

/// Shares of orientation and footprints in the observed misregistration apply only before the adjustment.
fn as_published(budget: &UncertaintyBudget, before: bool) -> [Cell; 6] {
    let footprints = match budget.ground {
        GroundPart::Resolved { along_px } if before => {
            Cell::from(label(along_px, 2)).traced("/budget/ground/resolved/along_px")
        }
        GroundPart::NotResolvable if before => {
            "not resolvable: orientation explains more than is observed".into()
        }
        _ => "–".into(),
    };
    [
        observed(budget, before),
        of(budget.along_px, "along_px"),
        footprints,
        of(
            budget.paper_average.planimetric_m,
            "paper_average/planimetric_m",
        ),
        of(budget.paper_average.height_m, "paper_average/height_m"),
        of(budget.equation_7.height_m, "equation_7/height_m"),
    ]
}

fn by_equation_5(budget: &UncertaintyBudget, before: bool) -> [Cell; 5] {
    let found = &budget.equation_5;
    let left = found.unexplained_px.filter(|_| before);
    [
        observed(budget, before),
        of(found.along_px, "equation_5/along_px"),
        left.map_or_else(|| "–".into(), |px| of(px, "equation_5/unexplained_px")),
        of(found.point.planimetric_m, "equation_5/point/planimetric_m"),
        of(found.point.height_m, "equation_5/point/height_m"),
    ]
}

fn observed(budget: &UncertaintyBudget, before: bool) -> Cell {
    let px = budget.total_along_px.filter(|_| before);
    px.map_or_else(|| "–".into(), |px| of(px, "total_along_px"))
}

/// A number of the budget at `name` below it.
fn of(value: f64, name: &str) -> Cell {
    Cell::from(label(value, 2)).traced(format!("/budget/{name}"))
}

/// Reason why a pair has no budget.
fn without_budget(pair: &BeforeAfter) -> Markup {
    html! {
        @for (state, found) in pair.states() {
            @if let Err(reason) = &found.budget {
                p { (pair.name()) " has no budget " (state) " the adjustment: " (maud::display(reason)) "." }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use areograph_geom::uncertainty::{
        BudgetInput, Misregistration, PairResiduals, ResidualMoments, uncertainty_budget,
    };

    /// Images that disagree by so many lines, half in each.
    fn budget(apart_lines: f64) -> UncertaintyBudget {
        let image = |mean_x: f64| ResidualMoments {
            mean_x,
            deviation_x: 0.0,
            mean_y: 0.0,
            deviation_y: 0.0,
        };
        let images = [image(0.5 * apart_lines), image(-0.5 * apart_lines)];
        uncertainty_budget(&BudgetInput {
            sites: vec![PairResiduals::of_images(images)],
            misregistration: Some(Misregistration {
                mean_m: -5.0 * apart_lines,
                rms_m: 5.0 * apart_lines,
            }),
            pixel_size_m: 5.0,
            height_over_base: 2.5,
        })
        .unwrap()
    }

    #[test]
    fn sites_are_pooled_by_their_squares() {
        // √((30² + 40²) / 2) = 35.36, and by eq. 7 that over √2.
        let html = of_sites(&[budget(30.0), budget(40.0)]).0;
        assert!(html.contains("2005, sites with a budget<"), "{html}");
        assert!(html.contains("all: 2 pairs"), "{html}");
        assert!(
            html.contains(">35.36<") && html.contains(">25.00<"),
            "{html}"
        );
        // No product has these numbers.
        assert!(!html.contains("data-from"), "{html}");
        assert_eq!(of_sites(&[budget(30.0)]).0, "");
    }
}
