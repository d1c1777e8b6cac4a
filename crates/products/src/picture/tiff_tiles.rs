//! TIFF with tiles, and overviews that viewers use to show all of a long image.
//!
//! Lines are kept in an unnamed file until all of them are present; each overview is made from the one before it, so that
//! memory holds a row of tiles only.

use std::{
    fs::File,
    io::{self, BufWriter, Read as _, Seek as _, Write as _},
};

use tiff::{
    encoder::{TiffEncoder, TiffKindStandard},
    tags::Tag,
};

use super::{PictureError, PictureHead, georeference};
use areograph_pds::control_table::ImageControl;

/// Edge of a tile, pixels.
const TILE: usize = 256;

/// Lines that wait to be cut into tiles.
#[derive(Debug)]
pub(super) struct TiffTiles {
    out: File,
    lines: BufWriter<File>,
}

/// Lines of one size in an unnamed file.
struct Level {
    lines: File,
    width: usize,
    height: usize,
    bytes_of_pixel: usize,
}

impl TiffTiles {
    pub(super) fn new(out: File) -> io::Result<Self> {
        let lines = BufWriter::new(tempfile::tempfile()?);
        Ok(Self { out, lines })
    }

    pub(super) fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.lines.write_all(bytes)
    }

    pub(super) fn finish(self, head: &PictureHead) -> Result<(), PictureError> {
        let lines = self
            .lines
            .into_inner()
            .map_err(io::IntoInnerError::into_error);
        let mut level = Level {
            lines: lines.map_err(tiff::TiffError::IoError)?,
            width: head.width as usize,
            height: head.height as usize,
            bytes_of_pixel: head.bytes_of_pixel(),
        };
        let mut encoder = TiffEncoder::new(BufWriter::new(self.out))?;
        let notes: Vec<String> = head
            .notes
            .iter()
            .map(|(name, text)| format!("{name}: {text}"))
            .collect();
        let mut first = Some((notes.join("\n"), head.control.as_ref()));
        loop {
            let half = write_level(&mut encoder, &mut level, first.take())?;
            if level.width <= TILE && level.height <= TILE {
                return Ok(());
            }
            level = half;
        }
    }
}

/// Room for the other contents of a file: notes and tables of tiles, 8 bytes per tile.
const TABLES_BYTES: u64 = 1 << 16;

/// Upper estimate of the bytes of the file.
pub(super) fn bytes_of(head: &PictureHead) -> u64 {
    let tile = TILE as u64;
    let of_tile = tile * tile * head.bytes_of_pixel() as u64 + 8;
    let (mut width, mut height) = (u64::from(head.width), u64::from(head.height));
    let control = head.control.as_ref();
    let mut bytes = TABLES_BYTES + control.map_or(0, georeference::bytes_of);
    loop {
        bytes += width.div_ceil(tile) * height.div_ceil(tile) * of_tile;
        if width <= tile && height <= tile {
            return bytes;
        }
        (width, height) = (width.div_ceil(2), height.div_ceil(2));
    }
}

