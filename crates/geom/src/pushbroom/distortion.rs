//! Distortion of a detector line: the look direction of each sample, and the sample of a look direction.
//!
//! Look directions are tangents in camera axes, `q1/q3` along the track and `q2/q3` across it. A distorted
//! line is a curve in this plane: every sample has its own tangent along the track.

use nalgebra::{Matrix2, Vector2};

use areograph_base::instruments::{
    COEFFICIENTS_MAX, DistortionModel, Instrument, TRANSVERSE_TERMS,
};

/// Distances from the boresight below this are zero, thousands of pixels or millimetres.
const DISTANCE_MIN: f64 = 1e-6;
/// Samples per line at which a line is checked.
const CHECKED_AT: u32 = 200;
/// Steps of the search for a sample, and the last of them in the unit of its coordinate.
const STEPS_MAX: u32 = 30;
const LAST_STEP: f64 = 1e-13;

/// Look directions of the samples of an image's line.
///
/// Beyond its ends a line is extended straight, so that points beside the image have a sample as well.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Distortion {
    line: Option<DistortedLine>,
}

/// A detector line that is not the straight one of an ideal camera.
#[derive(Debug, Clone, Copy, PartialEq)]
struct DistortedLine {
    law: Law,
    coefficients: [f64; COEFFICIENTS_MAX],
    /// The line's distance from the boresight towards +X, in the unit of the law.
    along: f64,
    /// Unit of the law per sample.
    per_sample: f64,
    /// First and last point, by the coordinate across the track.
    ends: [CurvePoint; 2],
}

/// The unit in which a law measures distances from the boresight, and its formula.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Law {
    /// The angle off the boresight is a polynomial of odd powers of the distance in thousands of pixels.
    Angle,
    /// Ideal coordinates are `1 − Σ kᵢ r²ⁱ` times the distorted ones, millimetres, in front of a focal length.
    Radial { focal_length_mm: f64 },
    /// Across the track ideal coordinates are the distorted ones over `1 + k c²`, millimetres, in front of a focal
    /// length.
    AcrossQuotient { focal_length_mm: f64 },
    /// Distorted coordinates are polynomials of the ideal ones, millimetres, in front of a focal length.
    Transverse {
        focal_length_mm: f64,
        polynomials: [[f64; TRANSVERSE_TERMS]; 2],
    },
}

/// A point of the line and its change with the coordinate `c` across the track.
#[derive(Debug, Clone, Copy, PartialEq)]
struct CurvePoint {
    c: f64,
    along: f64,
    across: f64,
    along_by_c: f64,
    across_by_c: f64,
}

/// A line of which two samples have one look direction, or one looks back.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error(
    "pixel {pixel:.1} of the detector does not point farther across the track than the next pixel towards the boresight"
)]
pub struct FoldedLine {
    /// Pixel, from the outer edge of the first one.
    pub pixel: f64,
}

impl Distortion {
    /// A straight line through the boresight, pixels of equal width in the focal plane.
    pub const NONE: Self = Self { line: None };

    /// The distortion of `instrument` for an image that sums `summing` pixels in a sample.
    ///
    /// Its validity is tested by [`Self::check`].
    #[must_use]
    pub fn of(instrument: &Instrument, summing: f64) -> Self {
        let detector = &instrument.detector;
        let pitch_mm = instrument.optics.pixel_pitch_mm;
        let radial = Law::Radial {
            focal_length_mm: instrument.optics.focal_length_mm,
        };
        let (law, written, [per_pixel, along]): (Law, &[f64], [f64; 2]) = match &instrument
            .distortion
        {
            DistortionModel::None if detector.along_track_px.abs() <= 0.0 => {
                return Self::NONE;
            }
            DistortionModel::None => (radial, &[], [pitch_mm, pitch_mm * detector.along_track_px]),
            DistortionModel::RadialPolynomial { coefficients } => (
                radial,
                coefficients,
                [pitch_mm, pitch_mm * detector.along_track_px],
            ),
            DistortionModel::AcrossQuotient {
                coefficient_per_mm2,
            } => (
                Law::AcrossQuotient {
                    focal_length_mm: instrument.optics.focal_length_mm,
                },
                std::slice::from_ref(coefficient_per_mm2),
                [pitch_mm, pitch_mm * detector.along_track_px],
            ),
            DistortionModel::Transverse { coefficients } => (
                Law::Transverse {
                    focal_length_mm: instrument.optics.focal_length_mm,
                    polynomials: *coefficients,
                },
                &[],
                [pitch_mm, pitch_mm * detector.along_track_px],
            ),
            DistortionModel::AnglePolynomial {
                coefficients_rad,
                scale,
            } => (
                Law::Angle,
                coefficients_rad,
                [1e-3 * scale, 1e-3 * detector.along_track_px],
            ),
        };
        let mut coefficients = [0.0; COEFFICIENTS_MAX];
        for (place, value) in coefficients.iter_mut().zip(written) {
            *place = *value;
        }
        let ends_px = [
            -detector.boresight_px,
            f64::from(detector.pixels) - detector.boresight_px,
        ];
        let nowhere = CurvePoint {
            c: 0.0,
            along: 0.0,
            across: 0.0,
            along_by_c: 0.0,
            across_by_c: 0.0,
        };
        let mut line = DistortedLine {
            law,
            coefficients,
            along,
            per_sample: per_pixel * summing,
            ends: [nowhere; 2],
        };
        let sense = detector.samples_along.sign();
        let mut ends = ends_px.map(|end_px| line.within(sense * end_px * per_pixel));
        ends.sort_by(|one, other| one.c.total_cmp(&other.c));
        line.ends = ends;
        Self { line: Some(line) }
    }

