//! Rendering of an image: its ground under its illumination, through optics and detector.

use std::ops::Range;

use nalgebra::Vector3;

use super::{
    super::{
        drawn::Flown,
        error::SceneError,
        random::{mix, normal_of, unit_of},
        terrain::Terrain,
        ties::TrueImage,
        value_noise::noise,
    },
    light::{incidence_and_azimuth_deg, sun},
};
use areograph_base::error::Result;
use areograph_config::usual_instrument;

/// Spacings of the lattices of albedo, metres: the finest is two pixels of the image with the largest ones.
const LATTICES_M: [f64; 5] = [24.0, 48.0, 96.0, 192.0, 384.0];
/// Largest relative change of albedo by a lattice.
const CONTRAST: f64 = 0.14;
/// Values of a flat point of mean albedo, and of a black one. They are linear in brightness, as MOC's 8 bits are.
const LEVEL_DN: [f64; 2] = [130.0, 12.0];
/// Noise of a pixel.
const NOISE_DN: f64 = 1.0;
/// Brightness difference between even and odd detectors, counted from 1. In M01/00115, where a sample is the mean of
/// three detectors, alternately two of a kind and one of the other, neighbours differ by a third of it: 155.729 −
/// 155.409.
const EVEN_DN: f64 = 0.96;
/// Focal length over aperture, and the wavelength in the middle of the band from 0.5 to 0.9 µm, millimetres.
///
/// # Source
/// Malin et al. 1992.
const OPTICS: [f64; 2] = [10.0, 0.0007];

/// An image, its ground and its illumination.
pub(super) struct Rendering<'a> {
    pub(super) image: TrueImage<'a>,
    terrain: &'a Terrain,
    /// Keys of albedo, common to all images, and of this image's noise.
    keys: [u64; 2],
    /// Towards the Sun, unit vector.
    sun: Vector3<f64>,
    /// Share of its light that a pixel receives from each neighbour on an axis.
    blur: f64,
}

impl<'a> Rendering<'a> {
    pub(super) fn new(flown: &'a Flown, terrain: &'a Terrain, seed: u64) -> Result<Self> {
        let planned = flown.arc.image;
        let noise = planned
            .id
            .bytes()
            .fold(mix(seed), |key, byte| mix(key ^ u64::from(byte)));
        Ok(Self {
            image: TrueImage::new(flown, terrain)?,
            terrain,
            keys: [mix(seed ^ 0x00A1_BED0), noise],
            sun: sun(flown),
            blur: blur(planned.summing),
        })
    }

    /// Incidence angle of the Sun over the site, and its azimuth from north to east, degrees.
    pub(super) fn sun_deg(&self) -> [f64; 2] {
        incidence_and_azimuth_deg(self.image.flown.arc.image, &self.sun)
    }

    /// Pixels of some lines and samples.
    pub(super) fn pixels(&self, lines: Range<u32>, samples: Range<u32>) -> Result<Vec<u8>> {
        let sharp = self.sharp(&lines, &samples)?;
        let (side, middle) = (self.blur, 1.0 - 2.0 * self.blur);
        let mut pixels = Vec::with_capacity(lines.len() * samples.len());
        for (rows, line) in sharp.windows(3).zip(lines) {
            let down = |at: usize| side * (rows[0][at] + rows[2][at]) + middle * rows[1][at];
            for (at, sample) in samples.clone().enumerate() {
                let dn = side * (down(at) + down(at + 2)) + middle * down(at + 1);
                pixels.push(self.read_out(dn, line, sample));
            }
        }
        Ok(pixels)
    }

    /// Values of a perfect camera at the middles of these pixels and of one more on every side, line by line.
    fn sharp(&self, lines: &Range<u32>, samples: &Range<u32>) -> Result<Vec<Vec<f64>>> {
        // Slopes require another one on every side.
        let around = |of: &Range<u32>| i64::from(of.start) - 2..i64::from(of.end) + 2;
        let rows = around(lines).map(|line| self.ground_m(line, around(samples)));
        let rows: Vec<Vec<Vector3<f64>>> = rows.collect::<Result<_>>()?;
        let sharp = rows.windows(3).map(|rows| {
            let (above, here, below) = (&rows[0], &rows[1], &rows[2]);
            let number = |at: usize| {
                let slope = (here[at + 1] - here[at - 1]).cross(&(below[at] - above[at]));
                self.number(&here[at], &slope)
            };
            (1..here.len() - 1).map(number).collect()
        });
        Ok(sharp.collect())
    }

