//! The budget of eq. 5 to 9 of Shan et al. 2005: how far apart the two footprints of one point lie.

use super::{
    html::{Cell, Column, Table, paragraph},
    misregistration::BeforeAfter,
    plots::label,
    section::Section,
};
use crate::{
    geom::uncertainty::{GroundPart, UncertaintyBudget},
    products::GeometricProducts,
};

pub(super) const SECTION: Section = Section {
    title: "Reproduction of the paper: eq. 5 to 9",
    anchor: "reproduction-eq-5-to-9",
    appears: |site| {
        let pairs = site.geometric.as_ref().map(|geometric| geometric.pairs);
        pairs.is_some_and(|pairs| !pairs.is_empty())
    },
    write: |site| Ok(site.geometric.iter().map(write).collect()),
};

fn write(geometric: &GeometricProducts) -> String {
    let pairs = BeforeAfter::all(geometric);
    let words: String = pairs.iter().map(in_words).collect();
    let explained = "Every tie point's reprojection residuals give D = √(M² + σ²) per image; along the track the squares \
                     of both images add up to what the orientation explains. One MOLA spacing is taken for the whole \
                     discrepancy of a footprint, and what orientation does not explain of it is the footprints' own. \
                     Across the track the paper takes the average of both images, though its eq. 7 says the root of the \
                     sum of squares, which makes heights worse by about √2. Heights are H/B times the part across the \
                     track. After the adjustment footprints no longer lie a spacing apart, so that eq. 6 says nothing \
                     then. Eq. 8 and 9 tell how well the two images agree, never how accurate heights or places are.";
    words + &along(&pairs) + &points(&pairs) + &paragraph(explained)
}

/// What makes a footprint fall apart in two images, before the adjustment.
fn along(pairs: &[BeforeAfter]) -> String {
    let mut table = Table::new(
        "Along the track before the adjustment, pixels (eq. 6 and 7)",
        &[
            Column::Text("pair"),
            Column::Number("pixel, m"),
            Column::Number("one MOLA spacing"),
            Column::Number("orientation"),
            Column::Number("footprints"),
        ],
    );
    for pair in pairs {
        let spacings_m = pair.before.line_spacing_m;
        if let Ok(budget) = &pair.before.budget {
            let ground = match budget.ground {
                GroundPart::Resolved { along_px } => label(along_px, 2),
                GroundPart::NotResolvable => "not resolvable".to_owned(),
            };
            table.row(
                true,
                [
                    pair.name().into(),
                    label(0.5 * (spacings_m[0] + spacings_m[1]), 3).into(),
                    label(budget.total_along_px, 2).into(),
                    label(budget.along_px, 2).into(),
                    ground.into(),
                ],
            );
        }
    }
    table.finish()
}

fn points(pairs: &[BeforeAfter]) -> String {
    let mut table = Table::new(
        "Ground points (eq. 8 and 9), by two readings of the discrepancy across the track",
        &[
            Column::Text("pair"),
            Column::Text("adjustment"),
            Column::Text("across the track"),
            Column::Number("across, px"),
            Column::Number("planimetric, px"),
            Column::Number("planimetric, m"),
            Column::Number("height, px"),
            Column::Number("height, m"),
        ],
    );
    for pair in pairs {
        for (state, found) in pair.states() {
            for cells in found.budget.iter().flat_map(point_cells) {
                let head = [Cell::from(pair.name()), state.into()];
                table.row(true, head.into_iter().chain(cells));
            }
        }
    }
    table.finish()
}

fn point_cells(budget: &UncertaintyBudget) -> [[Cell; 6]; 2] {
    [
        ("average (paper)", &budget.paper_average),
        ("sum of squares (eq. 7)", &budget.equation_7),
    ]
    .map(|(reading, point)| {
        let [across, planimetric, planimetric_m, height, height_m] = [
            point.across_px,
            point.planimetric_px,
            point.planimetric_m,
            point.height_px,
            point.height_m,
        ]
        .map(|value| label(value, 2).into());
        [
            reading.into(),
            across,
            planimetric,
            planimetric_m,
            height,
            height_m,
        ]
    })
}

/// What the budgets of a pair say, or why there is none.
fn in_words(pair: &BeforeAfter) -> String {
    let mut html = String::new();
    for (state, found) in pair.states() {
        let place = format!("{}, {state} the adjustment", pair.name());
        let budget = match &found.budget {
            Ok(budget) => budget,
            Err(reason) => {
                html += &paragraph(&format!("{place}: there is no budget, for {reason}."));
                continue;
            }
        };
        let (paper, sum) = (&budget.paper_average, &budget.equation_7);
        html += &paragraph(&format!(
            "{place}: the two footprints of one ground point lie {} m apart in plan, which eq. 9 turns into {} m of height, or {} m by \
             the sum of squares.",
            label(paper.planimetric_m, 1),
            label(paper.height_m, 1),
            label(sum.height_m, 1)
        ));
    }
    if let Ok(budget) = &pair.before.budget
        && budget.ground == GroundPart::NotResolvable
    {
        html += &paragraph(
            "The part of the footprints cannot be resolved: orientation alone explains more than one MOLA spacing.",
        );
    }
    html
}
