//! The part of the camera's image that a cube shows: group `AlphaCube`.
//!
//! Alpha lines and samples count in the image as the camera took it, beta lines and samples in this cube before any map
//! projection. Both count from 1 at the centre of the first one; edges lie at 0.5.
//!
//! # Source
//! `AlphaCube` of ISIS (class documentation).

use super::{error::CubeError, label_text};
use crate::label::Label;

const GROUP: &str = "ALPHACUBE";
/// Tolerance of whole numbers of lines, samples and factors: ISIS writes them with more digits.
const WHOLE: f64 = 1e-6;
/// Lines and samples beyond every camera.
const SIZE_MAX: f64 = 1e7;

/// One axis of a part, lines or samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PartOfAxis {
    /// Number in the image as taken.
    pub whole: u32,
    /// The first one of the part, counted from 0.
    pub first: u32,
    /// Number of the image that become one of the part.
    pub factor: u32,
    /// Number in the part.
    pub count: u32,
}

/// The part of the camera's image that a cube shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Part {
    /// Lines.
    pub lines: PartOfAxis,
    /// Samples.
    pub samples: PartOfAxis,
}

impl PartOfAxis {
    /// A complete axis.
    const fn all(count: u32) -> Self {
        Self {
            whole: count,
            first: 0,
            factor: 1,
            count,
        }
    }

    /// Whether it is complete, at full size.
    #[must_use]
    pub const fn is_whole(&self) -> bool {
        self.first == 0 && self.factor == 1 && self.count == self.whole
    }

    fn of(
        label: &Label,
        [whole, starting, ending, beta]: [&'static str; 4],
    ) -> Result<Self, CubeError> {
        let refused = |key: &'static str, value: String, expected: &str| CubeError::Label {
            group: "AlphaCube",
            key,
            value,
            expected: expected.to_owned(),
        };
        let number = |key: &'static str| {
            let text = label_text(label, GROUP, key).unwrap_or_default();
            let number = text.parse().ok();
            number
                .filter(|number: &f64| (0.0..=SIZE_MAX).contains(number))
                .ok_or_else(|| {
                    refused(
                        key,
                        text.to_owned(),
                        "a number from 0 to the largest image size",
                    )
                })
        };
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "within the size of an image, as checked above"
        )]
        let whole_number = |key: &'static str, value: f64, least: f64, expected: &str| {
            let rounded = value.round();
            if (value - rounded).abs() <= WHOLE && rounded >= least {
                Ok(rounded as u32)
            } else {
                Err(refused(key, value.to_string(), expected))
            }
        };
        let size = whole_number(whole, number(whole)?, 1.0, "a count from 1")?;
        let count = whole_number(beta, number(beta)?, 1.0, "a count from 1")?;
        let (start, end) = (number(starting)?, number(ending)?);
        let factor = (end - start) / f64::from(count);
        let factor = whole_number(
            ending,
            factor,
            1.0,
            "a whole number of image lines or samples per line or sample of the cube: enlarged and unevenly reduced cubes \
             contain no camera lines",
        )?;
        let first = whole_number(
            starting,
            start - 0.5,
            0.0,
            "an edge of a line or sample of the image",
        )?;
        if end > f64::from(size) + 0.5 + WHOLE {
            return Err(refused(ending, end.to_string(), "an edge within the image"));
        }
        Ok(Self {
            whole: size,
            first,
            factor,
            count,
        })
    }
}

impl Part {
    /// All of `[lines, samples]`.
    pub(super) const fn all([lines, samples]: [u32; 2]) -> Self {
        Self {
            lines: PartOfAxis::all(lines),
            samples: PartOfAxis::all(samples),
        }
    }

    /// The part that a label states; without the group, all of `[lines, samples]`.
    pub(super) fn of(label: &Label, size: [u32; 2]) -> Result<Self, CubeError> {
        if !label.entries.iter().any(|entry| entry.group == GROUP) {
            return Ok(Self::all(size));
        }
        let axis = |keys| PartOfAxis::of(label, keys);
        Ok(Self {
            lines: axis([
                "ALPHALINES",
                "ALPHASTARTINGLINE",
                "ALPHAENDINGLINE",
                "BETALINES",
            ])?,
            samples: axis([
                "ALPHASAMPLES",
                "ALPHASTARTINGSAMPLE",
                "ALPHAENDINGSAMPLE",
                "BETASAMPLES",
            ])?,
        })
    }
}
