//! Errors that the adjustment does not model, over missions: whether verdicts notice them, and whether what is stated holds
//! where they do not.
//!
//! Seeds begin at 50,000. The long run writes the page with `SNAPSHOTS=overwrite`.

pub(super) mod changes;

use std::fmt::Write as _;

use areograph::scene::{Jitter, Misregistration, Roughness, SceneErrors};

use super::{
    by_chance,
    common::{case::Case, kept, long},
    flown::{Pair, Plan, Site, Sizes, flown},
    root_mean_square,
};
use changes::{in_sites, in_ties, noise_with_tails, of_shots, off_nadir, orbit, samples_scatter};

const PAGE: &str = "docs/guide/src/unmodelled_errors.md";
/// Missions of three sites for every error.
const MISSIONS: u32 = 4;
const FIRST_SEED: u32 = 50_001;
/// The first errors, of one mission, are in every run.
const FEW: usize = 3;
/// Middle column of an image of summed pixels.
const MIDDLE_COLUMN: f64 = 512.0;
/// Stated noise of tie points, pixels.
const NOISE_PX: f64 = 0.5;

/// What becomes of an error.
#[derive(Clone, Copy, PartialEq, Debug)]
enum Answer {
    /// All sites are invalid.
    Invalid,
    /// Errors of the valid sites agree with what is stated.
    Inside,
    /// They do not, and the verdict lists the error among those that are not tested, with this phrase.
    NotTested(&'static str),
    /// They do not, and the verdict is silent: a fault of the program.
    NotNoticed,
}

/// An error and its size.
struct Kind {
    words: &'static str,
    errors: fn(&mut SceneErrors),
    /// Changes the files of the mission of a seed.
    files: fn(&Case, u32),
    /// Further keys of the adjustment.
    keys: &'static str,
    /// Whether the trial is of the sites with a misplaced profile alone.
    of_misplaced: bool,
    answer: Answer,
}

const UNCHANGED: Kind = Kind {
    words: "no additional error",
    errors: |_| {},
    files: |_, _| {},
    keys: "",
    of_misplaced: false,
    answer: Answer::Inside,
};

const ATTITUDE: &str = "an attitude error that all images share";
const LINE_TIMES: &str = "an error common to the start times of all images";
const DISTORTION: &str = "a camera distortion across the track";
const SHOTS: &str = "errors that ranges and radii of the shots share";
const ACROSS: &str = "errors of single tie points across the track";
const RADII: &str = r#"["shot_radii", "mid_radius"]"#;
const RANGES: &str = r#"["ranges"]"#;

const KINDS: &[Kind] = &[
    UNCHANGED,
    Kind {
        words: "opposite sign of the altimeter's clock bias",
        files: |case, _| in_sites(case, "sign = \"late\"", "sign = \"early\""),
        answer: Answer::Invalid,
        ..UNCHANGED
    },
    Kind {
        words: "bend of the detector line, σ 2 detector elements at its ends",
        errors: |of| of.camera.bend_sigma_px = 2.0,
        ..UNCHANGED
    },
    Kind {
        words: "all heights of shots too low by 5 m, with consistent ranges",
        files: |case, _| {
            of_shots(case, RADII, "add = -500", None);
            of_shots(case, RANGES, "add = 500", None);
        },
        answer: Answer::NotTested(SHOTS),
        ..UNCHANGED
    },
    Kind {
        words: "radii of shots too large by 10 m, with unchanged ranges",
        files: |case, _| of_shots(case, RADII, "add = 1000", None),
        answer: Answer::Invalid,
        ..UNCHANGED
    },
    Kind {
        words: "heights of profiles off nadir too high by 10 m, with consistent ranges",
        files: |case, _| {
            off_nadir(case, RADII, "add = 1000");
            off_nadir(case, RANGES, "add = -930");
        },
        ..UNCHANGED
    },
    Kind {
        words: "heights of profiles off nadir too high by 25 m, with consistent ranges",
        files: |case, _| {
            off_nadir(case, RADII, "add = 2500");
            off_nadir(case, RANGES, "add = -2325");
        },
        ..UNCHANGED
    },
    Kind {
        words: "focal length, σ 0.1 %",
        errors: |of| of.camera.focal_length_sigma = 1e-3,
        ..UNCHANGED
    },
    Kind {
        words: "drift of the attitude, σ 0.08 mrad (30 m) at the end of an image",
        errors: |of| of.attitude.linear_sigma_rad = 8e-5,
        ..UNCHANGED
    },
    Kind {
        words: "jitter of 2 detector elements (7 to 8 µrad) with periods of 1 to 10 s",
        errors: |of| {
            of.attitude.slow_jitter = Jitter {
                sinusoids: 1,
                amplitude_rad: [7e-6, 8e-6],
                period_s: [1.0, 10.0],
            };
        },
        ..UNCHANGED
    },
    Kind {
        words: "noise of tie points twice the stated value",
        errors: |of| of.tie_noise_factor = 2.0,
        ..UNCHANGED
    },
    Kind {
        words: "noise of tie points, with two thirds of its variance common to neighbours",
        errors: |of| of.tie_noise_common = 2.0 / 3.0,
        ..UNCHANGED
    },
    Kind {
        words: "noise of tie points from Student's distribution with three degrees of freedom, of the stated size",
        errors: |of| of.tie_noise_factor = 0.0,
        files: noise_with_tails,
        ..UNCHANGED
    },
    Kind {
        words: "lines and samples of tie points 0.5 pixels too large in one image of a pair",
        files: |case, _| {
            in_ties(
                case,
                |second, at| if second { at.map(|at| at + 0.5) } else { at },
            );
        },
        ..UNCHANGED
    },
    Kind {
        words: "errors of up to 2 pixels in the samples of tie points, in proportion to the square of the distance from the middle column",
        files: |case, _| {
            in_ties(case, |_, [line, sample]| {
                let off = (sample - MIDDLE_COLUMN) / MIDDLE_COLUMN;
                [line, sample + 2.0 * off * off]
            });
        },
        answer: Answer::NotTested(DISTORTION),
        ..UNCHANGED
    },
    Kind {
        words: "noise of the samples of tie points three times the stated value",
        files: samples_scatter,
        answer: Answer::NotTested(ACROSS),
        ..UNCHANGED
    },
    Kind {
        words: "attitude of each image, σ 1 mrad about each axis",
        errors: |of| of.attitude.constant_sigma_rad = [1e-3; 3],
        answer: Answer::NotTested(ATTITUDE),
        ..UNCHANGED
    },
    Kind {
        words: "pointing bias wrong by 0.5 s",
        files: |case, _| in_sites(case, "ck_bias_s = -1.15", "ck_bias_s = -1.65"),
        answer: Answer::NotTested(ATTITUDE),
        ..UNCHANGED
    },
    Kind {
        words: "delay of the lines of each image, σ 60 lines",
        errors: |of| of.misregistration = Misregistration::LineTimes { sigma_lines: 60.0 },
        answer: Answer::NotTested(LINE_TIMES),
        ..UNCHANGED
    },
    Kind {
        words: "orbit displaced by 80 m along the track",
        files: |case, _| orbit(case, "[80, 0, 0]"),
        answer: Answer::NotTested("an orbit error along or across the track, up to 100 m"),
        ..UNCHANGED
    },
    Kind {
        words: "orbit displaced by 80 m across the track",
        files: |case, _| orbit(case, "[0, 0, 80]"),
        ..UNCHANGED
    },
    Kind {
        words: "coordinates of shots with 0 to 100 % of the attitude error of their image, with `common_bus`",
        errors: |of| of.altimeter.attitude_share_max = [1.0, 1.0],
        keys: "common_bus = \"yes\"\n",
        ..UNCHANGED
    },
    Kind {
        words: "profiles misplaced by 0.5 to 2 km",
        errors: |of| of.altimeter.misplaced_chance = 0.5,
        of_misplaced: true,
        answer: Answer::NotTested("an error in the position of a single profile, up to"),
        ..UNCHANGED
    },
    Kind {
        words: "one frame in five too high by 30 m, with consistent ranges",
        files: |case, _| {
            of_shots(case, RADII, "add = 3000", Some(5));
            of_shots(case, RANGES, "add = -3000", Some(5));
        },
        answer: Answer::NotTested(SHOTS),
        ..UNCHANGED
    },
    Kind {
        words: "one frame in 20 too high by 300 m, with consistent ranges, as for a cloud",
        files: |case, _| {
            of_shots(case, RADII, "add = 30000", Some(20));
            of_shots(case, RANGES, "add = -30000", Some(20));
        },
        ..UNCHANGED
    },
];

/// The sites of one kind of error.
struct Trial {
    kind: &'static Kind,
    sites: Vec<Site>,
}

impl Trial {
    fn valid(&self) -> impl Iterator<Item = &Site> {
        self.sites.iter().filter(|site| site.is_valid())
    }

