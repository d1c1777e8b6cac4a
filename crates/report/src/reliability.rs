//! Reliability of the adjustment: absolute position, gross errors that no
//! residual shows, unknowns that cannot be separated, and rejected points.

use super::{
    heights::{WITHHELD_BECAUSE, known_beforehand, place_by},
    html::{Cell, Column, Markup, Table, counted, folded, html, paragraph},
    numbers::whole,
    plots::label,
    source::traced,
};
use areograph_base::footprints::AdjustmentModel;
use areograph_geom::statistics::Summary;
use areograph_products::{AdjustmentProducts, GeometricProducts, SiteProducts};
use areograph_stages::adjust::{
    Adjusted, AdjustmentSummary, PointKind, RejectionReason, ScalarResidual,
};

/// Error in standard deviations over the root of the redundancy number that Baarda's test at 3.29 detects in
/// eight cases of ten.
///
/// # Source
/// Baarda 1968, A testing procedure for use in geodetic networks.
const NON_CENTRALITY: f64 = 4.13;
/// Below this redundancy number a residual hides its error.
const HIDDEN: f64 = 0.1;
/// Above this one it shows the error clearly.
const SHOWN: f64 = 0.3;
/// Number of pairs of unknowns, and of blunders, listed; the rest are counted.
const CORRELATED_SHOWN: usize = 12;
const BLUNDERS_SHOWN: usize = 20;

/// Determined and undetermined quantities of the adjustment, with numbers.
pub(super) fn absolute(
    site: &SiteProducts,
    geometric: &GeometricProducts,
    adjustment: &AdjustmentProducts,
) -> Markup {
    let summary = &adjustment.adjusted.summary;
    let ties = &summary.ties;
    if ties.corrections_m[0].n == 0 {
        return paragraph("No tie point was used.");
    }
    let registration = if adjustment.images_agree {
        "Relative registration is corrected"
    } else {
        "Relative registration is not corrected"
    };
    let moved = |axis: usize| {
        let place = format!("adjustment.json#/adjustment/summary/ties/corrections_m/{axis}/mean");
        traced(&label(ties.corrections_m[axis].mean, 1), &place)
    };
    let altimeter = site.config.terms().altimeter;
    let determined = match &adjustment.adjusted.heights {
        Some(_) if site.accuracy_withheld().is_some() => html! {
            "heights follow " (altimeter) "; absolute accuracies are withheld: " (WITHHELD_BECAUSE)
        },
        Some(heights) => {
            let sigma = |axis: usize, decimals: usize| {
                let place = format!("adjustment.json#/adjustment/heights/mean_sigma_m/{axis}");
                traced(&label(heights.mean_sigma_m[axis], decimals), &place)
            };
            html! {
                "heights follow " (altimeter) " to " (sigma(2, 1)) " m on average; position is known to " (sigma(0, 0))
                " m east and " (sigma(1, 0)) " m north, from " (place_by(geometric, adjustment))
            }
        }
        None if summary.model == AdjustmentModel::Published => html! {
            "heights and position are not determined: image coordinates of footprints are computed from the \
             orientation to be adjusted"
        },
        None => html! { "heights and position are a priori, from " (known_beforehand(geometric)) },
    };
    html! {
        p {
            "Tie points moved by " (moved(0)) ", " (moved(1)) ", " (moved(2)) " m in X, Y, Z on average. "
            (registration) "; " (determined) "."
        }
    }
}

/// Observations of one kind along one axis.
struct Controlled {
    name: &'static str,
    unit: &'static str,
    sigma: f64,
    redundancies: Vec<f64>,
}

impl Controlled {
    fn all(site: &SiteProducts, adjusted: &Adjusted) -> Vec<Self> {
        let options = &site.config.adjustment;
        let views = |kind: PointKind, of: fn(&[ScalarResidual; 2]) -> f64| -> Vec<f64> {
            let views = adjusted.views.iter().filter(|view| view.kind == kind);
            views
                .map(|view| of(&[view.along_px, view.across_px]))
                .collect()
        };
        let along = |of: &[ScalarResidual; 2]| of[0].redundancy;
        let across = |of: &[ScalarResidual; 2]| of[1].redundancy;
        let ranges = adjusted.ranges.iter();
        let all = [
            (
                "tie point along the track",
                "px",
                options.tie_sigma_px[0],
                views(PointKind::Tie, along),
            ),
            (
                "tie point across the track",
                "px",
                options.tie_sigma_px[1],
                views(PointKind::Tie, across),
            ),
            (
                "footprint in the image, along the track",
                "px",
                options.footprint_sigma_px[0],
                views(PointKind::Shot, along),
            ),
            (
                "footprint in the image, across the track",
                "px",
                options.footprint_sigma_px[1],
                views(PointKind::Shot, across),
            ),
            (
                "laser range",
                "m",
                options.range_sigma_m,
                ranges.map(|range| range.residual_m.redundancy).collect(),
            ),
        ];
        let named = all.map(|(name, unit, sigma, redundancies)| Self {
            name,
            unit,
            sigma,
            redundancies,
        });
        let held = named.into_iter();
        held.filter(|of| !of.redundancies.is_empty()).collect()
    }

    fn mean(&self) -> f64 {
        Summary::of(&self.redundancies).mean
    }

