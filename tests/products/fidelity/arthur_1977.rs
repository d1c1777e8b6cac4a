//! Arthur & McMacken 1977: planimetric triangulation of rectified pictures.

use areograph::{
    geom::{
        plane::{
            Control, CornerZero, Measurement, Net, Place, Shrinkage, brick, fit_similarity,
            grow_bricks, projection_floor_m, scale, solve,
        },
        polynomial::root_mean_square,
    },
    scene::{PlaneRecipe, PlaneScene},
};

use super::{
    recipe::Normals,
    row::{Account, Comparison, Kind, Paper, Row, beyond_reach, derived, number},
};

pub(crate) static PAPER: Paper = Paper {
    name: "Arthur & McMacken 1977",
    citation: "Plane triangulation of rectified pictures.",
    prefix: "A77",
    count: 15,
    rows: &[&ROWS],
};

/// Table 2: point, Mercator X and Y, residuals of both, kilometres.
const TABLE_2: [(u32, [f64; 2], [f64; 2]); 6] = [
    (90, [849.0, 146.3], [-1.8, -0.6]),
    (307, [642.8, 154.9], [1.3, -1.6]),
    (308, [805.4, 216.2], [0.1, 0.0]),
    (340, [765.1, 288.4], [0.4, 1.0]),
    (341, [715.3, 320.1], [-0.2, 0.0]),
    (342, [694.9, 298.1], [0.1, 1.2]),
];

fn residuals_km(axis: usize) -> Vec<f64> {
    TABLE_2
        .iter()
        .map(|(_, _, residual)| residual[axis])
        .collect()
}

/// Change of scale that is left in the residuals, parts per million, when they are given minus computed (`1.0`) or the
/// other way round (`-1.0`).
fn scale_left_ppm(sign: f64) -> f64 {
    let (given, residuals): (Vec<Place>, Vec<Place>) = TABLE_2
        .iter()
        .map(|(_, [x, y], [dx, dy])| (Place::new(*x, *y), Place::new(*dx, *dy)))
        .unzip();
    let both = given.iter().zip(&residuals);
    let computed: Vec<Place> = both
        .map(|(given, residual)| given - residual * sign)
        .collect();
    let middle = computed.iter().sum::<Place>() / computed.len() as f64;
    let both = computed.iter().zip(&residuals);
    let moment: f64 = both
        .map(|(place, residual)| ((place - middle).conj() * residual).re)
        .sum();
    let square: f64 = computed
        .iter()
        .map(|place| (place - middle).norm_sqr())
        .sum();
    1e6 * moment / square
}

fn table_2() -> Vec<Comparison> {
    let [x, y] = [0, 1].map(residuals_km);
    vec![
        number("sum of δX, km", "0", x.iter().sum(), 1).within(0.3),
        number("sum of δY, km", "0", y.iter().sum(), 1).within(0.3),
        number("remaining scale, ppm", "0", scale_left_ppm(1.0), 0).within(250.0),
        number(
            "remaining scale for computed minus given, ppm",
            "0",
            scale_left_ppm(-1.0),
            0,
        )
        .shown(),
    ]
}

fn remarks() -> Vec<Comparison> {
    let largest = |values: &[f64]| {
        values
            .iter()
            .fold(0.0_f64, |most, value| most.max(value.abs()))
    };
    let [x, y] = [0, 1].map(residuals_km);
    let longest = x
        .iter()
        .zip(&y)
        .map(|(x, y)| x.hypot(*y))
        .fold(0.0, f64::max);
    vec![
        number(
            "largest residual, km",
            "1.8",
            largest(&x).max(largest(&y)),
            1,
        )
        .within(0.05),
        number("rms δX, km", "0.9", root_mean_square(&x), 3).within(0.05),
        number("rms δY, km", "0.9", root_mean_square(&y), 3).within(0.05),
        number("longest residual vector, km", "1.8", longest, 2).shown(),
    ]
}

/// Noise of the secondary net's measurements and of its controls that leaves the printed deviations, metres.
const SECONDARY_NOISE_M: f64 = 250.0 / 0.65;
const CONTROL_NOISE_M: f64 = 800.0;
const SEEDS: u64 = 20;

fn nine(noise_m: f64, seed: u64) -> PlaneScene {
    PlaneRecipe {
        noise_m,
        ..PlaneRecipe::NINE
    }
    .simulate(seed)
}

