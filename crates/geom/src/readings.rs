//! Causes of the along-track disagreement of image pairs, compared over many pairs.
//!
//! The images of a pair show the ground displaced along the track. Either every image has an error of its own, by its line times
//! or its attitude; or attitudes were read at times with one offset, the same for all images of a mission: images that follow
//! nadir are displaced by hundreds of metres per second of offset, inertially held images are not. One pair cannot distinguish
//! these causes; over many pairs, independent errors scatter about 0, and one offset displaces all pairs in proportion to their
//! sensitivity. Four hypotheses are compared: large errors of single images or small ones, each with and without an offset.
//! Large ones have the size of line times of 45 ms, which attitudes of 0.4 mrad have as well; small ones are attitudes of 0.1 mrad.
//!
//! # Source
//! Bayes factors: Kass and Raftery 1995, Journal of the American Statistical Association 90, 773–795. The hypothesis of one
//! offset, and the sizes of errors by default, follow from Shan et al. 2005, Table 5; see `AdjustmentConfig`.

use std::collections::BTreeMap;

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
#[cfg(feature = "schema")]
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

#[cfg(feature = "schema")]
use areograph_base::schema::all_positive;

/// Odds that decide between hypotheses that are equally likely a priori: 150 to 1 is very strong evidence (Kass and Raftery
/// 1995, section 3.2). A wrong decision displaces products by 100 m.
pub const DECISIVE_ODDS: f64 = 150.0;
/// Standard deviation of a displacement by errors that the tie points of a pair share, metres: jitter, and sensitivities that
/// are those of one tie point. Without it, the three pairs of three images would contradict each other.
const SHARED_M: f64 = 10.0;
/// Factors of the assumed sizes of line-time and rotation errors, equally likely a priori.
const FACTORS: [f64; 3] = [
    std::f64::consts::FRAC_1_SQRT_2,
    1.0,
    std::f64::consts::SQRT_2,
];

/// Displacement of the ground along the track, first minus second image of a pair, and its dependence on errors of both
/// images.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(JsonSchema))]
pub struct AlongTrack {
    /// Measured displacement, metres: the mean over the tie points.
    pub apart_m: f64,
    /// Standard deviation of `apart_m`, from the scatter of the tie points, metres.
    #[cfg_attr(feature = "schema", schemars(range(min = 0.0)))]
    pub sigma_m: f64,
    /// Distance of the ground from each camera, metres: displacement per radian of a rotation about the axis across the track.
    #[cfg_attr(feature = "schema", schemars(transform = all_positive))]
    pub range_m: [f64; 2],
    /// Displacement due to a delay of the lines of each image, metres per second.
    #[cfg_attr(feature = "schema", schemars(transform = all_positive))]
    pub line_time_m_s: [f64; 2],
    /// Displacement due to an offset of the attitude clock of both images, metres per second.
    pub clock_m_s: f64,
}

/// The disagreement of a pair of images along the track.
#[derive(Debug, Clone, PartialEq)]
pub struct PairDisagreement {
    /// Identifiers of the images: errors of an image are common to its pairs.
    pub images: [String; 2],
    /// The displacement.
    pub along_track: AlongTrack,
}

/// A priori standard deviations.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReadingSigmas {
    /// Delay of the lines of an image, seconds.
    pub line_time_s: f64,
    /// Rotation of an image by other attitude errors, radians.
    pub rotation_rad: f64,
    /// Offset of the attitude clock, seconds.
    pub clock_s: f64,
}

/// A cause of the disagreement of image pairs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Cause {
    /// Independent errors of single images.
    SingleImages,
    /// One offset of the attitude clock.
    AttitudeClock,
}

/// Causes, compared.
#[derive(Debug, Clone, PartialEq)]
pub struct CausesCompared {
    /// Natural logarithms of the probabilities of the disagreements: large errors of single images, the same with an offset, small
    /// errors, the same with an offset; without a common constant.
    pub log_likelihoods: [f64; 4],
    /// Offset of the attitude clock with small errors of single images, seconds.
    pub clock_s: f64,
    /// Standard deviation of `clock_s`.
    pub clock_sigma_s: f64,
    /// Disagreement of each pair minus its expected value by this offset, metres.
    pub left_m: Vec<f64>,
}

impl CausesCompared {
    /// Natural logarithm of the odds of one offset of the attitude clock, with small errors of single images, against the more
    /// probable hypothesis without an offset.
    #[must_use]
    pub fn log_odds_of_clock(&self) -> f64 {
        let [large, _, small, small_with] = self.log_likelihoods;
        small_with - large.max(small)
    }

    /// Natural logarithm of the odds of large errors of single images against the more probable hypothesis with small ones.
    #[must_use]
    pub fn log_odds_of_images(&self) -> f64 {
        let [large, _, small, small_with] = self.log_likelihoods;
        large - small.max(small_with)
    }

    /// Whether an offset with large errors of single images is more probable than either cause alone.
    #[must_use]
    pub fn are_both(&self) -> bool {
        let [large, both, _, small_with] = self.log_likelihoods;
        both > large.max(small_with)
    }

    /// The cause that has decisive odds; `None` where neither has, or where both together are more probable.
    #[must_use]
    pub fn supported(&self) -> Option<Cause> {
        if self.are_both() {
            None
        } else if self.log_odds_of_clock() >= DECISIVE_ODDS.ln() {
            Some(Cause::AttitudeClock)
        } else if self.log_odds_of_images() >= DECISIVE_ODDS.ln() {
            Some(Cause::SingleImages)
        } else {
            None
        }
    }
}

