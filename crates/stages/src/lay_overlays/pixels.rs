//! The pixels of an image, read once from its first line to its last: a quick look of the complete image, and full
//! resolution where it is needed.

use std::{ops::Range, sync::atomic::AtomicBool};

use serde::{Deserialize, Serialize};

use super::ShownImage;
use crate::tag_times::ImageTimes;
use areograph_base::error::{Result, Stopped};
use areograph_pds::{
    image_file::{ImageFile, LineState, Strip},
    pixel_file::PixelFile,
};

/// Most pixels of a quick look.
const QUICK_LOOK_PIXELS: u64 = 1_200_000;
/// Most pixels of all views of a site: six images of 1024 × 10,112 pixels are complete.
const VIEW_PIXELS: u64 = 1 << 26;
/// Complaints kept with their text; all are counted.
const COMPLAINTS_MAX: usize = 1_000;
/// Share of the darkest and of the brightest pixels that are shown as black and as white.
const CLIPPED: f64 = 0.005;

/// An image in a size that fits a page.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct QuickLook {
    /// Lines and samples of the image per line and sample of the quick look.
    pub reduction: u32,
    /// Samples.
    pub width: u32,
    /// Lines.
    pub height: u32,
    /// Means of the pixels of the image, line by line; 0 where no pixel is available.
    pub pixels: Vec<u8>,
    /// Pixel values to be shown as black and as white.
    pub range_dn: [u8; 2],
    /// Lines that are missing.
    pub lines_missing: u32,
    /// Lines that may be damaged.
    pub lines_suspect: u32,
}

impl QuickLook {
    /// The quick look with at most `pixels_max` pixels.
    #[must_use]
    pub fn within(&self, pixels_max: u64) -> Self {
        let factor = reduction(self.width, self.height, pixels_max);
        let mut smaller = Reduced::new(self.width, self.height, factor);
        for (line, pixels) in (0..).zip(self.pixels.chunks_exact(self.width as usize)) {
            smaller.add(line, pixels, 1);
        }
        Self {
            reduction: self.reduction * factor,
            range_dn: self.range_dn,
            lines_missing: self.lines_missing,
            lines_suspect: self.lines_suspect,
            ..smaller.finish()
        }
    }
}

/// A part of an image that is needed at full resolution.
#[derive(Debug)]
pub(super) struct Patch {
    lines: Range<u32>,
    samples: Range<u32>,
    /// Line by line; 0 where no pixel is available.
    pixels: Vec<u8>,
}

impl Patch {
    /// A part that has no pixels yet.
    pub(super) fn new(lines: Range<u32>, samples: Range<u32>) -> Self {
        let count = lines.len() * samples.len();
        Self {
            lines,
            samples,
            pixels: vec![0; count],
        }
    }

    fn take(&mut self, line: u32, pixels: &[u8]) {
        let width = self.samples.len();
        if !self.lines.contains(&line) || width == 0 {
            return;
        }
        let from = (line - self.lines.start) as usize * width;
        let row = &pixels[self.samples.start as usize..self.samples.end as usize];
        for (own, pixel) in self.pixels[from..from + width].iter_mut().zip(row) {
            *own = (*pixel).max(1);
        }
    }

    /// The value at a place of the image, interpolated between four pixels; 0 where one of them is missing.
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a position inside an image, and a mean of bytes"
    )]
    pub(super) fn at(&self, line: f64, sample: f64) -> u8 {
        let (top, left) = ((line - 0.5).floor(), (sample - 0.5).floor());
        let (down, right) = (line - 0.5 - top, sample - 0.5 - left);
        let pixel = |down: f64, right: f64| {
            let row = top + down - f64::from(self.lines.start);
            let column = left + right - f64::from(self.samples.start);
            let is_inside = (0.0..self.lines.len() as f64).contains(&row)
                && (0.0..self.samples.len() as f64).contains(&column);
            let place = row as usize * self.samples.len() + column as usize;
            if is_inside { self.pixels[place] } else { 0 }
        };
        let four = [(0.0, 0.0), (0.0, 1.0), (1.0, 0.0), (1.0, 1.0)];
        let four = four.map(|(down, right)| pixel(down, right));
        if four.contains(&0) {
            return 0;
        }
        let [upper_left, upper_right, lower_left, lower_right] = four.map(f64::from);
        let upper = upper_left + right * (upper_right - upper_left);
        let lower = lower_left + right * (lower_right - lower_left);
        (upper + down * (lower - upper)).round() as u8
    }
}

