//! Appendix: tables 2, 3 and 4 of Yoon & Shan 2004 for this site.

use super::{
    html::{Cell, Column, Table, paragraph},
    numbers::whole,
    plots::label,
    section::Section,
};
use crate::{
    geom::statistics::Summary,
    stages::adjust::{AdjustmentSummary, GroundSummary},
};

pub(super) const SECTION: Section = Section {
    title: "Appendix: tables of Yoon & Shan 2004",
    anchor: "yoon-and-shan-2004",
    appears: |site| site.adjustment().is_some(),
    write: |site| {
        let adjustment = site.adjustment();
        Ok(adjustment.map_or_else(String::new, |(_, of)| write(&of.adjusted.summary)))
    },
};

fn write(summary: &AdjustmentSummary) -> String {
    ground_corrections(summary) + &image_coordinates(summary) + &ground_sigmas(summary)
}

/// Mean and standard deviation, or a dash each where there is nothing.
fn moments(of: &Summary, decimals: usize) -> [Cell; 2] {
    if of.n == 0 {
        return ["–".into(), "–".into()];
    }
    [of.mean, of.standard_deviation].map(|value| label(value, decimals).into())
}

const fn kinds(summary: &AdjustmentSummary) -> [(&'static str, &GroundSummary); 2] {
    [("MOLA", &summary.shots), ("tie points", &summary.ties)]
}

fn ground_corrections(summary: &AdjustmentSummary) -> String {
    let mut table = Table::new(
        "Corrections of ground points (Table 2 of Yoon & Shan 2004), metres",
        &[
            Column::Text("points"),
            Column::Number("n"),
            Column::Number("X, mean"),
            Column::Number("std"),
            Column::Number("Y, mean"),
            Column::Number("std"),
            Column::Number("Z, mean"),
            Column::Number("std"),
        ],
    );
    for (name, of) in kinds(summary) {
        let mut cells: Vec<Cell> = vec![name.into(), whole(of.corrections_m[0].n).into()];
        cells.extend(of.corrections_m.iter().flat_map(|axis| moments(axis, 3)));
        table.row(true, cells);
    }
    table.finish()
        + &paragraph(
            "Adjusted minus initial, Mars-fixed axes; initial tie points are intersected with the orientation of the \
             kernels. What the paper calls RMS is the standard deviation about the mean.",
        )
}

fn image_coordinates(summary: &AdjustmentSummary) -> String {
    let mut table = Table::new(
        "Image coordinates (Table 3 of Yoon & Shan 2004): corrections of MOLA, residuals of tie points",
        &[
            Column::Text("image"),
            Column::Text("points"),
            Column::Number("n"),
            Column::Number("along, mean"),
            Column::Number("std"),
            Column::Number("across, mean"),
            Column::Number("std"),
        ],
    );
    for image in &summary.images {
        for (name, of) in [
            ("MOLA, lines and px", &image.mola_corrections),
            ("tie points, focal-plane px", &image.tie_residuals_px),
        ] {
            let mut cells: Vec<Cell> =
                vec![(&image.image).into(), name.into(), whole(of[0].n).into()];
            cells.extend(of.iter().flat_map(|axis| moments(axis, 3)));
            table.row(true, cells);
        }
    }
    table.finish()
}

fn ground_sigmas(summary: &AdjustmentSummary) -> String {
    let mut table = Table::new(
        "A posteriori standard deviations of ground points (Table 4 of Yoon & Shan 2004), metres, means",
        &[
            Column::Text("points"),
            Column::Number("σ X"),
            Column::Number("σ Y"),
            Column::Number("σ Z"),
            Column::Number("largest σ"),
            Column::Number("σ0"),
        ],
    );
    for (name, of) in kinds(summary) {
        let largest = of.sigmas_m.iter().map(|axis| axis.max).fold(0.0, f64::max);
        let mut cells: Vec<Cell> = vec![name.into()];
        for axis in &of.sigmas_m {
            let [mean, _] = moments(axis, 3);
            cells.push(mean);
        }
        cells.push(label(largest, 3).into());
        cells.push(label(summary.sigma0, 3).into());
        table.row(true, cells);
    }
    table.finish()
}
