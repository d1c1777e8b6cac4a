//! Against closed forms and against the full expression of the covariance.

use super::*;
use crate::ellipsoid::on_ellipsoid_m;
use areograph_base::body::Body;
use areograph_base::body::MARS_IAU2000;
use nalgebra::DMatrix;

/// Shots along a meridian from the equator northwards, `spacing_m` apart, with these heights.
fn profile(heights_m: &[f64], spacing_m: f64, east_m: f64, profile: usize) -> Vec<SurfaceShot> {
    let shot = |(shot, height_m): (usize, &f64)| SurfaceShot {
        ground_m: place(east_m, shot as f64 * spacing_m, *height_m),
        profile,
        attitude_known: true,
        off_nadir_rad: 0.0,
    };
    heights_m.iter().enumerate().map(shot).collect()
}

fn place(east_m: f64, north_m: f64, height_m: f64) -> Vector3<f64> {
    let radius_m = MARS_IAU2000.equatorial_radius_m;
    let (east_rad, north_rad) = (east_m / radius_m, north_m / radius_m);
    let up = crate::ellipsoid::spherical_to_xyz_m(east_rad, north_rad, 1.0);
    on_ellipsoid_m(Body::Mars.model(), &up) + height_m * up
}

/// Heights whose root mean square difference over one spacing is known.
fn zigzag(count: usize, step_m: f64) -> Vec<f64> {
    (0..count)
        .map(|shot| if shot % 2 == 0 { 0.0 } else { step_m })
        .collect()
}

fn only_ground(roughness_min_m: f64) -> SurfaceOptions {
    SurfaceOptions {
        profile_sigma_m: 0.0,
        plan_sigma_m: 0.0,
        roughness_min_m,
        ..SurfaceOptions::default()
    }
}

#[test]
fn standard_deviations_grow_with_the_distance_from_a_profile() {
    // A straight profile of 305 m spacing, roughness 4.4 m at 300 m, shots to 1 m: published values, 5 %.
    let shots = profile(&[0.0; 201], 305.0, 0.0, 0);
    let surface = LaserSurface::new(&shots, &[], &only_ground(4.4)).unwrap();
    for (east_m, expected_m) in [
        (0.0, 0.94),
        (75.0, 1.82),
        (150.0, 2.68),
        (300.0, 4.18),
        (600.0, 6.72),
        (1000.0, 9.58),
        (2000.0, 15.6),
    ] {
        let beside = surface.predict(&[place(east_m, 100.0 * 305.0, 0.0)]);
        let sigma_m = beside.sigma_m(0);
        assert!(
            (sigma_m / expected_m - 1.0).abs() < 0.05,
            "{east_m} m: {sigma_m} m"
        );
        assert!((beside.nearest_m[0] - east_m).abs() < 1.0, "{east_m}");
    }
}

#[test]
fn a_constant_comes_back_and_so_does_what_is_added_to_all_shots() {
    let shots = profile(&[120.0; 60], 305.0, 0.0, 0);
    let surface = LaserSurface::new(&shots, &[], &SurfaceOptions::default()).unwrap();
    let places = [place(700.0, 4_000.0, 0.0), place(-2_000.0, 19_000.0, 0.0)];
    let constant = surface.predict(&places);
    for (height_m, slope) in constant.heights_m.iter().zip(&constant.slopes) {
        assert!((height_m - 120.0).abs() < 1e-6); // metres, rounding of 3.4e6
        assert!(slope.norm() < 1e-8);
    }
    let rough = zigzag(60, 6.0);
    let raised: Vec<f64> = rough.iter().map(|height_m| height_m + 50.0).collect();
    let heights = |heights_m: &[f64]| {
        let shots = profile(heights_m, 305.0, 0.0, 0);
        let surface = LaserSurface::new(&shots, &[], &SurfaceOptions::default()).unwrap();
        surface.predict(&places).heights_m
    };
    for (raised_m, height_m) in heights(&raised).iter().zip(heights(&rough)) {
        assert!((raised_m - height_m - 50.0).abs() < 1e-6);
    }
}

