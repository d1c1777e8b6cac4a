//! `areograph kernels compare`.

use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::json;

use super::super::{load_sites, output};
use crate::{
    config::{SiteConfig, usual_instrument},
    error::{Cause, Error, Kind},
    flow::{
        Answer, Compared, Request, RivalSet, compare_kernels, require_different, required_by_site,
        rival_sets,
    },
    report::{KernelComparison, comparison_page},
    spice::{KernelSet, RequiredCoverage, Session},
    stages::compare_kernels::{AttitudeComparison, Comparison, Size},
    store::page::PagePath,
    time::{Et, Interval, Intervals, PointingBias},
    units::RADIANS_PER_ARCSECOND,
};

/// Compares rival kernel sets: how far the orbit and the attitude of each are from the mean of all.
///
/// Orbits are positions of MGS relative to Mars (geometric, J2000) along the radial, along-track and cross-track axes of
/// the mean orbit. The set with the least root mean square distance from the mean is closest, as in Shan et al. 2005.
/// Epochs are equally spaced over the time that all sets cover, 1 s apart, or farther apart if there would be more than
/// 10000; gaps of each set are listed.
///
/// Example: `areograph kernels compare nav.tm gsfc.tm ipng.tm --site gusev_crater.toml`
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    /// Metakernels (.tm), two or more; without any, the rival sets of --site.
    #[arg(required_unless_present = "site", value_name = "SET.tm")]
    sets: Vec<PathBuf>,
    /// Compare within this interval, UTC, for example 1999-08-24T14:00..1999-08-24T15:00.
    #[arg(long, value_name = "FROM..TO", conflicts_with = "site")]
    time: Option<String>,
    /// Compare over the times for which this site needs kernels, with its pointing bias.
    #[arg(long, value_name = "SITE.toml")]
    site: Option<PathBuf>,
    /// Print JSON, including the deviations at every epoch.
    #[arg(long)]
    json: bool,
    /// Write a page with tables and plots to this file; its folder must exist, and products are not overwritten.
    #[arg(long, value_name = "FILE.html")]
    page: Option<PathBuf>,
}

/// A command line that does not define a comparison.
#[derive(Debug, thiserror::Error, Cause)]
#[cause(Configuration)]
enum Usage {
    #[error("kernel sets to compare: {count}; expected two or more")]
    #[cause("name the metakernels of rival sets, or a site with [[kernels.sets]]")]
    TooFew { count: usize },
    #[error("--time is \"{written}\"; expected FROM..TO in UTC, FROM earlier than TO")]
    #[cause("write for example --time 1999-08-24T14:00..1999-08-24T15:00")]
    Time { written: String },
}

pub(super) fn run(arguments: &Arguments) -> Result<(), Error> {
    let page_path = arguments.page.as_deref().map(PagePath::new).transpose()?;
    let site = match &arguments.site {
        Some(path) => load_sites(std::slice::from_ref(path))?.pop(),
        None => None,
    };
    let sets = match &site {
        Some(site) if arguments.sets.is_empty() => rival_sets(site)?,
        _ => named(&arguments.sets)?,
    };
    if sets.len() < 2 {
        return Err(Usage::TooFew { count: sets.len() }.into());
    }
    let bias = site
        .as_ref()
        .map_or(usual_instrument().pointing_bias(), bias_of_site);
    let required = match (&arguments.time, &site) {
        (Some(time), _) => Some(wanted_by_time(time, bias, &sets[0].kernels)?),
        (None, Some(site)) => Some(required_by_site(site)?),
        (None, None) => None,
    };
    let request = Request {
        stage: "compare_kernels",
        required: required.as_ref(),
        bias,
        attitudes: true,
        clocks: site.is_some_and(|site| !site.images.is_empty()),
    };
    require_different(&sets)?;
    let compared = compare_kernels(&sets, &request)?;
    if let Some(path) = &page_path {
        path.write(&page(&compared)?)?;
    }
    if arguments.json {
        output::json(&json!(Answer::of(&compared)));
    } else {
        print(&compared);
        if let Some(path) = &arguments.page {
            output::line(format_args!("page: {}", path.display()));
        }
    }
    Ok(())
}

/// The pointing bias of the site's first camera.
fn bias_of_site(site: &SiteConfig) -> PointingBias {
    let named = site.images.first();
    let named = named.and_then(|image| image.instrument.as_ref());
    site.pointing.bias_of(named.unwrap_or(usual_instrument()))
}

fn page(compared: &Compared) -> Result<String, Error> {
    let mut remarks = compared.notes.clone();
    remarks.extend(compared.uncovered_lines());
    comparison_page(&KernelComparison {
        orbit: &compared.orbit,
        attitude: compared.attitude.as_ref(),
        utc: &compared.utc,
        remarks: &remarks,
    })
}

