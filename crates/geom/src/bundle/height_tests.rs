//! Heights against a surface: the partitioned equations against dense ones of all unknowns.

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use super::{
    Adjustment, AttitudeClock, BundleOptions, HeightControl, Network, Residual,
    factor::Factor,
    groups::PointGroups,
    heights::Heights,
    layout::Linearised,
    prior_tests::{expected, prior_row, prior_variance},
    quality::judge,
    reduce::Settled,
    solve,
    solve::{Stop, settle},
    tests::{dense_rows, layout, network},
    unknowns::{State, Unknown},
};
use crate::{
    ellipsoid::height_m,
    pushbroom::{EulerPolynomial, ExteriorOrientation, Sighting},
    surface::{LaserSurface, SurfaceOptions, SurfaceShot},
};
use areograph_base::body::Body;

/// Points of the network that have a height: all that carry no coordinates of their own.
pub(super) const CONTROLLED: std::ops::Range<usize> = 4..9;

/// The network with measurements that all come from its points and initial orientations.
fn measured(mut network: Network<EulerPolynomial>) -> Network<EulerPolynomial> {
    for view in &mut network.views {
        let image = &network.images[view.image];
        let ground_m = &network.points[view.point].ground_m;
        let seen = Sighting::near(&image.base, &image.distortion, view.x_lines, ground_m, 1e-3);
        let seen = seen.unwrap().solution;
        view.x_lines = seen.x;
        view.y_px = -image.focal_length_px * seen.camera_m.y / seen.camera_m.z;
    }
    for range in &mut network.ranges {
        let pose = network.images[range.image].base.pose(range.x_lines);
        range.range_m = (network.points[range.point].ground_m - pose.position_m).norm();
    }
    network
}

/// Two profiles east and west of the points, `above_m` over the ground that these have.
fn surface(network: &Network<EulerPolynomial>, above_m: f64) -> LaserSurface {
    surface_with(network, above_m, &SurfaceOptions::default())
}

/// All controlled points observed above a surface.
fn observed(surface: LaserSurface) -> HeightControl {
    HeightControl {
        surface,
        jitter: None,
        common_noise: None,
        compared: Vec::new(),
        observed: CONTROLLED.collect(),
    }
}

pub(super) fn surface_with(
    network: &Network<EulerPolynomial>,
    above_m: f64,
    options: &SurfaceOptions,
) -> LaserSurface {
    let shots = [-800.0, 500.0].into_iter().enumerate();
    let shots: Vec<SurfaceShot> = shots
        .flat_map(|(profile, east_m)| {
            let points = network.points.iter();
            points.enumerate().flat_map(move |(index, point)| {
                (0..3).map(move |step| {
                    let north_m = 310.0 * f64::from(step);
                    let wave_m = 6.0 * (0.9 * (index as f64) + f64::from(step)).sin();
                    let moved = point.ground_m + Vector3::new(0.0, east_m, north_m);
                    let up = moved.normalize();
                    SurfaceShot {
                        ground_m: up * (point.ground_m.norm() + above_m + wave_m),
                        profile,
                        attitude_known: true,
                        off_nadir_rad: 0.0,
                    }
                })
            })
        })
        .collect();
    LaserSurface::new(&shots, &[], options).unwrap()
}

/// An attitude clock: the first and the last image follow nadir, the second is held towards a star.
fn attitude_clock() -> AttitudeClock {
    AttitudeClock {
        sigma_s: 1.0,
        turns_rad_s: vec![
            Vector3::new(1e-5, -8.7e-4, 2e-5),
            Vector3::new(-7e-6, 1e-6, 0.0),
            Vector3::new(3e-5, 8.6e-4, -1e-5),
        ],
    }
}

/// The converged network with heights of full covariance, and its statistics.
pub(super) struct Dense {
    /// Inverse of the normal matrix of all unknowns, and its solution there.
    pub(super) cofactors: DMatrix<f64>,
    step: DVector<f64>,
}

