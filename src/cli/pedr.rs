//! `areograph pedr`.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use clap::{Args, Subcommand};
use serde_json::json;

use super::{output, pedr_index, pedr_search};
use crate::{
    error::{Error, Locate as _},
    pds::pedr::{Complaint, FieldGuard, File},
    spice::{KernelSet, Session},
    time::Et,
};

/// Looks into PEDR files.
#[derive(Debug, Args)]
pub(super) struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Shows label, orbits, time span and everything that is wrong with each file.
    Info {
        /// PEDR files (AP#####v.B).
        #[arg(required = true, value_name = "FILE")]
        files: Vec<PathBuf>,
        /// Leap seconds (LSK, such as naif0012.tls): shows the time span in UTC as well.
        #[arg(long, value_name = "FILE")]
        leap_seconds: Option<PathBuf>,
        /// Print JSON.
        #[arg(long)]
        json: bool,
    },
    /// Makes the index of an archive, or brings it up to date.
    Index(pedr_index::Arguments),
    /// Finds the shots of an archive that lie in windows.
    Search(pedr_search::Arguments),
}

/// Complaints printed for a file; all are counted.
const COMPLAINTS_PRINTED: usize = 20;

pub(super) fn run(arguments: &Arguments) -> Result<(), Error> {
    let (files, leap_seconds, json) = match &arguments.command {
        Command::Info {
            files,
            leap_seconds,
            json,
        } => (files, leap_seconds, json),
        Command::Index(arguments) => return pedr_index::run(arguments),
        Command::Search(arguments) => return pedr_search::run(arguments),
    };
    let clock = match leap_seconds {
        Some(kernel) => Some(Session::open(&KernelSet::from_files(
            std::slice::from_ref(kernel),
        )?)?),
        None => None,
    };
    let (mut answers, mut useless) = (Vec::new(), Vec::new());
    for path in files {
        let file = File::open(path)?;
        let answer = info(path, &file, clock.as_ref())?;
        useless.extend(file.require_records().err());
        if *json {
            answers.push(answer);
        } else {
            print(&answer);
        }
    }
    if *json {
        output::json(&answers.into());
    }
    // Every file is shown first; the last of the useless ones is told by whoever called.
    let last = useless.pop();
    useless.iter().for_each(output::error);
    last.map_or(Ok(()), Err)
}

fn info(path: &Path, file: &File, clock: Option<&Session>) -> Result<serde_json::Value, Error> {
    let guard = FieldGuard::new(file.label().software_version);
    let mut complaints: Vec<Complaint> = file.label_complaints().to_vec();
    let mut orbits: BTreeMap<u32, u64> = BTreeMap::new();
    let mut span_s: Option<[f64; 2]> = None;
    for (row, frame) in file.frames(0..file.records().len(), guard) {
        if let Err(error) = &frame {
            complaints.push(file.record_complaint(row, error));
            continue;
        }
        let record = &file.records()[row];
        *orbits.entry(record.orbit.get()).or_default() += 1;
        let time_s = record.time_s.get();
        span_s = Some(span_s.map_or([time_s; 2], |[first, _]| [first, time_s]));
    }
    complaints.extend(file.trailing_complaint());
    let label = file.label();
    let mut answer = json!({
        "file": path,
        "version": file.name().map(|name| name.version),
        "product_id": label.product_id,
        "data_set_id": label.data_set_id,
        "software_version": label.software_version,
        "datum_in_label": label.datum,
        "records": file.records().len(),
        "good_records": orbits.values().sum::<u64>(),
        "orbits": orbits.keys().collect::<Vec<_>>(),
        "et_first_s": span_s.map(|[first, _]| first),
        "et_last_s": span_s.map(|[_, last]| last),
        "blake3": file.blake3(),
        "complaints": complaints.iter().map(ToString::to_string).collect::<Vec<_>>(),
    });
    if let (Some(clock), Some([first_s, last_s])) = (clock, span_s) {
        let kernel = &clock.kernels().kernels()[0].path;
        let utc = |et_s| clock.et_to_utc(Et::from_seconds(et_s)).in_file(kernel);
        answer["utc_first"] = utc(first_s)?.into();
        answer["utc_last"] = utc(last_s)?.into();
    }
    Ok(answer)
}

fn print(answer: &serde_json::Value) {
    for (key, value) in answer.as_object().into_iter().flatten() {
        match value.as_array() {
            Some(texts) if key == "complaints" => {
                output::line(format_args!("{key:18}{}", texts.len()));
                for text in texts.iter().take(COMPLAINTS_PRINTED) {
                    output::line(format_args!("  {}", text.as_str().unwrap_or_default()));
                }
            }
            _ => output::line(format_args!("{key:18}{value}")),
        }
    }
}
