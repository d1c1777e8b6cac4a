//! Shrinkage of a figure by two controls, and its correction.

use super::{Place, net::Net, similarity::Similarity, solve::Solution};

/// The effect of two controls on the figure between them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shrinkage {
    /// Distance of the controls as given, map units.
    pub given: f64,
    /// Computed over given distance.
    pub factor: f64,
    /// The factor predicted from the tie residuals.
    pub law: f64,
}

/// The factor by which two controls of equal `weight` shorten: `L'/L = 1 / (1 + 2T/(w L²))`.
///
/// Residuals of ties scale with the map and decrease as it shrinks, which only the equations of the controls resist.
/// `tie_squares` is `T`, the sum of squares of the ties when the controls are held exactly, `distance` is `L`. The
/// controls move inward along their line, each by `(L − L')/2`.
///
/// # Source
/// The effect: Arthur & McMacken 1977, who observed it; the law follows from the ties being homogeneous in the
/// unknowns.
#[must_use]
pub fn shrinkage_factor(tie_squares: f64, distance: f64, weight: f64) -> f64 {
    1.0 / (1.0 + 2.0 * tie_squares / (weight * distance * distance))
}

impl Shrinkage {
    /// The shrinkage of a net with exactly two controls; `None` for others.
    #[must_use]
    pub fn of(net: &Net, solution: &Solution) -> Option<Self> {
        let [first, second] = net.controls[..] else {
            return None;
        };
        let computed = [first, second].map(|control| solution.places[control.point]);
        let [Some(one), Some(two)] = computed else {
            return None;
        };
        let given = (second.at - first.at).norm();
        let factor = (two - one).norm() / given;
        // Two springs in a row; half of one weight when both are equal.
        let weight = 2.0 / (1.0 / first.weight + 1.0 / second.weight);
        let held = solution.tie_squares() / factor.powi(2);
        Some(Self {
            given,
            factor,
            law: shrinkage_factor(held, given, weight),
        })
    }
}

impl Solution {
    /// The figure with its two controls at their given positions: the solution that holds them exactly. A net with
    /// any other number of controls is unchanged.
    #[must_use]
    pub fn unshrunk(mut self, net: &Net) -> Self {
        let [first, second] = net.controls[..] else {
            return self;
        };
        let (Some(one), Some(two)) = (self.places[first.point], self.places[second.point]) else {
            return self;
        };
        let turn = (second.at - first.at) / (two - one);
        let back = Similarity {
            turn,
            shift: first.at - turn * one,
        };
        for picture in &mut self.pictures {
            *picture = back.after(picture);
        }
        for place in self.places.iter_mut().flatten() {
            *place = back.map(*place);
        }
        for deviation in &mut self.deviations {
            *deviation *= turn;
        }
        for residual in self.control_residuals.iter_mut().flatten() {
            *residual = Place::new(0.0, 0.0);
        }
        self
    }
}
