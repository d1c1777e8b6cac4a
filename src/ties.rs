//! Tie points: places on the ground that were measured in several images.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::error::{Fault, Kind};

/// A point measured in images; its ground coordinates are not known.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TiePoint {
    /// Identifier in its file.
    pub id: String,
    /// Its measurements.
    pub measures: Vec<TieMeasure>,
}

/// One measurement.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TieMeasure {
    /// The image as the file names it: an identifier, or an ISIS serial number.
    pub image: String,
    /// Line in the whole image, 0 at the outer edge of the first line and 0.5 at its middle.
    pub line: f64,
    /// Sample, 0 at the outer edge of the first pixel and 0.5 at its middle.
    pub sample: f64,
}

/// A measurement names an image that is not there.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("tie point {tie} is measured in {image}, which is none of the images {known}")]
pub struct UnknownImage {
    /// Identifier of the tie point.
    pub tie: String,
    /// The name.
    pub image: String,
    /// The names that are known.
    pub known: String,
}

impl Fault for UnknownImage {
    fn kind(&self) -> Kind {
        Kind::Input
    }

    fn advice(&self) -> String {
        "give the images the names of the tie point file (serial numbers in an ISIS network), or leave those measurements out"
            .to_owned()
    }
}

/// Index of the image of each measurement of each tie point.
///
/// # Errors
/// The first measurement in an image that is not among `images`.
pub fn image_indices(images: &[&str], ties: &[TiePoint]) -> Result<Vec<Vec<usize>>, UnknownImage> {
    let index: BTreeMap<&str, usize> = images.iter().copied().zip(0..).collect();
    let of_measure = |tie: &TiePoint, measure: &TieMeasure| {
        let found = index.get(measure.image.as_str()).copied();
        found.ok_or_else(|| UnknownImage {
            tie: tie.id.clone(),
            image: measure.image.clone(),
            known: images.join(", "),
        })
    };
    ties.iter()
        .map(|tie| {
            tie.measures
                .iter()
                .map(|measure| of_measure(tie, measure))
                .collect()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_measurement_in_an_unknown_image_is_named() {
        let measure = |image: &str| TieMeasure {
            image: image.to_owned(),
            line: 1.0,
            sample: 2.0,
        };
        let tie = TiePoint {
            id: "t1".to_owned(),
            measures: vec![measure("B"), measure("A")],
        };
        let ties = [tie];
        assert_eq!(image_indices(&["A", "B"], &ties), Ok(vec![vec![1, 0]]));
        let unknown = image_indices(&["B", "C"], &ties).unwrap_err();
        assert_eq!(
            unknown.to_string(),
            "tie point t1 is measured in A, which is none of the images B, C"
        );
    }
}
