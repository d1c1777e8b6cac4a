//! Errors of kernels and of CSPICE.

use areograph_base::{
    constants::{SPEED_OF_LIGHT_M_S, SUN_DISTANCE_M},
    error::{Cause, Kind},
    time::{Et, Interval},
};

/// Least and largest time that light takes from the Sun to Mars, seconds.
pub(super) const SUN_LIGHT_S: [f64; 2] = [
    SUN_DISTANCE_M[0] / SPEED_OF_LIGHT_M_S,
    SUN_DISTANCE_M[1] / SPEED_OF_LIGHT_M_S,
];

/// An error of kernels, of their content, or of a CSPICE call.
#[derive(Debug, thiserror::Error, Cause)]
#[cause(Input)]
pub enum SpiceError {
    /// CSPICE signalled an error.
    #[error("{call}: {short}: {long}")]
    #[cause(kind_of(short): "{}", advice_on(short))]
    Spice {
        /// The routine called, and its argument where NAIF's text does not state it.
        call: String,
        /// NAIF's short message, for example `SPICE(SPKINSUFFDATA)`.
        short: String,
        /// NAIF's long message.
        long: String,
    },
    /// A session is open on this thread already; waiting for it would never end.
    #[error("a SPICE session is already open on this thread")]
    #[cause(Bug: "report this: a stage opened a second session")]
    SessionOpen,
    /// CSPICE returned a date in a form other than the documented one.
    #[error("CSPICE returned the UTC {0}; expected ISO 8601")]
    #[cause(Bug: "report this with the versions of CSPICE and areograph")]
    NotIso(String),
    /// The file is not a kernel that can be loaded.
    #[error("is {found}; expected {expected}")]
    #[cause("{}", if found.starts_with("a folder") {
        "name a metakernel, or kernels one by one"
    } else {
        "fetch the kernel again from NAIF, or correct the list of kernels"
    })]
    NotAKernel {
        /// The kind of the file.
        found: String,
        /// The expected kind.
        expected: &'static str,
    },
    /// A binary kernel is shorter than its own file record states, or its segment list is broken.
    #[error("damaged binary kernel: {problem}")]
    #[cause("fetch the kernel again: the copy is incomplete or damaged")]
    DamagedKernel {
        /// The problem, with numbers.
        problem: String,
    },
    /// A text does not follow the rules of NAIF text kernels.
    #[error("line {line}: {problem}")]
    #[cause("correct this line of the text kernel")]
    TextKernel {
        /// Line, counted from 1.
        line: usize,
        /// The problem.
        problem: String,
    },
    /// A metakernel names a file that does not exist.
    #[error("names {name}, which does not exist{candidates}")]
    #[cause(
        "correct KERNELS_TO_LOAD or PATH_VALUES; relative paths are relative to the metakernel's folder"
    )]
    MissingKernel {
        /// Name with the path symbols replaced.
        name: String,
        /// Similar names, if any, as the end of the sentence.
        candidates: String,
    },
    /// A folder of kernels lacks a required one.
    #[error("no kernel in this folder {what}")]
    #[cause("put the missing kernel under kernels.root, or name the kernels individually")]
    NothingToSelect {
        /// The missing text, for example `defines the MGS clock (SCLK_DATA_TYPE_94)`.
        what: String,
    },
    /// A set of kernels lacks a text kernel that a call needs.
    #[error("no {kernel} in the set{}", without(set, variable))]
    #[cause(Coverage: "add such a kernel to the set, for example {example}")]
    MissingText {
        /// The kernel that usually holds it.
        kernel: String,
        /// The variable that is not defined.
        variable: String,
        /// A file of the archive that holds it.
        example: String,
        /// Names of the kernels of the set.
        set: Vec<String>,
    },
    /// A text is too long for CSPICE, or cannot be passed to it.
    #[error("{what} cannot be passed to CSPICE: {problem}")]
    #[cause("use shorter paths without control characters, for example through a symbolic link")]
    Unusable {
        /// The kind of text: a path, a clock string, ...
        what: &'static str,
        /// The reason.
        problem: String,
    },
    /// Kernels do not cover the required interval.
    #[error("no {what} of {of} for {gap} ({gap_utc}), required for {required}; {neighbours}")]
    #[cause(Coverage: "add kernels that fill the gap, or omit the image or profile concerned")]
    CoverageGap {
        /// `position` or `attitude`.
        what: &'static str,
        /// The spacecraft.
        of: String,
        /// The gap.
        gap: Interval,
        /// The gap in UTC.
        gap_utc: String,
        /// The required interval.
        required: Interval,
        /// Kernels that end or begin there.
        neighbours: String,
    },
    /// Kernels hold the spacecraft, but not the Sun as Mars sees it.
    #[error(
        "no position of the Sun as seen from Mars at {seen} (UTC {utc}); expected kernels that contain Mars at this \
         time, and the Sun {:.0} to {:.0} s earlier, when the light left the Sun",
        SUN_LIGHT_S[0], SUN_LIGHT_S[1]
    )]
    #[cause(
        Coverage: "add an ephemeris of the Sun and Mars that begins at least 14 minutes before the image, for example \
         a planetary ephemeris (de*.bsp)"
    )]
    NoSun {
        /// Instant at which its light arrives at Mars.
        seen: Et,
        /// This instant in UTC.
        utc: String,
    },
    /// No attitude sample within the tolerance.
    #[error("no attitude of {of} within {tolerance_s} s of {kernel_time} (C-kernel time)")]
    #[cause(like = CoverageGap)]
    NoAttitude {
        /// The spacecraft.
        of: String,
        /// Instant in the time of the C-kernel.
        kernel_time: Et,
        /// Tolerance of the search.
        tolerance_s: f64,
    },
    /// A kernel holds NaN or an infinity.
    #[error("{what} at {instant} (UTC {utc}) is not finite{part}")]
    #[cause(
        "fetch the kernel again, or omit it from the list: this interval contains NaN or infinity"
    )]
    NotFinite {
        /// The position, velocity or attitude concerned.
        what: String,
        /// The instant, in the time of the kernel.
        instant: Et,
        /// This instant in UTC.
        utc: String,
        /// The part of the kernel that holds it, as the end of the sentence.
        part: String,
    },
    /// UTC of the kernels is not the published one.
    #[error(
        "the start of {day} UTC is {off_s:+.3} s away from the published time scale (IERS, Bulletin C); expected at most \
         0.001 s"
    )]
    #[cause(
        "fetch the current leap-second kernel from NAIF (naif0012.tls): the kernel in use lacks a leap second or was changed"
    )]
    OtherUtc {
        /// The first day that shows it.
        day: String,
        /// Instant according to the kernels minus the published one, seconds.
        off_s: f64,
    },
    /// The kernels' motion cannot be tabulated to the tolerance.
    #[error(
        "trajectory near {near}: positions and velocities in the kernels disagree by {error_m:.3} m within {piece_s} s; \
         expected at most {tolerance_m} m"
    )]
    #[cause(Coverage: "check the SPK for jumps at this time, and check that its positions are in kilometres and its \
     velocities in km/s")]
    NoConvergence {
        /// The instant.
        near: Et,
        /// Largest distance from CSPICE in the piece, metres.
        error_m: f64,
        /// Length of the piece, seconds.
        piece_s: f64,
        /// Required tolerance, metres.
        tolerance_m: f64,
    },
    /// Columns for a kernel writer do not fit together.
    #[error("segment {segment}: {problem}")]
    #[cause(Bug: "report this: a kernel writer received columns that do not match")]
    Segment {
        /// Name of the segment.
        segment: String,
        /// The mismatch.
        problem: String,
    },
}