/// The equations of all unknowns at `state`, heights included, solved at once.
pub(super) fn dense(
    layout: &super::layout::Layout<'_, EulerPolynomial>,
    at: &Linearised,
    heights: &Heights,
    points: usize,
) -> Dense {
    let shared = layout.columns.len();
    let unknowns = shared + 3 * points;
    let mut normal = DMatrix::zeros(unknowns, unknowns);
    let mut right = DVector::zeros(unknowns);
    for point in 0..points {
        let (rows, misclosures) = dense_rows(layout, at, point);
        normal += rows.tr_mul(&rows);
        right += rows.tr_mul(&misclosures);
    }
    for (column, sigma) in layout.columns.sigmas.iter().enumerate() {
        let row = prior_row(layout, column, unknowns);
        let off = row.rows(0, shared).dot(&at.state.corrections) - expected(layout, column);
        normal += &row * row.transpose() * sigma.powi(-2);
        right -= row * (off * sigma.powi(-2));
    }
    let mut rows = DMatrix::zeros(heights.points.len(), unknowns);
    let mut above_m = DVector::zeros(heights.points.len());
    for (index, point) in heights.points.iter().enumerate() {
        let (difference_m, by_point) = heights.difference_m(&at.state, index);
        above_m[index] = difference_m;
        for axis in 0..3 {
            rows[(index, shared + 3 * point + axis)] = by_point[axis];
        }
        for (column, by_shift) in heights.by_shared(index) {
            rows[(index, column)] -= by_shift;
        }
    }
    let weights = heights.covariance_m2().cholesky().unwrap().inverse();
    normal += rows.tr_mul(&(&weights * &rows));
    right -= rows.tr_mul(&(&weights * above_m));
    // Scaled explicitly, for the plain inverse to be accurate enough.
    let scale = normal.diagonal().map(|value| 1.0 / value.sqrt());
    for row in 0..unknowns {
        for column in 0..unknowns {
            normal[(row, column)] *= scale[row] * scale[column];
        }
    }
    let scaled = normal.cholesky().unwrap().inverse();
    let cofactors = DMatrix::from_fn(unknowns, unknowns, |row, column| {
        scaled[(row, column)] * scale[row] * scale[column]
    });
    Dense {
        step: &cofactors * right,
        cofactors,
    }
}

#[test]
fn heights_by_parts_equal_the_dense_equations() {
    let network = network();
    let surface = surface(&network, 35.0);
    are_those_of_the_dense_equations(network, &surface);
}

#[test]
fn the_derivative_by_the_attitudes_clock_equals_central_differences() {
    // A hundredth of a second turns by 9e-6 rad at most.
    const STEP_S: f64 = 1e-2;
    let network = Network {
        attitude_clock: Some(attitude_clock()),
        ..network()
    };
    let (layout, start, _) = layout(&network);
    let clock = layout.columns.attitude_clock.unwrap();
    let computed = |offset_s: f64, index: usize| {
        let mut corrections = start.corrections.clone();
        corrections[clock] = offset_s;
        let state = State::new(
            &network,
            &layout.columns,
            corrections,
            start.points_m.clone(),
        );
        layout.view_rows(&state, index).unwrap()
    };
    for (index, view) in network.views.iter().enumerate() {
        let rows = computed(0.7, index);
        let [ahead, behind] = [STEP_S, -STEP_S].map(|step_s| computed(0.7 + step_s, index));
        let turn_rad_s = attitude_clock().turns_rad_s[view.image];
        let scale = rows.map(|row| row.by_rotation.norm() * turn_rad_s.norm());
        for axis in 0..2 {
            // Computed values: misclosures with the sign turned.
            let numeric = (behind[axis].misclosure - ahead[axis].misclosure) / (2.0 * STEP_S);
            let analytic = rows[axis].by_rotation.dot(&turn_rad_s);
            // A share of the derivative: lines of 1e4 are rounded at 1e-12.
            assert!(
                (numeric - analytic).abs() < 1e-6 * scale[0].max(scale[1]),
                "{index}"
            );
        }
    }
}

#[test]
fn relief_and_the_attitudes_clock_by_parts_equal_the_dense_equations() {
    let mut network = network();
    network.attitude_clock = Some(attitude_clock());
    let options = SurfaceOptions {
        uses_relief: true,
        ..SurfaceOptions::default()
    };
    let surface = surface_with(&network, 35.0, &options);
    are_those_of_the_dense_equations(network, &surface);
}

/// The recorded position less the truth, of which the shift of the profile is a part: `at` is the first row of the point.
fn of_record(
    cofactors: &DMatrix<f64>,
    at: usize,
    (axes, columns): (Matrix3<f64>, [Option<usize>; 3]),
) -> Matrix3<f64> {
    let mut whole = DMatrix::zeros(3, cofactors.ncols());
    for axis in 0..3 {
        whole[(axis, at + axis)] = 1.0;
        for (row, column) in columns.iter().enumerate() {
            whole[(axis, column.unwrap())] = axes[(row, axis)];
        }
    }
    let recorded = &whole * cofactors * whole.transpose();
    recorded.fixed_view::<3, 3>(0, 0).into_owned()
}

