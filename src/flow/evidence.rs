//! Evidence for the verdict, and notes for readers of the products.

use std::{
    collections::{BTreeMap, BTreeSet},
    ffi::OsStr,
    path::Path,
};

use super::{choice::KernelChoice, outputs::Site};
use crate::{
    capabilities::findings,
    config::SiteConfig,
    error::{Error, Result},
    footprints::SourceFile,
    geom::pushbroom::CameraModel,
    instruments::Instrument,
    minus::with_minus,
    stage::Round,
    stages::{
        adjust::accuracy_withheld,
        check_profiles::ProfileCheck,
        convert_datum::Converted,
        describe_kernels::KernelDescription,
        judge::{AdjustmentEvidence, BeamEvidence, Evidence, JudgedImage, Verdict, judge},
        lay_overlays::{Overlays, ShownImage},
        read_ties::Ties,
        search_footprints::SearchResult,
        tag_times::ImageTimes,
    },
    store::book::Book,
};

/// The verdict, and whether the images of every pair agree at their tie points after the adjustment.
pub(super) fn judged(
    config: &SiteConfig,
    site: &Site,
    warnings: &[String],
    complaints: &[String],
) -> Result<(Verdict, bool)> {
    let images = judged_images(&site.book, Round::Initial)?;
    let adjusted_images = judged_images(&site.book, Round::Adjusted)?;
    let book = &site.book;
    let adjustment = book.find(Round::Initial)?.map(|adjusted| {
        Ok::<_, Error>(AdjustmentEvidence {
            ties: book.of()?,
            adjusted,
            images: &adjusted_images,
            pairs: book.of::<Vec<_>>()?,
            adjusted_pairs: book.require::<Vec<_>>(Round::Adjusted)?.value()?,
            heights: book.of()?,
            adjusted_heights: book.require(Round::Adjusted)?.value()?,
        })
    });
    let adjustment = adjustment.transpose()?;
    let failure = site
        .adjustment_failure
        .as_ref()
        .map(|failure| format!("{}; {}", failure.cause, failure.cause.advice()));
    let findings = findings(config, book)?;
    let searched = config.has_shots();
    let verdict = judge(&Evidence {
        terms: config.terms(),
        footprints: searched.then_some(site.book.of::<Converted>()?.footprints.len()),
        rejected: &book.of::<SearchResult>()?.rejected,
        ground: site.book.of::<Converted>()?.footprints.ground_choice(),
        limits: &config.limits,
        range_limits: &config.range_check,
        orientation_limits: &config.orientation,
        ranges: book.of()?,
        clock_correction_s: config.altimeter_clock.correction_s(),
        images: &images,
        beam: BeamEvidence {
            images: book.of::<Vec<_>>()?,
            adjustment: &config.adjustment,
            surface: &config.laser_surface,
        },
        warnings,
        complaints,
        profiles: book.of()?,
        adjustment,
        findings: &findings,
        adjustment_failure: failure.as_deref(),
    });
    Ok((
        verdict,
        adjustment.is_some_and(|of| of.images_agree(&config.limits)),
    ))
}

/// Remarks on kernels, clocks, labels and tie points, one sentence each.
pub(super) fn warnings(config: &SiteConfig, site: &Site) -> Result<Vec<String>> {
    let described = site.book.of::<KernelDescription>()?;
    let mut warnings: Vec<String> = described.pck_note.iter().cloned().collect();
    warnings.extend(described.rates_note.iter().cloned());
    let images = judged_images(&site.book, Round::Initial)?;
    for camera in cameras(&images) {
        warnings.extend(config.pointing.departure(camera));
    }
    for JudgedImage { times, model, .. } in &images {
        let remarks = times.remarks.iter();
        let remarks = remarks.filter(|remark| !remark.is_beyond_accuracy());
        warnings.extend(remarks.map(|remark| format!("image {}: {}", times.id, remark.text)));
        let remark = model.remark.as_ref();
        warnings.extend(remark.map(|remark| format!("image {}: {remark}", times.id)));
    }
    warnings.extend(same_exposures(&images));
    let checked = site.book.of::<ProfileCheck>()?;
    warnings.extend(checked.remark());
    warnings.extend(empty_pedr_files(config, site)?);
    warnings.extend(gimbal_locks(&images, true));
    if let Some(ties) = site.book.find::<Ties>(Round::Initial)? {
        let remarks = ties.remarks.iter();
        warnings.extend(remarks.map(|remark| format!("tie points: {remark}")));
    }
    if site.is_adjusted()? {
        let times = images.iter().map(|image| image.times);
        warnings.extend(accuracy_withheld(config, times));
    }
    for (id, image) in shown(site)? {
        let damage = image.damage();
        warnings.extend(damage.map(|damage| format!("pixels of {id}: {damage}")));
    }
    Ok(warnings)
}

