//! Evidence for the verdict, and notes for readers of the products.

use std::{
    collections::{BTreeMap, BTreeSet},
    ffi::OsStr,
    path::Path,
};

use super::outputs::Site;
use crate::{
    config::SiteConfig,
    error::Result,
    footprints::SourceFile,
    geom::pushbroom::CameraModel,
    instruments::Instrument,
    stage::Output,
    stages::{
        adjust::accuracy_withheld,
        judge::{AdjustmentEvidence, BeamEvidence, Evidence, JudgedImage, Verdict, judge},
        lay_overlays::ShownImage,
        site_image::SiteImage,
    },
    wording::with_minus,
};

/// The verdict, and whether the images of every pair agree at their tie points after the adjustment.
pub(super) fn judged(
    config: &SiteConfig,
    site: &Site,
    warnings: &[String],
    complaints: &[String],
) -> Result<(Verdict, bool)> {
    let images = judged_images(&site.images)?;
    let adjusted = site.adjustment.as_ref();
    let adjusted_images = adjusted.map_or(&[][..], |of| &of.images);
    let adjusted_images = judged_images(adjusted_images)?;
    let adjustment = match (&site.ties, &site.intersection, adjusted) {
        (Some(ties), Some(initial), Some(adjustment)) => Some(AdjustmentEvidence {
            ties: ties.value()?,
            adjusted: adjustment.adjusted.value()?,
            images: &adjusted_images,
            pairs: initial.pairs.value()?,
            adjusted_pairs: adjustment.intersection.pairs.value()?,
            heights: initial.heights.value()?,
            adjusted_heights: adjustment.intersection.heights.value()?,
        }),
        _ => None,
    };
    let failure = site
        .adjustment_failure
        .as_ref()
        .map(|failure| format!("{}; {}", failure.cause, failure.cause.advice()));
    let surface = site.surface.as_ref().map(Output::value).transpose()?;
    let searched = config.has_shots();
    let verdict = judge(&Evidence {
        wording: config.wording(),
        footprints: searched.then_some(site.converted.value()?.footprints.len()),
        limits: &config.limits,
        range_limits: &config.range_check,
        orientation_limits: &config.orientation,
        ranges: site.ranges.value()?,
        clock_correction_s: config.mola_clock.correction_s(),
        images: &images,
        beam: BeamEvidence {
            images: site.beam.value()?,
            adjustment: &config.adjustment,
            surface: &config.mola_surface,
        },
        warnings,
        complaints,
        adjustment,
        surface: surface.map(|of| &of.account),
        adjustment_failure: failure.as_deref(),
    });
    Ok((
        verdict,
        adjustment.is_some_and(|of| of.images_agree(&config.limits)),
    ))
}

