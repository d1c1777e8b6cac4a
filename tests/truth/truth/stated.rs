//! Stated standard deviations against truth, over missions whose errors have other sizes than those that areograph assumes, and
//! kinds that it does not model: the table of the guide.
//!
//! Seeds begin at 30,000. The long run writes the page with `SNAPSHOTS=overwrite`.

use std::fmt::Write as _;

use areograph::scene::Roughness;

use super::{
    by_chance,
    common::{kept, long},
    flown::{Pair, Plan, Site, Stated, flown},
};

const PAGE: &str = "docs/guide/src/stated_against_true.md";
/// Missions of the long run without further keys and with them, and of every run: three sites each.
const MISSIONS: u32 = 60;
const MISSIONS_WITH_KEYS: u32 = 30;
const MISSIONS_OF_EVERY_RUN: u32 = 4;
const FIRST_SEED: u32 = 30_001;
const GROUNDS: [Roughness; 4] = [
    Roughness::Varied,
    Roughness::Plains,
    Roughness::Medium,
    Roughness::Rough,
];
const NOISES_PX: [f64; 3] = [1.0, 0.5, 0.22];
/// Keys of the adjustment by which missions are run as well.
const KEYS: [(&str, &str); 2] = [
    ("default values", ""),
    ("`common_bus`", "common_bus = \"yes\"\n"),
];

/// What is stated before the adjustment.
const BEFORE: &str = "MOLA surface at the tie points before the adjustment, height";

/// Errors of one quantity with what is stated of them.
struct Quantity {
    name: String,
    unit: &'static str,
    pairs: Vec<Pair>,
    /// How many of them are independent.
    independent: usize,
    /// Whether less error than stated is allowed, because the statement is a bound.
    is_bound: bool,
    /// Largest ratio.
    most: f64,
}

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

    /// Fails unless what is stated holds.
    fn assert_holds(&self) {
        let chance = by_chance(self.independent);
        // Sizes are drawn for a mission: of few missions all may be small.
        let low = if self.is_bound || !long() {
            0.0
        } else {
            chance[0].min(0.8)
        };
        let z = self.z();
        assert!(
            z > low && z < chance[1].max(self.most),
            "{}: {z:.2} of what is stated",
            self.line()
        );
        // 0.5 %, and as many as chance adds to it: of correlated errors all go together.
        let share = self.beyond() as f64 / self.pairs.len() as f64;
        let independent = self.independent as f64;
        let most = 0.005 + 3.0 * (0.005 / independent).sqrt() + 1.0 / independent;
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
            most: 1.25,
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
    add(BEFORE, "m", before.collect(), count, false);
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
            &format!("clock of the altimeter by the ranges of a profile {name}"),
            "s",
            clocks,
            independent,
            way == 0,
        );
    }
    all.retain(|of| !of.pairs.is_empty());
    for of in &mut all {
        if of.name == BEFORE {
            // Stated too small: the page says so.
            of.most = 1.5;
        }
    }
    all
}

