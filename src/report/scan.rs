//! What the ranges say of the MOLA clock: spread of the residuals against the assumed correction.

use super::{
    html::{Column, Table, paragraph},
    plots::{COLOURS, MARK, Mark, Panel, Plot, Series, figure},
    ranges::{group_title, groups},
    section::Section,
};
use crate::{error::Result, products::SiteProducts, stages::check_ranges::BiasScan};

pub(super) const SECTION: Section = Section {
    title: "Clock bias scan",
    anchor: "clock-bias-scan",
    appears: |site| {
        let mut profiles = site.ranges.profiles.iter();
        profiles.any(|ranges| ranges.scan.is_some())
    },
    write,
};

fn write(site: &SiteProducts) -> Result<String> {
    let mut figures = String::new();
    for group in groups(site) {
        if let Some(plot) = scan_plot(site, group) {
            figures += &figure(&plot)?;
        }
    }
    let words = paragraph(
        "The correction added to the time tags at which the residuals of a profile spread least. Profiles at nadir \
         hardly tell, whatever the true bias: their uncertainty is large.",
    );
    Ok([
        words,
        table(site),
        format!("<div class=\"plots\">\n{figures}</div>\n"),
    ]
    .concat())
}

fn table(site: &SiteProducts) -> String {
    let configured_s = site.config.mola_clock.correction_s();
    let mut table = Table::new(
        "Correction of least spread, seconds",
        &[
            Column::Text("profile"),
            Column::Number("best"),
            Column::Number("uncertainty"),
            Column::Number("configured"),
            Column::Number("best − configured"),
            Column::Number("smallest spread, m"),
        ],
    );
    for ranges in &site.ranges.profiles {
        let Some(scan) = &ranges.scan else { continue };
        let number = |value: Option<f64>| {
            value.map_or_else(|| "–".to_owned(), |seconds| format!("{seconds:.4}"))
        };
        let signed = |value: Option<f64>| {
            value.map_or_else(|| "–".to_owned(), |seconds| format!("{seconds:+.4}"))
        };
        let least_m = scan.spread_m.iter().copied().fold(f64::INFINITY, f64::min);
        table.row(
            true,
            [
                (&ranges.profile).into(),
                signed(scan.best_s).into(),
                number(scan.uncertainty_s).into(),
                signed(Some(configured_s)).into(),
                signed(scan.best_s.map(|best_s| best_s - configured_s)).into(),
                format!("{least_m:.4}").into(),
            ],
        );
    }
    table.finish()
}

fn scan_plot(site: &SiteProducts, group: std::ops::Range<usize>) -> Option<Plot> {
    let configured_s = site.config.mola_clock.correction_s();
    let title = format!("Clock bias scan of {}", group_title(site, &group));
    let profiles = &site.ranges.profiles[group];
    let (mut series, mut marks, mut said) = (Vec::new(), Vec::new(), Vec::new());
    for (colour, ranges) in profiles.iter().enumerate() {
        let Some(scan) = &ranges.scan else { continue };
        let points = scan.correction_s.iter().zip(&scan.spread_m);
        let points = points.map(|(correction, spread)| (*correction, *spread));
        series.push(Series::line(&*ranges.profile, colour, points.collect()));
        if let (Some(best_s), Some(uncertainty_s)) = (scan.best_s, scan.uncertainty_s) {
            marks.push(Mark {
                x: best_s,
                half_width: uncertainty_s,
                colour: COLOURS[colour % COLOURS.len()],
            });
        }
        said.push(format!("{}: {}", ranges.profile, best(scan)));
    }
    if series.is_empty() {
        return None;
    }
    marks.push(Mark {
        x: configured_s,
        half_width: 0.0,
        colour: MARK,
    });
    let mut panel = Panel::of("standard deviation, m", series);
    panel.marks = marks;
    let caption = format!(
        "{}. Red: the configured {configured_s:+.3} s; upright lines in the curve's colour: the best correction, \
         with a band as wide as its uncertainty.",
        said.join("; ")
    );
    let x = "assumed correction of the tags, s";
    Some(Plot::of(title, caption, x, vec![panel]))
}

fn best(scan: &BiasScan) -> String {
    match (scan.best_s, scan.uncertainty_s) {
        (Some(best_s), Some(uncertainty_s)) => format!("best {best_s:+.4} ± {uncertainty_s:.4} s"),
        (Some(best_s), None) => format!("best {best_s:+.4} s"),
        _ => "no minimum inside the scan".to_owned(),
    }
}
