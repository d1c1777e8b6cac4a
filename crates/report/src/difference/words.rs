//! The difference in sentences, for terminals and the head of the page.

use super::{
    Outcome, RunDifference,
    changes::{Change, Texts, text},
    images::{ImageDifference, ImageMovement},
    items::{Item, Items},
    movement::{Component, ROUNDING, Size},
};
use crate::html::counted;
use areograph_base::minus::{self, MINUS};
use areograph_geom::statistics::largest;
use areograph_store::manifest::Verdict;

/// Texts of one kind that a sentence quotes; the JSON answer has all.
const FEW: usize = 3;

/// A number with three decimals, or two digits when it is too small for them; rounding errors are 0.
#[must_use]
pub fn quantity(value: f64) -> String {
    if value.abs() <= ROUNDING {
        return "0".to_owned();
    }
    // Two digits, in decimals where readable.
    let text = match value.abs() {
        0.01.. => format!("{value:.3}"),
        0.001.. => format!("{value:.4}"),
        0.000_1.. => format!("{value:.5}"),
        _ => {
            let text = format!("{value:.1e}");
            match text.split_once('e') {
                Some((digits, power)) => format!("{digits} × 10{}", raised(power)),
                None => text,
            }
        }
    };
    text.replace('-', &MINUS.to_string())
}

/// A power of ten behind its base.
fn raised(power: &str) -> String {
    const DIGITS: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    let digit = |letter: char| {
        letter
            .to_digit(10)
            .map_or('⁻', |digit| DIGITS[digit as usize])
    };
    power.chars().map(digit).collect()
}

impl RunDifference {
    /// The outcome in one sentence, without a full stop.
    #[must_use]
    pub fn headline(&self) -> String {
        match self.outcome {
            Outcome::NothingChanged => "nothing changed".to_owned(),
            Outcome::NothingMoved => "nothing moved".to_owned(),
            Outcome::Moved => {
                let moved = match self.farthest() {
                    none if none.is_empty() => "nothing in both moved".to_owned(),
                    moved => format!("moved: {}", moved.join("; ")),
                };
                let all = [vec![moved], self.not_compared()].concat();
                all.join("; ")
            }
            Outcome::BeyondLimit => format!("BEYOND THE LIMIT: {}", few(&self.beyond_limits)),
        }
    }

    /// The largest movements of each kind.
    fn farthest(&self) -> Vec<String> {
        let mut sentences = self.footprints_moved();
        let images = || {
            self.images
                .iter()
                .filter_map(|image| image.movement.as_ref())
        };
        let up_to = |value: fn(&ImageMovement) -> f64| largest(images().map(value)).unwrap_or(0.0);
        let time_s = up_to(|movement| movement.time_s.max_abs);
        let distance_m = up_to(|movement| movement.distance_m.max);
        let turn_arcsec = up_to(|movement| movement.turn_arcsec.max);
        let ground_m = up_to(|movement| movement.boresight_ground_m.map_or(0.0, |size| size.max));
        if images().any(|movement| movement.distance_m.moved()) {
            sentences.push(format!("cameras by up to {} m", quantity(distance_m)));
        }
        if images().any(|movement| movement.turn_arcsec.moved()) {
            sentences.push(format!(
                "pointing by up to {} arcsec",
                quantity(turn_arcsec)
            ));
        }
        if images().any(|movement| movement.boresight_ground_m.is_some_and(|size| size.moved())) {
            sentences.push(format!(
                "boresights on the ground by up to {} m",
                quantity(ground_m)
            ));
        }
        if images().any(|movement| movement.time_s.moved()) {
            sentences.push(format!("line times by up to {} s", quantity(time_s)));
        }
        sentences
    }

