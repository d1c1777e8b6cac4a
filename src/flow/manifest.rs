//! What the manifest says of a run.

use std::collections::BTreeMap;

use super::{Stage, results::Results};
use crate::{
    altimetry::BiasScope,
    config::SiteConfig,
    error::Result,
    files::file_name,
    frames::MarsIau2000,
    geom::{attitude::rotation_vector, mars_rotation::mars_rotation},
    products::KernelLine,
    spice::{KernelSet, Session},
    stages::compare_pairs::PairComparison,
    store::manifest::{
        BiasEntry, Complaints, ConfigurationEntry, KernelEntry, Manifest, ProductEntry, StageEntry,
        Verdict, figures,
    },
    time::{Et, Intervals},
    units::RADIANS_PER_DEGREE,
};

/// Complaints that the manifest quotes; all are counted.
const COMPLAINTS_QUOTED: usize = 100;

/// A PCK that turns Mars by more than this against the IAU 2000 formula holds another model, radians
/// (1e-7 rad is 0.3 m on the ground; the models differ by 4e-3 rad).
const PCK_TOLERANCE_RAD: f64 = 1e-7;

/// What is known of the products once they are made.
pub(super) struct Account {
    pub(super) invalid_because: Vec<String>,
    pub(super) kernels: Vec<KernelEntry>,
    pub(super) products: Vec<ProductEntry>,
    pub(super) notes: Vec<String>,
    pub(super) remarks: Vec<String>,
    pub(super) complaints: Vec<String>,
}

fn largest_disagreement_m(pairs: &[PairComparison]) -> Option<f64> {
    let pairs = pairs.iter().map(|pair| pair.disagreement_m);
    pairs.max_by(f64::total_cmp)
}

impl Results<'_> {
    /// What a reader of the products should know, one sentence each.
    pub(super) fn notes(&self) -> Vec<String> {
        let choice = self.choice.iter().flat_map(|choice| &choice.value.notes);
        let mut notes: Vec<String> = choice.chain(self.kernels.notes()).cloned().collect();
        notes.extend(self.found.value.notes.iter().cloned());
        notes.extend(self.converted.value.notes.iter().cloned());
        for image in &self.images.value {
            notes.extend(
                image
                    .notes
                    .iter()
                    .map(|note| format!("image {}: {note}", image.id)),
            );
        }
        notes.extend(self.geometric.iter().flat_map(|of| of.ties.value.notes()));
        notes
    }

    /// Shots inside a window that were left out, by reason.
    pub(super) fn rejected(&self) -> BTreeMap<String, u64> {
        let rejected = self.found.value.rejected.iter();
        rejected
            .map(|(reason, count)| (reason.to_string(), *count))
            .collect()
    }

    /// The largest figures of the site.
    fn figures(&self) -> BTreeMap<String, f64> {
        let profiles = self.ranges.value.profiles.iter();
        let means = profiles.map(|ranges| ranges.range_minus_distance_m.mean.abs());
        let models = || self.models.iter().map(|model| &model.value);
        let positions = models().map(|model| model.second_order.position_rmse_m());
        let pointings = models().map(|model| model.rotation_vector.rmse_rad());
        [
            (figures::RANGE_MEAN_M, means.max_by(f64::total_cmp)),
            (figures::POSITION_RMSE_M, positions.max_by(f64::total_cmp)),
            (figures::POINTING_RMSE_RAD, pointings.max_by(f64::total_cmp)),
            (
                figures::DISAGREEMENT_M,
                self.geometric
                    .and_then(|of| largest_disagreement_m(&of.intersected.value.pairs)),
            ),
            (
                figures::ADJUSTED_DISAGREEMENT_M,
                self.geometric
                    .and_then(|of| largest_disagreement_m(&of.readjusted.value.intersected.pairs)),
            ),
            (
                figures::ADJUSTMENT_SIGMA0,
                self.geometric.map(|of| of.adjusted.value.summary.sigma0),
            ),
        ]
        .into_iter()
        .filter_map(|(name, figure)| Some((name.to_owned(), figure?)))
        .collect()
    }

    /// The manifest of these results.
    pub(super) fn manifest(&self, account: Account, fingerprint: String) -> Manifest {
        let Account {
            invalid_because,
            kernels,
            products,
            notes,
            remarks,
            complaints,
        } = account;
        let config = self.config;
        let found = &self.found.value;
        let mut stages: Vec<StageEntry> = self
            .stages()
            .into_iter()
            .map(|(name, _, fingerprint)| StageEntry { name, fingerprint })
            .collect();
        stages.push(StageEntry {
            name: Stage::Publish.name().to_owned(),
            fingerprint,
        });
        let registered = || self.registrations.iter().map(|image| &image.value);
        let counts = BTreeMap::from([
            ("frames_read".to_owned(), found.frames_read),
            ("shots_read".to_owned(), found.shots_read),
            (
                "footprints".to_owned(),
                self.converted.value.footprints.len() as u64,
            ),
            ("profiles".to_owned(), self.profiles.value.len() as u64),
            ("images".to_owned(), self.images.value.len() as u64),
            (
                "registered".to_owned(),
                registered().map(|image| image.points.len() as u64).sum(),
            ),
            (
                "registered_inside".to_owned(),
                registered()
                    .map(|image| image.points.inside_count() as u64)
                    .sum(),
            ),
            (
                "registration_rejected".to_owned(),
                registered().flat_map(|image| image.rejected.values()).sum(),
            ),
        ]);
        Manifest {
            tool: "areograph".to_owned(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            site: config.site.clone(),
            verdict: Verdict {
                valid: invalid_because.is_empty(),
                reasons: invalid_because,
                remarks,
            },
            configuration: ConfigurationEntry {
                file_name: file_name(&config.file),
                blake3: config.blake3.clone(),
                keys: config.keys.clone(),
            },
            biases: biases(config),
            kernels,
            kernel_choice: self
                .choice
                .map_or_else(Vec::new, |choice| choice.value.entries.clone()),
            stages,
            products,
            counts,
            figures: self.figures(),
            rejected: self.rejected(),
            complaints: Complaints {
                count: found.complaint_counts.values().sum::<u64>() + self.tie_complaints(),
                texts: complaints.into_iter().take(COMPLAINTS_QUOTED).collect(),
            },
            notes,
            finished_utc: chrono::Utc::now().format("%Y-%m-%dT%H:%M:%SZ").to_string(),
        }
    }
}

