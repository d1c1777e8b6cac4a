//! The index of an archive on a server.

use std::path::Path;

use serde_json::json;

use super::Arguments;
use crate::{
    cli::{output, progress::Progress},
    error::Error,
    fetch::{
        Archives,
        remote::{Indexed, Indexing},
    },
};

pub(super) fn run(url: &str, into: &Path, arguments: &Arguments) -> Result<(), Error> {
    let mut archives = match &arguments.archives {
        Some(path) => Archives::with(path)?,
        None => Archives::built_in()?,
    };
    archives.pedr.url = format!("{}/", url.trim_end_matches('/'));
    let indexing = Indexing {
        archives,
        replace: arguments.archives.is_some(),
        into,
        list: arguments.list.as_deref(),
        verify: arguments.verify,
    };
    let progress = Progress::of_work("pedr index");
    let indexed = progress.watch("streaming", |watch| indexing.run(watch))?;
    let Indexed {
        files,
        bytes,
        stand_in_bytes,
        read,
        removed,
        failures,
    } = indexed;
    if arguments.json {
        output::json(&json!({
            "index": into,
            "bytes": stand_in_bytes,
            "files": files,
            "bytes_of_files": bytes,
            "read": read,
            "removed": removed,
        }));
    } else {
        output::line(format_args!(
            "{}: {files} files of {bytes} bytes on the server, {read} of them streamed now, {removed} removed; stand-ins of \
             {stand_in_bytes} bytes",
            into.display()
        ));
    }
    let mut failures = failures.into_iter();
    let Some(first) = failures.next() else {
        return Ok(());
    };
    failures.for_each(output::error);
    Err(first)
}
