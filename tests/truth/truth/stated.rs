//! Stated standard deviations against truth, over missions whose errors have other sizes than those that areograph assumes, and
//! kinds that it does not model: the table of the guide.
//!
//! Seeds begin at 30,000. The long run writes the page with `SNAPSHOTS=overwrite`.

use std::fmt::Write as _;

use areograph::{geom::surface::tails, scene::Roughness};

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
const KEYS: [(&str, &str); 3] = [
    ("default values", ""),
    ("`common_bus`", "common_bus = \"yes\"\n"),
    (
        "`common_bus` and `relief_for_plan`",
        "common_bus = \"yes\"\nrelief_for_plan = \"yes\"\n",
    ),
];

/// Errors of one quantity with what is stated of them.
struct Quantity {
    name: String,
    unit: &'static str,
    pairs: Vec<Pair>,
    /// How many of them are independent.
    independent: usize,
    kind: Kind,
}

/// What a standard deviation states.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    /// The root mean square of normal errors.
    Normal,
    /// A bound: errors may be smaller.
    Bound,
    /// Half of the interval that contains 68.27 % of errors with the tails of the surface (`geom/surface/tails.rs`).
    Surface,
}

impl Kind {
    /// Largest ratio of the root mean square of errors.
    fn most(self) -> f64 {
        match self {
            // Three degrees of freedom: the square root of 3 over 1.197.
            Self::Surface => 1.45,
            _ => 1.25,
        }
    }

    /// Largest share of errors beyond three standard deviations.
    fn beyond(self) -> f64 {
        match self {
            Self::Surface => 1.0 - tails::probability(3.0),
            _ => 0.005,
        }
    }
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
        let low = if self.kind == Kind::Bound || !long() {
            0.0
        } else {
            chance[0].min(0.8)
        };
        let z = self.z();
        assert!(
            z > low && z < chance[1].max(self.kind.most()),
            "{}: {z:.2} of what is stated",
            self.line()
        );
        // As many as chance adds to it: of correlated errors all go together.
        let share = self.beyond() as f64 / self.pairs.len() as f64;
        let independent = self.independent as f64;
        let stated = self.kind.beyond();
        let most = stated + 3.0 * (stated / independent).sqrt() + 1.0 / independent;
        assert!(share <= most, "{}: {share} beyond 3 sigma", self.line());
    }
}

const fn bound_where(is_bound: bool) -> Kind {
    if is_bound { Kind::Bound } else { Kind::Normal }
}

/// The quantities that the adjustment states, over the valid sites.
fn quantities(sites: &[&Stated]) -> Vec<Quantity> {
    let count = sites.len();
    let mut all = Vec::new();
    let mut add = |name: &str, unit, pairs: Vec<Pair>, independent: usize, kind| {
        all.push(Quantity {
            name: name.to_owned(),
            unit,
            pairs,
            independent,
            kind,
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
            Kind::Normal,
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
            Kind::Normal,
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
        Kind::Surface,
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
            bound_where(axis == 2),
        );
    }
    for (axis, name) in [(0, "X"), (1, "Y"), (2, "Z, along the track")] {
        let cameras = sites.iter().flat_map(|site| &site.cameras);
        add(
            &format!("position of a camera, {name}"),
            "m",
            cameras.map(|camera| camera[axis]).collect(),
            2 * count,
            bound_where(axis < 2),
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
            bound_where(way == 0),
        );
    }
    all.retain(|of| !of.pairs.is_empty());
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

/// Tie points of the valid sites.
struct TieCounts {
    good: usize,
    lost: usize,
    kept_blunders: usize,
}

impl TieCounts {
    fn of(sites: &[Site]) -> Self {
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
        "Of {sound} sites whose profiles lie where they should, {refused} are invalid; of {misplaced} with a misplaced profile, {noticed}. \
         The valid sites lost {} of {} good tie points and kept {} blunders.\n",
        ties.lost, ties.good, ties.kept_blunders
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

Errors of single tie points have long tails: more of them exceed three standard deviations than by chance (0.3 %). Jitter about
roll, which moves heights, leaves no residuals, and that about pitch, which does, can be smaller. A misplaced profile can remain
within the limit of the beam; its footprints then exceed three standard deviations.

The standard deviation of the MOLA surface is half the interval that contains 68 % of errors. Craters between profiles make the
tails long: errors of withheld real profiles follow Student's distribution with three degrees of freedom. Their root mean square
is then 1.45 standard deviations, and 3.7 % of them exceed three.
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
