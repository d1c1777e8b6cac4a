//! Constants of the mission, each with its source and sign; those of the spacecraft stand in `config/spacecraft`, those
//! of bodies in [`crate::body`].

use std::sync::LazyLock;

use serde::Deserialize;

/// NAIF id of the centre of Mars.
pub const NAIF_MARS: i32 = 499;
/// Name of Mars in labels.
pub const MARS_NAME: &str = "MARS";
/// NAIF id of the Sun.
pub const NAIF_SUN: i32 = 10;

/// NAIF id of the barycentre of the solar system.
pub const NAIF_SOLAR_SYSTEM_BARYCENTRE: i32 = 0;
/// Speed of light, metres per second.
pub const SPEED_OF_LIGHT_M_S: f64 = 299_792_458.0;

/// The spacecraft whose clock, orbit and attitude are read.
pub static SPACECRAFT: LazyLock<Spacecraft> =
    LazyLock::new(|| of_the_program(include_str!("../config/spacecraft/mgs.toml")));

/// A spacecraft, as its file under `config/spacecraft` says.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Spacecraft {
    /// Identifier, the name of its file; kernels of its archive have names that begin with it and an underscore.
    pub id: String,
    /// Its name in messages and in serial numbers of ISIS.
    pub name: String,
    /// Its name in full.
    pub full_name: String,
    /// Its name in labels, where underscores may stand for blanks.
    pub label_name: String,
    /// NAIF id of the spacecraft and of its clock.
    pub naif: i32,
    /// NAIF id of the frame of its bus, the object of attitude kernels.
    pub bus: i32,
    /// Name of that frame.
    pub bus_frame: String,
    /// A file of the archive that defines clock and frame.
    pub clock_kernel: String,
    /// Where these come from.
    pub source: String,
}

#[expect(
    clippy::panic,
    reason = "a program built with a bad file of its own; every test with kernels reads it"
)]
fn of_the_program<T: serde::de::DeserializeOwned>(text: &str) -> T {
    toml::from_str(text).unwrap_or_else(|error| panic!("built with a bad file: {error}"))
}
