//! Mistakes in the input of missions whose errors are drawn: whether the verdict notices each, or the error stays within what is
//! stated.
//!
//! Ten seeds of each. The long run writes the page with `SNAPSHOTS=overwrite`.

mod kinds;

use std::{collections::BTreeSet, fmt::Write as _};

use areograph::scene::Roughness;

use super::{
    SITES,
    common::{kept, long},
    flown::{Plan, Site, flown},
};
use kinds::{MISTAKES, Mistake, NONE};

const PAGE: &str = "docs/guide/src/mistakes.md";
const INTRODUCTION: &str = include_str!("mistakes/introduction.md");
const FIRST_SEED: u32 = 230_001;
/// Missions for each mistake; those after the first ones have further passes.
const MISSIONS: u32 = 10;
const WITHOUT_PASSES: u32 = 6;
const PASSES: u32 = 24;
/// The first mistakes, of one mission, are in every run.
const FEW: usize = 2;
const GROUNDS: [Roughness; 4] = [
    Roughness::Varied,
    Roughness::Plains,
    Roughness::Medium,
    Roughness::Rough,
];
const NOISES_PX: [f64; 3] = [0.5, 1.0, 0.3];
/// A mean of tie points is as stated within this many standard deviations on every axis.
const MOST_SIGMAS: f64 = 3.0;

/// What becomes of a site with a mistake.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Answer {
    Refused,
    Invalid,
    Remark,
    Inside,
    /// Valid without a remark, and the error exceeds what is stated; the verdict lists it among those that no datum tests.
    Untested,
    /// The same, and not listed: a fault of the program, or chance.
    Beyond,
}

const ANSWERS: [Answer; 6] = [
    Answer::Refused,
    Answer::Invalid,
    Answer::Remark,
    Answer::Inside,
    Answer::Untested,
    Answer::Beyond,
];

/// Missions with a mistake, and one site of each.
fn plans(mistake: &Mistake) -> Vec<Plan<'_>> {
    let plan = |index: u32| {
        let number = index as usize;
        Plan {
            passes: if index >= WITHOUT_PASSES { PASSES } else { 0 },
            ties_at_shots: index >= WITHOUT_PASSES,
            errors: mistake.errors,
            files: mistake.files,
            sites: std::slice::from_ref(&SITES[number % SITES.len()]),
            may_be_refused: true,
            ..Plan::drawn(
                FIRST_SEED + index,
                GROUNDS[number % GROUNDS.len()],
                NOISES_PX[number % NOISES_PX.len()],
            )
        }
    };
    (0..if long() { MISSIONS } else { 1 }).map(plan).collect()
}

/// Remarks without their numbers.
fn remarks(site: &Site) -> BTreeSet<String> {
    let remarks = site.verdict["remarks"].as_array();
    let texts = remarks.into_iter().flatten().map(|text| {
        let text = text.as_str().unwrap().chars();
        text.filter(|of| !of.is_ascii_digit() && !".−+-".contains(*of))
            .collect()
    });
    texts.collect()
}

/// Largest error of the mean of the tie points on an axis in stated standard deviations.
fn largest(site: &Site) -> Option<f64> {
    let [error_m, sigma_m] = site.stated.as_ref()?.ties.shared;
    Some(error_m.component_div(&sigma_m).amax())
}

/// The answer to a mistake; `sound` is the same site without it.
fn answer(mistake: &Mistake, site: &Site, sound: &Site) -> Answer {
    let lists = |phrase: &str| site.list("untested").contains(phrase);
    if site.verdict.is_null() {
        Answer::Refused
    } else if !site.is_valid() {
        Answer::Invalid
    } else if !remarks(site).is_subset(&remarks(sound)) {
        Answer::Remark
    } else if largest(site).is_some_and(|sigmas| sigmas <= MOST_SIGMAS) {
        Answer::Inside
    } else if mistake.untested.is_some_and(lists) {
        Answer::Untested
    } else {
        Answer::Beyond
    }
}

/// The sites with one mistake.
struct Trial<'a> {
    words: &'static str,
    sites: Vec<(Site, Answer)>,
    sound: &'a [Site],
}

