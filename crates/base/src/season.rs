//! The season of Mars: areocentric longitude of the Sun.

use std::f64::consts::TAU;

use crate::{
    time::Et,
    units::{RADIANS_PER_DEGREE, wrap_two_pi},
};

/// Seconds of a day.
const DAY_S: f64 = 86_400.0;

/// Perturbations by planets: amplitude in degrees, period in Julian years, phase in degrees.
const PERTURBATIONS: [[f64; 3]; 7] = [
    [0.0071, 2.2353, 49.409],
    [0.0057, 2.7543, 168.173],
    [0.0039, 1.1177, 191.837],
    [0.0037, 15.7866, 21.736],
    [0.0021, 2.1354, 15.704],
    [0.0020, 2.4694, 95.528],
    [0.0018, 32.8493, 49.095],
];

/// Areocentric longitude of the Sun (Ls), radians from 0 to 2π: 0 at the northward equinox of Mars, π/2 at the northern summer
/// solstice. The error is 0.01° within decades of 2000.
///
/// # Source
/// Allison & `McEwen` 2000, Planetary and Space Science 48, 215–235, equations 16 to 19 and table 5.
#[must_use]
pub fn solar_longitude_rad(et: Et) -> f64 {
    let days = et.seconds() / DAY_S;
    let mean_anomaly_rad = (19.3870 + 0.524_020_75 * days) * RADIANS_PER_DEGREE;
    let mean_sun_deg = 270.3863 + 0.524_038_40 * days;
    let perturbed = PERTURBATIONS
        .iter()
        .map(|[amplitude_deg, years, phase_deg]| {
            let turn = days / (365.25 * years);
            amplitude_deg * (TAU * turn + phase_deg * RADIANS_PER_DEGREE).cos()
        });
    let harmonic = |order: f64| (order * mean_anomaly_rad).sin();
    let centre_deg = (10.691 + 3e-7 * days) * harmonic(1.0)
        + 0.623 * harmonic(2.0)
        + 0.050 * harmonic(3.0)
        + 0.005 * harmonic(4.0)
        + 0.0005 * harmonic(5.0)
        + perturbed.sum::<f64>();
    wrap_two_pi((mean_sun_deg + centre_deg) * RADIANS_PER_DEGREE)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Equinoxes and solstices of Mars year 24, UTC to the day (Clancy et al. 2000, J. Geophys. Res. 105, table of Mars years): in a day
    /// the Sun moves by 0.4° to 0.6°.
    #[test]
    fn seasons_of_the_laser_begin_on_their_days() {
        // Days from 2000-01-01 12:00 TDB to 0:00 UTC of 1998-07-14, 1999-01-29, 1999-07-31 and 1999-12-25.
        for (days, expected_deg) in [
            (-536.5, 0.0),
            (-337.5, 90.0),
            (-154.5, 180.0),
            (-7.5, 270.0),
        ] {
            // Within the day.
            let of = |days: f64| {
                solar_longitude_rad(Et::from_seconds(days * DAY_S)) / RADIANS_PER_DEGREE
            };
            let off_deg = |days| (of(days) - expected_deg + 180.0_f64).rem_euclid(360.0) - 180.0;
            assert!(
                off_deg(days) < 0.05 && off_deg(days + 1.0) > -0.05,
                "{expected_deg}: {}",
                off_deg(days)
            );
        }
    }
}