fn plans(keys: &'static str) -> Vec<Plan<'static>> {
    let count = match (long(), keys) {
        (false, _) => MISSIONS_OF_EVERY_RUN,
        (true, "") => MISSIONS,
        (true, _) => MISSIONS_WITH_KEYS,
    };
    (0..count)
        .zip(GROUNDS.into_iter().cycle())
        .zip(NOISES_PX.into_iter().cycle())
        .map(|((index, ground), noise_px)| Plan {
            keys,
            ..Plan::drawn(FIRST_SEED + index, ground, noise_px)
        })
        .collect()
}

/// Counts of verdicts, good tie points lost and blunders kept.
fn counts(sites: &[Site]) -> String {
    let misplaced = |is: bool, valid: bool| {
        let sites = sites.iter();
        sites
            .filter(|site| site.has_misplaced_profile == is && site.is_valid() == valid)
            .count()
    };
    let stated = || {
        sites
            .iter()
            .filter(|site| site.is_valid())
            .filter_map(|site| site.stated.as_ref())
    };
    let lost: usize = stated().map(|of| of.judged.lost.len()).sum();
    let good: usize = stated().map(|of| of.judged.errors_m.len()).sum();
    let kept: usize = stated().map(|of| of.judged.kept_blunders.len()).sum();
    format!(
        "Of {} sites whose profiles lie where they should, {} are invalid; of {} with a misplaced profile, {}. \
         The valid sites lost {lost} of {} good tie points and kept {kept} blunders.\n",
        misplaced(false, true) + misplaced(false, false),
        misplaced(false, false),
        misplaced(true, true) + misplaced(true, false),
        misplaced(true, false),
        good + lost,
    )
}

const HEAD: &str = "\n| quantity | values | error, rms | stated, rms | ratio (95 %) | beyond 3 σ |\n|---|---:|---:|---:|---:|---:|\n";

const INTRODUCTION: &str = "\
# Stated against true

areograph states a standard deviation of every result. This page compares these standard deviations with true errors, in synthetic
missions whose truth is known. A test computes the tables (`tests/truth/truth/stated.rs`, in the long run) and writes this page.

The missions share few assumptions with areograph (`areograph scene --realistic`). The size of every kind of error is drawn for
each mission, over the range of its sources. Coordinates of shots contain a part of the attitude error of the images.
Profiles off nadir have the heights of their shift. Some profiles lie elsewhere. The camera is bent and its focal
length is in error. Errors of neighbouring tie points are correlated, and their size is not the stated one. The ground has different
roughness and exponents.

*Ratio* is the root mean square of errors over their stated standard deviations: 1 if the statement holds. Its interval of 95 %
counts independent values only. Invalid sites do not enter the tables, because their products are withheld from use.

Three statements are weaker than the others. The heights of the MOLA surface before the adjustment err by a third more than stated. Single
tie points exceed three standard deviations in height in 1.0 to 1.3 % of cases, where chance gives 0.3 %: their errors have long tails. A profile
that lies 0.5 to 0.7 km elsewhere can remain within the limit of the beam; its footprints then exceed three standard deviations.
";

/// The missions with one set of keys.
struct Variant {
    name: &'static str,
    sites: Vec<Site>,
}

impl Variant {
    #[allow(clippy::print_stdout, reason = "what was measured is worth reading")]
    fn flown(name: &'static str, keys: &'static str) -> Self {
        let sites = flown(&plans(keys));
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
        for site in variant.sites.iter().filter(|site| site.is_valid()) {
            let Some(stated) = &site.stated else { continue };
            let [error_m, sigma_m] = stated.ties.shared;
            let judged = &stated.judged;
            let before_m = judged.surface_off_m;
            let is_far = (0..3).any(|axis| error_m[axis].abs() > 2.7 * sigma_m[axis]);
            if is_far
                || before_m.abs() > 2.7 * judged.surface_sigma_m
                || !judged.kept_blunders.is_empty()
            {
                println!(
                    "{}: {:.1} {:.1} {:.1} of {:.1} {:.1} {:.1} m; before {before_m:.1} of {:.1} m; kept {:?}",
                    site.name,
                    error_m.x,
                    error_m.y,
                    error_m.z,
                    sigma_m.x,
                    sigma_m.y,
                    sigma_m.z,
                    judged.surface_sigma_m,
                    judged.kept_blunders
                );
            }
        }
        variant
    }

    fn quantities(&self) -> Vec<Quantity> {
        let valid = self.sites.iter().filter(|site| site.is_valid());
        let stated: Vec<&Stated> = valid.filter_map(|site| site.stated.as_ref()).collect();
        quantities(&stated)
    }

    fn section(&self) -> String {
        let mut text = format!("\n## With {}\n\n{}{HEAD}", self.name, counts(&self.sites));
        for quantity in self.quantities() {
            let _infallible = writeln!(text, "{}", quantity.line());
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
    }
}

#[test]
fn statements_hold_where_the_world_is_not_that_of_the_estimator() {
    let variants = &KEYS[..if long() { KEYS.len() } else { 1 }];
    let variants = variants
        .iter()
        .map(|(name, keys)| Variant::flown(name, keys));
    let variants: Vec<Variant> = variants.collect();
    if long() {
        let mut page = INTRODUCTION.to_owned();
        for variant in &variants {
            page += &variant.section();
        }
        kept::is_up_to_date(PAGE, &page);
    }
    for variant in &variants {
        variant.assert_holds();
    }
}
