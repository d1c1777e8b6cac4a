//! Images of the synthetic mission as the camera takes them: every pixel shows the ground that ties and shots are measured on,
//! by its albedo and its slope towards the Sun, with the noise of detectors.

use std::{
    fs::File,
    io::Write as _,
    ops::{Range, RangeInclusive},
    path::Path,
};

use nalgebra::Vector3;
use rayon::prelude::*;

use super::{
    drawn::Flown,
    error::SceneError,
    random::{mix, normal_of, unit_of},
    terrain::Terrain,
    ties::TrueImage,
};
use crate::{
    config::usual_instrument,
    error::{IoError, Locate as _, Result},
    pds::image_file::{Coding, NewImage, Predictor, encode},
    spice::Session,
    units::{RADIANS_PER_DEGREE, SECONDS_PER_MS},
};

/// Lines that are rendered at a time.
const STRIP_LINES: u32 = 64;
/// Spacings of the lattices of albedo, metres: the finest is two pixels of the image with the largest ones.
const LATTICES_M: [f64; 5] = [24.0, 48.0, 96.0, 192.0, 384.0];
/// Share of albedo that a lattice adds or takes at most.
const CONTRAST: f64 = 0.14;
/// Numbers of a flat place of mean albedo, and of a black one.
const LEVEL_DN: [f64; 2] = [130.0, 12.0];
/// Noise of a pixel.
const NOISE_DN: f64 = 1.0;
/// Offset of even samples, counted from 1, where nothing is summed.
const EVEN_DN: f64 = 2.0;
/// Zenith angle of the Sun: afternoon, to the west. Years apart, it is lower.
const SUN_RAD: [f64; 2] = [35.0 * RADIANS_PER_DEGREE, 45.0 * RADIANS_PER_DEGREE];

/// Writes the images that came down into `folder`, in the code that the archive has most of them in, without loss.
///
/// # Errors
/// An image that sees no ground, or cannot be coded; the system's refusal to write.
pub(super) fn write_images(
    folder: &Path,
    days: &[Flown],
    terrain: &Terrain,
    seed: u64,
    session: &Session,
) -> Result<()> {
    for flown in days.iter().filter(|flown| flown.arc.image.is_delivered()) {
        let planned = flown.arc.image;
        let camera = Rendering::new(flown, terrain, seed)?;
        let lines = planned.lines_delivered / 16 * 16;
        let starts: Vec<u32> = (0..lines).step_by(STRIP_LINES as usize).collect();
        let strips = starts.into_par_iter().map(|first| {
            camera.pixels(first..lines.min(first + STRIP_LINES), 0..planned.samples())
        });
        let strips: Vec<Vec<u8>> = strips.collect::<Result<_>>()?;
        let stop = session.et_to_utc(flown.arc.exposed.stop)?;
        let bytes = encoded(flown, &strips.concat(), &stop)?;
        let path = folder.join(format!(
            "{}.imq",
            planned.id.replace('-', "").to_lowercase()
        ));
        let written = File::create(&path).and_then(|mut file| file.write_all(&bytes));
        written.map_err(IoError::on("write")).in_file(&path)?;
    }
    Ok(())
}

fn encoded(flown: &Flown, pixels: &[u8], stop: &str) -> Result<Vec<u8>> {
    let planned = flown.arc.image;
    let failed = |error: &str| SceneError::Image {
        image: planned.id.to_owned(),
        error: error.to_owned(),
    };
    let clock = planned
        .sclk_start
        .split_once(':')
        .and_then(|(seconds, ticks)| Some((seconds.parse().ok()?, ticks.parse().ok()?)));
    let image = NewImage {
        product_id: &planned.id.replace('-', "/"),
        instrument: [&usual_instrument().label.instrument, ""],
        clock: clock.ok_or_else(|| failed("its clock string has no seconds and ticks"))?,
        utc: [planned.utc_start, stop],
        exposure_s: planned.exposure_ms * SECONDS_PER_MS,
        summing: u8::try_from(planned.summing).unwrap_or(u8::MAX),
        first_detector: 0,
        samples: planned.samples(),
        pixels,
        coding: Coding::Predictive {
            predictor: Predictor::X,
            table: 5,
        },
    };
    Ok(encode(&image).map_err(|error| failed(&error.to_string()))?)
}

/// An image, its ground and its light.
struct Rendering<'a> {
    image: TrueImage<'a>,
    terrain: &'a Terrain,
    /// Keys of albedo, the same for all images, and of this image's noise.
    keys: [u64; 2],
    /// Towards the Sun, unit vector.
    sun: Vector3<f64>,
    has_odd_even: bool,
}

