//! What can go wrong with kernels and with CSPICE.

use areograph_base::{
    error::{Cause, Kind},
    time::{Et, Interval},
};

/// An error of kernels, of what they hold, or of a CSPICE call.
#[derive(Debug, thiserror::Error)]
pub enum SpiceError {
    /// CSPICE signalled an error.
    #[error("{call}: {short}: {long}")]
    Spice {
        /// The routine that was called, and with what where NAIF's text does not say it.
        call: String,
        /// NAIF's short message, for example `SPICE(SPKINSUFFDATA)`.
        short: String,
        /// NAIF's long message.
        long: String,
    },
    /// A session is open on this thread already; waiting for it would never end.
    #[error("a SPICE session is already open on this thread")]
    SessionOpen,
    /// The file is something else than a kernel that can be loaded.
    #[error("is {found}; expected {expected}")]
    NotAKernel {
        /// What it is.
        found: String,
        /// What was expected in its place.
        expected: &'static str,
    },
    /// A binary kernel is shorter than its own file record says, or its segment list is broken.
    #[error("damaged binary kernel: {problem}")]
    DamagedKernel {
        /// What is wrong, with numbers.
        problem: String,
    },
    /// A text does not follow the rules of NAIF text kernels.
    #[error("line {line}: {problem}")]
    TextKernel {
        /// Line, counted from 1.
        line: usize,
        /// What is wrong with it.
        problem: String,
    },
    /// A metakernel names a file that is not there.
    #[error("names {name}, which does not exist{candidates}")]
    MissingKernel {
        /// Name after the path symbols were replaced.
        name: String,
        /// Similar names, if any, as the end of the sentence.
        candidates: String,
    },
    /// A folder of kernels lacks something that is needed.
    #[error("no kernel in this folder {what}")]
    NothingToSelect {
        /// What is missing, for example `defines the MGS clock (SCLK_DATA_TYPE_94)`.
        what: String,
    },
    /// A set of kernels lacks a text kernel that a call needs.
    #[error("no {kernel} in the set{}", without(set, variable))]
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
    /// A kernel is not what it was when it was chosen.
    #[error("kernel changed while it was in use: BLAKE3 was {was}, is {is}")]
    KernelChanged {
        /// Hash when it was chosen.
        was: String,
        /// Hash now.
        is: String,
    },
    /// A text is too long for CSPICE, or cannot be handed to it.
    #[error("{what} cannot be given to CSPICE: {problem}")]
    Unusable {
        /// What it is: a path, a clock string, ...
        what: &'static str,
        /// Why not.
        problem: String,
    },
    /// Kernels do not hold what was asked.
    #[error("no {what} of {of} for {gap} ({gap_utc}), required for {required}; {neighbours}")]
    CoverageGap {
        /// `position` or `attitude`.
        what: &'static str,
        /// The spacecraft.
        of: String,
        /// The part that is missing.
        gap: Interval,
        /// The same in UTC.
        gap_utc: String,
        /// What was asked for.
        required: Interval,
        /// Which kernels end or begin there.
        neighbours: String,
    },
    /// No attitude sample near enough.
    #[error("no attitude of {of} within {tolerance_s} s of {kernel_time} (time of the C-kernel)")]
    NoAttitude {
        /// The spacecraft.
        of: String,
        /// Instant as the C-kernel counts time.
        kernel_time: Et,
        /// How far it was allowed to look.
        tolerance_s: f64,
    },
    /// A kernel holds NaN or an infinity.
    #[error("{what} at {instant} (UTC {utc}) is not finite{part}")]
    NotFinite {
        /// Whose position, velocity or attitude.
        what: String,
        /// When, as the kernel counts time.
        instant: Et,
        /// The same in UTC.
        utc: String,
        /// Which part of the kernel holds it, as the end of the sentence.
        part: String,
    },
    /// The kernels' motion cannot be tabulated this well.
    #[error(
        "trajectory near {near}: {error_m} m off with pieces of {piece_s} s; required {tolerance_m} m"
    )]
    NoConvergence {
        /// Where.
        near: Et,
        /// Largest distance from CSPICE in the piece, metres.
        error_m: f64,
        /// Length of the piece, seconds.
        piece_s: f64,
        /// Distance that was asked for, metres.
        tolerance_m: f64,
    },
    /// Columns for a kernel writer do not fit together.
    #[error("segment {segment}: {problem}")]
    Segment {
        /// Name of the segment.
        segment: String,
        /// What does not fit.
        problem: String,
    },
}

