//! The combined adjustment: convergence, observations, corrections, reliability.

use super::{
    corrections, correlation,
    html::{Cell, Column, Markup, Table, counted, folded, html},
    many,
    numbers::whole,
    plots::{Extent, Panel, Plot, Series, figure, label},
    reliability, residuals,
    section::Section,
    source::traced,
};
use areograph_base::{error::Result, terms::Terms, verdict::CheckKind};
use areograph_geom::statistics::BAARDA_LIMIT;
use areograph_products::{AdjustmentProducts, GeometricProducts, SiteProducts};
use areograph_stages::adjust::{Adjusted, AdjustmentSummary, TypeSummary, WORSE_THAN_CONFIGURED};

/// Minimum number of iterations on the axis of the convergence, so that its labels are whole numbers.
const STEPS_SHOWN_MIN: f64 = 8.0;

pub(super) const SECTION: Section = Section {
    title: "Combined adjustment",
    anchor: "combined-adjustment",
    checks: &[
        CheckKind::TieResidualsAlong,
        CheckKind::TieResidualsAcross,
        CheckKind::VarianceComponents,
        CheckKind::TiesRejected,
        CheckKind::TiesUsed,
        CheckKind::ImagesJoined,
        CheckKind::PairsJoined,
        CheckKind::Correction,
    ],
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
) -> Result<Markup> {
    let adjusted = adjustment.adjusted;
    let summary = &adjusted.summary;
    Ok(html! {
        (overview(adjusted))
        (reliability::absolute(site, geometric, adjustment))
        div.plots { (residuals::distribution(adjusted)?) }
        (many::some_of_all(site))
        (residuals::images(site, adjusted))
        (folded("Observations by kind, and convergence", &html! {
            (observations(summary, &site.config.terms()))
            div.plots { (figure(&convergence(adjusted))?) }
        }))
        (folded("Corrections to the orientation, ranges and biases", &corrections::tables(site, adjusted)))
        h3 { "Reliability" }
        (reliability::redundancy(site, adjusted))
        (reliability::correlations(summary))
        (correlation::figures(site, adjusted)?)
        (reliability::rejected(adjusted))
    })
}

fn overview(adjusted: &Adjusted) -> Markup {
    let summary = &adjusted.summary;
    let [along, across] = summary.tie_components;
    let against_configured = |component: f64| {
        if summary.degrees_of_freedom == 0 {
            "no redundancy"
        } else if component < WORSE_THAN_CONFIGURED.recip() {
            "better than configured"
        } else if component <= WORSE_THAN_CONFIGURED {
            "as configured"
        } else {
            "worse than configured"
        }
    };
    let of = |text: &str, pointer: &str| {
        traced(
            text,
            &format!("adjustment.json#/adjustment/summary{pointer}"),
        )
    };
    html! {
        p {
            (traced(&counted(adjusted.images.len(), "image"), "manifest.json#/counts/images")) ", "
            (of(&counted(summary.shots.corrections_m[0].n as usize, "footprint"), "/shots/corrections_m/0/n")) " and "
            (of(&counted(summary.ties.corrections_m[0].n as usize, "tie point"), "/ties/corrections_m/0/n"))
            " adjusted together in " (of(&counted(summary.steps, "iteration"), "/steps")) "; "
            (of(&summary.degrees_of_freedom.to_string(), "/degrees_of_freedom"))
            " degrees of freedom. σ0 of tie points " (of(&label(along, 3), "/tie_components/0"))
            " along track (" (against_configured(along)) "), " (of(&label(across, 3), "/tie_components/1"))
            " across (" (against_configured(across)) "). σ0 of all observations: "
            (of(&label(summary.sigma0, 3), "/sigma0")) "."
        }
        @if summary.tie_scatter_px > 0.0 {
            p {
                "Tie points scatter by " (of(&label(summary.tie_scatter_px, 2), "/tie_scatter_px"))
                " px along the track in addition to their stated σ, as expected from attitude \
                 jitter. The standard deviations include this scatter along the track, and 1.4 times as much (at most \
                 1.5 px) across the track, where residuals do not reveal it."
            }
        }
    }
}

/// The weighted sum of squares from iteration to iteration.
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
            "Weighted sum of squares, from {} to {}.",
            label(*first, 1),
            label(*last, 1)
        ),
        _ => "No iteration was made.".to_owned(),
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
            "iteration",
            vec![panel],
        )
    }
}

fn observations(summary: &AdjustmentSummary, terms: &Terms<'_>) -> Markup {
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
    for (index, of) in summary.types.iter().enumerate() {
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
        // Without redundancy, the document has zeros for unknown values.
        let known = |text: String, is_known: bool, places: &str| {
            let cell = Cell::from(text);
            if is_known { cell.traced(places) } else { cell }
        };
        table.row_of(
            &format!("adjustment.json#/adjustment/summary/types/{index}"),
            true,
            [
                terms.fill(of.kind.words()).into_owned().into(),
                Cell::from(whole(of.observations)).traced("/observations"),
                Cell::from(label(of.redundancy, 1)).traced("/redundancy"),
                format!("{} %", label(each, 1)).into(),
                Cell::from(label(of.weighted_squares, 2)).traced("/weighted_squares"),
                known(component, of.redundancy > 0.0, "/variance_component"),
                known(
                    by_chance,
                    limits[1] > 0.0,
                    "/variance_component_limits/0 /variance_component_limits/1",
                ),
                Cell::from(of.beyond_limit.to_string()).traced("/beyond_limit"),
            ],
        );
    }
    let words = format!(
        "Variance component: √(vᵀPv / redundancy), near 1 if the a priori σ is correct. By chance: 99 % interval of \
         the component, lower for heights with robust weights. Beyond {BAARDA_LIMIT}: number that fails Baarda's \
         test, by chance 1 in 1000."
    );
    html! { (table.finish()) p { (words) } (outside(summary, terms)) }
}

/// The components that are outside their own interval, and what follows.
fn outside(summary: &AdjustmentSummary, terms: &Terms<'_>) -> Markup {
    let listed = |is_outside: fn(&TypeSummary) -> bool| {
        let found = summary.types.iter().filter(|of| is_outside(of));
        let found = found.map(|of| {
            format!(
                "{} {}",
                terms.fill(of.kind.words()),
                label(of.variance_component, 3)
            )
        });
        found.collect::<Vec<String>>().join(", ")
    };
    let sentences = [
        (
            listed(TypeSummary::is_above_chance),
            "Variance components above their interval (a priori standard deviations are too small)",
        ),
        (
            listed(TypeSummary::is_below_chance),
            "Variance components below their interval (a priori standard deviations are larger than the scatter, or \
             weights are robust; covariances are not reduced)",
        ),
    ];
    html! {
        @for (kinds, words) in sentences {
            @if !kinds.is_empty() { p { (words) ": " (kinds) "." } }
        }
    }
}
