//! Details that the public interface does not show: derivatives, and the elimination against dense equations.

use nalgebra::{DMatrix, DVector, Vector2, Vector3};

use super::{
    BundleImage, BundleOptions, BundlePoint, KnownCoordinates, Network, ORIENTATION_UNKNOWNS,
    Range, View,
    factor::Factor,
    groups::PointGroups,
    layout::{Layout, Linearised},
    point_rows::PointRows,
    reduce::reduce,
    solve,
    unknowns::{State, Unknown},
};
use crate::{
    collinearity::project,
    pushbroom::{Distortion, EulerPolynomial, ExteriorOrientation, Sighting, VectorPolynomial},
};

const FOCAL_LENGTH_PX: f64 = 3_500.0 / 0.026;

/// A camera that flies north over the equator at longitude zero, `roll_rad` to the side.
fn image(east_m: f64, roll_rad: f64) -> BundleImage<EulerPolynomial> {
    let path_m = VectorPolynomial {
        coefficients: [
            Vector3::new(3_776e3, east_m, -300.0),
            Vector3::new(0.0, 0.0, 4.4),
            Vector3::new(-1e-6, 2e-7, 0.0),
        ],
    };
    // Camera axes: X south, Z down; hence M = Ry(−90°) and a turn about X.
    let angles_rad = VectorPolynomial {
        coefficients: [
            Vector3::new(roll_rad, -1.4, 1e-3),
            Vector3::new(1e-8, 1e-6, -2e-8),
            Vector3::new(1e-13, -3e-12, 2e-13),
        ],
    };
    BundleImage {
        base: EulerPolynomial { path_m, angles_rad },
        half_lines: 5_000.0,
        line_period_s: 1.4e-3,
        focal_length_px: FOCAL_LENGTH_PX,
        distortion: Distortion::NONE,
        sigmas: std::array::from_fn(|index| if index < 9 { 100.0 } else { 2.6e-4 }),
        time_bias_sigma_s: 0.05,
    }
}

/// Three images, nine points; the first four carry coordinates and ranges, the last is seen by three.
pub(super) fn network() -> Network<EulerPolynomial> {
    let images = vec![image(0.0, 0.02), image(-150e3, 0.39), image(90e3, -0.22)];
    let mut network = Network {
        range_bias_sigmas_m: vec![30.0],
        ..Network::default()
    };
    for index in 0..9_u32 {
        let spread = f64::from(index) - 4.0;
        let x_lines = 900.0 * spread;
        let pose = images[0].base.pose(x_lines);
        let camera = Vector3::new(0.0, 1e-3 * spread, 1.0);
        let ground_m = pose.position_m
            + pose.mars_to_camera.tr_mul(&camera) * (380e3 + 60.0 * spread * spread);
        let point = network.points.len();
        let mola = index < 4;
        network.points.push(BundlePoint {
            ground_m,
            known: mola.then(|| KnownCoordinates::of_sigmas(Vector3::new(10.0, 12.0, 14.0))),
        });
        for (number, image) in images.iter().enumerate() {
            if number == 2 && index != 8 {
                continue;
            }
            // Any line serves: the equations need not be satisfied where they are only compared.
            let seen = image.base.pose(x_lines).camera_vector_m(&ground_m);
            let focal = project(&seen, image.focal_length_px).unwrap();
            network.views.push(View {
                point,
                image: number,
                x_lines,
                y_px: focal.y + 0.3 * spread,
                sigma_px: Vector2::new(1.0, 0.8),
            });
        }
        if mola {
            network.ranges.push(Range {
                to_laser_m: Vector3::new(-0.2, 0.3, 4.1),
                point,
                image: usize::from(index % 2 == 1),
                x_lines: x_lines + 20.0,
                range_m: 380e3,
                sigma_m: 10.0,
                profile: 0,
            });
        }
    }
    network.images = images;
    network
}

pub(super) fn layout(
    network: &Network<EulerPolynomial>,
) -> (Layout<'_, EulerPolynomial>, State, Vec<usize>) {
    let layout = Layout::of(network);
    let corrections = DVector::zeros(layout.columns.len());
    let points_m = network.points.iter().map(|point| point.ground_m).collect();
    let state = State::new(network, &layout.columns, corrections, points_m);
    (layout, state, (0..network.points.len()).collect())
}