/// Images whose pixels were read, and their identifiers.
fn shown(site: &Site) -> Result<Vec<(&str, &ShownImage)>> {
    let Some(overlays) = site.book.find::<Overlays>(Round::Initial)? else {
        return Ok(Vec::new());
    };
    let times = site.book.parts::<ImageTimes>(Round::Initial)?;
    let shown = overlays.images.iter();
    Ok(shown
        .map(|shown| (&*times[shown.image].id, shown))
        .collect())
}

/// The cameras of the images that kernels orient, each once.
fn cameras<'a>(images: &[JudgedImage<'a>]) -> Vec<&'a Instrument> {
    let mut cameras: Vec<&Instrument> = Vec::new();
    for JudgedImage { times, .. } in images {
        let camera = &times.instrument;
        if times.support.is_none() && !cameras.contains(&camera) {
            cameras.push(camera);
        }
    }
    cameras
}

/// Whether a form of orientation has polynomials of ω, φ and κ.
const fn has_angles(model: CameraModel) -> bool {
    match model {
        CameraModel::FirstOrder | CameraModel::SecondOrder => true,
        CameraModel::RotationVector | CameraModel::Samples => false,
    }
}

/// Images whose angles ω and κ turn about nearly the same axis; `use_angles` – of images that use these angles, or of
/// the others.
fn gimbal_locks(images: &[JudgedImage], use_angles: bool) -> Vec<String> {
    let mut locks = Vec::new();
    for JudgedImage { times, model, .. } in images {
        if model.near_gimbal_lock && has_angles(model.model) == use_angles {
            locks.push(format!(
                "image {}: |cos φ| falls to {:.3}, where ω and κ are poorly determined; the rotation-vector form is unaffected",
                times.id, model.cos_phi_min
            ));
        }
    }
    locks
}

/// Images that one camera took at one time with the same pixels: their labels may have been exchanged. A remark for each
/// group of such images.
fn same_exposures(images: &[JudgedImage]) -> Vec<String> {
    /// Images that a remark names; of more images, it states the number.
    const NAMED: usize = 5;
    let mut groups: Vec<Vec<&ImageTimes>> = Vec::new();
    for JudgedImage { times, .. } in images {
        let is_same = |group: &&mut Vec<&ImageTimes>| {
            let other = group[0];
            let starts = [times, other].map(|of| of.line_times.start());
            let apart_s = starts[0].since(starts[1]).abs();
            apart_s < times.line_times.mean_period_s() && times.detector() == other.detector()
        };
        match groups.iter_mut().find(is_same) {
            Some(group) => group.push(times),
            None => groups.push(vec![times]),
        }
    }
    let remark = |group: &Vec<&ImageTimes>| {
        let ids: Vec<&str> = group.iter().map(|times| &*times.id).collect();
        let named = match &ids[..] {
            [] | [_] => return None,
            [others @ .., last] if ids.len() <= NAMED => {
                format!("{} and {last}", others.join(", "))
            }
            _ => format!(
                "{} and {} others",
                ids[..NAMED].join(", "),
                ids.len() - NAMED
            ),
        };
        let which = if ids.len() == 2 { "one" } else { "some" };
        Some(format!(
            "images {named} were exposed at the same time by the same pixels: {which} of the labels may belong to another image"
        ))
    };
    groups.iter().filter_map(remark).collect()
}

