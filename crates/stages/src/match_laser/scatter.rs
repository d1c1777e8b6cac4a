//! Scatter of units: the part of their standard deviations that their own shots do not show.
//!
//! An orientation error shifts a model by an amount that changes linearly over the ground: shifts and biases of units
//! lie about a plane. Deviations from it are errors of the model that all shots of a unit share, so that leaving out
//! single shots does not show them.

use nalgebra::{Matrix3, Vector3};

use super::result::{UnitResult, Widened};
use areograph_base::units::wrap_pi;
use areograph_geom::{robust::RobustWeight, statistics::Summary};

/// Minimum number of units: three make a plane.
const UNITS_MIN: usize = 10;
/// Unknowns of a plane.
const UNKNOWNS: f64 = 3.0;
/// Rounds of reweighting; the last ones change nothing significant.
const ROUNDS: usize = 20;
/// A unit farther from the plane than this many widened standard deviations and this many cells was matched by chance.
const OFF_SIGMAS: f64 = 5.0;
const OFF_CELLS: f64 = 1.0;
/// Lower bounds of standard deviations: the steps of least squares, cells and metres.
const FLOOR: [f64; 3] = [1e-3, 1e-3, 1e-3];

/// A unit's position, relative to the mean in units of their spread, and its values.
struct Seen {
    /// Index of the unit.
    unit: usize,
    row: Vector3<f64>,
    /// Shift east and north, cells, bias, metres, and their standard deviations.
    values: [f64; 3],
    sigmas: [f64; 3],
}

/// A plane through values of units, and their residuals.
struct Plane {
    off: Vec<f64>,
    /// Residuals over standard deviations.
    normalised: Vec<f64>,
}

impl Plane {
    /// Through one of the values, with lower weights for units far from it.
    fn of(seen: &[Seen], at: usize) -> Option<Self> {
        let robust = RobustWeight::Huber {
            limit: RobustWeight::HUBER_LIMIT,
        };
        let off = |plane: &Vector3<f64>| -> Vec<f64> {
            seen.iter()
                .map(|of| of.values[at] - of.row.dot(plane))
                .collect()
        };
        let all: Vec<f64> = seen.iter().map(|of| of.values[at]).collect();
        let mut plane = Vector3::new(Summary::of(&all).median, 0.0, 0.0);
        for _ in 0..ROUNDS {
            let off = off(&plane);
            let normalised: Vec<f64> = off
                .iter()
                .zip(seen)
                .map(|(off, of)| off / of.sigmas[at])
                .collect();
            let scale = spread(&normalised, 1.0).max(f64::MIN_POSITIVE);
            let (mut normals, mut right) = (Matrix3::zeros(), Vector3::zeros());
            for (of, z) in seen.iter().zip(normalised) {
                let weight = robust.factor(z / scale) / of.sigmas[at].powi(2);
                normals += weight * of.row * of.row.transpose();
                right += weight * of.row * of.values[at];
            }
            plane = normals.cholesky()?.solve(&right);
        }
        let off = off(&plane);
        let normalised = off.iter().zip(seen).map(|(off, of)| off / of.sigmas[at]);
        Some(Self {
            normalised: normalised.collect(),
            off,
        })
    }
}

/// Robust standard deviation of residuals about this many planes.
fn spread(normalised: &[f64], planes: f64) -> f64 {
    let count = normalised.len() as f64;
    Summary::of(normalised).nmad * (count / (count - planes * UNKNOWNS)).sqrt()
}

fn seen(units: &[UnitResult], cell_m: [f64; 2]) -> Vec<Seen> {
    let first_rad = units.first().map_or(0.0, |unit| unit.place_rad[0]);
    let of = |unit: usize| {
        let result = units
            .get(unit)
            .filter(|unit| unit.is_kept() && !unit.judges)?;
        let (found, place_rad) = (result.found?, result.place_rad);
        let sigma = found.sigma?;
        let [east, north] = found.shift_cells;
        let [east_m, north_m] = sigma.shift_m;
        let sigmas = [east_m / cell_m[0], north_m / cell_m[1], sigma.bias_m];
        Some(Seen {
            unit,
            row: Vector3::new(1.0, wrap_pi(place_rad[0] - first_rad), place_rad[1]),
            values: [east, north, found.bias_m],
            sigmas: [0, 1, 2].map(|at| sigmas[at].max(FLOOR[at])),
        })
    };
    let mut seen: Vec<Seen> = (0..units.len()).filter_map(of).collect();
    for axis in [1, 2] {
        let places: Vec<f64> = seen.iter().map(|of| of.row[axis]).collect();
        let places = Summary::of(&places);
        for of in &mut seen {
            of.row[axis] = (of.row[axis] - places.mean) / places.standard_deviation;
        }
    }
    seen
}

