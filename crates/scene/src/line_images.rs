//! Images of the lines of a stereo camera over synthetic ground, pixel by pixel.

use std::{fs::File, io::BufWriter, path::Path};

use nalgebra::Vector3;
use rayon::prelude::*;
use tiff::encoder::{TiffEncoder, colortype::Gray8};

use super::{
    compression::compressed,
    error::SceneError,
    line_light::Light,
    pushbroom_pair::{Orbit, StereoLine},
    random::{Random, mix, normal_of, unit_of},
    terrain::Terrain,
    value_noise::noise,
};
use areograph_base::{
    error::{Error, IoError, Result},
    watch::Watch,
};

/// Spacings of the lattices of albedo, metres: the finest is two pixels.
const LATTICES_M: [f64; 5] = [54.0, 108.0, 216.0, 432.0, 864.0];
/// Largest relative change of albedo by a lattice.
const CONTRAST: f64 = 0.14;
/// Values of a flat point of mean albedo, and of a black one.
const LEVEL_DN: [f64; 2] = [130.0, 12.0];
/// Noise of a pixel.
const NOISE_DN: f64 = 1.0;
/// Share of its light that a pixel receives from each neighbour on an axis.
const BLUR: f64 = 0.12;
/// Largest deviation of the response of a line from the mean, where lines differ.
const RESPONSE: f64 = 0.03;
/// Height tolerance of the intersection with the ground, metres: a thousandth of a pixel.
const TOLERANCE_M: f64 = 0.05;
/// Lines that are rendered at a time.
const STRIP: u32 = 100;

/// The ground and its illumination.
pub(super) struct LineImages<'a> {
    pub(super) orbit: &'a Orbit,
    pub(super) terrain: &'a Terrain,
    pub(super) seed: u64,
    /// Whether light and response differ between lines, the ground has shadows, and images lose by compression.
    pub(super) is_fair: bool,
}

