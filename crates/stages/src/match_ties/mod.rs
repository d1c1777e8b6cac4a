//! Tie points that areograph measures itself.
//!
//! The common ground of every pair of images with pixels is divided into cells, and has further cells at the laser shots. In each, the place with the most
//! texture is searched in the other image: at the position and with the distortion that orientations and MOLA heights
//! predict, within their stated uncertainty, which is long along the epipolar curve where the height is uncertain.
//! Correlation proceeds from coarse to fine, least squares refines it, and the search is repeated from the other image.
//! Ambiguous or flat places and those that differ in the two directions are counted and left out; blunders are left to
//! the adjustment.
//!
//! Tie points belong to one pass: places, margins and standard deviations follow from one orientation. The second pass
//! sees only the adjusted orientation of the first and matches all cells anew. The pixels of an image are in a
//! temporary file with their halvings (`pds/pixel_file/pyramid`), so that memory does not grow with the image.

mod cells;
mod lines;
mod margin;
mod pair;
mod search;

#[cfg(test)]
mod tests;

use std::{collections::BTreeMap, sync::atomic::AtomicBool};

use self::pair::{Matched, match_pair};
use super::{
    convert_datum::Converted, group_profiles::Profile, image_pixels::PixelFiles, image_view::View,
    oriented::OrientedImage, read_ties::Ties, shot_heights::Heights, site_image::SiteImages,
    tag_times::ImageTimes,
};
use areograph_base::{
    error::{Cause, Result},
    ties::{MatchedPair, TieMeasure, TiePoint},
    watch::Watch,
};
use areograph_geom::pushbroom::Unseen;
use areograph_store::{
    stage::{Input, Inputs, Output, Round, Stage},
    stage_inputs,
};

pub use lines::{MatchLines, TiesOfLines};
pub use margin::Margin;

/// A pair with fewer tie points gets a remark.
const FEW_TIES: u32 = 60;
/// Share of the parts of the common ground without a tie point above which a remark states it.
const EMPTY_PARTS_MAX: f64 = 0.25;

stage_inputs! {
    /// Images with one orientation and their pixels, known heights, and the tie points of files.
    pub struct MatchTies<'a> {
        /// Round of the orientation.
        pub round: Round,
        /// The images.
        pub images: SiteImages<'a>,
        /// Their pixels.
        pub pixels: PixelFiles<'a>,
        /// Footprints in IAU 2000.
        pub converted: &'a Output<Converted>,
        /// Profiles.
        pub profiles: &'a Output<Vec<Profile>>,
        /// Uncertainty of the orientations.
        pub margin: &'a Margin,
        /// Tie points that were read.
        pub read: TiesOfFiles<'a>,
    }
}

/// The tie points of files, where there are some.
#[derive(Debug)]
pub struct TiesOfFiles<'a>(pub Option<&'a Output<Ties>>);

impl Input for TiesOfFiles<'_> {
    fn add_to(&self, field: &str, inputs: &mut Inputs) {
        if let Some(ties) = self.0 {
            ties.add_to(field, inputs);
        }
    }
}

/// A failed match.
#[derive(Debug, thiserror::Error, Cause)]
#[cause(Input)]
enum MatchError {
    #[error("image {image} shows no ground according to its orientation: {unseen}")]
    #[cause("check that the site's images overlap, and check their kernels and times")]
    Unseen { image: String, unseen: Unseen },
    #[error("no two images with pixels show the same ground according to their orientation")]
    #[cause(like = Unseen)]
    NothingInCommon,
    #[error("no tie point was found: {0}")]
    #[cause(
        "check that images.pixels belong to these images and show the same ground; if orientation errors exceed the \
         search margin, check start times, or give larger standard deviations in [adjustment]"
    )]
    NothingMatched(String),
}

