//! Outcome of matching for the points that were tried.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// Why a point of one image has no tie point in another.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, thiserror::Error,
)]
#[serde(rename_all = "snake_case")]
pub enum Unmatched {
    /// Noise alone would produce such gradients.
    #[error("no texture beyond the noise")]
    Flat,
    /// Pixels that were never received, or may be invalid.
    #[error("lines are missing or damaged")]
    Missing,
    /// A template or its search area extends over an edge.
    #[error("too close to the edge of an image")]
    Edge,
    /// Nothing within the margin is similar.
    #[error("no correlation within the margin")]
    Unlike,
    /// The match is ambiguous.
    #[error("another position correlates nearly as well")]
    Ambiguous,
    /// Least squares diverges, or does not end.
    #[error("least squares does not converge")]
    Unsettled,
    /// The search from the other image fails, or leads to another point.
    #[error("the search from the other image finds a different position")]
    OneWay,
    /// Found, but with insufficient accuracy.
    #[error("the standard deviation is too large")]
    Uncertain,
    /// A cell of a terrain model that contradicts most neighbouring cells.
    #[error("its height differs from those of most neighbouring cells")]
    Alone,
}

/// A pair of images, and the outcome for the ground that both show.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MatchedPair {
    /// Indices of the images; templates come from the first.
    pub images: [usize; 2],
    /// Cells of the ground that both show; one point was tried in each.
    pub cells: u32,
    /// Tie points.
    pub ties: u32,
    /// The other cells by reason.
    pub unmatched: BTreeMap<Unmatched, u32>,
    /// Parts of the common ground: those that have cells, and of these those with a tie point.
    pub parts: [u32; 2],
    /// Search distance from the predicted position, metres on the ground.
    pub reach_m: f64,
    /// Median standard deviation of a tie point in the second image, lines and samples.
    pub sigma_px: [f64; 2],
    /// Median correlation.
    pub correlation: f64,
    /// Whether too few points were found to be significant.
    pub is_refused: bool,
}

impl Unmatched {
    /// The reason as one word, for documents.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Flat => "flat",
            Self::Missing => "missing",
            Self::Edge => "edge",
            Self::Unlike => "unlike",
            Self::Ambiguous => "ambiguous",
            Self::Unsettled => "unsettled",
            Self::OneWay => "one_way",
            Self::Uncertain => "uncertain",
            Self::Alone => "alone",
        }
    }
}

impl MatchedPair {
    /// Points with texture that were searched in the other image.
    #[must_use]
    pub fn searched(&self) -> u32 {
        let not_searched = [Unmatched::Flat, Unmatched::Missing, Unmatched::Edge];
        let not_searched = not_searched
            .iter()
            .filter_map(|why| self.unmatched.get(why));
        self.cells - not_searched.sum::<u32>()
    }

    /// Why cells have no tie point, the most frequent reason first.
    #[must_use]
    pub fn reasons(&self) -> String {
        reasons(&self.unmatched)
    }
}

/// Reasons with their counts, the most frequent first.
#[must_use]
pub fn reasons(counted: &BTreeMap<Unmatched, u32>) -> String {
    let mut reasons: Vec<(&Unmatched, &u32)> = counted.iter().collect();
    reasons.sort_by_key(|(_, count)| std::cmp::Reverse(**count));
    let reasons = reasons.iter().map(|(why, count)| format!("{count}: {why}"));
    reasons.collect::<Vec<_>>().join("; ")
}
