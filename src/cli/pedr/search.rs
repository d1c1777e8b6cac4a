//! `areograph pedr search`.

mod arguments;

pub(super) use self::arguments::Arguments;
use crate::{
    cli::{output, stop::Signals},
    config::WindowConfig,
    error::Result,
    flow::{COMPLAINTS_MAX, ShotRequest, ShotSearch, ShotSink},
    footprints::{AsRead, Footprints},
    pds::archive::{Judged, WindowLists},
    products::ShotsFile,
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

pub(super) fn run(arguments: &Arguments) -> Result<()> {
    let format = arguments.format()?;
    let windows = arguments.windows.windows()?;
    let time = arguments.time()?;
    let signals = Signals::heard()?;
    arguments.check_paths()?;
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
    output::json(&answer.statement);
    if answer.complaints > 0 {
        tracing::warn!(
            "{} complaints: invalid records are skipped; `complaints` of the answer counts them by reason, \
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
