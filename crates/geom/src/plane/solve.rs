//! The one solver: ties and controls by least squares, four unknowns a picture.

use nalgebra::{Matrix2, RowVector2};

use super::{
    Place,
    check::{check, loose_picture},
    eliminate::{Rows, Step, factorise, order_of_least_degree, substitute},
    inverse::Cofactors,
    net::{Control, Groups, Measurement, Net, PlaneError},
    similarity::Similarity,
};
use crate::random::Random;

/// Equations and unknowns, each coordinate counted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Redundancy {
    /// `2(r − 1)` of every point on `r` pictures.
    pub ties: usize,
    /// Two of every control that a picture shows.
    pub controls: usize,
    /// Four of every picture.
    pub unknowns: usize,
}

impl Redundancy {
    /// Equations beyond what determines the unknowns.
    #[must_use]
    pub const fn total(&self) -> usize {
        (self.ties + self.controls).saturating_sub(self.unknowns)
    }
}

/// The adjusted net.
#[derive(Debug)]
pub struct Solution {
    /// The similarity from every picture to the map.
    pub pictures: Vec<Similarity>,
    /// Mean of the images of every point on the map; `None` for a point that no picture shows.
    pub places: Vec<Option<Place>>,
    /// For every measurement: its image on the map minus the mean of its point, map units.
    pub deviations: Vec<Place>,
    /// For every control: given minus computed, map units; `None` for one that no picture shows.
    pub control_residuals: Vec<Option<Place>>,
    /// Equations and unknowns.
    pub redundancy: Redundancy,
    steps: Vec<Step>,
    /// Position of every picture in the order of elimination.
    place_of: Vec<usize>,
    frames: Vec<Frame>,
}

/// Origin and size that reduce coordinates to small numbers about 0.
#[derive(Debug, Clone, Copy)]
struct Frame {
    centre: Place,
    size: f64,
}

impl Frame {
    /// About the mean, sized by the root mean square distance from it.
    fn of(places: impl Iterator<Item = Place> + Clone) -> Self {
        let count = places.clone().count().max(1) as f64;
        let centre = places.clone().sum::<Place>() / count;
        let squares: f64 = places.map(|place| (place - centre).norm_sqr()).sum();
        let size = (squares / count).sqrt();
        Self {
            centre,
            size: if size > 0.0 { size } else { 1.0 },
        }
    }

    fn inside(&self, place: Place) -> Place {
        (place - self.centre) / self.size
    }
}

/// Adjusts `net`: every point is tied to the mean of its images (weight 1), every control to the mean of its images
/// by its own weight.
///
/// For a point on `r` pictures the paper's `r` equations `X_i − mean(X) = 0` have rank `r − 1`; they are replaced by
/// `r − 1` orthonormal contrasts with the same sum of squares. Coordinates are centred and scaled.
///
/// # Errors
/// [`PlaneError`] for a net that leaves a picture free; see [`check`].
/// # Source
/// Arthur & McMacken 1977, eq. 3; contrasts after Helmert.
pub fn solve(net: &Net) -> Result<Solution, PlaneError> {
    check(net)?;
    match loose_picture(net) {
        // A part that hangs on one point shrinks to it, and noise hides that from the pivots: an exact net does not.
        Some(loose) if adjust(&exact(net)).is_err() => Err(loose),
        _ => adjust(net),
    }
}

/// A net of the same pictures and points whose measurements have no errors: every picture shows the map.
fn exact(net: &Net) -> Net {
    let mut random = Random::new(0, "exact net");
    let places: Vec<Place> = (0..net.points)
        .map(|_| Place::new(random.between(0.0, 1.0), random.between(0.0, 1.0)))
        .collect();
    let measurements = net.measurements.iter();
    let controls = net.controls.iter();
    Net {
        measurements: measurements
            .map(|measurement| Measurement {
                at: places[measurement.point],
                ..*measurement
            })
            .collect(),
        controls: controls
            .map(|control| Control {
                at: places[control.point],
                weight: 1.0,
                ..*control
            })
            .collect(),
        ..*net
    }
}

fn adjust(net: &Net) -> Result<Solution, PlaneError> {
    let (by_point, by_picture) = (net.by_point(), net.by_picture());
    let at = |index: &usize| net.measurements[*index].at;
    let frames: Vec<Frame> = by_picture
        .iter()
        .map(|of| Frame::of(of.iter().map(at)))
        .collect();
    let map = Frame::of(net.controls.iter().map(|control| control.at));
    let order = order_of_least_degree(neighbours(net, &by_point));
    let mut place_of = vec![0; net.pictures];
    for (place, picture) in order.iter().enumerate() {
        place_of[*picture] = place;
    }
    let rows = rows(net, &by_point, &frames, &map, &place_of);
    let steps = factorise(net.pictures, rows).map_err(|place| {
        let picture = order[place];
        let shared = by_picture.get(picture).iter();
        let shared = shared.filter(|index| by_point.get(net.measurements[**index].point).len() > 1);
        PlaneError::UnderconnectedPicture {
            picture,
            ties: shared.count(),
        }
    })?;
    let unknowns = substitute(&steps);
    let pictures: Vec<Similarity> = (0..net.pictures)
        .map(|picture| {
            let (unknown, frame) = (&unknowns[place_of[picture]], &frames[picture]);
            let turn = unknown[0] * (map.size / frame.size);
            Similarity {
                turn,
                shift: unknown[1] * map.size + map.centre - turn * frame.centre,
            }
        })
        .collect();
    let known = Known {
        steps,
        place_of,
        frames,
    };
    Ok(assemble(net, &by_point, pictures, known))
}