impl LineImages<'_> {
    /// Writes the image of a line as a TIFF of 8 bits.
    ///
    /// # Errors
    /// A pixel that does not see the ground; errors of writing.
    pub(super) fn write(&self, path: &Path, line: &StereoLine, watch: Watch<'_>) -> Result<()> {
        let [lines, samples] = self.orbit.size;
        let pixels = self.pixels(line, watch)?;
        let file = File::create(path).map_err(IoError::on("create"))?;
        let written = TiffEncoder::new(BufWriter::new(file))
            .and_then(|mut encoder| encoder.write_image::<Gray8>(samples, lines, &pixels));
        written.map_err(|error| {
            Error::from(IoError {
                action: "write",
                source: std::io::Error::other(error),
            })
        })
    }

    fn pixels(&self, line: &StereoLine, watch: Watch<'_>) -> Result<Vec<u8>> {
        let lines = self.orbit.size[0];
        let starts: Vec<u32> = (0..lines).step_by(STRIP as usize).collect();
        let strips = starts.into_par_iter().map(|start| {
            let end = (start + STRIP).min(lines);
            let strip = self.strip(line, start..end);
            watch.step(u64::from(end - start), "image lines");
            strip
        });
        let strips: Vec<Vec<u8>> = strips.collect::<Result<_>>()?;
        let pixels = strips.concat();
        Ok(if self.is_fair {
            compressed(&pixels, self.orbit.size[1] as usize)
        } else {
            pixels
        })
    }

    fn strip(&self, line: &StereoLine, lines: std::ops::Range<u32>) -> Result<Vec<u8>> {
        let response = self.response(line);
        // Slopes require a point on every side, blurring another one.
        let numbers = i64::from(lines.start) - 2..i64::from(lines.end) + 2;
        let rows = numbers
            .clone()
            .map(|row| self.ground_m(line, row as f64 + 0.5));
        let rows: Option<Vec<Vec<Vector3<f64>>>> = rows.collect();
        let rows = rows.ok_or_else(|| SceneError::Image {
            image: line.name.to_owned(),
            error: format!("lines {} to {} miss the ground", lines.start, lines.end),
        })?;
        let sharp = rows.windows(3).zip(numbers.skip(1)).map(|(rows, number)| {
            let (above, here, below) = (&rows[0], &rows[1], &rows[2]);
            let light = self.light(line, number as f64 + 0.5);
            let number = |at: usize| {
                let slope = (here[at + 1] - here[at - 1]).cross(&(below[at] - above[at]));
                response * self.number(&here[at], &slope, &light)
            };
            (1..here.len() - 1).map(number).collect()
        });
        let sharp: Vec<Vec<f64>> = sharp.collect();
        let mut pixels = Vec::new();
        for (rows, number) in sharp.windows(3).zip(lines) {
            let down =
                |at: usize| BLUR * (rows[0][at] + rows[2][at]) + (1.0 - 2.0 * BLUR) * rows[1][at];
            for sample in 0..self.orbit.size[1] {
                let at = sample as usize;
                let dn = BLUR * (down(at) + down(at + 2)) + (1.0 - 2.0 * BLUR) * down(at + 1);
                pixels.push(self.read_out(line, dn, number, sample));
            }
        }
        Ok(pixels)
    }

    /// The light while a line of an image is exposed.
    fn light(&self, line: &StereoLine, at_line: f64) -> Light {
        if !self.is_fair {
            return Light::steady(self.orbit);
        }
        let camera = line.truth(self.orbit.samples());
        let pose = self.orbit.true_pose(line, &camera, at_line);
        Light::of_line(self.orbit, line, at_line, pose.position_m)
    }

    /// The response of a line.
    fn response(&self, line: &StereoLine) -> f64 {
        if self.is_fair {
            let mut random = Random::new(self.seed, &format!("response of {}", line.name));
            1.0 + random.between(-RESPONSE, RESPONSE)
        } else {
            1.0
        }
    }

    /// Ground at the middles of the samples of a line and of two more on either side.
    fn ground_m(&self, line: &StereoLine, at_line: f64) -> Option<Vec<Vector3<f64>>> {
        let samples = self.orbit.samples();
        let camera = line.truth(samples);
        let pose = self.orbit.true_pose(line, &camera, at_line);
        let mut near_m = None;
        let mut ground_m = Vec::new();
        for sample in -2..=i64::from(self.orbit.size[1]) + 1 {
            let tangents = camera.tangents(2.0 * (sample as f64 + 0.5) / samples - 1.0);
            let look = Vector3::new(tangents.x, tangents.y, 1.0).normalize();
            let direction = pose.to_mars * look;
            let start_m = match near_m {
                Some(near_m) => near_m,
                None => self.terrain.range_m(&pose.position_m, &direction)?,
            };
            let range_m =
                self.terrain
                    .range_near_m(&pose.position_m, &direction, start_m, TOLERANCE_M)?;
            near_m = Some(range_m);
            ground_m.push(pose.position_m + range_m * direction);
        }
        Some(ground_m)
    }

    /// The value of a ground point by its albedo and slope.
    fn number(&self, ground_m: &Vector3<f64>, slope: &Vector3<f64>, light: &Light) -> f64 {
        let normal = slope.normalize() * slope.dot(ground_m).signum();
        let light = light.on(self.terrain, ground_m, &normal);
        let key = mix(self.seed ^ 0x00A1_BED0);
        let albedo: f64 = (0..)
            .zip(LATTICES_M)
            .map(|(octave, spacing_m)| {
                CONTRAST * noise(&(ground_m / spacing_m), key.wrapping_add(octave))
            })
            .sum();
        let [level_dn, black_dn] = LEVEL_DN;
        black_dn + (level_dn - black_dn) * (1.0 + albedo) * light
    }

    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped to the range of a byte before; 0 means no pixel"
    )]
    fn read_out(&self, line: &StereoLine, dn: f64, at_line: u32, sample: u32) -> u8 {
        let key = line
            .name
            .bytes()
            .fold(mix(self.seed), |key, byte| mix(key ^ u64::from(byte)));
        let pixel = mix(key ^ (u64::from(at_line) << 32 | u64::from(sample)));
        let noise_dn = NOISE_DN * normal_of(unit_of(pixel), unit_of(mix(pixel)));
        (dn + noise_dn).round().clamp(1.0, 255.0) as u8
    }
}
