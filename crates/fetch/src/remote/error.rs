//! Errors of archives that are read on their server.

use areograph_base::error::{Cause, Error};

use crate::error::{FetchError, advice_on_object};

/// Reasons why bytes of a file on a server cannot be used.
#[derive(Debug, thiserror::Error, Cause)]
pub enum RemoteError {
    /// The bytes are not those that were indexed.
    #[error("{part} of {url}: {found}; expected {expected} according to the index")]
    #[cause(Input: "the file on the server has changed since it was indexed: run `areograph pedr index URL{}` again with \
                   the same folder", verify(*is_noticed))]
    Changed {
        /// Address.
        url: String,
        /// Block and bytes.
        part: String,
        /// What the server has.
        found: String,
        /// What was indexed.
        expected: String,
        /// Whether an index notices the change without reading the file.
        is_noticed: bool,
    },
    /// The server does not send parts of files.
    #[error(
        "{url}: the server sends the whole file; expected the requested bytes (HTTP status 206)"
    )]
    #[cause(Io: "this server has no range requests: fetch the files (`areograph fetch`, or any other way), and \
                index the folder")]
    NoRanges {
        /// Address.
        url: String,
    },
    /// The server refuses or does not have the file.
    #[error("{url}: HTTP status {status}")]
    #[cause(Io: "{}", advice_on_object(url, *status).unwrap_or_else(|| advice_on(*status)))]
    Status {
        /// Address.
        url: String,
        /// Status of the answer.
        status: u16,
    },
    /// The server cannot be reached, or fails again and again.
    #[error("{url}: {problem}; attempts: {attempts}")]
    #[cause(Io: "check the address and the network, and run again later: bytes that have arrived are kept")]
    Unreachable {
        /// Address.
        url: String,
        /// The last problem.
        problem: String,
        /// Number of attempts without progress.
        attempts: u32,
    },
    /// Another request found that the server cannot be reached.
    #[error("{url}: not requested, because the server could not be reached just before")]
    #[cause(Io: "see the other message on this server, and run again later: bytes that have arrived are kept")]
    Down {
        /// Address.
        url: String,
    },
    /// A stand-in without an archive.
    #[error(
        "stands for a file on a server, but no folder above it contains {file}, which states the address"
    )]
    #[cause(Input: "leave stand-ins in the folder in which `areograph pedr index URL` put them")]
    NoArchive {
        /// Name of the file.
        file: &'static str,
    },
    /// A list names something that is no file of the archive.
    #[error(
        "line {line}: {found:?} is not a file of the archive; expected a path or an address below {url}"
    )]
    #[cause(Configuration: "correct the line, or give the address below which all files of the list are")]
    Listed {
        /// Line, counted from 1.
        line: usize,
        /// The text.
        found: String,
        /// Address of the archive.
        url: String,
    },
    /// A folder of stand-ins of another archive.
    #[error("describes the archive {found}; expected {expected}")]
    #[cause(Configuration: "give a different folder with --into; if the archive has moved, change url in this file first")]
    OtherArchive {
        /// Address in the folder.
        found: String,
        /// Address that was given.
        expected: String,
    },
    /// No PEDR file in a list.
    #[error("names no PEDR file (*.b); expected a path or an address in each line")]
    #[cause(Configuration: "name the files of the archive, or omit --list if the server lists them")]
    EmptyList,
    /// No PEDR file in the listings.
    #[error("{url}: the listing of the server names no PEDR file (*.b)")]
    #[cause(Configuration: "correct the address, or give a list of the files with --list")]
    NoFiles {
        /// Address.
        url: String,
    },
    /// More pages than an archive has.
    #[error("{url}: more than {max} folders below this address")]
    #[cause(Configuration: "give the address of the PEDR files, or a list of the files with --list")]
    TooManyFolders {
        /// Address.
        url: String,
        /// Limit.
        max: usize,
    },
    /// The server encodes its answers.
    #[error("{url}: {problem}")]
    #[cause(Io: "the server, or a proxy before it, does not serve the bytes of the file: give the address of another server, \
                or fetch the files and index their folder")]
    Encoded {
        /// Address.
        url: String,
        /// What the server does.
        problem: String,
    },
    /// The server redirects to where areograph does not follow.
    #[error("{url} redirects to {to}; the redirection is not followed: {why}")]
    #[cause(Io: "if the archive has moved, change url in areograph-archive.toml to its new address")]
    Redirect {
        /// Address.
        url: String,
        /// Its target.
        to: String,
        /// The rule.
        why: &'static str,
    },
    /// Folders within folders.
    #[error("{url}: the listings of the server lead more than {max} folders deep")]
    #[cause(Configuration: "give the address of the PEDR files, or a list of the files with --list")]
    TooDeep {
        /// Address of the folder.
        url: String,
        /// Limit.
        max: usize,
    },
    /// A link that may name a part of the archive.
    #[error(
        "{url}: the listing links to {found:?}; expected a file or a folder below this address"
    )]
    #[cause(Configuration: "give the address at which the server lists its own files, or a list of the files with --list")]
    Link {
        /// Address of the listing.
        url: String,
        /// The link.
        found: String,
    },
    /// A PEDR file that must be decompressed first.
    #[error("{url}: a compressed PEDR file; expected the file itself beside it")]
    #[cause(Input: "compressed files are not read on their server: fetch the files, decompress them, and index their \
                   folder, or name the other files with --list")]
    Compressed {
        /// Address.
        url: String,
    },
    /// Bytes that arrived are lost again.
    #[error("bytes that were received cannot be kept on this computer")]
    #[cause(Io: "free space on the disk of the folder")]
    Lost,
}

/// The option without which an index would not read the file.
const fn verify(is_noticed: bool) -> &'static str {
    if is_noticed { "" } else { " --verify" }
}

fn advice_on(status: u16) -> &'static str {
    match status {
        401 | 403 => "the server does not permit access; open the address in a browser",
        404 | 410 => {
            "correct the address (of an existing index: in areograph-archive.toml), or run `areograph pedr index URL` \
             again if the archive has changed"
        }
        _ => "run again later: bytes that have arrived are kept",
    }
}

/// A failure of a transfer, with the advice for an archive that is read on its server.
pub(super) fn advised(failure: Error) -> Error {
    let cause: &dyn std::error::Error = &*failure.cause;
    let cause = match cause.downcast_ref() {
        Some(FetchError::Status { url, status }) => RemoteError::Status {
            url: url.clone(),
            status: *status,
        },
        Some(FetchError::Network {
            url,
            problem,
            attempts,
        }) => RemoteError::Unreachable {
            url: url.clone(),
            problem: problem.clone(),
            attempts: *attempts,
        },
        Some(FetchError::Content { url, problem }) => RemoteError::Encoded {
            url: url.clone(),
            problem: problem.clone(),
        },
        Some(FetchError::Redirect { url, to, why }) => RemoteError::Redirect {
            url: url.clone(),
            to: to.clone(),
            why,
        },
        _ => return failure,
    };
    Error {
        cause: Box::new(cause),
        ..failure
    }
}
