//! Pixels of the pictures of a synthetic net, whose brightness is known at every place of the map.

use std::{f64::consts::TAU, io::Cursor};

use serde::Serialize;
use tiff::encoder::{TiffEncoder, colortype::Gray8};

use super::random::Random;
use areograph_geom::plane::{Place, Similarity};

/// Edge of a pixel on the map, metres.
const PIXEL_M: f64 = 120.0;
/// Waves of the brightness, and their lengths, metres: from four pixels on.
const WAVES: usize = 24;
const LENGTHS_M: [f64; 2] = [500.0, 12_000.0];
/// Mean brightness, and amplitude of a wave, grey values.
const MEAN_DN: f64 = 120.0;
const AMPLITUDE_DN: f64 = 15.0;

/// Brightness of the ground: the mean and a sum of waves, `amplitude cos(east x + north y + phase)`.
#[derive(Debug, Serialize)]
pub(super) struct Ground {
    mean_dn: f64,
    waves: Vec<Wave>,
}

#[derive(Debug, Serialize)]
struct Wave {
    amplitude_dn: f64,
    east_rad_per_m: f64,
    north_rad_per_m: f64,
    phase_rad: f64,
}

/// A picture with pixels.
pub(super) struct PictureImage {
    /// An uncompressed TIFF.
    pub(super) tiff: Vec<u8>,
    /// Coordinates of the outer corner of its first pixel, y upwards, and edge of a pixel.
    pub(super) corner: Place,
    pub(super) pixel_units: f64,
}

impl Ground {
    pub(super) fn new(seed: u64) -> Self {
        let mut random = Random::new(seed, "plane ground");
        let waves = (0..WAVES).map(|_| {
            let [short, long] = LENGTHS_M.map(f64::ln);
            let number = TAU / random.between(short, long).exp();
            let direction = random.between(0.0, TAU);
            Wave {
                amplitude_dn: AMPLITUDE_DN,
                east_rad_per_m: number * direction.cos(),
                north_rad_per_m: number * direction.sin(),
                phase_rad: random.between(0.0, TAU),
            }
        });
        Self {
            mean_dn: MEAN_DN,
            waves: waves.collect(),
        }
    }

    fn brightness_dn(&self, place_m: Place) -> f64 {
        let waves = self.waves.iter().map(|wave| {
            let phase_rad = wave.east_rad_per_m * place_m.re + wave.north_rad_per_m * place_m.im;
            wave.amplitude_dn * (phase_rad + wave.phase_rad).cos()
        });
        self.mean_dn + waves.sum::<f64>()
    }

    /// The picture that a similarity leads to the map, with a square of this side on the map in any orientation, in this contrast.
    ///
    /// # Errors
    /// A size that the library rejects.
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a small number of pixels, and a byte"
    )]
    pub(super) fn picture(
        &self,
        way: &Similarity,
        middle_m: Place,
        side_m: f64,
        contrast: f64,
    ) -> tiff::TiffResult<PictureImage> {
        let edge = (side_m * 2.0_f64.sqrt() / PIXEL_M).ceil() as u32 + 8;
        let pixel_units = PIXEL_M / way.scale();
        let middle = (middle_m - way.shift) / way.turn;
        let half = 0.5 * f64::from(edge) * pixel_units;
        let corner = middle + Place::new(-half, half);
        let cells = (0..edge).flat_map(|line| (0..edge).map(move |sample| [line, sample]));
        let pixels = cells.map(|[line, sample]| {
            let [down, right] = [line, sample].map(|at| (f64::from(at) + 0.5) * pixel_units);
            let place_m = way.map(corner + Place::new(right, -down));
            let dn = MEAN_DN + contrast * (self.brightness_dn(place_m) - MEAN_DN);
            dn.round().clamp(1.0, 255.0) as u8
        });
        let pixels: Vec<u8> = pixels.collect();
        let mut bytes = Cursor::new(Vec::new());
        TiffEncoder::new(&mut bytes)?.write_image::<Gray8>(edge, edge, &pixels)?;
        Ok(PictureImage {
            tiff: bytes.into_inner(),
            corner,
            pixel_units,
        })
    }
}
