//! Image coordinates of the places, and the pixels needed around them.

use nalgebra::{Matrix2, Vector2, Vector3};

use super::{
    Place, PlaceView,
    chips::{CHIP_EDGE, Lattice, Mark},
    pixels::Patch,
    places::{Subject, Wanted},
};
use crate::{
    oriented::OrientedImage,
    site_image::{SiteImage, SiteImages},
    tag_times::ImageTimes,
};
use areograph_base::error::Result;

/// Length on the ground over which lines and samples are counted, metres.
const STEP_M: f64 = 100.0;
/// Share of the half edge of a piece within which both orientations place the point, if possible.
const WITHIN: f64 = 0.8;
/// Most image pixels per pixel of a piece.
const COARSER_MAX: f64 = 4.0;
/// Lines and samples around a piece, for blending.
const AROUND: f64 = 2.0;

/// An oriented image.
pub(super) struct Camera<'a> {
    oriented: OrientedImage<'a>,
}

/// The oriented images.
///
/// # Errors
/// Samples that do not form an orientation.
pub(super) fn cameras(images: &[SiteImage]) -> Result<Vec<Camera<'_>>> {
    let oriented = SiteImages(images).oriented()?.into_iter();
    Ok(oriented.map(|oriented| Camera { oriented }).collect())
}

impl Camera<'_> {
    /// Line and sample of a point, and their change per metre towards east and north; `None` for a point that it cannot
    /// see.
    fn sees(&self, ground_m: &Vector3<f64>) -> Option<(Vector2<f64>, Matrix2<f64>)> {
        let projector = self.oriented.projector().ok()?;
        let at = |point_m: &Vector3<f64>| self.oriented.line_and_sample(&projector, point_m).ok();
        let up = ground_m.normalize();
        let east = Vector3::z().cross(&up).try_normalize(0.0)?;
        let north = up.cross(&east);
        let place = at(ground_m)?;
        let towards =
            |axis: Vector3<f64>| Some((at(&(ground_m + STEP_M * axis))? - place) / STEP_M);
        let per_m = Matrix2::from_columns(&[towards(east)?, towards(north)?]);
        (per_m.determinant() != 0.0).then_some((place, per_m))
    }
}

/// A place whose pixels are still to be read.
#[derive(Debug)]
pub(super) struct PlannedPlace {
    subject: Subject,
    pixel_m: f64,
    centres: Vec<Mark>,
    views: Vec<PlannedView>,
}

#[derive(Debug)]
struct PlannedView {
    image: usize,
    moved_m: Option<f64>,
    marks: Vec<(Mark, Vector2<f64>)>,
    chips: Vec<(Lattice, Patch)>,
}

/// A place in one image.
struct Sight {
    image: usize,
    marks: Vec<(Mark, Vector2<f64>)>,
    per_m: Matrix2<f64>,
}

impl Sight {
    fn mark(&self, wanted: Mark) -> Option<Vector2<f64>> {
        let found = self.marks.iter().find(|(mark, _)| *mark == wanted);
        found.map(|(_, place)| *place)
    }

    /// Edge of a pixel of the image on the ground, metres.
    fn pixel_m(&self) -> f64 {
        self.per_m.determinant().abs().sqrt().recip()
    }

    /// Distance by which the adjustment moves the place on the ground, metres.
    fn moved_m(&self) -> Option<f64> {
        let moved = self.mark(Mark::After)? - self.mark(Mark::Before)?;
        Some((self.per_m.try_inverse()? * moved).norm())
    }
}

