//! Filter of shots on the command line.

use clap::{Args, builder::TypedValueParser, value_parser};

use crate::{altimetry::ShotFilter, cli::numbers::above_to, units::RADIANS_PER_DEGREE};

/// Shots to keep.
#[derive(Debug, Args)]
pub(super) struct FilterArguments {
    /// Classification codes to keep, separated by commas: 1 ground, 0 cloud or noise.
    #[arg(long, value_delimiter = ',', default_values_t = [1], allow_hyphen_values = true)]
    classes: Vec<i16>,
    /// Trigger channels to keep, separated by commas.
    #[arg(long, value_delimiter = ',', default_value = "1,2,3,4", value_parser = channel())]
    channels: Vec<u8>,
    /// Attitude flags to keep, separated by commas.
    #[arg(long, value_delimiter = ',', default_value = "0,1")]
    attitude_flags: Vec<u16>,
    /// Largest off-nadir angle of the laser, degrees.
    #[arg(long, value_name = "DEGREES", default_value = "90", value_parser = above_to(0.0, ShotFilter::OFF_NADIR_LIMIT_DEG), allow_negative_numbers = true)]
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

/// A trigger channel, as in the site file.
fn channel() -> impl TypedValueParser<Value = u8> {
    let [first, last] = ShotFilter::CHANNELS.map(i64::from);
    value_parser!(u8).range(first..=last)
}
