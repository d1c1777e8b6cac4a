//! Scatter of tie points beyond their standard deviations: jitter of the images, which no polynomial of the orientation follows.
//!
//! Matching states how well two patches fit, to 0.04–0.12 pixels; attitude jitter of 1–5 µrad moves both by 0.2–0.4 pixels.
//! Without a place for it, good tie points are rejected as blunders, and heights are stated too precisely. The scatter is the
//! same for all measurements; residuals along the track determine it. Across the track nothing does, because heights absorb
//! errors there; jitter in roll and pitch is independent, so that the expected variance there is larger than the one found.

use nalgebra::Vector2;

use super::{network::Assembled, summary::AdjustmentSummary};
use areograph_geom::{
    bundle::{Adjustment, Residual},
    statistics::{NORMAL_MAD, median},
};

/// Relative standard deviation of a standard deviation from such a median of n values, times √n.
const OF_MEDIAN: f64 = 1.17;
/// A scatter is significant beyond this many of these.
const BY_CHANCE: f64 = 2.0;
/// Expected variance across the track over the one found along it. For sinusoids of roll and pitch with independent amplitudes,
/// uniform in their logarithm from a to 5 a, E\[roll²\] E\[1/pitch²\] is 2.2; of several sinusoids it is smaller.
const ACROSS: f64 = 2.0;
/// Fewest residuals that determine a scatter.
const RESIDUALS_MIN: usize = 40;
/// Residuals with less redundancy hardly show an error.
const REDUNDANCY_MIN: f64 = 0.05;
/// Largest scatter that may be jitter, focal-plane pixels: 5 µrad are 1.4 pixels of the narrow-angle camera.
pub(super) const SCATTER_MAX_PX: f64 = 1.5;
/// Halvings of the interval in which the scatter is searched: to 1e-6 pixels.
const HALVINGS: u32 = 21;

/// Standard deviation of the scatter of tie points beyond their own standard deviations, focal-plane pixels, from residuals along the track;
/// 0 where chance explains them.
///
/// The median of the standardised residuals resists blunders. At most [`SCATTER_MAX_PX`].
pub(super) fn tie_scatter_px<M>(assembled: &Assembled<M>, adjustment: &Adjustment) -> f64 {
    let views = assembled.network.views.iter().zip(&adjustment.views);
    let ties = views.filter(|(view, _)| view.point >= assembled.shots);
    let along: Vec<Residual> = ties
        .filter_map(|(_, residuals)| residuals.map(|[along, _]| along))
        .filter(|along| along.redundancy > REDUNDANCY_MIN)
        .collect();
    if along.len() < RESIDUALS_MIN {
        return 0.0;
    }
    // Factor of the standard deviations that a scatter leaves over.
    let left = |scatter_px: f64| {
        let mut sizes: Vec<f64> = along
            .iter()
            .map(|of| of.value.abs() / (of.redundancy.sqrt() * of.sigma.hypot(scatter_px)))
            .collect();
        NORMAL_MAD * median(&mut sizes)
    };
    // Two measurements of a point share one residual.
    let free = 0.5 * along.len() as f64;
    if left(0.0) <= 1.0 + BY_CHANCE * OF_MEDIAN / free.sqrt() {
        return 0.0;
    }
    let [mut low_px, mut high_px] = [0.0, SCATTER_MAX_PX];
    for _ in 0..HALVINGS {
        let middle_px = 0.5 * (low_px + high_px);
        if left(middle_px) > 1.0 {
            low_px = middle_px;
        } else {
            high_px = middle_px;
        }
    }
    high_px
}

/// Scatter along the track and the one expected across it, focal-plane pixels.
fn of_axes_px(scatter_px: f64) -> Vector2<f64> {
    let across_px = (ACROSS.sqrt() * scatter_px).min(SCATTER_MAX_PX);
    Vector2::new(scatter_px, across_px)
}

impl AdjustmentSummary {
    /// Scatter of tie points along the track and the one expected across it, focal-plane pixels; 0 where there is none.
    #[must_use]
    pub fn tie_scatter_of_axes_px(&self) -> [f64; 2] {
        of_axes_px(self.tie_scatter_px).into()
    }
}

impl<M> Assembled<M> {
    /// Adds a scatter along the track, focal-plane pixels, to the one so far, and adds both to the standard deviations of all
    /// measurements of tie points, with the one expected across the track.
    pub(super) fn scatter_ties(&mut self, scatter_px: f64) {
        let total_px = self.tie_scatter_px.hypot(scatter_px).min(SCATTER_MAX_PX);
        let [before_px, after_px] = [self.tie_scatter_px, total_px].map(of_axes_px);
        let added_px2 = after_px.component_mul(&after_px) - before_px.component_mul(&before_px);
        let shots = self.shots;
        let ties = self
            .network
            .views
            .iter_mut()
            .filter(|view| view.point >= shots);
        for view in ties {
            view.sigma_px = view.sigma_px.zip_map(&added_px2, |sigma_px, added_px2| {
                (sigma_px * sigma_px + added_px2).sqrt()
            });
        }
        self.tie_scatter_px = total_px;
    }
}