/// Remarks on kernels, clocks, labels and tie points, one sentence each.
pub(super) fn warnings(config: &SiteConfig, site: &Site) -> Result<Vec<String>> {
    let described = site.described.value()?;
    let mut warnings: Vec<String> = described.pck_note.iter().cloned().collect();
    warnings.extend(described.rates_note.iter().cloned());
    for camera in cameras(&site.images)? {
        warnings.extend(config.pointing.departure(camera));
    }
    for image in &site.images {
        let times = image.times.value()?;
        let remarks = times.remarks.iter();
        let remarks = remarks.filter(|remark| !remark.is_beyond_accuracy());
        warnings.extend(remarks.map(|remark| format!("image {}: {}", times.id, remark.text)));
    }
    warnings.extend(same_exposures(&site.images)?);
    warnings.extend(empty_pedr_files(config, site)?);
    if has_angles(config) {
        warnings.extend(gimbal_locks(&site.images)?);
    }
    if let Some(ties) = &site.ties {
        let remarks = ties.value()?.remarks.iter();
        warnings.extend(remarks.map(|remark| format!("tie points: {remark}")));
    }
    if site.adjustment.is_some() {
        let times = site.images.iter().map(|image| image.times.value());
        let times = times.collect::<Result<Vec<_>>>()?;
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
    let Some(overlays) = &site.overlays else {
        return Ok(Vec::new());
    };
    let shown = overlays.value()?.images.iter();
    let named = shown.map(|shown| Ok((&*site.images[shown.image].times.value()?.id, shown)));
    named.collect()
}

/// The cameras of the images that kernels orient, each once.
fn cameras(images: &[SiteImage]) -> Result<Vec<&Instrument>> {
    let mut cameras: Vec<&Instrument> = Vec::new();
    for image in images {
        let times = image.times.value()?;
        let camera = &times.instrument;
        if times.support.is_none() && !cameras.contains(&camera) {
            cameras.push(camera);
        }
    }
    Ok(cameras)
}

/// Whether the orientation that is used has polynomials of ω, φ and κ.
const fn has_angles(config: &SiteConfig) -> bool {
    match config.registration.model {
        CameraModel::FirstOrder | CameraModel::SecondOrder => true,
        CameraModel::RotationVector | CameraModel::Samples => false,
    }
}

/// Images whose angles ω and κ turn about nearly the same axis.
fn gimbal_locks(images: &[SiteImage]) -> Result<Vec<String>> {
    let mut locks = Vec::new();
    for image in images {
        let (times, model) = (image.times.value()?, image.model.value()?);
        if model.near_gimbal_lock {
            locks.push(format!(
                "image {}: |cos φ| falls to {:.3}, where ω and κ are poorly determined; the rotation-vector form is unaffected",
                times.id, model.cos_phi_min
            ));
        }
    }
    Ok(locks)
}

/// Images that one camera took at one time with the same pixels: their labels may have been exchanged.
fn same_exposures(images: &[SiteImage]) -> Result<Vec<String>> {
    let mut same = Vec::new();
    for (index, image) in images.iter().enumerate() {
        let times = image.times.value()?;
        for earlier in &images[..index] {
            let other = earlier.times.value()?;
            let apart_s = times
                .line_times
                .start()
                .since(other.line_times.start())
                .abs();
            if apart_s < times.line_times.mean_period_s() && times.detector() == other.detector() {
                same.push(format!(
                    "images {} and {} were exposed at the same time by the same pixels: one of the labels may belong to another image",
                    other.id, times.id
                ));
            }
        }
    }
    Ok(same)
}

/// PEDR files without a shot in the windows: each that the site file names, and those of patterns of which most files
/// have shots. A pattern of which most have none searches an archive.
fn empty_pedr_files(config: &SiteConfig, site: &Site) -> Result<Option<String>> {
    let footprints = &site.converted.value()?.footprints;
    let with_shots: BTreeSet<u16> = footprints.file.iter().copied().collect();
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
            "no shot in the windows comes from {}: check that each is a PEDR file of this site's orbits",
            empty.join(", ")
        )
    }))
}

fn judged_images(images: &[SiteImage]) -> Result<Vec<JudgedImage<'_>>> {
    let images = images.iter().map(|image| {
        Ok(JudgedImage {
            times: image.times.value()?,
            orientation: image.orientation.value()?,
            model: image.model.value()?,
        })
    });
    images.collect()
}

/// Notes for a reader of the products, one sentence each.
pub(super) fn notes(config: &SiteConfig, site: &Site) -> Result<Vec<String>> {
    let mut notes = Vec::new();
    if let Some(choice) = &site.choice {
        notes.extend(choice.value()?.notes.iter().cloned());
    }
    if let Some(kernels) = &site.kernels {
        notes.extend(kernels.notes().cloned());
    }
    notes.extend(site.found.value()?.notes.iter().cloned());
    notes.extend(site.converted.value()?.notes.iter().cloned());
    for image in &site.images {
        let times = image.times.value()?;
        let of_image = times.notes.iter();
        notes.extend(of_image.map(|note| format!("image {}: {note}", times.id)));
    }
    if !has_angles(config) {
        notes.extend(gimbal_locks(&site.images)?);
    }
    if let Some(ties) = &site.ties {
        notes.extend(ties.value()?.notes());
    }
    let said = notes
        .iter()
        .map(|note| with_minus(&config.wording().of(&**note)));
    Ok(said.collect())
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
    let complaints = site.found.value()?.complaints.iter();
    let mut complaints: Vec<String> = complaints.map(ToString::to_string).collect();
    if let Some(ties) = &site.ties {
        complaints.extend(ties.value()?.complaints.iter().cloned());
    }
    Ok(complaints.iter().map(|of| with_minus(of)).collect())
}

/// Rejected shots inside a window, by reason.
pub(super) fn rejected(site: &Site) -> Result<BTreeMap<String, u64>> {
    let rejected = site.found.value()?.rejected.iter();
    Ok(rejected
        .map(|(reason, count)| (reason.to_string(), *count))
        .collect())
}
