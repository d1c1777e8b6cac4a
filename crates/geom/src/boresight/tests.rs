//! Pooled boresights against drawn ones.

use nalgebra::{Matrix2, Vector2};

use super::{BoresightAngles, BoresightInformation, pooled};
use crate::random::Random;

const PRIOR_RAD: f64 = 1e-4;

/// What a site states of these angles with errors of these standard deviations; infinite for no information.
fn site(truth: Vector2<f64>, sigmas_rad: [f64; 2], random: &mut Random) -> BoresightInformation {
    let weights = Vector2::from(sigmas_rad.map(|of| of.powi(-2)));
    let mut noise = || random.normal();
    let errors = Vector2::new(noise(), noise());
    let drawn = Vector2::from_fn(|axis, _| {
        let error = if weights[axis] > 0.0 {
            errors[axis] * sigmas_rad[axis]
        } else {
            0.0
        };
        truth[axis] + error
    });
    // The axes of a site are not those of the bus exactly.
    let turned = nalgebra::Rotation2::new(0.1);
    let matrix = turned.matrix() * Matrix2::from_diagonal(&weights) * turned.matrix().transpose();
    let off = drawn - truth;
    BoresightInformation {
        matrix,
        vector: matrix * (truth + turned.matrix() * off),
    }
}

#[test]
fn information_is_free_of_the_prior_it_was_estimated_with() {
    let truth = Vector2::new(3e-4, -2e-4);
    let own = site(truth, [1.5e-4, 8e-5], &mut Random::new(1, "own"));
    for (mean, sigma, factor) in [(0.0, 1e-4, 1.0), (2e-4, 5e-5, 1.0), (-1e-4, 3e-4, 1.7)] {
        let before = Matrix2::from_diagonal_element(1.0 / (sigma * sigma));
        let cofactors = (before + own.matrix).try_inverse().unwrap();
        let prior = BoresightAngles {
            angles_rad: Vector2::repeat(mean),
            covariance_rad2: Matrix2::from_diagonal_element(sigma * sigma),
        };
        let adjusted = BoresightAngles {
            angles_rad: cofactors * (own.vector + before * prior.angles_rad),
            covariance_rad2: cofactors * factor,
        };
        let found = BoresightInformation::of(&adjusted, &prior, factor).unwrap();
        // Rounding, as shares.
        assert!((found.matrix * factor - own.matrix).norm() < 1e-9 * own.matrix.norm());
        assert!((found.vector * factor - own.vector).norm() < 1e-9 * own.vector.norm());
    }
    // Observations that state one angle only: nothing of the other, whose difference is rounding.
    let prior = BoresightAngles::of_sigma(PRIOR_RAD);
    let mut adjusted = prior;
    adjusted.covariance_rad2[(0, 0)] *= 1.0 + 1e-12;
    adjusted.covariance_rad2[(1, 1)] *= 0.5;
    let found = BoresightInformation::of(&adjusted, &prior, 1.0).unwrap();
    let [first, both, second] = found.matrix_terms();
    let share = second * PRIOR_RAD * PRIOR_RAD;
    // The difference of the first is -1e-4.
    assert!(first.abs() < 1e-9 && both.abs() < 1e-3, "{first} {both}");
    assert!((share - 1.0).abs() < 1e-9, "{share}");
    let held = BoresightAngles::of_sigma(0.0);
    assert_eq!(BoresightInformation::of(&held, &held, 1.0), None);
}

#[test]
fn errors_of_the_pooled_angles_are_as_stated() {
    // Of each number of sites, ratios of errors and standard deviations across the track; along it nothing is known.
    for count in [1_u32, 3, 12, 40] {
        let mut random = Random::new(7, &format!("pooled {count}"));
        let (mut squares, mut trials) = (0.0, 0.0);
        for _ in 0..400 {
            let truth = Vector2::new(PRIOR_RAD * random.normal(), PRIOR_RAD * random.normal());
            let sites: Vec<_> = (0..count)
                .map(|_| {
                    let sigma = 2e-4 * random.between(0.5, 2.0);
                    site(truth, [f64::INFINITY, sigma], &mut random)
                })
                .collect();
            let found = pooled(&sites, PRIOR_RAD);
            let [along, sigma] = found.angles.sigmas_rad();
            // One of 400 lies beyond its a priori standard deviation by chance.
            if !found.contradicts_prior.contains(&true) {
                let is_known = sigma < PRIOR_RAD && (count < 12 || sigma < 8e-5);
                assert!(is_known, "{count}: {sigma}");
                // Nothing determines the first angle but the second through the small rotation of the axes.
                assert!(along > 0.9 * PRIOR_RAD, "{count}: {along}");
            }
            squares += ((found.angles.angles_rad[1] - truth[1]) / sigma).powi(2);
            trials += 1.0;
        }
        let ratio = f64::sqrt(squares / trials);
        // 400 trials: 0.91 to 1.09 in 99 of 100 cases; scatter that chance makes larger scales the standard deviations.
        assert!((0.75..1.1).contains(&ratio), "{count}: {ratio}");
    }
}

