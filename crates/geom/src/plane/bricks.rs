//! BRICK, EXTEND, MORTAR and LOCAL: the solver on a few pictures, on bricks, and again on the pictures of a brick.

use super::{
    Place,
    net::{Control, Measurement, Net, Part, PlaneError},
    shrinkage::Shrinkage,
    similarity::Similarity,
    solve::{Redundancy, solve},
};

/// Weight of a seam's mean in LOCAL: as much as ten images.
const SEAM_WEIGHT: f64 = 10.0;

/// A brick: some pictures in a local figure whose position, size and orientation are approximate.
#[derive(Debug, Clone, PartialEq)]
pub struct Figure {
    /// Indices of its pictures in the net.
    pub pictures: Vec<usize>,
    /// From each picture to the figure.
    pub similarities: Vec<Similarity>,
    /// Every point that a picture shows: its index in the net and the mean of its images in the figure.
    pub places: Vec<(usize, Place)>,
    /// Every measurement: its index in the net and its image minus the mean, figure units.
    pub deviations: Vec<(usize, Place)>,
    /// Equations of ties, and unknowns without the four of the figure.
    pub redundancy: Redundancy,
    /// Shrinkage by the two guesses before it was corrected; `None` for a single picture.
    pub shrinkage: Option<Shrinkage>,
}

/// Bricks on controls.
#[derive(Debug, Clone, PartialEq)]
pub struct Block {
    /// From each figure to the block.
    pub bricks: Vec<Similarity>,
    /// Mean over bricks of every point of the net.
    pub places: Vec<Option<Place>>,
    /// Points on several bricks: brick, point, and its image minus the mean, block units.
    pub seams: Vec<(usize, usize, Place)>,
    /// Equations and unknowns.
    pub redundancy: Redundancy,
    /// Shrinkage by two controls before it was corrected.
    pub shrinkage: Option<Shrinkage>,
}

/// BRICK: ties `pictures` together on two approximate points of the picture with most ties, far apart, where that
/// picture has them. Their shrinkage is corrected.
///
/// # Errors
/// [`PlaneError::UnderconnectedPicture`], [`PlaneError::EqualPoints`].
pub fn brick(net: &Net, pictures: &[usize]) -> Result<Figure, PlaneError> {
    let Part {
        net: mut part,
        points,
        measurements,
    } = net.part(pictures);
    let figure = if pictures.len() == 1 {
        alone(&part)
    } else {
        part.controls = rough_guesses(&part);
        let solution = solve(&part).map_err(|error| error.of_part(&points, pictures))?;
        let shrinkage = Shrinkage::of(&part, &solution);
        let solution = solution.unshrunk(&part);
        let places = solution.places.into_iter().enumerate();
        Figure {
            pictures: (0..pictures.len()).collect(),
            similarities: solution.pictures,
            places: places
                .filter_map(|(point, place)| Some((point, place?)))
                .collect(),
            deviations: solution.deviations.into_iter().enumerate().collect(),
            redundancy: Redundancy {
                controls: 0,
                unknowns: solution.redundancy.unknowns - 4,
                ..solution.redundancy
            },
            shrinkage,
        }
    };
    Ok(figure.in_net(pictures, &points, &measurements))
}

/// A single picture, which is its own figure.
fn alone(part: &Net) -> Figure {
    let measured = part.measurements.iter();
    Figure {
        pictures: vec![0],
        similarities: vec![Similarity::IDENTITY],
        places: measured
            .map(|measurement| (measurement.point, measurement.at))
            .collect(),
        deviations: (0..part.measurements.len())
            .map(|index| (index, Place::new(0.0, 0.0)))
            .collect(),
        redundancy: Redundancy {
            ties: 0,
            controls: 0,
            unknowns: 0,
        },
        shrinkage: None,
    }
}

