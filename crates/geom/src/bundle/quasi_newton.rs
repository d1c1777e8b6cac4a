//! The curvature that Gauss–Newton steps omit, estimated from changes of the gradient.
//!
//! Gauss–Newton neglects the curvature of the observations times their residuals. For very many noisy ties that adds
//! up: along slow bends common to all images, which only the initial orientations constrain, it is as large as the
//! known information, of either sign. Steps then converge only slowly, and where the sign is negative they oscillate.
//! The change of the gradient from step to step shows this curvature.
//!
//! # Source
//! Nocedal 1980, Updating quasi-Newton matrices with limited storage; the equations of Gauss–Newton are its initial matrix.

use nalgebra::DVector;

use super::{factor::Factor, reduce::Settled};

/// Steps that are remembered.
const REMEMBERED: usize = 8;
/// A remembered step counts if the curvature along it is at least this share of the Gauss–Newton curvature.
const CURVATURE_MIN: f64 = 1e-3;
/// Steps are remembered where Gauss–Newton expects less than this relative decrease of the sum of squares: farther
/// away, the equations themselves change.
const NEAR: f64 = 1e-3;

/// Starting points of the last steps.
#[derive(Default)]
pub(super) struct QuasiNewton {
    /// Corrections of the shared unknowns, and the right-hand side there: the negative gradient.
    visited: Vec<(DVector<f64>, DVector<f64>)>,
}

impl QuasiNewton {
    /// The step from `now`, and whether it differs from the Gauss–Newton step.
    pub(super) fn step(&mut self, now: &Settled, factor: &Factor) -> (DVector<f64>, bool) {
        let right = &now.reduced.right;
        let step = factor.solve(right);
        if step.dot(right) > NEAR * now.reduced.cost {
            self.forget();
            return (step, false);
        }
        let corrections = now.at.state.corrections.clone();
        self.visited.push((corrections, right.clone()));
        if self.visited.len() > REMEMBERED + 1 {
            self.visited.remove(0);
        }
        let pairs = self.pairs(factor);
        if pairs.is_empty() {
            return (step, false);
        }
        let mut left = right.clone();
        let mut shares = Vec::with_capacity(pairs.len());
        for pair in pairs.iter().rev() {
            let share = pair.step.dot(&left) / pair.curvature;
            left -= &pair.change * share;
            shares.push(share);
        }
        let mut step = factor.solve(&left);
        for (pair, share) in pairs.iter().zip(shares.iter().rev()) {
            let taken = pair.change.dot(&step) / pair.curvature;
            step += &pair.step * (share - taken);
        }
        (step, true)
    }

    /// Forgets the former steps.
    pub(super) fn forget(&mut self) {
        self.visited.clear();
    }

    /// The steps with usable curvature, oldest first.
    fn pairs(&self, factor: &Factor) -> Vec<Pair> {
        let pairs = self.visited.windows(2).filter_map(|between| {
            let [(from, before), (to, after)] = between else {
                return None;
            };
            let (step, change) = (to - from, before - after);
            let curvature = step.dot(&change);
            let expected = change.dot(&factor.solve(&change));
            (curvature > CURVATURE_MIN * expected).then_some(Pair {
                step,
                change,
                curvature,
            })
        });
        pairs.collect()
    }
}

/// A step and the resulting change of the gradient.
struct Pair {
    step: DVector<f64>,
    change: DVector<f64>,
    /// Their product.
    curvature: f64,
}
