//! Image support data as a source of times, camera and orientation: whether they are of the site's body, and what is told.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::{ImageTimes, StartFrom};
use crate::{
    body::Body,
    config::ImageConfig,
    error::{Cause, Kind, Result},
    files::{HashedFile, file_name},
    geom::{attitude::rotation_vector, body_rotation::body_rotation},
    pds::isd::{ImageSupport, SupportTables, read_isd},
    spice::Session,
    time::Et,
    units::METRES_PER_KM,
};

/// Radii within this are those of the products' frame, metres: files are written to ten metres.
const RADIUS_TOLERANCE_M: f64 = 10.0;

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
    /// Whether positions are those of the spacecraft with the laser, geometric.
    pub has_laser: bool,
    /// Positions and rotations.
    pub tables: SupportTables,
}

/// Support data of another body.
#[derive(Debug, thiserror::Error)]
enum ForeignBody {
    #[error(
        "image {image}: naif_keywords.BODY_CODE is {code}; expected {}, {}",
        .body.naif().body,
        .body.names().name
    )]
    Code {
        image: String,
        body: Body,
        code: i64,
    },
    #[error(
        "image {image}: radii are {:.2} and {:.2} km; expected {:.2} and {:.2} km, those of {body} in {}",
        .radii_m[0] / METRES_PER_KM,
        .radii_m[1] / METRES_PER_KM,
        .body.model().equatorial_radius_m / METRES_PER_KM,
        .body.model().polar_radius_m / METRES_PER_KM,
        .body.names().short_frame
    )]
    Radii {
        image: String,
        body: Body,
        radii_m: [f64; 2],
    },
}

impl Cause for ForeignBody {
    fn kind(&self) -> Kind {
        Kind::Input
    }

    fn advice(&self) -> String {
        let (Self::Code { body, .. } | Self::Radii { body, .. }) = self;
        format!(
            "leave the image out, or write the body that its support data are of: the site is on {body} (body = \"{}\")",
            body.word()
        )
    }
}

impl SupportFile {
    /// What the file at `path` says of `image`, which sees `body`.
    ///
    /// # Errors
    /// As [`read_isd`]; support data of another body.
    fn read(
        body: Body,
        image: &ImageConfig,
        path: &Path,
        hashed: Option<&HashedFile>,
    ) -> Result<(ImageSupport, Self)> {
        let said = read_isd(path)?;
        let of_body = i64::from(body.naif().body);
        if let Some(code) = said.target.filter(|code| *code != of_body) {
            let image = image.id.clone();
            return Err(ForeignBody::Code { image, body, code }.into());
        }
        let model = body.model();
        let expected_m = [model.equatorial_radius_m, model.polar_radius_m];
        let mut apart_m = said
            .radii_m
            .iter()
            .zip(expected_m)
            .map(|(a, b)| (a - b).abs());
        if apart_m.any(|apart_m| apart_m > RADIUS_TOLERANCE_M) {
            let (image, radii_m) = (image.id.clone(), said.radii_m);
            return Err(ForeignBody::Radii {
                image,
                body,
                radii_m,
            }
            .into());
        }
        let file = Self {
            name: file_name(path),
            bytes: hashed.map_or(0, |file| file.bytes),
            blake3: hashed.map_or_else(String::new, |file| file.blake3.clone()),
            platform: said.platform.clone(),
            has_laser: image.has_laser,
            tables: said.tables.clone(),
        };
        Ok((said, file))
    }

    /// What is taken from the file.
    fn note(&self) -> String {
        format!(
            "camera, line times and orientation are those of the support data {}; nothing is applied to them, neither a \
             pointing bias nor a clock correction nor light time",
            self.name
        )
    }

    /// What does not agree with the frame of the products at the instant `at`.
    fn remarks(&self, body: Body, at: Et) -> Vec<String> {
        let rotation = &self.tables.body_rotation;
        let theirs = rotation.constant * rotation.at(at.seconds()).0;
        let ours = *body_rotation(body, at).matrix();
        let turn_rad = rotation_vector(&(theirs * ours.transpose())).norm();
        // Written so that NaN is remarked on too.
        if turn_rad <= body.rotation_tolerance_rad() {
            return Vec::new();
        }
        vec![format!(
            "the support data {} turn {body} by {:.1} m on the equator against {}; positions are taken in their frame",
            self.name,
            turn_rad * body.model().equatorial_radius_m,
            body.names().short_frame
        )]
    }
}

/// Times and camera of an image by its support data.
pub(super) fn supported(
    body: Body,
    image: &ImageConfig,
    path: &Path,
    hashed: Option<&HashedFile>,
    session: &Session,
) -> Result<ImageTimes> {
    let (said, file) = SupportFile::read(body, image, path, hashed)?;
    let start = said.line_times.start();
    let period_s = said.line_times.mean_period_s();
    Ok(ImageTimes {
        id: image.id.clone(),
        body,
        start_from: StartFrom::Support,
        sclk_start: None,
        utc_start: session.et_to_utc(start)?,
        exposure_s: period_s / f64::from(said.downtrack_summing),
        downtrack_summing: said.downtrack_summing,
        crosstrack_summing: said.crosstrack_summing,
        lines_delivered: said.line_times.lines(),
        samples: said.samples,
        first_detector: said.first_detector,
        notes: vec![file.note()],
        remarks: file.remarks(body, start),
        instrument: said.instrument,
        line_times: said.line_times,
        support: Some(file),
    })
}