fn pictures() -> Vec<Comparison> {
    const MARS_RADIUS_M: f64 = 3_396e3;
    let half_m = 0.5 * PlaneRecipe::TERTIARY.side_m;
    let gradient = 22.5_f64.to_radians().tan() / MARS_RADIUS_M;
    vec![
        number(
            "side of a Viking picture, km",
            "25",
            PlaneRecipe::TERTIARY.side_m / 1e3,
            0,
        )
        .exact(),
        derived(
            "orthographic treated as conformal at 22.5°, error at the edge, m",
            "not published",
            projection_floor_m(half_m, gradient, MARS_RADIUS_M),
            1,
        )
        .shown(),
    ]
}

fn unknowns() -> Vec<Comparison> {
    let scene = nine(0.0, 1);
    let solution = solve(&scene.net).unwrap();
    let theirs = solution.redundancy.unknowns as f64 / scene.net.pictures as f64;
    vec![number("in the paper, per picture", "4", theirs, 0).exact()]
}

/// A point that three held pictures show, a metre off in the first of them.
fn thirds() -> Vec<Comparison> {
    let mut net = Net {
        pictures: 3,
        points: 7,
        ..Net::default()
    };
    for picture in 0..3 {
        let of = Place::new(100.0 * picture as f64, 0.0);
        for (end, at) in [(0, Place::new(0.0, 0.0)), (1, Place::new(10.0, 0.0))] {
            let point = 1 + 2 * picture + end;
            net.measurements.push(Measurement { picture, point, at });
            net.controls.push(Control {
                point,
                at: at + of,
                weight: 1e12,
            });
        }
        let off = if picture == 0 { 1.0 } else { 0.0 };
        net.measurements.push(Measurement {
            picture,
            point: 0,
            at: Place::new(50.0, off) - of,
        });
    }
    let solution = solve(&net).unwrap();
    let tied = net.measurements.iter().zip(&solution.deviations);
    let tied = tied.filter(|(measured, _)| measured.point == 0);
    // The weight of what holds the pictures leaves 1e-6.
    let rows = tied
        .zip(["2/3", "−1/3", "−1/3"])
        .map(|((_, deviation), printed)| {
            let third = if printed == "2/3" {
                "0.666667"
            } else {
                "-0.333333"
            };
            number(printed, third, deviation.im, 5).within(1e-4)
        });
    rows.collect()
}

fn bricks() -> Vec<Comparison> {
    let scene = PlaneRecipe::TERTIARY.simulate(1);
    let brick_of = grow_bricks(&scene.net, 8);
    let bricks = brick_of.iter().max().unwrap() + 1;
    let mean = scene.net.pictures as f64 / bricks as f64;
    vec![number("pictures per brick, 25 in all", "6–10", mean, 1).between(6.0, 10.0)]
}

/// Root mean square of the tie deviations of a coordinate in a brick of nine pictures, metres.
fn tie_rms_m(scene: &PlaneScene) -> f64 {
    let pictures: Vec<usize> = (0..scene.net.pictures).collect();
    let figure = brick(&scene.net, &pictures).unwrap();
    let (from, to): (Vec<Place>, Vec<Place>) = figure
        .places
        .iter()
        .map(|(point, place)| (*place, scene.points[*point]))
        .unzip();
    let unit_m = fit_similarity(&from, &to).unwrap().scale();
    let mut views = vec![0; scene.net.points];
    for measured in &scene.net.measurements {
        views[measured.point] += 1;
    }
    let tied = figure.deviations.iter().zip(&scene.net.measurements);
    let coordinates: Vec<f64> = tied
        .filter(|(_, measured)| views[measured.point] > 1)
        .flat_map(|((_, deviation), _)| [deviation.re * unit_m, deviation.im * unit_m])
        .collect();
    root_mean_square(&coordinates)
}

fn tie_deviations() -> Vec<Comparison> {
    let sum_m: f64 = (0..SEEDS)
        .map(|seed| tie_rms_m(&nine(SECONDARY_NOISE_M, seed)))
        .sum();
    let rms_m = sum_m / SEEDS as f64;
    vec![
        number("rms, km", "0.25", rms_m / 1e3, 3).share(0.15),
        derived(
            "rms over the noise",
            "not published",
            rms_m / SECONDARY_NOISE_M,
            2,
        )
        .shown(),
    ]
}

