//! The pixels of the images as windows are read of them.

use rayon::prelude::*;

use crate::{
    error::Result,
    pds::pixel_file::{PixelFile, Pyramid},
    stages::{image_pixels::PixelFiles, tag_times::ImageTimes},
};

/// Decodes the pixels of all images that have some.
///
/// # Errors
/// See [`PixelFiles::told_apart`]; the system's refusal to write temporary files.
pub(super) fn decode(
    files: &PixelFiles<'_>,
    times: &[&ImageTimes],
) -> Result<Vec<Option<Pyramid>>> {
    let opened = files.told_apart(times)?;
    let decode = |file: &Option<PixelFile>| file.as_ref().map(Pyramid::of).transpose();
    opened.par_iter().map(decode).collect()
}
