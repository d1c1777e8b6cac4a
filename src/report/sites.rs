//! The page over all sites of an output folder.

use super::{
    fidelity::FIDELITY_FILE,
    html::{Cell, Column, Table, Tone, link, page, paragraph, verdict},
};
use crate::units::RADIANS_PER_ARCSECOND;

/// What the page says of one site.
#[derive(Debug, Clone, PartialEq)]
pub struct SiteLine {
    /// Name of the site's folder.
    pub folder: String,
    /// Its products; `None` when it has none, because a run did not come to its end.
    pub products: Option<SiteSummary>,
    /// Why the last run failed, if it did; the products are then of an earlier run.
    pub failure: Option<String>,
}

/// Products of one site in one line.
#[derive(Debug, Clone, PartialEq)]
pub struct SiteSummary {
    /// The verdict in words, as the program has it everywhere.
    pub verdict: &'static str,
    /// Why the site is invalid; empty when it is valid.
    pub reasons: Vec<String>,
    /// What a reader must weigh.
    pub remarks: Vec<String>,
    /// Shots, profiles, images.
    pub counts: [u64; 3],
    /// Largest |mean| of range − distance of a profile, metres.
    pub range_mean_m: Option<f64>,
    /// Largest second-order position RMSE of an image, metres.
    pub position_rmse_m: Option<f64>,
    /// Largest second-order pointing RMSE of an image, radians.
    pub pointing_rmse_rad: Option<f64>,
    /// Largest along-track parallax of two images at their tie points, metres.
    pub along_track_parallax_m: Option<f64>,
    /// The same with the adjusted orientation, metres.
    pub adjusted_along_track_parallax_m: Option<f64>,
    /// When the products were published.
    pub finished_utc: String,
    /// Version of the program that made them.
    pub version: String,
}

/// The page over `sites`, which stand in the order given.
#[must_use]
pub fn sites_page(sites: &[SiteLine]) -> String {
    let with = |required: Tone| sites.iter().filter(|site| tone(site) == required).count();
    let unfinished = sites.iter().filter(|site| site.products.is_none()).count();
    let (valid, remarks) = (with(Tone::Good), with(Tone::Remarks));
    let invalid = with(Tone::Bad) - unfinished;
    let headline = format!(
        "{} sites: {invalid} invalid or failed, {unfinished} without products, {remarks} valid with remarks, {valid} valid.",
        sites.len()
    );
    let overall = if invalid + unfinished > 0 {
        Tone::Bad
    } else if remarks > 0 {
        Tone::Remarks
    } else {
        Tone::Good
    };
    let fidelity = format!(
        "<p>{}: every number that the papers print, with areograph's beside it.</p>\n",
        link(FIDELITY_FILE, "Fidelity to the papers")
    );
    let words = paragraph(
        "Each name leads to the site's report. Figures are the largest of the site: |mean| of range − distance over \
         its profiles, RMSE of the second-order models over its images.",
    );
    page(
        "Sites",
        &(verdict(overall, &headline, "") + &table(sites) + &words + &fidelity),
        &[],
    )
}

fn tone(site: &SiteLine) -> Tone {
    match &site.products {
        None => Tone::Bad,
        Some(_) if site.failure.is_some() => Tone::Bad,
        Some(summary) if !summary.reasons.is_empty() => Tone::Bad,
        Some(summary) if !summary.remarks.is_empty() => Tone::Remarks,
        Some(_) => Tone::Good,
    }
}

fn table(sites: &[SiteLine]) -> String {
    let mut table = Table::new(
        "Sites",
        &[
            Column::Text("site"),
            Column::Text("verdict"),
            Column::Text("because"),
            Column::Number("shots"),
            Column::Number("profiles"),
            Column::Number("images"),
            Column::Number("range, m"),
            Column::Number("position, m"),
            Column::Number("pointing, ″"),
            Column::Number("images apart, m"),
            Column::Number("adjusted, m"),
            Column::Text("published (UTC)"),
            Column::Text("version"),
        ],
    );
    for site in sites {
        table.row(tone(site) != Tone::Bad, cells(site));
    }
    table.finish()
}

fn cells(site: &SiteLine) -> Vec<Cell> {
    let Some(summary) = &site.products else {
        let because = site
            .failure
            .as_deref()
            .map_or("the last run did not finish; see its log", first_line);
        return vec![(&site.folder).into(), "no products".into(), because.into()];
    };
    let (word, why) = match &site.failure {
        Some(failure) => (
            "last run failed; products of an earlier run",
            first_line(failure).to_owned(),
        ),
        None => (summary.verdict, because(summary)),
    };
    let figure = |value: Option<f64>, scale: f64| -> Cell {
        value
            .map_or_else(|| "–".to_owned(), |value| format!("{:.3}", value * scale))
            .into()
    };
    let mut cells = vec![
        Cell::Html(link(
            &format!("{}/report/index.html", site.folder),
            &site.folder,
        )),
        word.into(),
        why.into(),
    ];
    cells.extend(summary.counts.map(|count| count.to_string().into()));
    cells.push(figure(summary.range_mean_m, 1.0));
    cells.push(figure(summary.position_rmse_m, 1.0));
    cells.push(figure(
        summary.pointing_rmse_rad,
        RADIANS_PER_ARCSECOND.recip(),
    ));
    cells.push(figure(summary.along_track_parallax_m, 1.0));
    cells.push(figure(summary.adjusted_along_track_parallax_m, 1.0));
    cells.push((&summary.finished_utc).into());
    cells.push((&summary.version).into());
    cells
}

fn first_line(text: &str) -> &str {
    text.lines().next().unwrap_or_default()
}

/// The first reason or remark, and how many more there are.
fn because(summary: &SiteSummary) -> String {
    let mut all = summary.reasons.iter().chain(&summary.remarks);
    let Some(first) = all.next() else {
        return String::new();
    };
    match all.count() {
        0 => first.clone(),
        more => format!("{first}; and {more} more"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_worst_is_said_first() {
        let summary = |verdict, reasons: &[&str]| SiteSummary {
            verdict,
            reasons: reasons.iter().map(ToString::to_string).collect(),
            remarks: Vec::new(),
            counts: [10, 1, 0],
            range_mean_m: Some(1.25),
            position_rmse_m: None,
            pointing_rmse_rad: None,
            along_track_parallax_m: None,
            adjusted_along_track_parallax_m: None,
            finished_utc: "2026-01-01T00:00:00Z".to_owned(),
            version: "1".to_owned(),
        };
        let line = |folder: &str, products| SiteLine {
            folder: folder.to_owned(),
            products,
            failure: None,
        };
        let page = sites_page(&[
            line("good", Some(summary("valid", &[]))),
            line("bad", Some(summary("INVALID", &["mean of <x>", "more"]))),
            line("half", None),
            SiteLine {
                failure: Some("a <kernel> is gone\n  what to do: look".to_owned()),
                ..line("stale", Some(summary("valid", &[])))
            },
        ]);
        assert!(page.contains(
            "4 sites: 2 invalid or failed, 1 without products, 0 valid with remarks, 1 valid."
        ));
        assert!(page.contains("mean of &lt;x&gt;; and 1 more"));
        assert!(page.contains("href=\"good/report/index.html\""));
        assert!(page.contains("a &lt;kernel&gt; is gone</td>"));
        assert_eq!(page.matches("<tr class=\"invalid\">").count(), 3);
    }
}
