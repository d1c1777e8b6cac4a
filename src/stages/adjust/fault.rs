//! Why a site cannot be adjusted, in the words of its identifiers.

use super::{AdjustImage, CONTRADICTION, PointKind, network::Assembled};
use crate::{
    error::{Fault, Kind},
    geom::{
        bundle::{BundleFault, Part, Unknown},
        pushbroom::Unseen,
    },
};

/// Why a site cannot be adjusted.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum AdjustFault {
    /// No tie point could be intersected.
    #[error("none of {ties} tie points has a ground point; {first}")]
    NoTies {
        /// Tie points.
        ties: usize,
        /// The first of them, and why it has none.
        first: String,
    },
    /// The network as a whole.
    #[error("{0}")]
    Network(BundleFault),
    /// A standard deviation, coordinate or number that is none.
    #[error("{what} is {value}, expected {expected}")]
    Value {
        /// What it is, of which image, point or profile.
        what: String,
        /// The value.
        value: f64,
        /// What it should be.
        expected: &'static str,
    },
    /// Nothing tells unknowns apart.
    #[error("the network is singular: nothing tells apart {0}")]
    Singular(String),
    /// A range names an image that is not there.
    #[error("shot {shot} was fired during image {image}, which is none of the images {known}")]
    UnknownImage {
        /// Identifier of the shot.
        shot: String,
        /// The name.
        image: String,
        /// The names that are known.
        known: String,
    },
    /// Two shots have the same identifier.
    #[error("two shots have the identifier {0}")]
    DuplicateShot(String),
    /// An orientation that sees nothing.
    #[error("image {image}: its orientation sees no ground: {unseen}")]
    Blind {
        /// Identifier of the image.
        image: String,
        /// Why.
        unseen: Unseen,
    },
    /// Initial values that the observations refute.
    #[error(
        "{what} contradicts the rest of the network: standardised residual {standardised:.1}, expected at most {CONTRADICTION}"
    )]
    Contradiction {
        /// The initial value.
        what: String,
        /// Its standardised residual, without sign.
        standardised: f64,
    },
}

impl Fault for AdjustFault {
    fn kind(&self) -> Kind {
        Kind::Input
    }

    fn advice(&self) -> String {
        match self {
            Self::NoTies { .. } => "check that the images overlap and that the tie points are theirs",
            Self::Network(BundleFault::Unsettled { .. }) => "check the tie points and the images' times and kernels: so far apart the observations have no common solution",
            Self::Network(_) => "check the input of the adjustment, and give orientations and footprints finite standard deviations",
            Self::Value { .. } => "correct this value, or leave out what it belongs to",
            Self::Singular(_) => "give these unknowns finite standard deviations, or hold them fixed with 0",
            Self::UnknownImage { .. } => "give shots the identifiers of the images",
            Self::DuplicateShot(_) => "leave out the second file, or number the shots anew",
            Self::Blind { .. } => "check the orientation samples of the image",
            Self::Contradiction { .. } => "check the datum, the clock and the units of this value, or raise its standard deviation",
        }
        .to_owned()
    }
}

/// The fault with identifiers in place of indices.
pub(super) fn in_words<M>(
    fault: BundleFault,
    images: &[AdjustImage<M>],
    assembled: &Assembled<&M>,
) -> AdjustFault {
    match fault {
        BundleFault::Singular { unknowns } => {
            let words: Vec<String> = unknowns
                .iter()
                .map(|unknown| unknown_in_words(*unknown, images, &assembled.profiles))
                .collect();
            AdjustFault::Singular(words.join(", "))
        }
        BundleFault::Value {
            part,
            what,
            value,
            expected,
        } => AdjustFault::Value {
            what: format!("the {what} of {}", part_in_words(part, images, assembled)),
            value,
            expected,
        },
        _ => AdjustFault::Network(fault),
    }
}

/// A part of the network by its identifiers.
fn part_in_words<M>(part: Part, images: &[AdjustImage<M>], assembled: &Assembled<&M>) -> String {
    let image = |index: usize| format!("image {}", images[index].stereo.id);
    let point = |index: usize| {
        let kind = match assembled.kind(index) {
            PointKind::Shot => "shot",
            PointKind::Tie => "tie point",
        };
        format!("{kind} {}", assembled.points[index])
    };
    match part {
        Part::Image(index) => image(index),
        Part::Point(index) => point(index),
        Part::View(index) => {
            let view = &assembled.network.views[index];
            format!("{} in {}", point(view.point), image(view.image))
        }
        Part::Range(index) => {
            let range = &assembled.network.ranges[index];
            format!("the range of {}", point(range.point))
        }
        Part::Profile(index) => format!("profile {}", assembled.profiles[index]),
    }
}

/// An unknown as a surveyor names it.
pub(super) fn unknown_in_words<M>(
    unknown: Unknown,
    images: &[AdjustImage<M>],
    profiles: &[String],
) -> String {
    let owner = match unknown {
        Unknown::Orientation { image, .. } | Unknown::TimeBias { image } => {
            format!("image {}", images[image].stereo.id)
        }
        Unknown::RangeBias { profile } => format!("profile {}", profiles[profile]),
    };
    format!("the {} of {owner}", unknown.quantity())
}
