//! Levels of the unknowns of an orientation, in jigsaw's words.

use schemars::JsonSchema;
use serde::Serialize;

/// What of an image's position is unknown: each level adds a power of time (jigsaw's `spsolve`).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PositionUnknowns {
    /// Nothing.
    None,
    /// A constant.
    Position,
    /// And what is linear in time.
    Velocity,
    /// And what is quadratic.
    Acceleration,
}

impl PositionUnknowns {
    /// Every level, with its word in the configuration.
    pub(super) const WORDS: [(&'static str, Self); 4] = [
        ("none", Self::None),
        ("position", Self::Position),
        ("velocity", Self::Velocity),
        ("acceleration", Self::Acceleration),
    ];

    /// Powers of time that are unknown.
    #[must_use]
    pub const fn powers(self) -> usize {
        match self {
            Self::None => 0,
            Self::Position => 1,
            Self::Velocity => 2,
            Self::Acceleration => 3,
        }
    }
}

/// What of an image's rotation is unknown, likewise (jigsaw's `camsolve`).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RotationUnknowns {
    /// Nothing.
    None,
    /// Constant angles.
    Angles,
    /// And what is linear in time.
    Velocity,
    /// And what is quadratic.
    Acceleration,
}

impl RotationUnknowns {
    /// Every level, with its word in the configuration.
    pub(super) const WORDS: [(&'static str, Self); 4] = [
        ("none", Self::None),
        ("angles", Self::Angles),
        ("velocity", Self::Velocity),
        ("acceleration", Self::Acceleration),
    ];

    /// Powers of time that are unknown.
    #[must_use]
    pub const fn powers(self) -> usize {
        match self {
            Self::None => 0,
            Self::Angles => 1,
            Self::Velocity => 2,
            Self::Acceleration => 3,
        }
    }
}
