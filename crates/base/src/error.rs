//! Failures and their places: one wrapper adds the place, the enum of each room the cause.
//!
//! A cause is a [`Cause`]: it has a [`Kind`] (hence the exit code) and an advice.
//! [`Error`] carries it upwards and collects site, stage and file on the way.

use std::{
    borrow::Cow,
    fmt,
    path::PathBuf,
    sync::atomic::{AtomicBool, Ordering},
};

/// Kind and advice of a failure, beside its message.
///
/// ```
/// use areograph_base::error::{Cause, Kind};
///
/// #[derive(Debug, thiserror::Error, Cause)]
/// #[cause(Input)]
/// enum TableError {
///     #[error("no row")]
///     #[cause("give a table with at least one row")]
///     Empty,
///     #[error("line {line} is truncated")]
///     #[cause(like = Empty)]
///     Truncated { line: usize },
///     #[error("no column {0}")]
///     #[cause(Configuration: "name a column of the table instead of {0}")]
///     Column(String),
///     #[error("the table is of {body}")]
///     #[cause("set body to {word}", word = body.to_lowercase())]
///     Body { body: String },
/// }
///
/// assert_eq!(TableError::Empty.kind(), Kind::Input);
/// let truncated = TableError::Truncated { line: 3 };
/// assert_eq!(truncated.advice(), "give a table with at least one row");
/// let column = TableError::Column("height".to_owned());
/// assert_eq!(column.kind(), Kind::Configuration);
/// assert_eq!(column.advice(), "name a column of the table instead of height");
/// let body = TableError::Body { body: "Mars".to_owned() };
/// assert_eq!(body.advice(), "set body to mars");
/// ```
///
/// A variant without kind or advice does not compile:
///
/// ```compile_fail
/// # use areograph_base::error::Cause;
/// #[derive(Debug, thiserror::Error, Cause)]
/// #[error("no row")]
/// #[cause(Input)] // no advice
/// struct Empty;
/// ```
pub use areograph_derive::Cause;

/// Kinds of failure; each is an exit code of the program.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum Kind {
    /// A bug in areograph.
    Bug = 1,
    /// Command line or configuration.
    Configuration = 2,
    /// Invalid content of labels, PEDR files or kernels.
    Input = 3,
    /// Kernels do not cover the requested times.
    Coverage = 4,
    /// The products exist but are marked invalid.
    Validation = 5,
    /// The operating system refused to read or write.
    Io = 6,
    /// The user stopped the program (128 + SIGINT, as shells count).
    Interrupted = 130,
}

impl Kind {
    /// The exit code of the process.
    #[must_use]
    pub const fn exit_code(self) -> u8 {
        self as u8
    }
}

/// A cause of failure, with its kind and advice; derived, with `#[cause(Kind: "advice")]` below thiserror's `#[error]`.
pub trait Cause: std::error::Error + Send + Sync + 'static {
    /// The kind of this failure.
    fn kind(&self) -> Kind;
    /// The advice to the user, one sentence.
    fn advice(&self) -> String;

    /// The advice for a failure that concerns an entry of a configuration.
    fn advice_on_configured(&self) -> String {
        self.advice()
    }
}

/// A cause together with the place where it happened.
#[derive(Debug)]
pub struct Error {
    /// Site, once the flow knows it.
    pub site: Option<String>,
    /// Stage of the flow, for a stage of one image followed by `/` and the image.
    pub stage: Option<String>,
    /// File that was read or written.
    pub file: Option<PathBuf>,
    /// The cause.
    pub cause: Box<dyn Cause>,
}

impl Error {
    /// A failure whose place is not known yet.
    pub fn new(error: impl Cause) -> Self {
        Self {
            site: None,
            stage: None,
            file: None,
            cause: Box::new(error),
        }
    }

    /// The failure, which concerns `file` (an inner file is kept).
    #[must_use]
    pub fn in_file(mut self, file: impl Into<PathBuf>) -> Self {
        self.file.get_or_insert_with(|| file.into());
        self
    }

    /// The failure, which comes from `stage`.
    #[must_use]
    pub fn in_stage(mut self, stage: &str) -> Self {
        self.stage.get_or_insert_with(|| stage.to_owned());
        self
    }

    /// The failure, which concerns `site`.
    #[must_use]
    pub fn in_site(mut self, site: &str) -> Self {
        self.site.get_or_insert_with(|| site.to_owned());
        self
    }

    /// The kind of the cause.
    #[must_use]
    pub fn kind(&self) -> Kind {
        self.cause.kind()
    }
}

impl<F: Cause> From<F> for Error {
    fn from(error: F) -> Self {
        Self::new(error)
    }
}

impl fmt::Display for Error {
    /// `site/stage: file: cause`, then a second line with the advice.
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (&self.site, &self.stage) {
            (Some(site), Some(stage)) => write!(formatter, "{site}/{stage}: ")?,
            (Some(site), None) => write!(formatter, "{site}: ")?,
            (None, Some(stage)) => write!(formatter, "{stage}: ")?,
            (None, None) => {}
        }
        if let Some(file) = &self.file {
            write!(formatter, "{}: ", printable(&file.to_string_lossy(), ""))?;
        }
        write!(formatter, "{}", self.cause)?;
        // The files of stages are named in a configuration.
        let advice = if self.stage.is_some() {
            self.cause.advice_on_configured()
        } else {
            self.cause.advice()
        };
        if !advice.is_empty() {
            write!(formatter, "\n  what to do: {advice}")?;
        }
        Ok(())
    }
}