/// Reads all strips of an image, one of so many `images` with pixels.
///
/// # Errors
/// Read errors; [`Stopped`].
pub(super) fn read(
    file: &PixelFile,
    (image, times): (usize, &ImageTimes),
    images: u64,
    mut patches: Vec<&mut Patch>,
    stop: &AtomicBool,
) -> Result<ShownImage> {
    let (samples, lines) = (times.samples, file.lines());
    let factor = reduction(samples, lines, QUICK_LOOK_PIXELS);
    let mut reduced = Reduced::new(samples, lines, factor);
    let finer = reduction(samples, lines, VIEW_PIXELS / images.max(1));
    let mut view = (finer < factor).then(|| Reduced::new(samples, lines, finer));
    let mut counts = [0_u64; 256];
    let (mut lines_there, mut lines_suspect) = (0, 0);
    let mut strips = file.strips()?;
    while let Some(strip) = strips.next_strip()? {
        Stopped::check(stop)?;
        for (line, pixels, state) in lines_of(&strip) {
            lines_there += 1;
            lines_suspect += u32::from(state == LineState::Suspect);
            reduced.add(line, pixels, 0);
            if let Some(view) = &mut view {
                view.add(line, pixels, 0);
            }
            for pixel in pixels {
                counts[usize::from(*pixel)] += 1;
            }
            for patch in &mut patches {
                patch.take(line, pixels);
            }
        }
    }
    let finished = |reduced: Reduced| QuickLook {
        range_dn: range_dn(&counts),
        lines_missing: lines - lines_there,
        lines_suspect,
        ..reduced.finish()
    };
    let opened = file.archive().map(ImageFile::complaints);
    let (opened, count) = opened.map_or((&[][..], 0), |opened| (opened.kept(), opened.count()));
    let (decoded, count_decoded) = strips.complaints();
    let complaints = opened.iter().chain(decoded).take(COMPLAINTS_MAX);
    Ok(ShownImage {
        image,
        quick_look: finished(reduced),
        view: view.map(finished),
        lines,
        complaints: complaints.map(ToString::to_string).collect(),
        complaint_count: count + count_decoded,
    })
}

/// Number, pixels and state of the available lines of a strip.
fn lines_of(strip: &Strip) -> impl Iterator<Item = (u32, &[u8], LineState)> {
    let lines = (strip.first_line..).zip(strip.lines());
    let there = lines.filter(|(_, (_, state))| **state != LineState::Missing);
    there.map(|(line, (pixels, state))| (line, pixels, *state))
}

/// The smallest reduction that leaves at most `pixels_max` pixels.
fn reduction(width: u32, height: u32, pixels_max: u64) -> u32 {
    let pixels =
        |factor: u32| u64::from(width.div_ceil(factor)) * u64::from(height.div_ceil(factor));
    let least = (1..=width.max(height)).find(|factor| pixels(*factor) <= pixels_max.max(1));
    least.unwrap_or(width.max(height).max(1))
}

/// Pixel values below and above which a small share of the pixels lies.
fn range_dn(counts: &[u64; 256]) -> [u8; 2] {
    [
        beyond(counts, 0..=u8::MAX),
        beyond(counts, (0..=u8::MAX).rev()),
    ]
}

/// The first of these values up to which more than a small share of all pixels lies.
fn beyond(counts: &[u64; 256], mut numbers: impl Iterator<Item = u8>) -> u8 {
    let share = CLIPPED * counts.iter().sum::<u64>() as f64;
    let mut pixels = 0;
    let found = numbers.find(|number| {
        pixels += counts[usize::from(*number)];
        pixels as f64 > share
    });
    found.unwrap_or_default()
}

/// Means of square blocks of pixels, accumulated line by line.
struct Reduced {
    factor: u32,
    width: u32,
    height: u32,
    pixels: Vec<u8>,
    /// Sum and number of the pixels of each block in the current row of blocks.
    sums: Vec<(u32, u32)>,
    row: u32,
}

impl Reduced {
    fn new(width: u32, height: u32, factor: u32) -> Self {
        let (width, height) = (width.div_ceil(factor), height.div_ceil(factor));
        Self {
            factor,
            width,
            height,
            pixels: vec![0; width as usize * height as usize],
            sums: vec![(0, 0); width as usize],
            row: 0,
        }
    }

