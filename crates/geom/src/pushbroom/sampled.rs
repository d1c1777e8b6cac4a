//! Orientation through its samples, without a polynomial over the whole image, so that the effect of a polynomial can
//! be measured.

use nalgebra::{Matrix3, Vector3};

use super::{ExteriorOrientation, Pose, PoseRate};
use crate::attitude::{left_jacobian_product, matrix_of_rotation_vector, rotation_vector};

/// Orientation that interpolates every one of its samples.
///
/// Between two samples positions and rotation vectors are cubics whose slopes at the samples follow the parabola
/// through three neighbours (exact for quadratic motion); before the first and after the last they are extended
/// straight.
#[derive(Debug, Clone, PartialEq)]
pub struct SampledOrientation {
    nodes: Vec<Node>,
    reference: Matrix3<f64>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Node {
    x: f64,
    position_m: Curve,
    vector_rad: Curve,
}

/// Value and slope at a node.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Curve {
    value: Vector3<f64>,
    slope: Vector3<f64>,
}

/// Invalid samples of an orientation.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum SamplesError {
    /// Fewer than three.
    #[error("{0} orientation samples; expected at least 3")]
    TooFew(usize),
    /// Lines that do not increase, or are not finite.
    #[error(
        "sample {row} at line {x} follows a sample at line {before}; expected increasing lines"
    )]
    NotIncreasing {
        /// Sample, counted from 0.
        row: usize,
        /// Its line.
        x: f64,
        /// The line of the sample before.
        before: f64,
    },
    /// A position that is not finite, or a matrix that is not a rotation.
    #[error(
        "sample {row} is invalid (determinant of the rotation {determinant}); expected a finite position and a rotation"
    )]
    NotAPose {
        /// Sample, counted from 0.
        row: usize,
        /// Determinant of its matrix.
        determinant: f64,
    },
}

/// A matrix is a rotation when its determinant and the products of its rows match within this.
const ROTATION_TOLERANCE: f64 = 1e-6;

impl SampledOrientation {
    /// The orientation through `samples`, lines with poses.
    ///
    /// # Errors
    /// Fewer than three samples, lines that do not increase, invalid poses.
    pub fn new(samples: &[(f64, Pose)]) -> Result<Self, SamplesError> {
        if samples.len() < 3 {
            return Err(SamplesError::TooFew(samples.len()));
        }
        for (row, (_, pose)) in samples.iter().enumerate() {
            let matrix = &pose.mars_to_camera;
            let determinant = matrix.determinant();
            let skew = (matrix * matrix.transpose() - Matrix3::identity())
                .abs()
                .max();
            let rotates = (determinant - 1.0).abs() <= ROTATION_TOLERANCE
                && skew <= ROTATION_TOLERANCE
                && pose.position_m.iter().all(|value| value.is_finite());
            if !rotates {
                return Err(SamplesError::NotAPose { row, determinant });
            }
        }
        for (row, pair) in samples.windows(2).enumerate() {
            let (before, x) = (pair[0].0, pair[1].0);
            if !(before < x && before.is_finite() && x.is_finite()) {
                let row = row + 1;
                return Err(SamplesError::NotIncreasing { row, x, before });
            }
        }
        let reference = samples[samples.len() / 2].1.mars_to_camera;
        let x: Vec<f64> = samples.iter().map(|sample| sample.0).collect();
        let positions: Vec<Vector3<f64>> = samples.iter().map(|s| s.1.position_m).collect();
        let vectors: Vec<Vector3<f64>> = samples
            .iter()
            .map(|sample| rotation_vector(&(sample.1.mars_to_camera * reference.transpose())))
            .collect();
        let nodes = (0..x.len())
            .map(|row| Node {
                x: x[row],
                position_m: Curve::at(&x, &positions, row),
                vector_rad: Curve::at(&x, &vectors, row),
            })
            .collect();
        Ok(Self { nodes, reference })
    }

    /// Position and rotation vector at `x`.
    fn curves(&self, x: f64) -> (Curve, Curve) {
        let after = self.nodes.partition_point(|node| node.x < x);
        let (Some(before), Some(next)) =
            (self.nodes.get(after.wrapping_sub(1)), self.nodes.get(after))
        else {
            let end = &self.nodes[after.min(self.nodes.len() - 1)];
            let straight = |curve: &Curve| Curve {
                value: curve.value + curve.slope * (x - end.x),
                slope: curve.slope,
            };
            return (straight(&end.position_m), straight(&end.vector_rad));
        };
        let width = next.x - before.x;
        let along = (x - before.x) / width;
        (
            Curve::between(&before.position_m, &next.position_m, width, along),
            Curve::between(&before.vector_rad, &next.vector_rad, width, along),
        )
    }
}

impl Curve {
    /// Value at sample `row` with the slope of the parabola through it and two neighbours.
    fn at(x: &[f64], values: &[Vector3<f64>], row: usize) -> Self {
        let first = row.saturating_sub(1).min(x.len() - 3);
        let chord = |from: usize| (values[from + 1] - values[from]) / (x[from + 1] - x[from]);
        let (before, after) = (chord(first), chord(first + 1));
        let bend = (after - before) / (x[first + 2] - x[first]);
        let from_both = (x[row] - x[first]) + (x[row] - x[first + 1]);
        Self {
            value: values[row],
            slope: before + bend * from_both,
        }
    }

    /// The cubic between two nodes `width` lines apart, at the share `along` of the way.
    fn between(before: &Self, next: &Self, width: f64, along: f64) -> Self {
        let (s, s2) = (along, along * along);
        let rise = next.value - before.value;
        let (bend_before, bend_next) = (before.slope * width, next.slope * width);
        let square = rise * 3.0 - bend_before * 2.0 - bend_next;
        let cube = bend_before + bend_next - rise * 2.0;
        Self {
            value: before.value + bend_before * s + square * s2 + cube * (s2 * s),
            slope: (bend_before + square * (2.0 * s) + cube * (3.0 * s2)) / width,
        }
    }
}

impl ExteriorOrientation for SampledOrientation {
    fn pose(&self, x: f64) -> Pose {
        self.pose_and_rate(x).0
    }

    fn pose_and_rate(&self, x: f64) -> (Pose, PoseRate) {
        let (position_m, vector_rad) = self.curves(x);
        let pose = Pose {
            position_m: position_m.value,
            mars_to_camera: matrix_of_rotation_vector(&vector_rad.value) * self.reference,
        };
        let motion = PoseRate {
            advance_m: position_m.slope,
            turn_rad: left_jacobian_product(&vector_rad.value, &vector_rad.slope),
        };
        (pose, motion)
    }
}
