//! Tie points: points on the ground that were measured in several images.

mod matching;

use nalgebra::Matrix3;
use serde::{Deserialize, Serialize};

use crate::{
    error::Cause,
    frames::{BodyFixed, Position},
};

pub use matching::{MatchedPair, Unmatched, reasons};

/// A point measured in images.
///
/// Its measurements name their images by `I`: the text of a file, or the index among a site's images.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TiePoint<I = usize> {
    /// Identifier in its file.
    pub id: String,
    /// Its ground coordinates, if known a priori.
    pub known: Option<KnownGround>,
    /// Its measurements.
    pub measures: Vec<TieMeasure<I>>,
}

/// A priori ground coordinates of a point.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct KnownGround {
    /// Its position.
    pub ground: Position<BodyFixed>,
    /// Covariance of its coordinates, m²; `None` if they are held fixed.
    pub covariance_m2: Option<Matrix3<f64>>,
}

/// One measurement.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TieMeasure<I = usize> {
    /// The image as the file names it (an identifier, or an ISIS serial number), or its index.
    pub image: I,
    /// Line in the complete image, 0 at the outer edge of the first line and 0.5 at its middle.
    pub line: f64,
    /// Sample, 0 at the outer edge of the first pixel and 0.5 at its middle.
    pub sample: f64,
    /// Standard deviations of line and sample, if the file states them, lines and pixels of the image.
    pub sigma_px: Option<[f64; 2]>,
}

impl TiePoint<String> {
    /// The point with the indices that `index_of` gives for the names of its images; unknown names go to `unknown`,
    /// and their measurements are left out.
    pub fn in_images(
        self,
        index_of: impl Fn(&str) -> Option<usize>,
        mut unknown: impl FnMut(String),
    ) -> TiePoint {
        let mut measures = Vec::with_capacity(self.measures.len());
        for TieMeasure {
            image,
            line,
            sample,
            sigma_px,
        } in self.measures
        {
            match index_of(&image) {
                Some(image) => measures.push(TieMeasure {
                    image,
                    line,
                    sample,
                    sigma_px,
                }),
                None => unknown(image),
            }
        }
        TiePoint {
            id: self.id,
            known: self.known,
            measures,
        }
    }
}

/// A measurement belongs to an image that does not exist.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error, Cause)]
#[error(
    "tie point {tie} is measured in image {image}, counted from 0; expected an image below {images}"
)]
#[cause(Bug: "report this with the site's configuration and the log")]
pub struct UnknownImage {
    /// Identifier of the tie point.
    pub tie: String,
    /// Index of the image.
    pub image: usize,
    /// Number of images.
    pub images: usize,
}

/// Ensures that every measurement belongs to one of `images` images.
///
/// # Errors
/// The first measurement that does not.
pub fn require_images(ties: &[TiePoint], images: usize) -> Result<(), UnknownImage> {
    let measures = ties
        .iter()
        .flat_map(|tie| tie.measures.iter().map(move |measure| (tie, measure.image)));
    for (tie, image) in measures {
        if image >= images {
            return Err(UnknownImage {
                tie: tie.id.clone(),
                image,
                images,
            });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_become_indices_and_an_index_without_an_image_is_reported() {
        let measure = |image: &str| TieMeasure {
            image: image.to_owned(),
            line: 1.0,
            sample: 2.0,
            sigma_px: None,
        };
        let tie = TiePoint {
            id: "t1".to_owned(),
            known: None,
            measures: vec![measure("B"), measure("elsewhere"), measure("A")],
        };
        let mut unknown = Vec::new();
        let index_of = |name: &str| ["A", "B"].iter().position(|known| *known == name);
        let tie = tie.in_images(index_of, |name| unknown.push(name));
        let images: Vec<usize> = tie.measures.iter().map(|measure| measure.image).collect();
        assert_eq!(
            (images, unknown),
            (vec![1, 0], vec!["elsewhere".to_owned()])
        );
        let ties = [tie];
        assert_eq!(require_images(&ties, 2), Ok(()));
        assert_eq!(
            require_images(&ties, 1).unwrap_err().to_string(),
            "tie point t1 is measured in image 1, counted from 0; expected an image below 1"
        );
    }
}
