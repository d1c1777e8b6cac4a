//! `areograph pedr info`.

use std::{
    collections::BTreeMap,
    fmt::Display,
    path::{Path, PathBuf},
};

use clap::Args;
use serde_json::{Value, json};

use super::tables::TableCounts;
use crate::{
    cli::{
        files::{PEDR_FILES, expand},
        output,
    },
    error::{Error, Locate as _},
    flow::instant_of_table,
    geom::statistics::Summary,
    pds::{
        pedr::{Counts, File},
        shot_table::is_ode_pedr,
    },
    spice::{KernelSet, Session},
    time::Et,
};

/// Shows label, orbits, time span, statistics of the shots, and all errors of each file.
///
/// Shots are counted by class, trigger channel, attitude flag and orbit model, excluding shots without a return and
/// contradictory shots. Ranges are compared with the distance from the spacecraft position in the file to the footprint,
/// which was computed with this position, so that the difference tests the file and its reader without kernels.
#[derive(Debug, Args)]
#[command(after_help = "Example: areograph pedr info pedr/*.b")]
pub(super) struct Arguments {
    /// PEDR files (AP#####v.B), folders or globs of them, and tables of the Orbital Data Explorer's PEDR query.
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// Leap seconds (LSK, such as naif0012.tls): shows the time span in UTC as well.
    #[arg(long, value_name = "FILE")]
    leap_seconds: Option<PathBuf>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// Complaints shown for a file; all are counted.
const COMPLAINTS_PRINTED: usize = 20;

pub(super) fn run(arguments: &Arguments) -> Result<(), Error> {
    let clock = match &arguments.leap_seconds {
        Some(kernel) => Some(Session::open(&KernelSet::from_files(
            std::slice::from_ref(kernel),
        )?)?),
        None => None,
    };
    let (mut answers, mut useless) = (Vec::new(), Vec::new());
    for path in &expand(&arguments.files, &PEDR_FILES)? {
        if is_ode_pedr(path).unwrap_or(false) {
            match info_of_table(path, clock.as_ref()) {
                Ok(answer) if arguments.json => answers.push(answer),
                Ok(answer) => print(None, &answer),
                Err(failure) => useless.push(failure),
            }
            continue;
        }
        let file = match File::open(path) {
            Ok(file) => file,
            Err(failure) => {
                useless.push(failure);
                continue;
            }
        };
        let (counts, answer) = info(path, &file, clock.as_ref())?;
        useless.extend(file.require_records().err());
        if arguments.json {
            answers.push(answer);
        } else {
            print(Some(&counts), &answer);
        }
    }
    if arguments.json {
        output::json(&answers.into());
    }
    // Every file is shown first; the caller reports the last unusable one.
    let last = useless.pop();
    useless.iter().for_each(output::error);
    last.map_or(Ok(()), Err)
}

fn info(path: &Path, file: &File, clock: Option<&Session>) -> Result<(Counts, Value), Error> {
    let (counts, complaints) = file.count();
    let label = file.label();
    let mut answer = json!({
        "file": path,
        "version": file.name().map(|name| name.version),
        "product_id": label.product_id,
        "data_set_id": label.data_set_id,
        "software_version": label.software_version,
        "datum_in_label": label.datum,
        "records": counts.records,
        "good_records": counts.good_records,
        "orbits": counts.records_by_orbit.keys().collect::<Vec<_>>(),
        "et_first_s": counts.span_s.map(|[first_s, _]| first_s),
        "et_last_s": counts.span_s.map(|[_, last_s]| last_s),
        "shots": counts.shots,
        "without_return": counts.without_return,
        "spoiled_shots": counts.spoiled_shots,
        "shots_by_class": counts.shots_by_class,
        "shots_by_channel": counts.shots_by_channel,
        "shots_by_attitude_flag": counts.shots_by_attitude_flag,
        "shots_by_orbit_model": counts.shots_by_orbit_model,
        "range_minus_distance_m": {
            "ground": counts.ground_range_minus_distance_m,
            "other": counts.other_range_minus_distance_m,
        },
        "blake3": file.blake3(),
        "complaints": complaints.iter().map(ToString::to_string).collect::<Vec<_>>(),
    });
    add_utc(&mut answer, clock, counts.span_s)?;
    Ok((counts, answer))
}

fn info_of_table(path: &Path, clock: Option<&Session>) -> Result<Value, Error> {
    let utc = |text: &str| instant_of_table(clock, text);
    let counts = TableCounts::of(path, clock.map(|_| &utc as _))?;
    let mut answer = counts.answer(path)?;
    add_utc(&mut answer, clock, counts.span_s())?;
    Ok(answer)
}

/// Adds the time span in UTC, where leap seconds are known.
fn add_utc(
    answer: &mut Value,
    clock: Option<&Session>,
    span_s: Option<[f64; 2]>,
) -> Result<(), Error> {
    if let (Some(clock), Some([first_s, last_s])) = (clock, span_s) {
        let kernel = &clock.kernels().kernels()[0].path;
        let utc = |et_s| clock.et_to_utc(Et::from_seconds(et_s)).in_file(kernel);
        answer["utc_first"] = utc(first_s)?.into();
        answer["utc_last"] = utc(last_s)?.into();
    }
    Ok(())
}

/// The answer as a table; counts and statistics are on separate lines.
///
/// * `counts` – counts of a PEDR file
fn print(counts: Option<&Counts>, answer: &Value) {
    for (key, value) in answer.as_object().into_iter().flatten() {
        let counted = match (key.as_str(), counts) {
            ("shots_by_orbit_model", Some(counts)) => counted(&counts.shots_by_orbit_model),
            ("range_minus_distance_m", Some(counts)) => {
                statistics("ground", &counts.ground_range_minus_distance_m);
                statistics("other", &counts.other_range_minus_distance_m);
                continue;
            }
            ("range_minus_distance_m", None) => "not determined".to_owned(),
            ("shots_by_class" | "shots_by_channel" | "shots_by_attitude_flag", _) => {
                let members = value.as_object().into_iter().flatten();
                counted(
                    &members
                        .map(|(class, count)| (class.clone(), count.as_u64().unwrap_or(0)))
                        .collect(),
                )
            }
            ("complaints", _) => {
                let texts = value.as_array().map_or(&[][..], Vec::as_slice);
                line(key, texts.len());
                for text in texts.iter().take(COMPLAINTS_PRINTED) {
                    output::line(format_args!("  {}", text.as_str().unwrap_or_default()));
                }
                continue;
            }
            _ => match value {
                Value::String(text) => text.clone(),
                Value::Null => "not stated".to_owned(),
                other => other.to_string(),
            },
        };
        line(key, counted);
    }
}

fn line(key: &str, value: impl Display) {
    output::line(format_args!("{key:24}{value}"));
}

fn counted<K: Display>(counts: &BTreeMap<K, u64>) -> String {
    let counts = counts.iter().map(|(key, count)| format!("{key}: {count}"));
    let counts = counts.collect::<Vec<_>>().join(", ");
    if counts.is_empty() {
        "none".to_owned()
    } else {
        counts
    }
}

fn statistics(of: &str, residuals_m: &Summary) {
    let Summary {
        n,
        mean,
        standard_deviation,
        median,
        nmad,
        min,
        max,
    } = residuals_m;
    let key = format!("range-distance {of}");
    if *n == 0 {
        return line(&key, "0 shots");
    }
    line(
        &key,
        format_args!(
            "{n} shots, mean {mean:.3} m, sd {standard_deviation:.3} m, median {median:.3} m, NMAD {nmad:.3} m, \
             {min:.3} to {max:.3} m"
        ),
    );
}
