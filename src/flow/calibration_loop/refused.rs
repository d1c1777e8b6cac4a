//! Input that a calibration from pixels refuses.

use crate::{
    config::CameraConfig,
    error::{Cause, Locate as _, Result},
    pds::pixel_file::{PixelFile, Pyramid},
    stages::{calibrate::CONTROLS_MIN, line_camera::LineCamera, match_laser::LaserMatch},
};

/// Pixels of another image.
#[derive(Debug, thiserror::Error, Cause)]
#[cause(Input: "check that cameras.pixels are not exchanged, and are the whole images that cameras.isd describe")]
enum PixelsError {
    #[error("camera {camera}: its pixels have {} lines of {} samples; expected {} of {}, as in its support data", found[0], found[1], expected[0], expected[1])]
    Size {
        camera: String,
        found: [u32; 2],
        expected: [u32; 2],
    },
    #[error("camera {camera}: its pixels are map-projected; expected the unprojected image")]
    Map { camera: String },
    #[error("camera {camera} has no pixels")]
    Missing { camera: String },
}

/// Too little laser control was found.
#[derive(Debug, thiserror::Error, Cause)]
#[error(
    "{used} of {} units of laser shots match the terrain model of the images, and {judging} of {} withheld units; expected at least \
     {CONTROLS_MIN} of each. {example}", of[0], of[1]
)]
#[cause(Input: "check that cameras.pixels are not exchanged and laser.files are passes over this ground with relief; \
    give more passes, or a larger laser.search_cells if orbit and mounting are farther off")]
pub(super) struct FewUnits {
    used: usize,
    judging: usize,
    of: [usize; 2],
    example: String,
}

impl FewUnits {
    /// Checks the units that the laser found in a terrain model; `None` if they suffice.
    pub(super) fn of(control: &LaserMatch) -> Option<Self> {
        let units = |judges: bool| {
            control
                .units
                .iter()
                .filter(move |unit| unit.judges == judges)
        };
        let points = |judges: bool| {
            control
                .points
                .iter()
                .filter(|point| point.judges == judges)
                .count()
        };
        let refused = control.units.iter().find(|unit| !unit.is_kept());
        let few = Self {
            used: points(false),
            judging: points(true),
            of: [false, true].map(|judges| units(judges).count()),
            example: refused.map_or_else(String::new, |unit| {
                format!("Unit {}: {}", unit.unit, unit.refused_because)
            }),
        };
        (few.used.min(few.judging) < CONTROLS_MIN).then_some(few)
    }
}

/// The pixels of a camera, which must cover its complete image.
pub(super) fn pixels_of(camera: &CameraConfig, line: &LineCamera) -> Result<Pyramid> {
    let id = || camera.id.clone();
    let Some(path) = &camera.pixels else {
        return Err(PixelsError::Missing { camera: id() }.into());
    };
    let file = PixelFile::open(path, &[])?;
    let wrong = {
        let found = [file.lines(), file.samples()];
        let expected = [line.camera.line_times.lines(), line.samples];
        let size = PixelsError::Size {
            camera: id(),
            found,
            expected,
        };
        let map = PixelsError::Map { camera: id() };
        let is_map = file.is_projected().then_some(map);
        is_map.or((found != expected).then_some(size))
    };
    match wrong {
        Some(wrong) => Err(wrong).in_file(path),
        None => Pyramid::of(&file),
    }
}
