//! Configuration, files and kernel coverage of a site, without running it.

use std::path::Path;

use super::{
    Stage,
    steps::{load_kernels, wanted},
};
use crate::{
    config::{DatumChoice, KernelSource, SiteConfig},
    error::{Failure, Place, Result},
    pds::pedr,
    spice::{Session, Wanted},
    stages::{sample_orientation::sample_orientation, tag_times::tag_times},
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

/// Checks kernels, image labels with their coverage, and PEDR labels of a site.
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

/// Checks the kernels; of rival sets every one, since any of them may be chosen.
fn check_kernels(config: &SiteConfig, checked: &mut Checked) -> Result<()> {
    let KernelSource::Sets(sets) = &config.kernels.source else {
        return check_set(config, 0, "", checked);
    };
    for (index, set) in sets.iter().enumerate() {
        let prefix = format!("kernel set {}: ", set.id);
        if let Err(failure) = check_set(config, index, &prefix, checked) {
            checked.failures.push(failure.in_site(&config.site));
        }
    }
    Ok(())
}

fn check_set(config: &SiteConfig, index: usize, prefix: &str, checked: &mut Checked) -> Result<()> {
    let clocks = load_kernels(config, &Wanted::default(), index)?;
    let session = Session::open(&clocks)?;
    let mut images = Vec::new();
    for image in &config.images {
        match tag_times(std::slice::from_ref(image), &session) {
            Ok(mut times) => images.append(&mut times),
            Err(failure) => checked.failures.push(failure.in_site(&config.site)),
        }
    }
    drop(session);
    let kernels = load_kernels(config, &wanted(config, &images, &[]), index)?;
    let explanation = kernels.explanation().iter();
    checked
        .findings
        .extend(explanation.map(|line| format!("{prefix}{line}")));
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
        let finding = sampled.in_stage(&Stage::SampleOrientation.of_image(&image.id)).map(|_| {
            format!(
                "{prefix}image {}: {} lines from {} UTC, first line centre {}, position and attitude covered",
                image.id,
                image.lines_header,
                image.utc_start,
                image.line_centre(0)
            )
        });
        checked.note(finding, config);
    }
    Ok(())
}
