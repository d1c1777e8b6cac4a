//! Output of a fetch.

use crate::{
    cli::output,
    fetch::{
        Done, Outcome, Standing,
        audit::Audit,
        plan::{Plan, PlannedFile},
    },
};

/// A number of bytes for people.
fn size(bytes: u64) -> String {
    let megabytes = bytes as f64 / 1e6;
    if megabytes >= 1.0 {
        format!("{megabytes:.1} MB")
    } else {
        format!("{bytes} B")
    }
}

fn size_of(file: &PlannedFile) -> String {
    match file.bytes {
        Some(bytes) if file.is_exact => size(bytes),
        Some(bytes) => format!("about {}", size(bytes)),
        None => "size unknown".to_owned(),
    }
}

pub(super) fn plan(plan: &Plan, standing: &[Standing]) {
    for (file, standing) in plan.files.iter().zip(standing) {
        let standing = match standing {
            Standing::Present => "present".to_owned(),
            Standing::Unknown => "present, to be compared".to_owned(),
            Standing::Other => "present, but a different file".to_owned(),
            Standing::Begun(bytes) => format!("{} have arrived", size(*bytes)),
            Standing::Missing => "missing".to_owned(),
        };
        output::line(format_args!(
            "{} {}: {standing}, {}\n  {}\n  {}",
            file.kind.word(),
            file.path.display(),
            size_of(file),
            file.url,
            file.why
        ));
    }
    for note in &plan.notes {
        output::line(format_args!("note: {note}"));
    }
    lacks(plan);
    let (known, unknown) = plan.bytes();
    let of_unknown = match unknown {
        0 => String::new(),
        files => format!(", and {files} of unknown size"),
    };
    let to_fetch = standing
        .iter()
        .filter(|standing| **standing != Standing::Present);
    output::line(format_args!(
        "files: {}, {}{of_unknown}; not present: {}",
        plan.files.len(),
        size(known),
        to_fetch.count()
    ));
}

pub(super) fn lacks(plan: &Plan) {
    for lack in &plan.lacks {
        output::line(format_args!("in_no_index {lack}"));
    }
}

/// One line for a file, as soon as it is complete or has failed.
pub(super) fn outcome(outcome: &Outcome) {
    let path = outcome.file.path.display();
    match &outcome.result {
        Ok((Done::Present, _)) => tracing::info!("{path}: present"),
        Ok((Done::Adopted, record)) => {
            output::line(format_args!(
                "{path}: was present and matches the file of the archive, {}",
                size(record.bytes)
            ));
        }
        Ok((Done::Empty, _)) => output::line(format_args!(
            "{path}: written without rows: the service has no shot in this part of the window"
        )),
        Ok((Done::Fetched { resumed: 0 }, record)) => {
            output::line(format_args!("{path}: fetched, {}", size(record.bytes)));
        }
        Ok((Done::Fetched { resumed }, record)) => {
            output::line(format_args!(
                "{path}: fetched, {}, of which {} had arrived earlier",
                size(record.bytes),
                size(*resumed)
            ));
        }
        Err(failure) => output::error(failure),
    }
}

pub(super) fn summary(outcomes: &[Outcome]) {
    let (mut present, mut fetched, mut failed) = (0, 0, 0);
    for outcome in outcomes {
        match &outcome.result {
            Ok((Done::Fetched { .. } | Done::Empty, _)) => fetched += 1,
            Ok(_) => present += 1,
            Err(_) => failed += 1,
        }
    }
    output::line(format_args!(
        "fetched: {fetched}; present: {present}; failed: {failed}"
    ));
}

pub(super) fn audit(audit: &Audit) {
    for (word, lines) in [
        ("missing", &audit.missing),
        ("differs", &audit.differ),
        ("not_needed", &audit.not_needed),
        ("not_fetched", &audit.foreign),
        ("in_no_index", &audit.in_no_index),
    ] {
        for line in lines {
            output::line(format_args!("{word} {line}"));
        }
    }
    output::line(format_args!(
        "missing: {}; differ: {}; not needed: {}; not fetched by areograph: {}; in no index: {}",
        audit.missing.len(),
        audit.differ.len(),
        audit.not_needed.len(),
        audit.foreign.len(),
        audit.in_no_index.len()
    ));
}
