//! Cubes of ISIS: one band of whole or real numbers, in tiles or line by line.
//!
//! # Source
//! The cube format and the special pixels of ISIS (`SpecialPixel.h`, ISIS documentation of logical and physical cubes).

use std::{fmt, fs::File, io, os::unix::fs::FileExt as _, path::Path};

use super::{
    PixelFileError,
    rows::{LINES_MAX, Rows, SAMPLES_MAX, fits},
};
use crate::label::Label;
use areograph_base::error::{IoError, Result};

/// Lines read at a time from a cube without tiles.
const LINES_AT_ONCE: u32 = 64;
/// Largest accepted edge of a tile; ISIS writes 128.
const TILE_MAX: u32 = 4_096;

/// Storage type of a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Number {
    UnsignedByte,
    SignedWord,
    UnsignedWord,
    Real,
}

/// A cube as its label describes it.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Cube {
    number: Number,
    is_lsb: bool,
    /// Value = base + multiplier × number.
    base: f64,
    multiplier: f64,
    /// First byte of the pixels.
    start: u64,
    lines: u32,
    samples: u32,
    /// Lines and samples of a tile; `None` for band-sequential lines.
    tile: Option<[u32; 2]>,
}

impl fmt::Display for Cube {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let order = if self.tile.is_some() {
            "tiles"
        } else {
            "band sequential"
        };
        write!(formatter, "ISIS cube, {:?}, {order}", self.number)
    }
}

/// The values of a label in the groups that describe pixels.
struct Core<'a>(&'a Label);

impl Core<'_> {
    fn text(&self, group: &str, key: &str) -> Option<&str> {
        let mut entries = self.0.entries.iter();
        let found = entries.find(|entry| entry.group == group && entry.key == key);
        found.map(|entry| &*entry.value)
    }

    fn count(
        &self,
        group: &str,
        key: &'static str,
        most: u32,
    ) -> std::result::Result<u32, PixelFileError> {
        let value = self.text(group, key).unwrap_or_default();
        let count = value
            .parse()
            .ok()
            .filter(|count| (1..=most).contains(count));
        count.ok_or_else(|| refused(key, value, "a count from 1 to the largest image size"))
    }

    fn number(&self, key: &'static str, usual: f64) -> std::result::Result<f64, PixelFileError> {
        let Some(value) = self.text("PIXELS", key) else {
            return Ok(usual);
        };
        let number = value.parse().ok().filter(|number: &f64| number.is_finite());
        number.ok_or_else(|| refused(key, value, "a number"))
    }
}

fn refused(key: &'static str, value: &str, expected: &'static str) -> PixelFileError {
    PixelFileError::Value {
        key,
        value: value.to_owned(),
        expected,
    }
}

impl Cube {
    /// The cube of an attached label.
    ///
    /// # Errors
    /// Invalid values for a cube of one band; a file that is too short for them.
    pub(super) fn of(label: &Label, path: &Path) -> Result<Self> {
        let core = Core(label);
        let word = |group, key| core.text(group, key).unwrap_or_default();
        if let Some(elsewhere) = label.find("^CORE") {
            Err(refused(
                "^CORE",
                &elsewhere.value,
                "pixels in the same file",
            ))?;
        }
        let bands = core.count("DIMENSIONS", "BANDS", u32::MAX)?;
        if bands != 1 {
            Err(refused("BANDS", &bands.to_string(), "1"))?;
        }
        let number = match word("PIXELS", "TYPE").to_ascii_lowercase().as_str() {
            "unsignedbyte" => Number::UnsignedByte,
            "signedword" => Number::SignedWord,
            "unsignedword" => Number::UnsignedWord,
            "real" => Number::Real,
            other => Err(refused(
                "TYPE",
                other,
                "UnsignedByte, SignedWord, UnsignedWord or Real",
            ))?,
        };
        let is_lsb = match word("PIXELS", "BYTEORDER").to_ascii_lowercase().as_str() {
            "lsb" | "noorder" => true,
            "msb" => false,
            other => Err(refused("BYTEORDER", other, "Lsb or Msb"))?,
        };
        let tile = match word("CORE", "FORMAT").to_ascii_lowercase().as_str() {
            "bandsequential" => None,
            "tile" => Some([
                core.count("CORE", "TILELINES", TILE_MAX)?,
                core.count("CORE", "TILESAMPLES", TILE_MAX)?,
            ]),
            other => Err(refused("FORMAT", other, "Tile or BandSequential"))?,
        };
        let start = word("CORE", "STARTBYTE");
        let first: u64 = start
            .parse()
            .ok()
            .filter(|first| *first > 0)
            .ok_or_else(|| refused("STARTBYTE", start, "a byte of the file, counted from 1"))?;
        let cube = Self {
            number,
            is_lsb,
            base: core.number("BASE", 0.0)?,
            multiplier: core.number("MULTIPLIER", 1.0)?,
            start: first - 1,
            lines: core.count("DIMENSIONS", "LINES", LINES_MAX)?,
            samples: core.count("DIMENSIONS", "SAMPLES", SAMPLES_MAX)?,
            tile,
        };
        if let Some([lines, _]) = cube.tile
            && !fits(lines, cube.samples)
        {
            Err(refused(
                "TILELINES",
                &lines.to_string(),
                "tiles with at most 16 million pixels per row of tiles",
            ))?;
        }
        let found = path.metadata().map_err(IoError::on("read"))?.len();
        let expected = cube.start.saturating_add(cube.pixel_bytes());
        if found < expected {
            Err(PixelFileError::Short { found, expected })?;
        }
        Ok(cube)
    }