/// Widens the standard deviations of all units by the scatter of kept units that are not withheld about a plane, and
/// rejects those of them that are far from it; `None`, with nothing changed, where they are too few or lie on a line.
///
/// * `cell_m` – size of a cell towards the east and the north, metres
pub(super) fn widen(units: &mut [UnitResult], cell_m: [f64; 2]) -> Option<Widened> {
    let seen = seen(units, cell_m);
    if seen.len() < UNITS_MIN {
        return None;
    }
    let [east, north, bias] = [0, 1, 2].map(|at| Plane::of(&seen, at));
    let (east, north, bias) = (east?, north?, bias?);
    let both: Vec<f64> = [&east, &north]
        .into_iter()
        .flat_map(|of| of.normalised.iter().copied())
        .collect();
    let widened = Widened {
        shift: spread(&both, 2.0).max(1.0),
        bias: spread(&bias.normalised, 1.0).max(1.0),
    };
    for (index, of) in seen.iter().enumerate() {
        let off_cells = east.off[index].hypot(north.off[index]);
        let sigmas = east.normalised[index].hypot(north.normalised[index]) / widened.shift;
        if off_cells > OFF_CELLS && sigmas > OFF_SIGMAS {
            units[of.unit].refused_because = format!(
                "its shift deviates by {off_cells:.1} cells, {sigmas:.0} standard deviations, from the plane fitted to \
                 the shifts; expected at most {OFF_CELLS} cell or {OFF_SIGMAS} standard deviations"
            );
        }
    }
    for unit in units {
        if let Some(found) = &mut unit.found {
            found.sigma = found.sigma.map(|sigma| sigma.wider(widened));
        }
    }
    Some(widened)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::match_laser::{MatchSigma, UnitMatch};
    use areograph_geom::random::Random;

    const CELL_M: [f64; 2] = [100.0, 100.0];

    /// Units on a slanting plane, each deviating by `times` its standard deviation.
    fn units(count: usize, times: f64) -> Vec<UnitResult> {
        let mut random = Random::new(7, "units about a plane");
        let of = |unit: usize| {
            let place_rad = [
                3.1 + 0.01 * (unit % 9) as f64,
                -0.2 + 0.002 * (unit / 9) as f64,
            ];
            let sigma_cells = 0.1 + 0.02 * (unit % 7) as f64;
            let mut off = || times * sigma_cells * random.normal();
            let slope = 40.0 * (place_rad[0] - 3.1);
            let shift_cells = [3.0 + slope + off(), -2.0 - slope + off()];
            UnitResult {
                unit: unit + 1,
                place_rad: [wrap_pi(place_rad[0]), place_rad[1]],
                judges: unit % 4 == 3,
                shots: 60,
                strips: 2,
                radius_m: 5_000.0,
                relief_m: 80.0,
                found: Some(UnitMatch {
                    shift_cells,
                    shift_m: shift_cells.map(|of| 100.0 * of),
                    shift_rad: [0.0; 2],
                    score: 0.99,
                    contrast: 2.0,
                    bias_m: 35.0 + 10.0 * slope + 20.0 * off(),
                    sigma: Some(MatchSigma {
                        shift_m: [100.0 * sigma_cells; 2],
                        bias_m: 20.0 * sigma_cells,
                    }),
                }),
                held_out: None,
                concordance: [None; 2],
                similarity: None,
                refused_because: String::new(),
            }
        };
        (0..count).map(of).collect()
    }

    #[test]
    fn scatter_that_shots_do_not_tell_widens_and_that_they_tell_does_not() {
        for (times, expected) in [(0.3, 1.0), (1.0, 1.0), (4.0, 4.0)] {
            let before = units(120, times);
            let mut after = before.clone();
            let widened = widen(&mut after, CELL_M);
            // A robust standard deviation of 180 and of 90 numbers: to a fifth and a little, one in a hundred.
            assert!(
                widened.is_some_and(|of| [of.shift, of.bias]
                    .iter()
                    .all(|of| (of / expected - 1.0).abs() < 0.25)),
                "{times}: {widened:?}"
            );
            for (before, after) in before.iter().zip(&after) {
                let sigma =
                    |of: &UnitResult| of.found.and_then(|found| found.sigma).map(|of| of.bias_m);
                let ratio = sigma(after).zip(sigma(before)).map(|(a, b)| a / b);
                // Withheld units are widened too.
                assert_eq!(
                    ratio.map(|of| (1e9 * of).round()),
                    widened.map(|of| (1e9 * of.bias).round())
                );
                assert!(after.is_kept(), "{}", after.refused_because);
            }
        }
    }

    #[test]
    fn a_unit_far_off_the_plane_is_refused_unless_it_judges() {
        let mut units = units(60, 1.0);
        for index in [5, 7] {
            if let Some(found) = &mut units[index].found {
                found.shift_cells[0] += 3.0;
            }
        }
        assert!(widen(&mut units, CELL_M).is_some());
        let refused: Vec<usize> = (0..60).filter(|at| !units[*at].is_kept()).collect();
        assert_eq!(refused, [5]);
    }

    #[test]
    fn few_units_and_units_on_a_line_tell_nothing() {
        assert_eq!(widen(&mut units(9, 1.0), CELL_M), None);
        let mut line = units(60, 1.0);
        for unit in &mut line {
            unit.place_rad[1] = 0.3;
        }
        assert_eq!(widen(&mut line, CELL_M), None);
    }
}