/// Quantities kept for the covariances.
struct Known {
    steps: Vec<Step>,
    place_of: Vec<usize>,
    frames: Vec<Frame>,
}

fn assemble(net: &Net, by_point: &Groups, pictures: Vec<Similarity>, known: Known) -> Solution {
    let images: Vec<Place> = net
        .measurements
        .iter()
        .map(|measured| pictures[measured.picture].map(measured.at))
        .collect();
    let places: Vec<Option<Place>> = by_point
        .iter()
        .map(|of| {
            let sum = of.iter().map(|index| images[*index]).sum::<Place>();
            (!of.is_empty()).then(|| sum / of.len() as f64)
        })
        .collect();
    let deviations = net.measurements.iter().zip(&images);
    let deviations = deviations
        .map(|(measured, image)| places[measured.point].map_or(*image, |mean| image - mean));
    let control_residuals = net
        .controls
        .iter()
        .map(|control| places[control.point].map(|computed| control.at - computed));
    let tied: usize = by_point.iter().map(|of| of.len().saturating_sub(1)).sum();
    let shown = net.controls.iter();
    let shown = shown
        .filter(|control| places[control.point].is_some())
        .count();
    Solution {
        deviations: deviations.collect(),
        control_residuals: control_residuals.collect(),
        redundancy: Redundancy {
            ties: 2 * tied,
            controls: 2 * shown,
            unknowns: 4 * net.pictures,
        },
        places,
        pictures,
        steps: known.steps,
        place_of: known.place_of,
        frames: known.frames,
    }
}

/// Pictures with a point in common, each list ascending.
fn neighbours(net: &Net, by_point: &Groups) -> Vec<Vec<usize>> {
    let mut neighbours = vec![Vec::new(); net.pictures];
    for measured in by_point.iter() {
        for one in measured {
            for two in measured {
                let pair = [one, two].map(|index| net.measurements[*index].picture);
                if pair[0] != pair[1] {
                    neighbours[pair[0]].push(pair[1]);
                }
            }
        }
    }
    for of in &mut neighbours {
        of.sort_unstable();
        of.dedup();
    }
    neighbours
}

/// The rows of every point: contrasts of its images, and the mean of the images of a control.
fn rows(
    net: &Net,
    by_point: &Groups,
    frames: &[Frame],
    map: &Frame,
    place_of: &[usize],
) -> Vec<Rows> {
    let control_of = net.control_of();
    let mut all = Vec::new();
    for (point, measured) in by_point.iter().enumerate() {
        let control = control_of[point].map(|index| &net.controls[index]);
        if measured.is_empty() || measured.len() == 1 && control.is_none() {
            continue;
        }
        let mut views: Vec<(usize, Place)> = measured
            .iter()
            .map(|index| {
                let measured = &net.measurements[*index];
                let inside = frames[measured.picture].inside(measured.at);
                (place_of[measured.picture], inside)
            })
            .collect();
        views.sort_by_key(|(place, _)| *place);
        let count = views.len();
        let mut rows = Rows {
            pictures: views.iter().map(|(place, _)| *place).collect(),
            values: Vec::with_capacity(count * (2 * count + 1)),
            leads: vec![0; count - 1],
        };
        for contrast in 1..count {
            let before = 1.0 / ((contrast * (contrast + 1)) as f64).sqrt();
            let share = |view: usize| match view.cmp(&contrast) {
                std::cmp::Ordering::Less => before,
                std::cmp::Ordering::Equal => -before * contrast as f64,
                std::cmp::Ordering::Greater => 0.0,
            };
            push_row(&mut rows.values, &views, share, Place::new(0.0, 0.0));
        }
        if let Some(control) = control {
            let root = control.weight.sqrt();
            rows.leads.push(0);
            let share = |_| root / count as f64;
            push_row(
                &mut rows.values,
                &views,
                share,
                map.inside(control.at) * root,
            );
        }
        all.push(rows);
    }
    all
}

fn push_row(
    values: &mut Vec<Place>,
    views: &[(usize, Place)],
    share: impl Fn(usize) -> f64,
    right: Place,
) {
    for (view, (_, inside)) in views.iter().enumerate() {
        let share = share(view);
        values.extend([inside * share, Place::new(share, 0.0)]);
    }
    values.push(right);
}