    /// The smallest error that the test detects, with its unit.
    fn smallest(&self) -> String {
        let error = NON_CENTRALITY * self.sigma / self.mean().sqrt();
        if error.is_finite() {
            format!("{} {}", label(error, 1), self.unit)
        } else {
            "–".to_owned()
        }
    }
}

/// Share of a gross error visible in its own residual.
pub(super) fn redundancy(site: &SiteProducts, adjusted: &Adjusted) -> Markup {
    let all = Controlled::all(site, adjusted);
    let mut table = Table::new(
        "Redundancy: fraction of a gross error that appears in the residual of its observation",
        &[
            Column::Text("observation"),
            Column::Number("number"),
            Column::Number("shown, mean"),
            Column::Number("least"),
            Column::Number("most"),
            Column::Number("smallest detectable error"),
        ],
    );
    let mut sentences = Vec::new();
    for of in &all {
        let found = Summary::of(&of.redundancies);
        let [mean, least, most] = [found.mean, found.min, found.max].map(per_cent);
        let hidden = found.mean < HIDDEN;
        let consequence = if hidden {
            "such errors cannot be detected"
        } else {
            "only large errors are detected"
        };
        if found.mean < SHOWN {
            sentences.push(format!(
                "On average, only {mean} of a gross error of a {} appears in its residual: {consequence}.",
                of.name
            ));
        }
        table.row(
            !hidden,
            [
                of.name.into(),
                whole(found.n).into(),
                mean.into(),
                least.into(),
                most.into(),
                of.smallest().into(),
            ],
        );
    }
    let words = "Shown: redundancy number r. Smallest error detectable by Baarda's test (limit 3.29, power 80 %): \
                 4.13 σ/√r with the mean r.";
    let table = html! { (table.finish()) p { (words) } };
    html! {
        @for sentence in sentences { p { (sentence) } }
        (folded("Redundancy by kind of observation", &table))
    }
}

/// A share; one that rounds to zero is still shown.
fn per_cent(share: f64) -> String {
    if 0.0 < share && share < 5e-4 {
        "< 0.1 %".to_owned()
    } else {
        format!("{} %", label(100.0 * share, 1))
    }
}

/// Unknowns that cannot be separated.
pub(super) fn correlations(summary: &AdjustmentSummary) -> Markup {
    let mut all: Vec<_> = summary.correlated.iter().enumerate().collect();
    all.sort_by(|(_, a), (_, b)| b.2.abs().total_cmp(&a.2.abs()));
    let Some((_, (first, second, largest))) = all.first() else {
        return paragraph(
            "No correlation of two unknowns of the adjustment exceeds 0.95 in magnitude.",
        );
    };
    let sum = if *largest < 0.0 { "sum" } else { "difference" };
    let words = format!(
        "{} are correlated by more than 0.95 in magnitude, {first} and {second} most ({}): only the {sum} of the two unknowns, \
         each divided by its σ, is well determined. Do not interpret the individual values.",
        counted(all.len(), "pair") + " of unknowns",
        label(*largest, 4)
    );
    let columns = &[
        Column::Number("correlation"),
        Column::Text("unknown"),
        Column::Text("and"),
    ];
    let mut table = Table::new("Largest correlations", columns);
    for (index, (first, second, coefficient)) in all.iter().take(CORRELATED_SHOWN) {
        let coefficient = Cell::from(label(*coefficient, 4)).traced("/2");
        table.row_of(
            &format!("adjustment.json#/adjustment/summary/correlated/{index}"),
            true,
            [coefficient, first.into(), second.into()],
        );
    }
    html! { p { (words) } (table.finish()) (rest(all.len(), CORRELATED_SHOWN)) }
}

fn rest(all: usize, shown: usize) -> Markup {
    html! { @if all > shown { p { "And " (all - shown) " more." } } }
}

/// Points that the adjustment rejected.
pub(super) fn rejected(adjusted: &Adjusted) -> Markup {
    let mut blunders = Vec::new();
    let mut undetermined = [0_usize; 2];
    for point in &adjusted.rejected {
        match point.reason {
            RejectionReason::Blunder { standardised }
            | RejectionReason::Height { standardised, .. } => {
                blunders.push((&point.id, standardised));
            }
            RejectionReason::Undetermined => {
                undetermined[usize::from(point.kind == PointKind::Tie)] += 1;
            }
            RejectionReason::NotIntersected => {}
        }
    }
    let undetermined = html! {
        @for (count, what) in undetermined.into_iter().zip(["footprint", "tie point"]) {
            @if count > 0 { p { (counted(count, what)) " rejected as not determined." } }
        }
    };
    if blunders.is_empty() {
        return html! { (undetermined) p { "No tie point was rejected as a blunder." } };
    }
    let columns = &[
        Column::Text("tie point"),
        Column::Number("largest standardised residual"),
    ];
    let mut table = Table::new("Blunders, in order of detection", columns);
    for (id, standardised) in blunders.iter().take(BLUNDERS_SHOWN) {
        table.row(true, [(*id).into(), label(*standardised, 1).into()]);
    }
    html! { (undetermined) (table.finish()) (rest(blunders.len(), BLUNDERS_SHOWN)) }
}
