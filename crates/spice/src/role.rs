//! Roles of kernels.

use std::fmt;

use serde::Serialize;

/// The role of a kernel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum KernelRole {
    /// Leap seconds.
    Lsk,
    /// Spacecraft clock.
    Sclk,
    /// Planetary constants.
    Pck,
    /// Frame definitions.
    Fk,
    /// Instrument.
    Ik,
    /// Ephemerides.
    Spk,
    /// Attitude.
    Ck,
    /// A list of kernels.
    Meta,
}

impl fmt::Display for KernelRole {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Self::Lsk => "LSK",
            Self::Sclk => "SCLK",
            Self::Pck => "PCK",
            Self::Fk => "FK",
            Self::Ik => "IK",
            Self::Spk => "SPK",
            Self::Ck => "CK",
            Self::Meta => "MK",
        })
    }
}