#[test]
fn derivatives_equal_central_differences() {
    let network = network();
    let (layout, start, _) = layout(&network);
    // Also away from the initial values: rotations of 1e-3 to 1e-2 rad.
    let corrections = DVector::from_fn(layout.columns.len(), |column, _| {
        let sign = if column % 2 == 0 { 1.0 } else { -1.0 };
        let size = match layout.columns.unknowns[column] {
            Unknown::Orientation { coefficient, .. } if coefficient < 9 => 150.0,
            Unknown::Orientation { coefficient, .. } => 5e-4 * coefficient as f64,
            Unknown::TimeBias { .. } => 0.03,
            Unknown::RangeBias { .. } => 25.0,
            Unknown::AttitudeClock => 0.7,
            Unknown::ProfileShift { .. } | Unknown::LineTime { .. } | Unknown::Boresight { .. } => {
                0.0
            }
        };
        sign * size
    });
    let corrected = State::new(
        &network,
        &layout.columns,
        corrections,
        start.points_m.clone(),
    );
    for state in [start, corrected] {
        derivatives_at(&network, &layout, &state);
    }
}

fn derivatives_at(
    network: &Network<EulerPolynomial>,
    layout: &Layout<'_, EulerPolynomial>,
    state: &State,
) {
    let at = |column: Option<usize>, step: f64, move_m: Vector3<f64>, point: usize| {
        let mut corrections = state.corrections.clone();
        if let Some(column) = column {
            corrections[column] += step;
        }
        let mut points_m = state.points_m.clone();
        points_m[point] += move_m;
        State::new(network, &layout.columns, corrections, points_m)
    };
    // Computed values: misclosures with the sign turned.
    let view = |state: &State, index: usize| {
        let rows = layout.view_rows(state, index).unwrap();
        rows.map(|row| -row.misclosure)
    };
    let close = |numeric: f64, analytic: f64, scale: f64| {
        assert!(
            (numeric - analytic).abs() < 1e-6 * scale,
            "{numeric} {analytic}"
        );
    };
    for index in [0, 1, 9, 18] {
        let entry = &network.views[index];
        let analytic = layout.view_rows(state, index).unwrap();
        for unknown in 0..=ORIENTATION_UNKNOWNS {
            let column = layout.columns.of_image[entry.image][unknown];
            // Steps whose truncation and rounding are both far below 1e-6 of the derivative: the line moves
            // with the unknown, and a quadratic term by a share of `step/1e4 m` with the line.
            let step = match unknown {
                0..9 => 4.0,
                9..18 => 1e-5,
                _ => 2e-3,
            };
            let ahead = view(&at(column, step, Vector3::zeros(), entry.point), index);
            let behind = view(&at(column, -step, Vector3::zeros(), entry.point), index);
            for axis in 0..2 {
                let partials = analytic[axis].by_image();
                let group = unknown / 3 * 3..(unknown / 3 * 3 + 3).min(partials.len());
                let norm = |row: usize| {
                    let partials = analytic[row].by_image();
                    DVector::from_column_slice(&partials[group.clone()]).norm()
                };
                // A row also includes part of the other's derivatives by the line.
                let scale = norm(axis).max(0.1 * norm(1 - axis));
                let numeric = (ahead[axis] - behind[axis]) / (2.0 * step);
                close(numeric, partials[unknown], scale.max(1e-2));
            }
        }
        for axis in 0..3 {
            let mut step_m = Vector3::zeros();
            step_m[axis] = 4.0;
            let ahead = view(&at(None, 0.0, step_m, entry.point), index);
            let behind = view(&at(None, 0.0, -step_m, entry.point), index);
            for row in 0..2 {
                let numeric = (ahead[row] - behind[row]) / 8.0;
                close(
                    numeric,
                    analytic[row].by_point[axis],
                    analytic[row].by_point.norm(),
                );
            }
        }
    }
    let range = &network.ranges[1];
    let analytic = layout.range_row(state, 1).by_image();
    for (unknown, partial) in analytic.iter().enumerate() {
        let column = layout.columns.of_image[range.image][unknown];
        let step = if unknown < 9 { 20.0 } else { 1e-4 };
        let distance = |step: f64| {
            let moved = at(column, step, Vector3::zeros(), range.point);
            -layout.range_row(&moved, 1).misclosure
        };
        let numeric = (distance(step) - distance(-step)) / (2.0 * step);
        close(numeric, *partial, 1.0);
    }
}

