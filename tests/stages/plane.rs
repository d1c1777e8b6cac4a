//! Plane triangulation against synthetic nets whose truth is known, after Arthur & McMacken 1977.

#![allow(
    clippy::unwrap_used,
    clippy::cast_possible_truncation,
    reason = "tests may fail loudly, and seeds are small"
)]

mod blunders;
mod refused;
mod uncertainty;

use areograph::{
    geom::plane::Shrinkage,
    geom::plane::{
        Block, Control, Figure, Measurement, Net, Place, Similarity, Solution, brick, extend,
        fit_similarity, local, mortar, scale, shrinkage_factor, solve,
    },
    scene::{PlaneRecipe, PlaneScene},
};

/// The tertiary net with noise.
const TERTIARY: PlaneRecipe = PlaneRecipe {
    noise_m: 30.0,
    ..PlaneRecipe::TERTIARY
};

fn nine(noise_m: f64) -> PlaneRecipe {
    PlaneRecipe {
        noise_m,
        ..PlaneRecipe::NINE
    }
}

fn bricks_of_columns(scene: &PlaneScene, columns: usize) -> Vec<Vec<usize>> {
    let brick = |picture: usize| (picture % columns) * 3 / columns;
    (0..3)
        .map(|of| {
            (0..scene.net.pictures)
                .filter(|picture| brick(*picture) == of)
                .collect()
        })
        .collect()
}

/// Root mean square of a coordinate.
fn rms(of: impl Iterator<Item = Place>) -> f64 {
    let squares: Vec<f64> = of.map(|place| place.norm_sqr()).collect();
    (squares.iter().sum::<f64>() / (2 * squares.len()) as f64).sqrt()
}

fn largest(of: impl Iterator<Item = f64>) -> f64 {
    of.fold(0.0, f64::max)
}

/// Errors of adjusted places, metres.
fn errors<'a>(
    scene: &'a PlaneScene,
    places: &'a [Option<Place>],
) -> impl Iterator<Item = Place> + 'a {
    let both = places.iter().zip(&scene.points);
    both.filter_map(|(found, truth)| Some((*found)? - truth))
}

#[test]
fn exact_data_give_the_truth() {
    let scene = nine(0.0).simulate(1);
    let solution = solve(&scene.net).unwrap();
    // A nanometre in a kilometre-wide unit of the recipe: 1e-9 km.
    let limit_m = 1e-6;
    assert!(largest(solution.deviations.iter().map(|of| of.norm())) < limit_m);
    assert!(
        largest(
            solution
                .control_residuals
                .iter()
                .map(|of| of.unwrap().norm())
        ) < limit_m
    );
    assert!(largest(errors(&scene, &solution.places).map(Place::norm)) < limit_m);
    for (found, truth) in solution.pictures.iter().zip(&scene.pictures) {
        // 1e-9 of the scale; the shift is extrapolated over a few thousand units.
        assert!((found.turn - truth.turn).norm() < 1e-9 * truth.turn.norm());
        assert!((found.shift - truth.shift).norm() < 1e-3 * limit_m.sqrt());
    }
}

#[test]
fn equations_are_counted_as_the_paper_counts_them() {
    let scene = nine(100.0).simulate(2);
    let solution = solve(&scene.net).unwrap();
    let mut views = vec![0_usize; scene.net.points];
    for measured in &scene.net.measurements {
        views[measured.point] += 1;
    }
    let ties: usize = views.iter().map(|r| 2 * (r - 1)).sum();
    assert_eq!(solution.redundancy.ties, ties);
    assert_eq!(solution.redundancy.controls, 24);
    assert_eq!(solution.redundancy.unknowns, 36);
    assert_eq!(solution.redundancy.total(), ties + 24 - 36);
    // Theirs against the rigorous way, 4m + 2n.
    assert!(4 * scene.net.pictures + 2 * scene.net.points > 10 * solution.redundancy.unknowns);
}

#[test]
fn three_pictures_share_a_tie_by_thirds() {
    // One point on three pictures; each picture held by two controls of its own.
    let mut net = Net {
        pictures: 3,
        points: 7,
        ..Net::default()
    };
    for picture in 0..3 {
        for (end, at) in [(0, Place::new(0.0, 0.0)), (1, Place::new(10.0, 0.0))] {
            let point = 1 + 2 * picture + end;
            let of = Place::new(100.0 * picture as f64, 0.0);
            net.measurements.push(Measurement { picture, point, at });
            net.controls.push(Control {
                point,
                at: at + of,
                weight: 1e12,
            });
        }
        let seen = Place::new(50.0 - 100.0 * picture as f64, [0.0, 3.0, 6.0][picture]);
        net.measurements.push(Measurement {
            picture,
            point: 0,
            at: seen,
        });
    }
    let solution = solve(&net).unwrap();
    let tie: Vec<Place> = net
        .measurements
        .iter()
        .zip(&solution.deviations)
        .filter(|(measured, _)| measured.point == 0)
        .map(|(_, deviation)| *deviation)
        .collect();
    // ⅔·0 − ⅓·3 − ⅓·6, and so on; the weight of the controls leaves 1e-6.
    for (found, expected) in tie.iter().zip([-3.0, 0.0, 3.0]) {
        assert!((found.im - expected).abs() < 1e-4, "{found} {expected}");
    }
}

