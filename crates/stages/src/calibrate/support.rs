//! Calibrated support data: the straight line of equal samples that is nearest to the calibrated look directions, with a
//! distortion if these are curved.

use nalgebra::{Matrix3, Vector3};

use super::geometry::Orbit;
use areograph_base::error::Result;
use areograph_geom::{calibration::CalibrationState, polynomial::Polynomial};
use areograph_pds::isd::{LineCurve, LineOptics, SupportSource};

/// Places at which the line is fitted.
const FITTED_AT: u32 = 129;
/// Turns towards the fitted line; the second is of the size of the square of the first.
const TURNS: usize = 3;
/// Order of the distortion of a curved line.
const CURVE_ORDER: usize = 3;
/// Residual of a straight line, pixels, up to which no distortion is written.
const STRAIGHT_PX: f64 = 1e-3;

/// Text of the calibrated support data of a camera, and their largest residual against its look directions, pixels.
pub(super) fn calibrated(
    source: SupportSource<'_>,
    orbit: &Orbit,
    camera: usize,
    state: &CalibrationState,
) -> Result<(String, f64)> {
    let image = &orbit.images[camera];
    let samples: Vec<f64> = (0..FITTED_AT)
        .map(|index| image.detector.samples * f64::from(index) / f64::from(FITTED_AT - 1))
        .collect();
    let looks: Vec<Vector3<f64>> = samples
        .iter()
        .map(|sample| {
            orbit
                .axes
                .tr_mul(&state.cameras[camera].look(image.s(*sample)))
        })
        .collect();
    let (mut line, mut left) = nearest(&samples, &looks);
    if left > STRAIGHT_PX * image.pixel()
        && let Some((curve, of_curve)) = curved(&line, &samples, &looks)
    {
        line.curve = Some(curve);
        left = of_curve;
    }
    let text = source.rewritten(&line, |et_s| orbit.shift_m(camera, state, et_s))?;
    Ok((text, left / image.pixel()))
}

/// The curve through look directions of samples, by polynomials of the tangent across, and its largest residual, a tangent.
fn curved(line: &LineOptics, samples: &[f64], looks: &[Vector3<f64>]) -> Option<(LineCurve, f64)> {
    let [along, across]: [Vec<f64>; 2] = [0, 1].map(|axis| {
        let of = looks.iter().map(|look| tangents(&line.bus_to_camera, look));
        of.map(|tangents| tangents[axis]).collect()
    });
    let straight: Vec<f64> = samples
        .iter()
        .map(|sample| (sample - line.boresight_sample) * line.tangent_per_sample)
        .collect();
    let along = Polynomial::fit(&across, &along, CURVE_ORDER)?;
    let straight = Polynomial::fit(&across, &straight, CURVE_ORDER)?;
    let curve = LineCurve {
        along: along.polynomial.coefficients().try_into().ok()?,
        straight: straight.polynomial.coefficients().try_into().ok()?,
    };
    let left = along.residuals.iter().zip(&straight.residuals);
    Some((curve, left.map(|(x, y)| x.hypot(*y)).fold(0.0, f64::max)))
}

/// The straight camera nearest to look directions of samples, and its largest residual, a tangent.
fn nearest(samples: &[f64], looks: &[Vector3<f64>]) -> (LineOptics, f64) {
    let mut axes = first_axes(looks);
    let mut line = LineOptics {
        bus_to_camera: axes,
        boresight_sample: 0.0,
        tangent_per_sample: 1.0,
        curve: None,
    };
    let mut left = f64::INFINITY;
    for turn in 0..=TURNS {
        let tangents: Vec<[f64; 2]> = looks.iter().map(|look| tangents(&axes, look)).collect();
        let fit = |axis: usize| {
            let of: Vec<f64> = tangents.iter().map(|tangent| tangent[axis]).collect();
            let fit = Polynomial::fit(samples, &of, 1);
            fit.map_or([0.0; 2], |fit| {
                let of = fit.polynomial.coefficients();
                [of[0], of[1]]
            })
        };
        let ([along, skew], [start, step]) = (fit(0), fit(1));
        if turn == TURNS {
            let missed = tangents
                .iter()
                .zip(samples)
                .map(|([x, y], sample)| x.hypot(y - start - step * sample));
            left = missed.fold(0.0, f64::max);
            line = LineOptics {
                bus_to_camera: axes,
                boresight_sample: -start / step,
                tangent_per_sample: step,
                curve: None,
            };
            break;
        }
        // Turns the boresight onto the line, and the samples along y.
        let boresight = axes.tr_mul(&Vector3::new(along - start * skew / step, 0.0, 1.0));
        let samples_along = axes.tr_mul(&Vector3::new(skew, step, 0.0));
        axes = axes_along(&boresight, &samples_along);
    }
    (line, left)
}

fn tangents(axes: &Matrix3<f64>, look: &Vector3<f64>) -> [f64; 2] {
    let seen = axes * look;
    [seen.x / seen.z, seen.y / seen.z]
}

/// Axes with z along the look in the middle and y towards the last sample.
fn first_axes(looks: &[Vector3<f64>]) -> Matrix3<f64> {
    let (first, last) = (looks[0].normalize(), looks[looks.len() - 1].normalize());
    axes_along(&looks[looks.len() / 2], &(last - first))
}

fn axes_along(boresight: &Vector3<f64>, samples_along: &Vector3<f64>) -> Matrix3<f64> {
    let z = boresight.normalize();
    let y = (samples_along - z * z.dot(samples_along)).normalize();
    Matrix3::from_rows(&[y.cross(&z).transpose(), y.transpose(), z.transpose()])
}
