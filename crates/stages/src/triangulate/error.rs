//! Reasons why a net has no solution, with the names of its pictures and points.

use areograph_base::error::Cause;
use areograph_geom::plane::{FilmError, PlaneError};

/// A net without a solution.
#[derive(Debug, Clone, PartialEq, thiserror::Error, Cause)]
#[cause(Input)]
pub enum NetError {
    /// The tables hold no measurement.
    #[error("the tables contain no measurement")]
    #[cause("give tables with measurements in measurements.files")]
    NoMeasurement,
    /// Fewer than two controls that a picture shows.
    #[error("controls measured in pictures: {found}; expected two or more")]
    #[cause("give at least two controls with the names of measured points")]
    TooFewControls {
        /// Number found.
        found: usize,
    },
    /// A picture or brick, with the parts tied to it, can turn, shrink or move.
    #[error(
        "UnderconnectedPicture: {what} {name} has {ties} ties and controls; expected two or more at different \
         positions, in a part of the net with two controls"
    )]
    #[cause("measure more points in common with its neighbours, or omit its measurements")]
    Underconnected {
        /// `picture` or `brick`.
        what: &'static str,
        /// Its name.
        name: String,
        /// Its points that are ties or controls, or those that tie the parts to the rest of the net.
        ties: usize,
    },
    /// Two points of a picture have one place.
    #[error("points {first} and {second} have the same position in picture {picture}")]
    #[cause(
        "points at the same position are one point: give both the same name, or correct one of them"
    )]
    EqualPoints {
        /// The picture.
        picture: String,
        /// One point.
        first: String,
        /// The other.
        second: String,
    },
    /// Two controls have one place.
    #[error("controls {first} and {second} have the same position on the map")]
    #[cause(like = EqualPoints)]
    EqualControls {
        /// One point.
        first: String,
        /// The other.
        second: String,
    },
    /// A picture is a mirror image.
    #[error("picture {picture} is mirrored relative to its neighbours")]
    #[cause(
        "change the sign of one coordinate of this picture, which may have been measured from the back of the film"
    )]
    MirroredPicture {
        /// The picture.
        picture: String,
    },
    /// All pictures are mirror images.
    #[error("the pictures are mirrored relative to the controls")]
    #[cause("set measurements.y_axis to the direction of y in the pictures")]
    MirroredFigure,
    /// A picture differs in size from its table.
    #[error(
        "WrongUnits: a unit of picture {picture} is {found_m:.4e} m on the ground; expected {expected_m:.4e} m within a factor of 2"
    )]
    #[cause("check metres_per_unit of the picture, and the units of controls and measurements")]
    WrongUnits {
        /// The picture.
        picture: String,
        /// Adjusted size of a unit on the ground, metres.
        found_m: f64,
        /// Size by its table, metres.
        expected_m: f64,
    },
    /// A control beyond the map.
    #[error(
        "WrongUnits: control {point} is {x_m:.4e} m east and {y_m:.4e} m north; the map extends to {limit_m:.4e} m"
    )]
    #[cause("check the unit in the column name, x_m or x_km, and the map of the configuration")]
    BeyondTheMap {
        /// The point.
        point: String,
        /// East, metres.
        x_m: f64,
        /// North, metres.
        y_m: f64,
        /// Reach of the map, metres.
        limit_m: f64,
    },
    /// A control outside the area of the projection.
    #[error("control {point} lies outside the area of the projection")]
    #[cause("choose another projection in the table [map]")]
    NotOnTheMap {
        /// The point.
        point: String,
    },
    /// A picture without ticks, in a net whose film is corrected.
    #[error(
        "picture {picture} has no ticks, and film.files corrects the other pictures; expected ticks of every picture"
    )]
    #[cause(
        "give the four corner ticks of the picture; for coordinates without distortion, known_x and known_y are x and y"
    )]
    NoTicks {
        /// The picture.
        picture: String,
    },
    /// Ticks that give no correction.
    #[error("the film of picture {picture}: {problem}")]
    #[cause(
        "give each of the four corner ticks of the picture once, and either none or all four of the mid-edge ticks"
    )]
    Film {
        /// The picture.
        picture: String,
        /// The problem.
        problem: String,
    },
}

/// Gives failures of the solver their names.
pub(super) struct Names<'a> {
    pub(super) pictures: &'a [String],
    pub(super) points: &'a [String],
}

impl Names<'_> {
    /// The failure with the names of the net; pictures are called `what`.
    pub(super) fn of(&self, error: PlaneError, what: &'static str) -> NetError {
        let picture = |index: usize| self.pictures[index].clone();
        let point = |index: usize| self.points[index].clone();
        match error {
            PlaneError::TooFewControls { found } => NetError::TooFewControls { found },
            PlaneError::UnderconnectedPicture { picture: at, ties } => NetError::Underconnected {
                what,
                name: picture(at),
                ties,
            },
            PlaneError::EqualPoints {
                picture: at,
                first,
                second,
            } => NetError::EqualPoints {
                picture: picture(at),
                first: point(first),
                second: point(second),
            },
            PlaneError::EqualControls { first, second } => NetError::EqualControls {
                first: point(first),
                second: point(second),
            },
            PlaneError::MirroredPicture { picture: at } => NetError::MirroredPicture {
                picture: picture(at),
            },
            PlaneError::MirroredFigure => NetError::MirroredFigure,
        }
    }
}

/// A film that gives no correction.
pub(super) fn film(picture: &str, problem: FilmError) -> NetError {
    NetError::Film {
        picture: picture.to_owned(),
        problem: problem.to_string(),
    }
}