/// PEDR files without a shot in the windows: every file that the site file names, and files of patterns most of whose
/// files have shots. A pattern most of whose files have none searches an archive.
fn empty_pedr_files(config: &SiteConfig, site: &Site) -> Result<Option<String>> {
    let footprints = &site.book.of::<Converted>()?.footprints;
    let with_shots: BTreeSet<u16> = footprints.file.iter().collect();
    let files = footprints.files.iter().zip(0_u16..);
    let files: Vec<(&SourceFile, bool)> = files
        .map(|(file, index)| (file, with_shots.contains(&index)))
        .collect();
    let full: BTreeSet<&str> = files
        .iter()
        .filter(|(_, has_shots)| *has_shots)
        .map(|(file, _)| &*file.blake3)
        .collect();
    if full.is_empty() || config.pedr.files.is_empty() {
        return Ok(None);
    }
    let written = config.keys.get("pedr.files");
    let written = written.and_then(|text| serde_json::from_str::<Vec<String>>(text).ok());
    let written = written.unwrap_or_default();
    let is_named = |name: &str| {
        let mut paths = written.iter().map(Path::new);
        paths.any(|path| path.file_name() == Some(OsStr::new(name)))
    };
    // A copy of a file with shots was read once.
    let (named, matched): (Vec<_>, Vec<_>) = files
        .iter()
        .map(|(file, _)| (&*file.name, full.contains(&*file.blake3)))
        .partition(|(name, _)| is_named(name));
    let matched_full = matched.iter().filter(|(_, is_full)| *is_full).count();
    let is_archive = 2 * matched_full < matched.len();
    let matched = matched.into_iter().filter(|_| !is_archive);
    let empty = named.into_iter().chain(matched);
    let empty: Vec<&str> = empty
        .filter(|(_, is_full)| !is_full)
        .map(|(name, _)| name)
        .collect();
    Ok((!empty.is_empty()).then(|| {
        format!(
            "no shot in the windows comes from {}: check that each is a {} of this site's orbits",
            empty.join(", "),
            config.terms().shot_file()
        )
    }))
}

fn judged_images(book: &Book, round: Round) -> Result<Vec<JudgedImage<'_>>> {
    let times = book.parts(Round::Initial)?.into_iter();
    let oriented = times.zip(book.parts(round)?).zip(book.parts(round)?);
    let images = oriented.map(|((times, orientation), model)| JudgedImage {
        times,
        orientation,
        model,
    });
    Ok(images.collect())
}

/// Notes for a reader of the products, one sentence each.
pub(super) fn notes(site: &Site) -> Result<Vec<String>> {
    let mut notes = Vec::new();
    let book = &site.book;
    if let Some(choice) = book.find::<KernelChoice>(Round::Initial)? {
        notes.extend(choice.notes.iter().cloned());
    }
    if let Some(kernels) = &site.kernels {
        notes.extend(kernels.notes().cloned());
    }
    notes.extend(book.of::<SearchResult>()?.notes.iter().cloned());
    notes.extend(site.book.of::<Converted>()?.notes.iter().cloned());
    let images = judged_images(book, Round::Initial)?;
    for JudgedImage { times, .. } in &images {
        let of_image = times.notes.iter();
        notes.extend(of_image.map(|note| format!("image {}: {note}", times.id)));
    }
    notes.extend(gimbal_locks(&images, false));
    if let Some(ties) = book.find::<Ties>(Round::Initial)? {
        notes.extend(ties.notes());
    }
    Ok(notes.iter().map(|note| with_minus(note)).collect())
}

/// Complaints about pixel files, one sentence each, and their total number.
pub(super) fn complaints_of_pixels(site: &Site) -> Result<(Vec<String>, u64)> {
    let (mut texts, mut count) = (Vec::new(), 0);
    for (id, image) in shown(site)? {
        let complaints = image.complaints.iter();
        texts.extend(complaints.map(|of| with_minus(&format!("pixels of {id}: {of}"))));
        count += image.complaint_count;
    }
    Ok((texts, count))
}

/// Complaints about input records, one sentence each.
pub(super) fn complaints(site: &Site) -> Result<Vec<String>> {
    let complaints = site.book.of::<SearchResult>()?.complaints.iter();
    let mut complaints: Vec<String> = complaints.map(ToString::to_string).collect();
    if let Some(ties) = site.book.find::<Ties>(Round::Initial)? {
        complaints.extend(ties.complaints.iter().cloned());
    }
    Ok(complaints.iter().map(|of| with_minus(of)).collect())
}

/// Rejected shots inside a window, by reason.
pub(super) fn rejected(site: &Site) -> Result<BTreeMap<String, u64>> {
    let rejected = site.book.of::<SearchResult>()?.rejected.iter();
    Ok(rejected
        .map(|(reason, count)| (reason.to_string(), *count))
        .collect())
}
