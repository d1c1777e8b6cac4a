//! Tests of statistics.

use super::*;

fn close(value: f64, expected: f64) {
    assert!((value - expected).abs() < 1e-12, "{value} {expected}"); // rounding of small numbers
}

#[test]
fn a_summary_over_many_values_is_that_of_a_list_bit_for_bit() {
    let values = |count: usize| {
        // Of both signs, with repetitions, and not in order.
        (0..count).map(|index| ((index * 7_919) % 100_003) as f64 / 64.0 - 500.0)
    };
    for count in [0, 1, 2, HELD_MAX, HELD_MAX + 1, HELD_MAX + 2, 3 * HELD_MAX] {
        let list: Vec<f64> = values(count).collect();
        assert_eq!(
            Summary::over(|| values(count)),
            Summary::of(&list),
            "{count}"
        );
    }
    let equal = || std::iter::repeat_n(-0.25, 2 * HELD_MAX);
    let list: Vec<f64> = equal().collect();
    assert_eq!(Summary::over(equal), Summary::of(&list));
}

#[test]
fn the_largest_of_some_is_none_of_those_that_are_no_number() {
    close(largest([-3.0, -1.0, -2.0]).unwrap(), -1.0);
    assert_eq!(largest([]), None);
    for place in 0..3 {
        let mut values = [1.0, 3.0, 2.0];
        values[place] = f64::NAN;
        assert!(largest(values).is_some_and(f64::is_nan), "NaN at {place}");
    }
}

#[test]
fn summary_by_hand() {
    let summary = Summary::of(&[2.0, 4.0, 4.0, 10.0]);
    assert_eq!(summary.n, 4);
    close(summary.mean, 5.0);
    close(summary.standard_deviation, 12.0_f64.sqrt()); // (9 + 1 + 1 + 25) / 3
    close(summary.median, 4.0);
    close(summary.nmad, 1.4826); // deviations 2, 0, 0, 6: median 1
    close(summary.min, 2.0);
    close(summary.max, 10.0);
    assert_eq!(Summary::of(&[]), Summary::default());
    close(Summary::of(&[7.0]).standard_deviation, 0.0);
}

#[test]
fn outliers_are_judged_from_the_median() {
    let mut residuals = vec![0.50, 0.51, 0.49, 0.50, 0.52, 0.48, 0.50];
    residuals.extend([0.70, f64::NAN]);
    let flags = outliers(&residuals, 5.0);
    assert_eq!(flags.iter().filter(|flag| **flag).count(), 2);
    assert!(flags[7] && flags[8]);
    // All equal but one, closer than five times the 1 cm floor: no outlier.
    assert!(
        outliers(&[1.0, 1.0, 1.0, 1.04], 5.0)
            .iter()
            .all(|flag| !flag)
    );
}

#[test]
fn trend_of_a_line_with_known_scatter() {
    let seconds = [0.0, 1.0, 2.0, 3.0];
    let trend = Trend::of(&seconds, &[1.0, 3.0, 5.0, 7.0]).unwrap();
    close(trend.slope, 2.0);
    close(trend.uncertainty, 0.0);
    let trend = Trend::of(&seconds, &[1.0, -1.0, -1.0, 1.0]).unwrap();
    close(trend.slope, 0.0);
    close(trend.uncertainty, (4.0_f64 / (2.0 * 5.0)).sqrt());
    assert!(Trend::of(&seconds[..2], &[1.0, 2.0]).is_none());
    assert!(Trend::of(&[1.0, 1.0, 1.0], &[1.0, 2.0, 3.0]).is_none());
}

/// Normal numbers by Box and Muller from a linear congruential generator, identical in every run.
fn normals() -> impl Iterator<Item = f64> {
    let mut state = 1_u64;
    std::iter::repeat_with(move || {
        let mut uniform = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            ((state >> 11) as f64 + 0.5) / (1_u64 << 53) as f64
        };
        (-2.0 * uniform().ln()).sqrt() * (std::f64::consts::TAU * uniform()).cos()
    })
}

#[test]
fn limits_of_unit_weight_are_those_of_chi_square() {
    // χ² at 0.005 and 0.995 from published tables, over its degrees of freedom.
    for (freedom, least, most) in [(10.0, 2.156, 25.188), (100.0, 67.328, 140.169)] {
        let [low, high] = unit_weight_limits(freedom).unwrap();
        let exact = [least, most].map(|square: f64| (square / freedom).sqrt());
        assert!(
            (low - exact[0]).abs() < 0.01 && (high - exact[1]).abs() < 0.01,
            "{low} {high} {exact:?}"
        );
    }
    assert_eq!(unit_weight_limits(0.5), None);
}

#[test]
fn one_standard_uncertainty_holds_two_thirds_of_the_slopes_of_correlated_noise() {
    const SERIES: u32 = 2_000;
    let mut normals = normals();
    // The number of shots of a profile over 17 s.
    let seconds: Vec<f64> = (0..180).map(|k| 0.1 * f64::from(k)).collect();
    for neighbours in [0.0, 0.5, 0.8, 0.9] {
        let mut inside = 0;
        for _ in 0..SERIES {
            let mut value = normals.next().unwrap();
            let fresh = f64::sqrt(1.0 - neighbours * neighbours);
            let values: Vec<f64> = seconds
                .iter()
                .map(|_| {
                    value = neighbours * value + fresh * normals.next().unwrap();
                    value
                })
                .collect();
            let trend = Trend::of(&seconds, &values).unwrap();
            inside += u32::from(trend.slope.abs() <= trend.uncertainty);
        }
        let share = f64::from(inside) / f64::from(SERIES);
        // 0.683 for a normal distribution; 2000 series determine it to 0.01, the estimate of the correlation from
        // 180 values adds some error.
        assert!((0.60..=0.76).contains(&share), "{neighbours}: {share}");
    }
}
