//! The page of a campaign: verdicts and pooled numbers, then figures, then bounded lists; tables hold everything.
//!
//! The page stays small for any number of sites: figures have a limited number of points, lists of sites and of the worst
//! rows end after ten.

mod figures;
mod lists;
mod tables;

use super::{
    html::{Column, Markup, Section, Table, Tone, counted, html, link, page, paragraph, verdict},
    numbers::{number, signed, whole},
    uncertainty,
};
use areograph_base::error::Result;
use areograph_geom::robust_mean::RobustMean;
use areograph_stages::pool_sites::{
    CampaignRows, CampaignSummary, PhaseSummary, Quantity, SiteCounts,
};

/// The page of a campaign, in a folder beside the folders of its sites.
///
/// # Errors
/// A plot that cannot be drawn, which is a bug in areograph.
pub fn campaign_page(summary: &CampaignSummary, rows: &CampaignRows) -> Result<String> {
    let sections = [
        Section::new("Mission phases", phases(summary)),
        Section::new("Misregistration", figures::misregistration(rows)?),
        Section::new("Pooled tables", tables::pooled(summary)),
        Section::new("Worst pairs and profiles", lists::worst(rows)),
        Section::new("Sites without a valid result", lists::not_valid(rows)),
        Section::new("How it was pooled", how(summary)),
    ];
    let lead = html! {
        (verdict(tone(&summary.sites), &headline(&summary.sites), &biases(summary)))
        (key_numbers(summary))
        (downloads())
        div.plots { (figures::map(rows)?) }
    };
    Ok(page(
        &format!("Campaign {}", summary.campaign),
        &lead,
        &sections,
    ))
}

/// The worst state that a site has.
fn tone(counts: &SiteCounts) -> Tone {
    let valid = counts.valid + counts.valid_with_remarks;
    if valid < counts.sites {
        Tone::Bad
    } else if counts.valid_with_remarks > 0 {
        Tone::Remarks
    } else {
        Tone::Good
    }
}

fn headline(counts: &SiteCounts) -> String {
    let parts = [
        (counts.failed, "failed"),
        (counts.absent, "without products"),
        (counts.unusable, "with unusable products"),
        (counts.invalid, "invalid"),
        (counts.valid_with_remarks, "valid with remarks"),
        (counts.valid, "valid"),
    ];
    let parts = parts.into_iter().filter(|(count, _)| *count > 0);
    let parts: Vec<String> = parts
        .map(|(count, of)| format!("{} {of}", whole(count)))
        .collect();
    let sites = counted(counts.sites as usize, "site");
    if parts.is_empty() {
        return format!("{sites}.");
    }
    format!("{sites}: {}.", parts.join(", "))
}

/// What the phases show of biases, in sentences.
fn biases(summary: &CampaignSummary) -> Markup {
    let named = |differs: bool| {
        let phases = summary.phases.iter().filter(|phase| {
            let along = phase.along_m.and_then(|along| along.differs_from_zero);
            along == Some(differs)
        });
        phases.collect::<Vec<_>>()
    };
    let (biased, free) = (named(true), named(false));
    let undecided = summary.phases.len() - biased.len() - free.len();
    let each: Vec<String> = biased
        .iter()
        .filter_map(|phase| {
            Some(format!(
                "{} ({})",
                phase.phase,
                with_sigma(&phase.along_m?.mean, 1)
            ))
        })
        .collect();
    let mut sentences = Vec::new();
    if !each.is_empty() {
        sentences.push(format!(
            "Mean along-track misregistration differs from zero in {}: {}.",
            counted(each.len(), "mission phase"),
            each.join(", ")
        ));
    }
    if !free.is_empty() {
        sentences.push(format!(
            "No mean along-track misregistration was detected in {}.",
            counted(free.len(), "mission phase")
        ));
    }
    if undecided > 0 {
        sentences.push(format!(
            "{} {} too few independent groups for a decision.",
            counted(undecided, "mission phase"),
            if undecided == 1 { "has" } else { "have" }
        ));
    }
    paragraph(&sentences.join(" "))
}

/// A mean with its standard deviation, metres.
fn with_sigma(mean: &RobustMean, decimals: usize) -> String {
    let sigma = mean
        .sigma
        .map(|sigma| format!(" ± {}", number(sigma, decimals)));
    format!(
        "{}{} m",
        signed(mean.value, decimals),
        sigma.unwrap_or_default()
    )
}

/// A number that is read first, with a note.
fn key(what: &str, value: &str, note: &str) -> Markup {
    html! { div { dt { (what) } dd { b { (value) } " " (note) } } }
}

