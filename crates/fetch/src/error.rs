//! Errors of indexes and transfers.

use areograph_base::error::Cause;

/// Reasons why a file was not planned or not fetched.
#[derive(Debug, thiserror::Error, Cause)]
pub enum FetchError {
    /// A row or a label of an index is malformed.
    #[error("line {line}: {problem}")]
    #[cause(Input: "fetch the index again with `areograph fetch --index`, or correct the file")]
    Index {
        /// Line, counted from 1.
        line: usize,
        /// The problem, with what was expected.
        problem: String,
    },
    /// An index is not in the folder.
    #[error("this folder contains no copy of {name}; expected the index of the archive ({url})")]
    #[cause(Input: "run `areograph fetch --index` with the same options on a computer that can reach the archive")]
    NoIndex {
        /// Name of the index.
        name: String,
        /// Its address.
        url: String,
    },
    /// The table of archives is invalid.
    #[error("{0}")]
    #[cause(Configuration: "correct the table of archives; see config/archives for its format")]
    Archives(String),
    /// Nothing is wanted.
    #[error("nothing to fetch: no site file, box, dates, orbits or images given")]
    #[cause(Configuration: "name a site file, or give --dates, --orbits, --image or --box")]
    Nothing,
    /// The archive refuses or does not have a file.
    #[error("{url}: HTTP status {status}")]
    #[cause(Io: "{}", advice_on_object(url, *status).unwrap_or_else(|| advice_on(*status)))]
    Status {
        /// Address.
        url: String,
        /// Status of the answer.
        status: u16,
    },
    /// The archive cannot be reached, or fails again and again.
    #[error("{url}: {problem}; attempts: {attempts}")]
    #[cause(Io: "run again later: transferred files are kept; `areograph fetch --plan` lists the missing files")]
    Network {
        /// Address.
        url: String,
        /// The last problem.
        problem: String,
        /// Number of attempts without progress.
        attempts: u32,
    },
    /// A redirection that is not followed.
    #[error("{url} redirects to {to}; the redirection is not followed: {why}")]
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
    #[error(
        "{url} is not a permitted address; expected https://, s3://, file:///, or http:// on this computer"
    )]
    #[cause(Configuration: "correct the address in the table of archives")]
    Address {
        /// Address.
        url: String,
    },
    /// An object store that cannot be asked, or answers otherwise.
    #[error("{url}: {problem}")]
    #[cause(Configuration: "correct the address, or the variables of the environment that name the object store: AWS_ENDPOINT_URL_S3, \
                           AWS_REGION, AWS_ACCESS_KEY_ID, AWS_SECRET_ACCESS_KEY")]
    ObjectStore {
        /// Address.
        url: String,
        /// The problem, with what was expected.
        problem: String,
    },
    /// The received data are not the file.
    #[error("{url}: {problem}")]
    #[cause(Input: "run `areograph fetch --index` first: the index may be older than the file; otherwise report the \
                   problem to the archive")]
    Content {
        /// Address.
        url: String,
        /// The difference.
        problem: String,
    },
    /// A service refuses a query, or its answer is another one than expected.
    #[error("{url}: the service returned no table: {reason}")]
    #[cause(Io: "open the address in a browser; reduce the window if it is too large, or run again later")]
    Service {
        /// The query.
        url: String,
        /// The reason that the service states.
        reason: String,
    },
    /// A service makes a table later.
    #[error(
        "{url}: the service has deferred the table to job {job}; expected the table in the answer"
    )]
    #[cause(Io: "divide the window into smaller windows, or look \
                   up the job ({url} with jobid={job} in place of the query) and put its \
                 *_pts_csv.csv at the planned path yourself")]
    Deferred {
        /// The query.
        url: String,
        /// The job of the service.
        job: String,
    },
    /// A box without shots.
    #[error("{url}: the service has no shot in this box")]
    #[cause(Coverage: "correct or enlarge the window: longitudes are positive east, latitudes areocentric")]
    NoShots {
        /// The query.
        url: String,
    },
    /// A service made another table than was asked for.
    #[error("{url} does not match the query: {problem}")]
    #[cause(Input: "run again: the service then generates a new table; otherwise open the query in a browser (`areograph fetch --plan` \
                   lists it)")]
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
    #[cause(Io: "see the messages above, and run again: transferred files are kept")]
    Incomplete {
        /// Files that failed.
        failed: usize,
        /// Files of the plan.
        planned: usize,
    },
    /// Something is needed that no archive has.
    #[error("all planned files are complete; items that no index lists: {lacks}")]
    #[cause(Coverage: "see the `in_no_index` lines above; other archives may have the items (--archives)")]
    Lacks {
        /// Number of missing items.
        lacks: usize,
    },
    /// Recorded files have changed or are missing.
    #[error(
        "{damaged} of {files} recorded files have changed since they were fetched, or are missing"
    )]
    #[cause(Input: "fetch them again: move damaged files away, or give --replace")]
    Damaged {
        /// Files that differ.
        damaged: usize,
        /// Recorded files.
        files: usize,
    },
    /// Another process fills the folder.
    #[error("another areograph fetch is filling this folder")]
    #[cause(Io: "wait until it ends, or give a different folder with --into")]
    Busy,
    /// A stored state is malformed.
    #[error("is not a state file of areograph fetch: {0}")]
    #[cause(Input: "move the file away: the next fetch examines all files again")]
    State(String),
}

/// The advice on a status of an object store, where it differs from that on a server of files.
pub(crate) fn advice_on_object(url: &str, status: u16) -> Option<&'static str> {
    match status {
        _ if !url.starts_with("s3://") => None,
        301 => Some("the bucket is in another region: set AWS_REGION"),
        307 => Some("the bucket is new: run again later, or set AWS_REGION"),
        400 | 401 | 403 => Some(
            "check AWS_ACCESS_KEY_ID, AWS_SECRET_ACCESS_KEY and AWS_REGION, the rights of the key, and the clock of this computer; \
             public buckets are read without a key, and some stores answer so if the object does not exist",
        ),
        404 => Some("no object has this key or prefix: correct the address"),
        _ => None,
    }
}

fn advice_on(status: u16) -> &'static str {
    match status {
        401 | 403 => "the archive does not permit access; open the address in a browser",
        404 | 410 => {
            "run `areograph fetch --index`: the index may be older than the archive; otherwise correct the address in the \
             table of archives"
        }
        _ => "run again later: transferred files are kept",
    }
}