impl<'a> Rendering<'a> {
    fn new(flown: &'a Flown, terrain: &'a Terrain, seed: u64) -> Result<Self> {
        let planned = flown.arc.image;
        let up = planned.site.direction();
        let west = up.cross(&Vector3::z()).normalize();
        // The first year of mapping and later ones: clocks of the mission's first 20 months begin with 61 to 66.
        let is_late = planned.sclk_start > "651";
        let (sin, cos) = SUN_RAD[usize::from(is_late)].sin_cos();
        let noise = planned
            .id
            .bytes()
            .fold(mix(seed), |key, byte| mix(key ^ u64::from(byte)));
        Ok(Self {
            image: TrueImage::new(flown, terrain)?,
            terrain,
            keys: [mix(seed ^ 0x00A1_BED0), noise],
            sun: cos * up + sin * west,
            has_odd_even: planned.summing == 1,
        })
    }

    /// Pixels of some lines and samples.
    fn pixels(&self, lines: Range<u32>, samples: Range<u32>) -> Result<Vec<u8>> {
        // Centres of the pixels, and of one more line and sample: slopes lie between neighbours.
        let row = |line: u32| self.ground_m(line, samples.start..=samples.end);
        let mut pixels = Vec::with_capacity(lines.len() * samples.len());
        let mut here = row(lines.start)?;
        for line in lines {
            let next = row(line + 1)?;
            for (place, sample) in samples.clone().enumerate() {
                let ground_m = here[place];
                let slope = (here[place + 1] - ground_m).cross(&(next[place] - ground_m));
                pixels.push(self.number(&ground_m, &slope, line, sample));
            }
            here = next;
        }
        Ok(pixels)
    }

    /// Ground at the middles of some pixels of a line.
    fn ground_m(&self, line: u32, samples: RangeInclusive<u32>) -> Result<Vec<Vector3<f64>>> {
        let middle = |count: u32| f64::from(count) + 0.5;
        let seen = self
            .image
            .ground_of_line_m(self.terrain, middle(line), samples.map(middle));
        let nothing = || SceneError::Image {
            image: self.image.flown.arc.image.id.to_owned(),
            error: format!("line {line} sees no ground"),
        };
        let seen: Option<Vec<Vector3<f64>>> = seen.into_iter().collect();
        Ok(seen.ok_or_else(nothing)?)
    }

    /// The number of a pixel: albedo and slope of its ground, noise, offset of its detector.
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped to a byte just before"
    )]
    fn number(&self, ground_m: &Vector3<f64>, slope: &Vector3<f64>, line: u32, sample: u32) -> u8 {
        // Samples grow to either side of the flight: the normal is the one that points up.
        let normal = slope.normalize() * slope.dot(ground_m).signum();
        let light = normal.dot(&self.sun).max(0.0) / self.sun.dot(&ground_m.normalize());
        let albedo: f64 = (0..)
            .zip(LATTICES_M)
            .map(|(octave, spacing_m)| {
                CONTRAST * noise(&(ground_m / spacing_m), self.keys[0].wrapping_add(octave))
            })
            .sum();
        let [level_dn, black_dn] = LEVEL_DN;
        let pixel = mix(self.keys[1] ^ (u64::from(line) << 32 | u64::from(sample)));
        let noise_dn = NOISE_DN * normal_of(unit_of(pixel), unit_of(mix(pixel)));
        let is_even = self.has_odd_even && sample % 2 == 1;
        let offset_dn = if is_even { EVEN_DN } else { 0.0 };
        let dn = black_dn + (level_dn - black_dn) * (1.0 + albedo) * light + noise_dn + offset_dn;
        dn.round().clamp(0.0, 255.0) as u8
    }
}

/// Value noise, −1 to 1: numbers at whole places, smoothly blended between them.
fn noise(place: &Vector3<f64>, key: u64) -> f64 {
    let corner = place.map(f64::floor);
    let share = (place - corner).map(|share| share * share * (3.0 - 2.0 * share));
    // Each node has a number by x, then y, then z: what two nodes have in common is mixed once.
    let between = |axis: usize, hash: u64, value: &dyn Fn(u64) -> f64| {
        let [near, far] = [0.0, 1.0].map(|step| value(mix(hash ^ (corner[axis] + step).to_bits())));
        near + share[axis] * (far - near)
    };
    let number = |hash: u64| 2.0 * unit_of(hash) - 1.0;
    let along_z = |hash: u64| between(2, hash, &number);
    let along_y = |hash: u64| between(1, hash, &along_z);
    between(0, key, &along_y)
}

#[cfg(test)]
mod tests;
