//! Arthur & McMacken 1977: planimetric triangulation of rectified pictures.

use areograph::geom::polynomial::root_mean_square;

use super::row::{Account, Comparison, Paper, Row, number};

pub(crate) static PAPER: Paper = Paper {
    name: "Arthur & McMacken 1977",
    citation: "Plane triangulation of rectified pictures.",
    prefix: "A77",
    count: 15,
    rows: &[&ROWS],
};

/// Table 2: point, Mercator X and Y, residuals of both, kilometres.
const TERTIARY: [(u32, [f64; 2], [f64; 2]); 6] = [
    (90, [849.0, 146.3], [-1.8, -0.6]),
    (307, [642.8, 154.9], [1.3, -1.6]),
    (308, [805.4, 216.2], [0.1, 0.0]),
    (340, [765.1, 288.4], [0.4, 1.0]),
    (341, [715.3, 320.1], [-0.2, 0.0]),
    (342, [694.9, 298.1], [0.1, 1.2]),
];

fn residuals_km(axis: usize) -> Vec<f64> {
    TERTIARY
        .iter()
        .map(|(_, _, residual)| residual[axis])
        .collect()
}

/// Change of scale that is left in the residuals, given minus computed, parts per million.
fn scale_left_ppm() -> f64 {
    let mean = |axis: usize| {
        TERTIARY
            .iter()
            .map(|(_, place, _)| place[axis])
            .sum::<f64>()
            / TERTIARY.len() as f64
    };
    let means = [mean(0), mean(1)];
    let (mut moment, mut square) = (0.0, 0.0);
    for (_, place, residual) in TERTIARY {
        for axis in 0..2 {
            let from_centre = place[axis] - means[axis];
            moment += from_centre * residual[axis];
            square += from_centre * from_centre;
        }
    }
    1e6 * moment / square
}

fn table_2() -> Vec<Comparison> {
    let [x, y] = [0, 1].map(residuals_km);
    vec![
        number("sum of δX, km", "0", x.iter().sum(), 1).within(0.3),
        number("sum of δY, km", "0", y.iter().sum(), 1).within(0.3),
        number("scale left, ppm", "0", scale_left_ppm(), 0).within(250.0),
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

static ROWS: [Row; 15] = [
    Row {
        id: "A77-01",
        place: "introduction",
        what: "pictures",
        account: Account::NotYetComputed {
            printed: "Mariner camera about 14° wide; Viking 1°, most tilted 12.5°, 25 × 25 km",
        },
        note: "",
    },
    Row {
        id: "A77-02",
        place: "equations 2 and 3",
        what: "unknowns of m pictures and n points",
        account: Account::NotYetComputed {
            printed: "4m + 2n, about 8m; theirs 4 a picture",
        },
        note: "",
    },
    Row {
        id: "A77-03",
        place: "tie equations",
        what: "coefficients of a point on three pictures",
        account: Account::NotYetComputed {
            printed: "2/3, −1/3, −1/3",
        },
        note: "The three equations of an axis add up to zero: they count as two.",
    },
    Row {
        id: "A77-04",
        place: "block",
        what: "pictures in a block and in a brick, controls",
        account: Account::NotYetComputed {
            printed: "30–40; 6–10; two",
        },
        note: "",
    },
    Row {
        id: "A77-05",
        place: "primary net",
        what: "its accuracy",
        account: Account::Cited {
            printed: "a few km in the north, often worse than ±20 km in the south",
        },
        note: "",
    },
    Row {
        id: "A77-06",
        place: "secondary net",
        what: "tie deviations of nine pictures in one brick, km",
        account: Account::NotYetComputed {
            printed: "largest 0.6 (X), 0.9 (Y); rms about ¼",
        },
        note: "",
    },
    Row {
        id: "A77-07",
        place: "secondary net, SCALE",
        what: "controls rejected, and what the others leave, km",
        account: Account::NotYetComputed {
            printed: "478 and 483 with 17 and 19 in Y; then largest 2.1, rms about ±0.8",
        },
        note: "",
    },
    Row {
        id: "A77-08",
        place: "table 1",
        what: "tie deviations of three bricks: largest δX δY, rms δX δY, m",
        account: Account::NotYetComputed {
            printed: "59.0 56.1, 21.7 25.8; 98.5 62.2, 47.4 26.6; 43.2 33.4, 16.3 13.5",
        },
        note: "The pictures themselves are not at hand.",
    },
    Row {
        id: "A77-09",
        place: "table 1",
        what: "deviations from brick to brick: largest δX δY, rms δX δY, m",
        account: Account::NotYetComputed {
            printed: "97.9 169.7, 53.9 84.7",
        },
        note: "The pictures themselves are not at hand.",
    },
    Row {
        id: "A77-10",
        place: "table 2",
        what: "residuals of SCALE in the tertiary net",
        account: Account::Met {
            from: "the table's six points, as given minus computed",
            ours: table_2,
        },
        note: "Both residual columns are headed δY; the first is δX. A fitted shift and scale leave nothing: \
               rounding to 0.1 km allows 0.3 km of the sums and 125 ppm of scale, one standard deviation.",
    },
    Row {
        id: "A77-11",
        place: "text on table 2",
        what: "largest residual and rms",
        account: Account::Met {
            from: "the table's six points",
            ours: remarks,
        },
        note: "1.8 km is one coordinate; the longest vector is that of point 307.",
    },
    Row {
        id: "A77-12",
        place: "conclusions",
        what: "precision",
        account: Account::Cited {
            printed: "100 m within; within 2 km of the Mars circles",
        },
        note: "An estimate from the rows above, without a covariance.",
    },
    Row {
        id: "A77-13",
        place: "shrinkage",
        what: "residuals at two controls",
        account: Account::NotYetComputed {
            printed: "point inward",
        },
        note: "",
    },
    Row {
        id: "A77-14",
        place: "film",
        what: "distortion: linear, and quadratic with none at the corners",
        account: Account::NotYetComputed {
            printed: "δ = a x + b x²",
        },
        note: "",
    },
    Row {
        id: "A77-15",
        place: "measuring",
        what: "monocomparator",
        account: Account::Cited { printed: "5×" },
        note: "",
    },
];
