//! TIFF and PNG of one greyscale band, read by their libraries.

use std::{fmt, fs::File, io::BufReader, path::Path};

use png::{BitDepth, ColorType, Transformations};
use tiff::decoder::{ChunkType, Decoder, DecodingResult};

use super::{
    PixelFileError,
    rows::{LINES_MAX, Rows, SAMPLES_MAX, fits},
};
use areograph_base::error::{IoError, Result};

/// Lines of a PNG read at a time.
const LINES_AT_ONCE: u32 = 64;

/// A format of pictures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Picture {
    Tiff,
    Png,
}

impl fmt::Display for Picture {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.name())
    }
}

impl Picture {
    const fn name(self) -> &'static str {
        match self {
            Self::Tiff => "TIFF",
            Self::Png => "PNG",
        }
    }

    /// The format of a file by its first bytes.
    pub(super) fn recognise(start: &[u8]) -> Option<Self> {
        let begins = |with: &[u8]| start.starts_with(with);
        if begins(b"\x89PNG\r\n\x1a\n") {
            Some(Self::Png)
        } else if [b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"]
            .iter()
            .any(|with| begins(*with))
        {
            Some(Self::Tiff)
        } else {
            None
        }
    }

    /// The lines from the first one on.
    ///
    /// # Errors
    /// The file cannot be read; a picture that is not of one greyscale band, or that its library rejects.
    pub(super) fn rows(self, path: &Path) -> Result<Box<dyn Rows>> {
        let file = BufReader::new(File::open(path).map_err(IoError::on("open"))?);
        Ok(match self {
            Self::Tiff => Box::new(TiffRows::new(file)?),
            Self::Png => Box::new(PngRows::new(file)?),
        })
    }

    fn refused(self, reason: impl fmt::Display) -> PixelFileError {
        PixelFileError::Picture {
            format: self.name(),
            reason: reason.to_string(),
        }
    }

    fn check_size(self, lines: u32, samples: u32) -> std::result::Result<[u32; 2], PixelFileError> {
        if (1..=LINES_MAX).contains(&lines) && (1..=SAMPLES_MAX).contains(&samples) {
            return Ok([lines, samples]);
        }
        Err(self.refused(format!(
            "{lines} lines of {samples} samples; expected at most {LINES_MAX} lines of {SAMPLES_MAX} samples"
        )))
    }
}

/// A TIFF by its rows of strips or tiles.
struct TiffRows {
    decoder: Decoder<BufReader<File>>,
    size: [u32; 2],
    /// Lines and samples of a strip or tile.
    chunk: [u32; 2],
    is_bytes: bool,
    line: u32,
}

impl fmt::Debug for TiffRows {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter
            .debug_struct("TiffRows")
            .field("size", &self.size)
            .finish_non_exhaustive()
    }
}

impl TiffRows {
    fn new(file: BufReader<File>) -> std::result::Result<Self, PixelFileError> {
        let refused = |error: tiff::TiffError| Picture::Tiff.refused(error);
        let mut decoder = Decoder::new(file).map_err(refused)?;
        let (samples, lines) = decoder.dimensions().map_err(refused)?;
        let size = Picture::Tiff.check_size(lines, samples)?;
        let colour = decoder.colortype().map_err(refused)?;
        let tiff::ColorType::Gray(bits) = colour else {
            return Err(Picture::Tiff.refused(format!("{colour:?}; expected one greyscale band")));
        };
        let (across, down) = match decoder.get_chunk_type() {
            ChunkType::Strip => (samples, decoder.chunk_dimensions().1),
            ChunkType::Tile => decoder.chunk_dimensions(),
        };
        if across == 0 || down == 0 {
            return Err(Picture::Tiff.refused("strips or tiles without pixels"));
        }
        if !fits(down.min(lines), samples) {
            return Err(Picture::Tiff.refused(format!(
                "strips or tiles of {down} lines; expected at most 16 million pixels per row of strips or tiles"
            )));
        }
        Ok(Self {
            decoder,
            size,
            chunk: [down, across],
            is_bytes: bits == 8,
            line: 0,
        })
    }

    fn numbers(&mut self, chunk: u32) -> std::result::Result<Vec<f64>, PixelFileError> {
        let refused = |error: tiff::TiffError| Picture::Tiff.refused(error);
        Ok(match self.decoder.read_chunk(chunk).map_err(refused)? {
            DecodingResult::U8(numbers) => all(numbers),
            DecodingResult::U16(numbers) => all(numbers),
            DecodingResult::U32(numbers) => all(numbers),
            DecodingResult::I16(numbers) => all(numbers),
            DecodingResult::I32(numbers) => all(numbers),
            DecodingResult::F32(numbers) => all(numbers),
            DecodingResult::F64(numbers) => numbers,
            _ => {
                return Err(Picture::Tiff.refused(
                    "unsupported pixel type; expected 8 bits (unsigned), 16 bits or 32 bits",
                ));
            }
        })
    }
}

