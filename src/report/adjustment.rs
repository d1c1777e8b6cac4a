//! The combined adjustment: how it converged, what the observations say, corrections, reliability.

use super::{
    corrections, correlation,
    html::{Column, Table, counted, heading, paragraph},
    numbers::whole,
    plots::{Extent, Panel, Plot, Series, figure, label},
    reliability, residuals,
    section::Section,
};
use crate::{
    error::Result,
    geom::statistics::BAARDA_LIMIT,
    products::{AdjustmentProducts, GeometricProducts, SiteProducts},
    stages::adjust::{Adjusted, AdjustmentSummary, ObservationType, WORSE_THAN_CONFIGURED},
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
        "<div class=\"plots\">\n{}{}</div>\n",
        residuals::distribution(adjusted)?,
        figure(&convergence(adjusted))?
    );
    html += &residuals::images(adjusted);
    html += &observations(summary);
    html += &heading("Corrections to the orientation");
    html += &corrections::tables(site, adjusted);
    html += &heading("Reliability");
    html += &reliability::redundancy(site, adjusted);
    html += &reliability::correlations(summary);
    html += &correlation::figures(adjusted)?;
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
            "Weighted sum of squared residuals before each step and after the last: from {} to {}.",
            label(*first, 1),
            label(*last, 1)
        ),
        _ => "No step was taken.".to_owned(),
    };
    let panel = Panel {
        height: 260,
        log: true,
        ..Panel::of("vᵀPv", vec![series])
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
                whole(of.observations).into(),
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
        "Variance component: √(vᵀPv / redundancy), 1 for right a priori standard deviations, with its 99 % interval; robust \
         weights lower that of heights. Beyond {BAARDA_LIMIT}: failed Baarda's test, by chance one in a thousand."
    );
    table.finish() + &paragraph(&words)
}
