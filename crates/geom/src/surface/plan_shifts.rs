//! Shifts of profiles in plan, all together, as their crossovers leave them.
//!
//! A shift on slopes changes the height of a profile at its crossovers. The differences between the shifts of crossing
//! profiles are therefore known, and profiles far from a place support those near it.

use nalgebra::{DMatrix, DVector, Vector2};

use super::SurfaceShot;
use crate::ellipsoid::local_axes;

/// Standard deviation of a shift in plan on an axis that all profiles share, metres: crossovers do not show it, and the scatter of
/// shifts does not contain it. A choice, a quarter of the horizontal accuracy of MOLA (100 m, Neumann et al. 2001). Without it, errors of positions by 60
/// profiles exceeded their stated standard deviations by up to a half.
pub(super) const COMMON_M: f64 = 25.0;

/// Offsets of recorded profiles from their true positions in plan, with the covariance of their errors. By default, nothing is
/// known of any.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PlanShifts {
    /// Profiles with crossovers, ascending.
    profiles: Vec<usize>,
    /// East and north of each profile, metres.
    shifts_m: DVector<f64>,
    /// Covariance of these, m².
    covariance_m2: DMatrix<f64>,
}

impl PlanShifts {
    /// Shifts of `profiles`, ascending: two rows for each.
    pub(super) const fn new(
        profiles: Vec<usize>,
        shifts_m: DVector<f64>,
        covariance_m2: DMatrix<f64>,
    ) -> Self {
        Self {
            profiles,
            shifts_m,
            covariance_m2,
        }
    }

    /// Offset of the record of a profile to the east and north of its true position, metres; 0 without crossovers.
    #[must_use]
    pub fn shift_m(&self, profile: usize) -> Vector2<f64> {
        self.row(profile).map_or_else(Vector2::zeros, |row| {
            Vector2::new(self.shifts_m[row], self.shifts_m[row + 1])
        })
    }

    /// The shots without these offsets.
    pub(super) fn removed_from(&self, shots: &[SurfaceShot]) -> Vec<SurfaceShot> {
        let moved = shots.iter().map(|shot| {
            let shift_m = self.shift_m(shot.profile);
            let axes = local_axes(&shot.ground_m);
            let aside_m = axes.tr_mul(&shift_m.push(0.0));
            // The radius stays: 100 m in plan change it by 1.5 mm.
            let direction = (shot.ground_m - aside_m).normalize();
            SurfaceShot {
                ground_m: direction * shot.ground_m.norm(),
                ..*shot
            }
        });
        moved.collect()
    }

    /// Covariance of the remaining shifts of `profiles` in east and north, m²: two rows for each; they have a part in common.
    ///
    /// * `prior_m` – standard deviation of a profile without crossovers
    pub(super) fn covariance_m2(
        &self,
        profiles: &[usize],
        prior_m: impl Fn(usize) -> f64,
    ) -> DMatrix<f64> {
        let rows: Vec<Option<usize>> = profiles
            .iter()
            .flat_map(|profile| {
                let row = self.row(*profile);
                [row, row.map(|row| row + 1)]
            })
            .collect();
        DMatrix::from_fn(rows.len(), rows.len(), |row, column| {
            let own_m2 = match (rows[row], rows[column]) {
                (Some(row), Some(column)) => self.covariance_m2[(row, column)],
                (None, None) if row == column => prior_m(profiles[row / 2]).powi(2),
                _ => 0.0,
            };
            let is_one_axis = row % 2 == column % 2;
            own_m2 + if is_one_axis { COMMON_M.powi(2) } else { 0.0 }
        })
    }