fn all<T: Into<f64>>(numbers: Vec<T>) -> Vec<f64> {
    numbers.into_iter().map(Into::into).collect()
}

impl Rows for TiffRows {
    fn size(&self) -> [u32; 2] {
        self.size
    }

    fn is_bytes(&self) -> bool {
        self.is_bytes
    }

    fn next_rows(&mut self) -> Result<Option<Vec<f64>>> {
        let ([lines, samples], [down, across]) = (self.size, self.chunk);
        if self.line == lines {
            return Ok(None);
        }
        let rows = down.min(lines - self.line);
        let chunks = samples.div_ceil(across);
        let mut numbers = vec![f64::NAN; rows as usize * samples as usize];
        for column in 0..chunks {
            let index = self.line / down * chunks + column;
            let (width, _) = self.decoder.chunk_data_dimensions(index);
            let stored = self.numbers(index)?;
            let first = (column * across) as usize;
            let stored = stored.chunks_exact(width.max(1) as usize);
            for (line, stored) in numbers.chunks_exact_mut(samples as usize).zip(stored) {
                for (number, value) in line[first..].iter_mut().zip(stored) {
                    *number = *value;
                }
            }
        }
        self.line += rows;
        Ok(Some(numbers))
    }
}

/// A PNG line by line.
struct PngRows {
    reader: png::Reader<BufReader<File>>,
    size: [u32; 2],
    /// Bytes of a number, and of a pixel: a second number is its opacity.
    bytes: [usize; 2],
    line: u32,
}

impl fmt::Debug for PngRows {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter
            .debug_struct("PngRows")
            .field("size", &self.size)
            .finish_non_exhaustive()
    }
}

impl PngRows {
    fn new(file: BufReader<File>) -> std::result::Result<Self, PixelFileError> {
        let mut decoder = png::Decoder::new(file);
        decoder.set_transformations(Transformations::EXPAND);
        let reader = decoder
            .read_info()
            .map_err(|error| Picture::Png.refused(error))?;
        let info = reader.info();
        let size = Picture::Png.check_size(info.height, info.width)?;
        if info.interlaced {
            return Err(Picture::Png.refused("interlaced; expected lines in sequence"));
        }
        let (colour, depth) = reader.output_color_type();
        let numbers = match colour {
            ColorType::Grayscale => 1,
            ColorType::GrayscaleAlpha => 2,
            other => {
                return Err(Picture::Png.refused(format!("{other:?}; expected one greyscale band")));
            }
        };
        let bytes = if depth == BitDepth::Sixteen { 2 } else { 1 };
        Ok(Self {
            reader,
            size,
            bytes: [bytes, bytes * numbers],
            line: 0,
        })
    }

    /// The number of a pixel; NaN for an invisible one.
    fn number(&self, pixel: &[u8]) -> f64 {
        let [bytes, _] = self.bytes;
        let value = |stored: &[u8]| {
            stored
                .iter()
                .fold(0.0, |sum, byte| 256.0 * sum + f64::from(*byte))
        };
        match pixel.get(bytes..) {
            Some(opacity) if !opacity.is_empty() && value(opacity) == 0.0 => f64::NAN,
            _ => value(&pixel[..bytes]),
        }
    }
}

impl Rows for PngRows {
    fn size(&self) -> [u32; 2] {
        self.size
    }

    fn is_bytes(&self) -> bool {
        self.bytes[0] == 1
    }

    fn next_rows(&mut self) -> Result<Option<Vec<f64>>> {
        let [lines, samples] = self.size;
        if self.line == lines {
            return Ok(None);
        }
        let rows = LINES_AT_ONCE.min(lines - self.line);
        let mut numbers = Vec::with_capacity(rows as usize * samples as usize);
        for _ in 0..rows {
            let row = self
                .reader
                .next_row()
                .map_err(|error| Picture::Png.refused(error))?;
            let Some(row) = row.map(|row| row.data().to_vec()) else {
                return Err(Picture::Png.refused("the file ends before the last line"))?;
            };
            let pixels = row.chunks_exact(self.bytes[1]);
            numbers.extend(pixels.map(|pixel| self.number(pixel)));
        }
        self.line += rows;
        Ok(Some(numbers))
    }
}
