//! Configuration, files and kernel coverage of a site, without writing anything.

use std::{path::Path, sync::atomic::AtomicBool};

use super::{
    Stage,
    steps::{load_kernels, wanted},
};
use crate::{
    config::{DatumChoice, SiteConfig},
    error::{Failure, Place, Result},
    pds::pedr,
    spice::{Session, Wanted},
    stages::{
        convert_datum::convert_datum,
        group_profiles::{Profile, group_profiles},
        sample_orientation::sample_orientation,
        search_footprints::search_footprints,
        tag_times::{ImageTimes, tag_times},
    },
};

/// What a check found.
#[derive(Debug, Default)]
pub struct Checked {
    /// What is well, one line each.
    pub findings: Vec<String>,
    /// What a run would stumble over; all of it, not only the first.
    pub failures: Vec<Failure>,
}

impl Checked {
    fn note(&mut self, result: Result<String>, config: &SiteConfig) {
        match result.in_site(&config.site) {
            Ok(finding) => self.findings.push(finding),
            Err(failure) => self.failures.push(failure),
        }
    }
}

/// Checks a site's kernels, labels and PEDR files, and coverage at its images and at its shots.
///
/// The PEDR files are searched as a run does it: only shots in the windows tell which times are needed.
#[must_use]
pub fn check_site(config: &SiteConfig) -> Checked {
    let mut checked = Checked::default();
    for path in &config.pedr.files {
        checked.note(check_pedr(path, config.pedr.datum), config);
    }
    if let Err(failure) = check_kernels(config, &mut checked) {
        checked.failures.push(failure.in_site(&config.site));
    }
    checked
}

fn check_pedr(path: &Path, choice: DatumChoice) -> Result<String> {
    let file = pedr::File::open(path)?;
    file.require_records()?;
    let version = file.name().map(|name| name.version);
    let datum = pedr::decide_datum(choice, version, file.label().datum).in_file(path)?;
    let complaints: Vec<String> = file
        .label_complaints()
        .iter()
        .map(|complaint| format!("; {}", complaint.text))
        .collect();
    let frames = file.records().len();
    Ok(format!(
        "{}: {frames} frames in {datum}{}",
        path.display(),
        complaints.concat()
    ))
}

/// Profiles of the site's shots, as [`super::run_site`] finds them.
fn profiles(config: &SiteConfig, images: &[ImageTimes]) -> Result<Vec<Profile>> {
    let correction_s = config.mola_clock.correction_s();
    let never = AtomicBool::new(false);
    let found = search_footprints(&config.pedr, &config.windows, correction_s, &never)?;
    let footprints = convert_datum(found.footprints, &config.mola_clock).footprints;
    Ok(group_profiles(&footprints, &config.windows, images))
}

/// Position at the shots of every profile; one finding for all that have it.
fn check_profiles(
    profiles: &[Profile],
    session: &Session,
    config: &SiteConfig,
    checked: &mut Checked,
) {
    let (mut covered, mut shots) = (0, 0);
    for profile in profiles {
        let position = session.require_position(profile.interval);
        match position.in_stage(Stage::CheckRanges.name()) {
            Ok(()) => {
                covered += 1;
                shots += profile.rows.len();
            }
            Err(failure) => checked.failures.push(failure.in_site(&config.site)),
        }
    }
    let of = profiles.len();
    let finding = format!("{covered} of {of} profiles ({shots} shots): position covered");
    checked.findings.push(finding);
}

/// Coverage at images, and at shots unless a PEDR file cannot be used: that was told before.
fn check_kernels(config: &SiteConfig, checked: &mut Checked) -> Result<()> {
    let searchable = !config.pedr.files.is_empty() && checked.failures.is_empty();
    let clocks = load_kernels(config, &Wanted::default())?;
    let session = Session::open(&clocks)?;
    let mut images = Vec::new();
    for image in &config.images {
        match tag_times(std::slice::from_ref(image), &session) {
            Ok(mut times) => images.append(&mut times),
            Err(failure) => checked.failures.push(failure.in_site(&config.site)),
        }
    }
    drop(session);
    let found = searchable.then(|| profiles(config, &images)).transpose();
    let profiles = found.unwrap_or_else(|failure| {
        checked.failures.push(failure.in_site(&config.site));
        None
    });
    let flights = profiles.as_deref().unwrap_or_default();
    let kernels = load_kernels(config, &wanted(config, &images, flights))?;
    checked
        .findings
        .extend(kernels.explanation().iter().cloned());
    let session = Session::open(&kernels)?;
    for image in &images {
        // One pass of the stage itself meets whatever a run would: ephemerides, frames, gaps.
        let pointing = &config.pointing;
        let sampled = sample_orientation(
            &session,
            image,
            &config.kernels,
            pointing,
            &config.orientation,
        );
        let finding = sampled.in_stage(&Stage::SampleOrientation.of_image(&image.id)).map(|orientation| {
            let invalid = orientation.invalid_because.iter();
            let invalid = invalid.map(|reason| format!("; products would be invalid: {reason}"));
            format!(
                "image {}: {} lines from {} UTC, first line centre {}, position and attitude covered{}",
                image.id,
                image.lines_header,
                image.utc_start,
                image.line_centre(0),
                invalid.collect::<String>()
            )
        });
        checked.note(finding, config);
    }
    match profiles.as_deref() {
        Some([]) => {
            let finding = "no shot in any window: products would be invalid";
            checked.findings.push(finding.to_owned());
        }
        Some(profiles) => check_profiles(profiles, &session, config, checked),
        None => {}
    }
    Ok(())
}