/// Whether SCALE keeps all of twelve controls but the two that are wrong, and what the others leave in a coordinate, metres.
fn two_gross_controls(seed: u64) -> (bool, f64) {
    let scene = nine(0.0, seed);
    let mut normals = Normals::new(seed);
    let figure: Vec<Place> = scene
        .net
        .controls
        .iter()
        .map(|control| control.at)
        .collect();
    let mut noisy =
        |place: &Place| place + Place::new(normals.next(), normals.next()) * CONTROL_NOISE_M;
    let mut given: Vec<Place> = figure.iter().map(&mut noisy).collect();
    let count = given.len();
    let first = usize::try_from(seed).unwrap() % count;
    let wrong = [first, (first + 5) % count];
    given[wrong[0]] += Place::new(0.0, 17_000.0);
    given[wrong[1]] += Place::new(0.0, 19_000.0);
    let scaled = scale(&figure, &given, 4.0).unwrap();
    let found = (0..count).all(|index| scaled.kept[index] != wrong.contains(&index));
    let [x, y] = scaled.rms();
    (found, 0.5 * (x + y))
}

fn gross_controls() -> Vec<Comparison> {
    let found: Vec<(bool, f64)> = (0..100).map(two_gross_controls).collect();
    let both = found.iter().filter(|(both, _)| *both).count();
    let mean_m = found.iter().map(|(_, rms_m)| rms_m).sum::<f64>() / found.len() as f64;
    vec![
        number(
            "both errors and no other control rejected, of 100 seeds",
            "100",
            both as f64,
            0,
        )
        .between(98.0, 100.0),
        number("rms of the other ten, km", "0.8", mean_m / 1e3, 2).share(0.15),
        beyond_reach("largest of the other ten, km", "2.1"),
    ]
}

fn shrinkage() -> Vec<Comparison> {
    let mut net = nine(1_000.0, 1).net;
    net.controls.truncate(2);
    let found = Shrinkage::of(&net, &solve(&net).unwrap()).unwrap();
    vec![
        number(
            "distance between the controls, ratio of computed to given",
            "below 1",
            found.factor,
            4,
        )
        .between(0.99, 0.9999),
        number(
            "difference from the law 1 / (1 + 2T/(w L²))",
            "0",
            found.factor - found.law,
            10,
        )
        .within(1e-10),
    ]
}

fn film() -> Vec<Comparison> {
    let (width, height) = (1_000.0, 800.0);
    let film = CornerZero::new(
        Place::new(0.0, 0.0),
        width,
        height,
        [[3.0, 3.0], [-2.0, -2.0]],
    )
    .unwrap();
    let moved = |x: f64, y: f64| film.distort(Place::new(x, y)) - Place::new(x, y);
    let corners = [(0.0, 0.0), (width, 0.0), (0.0, height), (width, height)];
    let worst = corners
        .map(|(x, y)| moved(x, y).norm())
        .into_iter()
        .fold(0.0, f64::max);
    vec![
        number("at the corners", "0", worst, 12).within(1e-12),
        number(
            "in the middle of an edge, of 3 measured there",
            "3",
            moved(0.5 * width, 0.0).re,
            12,
        )
        .within(1e-12),
    ]
}

