//! Levels of the unknowns of an orientation, in jigsaw's words.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Declares the levels of a quantity; `$constant`, in the configuration `$word`, is what jigsaw calls a constant of it.
macro_rules! levels {
    ($(#[$about:meta])* $name:ident, $(#[$constant_about:meta])* $constant:ident $word:literal) => {
        $(#[$about])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
        #[serde(rename_all = "snake_case")]
        pub enum $name {
            /// Nothing.
            None,
            $(#[$constant_about])*
            $constant,
            /// And a linear term in time.
            Velocity,
            /// And a quadratic term.
            Acceleration,
        }

        impl $name {
            /// Every level, with its word in the configuration.
            pub(super) const WORDS: [(&'static str, Self); 4] = [
                ("none", Self::None),
                ($word, Self::$constant),
                ("velocity", Self::Velocity),
                ("acceleration", Self::Acceleration),
            ];

            /// Powers of time that are unknown.
            #[must_use]
            pub const fn powers(self) -> usize {
                self as usize
            }
        }
    };
}

levels! {
    /// Unknowns of the position of an image: each level adds a power of time (jigsaw's `spsolve`).
    PositionUnknowns,
    /// A constant.
    Position "position"
}

levels! {
    /// Unknowns of the rotation of an image, likewise (jigsaw's `camsolve`).
    RotationUnknowns,
    /// Constant angles.
    Angles "angles"
}
