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
            /// Constant and linear terms in time.
            Velocity,
            /// Constant, linear and quadratic terms in time.
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
    /// Position unknowns of an image: each level adds a power of time (`spsolve` in jigsaw).
    PositionUnknowns,
    /// A constant.
    Position "position"
}

levels! {
    /// Rotation unknowns of an image: each level adds a power of time (`camsolve` in jigsaw).
    RotationUnknowns,
    /// Constant angles.
    Angles "angles"
}
