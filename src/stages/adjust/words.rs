//! Parts, unknowns and faults of a network by the identifiers of the site.

use super::{
    fault::AdjustFault,
    input::AdjustImage,
    network::{Assembled, Named},
    points::PointKind,
};
use crate::geom::bundle::{BundleFault, Part, Unknown};

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
        format!("{kind} {}", assembled.points[index].name)
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
        Part::Profile(index) => format!("profile {}", assembled.profiles[index].name),
    }
}

/// An unknown as a surveyor names it.
pub(super) fn unknown_in_words<M>(
    unknown: Unknown,
    images: &[AdjustImage<M>],
    profiles: &[Named],
) -> String {
    let owner = match unknown {
        Unknown::Orientation { image, .. } | Unknown::TimeBias { image } => {
            format!("image {}", images[image].stereo.id)
        }
        Unknown::RangeBias { profile } => format!("profile {}", profiles[profile].name),
    };
    format!("the {} of {owner}", unknown.quantity())
}
