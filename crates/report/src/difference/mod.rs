//! Differences between two runs of a site, read only from their published products.
//!
//! `A` is the earlier run and `B` the later one, by the order of the arguments; a movement is
//! `B − A`. Items in both are compared by identity: shots by file, orbit, record and shot number,
//! samples of an image by their line, profiles, images, kernels, stages and products by name.
//!
//! Products are compared, not the cache: the result holds for the files in use, also for products from elsewhere. The
//! manifest therefore repeats the keys of the configuration.

mod answer;
mod changes;
mod error;
mod footprints;
mod images;
mod items;
mod limits;
mod movement;
mod outputs;
mod places;
mod words;

use std::path::Path;

use schemars::JsonSchema;
use serde::Serialize;

use areograph_base::error::{Locate, Result};
use areograph_products::read::{ImageDocument, ProfileDocument, read_image, read_ranges};
use areograph_store::{
    manifest::{Manifest, Verdict},
    published::{read_published, still_published},
};

pub use answer::{Answer, SiteAnswer, schema};
pub use changes::{Change, Texts, text};
pub use footprints::{FootprintsDifference, FootprintsMovement, ShotName};
pub use images::{ImageDifference, ImageMovement, SampleMovement};
pub use items::{ChangedItem, Item, Items};
pub use limits::Limits;
pub use movement::{Component, Size};
pub use outputs::{Pairs, pairs, sites};
pub use places::Moved;
pub use words::quantity;

use error::DifferenceError;

/// A product of every site, and of no other flow.
const RANGES: &str = "ranges.json";

/// All differences between two runs of one site.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct RunDifference {
    /// Always `areograph difference 1`.
    #[schemars(extend("const" = "areograph difference 1"))]
    pub format: &'static str,
    /// Site identifier.
    pub site: String,
    /// Outcome, in one word.
    pub outcome: Outcome,
    /// Limits applied to the movements.
    pub limits: Limits,
    /// Movements beyond the limits, and limits that could not be applied, one sentence each.
    pub beyond_limits: Vec<String>,
    /// The first run.
    pub a: RunEntry,
    /// The second run.
    pub b: RunEntry,
    /// Kernels by name.
    pub kernels: Items,
    /// Whether configuration keys or values differ, according to the configuration hashes.
    pub configuration_changed: bool,
    /// Configuration keys with different values, as written.
    pub configuration: Vec<Change>,
    /// Time corrections that differ.
    pub biases: Vec<Change>,
    /// Counts that differ.
    pub counts: Vec<Change>,
    /// Differing figures of the site; each figure is the largest of its kind.
    pub figures: Vec<Change>,
    /// Numbers of rejected shots that differ, by reason.
    pub rejected: Vec<Change>,
    /// Input problems of one run only; manifests quote only the first problems.
    pub complaints: Texts,
    /// Notes of one run only, except notes on kernels that a list names, which `kernels` contains.
    pub notes: Texts,
    /// Stages by fingerprint, which depends on the inputs of a stage, not on the outputs.
    pub stages: Items,
    /// Product files by content.
    pub products: Items,
    /// Range statistics of every profile.
    pub profiles: Vec<ProfileDifference>,
    /// Differences of the footprints.
    pub footprints: FootprintsDifference,
    /// Orientations of all images from the kernels, followed by the adjusted orientations.
    pub images: Vec<ImageDifference>,
    /// Some of the adjusted tie points that both runs have.
    #[serde(skip)]
    pub ties: Vec<Moved>,
}

/// Outcome of a comparison.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// Manifests are equal except for the time of publication.
    NothingChanged,
    /// Manifests differ, but no footprint, position or pointing moved; images may be sampled at different lines.
    NothingMoved,
    /// Footprints, positions or pointing moved, or footprints or images are in one run only.
    Moved,
    /// A movement exceeds a limit, or a limit could not be applied.
    BeyondLimit,
}

/// A run as described in the manifest.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct RunEntry {
    /// Version of the program.
    pub version: String,
    /// Time of publication of the products.
    pub finished_utc: String,
    /// Configuration file, without folders.
    pub configuration: String,
    /// BLAKE3 hash of the configuration keys and values.
    #[schemars(regex(pattern = "^[0-9a-f]{64}$"))]
    pub configuration_blake3: String,
    /// Whether the products are within the limits of the configuration, and the limits that they exceed.
    pub verdict: Verdict,
}

impl RunEntry {
    fn of(manifest: &Manifest) -> Self {
        Self {
            version: manifest.version.clone(),
            finished_utc: manifest.finished_utc.clone(),
            configuration: manifest.configuration.file_name.clone(),
            configuration_blake3: manifest.configuration.blake3.clone(),
            verdict: manifest.verdict.clone(),
        }
    }
}

/// A profile in one or both runs.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct ProfileDifference {
    /// Window, orbit and crossing.
    pub profile: String,
    /// Whether any value of the profile differs.
    pub changed: bool,
    /// Values in the first run.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub a: Option<ProfileDocument>,
    /// Values in the second run.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub b: Option<ProfileDocument>,
}

