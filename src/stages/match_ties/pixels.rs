//! The pixels of the images: files that must be those of the images they are given for.

use std::path::Path;

use rayon::prelude::*;

use crate::{
    error::{Cause, Kind, Locate as _, Result},
    files::HashedFile,
    pds::{
        image_file::{ImageFile, Pyramid},
        pixel_file::PixelFile,
        product_named,
    },
    stage::{Input, Inputs},
    stages::tag_times::ImageTimes,
};

/// Clocks of an image and of its pixels that lie farther apart are those of two images, seconds; labels round them.
const CLOCKS_APART_MAX_S: u32 = 1;

/// For every image of the site the file with its pixels.
#[derive(Debug)]
pub struct PixelFiles<'a>(pub &'a [Option<HashedFile>]);

impl Input for PixelFiles<'_> {
    fn add_to(&self, _field: &str, inputs: &mut Inputs) {
        for (place, file) in self.0.iter().enumerate() {
            if let Some(file) = file {
                inputs.file("pixels", &file.path, Some(place), &file.blake3);
            }
        }
    }
}

/// Pixels that belong to another image.
#[derive(Debug, thiserror::Error)]
enum PixelsError {
    #[error(
        "image {image}: its pixels are {kind}, without a label; expected an image as the archive has it, whose label says which \
         one it is"
    )]
    Kind { image: String, kind: String },
    #[error(
        "image {image}: its pixels are those of product {product}; expected {expected}, which its identifier names"
    )]
    Product {
        image: String,
        product: String,
        expected: String,
    },
    #[error(
        "image {image}: its pixels were exposed from clock {clock} on; expected {expected}, as the image itself is"
    )]
    Clock {
        image: String,
        clock: String,
        expected: String,
    },
    #[error("image {image}: its pixels have {found} {what}; expected {expected}")]
    Size {
        image: String,
        what: &'static str,
        found: u32,
        expected: String,
    },
}

impl Cause for PixelsError {
    fn kind(&self) -> Kind {
        Kind::Input
    }

    fn advice(&self) -> String {
        match self {
            Self::Kind { .. } => "give images.pixels the file of the archive (.imq, .img), or leave out ties.match",
            Self::Product { .. } | Self::Size { .. } => {
                "check that images.pixels are not exchanged, and are all of the image"
            }
            Self::Clock { .. } => {
                "check that images.pixels are not exchanged, and the clock of the image's label or keys"
            }
        }
        .to_owned()
    }
}

/// Opens the pixels of an image.
///
/// # Errors
/// The system's refusal to read; a file that is no image, or another one.
pub(super) fn open(path: &Path, times: &ImageTimes) -> Result<ImageFile> {
    let pixels = PixelFile::open(path, std::slice::from_ref(&times.instrument))?;
    let other = pixels.other_kind();
    let PixelFile::Archive(file) = pixels else {
        return Err(PixelsError::Kind {
            image: times.id.clone(),
            kind: other.unwrap_or_default(),
        })
        .in_file(path);
    };
    belongs(&file, times).in_file(path)?;
    Ok(*file)
}

/// Whether what a file says of its image agrees with what is known of it.
fn belongs(file: &ImageFile, times: &ImageTimes) -> std::result::Result<(), PixelsError> {
    let image = || times.id.clone();
    let label = file.label();
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
    let layout = file.layout();
    let lines_max = times.line_times.lines();
    if layout.samples != times.samples {
        return Err(PixelsError::Size {
            image: image(),
            what: "samples in a line",
            found: layout.samples,
            expected: times.samples.to_string(),
        });
    }
    if layout.lines > lines_max {
        return Err(PixelsError::Size {
            image: image(),
            what: "lines",
            found: layout.lines,
            expected: format!("at most {lines_max}"),
        });
    }
    Ok(())
}

/// Seconds of a spacecraft clock.
fn whole_seconds(clock: &str) -> Option<u32> {
    let count = clock.split_once('/').map_or(clock, |(_, count)| count);
    count.split([':', '.']).next()?.trim().parse().ok()
}

/// Decodes the pixels of all images that have some.
///
/// # Errors
/// See [`open`]; the system's refusal to write temporary files.
pub(super) fn decode(
    files: &PixelFiles<'_>,
    times: &[&ImageTimes],
) -> Result<Vec<Option<Pyramid>>> {
    let pairs: Vec<_> = files.0.iter().zip(times).collect();
    let decoded = pairs.into_par_iter().map(|(file, times)| {
        let decode = |file: &HashedFile| Pyramid::of(&open(&file.path, times)?);
        file.as_ref().map(decode).transpose()
    });
    decoded.collect()
}
