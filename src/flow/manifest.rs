//! The manifest of a run.

use std::collections::BTreeMap;

use super::{
    PUBLISH, choice::KernelChoice, driver::Ledger, evidence::complaints_of_pixels, outputs::Site,
};
use crate::{
    altimetry::BiasScope,
    body::Body,
    capabilities,
    config::SiteConfig,
    error::Result,
    files::file_name,
    products::SiteStatements,
    stage::{Inputs, Round},
    stages::{
        adjust::Adjusted,
        check_heights::HeightCheck,
        check_ranges::RangeCheck,
        compare_pairs::PairComparison,
        convert_datum::Converted,
        describe_kernels::{KernelDescription, KernelLine},
        fit_sensor_model::SensorModel,
        group_profiles::Profile,
        read_ties::Ties,
        register::ImageRegistration,
        search_footprints::SearchResult,
        tag_times::{ImageTimes, used_biases},
    },
    store::{
        book::Book,
        manifest::{
            BiasEntry, Complaints, ConfigurationEntry, KernelEntry, Manifest, ProductEntry,
            StageEntry, figures,
        },
    },
};

/// Complaints that the manifest quotes; all are counted.
const COMPLAINTS_QUOTED: usize = 100;

/// Largest along-track parallax of a pair of images at their tie points, metres.
fn largest_along_track_parallax_m(book: &Book, round: Round) -> Result<Option<f64>> {
    let pairs = book
        .find::<Vec<PairComparison>>(round)?
        .into_iter()
        .flatten();
    let parallaxes_m = pairs.map(|pair| pair.along_track_parallax_m);
    Ok(parallaxes_m.max_by(f64::total_cmp))
}

/// Median height of the tie points above the MOLA surface, metres.
fn height_off_surface_m(book: &Book, round: Round) -> Result<Option<f64>> {
    let heights = book.find::<HeightCheck>(round)?;
    let above_m = heights.map(|heights| &heights.above_m);
    let above_m = above_m.filter(|above_m| above_m.n > 0);
    Ok(above_m.map(|above_m| above_m.median.abs()))
}

/// The manifest of a site whose products are made from `inputs`.
pub(super) fn manifest(
    config: &SiteConfig,
    site: &Site,
    (statements, products): (SiteStatements, Vec<ProductEntry>),
    ledger: &Ledger,
    inputs: &Inputs,
) -> Result<Manifest> {
    let (book, complaints) = (&site.book, statements.complaints);
    let found = book.of::<SearchResult>()?;
    let ties = book.find::<Ties>(Round::Initial)?;
    let of_ties = ties.map_or(0, |ties| ties.complaint_count);
    let (_, of_pixels) = complaints_of_pixels(site)?;
    let choice = book.find::<KernelChoice>(Round::Initial)?;
    Ok(Manifest {
        tool: "areograph".to_owned(),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        site: config.site.clone(),
        verdict: statements.verdict,
        configuration: ConfigurationEntry {
            file_name: file_name(&config.file),
            blake3: config.blake3.clone(),
            keys: config.keys.clone(),
        },
        biases: biases(config, site)?,
        kernels: book
            .of::<KernelDescription>()?
            .kernels
            .iter()
            .map(kernel_entry)
            .collect(),
        kernel_choice: choice.map_or_else(Vec::new, |choice| choice.entries.clone()),
        stages: stages(ledger, inputs),
        products,
        counts: counts(site)?,
        figures: figures_of(site)?,
        rejected: statements.rejected,
        complaints: Complaints {
            count: found.complaint_counts.values().sum::<u64>() + of_ties + of_pixels,
            texts: complaints.into_iter().take(COMPLAINTS_QUOTED).collect(),
        },
        notes: statements.notes,
        finished_utc: chrono::Utc::now().format("%Y-%m-%dT%H:%M:%SZ").to_string(),
    })
}

/// Every stage with the hash over its inputs; the last one made the products.
fn stages(ledger: &Ledger, inputs: &Inputs) -> Vec<StageEntry> {
    let entry = |name: &str, fingerprint: String| StageEntry {
        name: name.to_owned(),
        fingerprint,
    };
    let known = ledger.iter();
    let known = known.filter_map(|(label, provenance)| Some((label, provenance.as_ref()?)));
    let stages = known.map(|(label, provenance)| entry(label, provenance.fingerprint.clone()));
    stages
        .chain([entry(PUBLISH, inputs.fingerprint())])
        .collect()
}

fn kernel_entry(line: &KernelLine) -> KernelEntry {
    KernelEntry {
        name: line.name.clone(),
        role: line.role.clone(),
        bytes: line.bytes,
        blake3: line.blake3.clone(),
        coverage_used: line.used.clone(),
    }
}