    /// Mean errors of the valid sites on an axis.
    fn means(&self, axis: usize) -> Vec<Pair> {
        let stated = self.valid().filter_map(|site| site.stated.as_ref());
        stated.map(|of| of.ties.shared.map(|of| of[axis])).collect()
    }

    /// Height errors of single tie points of the valid sites.
    fn singles(&self) -> Vec<Pair> {
        let stated = self.valid().filter_map(|site| site.stated.as_ref());
        let single = stated.flat_map(|of| &of.ties.single);
        single.map(|of| of.map(|of| of.z)).collect()
    }

    /// Errors of single footprints of the valid sites east and north.
    fn footprints(&self) -> Vec<Pair> {
        let stated = self.valid().filter_map(|site| site.stated.as_ref());
        let profiles = stated.flat_map(|of| &of.footprints);
        let single = profiles.flat_map(|profile| &profile.single);
        single
            .flat_map(|of| [of.map(|of| of.x), of.map(|of| of.y)])
            .collect()
    }

    fn answer(&self) -> Answer {
        // Of few sites, as many as chance allows.
        let most = |limit: f64, count: usize| {
            let [_, by_chance] = by_chance(count);
            if long() { limit } else { limit.max(by_chance) }
        };
        let count = self.valid().count();
        if count == 0 {
            return Answer::Invalid;
        }
        let means_hold = (0..3).all(|axis| ratio(&self.means(axis)) <= most(1.25, count));
        let singles_hold = ratio(&self.singles()) <= most(1.3, count)
            && ratio(&self.footprints()) <= most(1.3, count);
        if means_hold && singles_hold {
            return Answer::Inside;
        }
        match self.kind.answer {
            Answer::NotTested(phrase) if self.valid().all(|site| lists(site, phrase)) => {
                Answer::NotTested(phrase)
            }
            _ => Answer::NotNoticed,
        }
    }

