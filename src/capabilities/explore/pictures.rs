//! Layers as PNG, with transparent pixels where there is nothing to show.

use png::{BitDepth, ColorType, Compression, Encoder, EncodingError};

use super::layers::{Layer, Part, Pixels};
use crate::{error::Result, products::error::ProductError};

impl Layer<'_> {
    /// A file of the layer.
    ///
    /// # Errors
    /// A picture that the library rejects, which is a bug in areograph.
    pub(super) fn png(&self, part: &Part) -> Result<Vec<u8>> {
        match &self.pixels {
            Pixels::Png(file) => Ok(file.clone()),
            Pixels::Grey(pixels, range) => drawn(part, &self.reduced(pixels, part, *range)),
            Pixels::Tiles(tiles, range) => {
                let span = |axis: usize, [from, to]: [usize; 2]| from..self.size[axis].min(to);
                let (rows, columns) = (span(0, part.rows), span(1, part.columns));
                let own = Layer {
                    name: String::new(),
                    title: String::new(),
                    place: self.place,
                    size: [rows.len(), columns.len()],
                    pixels: Pixels::Grey(tiles.window(&rows, &columns).into(), *range),
                };
                let part = Part {
                    file: String::new(),
                    rows: [0, part.rows[1] - part.rows[0]],
                    columns: [0, part.columns[1] - part.columns[0]],
                    step: part.step,
                };
                own.png(&part)
            }
        }
    }

    /// Means of the pixels of squares, stretched; 0 where there is none.
    fn reduced(&self, pixels: &[u8], part: &Part, [black, white]: [u8; 2]) -> Vec<u8> {
        let ([top, bottom], [left, right], step) = (part.rows, part.columns, part.step);
        let width = (right - left).div_ceil(step);
        let mut reduced = Vec::with_capacity(width * (bottom - top).div_ceil(step));
        let known = [bottom.min(self.size[0]), right.min(self.size[1])];
        for first in (top..bottom).step_by(step) {
            let mut sums = vec![(0_u32, 0_u32); width];
            for row in first..known[0].min(first + step) {
                let row = &pixels[row * self.size[1] + left..row * self.size[1] + known[1]];
                for ((sum, count), square) in sums.iter_mut().zip(row.chunks(step)) {
                    for pixel in square.iter().filter(|pixel| **pixel > 0) {
                        *sum += u32::from(*pixel);
                        *count += 1;
                    }
                }
            }
            let grey = sums.iter().map(|(sum, count)| match count {
                0 => 0,
                _ => stretched(f64::from(*sum) / f64::from(*count), black, white),
            });
            reduced.extend(grey);
        }
        reduced
    }
}

/// The file of a part with these greys.
fn drawn(part: &Part, grey: &[u8]) -> Result<Vec<u8>> {
    let [rows, columns] = [part.rows, part.columns]
        .map(|[from, to]| u32::try_from((to - from).div_ceil(part.step)).unwrap_or(0));
    let file = encoded(grey, columns, rows);
    Ok(file.map_err(ProductError::refused("draw a picture"))?)
}

/// A brightness from 1 on.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "1 to 255"
)]
fn stretched(mean: f64, black: u8, white: u8) -> u8 {
    let [black, white] = [black, white].map(f64::from);
    let share = (mean - black) / (white - black).max(1.0);
    (1.0 + 254.0 * share.clamp(0.0, 1.0)).round() as u8
}

/// Greys as PNG, 0 transparent.
fn encoded(grey: &[u8], columns: u32, rows: u32) -> std::result::Result<Vec<u8>, EncodingError> {
    let mut file = Vec::new();
    let mut encoder = Encoder::new(&mut file, columns, rows);
    encoder.set_color(ColorType::Grayscale);
    encoder.set_depth(BitDepth::Eight);
    encoder.set_compression(Compression::Fast);
    encoder.set_trns(vec![0, 0]);
    encoder.write_header()?.write_image_data(grey)?;
    Ok(file)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{capabilities::explore::layers::LayerPlace, column::Tiles};

    #[test]
    fn squares_have_the_mean_of_their_known_pixels() {
        let layer = |pixels| Layer {
            name: String::new(),
            title: String::new(),
            place: LayerPlace::Map([0.0; 4]),
            pixels,
            size: [2, 3],
        };
        let bytes = [1, 0, 0, 255, 0, 0];
        let tiles = Tiles::of([2, 3], &bytes);
        let in_tiles = layer(Pixels::Tiles(&tiles, [1, 255]));
        let layer = layer(Pixels::Grey((&bytes[..]).into(), [1, 255]));
        let part = Part {
            file: String::new(),
            rows: [0, 2],
            columns: [0, 4],
            step: 2,
        };
        let file = layer.png(&part).unwrap();
        assert_eq!(in_tiles.png(&part).unwrap(), file);
        let mut reader = png::Decoder::new(std::io::Cursor::new(file))
            .read_info()
            .unwrap();
        // The decoder keeps the low byte of the two.
        assert_eq!(reader.info().trns.as_deref(), Some(&[0][..]));
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut pixels).unwrap();
        assert_eq!(pixels, [128, 0]);
    }
}
