//! The observed bodies: rotation, shape and names, from their files under `config/bodies`.
//!
//! Frame, ellipsoid, maps, names and numbers of products belong to the body of the site. Footprints, image times and
//! orientations carry it through the stages; `Body::Mars` is written where something belongs to Mars Global Surveyor.
//! Mars is in IAU 2000 by areograph's own constants, not by the loaded PCK (a difference is noted); the Moon rotates as
//! its support data state; its formula checks this rotation.
//!
//! ```
//! use areograph_base::body::Body;
//!
//! assert_eq!(Body::default(), Body::Mars);
//! assert_eq!(Body::Moon.model().equatorial_radius_m, 1_737_400.0);
//! ```

use std::{collections::BTreeMap, fmt, sync::LazyLock};

use serde::{Deserialize, Serialize};

/// The body of a site. A site has one: frames, heights, maps and words of its products belong to this body.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Body {
    /// In the frame of the IAU 2000 report.
    #[default]
    Mars,
    /// In the mean Earth/polar axis frame.
    Moon,
}

/// Report that a file's body-fixed coordinates follow, known only when the file is read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Datum {
    /// Mars, W₀ = 176.868°.
    Iau1991,
    /// Mars, W₀ = 176.901°.
    Iau1994,
    /// Mars, W₀ = 176.630°.
    Iau2000,
    /// The Moon's mean Earth/polar axis.
    #[serde(rename = "moon_me")]
    MoonMe,
}

/// Rotation and shape of a body in one report.
///
/// `ra = ra0 + ra1·T + Σ a sin E`, `dec = dec0 + dec1·T + Σ b cos E`, `W = w0 + w1·d + w2·d² + Σ c sin E`, with `T` in
/// Julian centuries of 36 525 days, `d` in days of TDB past J2000 and `E` the angles of [`Nutation`]; body-fixed from J2000
/// is `[W]₃ [90° − dec]₁ [90° + ra]₃`, each a rotation of the frame.
#[derive(Debug, Clone, PartialEq)]
pub struct BodyModel {
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
    /// Its change, degrees per day squared.
    pub meridian_deg_per_day2: f64,
    /// Periodic terms; Mars has none in these reports.
    pub nutation: Vec<Nutation>,
    /// Equatorial radius, metres.
    pub equatorial_radius_m: f64,
    /// Polar radius, metres.
    pub polar_radius_m: f64,
}

/// One periodic term of pole and meridian.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Nutation {
    /// Its angle at J2000, degrees.
    pub angle_deg: f64,
    /// Rate of the angle, degrees per Julian century.
    pub angle_deg_per_century: f64,
    /// Coefficient of the right ascension of the pole, times the sine, degrees.
    pub pole_ra_deg: f64,
    /// Coefficient of its declination, times the cosine, degrees.
    pub pole_dec_deg: f64,
    /// Coefficient of the prime meridian, times the sine, degrees.
    pub meridian_deg: f64,
}

/// Mars in the 1991 IAU report, the likely "IAU 1991" of MOLA products before version L.
pub static MARS_IAU1991: LazyLock<BodyModel> = LazyLock::new(|| MARS.model("iau1991"));
/// Mars in the 1994 IAU report: `pck00005`, and the `pck00006` that Shan et al. 2005 calls IAU 1991.
pub static MARS_IAU1994: LazyLock<BodyModel> = LazyLock::new(|| MARS.model("iau1994"));
/// Mars in the 2000 IAU report, the frame of every product at Mars.
pub static MARS_IAU2000: LazyLock<BodyModel> = LazyLock::new(|| MARS.model("iau2000"));
/// The Moon in its mean Earth/polar axis frame, the frame of every product at the Moon.
pub static MOON_ME: LazyLock<BodyModel> = LazyLock::new(|| MOON.model("moon_me"));

static MARS: LazyLock<BodyFile> =
    LazyLock::new(|| of_the_program(include_str!("../../../config/bodies/mars.toml")));
static MOON: LazyLock<BodyFile> =
    LazyLock::new(|| of_the_program(include_str!("../../../config/bodies/moon.toml")));

/// Content of a file under `config/bodies`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(dead_code, reason = "sources are for readers of the file")]
struct BodyFile {
    id: String,
    names: Names,
    naif: Naif,
    rotation: RotationOfFiles,
    map: MapSphere,
    report: BTreeMap<String, Report>,
}

/// Names of a body and its frame in texts.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Names {
    /// Its name in headings, labels and catalogues.
    pub name: String,
    /// The name within a sentence.
    pub in_text: String,
    /// Its class, as in PDS4 labels, and in lower case in STAC catalogues.
    pub class: String,
    /// Frame of the coordinates, one line for readers of products.
    pub frame: String,
    /// The frame in two or three words.
    pub short_frame: String,
}

/// Names of a body and its frame in NAIF's kernels.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Naif {
    /// Number of the body.
    pub body: i32,
    /// Number of the frame of its products.
    pub frame: i32,
    /// Name of the frame that planetary constants kernels define.
    pub pck_frame: String,
}

/// Tolerance of rotations of files against the formula.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(dead_code, reason = "sources are for readers of the file")]
struct RotationOfFiles {
    tolerance_rad: f64,
    source: String,
}

/// The sphere of maps and formats for GIS.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MapSphere {
    /// Code in the registry `IAU_2015`.
    pub code: u32,
    /// Its name there.
    pub crs: String,
    /// Name of its datum and of the sphere.
    pub datum: String,
    /// Anchor of the longitudes, if the registry states one.
    pub anchor: Option<String>,
    /// Radius, metres.
    pub radius_m: f64,
    /// Name of the datum in Ames Stereo Pipeline.
    pub asp_datum: String,
}