    /// Changes, one sentence each, the inputs first; unchanged items are omitted.
    #[must_use]
    pub fn sentences(&self) -> Vec<String> {
        let mut sentences = Vec::new();
        // A changed verdict comes first.
        let verdict_changed = self.verdict_changed();
        if verdict_changed {
            sentences.push(self.verdict_sentence());
        }
        sentences.extend(self.of_inputs());
        sentences.extend(values("biases", &self.biases));
        sentences.extend(values("counts", &self.counts));
        sentences.extend(values("figures", &self.figures));
        sentences.extend(values("rejected shots", &self.rejected));
        sentences.extend(texts("complaints", &self.complaints));
        sentences.extend(texts("notes", &self.notes));
        if self.outcome != Outcome::NothingChanged {
            sentences.push(self.stages_sentence());
            sentences.extend(self.of_movements(|_| true));
        }
        if !verdict_changed {
            sentences.push(self.verdict_sentence());
        }
        sentences
    }

    /// The sentences without the contents of the tables below, and without unmoved images.
    #[must_use]
    pub fn first_sentences(&self) -> Vec<String> {
        let mut sentences = self.of_inputs();
        sentences.extend(texts("complaints", &self.complaints));
        sentences.extend(texts("notes", &self.notes));
        if self.outcome != Outcome::NothingChanged {
            sentences.extend(self.of_movements(ImageDifference::differs));
        }
        if !self.verdict_changed() {
            sentences.push(self.verdict_sentence());
        }
        sentences
    }

    /// Program, kernels and configuration.
    fn of_inputs(&self) -> Vec<String> {
        let mut sentences = Vec::new();
        if self.a.version != self.b.version {
            sentences.push(format!(
                "areograph: {} → {}",
                self.a.version, self.b.version
            ));
        }
        sentences.extend(items("kernels", &self.kernels));
        if self.configuration_changed {
            sentences.push(self.configuration_sentence());
        }
        sentences
    }

    /// Footprints, profiles and the `wanted` images.
    fn of_movements(&self, wanted: fn(&ImageDifference) -> bool) -> Vec<String> {
        let mut sentences = vec![format!("footprints: {}", self.footprints_sentence())];
        sentences.extend(self.profiles_sentence());
        let images = self.images.iter().filter(|image| wanted(image));
        sentences.extend(images.map(image_sentence));
        sentences
    }

    fn configuration_sentence(&self) -> String {
        let keys: Vec<String> = self.configuration.iter().map(change).collect();
        format!("configuration: {}", keys.join("; "))
    }

    fn stages_sentence(&self) -> String {
        let names = |names: Vec<&str>| match names.len() {
            0 => "none".to_owned(),
            _ => names.join(", "),
        };
        let stages = &self.stages;
        let moved = stages.changed.iter().map(|stage| &*stage.name);
        let new = stages.added.iter().map(|stage| &*stage.name);
        let mut sentences = vec![format!(
            "stages with changed inputs: {}",
            names(moved.chain(new).collect())
        )];
        if !stages.removed.is_empty() {
            let gone = stages.removed.iter().map(|stage| &*stage.name).collect();
            sentences.push(format!("removed: {}", names(gone)));
        }
        sentences.push(format!("the same: {}", stages.unchanged));
        sentences.join("; ")
    }

    /// Movement of footprints.
    fn footprints_moved(&self) -> Vec<String> {
        let Some(movement) = &self.footprints.movement else {
            return Vec::new();
        };
        let mut sentences = Vec::new();
        if movement.moved > 0 {
            sentences.push(format!(
                "{} of {} footprints by up to {} m",
                movement.moved,
                self.footprints.matched,
                quantity(movement.distance_m.max)
            ));
        }
        if movement.topography_m.moved() {
            let heights = signed(movement.topography_m, "m");
            sentences.push(format!("heights of footprints by {heights}"));
        }
        if movement.time_s.moved() {
            let times = signed(movement.time_s, "s");
            sentences.push(format!("times of footprints by {times}"));
        }
        sentences
    }