/// Rows of a point in all shared unknowns and all coordinates, and their misclosures.
pub(super) fn dense_rows(
    layout: &Layout<'_, EulerPolynomial>,
    at: &Linearised,
    point: usize,
) -> (DMatrix<f64>, DVector<f64>) {
    let shared = layout.columns.len();
    let mut rows = PointRows::default();
    layout.fill(&mut rows, at, point).unwrap();
    let count = rows.weights.len();
    let mut dense = DMatrix::zeros(count, shared + 3 * layout.network.points.len());
    let mut misclosures = DVector::zeros(count);
    for row in 0..count {
        for (column, partial) in rows.columns().zip(rows.row(row)) {
            dense[(row, column)] = *partial;
        }
        misclosures[row] = *rows.row(row).last().unwrap();
        for axis in 0..3 {
            dense[(row, shared + 3 * point + axis)] = rows.by_point[row][axis];
        }
    }
    (dense, misclosures)
}

/// A chain of images side by side: each point is seen by two neighbours, or by an image and the next but one.
fn chain() -> Network<EulerPolynomial> {
    let mut network = network();
    network.images = (0..7)
        .map(|number| {
            image(
                40e3 * f64::from(number) - 120e3,
                0.1 * f64::from(3 - number),
            )
        })
        .collect();
    network.ranges.clear();
    network.views.clear();
    let ground_m: Vec<Vector3<f64>> = network.points.iter().map(|point| point.ground_m).collect();
    network.points.clear();
    for first in 0..6 {
        let second = (first + 1 + first % 2).min(6);
        for ground_m in &ground_m {
            for image in [first, second] {
                let base = &network.images[image].base;
                let seen = Sighting::near(base, &Distortion::NONE, 0.0, ground_m, 1e-3).unwrap();
                let focal = project(&seen.solution.camera_m, FOCAL_LENGTH_PX).unwrap();
                let point = network.points.len();
                let error = 0.4 * (1.7 * (point + 5 * image) as f64).sin();
                network.views.push(View {
                    point,
                    image,
                    x_lines: seen.solution.x + error,
                    y_px: focal.y - error,
                    sigma_px: Vector2::new(1.0, 0.8),
                });
            }
            network.points.push(BundlePoint {
                ground_m: *ground_m,
                known: None,
            });
        }
    }
    network
}

#[test]
fn elimination_equals_the_dense_equations() {
    against_dense(&network());
}

#[test]
fn sparse_equations_equal_the_dense_ones() {
    let network = chain();
    let (layout, start, active) = layout(&network);
    let at = layout.linearise(start);
    let groups = PointGroups::of(&layout, active);
    let reduced = reduce(&layout, &at, &groups).unwrap();
    let last = layout.columns.len() - 1;
    assert_eq!(reduced.matrix.element(0, last), None); // the first image shares nothing with the last
    against_dense(&network);
}