/// Writes one size of the picture; the next smaller one. Only the largest has a description and control points.
fn write_level(
    encoder: &mut TiffEncoder<BufWriter<File>, TiffKindStandard>,
    level: &mut Level,
    first: Option<(String, Option<&ImageControl>)>,
) -> Result<Level, PictureError> {
    let line_bytes = level.width * level.bytes_of_pixel;
    level.lines.rewind().map_err(tiff::TiffError::IoError)?;
    let mut half = BufWriter::new(tempfile::tempfile().map_err(tiff::TiffError::IoError)?);
    let mut directory = encoder.image_directory()?;
    let (mut offsets, mut counts) = (Vec::new(), Vec::new());
    let mut band = vec![0; TILE * line_bytes];
    for first in (0..level.height).step_by(TILE) {
        let lines = TILE.min(level.height - first);
        let band = &mut band[..lines * line_bytes];
        level
            .lines
            .read_exact(band)
            .map_err(tiff::TiffError::IoError)?;
        for column in (0..level.width).step_by(TILE) {
            let mut tile = vec![0; TILE * TILE * level.bytes_of_pixel];
            let bytes = TILE.min(level.width - column) * level.bytes_of_pixel;
            let rows = tile.chunks_exact_mut(TILE * level.bytes_of_pixel);
            for (row, line) in rows.zip(band.chunks_exact(line_bytes)) {
                let from = column * level.bytes_of_pixel;
                row[..bytes].copy_from_slice(&line[from..from + bytes]);
            }
            let offset = if level.bytes_of_pixel == 2 {
                directory.write_data(deep(&tile).as_slice())?
            } else {
                directory.write_data(tile.as_slice())?
            };
            offsets.push(u32::try_from(offset).map_err(|_| tiff::TiffError::IntSizeError)?);
            counts.push(u32::try_from(tile.len()).unwrap_or(u32::MAX));
        }
        let smaller = halved(band, level.width, level.bytes_of_pixel);
        half.write_all(&smaller).map_err(tiff::TiffError::IoError)?;
    }
    let size = |pixels: usize| u32::try_from(pixels).unwrap_or(u32::MAX);
    directory.write_tag(Tag::NewSubfileType, u32::from(first.is_none()))?;
    directory.write_tag(Tag::ImageWidth, size(level.width))?;
    directory.write_tag(Tag::ImageLength, size(level.height))?;
    directory.write_tag(
        Tag::BitsPerSample,
        if level.bytes_of_pixel == 2 { 16_u16 } else { 8 },
    )?;
    // No compression; the least value is black; one sample of a pixel; whole numbers without a sign.
    directory.write_tag(Tag::Compression, 1_u16)?;
    directory.write_tag(Tag::PhotometricInterpretation, 1_u16)?;
    directory.write_tag(Tag::SamplesPerPixel, 1_u16)?;
    directory.write_tag(Tag::SampleFormat, 1_u16)?;
    directory.write_tag(Tag::TileWidth, size(TILE))?;
    directory.write_tag(Tag::TileLength, size(TILE))?;
    directory.write_tag(Tag::TileOffsets, offsets.as_slice())?;
    directory.write_tag(Tag::TileByteCounts, counts.as_slice())?;
    if let Some((description, control)) = first {
        directory.write_tag(Tag::ImageDescription, description.as_str())?;
        if let Some(control) = control {
            georeference::write(&mut directory, control)?;
        }
    }
    directory.finish()?;
    let lines = half
        .into_inner()
        .map_err(|error| tiff::TiffError::IoError(error.into_error()))?;
    Ok(Level {
        lines,
        width: level.width.div_ceil(2),
        height: level.height.div_ceil(2),
        bytes_of_pixel: level.bytes_of_pixel,
    })
}

/// Pixels of 16 bits.
fn deep(bytes: &[u8]) -> Vec<u16> {
    bytes
        .chunks_exact(2)
        .map(|pair| u16::from_le_bytes([pair[0], pair[1]]))
        .collect()
}

/// Lines and samples two by two, their means rounded; an odd last one counts for both.
fn halved(band: &[u8], width: usize, bytes_of_pixel: usize) -> Vec<u8> {
    let pixels: Vec<u16> = if bytes_of_pixel == 2 {
        deep(band)
    } else {
        band.iter().map(|byte| u16::from(*byte)).collect()
    };
    let mut half = Vec::with_capacity(band.len() / 4 + width);
    for pair in pixels.chunks(2 * width) {
        let (upper, lower) = pair.split_at(width);
        let lower = if lower.is_empty() { upper } else { lower };
        for column in (0..width).step_by(2) {
            let next = (column + 1).min(width - 1);
            let four = [upper[column], upper[next], lower[column], lower[next]];
            let sum: u32 = four.into_iter().map(u32::from).sum();
            let mean = u16::try_from((sum + 2) / 4).unwrap_or(u16::MAX);
            half.extend_from_slice(&mean.to_le_bytes()[..bytes_of_pixel]);
        }
    }
    half
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_those_of_all_tiles() {
        let head = |width, height, is_deep| PictureHead {
            width,
            height,
            is_deep,
            notes: Vec::new(),
            control: None,
        };
        // 3 × 2, 2 × 1 and 1 tiles.
        assert_eq!(
            bytes_of(&head(640, 320, false)),
            TABLES_BYTES + 9 * (65_536 + 8)
        );
        assert_eq!(bytes_of(&head(1, 1, true)), TABLES_BYTES + 131_072 + 8);
        // The largest size that headers can hold.
        assert!(bytes_of(&head(4080, 65_535 * 16, false)) > u64::from(u32::MAX));
    }

    #[test]
    fn halves_are_means_and_odd_edges_stand_for_themselves() {
        let band = [10, 20, 31, 30, 40, 50, 7, 8, 9];
        assert_eq!(halved(&band, 3, 1), [25, 41, 8, 9]);
        let deep_band: Vec<u8> = [1000_u16, 2000, 3000, 4001]
            .iter()
            .flat_map(|pixel| pixel.to_le_bytes())
            .collect();
        assert_eq!(deep(&halved(&deep_band, 2, 2)), [2500]);
    }
}