/// Weights of ordinary kriging by its equations as Cressie states them, with a multiplier: one column per place.
fn weights(surface: &LaserSurface, at: &[Vector2<f64>]) -> DMatrix<f64> {
    let (shots, gamma) = (&surface.kriging.shots, surface.variogram());
    let count = shots.len();
    let equations = DMatrix::from_fn(count + 1, count + 1, |row, column| {
        match (shots.get(row), shots.get(column)) {
            (Some(one), Some(other)) if row == column => {
                -1.0 - 2.0 * gamma.at(one.shared.farther_m())
                    - gamma.between(&one.plan_m, &other.plan_m)
            }
            (Some(one), Some(other)) => gamma.between(&one.plan_m, &other.plan_m),
            (None, None) => 0.0,
            _ => 1.0,
        }
    });
    let right = DMatrix::from_fn(count + 1, at.len(), |row, place| {
        let shot = shots.get(row);
        shot.map_or(1.0, |shot| gamma.between(&shot.plan_m, &at[place]))
    });
    equations.lu().solve(&right).unwrap()
}

#[test]
fn the_covariance_is_the_full_expression_symmetric_and_positive_definite() {
    let mut shots = profile(&zigzag(40, 9.0), 305.0, 0.0, 0);
    let second = profile(&zigzag(40, 7.0), 311.0, 2_500.0, 1).into_iter();
    shots.extend(second.map(|shot| SurfaceShot {
        attitude_known: false,
        ..shot
    }));
    let surface = LaserSurface::new(&shots, &[], &only_ground(4.0)).unwrap();
    let places: Vec<Vector3<f64>> = (0..12)
        .map(|tie| {
            place(
                200.0 * f64::from(tie),
                5_000.0 + 310.0 * f64::from(tie),
                0.0,
            )
        })
        .collect();
    let at: Vec<Vector2<f64>> = places.iter().map(|place| surface.plan.of(place)).collect();
    let (kriging, gamma) = (&surface.kriging, surface.variogram());
    let relation = kriging.at(&at);
    let mut quick = kriging.between_m2(&at);
    kriging.add_errors_m2(&mut quick, relation);
    quick.fill_upper_triangle_with_lower_triangle();
    let solved = weights(&surface, &at);
    for (i, one) in at.iter().enumerate() {
        for (j, other) in at.iter().enumerate() {
            let mut full = -gamma.between(one, other);
            for (k, shot) in kriging.shots.iter().enumerate() {
                full += solved[(k, i)] * gamma.between(&shot.plan_m, other);
                full += solved[(k, j)] * gamma.between(&shot.plan_m, one);
                let noise_m2 = 1.0 + 2.0 * gamma.at(shot.shared.farther_m());
                full += solved[(k, i)] * solved[(k, j)] * noise_m2;
                for (l, second) in kriging.shots.iter().enumerate() {
                    full -= solved[(k, i)]
                        * solved[(l, j)]
                        * gamma.between(&shot.plan_m, &second.plan_m);
                }
            }
            // m²; rounding of sums of 6400 terms of 1e4 m².
            assert!(
                (full - quick[(i, j)]).abs() < 1e-6,
                "{full} {}",
                quick[(i, j)]
            );
        }
    }
    assert!(nalgebra::Cholesky::new(quick.clone()).is_some());
}

#[test]
fn places_alone_and_their_mean_have_the_errors_of_the_whole() {
    // The second profile is farther from its place than others, and its shots share larger errors; a third is rougher.
    let mut shots = profile(&zigzag(60, 9.0), 305.0, 0.0, 2);
    let second = profile(&zigzag(60, 7.0), 311.0, 2_500.0, 5).into_iter();
    shots.extend(second.map(|shot| SurfaceShot {
        attitude_known: false,
        ..shot
    }));
    shots.extend(profile(&zigzag(60, 30.0), 300.0, 9_000.0, 7));
    // More places than one task predicts.
    let places: Vec<Vector3<f64>> = (0..150)
        .map(|tie| place(70.0 * f64::from(tie), 4_000.0 + 43.0 * f64::from(tie), 0.0))
        .collect();
    let relief = SurfaceOptions {
        uses_relief: true,
        ..SurfaceOptions::default()
    };
    for options in [SurfaceOptions::default(), relief, only_ground(4.0)] {
        let surface = LaserSurface::new(&shots, &[], &options).unwrap();
        let whole = surface.predict(&places);
        let each = surface.predict_each(&places);
        assert_eq!(each.len(), places.len());
        for (index, of) in each.iter().enumerate() {
            // Metres, and shares: rounding of 1e5 m² of ground in variances of 1 to 1e4 m².
            assert!((of.height_m - whole.heights_m[index]).abs() < 1e-8);
            assert!((of.sigma_m / whole.sigma_m(index) - 1.0).abs() < 1e-9);
            assert!((of.nearest_m - whole.nearest_m[index]).abs() < 1e-8);
            assert!((of.slope - whole.slopes[index]).norm() < 1e-9);
        }
        let mean = surface.predict_mean(&places);
        let count = places.len() as f64;
        let heights_m: f64 = whole.heights_m.iter().sum();
        assert!((mean.height_m - heights_m / count).abs() < 1e-8);
        let variance_m2 = whole.covariance_m2.sum() / (count * count);
        assert!((mean.variance_m2 / variance_m2 - 1.0).abs() < 1e-9);
        assert!(nalgebra::Cholesky::new(whole.covariance_m2).is_some());
    }
}