/// Rows and things counted.
fn counts(site: &Site) -> Result<BTreeMap<String, u64>> {
    let book = &site.book;
    let found = book.of::<SearchResult>()?;
    let (mut registered, mut inside, mut rejected) = (0, 0, 0);
    for registration in book.parts::<ImageRegistration>(Round::Initial)? {
        registered += registration.points.len() as u64;
        inside += registration.points.inside_count() as u64;
        rejected += registration.rejected.values().sum::<u64>();
    }
    let counts = [
        ("frames_read", found.frames_read),
        ("shots_read", found.shots_read),
        (
            "footprints",
            book.of::<Converted>()?.footprints.len() as u64,
        ),
        ("profiles", book.of::<Vec<Profile>>()?.len() as u64),
        (
            "images",
            book.parts::<ImageTimes>(Round::Initial)?.len() as u64,
        ),
        ("registered", registered),
        ("registered_inside", inside),
        ("registration_rejected", rejected),
    ];
    let mut counts: BTreeMap<String, u64> =
        counts.map(|(name, count)| (name.to_owned(), count)).into();
    if let Some(ties) = book.find(Round::Initial)? {
        counts.extend(matched(ties));
    }
    counts.extend(capabilities::counts(book)?);
    Ok(counts)
}

/// Cells of common ground in which a tie point was searched, by outcome; empty without matching.
fn matched(ties: &Ties) -> BTreeMap<String, u64> {
    let mut counts = BTreeMap::new();
    for pair in &ties.matched {
        let mut add = |name: String, count: u32| {
            *counts.entry(name).or_insert(0) += u64::from(count);
        };
        add("match_cells".to_owned(), pair.cells);
        add("match_ties".to_owned(), pair.ties);
        for (why, count) in &pair.unmatched {
            add(format!("match_{}", why.word()), *count);
        }
    }
    counts
}

/// The largest figures of the site.
fn figures_of(site: &Site) -> Result<BTreeMap<String, f64>> {
    let book = &site.book;
    let profiles = book.of::<RangeCheck>()?.profiles.iter();
    // Ranges of tables may have nothing to be compared with.
    let measured = profiles.filter(|ranges| ranges.measured() > 0);
    let means = measured.map(|ranges| ranges.mean_without_outliers_m.abs());
    let models = book.parts::<SensorModel>(Round::Initial)?;
    let positions = models
        .iter()
        .map(|model| model.second_order.position_rmse_m());
    let pointings = models.iter().map(|model| model.rotation_vector.rmse_rad());
    let before = largest_along_track_parallax_m(book, Round::Initial)?;
    let after = largest_along_track_parallax_m(book, Round::Adjusted)?;
    let height = height_off_surface_m(book, Round::Initial)?;
    let adjusted_height = height_off_surface_m(book, Round::Adjusted)?;
    let adjusted = book.find::<Adjusted>(Round::Initial)?;
    let figures = [
        (figures::RANGE_MEAN_M, means.max_by(f64::total_cmp)),
        (figures::POSITION_RMSE_M, positions.max_by(f64::total_cmp)),
        (figures::POINTING_RMSE_RAD, pointings.max_by(f64::total_cmp)),
        (figures::ALONG_TRACK_PARALLAX_M, before),
        (figures::ADJUSTED_ALONG_TRACK_PARALLAX_M, after),
        (figures::HEIGHT_OFF_SURFACE_M, height),
        (figures::ADJUSTED_HEIGHT_OFF_SURFACE_M, adjusted_height),
        (
            figures::ADJUSTMENT_SIGMA0,
            adjusted.map(|of| of.summary.sigma0),
        ),
    ];
    let figures = figures.into_iter();
    Ok(figures
        .filter_map(|(name, figure)| Some((name.to_owned(), figure?)))
        .collect())
}

fn biases(config: &SiteConfig, site: &Site) -> Result<Vec<BiasEntry>> {
    let terms = config.terms();
    let scope = match config.altimeter_clock.scope {
        BiasScope::SpkLookup => "spacecraft position in the range check".to_owned(),
        BiasScope::Rotation => format!("rotation of {} into {}", terms.body(), terms.short_frame()),
        BiasScope::Both => format!(
            "spacecraft position in the range check, and rotation of {} into {}",
            terms.body(),
            terms.short_frame()
        ),
        BiasScope::None => "nothing".to_owned(),
    };
    let clock = BiasEntry {
        name: "mola_clock".to_owned(),
        correction_s: config.altimeter_clock.correction_s(),
        scope,
        source: config.altimeter_clock.source.clone(),
    };
    let images = site.book.parts(Round::Initial)?;
    let pointing = used_biases(&config.pointing, images);
    let several = pointing.len() > 1;
    let pointing = pointing.into_iter().map(|of| BiasEntry {
        name: "ck_bias".to_owned(),
        correction_s: of.bias.seconds(),
        scope: if several {
            format!("attitude look-ups of {}", of.camera)
        } else {
            "attitude look-ups".to_owned()
        },
        source: of.source.to_owned(),
    });
    // The MOLA clock correction applies only at Mars.
    let clock = (config.body == Body::Mars).then_some(clock);
    Ok(pointing.chain(clock).collect())
}