/// Rotation and shape of one report, with their source.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(dead_code, reason = "sources are for readers of the file")]
struct Report {
    pole_ra_deg: f64,
    pole_ra_deg_per_century: f64,
    pole_dec_deg: f64,
    pole_dec_deg_per_century: f64,
    meridian_deg: f64,
    meridian_deg_per_day: f64,
    #[serde(default)]
    meridian_deg_per_day2: f64,
    #[serde(default)]
    nutation: Vec<Nutation>,
    equatorial_radius_m: f64,
    polar_radius_m: f64,
    source: String,
}

impl Body {
    /// Every body, with its name in the configuration.
    pub const WORDS: [(&'static str, Self); 2] = [("mars", Self::Mars), ("moon", Self::Moon)];

    /// Its name in the configuration.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Mars => "mars",
            Self::Moon => "moon",
        }
    }

    fn file(self) -> &'static BodyFile {
        match self {
            Self::Mars => &MARS,
            Self::Moon => &MOON,
        }
    }

    /// Rotation and shape in the frame of the products.
    #[must_use]
    pub fn model(self) -> &'static BodyModel {
        self.datum().model()
    }

    /// The datum of the products.
    #[must_use]
    pub const fn datum(self) -> Datum {
        match self {
            Self::Mars => Datum::Iau2000,
            Self::Moon => Datum::MoonMe,
        }
    }

    /// Its names in texts.
    #[must_use]
    pub fn names(self) -> &'static Names {
        &self.file().names
    }

    /// Its names in NAIF's kernels.
    #[must_use]
    pub fn naif(self) -> &'static Naif {
        &self.file().naif
    }

    /// Its sphere of maps.
    #[must_use]
    pub fn map(self) -> &'static MapSphere {
        &self.file().map
    }

    /// The ground of the whole body as a grey picture for maps of sites, PNG: shaded, from 0° eastwards to 360° and from
    /// 90° N to 90° S, every degree of longitude and latitude of the same size. Only Mars has one.
    ///
    /// # Source
    /// MOLA MEGDR at four cells per degree (`MGS-M-MOLA-5-MEGDR-L3-V1.0`, NASA PDS); `scripts/relief.py` writes the file.
    #[must_use]
    pub const fn relief(self) -> Option<&'static [u8]> {
        match self {
            Self::Mars => Some(include_bytes!("../../../config/bodies/mars_relief.png")),
            Self::Moon => None,
        }
    }

    /// Tolerance of body rotations of support data against the formula of the products' frame, radians.
    #[must_use]
    pub fn rotation_tolerance_rad(self) -> f64 {
        self.file().rotation.tolerance_rad
    }
}

impl fmt::Display for Body {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(&self.names().in_text)
    }
}

impl Datum {
    /// The body of this datum.
    #[must_use]
    pub const fn body(self) -> Body {
        match self {
            Self::Iau1991 | Self::Iau1994 | Self::Iau2000 => Body::Mars,
            Self::MoonMe => Body::Moon,
        }
    }

    /// Rotation and shape of the report.
    #[must_use]
    pub fn model(self) -> &'static BodyModel {
        match self {
            Self::Iau1991 => &MARS_IAU1991,
            Self::Iau1994 => &MARS_IAU1994,
            Self::Iau2000 => &MARS_IAU2000,
            Self::MoonMe => &MOON_ME,
        }
    }
}

impl fmt::Display for Datum {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.model().name)
    }
}

impl BodyFile {
    #[expect(
        clippy::panic,
        reason = "an invalid file in the program itself; a test reads every report"
    )]
    fn model(&self, name: &'static str) -> BodyModel {
        let Some(report) = self.report.get(name) else {
            panic!(
                "built with an invalid file: {} has no report {name}",
                self.id
            );
        };
        BodyModel {
            name,
            pole_ra_deg: report.pole_ra_deg,
            pole_ra_deg_per_century: report.pole_ra_deg_per_century,
            pole_dec_deg: report.pole_dec_deg,
            pole_dec_deg_per_century: report.pole_dec_deg_per_century,
            meridian_deg: report.meridian_deg,
            meridian_deg_per_day: report.meridian_deg_per_day,
            meridian_deg_per_day2: report.meridian_deg_per_day2,
            nutation: report.nutation.clone(),
            equatorial_radius_m: report.equatorial_radius_m,
            polar_radius_m: report.polar_radius_m,
        }
    }
}

#[expect(
    clippy::panic,
    reason = "an invalid file in the program itself; every test with a body reads it"
)]
fn of_the_program<T: serde::de::DeserializeOwned>(text: &str) -> T {
    toml::from_str(text).unwrap_or_else(|error| panic!("built with an invalid file: {error}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_body_and_report_is_read() {
        for (word, body) in Body::WORDS {
            assert_eq!(body.word(), word);
            assert_eq!(body.file().id, word);
            assert!(body.model().polar_radius_m <= body.model().equatorial_radius_m);
            assert!(body.map().radius_m <= body.model().equatorial_radius_m);
            assert!(body.rotation_tolerance_rad() > 0.0);
            assert!(body.naif().body > 0 && body.naif().frame > 0);
        }
        for datum in [
            Datum::Iau1991,
            Datum::Iau1994,
            Datum::Iau2000,
            Datum::MoonMe,
        ] {
            assert_eq!(datum.to_string(), datum.model().name);
        }
    }
}
