//! The budget of eq. 5 to 9 of Shan et al. 2005: how far apart the two footprints of one point lie.

use super::{
    html::{Cell, Column, Table, folded, paragraph},
    misregistration::BeforeAfter,
    plots::label,
    section::Section,
};
use crate::{
    geom::uncertainty::{GroundPart, UncertaintyBudget},
    products::GeometricProducts,
};

pub(super) const SECTION: Section = Section {
    title: "Appendix: uncertainty budget of Shan et al. 2005",
    anchor: "gap-of-footprints",
    appears: |site| {
        let pairs = site.geometric.as_ref().map(|geometric| geometric.pairs);
        pairs.is_some_and(|pairs| !pairs.is_empty())
    },
    write: |site| Ok(site.geometric.iter().map(write).collect()),
};

fn write(geometric: &GeometricProducts) -> String {
    let pairs = BeforeAfter::all(geometric);
    let explained = "D = √(M² + σ²) of the reprojection residuals; the whole is one MOLA spacing. Across track the paper averages where \
                     its eq. 7 adds squares: both are given. Agreement of two images, not accuracy.";
    let without: String = pairs.iter().map(without_budget).collect();
    let html = budgets(&pairs) + &without + &paragraph(explained);
    folded("The budget by eq. 5 to 9", &html)
}

fn budgets(pairs: &[BeforeAfter]) -> String {
    let mut table = Table::new(
        "How far apart the two footprints of a point lie (eq. 5 to 9 of Shan et al. 2005)",
        &[
            Column::Text("pair"),
            Column::Text("adjustment"),
            Column::Number("one MOLA spacing, px"),
            Column::Number("by orientation, px"),
            Column::Number("by footprints, px"),
            Column::Number("in plan, m"),
            Column::Number("in height, m"),
            Column::Number("in height by eq. 7, m"),
        ],
    );
    for pair in pairs {
        let mut before = true;
        for (state, found) in pair.states() {
            if let Ok(budget) = &found.budget {
                let head = [Cell::from(pair.name()), state.into()];
                let cells = head.into_iter().chain(cells(budget, before));
                table.row_of(&pair.place(state), true, cells);
            }
            before = false;
        }
    }
    table.finish()
}

/// Shares of orientation and footprints in a spacing apply only before the adjustment.
fn cells(budget: &UncertaintyBudget, before: bool) -> [Cell; 6] {
    let footprints = match budget.ground {
        _ if !before => "–".into(),
        GroundPart::Resolved { along_px } => {
            Cell::from(label(along_px, 2)).told("/budget/ground/resolved/along_px")
        }
        GroundPart::NotResolvable => {
            "not resolvable: orientation explains more than a spacing".into()
        }
    };
    let of = |value: f64, name: &str| Cell::from(label(value, 2)).told(format!("/budget/{name}"));
    let spacing = if before {
        of(budget.total_along_px, "total_along_px")
    } else {
        "–".into()
    };
    [
        spacing,
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

/// Reason why a pair has no budget.
fn without_budget(pair: &BeforeAfter) -> String {
    let mut html = String::new();
    for (state, found) in pair.states() {
        if let Err(reason) = &found.budget {
            let name = pair.name();
            html += &paragraph(&format!(
                "{name}, {state} the adjustment: there is no budget: {reason}."
            ));
        }
    }
    html
}
