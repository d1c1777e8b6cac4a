//! Image support data as a source of times, camera and orientation: whether they are of the site's body, and what is told.

use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::{
    constants::{MARS_IAU2000, NAIF_MARS},
    error::{Cause, Kind, Result},
    files::{HashedFile, file_name},
    frames::MarsIau2000,
    geom::{attitude::rotation_vector, mars_rotation::mars_rotation},
    pds::isd::{ImageSupport, SupportTables, read_isd},
    time::Et,
    units::METRES_PER_KM,
};

/// Radii within this are those of IAU 2000, metres: files are written to ten metres.
const RADIUS_TOLERANCE_M: f64 = 10.0;
/// A body rotation within this is that of IAU 2000, radians: light time to the ground turns Mars by 1e-7, the models of
/// other reports by 1e-4 and more. On the ground it is three metres.
const ROTATION_TOLERANCE_RAD: f64 = 1e-6;

/// Support data of an image, and the file that they stand in.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SupportFile {
    /// File name, without folders.
    pub name: String,
    /// Size.
    pub bytes: u64,
    /// BLAKE3 of its content, hexadecimal.
    pub blake3: String,
    /// Name of the spacecraft.
    pub platform: String,
    /// Positions and rotations.
    pub tables: SupportTables,
}

/// Support data of another body.
#[derive(Debug, thiserror::Error)]
enum ForeignBody {
    #[error("image {image}: naif_keywords.BODY_CODE is {code}; expected {NAIF_MARS}, Mars")]
    Code { image: String, code: i64 },
    #[error(
        "image {image}: radii are {:.2} and {:.2} km; expected {:.2} and {:.2} km, those of Mars in IAU 2000",
        .radii_m[0] / METRES_PER_KM,
        .radii_m[1] / METRES_PER_KM,
        MARS_IAU2000.equatorial_radius_m / METRES_PER_KM,
        MARS_IAU2000.polar_radius_m / METRES_PER_KM
    )]
    Radii { image: String, radii_m: [f64; 2] },
}

impl Cause for ForeignBody {
    fn kind(&self) -> Kind {
        Kind::Input
    }

    fn advice(&self) -> String {
        "leave the image out: areograph knows images of Mars alone".to_owned()
    }
}

impl SupportFile {
    /// What the file at `path` says of `image`.
    ///
    /// # Errors
    /// As [`read_isd`]; support data of another body than Mars.
    pub(super) fn read(
        image: &str,
        path: &Path,
        hashed: Option<&HashedFile>,
    ) -> Result<(ImageSupport, Self)> {
        let said = read_isd(path)?;
        if let Some(code) = said.target.filter(|code| *code != i64::from(NAIF_MARS)) {
            let image = image.to_owned();
            return Err(ForeignBody::Code { image, code }.into());
        }
        let expected_m = [
            MARS_IAU2000.equatorial_radius_m,
            MARS_IAU2000.polar_radius_m,
        ];
        let mut apart_m = said
            .radii_m
            .iter()
            .zip(expected_m)
            .map(|(a, b)| (a - b).abs());
        if apart_m.any(|apart_m| apart_m > RADIUS_TOLERANCE_M) {
            let (image, radii_m) = (image.to_owned(), said.radii_m);
            return Err(ForeignBody::Radii { image, radii_m }.into());
        }
        let file = Self {
            name: file_name(path),
            bytes: hashed.map_or(0, |file| file.bytes),
            blake3: hashed.map_or_else(String::new, |file| file.blake3.clone()),
            platform: said.platform.clone(),
            tables: said.tables.clone(),
        };
        Ok((said, file))
    }

    /// What is taken from the file.
    pub(super) fn note(&self) -> String {
        format!(
            "camera, line times and orientation are those of the support data {}; nothing is applied to them, neither a \
             pointing bias nor a clock correction nor light time",
            self.name
        )
    }

    /// What does not agree with the frame of the products at the instant `at`.
    pub(super) fn remarks(&self, at: Et) -> Vec<String> {
        let rotation = &self.tables.body_rotation;
        let theirs = rotation.constant * rotation.at(at.seconds()).0;
        let ours = *mars_rotation::<MarsIau2000>(at).matrix();
        let turn_rad = rotation_vector(&(theirs * ours.transpose())).norm();
        // Written so that NaN is remarked on too.
        if turn_rad <= ROTATION_TOLERANCE_RAD {
            return Vec::new();
        }
        vec![format!(
            "the support data {} turn Mars by {:.1} m on the equator against IAU 2000; positions are taken in their frame",
            self.name,
            turn_rad * MARS_IAU2000.equatorial_radius_m
        )]
    }
}