    fn line(&self) -> String {
        let valid = self.valid().count();
        let mut cells = vec![
            self.kind.words.to_owned(),
            self.sites.len().to_string(),
            (self.sites.len() - valid).to_string(),
        ];
        for axis in [2, 0, 1] {
            let pairs = self.means(axis);
            cells.push(if pairs.is_empty() {
                "–".to_owned()
            } else {
                let errors_m = pairs.iter().map(|[error_m, _]| *error_m);
                let error_m = root_mean_square(errors_m);
                format!("{error_m:.1} m, {:.2}", ratio(&pairs))
            });
        }
        let singles = self.singles();
        for pairs in [singles, self.footprints()] {
            cells.push(if pairs.is_empty() {
                "–".to_owned()
            } else {
                format!("{:.2}", ratio(&pairs))
            });
        }
        cells.push(match self.answer() {
            Answer::Invalid => "invalid".to_owned(),
            Answer::Inside => "inside".to_owned(),
            Answer::NotTested(_) => "stated as not tested".to_owned(),
            Answer::NotNoticed => "**not noticed**".to_owned(),
        });
        format!("| {} |", cells.join(" | "))
    }
}

/// Whether the verdict lists errors with the phrase as not tested, of attitudes up to sizes on the ground that hold.
fn lists(site: &Site, phrase: &str) -> bool {
    let entries = site.verdict["untested"].as_array().unwrap();
    let mut texts = entries.iter().map(|entry| entry.as_str().unwrap());
    let Some(entry) = texts.find(|text| text.contains(phrase)) else {
        return false;
    };
    // "…, 528 and 502 m on the ground".
    let Some((sizes, _)) = entry.split_once(" m on the ground") else {
        return true;
    };
    let across_m: f64 = sizes.rsplit(' ').next().unwrap().parse().unwrap();
    let error_m = site.stated.as_ref().unwrap().ties.shared[0].xy();
    phrase != ATTITUDE || error_m.amax() <= across_m
}

/// Root mean square of errors over their standard deviations.
fn ratio(pairs: &[Pair]) -> f64 {
    root_mean_square(pairs.iter().map(|[error_m, sigma_m]| error_m / sigma_m))
}

const INTRODUCTION: &str = "\
# Errors that the adjustment does not model

Each row adds or enlarges one error in four missions of three sites each; the other errors have the sizes that areograph assumes. A test
computes the table (`tests/truth/truth/unmodelled.rs`, in the long run) and writes this page. Sizes with σ are standard deviations of
random errors; all others are fixed values or ranges. `range_check.mean_max_m` is 20 m, because the assumed standard deviation of orbits is 5 m
in radius. [*Wrong inputs*](wrong_inputs.md) lists mistakes of all sizes on one site with default limits; in the missions of [*Stated against
true*](stated_against_true.md), many such errors occur together.

*Invalid* counts the invalid sites. The other columns refer to the valid sites: the root mean square, over the sites, of the mean error of their
tie points, with the ratio as in *Stated against true*; the ratios of the heights of single tie points, and of single footprints in plan.
Sites that are valid with remarks count as valid. *Answer*:

- *invalid*: all sites are invalid.
- *inside*: no ratio of means exceeds 1.25, and no ratio of single values 1.3.
- *stated as not tested*: a ratio exceeds these limits. The terminal, the page and the manifest list errors of this kind as not tested;
  larger ones can make a site invalid.

A drift of 0.08 mrad is eight times the standard deviation that areograph assumes. Tie points determine this drift. A correction of drift or bend
of four to six standard deviations causes a remark. A larger correction makes the site invalid even if the result is correct, because no other check
detects a wrong `CROSSTRACK_SUMMING` in both labels, which moves the ground by 707 m.

| error | sites | invalid | height | east | north | single heights | footprints | answer |
|---|---:|---:|---:|---:|---:|---:|---:|---|
";

fn plans(kind: &'static Kind) -> impl Iterator<Item = Plan<'static>> {
    let grounds = [Roughness::Plains, Roughness::Medium, Roughness::Varied];
    let count = if long() { MISSIONS } else { 1 };
    let missions = (0..count).zip(grounds.into_iter().cycle());
    missions.map(|(index, ground)| Plan {
        sizes: Sizes::Cited,
        errors: kind.errors,
        files: kind.files,
        keys: kind.keys,
        ..Plan::drawn(FIRST_SEED + index, ground, NOISE_PX)
    })
}

#[test]
#[allow(clippy::print_stdout, reason = "what was measured is worth reading")]
fn errors_that_are_not_modelled_have_their_answer() {
    let kinds = &KINDS[..if long() { KINDS.len() } else { FEW }];
    let all: Vec<Plan<'_>> = kinds.iter().flat_map(plans).collect();
    let mut sites = flown(&all);
    let of_kind = sites.len() / kinds.len();
    let mut trials = Vec::new();
    for kind in kinds {
        let rest = sites.split_off(of_kind);
        sites.retain(|site| site.has_misplaced_profile || !kind.of_misplaced);
        trials.push(Trial { kind, sites });
        sites = rest;
    }
    let mut page = INTRODUCTION.to_owned();
    for trial in &trials {
        for site in trial.sites.iter().filter(|site| !site.is_valid()) {
            println!(
                "{}, {}: {}",
                trial.kind.words,
                site.name,
                site.list("reasons")
            );
        }
        let _infallible = writeln!(page, "{}", trial.line());
    }
    println!("{page}");
    if long() {
        kept::is_up_to_date(PAGE, &page);
    }
    assert!(trials[0].sites.iter().all(Site::is_valid), "sound sites");
    for trial in &trials {
        assert_eq!(trial.answer(), trial.kind.answer, "{}", trial.kind.words);
    }
}
