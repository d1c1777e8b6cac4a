//! The pixels of the images, with a check that each file belongs to its image.

use std::path::Path;

use rayon::prelude::*;

use super::site_image::SiteImage;
use crate::tag_times::ImageTimes;
use areograph_base::{
    error::{Cause, Locate as _, Result},
    instruments::Instrument,
};
use areograph_config::all_instruments;
use areograph_pds::{
    ImageLabel, RowTimes,
    image_file::ImageFile,
    pixel_file::{PixelFile, Pyramid},
    product_named,
};
use areograph_store::{
    files::HashedFile,
    stage::{Input, Inputs},
};

/// With a larger difference, the clocks of an image and of its pixels belong to two images, seconds; labels round them.
pub(super) const CLOCKS_APART_MAX_S: u32 = 1;

/// For every image of the site the file with its pixels, where there is one.
#[derive(Debug, Clone, Copy)]
pub struct PixelFiles<'a>(pub &'a [Option<HashedFile>]);

impl Input for PixelFiles<'_> {
    fn add_to(&self, field: &str, inputs: &mut Inputs) {
        for (place, file) in self.0.iter().enumerate() {
            if let Some(file) = file {
                inputs.file(field, &file.path, Some(place), &file.blake3);
            }
        }
    }
}

impl PixelFiles<'_> {
    /// The files, opened, of the images with these times.
    ///
    /// # Errors
    /// Read errors; a file whose pixels cannot be read, or belong to another image.
    pub fn opened(&self, times: &[&ImageTimes]) -> Result<Vec<Option<PixelFile>>> {
        let files = self.0.iter().zip(times);
        let opened = files.map(|(file, times)| {
            let file = file.as_ref().map(|file| open_pixels(&file.path, times));
            file.transpose()
        });
        opened.collect()
    }

    /// The opened files where exchanged files would otherwise remain undetected: two files without a label must differ
    /// in size.
    ///
    /// # Errors
    /// As [`Self::opened`]; two such files.
    pub fn of_distinct_images(&self, times: &[&ImageTimes]) -> Result<Vec<Option<PixelFile>>> {
        let opened = self.opened(times)?;
        let without_label = || {
            let files = opened.iter().zip(times);
            let files = files.filter_map(|(file, times)| Some((file.as_ref()?, &times.id)));
            files.filter(|(file, _)| file.label().is_none())
        };
        for (at, (file, image)) in without_label().enumerate() {
            let size = [file.lines(), file.samples()];
            let mut others = without_label().take(at);
            if let Some((_, other)) =
                others.find(|(other, _)| [other.lines(), other.samples()] == size)
            {
                let images = [other, image].map(String::clone);
                return Err(PixelsError::Alike { images, size }).in_file(file.path());
            }
        }
        Ok(opened)
    }

    /// The decoded pixels of all images that have some, from which windows are read.
    ///
    /// # Errors
    /// As [`Self::of_distinct_images`]; errors in writing temporary files.
    pub fn decoded(&self, times: &[&ImageTimes]) -> Result<Vec<Option<Pyramid>>> {
        let all: Vec<usize> = (0..times.len()).collect();
        self.decoded_among(times, &all)
    }

    /// As [`Self::decoded`], of these images alone.
    ///
    /// # Errors
    /// As [`Self::decoded`].
    pub fn decoded_among(
        &self,
        times: &[&ImageTimes],
        images: &[usize],
    ) -> Result<Vec<Option<Pyramid>>> {
        let opened = self.of_distinct_images(times)?;
        let decode = |(index, file): (usize, &Option<PixelFile>)| {
            let file = file.as_ref().filter(|_| images.contains(&index));
            file.map(Pyramid::of).transpose()
        };
        opened.par_iter().enumerate().map(decode).collect()
    }

    /// Every file whose image has its times, and the result of opening it.
    pub fn examined<'i>(
        &self,
        images: &'i [SiteImage],
    ) -> impl Iterator<Item = (&'i ImageTimes, Result<PixelFile>)> {
        let files = self.0.iter().zip(images);
        let known = files.filter_map(|(file, image)| Some((file.as_ref()?, image.times.get()?)));
        known.map(|(file, times)| (times, open_pixels(&file.path, times)))
    }
}

/// Pixels that belong to another image.
#[derive(Debug, thiserror::Error, Cause)]
#[cause(Input)]
enum PixelsError {
    #[error(
        "image {image}: its pixels belong to product {product}; expected {expected}, which the image identifier names"
    )]
    #[cause(
        "check that images.pixels are not exchanged and contain the complete image; check lines_delivered if it is given"
    )]
    Product {
        image: String,
        product: String,
        expected: String,
    },
    #[error(
        "image {image}: the exposure of its pixels begins at clock {clock}; expected {expected}, the clock of the image"
    )]
    #[cause(
        "check that images.pixels are not exchanged; check the clock in the label or keys of the image"
    )]
    Clock {
        image: String,
        clock: String,
        expected: String,
    },
    #[error(
        "image {image}: its pixels belong to camera {found}; expected {expected}, the camera of the image"
    )]
    #[cause(
        "check that images.pixels are not exchanged; check the label or the exposures of the image"
    )]
    Camera {
        image: String,
        found: String,
        expected: String,
    },
    #[error(
        "image {image}: the exposure of its pixels begins at ET {found_s:.3} s; expected {expected_s:.3} s, the start \
         of the image"
    )]
    #[cause(like = Camera)]
    Start {
        image: String,
        found_s: f64,
        expected_s: f64,
    },
    #[error("image {image}: its pixels are map-projected; expected the unprojected image")]
    #[cause("give the unprojected cube, or the archive file (.imq, .img)")]
    Map { image: String },
    #[error(
        "images {} and {}: both pixel files have {} lines of {} samples, without a label that identifies the image; \
         expected a label in one of the files",
        images[0], images[1], size[0], size[1]
    )]
    #[cause(
        "give the archive file (.imq, .img) or the ISIS cube for one of the images: without a label, exchanged images \
         cannot be distinguished from orientation errors"
    )]
    Alike { images: [String; 2], size: [u32; 2] },
    #[error(
        "image {image}: label and pixels of one file contradict each other: {first} ({count} contradictions in all)"
    )]
    #[cause(
        "fetch the file again, with label and pixels in one file: the label or the pixels may belong to another image"
    )]
    Contradiction {
        image: String,
        first: String,
        count: usize,
    },
    #[error("image {image}: its pixel file has {found} {what}; expected {expected}")]
    #[cause(like = Product)]
    Size {
        image: String,
        what: &'static str,
        found: u32,
        expected: String,
    },
}