    /// Items that are in one run only, or cannot be compared.
    fn not_compared(&self) -> Vec<String> {
        let footprints = &self.footprints;
        let unmatched = unmatched(footprints.only_in_a, footprints.only_in_b, " footprints");
        let mut sentences: Vec<String> = unmatched.collect();
        let without = |only_in_one: bool| {
            let images = self.images.iter().filter(|image| image.movement.is_none());
            images
                .filter(|image| image.only_in_one() == only_in_one)
                .count()
        };
        for (count, why) in [
            (without(true), "in one run only"),
            (without(false), "without a line in common"),
        ] {
            if count > 0 {
                sentences.push(format!("{} {why}", counted(count, "image")));
            }
        }
        sentences
    }

    /// Footprints, without the word.
    fn footprints_sentence(&self) -> String {
        let footprints = &self.footprints;
        let mut sentences = vec![format!("{} in both", footprints.matched)];
        if let Some(movement) = &footprints.movement {
            sentences.push(match &movement.farthest {
                None => "none moved".to_owned(),
                Some(farthest) => format!(
                    "{} moved, mean movement of all {} m, largest {} m ({} record {} shot {})",
                    movement.moved,
                    quantity(movement.distance_m.mean),
                    quantity(movement.distance_m.max),
                    farthest.source_file,
                    farthest.record,
                    farthest.shot
                ),
            });
            if movement.topography_m.moved() {
                sentences.push(format!("heights by {}", signed(movement.topography_m, "m")));
            }
            if movement.time_s.moved() {
                sentences.push(format!("times by {}", signed(movement.time_s, "s")));
            }
        }
        sentences.extend(unmatched(footprints.only_in_a, footprints.only_in_b, ""));
        sentences.join(", ")
    }

    fn profiles_sentence(&self) -> Option<String> {
        let changed = self.profiles.iter().filter(|profile| profile.changed);
        let sentences: Vec<String> = changed
            .map(|profile| match (&profile.a, &profile.b) {
                (Some(a), Some(b)) => {
                    let change_m = b.range_minus_distance_m.mean - a.range_minus_distance_m.mean;
                    format!("{} mean {} m", profile.profile, minus::signed(change_m, 3))
                }
                (Some(_), None) => format!("{} only in A", profile.profile),
                _ => format!("{} only in B", profile.profile),
            })
            .collect();
        (!sentences.is_empty()).then(|| format!("range residuals of profiles: {}", few(&sentences)))
    }

    fn verdict_sentence(&self) -> String {
        let (a, b) = (&self.a.verdict, &self.b.verdict);
        if (a.word(), &a.reasons, &a.remarks) == (b.word(), &b.reasons, &b.remarks) {
            return format!("verdict: {} in both", a.word());
        }
        let all = |verdict: &Verdict| [&verdict.reasons[..], &verdict.remarks].concat();
        let differ = Texts::between(&all(a), &all(b));
        let mut sentences = vec![format!("verdict: {} → {}", a.word(), b.word())];
        for (texts, tense) in [(&differ.only_in_a, "no longer"), (&differ.only_in_b, "now")] {
            if !texts.is_empty() {
                sentences.push(format!("{tense}: {}", texts.join("; ")));
            }
        }
        sentences.join("; ")
    }
}

/// Mean with its sign and largest size.
fn signed(component: Component, unit: &str) -> String {
    let Component { mean, max_abs } = component;
    format!(
        "{} {unit} on average, at most {} {unit}",
        quantity(mean),
        quantity(max_abs)
    )
}

fn change(change: &Change) -> String {
    let [a, b] = [&change.a, &change.b].map(|value| text(value.as_ref()));
    format!("{} {a} → {b}", change.what)
}

fn values(what: &str, changes: &[Change]) -> Option<String> {
    let sentences: Vec<String> = changes.iter().map(change).collect();
    (!sentences.is_empty()).then(|| format!("{what}: {}", sentences.join("; ")))
}