/// The sets by the names of their metakernels, or by their paths where names coincide.
fn named(paths: &[PathBuf]) -> Result<Vec<RivalSet>, Error> {
    let stem = |path: &Path| path.file_stem().map(ToOwned::to_owned);
    let sets = paths.iter().map(|path| {
        let alone = paths
            .iter()
            .filter(|other| stem(other) == stem(path))
            .count()
            == 1;
        let id = match stem(path) {
            Some(stem) if alone => stem.to_string_lossy().into_owned(),
            _ => path.display().to_string(),
        };
        let kernels = KernelSet::from_metakernel(path)?;
        Ok(RivalSet { id, kernels })
    });
    sets.collect()
}

/// One interval for positions and attitudes; `kernels` convert its ends.
fn wanted_by_time(
    written: &str,
    bias: PointingBias,
    kernels: &KernelSet,
) -> Result<RequiredCoverage, Error> {
    let unclear = || Usage::Time {
        written: written.to_owned(),
    };
    let (from, to) = written.split_once("..").ok_or_else(unclear)?;
    let session = Session::open(kernels)?;
    let instant = |utc: &str| -> Result<Et, Error> {
        session
            .utc_to_et(utc)
            .map_err(|failure| match failure.kind() {
                Kind::Input => unclear().into(),
                _ => failure,
            })
    };
    let span = Interval::new(instant(from)?, instant(to)?);
    if span.start >= span.stop {
        return Err(unclear().into());
    }
    let span = Intervals::union_of([span]);
    Ok(RequiredCoverage {
        attitudes: span.shifted(bias.seconds()),
        positions: span,
        ..RequiredCoverage::default()
    })
}

fn print(compared: &Compared) {
    let orbit = &compared.orbit;
    output::line(format_args!(
        "orbit: {} epochs from {} to {} UTC; metres, set minus mean of all",
        orbit.epochs.len(),
        compared.utc[0],
        compared.utc[1],
    ));
    print_table(orbit, 1.0, None);
    if let Some(attitude) = &compared.attitude {
        output::line(format_args!(
            "attitude: {} epochs; arcseconds about the same axes; ground: displacement of the boresight on the ground, metres",
            attitude.turns.epochs.len(),
        ));
        print_table(&attitude.turns, RADIANS_PER_ARCSECOND, Some(attitude));
    }
    for line in compared.uncovered_lines() {
        output::line(line);
    }
    for note in &compared.notes {
        output::line(format_args!("note: {note}"));
    }
}

/// Deviations and differences of each two sets, in units of `unit`.
fn print_table(comparison: &Comparison, unit: f64, attitude: Option<&AttitudeComparison>) {
    let heads = ["radial", "along track", "cross track"].map(|head| format!("{head:^23}"));
    let ground = attitude.map_or("", |_| "  ground rms  ground max");
    output::line(format_args!(
        "  {:24}{}{:>12}{:>12}{ground}",
        "mean ± st. deviation",
        heads.concat(),
        "rms",
        "max"
    ));
    let row = |name: &str, size: &Size, ground: &str| {
        let components = size.components.map(|one| {
            let (mean, spread) = (one.mean / unit, one.standard_deviation / unit);
            let mean = format!("{mean:.3}").replace('-', "−");
            format!("{mean:>11} ± {spread:<9.3}")
        });
        let (rms, max) = (size.rms / unit, size.max / unit);
        let components = components.concat();
        output::line(format_args!(
            "  {name:24}{components}{rms:>12.3}{max:>12.3}{ground}"
        ));
    };
    for (index, deviation) in comparison.deviations.iter().enumerate() {
        let ground = attitude.and_then(|attitude| attitude.ground_size_m(index));
        let ground =
            ground.map_or_else(String::new, |[rms, max]| format!("{rms:>12.3}{max:>12.3}"));
        row(&deviation.set, &deviation.size, &ground);
    }
    for (first, second) in comparison.pairs() {
        let sets = [second, first].map(|index| &*comparison.deviations[index].set);
        row(&sets.join(" − "), &comparison.difference(first, second), "");
    }
    let closest = &comparison.closest().set;
    let tied: Vec<&str> = comparison.tied_sets().collect();
    if let [_, _] = &*comparison.deviations {
        output::line(
            "  the two sets are equally far from their mean: a third set is needed to choose one",
        );
    } else if tied.is_empty() {
        output::line(format_args!("  closest to the mean of all: {closest}"));
    } else {
        output::line(format_args!(
            "  equally close to the mean of all: {closest}, {}",
            tied.join(", ")
        ));
    }
    for close in comparison.nearly_as_close() {
        output::line(format_args!(
            "  not decisive: {} is nearly as close",
            close.set
        ));
    }
    if let Some(far) = comparison.pulls_the_mean() {
        output::line(format_args!("  biases the mean: {}", far.set));
    }
    if let Some(far) = comparison.decided_by() {
        output::line(format_args!(
            "  the choice of the closest set depends on {}",
            far.set
        ));
    }
}
