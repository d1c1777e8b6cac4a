//! Boresight of a laser on the bus of cameras, pooled over sites.
//!
//! Each site states what its own observations say of the two angles between the laser and its mounting: its estimate without the
//! a priori values that it used. These statements of independent sites add up; the a priori values enter once.
//!
//! # Source
//! Weighted mean of correlated pairs in the form of normal equations; scale of the standard deviations by the scatter of the
//! sites, Birge 1932, *Physical Review* 40, 207–227; blunder test, Baarda 1968.

use nalgebra::{Matrix2, SymmetricEigen, Vector2};
use serde::{Deserialize, Serialize};

/// Two angles between the laser and its mounting with their covariance.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct BoresightAngles {
    /// Angles, radians.
    pub angles_rad: Vector2<f64>,
    /// Covariance, rad²; a variance of 0 holds an angle.
    pub covariance_rad2: Matrix2<f64>,
}

impl BoresightAngles {
    /// Angles of 0 with this standard deviation each, radians.
    #[must_use]
    pub fn of_sigma(sigma_rad: f64) -> Self {
        Self {
            angles_rad: Vector2::zeros(),
            covariance_rad2: Matrix2::from_diagonal_element(sigma_rad.powi(2)),
        }
    }

    /// Standard deviations, radians.
    #[must_use]
    pub fn sigmas_rad(&self) -> [f64; 2] {
        [0, 1].map(|axis| self.covariance_rad2[(axis, axis)].max(0.0).sqrt())
    }
}

/// What observations say of the two angles: normal equations `matrix · angles = vector`, which need not have a solution.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct BoresightInformation {
    /// Per rad².
    pub matrix: Matrix2<f64>,
    /// Per radian.
    pub vector: Vector2<f64>,
}

impl BoresightInformation {
    /// Of the terms of the symmetric matrix (first angle, both, second) and of the vector.
    #[must_use]
    pub fn new([first, both, second]: [f64; 3], vector: [f64; 2]) -> Self {
        Self {
            matrix: Matrix2::new(first, both, both, second),
            vector: vector.into(),
        }
    }

    /// Terms of the matrix, as for [`Self::new`].
    #[must_use]
    pub fn matrix_terms(&self) -> [f64; 3] {
        [(0, 0), (0, 1), (1, 1)].map(|at| self.matrix[at])
    }

    /// Of the observations of an adjustment, without its a priori values; `None` for angles that were held. Directions of which they
    /// state nothing beyond rounding have no information.
    ///
    /// * `variance_factor` – factor of the covariance of `adjusted` over its cofactors
    #[must_use]
    pub fn of(
        adjusted: &BoresightAngles,
        prior: &BoresightAngles,
        variance_factor: f64,
    ) -> Option<Self> {
        let known = adjusted.covariance_rad2.try_inverse()? * variance_factor;
        let before = prior.covariance_rad2.try_inverse()?;
        let vector = (known * adjusted.angles_rad - before * prior.angles_rad) / variance_factor;
        let matrix = (known - before) / variance_factor;
        let is_finite = matrix.iter().chain(&vector).all(|of| of.is_finite());
        let least = ROUNDING * before.norm() / variance_factor;
        is_finite.then(|| {
            Self {
                matrix: 0.5 * (matrix + matrix.transpose()),
                vector,
            }
            .above(least)
        })
    }

    /// Without the directions that have at most this information.
    fn above(&self, least: f64) -> Self {
        let mut kept = Self::default();
        for (direction, information) in directions(self, least) {
            kept.matrix += direction * direction.transpose() * information;
            kept.vector += direction * direction.dot(&self.vector);
        }
        kept
    }
}

/// Information below this share of the a priori one is rounding of the difference between both.
const ROUNDING: f64 = 1e-9;
/// Directions with less information than this share of the a priori one state nothing.
const INFORMATION_MIN: f64 = 1e-3;
/// A priori standard deviations are multiplied by this where the sites contradict them.
const WIDER: f64 = 100.0;
/// Standard deviations from the a priori value that are a contradiction.
const CONTRADICTION_SIGMAS: f64 = 3.0;
/// With fewer sites, the data do not show whether one of them or the a priori value is wrong.
const TESTED_SITES_MIN: usize = 5;
/// Quantiles of χ² that one correct site of a thousand exceeds, for 1 and 2 degrees of freedom.
const SITE_LIMITS: [f64; 2] = [10.83, 13.82];

/// The boresight by several sites.
#[derive(Debug, Clone, PartialEq)]
pub struct PooledBoresight {
    /// The angles.
    pub angles: BoresightAngles,
    /// Indices of sites that contradict the others, and are left out.
    pub contradicting: Vec<usize>,
    /// Degrees of freedom of the scatter of the others.
    pub freedom: f64,
    /// Their scatter over the stated one, as a standard deviation; above 1, it scales the standard deviations. 1 without freedom.
    pub scatter: f64,
    /// Whether at least five sites contradict the a priori standard deviation of each angle, which is then not used.
    pub contradicts_prior: [bool; 2],
}

