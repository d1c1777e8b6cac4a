//! `areograph pedr search`.

mod arguments;

use std::path::Path;

use serde_json::Value;

pub(super) use self::arguments::Arguments;
use crate::{
    cli::{files::exist, output, stop::Signals},
    config::WindowConfig,
    error::Result,
    flow::{COMPLAINTS_MAX, ShotRequest, ShotSearch, ShotSink},
    footprints::{AsRead, Footprints},
    pds::archive::{Judged, WindowLists},
    products::ShotsFile,
    service::words::counted,
};

/// The file of the shots, if one is requested.
struct Out(Option<ShotsFile>);

impl ShotSink for Out {
    fn take(&mut self, shots: Footprints<AsRead>, windows: &WindowLists) -> Result<()> {
        match &mut self.0 {
            Some(file) => file.write(shots, windows),
            None => Ok(()),
        }
    }
}

/// Windows whose counts are printed.
const WINDOWS_MAX: usize = 20;

/// The answer for people: counts, completeness, and the file.
fn print(statement: &Value, out: Option<&Path>) {
    let count = |of: &Value| of.as_u64().unwrap_or(0);
    let list = |name: &str| statement[name].as_array().map_or(&[][..], Vec::as_slice);
    let windows = list("windows");
    if windows.len() > 1 {
        for window in windows.iter().take(WINDOWS_MAX) {
            let id = window["id"].as_str().unwrap_or_default();
            output::line(format_args!("{id}: {} shots", count(&window["shots"])));
        }
        if windows.len() > WINDOWS_MAX {
            let more = windows.len() - WINDOWS_MAX;
            output::line(format_args!("… and {more} more windows (--json lists all)"));
        }
    }
    let (rows, files, read) = (
        count(&statement["rows"]),
        list("files").len(),
        count(&statement["frames_read"]),
    );
    let is_complete = statement["complete"].as_bool().unwrap_or(false);
    let incomplete = if is_complete { "" } else { "; INCOMPLETE" };
    output::line(format_args!(
        "{} in the windows; {} searched, {} read{incomplete}",
        counted(rows, "shot"),
        counted(files, "file"),
        counted(read, "record"),
    ));
    let rejected = statement["rejected"].as_object().into_iter().flatten();
    let rejected: Vec<String> = rejected
        .map(|(reason, shots)| format!("{reason}: {}", count(shots)))
        .collect();
    if !rejected.is_empty() {
        output::line(format_args!("rejected shots: {}", rejected.join(", ")));
    }
    if let Some(out) = out {
        output::line(format_args!("{}: written", out.display()));
    }
}

pub(super) fn run(arguments: &Arguments) -> Result<()> {
    let format = arguments.format()?;
    let windows = arguments.windows.windows()?;
    let time = arguments.time()?;
    let signals = Signals::heard()?;
    arguments.check_paths()?;
    // As for pages: nothing is created for a mistyped folder.
    let folder = arguments.out.as_deref().and_then(Path::parent);
    if let Some(folder) = folder.filter(|folder| *folder != Path::new("")) {
        exist(&[folder.to_owned()])?;
    }
    let filter = arguments.filter();
    let request = ShotRequest {
        paths: &arguments.paths,
        windows: &windows,
        filter: Some(&filter),
        time,
        judged: if arguments.check_all {
            Judged::All
        } else {
            Judged::Near
        },
        leap_seconds: arguments.leap_seconds.as_deref(),
    };
    let search = ShotSearch::open(request, signals.stop())?;
    arguments.require_apart(&search.paths(), search.failures())?;
    let mut out = Out(None);
    if let (Some(format), Some(path)) = (format, &arguments.out) {
        let ids = |window: &WindowConfig| window.id.clone();
        let window_ids = windows.iter().map(ids).collect();
        let file = ShotsFile::create(path, format, search.files().to_vec(), window_ids)?;
        out = Out(Some(file));
    }
    let answer = search.run(signals.stop(), &mut out)?;
    if let Out(Some(file)) = out {
        file.finish(&answer.statement)?;
    }
    if arguments.json {
        output::json(&answer.statement);
    } else {
        print(&answer.statement, arguments.out.as_deref());
    }
    if answer.complaints > 0 {
        tracing::warn!(
            "{} complaints: invalid records are skipped; with --json, `complaints` counts them by reason, and \
             `first_complaints` lists the first {COMPLAINTS_MAX}",
            answer.complaints
        );
    }
    let mut failures = answer.failures.into_iter();
    let Some(first) = failures.next() else {
        return Ok(());
    };
    failures.for_each(output::error);
    Err(first)
}