#[test]
fn sites_that_scatter_more_than_stated_state_less() {
    let mut random = Random::new(3, "scatter");
    let truth = Vector2::zeros();
    let mut stated = |factor: f64| {
        let sites: Vec<_> = (0..40)
            .map(|_| {
                let mut of = site(truth, [1e-4 * factor; 2], &mut random);
                of.matrix *= factor.powi(2);
                of.vector *= factor.powi(2);
                of
            })
            .collect();
        pooled(&sites, PRIOR_RAD)
    };
    let (as_stated, twice) = (stated(1.0), stated(1.8));
    assert!(
        (0.75..1.25).contains(&as_stated.scatter),
        "{}",
        as_stated.scatter
    );
    assert!(twice.scatter > 1.4, "{}", twice.scatter);
    let ratio = twice.angles.sigmas_rad()[1] / as_stated.angles.sigmas_rad()[1];
    assert!((1.3..2.2).contains(&ratio), "{ratio}");
}

#[test]
fn one_wrong_site_is_found_and_left_out() {
    let mut random = Random::new(5, "wrong");
    let truth = Vector2::new(5e-5, -6e-5);
    let sigmas = [1.5e-4; 2];
    let mut sites: Vec<_> = (0..9).map(|_| site(truth, sigmas, &mut random)).collect();
    assert_eq!(pooled(&sites, PRIOR_RAD).contradicting, [0; 0]);
    sites[4] = site(truth + Vector2::new(0.0, 1.5e-3), sigmas, &mut random);
    let found = pooled(&sites, PRIOR_RAD);
    assert_eq!(found.contradicting, [4]);
    let off = (found.angles.angles_rad - truth).norm();
    assert!(off < 2e-4, "{off}");
    // Three of which one is wrong: they do not show which, and the scatter scales the standard deviations.
    let found = pooled(&sites[3..6], PRIOR_RAD);
    assert!(
        found.contradicting.is_empty() && found.scatter > 3.0,
        "{found:?}"
    );
}

#[test]
fn a_mounting_beyond_its_prior_is_found() {
    let mut random = Random::new(9, "beyond");
    let truth = Vector2::new(0.0, 5e-4);
    let sites: Vec<_> = (0..12)
        .map(|_| site(truth, [f64::INFINITY, 2e-4], &mut random))
        .collect();
    let found = pooled(&sites, PRIOR_RAD);
    assert_eq!(found.contradicts_prior, [false, true]);
    let [along, across] = found.angles.sigmas_rad();
    assert!(
        (found.angles.angles_rad[1] - truth[1]).abs() < 3.0 * across && along > 0.9 * PRIOR_RAD
    );
    // Without any site, the a priori values.
    assert_eq!(
        pooled(&[], PRIOR_RAD).angles,
        BoresightAngles::of_sigma(PRIOR_RAD)
    );
}

#[test]
fn fewer_than_five_sites_do_not_replace_the_prior() {
    // Sites that agree on 0.5 mrad towards Y, ±0.05 mrad each, and state nothing towards X.
    let own = BoresightInformation::new([0.0, 0.0, 4e8], [0.0, 2e5]);
    let five = pooled(&[own; 5], PRIOR_RAD);
    assert_eq!(five.contradicts_prior, [false, true]);
    // The widened a priori value moves it by 2.5 nrad.
    assert!((five.angles.angles_rad[1] - 5e-4).abs() < 1e-8, "{five:?}");
    let four = pooled(&[own; 4], PRIOR_RAD);
    assert_eq!(four.contradicts_prior, [false, false]);
    // Weights of 16 by the sites and 1 by the a priori value.
    let expected_rad = 5e-4 * 16.0 / 17.0;
    assert!(
        (four.angles.angles_rad[1] - expected_rad).abs() < 1e-9,
        "{four:?}"
    );
}