/// Compares the products in two folders of one site; movements beyond `limits` are reported.
///
/// # Errors
/// A folder without products, with incomplete ones or with others than its manifest states; products of
/// two sites; products that this version cannot read.
pub fn compare(a: &Path, b: &Path, limits: &Limits) -> Result<RunDifference> {
    let (first, second) = (read_published(a)?, read_published(b)?);
    if first.site != second.site {
        let error = DifferenceError::DifferentSites {
            a: first.site,
            b: second.site,
        };
        return Err(error).in_file(b);
    }
    let site = first.site.clone();
    let difference = of_manifests(&first, &second, limits);
    let read = read_movements(difference, [(a, &first), (b, &second)]).in_site(&site)?;
    for (folder, manifest) in [(a, &first), (b, &second)] {
        still_published(folder, manifest).in_site(&site)?;
    }
    Ok(limits.judged(read))
}

/// Differences between the manifests.
fn of_manifests(a: &Manifest, b: &Manifest, limits: &Limits) -> RunDifference {
    let mut b_when_a_was_made = b.clone();
    b_when_a_was_made.finished_utc.clone_from(&a.finished_utc);
    RunDifference {
        format: "areograph difference 1",
        site: a.site.clone(),
        outcome: if b_when_a_was_made == *a {
            Outcome::NothingChanged
        } else {
            Outcome::NothingMoved
        },
        limits: *limits,
        beyond_limits: Vec::new(),
        a: RunEntry::of(a),
        b: RunEntry::of(b),
        kernels: Items::between(&items::kernels(a), &items::kernels(b)),
        configuration_changed: a.configuration.blake3 != b.configuration.blake3,
        configuration: changes::between(&a.configuration.keys, &b.configuration.keys),
        biases: changes::between(&changes::biases(a), &changes::biases(b)),
        counts: changes::between(&a.counts, &b.counts),
        figures: changes::between(&a.figures, &b.figures),
        rejected: changes::between(&a.rejected, &b.rejected),
        complaints: Texts::between(&a.complaints.texts, &b.complaints.texts),
        notes: Texts::between(&a.notes, &b.notes),
        stages: Items::between(&items::stages(a), &items::stages(b)),
        products: Items::between(&items::products(a), &items::products(b)),
        profiles: Vec::new(),
        footprints: FootprintsDifference::default(),
        images: Vec::new(),
        ties: Vec::new(),
    }
}

/// Adds the differences between the products.
fn read_movements(
    mut difference: RunDifference,
    runs: [(&Path, &Manifest); 2],
) -> Result<RunDifference> {
    let [a, b] = runs.map(|(folder, _)| folder);
    let ranges = [read_ranges(&a.join(RANGES))?, read_ranges(&b.join(RANGES))?];
    let [first, second] = ranges.map(|document| document.profiles);
    difference.profiles = profiles(first, second);
    difference.footprints = footprints::between(a, b)?;
    let body = items::body(runs[0].1);
    difference.ties = places::ties(a, b)?;
    for which in images::ORIENTATIONS {
        let (orientation, _) = which;
        let images = |manifest: &Manifest| items::images(manifest, orientation);
        for name in items::united(&images(runs[0].1), &images(runs[1].1)) {
            let document = |(folder, manifest): (&Path, &Manifest)| {
                let file = folder.join(format!("images/{name}/{orientation}.json"));
                let there = images(manifest).contains(&name);
                there.then(|| read_image(&file)).transpose()
            };
            let documents: [Option<ImageDocument>; 2] = [document(runs[0])?, document(runs[1])?];
            let image = images::between(&name, which, [a, b], &documents, body)?;
            difference.images.push(image);
        }
    }
    Ok(difference)
}

/// Profiles of both runs, in the order of the first, then those only in the second.
fn profiles(a: Vec<ProfileDocument>, mut b: Vec<ProfileDocument>) -> Vec<ProfileDifference> {
    let mut profiles = Vec::with_capacity(a.len());
    for first in a {
        let place = b.iter().position(|second| second.id == first.id);
        let second = place.map(|place| b.remove(place));
        profiles.push(ProfileDifference {
            profile: first.id.clone(),
            changed: second.as_ref() != Some(&first),
            a: Some(first),
            b: second,
        });
    }
    profiles.extend(b.into_iter().map(|second| ProfileDifference {
        profile: second.id.clone(),
        changed: true,
        a: None,
        b: Some(second),
    }));
    profiles
}

impl RunDifference {
    /// Whether a footprint, a position or the pointing moved, or a footprint or an image is in one run
    /// only.
    #[must_use]
    pub fn moved(&self) -> bool {
        self.footprints.moved() || self.images.iter().any(ImageDifference::moved)
    }

    /// Whether the word of the verdict differs.
    #[must_use]
    pub fn verdict_changed(&self) -> bool {
        self.a.verdict.word() != self.b.verdict.word()
    }

    /// Whether both runs published the same products.
    #[must_use]
    pub fn is_unchanged(&self) -> bool {
        self.outcome == Outcome::NothingChanged
    }

    /// Order of presentation: changed verdicts first, the worst at the top; then movements.
    #[must_use]
    pub fn severity(&self) -> (bool, bool, bool, Outcome) {
        let (changed, after) = (self.verdict_changed(), &self.b.verdict);
        let worse = (
            changed && !after.valid,
            changed && !after.remarks.is_empty(),
        );
        (changed, worse.0, worse.1, self.outcome)
    }
}