    /// Ground at the middles of some pixels of a line.
    fn ground_m(&self, line: i64, samples: Range<i64>) -> Result<Vec<Vector3<f64>>> {
        let middle = |count: i64| count as f64 + 0.5;
        let seen = self
            .image
            .ground_of_line_m(self.terrain, middle(line), samples.map(middle));
        let nothing = || SceneError::Image {
            image: self.image.flown.arc.image.id.to_owned(),
            error: format!("line {line} misses the ground"),
        };
        let seen: Option<Vec<Vector3<f64>>> = seen.into_iter().collect();
        Ok(seen.ok_or_else(nothing)?)
    }

    /// The value of a ground point by its albedo and slope.
    fn number(&self, ground_m: &Vector3<f64>, slope: &Vector3<f64>) -> f64 {
        // Samples increase to either side of the flight: the normal is the one that points up.
        let normal = slope.normalize() * slope.dot(ground_m).signum();
        let light = normal.dot(&self.sun).max(0.0) / self.sun.dot(&ground_m.normalize());
        let albedo: f64 = (0..)
            .zip(LATTICES_M)
            .map(|(octave, spacing_m)| {
                CONTRAST * noise(&(ground_m / spacing_m), self.keys[0].wrapping_add(octave))
            })
            .sum();
        let [level_dn, black_dn] = LEVEL_DN;
        black_dn + (level_dn - black_dn) * (1.0 + albedo) * light
    }

    /// The byte of a pixel, with the noise and the offset of its detectors.
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped to the range of a byte before"
    )]
    fn read_out(&self, dn: f64, line: u32, sample: u32) -> u8 {
        let pixel = mix(self.keys[1] ^ (u64::from(line) << 32 | u64::from(sample)));
        let noise_dn = NOISE_DN * normal_of(unit_of(pixel), unit_of(mix(pixel)));
        let summing = self.image.flown.arc.image.summing;
        let even_share = even_detectors(sample, summing) as f64 / f64::from(summing);
        let dn = dn + noise_dn + EVEN_DN * even_share;
        dn.round().clamp(0.0, 255.0) as u8
    }
}

/// Number of even detectors, counted from 1, in a sample.
fn even_detectors(sample: u32, summing: u32) -> usize {
    let first = sample * summing;
    let detectors = first..first + summing;
    detectors.filter(|detector| detector % 2 == 1).count()
}

/// Share of its light that a pixel receives from each neighbour on an axis: at half a period a pixel, contrast is then
/// reduced as by the width of a pixel and the diffraction of the optics.
fn blur(summing: u32) -> f64 {
    let [f_number, wavelength_mm] = OPTICS;
    let pixel_mm = f64::from(summing) * usual_instrument().optics.pixel_pitch_mm;
    // Relative to the highest frequency that the aperture passes.
    let frequency = (0.5 / pixel_mm * wavelength_mm * f_number).min(1.0);
    let diffraction = std::f64::consts::FRAC_2_PI
        * (frequency.acos() - frequency * (1.0 - frequency * frequency).sqrt());
    let left = std::f64::consts::FRAC_2_PI * diffraction;
    0.25 * (1.0 - left)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_of_the_finest_contrast_passes_the_camera() {
        // Two pixels of 13 µm: 19.2 periods a millimetre of the 142.9 that f/10 passes, 0.829 of the contrast; the
        // pixel itself 0.637.
        let left = 1.0 - 4.0 * blur(2);
        assert!((left - 0.829 * 0.637).abs() < 1e-3, "{left}");
        // Coarser ones are blurred less.
        assert!(blur(3) < blur(2));
    }

    #[test]
    fn detectors_of_two_kinds_show_where_they_do_not_make_pairs() {
        let even = |summing| [0, 1, 2].map(|sample| even_detectors(sample, summing));
        assert_eq!(even(1), [0, 1, 0]);
        assert_eq!(even(2), [1; 3]);
        assert_eq!(even(3), [1, 2, 1]);
    }
}