impl Solution {
    /// Weighted sum of squares of all residuals, map units squared.
    #[must_use]
    pub fn squares(&self, net: &Net) -> f64 {
        let controls = net.controls.iter().zip(&self.control_residuals);
        let controls = controls.filter_map(|(control, residual)| Some((control, (*residual)?)));
        let controls = controls.map(|(control, residual)| control.weight * residual.norm_sqr());
        self.tie_squares() + controls.sum::<f64>()
    }

    /// Sum of squares of the deviations only, map units squared.
    #[must_use]
    pub fn tie_squares(&self) -> f64 {
        self.deviations.iter().map(Place::norm_sqr).sum()
    }

    /// A posteriori standard deviation of a coordinate of an image of a tie on the map; `None` without redundancy.
    #[must_use]
    pub fn sigma(&self, net: &Net) -> Option<f64> {
        let redundancy = self.redundancy.total();
        (redundancy > 0).then(|| (self.squares(net) / redundancy as f64).sqrt())
    }

    /// Cofactors, from which standard deviations follow.
    #[must_use]
    pub fn precision(&self) -> Precision<'_> {
        Precision {
            solution: self,
            cofactors: Cofactors::of(&self.steps),
        }
    }
}

/// Cofactors of the adjusted net: variances of a coordinate where the variance of an image of a tie is 1.
pub struct Precision<'a> {
    solution: &'a Solution,
    cofactors: Cofactors,
}

impl Precision<'_> {
    /// For a picture: cofactors of `turn` and `shift` in map units, for a measurement at the middle of its points.
    #[must_use]
    pub fn picture(&self, picture: usize) -> [f64; 2] {
        let place = self.solution.place_of[picture];
        let block = self.cofactors.between(place, place);
        let size = self.solution.frames[picture].size;
        [block[(0, 0)].re / size.powi(2), block[(1, 1)].re]
    }

    /// For the image of a point on the map, without its own error: the part of its variance that its picture has.
    #[must_use]
    pub(super) fn image(&self, of: &Measurement) -> f64 {
        self.form(&[self.row(of, 1.0)])
    }

    /// For the adjusted position of a point, the mean of its images; `of` are its measurements, `weight` is the weight
    /// of its control, if the point is one.
    ///
    /// The errors of the images are part of the error of a control: the contribution `h` of the control to the net is
    /// subtracted from the mean. A weight above the number of images implies that the images are known too; then the
    /// position is the control's.
    #[must_use]
    pub fn place(&self, net: &Net, of: &[usize], weight: Option<f64>) -> f64 {
        let count = of.len() as f64;
        let views: Vec<(usize, RowVector2<Place>)> = of
            .iter()
            .map(|index| self.view(net, *index, 1.0 / count))
            .collect();
        let form = self.form(&views);
        match weight {
            None => form + 1.0 / count,
            Some(weight) if weight > count => form,
            Some(weight) => (form + (1.0 - 2.0 * weight * form) / count).max(0.0),
        }
    }

    /// For the deviation of a measurement from the mean of its point, `of`: the share of its variance that its own
    /// error retains.
    #[must_use]
    pub fn deviation(&self, net: &Net, of: &[usize], measurement: usize) -> f64 {
        let count = of.len() as f64;
        let views: Vec<(usize, RowVector2<Place>)> = of
            .iter()
            .map(|index| {
                let own = if *index == measurement { 1.0 } else { 0.0 };
                self.view(net, *index, own - 1.0 / count)
            })
            .collect();
        (1.0 - 1.0 / count - self.form(&views)).max(0.0)
    }

    fn view(&self, net: &Net, index: usize, share: f64) -> (usize, RowVector2<Place>) {
        self.row(&net.measurements[index], share)
    }

    fn row(&self, measured: &Measurement, share: f64) -> (usize, RowVector2<Place>) {
        let inside = self.solution.frames[measured.picture].inside(measured.at);
        let row = RowVector2::new(inside * share, Place::new(share, 0.0));
        (self.solution.place_of[measured.picture], row)
    }

    /// `g Q gᴴ`.
    fn form(&self, views: &[(usize, RowVector2<Place>)]) -> f64 {
        let mut sum = 0.0;
        for (one, row) in views {
            for (two, other) in views {
                let block: Matrix2<Place> = self.cofactors.between(*one, *two);
                sum += (row * block * other.adjoint())[(0, 0)].re;
            }
        }
        sum
    }
}

impl std::fmt::Debug for Precision<'_> {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.debug_struct("Precision").finish_non_exhaustive()
    }
}

impl Solution {
    /// The measurements of every point, as indices: the input of [`Precision::place`].
    #[must_use]
    pub fn measurements_of(net: &Net) -> Vec<Vec<usize>> {
        net.by_point().iter().map(<[usize]>::to_vec).collect()
    }
}