/// Image coordinates of a place, and the pixels to be read; `None` where one of the images does not see it.
pub(super) fn plan(
    wanted: Wanted,
    before: &[Camera],
    after: &[Camera],
    times: &[&ImageTimes],
) -> Option<PlannedPlace> {
    let sights = wanted.images.iter().map(|(image, measured)| {
        let [initial, adjusted] = &wanted.ground_m;
        let initial = initial.and_then(|ground_m| before[*image].sees(&ground_m));
        let adjusted = adjusted.and_then(|ground_m| after.get(*image)?.sees(&ground_m));
        let marks = [
            (Mark::Before, initial.map(|(place, _)| place)),
            (Mark::After, adjusted.map(|(place, _)| place)),
            (Mark::Measured, *measured),
        ];
        let marks = marks
            .into_iter()
            .filter_map(|(mark, place)| Some((mark, place?)));
        Some(Sight {
            image: *image,
            marks: marks.collect(),
            per_m: adjusted.or(initial)?.1,
        })
    });
    let sights: Vec<Sight> = sights.collect::<Option<_>>()?;
    let centres: Vec<Mark> = match wanted.subject {
        Subject::Tie { .. } => vec![Mark::Measured],
        Subject::Footprint { .. } => vec![Mark::Before, Mark::After],
    };
    let all_have = |mark: &Mark| sights.iter().all(|sight| sight.mark(*mark).is_some());
    let centres: Vec<Mark> = centres.into_iter().filter(all_have).collect();
    if centres.is_empty() {
        return None;
    }
    let pixel_m = pixel_m(&sights);
    let views = sights.into_iter().map(|sight| {
        let lattices = centres.iter().filter_map(|centre| {
            let lattice = Lattice {
                centre: sight.mark(*centre)?,
                per_m: sight.per_m,
                pixel_m,
            };
            Some((lattice, patch(&lattice, times[sight.image])))
        });
        PlannedView {
            image: sight.image,
            moved_m: sight.moved_m(),
            chips: lattices.collect(),
            marks: sight.marks,
        }
    });
    Some(PlannedPlace {
        subject: wanted.subject,
        pixel_m,
        views: views.collect(),
        centres,
    })
}

/// Pixels of the coarsest image, or larger ones where marks lie far apart.
fn pixel_m(sights: &[Sight]) -> f64 {
    let of = |value: fn(&Sight) -> f64| sights.iter().map(value).fold(0.0, f64::max);
    let finest_m = of(Sight::pixel_m);
    let apart_m = of(|sight| sight.moved_m().unwrap_or_default());
    let needed_m = apart_m / (0.5 * WITHIN * CHIP_EDGE as f64);
    needed_m.clamp(finest_m, COARSER_MAX * finest_m)
}

/// The part of the image that a piece needs.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "casts from floating point saturate, and the edges of the image limit the part"
)]
fn patch(lattice: &Lattice, times: &ImageTimes) -> Patch {
    let edge = CHIP_EDGE as f64;
    let corners = [(0.0, 0.0), (edge, 0.0), (0.0, edge), (edge, edge)];
    let corners = corners.map(|(column, row)| lattice.in_image(column, row));
    let range = |of: fn(&Vector2<f64>) -> f64, end: u32| {
        let low = corners.iter().map(of).fold(f64::INFINITY, f64::min) - AROUND;
        let high = corners.iter().map(of).fold(f64::NEG_INFINITY, f64::max) + AROUND;
        let first = (low.floor() as u32).min(end);
        first..(high.ceil() as u32).clamp(first, end)
    };
    Patch::new(
        range(|place| place.x, times.line_times.lines()),
        range(|place| place.y, times.samples),
    )
}

impl PlannedPlace {
    /// The parts that are needed of an image.
    pub(super) fn patches_of(&mut self, image: usize) -> impl Iterator<Item = &mut Patch> {
        let views = self
            .views
            .iter_mut()
            .filter(move |view| view.image == image);
        views.flat_map(|view| view.chips.iter_mut().map(|(_, patch)| patch))
    }

    /// The place with its pieces. A piece has the marks that belong to its centre: around the place by the kernels only
    /// that mark, else all marks.
    pub(super) fn cut(self) -> Place {
        let centres = &self.centres;
        let views = self.views.into_iter().map(|view| {
            let chips = centres
                .iter()
                .zip(&view.chips)
                .map(|(centre, (lattice, patch))| {
                    let marks = view.marks.iter();
                    let shown = marks.filter(|(mark, _)| *centre != Mark::Before || mark == centre);
                    lattice.cut(patch, &shown.copied().collect::<Vec<_>>())
                });
            PlaceView {
                image: view.image,
                moved_m: view.moved_m,
                chips: chips.collect(),
            }
        });
        Place {
            subject: self.subject,
            pixel_m: self.pixel_m,
            views: views.collect(),
            centres: self.centres.clone(),
        }
    }
}
