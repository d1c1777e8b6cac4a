//! Which shots are kept, on the command line.

use clap::Args;

use crate::{altimetry::ShotFilter, units::RADIANS_PER_DEGREE};

/// Shots to keep.
#[derive(Debug, Args)]
pub(super) struct FilterArguments {
    /// Classification codes to keep: 1 ground, 0 cloud or noise.
    #[arg(long, value_delimiter = ',', default_values_t = [1], allow_hyphen_values = true)]
    classes: Vec<i16>,
    /// Trigger channels to keep.
    #[arg(long, value_delimiter = ',', default_values_t = [1, 2, 3, 4])]
    channels: Vec<u8>,
    /// Attitude flags to keep.
    #[arg(long, value_delimiter = ',', default_values_t = [0, 1])]
    attitude_flags: Vec<u16>,
    /// Largest off-nadir angle of the laser, degrees.
    #[arg(long, value_name = "DEGREES", default_value_t = 90.0)]
    off_nadir_max_deg: f64,
}

impl FilterArguments {
    pub(super) fn filter(&self) -> ShotFilter {
        ShotFilter {
            classes: self.classes.clone(),
            channels: self.channels.clone(),
            attitude_flags: self.attitude_flags.clone(),
            off_nadir_max_rad: self.off_nadir_max_deg * RADIANS_PER_DEGREE,
        }
    }
}
