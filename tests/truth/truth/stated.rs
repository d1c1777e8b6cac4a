//! Stated standard deviations against truth, over missions whose errors have other sizes than those that areograph assumes, and
//! kinds that it does not model: the table of the guide.
//!
//! The long run writes the page with `SNAPSHOTS=overwrite`. `AREOGRAPH_FIRST_SEED=<number>` runs missions from another seed under
//! the same limits and does not write the page.

use std::fmt::Write as _;

use areograph::scene::Roughness;

mod further;

use super::{
    by_chance,
    common::{kept, long},
    flown::{Pair, Plan, Site, Stated, flown},
};

const PAGE: &str = "docs/guide/src/stated_against_true.md";
/// Missions of the long run without further keys and with them, and of every run: three sites each.
const MISSIONS: u32 = 60;
const MISSIONS_WITH_KEYS: u32 = 30;
const MISSIONS_OF_EVERY_RUN: u32 = 2;
const FIRST_SEED: u32 = 30_001;
const GROUNDS: [Roughness; 4] = [
    Roughness::Varied,
    Roughness::Plains,
    Roughness::Medium,
    Roughness::Rough,
];
const NOISES_PX: [f64; 3] = [1.0, 0.5, 0.22];
/// Keys of the adjustment by which missions are run as well.
const KEYS: [[&str; 2]; 2] = [
    ["`relief_for_plan = \"no\"`", WITHOUT_RELIEF],
    [
        "`common_bus = \"yes\"` and `relief_for_plan = \"no\"`",
        "common_bus = \"yes\"\nrelief_for_plan = \"no\"\n",
    ],
];
/// `profiles` tests positions with relief.
const WITHOUT_RELIEF: &str = "relief_for_plan = \"no\"\n";

/// Errors of one quantity with what is stated of them.
struct Quantity {
    name: String,
    unit: &'static str,
    pairs: Vec<Pair>,
    /// How many of them are independent.
    independent: usize,
    /// Whether less error than stated is allowed, because the statement is an upper bound.
    is_bound: bool,
}

/// Largest ratio, and largest share beyond three standard deviations, of statements that hold.
const RATIO_MOST: f64 = 1.25;
const BEYOND_MOST: f64 = 0.005;
/// Least ratio of an upper bound.
const BOUND_LEAST: f64 = 0.4;

impl Quantity {
    fn z(&self) -> f64 {
        let squares = self
            .pairs
            .iter()
            .map(|[error, sigma]| (error / sigma).powi(2));
        (squares.sum::<f64>() / self.pairs.len() as f64).sqrt()
    }

    fn beyond(&self) -> usize {
        let pairs = self.pairs.iter();
        pairs
            .filter(|[error, sigma]| error.abs() > 3.0 * sigma)
            .count()
    }

    fn root_mean_square(&self, of: usize) -> f64 {
        let squares = self.pairs.iter().map(|pair| pair[of].powi(2));
        (squares.sum::<f64>() / self.pairs.len() as f64).sqrt()
    }

    /// The interval of 95 % of z.
    fn interval(&self) -> [f64; 2] {
        let share = 2.0 / (9.0 * self.independent as f64);
        [1.96, -1.96].map(|sigmas| {
            let by_chance = (1.0 - share + sigmas * share.sqrt()).max(0.01).powf(1.5);
            self.z() / by_chance
        })
    }

    fn line(&self) -> String {
        let [low, high] = self.interval();
        let digits = |value: f64| match value {
            value if value >= 100.0 => format!("{value:.0}"),
            value if value >= 10.0 => format!("{value:.1}"),
            value => format!("{value:.2}"),
        };
        let beyond = self.beyond();
        format!(
            "| {} | {} | {} {} | {} {} | {:.2} ({low:.2}–{high:.2}) | {beyond} ({:.1} %) |",
            self.name,
            self.pairs.len(),
            digits(self.root_mean_square(0)),
            self.unit,
            digits(self.root_mean_square(1)),
            self.unit,
            self.z(),
            100.0 * beyond as f64 / self.pairs.len() as f64,
        )
    }

    /// Whether the ratio, or the share beyond three standard deviations, exceeds the limits of statements that hold.
    fn is_exceeded(&self) -> bool {
        self.z() > RATIO_MOST || self.beyond() as f64 > BEYOND_MOST * self.pairs.len() as f64
    }

    /// Fails unless what is stated holds, apart from chance.
    fn assert_holds(&self) {
        let chance = by_chance(self.independent);
        // Sizes are drawn for a mission: of few missions all may be small.
        let low = match (long(), self.is_bound) {
            (false, _) => 0.0,
            (true, true) => BOUND_LEAST,
            (true, false) => chance[0].min(0.8),
        };
        let z = self.z();
        assert!(
            z > low && z < chance[1].max(RATIO_MOST),
            "{}: {z:.2} of what is stated",
            self.line()
        );
        // As many as chance adds to it: of correlated errors all go together.
        let share = self.beyond() as f64 / self.pairs.len() as f64;
        let independent = self.independent as f64;
        let most = BEYOND_MOST + 3.0 * (BEYOND_MOST / independent).sqrt() + 1.0 / independent;
        assert!(share <= most, "{}: {share} beyond 3 sigma", self.line());
    }
}

