//! The page of all sites in an output folder.

use chrono::{DateTime, FixedOffset};

use super::{
    fidelity::FIDELITY_FILE,
    html::{Cell, Column, Markup, Table, Tone, counted, html, link, page, verdict},
    numbers::{number, whole},
    sites_map::{self, Place},
    source::traced,
    uncertainty,
};
use areograph_base::{body::Body, error::Result};
use areograph_geom::uncertainty::UncertaintyBudget;

/// Entry of one site on the page.
#[derive(Debug, Clone, PartialEq)]
pub struct SiteLine {
    /// Name of the site's folder.
    pub folder: String,
    /// Its products; `None` if it has none, because a run did not finish.
    pub products: Option<SiteSummary>,
    /// Error of the last run, if it failed; the products are then of an earlier run.
    pub failure: Option<String>,
}

/// Products of one site in one line.
#[derive(Debug, Clone, PartialEq)]
pub struct SiteSummary {
    /// The verdict in words, the same throughout the program.
    pub verdict: &'static str,
    /// Reasons why the site is invalid; empty when it is valid.
    pub reasons: Vec<String>,
    /// Remarks for the reader.
    pub remarks: Vec<String>,
    /// Shots, profiles, images.
    pub counts: [u64; 3],
    /// Mean of range − distance for the profile with the largest |mean|, metres.
    pub range_mean_m: Option<f64>,
    /// Largest along-track parallax of two images at their tie points, with the orientation from the kernels and the
    /// adjusted one, metres.
    pub images_apart_m: [Option<f64>; 2],
    /// Median height of tie points above the MOLA surface, below it negative, likewise, metres.
    pub height_off_m: [Option<f64>; 2],
    /// The body.
    pub body: Body,
    /// East longitude and areocentric latitude of the middle of the first window that is a box, degrees.
    pub place_deg: Option<(f64, f64)>,
    /// The uncertainty budget of each of its pairs before the adjustment.
    pub budgets: Vec<UncertaintyBudget>,
    /// Results of the previous products.
    pub earlier: Option<Earlier>,
    /// Time at which the products were published.
    pub finished_utc: String,
    /// Version of the program that made them.
    pub version: String,
}

/// Results of the previous products.
#[derive(Debug, Clone, PartialEq)]
pub struct Earlier {
    /// The verdict in words.
    pub verdict: &'static str,
    /// Heights off the laser surface, images apart, both adjusted, and range − distance, as in [`SiteSummary`].
    pub figures_m: [Option<f64>; 3],
    /// Time at which they were published.
    pub finished_utc: String,
    /// Path of their manifest, from the page.
    pub manifest: String,
}

/// The page of `sites`, in the given order.
///
/// # Errors
/// A map that cannot be drawn, which is a bug in areograph.
pub fn sites_page(sites: &[SiteLine]) -> Result<String> {
    let with = |required: Tone| sites.iter().filter(|site| tone(site) == required).count();
    let unfinished = sites.iter().filter(|site| site.products.is_none()).count();
    let (valid, remarks) = (with(Tone::Good), with(Tone::Remarks));
    let invalid = with(Tone::Bad) - unfinished;
    let parts = [
        (invalid, "invalid or failed"),
        (unfinished, "without products"),
        (remarks, "valid with remarks"),
        (valid, "valid"),
    ];
    let parts = parts.into_iter().filter(|(count, _)| *count > 0);
    let parts: Vec<String> = parts.map(|(count, of)| format!("{count} {of}")).collect();
    let headline = format!("{}: {}.", counted(sites.len(), "site"), parts.join(", "));
    let overall = if invalid + unfinished > 0 {
        Tone::Bad
    } else if remarks > 0 {
        Tone::Remarks
    } else {
        Tone::Good
    };
    let words = "Height offset: median height of the tie points above the laser surface. Image distance: along-track \
         disagreement of the worst pair. Range − distance: largest mean of a profile.";
    let budgets = sites.iter().filter_map(|site| site.products.as_ref());
    let budgets: Vec<UncertaintyBudget> = budgets.flat_map(|of| of.budgets.clone()).collect();
    let lead = html! {
        (verdict(overall, &headline, &Markup::default()))
        div.plots { @for (_, body) in Body::WORDS { (sites_map::figure(body, &places(sites, body), sites_map::OF_WINDOWS)?) } }
        (table(sites))
        p { (words) }
        (uncertainty::of_sites(&budgets))
        p {
            (link(FIDELITY_FILE, "Fidelity to the papers"))
            ": published numbers with the results of areograph, by kind of evidence."
        }
    };
    Ok(page("Sites", &lead, &[]))
}