/// Two ties of the picture with most of them, as far apart as possible, where that picture has them.
pub(super) fn rough_guesses(part: &Net) -> Vec<Control> {
    let by_point = part.by_point();
    let ties = |of: &[usize]| -> Vec<usize> {
        let tied = |index: &&usize| by_point.get(part.measurements[**index].point).len() > 1;
        of.iter().filter(tied).copied().collect()
    };
    let of_pictures = part.by_picture();
    let of_pictures = of_pictures.iter().map(ties);
    // The first of those with most ties.
    let most = of_pictures.reduce(|best, next| if next.len() > best.len() { next } else { best });
    let most = most.unwrap_or_default();
    let at = |index: usize| part.measurements[index].at;
    let farthest_from = |place: Place| {
        let distances = most
            .iter()
            .map(|index| ((at(*index) - place).norm(), *index));
        distances.reduce(|best, next| if next.0 > best.0 { next } else { best })
    };
    let middle = most.iter().map(|index| at(*index)).sum::<Place>() / most.len().max(1) as f64;
    let first = farthest_from(middle).map(|(_, index)| index);
    let second = first
        .and_then(|first| farthest_from(at(first)))
        .map(|(_, index)| index);
    let control = |index: usize| Control {
        point: part.measurements[index].point,
        at: at(index),
        weight: 1.0,
    };
    match (first, second) {
        (Some(first), Some(second)) if first != second => vec![control(first), control(second)],
        _ => Vec::new(),
    }
}

impl PlaneError {
    /// The error of a part with the indices of the complete net; missing guesses are reported as missing ties.
    pub(super) fn of_part(self, points: &[usize], pictures: &[usize]) -> Self {
        match self {
            Self::TooFewControls { found } => Self::UnderconnectedPicture {
                picture: pictures[0],
                ties: found,
            },
            Self::UnderconnectedPicture { picture, ties } => Self::UnderconnectedPicture {
                picture: pictures[picture],
                ties,
            },
            Self::EqualPoints {
                picture,
                first,
                second,
            } => Self::EqualPoints {
                picture: pictures[picture],
                first: points[first],
                second: points[second],
            },
            Self::EqualControls { first, second } => Self::EqualControls {
                first: points[first],
                second: points[second],
            },
            other => other,
        }
    }
}

impl Figure {
    /// Distance of the farthest point from the first, figure units.
    #[must_use]
    pub fn extent(&self) -> f64 {
        let first = self
            .places
            .first()
            .map_or(Place::new(0.0, 0.0), |(_, place)| *place);
        let distances = self.places.iter().map(|(_, place)| (place - first).norm());
        distances.fold(0.0, f64::max)
    }

    /// The figure of a part with the indices of the complete net.
    pub(super) fn in_net(
        self,
        pictures: &[usize],
        points: &[usize],
        measurements: &[usize],
    ) -> Self {
        let places = self.places.into_iter();
        let deviations = self.deviations.into_iter();
        Self {
            pictures: self
                .pictures
                .iter()
                .map(|picture| pictures[*picture])
                .collect(),
            places: places
                .map(|(point, place)| (points[point], place))
                .collect(),
            deviations: deviations
                .map(|(index, of)| (measurements[index], of))
                .collect(),
            ..self
        }
    }
}

/// EXTEND: ties bricks by their common points on the two controls that are farthest apart, and corrects the shrinkage:
/// a figure that is free except for its place, size and direction.
///
/// # Errors
/// [`PlaneError`]; its pictures are bricks.
pub fn extend(net: &Net, figures: &[Figure]) -> Result<Block, PlaneError> {
    let shown = shown_points(net, figures);
    let controls: Vec<Control> = net
        .controls
        .iter()
        .filter(|control| shown[control.point])
        .map(|control| Control {
            weight: 1.0,
            ..*control
        })
        .collect();
    let farthest = |from: Place| {
        let distances = controls.iter().map(|of| ((of.at - from).norm(), of));
        let farthest = distances.reduce(|best, next| if next.0 > best.0 { next } else { best });
        farthest.map(|(_, control)| *control)
    };
    let middle =
        controls.iter().map(|control| control.at).sum::<Place>() / controls.len().max(1) as f64;
    let first = farthest(middle);
    let second = first.and_then(|first| farthest(first.at));
    let two = first.into_iter().chain(second).collect();
    join(net, figures, two, true)
}