/// The quantities that the adjustment states, over the valid sites.
fn quantities(sites: &[&Stated]) -> Vec<Quantity> {
    let count = sites.len();
    let mut all = Vec::new();
    let mut add = |name: &str, unit, pairs: Vec<Pair>, independent: usize, is_bound| {
        all.push(Quantity {
            name: name.to_owned(),
            unit,
            pairs,
            independent,
            is_bound,
        });
    };
    for (axis, name) in [(2, "height"), (0, "east"), (1, "north")] {
        let shared = sites.iter().map(|site| {
            let [error_m, sigma_m] = &site.ties.shared;
            [error_m[axis], sigma_m[axis]]
        });
        add(
            &format!("mean of the tie points of a site, {name}"),
            "m",
            shared.collect(),
            count,
            false,
        );
    }
    for (axis, name) in [(2, "height"), (0, "east"), (1, "north")] {
        let single = sites.iter().flat_map(|site| &site.ties.single);
        let single = single.map(|[error_m, sigma_m]| [error_m[axis], sigma_m[axis]]);
        add(
            &format!("single tie point, {name}"),
            "m",
            single.collect(),
            count,
            false,
        );
    }
    let before = sites.iter().map(|site| {
        let of = &site.judged;
        [of.surface_off_m, of.surface_sigma_m]
    });
    add(
        "MOLA surface at the tie points before the adjustment, height",
        "m",
        before.collect(),
        count,
        false,
    );
    let profiles: usize = sites.iter().map(|site| site.footprints.len()).sum();
    for (axis, name) in [(2, "height"), (0, "east"), (1, "north")] {
        let single = sites
            .iter()
            .flat_map(|site| &site.footprints)
            .flat_map(|profile| &profile.single);
        let single = single.map(|[error_m, sigma_m]| [error_m[axis], sigma_m[axis]]);
        add(
            &format!("adjusted footprint, {name}"),
            "m",
            single.collect(),
            profiles,
            axis == 2,
        );
    }
    for (axis, name) in [(0, "X"), (1, "Y"), (2, "Z, along the track")] {
        let cameras = sites.iter().flat_map(|site| &site.cameras);
        add(
            &format!("position of a camera, {name}"),
            "m",
            cameras.map(|camera| camera[axis]).collect(),
            2 * count,
            axis < 2,
        );
    }
    for (way, name) in [(0, "at nadir"), (1, "off nadir")] {
        let clocks: Vec<Pair> = sites
            .iter()
            .flat_map(|site| &site.clocks[way])
            .copied()
            .collect();
        let independent = clocks.len();
        add(
            &format!("clock of the altimeter from the ranges of a profile {name}"),
            "s",
            clocks,
            independent,
            way == 0,
        );
    }
    all.retain(|of| !of.pairs.is_empty());
    all
}

/// Seed of `AREOGRAPH_FIRST_SEED`, if set.
fn other_first_seed() -> Option<u32> {
    let text = std::env::var("AREOGRAPH_FIRST_SEED").ok()?;
    Some(text.parse().unwrap())
}