impl<'a> Trial<'a> {
    fn of(mistake: &'static Mistake, sites: Vec<Site>, sound: &'a [Site]) -> Self {
        assert_eq!(sites.len(), sound.len());
        let answers: Vec<Answer> = sites
            .iter()
            .zip(sound)
            .map(|(site, sound)| answer(mistake, site, sound))
            .collect();
        Self {
            words: mistake.words,
            sites: sites.into_iter().zip(answers).collect(),
            sound,
        }
    }

    fn count(&self, answer: Answer) -> usize {
        let such = self.sites.iter().filter(|(_, of)| *of == answer);
        such.count()
    }

    fn line(&self) -> String {
        let mut line = format!("| {} | {} |", self.words, self.sites.len());
        for answer in ANSWERS {
            let _infallible = write!(line, " {} |", self.count(answer));
        }
        let unmarked = self
            .sites
            .iter()
            .filter(|(_, of)| matches!(of, Answer::Inside | Answer::Untested | Answer::Beyond));
        let most = unmarked.filter_map(|(site, _)| largest(site));
        match most.reduce(f64::max) {
            Some(most) => line + &format!(" {most:.1} |"),
            None => line + " – |",
        }
    }

    #[allow(clippy::print_stdout, reason = "what was measured is worth reading")]
    fn print(&self) {
        println!("{}", self.line());
        for ((site, answer), sound) in self.sites.iter().zip(self.sound) {
            let shared = site.stated.as_ref().map(|of| of.ties.shared);
            let [errors_m, sigmas_m] =
                shared.map_or([[0.0; 3]; 2], |of| of.map(|of| [of.x, of.y, of.z]));
            let texts = match answer {
                Answer::Invalid => site.list("reasons"),
                Answer::Remark => {
                    let sound = remarks(sound);
                    let new = remarks(site).into_iter().filter(|of| !sound.contains(of));
                    format!("{:?}", new.collect::<Vec<_>>())
                }
                Answer::Untested | Answer::Beyond => site.list("remarks"),
                Answer::Refused | Answer::Inside => String::new(),
            };
            println!(
                "    {} {answer:?} {errors_m:.1?} {sigmas_m:.1?} {texts}",
                site.name
            );
        }
    }
}

/// The line of the sites without a mistake, whose remarks do not count.
fn line_of_sound(sound: &[Site]) -> String {
    let answers = sound.iter().map(|site| answer(&NONE, site, site));
    let answers: Vec<Answer> = answers.collect();
    let mut line = format!("| {} | {} |", NONE.words, sound.len());
    for answer in ANSWERS {
        let count = answers.iter().filter(|of| **of == answer).count();
        let _infallible = write!(line, " {count} |");
    }
    let most = sound.iter().filter_map(largest).fold(0.0, f64::max);
    line + &format!(" {most:.1} |")
}

#[test]
#[allow(clippy::print_stdout, reason = "what was measured is worth reading")]
fn mistakes_are_named_or_their_errors_are_stated() {
    let mistakes = &MISTAKES[..if long() { MISTAKES.len() } else { FEW }];
    // One mistake, while its answer is mended.
    let only = std::env::var("AREOGRAPH_MUTATIONS").ok();
    let chosen = mistakes.iter().filter(|of| {
        let only = only.as_deref();
        only.is_none_or(|only| only.split(',').any(|part| of.words.contains(part)))
    });
    let chosen: Vec<&Mistake> = chosen.collect();
    let sound = flown(&plans(&NONE));
    let mut page = format!("{INTRODUCTION}{}\n", line_of_sound(&sound));
    let [mut beyond, mut sites] = [0; 2];
    for mistake in chosen {
        let trial = Trial::of(mistake, flown(&plans(mistake)), &sound);
        trial.print();
        let _infallible = writeln!(page, "{}", trial.line());
        beyond += trial.count(Answer::Beyond);
        sites += trial.sites.len();
    }
    println!("{page}");
    for site in &sound {
        assert_eq!(answer(&NONE, site, site), Answer::Inside, "{}", site.name);
    }
    // Three standard deviations on three axes: one site in 120 by chance.
    assert!(60 * beyond <= sites.max(60), "{beyond} of {sites} sites");
    if long() && only.is_none() {
        kept::is_up_to_date(PAGE, &page);
    }
}
