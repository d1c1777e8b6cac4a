//! Some bytes of a file, by one request.

use std::{
    fs::File,
    io::{ErrorKind, Read},
    ops::Range,
    os::unix::fs::FileExt as _,
    time::SystemTime,
};

use super::error::RemoteError;
use crate::{
    address::mirror,
    client::{Ask, Fault, header, refused},
    error::FetchError,
    headers::{range_of, wait_of},
    transfer::Receiver,
};
use areograph_base::error::{IoError, Locate as _, Result, Stopped};

/// Bytes that are read at a time.
const CHUNK: usize = 1 << 16;

/// Successive bytes of a file.
#[derive(Debug)]
pub(super) struct Wanted<'a> {
    pub(super) url: &'a str,
    /// Length of the file when it was indexed.
    pub(super) length: u64,
    pub(super) bytes: Range<u64>,
    /// The part in messages.
    pub(super) part: &'a str,
}

/// Bytes that arrived, and the server's validator of the file.
#[derive(Debug, Default)]
pub(super) struct Received {
    pub(super) bytes: Vec<u8>,
    pub(super) validator: Option<String>,
}

/// Receives exactly these bytes.
///
/// # Errors
/// [`RemoteError`]; [`FetchError`] of addresses; [`Stopped`].
pub(super) fn receive(receiver: &Receiver<'_>, wanted: &Wanted<'_>) -> Result<Received> {
    let mut failed = 0;
    loop {
        Stopped::check(receiver.stop)?;
        match attempt(receiver, wanted) {
            Ok(received) => return Ok(received),
            Err(Fault::Lasting(failure)) => return Err(super::error::advised(failure)),
            Err(Fault::Passing(problem, asked)) => {
                failed += 1;
                let paused = receiver.pause(wanted.url, problem, asked, failed);
                paused.map_err(super::error::advised)?;
            }
        }
    }
}

/// Makes sure that the server sends parts of a file: without them, the file can be indexed, but not read.
///
/// # Errors
/// [`RemoteError::NoRanges`]. Any other problem is reported by the transfer of the file.
pub(super) fn require_ranges(receiver: &Receiver<'_>, url: &str) -> Result<()> {
    let ask = Ask {
        range: Some([0, 0]),
        ..Ask::default()
    };
    let is_whole = mirror(url).is_none()
        && (receiver.client.respond(url, ask)).is_ok_and(|answer| answer.status() == 200);
    if is_whole {
        let url = url.to_owned();
        return Err(RemoteError::NoRanges { url }.into());
    }
    Ok(())
}

fn attempt(receiver: &Receiver<'_>, wanted: &Wanted<'_>) -> std::result::Result<Received, Fault> {
    let url = wanted.url.to_owned();
    if let Some(path) = mirror(&url) {
        let read = || -> std::io::Result<Received> {
            let file = File::open(&path)?;
            let length = file.metadata()?.len();
            let mut bytes = vec![0; length_of(wanted)];
            match file.read_exact_at(&mut bytes, wanted.bytes.start) {
                // A shorter file: its bytes are those of no block.
                Err(error) if error.kind() == ErrorKind::UnexpectedEof => bytes.clear(),
                other => other?,
            }
            let validator = Some(format!("length {length}"));
            Ok(Received { bytes, validator })
        };
        return Ok(read().map_err(IoError::on("read")).in_file(path)?);
    }
    let ask = Ask {
        range: Some([wanted.bytes.start, wanted.bytes.end - 1]),
        ..Ask::default()
    };
    let response = receiver.client.respond(&url, ask)?;
    let status = response.status().as_u16();
    let stated = |name| header(&response, name);
    let content_length: Option<u64> = stated("content-length").and_then(|text| text.parse().ok());
    let changed = |found: String| {
        Fault::from(RemoteError::Changed {
            url: url.clone(),
            part: wanted.part.to_owned(),
            found,
            expected: format!("a file of {} bytes", wanted.length),
            is_noticed: true,
        })
    };
    match status {
        206 => {}
        200 => {
            let other = content_length.filter(|length| *length != wanted.length);
            return Err(match other {
                Some(length) => changed(format!("the file has {length} bytes")),
                None => RemoteError::NoRanges { url }.into(),
            });
        }
        416 => return Err(changed("the file does not reach so far".to_owned())),
        _ => {
            let wait = stated("retry-after").and_then(|text| wait_of(text, SystemTime::now()));
            return Err(refused(&url, status, wait));
        }
    }
    if stated("content-encoding").is_some_and(|coding| coding != "identity") {
        let problem = "the answer is encoded, although the unencoded file was requested".to_owned();
        return Err(FetchError::Content { url, problem }.into());
    }
    match stated("content-range").and_then(range_of) {
        Some((_, Some(length))) if length != wanted.length => {
            return Err(changed(format!("the file has {length} bytes")));
        }
        Some(([first, last], _)) if first == wanted.bytes.start && last == wanted.bytes.end - 1 => {
        }
        _ => {
            let problem = "the server sent other bytes of the file than requested".to_owned();
            return Err(Fault::Passing(problem, None));
        }
    }
    let length = length_of(wanted);
    if let Some(announced) = content_length.filter(|announced| *announced != length as u64) {
        let problem = format!("the answer has {announced} bytes; requested were {length}");
        return Err(Fault::Passing(problem, None));
    }
    let validator = stated("etag").or(stated("last-modified"));
    let validator = validator.map(str::to_owned);
    let bytes = body(receiver, response.into_body().into_reader(), length)?;
    Ok(Received { bytes, validator })
}

fn length_of(wanted: &Wanted<'_>) -> usize {
    usize::try_from(wanted.bytes.end - wanted.bytes.start).unwrap_or(usize::MAX)
}

/// The bytes of a body, which has this length.
fn body(
    receiver: &Receiver<'_>,
    mut body: impl Read,
    length: usize,
) -> std::result::Result<Vec<u8>, Fault> {
    let mut bytes = Vec::with_capacity(length);
    let mut buffer = vec![0; CHUNK];
    loop {
        Stopped::check(receiver.stop)?;
        match body.read(&mut buffer) {
            Ok(0) => break,
            Ok(count) => bytes.extend_from_slice(&buffer[..count]),
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(error) => {
                let problem = format!("{error} after {} of {length} bytes", bytes.len());
                return Err(Fault::Passing(problem, None));
            }
        }
        if bytes.len() > length {
            let problem = "more bytes were received than requested".to_owned();
            return Err(Fault::Passing(problem, None));
        }
    }
    if bytes.len() < length {
        let problem = format!("the transfer ended after {} of {length} bytes", bytes.len());
        return Err(Fault::Passing(problem, None));
    }
    Ok(bytes)
}
