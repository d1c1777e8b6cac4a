//! Mirrored pictures: read from the wrong side of the film, or with an axis reversed.

use std::collections::BTreeMap;

use super::{
    Place,
    controls::fit_similarity,
    net::{Net, PlaneError},
};

/// Squares left by one handedness over those left by the other, below which the handedness is certain.
const CERTAIN: f64 = 0.1;
/// Below this share of the squares of the coordinates, a residual is rounding.
const EXACT: f64 = 1e-18;

/// Finds a picture, or the whole figure, of the wrong handedness.
///
/// Each pair of pictures with three points in common is compared by a similarity and by a mirrored one; where one of
/// them leaves a tenth of the squares of the other, the relative handedness of the pictures is decided. Among connected
/// pictures the minority is mirrored.
///
/// # Errors
/// [`PlaneError::MirroredPicture`].
pub fn find_mirrored(net: &Net) -> Result<(), PlaneError> {
    let hands = hands(net);
    let mut neighbours: Vec<Vec<(usize, bool)>> = vec![Vec::new(); net.pictures];
    for ((one, two), same) in hands {
        neighbours[one].push((two, same));
        neighbours[two].push((one, same));
    }
    let mut hand: Vec<Option<bool>> = vec![None; net.pictures];
    for start in 0..net.pictures {
        if hand[start].is_some() {
            continue;
        }
        hand[start] = Some(true);
        let (mut part, mut next) = (vec![start], 0);
        while let Some(&picture) = part.get(next) {
            next += 1;
            for &(other, same) in &neighbours[picture] {
                if hand[other].is_none() {
                    hand[other] = hand[picture].map(|of| of == same);
                    part.push(other);
                }
            }
        }
        let turned = |picture: &&usize| hand[**picture] == Some(false);
        let others = part.iter().filter(turned).count();
        let wrong = 2 * others > part.len();
        let mirrored = part
            .iter()
            .filter(|picture| hand[**picture] == Some(wrong))
            .min();
        if others > 0
            && let Some(&picture) = mirrored
        {
            return Err(PlaneError::MirroredPicture { picture });
        }
    }
    Ok(())
}

/// Whether pairs of pictures have the same handedness, where that is certain.
fn hands(net: &Net) -> BTreeMap<(usize, usize), bool> {
    let mut shared: BTreeMap<(usize, usize), Vec<(Place, Place)>> = BTreeMap::new();
    for measured in net.by_point().iter() {
        for (index, one) in measured.iter().enumerate() {
            for two in &measured[index + 1..] {
                let (mut one, mut two) = (&net.measurements[*one], &net.measurements[*two]);
                if one.picture > two.picture {
                    std::mem::swap(&mut one, &mut two);
                }
                let pair = shared.entry((one.picture, two.picture)).or_default();
                pair.push((one.at, two.at));
            }
        }
    }
    shared
        .into_iter()
        .filter_map(|(pictures, places)| Some((pictures, same_hand(&places)?)))
        .collect()
}

/// Whether points have the same handedness in two pictures; `None` where fewer than three points, or their spread, do
/// not decide it.
#[must_use]
pub fn same_hand(places: &[(Place, Place)]) -> Option<bool> {
    if places.len() < 3 {
        return None;
    }
    let (from, to): (Vec<Place>, Vec<Place>) = places.iter().copied().unzip();
    let mirrored: Vec<Place> = from.iter().map(Place::conj).collect();
    let left = |from: &[Place]| -> Option<f64> {
        let fitted = fit_similarity(from, &to)?;
        let rests = from.iter().zip(&to);
        Some(
            rests
                .map(|(from, to)| (to - fitted.map(*from)).norm_sqr())
                .sum(),
        )
    };
    let (same, other) = (left(&from)?, left(&mirrored)?);
    let size: f64 = to.iter().map(Place::norm_sqr).sum();
    if same.max(other) <= EXACT * size {
        return None;
    }
    if same < CERTAIN * other {
        Some(true)
    } else if other < CERTAIN * same {
        Some(false)
    } else {
        None
    }
}
