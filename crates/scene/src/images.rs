//! Images of the synthetic mission as the camera would take them: pixels show the ground of ties and shots, by its
//! albedo and its slope towards the Sun, with the blur and the noise of the camera.

mod light;
mod rendering;

use std::{fs::File, io::Write as _, path::Path};

use rayon::prelude::*;

use self::rendering::Rendering;
use super::{drawn::Flown, error::SceneError, terrain::Terrain, truth::RenderedTruth};
use areograph_base::{
    error::{IoError, Locate as _, Result},
    units::SECONDS_PER_MS,
    watch::Watch,
};
use areograph_config::usual_instrument;
use areograph_pds::image_file::{Coding, NewImage, Predictor, Transform, encode};
use areograph_spice::Session;

/// Lines that are rendered at a time.
const STRIP_LINES: u32 = 128;

/// Encoding of images, by one of the spacecraft's encoders.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Coder {
    /// Prediction from the preceding pixel, lossless; the code of most images in the archive.
    Predictive,
    /// Cosine transform of blocks of 16 × 16 pixels, in steps of two numbers: lossy.
    Transform,
}

impl Coder {
    const fn name(self) -> &'static str {
        match self {
            Self::Predictive => "predictive",
            Self::Transform => "transform",
        }
    }

    const fn coding(self) -> Coding {
        match self {
            Self::Predictive => Coding::Predictive {
                predictor: Predictor::X,
                table: 5,
            },
            Self::Transform => Coding::Transform {
                transform: Transform::Cosine,
                groups: 4,
                spacing: 32,
            },
        }
    }
}

/// Name of the file of an image.
pub(super) fn image_name(id: &str) -> String {
    format!("{}.imq", id.replace('-', "").to_lowercase())
}

/// Writes the delivered images into `folder`; returns the true values of each.
///
/// # Errors
/// An image that does not see the ground, or cannot be encoded; errors of writing.
pub(super) fn write_images<'a>(
    folder: &Path,
    days: &[&Flown<'a>],
    terrain: &Terrain,
    (seed, coder): (u64, Coder),
    session: &Session,
    watch: Watch<'_>,
) -> Result<Vec<RenderedTruth<'a>>> {
    let delivered = |flown: &&&Flown| flown.arc.image.is_delivered();
    for flown in days.iter().filter(delivered) {
        watch.announce(flown.arc.image.lines_delivered as usize / 16 * 16);
    }
    let mut truth = Vec::new();
    for flown in days.iter().filter(delivered) {
        let planned = flown.arc.image;
        let camera = Rendering::new(flown, terrain, seed)?;
        let lines = planned.lines_delivered / 16 * 16;
        let starts: Vec<u32> = (0..lines).step_by(STRIP_LINES as usize).collect();
        let strips = starts.into_par_iter().map(|first| {
            let end = lines.min(first + STRIP_LINES);
            let strip = camera.pixels(first..end, 0..planned.samples());
            watch.step(u64::from(end - first), "image lines");
            strip
        });
        let strips: Vec<Vec<u8>> = strips.collect::<Result<_>>()?;
        let stop = session.et_to_utc(flown.arc.exposed.stop)?;
        let bytes = encoded(flown, &strips.concat(), &stop, coder)?;
        let path = folder.join(image_name(planned.id));
        let written = File::create(&path).and_then(|mut file| file.write_all(&bytes));
        written.map_err(IoError::on("write")).in_file(&path)?;
        truth.push(RenderedTruth::new(planned, coder.name(), camera.sun_deg()));
    }
    Ok(truth)
}

fn encoded(flown: &Flown, pixels: &[u8], stop: &str, coder: Coder) -> Result<Vec<u8>> {
    let planned = flown.arc.image;
    let failed = |error: &str| SceneError::Image {
        image: planned.id.to_owned(),
        error: error.to_owned(),
    };
    let clock = planned
        .sclk_start
        .split_once(':')
        .and_then(|(seconds, ticks)| Some((seconds.parse().ok()?, ticks.parse().ok()?)));
    let image = NewImage {
        product_id: &planned.id.replace('-', "/"),
        instrument: [&usual_instrument().label.instrument, ""],
        clock: clock.ok_or_else(|| failed("the clock string contains no seconds and ticks"))?,
        utc: [planned.utc_start, stop],
        exposure_s: planned.exposure_ms * SECONDS_PER_MS,
        summing: u8::try_from(planned.summing).unwrap_or(u8::MAX),
        first_detector: 0,
        samples: planned.samples(),
        pixels,
        coding: coder.coding(),
    };
    Ok(encode(&image).map_err(|error| failed(&error.to_string()))?)
}

#[cfg(test)]
mod tests;
