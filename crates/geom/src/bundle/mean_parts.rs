//! The error of the mean of the points with an observed height, by its causes.
//!
//! The mean is a linear function of all observations and a priori values. Those of different causes are independent, so that the
//! cofactors of their parts add up to those of the mean.

use nalgebra::{DMatrix, Matrix3, Matrix3xX, Vector3};

use super::{heights::Heights, layout::Layout, relative::Mean, unknowns::Unknown};

/// Cofactors of the mean of the points with an observed height due to some causes, m²; the rest of its cofactors is due to the other
/// observations: image coordinates, ranges, spots and given coordinates.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct MeanParts {
    /// A priori values of orientations, line times and the attitude clock, which the images of a mission phase have in common.
    pub orientations_m2: Matrix3<f64>,
    /// A priori values of the boresight angles of the laser.
    pub boresight_m2: Matrix3<f64>,
    /// Shifts of profiles, of each by itself.
    pub profiles_m2: Matrix3<f64>,
    /// The shift in plan that all profiles have in common, where relief is used; profiles whose shift is an unknown have none.
    pub frame_m2: Matrix3<f64>,
    /// Positions in plan of points and profiles on slopes, where relief does not determine them.
    pub slopes_m2: Matrix3<f64>,
    /// The ground between the shots, robust weights included.
    pub ground_m2: Matrix3<f64>,
}

impl MeanParts {
    pub(super) fn of<M>(layout: &Layout<'_, M>, heights: &Heights, mean: &Mean) -> Self {
        let mut parts = Self::default();
        parts.add_priors(layout, mean);
        parts.add_heights(heights, &mean.by_height());
        parts
    }

    /// Adds the parts of a priori values.
    fn add_priors<M>(&mut self, layout: &Layout<'_, M>, mean: &Mean) {
        let columns = &layout.columns;
        for (column, (unknown, sigma)) in columns.unknowns.iter().zip(&columns.sigmas).enumerate() {
            let part = match unknown {
                Unknown::Orientation { .. }
                | Unknown::TimeBias { .. }
                | Unknown::LineTime { .. }
                | Unknown::AttitudeClock => &mut self.orientations_m2,
                Unknown::ProfileShift { .. } => &mut self.profiles_m2,
                Unknown::Boresight { .. } => &mut self.boresight_m2,
                // It belongs to the ranges.
                Unknown::RangeBias { .. } => continue,
            };
            let terms = columns.prior_terms(column);
            let moves: Vector3<f64> = terms
                .map(|(term, factor)| factor * mean.with_unknown(term))
                .sum();
            // Of an unknown without an a priori value, 0.
            let moved_m = moves / *sigma;
            *part += moved_m * moved_m.transpose();
        }
    }

    /// Adds the parts of observed heights.
    ///
    /// * `gain` – change of the mean with each height, of either sign
    fn add_heights(&mut self, heights: &Heights, gain: &Matrix3xX<f64>) {
        let square = |covariance_m2: &DMatrix<f64>| -> Matrix3<f64> {
            gain * covariance_m2 * gain.transpose()
        };
        let surface = &heights.surface;
        let all_m2 = square(&heights.covariance_m2());
        let mut of_profiles_m2 = Matrix3::zeros();
        if let Some(relief) = &surface.relief {
            let is_unknown = |profile: usize| heights.shared.iter().any(|(of, _)| *of == profile);
            let mut moves = Matrix3xX::zeros(3 * relief.profiles.len());
            let mut together = Matrix3::zeros();
            for (at, profile) in relief.profiles.iter().enumerate() {
                if !is_unknown(profile.profile) {
                    let by_shift = gain * profile.by_shift.transpose();
                    moves.columns_mut(3 * at, 3).copy_from(&by_shift);
                    together += by_shift;
                }
            }
            of_profiles_m2 += &moves * &relief.covariance_m2 * moves.transpose();
            let in_plan = together.fixed_columns::<2>(0);
            self.frame_m2 = in_plan * in_plan.transpose() * relief.common_plan_m2;
        } else {
            let moves = gain * surface.radial_m.transpose();
            of_profiles_m2 += &moves * moves.transpose();
            self.slopes_m2 = square(&(&surface.covariance_m2 - &surface.without_plan_m2));
        }
        self.profiles_m2 += of_profiles_m2 - self.frame_m2;
        self.ground_m2 = all_m2 - of_profiles_m2 - self.slopes_m2;
    }
}
