//! Position by relief.

use super::super::{
    html::{Cell, Column, Markup, Table, html, paragraph},
    plots::label,
};
use areograph_stages::adjust::{Adjusted, ProfileOffset, ReliefChoice};

/// Beyond this standard deviation relief does not determine the position, metres.
const BEYOND_USE_M: f64 = 1e3;

/// Precision of the position by relief, whether it is useful, and the result if it is used.
pub(super) fn relief(adjusted: &Adjusted, beforehand: &str) -> Markup {
    if adjusted.heights.is_none() {
        return Markup::default();
    }
    let Some(relief) = &adjusted.relief else {
        return paragraph(
            "Relief does not determine the position of the images: the surface has no slope at the tie points.",
        );
    };
    let is_imprecise = !(relief.sigma_m[0].max(relief.sigma_m[1]) <= BEYOND_USE_M);
    if is_imprecise && !relief.used && !matches!(relief.choice, ReliefChoice::Failed(_)) {
        return paragraph("Relief does not determine the position here.");
    }
    let alone = format!(
        "Relief alone determines the position to {}",
        axes(relief.sigma_m)
    );
    let [used, not_used] = ["relief is used", "relief is not used"];
    let is_used = if relief.used { used } else { not_used };
    let text = match &relief.choice {
        ReliefChoice::Configured => format!("{alone}; {is_used} (adjustment.relief_for_plan)."),
        ReliefChoice::Imprecise => {
            format!("{alone}, less precisely than {beforehand}; {not_used}.")
        }
        ReliefChoice::Compared(compared) => format!(
            "{alone}. The mean position of the tie points is known to {} without relief, and to {} with it; {is_used}.",
            axes(compared.without_sigma_m),
            axes(compared.with_sigma_m)
        ),
        ReliefChoice::Failed(reason) => {
            format!("{alone}; {not_used}, because the adjustment with relief failed: {reason}.")
        }
    };
    let caption =
        "Recorded positions of the profiles minus their positions from relief and images, metres";
    html! {
        (paragraph(&text))
        @if relief.used {
            p {
                "The standard deviations contain a small error that all profiles share. A larger one, such as an error of the \
                 frame of the altimeter, is not contained in them."
            }
        }
        (profiles(caption, &relief.profile_shifts))
    }
}

fn axes([east_m, north_m]: [f64; 2]) -> String {
    format!("±{} m E, ±{} m N", label(east_m, 0), label(north_m, 0))
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
