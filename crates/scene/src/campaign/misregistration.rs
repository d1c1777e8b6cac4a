//! How far an image lies from where labels and kernels place it, by its true camera.

use nalgebra::Vector3;
use serde::Serialize;

use super::super::{
    drawn::{DayErrors, Flown, orbit_axes},
    terrain::Terrain,
    ties::{EDGE_PX, TrueImage},
    versions::Version,
};
use areograph_base::{error::Result, ties::TieMeasure};
use areograph_geom::pushbroom::{ExteriorOrientation as _, Projector, SampledOrientation};

/// Family of the orbit that sites use.
pub(super) const USED_ORBIT: &str = "nav";
/// Points of an image in lines and samples for its own misregistration.
const GRID: [u32; 2] = [7, 5];

/// Position of ground in an image by labels and kernels minus its true position.
#[derive(Debug, Clone, Copy, Default, Serialize)]
pub(super) struct Misregistration {
    /// Along the track.
    pub(super) along_lines: f64,
    pub(super) along_m: f64,
    /// Across the track.
    pub(super) across_samples: f64,
    pub(super) across_m: f64,
    /// The part of `along_m` that the offset of the attitude's clock causes.
    pub(super) clock_along_m: f64,
    /// Distance of successive lines on the ground.
    pub(super) line_spacing_m: f64,
    /// Width of a pixel at the range of the ground.
    pub(super) pixel_m: f64,
}

/// The mean of some.
pub(super) fn mean(of: &[Misregistration]) -> Misregistration {
    let share = 1.0 / of.len().max(1) as f64;
    of.iter()
        .fold(Misregistration::default(), |sum, one| Misregistration {
            along_lines: sum.along_lines + share * one.along_lines,
            along_m: sum.along_m + share * one.along_m,
            across_samples: sum.across_samples + share * one.across_samples,
            across_m: sum.across_m + share * one.across_m,
            clock_along_m: sum.clock_along_m + share * one.clock_along_m,
            line_spacing_m: sum.line_spacing_m + share * one.line_spacing_m,
            pixel_m: sum.pixel_m + share * one.pixel_m,
        })
}

/// Flights of an image by the orbit that sites use: as labels and kernels have it, and with the true offset of the attitude's clock.
pub(super) struct ByKernels<'a>([Flown<'a>; 2]);

impl<'a> ByKernels<'a> {
    /// Those of the day of an image.
    pub(super) fn of(flown: &Flown<'a>, seed: u64) -> Self {
        let arc = &flown.arc;
        let middle = arc.exposed.start.plus(0.5 * arc.exposed.duration_s());
        let used = Version::new(USED_ORBIT, arc.image.id, seed, middle);
        let with_clock = |attitude_clock_s| Flown {
            arc: arc.clone(),
            errors: DayErrors {
                bus_position_m: orbit_axes(arc) * used.offset_m,
                attitude_clock_s,
                ..DayErrors::none()
            },
        };
        Self([0.0, flown.errors.attitude_clock_s].map(with_clock))
    }

    /// Its cameras.
    ///
    /// # Errors
    /// An image that does not see the ground.
    pub(super) fn cameras(&'a self, terrain: &Terrain) -> Result<[TrueImage<'a>; 2]> {
        let Self([stated, with_clock]) = self;
        Ok([
            TrueImage::new(stated, terrain)?,
            TrueImage::new(with_clock, terrain)?,
        ])
    }
}

/// An image by its kernels and with the true offset of the clock.
pub(super) struct Stated<'a> {
    cameras: &'a [TrueImage<'a>; 2],
    projectors: [Projector<'a, SampledOrientation>; 2],
}

impl<'a> Stated<'a> {
    /// The image with these cameras.
    ///
    /// # Errors
    /// An image that does not see the ground.
    pub(super) fn new(cameras: &'a [TrueImage<'a>; 2]) -> Result<Self> {
        let [stated, with_clock] = cameras;
        Ok(Self {
            cameras,
            projectors: [stated.projector()?, with_clock.projector()?],
        })
    }

    /// Misregistration of ground that the true camera shows at `seen`; `None` where the kernels place it at the edge of the image or
    /// outside it.
    pub(super) fn of_ground(
        &self,
        ground_m: &Vector3<f64>,
        seen: &TieMeasure<String>,
    ) -> Option<Misregistration> {
        let [stated, with_clock] = self.cameras;
        let place = stated.measure(&self.projectors[0], ground_m)?;
        let by_clock = with_clock.measure(&self.projectors[1], ground_m)?;
        let camera = &stated.oriented_camera;
        let (x_lines, _) = camera.focal_plane_coordinates(place.line, place.sample);
        let line_spacing_m = camera.line_spacing_m(x_lines, ground_m);
        let depth_m = camera.orientation.pose(x_lines).camera_vector_m(ground_m).z;
        let pixel_m = depth_m / camera.detector.focal_length_px;
        let [along_lines, across_samples] = [place.line - seen.line, place.sample - seen.sample];
        Some(Misregistration {
            along_lines,
            along_m: along_lines * line_spacing_m,
            across_samples,
            across_m: across_samples * pixel_m,
            clock_along_m: (place.line - by_clock.line) * line_spacing_m,
            line_spacing_m,
            pixel_m,
        })
    }

    /// The mean over a grid of points of the true image.
    ///
    /// # Errors
    /// An image that does not see the ground.
    pub(super) fn of_image(
        &self,
        image: &TrueImage<'_>,
        terrain: &Terrain,
    ) -> Result<Misregistration> {
        let projector = image.projector()?;
        let [lines, samples] = image.extent_px();
        let at = |index: u32, count: u32, end_px: f64| {
            EDGE_PX + (end_px - EDGE_PX) * (f64::from(index) + 0.5) / f64::from(count)
        };
        let places = (0..GRID[0]).flat_map(|line| (0..GRID[1]).map(move |sample| [line, sample]));
        let found = places.filter_map(|[line, sample]| {
            let [line, sample] = [at(line, GRID[0], lines), at(sample, GRID[1], samples)];
            let ground_m = image.ground_m(terrain, line, sample)?;
            let seen = image.measure(&projector, &ground_m)?;
            self.of_ground(&ground_m, &seen)
        });
        Ok(mean(&found.collect::<Vec<_>>()))
    }
}
