//! A rectangle of an image.

use nalgebra::Vector2;

use super::Affine;

/// A rectangle of an image as numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct Patch {
    /// Line and sample of its first pixel, counted from 0.
    pub first: [i64; 2],
    /// Its lines and samples.
    pub size: [usize; 2],
    /// Line by line.
    pub values: Vec<f32>,
}

/// An interpolated value, and its gradient.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Between {
    /// The number.
    pub value: f64,
    /// Its change per line and per sample.
    pub slope: [f64; 2],
}

impl Patch {
    /// The pixel at `line` and `sample` of the patch, counted from 0.
    #[must_use]
    pub fn at(&self, line: usize, sample: usize) -> f32 {
        self.values[line * self.size[1] + sample]
    }

    /// Some pixels, line by line.
    pub(super) fn row(&self, line: usize, samples: std::ops::Range<usize>) -> &[f32] {
        let start = line * self.size[1];
        &self.values[start + samples.start..start + samples.end]
    }

    /// The mean of every pixel with its neighbours, weighted 1, 2, 1 along and across the lines; each edge loses a
    /// pixel.
    ///
    /// The alternation from sample to sample of a camera's detectors is removed; noise is reduced to 3/8.
    #[must_use]
    pub fn smoothed(&self) -> Self {
        let size = self.size.map(|length| length.saturating_sub(2));
        let mut across = Vec::with_capacity(self.size[0] * size[1]);
        for line in 0..self.size[0] {
            let row = self.row(line, 0..self.size[1]);
            across.extend(
                row.windows(3)
                    .map(|near| 0.25 * (near[0] + near[2]) + 0.5 * near[1]),
            );
        }
        let mut values = Vec::with_capacity(size[0] * size[1]);
        for line in 0..size[0] {
            let rows = [0, 1, 2].map(|down| &across[(line + down) * size[1]..][..size[1]]);
            let pixels = rows[0].iter().zip(rows[1]).zip(rows[2]);
            values.extend(pixels.map(|((above, here), below)| 0.25 * (above + below) + 0.5 * here));
        }
        Self {
            first: self.first.map(|first| first + 1),
            size,
            values,
        }
    }

    /// The value at a position of the image, by cubic convolution; `None` where the patch lacks one of the 16 pixels
    /// around it.
    ///
    /// # Source
    /// Keys 1981, a = −1/2.
    #[must_use]
    pub fn between(&self, place: &Vector2<f64>) -> Option<Between> {
        let (top, down) = self.split(0, place.x)?;
        let (left, right) = self.split(1, place.y)?;
        let [lines, line_slopes] = cubic(down);
        let [samples, sample_slopes] = cubic(right);
        let mut between = Between {
            value: 0.0,
            slope: [0.0; 2],
        };
        for (line, (weight, slope)) in lines.iter().zip(line_slopes).enumerate() {
            let row = self.row(top + line, left..left + 4);
            let [mut value, mut change] = [0.0; 2];
            for (pixel, (weight, slope)) in row.iter().zip(samples.iter().zip(sample_slopes)) {
                value += weight * f64::from(*pixel);
                change += slope * f64::from(*pixel);
            }
            between.value += weight * value;
            between.slope[0] += slope * value;
            between.slope[1] += weight * change;
        }
        Some(between)
    }

    /// The first of the four pixels around a coordinate, and the coordinate's distance behind the second.
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "the value is compared with the patch size"
    )]
    fn split(&self, axis: usize, coordinate: f64) -> Option<(usize, f64)> {
        let behind = coordinate - 0.5 - self.first[axis] as f64;
        let end = self.size[axis] as f64 - 2.0;
        (1.0..end).contains(&behind).then(|| {
            // Without its fraction; a call of `floor` costs more.
            let pixel = behind as usize;
            (pixel - 1, behind - pixel as f64)
        })
    }

    /// The rectangle of another image with this `first` pixel and `size`, resampled from this image; `None` where the
    /// patch does not contain all of it.
    #[must_use]
    pub fn resampled(&self, first: [i64; 2], size: [usize; 2], warp: &Affine) -> Option<Self> {
        let mut values = Vec::with_capacity(size[0] * size[1]);
        for line in 0..size[0] {
            for sample in 0..size[1] {
                let middle = Vector2::new(
                    first[0] as f64 + line as f64 + 0.5,
                    first[1] as f64 + sample as f64 + 0.5,
                );
                #[allow(clippy::cast_possible_truncation, reason = "pixels are bytes")]
                values.push(self.between(&warp.apply(&middle))?.value as f32);
            }
        }
        Some(Self {
            first,
            size,
            values,
        })
    }

    /// Middle of the patch.
    #[must_use]
    pub fn middle(&self) -> Vector2<f64> {
        Vector2::from_fn(|axis, _| self.first[axis] as f64 + 0.5 * self.size[axis] as f64)
    }
}

/// Weights of four equally spaced values for one between the second and the third, `t` behind the second, and their
/// derivatives by `t`.
fn cubic(t: f64) -> [[f64; 4]; 2] {
    let (t2, t3) = (t * t, t * t * t);
    [
        [
            0.5 * (-t3 + 2.0 * t2 - t),
            0.5 * (3.0 * t3 - 5.0 * t2 + 2.0),
            0.5 * (-3.0 * t3 + 4.0 * t2 + t),
            0.5 * (t3 - t2),
        ],
        [
            0.5 * (-3.0 * t2 + 4.0 * t - 1.0),
            0.5 * (9.0 * t2 - 10.0 * t),
            0.5 * (-9.0 * t2 + 8.0 * t + 1.0),
            0.5 * (3.0 * t2 - 2.0 * t),
        ],
    ]
}