#[test]
fn deviations_follow_the_noise() {
    let noise_m = 380.0;
    let seeds = 20;
    let total: f64 = (0..seeds)
        .map(|seed| {
            let scene = nine(noise_m).simulate(seed);
            let pictures: Vec<usize> = (0..9).collect();
            let figure = brick(&scene.net, &pictures).unwrap();
            // From figure units to metres.
            let unit_m = scale_of(&figure, &scene);
            let deviations = figure
                .deviations
                .iter()
                .map(|(_, deviation)| deviation * unit_m);
            let tied = deviations.zip(&scene.net.measurements);
            let count = |point| {
                scene
                    .net
                    .measurements
                    .iter()
                    .filter(|of| of.point == point)
                    .count()
            };
            rms(tied
                .filter(|(_, of)| count(of.point) > 1)
                .map(|(deviation, _)| deviation))
        })
        .sum();
    let ratio = total / f64::from(seeds as u32) / noise_m;
    // 0.65 of the noise with overlaps of two to four, within 15 % for the overlaps of one recipe.
    assert!((0.55..=0.75).contains(&ratio), "{ratio}");
}

fn scale_of(figure: &Figure, scene: &PlaneScene) -> f64 {
    let (from, to): (Vec<Place>, Vec<Place>) = figure
        .places
        .iter()
        .map(|(point, place)| (*place, scene.points[*point]))
        .unzip();
    fit_similarity(&from, &to).unwrap().scale()
}

/// The net on two controls of one weight, near opposite corners.
fn on_two(scene: &PlaneScene, weight: f64) -> Net {
    let mut net = scene.net.clone();
    net.controls.truncate(2);
    for control in &mut net.controls {
        control.weight = weight;
    }
    net
}

#[test]
fn two_controls_shrink_the_figure_by_the_law() {
    for weight in [0.1, 1.0, 10.0] {
        for seed in 0..5 {
            let scene = nine(1_000.0).simulate(seed);
            let net = on_two(&scene, weight);
            let solution = solve(&net).unwrap();
            let shrinkage = Shrinkage::of(&net, &solution).unwrap();
            assert!(
                (shrinkage.factor - shrinkage.law).abs() < 1e-10,
                "{shrinkage:?}"
            );
            assert!(shrinkage.factor < 1.0);
            // With the ties of the figure that holds its controls exactly, solved on its own.
            let held = solve(&on_two(&scene, 1e12)).unwrap();
            let law = shrinkage_factor(held.tie_squares(), shrinkage.given, weight);
            assert!(
                (shrinkage.factor - law).abs() < 1e-9,
                "{} {law}",
                shrinkage.factor
            );
            // Each control moves inward by half of it, and nothing across.
            let line = net.controls[1].at - net.controls[0].at;
            let inward = 0.5 * shrinkage.given * (1.0 - shrinkage.factor);
            let along = line / line.norm();
            for (residual, sign) in solution.control_residuals.iter().zip([-1.0, 1.0]) {
                let off = residual.unwrap() / along - sign * inward;
                assert!(off.norm() < 1e-6, "{off} m"); // 1e-11 of the figure
            }
            // The cure is the figure that holds its controls.
            let cured = solution.unshrunk(&net);
            let differences = cured.places.iter().zip(&held.places);
            let worst = largest(differences.map(|(a, b)| (a.unwrap() - b.unwrap()).norm()));
            assert!(worst < 1e-3, "{worst} m"); // the weight of 1e12 leaves that much
        }
    }
}

