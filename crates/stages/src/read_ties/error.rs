//! Tie points that do not belong to the images.

use super::{Ties, repeats::SharedPlaces};
use crate::tag_times::ImageTimes;
use areograph_base::{
    error::Cause,
    ties::{TieMeasure, TiePoint},
};
use areograph_config::ImageConfig;

/// Names of foreign images that a message quotes.
const NAMES_QUOTED: usize = 5;

/// Tie points that belong to other images.
#[derive(Debug, thiserror::Error, Cause)]
#[cause(Input)]
pub(super) enum TiesError {
    #[error("the tie point files contain no measurement")]
    #[cause("give files with measurements in ties.files")]
    Empty,
    #[error("none of the {points} tie points is measured in two images of the site")]
    #[cause("measure tie points in at least two images, or omit the table [ties]")]
    NoneJoins { points: usize },
    #[error("tie points are measured in {found}; expected images of the site: {expected}")]
    #[cause("set images.serial_number of each image to its name in the file")]
    NoImage { found: String, expected: String },
    #[error("tie points: {0}; expected at most half of the points at shared positions")]
    #[cause("each image position belongs to one tie point: check the source of the table")]
    SharedPlaces(SharedPlaces),
    #[error("{0}")]
    #[cause(
        "measure tie points in the delivered file, whose first line and sample begin at 0; check lines_delivered if it \
         is set"
    )]
    Outside(Outside),
}

/// Measurements outside the delivered image. They were made in another file, so that those inside may be displaced too.
#[derive(Debug, thiserror::Error)]
#[error(
    "image {image}: {count} of {all} measurements lie outside the delivered image, for example tie point {point} at \
     line {line:.2}, sample {sample:.2}; expected lines 0 to {lines} and samples 0 to {samples}"
)]
pub(super) struct Outside {
    image: String,
    count: usize,
    all: usize,
    point: String,
    line: f64,
    sample: f64,
    lines: u32,
    samples: u32,
}

impl Outside {
    /// The measurements of `points` in the image with this index that lie outside it, if any do.
    pub(super) fn of(points: &[TiePoint], index: usize, times: &ImageTimes) -> Option<Self> {
        let (lines, samples) = (times.lines_delivered, times.samples);
        let within = |measure: &TieMeasure| {
            (0.0..=f64::from(lines)).contains(&measure.line)
                && (0.0..=f64::from(samples)).contains(&measure.sample)
        };
        let measures = points.iter().flat_map(|point| {
            let measures = point.measures.iter();
            measures
                .filter(|measure| measure.image == index)
                .map(move |measure| (point, measure))
        });
        let all = measures.clone().count();
        let mut outside = measures.filter(|(_, measure)| !within(measure));
        let (point, measure) = outside.next()?;
        Some(Self {
            image: times.id.clone(),
            count: 1 + outside.count(),
            all,
            point: point.id.clone(),
            line: measure.line,
            sample: measure.sample,
            lines,
            samples,
        })
    }
}

pub(super) fn nothing_found(read: &Ties, images: &[ImageConfig]) -> TiesError {
    if read.elsewhere.is_empty() {
        return TiesError::Empty;
    }
    let mut found: Vec<&str> = read.elsewhere.keys().map(String::as_str).collect();
    let more = found.len().saturating_sub(NAMES_QUOTED);
    found.truncate(NAMES_QUOTED);
    let more = match more {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    let names: Vec<&str> = images.iter().map(ImageConfig::name_in_ties).collect();
    TiesError::NoImage {
        found: found.join(", ") + &more,
        expected: names.join(", "),
    }
}