/// Compares the causes over `pairs`.
///
/// Each hypothesis is a mean over sizes of the errors, and includes the measurements of tie points. `None` without pairs, or where a
/// number is not finite.
#[must_use]
pub fn compare(pairs: &[PairDisagreement], sigmas: &ReadingSigmas) -> Option<CausesCompared> {
    if pairs.is_empty() {
        return None;
    }
    let of_pairs = |of: fn(&AlongTrack) -> f64| {
        DVector::from_iterator(pairs.len(), pairs.iter().map(|pair| of(&pair.along_track)))
    };
    let apart_m = of_pairs(|pair| pair.apart_m);
    let by_clock_m_s = of_pairs(|pair| pair.clock_m_s);
    let by_rotation = shared(pairs, |pair| pair.range_m);
    let by_line_time = shared(pairs, |pair| pair.line_time_m_s);
    let measured_m2 =
        DMatrix::from_diagonal(&of_pairs(|pair| pair.sigma_m.powi(2) + SHARED_M.powi(2)));
    let (mut large, mut large_with) = (Vec::new(), Vec::new());
    let (mut small, mut clocks) = (Vec::new(), Vec::new());
    for rotations in FACTORS {
        let rotation_rad = rotations * sigmas.rotation_rad;
        let small_m2 = &measured_m2 + &by_rotation * rotation_rad.powi(2);
        for line_times in FACTORS {
            let line_time_s = line_times * sigmas.line_time_s;
            let large_m2 = &small_m2 + &by_line_time * line_time_s.powi(2);
            large.push(log_density(&Cholesky::new(large_m2.clone())?, &apart_m));
            let clock = Clock::of(large_m2, &apart_m, &by_clock_m_s, sigmas.clock_s)?;
            large_with.push(clock.log_density);
        }
        small.push(log_density(&Cholesky::new(small_m2.clone())?, &apart_m));
        clocks.push(Clock::of(
            small_m2,
            &apart_m,
            &by_clock_m_s,
            sigmas.clock_s,
        )?);
    }
    let small_with: Vec<f64> = clocks.iter().map(|of| of.log_density).collect();
    let log_likelihoods = [&large, &large_with, &small, &small_with].map(|of| log_mean(of));
    // The mean and the variance of a mixture.
    let shares = small_with.iter().map(|of| (of - log_likelihoods[3]).exp());
    let mut moments = [0.0; 2];
    for (share, of) in shares.zip(&clocks) {
        let share = share / clocks.len() as f64;
        moments[0] += share * of.offset_s;
        moments[1] += share * (of.variance_s2 + of.offset_s.powi(2));
    }
    let [clock_s, square_s2] = moments;
    let compared = CausesCompared {
        log_likelihoods,
        clock_s,
        clock_sigma_s: (square_s2 - clock_s.powi(2)).sqrt(),
        left_m: (apart_m - by_clock_m_s * clock_s).iter().copied().collect(),
    };
    let are_finite = log_likelihoods.iter().all(|of| of.is_finite());
    (are_finite && compared.clock_sigma_s.is_finite()).then_some(compared)
}

/// One offset, with errors of single images of one size.
struct Clock {
    log_density: f64,
    offset_s: f64,
    variance_s2: f64,
}

impl Clock {
    fn of(
        own_m2: DMatrix<f64>,
        apart_m: &DVector<f64>,
        by_clock_m_s: &DVector<f64>,
        sigma_s: f64,
    ) -> Option<Self> {
        let common_m2 = by_clock_m_s * by_clock_m_s.transpose() * sigma_s.powi(2);
        let whole = Cholesky::new(&own_m2 + common_m2)?;
        let weighted = Cholesky::new(own_m2)?.solve(by_clock_m_s);
        let variance_s2 = (sigma_s.powi(-2) + weighted.dot(by_clock_m_s)).recip();
        Some(Self {
            log_density: log_density(&whole, apart_m),
            offset_s: variance_s2 * weighted.dot(apart_m),
            variance_s2,
        })
    }
}

/// Covariances of the disagreements by errors of single images of size 1, which have these effects.
fn shared(pairs: &[PairDisagreement], effects: impl Fn(&AlongTrack) -> [f64; 2]) -> DMatrix<f64> {
    let mut column_of: BTreeMap<&str, usize> = BTreeMap::new();
    for image in pairs.iter().flat_map(|pair| &pair.images) {
        let next = column_of.len();
        column_of.entry(image).or_insert(next);
    }
    let mut design = DMatrix::<f64>::zeros(pairs.len(), column_of.len());
    for (row, pair) in pairs.iter().enumerate() {
        for ((image, effect), sign) in pair
            .images
            .iter()
            .zip(effects(&pair.along_track))
            .zip([1.0, -1.0])
        {
            design[(row, column_of[image.as_str()])] += sign * effect;
        }
    }
    &design * design.transpose()
}

/// Logarithm of the normal density of `values` with mean 0, without its constant.
fn log_density(covariance: &Cholesky<f64, Dyn>, values: &DVector<f64>) -> f64 {
    let log_determinant: f64 = covariance
        .l_dirty()
        .diagonal()
        .iter()
        .map(|of| of.ln())
        .sum();
    -log_determinant - 0.5 * values.dot(&covariance.solve(values))
}

/// Logarithm of the mean of exponentials.
fn log_mean(logarithms: &[f64]) -> f64 {
    let largest = logarithms.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let sum: f64 = logarithms.iter().map(|of| (of - largest).exp()).sum();
    largest + (sum / logarithms.len() as f64).ln()
}

#[cfg(test)]
mod tests;