static ROWS: [Row; 15] = [
    Row {
        id: "A77-01",
        kind: Kind::ClosedLoop,
        place: "introduction",
        what: "pictures: Mariner about 14° wide, overlap of Mariner 9 below 2 %; Viking 1°, most tilted 12.5°, 25 × 25 km",
        account: Account::Input {
            from: "the recipe of the synthetic tertiary net",
            ours: pictures,
            test: "tests/stages/plane.rs::seams_are_wider_than_bricks_are_within_and_local_evens_them_out",
        },
        note: "The paper uses orthographic pictures as if they were conformal; the second number is the error due to \
               this assumption.",
    },
    Row {
        id: "A77-02",
        kind: Kind::ClosedLoop,
        place: "equations 2 and 3",
        what: "unknowns of m pictures and n points: 4m + 2n, about 8m; in the paper, 4 per picture",
        account: Account::Agrees {
            from: "the equations of a synthetic net",
            ours: unknowns,
        },
        note: "A rigorous solution has 4m + 2n unknowns, or 8m with two points per picture.",
    },
    Row {
        id: "A77-03",
        kind: Kind::ClosedLoop,
        place: "tie equations",
        what: "coefficients of a point on three pictures",
        account: Account::Agrees {
            from: "deviations of a point that is in error in one of three pictures",
            ours: thirds,
        },
        note: "The three equations of an axis add up to zero, so two of them are independent.",
    },
    Row {
        id: "A77-04",
        kind: Kind::ClosedLoop,
        place: "block",
        what: "30–40 pictures in a block, 6–10 in a brick, two controls",
        account: Account::Input {
            from: "bricks grown in the synthetic tertiary net",
            ours: bricks,
            test: "tests/stages/plane.rs::bricks_extended_and_scaled_are_the_one_shot_solution",
        },
        note: "",
    },
    Row {
        id: "A77-05",
        kind: Kind::Constants,
        place: "primary net",
        what: "accuracy of the primary net",
        account: Account::Cited {
            printed: "a few km in the north, often worse than ±20 km in the south",
        },
        note: "",
    },
    Row {
        id: "A77-06",
        kind: Kind::ClosedLoop,
        place: "secondary net",
        what: "tie deviations of nine pictures in one brick: largest 0.6 (X), 0.9 km (Y), rms about ¼ km",
        account: Account::InPart {
            from: "nine pictures, 200 points, noise of 385 m, 20 seeds",
            ours: tie_deviations,
        },
        note: "The size is an input (closed loop): the rms deviation is 0.65 times the noise, which is chosen \
               accordingly. The largest deviations require data.",
    },
    Row {
        id: "A77-07",
        kind: Kind::ClosedLoop,
        place: "secondary net, SCALE",
        what: "478 and 483 rejected with 17 and 19 km in Y; then largest 2.1, rms about ±0.8 km",
        account: Account::InPart {
            from: "twelve controls with 0.8 km of noise, two of them in error by 17 and 19 km in Y",
            ours: gross_controls,
        },
        note: "The size is an input (closed loop). If they were rejected one at a time, as in the paper, the two \
               errors would mask each other in half of the cases.",
    },
    Row {
        id: "A77-08",
        kind: Kind::Evidence,
        place: "Table 1",
        what: "tie deviations of three bricks: largest δX δY, rms δX δY, m",
        account: Account::Data {
            printed: "59.0 56.1, 21.7 25.8; 98.5 62.2, 47.4 26.6; 43.2 33.4, 16.3 13.5",
        },
        note: "The 25 pictures are on film that is not available; deviations are proportional to the noise, as in \
               A77-06.",
    },
    Row {
        id: "A77-09",
        kind: Kind::Evidence,
        place: "Table 1",
        what: "deviations from brick to brick: largest δX δY, rms δX δY, m",
        account: Account::Data {
            printed: "97.9 169.7, 53.9 84.7",
        },
        note: "These deviations are larger than those within bricks. The synthetic net shows the same, and LOCAL \
               reduces the deviations \
               (tests/stages/plane.rs::seams_are_wider_than_bricks_are_within_and_local_evens_them_out).",
    },
    Row {
        id: "A77-10",
        kind: Kind::Arithmetic,
        place: "Table 2",
        what: "residuals of SCALE in the tertiary net",
        account: Account::Agrees {
            from: "the table's six points, as given minus computed",
            ours: table_2,
        },
        note: "Both residual columns have the heading δY; the first is δX. After a fit of shift and scale, both sums \
               and the remaining scale are zero: rounding to 0.1 km permits sums of up to 0.3 km and causes a standard \
               deviation of 125 ppm in scale.",
    },
    Row {
        id: "A77-11",
        kind: Kind::Arithmetic,
        place: "text on Table 2",
        what: "largest residual and rms",
        account: Account::Agrees {
            from: "the table's six points",
            ours: remarks,
        },
        note: "The published 1.8 km is one coordinate; the longest vector is that of point 307.",
    },
    Row {
        id: "A77-12",
        kind: Kind::Constants,
        place: "conclusions",
        what: "precision",
        account: Account::Cited {
            printed: "100 m within; within 2 km of the Mars circles",
        },
        note: "The paper estimates the precision from the rows above, without a covariance.",
    },
    Row {
        id: "A77-13",
        kind: Kind::ClosedLoop,
        place: "shrinkage",
        what: "residuals at two controls point inward, although there is no redundancy",
        account: Account::Agrees {
            from: "nine pictures with 1 km of noise on two controls",
            ours: shrinkage,
        },
        note: "Residuals of ties are measured on the map and shrink with it.",
    },
    Row {
        id: "A77-14",
        kind: Kind::ClosedLoop,
        place: "film",
        what: "distortion: linear, and quadratic without distortion at the corners",
        account: Account::Agrees {
            from: "quadratic distortion with its origin at a corner",
            ours: film,
        },
        note: "δ = a x + b x² vanishes at the corners with a = −b W.",
    },
    Row {
        id: "A77-15",
        kind: Kind::Constants,
        place: "measuring",
        what: "monocomparator",
        account: Account::Cited { printed: "5×" },
        note: "",
    },
];
