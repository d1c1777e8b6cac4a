//! Constants of the mission, each with its source and sign; those of Mars stand in `config/bodies/mars.toml`, those
//! of the spacecraft in `config/spacecraft`.

use std::sync::LazyLock;

use serde::Deserialize;

/// NAIF id of the frame `IAU_MARS`.
pub const NAIF_IAU_MARS: i32 = 10_014;
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

/// Rotation and shape of Mars in one IAU report.
///
/// `ra = ra0 + ra1·T`, `dec = dec0 + dec1·T`, `W = w0 + w1·d`, with `T` in Julian centuries of
/// 36 525 days and `d` in days of TDB past J2000; body-fixed from J2000 is
/// `[W]₃ [90° − dec]₁ [90° + ra]₃`, each a rotation of the frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MarsModel {
    /// Name as configuration and products write it.
    pub name: &'static str,
    /// Right ascension of the pole at J2000, degrees.
    pub pole_ra_deg: f64,
    /// Its rate, degrees per Julian century.
    pub pole_ra_deg_per_century: f64,
    /// Declination of the pole at J2000, degrees.
    pub pole_dec_deg: f64,
    /// Its rate, degrees per Julian century.
    pub pole_dec_deg_per_century: f64,
    /// Prime meridian at J2000, degrees.
    pub meridian_deg: f64,
    /// Rotation rate, degrees per day.
    pub meridian_deg_per_day: f64,
    /// Equatorial radius, metres.
    pub equatorial_radius_m: f64,
    /// Polar radius, metres.
    pub polar_radius_m: f64,
}

/// Mars in the 1991 IAU report, the likely "IAU 1991" of MOLA products before version L.
pub static MARS_IAU1991: LazyLock<MarsModel> = LazyLock::new(|| MARS.iau1991.named("iau1991"));
/// Mars in the 1994 IAU report: `pck00005`, and the `pck00006` that Shan et al. 2005 calls IAU 1991.
pub static MARS_IAU1994: LazyLock<MarsModel> = LazyLock::new(|| MARS.iau1994.named("iau1994"));
/// Mars in the 2000 IAU report, the frame of every areograph product.
pub static MARS_IAU2000: LazyLock<MarsModel> = LazyLock::new(|| MARS.iau2000.named("iau2000"));

/// What `config/bodies/mars.toml` says.
static MARS: LazyLock<Body> =
    LazyLock::new(|| of_the_program(include_str!("../config/bodies/mars.toml")));

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

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(
    dead_code,
    reason = "names and sources are for those who read the file"
)]
struct Body {
    id: String,
    name: String,
    iau1991: Report,
    iau1994: Report,
    iau2000: Report,
}

/// Rotation and shape of one report, with their source.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(dead_code, reason = "sources are for those who read the file")]
struct Report {
    pole_ra_deg: f64,
    pole_ra_deg_per_century: f64,
    pole_dec_deg: f64,
    pole_dec_deg_per_century: f64,
    meridian_deg: f64,
    meridian_deg_per_day: f64,
    equatorial_radius_m: f64,
    polar_radius_m: f64,
    source: String,
}

impl Report {
    const fn named(&self, name: &'static str) -> MarsModel {
        MarsModel {
            name,
            pole_ra_deg: self.pole_ra_deg,
            pole_ra_deg_per_century: self.pole_ra_deg_per_century,
            pole_dec_deg: self.pole_dec_deg,
            pole_dec_deg_per_century: self.pole_dec_deg_per_century,
            meridian_deg: self.meridian_deg,
            meridian_deg_per_day: self.meridian_deg_per_day,
            equatorial_radius_m: self.equatorial_radius_m,
            polar_radius_m: self.polar_radius_m,
        }
    }
}

#[expect(
    clippy::panic,
    reason = "a program built with a bad file of its own; every test on Mars or with kernels reads it"
)]
fn of_the_program<T: serde::de::DeserializeOwned>(text: &str) -> T {
    toml::from_str(text).unwrap_or_else(|error| panic!("built with a bad file: {error}"))
}