fn biases(config: &SiteConfig) -> Vec<BiasEntry> {
    let scope = match config.mola_clock.scope {
        BiasScope::SpkLookup => "spacecraft position in the range check",
        BiasScope::Rotation => "rotation of Mars into IAU 2000",
        BiasScope::Both => {
            "spacecraft position in the range check, and rotation of Mars into IAU 2000"
        }
        BiasScope::None => "nothing",
    };
    vec![
        BiasEntry {
            name: "ck_bias".to_owned(),
            correction_s: config.pointing.ck_bias.seconds(),
            scope: "attitude look-ups".to_owned(),
            source: config.pointing.source.clone(),
        },
        BiasEntry {
            name: "mola_clock".to_owned(),
            correction_s: config.mola_clock.correction_s(),
            scope: scope.to_owned(),
            source: config.mola_clock.source.clone(),
        },
    ]
}

/// Kernels with what the run read of each: where several hold the same instant, the last one is read.
pub(super) fn kernel_entries(session: &Session, results: &Results<'_>) -> Result<Vec<KernelEntry>> {
    let tolerance_s = results.config.kernels.ck_tolerance_s;
    let in_use = session.coverage_in_use(results.wanted, tolerance_s)?;
    let entries = results.kernels.kernels().iter().enumerate();
    Ok(entries
        .map(|(index, kernel)| {
            let own = in_use.iter().find(|(of, _)| *of == index);
            KernelEntry {
                name: kernel.file_name(),
                role: kernel.role.to_string(),
                bytes: kernel.bytes,
                blake3: kernel.blake3.clone(),
                coverage_used: own.map_or_else(Vec::new, |(_, used)| used.as_slice().to_vec()),
            }
        })
        .collect())
}

/// Kernels with all that they hold of MGS, as reports show them.
pub(super) fn kernel_lines(session: &Session, kernels: &KernelSet) -> Result<Vec<KernelLine>> {
    let coverage = session.coverage()?;
    let lines = kernels.kernels().iter().enumerate();
    Ok(lines
        .map(|(index, kernel)| KernelLine {
            name: kernel.file_name(),
            role: kernel.role.to_string(),
            bytes: kernel.bytes,
            blake3: kernel.blake3.clone(),
            held: coverage
                .per_kernel
                .iter()
                .find(|(of, _)| *of == index)
                .map(|(_, held)| held.clone()),
        })
        .collect())
}

/// Products use the IAU 2000 formula whatever the PCK says; whoever loads `kernels.tm` should know.
pub(super) fn pck_note(session: &Session, wanted: &Intervals) -> Option<String> {
    let at = wanted
        .as_slice()
        .first()
        .map_or(Et::from_seconds(0.0), |interval| interval.start);
    let ours = *mars_rotation::<MarsIau2000>(at).matrix();
    // Without a PCK there is nothing to compare, and nothing that could mislead.
    let theirs = session.mars_matrix(at).ok()?;
    let turn_rad = rotation_vector(&(theirs * ours.transpose())).norm();
    (turn_rad > PCK_TOLERANCE_RAD).then(|| {
        format!(
            "the PCK turns IAU_MARS by {:.5}° against IAU 2000; products use the IAU 2000 constants",
            turn_rad / RADIANS_PER_DEGREE
        )
    })
}
