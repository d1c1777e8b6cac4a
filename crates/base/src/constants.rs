//! Constants of the mission, each with its source and sign; constants of the spacecraft are in `config/spacecraft`, of
//! bodies in [`crate::body`].

use std::sync::LazyLock;

/// Smallest standard deviation of a point, pixels or metres: no measurement is better, and squares remain finite.
pub const SIGMA_MIN: f64 = 1e-3;

/// Largest standard deviation of a laser point, metres: at this distance the ground is 3 m below a plane (of the
/// Moon), which laser heights do not resolve; at three times the distance 23 m.
pub const CONTROL_SIGMA_MAX_M: f64 = 3_000.0;

use serde::Deserialize;

use crate::units::RADIANS_PER_ARCSECOND;

/// Folder that `areograph fetch` keeps beside the files that it fetches: parts of files, copies of indexes.
pub const FETCH_FOLDER: &str = ".fetch";
/// NAIF id of the centre of Mars.
pub const NAIF_MARS: i32 = 499;
/// Name of Mars in labels.
pub const MARS_NAME: &str = "MARS";
/// NAIF id of the Sun.
pub const NAIF_SUN: i32 = 10;
/// Least and largest distance of Mars from the Sun, metres, for choosing kernels: perihelion 206.65 and aphelion 249.26
/// million km (NASA's Mars fact sheet), rounded outwards.
pub const SUN_DISTANCE_M: [f64; 2] = [206.0e9, 250.0e9];

/// NAIF id of the barycentre of the solar system.
pub const NAIF_SOLAR_SYSTEM_BARYCENTRE: i32 = 0;
/// Speed of light, metres per second.
pub const SPEED_OF_LIGHT_M_S: f64 = 299_792_458.0;

/// Speed of the mapping orbit over the ground, metres per second: converts times into distances along the track.
///
/// # Source
/// The circumference of Mars, 21,300 km, over the period of 7,064 s (Shan et al. 2005, table 1: 1.9 h) is 3,015 m/s; one
/// significant digit serves limits and margins.
pub const GROUND_SPEED_M_S: f64 = 3_000.0;

/// All built-in spacecraft; the first carries the laser.
static ALL: LazyLock<[Spacecraft; 2]> = LazyLock::new(|| {
    [
        of_the_program(include_str!("../../../config/spacecraft/mgs.toml")),
        of_the_program(include_str!("../../../config/spacecraft/mex.toml")),
    ]
});

/// The spacecraft of the laser, and of cameras that name no other spacecraft.
pub static SPACECRAFT: LazyLock<&Spacecraft> = LazyLock::new(|| &ALL[0]);

/// A spacecraft, as described in its file under `config/spacecraft`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Spacecraft {
    /// Identifier, the name of its file; kernels of its archive have names that begin with it and an underscore.
    pub id: String,
    /// Its name in messages and in serial numbers of ISIS.
    pub name: String,
    /// Its name in full.
    pub full_name: String,
    /// Its name in labels, where underscores may replace blanks.
    pub label_name: String,
    /// NAIF id of the spacecraft and of its clock.
    pub naif: i32,
    /// NAIF id of the frame of its bus, the object of attitude kernels.
    pub bus: i32,
    /// Name of that frame.
    pub bus_frame: String,
    /// Whether its labels contain the clock of the clock kernels.
    pub labels_tell_clock: bool,
    /// A file of the archive that defines the clock.
    pub clock_kernel: String,
    /// A file of the archive that defines the frame of the bus.
    pub frame_kernel: String,
    /// Largest accepted time correction of its attitude kernels, seconds; 0 if they need none.
    pub ck_bias_max_s: f64,
    /// Source of these values.
    pub source: String,
    /// A priori accuracy of its orbit and attitude, used by sites that state none.
    pub a_priori: OrientationAccuracy,
}

/// Standard deviations of the orientation of an image, equal on all axes, for the powers 0, 1 and 2 of t; t is 0 in the
/// middle of the image and 1 at its end.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OrientationAccuracy {
    /// Of positions, metres.
    pub position_sigma_m: [f64; 3],
    /// Of rotations about the camera axes, arc seconds.
    pub rotation_sigma_arcsec: [f64; 3],
    /// Source of these values.
    pub source: String,
}

impl OrientationAccuracy {
    /// Standard deviations of rotations, radians.
    #[must_use]
    pub fn rotation_sigma_rad(&self) -> [f64; 3] {
        self.rotation_sigma_arcsec
            .map(|sigma| sigma * RADIANS_PER_ARCSECOND)
    }
}

impl Spacecraft {
    /// All built-in spacecraft; the first carries the laser.
    #[must_use]
    pub fn all() -> &'static [Self] {
        &*ALL
    }

    /// The spacecraft with this identifier.
    #[must_use]
    pub fn of_id(id: &str) -> Option<&'static Self> {
        ALL.iter().find(|spacecraft| spacecraft.id == id)
    }

    /// The spacecraft with this name in labels, where underscores may replace blanks.
    #[must_use]
    pub fn of_label_name(name: &str) -> Option<&'static Self> {
        let name = name.replace('_', " ");
        let mut all = ALL.iter();
        all.find(|spacecraft| spacecraft.label_name.eq_ignore_ascii_case(&name))
    }

    /// Its index in [`Self::all`].
    #[must_use]
    pub fn place(&self) -> usize {
        let place = ALL.iter().position(|one| one.naif == self.naif);
        place.unwrap_or_default()
    }

    /// Whether it carries the laser.
    #[must_use]
    pub fn has_laser(&self) -> bool {
        self.naif == SPACECRAFT.naif
    }
}

#[expect(
    clippy::panic,
    reason = "an invalid file in the program itself; every test with kernels reads it"
)]
fn of_the_program<T: serde::de::DeserializeOwned>(text: &str) -> T {
    toml::from_str(text).unwrap_or_else(|error| panic!("built with an invalid file: {error}"))
}
