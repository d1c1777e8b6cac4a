//! Measurements and controls: positions of points in pictures, and points whose map coordinates are known.

use super::Place;

/// A point measured in a picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measurement {
    /// Index of the picture.
    pub picture: usize,
    /// Index of the point.
    pub point: usize,
    /// Position, in the picture's own units.
    pub at: Place,
}

/// A point whose map coordinates are given.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Control {
    /// Index of the point.
    pub point: usize,
    /// Position, in map units.
    pub at: Place,
    /// Weight against a tie, whose weight is 1: the square of (standard deviation of an image of a tie on the map ÷
    /// standard deviation of the control).
    pub weight: f64,
}

/// Pictures, points and their measurements.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Net {
    /// Number of pictures.
    pub pictures: usize,
    /// Number of points.
    pub points: usize,
    /// Points in pictures.
    pub measurements: Vec<Measurement>,
    /// Points on the map.
    pub controls: Vec<Control>,
}

/// Reasons why a net has no solution. Pictures and points are indices.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum PlaneError {
    /// Fewer than two controls that a picture shows.
    #[error("controls on pictures: {found}; expected two or more")]
    TooFewControls {
        /// Number of such controls.
        found: usize,
    },
    /// A picture, and those tied to it only, can rotate, shrink or move.
    #[error(
        "picture {picture} is tied to the net by {ties} points; expected two or more distinct points, in a part of the \
         net with controls"
    )]
    UnderconnectedPicture {
        /// The picture.
        picture: usize,
        /// Its points that are ties or controls; of a part that hangs on few points, those that the part shares with the
        /// rest of the net and with the controls.
        ties: usize,
    },
    /// Two points of a picture coincide.
    #[error("points {first} and {second} have the same position in picture {picture}")]
    EqualPoints {
        /// The picture.
        picture: usize,
        /// One point.
        first: usize,
        /// The other.
        second: usize,
    },
    /// Two controls coincide on the map.
    #[error("controls {first} and {second} have the same position on the map")]
    EqualControls {
        /// One point.
        first: usize,
        /// The other.
        second: usize,
    },
    /// A picture has the opposite handedness to its neighbours.
    #[error("picture {picture} is mirrored relative to its neighbours")]
    MirroredPicture {
        /// The picture.
        picture: usize,
    },
    /// All pictures have the opposite handedness to the map.
    #[error("the pictures are mirrored relative to the controls")]
    MirroredFigure,
}

impl Net {
    /// The net with some of its measurements, and their indices in this one. Pictures and points keep theirs.
    #[must_use]
    pub fn kept(&self, keep: impl Fn(usize) -> bool) -> (Self, Vec<usize>) {
        let indices: Vec<usize> = (0..self.measurements.len())
            .filter(|at| keep(*at))
            .collect();
        let measurements = indices.iter().map(|at| self.measurements[*at]).collect();
        let net = Self {
            measurements,
            controls: self.controls.clone(),
            ..*self
        };
        (net, indices)
    }

    /// Measurements of every point, as indices.
    pub(super) fn by_point(&self) -> Groups {
        Groups::of(
            self.points,
            self.measurements.iter().map(|measured| measured.point),
        )
    }

    /// Measurements in every picture, as indices.
    pub(super) fn by_picture(&self) -> Groups {
        Groups::of(
            self.pictures,
            self.measurements.iter().map(|measured| measured.picture),
        )
    }

    /// The control of every point.
    pub(super) fn control_of(&self) -> Vec<Option<usize>> {
        let mut of = vec![None; self.points];
        for (index, control) in self.controls.iter().enumerate() {
            of[control.point] = Some(index);
        }
        of
    }

    /// The net of these pictures only, with the indices of its pictures, points and measurements in this one.
    pub(super) fn part(&self, pictures: &[usize]) -> Part {
        let mut place = vec![None; self.pictures];
        for (index, picture) in pictures.iter().enumerate() {
            place[*picture] = Some(index);
        }
        let mut point_of = vec![None; self.points];
        let (mut points, mut from, mut measurements) = (Vec::new(), Vec::new(), Vec::new());
        for (index, measured) in self.measurements.iter().enumerate() {
            let Some(picture) = place[measured.picture] else {
                continue;
            };
            let point = *point_of[measured.point].get_or_insert_with(|| {
                points.push(measured.point);
                points.len() - 1
            });
            from.push(index);
            measurements.push(Measurement {
                picture,
                point,
                at: measured.at,
            });
        }
        Part {
            net: Self {
                pictures: pictures.len(),
                points: points.len(),
                measurements,
                controls: Vec::new(),
            },
            points,
            measurements: from,
        }
    }
}

/// A part of a net.
pub(super) struct Part {
    pub(super) net: Net,
    /// Its points in the complete net.
    pub(super) points: Vec<usize>,
    /// Its measurements in the complete net.
    pub(super) measurements: Vec<usize>,
}

/// Indices in groups, each in ascending order.
pub(super) struct Groups {
    starts: Vec<usize>,
    members: Vec<usize>,
}

impl Groups {
    fn of(groups: usize, group_of: impl Iterator<Item = usize> + Clone) -> Self {
        let mut starts = vec![0; groups + 1];
        for group in group_of.clone() {
            starts[group + 1] += 1;
        }
        for group in 0..groups {
            starts[group + 1] += starts[group];
        }
        let mut next = starts.clone();
        let mut members = vec![0; starts[groups]];
        for (index, group) in group_of.enumerate() {
            members[next[group]] = index;
            next[group] += 1;
        }
        Self { starts, members }
    }

    pub(super) fn get(&self, group: usize) -> &[usize] {
        &self.members[self.starts[group]..self.starts[group + 1]]
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = &[usize]> {
        (0..self.starts.len() - 1).map(|group| self.get(group))
    }
}