fn texts(what: &str, texts: &Texts) -> Option<String> {
    let runs = [(&texts.only_in_a, "A"), (&texts.only_in_b, "B")].into_iter();
    let sentences: Vec<String> = runs
        .filter(|(texts, _)| !texts.is_empty())
        .map(|(texts, whose)| format!("only in {whose}: {}", few(texts)))
        .collect();
    (!texts.is_empty()).then(|| format!("{what} {}", sentences.join("; ")))
}

/// The first texts; the others are counted.
fn few(texts: &[String]) -> String {
    let sentences = texts[..texts.len().min(FEW)].join("; ");
    match texts.len().saturating_sub(FEW) {
        0 => sentences,
        more => format!("{sentences}; and {more} more"),
    }
}

fn items(what: &str, items: &Items) -> Option<String> {
    let named = |name: &str, role: Option<&String>, happened: &str| match role {
        Some(role) => format!("{name} ({role}) {happened}"),
        None => format!("{name} {happened}"),
    };
    let unmatched = |items: &[Item], happened: &str| -> Vec<String> {
        let items = items.iter();
        items
            .map(|item| named(&item.name, item.role.as_ref(), happened))
            .collect()
    };
    let changed = items.changed.iter();
    let mut sentences: Vec<String> = changed
        .map(|item| named(&item.name, item.role.as_ref(), "changed"))
        .collect();
    sentences.extend(unmatched(&items.removed, "removed"));
    sentences.extend(unmatched(&items.added, "added"));
    if items.reordered {
        sentences.push("another load order".to_owned());
    }
    (!items.is_empty()).then(|| {
        format!(
            "{what}: {}; {} unchanged",
            sentences.join(", "),
            items.unchanged
        )
    })
}

fn image_sentence(image: &ImageDifference) -> String {
    let name = &image.image;
    let Some(movement) = &image.movement else {
        return match (image.valid_in_a, image.valid_in_b) {
            (Some(_), None) => format!("image {name}: only in A"),
            (None, _) => format!("image {name}: only in B"),
            _ => format!("image {name}: no sample at the same line in both runs"),
        };
    };
    let mut sentences = Vec::new();
    sentences.push(if movement.distance_m.moved() {
        format!(
            "moved by {} m on average, up to {} m (mean radial {}, along {}, cross {})",
            quantity(movement.distance_m.mean),
            quantity(movement.distance_m.max),
            quantity(movement.radial_m.mean),
            quantity(movement.along_m.mean),
            quantity(movement.cross_m.mean)
        )
    } else {
        "not moved".to_owned()
    });
    sentences.push(if movement.turn_arcsec.moved() {
        format!(
            "rotated by {} arcsec on average, up to {} (mean about x {}, y {}, z {})",
            quantity(movement.turn_arcsec.mean),
            quantity(movement.turn_arcsec.max),
            quantity(movement.about_x_arcsec.mean),
            quantity(movement.about_y_arcsec.mean),
            quantity(movement.about_z_arcsec.mean)
        )
    } else {
        "not turned".to_owned()
    });
    if let Some(ground_m) = movement.boresight_ground_m.filter(Size::moved) {
        sentences.push(format!(
            "boresight moved on the ground by {} m on average, up to {} m",
            quantity(ground_m.mean),
            quantity(ground_m.max)
        ));
    }
    if movement.time_s.moved() {
        let times = signed(movement.time_s, "s");
        sentences.push(format!("line times differ by {times}"));
    }
    let (a, b) = (image.samples_only_in_a, image.samples_only_in_b);
    sentences.extend(unmatched(a, b, " samples"));
    format!("image {name}: {}", sentences.join("; "))
}

/// Items in one run only.
fn unmatched(in_a: usize, in_b: usize, what: &'static str) -> impl Iterator<Item = String> {
    let runs = [(in_a, "A"), (in_b, "B")].into_iter();
    runs.filter(|(count, _)| *count > 0)
        .map(move |(count, whose)| format!("{count}{what} only in {whose}"))
}
