//! Noise that is smooth between the nodes of a lattice: what albedo is made of.

use nalgebra::Vector3;

use super::random::{mix, unit_of};

/// Value noise, −1 to 1: numbers at whole places, smoothly blended between them.
pub(super) fn noise(place: &Vector3<f64>, key: u64) -> f64 {
    let corner = place.map(f64::floor);
    let share = (place - corner).map(|share| share * share * (3.0 - 2.0 * share));
    // Each node has a number by x, then y, then z: what two nodes have in common is mixed once.
    let between = |axis: usize, hash: u64, value: &dyn Fn(u64) -> f64| {
        let [near, far] = [0.0, 1.0].map(|step| value(mix(hash ^ (corner[axis] + step).to_bits())));
        near + share[axis] * (far - near)
    };
    let number = |hash: u64| 2.0 * unit_of(hash) - 1.0;
    let along_z = |hash: u64| between(2, hash, &number);
    let along_y = |hash: u64| between(1, hash, &along_z);
    between(0, key, &along_y)
}