/// Pools the statements of independent `sites`.
///
/// * `prior_sigma_rad` – a priori standard deviation of each angle, radians, above 0
#[must_use]
pub fn pooled(sites: &[BoresightInformation], prior_sigma_rad: f64) -> PooledBoresight {
    let least = INFORMATION_MIN / prior_sigma_rad.powi(2);
    let mut used: Vec<usize> = (0..sites.len()).collect();
    let mut contradicting = Vec::new();
    let weak = [WIDER * prior_sigma_rad; 2];
    while used.len() >= TESTED_SITES_MIN {
        let of_site = |place: usize| {
            let others = used.iter().filter(|of| **of != used[place]);
            let others = solved(others.map(|of| &sites[*of]), &weak, 1.0);
            excess(&sites[used[place]], &others, least)
        };
        let all = (0..used.len()).map(|place| (place, of_site(place)));
        let worst = all.max_by(|one, other| one.1.total_cmp(&other.1));
        let Some((place, _)) = worst.filter(|(_, excess)| *excess > 1.0) else {
            break;
        };
        contradicting.push(used.remove(place));
    }
    contradicting.sort_unstable();
    let kept = || used.iter().map(|of| &sites[*of]);
    let (scatter, freedom) = scatter(kept(), &solved(kept(), &weak, 1.0), least);
    let scale = scatter.max(1.0).powi(-2);
    // A contradiction in a direction between both angles is one of the angle that the sites know better.
    let known: Matrix2<f64> = kept().map(|of| of.matrix).sum();
    let axes = if known[(0, 0)] > known[(1, 1)] {
        [0, 1]
    } else {
        [1, 0]
    };
    let mut contradicts_prior = [false; 2];
    let mut sigmas = [prior_sigma_rad; 2];
    for axis in axes {
        let stating = kept().filter(|of| of.matrix[(axis, axis)] > least).count();
        if stating < TESTED_SITES_MIN {
            continue;
        }
        sigmas[axis] = weak[axis];
        let alone = solved(kept(), &sigmas, scale);
        let expected = alone.covariance_rad2[(axis, axis)] + prior_sigma_rad.powi(2);
        contradicts_prior[axis] =
            alone.angles_rad[axis].abs() > CONTRADICTION_SIGMAS * expected.sqrt();
        if !contradicts_prior[axis] {
            sigmas[axis] = prior_sigma_rad;
        }
    }
    PooledBoresight {
        angles: solved(kept(), &sigmas, scale),
        contradicting,
        freedom,
        scatter,
        contradicts_prior,
    }
}

/// The angles by sites and a priori values of 0.
///
/// * `scale` – factor of the information of the sites
fn solved<'a>(
    sites: impl Iterator<Item = &'a BoresightInformation>,
    prior_sigmas_rad: &[f64; 2],
    scale: f64,
) -> BoresightAngles {
    let prior = Vector2::from(prior_sigmas_rad.map(|of| of.powi(-2)));
    let (mut matrix, mut vector) = (Matrix2::from_diagonal(&prior), Vector2::zeros());
    for site in sites {
        matrix += site.matrix * scale;
        vector += site.vector * scale;
    }
    // Rounding may leave a site a little less than no information; the a priori values have far more.
    let covariance_rad2 = matrix.try_inverse().unwrap_or_else(Matrix2::zeros);
    BoresightAngles {
        angles_rad: covariance_rad2 * vector,
        covariance_rad2,
    }
}

/// Directions in which a site states something, with its information about them.
fn directions(
    site: &BoresightInformation,
    least: f64,
) -> impl Iterator<Item = (Vector2<f64>, f64)> {
    let SymmetricEigen {
        eigenvectors,
        eigenvalues,
    } = site.matrix.symmetric_eigen();
    let all = (0..2).map(move |of| (eigenvectors.column(of).into_owned(), eigenvalues[of]));
    all.filter(move |(_, information)| *information > least)
}

/// Squared distance of a site from all others over its limit.
fn excess(site: &BoresightInformation, others: &BoresightAngles, least: f64) -> f64 {
    let found: Vec<(Vector2<f64>, f64)> = directions(site, least).collect();
    let off = |(direction, information): &(Vector2<f64>, f64)| {
        direction.dot(&site.vector) / information - direction.dot(&others.angles_rad)
    };
    let between = |one: usize, other: usize| {
        let [(of_one, information), (of_other, _)] = [one, other].map(|of| found[of]);
        let own = if one == other {
            information.recip()
        } else {
            0.0
        };
        of_one.dot(&(others.covariance_rad2 * of_other)) + own
    };
    match found.as_slice() {
        [] => 0.0,
        [one] => off(one).powi(2) / between(0, 0) / SITE_LIMITS[0],
        [one, two, ..] => {
            let covariance =
                Matrix2::new(between(0, 0), between(0, 1), between(1, 0), between(1, 1));
            let off = Vector2::new(off(one), off(two));
            let weights = covariance.try_inverse().unwrap_or_else(Matrix2::zeros);
            off.dot(&(weights * off)) / SITE_LIMITS[1]
        }
    }
}

/// Scatter of the sites about `pooled` over the stated one, and its degrees of freedom.
fn scatter<'a>(
    sites: impl Iterator<Item = &'a BoresightInformation>,
    pooled: &BoresightAngles,
    least: f64,
) -> (f64, f64) {
    let (mut squares, mut freedom) = (0.0, 0.0);
    for site in sites {
        for (direction, information) in directions(site, least) {
            let off = direction.dot(&site.vector) - information * direction.dot(&pooled.angles_rad);
            squares += off * off / information;
            // The result follows each site by its share.
            let variance = direction.dot(&(pooled.covariance_rad2 * direction));
            freedom += 1.0 - information * variance;
        }
    }
    if freedom < 0.5 {
        return (1.0, 0.0);
    }
    ((squares / freedom).sqrt(), freedom)
}

#[cfg(test)]
mod tests;
