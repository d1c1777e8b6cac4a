//! Checks that support data belong to a body, and to its frame.

use super::{ImageSupport, SupportTables};
use areograph_base::{body::Body, error::Cause, time::Et, units::METRES_PER_KM};
use areograph_geom::{attitude::rotation_vector, body_rotation::body_rotation};

/// Tolerance of radii against the radii of the products' frame, metres: files round them to ten metres.
pub(super) const RADIUS_TOLERANCE_M: f64 = 10.0;

/// Support data of a different body.
#[derive(Debug, thiserror::Error, Cause)]
#[cause(Input: "omit the image, or set body to the body of its support data; the configuration expects {body} \
    (body = \"{}\")", body.word())]
pub enum ForeignBody {
    /// Identified by its code.
    #[error(
        "image {image}: naif_keywords.BODY_CODE is {code}; expected {}, {}",
        .body.naif().body,
        .body.names().name
    )]
    Code {
        /// The image.
        image: String,
        /// The body that was expected.
        body: Body,
        /// NAIF code of the other body.
        code: i64,
    },
    /// Identified by its radii.
    #[error(
        "image {image}: radii are {:.2} and {:.2} km; expected {:.2} and {:.2} km, the radii of {body} in {}",
        .radii_m[0] / METRES_PER_KM,
        .radii_m[1] / METRES_PER_KM,
        .body.model().equatorial_radius_m / METRES_PER_KM,
        .body.model().polar_radius_m / METRES_PER_KM,
        .body.names().short_frame
    )]
    Radii {
        /// The image.
        image: String,
        /// The body that was expected.
        body: Body,
        /// Equatorial and polar radius of the other body, metres.
        radii_m: [f64; 2],
    },
}

impl ImageSupport {
    /// Checks that an image, known as `image`, shows `body`.
    ///
    /// # Errors
    /// [`ForeignBody`], with the number or the radii that are not the body's.
    pub fn sees(&self, body: Body, image: &str) -> Result<(), ForeignBody> {
        let image = || image.to_owned();
        let of_body = i64::from(body.naif().body);
        if let Some(code) = self.target.filter(|code| *code != of_body) {
            let image = image();
            return Err(ForeignBody::Code { image, body, code });
        }
        let model = body.model();
        let expected_m = [model.equatorial_radius_m, model.polar_radius_m];
        let radii_m = self.radii_m;
        let mut apart_m = radii_m.iter().zip(expected_m).map(|(a, b)| (a - b).abs());
        if apart_m.any(|apart_m| apart_m > RADIUS_TOLERANCE_M) {
            let image = image();
            return Err(ForeignBody::Radii {
                image,
                body,
                radii_m,
            });
        }
        Ok(())
    }
}

impl SupportTables {
    /// The remark if the rotation in the file `name` at the instant `at` differs from the frame of products on `body`.
    #[must_use]
    pub fn frame_remark(&self, body: Body, name: &str, at: Et) -> Option<String> {
        let rotation = &self.body_rotation;
        let theirs = rotation.constant * rotation.at(at.seconds()).0;
        let ours = *body_rotation(body, at).matrix();
        let turn_rad = rotation_vector(&(theirs * ours.transpose())).norm();
        // Written so that NaN is remarked on too.
        if turn_rad <= body.rotation_tolerance_rad() {
            return None;
        }
        Some(format!(
            "the frame of {body} in the support data {name} is rotated by {:.1} m at the equator relative to {}; positions refer \
             to the frame of the support data",
            turn_rad * body.model().equatorial_radius_m,
            body.names().short_frame
        ))
    }
}