/// The sum of the redundancy numbers of image coordinates, ranges, a priori positions and heights.
fn sum_of_redundancies(adjustment: &Adjustment) -> f64 {
    let views = adjustment.views.iter().flatten().flatten();
    let views: f64 = views.map(|residual| residual.redundancy).sum();
    let ranges = adjustment.ranges.iter().flatten();
    let ranges: f64 = ranges.map(|residual| residual.redundancy).sum();
    let points = adjustment.points.iter().flatten();
    let points = points.filter_map(|point| point.priors).flatten();
    let points: f64 = points.map(|residual: Residual| residual.redundancy).sum();
    let heights = adjustment.heights.iter();
    let heights: f64 = heights.map(|height| height.redundancy).sum();
    views + ranges + points + heights
}

/// The equations of `network` with heights above `surface`, solved by parts, and the statistics of the solution.
pub(super) fn are_those_of_the_dense_equations(
    mut network: Network<EulerPolynomial>,
    surface: &LaserSurface,
) {
    network.heights = Some(observed(surface.clone()));
    let (mut layout, start, active) = layout(&network);
    let shared = layout.columns.len();
    let bus = network.common_bus.as_ref();
    let shifts = bus.map_or_else(Vec::new, |bus| layout.columns.shifts_on_surface(bus));
    let heights = Heights::at(surface, CONTROLLED.collect(), shifts, &start);
    let start = layout.linearise(start);
    let groups = PointGroups::of(&layout, active.clone());
    let before = dense(&layout, &start, &heights, active.len());

    layout.heights = Some(heights);
    let reduced = super::reduce::reduce(&layout, &start, &groups).unwrap();
    let step = Factor::new(&reduced.matrix, reduced.heights.as_ref())
        .unwrap()
        .solve(&reduced.right);
    for (column, sigma) in layout.columns.sigmas.iter().enumerate() {
        // As shares of the standard deviations; steps are of their order.
        assert!(
            (step[column] - before.step[column]).abs() < 1e-8 * sigma,
            "{column}: {} {} of {sigma}",
            step[column],
            before.step[column]
        );
    }

    let mut history = Vec::new();
    let stop = Stop {
        steps_max: 100,
        change: 1e-10,
    };
    let settled = settle(&layout, start, &groups, stop, &mut history).unwrap();
    let heights = layout.heights.as_ref().unwrap();
    let dense = dense(&layout, &settled.at, heights, active.len());
    for step in dense.step.iter().skip(shared) {
        // Metres: once the parts have converged to 1e-10 of the sum of squares, the remaining step of the whole is
        // small.
        assert!(step.abs() < 1e-3, "{step}");
    }
    let Settled { reduced, .. } = &settled;
    let factor = Factor::new(&reduced.matrix, reduced.heights.as_ref()).unwrap();
    let cofactors = factor.cofactors(&reduced.matrix);
    let fitness = vec![Ok(()); active.len()];
    let adjustment = judge(&layout, &settled, &groups, &fitness, &factor);
    let block = |one: usize, other: usize| {
        let (row, column) = (shared + 3 * one, shared + 3 * other);
        dense.cofactors.fixed_view::<3, 3>(row, column).into_owned()
    };
    for point in &active {
        let expected: Matrix3<f64> = block(*point, *point);
        let found = adjustment.points[*point].unwrap().cofactor_m2;
        assert!(
            (found - expected).abs().max() < 1e-6 * expected.trace(),
            "{point}"
        );
    }
    let mut mean = Matrix3::zeros();
    for one in CONTROLLED {
        for other in CONTROLLED {
            mean += block(one, other) / (CONTROLLED.len() as f64).powi(2);
        }
    }
    let found = adjustment.mean_cofactor_m2.unwrap();
    assert!((found - mean).abs().max() < 1e-6 * mean.trace());
    for point in &active {
        let own: Matrix3<f64> = block(*point, *point);
        let expected = match layout.shift_of(*point) {
            None => {
                let others = CONTROLLED.map(|other| block(*point, other));
                let between = others.sum::<Matrix3<f64>>() / CONTROLLED.len() as f64;
                own + mean - between - between.transpose()
            }
            Some(shift) => of_record(&dense.cofactors, shared + 3 * point, shift),
        };
        let found = adjustment.points[*point].unwrap().relative_m2.unwrap();
        // Differences of what the points share, which is larger.
        let off = (found - expected).abs().max();
        assert!(off < 1e-6 * (own.trace() + mean.trace()), "{point}: {off}");
    }

    // Redundancy numbers add up to observations minus unknowns.
    let mut sum = sum_of_redundancies(&adjustment);
    for (column, sigma) in layout.columns.sigmas.iter().enumerate() {
        let redundancy = 1.0 - prior_variance(&layout, &cofactors, column) / sigma.powi(2);
        sum += redundancy;
        if let Unknown::ProfileShift { profile, axis } = layout.columns.unknowns[column] {
            let bus = adjustment.common_bus.as_ref().unwrap();
            let stated = bus.profile_shifts_m[profile][axis].prior.unwrap();
            assert!((stated.redundancy - redundancy).abs() < 1e-9, "{axis}"); // rounding
        }
    }
    let spots = adjustment.common_bus.iter().flat_map(|bus| &bus.spots);
    let spots: Vec<_> = spots.flatten().flatten().collect();
    sum += spots
        .iter()
        .map(|residual| residual.redundancy)
        .sum::<f64>();
    let observations = 2 * network.views.len()
        + spots.len()
        + network.ranges.len()
        + 3 * (active.len() - CONTROLLED.len())
        + shared
        + CONTROLLED.len();
    let free = observations - shared - 3 * active.len();
    assert!((sum - free as f64).abs() < 1e-5, "{sum} {free}");
}

