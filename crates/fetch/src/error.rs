//! Errors of indexes and transfers.

use areograph_base::error::Cause;

/// Reasons why a file was not planned or not fetched.
#[derive(Debug, thiserror::Error, Cause)]
pub enum FetchError {
    /// A row or a label of an index is malformed.
    #[error("line {line}: {problem}")]
    #[cause(Input: "fetch the index again by `areograph fetch --index`, or correct the file")]
    Index {
        /// Line, counted from 1.
        line: usize,
        /// The problem, with what was expected.
        problem: String,
    },
    /// An index is not in the folder.
    #[error("no copy of {name} is in this folder; expected the index of the archive ({url})")]
    #[cause(Input: "run `areograph fetch --index` with the same options where the archive can be reached")]
    NoIndex {
        /// Name of the index.
        name: String,
        /// Its address.
        url: String,
    },
    /// The table of archives is invalid.
    #[error("{0}")]
    #[cause(Configuration: "correct the table of archives; config/archives has the form")]
    Archives(String),
    /// Nothing is wanted.
    #[error("nothing to fetch: no site file, box, dates, orbits or images")]
    #[cause(Configuration: "name a site file, or give --dates, --orbits, --image or --box")]
    Nothing,
    /// The archive refuses or does not have a file.
    #[error("{url}: HTTP status {status}")]
    #[cause(Io: "{}", advice_on(*status))]
    Status {
        /// Address.
        url: String,
        /// Status of the answer.
        status: u16,
    },
    /// The archive cannot be reached, or fails again and again.
    #[error("{url}: {problem}; attempts: {attempts}")]
    #[cause(Io: "run again later: transferred files are kept; `areograph fetch --plan` lists the missing ones")]
    Network {
        /// Address.
        url: String,
        /// The last problem.
        problem: String,
        /// Number of attempts without progress.
        attempts: u32,
    },
    /// A redirection that is not followed.
    #[error("{url} leads to {to}, which is not followed: {why}")]
    #[cause(Io: "if the archive has moved, give its new address in a table (--archives)")]
    Redirect {
        /// Address.
        url: String,
        /// Its target.
        to: String,
        /// The rule.
        why: &'static str,
    },
    /// An address that is not fetched from.
    #[error("{url} is not fetched from; expected https://, file://, or http:// of this computer")]
    #[cause(Configuration: "correct the address in the table of archives")]
    Address {
        /// Address.
        url: String,
    },
    /// The received data are not the file.
    #[error("{url}: {problem}")]
    #[cause(Input: "run `areograph fetch --index` first: the index may be older than the file; else report it to the archive")]
    Content {
        /// Address.
        url: String,
        /// The difference.
        problem: String,
    },
    /// A service refuses a query, or its answer is another one than expected.
    #[error("{url}: the service made no table: {reason}")]
    #[cause(Io: "open the address in a browser; reduce the window where it is too large, or run again later")]
    Service {
        /// The query.
        url: String,
        /// The reason that the service states.
        reason: String,
    },
    /// A service makes a table later.
    #[error(
        "{url}: the service makes the table later, as job {job}; expected the table in its answer"
    )]
    #[cause(Io: "divide the window into smaller ones, or look up the job ({url} with jobid={job} in place of the query) and put its \
                 *_pts_csv.csv into place yourself")]
    Deferred {
        /// The query.
        url: String,
        /// The job of the service.
        job: String,
    },
    /// A box without shots.
    #[error("{url}: the service has no shot in this box")]
    #[cause(Coverage: "correct or enlarge the window: longitudes are east, latitudes areocentric")]
    NoShots {
        /// The query.
        url: String,
    },
    /// A service made another table than was asked for.
    #[error("{url}: this is not the table of the query: {problem}")]
    #[cause(Input: "run again: the service makes the table anew; else open the query of `areograph fetch --plan` in a browser")]
    Table {
        /// Address of the table at the service.
        url: String,
        /// The difference.
        problem: String,
    },
    /// Another file has the name.
    #[error("exists with different content: {problem}")]
    #[cause(Input: "move the file away, or give --replace")]
    Conflict {
        /// The difference.
        problem: String,
    },
    /// Files of a plan are not complete.
    #[error("{failed} of {planned} files are not complete")]
    #[cause(Io: "see the messages above; run again: transferred files are kept")]
    Incomplete {
        /// Files that failed.
        failed: usize,
        /// Files of the plan.
        planned: usize,
    },
    /// Something is needed that no archive has.
    #[error("all planned files are complete, but no index lists the remaining ones: {lacks}")]
    #[cause(Coverage: "see the lines `in_no_index` above; other archives may have it (--archives)")]
    Lacks {
        /// Number of missing items.
        lacks: usize,
    },
    /// Recorded files have changed or are missing.
    #[error("{damaged} of {files} recorded files are not as they were fetched")]
    #[cause(Input: "fetch them again: move damaged files away, or give --replace")]
    Damaged {
        /// Files that differ.
        damaged: usize,
        /// Recorded files.
        files: usize,
    },
    /// Another process fills the folder.
    #[error("another areograph fetch is filling this folder")]
    #[cause(Io: "wait for it, or give this one another --into")]
    Busy,
    /// A stored state is malformed.
    #[error("is not a state of areograph fetch: {0}")]
    #[cause(Input: "move the file away: the next fetch examines all files anew")]
    State(String),
}

fn advice_on(status: u16) -> &'static str {
    match status {
        401 | 403 => "the archive does not permit this; look at the address in a browser",
        404 | 410 => {
            "run `areograph fetch --index`: the index may be older than the archive; else correct the address in the table of \
             archives"
        }
        _ => "run again later: transferred files are kept",
    }
}
