//! A stage: a name, all its inputs, and a function of them.
//!
//! [`stage_inputs!`](crate::stage_inputs) declares the struct of the inputs of a stage. Its fields are its
//! fingerprint: a value that is not a field cannot be used, and a field cannot be forgotten.
//!
//! A rerun names the field that changed. A stage sees the kernels as a `KernelView`: kernels outside its fingerprint
//! are not loaded. A stage calls no other stage, writes nothing to the terminal and does not know the files of another
//! stage; long stages count their steps (`base/watch`).
//!
//! Outputs enter fingerprints by content: an early stage that gives the same bytes again ends the chain of reruns. A
//! change of the computation raises the `METHOD` of the stage. `docs/methods.csv` holds the output of every stage for
//! fixed scenes with its number, and `tests/products/methods.rs` fails on another output under the same number. The
//! numbers of the functions of other stages that a caller lists in `CALLS` are among its inputs. Products repeat the
//! fingerprint of every stage, so they are recomputed when any of them changes.

mod inputs;
mod output;
mod reason;

use std::sync::atomic::AtomicBool;

use serde::{Deserialize, Serialize, de::DeserializeOwned};

pub use inputs::{InOrder, Input, Inputs};
pub use output::{Output, Provenance};
pub use reason::Reason;

use areograph_base::{error::Result, watch::Watch};

/// Whether a stage works on the orientation from the kernels or on the adjusted one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Round {
    /// The orientation from the kernels.
    Initial,
    /// An adjustment by tie points that were matched with the orientation from the kernels, made to match them again.
    Matching,
    /// The adjusted orientation.
    Adjusted,
}

impl Round {
    /// Part of a stage that runs once per site in each round.
    #[must_use]
    pub fn part(self) -> Option<String> {
        self.name().map(str::to_owned)
    }

    /// Part of a stage that runs for `image` in each round.
    #[must_use]
    pub fn part_of(self, image: &str) -> Option<String> {
        Some(match self.name() {
            None => image.to_owned(),
            Some(round) => format!("{image}/{round}"),
        })
    }

    /// Mark of a stage that makes the orientation of this round: the last adjustment of a site is the adjustment.
    #[must_use]
    pub const fn of_adjustment(self) -> Self {
        match self {
            Self::Matching => Self::Matching,
            Self::Initial | Self::Adjusted => Self::Initial,
        }
    }

    const fn name(self) -> Option<&'static str> {
        match self {
            Self::Initial => None,
            Self::Matching => Some("matching"),
            Self::Adjusted => Some("adjusted"),
        }
    }
}

/// The outputs differ by the round, and enter under their labels.
impl Input for Round {
    fn add_to(&self, _field: &str, _inputs: &mut Inputs) {}
}

/// A stage whose functions another one calls, by its name and the number of its method; see [`called`].
pub type Called = (&'static str, u32);

/// Entry of [`Stage::CALLS`] for a stage whose functions are called.
#[must_use]
pub const fn called<S: Stage>() -> Called {
    (S::NAME, S::METHOD)
}

/// A step of the flow: a function of its fields only.
pub trait Stage {
    /// Name in logs, messages, the manifest and the command line.
    const NAME: &'static str;
    /// Raised when the stage computes a different output from the same inputs, or the layout of its output changes;
    /// `docs/methods.csv` contains its output, and `tests/products/methods.rs` fails if this is forgotten.
    const METHOD: u32 = 1;
    /// Stages whose functions it calls: their methods are inputs of it.
    const CALLS: &'static [Called] = &[];
    /// Whether `check` runs the stage; for other stages it only examines the inputs, by [`Stage::examine`].
    const CHECKED: bool = false;
    /// Its output; stored, and passed to later stages.
    type Output: Serialize + DeserializeOwned;

    /// All inputs of the stage by name; made by [`stage_inputs!`](crate::stage_inputs).
    fn inputs(&self) -> Inputs;

    /// The part for which a stage runs if it runs several times in a site: an image, or the second round.
    fn part(&self) -> Option<String> {
        None
    }

    /// Computes the output. `stop` is checked inside long loops.
    ///
    /// # Errors
    /// Errors of the stage; [`Stopped`](areograph_base::error::Stopped).
    fn run(&self, stop: &AtomicBool) -> Result<Self::Output>;

    /// Computes the output and counts the steps of long loops; identical for a stage that counts none.
    ///
    /// # Errors
    /// As [`Stage::run`].
    fn run_watched(&self, watch: Watch<'_>) -> Result<Self::Output> {
        self.run(watch.stop())
    }

    /// Findings of `check` in the inputs without running the stage: all findings and all failures.
    fn examine(&self) -> Vec<Result<String>> {
        Vec::new()
    }

    /// Findings of `check` in the output.
    fn findings(&self, _output: &Self::Output) -> Vec<String> {
        Vec::new()
    }

    /// Name of the stage followed by its part, for example `register/E02-00665`.
    fn label(&self) -> String {
        self.part().map_or_else(
            || Self::NAME.to_owned(),
            |part| format!("{}/{part}", Self::NAME),
        )
    }
}

/// Declares the inputs of a stage. The fields are its fingerprint, each by its [`Input`].
///
/// ```
/// use areograph_store::{stage::{Output, Stage}, stage_inputs};
///
/// stage_inputs! {
///     /// Multiplies what was counted.
///     pub struct Multiply<'a> {
///         /// What was counted.
///         pub counted: &'a Output<u32>,
///         /// Factor of the configuration.
///         pub factor: &'a u32,
///     }
/// }
///
/// impl Stage for Multiply<'_> {
///     const NAME: &'static str = "multiply";
///     type Output = u32;
///     areograph_store::stage_inputs!(fingerprint);
///
///     fn run(&self, _stop: &std::sync::atomic::AtomicBool) -> areograph_base::error::Result<u32> {
///         Ok(self.counted.value()? * *self.factor)
///     }
/// }
/// ```
#[macro_export]
macro_rules! stage_inputs {
    (
        $(#[$doc:meta])*
        pub struct $name:ident<$life:lifetime> {
            $($(#[$field_doc:meta])* pub $field:ident: $kind:ty,)*
        }
    ) => {
        $(#[$doc])*
        #[derive(Debug)]
        pub struct $name<$life> { $($(#[$field_doc])* pub $field: $kind,)* }

        impl $name<'_> {
            fn fingerprint(&self, inputs: &mut $crate::stage::Inputs) {
                $($crate::stage::Input::add_to(&self.$field, stringify!($field), inputs);)*
            }
        }
    };
    (fingerprint) => {
        fn inputs(&self) -> $crate::stage::Inputs {
            let mut inputs = $crate::stage::Inputs::new(Self::METHOD);
            inputs.calls(Self::CALLS);
            self.fingerprint(&mut inputs);
            inputs
        }
    };
}
