//! Images and their pieces as PNG.

use png::{BitDepth, ColorType, Encoder, EncodingError};

use super::{
    canvas::Canvas,
    marks::{MarkedFootprint, footprints},
};
use crate::{SiteProducts, error::ProductError};
use areograph_base::error::Result;
use areograph_stages::lay_overlays::{CHIP_EDGE, Chip, Mark};

/// Least distance of two marks, pixels: closer footprints are thinned.
const MARKS_APART: f64 = 18.0;
/// Least distance of two numbers, pixels.
const NUMBERS_APART: f64 = 60.0;
/// Share of the darkest and of the brightest pixels of a piece that are shown as black and as white.
const CLIPPED: f64 = 0.01;
/// Levels of each image in a picture of two.
const LEVELS: u8 = 16;

/// A picture as PNG.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Picture {
    /// Pixels of a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Lines and samples of the image that are one pixel; 1 in a piece.
    pub reduction: u32,
    /// Interval of the marked footprints.
    pub step: usize,
    /// The file.
    pub png: Vec<u8>,
}

/// A complete image with its footprints, of limited size; `None` for an image without known pixels.
///
/// # Errors
/// A picture that the library rejects, which is a bug in areograph.
pub fn strip(site: &SiteProducts, image: usize, pixels_max: u64) -> Result<Option<Picture>> {
    let Some(look) = site
        .overlays
        .and_then(|overlays| overlays.quick_look(image))
    else {
        return Ok(None);
    };
    let look = look.within(pixels_max);
    let mut canvas = Canvas::new(&look.pixels, [look.width, look.height], look.range_dn);
    let marked = footprints(site, image);
    let reduction = f64::from(look.reduction);
    let place = |[line, sample]: [f64; 2]| [sample / reduction, line / reduction];
    let spacing = spacing(&marked) / reduction;
    let [step, number_step] = [MARKS_APART, NUMBERS_APART].map(|apart| step(apart / spacing));
    let shown = || {
        marked
            .iter()
            .filter(|footprint| footprint.number % step == 0)
    };
    for footprint in shown() {
        for (mark, at) in [
            (Mark::Before, footprint.before),
            (Mark::After, footprint.after),
        ] {
            if let Some(at) = at {
                canvas.mark(mark, place(at));
            }
        }
    }
    for footprint in shown().filter(|of| of.number % number_step == 0) {
        if let Some(at) = footprint.after.or(footprint.before) {
            // Profiles lie side by side.
            let to_left = footprint.profile % 2 == 1;
            canvas.number(footprint.number, place(at), to_left);
        }
    }
    Ok(Some(Picture {
        width: canvas.width,
        height: canvas.height,
        reduction: look.reduction,
        step,
        png: indexed(
            &canvas.pixels,
            [canvas.width, canvas.height],
            Canvas::palette(),
        )?,
    }))
}

/// A piece of an image with its marks.
///
/// # Errors
/// A picture that the library rejects, which is a bug in areograph.
pub fn piece(chip: &Chip) -> Result<Picture> {
    let mut canvas = Canvas::new(&chip.pixels, EDGES, range_dn(&chip.pixels));
    for (mark, at) in &chip.marks {
        canvas.mark(*mark, *at);
    }
    of_piece(&canvas.pixels, Canvas::palette())
}

/// Two pieces in one picture: the first in red, the second in green and blue.
///
/// # Errors
/// A picture that the library rejects, which is a bug in areograph.
pub fn anaglyph(first: &Chip, second: &Chip) -> Result<Picture> {
    let levels = [first, second].map(|chip| levels(&chip.pixels));
    let pixels =
        first.pixels.iter().zip(&second.pixels).map(|(one, other)| {
            LEVELS * levels[0][usize::from(*one)] + levels[1][usize::from(*other)]
        });
    let value = |level: u8| level * (u8::MAX / (LEVELS - 1));
    let palette = (0..=u8::MAX).flat_map(|place| {
        let [red, cyan] = [place / LEVELS, place % LEVELS].map(value);
        [red, cyan, cyan]
    });
    of_piece(&pixels.collect::<Vec<_>>(), palette.collect())
}

#[allow(clippy::cast_possible_truncation, reason = "a small number")]
const EDGES: [u32; 2] = [CHIP_EDGE as u32; 2];

