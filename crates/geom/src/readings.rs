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
use serde::{Deserialize, Serialize};

/// Odds that decide between two readings that are equally likely a priori: 150 to 1 is very strong evidence (Kass and Raftery
/// 1995, section 3.2). A wrong reading displaces products by 100 m.
pub const DECISIVE_ODDS: f64 = 150.0;
/// Standard deviation of the displacement by errors that the tie points of a pair share, metres: jitter, and sensitivities of
/// the middle of the images.
const SHARED_M: f64 = 10.0;
/// Factors of the assumed sizes of line-time and rotation errors, equally likely a priori.
const FACTORS: [f64; 3] = [
    std::f64::consts::FRAC_1_SQRT_2,
    1.0,
    std::f64::consts::SQRT_2,
];

/// The disagreement of a pair of images along the track.
#[derive(Debug, Clone, PartialEq)]
pub struct PairDisagreement {
    /// Identifiers of the images: errors of an image are common to its pairs.
    pub images: [String; 2],
    /// Displacement of the ground in the first image minus displacement in the second, metres.
    pub apart_m: f64,
    /// Standard deviation of this by the measurements of tie points, metres.
    pub sigma_m: f64,
    /// Displacement in each image by a rotation about the axis across the track, metres per radian: its range.
    pub range_m: [f64; 2],
    /// Displacement in each image by a delay of its lines, metres per second.
    pub line_time_m_s: [f64; 2],
    /// Change of `apart_m` with the offset of the attitude clock, metres per second.
    pub clock_m_s: f64,
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