#[test]
fn shrinkage_is_of_the_size_of_the_prototype_and_quadratic_in_the_noise() {
    let factor = |noise_m: f64, seed| {
        let net = on_two(&nine(noise_m).simulate(seed), 1.0);
        Shrinkage::of(&net, &solve(&net).unwrap()).unwrap()
    };
    let mut all: Vec<f64> = (0..21).map(|seed| factor(1_000.0, seed).factor).collect();
    all.sort_by(f64::total_cmp);
    // 0.9978 to 0.9984 in the prototype; distance and overlaps of the seed make the difference.
    assert!(all[0] > 0.990 && all[20] < 0.9995, "{all:?}");
    assert!((0.9970..0.9990).contains(&all[10]), "{all:?}");
    for seed in 0..10 {
        let moved = |noise_m| 1.0 - factor(noise_m, seed).factor;
        for (noise_m, times) in [(50.0, 0.0025), (250.0, 0.0625), (2_000.0, 4.0)] {
            let ratio = moved(noise_m) / (moved(1_000.0) * times);
            // Terms of the fourth order, and ties that turn with the noise.
            assert!((ratio - 1.0).abs() < 0.05, "{noise_m}: {ratio}");
        }
    }
}

/// BRICK, EXTEND and SCALE.
fn by_bricks(scene: &PlaneScene, bricks: &[Vec<usize>]) -> (Vec<Figure>, Block, Similarity) {
    let figures: Vec<Figure> = bricks
        .iter()
        .map(|pictures| brick(&scene.net, pictures).unwrap())
        .collect();
    let block = extend(&scene.net, &figures).unwrap();
    let scaled = scaled(scene, &block.places);
    (figures, block, scaled)
}

fn scaled(scene: &PlaneScene, places: &[Option<Place>]) -> Similarity {
    let controls = scene.net.controls.iter();
    let (from, to): (Vec<Place>, Vec<Place>) = controls
        .map(|control| (places[control.point].unwrap(), control.at))
        .unzip();
    scale(&from, &to, 4.0).unwrap().similarity
}

#[test]
fn bricks_extended_and_scaled_are_the_one_shot_solution() {
    for (noise_m, limit_m) in [(0.0, 1e-6), (30.0, 60.0)] {
        let recipe = PlaneRecipe {
            noise_m,
            ..TERTIARY
        };
        let scene = recipe.simulate(3);
        let (figures, block, to_map) = by_bricks(&scene, &bricks_of_columns(&scene, 5));
        // All pictures at once on two controls, the figure as free as EXTEND leaves it, then SCALE.
        let two = on_two(&scene, 1.0);
        let free = solve(&two).unwrap().unshrunk(&two);
        let free_to_map = scaled(&scene, &free.places);
        let apart = |places: &[Option<Place>], to_map: &Similarity| {
            let found = places.iter().map(|place| to_map.map(place.unwrap()));
            rms(found
                .zip(&free.places)
                .map(|(a, b)| a - free_to_map.map(b.unwrap())))
        };
        // Exact data to a micrometre; with noise, twice that of an image.
        let found = apart(&block.places, &to_map);
        assert!(found < limit_m, "{found} m at {noise_m} m");
        // MORTAR on light controls, scaled again, tells the same.
        let mut light = scene.net.clone();
        for control in &mut light.controls {
            control.weight = 1e-6;
        }
        let joined = mortar(&light, &figures).unwrap();
        let found = apart(&joined.places, &scaled(&scene, &joined.places));
        assert!(found < limit_m, "MORTAR: {found} m at {noise_m} m");
    }
}

/// Root mean square distance of a coordinate of points that several bricks show from the mean over the bricks, metres.
fn seams(scene: &PlaneScene, bricks: &[Vec<usize>], pictures: &[Similarity]) -> f64 {
    let mut images: Vec<Vec<(usize, Place)>> = vec![Vec::new(); scene.net.points];
    for measured in &scene.net.measurements {
        let brick = bricks
            .iter()
            .position(|of| of.contains(&measured.picture))
            .unwrap();
        images[measured.point].push((brick, pictures[measured.picture].map(measured.at)));
    }
    let mut rests = Vec::new();
    for of in &images {
        let means: Vec<Place> = (0..bricks.len())
            .filter_map(|brick| {
                let own: Vec<Place> = of
                    .iter()
                    .filter(|(b, _)| *b == brick)
                    .map(|(_, p)| *p)
                    .collect();
                (!own.is_empty()).then(|| own.iter().sum::<Place>() / own.len() as f64)
            })
            .collect();
        if means.len() > 1 {
            let mean = means.iter().sum::<Place>() / means.len() as f64;
            rests.extend(means.iter().map(|of| of - mean));
        }
    }
    rms(rests.into_iter())
}

