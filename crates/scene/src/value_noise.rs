//! Smooth noise between the nodes of a lattice, used for albedo.

use nalgebra::Vector3;

use super::random::{mix, unit_of};

/// Value noise, −1 to 1: values at integer positions, smoothly interpolated.
pub(super) fn noise(place: &Vector3<f64>, key: u64) -> f64 {
    let corner = place.map(f64::floor);
    let share = (place - corner).map(|share| share * share * (3.0 - 2.0 * share));
    // The value of a node is hashed by x, then y, then z: common parts of two nodes are computed once.
    let between = |axis: usize, hash: u64, value: &dyn Fn(u64) -> f64| {
        let [near, far] = [0.0, 1.0].map(|step| value(mix(hash ^ (corner[axis] + step).to_bits())));
        near + share[axis] * (far - near)
    };
    let number = |hash: u64| 2.0 * unit_of(hash) - 1.0;
    let along_z = |hash: u64| between(2, hash, &number);
    let along_y = |hash: u64| between(1, hash, &along_z);
    between(0, key, &along_y)
}
