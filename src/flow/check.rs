//! Configuration, files and kernel coverage of a site, without writing anything.

use std::{path::Path, sync::atomic::AtomicBool};

use super::{
    Stage,
    kernels::{load_kernels, wanted},
};
use crate::{
    altimetry::DatumChoice,
    config::SiteConfig,
    error::{Failure, Place, Result},
    kernel_source::KernelSource,
    pds::pedr,
    spice::{Session, Wanted},
    stages::{
        convert_datum::convert_datum,
        group_profiles::{Profile, group_profiles},
        read_ties::read_ties,
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

/// Checks a site's kernels, labels, PEDR and tie point files, and coverage at its images and at its shots.
///
/// The PEDR files are searched as a run does it: only shots in the windows tell which times are needed.
#[must_use]
pub fn check_site(config: &SiteConfig) -> Checked {
    let mut checked = Checked::default();
    for path in &config.pedr.files {
        checked.note(check_pedr(path, config.pedr.datum), config);
    }
    if !config.ties.files.is_empty() {
        checked.note(check_ties(config), config);
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

fn check_ties(config: &SiteConfig) -> Result<String> {
    let ties = read_ties(&config.ties, &config.images).in_stage(Stage::ReadTies.name())?;
    let (points, joining) = (ties.points.len(), ties.joining());
    let bad = match ties.complaint_count {
        0 => String::new(),
        count => format!("; {count} records that cannot be read"),
    };
    Ok(format!(
        "{points} tie points, {joining} of them in two or more images{bad}"
    ))
}

/// Profiles of the site's shots, as [`super::run_site`] finds them; nothing is stored.
pub(super) fn find_profiles(config: &SiteConfig, images: &[ImageTimes]) -> Result<Vec<Profile>> {
    let correction_s = config.mola_clock.correction_s();
    let never = AtomicBool::new(false);
    let found = search_footprints(&config.pedr, &config.windows, correction_s, &never)?;
    let footprints = convert_datum(found.footprints, &config.mola_clock).footprints;
    Ok(group_profiles(&footprints, &config.windows, images))
}

/// Position at the shots of every profile; one finding for all that have it.
fn check_profiles(
    needs: &Needs,
    session: &Session,
    config: &SiteConfig,
    prefix: &str,
    checked: &mut Checked,
) {
    let (mut covered, mut shots) = (0, 0);
    for profile in &needs.profiles {
        let position = session.require_position(profile.interval);
        match position.in_stage(Stage::CheckRanges.name()) {
            Ok(()) => {
                covered += 1;
                shots += profile.rows.len();
            }
            Err(failure) => checked.failures.push(failure.in_site(&config.site)),
        }
    }
    let of = needs.profiles.len();
    if of > 0 {
        let finding =
            format!("{prefix}{covered} of {of} profiles ({shots} shots): position covered");
        checked.findings.push(finding);
    }
}

/// What the site asks of its kernels.
struct Needs {
    images: Vec<ImageTimes>,
    /// Empty when a PEDR file cannot be used: that was told before.
    profiles: Vec<Profile>,
}

/// Coverage at images and shots; of rival sets of kernels every one, since any of them may be chosen.
fn check_kernels(config: &SiteConfig, checked: &mut Checked) -> Result<()> {
    let needs = needs(config, checked)?;
    let KernelSource::Sets(sets) = &config.kernels.source else {
        return check_set(config, 0, "", &needs, checked);
    };
    for (index, set) in sets.iter().enumerate() {
        let prefix = format!("kernel set {}: ", set.id);
        if let Err(failure) = check_set(config, index, &prefix, &needs, checked) {
            checked.failures.push(failure.in_site(&config.site));
        }
    }
    Ok(())
}

/// Times of the images by the clocks of the first set, and the shots in the windows.
fn needs(config: &SiteConfig, checked: &mut Checked) -> Result<Needs> {
    let searchable = !config.pedr.files.is_empty() && checked.failures.is_empty();
    let clocks = load_kernels(config, &Wanted::default(), 0)?;
    let session = Session::open(&clocks)?;
    let mut images = Vec::new();
    for image in &config.images {
        match tag_times(std::slice::from_ref(image), &session) {
            Ok(mut times) => images.append(&mut times),
            Err(failure) => checked.failures.push(failure.in_site(&config.site)),
        }
    }
    drop(session);
    let mut found = Vec::new();
    if searchable {
        match find_profiles(config, &images) {
            Ok(profiles) => found = profiles,
            Err(failure) => checked.failures.push(failure.in_site(&config.site)),
        }
        if found.is_empty() && checked.failures.is_empty() {
            let finding = "no shot in any window: products would be invalid";
            checked.findings.push(finding.to_owned());
        }
    }
    Ok(Needs {
        images,
        profiles: found,
    })
}

fn check_set(
    config: &SiteConfig,
    index: usize,
    prefix: &str,
    needs: &Needs,
    checked: &mut Checked,
) -> Result<()> {
    let wanted = wanted(config, &needs.images, &needs.profiles);
    let kernels = load_kernels(config, &wanted, index)?;
    let explanation = kernels.explanation().iter();
    checked
        .findings
        .extend(explanation.map(|line| format!("{prefix}{line}")));
    let session = Session::open(&kernels)?;
    for image in &needs.images {
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
                "{prefix}image {}: {} lines from {} UTC, first line centre {}, position and attitude covered{}",
                image.id,
                image.lines_header,
                image.utc_start,
                image.line_centre(0),
                invalid.collect::<String>()
            )
        });
        checked.note(finding, config);
    }
    check_profiles(needs, &session, config, prefix, checked);
    Ok(())
}
