//! Mirrored pictures: read from the wrong side of the film, or with an axis reversed.

use std::collections::BTreeMap;

use super::{
    Place,
    controls::fit_similarity,
    net::{Net, PlaneError},
};

/// Logarithm of a likelihood ratio above which a handedness is certain: chance exceeds it once in a thousand.
///
/// Of three points, one of them wrong, or all nearly on a line, the mirrored fit is the better one by a factor of ten in
/// every tenth case.
const CERTAIN: f64 = 7.0;
/// Below this share of the squares of the coordinates, a residual is rounding.
const EXACT: f64 = 1e-18;

/// Finds a picture, or the complete figure, of the wrong handedness.
///
/// Each pair of pictures with three points in common is compared by a similarity and by a mirrored one. The logarithm
/// of the ratio of their likelihoods is the evidence of the pair. The adopted handedness of all pictures is the one
/// that agrees best with the evidence of all pairs; among connected pictures the minority is mirrored, where the
/// evidence against it is certain. A pair with a wrong point is thus outvoted by the others.
///
/// # Errors
/// [`PlaneError::MirroredPicture`].
pub fn find_mirrored(net: &Net) -> Result<(), PlaneError> {
    let evidence = evidence_of_pairs(net);
    let mut hands = Hands::spanning(net.pictures, &evidence);
    hands.improve(&evidence);
    for part in hands.parts() {
        let turned = part.iter().filter(|picture| hands.turned[**picture]);
        let wrong = 2 * turned.count() <= part.len();
        let is_wrong = |picture: &usize| hands.turned[*picture] == wrong;
        // Gain of the labels over a part of one handedness.
        let against = evidence.iter().filter(|((one, two), _)| {
            hands.part[*one] == hands.part[part[0]] && hands.turned[*one] != hands.turned[*two]
        });
        let gain: f64 = against.map(|(_, evidence)| -evidence).sum();
        if let Some(&picture) = part.iter().filter(|picture| is_wrong(picture)).min()
            && gain > CERTAIN
        {
            return Err(PlaneError::MirroredPicture { picture });
        }
    }
    Ok(())
}

/// Evidence of pairs of pictures that they have the same handedness; negative where they have not.
fn evidence_of_pairs(net: &Net) -> BTreeMap<(usize, usize), f64> {
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
        .filter_map(|(pictures, places)| Some((pictures, evidence(&places)?)))
        .collect()
}

/// Whether each picture is turned against the first of its part.
struct Hands {
    turned: Vec<bool>,
    part: Vec<usize>,
}

impl Hands {
    /// The handedness along the pairs of most evidence that connect the pictures.
    fn spanning(pictures: usize, evidence: &BTreeMap<(usize, usize), f64>) -> Self {
        let mut pairs: Vec<(&(usize, usize), &f64)> = evidence.iter().collect();
        pairs.sort_by(|(_, one), (_, two)| two.abs().total_cmp(&one.abs()));
        let mut hands = Self {
            turned: vec![false; pictures],
            part: (0..pictures).collect(),
        };
        for ((one, two), evidence) in pairs {
            let [into, from] = [hands.part[*one], hands.part[*two]];
            if into == from {
                continue;
            }
            let differ = (*evidence < 0.0) != (hands.turned[*one] != hands.turned[*two]);
            for picture in 0..pictures {
                if hands.part[picture] == from {
                    hands.part[picture] = into;
                    hands.turned[picture] ^= differ;
                }
            }
        }
        hands
    }

    /// Turns single pictures as long as the pairs agree better.
    fn improve(&mut self, evidence: &BTreeMap<(usize, usize), f64>) {
        // Each turn gains; a bound for rounding.
        for _ in 0..self.turned.len() {
            let mut agreement = vec![0.0; self.turned.len()];
            for ((one, two), evidence) in evidence {
                let differ = self.turned[*one] != self.turned[*two];
                let agrees = if differ { -evidence } else { *evidence };
                agreement[*one] += agrees;
                agreement[*two] += agrees;
            }
            let worst = (0..agreement.len()).min_by(|a, b| agreement[*a].total_cmp(&agreement[*b]));
            let Some(worst) = worst.filter(|worst| agreement[*worst] < 0.0) else {
                return;
            };
            self.turned[worst] ^= true;
        }
    }

    /// The connected pictures, each part ascending.
    fn parts(&self) -> impl Iterator<Item = Vec<usize>> {
        let mut parts: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        for (picture, part) in self.part.iter().enumerate() {
            parts.entry(*part).or_default().push(picture);
        }
        parts.into_values()
    }
}

/// Whether points have the same handedness in two pictures; `None` where fewer than three points, or their spread, do
/// not decide it.
#[must_use]
pub fn same_hand(places: &[(Place, Place)]) -> Option<bool> {
    let evidence = evidence(places)?;
    (evidence.abs() > CERTAIN).then_some(evidence > 0.0)
}

/// Logarithm of the likelihood of points under a similarity over that under a mirrored one, for normal errors of an
/// unknown standard deviation: `(n − 2) ln(squares mirrored / squares)`. `None` for fewer than three points.
fn evidence(places: &[(Place, Place)]) -> Option<f64> {
    if places.len() < 3 {
        return None;
    }
    let (from, to): (Vec<Place>, Vec<Place>) = places.iter().copied().unzip();
    let mirrored: Vec<Place> = from.iter().map(Place::conj).collect();
    let size: f64 = to.iter().map(Place::norm_sqr).sum();
    let left = |from: &[Place]| -> Option<f64> {
        let fitted = fit_similarity(from, &to)?;
        let rests = from.iter().zip(&to);
        let squares: f64 = rests
            .map(|(from, to)| (to - fitted.map(*from)).norm_sqr())
            .sum();
        Some(squares.max(EXACT * size))
    };
    let (same, other) = (left(&from)?, left(&mirrored)?);
    Some((places.len() - 2) as f64 * (other / same).ln())
}