/// The sites on a body with a known position.
fn places(sites: &[SiteLine], body: Body) -> Vec<Place<'_>> {
    let placed = sites.iter().filter_map(|site| {
        let products = site
            .products
            .as_ref()
            .filter(|products| products.body == body)?;
        Some(Place {
            name: &site.folder,
            tone: tone(site),
            place_deg: products.place_deg?,
        })
    });
    placed.collect()
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

fn table(sites: &[SiteLine]) -> Markup {
    let mut table = Table::of_cards(
        "Sites",
        &[
            Column::Text("site"),
            Column::Text("verdict"),
            Column::Number("shots"),
            Column::Number("profiles"),
            Column::Number("images"),
            Column::Number("height offset, m: before → adjusted"),
            Column::Number("image distance, m: before → adjusted"),
            Column::Number("range − distance, m"),
            Column::Text("compared with the previous run"),
            Column::Text("published (UTC)"),
        ],
    );
    let published = sites.iter().filter_map(|site| site.products.as_ref());
    let newest = published.filter_map(SiteSummary::finished).max();
    for site in sites {
        let place = format!("{}/manifest.json#", site.folder);
        table.row_of(&place, tone(site) != Tone::Bad, cells(site, newest));
    }
    table.finish()
}

impl SiteSummary {
    fn finished(&self) -> Option<DateTime<FixedOffset>> {
        DateTime::parse_from_rfc3339(&self.finished_utc).ok()
    }

    /// Age of the products relative to the newest ones of all sites; empty for these.
    fn age(&self, newest: Option<DateTime<FixedOffset>>) -> String {
        let older = newest
            .zip(self.finished())
            .map(|(newest, own)| newest - own);
        older.map_or_else(String::new, |older| {
            match (older.num_days(), older.num_hours(), older.num_minutes()) {
                (0, 0, 0) => String::new(),
                (0, 0, minutes) => format!("{minutes} min before the newest"),
                (0, hours, _) => format!("{hours} h before the newest"),
                (days, ..) => format!("{} before the newest", counted(days as usize, "day")),
            }
        })
    }
}

/// Candidates for the headline number, with their names among the figures of a manifest.
const HEADLINES: [(&str, &str); 3] = [
    ("height offset", "adjusted_height_off_surface_m"),
    ("image distance", "adjusted_along_track_parallax_m"),
    ("range − distance", "range_mean_m"),
];

impl SiteSummary {
    /// Change of verdict and headline number since the previous products.
    fn trend(&self) -> Cell {
        let Some(before) = &self.earlier else {
            return dash().into();
        };
        let verdict = if before.verdict == self.verdict {
            format!("{} as before", self.verdict)
        } else {
            format!("{} → {}", before.verdict, self.verdict)
        };
        let now_m = [
            self.height_off_m[1],
            self.images_apart_m[1],
            self.range_mean_m,
        ];
        let pairs = before.figures_m.into_iter().zip(now_m).zip(HEADLINES);
        let mut moves = pairs.filter_map(|((before_m, now_m), of)| Some((before_m?, now_m?, of)));
        let number = moves.next().map(|(before_m, now_m, (what, name))| {
            let [was, is] = [before_m, now_m].map(|metres| number(metres, 2));
            let now = figure_place(name, now_m);
            if was == is {
                return traced(&format!("{what} {is} m"), &now);
            }
            let places = format!("{}#{} {now}", before.manifest, figure_place(name, before_m));
            traced(&format!("{what} {was} → {is} m"), &places)
        });
        html! {
            (verdict)
            @if let Some(number) = number { br; small { (number) } }
            br; small { "since " (minute(&before.finished_utc)) }
        }
        .into()
    }
}

fn cells(site: &SiteLine, newest: Option<DateTime<FixedOffset>>) -> Vec<Cell> {
    let explained = |word: &str, why: &str| -> Cell {
        html! { (word) @if !why.is_empty() { br; small { (why) } } }.into()
    };
    let Some(summary) = &site.products else {
        let because = site
            .failure
            .as_deref()
            .map_or("the last run did not finish; see its log", first_line);
        return vec![(&site.folder).into(), explained("no products", because)];
    };
    let (word, why) = match &site.failure {
        Some(failure) => (
            "last run failed; products of an earlier run",
            first_line(failure).to_owned(),
        ),
        None => (summary.verdict, because(summary)),
    };
    let mut cells = vec![
        link(&format!("{}/report/index.html", site.folder), &site.folder).into(),
        explained(word, &why),
    ];
    let counts = summary
        .counts
        .into_iter()
        .zip(["footprints", "profiles", "images"]);
    cells.extend(
        counts.map(|(count, name)| Cell::from(whole(count)).traced(format!("/counts/{name}"))),
    );
    cells.push(moved(summary.height_off_m, "height_off_surface_m"));
    cells.push(moved(summary.images_apart_m, "along_track_parallax_m"));
    cells.push(summary.range_mean_m.map_or_else(
        || dash().into(),
        |mean_m| Cell::from(number(mean_m, 2)).traced(figure_place("range_mean_m", mean_m)),
    ));
    cells.push(summary.trend());
    // Only what distinguishes a site from the others.
    let age = Some(summary.age(newest)).filter(|age| !age.is_empty());
    let of_another = (summary.version != env!("CARGO_PKG_VERSION"))
        .then(|| format!("areograph {}", summary.version));
    let remarks: Vec<String> = age.into_iter().chain(of_another).collect();
    let published = html! {
        span.short { (minute(&summary.finished_utc)) }
        @if !remarks.is_empty() { br; small { (remarks.join(", ")) } }
    };
    cells.push(published.into());
    cells
}

