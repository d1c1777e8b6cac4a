//! Images with separate rows and plots on the page of a site: all of a few, and of many the most significant ones.
//!
//! The page of a site grows with the images that it shows, not with the number of images of the site. The files of each
//! image have the same numbers, and more of them.

use std::cmp::Ordering;

use super::site::{ImageProducts, SiteProducts};
use areograph_stages::adjust::PointKind;

/// Largest number of images with separate rows and plots: with tie points each has about 0.15 MB on the page, which stays
/// below 2 MB for any number of images.
pub const IMAGES_SHOWN: usize = 6;

/// Criteria for showing an image of many.
struct Rank {
    index: usize,
    is_invalid: bool,
    /// RMS of the residuals of its tie points, focal-plane pixels; 0 without any.
    ties_px: f64,
    /// Largest share of a limit of its polynomials.
    share: f64,
}

impl<'a> SiteProducts<'a> {
    /// Indices of the images with separate rows and plots, in the order of the site: all of at most [`IMAGES_SHOWN`];
    /// of more, first invalid images, then images with the largest tie point residuals, then images that use most of
    /// the limits of their polynomials.
    #[must_use]
    pub fn shown_images(&self) -> Vec<usize> {
        if self.images.len() <= IMAGES_SHOWN {
            return (0..self.images.len()).collect();
        }
        let ties_px = self.tie_rms_px();
        let adjusted = self.adjustment().map(|(_, adjustment)| adjustment.images);
        let ranks = self.images.iter().enumerate().map(|(index, image)| {
            let after = adjusted.and_then(|images| images.get(index));
            Rank {
                index,
                is_invalid: [Some(image), after].into_iter().flatten().any(is_invalid),
                ties_px: ties_px.get(index).copied().unwrap_or_default(),
                share: self.share_of_limits(image),
            }
        });
        let mut ranks: Vec<Rank> = ranks.collect();
        ranks.sort_by(Rank::compare);
        let shown = ranks.iter().take(IMAGES_SHOWN);
        let mut shown: Vec<usize> = shown.map(|rank| rank.index).collect();
        shown.sort_unstable();
        shown
    }

    /// RMS of the adjusted residuals of the tie points of every image, along and across the track together, focal-plane
    /// pixels; 0 for an image without any, and empty without an adjustment.
    #[must_use]
    pub fn tie_rms_px(&self) -> Vec<f64> {
        let Some((_, adjustment)) = self.adjustment() else {
            return Vec::new();
        };
        let mut sums = vec![(0.0, 0_usize); self.images.len()];
        let views = adjustment.adjusted.views.iter();
        for view in views.filter(|view| view.kind == PointKind::Tie) {
            if let Some((squares, count)) = sums.get_mut(view.image) {
                *squares += view.along_px.value.powi(2) + view.across_px.value.powi(2);
                *count += 1;
            }
        }
        let each = sums.into_iter();
        each.map(|(squares, count): (f64, usize)| (squares / count.max(1) as f64).sqrt())
            .collect()
    }

    /// Largest share of a limit that the polynomials of `image` use.
    fn share_of_limits(&self, image: &ImageProducts<'a>) -> f64 {
        let limits = &self.config.orientation;
        let position = image.model.second_order.position_rmse_m() / limits.position_rmse_max_m;
        let pointing = image.model.rotation_vector.rmse_rad() / limits.pointing_rmse_max_rad;
        position.max(pointing)
    }
}

fn is_invalid(image: &ImageProducts) -> bool {
    !image.invalid_because().is_empty()
}

impl Rank {
    /// The image that matters more comes first; equal ones stay in the order of the site.
    fn compare(&self, other: &Self) -> Ordering {
        let worse = other.is_invalid.cmp(&self.is_invalid);
        worse
            .then(other.ties_px.total_cmp(&self.ties_px))
            .then(other.share.total_cmp(&self.share))
            .then(self.index.cmp(&other.index))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn invalid_images_come_first_then_the_largest_residuals() {
        let rank = |index: usize, is_invalid: bool, ties_px: f64, share: f64| Rank {
            index,
            is_invalid,
            ties_px,
            share,
        };
        let mut ranks = [
            rank(0, false, 0.5, 0.9),
            rank(1, false, 0.5, 0.9),
            rank(2, false, 2.0, 0.1),
            rank(3, true, 0.0, 0.0),
            rank(4, false, 0.5, 1.0),
            rank(5, false, f64::NAN, 0.0),
        ];
        ranks.sort_by(Rank::compare);
        let order: Vec<usize> = ranks.iter().map(|rank| rank.index).collect();
        // NaN counts as the largest.
        assert_eq!(order, [3, 5, 2, 4, 0, 1]);
    }
}
