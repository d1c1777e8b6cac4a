//! Shan et al. 2005, Table 4 (position), from a circular orbit alone.

use areograph::{constants::MARS_IAU2000, geom::polynomial::Polynomial, units::RADIANS_PER_DEGREE};
use nalgebra::{Rotation3, Vector3};

/// Gravitational parameter, m³/s²; radius of the orbit, m; its inclination; rotation of Mars, rad/s.
const GM: f64 = 42_828.37e9;
const RADIUS_M: f64 = 3_776.3e3;
const INCLINATION_DEG: f64 = 92.9;

struct Row {
    id: &'static str,
    latitude_deg: f64,
    longitude_deg: f64,
    lines: f64,
    period_s: f64,
    first_order_m: [f64; 3],
    second_order_m: [f64; 3],
    /// The Isidis rows of second order show a defect of the orbit data that the paper used.
    second_order_counts: bool,
}

const TABLE: [Row; 6] = [
    Row {
        id: "E02-02855",
        latitude_deg: -13.4,
        longitude_deg: -41.65,
        lines: 9_856.0,
        period_s: 1.8078e-3,
        first_order_m: [29.035, 23.662, 8.762],
        second_order_m: [0.001, 0.019, 0.051],
        second_order_counts: true,
    },
    Row {
        id: "E04-01275",
        latitude_deg: -13.4,
        longitude_deg: -44.05,
        lines: 8_064.0,
        period_s: 1.2052e-3,
        first_order_m: [8.339, 7.389, 2.639],
        second_order_m: [0.0003, 0.003, 0.008],
        second_order_counts: true,
    },
    Row {
        id: "E02-00665",
        latitude_deg: -14.6,
        longitude_deg: 175.3,
        lines: 10_496.0,
        period_s: 1.4462e-3,
        first_order_m: [26.998, 0.716, 7.051],
        second_order_m: [0.007, 0.010, 0.031],
        second_order_counts: true,
    },
    Row {
        id: "E02-01453",
        latitude_deg: -14.6,
        longitude_deg: 177.8,
        lines: 8_960.0,
        period_s: 1.4462e-3,
        first_order_m: [19.697, 0.299, 5.078],
        second_order_m: [0.005, 0.006, 0.020],
        second_order_counts: true,
    },
    Row {
        id: "E02-01301",
        latitude_deg: 4.5,
        longitude_deg: 88.0,
        lines: 8_064.0,
        period_s: 0.9642e-3,
        first_order_m: [0.749, 7.285, 2.776],
        second_order_m: [0.288, 0.193, 2.256],
        second_order_counts: false,
    },
    Row {
        id: "E02-02016",
        latitude_deg: 4.5,
        longitude_deg: 88.0,
        lines: 8_064.0,
        period_s: 1.4462e-3,
        first_order_m: [1.693, 16.525, 1.537],
        second_order_m: [0.049, 0.035, 0.382],
        second_order_counts: false,
    },
];

/// Position in the rotating frame of Mars, `seconds` after the site was overflown northwards.
fn position_m(row: &Row, seconds: f64) -> Vector3<f64> {
    let inclination = INCLINATION_DEG * RADIANS_PER_DEGREE;
    let along = ((row.latitude_deg * RADIANS_PER_DEGREE).sin() / inclination.sin()).asin();
    let east_of_node = (inclination.cos() * along.sin()).atan2(along.cos());
    let node = row.longitude_deg * RADIANS_PER_DEGREE - east_of_node;
    let argument = along + (GM / RADIUS_M.powi(3)).sqrt() * seconds;
    let in_plane = RADIUS_M * Vector3::new(argument.cos(), argument.sin(), 0.0);
    let mars_rad_s = MARS_IAU2000.meridian_deg_per_day * RADIANS_PER_DEGREE / 86_400.0;
    Rotation3::from_axis_angle(&Vector3::z_axis(), node - mars_rad_s * seconds)
        * Rotation3::from_axis_angle(&Vector3::x_axis(), inclination)
        * in_plane
}

fn norm(rmse_m: [f64; 3]) -> f64 {
    Vector3::from(rmse_m).norm()
}

#[test]
fn position_residuals_of_table_4_follow_from_the_orbit() {
    for row in &TABLE {
        let duration_s = row.lines * row.period_s;
        let x: Vec<f64> = (0..31).map(|k| f64::from(k) / 15.0 - 1.0).collect();
        let positions: Vec<Vector3<f64>> = x
            .iter()
            .map(|x| position_m(row, x * duration_s / 2.0))
            .collect();
        let rmse = |order: usize| {
            [0, 1, 2].map(|axis| {
                let y: Vec<f64> = positions.iter().map(|position| position[axis]).collect();
                Polynomial::fit(&x, &y, order).unwrap().rmse
            })
        };
        let [first, second] = [rmse(1), rmse(2)];
        println!("{}: {first:.3?} {second:.4?}", row.id);
        let share = norm(first) / norm(row.first_order_m) - 1.0;
        let isidis = !row.second_order_counts;
        // 1 % where the paper's orbit is sound; its Isidis rows carry up to 2.3 m of something else.
        let limit = if isidis { 0.08 } else { 0.01 };
        assert!(share.abs() < limit, "{} first order {share}", row.id);
        if row.second_order_counts {
            let share = norm(second) / norm(row.second_order_m) - 1.0;
            assert!(share.abs() < 0.06, "{} second order {share}", row.id);
        }
    }
}
