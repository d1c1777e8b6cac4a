//! Against closed forms, and against missions with known causes.

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
        along_track: AlongTrack {
            apart_m,
            sigma_m: 1.0,
            range_m: [380e3, 420e3],
            line_time_m_s: [3_000.0; 2],
            clock_m_s: 330.0,
        },
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
                for (range_m, sign) in pair.along_track.range_m.iter().zip([1.0, -1.0]) {
                    let of_rotation_m = range_m * self.rotation_rad * random.normal();
                    let of_lines_m = 3_000.0 * self.line_time_s * random.normal();
                    pair.along_track.apart_m += sign * (of_rotation_m + of_lines_m);
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
    // Of five offsets, one is below 0.2 s, and hardly distinct from none.
    assert!(
        clock >= MISSIONS * 7 / 10 && images <= MISSIONS / 151,
        "{images} {clock}"
    );
    assert!((0.8..1.25).contains(&ratio), "{ratio}");
}

#[test]
fn images_that_agree_decide_nothing_and_an_offset_beside_large_errors_is_no_decision() {
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
    let ([images, clock], ratio) = together.decided(&mut random);
    // The offset would be stated with too small a standard deviation. Errors of single images are there, whatever the offset.
    assert!(clock <= MISSIONS / 100, "{clock}");
    assert!(images <= MISSIONS / 2 && ratio > 2.0, "{images} {ratio}");
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
            pair.along_track.range_m = [400e3; 2];
        }
        pairs[1].along_track.clock_m_s = 0.0;
        pairs[2].along_track.clock_m_s = 335.0;
        compare(&pairs, &SIGMAS).unwrap().log_odds_of_clock()
    };
    // Five metres of closure change the odds by less than a factor of two.
    let [closed, open] = [[200.0, 30.0, 230.0], [200.0, 30.0, 235.0]].map(of);
    assert!(
        (closed - open).abs() < 2_f64.ln() && closed < DECISIVE_ODDS.ln(),
        "{closed} {open}"
    );
}