    /// The cause that has decisive odds; `None` where neither has, or where both together are more probable.
    #[must_use]
    pub fn supported(&self) -> Option<Cause> {
        let [large, both, _, small_with] = self.log_likelihoods;
        if self.log_odds_of_clock() >= DECISIVE_ODDS.ln() && small_with >= both {
            Some(Cause::AttitudeClock)
        } else if self.log_odds_of_images() >= DECISIVE_ODDS.ln() && large >= both {
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
    let apart_m = DVector::from_iterator(pairs.len(), pairs.iter().map(|pair| pair.apart_m));
    let by_clock_m_s = DVector::from_iterator(pairs.len(), pairs.iter().map(|pair| pair.clock_m_s));
    let by_rotation = shared(pairs, |pair| pair.range_m);
    let by_line_time = shared(pairs, |pair| pair.line_time_m_s);
    let measured_m2 = DMatrix::from_diagonal(&DVector::from_iterator(
        pairs.len(),
        pairs
            .iter()
            .map(|pair| pair.sigma_m.powi(2) + SHARED_M.powi(2)),
    ));
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
fn shared(
    pairs: &[PairDisagreement],
    effects: impl Fn(&PairDisagreement) -> [f64; 2],
) -> DMatrix<f64> {
    let mut column_of: BTreeMap<&str, usize> = BTreeMap::new();
    for image in pairs.iter().flat_map(|pair| &pair.images) {
        let next = column_of.len();
        column_of.entry(image).or_insert(next);
    }
    let mut design = DMatrix::<f64>::zeros(pairs.len(), column_of.len());
    for (row, pair) in pairs.iter().enumerate() {
        for ((image, effect), sign) in pair.images.iter().zip(effects(pair)).zip([1.0, -1.0]) {
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
mod tests {
    use super::*;
    use crate::random::Random;

    const SIGMAS: ReadingSigmas = ReadingSigmas {
        line_time_s: 0.045,
        rotation_rad: 1e-4,
        clock_s: 1.0,
    };

    fn pair(number: usize, apart_m: f64) -> PairDisagreement {
        PairDisagreement {
            images: [format!("nadir {number}"), format!("held {number}")],
            apart_m,
            sigma_m: 1.0,
            range_m: [380e3, 420e3],
            line_time_m_s: [3_000.0; 2],
            clock_m_s: 330.0,
        }
    }

    /// The closed form for one pair: two variances of one difference.
    #[test]
    fn one_pair_has_the_ratio_of_two_normal_densities() {
        let found = compare(&[pair(0, 200.0)], &SIGMAS).unwrap();
        let of = |rotation: f64, clock_s: f64| {
            let turned_m2 = (380e3_f64.powi(2) + 420e3_f64.powi(2)) * (rotation * 1e-4).powi(2);
            let variance_m2: f64 = 1.0 + SHARED_M.powi(2) + turned_m2 + (330.0 * clock_s).powi(2);
            (-0.5 * 200_f64.powi(2) / variance_m2).exp() / variance_m2.sqrt()
        };
        let sum = |clock_s: f64| {
            FACTORS
                .iter()
                .map(|factor| of(*factor, clock_s))
                .sum::<f64>()
        };
        let expected = (sum(1.0) / sum(0.0)).ln();
        let [_, _, small, small_with] = found.log_likelihoods;
        // Rounding of logarithms of about 10.
        assert!(
            (small_with - small - expected).abs() < 1e-9,
            "{found:?} {expected}"
        );
    }

    #[test]
    fn the_three_pairs_of_the_paper_do_not_decide() {
        // Shan et al. 2005, Table 5: 231, 225 and 271 m.
        let pairs = [231.0, 225.0, 271.0].iter().enumerate();
        let pairs: Vec<_> = pairs
            .map(|(number, apart_m)| pair(number, *apart_m))
            .collect();
        let found = compare(&pairs, &SIGMAS).unwrap();
        assert!((0.65..0.8).contains(&found.clock_s), "{found:?}");
        assert!(
            found.supported().is_none() && found.log_odds_of_clock() > 0.0,
            "{found:?}"
        );
    }

    /// A mission with errors of these sizes.
    struct Mission {
        offset_sigma_s: f64,
        rotation_rad: f64,
        line_time_s: f64,
    }

    impl Mission {
        /// Decisions for either cause, by ten pairs of each of 200 missions, and the ratio of the errors of the offset to their
        /// stated standard deviations.
        fn decided(&self, random: &mut Random) -> ([usize; 2], f64) {
            let (mut decided, mut squares) = ([0_usize; 2], 0.0_f64);
            for mission in 0..MISSIONS {
                let clock_s = self.offset_sigma_s * random.normal();
                let pairs = (0..10).map(|number| {
                    let mut pair = pair(10 * mission + number, 330.0 * clock_s);
                    for (range_m, sign) in pair.range_m.iter().zip([1.0, -1.0]) {
                        let of_rotation_m = range_m * self.rotation_rad * random.normal();
                        let of_lines_m = 3_000.0 * self.line_time_s * random.normal();
                        pair.apart_m += sign * (of_rotation_m + of_lines_m);
                    }
                    pair
                });
                let found = compare(&pairs.collect::<Vec<_>>(), &SIGMAS).unwrap();
                match found.supported() {
                    Some(Cause::SingleImages) => decided[0] += 1,
                    Some(Cause::AttitudeClock) => decided[1] += 1,
                    None => {}
                }
                squares += ((found.clock_s - clock_s) / found.clock_sigma_s).powi(2);
            }
            (decided, (squares / MISSIONS as f64).sqrt())
        }
    }

    const MISSIONS: usize = 200;

    #[test]
    fn ten_pairs_decide_for_the_cause_that_made_them() {
        let mut random = Random::new(7, "readings");
        let lines = Mission {
            offset_sigma_s: 0.0,
            rotation_rad: 1e-4,
            line_time_s: 0.044,
        };
        let ([images, clock], _) = lines.decided(&mut random);
        // Odds of 150 to 1 leave at most one wrong decision of 151.
        assert!(
            images >= MISSIONS * 3 / 4 && clock <= MISSIONS / 151,
            "{images} {clock}"
        );
        // Attitudes of 0.4 mrad are errors of single images as well.
        let attitudes = Mission {
            offset_sigma_s: 0.0,
            rotation_rad: 4e-4,
            line_time_s: 0.0,
        };
        let ([images, clock], _) = attitudes.decided(&mut random);
        assert!(
            images >= MISSIONS * 3 / 4 && clock <= MISSIONS / 151,
            "{images} {clock}"
        );
        let offset = Mission {
            offset_sigma_s: 0.73,
            rotation_rad: 1e-4,
            line_time_s: 0.0,
        };
        let ([images, clock], ratio) = offset.decided(&mut random);
        // Of six offsets, one is below 0.15 s, and hardly distinct from none.
        assert!(
            clock >= MISSIONS * 7 / 10 && images <= MISSIONS / 151,
            "{images} {clock}"
        );
        assert!((0.8..1.25).contains(&ratio), "{ratio}");
    }

    #[test]
    fn images_that_agree_and_causes_that_occur_together_are_undecided() {
        let mut random = Random::new(8, "readings");
        for (rotation_rad, line_time_s) in [(1e-4, 0.0), (5e-5, 0.0), (5e-5, 0.005), (5e-5, 0.01)] {
            let agree = Mission {
                offset_sigma_s: 0.0,
                rotation_rad,
                line_time_s,
            };
            let (decided, _) = agree.decided(&mut random);
            assert!(
                decided.iter().all(|of| *of <= MISSIONS / 100),
                "{rotation_rad} {line_time_s}: {decided:?}"
            );
        }
        let together = Mission {
            offset_sigma_s: 0.73,
            rotation_rad: 1e-4,
            line_time_s: 0.044,
        };
        let ([_, clock], _) = together.decided(&mut random);
        // The offset would be stated with too small a standard deviation.
        assert!(clock <= MISSIONS / 20, "{clock}");
    }

    #[test]
    fn pairs_of_one_image_share_its_error() {
        // One image with an error in three pairs is one error, not three.
        let with_one = |image: &str| {
            let pairs = (0..3).map(|number| {
                let mut pair = pair(number, 150.0);
                pair.images[0] = format!("{image}{}", if image == "own" { number } else { 0 });
                pair
            });
            compare(&pairs.collect::<Vec<_>>(), &SIGMAS)
                .unwrap()
                .log_odds_of_clock()
        };
        assert!(with_one("shared") < with_one("own"));
    }

    /// Three images of one place: their three disagreements close up to metres.
    #[test]
    fn a_triangle_is_two_pairs() {
        let of = |apart_m: [f64; 3]| {
            let mut pairs: Vec<_> = apart_m
                .iter()
                .enumerate()
                .map(|(number, apart_m)| pair(number, *apart_m))
                .collect();
            for (pair, images) in pairs.iter_mut().zip([["a", "b"], ["b", "c"], ["a", "c"]]) {
                pair.images = images.map(str::to_owned);
                pair.range_m = [400e3; 2];
            }
            pairs[1].clock_m_s = 0.0;
            pairs[2].clock_m_s = 335.0;
            compare(&pairs, &SIGMAS).unwrap().log_odds_of_clock()
        };
        // Five metres of closure change the odds by less than a factor of two.
        let [closed, open] = [[200.0, 30.0, 230.0], [200.0, 30.0, 235.0]].map(of);
        assert!(
            (closed - open).abs() < 2_f64.ln() && closed < DECISIVE_ODDS.ln(),
            "{closed} {open}"
        );
    }
}