    /// Row of the east shift of a profile.
    fn row(&self, profile: usize) -> Option<usize> {
        let at = self.profiles.binary_search(&profile).ok()?;
        Some(2 * at)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::{
        ProfileNet, ProfilePriors, SurfaceOptions, crossovers, invented_profiles::over_waves,
    };

    const PRIORS: ProfilePriors = ProfilePriors {
        radial_sigma_m: 1.0,
        plan_sigma_m: 70.0,
    };

    /// Shifts of sixteen profiles, metres: their root mean square is 70 m on each axis.
    fn drawn_m() -> Vec<[f64; 2]> {
        let axis = |index: f64, phase: f64| 99.0 * (2.4 * index + phase).sin();
        (0..16_u8)
            .map(|index| [axis(index.into(), 0.0), axis(index.into(), 1.1)])
            .collect()
    }

    fn found(shots: &[SurfaceShot]) -> PlanShifts {
        let crossovers = crossovers(shots, &SurfaceOptions::default());
        let net = ProfileNet::of(&crossovers, &PRIORS);
        assert!(net.left_out.is_empty(), "{:?}", net.left_out);
        net.plan_shifts(&crossovers, PRIORS.plan_sigma_m).unwrap()
    }

    #[test]
    fn crossovers_show_the_differences_between_shifts() {
        let (drawn_m, shots) = (drawn_m(), over_waves(&drawn_m()));
        let shifts = found(&shots);
        let errors_m = drawn_m.iter().enumerate();
        let errors_m: Vec<Vector2<f64>> = errors_m
            .map(|(profile, true_m)| shifts.shift_m(profile) - Vector2::from(*true_m))
            .collect();
        let mean_m = errors_m.iter().sum::<Vector2<f64>>() / errors_m.len() as f64;
        let squares_m2 = errors_m.iter().map(|of| (of - mean_m).norm_squared());
        let rms_m = (squares_m2.sum::<f64>() / (2.0 * errors_m.len() as f64)).sqrt();
        // Well below 70 m: 70 m on waves of 25 and 30 m change heights by 2 m, against noise of 1 m and the ground between shots.
        assert!(rms_m < 50.0, "{rms_m} m: {errors_m:.0?}");
        // Each within what its covariance states.
        let profiles: Vec<usize> = (0..16).collect();
        let covariance_m2 = shifts.covariance_m2(&profiles, |_| 70.0);
        for (profile, error_m) in errors_m.iter().enumerate() {
            for axis in 0..2 {
                let sigma_m = covariance_m2[(2 * profile + axis, 2 * profile + axis)].sqrt();
                assert!(
                    error_m[axis].abs() < 3.0 * sigma_m && sigma_m < 70.0,
                    "{profile}: {error_m} {sigma_m}"
                );
            }
        }
        // Nothing shows a shift of all profiles together: neighbours are in error alike.
        assert!(covariance_m2[(0, 2)] > 0.0 && covariance_m2[(1, 3)] > 0.0);
    }

    #[test]
    fn shots_move_back_by_the_shift_of_their_profile_alone() {
        let shots = over_waves(&drawn_m());
        let shifts = found(&shots);
        for (shot, moved) in shots.iter().zip(shifts.removed_from(&shots)) {
            let axes = local_axes(&shot.ground_m);
            let step_m = axes * (moved.ground_m - shot.ground_m);
            // Metres: the curvature of Mars over 200 m is 6 mm.
            let off_m = (step_m.xy() + shifts.shift_m(shot.profile)).norm();
            assert!(off_m < 0.01 && step_m.z.abs() < 0.01, "{step_m}");
        }
        assert_eq!(shifts.shift_m(99), Vector2::zeros());
        let unknown_m2 = shifts.covariance_m2(&[99, 0], |_| 70.0);
        // A profile without crossovers shares the common part alone.
        let common_m2 = COMMON_M.powi(2);
        assert!(
            (unknown_m2[(0, 0)] - 4_900.0 - common_m2).abs() < 1e-9,
            "{unknown_m2}"
        );
        assert!((unknown_m2[(0, 2)] - common_m2).abs() < 1e-9 && unknown_m2[(0, 1)] == 0.0);
    }
}