/// MORTAR: ties bricks by their common points on all controls, by their weights.
///
/// # Errors
/// [`PlaneError`]; its pictures are bricks.
pub fn mortar(net: &Net, figures: &[Figure]) -> Result<Block, PlaneError> {
    join(net, figures, net.controls.clone(), false)
}

fn shown_points(net: &Net, figures: &[Figure]) -> Vec<bool> {
    let mut shown = vec![false; net.points];
    for (point, _) in figures.iter().flat_map(|figure| &figure.places) {
        shown[*point] = true;
    }
    shown
}

/// The net whose pictures are the figures of bricks, without controls.
fn bricks_as_pictures(net: &Net, figures: &[Figure]) -> Net {
    let measurements = figures.iter().enumerate().flat_map(|(brick, figure)| {
        let places = figure.places.iter();
        places.map(move |(point, at)| Measurement {
            picture: brick,
            point: *point,
            at: *at,
        })
    });
    Net {
        pictures: figures.len(),
        points: net.points,
        measurements: measurements.collect(),
        controls: Vec::new(),
    }
}

fn join(
    net: &Net,
    figures: &[Figure],
    controls: Vec<Control>,
    unshrunk: bool,
) -> Result<Block, PlaneError> {
    let of_bricks = Net {
        controls,
        ..bricks_as_pictures(net, figures)
    };
    let mut solution = solve(&of_bricks)?;
    let shrinkage = Shrinkage::of(&of_bricks, &solution).filter(|_| unshrunk);
    if unshrunk {
        solution = solution.unshrunk(&of_bricks);
    }
    let by_point = of_bricks.by_point();
    let seams = of_bricks.measurements.iter().zip(&solution.deviations);
    let seams = seams.filter(|(measured, _)| by_point.get(measured.point).len() > 1);
    Ok(Block {
        seams: seams
            .map(|(measured, deviation)| (measured.picture, measured.point, *deviation))
            .collect(),
        bricks: solution.pictures,
        places: solution.places,
        redundancy: solution.redundancy,
        shrinkage,
    })
}

/// LOCAL: ties the pictures of every brick again, with the means of its seams as controls, which distributes the seams.
/// A brick with fewer than two points in others is unchanged.
///
/// Returns the similarity from every picture of the net to the block.
///
/// # Errors
/// [`PlaneError`].
pub fn local(net: &Net, figures: &[Figure], block: &Block) -> Result<Vec<Similarity>, PlaneError> {
    let mut pictures = block.pictures(net, figures);
    for (brick, figure) in figures.iter().enumerate() {
        let seams = block.seams.iter().filter(|(of, ..)| *of == brick);
        let Part {
            net: mut part,
            points,
            ..
        } = net.part(&figure.pictures);
        let mut index_of = vec![None; net.points];
        for (index, point) in points.iter().enumerate() {
            index_of[*point] = Some(index);
        }
        part.controls = seams
            .filter_map(|(_, point, _)| {
                Some(Control {
                    point: index_of[*point]?,
                    at: block.places[*point]?,
                    weight: SEAM_WEIGHT,
                })
            })
            .collect();
        if part.controls.len() < 2 {
            continue;
        }
        let solution = solve(&part).map_err(|error| error.of_part(&points, &figure.pictures))?;
        for (picture, similarity) in figure.pictures.iter().zip(solution.pictures) {
            pictures[*picture] = similarity;
        }
    }
    Ok(pictures)
}

impl Block {
    /// The similarity from every picture of the net to the block, through its brick.
    #[must_use]
    pub fn pictures(&self, net: &Net, figures: &[Figure]) -> Vec<Similarity> {
        let mut pictures = vec![Similarity::IDENTITY; net.pictures];
        for (figure, brick) in figures.iter().zip(&self.bricks) {
            for (picture, similarity) in figure.pictures.iter().zip(&figure.similarities) {
                pictures[*picture] = brick.after(similarity);
            }
        }
        pictures
    }
}
