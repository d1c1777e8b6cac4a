//! Position by relief.

use super::super::{
    html::{Cell, Column, Markup, Table, html, paragraph},
    plots::label,
};
use areograph_stages::adjust::{Adjusted, HeightSummary, ProfileOffset};

/// Relief is useful if its standard deviation of position is below this fraction of the a priori one.
const SHARE_OF_USE: f64 = 0.5;
/// Beyond this standard deviation relief does not determine the position, metres.
const BEYOND_USE_M: f64 = 1e3;

/// Precision of the position by relief, whether it is useful, and the result if it is used.
pub(super) fn relief(adjusted: &Adjusted, beforehand: &str) -> Markup {
    let Some(heights) = &adjusted.heights else {
        return Markup::default();
    };
    let Some(relief) = &adjusted.relief else {
        return paragraph(
            "Relief does not determine the position of the images: the surface has no slope at the tie points.",
        );
    };
    let [east_m, north_m] = relief.sigma_m;
    let axes = format!("±{} m E, ±{} m N", label(east_m, 0), label(north_m, 0));
    if relief.used {
        let caption = "Recorded positions of the profiles minus their positions from relief and images, metres";
        return html! {
            p { "Relief alone determines the position to " (axes) "; relief is used (adjustment.relief_for_plan)." }
            (profiles(caption, &relief.profile_shifts))
        };
    }
    if !(east_m.max(north_m) <= BEYOND_USE_M) {
        return paragraph("Relief does not determine the position here.");
    }
    let than = if is_of_use([east_m, north_m], heights) {
        "much better than"
    } else {
        "not much better than"
    };
    paragraph(&format!(
        "Relief alone would determine the position to {axes}, {than} {beforehand}; relief is not used \
         (adjustment.relief_for_plan)."
    ))
}

/// Whether relief is precise enough to be used.
fn is_of_use(relief_m: [f64; 2], heights: &HeightSummary) -> bool {
    let [east_m, north_m, _] = heights.mean_sigma_m;
    let is_of_use = |relief_m: f64, known_m: f64| relief_m < SHARE_OF_USE * known_m;
    is_of_use(relief_m[0], east_m) && is_of_use(relief_m[1], north_m)
}

/// Shifts of profiles; empty without any.
pub(super) fn profiles(caption: &str, offsets: &[ProfileOffset]) -> Markup {
    if offsets.is_empty() {
        return Markup::default();
    }
    let mut table = Table::new(
        caption,
        &[
            Column::Text("profile"),
            Column::Number("east"),
            Column::Number("north"),
            Column::Number("up"),
        ],
    );
    for offset in offsets {
        let mut cells: Vec<Cell> = vec![(&offset.profile).into()];
        let axes = offset.shift_m.iter().zip(&offset.sigma_m);
        cells.extend(axes.map(|(shift_m, sigma_m)| {
            Cell::from(format!("{} ± {}", label(*shift_m, 1), label(*sigma_m, 1)))
        }));
        table.row(true, cells);
    }
    table.finish()
}
