//! The printed numbers of Arthur & McMacken 1977 that follow from each other.

use areograph::geom::plane::Place;

/// SCALE of the tertiary net: point, Mercator coordinates, residuals; kilometres.
const TABLE_2: [(u32, [f64; 2], [f64; 2]); 6] = [
    (90, [849.0, 146.3], [-1.8, -0.6]),
    (307, [642.8, 154.9], [1.3, -1.6]),
    (308, [805.4, 216.2], [0.1, 0.0]),
    (340, [765.1, 288.4], [0.4, 1.0]),
    (341, [715.3, 320.1], [-0.2, 0.0]),
    (342, [694.9, 298.1], [0.1, 1.2]),
];

fn places() -> (Vec<Place>, Vec<Place>) {
    TABLE_2
        .iter()
        .map(|(_, [x, y], [dx, dy])| (Place::new(*x, *y), Place::new(*dx, *dy)))
        .unzip()
}

/// Change of scale that residuals still hold, parts per million, when they are given minus computed (`1.0`) or the
/// other way round (`-1.0`): of a fit it is 0.
fn left_scale_ppm(sign: f64) -> f64 {
    let (given, residuals) = places();
    let computed: Vec<Place> = given
        .iter()
        .zip(&residuals)
        .map(|(z, v)| z - v * sign)
        .collect();
    let middle = computed.iter().sum::<Place>() / 6.0;
    let pairs = computed.iter().zip(&residuals);
    let product: f64 = pairs.map(|(z, v)| ((z - middle).conj() * v).re).sum();
    let squares: f64 = computed.iter().map(|z| (z - middle).norm_sqr()).sum();
    1e6 * product / squares
}

#[test]
fn the_residuals_of_table_2_are_those_of_a_similarity() {
    let (_, residuals) = places();
    let sum: Place = residuals.iter().sum();
    // Six residuals rounded to 0.1 km.
    assert!(sum.re.abs() <= 0.3 && sum.im.abs() <= 0.3, "{sum}");
    let rms = |part: fn(&Place) -> f64| {
        (residuals.iter().map(|of| part(of).powi(2)).sum::<f64>() / 6.0).sqrt()
    };
    let (x, y) = (rms(|of| of.re), rms(|of| of.im));
    assert!(
        (x - 0.926).abs() < 0.001 && (y - 0.945).abs() < 0.001,
        "{x} {y}"
    );
    let longest = residuals.iter().map(|of| of.norm()).fold(0.0, f64::max);
    assert!((longest - 2.06).abs() < 0.005, "{longest}");
    // Rounding makes 125 ppm: given minus computed agrees with a fit, the other way round does not.
    assert!(
        (left_scale_ppm(1.0) + 87.0).abs() < 1.0,
        "{}",
        left_scale_ppm(1.0)
    );
    assert!(
        (left_scale_ppm(-1.0) - 279.0).abs() < 1.0,
        "{}",
        left_scale_ppm(-1.0)
    );
}