#[test]
fn ground_that_stands_higher_lifts_the_points_and_moves_them_little_in_plan() {
    let mean_height_m = |above_m: f64| {
        let mut network = measured(network());
        let surface = surface(&network, above_m);
        network.heights = Some(observed(surface));
        let adjusted = solve(&network, &BundleOptions::default()).unwrap();
        let heights = CONTROLLED.map(|point| {
            height_m(
                Body::Mars.model(),
                &adjusted.points[point].unwrap().ground_m,
            )
            .0
        });
        heights.sum::<f64>() / CONTROLLED.len() as f64
    };
    let lifted_m = mean_height_m(50.0) - mean_height_m(0.0);
    // Metres. The four points with coordinates of their own resist: heights of 10 m and of 5 m share the lift.
    assert!((30.0..51.0).contains(&lifted_m), "{lifted_m}");
}

#[test]
fn heights_that_do_not_converge_are_reported() {
    let mut network = network();
    let surface = surface(&network, 35.0);
    network.heights = Some(observed(surface));
    let settled = |height_rounds_max| {
        let options = BundleOptions {
            height_rounds_max,
            ..BundleOptions::default()
        };
        solve(&network, &options).unwrap().heights_settled
    };
    assert!(settled(15) && !settled(1));
}

#[test]
fn heights_that_are_only_compared_change_nothing() {
    let mut network = network();
    let alone = solve(&network, &BundleOptions::default()).unwrap();
    let surface = surface(&network, 60.0);
    network.heights = Some(HeightControl {
        surface,
        jitter: None,
        common_noise: None,
        compared: CONTROLLED.collect(),
        observed: Vec::new(),
    });
    let compared = solve(&network, &BundleOptions::default()).unwrap();
    assert_eq!(alone.points, compared.points);
    assert_eq!(alone.images, compared.images);
    assert_eq!(alone.observations, compared.observations);
    assert!(compared.heights.is_empty());
    assert_eq!(compared.compared.len(), CONTROLLED.len());
    for height in &compared.compared {
        assert!(height.ray_sigma_m > 0.0 && height.surface_sigma_m > 0.0);
    }
}

#[test]
fn a_height_that_no_surface_explains_loses_its_weight() {
    let mut network = network();
    let surface = surface(&network, 0.0);
    // One point lies in a hole between the profiles, as its rays show.
    let hole_m = network.points[6].ground_m.normalize() * 900.0;
    network.points[6].ground_m -= hole_m;
    let mut network = measured(network);
    network.heights = Some(observed(surface));
    let adjusted = solve(&network, &BundleOptions::default()).unwrap();
    let in_hole = adjusted
        .heights
        .iter()
        .find(|height| height.point == 6)
        .unwrap();
    assert!(in_hole.above_m < -600.0, "{}", in_hole.above_m);
    assert!(in_hole.weight_factor < 0.05, "{}", in_hole.weight_factor);
    for other in adjusted.heights.iter().filter(|height| height.point != 6) {
        assert!(
            other.weight_factor > 0.5,
            "{} {}",
            other.point,
            other.weight_factor
        );
    }
}