    /// Adds the pixels of a line that are at least `least`.
    fn add(&mut self, line: u32, pixels: &[u8], least: u8) {
        let row = line / self.factor;
        if row != self.row {
            self.end_row();
            self.row = row;
        }
        let squares = pixels.chunks(self.factor as usize);
        for ((sum, count), square) in self.sums.iter_mut().zip(squares) {
            for pixel in square.iter().filter(|pixel| **pixel >= least) {
                *sum += u32::from(*pixel);
                *count += 1;
            }
        }
    }

    fn end_row(&mut self) {
        let from = self.row as usize * self.width as usize;
        let row = self.pixels.iter_mut().skip(from).zip(&mut self.sums);
        for (pixel, (sum, count)) in row {
            if let Some(mean) = (*sum + *count / 2).checked_div(*count) {
                *pixel = u8::try_from(mean).unwrap_or(u8::MAX).max(1);
            }
            (*sum, *count) = (0, 0);
        }
    }

    fn finish(mut self) -> QuickLook {
        self.end_row();
        QuickLook {
            reduction: self.factor,
            width: self.width,
            height: self.height,
            pixels: self.pixels,
            range_dn: [0, u8::MAX],
            lines_missing: 0,
            lines_suspect: 0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reduced_image_has_means_and_keeps_what_is_missing() {
        let mut reduced = Reduced::new(5, 6, 2);
        reduced.add(0, &[10, 20, 30, 40, 50], 0);
        reduced.add(1, &[10, 20, 30, 40, 50], 0);
        // Lines 2 and 3 are missing; of the last two one is.
        reduced.add(5, &[0, 0, 100, 101, 7], 0);
        let look = reduced.finish();
        assert_eq!((look.width, look.height), (3, 3));
        assert_eq!(look.pixels, [15, 35, 50, 0, 0, 0, 1, 101, 7]);
        let whole = QuickLook {
            range_dn: [3, 200],
            ..look
        };
        let smaller = whole.within(4);
        assert_eq!(
            (smaller.reduction, smaller.width, smaller.height),
            (4, 2, 2)
        );
        assert_eq!(smaller.range_dn, [3, 200]);
        // 15, 35 and nothing below them; 1 and 101 alone.
        assert_eq!(smaller.pixels, [25, 50, 51, 7]);
    }

    #[test]
    fn damage_of_a_file_is_reported_with_its_numbers() {
        let shown = |missing, complaints: &[&str]| {
            let mut quick_look = Reduced::new(5, 6, 2).finish();
            quick_look.lines_missing = missing;
            ShownImage {
                image: 0,
                quick_look,
                view: None,
                lines: 8960,
                complaints: complaints.iter().map(ToString::to_string).collect(),
                complaint_count: complaints.len() as u64,
            }
        };
        assert_eq!(shown(0, &[]).damage(), None);
        let damage = shown(1536, &["byte 7: one", "byte 9: other"]).damage();
        assert_eq!(
            damage.as_deref(),
            Some(
                "1536 of 8960 lines are missing and 0 may be damaged; 2 complaints, first: byte 7: one"
            )
        );
        let damage = shown(3, &[]).damage();
        assert!(damage.is_some_and(|text| text.ends_with("no complaint")));
    }

    #[test]
    fn a_long_image_fits_without_growing_wider_than_it_is() {
        // The largest of the mission: 2048 samples and 100 000 lines.
        let factor = reduction(2048, 100_000, QUICK_LOOK_PIXELS);
        assert_eq!(factor, 14);
        assert_eq!(reduction(2048, 500, QUICK_LOOK_PIXELS), 1);
    }

    #[test]
    fn the_range_leaves_out_half_a_percent_on_either_side() {
        let mut counts = [0; 256];
        counts[0] = 4;
        counts[100] = 500;
        counts[140] = 490;
        counts[255] = 6;
        assert_eq!(range_dn(&counts), [100, 255]);
    }

    #[test]
    fn a_place_between_pixels_is_blended_and_none_beyond_the_edge() {
        let mut patch = Patch::new(10..12, 4..6);
        patch.take(9, &[9; 8]);
        patch.take(10, &[0, 0, 0, 0, 10, 20, 0, 0]);
        patch.take(11, &[0, 0, 0, 0, 30, 40, 0, 0]);
        assert_eq!(patch.at(10.5, 4.5), 10);
        assert_eq!(patch.at(11.0, 5.0), 25);
        assert_eq!(patch.at(11.4, 4.5), 28);
        assert_eq!(patch.at(10.4, 4.5), 0);
        assert_eq!(patch.at(10.5, 5.6), 0);
    }
}