/// Day and minute of an instant.
fn minute(utc: &str) -> String {
    utc.get(..16).unwrap_or(utc).replace('T', " ")
}

/// A figure before and after the adjustment, with a dash where there is none.
fn moved([before, after]: [Option<f64>; 2], name: &str) -> Cell {
    let text = |value: Option<f64>| value.map_or_else(dash, |value| number(value, 1));
    let both = Cell::from(match (before, after) {
        (None, None) => dash(),
        _ => format!("{} → {}", text(before), text(after)),
    });
    let place = |name: &str, value: Option<f64>| figure_place(name, value.unwrap_or(0.0));
    let [before_place, after_place] = [
        place(name, before),
        place(&format!("adjusted_{name}"), after),
    ];
    match (before, after) {
        (Some(_), Some(_)) => both.traced(format!("{before_place} {after_place}")),
        (Some(_), None) => both.traced(before_place),
        (None, _) => both.traced(after_place),
    }
}

/// Place of a figure in a manifest, which keeps it without its sign.
fn figure_place(name: &str, value: f64) -> String {
    let sign = if value < 0.0 { "*-1" } else { "" };
    format!("/figures/{name}{sign}")
}

fn dash() -> String {
    "–".to_owned()
}

fn first_line(text: &str) -> &str {
    text.lines().next().unwrap_or_default()
}

/// The first reason or remark, and the number of others.
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
            range_mean_m: Some(-1.25),
            images_apart_m: [Some(261.2), Some(0.04)],
            height_off_m: [None, None],
            body: Body::Mars,
            place_deg: Some((175.3, -14.6)),
            budgets: Vec::new(),
            earlier: None,
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
        ])
        .unwrap();
        assert!(page.contains("4 sites: 2 invalid or failed, 1 without products, 1 valid."));
        assert!(page.contains("mean of &lt;x&gt;; and 1 more"));
        assert!(page.contains("href=\"good/report/index.html\""));
        assert!(page.contains("<small>a &lt;kernel&gt; is gone</small>"));
        assert!(page.contains("261.2 → 0.0"));
        // Change since the previous products; their verdict is shown even if it is the same.
        let mut moved = summary("valid", &[]);
        moved.earlier = Some(Earlier {
            verdict: "INVALID",
            figures_m: [None, Some(31.5), Some(-1.25)],
            finished_utc: String::new(),
            manifest: "moved/before.json".to_owned(),
        });
        let trend = sites_page(&[line("moved", Some(moved.clone()))]).unwrap();
        assert!(trend.contains("INVALID → valid<br>"));
        assert!(trend.contains("image distance 31.50 → 0.04 m"));
        moved.verdict = "INVALID";
        moved.images_apart_m = [None, None];
        let trend = sites_page(&[line("moved", Some(moved))]).unwrap();
        assert!(trend.contains("INVALID as before<br>"));
        assert!(trend.contains("range − distance −1.25 m"));
        assert!(trend.contains("data-from=\"/figures/range_mean_m*-1\""));
        // All of the three ran at the same time, by another version; an older one is marked.
        assert_eq!(page.matches("<small>areograph 1</small>").count(), 3);
        let mut older = summary("valid", &[]);
        older.finished_utc = "2025-12-29T21:00:00Z".to_owned();
        let newest = summary("valid", &[]).finished();
        assert_eq!(older.age(newest), "2 days before the newest");
        // The three sites with products are on the map too.
        let map = page
            .split("<svg")
            .nth(1)
            .unwrap()
            .split("</svg>")
            .next()
            .unwrap();
        assert!(
            ["good", "bad", "stale"]
                .iter()
                .all(|name| map.contains(name))
        );
        assert_eq!(page.matches("<tr class=\"invalid\"").count(), 3);
    }
}
