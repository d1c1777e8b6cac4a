//! Subpixel matching of a patch in another image: least squares over its pixels.

use nalgebra::{Matrix2, SMatrix, SVector, Vector2};

use super::{Affine, Patch};

/// Shift of two coordinates, four elements of the affine distortion, offset and gain of the brightness.
const UNKNOWNS: usize = 8;
/// Maximum number of steps.
const STEPS_MAX: usize = 20;
/// A shift below this ends the iteration, pixels.
const LAST_STEP_PX: f64 = 0.003;
/// A match farther from its start than this is a mismatch, pixels.
const SHIFT_MAX_PX: f64 = 3.0;
/// Pixels within which residuals are correlated: smoothing correlates two, illumination of slopes a few more.
const JOINED_PX: usize = 5;
/// Admissible gains of the brightness between two images of the same ground.
const GAIN: [f64; 2] = [0.1, 10.0];

/// A patch matched in another image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LeastSquaresMatch {
    /// From the middle of the patch to the other image.
    pub affine: Affine,
    /// Covariance of the position in the other image, lines and samples, pixels².
    pub covariance_px2: Matrix2<f64>,
    /// Correlation of the patch with the other image there.
    pub correlation: f64,
}

/// Reasons why a patch is not matched.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LeastSquaresFailure {
    /// It lies outside the available part of the other image.
    Outside,
    /// The steps do not converge, or diverge.
    NotConverged,
    /// The pixels do not determine the position.
    Undetermined,
}

type Normals = SMatrix<f64, UNKNOWNS, UNKNOWNS>;
type Row = SVector<f64, UNKNOWNS>;

/// Equations of one pixel each at an estimate.
struct Equations {
    rows: Vec<Row>,
    /// Template minus computed values.
    left: Vec<f64>,
    correlation: f64,
}

/// Moves `start` until the pixels of `template` agree best with the pixels of `other`; brightness may differ by an
/// offset and a gain, and the surface may be inclined differently.
///
/// The covariance uses residuals without a model: neighbours are correlated, and residuals may be larger where texture
/// is strong. It is the sum over all pairs of near pixels of the effect of their residuals on the position (Newey &
/// West 1987, in two dimensions), or the result for independent residuals where that is larger.
///
/// # Errors
/// [`LeastSquaresFailure`].
/// # Source
/// Förstner 1982; Gruen 1985.
pub fn match_least_squares(
    template: &Patch,
    other: &Patch,
    start: &Affine,
) -> Result<LeastSquaresMatch, LeastSquaresFailure> {
    let middle = template.middle();
    let half = 0.5 * template.size[0].max(template.size[1]) as f64;
    let mut affine = Affine {
        from: middle,
        to: start.apply(&middle),
        matrix: start.matrix,
    };
    let first = affine.to;
    let mut light = initial_light(template, other, &affine)?;
    for _ in 0..STEPS_MAX {
        let equations = equations(template, other, &affine, light, half)?;
        let inverse = inverse(&equations)?;
        let right: Row = equations
            .rows
            .iter()
            .zip(&equations.left)
            .map(|(row, left)| row * *left)
            .sum();
        let step = inverse * right;
        affine.to += Vector2::new(step[0], step[1]);
        affine.matrix += Matrix2::new(step[2], step[3], step[4], step[5]) / half;
        light = [light[0] + step[6], light[1] + step[7]];
        let moved_px = step.fixed_rows::<2>(0).norm();
        let turned_px = step.fixed_rows::<4>(2).norm();
        let is_near = (affine.to - first).norm() <= SHIFT_MAX_PX;
        let is_lit = (GAIN[0]..=GAIN[1]).contains(&light[1]);
        if !(is_near && is_lit && turned_px <= half) {
            return Err(LeastSquaresFailure::NotConverged);
        }
        if moved_px <= LAST_STEP_PX {
            return finish(template, other, affine, light, half);
        }
    }
    Err(LeastSquaresFailure::NotConverged)
}

/// The match at the last estimate.
fn finish(
    template: &Patch,
    other: &Patch,
    affine: Affine,
    light: [f64; 2],
    half: f64,
) -> Result<LeastSquaresMatch, LeastSquaresFailure> {
    let equations = equations(template, other, &affine, light, half)?;
    let inverse = inverse(&equations)?;
    let squares: f64 = equations.left.iter().map(|left| left * left).sum();
    let freedom = (equations.left.len().saturating_sub(UNKNOWNS)).max(1) as f64;
    let independent = inverse.fixed_view::<2, 2>(0, 0) * (squares / freedom);
    let joined =
        joined(&equations, &inverse, template.size) * (equations.left.len() as f64 / freedom);
    let is_larger = joined.trace() > independent.trace() && joined.determinant() > 0.0;
    Ok(LeastSquaresMatch {
        affine,
        covariance_px2: if is_larger { joined } else { independent },
        correlation: equations.correlation,
    })
}

