//! Largest and root mean square of places, coordinate by coordinate.

use areograph_geom::plane::Place;

/// Largest |x| and |y|; 0 without places.
pub(super) fn largest(of: &[Place]) -> [f64; 2] {
    let part = |part: fn(&Place) -> f64| of.iter().map(part).fold(0.0, f64::max);
    [part(|of| of.re.abs()), part(|of| of.im.abs())]
}

/// Root mean squares of x and y; 0 without places.
pub(super) fn rms(of: &[Place]) -> [f64; 2] {
    let count = of.len().max(1) as f64;
    let part = |part: fn(&Place) -> f64| {
        (of.iter().map(|of| part(of).powi(2)).sum::<f64>() / count).sqrt()
    };
    [part(|of| of.re), part(|of| of.im)]
}

/// Both coordinates together.
pub(super) fn rms_of_both(of: &[Place]) -> f64 {
    let [x, y] = rms(of);
    (0.5 * (x * x + y * y)).sqrt()
}

/// Half of the longer side of the bounding box of places.
pub(super) fn half_side(places: &[Place]) -> f64 {
    let side = |part: fn(&Place) -> f64| {
        let low = places.iter().map(part).fold(f64::INFINITY, f64::min);
        let high = places.iter().map(part).fold(f64::NEG_INFINITY, f64::max);
        (high - low).max(0.0)
    };
    0.5 * side(|of| of.re).max(side(|of| of.im))
}