    /// Checks that every pixel of `instrument` looks farther across the track than those nearer to the boresight.
    ///
    /// # Errors
    /// The first pixel that does not.
    pub fn check(instrument: &Instrument) -> Result<(), FoldedLine> {
        let Some(line) = Self::of(instrument, 1.0).line else {
            return Ok(());
        };
        let detector = &instrument.detector;
        for step in 0..=CHECKED_AT {
            let pixel = f64::from(step) / f64::from(CHECKED_AT) * f64::from(detector.pixels);
            let place = line.within((pixel - detector.boresight_px) * line.per_sample);
            // Else the tangent of more than a right angle; polynomials give tangents, and may move the boresight.
            let ahead = matches!(line.law, Law::Transverse { .. }) || place.across * place.c >= 0.0;
            if !(ahead && place.across_by_c > 0.0 && place.across_by_c.is_finite()) {
                return Err(FoldedLine { pixel });
            }
        }
        Ok(())
    }

    /// Tangents along and across the track of the place `samples` from the boresight towards +Y; `None`
    /// without distortion.
    pub(super) fn look(&self, samples: f64) -> Option<[f64; 2]> {
        let line = self.line.as_ref()?;
        let place = line.at(samples * line.per_sample);
        Some([place.along, place.across])
    }

    /// Samples from the boresight towards +Y of the place with a tangent across the track; `None` without
    /// distortion.
    pub(super) fn samples(&self, across: f64) -> Option<f64> {
        let line = self.line.as_ref()?;
        Some(line.coordinate(across) / line.per_sample)
    }

    /// Change of the tangent across the track per sample, where it is `across`; `None` without distortion.
    pub(super) fn across_per_sample(&self, across: f64) -> Option<f64> {
        let line = self.line.as_ref()?;
        Some(line.at(line.coordinate(across)).across_by_c * line.per_sample)
    }

    /// Tangent along the track where the line has the tangent `across`, and its change with `across`.
    pub(crate) fn curve(&self, across: f64) -> [f64; 2] {
        let Some(line) = &self.line else {
            return [0.0; 2];
        };
        let place = line.at(line.coordinate(across));
        [place.along, place.along_by_c / place.across_by_c]
    }
}

impl DistortedLine {
    /// Tangent over distance at the distance `r`, and its derivative over `r`; 1/f for polynomials of both coordinates.
    fn scale(&self, r: f64) -> [f64; 2] {
        let square = r * r;
        // Value and derivative by r² of the polynomial in r².
        let (mut value, mut rate) = (0.0, 0.0);
        for coefficient in self.coefficients.iter().rev() {
            rate = rate * square + value;
            value = value * square + coefficient;
        }
        match self.law {
            Law::Radial { focal_length_mm } => [
                (1.0 - value) / focal_length_mm,
                -2.0 * rate / focal_length_mm,
            ],
            Law::AcrossQuotient { focal_length_mm } => {
                let coefficient = self.coefficients[0];
                let by = 1.0 + coefficient * square;
                [
                    1.0 / (by * focal_length_mm),
                    -2.0 * coefficient / (by * by * focal_length_mm),
                ]
            }
            Law::Transverse {
                focal_length_mm, ..
            } => [1.0 / focal_length_mm, 0.0],
            Law::Angle if r < DISTANCE_MIN => [value, 2.0 * (rate + value * value * value / 3.0)],
            Law::Angle => {
                let tangent = (r * value).tan();
                let angle_rate = value + 2.0 * square * rate;
                let over_distance = tangent / r;
                let by_distance = (1.0 + tangent * tangent) * angle_rate;
                [over_distance, (by_distance - over_distance) / square]
            }
        }
    }