fn of_piece(pixels: &[u8], palette: Vec<u8>) -> Result<Picture> {
    let [width, height] = EDGES;
    Ok(Picture {
        width,
        height,
        reduction: 1,
        step: 1,
        png: indexed(pixels, EDGES, palette)?,
    })
}

fn indexed(pixels: &[u8], size: [u32; 2], palette: Vec<u8>) -> Result<Vec<u8>> {
    let mut file = Vec::new();
    encode(&mut file, pixels, size, palette).map_err(ProductError::refused("draw an image"))?;
    Ok(file)
}

fn encode(
    file: &mut Vec<u8>,
    pixels: &[u8],
    [width, height]: [u32; 2],
    palette: Vec<u8>,
) -> std::result::Result<(), EncodingError> {
    let mut encoder = Encoder::new(file, width, height);
    encoder.set_color(ColorType::Indexed);
    encoder.set_depth(BitDepth::Eight);
    encoder.set_palette(palette);
    encoder.write_header()?.write_image_data(pixels)
}

/// Numbers below and above which a small share of a piece lies.
fn range_dn(pixels: &[u8]) -> [u8; 2] {
    let mut there: Vec<u8> = pixels.iter().copied().filter(|pixel| *pixel > 0).collect();
    there.sort_unstable();
    let Some(last) = there.len().checked_sub(1) else {
        return [0, u8::MAX];
    };
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a share of a length"
    )]
    let clipped = (CLIPPED * last as f64) as usize;
    [there[clipped], there[last - clipped]]
}

/// The level of every number of a piece.
fn levels(pixels: &[u8]) -> [u8; 256] {
    let [black, white] = range_dn(pixels).map(usize::from);
    let last = usize::from(LEVELS - 1);
    std::array::from_fn(|number| {
        let above = number.saturating_sub(black) * last / (white - black).max(1);
        u8::try_from(above.min(last)).unwrap_or_default()
    })
}

/// Mean distance of footprints that follow each other in a profile, lines and samples of the image; a large number
/// where no footprints do.
fn spacing(marked: &[MarkedFootprint]) -> f64 {
    let follows = |pair: &&[MarkedFootprint]| {
        pair[0].profile == pair[1].profile && pair[0].number + 1 == pair[1].number
    };
    let apart = |pair: &[MarkedFootprint]| {
        let at = |of: &MarkedFootprint| of.after.or(of.before);
        let ([line, sample], [next_line, next_sample]) = (at(&pair[0])?, at(&pair[1])?);
        Some((next_line - line).hypot(next_sample - sample))
    };
    let apart: Vec<f64> = marked
        .windows(2)
        .filter(follows)
        .filter_map(apart)
        .collect();
    if apart.is_empty() {
        return f64::from(u16::MAX);
    }
    apart.iter().sum::<f64>() / apart.len() as f64
}

/// The least step of 1, 2, 5, 10 … that is not below `least`.
fn step(least: f64) -> usize {
    let decades = (0..9).map(|power| 10_usize.pow(power));
    let mut steps = decades.flat_map(|decade| [decade, 2 * decade, 5 * decade]);
    steps
        .find(|step| *step as f64 >= least)
        .unwrap_or(usize::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_round() {
        assert_eq!(
            [0.1, 1.0, 1.1, 4.9, 7.0, 30.0].map(step),
            [1, 1, 2, 5, 10, 50]
        );
        // A multiple of the step of marks has one.
        assert!(step(f64::NAN) >= 1);
    }

    #[test]
    fn two_pieces_that_agree_are_grey() {
        let chip = Chip {
            pixels: (0..CHIP_EDGE * CHIP_EDGE)
                .map(|place| u8::try_from(place % 251).unwrap())
                .collect(),
            marks: Vec::new(),
        };
        let picture = anaglyph(&chip, &chip).unwrap();
        let mut decoder = png::Decoder::new(std::io::Cursor::new(&picture.png));
        decoder.set_transformations(png::Transformations::EXPAND);
        let mut reader = decoder.read_info().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut pixels).unwrap();
        assert!(
            pixels
                .chunks_exact(3)
                .all(|pixel| pixel[0] == pixel[1] && pixel[1] == pixel[2])
        );
    }
}
