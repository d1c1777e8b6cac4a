//! Of rival kernel sets the one whose trajectory is closest to the mean of all.

use serde::{Deserialize, Serialize};

use super::{
    check::find_profiles,
    compare::{Compared, Request, RivalSet, compare_kernels},
    kernels::{load_kernels, load_rivals, wanted},
};
use crate::{
    config::SiteConfig,
    error::{Place, Result},
    spice::{KernelRole, Session, Wanted},
    stages::tag_times::tag_times,
    store::manifest::{FileEntry, KernelChoiceEntry},
};

/// Which set was chosen, and by which distances.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct KernelChoice {
    /// Index of the chosen set.
    pub(super) chosen: usize,
    /// All sets, as the manifest tells of them.
    pub(super) entries: Vec<KernelChoiceEntry>,
    /// The choice and what was left out, one sentence each.
    pub(super) notes: Vec<String>,
}

/// Compares the trajectories of at least two sets over the positions that the site needs.
///
/// # Errors
/// As [`compare_kernels`].
pub(super) fn choose_kernels(
    config: &SiteConfig,
    wanted: &Wanted,
    rivals: &[RivalSet],
) -> Result<KernelChoice> {
    if wanted.positions.duration_s() <= 0.0 {
        let first = &rivals[0].id;
        return Ok(KernelChoice {
            chosen: 0,
            entries: Vec::new(),
            notes: vec![format!(
                "kernel set {first} is used: no position is needed by which the sets could be compared"
            )],
        });
    }
    let request = Request {
        wanted: Some(wanted),
        bias: config.pointing.ck_bias,
        attitudes: false,
        clocks: !config.images.is_empty(),
    };
    let compared = compare_kernels(rivals, &request)?;
    Ok(KernelChoice {
        chosen: compared.orbit.closest,
        entries: entries(rivals, &compared),
        notes: notes(&compared),
    })
}

/// The rival sets of the configuration; none when it names one source of kernels.
///
/// # Errors
/// Kernels that cannot be read.
pub fn rival_sets(config: &SiteConfig) -> Result<Vec<RivalSet>> {
    load_rivals(config).in_site(&config.site)
}

/// The times at which a site reads kernels, found by the stages that need no orbit; nothing is stored.
///
/// # Errors
/// What those stages say of labels, clocks and PEDR files.
pub fn wanted_by_site(config: &SiteConfig) -> Result<Wanted> {
    let clocks = load_kernels(config, &Wanted::default(), 0).in_site(&config.site)?;
    let session = Session::open(&clocks)?;
    let images = tag_times(&config.images, &session).in_site(&config.site)?;
    drop(session);
    let profiles = find_profiles(config, &images).in_site(&config.site)?;
    Ok(wanted(config, &images, &profiles))
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
            "kernel set {} is the first of several that are equally close; as close: {}",
            orbit.closest().set,
            orbit.tied_sets().collect::<Vec<_>>().join(", ")
        ));
    }
    notes.extend(compared.left_out.iter().map(|left_out| {
        format!(
            "kernel set {}: no {} for UTC {} .. {} ({:.3} s), left out of the comparison of sets",
            left_out.set,
            left_out.what,
            left_out.utc[0],
            left_out.utc[1],
            left_out.interval.duration_s()
        )
    }));
    notes
}
