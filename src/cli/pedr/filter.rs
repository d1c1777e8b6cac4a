//! Filter of shots on the command line.

use clap::{Args, ValueEnum, builder::TypedValueParser, value_parser};

use crate::{
    altimetry::{GroundRadius, ShotFilter},
    cli::numbers::above_to,
    units::RADIANS_PER_DEGREE,
};

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
    /// First and last areocentric longitude of the Sun, degrees: the season of Mars; if the first exceeds the last, the
    /// interval contains 0.
    #[arg(long, value_name = "FIRST,LAST", default_value = "0,360", value_parser = season)]
    solar_longitude_deg: [f64; 2],
}

impl FilterArguments {
    pub(super) fn filter(&self) -> ShotFilter {
        ShotFilter {
            classes: self.classes.clone(),
            channels: self.channels.clone(),
            attitude_flags: self.attitude_flags.clone(),
            off_nadir_max_rad: self.off_nadir_max_deg * RADIANS_PER_DEGREE,
            solar_longitude_rad: self
                .solar_longitude_deg
                .map(|degrees| degrees * RADIANS_PER_DEGREE),
        }
    }
}

/// Two longitudes of the Sun.
fn season(text: &str) -> Result<[f64; 2], String> {
    let edge = |text: &str| text.trim().parse().ok();
    let edges = text
        .split_once(',')
        .and_then(|(first, last)| Some([edge(first)?, edge(last)?]));
    edges
        .filter(|edges: &[f64; 2]| edges.iter().all(|edge| (0.0..=360.0).contains(edge)))
        .ok_or_else(|| "expected two longitudes from 0 to 360 degrees, such as 330,30".to_owned())
}

/// The radius of a shot that is used as the radius of the ground.
#[derive(Debug, Args)]
pub(super) struct GroundArgument {
    /// Radii: corrected by the crossover residuals of the files, or raw.
    #[arg(long, value_enum, default_value = "corrected")]
    crossover: Radius,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Radius {
    Corrected,
    Raw,
}

impl GroundArgument {
    pub(super) const fn ground(&self) -> GroundRadius {
        match self.crossover {
            Radius::Corrected => GroundRadius::Corrected,
            Radius::Raw => GroundRadius::Raw,
        }
    }
}

/// A trigger channel, as in the site file.
fn channel() -> impl TypedValueParser<Value = u8> {
    let [first, last] = ShotFilter::CHANNELS.map(i64::from);
    value_parser!(u8).range(first..=last)
}