/// Text with its control characters escaped, so that a terminal shows and does not obey them.
///
/// * `kept` – control characters that remain
#[must_use]
pub fn printable<'a>(text: &'a str, kept: &str) -> Cow<'a, str> {
    let is_escaped = |letter: char| letter.is_control() && !kept.contains(letter);
    if !text.contains(is_escaped) {
        return Cow::Borrowed(text);
    }
    let mut shown = String::with_capacity(text.len());
    for letter in text.chars() {
        if is_escaped(letter) {
            shown.extend(letter.escape_default());
        } else {
            shown.push(letter);
        }
    }
    Cow::Owned(shown)
}

/// Result of fallible functions above the lowest floor.
pub type Result<T> = std::result::Result<T, Error>;

/// Adds the place to a result on its way up.
pub trait Locate<T> {
    /// See [`Error::in_file`].
    ///
    /// # Errors
    /// The same failure, with its place.
    fn in_file(self, file: impl Into<PathBuf>) -> Result<T>;
    /// See [`Error::in_stage`].
    ///
    /// # Errors
    /// The same failure, with its place.
    fn in_stage(self, stage: &str) -> Result<T>;
    /// See [`Error::in_site`].
    ///
    /// # Errors
    /// The same failure, with its place.
    fn in_site(self, site: &str) -> Result<T>;
}

impl<T, E: Into<Error>> Locate<T> for std::result::Result<T, E> {
    fn in_file(self, file: impl Into<PathBuf>) -> Result<T> {
        self.map_err(|error| error.into().in_file(file))
    }

    fn in_stage(self, stage: &str) -> Result<T> {
        self.map_err(|error| error.into().in_stage(stage))
    }

    fn in_site(self, site: &str) -> Result<T> {
        self.map_err(|error| error.into().in_site(site))
    }
}

/// The operating system refused a file operation.
#[derive(Debug, thiserror::Error)]
#[error("cannot {action}: {source}")]
pub struct IoError {
    /// The attempted action, for example "read" or "rename into place".
    pub action: &'static str,
    /// The system's reason.
    pub source: std::io::Error,
}

impl IoError {
    /// For `map_err`: `File::open(path).map_err(IoError::on("open")).in_file(path)?`.
    pub fn on(action: &'static str) -> impl Fn(std::io::Error) -> Self {
        move |source| Self { action, source }
    }
}

/// First words of the actions of [`IoError`] that need an existing file or folder.
const READING: [&str; 5] = ["read", "open", "list", "look", "find"];

impl Cause for IoError {
    fn kind(&self) -> Kind {
        let verb = self.action.split(' ').next().unwrap_or_default();
        let is_read = READING.contains(&verb) && !self.action.contains("temporary");
        if is_read && self.source.kind() == std::io::ErrorKind::NotFound {
            // Like a wrong file: only new input helps.
            Kind::Input
        } else {
            Kind::Io
        }
    }

    fn advice(&self) -> String {
        use std::io::ErrorKind;
        match self.source.kind() {
            ErrorKind::NotFound => "check the path",
            ErrorKind::PermissionDenied => "check the permissions of the file and its folder",
            ErrorKind::StorageFull | ErrorKind::QuotaExceeded => {
                "free some space or choose another --out, then run again: finished stages are kept"
            }
            ErrorKind::IsADirectory | ErrorKind::NotADirectory => {
                "check the path: it names a file instead of a folder, or a folder instead of a file"
            }
            _ => "check the file and the disk, then run again",
        }
        .to_owned()
    }

    fn advice_on_configured(&self) -> String {
        let advice = self.advice();
        if self.source.kind() == std::io::ErrorKind::NotFound {
            return advice + "; relative paths in a configuration file are relative to its folder";
        }
        advice
    }
}

/// The user stopped the program, and the running stage was abandoned.
#[derive(Debug, thiserror::Error, Cause)]
#[error("interrupted")]
#[cause(Interrupted: "run again: finished stages are kept")]
pub struct Stopped;

impl Stopped {
    /// For long loops, before each part of their work.
    ///
    /// # Errors
    /// This error, once `stop` is set.
    pub fn check(stop: &AtomicBool) -> std::result::Result<(), Self> {
        if stop.load(Ordering::Relaxed) {
            Err(Self)
        } else {
            Ok(())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failure_names_its_whole_place_and_its_advice() {
        let error = IoError::on("read")(std::io::ErrorKind::NotFound.into());
        let failure = Error::from(error)
            .in_file("ap19019k.b")
            .in_stage("search_footprints")
            .in_site("gusev")
            .in_file("outer.toml");
        assert_eq!(
            failure.to_string(),
            "gusev/search_footprints: ap19019k.b: cannot read: entity not found\n  \
             what to do: check the path; relative paths in a configuration file are relative to its folder"
        );
        assert_eq!(failure.kind().exit_code(), 3);
    }

    #[test]
    fn a_path_cannot_command_the_terminal() {
        let error = IoError::on("read")(std::io::ErrorKind::NotFound.into());
        let failure = Error::from(error).in_file("a\u{1b}[31m\n\u{9b}b.toml");
        let shown = failure.to_string();
        assert!(
            shown.starts_with(r"a\u{1b}[31m\n\u{9b}b.toml: cannot read"),
            "{shown}"
        );
        assert_eq!(printable("a\tb\n\u{7}", "\t\n"), "a\tb\n\\u{7}");
    }
}
