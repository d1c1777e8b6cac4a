//! Heights and jitter: an attitude that oscillates about the camera's x axis lifts and lowers points along an image.
//!
//! Jitter is an error of the rays that points seen at nearly the same time share. Over relief it resembles a horizontal shift, and
//! many precise heights would follow it. The unknowns of the orientation contain its slow part. The scatter of tie points also
//! contains jitter, as independent noise; robust weights do not. An image whose rotation is held has no jitter here.

use nalgebra::DMatrix;

use super::{control::Jitter, layout::Layout, unknowns::CONSTANT_ROLL};

/// Powers of time of a parabola.
const POWERS: usize = 3;

/// Covariance of the heights of `points` by jitter, m²: for every image, `gᵢ gⱼ σ² exp(−|tᵢ − tⱼ|/τ)` without the least-squares
/// parabola in time over these points, `g` the change of a height with a rotation about the x axis.
///
/// * `by_shared` – change of each height with each shared unknown
pub(super) fn covariance_m2<M>(
    layout: &Layout<'_, M>,
    jitter: &Jitter,
    points: &[usize],
    by_shared: &DMatrix<f64>,
) -> DMatrix<f64> {
    let network = layout.network;
    let mut covariance_m2 = DMatrix::zeros(points.len(), points.len());
    for (image, of_image) in layout.columns.of_image.iter().enumerate() {
        let Some(column) = of_image[CONSTANT_ROLL] else {
            continue;
        };
        let seen = |(index, point): (usize, &usize)| {
            let views = layout.views.of_key(*point).iter();
            let mut views = views.map(|view| &network.views[*view]);
            let view = views.find(|view| view.image == image)?;
            Some((index, view.x_lines))
        };
        let seen: Vec<(usize, f64)> = points.iter().enumerate().filter_map(seen).collect();
        let period_s = network.images[image].line_period_s;
        let instants_s: Vec<f64> = seen.iter().map(|(_, lines)| lines * period_s).collect();
        let rad2 = without_parabola_rad2(jitter, &instants_s);
        for (column_of, (second, _)) in seen.iter().enumerate() {
            for (row_of, (first, _)) in seen.iter().enumerate() {
                covariance_m2[(*first, *second)] += by_shared[(*first, column)]
                    * by_shared[(*second, column)]
                    * rad2[(row_of, column_of)];
            }
        }
    }
    covariance_m2
}

/// Covariance of the rotations at some instants of an image without their parabola in time, rad².
fn without_parabola_rad2(jitter: &Jitter, instants_s: &[f64]) -> DMatrix<f64> {
    let count = instants_s.len();
    let mut rad2 = DMatrix::from_fn(count, count, |row, column| {
        let apart_s = (instants_s[row] - instants_s[column]).abs();
        jitter.sigma_rad.powi(2) * (-apart_s / jitter.time_s).exp()
    });
    let reach_s = instants_s
        .iter()
        .fold(1.0, |reach_s: f64, instant_s| reach_s.max(instant_s.abs()));
    let mut parabolas = DMatrix::from_element(count, POWERS.min(count), 1.0);
    for power in 1..parabolas.ncols() {
        for (row, instant_s) in instants_s.iter().enumerate() {
            parabolas[(row, power)] = parabolas[(row, power - 1)] * instant_s / reach_s;
        }
    }
    let basis = parabolas.qr().q();
    rad2 -= &basis * (basis.transpose() * &rad2);
    rad2 -= (&rad2 * &basis) * basis.transpose();
    0.5 * (&rad2 + rad2.transpose())
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DVector;

    const JITTER: Jitter = Jitter {
        sigma_rad: 4e-6,
        time_s: 1.0,
    };

    fn instants_s() -> Vec<f64> {
        (0..60).map(|index| 0.25 * f64::from(index) - 7.4).collect()
    }

    #[test]
    fn a_parabola_is_no_jitter() {
        let instants_s = instants_s();
        let rad2 = without_parabola_rad2(&JITTER, &instants_s);
        for power in 0..3 {
            let powers = instants_s.iter().map(|instant_s| instant_s.powi(power));
            let parabola = DVector::from_iterator(60, powers);
            let left = (&rad2 * &parabola).norm() / (rad2.norm() * parabola.norm());
            assert!(left < 1e-12, "{power}: {left}"); // rounding
        }
    }

    #[test]
    fn jitter_is_shared_by_what_is_seen_together() {
        let rad2 = without_parabola_rad2(&JITTER, &instants_s());
        let correlation = |one: usize, other: usize| {
            rad2[(one, other)] / (rad2[(one, one)] * rad2[(other, other)]).sqrt()
        };
        // A quarter of a second and six seconds apart, in the middle of the image: e^-0.25, less what the parabola takes.
        assert!(
            (0.6..0.78).contains(&correlation(30, 31)),
            "{}",
            correlation(30, 31)
        );
        assert!(correlation(18, 42).abs() < 0.25, "{}", correlation(18, 42));
        let share = rad2[(30, 30)].sqrt() / JITTER.sigma_rad;
        assert!((0.7..1.0).contains(&share), "{share}");
        // No negative variance but rounding.
        let least = rad2.symmetric_eigenvalues().min();
        assert!(least > -1e-24, "{least}");
    }

    #[test]
    fn few_points_have_no_jitter_beyond_a_parabola() {
        for count in 1..=3 {
            let rad2 = without_parabola_rad2(&JITTER, &instants_s()[..count]);
            assert!(rad2.amax() < 1e-24, "{count}"); // rad², of 1.6e-11
        }
        assert!(without_parabola_rad2(&JITTER, &[]).is_empty());
    }
}
