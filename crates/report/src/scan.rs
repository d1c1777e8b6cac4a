//! MOLA clock by the ranges: spread of the residuals against the assumed correction.

use super::{
    html::{Cell, Column, Markup, Table, folded, html, paragraph},
    numbers::{number, signed},
    plots::{COLOURS, MARK, Mark, Panel, Plot, Series, figure},
    ranges::{many, place, plotted},
    section::Section,
};
use areograph_base::{error::Result, verdict::CheckKind};
use areograph_products::SiteProducts;
use areograph_stages::check_ranges::BiasScan;

pub(super) const SECTION: Section = Section {
    title: "Clock bias scan",
    anchor: "clock-bias-scan",
    checks: &[CheckKind::ClockCorrection],
    appears: |site| {
        let mut profiles = site.ranges.profiles.iter();
        profiles.any(|ranges| ranges.scan.is_some())
    },
    write,
};

fn write(site: &SiteProducts) -> Result<Markup> {
    let words = paragraph(
        "The best time-tag correction minimises the spread of the residuals, with raw radii, or with \
         crossover-corrected radii if these reduce the least spread by more than 2 %. Nadir profiles constrain the \
         correction poorly.",
    );
    let plots = plotted(site).into_iter();
    let plots = plots.filter_map(|index| scan_plot(site, index));
    let figures = html! { div.plots { @for plot in plots { (figure(&plot)?) } } };
    Ok(html! {
        (words)
        @if many(site) {
            (figures)
            (folded("Table of all profiles", &table(site)))
        } @else {
            (table(site))
            (folded("Spread against correction", &figures))
        }
    })
}

fn table(site: &SiteProducts) -> Markup {
    let configured_s = site.config.altimeter_clock.correction_s();
    let mut table = Table::new(
        "Correction of least spread, seconds",
        &[
            Column::Text("profile"),
            Column::Text("radius"),
            Column::Number("best"),
            Column::Number("uncertainty"),
            Column::Number("configured"),
            Column::Number("best − configured"),
            Column::Number("least spread at a scanned correction, m"),
        ],
    );
    for (index, ranges) in site.ranges.profiles.iter().enumerate() {
        let Some(scan) = &ranges.scan else { continue };
        let plain =
            |value: Option<f64>| value.map_or_else(|| "–".to_owned(), |seconds| number(seconds, 4));
        let with_sign =
            |value: Option<f64>| value.map_or_else(|| "–".to_owned(), |seconds| signed(seconds, 4));
        let least_m = scan.spread_m.iter().copied().fold(f64::INFINITY, f64::min);
        table.row_of(
            &place(index),
            true,
            [
                (&ranges.profile).into(),
                scan.radius.word().into(),
                Cell::from(with_sign(scan.best_s)).traced("/bias_scan/best_s"),
                Cell::from(plain(scan.uncertainty_s)).traced("/bias_scan/uncertainty_s"),
                Cell::from(with_sign(Some(configured_s)))
                    .traced("ranges.json#/mola_clock/correction_s"),
                with_sign(scan.best_s.map(|best_s| best_s - configured_s)).into(),
                format!("{least_m:.4}").into(),
            ],
        );
    }
    table.finish()
}

fn scan_plot(site: &SiteProducts, index: usize) -> Option<Plot> {
    let configured_s = site.config.altimeter_clock.correction_s();
    let ranges = &site.ranges.profiles[index];
    let scan = ranges.scan.as_ref()?;
    let points = scan.correction_s.iter().zip(&scan.spread_m);
    let points = points.map(|(correction, spread)| (*correction, *spread));
    let mut panel = Panel::of(
        "standard deviation, m",
        vec![Series::line("spread of the residuals", 0, points.collect())],
    );
    if let (Some(best_s), Some(uncertainty_s)) = (scan.best_s, scan.uncertainty_s) {
        panel.marks.push(Mark {
            x: best_s,
            half_width: uncertainty_s,
            colour: COLOURS[0],
        });
    }
    panel.marks.push(Mark {
        x: configured_s,
        half_width: 0.0,
        colour: MARK,
    });
    let caption = format!(
        "{}; configured: {} s (red).",
        best(scan),
        signed(configured_s, 3)
    );
    let title = format!("Clock bias scan of {}", ranges.profile);
    let x = "assumed time-tag correction, s";
    Some(Plot::of(title, caption, x, vec![panel]))
}

fn best(scan: &BiasScan) -> String {
    match (scan.best_s, scan.uncertainty_s) {
        (Some(best_s), Some(uncertainty_s)) => {
            format!(
                "Best {} ± {} s (blue)",
                signed(best_s, 4),
                number(uncertainty_s, 4)
            )
        }
        (Some(best_s), None) => format!("Best {} s", signed(best_s, 4)),
        _ => "No minimum inside the scan".to_owned(),
    }
}