impl Stage for MatchTies<'_> {
    const NAME: &'static str = "match_ties";
    const METHOD: u32 = 4;
    type Output = Ties;
    stage_inputs!(fingerprint);

    fn part(&self) -> Option<String> {
        self.round.part()
    }

    fn run(&self, stop: &AtomicBool) -> Result<Ties> {
        self.run_watched(stop.into())
    }

    fn run_watched(&self, watch: Watch<'_>) -> Result<Ties> {
        let oriented = self.images.oriented()?;
        let times = self.images.0.iter().map(|image| image.times.value());
        let times: Vec<&ImageTimes> = times.collect::<Result<_>>()?;
        let pixels = self.pixels.decoded(&times)?;
        let mut views = Vec::new();
        for (index, (image, pixels)) in oriented.iter().zip(&pixels).enumerate() {
            if let Some(pixels) = pixels {
                let view = View::of(image, pixels).map_err(|unseen| {
                    let image = image.image.id.clone();
                    MatchError::Unseen { image, unseen }
                })?;
                views.push((index, view));
            }
        }
        let heights = Heights::of(&self.converted.value()?.footprints, self.profiles.value()?);
        let mut matched = Vec::new();
        for (at, first) in views.iter().enumerate() {
            for second in &views[at + 1..] {
                matched.extend(match_pair([first, second], &heights, self.margin, watch)?);
            }
        }
        let read = self.read.0.map(|read| read.value()).transpose()?;
        joined(read.cloned().unwrap_or_default(), matched, &oriented)
    }

    /// The pixels are opened, not decoded.
    fn examine(&self) -> Vec<Result<String>> {
        let opened = self.pixels.examined(self.images.0);
        let opened = opened.map(|(times, file)| {
            let file = file?;
            Ok(format!(
                "image {}: {} lines of {} samples to be matched",
                times.id,
                file.lines(),
                file.samples()
            ))
        });
        let mut examined: Vec<_> = opened.collect();
        let times: Option<Vec<_>> = self
            .images
            .0
            .iter()
            .map(|image| image.times.get())
            .collect();
        if let Some(times) = times
            && examined.iter().all(Result::is_ok)
            && let Err(failure) = self.pixels.of_distinct_images(&times)
        {
            examined.push(Err(failure));
        }
        examined
    }
}

/// The tie points of files, followed by those that were matched.
fn joined(mut ties: Ties, matched: Vec<Matched>, images: &[OrientedImage<'_>]) -> Result<Ties> {
    if matched.is_empty() {
        if ties.points.is_empty() {
            return Err(MatchError::NothingInCommon.into());
        }
        ties.remarks.push(MatchError::NothingInCommon.to_string());
    }
    let name = |index: usize| images.get(index).map_or("", |image| &*image.image.id);
    for of_pair in &matched {
        ties.remarks.extend(remarks(&of_pair.account, name));
    }
    if ties.points.is_empty() && matched.iter().all(|of_pair| of_pair.ties.is_empty()) {
        return Err(MatchError::NothingMatched(ties.remarks.join("; ")).into());
    }
    ties.read = ties.points.len();
    ties.points.extend(points(&matched));
    ties.matched = matched.into_iter().map(|of_pair| of_pair.account).collect();
    Ok(ties)
}

/// One point for every place of an image that was found in others; where several pairs measured a place of their first
/// image, the largest standard deviations apply.
fn points(matched: &[Matched]) -> Vec<TiePoint> {
    let mut known: BTreeMap<(usize, u64, u64), usize> = BTreeMap::new();
    let mut points: Vec<TiePoint> = Vec::new();
    for [first, second] in matched.iter().flat_map(|of_pair| &of_pair.ties) {
        let place = (first.image, first.line.to_bits(), first.sample.to_bits());
        let at = *known.entry(place).or_insert(points.len());
        if let Some(point) = points.get_mut(at) {
            let earlier = &mut point.measures[0];
            earlier.sigma_px = larger(earlier, first);
            point.measures.push(second.clone());
        } else {
            points.push(TiePoint {
                id: format!("matched-{:04}", at + 1),
                known: None,
                measures: vec![first.clone(), second.clone()],
            });
        }
    }
    points
}

fn larger(one: &TieMeasure, other: &TieMeasure) -> Option<[f64; 2]> {
    let (one, other) = (one.sigma_px?, other.sigma_px?);
    Some([one[0].max(other[0]), one[1].max(other[1])])
}

/// Remarks on a pair, one sentence each.
fn remarks<'a>(pair: &MatchedPair, name: impl Fn(usize) -> &'a str) -> Vec<String> {
    let [first, second] = pair.images.map(name);
    let mut remarks = Vec::new();
    if pair.is_refused {
        remarks.push(format!(
            "images {first} and {second}: {} of {} cells match within {:.0} m of their expected positions, too few to \
             be significant; none is used ({})",
            pair.ties,
            pair.cells,
            pair.reach_m,
            pair.reasons()
        ));
        return remarks;
    }
    if pair.ties < FEW_TIES {
        remarks.push(format!(
            "images {first} and {second}: only {} of {} cells match ({})",
            pair.ties,
            pair.cells,
            pair.reasons()
        ));
    }
    let [parts, with_ties] = pair.parts;
    if f64::from(parts - with_ties) > EMPTY_PARTS_MAX * f64::from(parts) {
        remarks.push(format!(
            "images {first} and {second}: no tie point in {} of the {parts} parts of their common ground",
            parts - with_ties
        ));
    }
    remarks
}