fn against_dense(network: &Network<EulerPolynomial>) {
    let (layout, state, active) = layout(network);
    let at = layout.linearise(state);
    let shared = layout.columns.len();
    let unknowns = shared + 3 * active.len();
    let mut normal = DMatrix::zeros(unknowns, unknowns);
    let mut right = DVector::zeros(unknowns);
    for point in &active {
        let (dense, misclosures) = dense_rows(&layout, &at, *point);
        normal += dense.tr_mul(&dense);
        right += dense.tr_mul(&misclosures);
    }
    for (column, sigma) in layout.columns.sigmas.iter().enumerate() {
        normal[(column, column)] += sigma.powi(-2);
    }
    // Scaled explicitly, for the plain inverse to be accurate enough.
    let scale = normal.diagonal().map(|value| 1.0 / value.sqrt());
    let scaled = DMatrix::from_fn(unknowns, unknowns, |row, column| {
        normal[(row, column)] * scale[row] * scale[column]
    });
    let factor = scaled.cholesky().unwrap();
    let dense_step = factor
        .solve(&right.component_mul(&scale))
        .component_mul(&scale);
    let dense_cofactors = factor.inverse();

    let groups = PointGroups::of(&layout, active);
    let reduced = reduce(&layout, &at, &groups).unwrap();
    let factor = Factor::new(&reduced.matrix, None).unwrap();
    let step = factor.solve(&reduced.right);
    for (column, sigma) in layout.columns.sigmas.iter().enumerate() {
        // As shares of the standard deviations; steps are of their order.
        assert!(
            (step[column] - dense_step[column]).abs() < 1e-9 * sigma,
            "{column}"
        );
    }
    let inverse = factor.cofactors(&reduced.matrix);
    for column in 0..shared {
        for row in 0..=column {
            let Some(found) = inverse.element(row, column) else {
                continue;
            };
            // As shares of the variances.
            let variances = [row, column].map(|at| dense_cofactors[(at, at)].sqrt() * scale[at]);
            let dense = dense_cofactors[(row, column)] * scale[row] * scale[column];
            assert!((found - dense).abs() < 1e-9 * variances[0] * variances[1]);
        }
    }
    for point in &groups.points {
        let mut rows = PointRows::default();
        layout.fill(&mut rows, &at, *point).unwrap();
        let step_m = rows.point_step_m(&step).unwrap();
        for axis in 0..3 {
            let dense_m = dense_step[shared + 3 * point + axis];
            let largest_m = dense_step.rows(shared, 3 * groups.points.len()).amax();
            assert!((step_m[axis] - dense_m).abs() < 1e-9 * largest_m);
        }
    }
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let network = chain();
    let with_threads = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        let pool = pool.build().unwrap();
        pool.install(|| solve(&network, &BundleOptions::default()).unwrap())
    };
    assert_eq!(with_threads(1), with_threads(5));
}

#[test]
fn cofactors_of_points_equal_those_of_the_dense_equations() {
    let network = network();
    let adjustment = solve(&network, &BundleOptions::default()).unwrap();
    let (layout, start, active) = layout(&network);
    let mut corrections = start.corrections.clone();
    for (image, adjusted) in adjustment.images.iter().enumerate() {
        for (coefficient, value) in adjusted.correction.coefficients().iter().enumerate() {
            corrections[layout.columns.of_image[image][coefficient].unwrap()] = *value;
        }
        corrections[layout.columns.of_image[image][ORIENTATION_UNKNOWNS].unwrap()] =
            adjusted.time_bias_s.unwrap().0;
    }
    corrections[layout.columns.of_profile[0].unwrap()] = adjustment.range_biases_m[0].unwrap().0;
    let points_m = adjustment
        .points
        .iter()
        .map(|point| point.unwrap().ground_m)
        .collect();
    let state = State::new(&network, &layout.columns, corrections, points_m);
    let at = layout.linearise(state);
    let shared = layout.columns.len();
    let unknowns = shared + 3 * active.len();
    let mut normal = DMatrix::zeros(unknowns, unknowns);
    for point in &active {
        let (dense, _) = dense_rows(&layout, &at, *point);
        normal += dense.tr_mul(&dense);
    }
    for (column, sigma) in layout.columns.sigmas.iter().enumerate() {
        normal[(column, column)] += sigma.powi(-2);
    }
    let scale = normal.diagonal().map(|value| 1.0 / value.sqrt());
    for row in 0..unknowns {
        for column in 0..unknowns {
            normal[(row, column)] *= scale[row] * scale[column];
        }
    }
    let inverse = normal.cholesky().unwrap().inverse();
    for point in active {
        let cofactor_m2 = adjustment.points[point].unwrap().cofactor_m2;
        for row in 0..3 {
            for column in 0..3 {
                let (r, c) = (shared + 3 * point + row, shared + 3 * point + column);
                let dense = inverse[(r, c)] * scale[r] * scale[c];
                // The point moved by rounding since the last step.
                assert!((cofactor_m2[(row, column)] - dense).abs() < 1e-6 * cofactor_m2.trace());
            }
        }
    }
}

#[test]
fn unknown_parts_of_a_network_are_reported() {
    let mut lost = network();
    lost.views[3].point = 99;
    let error = solve(&lost, &BundleOptions::default()).unwrap_err();
    assert_eq!(
        error.to_string(),
        "view 3 belongs to point 99, which is not in the network"
    );
    let mut lost = network();
    lost.ranges[1].profile = 7;
    let error = solve(&lost, &BundleOptions::default()).unwrap_err();
    assert_eq!(
        error.to_string(),
        "range 1 belongs to profile 7, which is not in the network"
    );
}
