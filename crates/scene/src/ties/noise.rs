//! Noise of tie points, which neighbours share in part.

use crate::{error_sources::SceneErrors, random::Random};

/// Noise of tie points.
#[derive(Debug, Clone, Copy)]
pub(crate) struct TieNoise {
    /// Standard deviation, lines and samples.
    pub(super) sigma_px: f64,
    /// Share of its variance that neighbours have in common.
    pub(super) common: f64,
}

impl TieNoise {
    /// Noise of a mission.
    pub(crate) fn of(errors: &SceneErrors) -> Self {
        Self {
            sigma_px: errors.tie_noise_factor * errors.tie_noise_px,
            common: errors.tie_noise_common,
        }
    }

    /// The same with another noise, as site files state it, pixels.
    pub(crate) fn stated_as(self, errors: &SceneErrors, stated_px: f64) -> Self {
        Self {
            sigma_px: errors.tie_noise_factor * stated_px,
            ..self
        }
    }
}

/// Errors that neighbouring tie points have in common: waves over an image, of standard deviation 1.
pub(super) struct Waves(Vec<[f64; 3]>);

impl Waves {
    const COUNT: u32 = 12;
    /// Shortest and longest wave, pixels.
    const LENGTH_PX: [f64; 2] = [300.0, 3_000.0];

    pub(super) fn draw(random: &mut Random) -> Self {
        let waves = (0..Self::COUNT).map(|_| {
            let [shortest_px, longest_px] = Self::LENGTH_PX;
            let number = std::f64::consts::TAU / random.between_log(shortest_px, longest_px);
            let (sin, cos) = random.between(0.0, std::f64::consts::TAU).sin_cos();
            let phase = random.between(0.0, std::f64::consts::TAU);
            [number * sin, number * cos, phase]
        });
        Self(waves.collect())
    }

    pub(super) fn at(&self, line: f64, sample: f64) -> f64 {
        let waves = self.0.iter();
        let sum: f64 = waves
            .map(|[by_line, by_sample, phase]| (by_line * line + by_sample * sample + phase).cos())
            .sum();
        sum * (2.0 / f64::from(Self::COUNT)).sqrt()
    }
}
