//! Two readings of the along-track disagreement of images, and the positions of tie points by each.

use super::super::{
    html::{Cell, Column, Markup, Table, html, paragraph},
    plots::label,
};
use areograph_stages::adjust::{Adjusted, OtherReading};

/// Both readings side by side, if the images disagree significantly; without standard deviations where the accuracy
/// `is_withheld`.
pub(super) fn two_readings(adjusted: &Adjusted, is_withheld: bool) -> Markup {
    match &adjusted.other_reading {
        None => Markup::default(),
        Some(Err(reason)) => paragraph(&format!(
            "The other reading of the along-track disagreement (adjustment.attitude_clock) gave no result: {reason}."
        )),
        Some(Ok(other)) => html! { (table(adjusted, other, is_withheld)) p { (WORDS) } },
    }
}

const WORDS: &str = "Tie points show the offset between images, but not which image is in error. An offset of \
                     the attitude clock rotates images that track nadir, but not images that were held inertially.";

fn table(adjusted: &Adjusted, other: &OtherReading, is_withheld: bool) -> Markup {
    let mut table = Table::new(
        "Two readings of the along-track disagreement, metres",
        &[
            Column::Text("reading"),
            Column::Text("products"),
            Column::Number("east"),
            Column::Number("north"),
            Column::Number("up"),
            Column::Number("σ east"),
            Column::Number("σ north"),
            Column::Number("σ up"),
        ],
    );
    let heights = adjusted.heights.as_ref();
    let own_sigma_m = heights.map(|heights| heights.mean_sigma_m);
    let rows = [
        (
            "heights",
            adjusted.attitude_clock_s,
            None,
            own_sigma_m,
            "follow it",
        ),
        (
            "other_reading",
            other.attitude_clock_s,
            Some(other.moved_m),
            other.mean_sigma_m,
            "do not",
        ),
    ];
    for (place, clock_s, moved_m, sigma_m, products) in rows {
        let mut cells: Vec<Cell> = vec![reading(clock_s, is_withheld).into(), products.into()];
        let axes = [0, 1, 2];
        cells.extend(axes.map(|axis| {
            // Differences are from the reading that the products follow.
            let metres = moved_m.map_or_else(|| "–".to_owned(), |moved_m| label(moved_m[axis], 1));
            Cell::from(metres).traced(format!("/moved_m/{axis}"))
        }));
        cells.extend(axes.map(|axis| {
            if is_withheld {
                return Cell::from("withheld");
            }
            let sigma_m = sigma_m.map(|sigma_m| format!("±{}", label(sigma_m[axis], 1)));
            let sigma_m = Cell::from(sigma_m.unwrap_or_else(|| "–".to_owned()));
            sigma_m.traced(format!("/mean_sigma_m/{axis}"))
        }));
        table.row_of(&format!("adjustment.json#/adjustment/{place}"), true, cells);
    }
    table.finish()
}

fn reading(clock_s: Option<(f64, f64)>, is_withheld: bool) -> String {
    clock_s.map_or_else(
        || "shared: all images equally likely to be in error".to_owned(),
        |(offset_s, sigma_s)| {
            let sigma = if is_withheld {
                String::new()
            } else {
                format!(" ± {}", label(sigma_s, 2))
            };
            let offset = label(offset_s, 2);
            format!("attitude clock offset of {offset}{sigma} s")
        },
    )
}
