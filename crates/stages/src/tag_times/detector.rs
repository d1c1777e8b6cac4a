//! Summing and samples of an image against the detector of its camera.

use areograph_base::{
    error::{Cause, Result},
    instruments::Instrument,
};

/// An image that its camera cannot have taken.
#[derive(Debug, thiserror::Error, Cause)]
#[cause(Input)]
enum DetectorError {
    #[error("image {image}: {key} is {summing}; expected 1 to {max} for {instrument}")]
    #[cause(
        "check summing, samples and first detector, and check that this camera exposed the image"
    )]
    Summing {
        image: String,
        key: &'static str,
        summing: u32,
        instrument: String,
        max: u32,
    },
    #[error(
        "image {image}: crosstrack_summing {code} of {instrument} denotes summing that varies over the line; expected \
         the same summing for all samples"
    )]
    #[cause("omit the image: its samples differ in width, which areograph does not model")]
    VariableSumming {
        image: String,
        code: u32,
        instrument: String,
    },
    #[error(
        "image {image}: {samples} samples of {crosstrack} pixels from pixel {first} end at pixel {end}; expected at \
         most {pixels}, the number of pixels of {instrument}"
    )]
    #[cause(like = Summing)]
    Detector {
        image: String,
        samples: u32,
        crosstrack: u32,
        first: u32,
        end: u64,
        instrument: String,
        pixels: u32,
    },
    #[error(
        "image {image}: its {samples} samples of {crosstrack} pixels cover only part of the {pixels} pixels of \
         {instrument}, and its first pixel is unknown; expected first_detector"
    )]
    #[cause(
        "add `first_detector` to the image's table: ISIS and ALE assume the first pixel, first_detector = 0; a file \
         whose first columns were removed begins that many pixels later"
    )]
    FirstPixel {
        image: String,
        samples: u32,
        crosstrack: u32,
        instrument: String,
        pixels: u32,
    },
}

/// Checks that `instrument` supports this summing, and that its detector covers these samples.
///
/// # Errors
/// The limit of the instrument that the image breaks.
pub(super) fn fits_detector(
    image: &str,
    instrument: &Instrument,
    [downtrack, crosstrack]: [u32; 2],
    [first, samples]: [u32; 2],
) -> Result<()> {
    let limits = &instrument.summing;
    for (key, summing) in [
        ("downtrack_summing", downtrack),
        ("crosstrack_summing", crosstrack),
    ] {
        if summing == 0 || summing > limits.max {
            return Err(DetectorError::Summing {
                image: image.to_owned(),
                key,
                summing,
                instrument: instrument.name.clone(),
                max: limits.max,
            }
            .into());
        }
    }
    if limits.variable_codes.contains(&crosstrack) {
        return Err(DetectorError::VariableSumming {
            image: image.to_owned(),
            code: crosstrack,
            instrument: instrument.name.clone(),
        }
        .into());
    }
    within_detector(image, instrument, crosstrack, [first, samples])
}

/// Checks that the detector of `instrument` covers these samples.
///
/// # Errors
/// [`DetectorError::Detector`].
pub(super) fn within_detector(
    image: &str,
    instrument: &Instrument,
    crosstrack: u32,
    [first, samples]: [u32; 2],
) -> Result<()> {
    let pixels = instrument.detector.pixels;
    let end = u64::from(first) + u64::from(samples) * u64::from(crosstrack);
    if samples == 0 || end > u64::from(pixels) {
        return Err(DetectorError::Detector {
            image: image.to_owned(),
            samples,
            crosstrack,
            first,
            end,
            instrument: instrument.name.clone(),
            pixels,
        }
        .into());
    }
    Ok(())
}

/// An image with fewer samples than its detector has, whose position on the line is not stated.
pub(super) struct PartOfLine<'a> {
    pub(super) instrument: &'a Instrument,
    pub(super) samples: u32,
    pub(super) crosstrack: u32,
}

impl PartOfLine<'_> {
    /// A remark that the image is put on the first pixel.
    ///
    /// # Errors
    /// An image whose kind of label never states the first pixel (`is_open`).
    pub(super) fn on_first_pixel(&self, image: &str, is_open: bool) -> Result<String> {
        let (samples, pixels) = (self.samples, self.instrument.detector.pixels);
        if is_open {
            return Err(DetectorError::FirstPixel {
                image: image.to_owned(),
                samples,
                crosstrack: self.crosstrack,
                instrument: self.instrument.name.clone(),
                pixels,
            }
            .into());
        }
        Ok(format!(
            "the first pixel of its {samples} samples on the {pixels} pixels of the detector is not stated \
             (EDIT_MODE_ID, first_detector); pixel 0 is assumed"
        ))
    }
}