/// Offset and gain by which the other image has the brightness and contrast of the template.
fn initial_light(
    template: &Patch,
    other: &Patch,
    affine: &Affine,
) -> Result<[f64; 2], LeastSquaresFailure> {
    let there = other
        .resampled(template.first, template.size, affine)
        .ok_or(LeastSquaresFailure::Outside)?;
    let moments = |patch: &Patch| {
        let count = patch.values.len() as f64;
        let values = || patch.values.iter().copied().map(f64::from);
        let mean = values().sum::<f64>() / count;
        let variance = values().map(|value| (value - mean).powi(2)).sum::<f64>() / count;
        [mean, variance.sqrt()]
    };
    let [[mean, spread], [other_mean, other_spread]] = [template, &there].map(moments);
    if !(other_spread > 0.0) {
        return Err(LeastSquaresFailure::Undetermined);
    }
    let gain = spread / other_spread;
    Ok([mean - gain * other_mean, gain])
}

fn equations(
    template: &Patch,
    other: &Patch,
    affine: &Affine,
    [offset, gain]: [f64; 2],
    half: f64,
) -> Result<Equations, LeastSquaresFailure> {
    let count = template.values.len();
    let (mut rows, mut left) = (Vec::with_capacity(count), Vec::with_capacity(count));
    // Sums of template, other, their squares and their product.
    let mut sums = [0.0; 5];
    for line in 0..template.size[0] {
        for sample in 0..template.size[1] {
            let place = Vector2::new(
                template.first[0] as f64 + line as f64 + 0.5,
                template.first[1] as f64 + sample as f64 + 0.5,
            );
            let there = other
                .between(&affine.apply(&place))
                .ok_or(LeastSquaresFailure::Outside)?;
            let here = f64::from(template.at(line, sample));
            let away = (place - affine.from) / half;
            let [down, right] = there.slope.map(|slope| gain * slope);
            rows.push(Row::from([
                down,
                right,
                down * away.x,
                down * away.y,
                right * away.x,
                right * away.y,
                1.0,
                there.value,
            ]));
            left.push(here - offset - gain * there.value);
            let terms = [
                here,
                there.value,
                here * here,
                there.value * there.value,
                here * there.value,
            ];
            for (sum, term) in sums.iter_mut().zip(terms) {
                *sum += term;
            }
        }
    }
    let [a, b, aa, bb, ab] = sums.map(|sum| sum / count as f64);
    let correlation = (ab - a * b) / ((aa - a * a) * (bb - b * b)).sqrt();
    Ok(Equations {
        rows,
        left,
        correlation,
    })
}

/// Inverse of the normal equations, scaled so that grey values and slopes are of like size.
fn inverse(equations: &Equations) -> Result<Normals, LeastSquaresFailure> {
    let mut normals = Normals::zeros();
    for row in &equations.rows {
        normals.ger(1.0, row, row, 1.0);
    }
    let scale = normals.diagonal().map(|square| 1.0 / square.sqrt());
    if !scale.iter().all(|scale| scale.is_finite()) {
        return Err(LeastSquaresFailure::Undetermined);
    }
    let scale = Normals::from_diagonal(&scale);
    let scaled = scale * normals * scale;
    let inverse = scaled
        .cholesky()
        .ok_or(LeastSquaresFailure::Undetermined)?
        .inverse();
    Ok(scale * inverse * scale)
}

/// Contribution to the position's covariance of residuals correlated within [`JOINED_PX`].
fn joined(equations: &Equations, inverse: &Normals, size: [usize; 2]) -> Matrix2<f64> {
    let influence = inverse.fixed_rows::<2>(0).into_owned();
    let moves: Vec<Vector2<f64>> = equations
        .rows
        .iter()
        .zip(&equations.left)
        .map(|(row, left)| influence * row * *left)
        .collect();
    let weight = |lag: usize| 1.0 - lag as f64 / (JOINED_PX + 1) as f64;
    let lagged = |down: usize, right: isize| -> Matrix2<f64> {
        let mut sum = Matrix2::zeros();
        for line in 0..size[0].saturating_sub(down) {
            for sample in 0..size[1] {
                let Some(other) = sample.checked_add_signed(right).filter(|at| *at < size[1])
                else {
                    continue;
                };
                let [one, other] =
                    [line * size[1] + sample, (line + down) * size[1] + other].map(|at| &moves[at]);
                sum += one * other.transpose();
            }
        }
        sum
    };
    let mut covariance = Matrix2::zeros();
    let reach = isize::try_from(JOINED_PX).unwrap_or_default();
    for down in 0..=JOINED_PX {
        for right in -reach..=reach {
            if down == 0 && right < 0 {
                continue;
            }
            let weighted = lagged(down, right) * (weight(down) * weight(right.unsigned_abs()));
            covariance += weighted;
            if down > 0 || right > 0 {
                covariance += weighted.transpose();
            }
        }
    }
    covariance
}