    pub(super) const fn size(&self) -> [u32; 2] {
        [self.lines, self.samples]
    }

    /// Bytes of all pixels, including the padding of tiles.
    fn pixel_bytes(&self) -> u64 {
        let [lines, samples] = self.tile.map_or(self.size(), |[lines, samples]| {
            [
                self.lines.next_multiple_of(lines),
                self.samples.next_multiple_of(samples),
            ]
        });
        u64::from(lines) * u64::from(samples) * self.number.bytes() as u64
    }

    /// The lines from the first one on.
    ///
    /// # Errors
    /// The file cannot be read.
    pub(super) fn rows(&self, path: &Path) -> Result<Box<dyn Rows>> {
        let file = File::open(path).map_err(IoError::on("open"))?;
        Ok(Box::new(CubeRows {
            cube: self.clone(),
            file,
            line: 0,
        }))
    }
}

#[derive(Debug)]
struct CubeRows {
    cube: Cube,
    file: File,
    line: u32,
}

impl Rows for CubeRows {
    fn size(&self) -> [u32; 2] {
        self.cube.size()
    }

    fn is_bytes(&self) -> bool {
        // Only the usual values of base and multiplier are written unchanged.
        #[allow(clippy::float_cmp, reason = "numbers as they are written")]
        let is_plain = self.cube.base == 0.0 && self.cube.multiplier == 1.0;
        self.cube.number == Number::UnsignedByte && is_plain
    }

    fn next_rows(&mut self) -> Result<Option<Vec<f64>>> {
        if self.line == self.cube.lines {
            return Ok(None);
        }
        let lines = self.cube.tile.map_or(LINES_AT_ONCE, |[lines, _]| lines);
        let lines = lines.min(self.cube.lines - self.line);
        let numbers = match self.cube.tile {
            None => self.plain(lines),
            Some(tile) => self.tiles(lines, tile),
        };
        let numbers = numbers.map_err(IoError::on("read"))?;
        self.line += lines;
        Ok(Some(numbers))
    }
}

impl CubeRows {
    fn plain(&self, lines: u32) -> io::Result<Vec<f64>> {
        let bytes = self.cube.number.bytes();
        let line_bytes = self.cube.samples as usize * bytes;
        let at = self.cube.start + u64::from(self.line) * line_bytes as u64;
        let mut buffer = vec![0; lines as usize * line_bytes];
        self.file.read_exact_at(&mut buffer, at)?;
        Ok(buffer
            .chunks_exact(bytes)
            .map(|bytes| self.cube.value(bytes))
            .collect())
    }

    /// A row of tiles, each with its lines one after the other.
    fn tiles(&self, lines: u32, [tile_lines, tile_samples]: [u32; 2]) -> io::Result<Vec<f64>> {
        let (bytes, samples) = (self.cube.number.bytes(), self.cube.samples as usize);
        let tile_bytes = tile_lines as usize * tile_samples as usize * bytes;
        let tiles = samples.div_ceil(tile_samples as usize);
        let row = (self.line / tile_lines) as usize;
        let mut numbers = vec![f64::NAN; lines as usize * samples];
        let mut buffer = vec![0; tile_bytes];
        for tile in 0..tiles {
            let at = self.cube.start + (row * tiles + tile) as u64 * tile_bytes as u64;
            self.file.read_exact_at(&mut buffer, at)?;
            let first = tile * tile_samples as usize;
            let stored = buffer.chunks_exact(tile_samples as usize * bytes);
            for (line, stored) in numbers.chunks_exact_mut(samples).zip(stored) {
                for (number, bytes) in line[first..].iter_mut().zip(stored.chunks_exact(bytes)) {
                    *number = self.cube.value(bytes);
                }
            }
        }
        Ok(numbers)
    }
}

impl Number {
    const fn bytes(self) -> usize {
        match self {
            Self::UnsignedByte => 1,
            Self::SignedWord | Self::UnsignedWord => 2,
            Self::Real => 4,
        }
    }
}

impl Cube {
    /// The value of a stored number; NaN for special values.
    fn value(&self, bytes: &[u8]) -> f64 {
        let mut bytes: [u8; 4] =
            std::array::from_fn(|at| bytes.get(at).copied().unwrap_or_default());
        let length = self.number.bytes();
        if !self.is_lsb {
            bytes[..length].reverse();
        }
        let word = u16::from_le_bytes([bytes[0], bytes[1]]);
        let (number, is_special) = match self.number {
            // 0 is NULL, and 255 high saturation, which is kept as a number.
            Number::UnsignedByte => (f64::from(bytes[0]), bytes[0] == 0),
            Number::SignedWord => {
                let word = word.cast_signed();
                (f64::from(word), word < -32_752)
            }
            Number::UnsignedWord => (f64::from(word), !(3..=65_522).contains(&word)),
            Number::Real => {
                let real = f32::from_le_bytes(bytes);
                // The special values are the lowest numbers.
                (
                    f64::from(real),
                    !real.is_finite() || real.to_bits() >= 0xFF7F_FFFB,
                )
            }
        };
        if is_special {
            f64::NAN
        } else {
            self.base + self.multiplier * number
        }
    }
}
