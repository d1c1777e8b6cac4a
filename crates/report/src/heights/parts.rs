//! Absolute accuracy of the mean of the tie points, by its causes.

use super::super::{
    html::{Cell, Column, Markup, Table, html},
    plots::label,
};
use areograph_base::terms::Terms;
use areograph_stages::adjust::HeightSummary;

/// Place of the parts in the products.
const PARTS: &str = "adjustment.json#/adjustment/heights/mean_sigma_parts";
/// Parts below this on every axis have no row, metres: the last decimal of the table.
const SHOWN_M: f64 = 0.05;

/// The parts of the standard deviations of the mean.
pub(super) fn parts(heights: &HeightSummary, terms: Terms) -> Markup {
    let mut table = Table::new(
        "Parts of the uncertainty of the mean position of the tie points, by cause, standard deviations in metres",
        &[
            Column::Text("cause"),
            Column::Text("the same error in"),
            Column::Number("east"),
            Column::Number("north"),
            Column::Number("height"),
        ],
    );
    let all = heights.mean_sigma_parts.all();
    let shown = all
        .iter()
        .filter(|of| of.sigma_m.iter().any(|sigma_m| *sigma_m >= SHOWN_M));
    for part in shown {
        let mut cells = vec![
            Cell::from(terms.fill(part.words).into_owned()),
            Cell::from(part.shared_by),
        ];
        cells.extend(part.sigma_m.iter().enumerate().map(|(axis, sigma_m)| {
            Cell::from(label(*sigma_m, 1)).traced(format!("/{}/{axis}", part.name))
        }));
        table.row_of(PARTS, true, cells);
    }
    html! {
        (table.finish())
        p {
            "The causes are independent: the squares of their standard deviations add up to those of the mean. Averages over several \
             sites reduce only errors that these sites do not share."
        }
    }
}
