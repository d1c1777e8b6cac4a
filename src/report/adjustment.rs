//! The combined adjustment: tables 2, 3 and 4 of Yoon & Shan 2004 for this site, and what the observations say.

use super::{
    corrections,
    html::{Cell, Column, Table, counted, heading, paragraph},
    plots::{Extent, Panel, Plot, Series, figure, label},
    reliability,
    section::Section,
};
use crate::{
    error::Result,
    geom::statistics::{BAARDA_LIMIT, Summary},
    products::{AdjustmentProducts, GeometricProducts, SiteProducts},
    stages::adjust::{
        Adjusted, AdjustmentSummary, GroundSummary, ObservationType, WORSE_THAN_CONFIGURED,
    },
};

/// Steps that the axis of the convergence has room for at least, so that its labels are whole numbers.
const STEPS_SHOWN_MIN: f64 = 8.0;

pub(super) const SECTION: Section = Section {
    title: "Combined adjustment",
    anchor: "combined-adjustment",
    appears: |site| site.adjustment().is_some(),
    write: |site| {
        let adjustment = site.adjustment();
        let written = adjustment.map(|(ties, adjustment)| write(site, &ties, &adjustment));
        Ok(written.transpose()?.unwrap_or_default())
    },
};

fn write(
    site: &SiteProducts,
    geometric: &GeometricProducts,
    adjustment: &AdjustmentProducts,
) -> Result<String> {
    let adjusted = adjustment.adjusted;
    let summary = &adjusted.summary;
    let mut html = paragraph(&overview(adjusted));
    html += &paragraph(&reliability::absolute(geometric, adjustment));
    html += &format!(
        "<div class=\"plots\">\n{}</div>\n",
        figure(&convergence(adjusted))?
    );
    html += &ground_corrections(summary);
    html += &image_coordinates(summary);
    html += &ground_sigmas(summary);
    html += &observations(summary);
    html += &heading("Corrections to the orientation");
    html += &corrections::tables(site, adjusted);
    html += &heading("Reliability");
    html += &reliability::redundancy(site, adjusted);
    html += &reliability::correlations(summary);
    html += &reliability::rejected(adjusted);
    Ok(html)
}

fn overview(adjusted: &Adjusted) -> String {
    let summary = &adjusted.summary;
    let [along, across] = summary.tie_components;
    let verdict = if summary.degrees_of_freedom == 0 {
        "nothing is redundant, so nothing can be said about the observations"
    } else if along < WORSE_THAN_CONFIGURED.recip() {
        "they agree better along the track than their standard deviations suggest"
    } else if along <= WORSE_THAN_CONFIGURED {
        "they agree along the track as their standard deviations suggest"
    } else {
        "they agree worse along the track than their standard deviations suggest"
    };
    format!(
        "{}, {} and {} were adjusted together in {}; {} degrees of freedom. The standard deviation of unit weight of tie \
         points is {} along the track and {} across it (a priori 1): {verdict}. Over all observations σ0 is {}.",
        counted(adjusted.images.len(), "image"),
        counted(summary.shots.corrections_m[0].n as usize, "footprint"),
        counted(summary.ties.corrections_m[0].n as usize, "tie point"),
        counted(summary.steps, "step"),
        summary.degrees_of_freedom,
        label(along, 3),
        label(across, 3),
        label(summary.sigma0, 3)
    )
}

/// The weighted sum of squares from step to step.
fn convergence(adjusted: &Adjusted) -> Plot {
    let squares = (0_u32..).zip(&adjusted.weighted_squares);
    let logarithms = squares
        .filter(|(_, squares)| **squares > 0.0)
        .map(|(step, squares)| (f64::from(step), squares.log10()));
    let series = Series::line("weighted sum of squares", 0, logarithms.collect());
    let ends = (
        adjusted.weighted_squares.first(),
        adjusted.weighted_squares.last(),
    );
    let words = match ends {
        (Some(first), Some(last)) => format!(
            "Weighted sum of squared residuals before each step and after the last, as a power of ten: from {first:.4e} \
             to {last:.4e}."
        ),
        _ => "No step was taken.".to_owned(),
    };
    let panel = Panel {
        height: 260,
        ..Panel::of("log10 of vᵀPv", vec![series])
    };
    Plot {
        x: Extent {
            low: 0.0,
            high: (adjusted.weighted_squares.len() as f64).max(STEPS_SHOWN_MIN),
        },
        ..Plot::of(
            "Convergence of the adjustment".to_owned(),
            words,
            "step",
            vec![panel],
        )
    }
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
        let mut cells: Vec<Cell> = vec![name.into(), of.corrections_m[0].n.to_string().into()];
        cells.extend(of.corrections_m.iter().flat_map(|axis| moments(axis, 3)));
        table.row(true, cells);
    }
    table.finish()
        + &paragraph(
            "Adjusted minus initial, Mars-fixed axes. The initial tie points are intersections with the orientation of \
             the kernels. The paper's “RMS” is the standard deviation about the mean, as here.",
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
            let mut cells: Vec<Cell> = vec![
                (&image.image).into(),
                name.into(),
                of[0].n.to_string().into(),
            ];
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

/// A kind of observation in words.
const fn kind(of: ObservationType) -> &'static str {
    match of {
        ObservationType::TieAlong => "tie points in images, along the track",
        ObservationType::TieAcross => "tie points in images, across the track",
        ObservationType::MolaHeight => "heights by the MOLA surface",
        ObservationType::MolaImage => "image coordinates of MOLA",
        ObservationType::MolaRange => "MOLA ranges",
        ObservationType::Orientation => "initial orientation",
        ObservationType::MolaGround => "ground coordinates of MOLA",
        ObservationType::TieGround => "given coordinates of tie points",
        ObservationType::Bias => "time and range biases",
        ObservationType::LaserSpot => "the laser in simultaneous images, by the mounting",
    }
}

fn observations(summary: &AdjustmentSummary) -> String {
    let mut table = Table::new(
        "Observations by kind",
        &[
            Column::Text("kind"),
            Column::Number("number"),
            Column::Number("redundancy"),
            Column::Number("per observation"),
            Column::Number("vᵀPv"),
            Column::Number("variance component"),
            Column::Number("by chance"),
            Column::Number("beyond 3.29"),
        ],
    );
    for of in &summary.types {
        let each = 100.0 * of.redundancy / of.observations.max(1) as f64;
        let component = if of.redundancy > 0.0 {
            label(of.variance_component, 3)
        } else {
            "–".to_owned()
        };
        let limits = of.variance_component_limits;
        let by_chance = if limits[1] > 0.0 {
            format!("{} to {}", label(limits[0], 2), label(limits[1], 2))
        } else {
            "–".to_owned()
        };
        table.row(
            true,
            [
                kind(of.kind).into(),
                of.observations.to_string().into(),
                label(of.redundancy, 1).into(),
                format!("{} %", label(each, 1)).into(),
                label(of.weighted_squares, 2).into(),
                component.into(),
                by_chance.into(),
                of.beyond_limit.to_string().into(),
            ],
        );
    }
    let words = format!(
        "The variance component is the standard deviation of unit weight of one kind, √(vᵀPv / redundancy): near 1 where \
         the a priori standard deviations are right, below 1 where they are too large; 99 of 100 lie \
         within the limits of χ² by chance. Robust weights keep heights below theirs. Beyond {BAARDA_LIMIT}: \
         observations that fail Baarda's test; one good one in a thousand does."
    );
    table.finish() + &paragraph(&words)
}
