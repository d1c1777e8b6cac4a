//! Appendix: tables 2, 3 and 4 of Yoon & Shan 2004 for this site.

use super::{
    html::{Cell, Column, Markup, Table, folded, html},
    many,
    numbers::whole,
    plots::label,
    section::Section,
};
use areograph_base::footprints::AdjustmentModel;
use areograph_geom::statistics::Summary;
use areograph_products::SiteProducts;
use areograph_stages::adjust::{AdjustmentSummary, GroundSummary};

pub(super) const SECTION: Section = Section {
    title: "Appendix: tables of Yoon & Shan 2004",
    anchor: "yoon-and-shan-2004",
    checks: &[],
    appears: |site| site.adjustment().is_some(),
    write: |site| {
        let adjustment = site.adjustment();
        Ok(adjustment.map_or_else(Markup::default, |(_, of)| write(site, &of.adjusted.summary)))
    },
};

/// Elements of Table 3 of the paper that these models do not have.
fn departure(summary: &AdjustmentSummary) -> &'static str {
    match summary.model {
        AdjustmentModel::Published => {
            "Across the track, this is not the published model: residuals refer to the line that sees the point, whereas \
             Yoon & Shan 2004 use the measured line. Their across-track mean corrections of MOLA footprints, −2.711 \
             to 3.286 px at Gusev and Isidis, result from the skew of the flight against the measured line and vanish \
             here. Their σ0 of 1.01 to 1.06 is not comparable."
        }
        AdjustmentModel::MolaSurface => {
            "In this model, image coordinates of footprints are not observations; their rows are empty. The published model \
             (adjustment.model) fills these rows."
        }
    }
}

fn write(site: &SiteProducts, summary: &AdjustmentSummary) -> Markup {
    let tables = html! {
        (ground_corrections(summary))
        (image_coordinates(site, summary))
        (ground_sigmas(summary))
    };
    folded("Tables 2, 3 and 4 for this site", &tables)
}

/// Place of the summary in the products.
const PLACE: &str = "adjustment.json#/adjustment/summary";

/// Mean and standard deviation at `place` below the row's, or dashes for missing values.
fn moments(of: &Summary, place: &str) -> [Cell; 2] {
    if of.n == 0 {
        return ["–".into(), "–".into()];
    }
    let values = [
        (of.mean, "mean"),
        (of.standard_deviation, "standard_deviation"),
    ];
    values.map(|(value, name)| Cell::from(label(value, 3)).traced(format!("{place}/{name}")))
}

/// Footprints and tie points, each with its place below the summary.
const fn kinds(summary: &AdjustmentSummary) -> [(&'static str, &'static str, &GroundSummary); 2] {
    [
        ("footprints", "shots", &summary.shots),
        ("tie points", "ties", &summary.ties),
    ]
}

fn ground_corrections(summary: &AdjustmentSummary) -> Markup {
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
    for (name, place, of) in kinds(summary) {
        let count = Cell::from(whole(of.corrections_m[0].n)).traced("/corrections_m/0/n");
        let mut cells: Vec<Cell> = vec![name.into(), count];
        let axes = of.corrections_m.iter().enumerate();
        cells.extend(axes.flat_map(|(at, axis)| moments(axis, &format!("/corrections_m/{at}"))));
        table.row_of(&format!("{PLACE}/{place}"), true, cells);
    }
    html! {
        (table.finish())
        p {
            "Adjusted minus initial, body-fixed axes. The RMS of Yoon & Shan 2004 is the standard deviation about the mean."
        }
    }
}

fn image_coordinates(site: &SiteProducts, summary: &AdjustmentSummary) -> Markup {
    let mut table = Table::new(
        "Image coordinates (Table 3 of Yoon & Shan 2004): corrections of footprints, residuals of tie points",
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
    for (index, _) in many::shown(site) {
        let Some(image) = summary.images.get(index) else {
            continue;
        };
        let [shots, ties] = ["mola_corrections", "tie_residuals_px"];
        for (name, place, of) in [
            ("footprints, lines and px", shots, &image.mola_corrections),
            ("tie points, focal-plane px", ties, &image.tie_residuals_px),
        ] {
            let count = Cell::from(whole(of[0].n)).traced("/0/n");
            let mut cells: Vec<Cell> = vec![(&image.image).into(), name.into(), count];
            let axes = of.iter().enumerate();
            cells.extend(axes.flat_map(|(at, axis)| moments(axis, &format!("/{at}"))));
            table.row_of(&format!("{PLACE}/images/{index}/{place}"), true, cells);
        }
    }
    html! { (many::some_of_all(site)) (table.finish()) p { (departure(summary)) } }
}

fn ground_sigmas(summary: &AdjustmentSummary) -> Markup {
    let mut table = Table::new(
        "A posteriori standard deviations of ground points (Table 4 of Yoon & Shan 2004): means, metres",
        &[
            Column::Text("points"),
            Column::Number("σ X"),
            Column::Number("σ Y"),
            Column::Number("σ Z"),
            Column::Number("largest σ"),
            Column::Number("σ0"),
        ],
    );
    for (name, place, of) in kinds(summary) {
        let axes = of.sigmas_m.iter().enumerate();
        let largest = axes
            .clone()
            .max_by(|(_, a), (_, b)| a.max.total_cmp(&b.max));
        let mut cells: Vec<Cell> = vec![name.into()];
        for (at, axis) in axes {
            let [mean, _] = moments(axis, &format!("/sigmas_m/{at}"));
            cells.push(mean);
        }
        let largest = largest
            .map(|(at, axis)| Cell::from(label(axis.max, 3)).traced(format!("/sigmas_m/{at}/max")));
        cells.extend(largest);
        cells.push(Cell::from(label(summary.sigma0, 3)).traced(format!("{PLACE}/sigma0")));
        table.row_of(&format!("{PLACE}/{place}"), true, cells);
    }
    table.finish()
}
