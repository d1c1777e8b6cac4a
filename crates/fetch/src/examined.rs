//! Whether a file in the folder is the planned one.

use std::fs;

use crate::{
    client::{Ask, Client, Fault, Reply},
    error::FetchError,
    hashed::Hashed,
    outcome::Done,
    part::Part,
    plan::{FileKind, PlannedFile},
    state::{Record, Verified},
};
use areograph_base::error::{Error, Result};

/// Whether the file in the folder is the planned one; `None` if it must be fetched anew.
///
/// * `is_thorough` – whether a recorded file is read
pub(crate) fn examined(
    file: &PlannedFile,
    known: Option<&Record>,
    part: &Part,
    client: &Client,
    is_thorough: bool,
) -> Result<Option<(Done, Record)>> {
    let size = fs::metadata(&file.path)
        .map(|found| found.len())
        .unwrap_or_default();
    let is_stated = |md5: &str| file.md5.as_ref().is_none_or(|stated| stated == md5);
    if let Some(record) = known
        && record.bytes == size
        && is_stated(&record.md5)
        && (!is_thorough || record.is(&Hashed::of(&file.path)?))
    {
        return Ok(Some((Done::Present, record.clone())));
    }
    let conflict = |problem: String| Error::from(FetchError::Conflict { problem });
    let hashed = Hashed::of(&file.path)?;
    if let Some(md5) = &file.md5 {
        if *md5 == hashed.md5 {
            let record = Record::of(&file.url, hashed, Verified::Md5, &file.why);
            return Ok(Some((Done::Adopted, record)));
        }
        // The archive has a new version of a file that areograph fetched and that is unchanged since.
        if known.is_some_and(|record| record.is(&hashed)) {
            return Err(conflict(format!(
                "fetched earlier with MD5 {}; the archive now has {md5}",
                hashed.md5
            )));
        }
        return Err(conflict(format!(
            "MD5 is {}; expected {md5} according to the archive",
            hashed.md5
        )));
    }
    if let Some(record) = known {
        let problem = format!(
            "{} bytes with SHA-256 {}; expected {} bytes with {}, as fetched",
            hashed.bytes, hashed.sha256, record.bytes, record.sha256
        );
        return Err(conflict(problem));
    }
    // A process that was killed between the name and the record.
    if part.meta.sha256.as_ref() == Some(&hashed.sha256) {
        let record = Record {
            made_url: file.shot_box.as_ref().map(|_| part.meta.url.clone()),
            ..Record::of(&file.url, hashed, verified_by(file, part), &file.why)
        };
        return Ok(Some((Done::Adopted, record)));
    }
    if file.kind == FileKind::Shots {
        let bytes = hashed.bytes;
        return Err(conflict(format!(
            "{bytes} bytes that areograph did not fetch"
        )));
    }
    let exact = file.bytes.filter(|_| file.is_exact);
    let length = match exact {
        Some(bytes) => Some(bytes),
        None => length_of(client, &file.url)?,
    };
    match length {
        Some(length) if length == hashed.bytes => {
            let record = Record::of(&file.url, hashed, Verified::Size, &file.why);
            Ok(Some((Done::Adopted, record)))
        }
        Some(length) => Err(conflict(format!(
            "{} bytes; expected {length}",
            hashed.bytes
        ))),
        None => Ok(None),
    }
}

/// Basis on which a transferred file was verified.
pub(crate) fn verified_by(file: &PlannedFile, part: &Part) -> Verified {
    match file.kind {
        FileKind::Shots => Verified::Rows,
        _ if file.md5.is_some() || part.meta.md5.is_some() => Verified::Md5,
        FileKind::Kernel | FileKind::Pedr | FileKind::Image => Verified::Size,
    }
}

/// Size of a file by its server.
fn length_of(client: &Client, url: &str) -> Result<Option<u64>> {
    match client.get(url, Ask::default()) {
        Ok(Reply::Body(answer)) => Ok(answer.meta.length),
        Ok(_) => Ok(None),
        Err(Fault::Lasting(failure)) => Err(failure),
        Err(Fault::Passing(problem, _)) => {
            let url = url.to_owned();
            Err(FetchError::Network {
                url,
                problem,
                attempts: 1,
            }
            .into())
        }
    }
}