/// Maximum number of kernel names in a message.
const NAMES_MAX: usize = 12;

/// States that no kernel of a set defines `variable`, as the end of a sentence.
fn without(names: &[String], variable: &str) -> String {
    let more = match names.len() {
        0 => return ", which is empty".to_owned(),
        count if count <= NAMES_MAX => String::new(),
        count => format!(" and {} more", count - NAMES_MAX),
    };
    let first = names[..names.len().min(NAMES_MAX)].join(", ");
    format!(": none of {first}{more} defines {variable}")
}

/// CSPICE's short messages for insufficient coverage.
const COVERAGE_MESSAGES: [&str; 3] = [
    "SPICE(SPKINSUFFDATA)",
    "SPICE(NOFRAMECONNECT)",
    "SPICE(CKINSUFFDATA)",
];

/// The kind of an error of CSPICE, by its short message.
fn kind_of(short: &str) -> Kind {
    if COVERAGE_MESSAGES.contains(&short) {
        Kind::Coverage
    } else {
        Kind::Input
    }
}

/// The advice on an error of CSPICE, by its short message.
fn advice_on(short: &str) -> &'static str {
    if kind_of(short) == Kind::Coverage {
        "add kernels that cover this time; `areograph kernels coverage` shows the coverage"
    } else {
        "check the value and the kernels that NAIF's message names"
    }
}

impl SpiceError {
    /// Whether CSPICE lacks coverage.
    pub(super) fn is_coverage(&self) -> bool {
        matches!(self, Self::Spice { short, .. } if kind_of(short) == Kind::Coverage)
    }

    /// The error of CSPICE, with the `value` that caused it.
    pub(super) fn of(mut self, value: &str) -> Self {
        if let Self::Spice { call, .. } = &mut self {
            *call = format!("{call}(\"{value}\")");
        }
        self
    }
}
