//! Measured tie points: noise and blunders.

use nalgebra::Vector3;

use super::noise::{TieNoise, Waves};
use crate::{
    random::Random,
    truth::{BlunderTruth, TieTruth},
};
use areograph_base::ties::{TieMeasure, TiePoint};

/// One of this many tie points is a blunder, the first in the middle of the first group.
const BLUNDER_EVERY: usize = 20;
/// Shortest and longest blunder, in any direction.
pub(super) const BLUNDER_PX: [f64; 2] = [20.0, 100.0];

/// A ground point and its image coordinates in the images that show it, two or more, each with the index of its image.
pub(crate) struct Tie {
    pub(crate) ground_m: Vector3<f64>,
    pub(crate) measures: Vec<(usize, TieMeasure<String>)>,
}

/// Adds noise to all measurements in a number of images, and blunders to a few.
pub(crate) fn spoil(
    ties: Vec<Tie>,
    images: usize,
    noise: TieNoise,
    random: &mut Random,
) -> (Vec<TiePoint<String>>, Vec<TieTruth>) {
    // Drawn apart, so that the other draws do not depend on it.
    let mut of_waves = random.clone();
    let waves = (0..images).map(|_| [(); 2].map(|()| Waves::draw(&mut of_waves)));
    let waves: Vec<[Waves; 2]> = waves.collect();
    let own_px = noise.sigma_px * (1.0 - noise.common).sqrt();
    let common_px = noise.sigma_px * noise.common.sqrt();
    let spoilt = ties.into_iter().enumerate().map(|(index, tie)| {
        let id = format!("tie-{:03}", index + 1);
        let noisy = tie.measures.into_iter().map(|(image, mut measure)| {
            let common = waves[image]
                .each_ref()
                .map(|of| common_px * of.at(measure.line, measure.sample));
            measure.line += own_px * random.normal() + common[0];
            measure.sample += own_px * random.normal() + common[1];
            measure
        });
        let mut measures: Vec<TieMeasure<String>> = noisy.collect();
        let blunder =
            (index % BLUNDER_EVERY == BLUNDER_EVERY / 2).then(|| blunder(&mut measures, random));
        let truth = TieTruth {
            id: id.clone(),
            ground_iau2000_m: tie.ground_m.into(),
            blunder,
        };
        let known = None;
        (
            TiePoint {
                id,
                known,
                measures,
            },
            truth,
        )
    });
    spoilt.unzip()
}

/// Displaces one of the measurements by a blunder.
fn blunder(measures: &mut [TieMeasure<String>], random: &mut Random) -> BlunderTruth {
    let last_first = random.between(0.0, 1.0) * measures.len() as f64;
    let image = measures.len().saturating_sub(1 + whole(last_first));
    let [least_px, most_px] = BLUNDER_PX;
    let length_px = random.between(least_px, most_px);
    let (sin, cos) = random.between(0.0, std::f64::consts::TAU).sin_cos();
    let [line_error, sample_error] = [length_px * cos, length_px * sin];
    let measure = &mut measures[image];
    measure.line += line_error;
    measure.sample += sample_error;
    BlunderTruth {
        image: measure.image.clone(),
        line_error,
        sample_error,
    }
}

/// Whole part of a small positive number.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "below the number of images"
)]
fn whole(number: f64) -> usize {
    number as usize
}