    /// The point with coordinate `c`, by the law.
    fn within(&self, c: f64) -> CurvePoint {
        if let Law::AcrossQuotient { focal_length_mm } = self.law {
            let [scale, rate] = self.scale(c);
            return CurvePoint {
                c,
                along: self.along / focal_length_mm,
                across: c * scale,
                along_by_c: 0.0,
                across_by_c: scale + c * c * rate,
            };
        }
        if let Law::Transverse {
            focal_length_mm,
            polynomials,
        } = &self.law
        {
            return self.transverse(*focal_length_mm, polynomials, c);
        }
        let [scale, rate] = self.scale(c.hypot(self.along));
        CurvePoint {
            c,
            along: self.along * scale,
            across: c * scale,
            along_by_c: self.along * c * rate,
            across_by_c: scale + c * c * rate,
        }
    }

    /// The point whose distorted coordinates are those of the line at `c`, by Newton's method.
    fn transverse(
        &self,
        focal_length_mm: f64,
        polynomials: &[[f64; TRANSVERSE_TERMS]; 2],
        c: f64,
    ) -> CurvePoint {
        let mut ideal = Vector2::new(self.along, c);
        let mut by_ideal = Matrix2::identity();
        for _ in 0..STEPS_MAX {
            let distorted;
            (distorted, by_ideal) = third_degree(polynomials, &ideal);
            let missed = Vector2::new(self.along, c) - distorted;
            let Some(step) = by_ideal.try_inverse().map(|inverse| inverse * missed) else {
                break;
            };
            ideal += step;
            // Written so that NaN ends it.
            if !(step.amax() > LAST_STEP * focal_length_mm) {
                break;
            }
        }
        // A singular one has no coordinate that increases with c: the check refuses it.
        let by_distorted = by_ideal.try_inverse().unwrap_or_default();
        CurvePoint {
            c,
            along: ideal.x / focal_length_mm,
            across: ideal.y / focal_length_mm,
            along_by_c: by_distorted.m12 / focal_length_mm,
            across_by_c: by_distorted.m22 / focal_length_mm,
        }
    }

    /// The point of the curve, extended straight beyond the ends.
    fn at(&self, c: f64) -> CurvePoint {
        let [first, last] = &self.ends;
        let end = if c < first.c {
            first
        } else if c > last.c {
            last
        } else {
            return self.within(c);
        };
        CurvePoint {
            c,
            along: end.along + end.along_by_c * (c - end.c),
            across: end.across + end.across_by_c * (c - end.c),
            ..*end
        }
    }

    /// The coordinate of the point with the tangent `across`, by Newton's method on the angle.
    fn coordinate(&self, across: f64) -> f64 {
        let [first, last] = &self.ends;
        for (end, beyond) in [(first, across < first.across), (last, across > last.across)] {
            if beyond {
                return end.c + (across - end.across) / end.across_by_c;
            }
        }
        let angle_rad = across.atan();
        let spread_rad = last.across.atan() - first.across.atan();
        let share = (angle_rad - first.across.atan()) / spread_rad;
        let mut c = first.c + share * (last.c - first.c);
        for _ in 0..STEPS_MAX {
            let place = self.within(c);
            let slope = place.across_by_c / (1.0 + place.across * place.across);
            let step = (angle_rad - place.across.atan()) / slope;
            c = (c + step).clamp(first.c, last.c);
            // Written so that NaN ends it.
            if !(step.abs() > LAST_STEP) {
                break;
            }
        }
        c
    }
}

/// Polynomials of third degree at a place, and their derivatives: a row for each polynomial.
///
/// # Source
/// `computeTransverseDistortion` of usgscsm: the order of the terms.
fn third_degree(
    polynomials: &[[f64; TRANSVERSE_TERMS]; 2],
    place: &Vector2<f64>,
) -> (Vector2<f64>, Matrix2<f64>) {
    let (x, y) = (place.x, place.y);
    let terms = [
        1.0,
        x,
        y,
        x * x,
        x * y,
        y * y,
        x * x * x,
        x * x * y,
        x * y * y,
        y * y * y,
    ];
    let by_x = [
        0.0,
        1.0,
        0.0,
        2.0 * x,
        y,
        0.0,
        3.0 * x * x,
        2.0 * x * y,
        y * y,
        0.0,
    ];
    let by_y = [
        0.0,
        0.0,
        1.0,
        0.0,
        x,
        2.0 * y,
        0.0,
        x * x,
        2.0 * x * y,
        3.0 * y * y,
    ];
    let sum = |of: &[f64; TRANSVERSE_TERMS], row: usize| -> f64 {
        of.iter().zip(&polynomials[row]).map(|(a, b)| a * b).sum()
    };
    (
        Vector2::new(sum(&terms, 0), sum(&terms, 1)),
        Matrix2::new(sum(&by_x, 0), sum(&by_y, 0), sum(&by_x, 1), sum(&by_y, 1)),
    )
}
