//! What sites state of the boresight of the laser: the file that `areograph estimate-boresight --toml` prints.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::{
    printed_file::PrintedFile,
    problems::{Problems, Review},
};
use areograph_geom::boresight::BoresightInformation;

/// Statements of sites about the two boresight angles of a laser.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BoresightStatements {
    /// A priori standard deviation of each angle, radians.
    pub prior_sigma_rad: f64,
    /// Mounting of each camera, to which the angles refer.
    pub mountings: Vec<LaserMounting>,
    /// The sites; no two of them share an image or an orbit.
    pub sites: Vec<BoresightOfSite>,
}

/// Direction of the laser in a camera.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LaserMounting {
    /// Name of the spacecraft.
    pub spacecraft: String,
    /// Name of the camera.
    pub camera: String,
    /// Direction of the beam by the mounting, components in the camera, of length 1.
    pub beam: [f64; 3],
}

/// What a site states of the angles, without a priori values.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BoresightOfSite {
    /// The site.
    pub site: String,
    /// All images of the site: they share tie points.
    pub images: Vec<String>,
    /// Orbits of all its profiles.
    pub orbits: Vec<String>,
    /// Normal matrix of the angles: first, both, second; per rad².
    pub matrix: [f64; 3],
    /// Right-hand side, per radian.
    pub vector: [f64; 2],
}

impl BoresightOfSite {
    /// Its statement.
    #[must_use]
    pub fn information(&self) -> BoresightInformation {
        BoresightInformation::new(self.matrix, self.vector)
    }

    /// Whether the site shares an image or an orbit with these.
    #[must_use]
    pub fn shares(&self, images: &[String], orbits: &[String]) -> bool {
        let any = |own: &[String], others: &[String]| own.iter().any(|of| others.contains(of));
        any(&self.images, images) || any(&self.orbits, orbits)
    }
}

impl BoresightStatements {
    /// The file with this content.
    #[must_use]
    pub fn to_toml(&self) -> String {
        // All values have a form in TOML.
        let content = toml::to_string(self).unwrap_or_default();
        format!(
            "# Printed by `areograph estimate-boresight --toml`, for adjustment.boresight of site files.\n\
             # Orientations and profile positions of different sites are assumed to be in error independently; an error common to all sites \
             is not included.\n{content}"
        )
    }

    /// Reads the file `text`.
    fn parse(text: &str, file: &Path) -> Result<Self, Problems> {
        let mut review = Review::new(file, text);
        let read = toml::from_str::<Self>(text).map_err(|error| {
            let message = format!("{}; expected the file as printed", error.message());
            review.problem(error.span(), message);
        });
        if let Some(problem) = read.as_ref().ok().and_then(Self::problem) {
            review.problem(None, format!("{problem}; expected the file as printed"));
        }
        review.finish(read.ok()).map(|(value, _)| value)
    }

    /// A value that no printed file has.
    fn problem(&self) -> Option<String> {
        let sigma_rad = self.prior_sigma_rad;
        if !(sigma_rad > 0.0 && sigma_rad.is_finite()) {
            return Some(format!("prior_sigma_rad is {sigma_rad}"));
        }
        let is_unit = |beam: &[f64; 3]| {
            let square = beam.iter().map(|of| of * of).sum::<f64>();
            (square - 1.0).abs() < 1e-9
        };
        if let Some(of) = self.mountings.iter().find(|of| !is_unit(&of.beam)) {
            return Some(format!(
                "beam of {} is not a direction of length 1",
                of.camera
            ));
        }
        let is_valid = |of: &BoresightOfSite| {
            let [first, both, second] = of.matrix;
            let sum = first.abs() + second.abs();
            // Less than this share of the a priori values changes no result.
            let rounding = 1e-9 * (sum + sigma_rad.powi(-2));
            // Written so that NaN is refused.
            let states = first >= -rounding
                && second >= -rounding
                && first * second - both * both >= -rounding * sum;
            states && of.vector.iter().all(|of| of.is_finite()) && !of.images.is_empty()
        };
        let invalid = self.sites.iter().find(|of| !is_valid(of));
        let invalid =
            invalid.map(|of| format!("matrix, vector or images of {} are not valid", of.site));
        let mut sites = self.sites.iter().enumerate();
        let shared = || {
            sites.find_map(|(place, of)| {
                let earlier = &self.sites[..place];
                let other = earlier
                    .iter()
                    .find(|other| other.shares(&of.images, &of.orbits))?;
                Some(format!(
                    "{} and {} share an image or an orbit",
                    other.site, of.site
                ))
            })
        };
        invalid.or_else(shared)
    }
}

/// The path of such a file.
pub(super) const BORESIGHT_FILE: PrintedFile<BoresightStatements> = PrintedFile {
    expected: "the path of a file with the output of `areograph estimate-boresight --toml`",
    usual: "boresight.toml",
    parse: BoresightStatements::parse,
};

#[cfg(test)]
mod tests {
    use super::*;

    fn statements() -> BoresightStatements {
        let site = |site: &str, orbit: &str| BoresightOfSite {
            site: site.to_owned(),
            images: vec![format!("{site}-1"), format!("{site}-2")],
            orbits: vec![orbit.to_owned()],
            matrix: [1.5e-3, -2.5e6, 3.5e7],
            vector: [-20.0, 1.25e3],
        };
        BoresightStatements {
            prior_sigma_rad: 1e-4,
            mountings: vec![LaserMounting {
                spacecraft: "Mars Global Surveyor".to_owned(),
                camera: "MOC-NA".to_owned(),
                beam: [0.6, 0.0, 0.8],
            }],
            sites: vec![site("eos", "9044"), site("gusev", "8939")],
        }
    }

    #[test]
    fn a_printed_file_is_read_as_it_was() {
        let mut statements = statements();
        statements.sites[0].matrix = [0.0, 0.0, 3.5e7];
        statements.sites[1].matrix = [2.0e7, -2.5e6, 3.5e7];
        let text = statements.to_toml();
        let read = BoresightStatements::parse(&text, Path::new("b.toml"));
        assert_eq!(read, Ok(statements));
    }

    #[test]
    fn an_altered_file_is_refused() {
        let mut statements = statements();
        for site in &mut statements.sites {
            site.matrix = [2.0e7, -2.5e6, 3.5e7];
        }
        for (from, to, expected) in [
            (
                "prior_sigma_rad = 0.0001",
                "prior_sigma_rad = 0.0",
                "prior_sigma_rad is 0",
            ),
            ("0.6, 0.0", "0.7, 0.0", "beam of MOC-NA"),
            ("20000000.0, ", "", "expected the file as printed"),
            (
                "-2500000.0",
                "-250000000.0",
                "matrix, vector or images of eos",
            ),
            ("\"8939\"", "\"9044\"", "eos and gusev share"),
            ("gusev-1", "eos-2", "eos and gusev share"),
            ("vector", "vectr", "vectr"),
            ("[-20.0, ", "[nan, ", "of eos are not valid"),
        ] {
            let text = statements.to_toml().replace(from, to);
            assert_ne!(text, statements.to_toml(), "{from}");
            let refused = BoresightStatements::parse(&text, Path::new("b.toml")).unwrap_err();
            assert!(
                refused.to_string().contains(expected),
                "{expected}: {refused}"
            );
        }
    }
}