#[test]
fn seams_are_wider_than_bricks_are_within_and_local_evens_them_out() {
    for seed in 0..5 {
        let scene = TERTIARY.simulate(seed);
        let bricks = bricks_of_columns(&scene, 5);
        let (figures, block, to_map) = by_bricks(&scene, &bricks);
        let to_map_of = |pictures: Vec<Similarity>| -> Vec<Similarity> {
            pictures
                .iter()
                .map(|picture| to_map.after(picture))
                .collect()
        };
        let before = seams(
            &scene,
            &bricks,
            &to_map_of(block.pictures(&scene.net, &figures)),
        );
        let after = seams(
            &scene,
            &bricks,
            &to_map_of(local(&scene.net, &figures, &block).unwrap()),
        );
        assert!(after < 0.9 * before, "seed {seed}: {before} m to {after} m");
    }
}

#[test]
fn heavier_controls_are_met_and_lighter_ones_are_not() {
    let scene = PlaneRecipe {
        control_sigma_m: 2_000.0,
        ..nine(250.0)
    }
    .simulate(4);
    let off = |weight: f64| {
        let mut net = scene.net.clone();
        for control in &mut net.controls {
            control.weight = weight;
        }
        let solution = solve(&net).unwrap();
        largest(
            solution
                .control_residuals
                .iter()
                .map(|of| of.unwrap().norm()),
        )
    };
    let found = [0.01, 1.0, 100.0, 1e8].map(off);
    assert!(found.windows(2).all(|pair| pair[1] < pair[0]), "{found:?}");
    assert!(found[0] > 1_000.0 && found[3] < 0.1, "{found:?}");
}

#[test]
fn the_order_of_pictures_changes_nothing() {
    let scene = nine(250.0).simulate(5);
    let solution = solve(&scene.net).unwrap();
    let turned = |picture: usize| (picture * 4 + 5) % 9;
    let mut net = scene.net.clone();
    for measured in &mut net.measurements {
        measured.picture = turned(measured.picture);
    }
    net.measurements.reverse();
    net.controls.reverse();
    let other = solve(&net).unwrap();
    for (picture, similarity) in solution.pictures.iter().enumerate() {
        let again = &other.pictures[turned(picture)];
        assert!((similarity.turn - again.turn).norm() < 1e-9 * similarity.turn.norm());
    }
    let differences = solution.places.iter().zip(&other.places);
    let worst = largest(differences.map(|(a, b)| (a.unwrap() - b.unwrap()).norm()));
    assert!(worst < 1e-6, "{worst} m"); // 1e-9 km
}

#[test]
fn what_moves_the_controls_moves_the_result() {
    let scene = nine(250.0).simulate(6);
    let solution = solve(&scene.net).unwrap();
    let moved = Similarity {
        turn: Place::from_polar(1.0, 1.1),
        shift: Place::new(7.5e5, -2.0e5),
    };
    let mut net = scene.net.clone();
    for control in &mut net.controls {
        control.at = moved.map(control.at);
    }
    let other = solve(&net).unwrap();
    let differences = solution.places.iter().zip(&other.places);
    let worst = largest(differences.map(|(a, b)| (moved.map(a.unwrap()) - b.unwrap()).norm()));
    assert!(worst < 1e-6, "{worst} m"); // 1e-9 km
    let differences = solution.deviations.iter().zip(&other.deviations);
    let worst = largest(differences.map(|(a, b)| (moved.turn * a - b).norm()));
    assert!(worst < 1e-6, "{worst} m");
}

#[test]
fn many_pictures_are_solved_as_few_are() {
    // A strip round a loop in the order of elimination: thirty by thirty pictures.
    let scene = PlaneRecipe {
        grid: [30, 30],
        points: 12_000,
        controls: 40,
        noise_m: 100.0,
        ..PlaneRecipe::NINE
    }
    .simulate(7);
    let solution = solve(&scene.net).unwrap();
    let found = solution.sigma(&scene.net).unwrap();
    // Of some ten thousand residuals: 100 m within 3 %.
    assert!((found / 100.0 - 1.0).abs() < 0.03, "{found} m");
    // Errors over stated standard deviations: those of neighbours hang together, so 15 %.
    let precision = solution.precision();
    let of_point = Solution::measurements_of(&scene.net);
    let controls = &scene.net.controls;
    let normalised = errors(&scene, &solution.places)
        .enumerate()
        .map(|(point, error)| {
            let weight = controls
                .iter()
                .find(|of| of.point == point)
                .map(|of| of.weight);
            error / (100.0 * precision.place(&scene.net, &of_point[point], weight).sqrt())
        });
    let found = rms(normalised);
    assert!((found - 1.0).abs() < 0.15, "{found}");
}

/// Adjusted with the weights of a recipe.
fn weighted(scene: &PlaneScene, weight: f64) -> (Net, Solution) {
    let mut net = scene.net.clone();
    for control in &mut net.controls {
        control.weight = weight;
    }
    let solution = solve(&net).unwrap();
    (net, solution)
}