fn open_pixels(path: &Path, times: &ImageTimes) -> Result<PixelFile> {
    // The image's own camera before others that labels name alike.
    let cameras: Vec<Instrument> = std::iter::once(&times.instrument)
        .chain(all_instruments())
        .cloned()
        .collect();
    let file = PixelFile::open(path, &cameras)?;
    belongs(&file, times).in_file(path)?;
    Ok(file)
}

/// Whether a file agrees with its image. An image that was received in part may have fewer lines; without a label, it
/// is unknown which ones.
fn belongs(file: &PixelFile, times: &ImageTimes) -> std::result::Result<(), PixelsError> {
    let image = || times.id.clone();
    if file.is_projected() {
        return Err(PixelsError::Map { image: image() });
    }
    let size = |what, found, expected| PixelsError::Size {
        image: image(),
        what,
        found,
        expected,
    };
    if let Some(archive) = file.archive() {
        of_one_image(archive, times)?;
    }
    let (lines, samples) = (file.lines(), file.samples());
    let [delivered, header] = [times.lines_delivered, times.line_times.lines()];
    if let Some(label) = file.label() {
        of_the_image(label, times)?;
    } else if ![delivered, header].contains(&lines) {
        let expected = if delivered == header {
            format!("{header}, because there is no label")
        } else {
            format!("{delivered} or {header}, because there is no label")
        };
        return Err(size("lines", lines, expected));
    }
    if samples != times.samples {
        return Err(size(
            "samples in a line",
            samples,
            times.samples.to_string(),
        ));
    }
    let has_rows = file.label().is_some_and(|label| label.lines.is_some());
    if has_rows && lines != header {
        return Err(size("lines", lines, header.to_string()));
    }
    if lines > header {
        return Err(size("lines", lines, format!("at most {header}")));
    }
    // A file holds all exposed lines, some of them empty, or those that were received; of a complete file, all were
    // received.
    let may_lack = file.archive().is_none_or(|archive| !archive.is_complete());
    if lines > delivered && !(lines == header && may_lack) {
        return Err(size(
            "lines",
            lines,
            format!(
                "at most {delivered}, the number of lines received of {header} (lines_delivered)"
            ),
        ));
    }
    Ok(())
}

/// Whether the fragments of a file belong to the image that its label describes.
fn of_one_image(file: &ImageFile, times: &ImageTimes) -> std::result::Result<(), PixelsError> {
    match file.contradictions() {
        [] => Ok(()),
        [first, ..] => Err(PixelsError::Contradiction {
            image: times.id.clone(),
            first: first.to_string(),
            count: file.contradictions().len(),
        }),
    }
}

/// Whether a label names the product and the clock of the image.
fn of_the_image(label: &ImageLabel, times: &ImageTimes) -> std::result::Result<(), PixelsError> {
    let image = || times.id.clone();
    let product = label.product_id.as_deref();
    if let (Some(product), Some(expected)) = (product, product_named(&times.id))
        && product_named(product).is_some_and(|found| found != expected)
    {
        return Err(PixelsError::Product {
            image: image(),
            product: product.to_owned(),
            expected,
        });
    }
    if let Some(rows) = &label.lines {
        of_its_rows(label, rows, times)?;
    }
    let clocks = [&label.fields.sclk_start, &times.sclk_start];
    if let [Some(clock), Some(expected)] = clocks
        && let [Some(found), Some(known)] = [clock, expected].map(|clock| whole_seconds(clock))
        && found.abs_diff(known) > CLOCKS_APART_MAX_S
    {
        return Err(PixelsError::Clock {
            image: image(),
            clock: clock.clone(),
            expected: expected.clone(),
        });
    }
    Ok(())
}

/// Whether rows with times belong to the image: to its camera, and from the same instant on.
fn of_its_rows(
    label: &ImageLabel,
    rows: &RowTimes,
    times: &ImageTimes,
) -> std::result::Result<(), PixelsError> {
    let names = [&label.instrument, &times.instrument].map(|camera| camera.label.to_string());
    if let [found, expected] = names
        && found != expected
    {
        return Err(PixelsError::Camera {
            image: times.id.clone(),
            found,
            expected,
        });
    }
    let starts = [
        rows.pieces.first().map(|piece| piece.start),
        Some(times.line_times.start()),
    ];
    if let [Some(found), Some(expected)] = starts
        && !(found.since(expected).abs() <= f64::from(CLOCKS_APART_MAX_S))
    {
        return Err(PixelsError::Start {
            image: times.id.clone(),
            found_s: found.seconds(),
            expected_s: expected.seconds(),
        });
    }
    Ok(())
}

/// Seconds of a spacecraft clock.
fn whole_seconds(clock: &str) -> Option<u32> {
    let count = clock.split_once('/').map_or(clock, |(_, count)| count);
    count.split([':', '.']).next()?.trim().parse().ok()
}

#[cfg(test)]
mod tests;