/// Names of a set that a message repeats.
const NAMES_MAX: usize = 12;

/// That none of a set of kernels defines `variable`, as the end of a sentence.
fn without(names: &[String], variable: &str) -> String {
    let more = match names.len() {
        0 => return ", which is empty".to_owned(),
        count if count <= NAMES_MAX => String::new(),
        count => format!(" and {} more", count - NAMES_MAX),
    };
    let first = names[..names.len().min(NAMES_MAX)].join(", ");
    format!(": none of {first}{more} defines {variable}")
}

/// CSPICE's short messages that mean "the kernels do not reach there".
const COVERAGE_MESSAGES: [&str; 3] = [
    "SPICE(SPKINSUFFDATA)",
    "SPICE(NOFRAMECONNECT)",
    "SPICE(CKINSUFFDATA)",
];

impl SpiceError {
    /// The same error of CSPICE, known to come from `value`.
    pub(super) fn of(mut self, value: &str) -> Self {
        if let Self::Spice { call, .. } = &mut self {
            *call = format!("{call}(\"{value}\")");
        }
        self
    }
}

impl Cause for SpiceError {
    fn kind(&self) -> Kind {
        match self {
            Self::Spice { short, .. } if COVERAGE_MESSAGES.contains(&short.as_str()) => {
                Kind::Coverage
            }
            Self::MissingText { .. }
            | Self::CoverageGap { .. }
            | Self::NoAttitude { .. }
            | Self::NoConvergence { .. } => Kind::Coverage,
            Self::SessionOpen | Self::Segment { .. } => Kind::Bug,
            _ => Kind::Input,
        }
    }

    fn advice(&self) -> String {
        match self {
            Self::Spice { .. } if self.kind() == Kind::Coverage => {
                "add kernels that cover this time; `areograph kernels coverage` shows the coverage"
            }
            Self::Spice { .. } => "check the value and the kernels that NAIF's message names",
            Self::MissingText { example, .. } => {
                return format!("add such a kernel to the set, for example {example}");
            }
            Self::SessionOpen => "report this: a stage opened a second session",
            Self::NotAKernel { .. } => {
                "fetch the kernel again from NAIF, or correct the list of kernels"
            }
            Self::DamagedKernel { .. } => "fetch the kernel again: the copy is incomplete or broken",
            Self::TextKernel { .. } => "correct this line of the text kernel",
            Self::MissingKernel { .. } => {
                "correct KERNELS_TO_LOAD or PATH_VALUES; relative paths count from the metakernel's folder"
            }
            Self::NothingToSelect { .. } => {
                "put the missing kernel under kernels.root, or name the kernels one by one"
            }
            Self::KernelChanged { .. } => "run again when no program is writing to the kernel folder",
            Self::Unusable { .. } => "use shorter paths without control characters, for example by a link",
            Self::CoverageGap { .. } | Self::NoAttitude { .. } => {
                "add kernels that fill the gap, or leave out the image or profile that needs it"
            }
            Self::NotFinite { .. } => {
                "fetch the kernel again, or leave it out of the list: this part of it holds NaN or infinity"
            }
            Self::NoConvergence { .. } => {
                "check the SPK for jumps there, or allow a larger tolerance"
            }
            Self::Segment { .. } => "report this: a kernel writer was given columns that do not fit",
        }
        .to_owned()
    }
}