/// Missions with `keys` from a seed on.
fn plans(keys: &'static str, first_seed: u32) -> Vec<Plan<'static>> {
    let count = match (long(), keys) {
        (false, _) => MISSIONS_OF_EVERY_RUN,
        (true, WITHOUT_RELIEF) => MISSIONS,
        (true, _) => MISSIONS_WITH_KEYS,
    };
    (0..count)
        .zip(GROUNDS.into_iter().cycle())
        .zip(NOISES_PX.into_iter().cycle())
        .map(|((index, ground), noise_px)| Plan {
            keys,
            ..Plan::drawn(first_seed + index, ground, noise_px)
        })
        .collect()
}

/// Tie points of the valid sites.
pub(super) struct TieCounts {
    pub(super) good: usize,
    pub(super) lost: usize,
    pub(super) kept_blunders: usize,
}

impl TieCounts {
    pub(super) fn of(sites: &[Site]) -> Self {
        let valid = || sites.iter().filter(|site| site.is_valid());
        let stated = || valid().filter_map(|site| site.stated.as_ref());
        let lost = stated().map(|of| of.judged.lost.len()).sum();
        Self {
            good: lost + stated().map(|of| of.judged.errors_m.len()).sum::<usize>(),
            lost,
            kept_blunders: stated().map(|of| of.judged.kept_blunders.len()).sum(),
        }
    }
}

/// Counts of verdicts, good tie points lost and blunders kept, in words.
fn counts(sites: &[Site]) -> String {
    let invalid = |is_misplaced: bool| {
        let of_kind = || {
            sites
                .iter()
                .filter(move |site| site.has_misplaced_profile == is_misplaced)
        };
        [
            of_kind().count(),
            of_kind().filter(|site| !site.is_valid()).count(),
        ]
    };
    let ([sound, refused], [misplaced, noticed]) = (invalid(false), invalid(true));
    let ties = TieCounts::of(sites);
    format!(
        "Invalid sites: {refused} of {sound} with correctly placed profiles, {noticed} of {misplaced} with a misplaced profile. \
         Correct tie points rejected in valid sites: {} of {}; undetected blunders: {}.\n",
        ties.lost, ties.good, ties.kept_blunders
    )
}

const HEAD: &str = "\n| quantity | values | error, rms | stated, rms | ratio (95 %) | beyond 3 σ |\n|---|---:|---:|---:|---:|---:|\n";

const INTRODUCTION: &str = include_str!("stated/introduction.md");

/// The missions with one set of keys.
struct Variant {
    name: &'static str,
    sites: Vec<Site>,
}

impl Variant {
    #[allow(clippy::print_stdout, reason = "what was measured is worth reading")]
    fn flown([name, keys]: [&'static str; 2], first_seed: u32) -> Self {
        let sites = flown(&plans(keys, first_seed));
        let variant = Self { name, sites };
        println!("{}", variant.section());
        for site in variant.sites.iter().filter(|site| !site.is_valid()) {
            let misplaced = if site.has_misplaced_profile {
                " (misplaced profile)"
            } else {
                ""
            };
            println!("{}{misplaced}: {}", site.name, site.list("reasons"));
        }
        variant
    }

    /// What the valid sites of a kind state.
    fn valid(&self, is_of_kind: impl Fn(&Site) -> bool) -> Vec<&Stated> {
        let valid = self.sites.iter().filter(|site| site.is_valid());
        let of_kind = valid.filter(|site| is_of_kind(site));
        of_kind.filter_map(|site| site.stated.as_ref()).collect()
    }

    fn quantities(&self) -> Vec<Quantity> {
        quantities(&self.valid(|_| true))
    }

    fn section(&self) -> String {
        let mut text = format!("\n## With {}\n\n{}{HEAD}", self.name, counts(&self.sites));
        let all = self.quantities();
        for quantity in &all {
            let _infallible = writeln!(text, "{}", quantity.line());
        }
        let exceeded = all.iter().filter(|of| of.is_exceeded());
        let names: Vec<&str> = exceeded.map(|of| &*of.name).collect();
        let _infallible = writeln!(
            text,
            "\nRatio above 1.25, or more than 0.5 % beyond three standard deviations: {}.",
            names.join("; ")
        );
        let misplaced = self.valid(|site| site.has_misplaced_profile).len();
        if misplaced > 0 {
            let placed = quantities(&self.valid(|site| !site.has_misplaced_profile));
            let lines = placed.iter().filter(|of| of.is_exceeded());
            let lines = lines.map(|of| format!("{} ({:.2}; {})", of.name, of.z(), of.beyond()));
            let _infallible = writeln!(
                text,
                "Without the valid sites that have a misplaced profile (number: {misplaced}), ratio and number beyond 3 σ: {}.",
                lines.collect::<Vec<_>>().join("; ")
            );
        }
        text
    }

    /// Fails unless statements hold, sound sites are valid, and blunders are found.
    fn assert_holds(&self) {
        for quantity in self.quantities() {
            quantity.assert_holds();
        }
        let sound = || self.sites.iter().filter(|site| !site.has_misplaced_profile);
        let refused = sound().filter(|site| !site.is_valid()).count();
        // One in 50.
        assert!(50 * refused <= sound().count().max(50), "{refused} refused");
        let ties = TieCounts::of(&self.sites);
        // 0.5 % of the good ones; of the blunders, one in twenty of all, as many.
        assert!(
            200 * ties.lost <= ties.good,
            "{} of {} lost",
            ties.lost,
            ties.good
        );
        let blunders = ties.good / 19;
        assert!(
            200 * ties.kept_blunders <= blunders.max(200),
            "{} blunders kept",
            ties.kept_blunders
        );
    }
}

#[test]
fn statements_hold_where_the_world_is_not_that_of_the_estimator() {
    let variants = &KEYS[..if long() { KEYS.len() } else { 1 }];
    let first_seed = other_first_seed().unwrap_or(FIRST_SEED);
    let variants = variants
        .iter()
        .map(|keys| Variant::flown(*keys, first_seed));
    let variants: Vec<Variant> = variants.collect();
    if long() && other_first_seed().is_none() {
        let mut page = INTRODUCTION.to_owned();
        for variant in &variants {
            page += &variant.section();
        }
        page += "\n## Further missions\n\n{{#include further_missions.md}}\n";
        kept::is_up_to_date(PAGE, &page);
    }
    for variant in &variants {
        variant.assert_holds();
    }
}