#[test]
fn roughness_is_learnt_without_the_noise_of_the_shots() {
    // Heights an odd number of spacings of 300 m apart differ by 10 m, all others by none; the noise of two shots is
    // 2 m². Short distances weigh more.
    let shots = profile(&zigzag(101, 10.0), 300.0, 0.0, 0);
    let surface = LaserSurface::new(&shots, &[], &only_ground(1.0)).unwrap();
    let (mut squares_m2, mut weights) = (0.0, 0.0);
    for lag in 1..=10 {
        let difference_m2 = if lag % 2 == 1 { 98.0 } else { -2.0 };
        let lag = f64::from(lag);
        squares_m2 += difference_m2 / lag.powf(1.4) / lag;
        weights += 1.0 / lag;
    }
    let expected_m = f64::sqrt(squares_m2 / weights);
    assert!((surface.variogram().roughness_m - expected_m).abs() < 0.01);
}

#[test]
fn standard_deviations_follow_the_roughness_of_the_neighbourhood() {
    // Rough in the south, smooth in the north.
    let mut heights_m = zigzag(150, 20.0);
    heights_m.extend(zigzag(150, 4.0));
    let shots = profile(&heights_m, 300.0, 0.0, 0);
    let surface = LaserSurface::new(&shots, &[], &only_ground(1.0)).unwrap();
    let sigma_m = |north_m: f64| surface.predict(&[place(600.0, north_m, 0.0)]).sigma_m(0);
    let (south_m, middle_m, north_m) = (sigma_m(15_000.0), sigma_m(45_000.0), sigma_m(75_000.0));
    // Five times rougher; 20 pairs of all shots take part in some 30 of the neighbourhood.
    assert!(south_m > 1.5 * north_m, "{south_m} {north_m}");
    assert!((north_m..south_m).contains(&middle_m), "{middle_m}");
}

#[test]
fn heights_change_with_the_place_as_differences_say() {
    let ground_m = place(1_234_567.0, 2_345_678.0, -4_321.0);
    let (_, by_place) = height_m(Body::Mars.model(), &ground_m);
    for axis in 0..3 {
        let mut step = Vector3::zeros();
        step[axis] = 10.0;
        let [after_m, before_m] =
            [ground_m + step, ground_m - step].map(|place| height_m(Body::Mars.model(), &place).0);
        // Central differences over 20 m; curvature of a globe: 1e-9.
        assert!(((after_m - before_m) / 20.0 - by_place[axis]).abs() < 1e-8);
    }
}

#[test]
fn too_few_shots_and_shots_that_are_no_numbers_are_refused() {
    let few = profile(&[0.0; 9], 300.0, 0.0, 0);
    let refused = LaserSurface::new(&few, &[], &SurfaceOptions::default());
    assert_eq!(refused.unwrap_err(), SurfaceError::TooFew { shots: 9 });
    let mut shots = profile(&[0.0; 20], 300.0, 0.0, 0);
    shots[7].ground_m.x = f64::NAN;
    let refused = LaserSurface::new(&shots, &[], &SurfaceOptions::default());
    assert_eq!(refused.unwrap_err(), SurfaceError::NotANumber);
}

#[test]
fn of_very_many_shots_those_near_the_places_are_taken() {
    let shots = profile(&zigzag(4_000, 8.0), 305.0, 0.0, 0);
    let around = [place(100.0, 50_000.0, 0.0)];
    let surface = LaserSurface::new(&shots, &around, &SurfaceOptions::default()).unwrap();
    assert!((15..=21).contains(&surface.shots()), "{}", surface.shots());
    let all = LaserSurface::new(&shots, &[], &SurfaceOptions::default()).unwrap();
    assert!(all.shots() <= SHOTS_MAX);
}