fn key_numbers(summary: &CampaignSummary) -> Markup {
    let [before, after] = [&summary.before, &summary.after].map(|of| of.misregistration.as_ref());
    let arrow = |before: Option<f64>, after: Option<f64>, decimals: usize| {
        let text = |value: Option<f64>| {
            value.map_or_else(|| "–".to_owned(), |value| number(value, decimals))
        };
        before.map(|_| format!("{} → {}", text(before), text(after)))
    };
    let along = arrow(
        before.map(|of| of.along_rms_m),
        after.map(|of| of.along_rms_m),
        1,
    );
    let spacings = arrow(
        before.and_then(|of| of.along_rms_spacings),
        after.and_then(|of| of.along_rms_spacings),
        3,
    );
    let mean = before.and_then(|of| of.along_mean_m);
    let [low, high] = [&summary.before, &summary.after].map(|of| of.heights.as_ref());
    let heights = arrow(
        low.map(|of| of.means_rms_m),
        high.map(|of| of.means_rms_m),
        1,
    );
    html! {
        dl.numbers {
            @if let Some(along) = along {
                (key("misregistration along the track, RMS, before → after", &format!("{along} m"),
                    &spacings.map_or_else(String::new, |of| format!("{of} shot spacings"))))
            }
            @if let Some(mean) = &mean {
                (key("its mean before the adjustment", &with_sigma(mean, 1), decided(mean)))
            }
            @if let Some(heights) = heights {
                (key("tie points above the laser surface, RMS of pairs", &format!("{heights} m"),
                    &counted(low.map_or(0, |of| of.pairs as usize), "pair")))
            }
            @if let Some(ranges) = &summary.ranges {
                (key("range − distance, mean of shots", &format!("{} m", signed(ranges.mean_m, 2)),
                    &counted(ranges.profiles as usize, "profile")))
            }
            @if let Some(budget) = &summary.budget {
                (key("distance of footprints by orientation (eq. 7)", &format!("{} px", number(budget.all.along_px, 1)),
                    &format!("{}, squares averaged", counted(budget.pairs as usize, "pair"))))
            }
            (key("pooled", &counted(summary.pairs as usize, "pair"),
                &format!("of {}, {} without a common image or orbit", whole(summary.pair_rows), counted(summary.groups as usize, "group"))))
        }
    }
}

/// The decision on a mean, in words.
fn decided(mean: &RobustMean) -> &'static str {
    match mean.differs_from_zero() {
        Some(true) => "differs from zero",
        Some(false) => "no difference from zero detected",
        None => "too few independent groups for a decision",
    }
}

fn downloads() -> Markup {
    let files = [
        ("sites.csv", "Sites"),
        ("images.csv", "Images"),
        ("pairs.csv", "Pairs"),
        ("profiles.csv", "Profiles"),
        ("summary.json", "Pooled numbers"),
    ];
    html! {
        ul.downloads { @for (path, name) in files { li { (link(path, name)) } } }
        p.about {
            "The folders sites, images, pairs and profiles hold the same tables as Parquet, by mission phase."
        }
    }
}

/// Quantity of a phase, with its standard deviation and what it decides.
fn quantity(of: Option<Quantity>, decimals: usize) -> String {
    let Some(of) = of else {
        return "–".to_owned();
    };
    let sigma = of
        .mean
        .sigma
        .map(|sigma| format!(" ± {}", number(sigma, decimals)));
    let mark = match of.differs_from_zero {
        Some(true) => " *",
        _ => "",
    };
    format!(
        "{}{}{mark}",
        signed(of.mean.value, decimals),
        sigma.unwrap_or_default()
    )
}

/// Phases with rows; the table of pairs has the others.
const PHASES_MAX: usize = 100;

fn phases(summary: &CampaignSummary) -> Markup {
    let mut table = Table::new(
        "Mission phases before the adjustment, mean ± standard deviation",
        &[
            Column::Text("phase"),
            Column::Number("pairs"),
            Column::Number("independent groups"),
            Column::Number("along the track, m"),
            Column::Number("across the track, m"),
            Column::Number("attitude clock, s"),
            Column::Number("tie points above the laser surface, m"),
        ],
    );
    for phase in summary.phases.iter().take(PHASES_MAX) {
        let groups = |of: &PhaseSummary| of.along_m.map_or(0, |of| of.mean.groups);
        table.row(
            true,
            [
                (&phase.phase).into(),
                whole(phase.pairs).into(),
                whole(groups(phase)).into(),
                quantity(phase.along_m, 1).into(),
                quantity(phase.across_m, 1).into(),
                quantity(phase.attitude_clock_s, 3).into(),
                quantity(phase.height_m, 1).into(),
            ],
        );
    }
    let words = "* The mean is reported as different from zero at a two-sided significance level of 0.27 % (Student's \
                 distribution). With fewer than four groups, no decision is reported. Along and across: misregistration of the \
                 footprints, image with the larger emission angle minus the other image; pairs with equal or unknown emission \
                 angles are left out. Attitude clock: the offset that the displacements of tie points suggest if all images of \
                 the phase share it.";
    html! {
        @if summary.phases.is_empty() { p { "No pair is pooled." } }
        @else { (table.finish()) p { (words) } }
    }
}

fn how(summary: &CampaignSummary) -> Markup {
    let words = "Only sites that are valid, with or without remarks, are pooled; the tables contain all sites. Images, pairs of \
                 images and profiles that several sites have count once. Squares are averaged over the pairs, as in eq. 7 of \
                 Shan et al. 2005.";
    let ranges = "Table 3 includes outliers and profiles that the range check or the laser surface rejects. Of sites with a \
                  common image, one profile of each orbit is pooled. Profiles of sites that overlap without a common image are \
                  all pooled, and may have shots in common.";
    let means = "Pairs with a common image, or with images of one orbit, belong to one group. Each group enters a mean as one \
                 observation, whatever its number of pairs. Standard deviations of means require no a priori standard \
                 deviations of the observations: they follow from the scatter between groups, and include all errors that \
                 differ from group to group. From 8 groups on, groups far from the others lose weight (Huber). A mean is \
                 reported as different from zero at a two-sided significance level of 0.27 % (Student's distribution). With \
                 fewer than four groups, no decision is reported.";
    html! {
        p { (words) }
        p { (ranges) }
        p { (means) }
        p {
            (whole(summary.image_rows)) " rows of images, " (whole(summary.pair_rows)) " of pairs, "
            (whole(summary.profile_rows)) " of profiles."
        }
        @if let Some(budget) = &summary.budget { (uncertainty::of_campaign(budget)) }
    }
}

#[cfg(test)]
mod tests;
