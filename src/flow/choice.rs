//! Chooses the rival kernel set whose trajectory is closest to the mean of all.

use std::sync::atomic::AtomicBool;

use serde::{Deserialize, Serialize};

use super::{
    compare::{Compared, Request, RivalSet, compare_kernels},
    kernels::load_rivals,
};
use crate::{
    config::SiteConfig,
    error::Result,
    files::InputFiles,
    spice::{KernelRole, RequiredCoverage, position_kernels},
    stage::{Input, Inputs, Stage},
    stage_inputs,
    stages::describe_kernels::Required,
    store::manifest::{FileEntry, KernelChoiceEntry},
    time::PointingBias,
};

/// The chosen set, and the distances on which the choice is based.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct KernelChoice {
    /// Index of the chosen set.
    pub chosen: usize,
    /// All sets, as entries of the manifest.
    pub entries: Vec<KernelChoiceEntry>,
    /// The choice and the exclusions, one sentence each.
    pub notes: Vec<String>,
}

stage_inputs! {
    /// The rival sets, and the positions over which they are compared.
    pub struct ChooseKernels<'a> {
        /// The sets.
        pub sets: RivalKernelSets<'a>,
        /// Times at which the site reads kernels.
        pub required: Required<'a>,
        /// Whether the clocks must agree: times of images depend on them.
        pub compare_clocks: &'a bool,
    }
}

/// Rival sets in the order of the configuration, with the kernels on which positions may depend.
#[derive(Debug)]
pub struct RivalKernelSets<'a>(&'a [RivalSet]);

impl<'a> RivalKernelSets<'a> {
    /// These sets, which contain only kernels on which positions may depend.
    pub(super) const fn new(sets: &'a [RivalSet]) -> Self {
        Self(sets)
    }
}

impl Input for RivalKernelSets<'_> {
    fn add_to(&self, _field: &str, inputs: &mut Inputs) {
        let names: Vec<&str> = self.0.iter().map(|set| &*set.id).collect();
        inputs.setting("kernels.sets (names)", &names);
        for set in self.0 {
            let sort = format!("kernel of set {}", set.id);
            for (place, kernel) in set.kernels.kernels().iter().enumerate() {
                inputs.file(&sort, &kernel.path, Some(place), &kernel.blake3);
            }
        }
    }
}

impl Stage for ChooseKernels<'_> {
    const NAME: &'static str = "choose_kernels";
    const METHOD: u32 = 2;
    type Output = KernelChoice;
    stage_inputs!(fingerprint);

    fn run(&self, _stop: &AtomicBool) -> Result<KernelChoice> {
        let nothing = RequiredCoverage::default();
        let required = self.required.0.unwrap_or(&nothing);
        choose_kernels(self.sets.0, required, *self.compare_clocks)
    }
}

/// Compares the trajectories of at least two sets over the positions that the site needs.
///
/// # Errors
/// As [`compare_kernels`].
fn choose_kernels(
    rivals: &[RivalSet],
    required: &RequiredCoverage,
    clocks: bool,
) -> Result<KernelChoice> {
    if required.positions.duration_s() <= 0.0 {
        let first = &rivals[0].id;
        return Ok(KernelChoice {
            chosen: 0,
            entries: Vec::new(),
            notes: vec![format!(
                "kernel set {first} is used: the site requires no positions at which the sets could be compared"
            )],
        });
    }
    let request = Request {
        stage: ChooseKernels::NAME,
        required: Some(required),
        bias: PointingBias::from_seconds(0.0),
        attitudes: false,
        clocks,
    };
    let compared = compare_kernels(rivals, &request)?;
    Ok(KernelChoice {
        chosen: compared.orbit.closest,
        entries: entries(rivals, &compared),
        notes: notes(&compared),
    })
}

/// The rival sets of the configuration with the kernels on which positions may depend; empty if it names one source.
///
/// # Errors
/// Kernels that cannot be read.
pub(super) fn rival_positions(config: &SiteConfig, files: &InputFiles) -> Result<Vec<RivalSet>> {
    let rivals = load_rivals(config, files)?.into_iter().map(|rival| {
        Ok(RivalSet {
            kernels: position_kernels(&rival.kernels)?,
            id: rival.id,
        })
    });
    rivals.collect()
}

fn entries(rivals: &[RivalSet], compared: &Compared) -> Vec<KernelChoiceEntry> {
    let orbit = &compared.orbit;
    let sets = rivals.iter().zip(&orbit.deviations).enumerate();
    sets.map(|(index, (rival, deviation))| {
        let kernels = rival.kernels.kernels().iter();
        let ephemerides = kernels.filter(|kernel| kernel.role == KernelRole::Spk);
        let [radial, along, cross] = deviation.size.components;
        KernelChoiceEntry {
            set: rival.id.clone(),
            chosen: index == orbit.closest,
            epochs: orbit.epochs.len() as u64,
            distance_rms_m: deviation.size.rms,
            distance_max_m: deviation.size.max,
            radial_mean_m: radial.mean,
            along_track_mean_m: along.mean,
            cross_track_mean_m: cross.mean,
            ephemerides: ephemerides
                .map(|kernel| FileEntry {
                    name: kernel.file_name(),
                    blake3: kernel.blake3.clone(),
                })
                .collect(),
        }
    })
    .collect()
}

fn notes(compared: &Compared) -> Vec<String> {
    let orbit = &compared.orbit;
    let distances: Vec<String> = orbit
        .deviations
        .iter()
        .map(|deviation| format!("{} {:.3} m", deviation.set, deviation.size.rms))
        .collect();
    let mut notes = vec![format!(
        "kernel set {} is used: its trajectory is closest to the mean of all (root mean square distance \
         at {} epochs: {})",
        orbit.closest().set,
        orbit.epochs.len(),
        distances.join(", ")
    )];
    if !orbit.tied.is_empty() {
        notes.push(format!(
            "kernel set {} is the first of several that are equally close: {}",
            orbit.closest().set,
            orbit.tied_sets().collect::<Vec<_>>().join(", ")
        ));
    }
    notes.extend(compared.uncovered_lines());
    notes
}
