//! What each stage depends on. The lists are the method's dependencies, read beside [`super::run_site`].

use std::{
    path::{Path, PathBuf},
    sync::atomic::AtomicBool,
};

use rayon::prelude::*;

use super::RivalSet;
use crate::{
    config::SiteConfig,
    error::{Result, Stopped},
    files::{file_name, hash_file},
    spice::{KernelRole, KernelSet, Wanted},
    stages::tag_times::ImageTimes,
    store::fingerprint::Parts,
};

/// Raised when a stage computes something else from the same parts, or lays its output out anew.
const METHOD: u32 = 10;

/// Image keys, label files and all text kernels, among them those that convert times.
pub(super) fn tag_times(config: &SiteConfig, kernels: &KernelSet) -> Result<Parts> {
    let mut parts = Parts::new(METHOD);
    for image in &config.images {
        parts = parts
            .key(&format!("images.{}", image.id), &image.fields)
            .key(
                &format!("images.{}.instrument", image.id),
                &image.instrument,
            );
        if let Some(label) = &image.label {
            parts = parts.file("label", &image.id, &hash_file(label)?.0);
        }
    }
    Ok(with_kernels(parts, kernels, |role| {
        // A file headed as frames may hold a clock as well.
        !matches!(role, KernelRole::Spk | KernelRole::Ck)
    }))
}

/// BLAKE3 of files, in their order; `stop` is looked at before each.
pub(super) fn hash_files(paths: &[PathBuf], stop: &AtomicBool) -> Result<Vec<String>> {
    let hash = |path: &PathBuf| {
        Stopped::check(stop)?;
        Ok(hash_file(path)?.0)
    };
    paths.par_iter().map(hash).collect()
}

/// PEDR files (by their hashes) and filters, windows, and the clock correction.
pub(super) fn search_footprints(config: &SiteConfig, hashes: &[String]) -> Parts {
    let mut parts = Parts::new(METHOD)
        .key("pedr.datum", &config.pedr.datum)
        .key("pedr.filter", &config.pedr.filter)
        .key("mola_clock (correction)", &config.mola_clock.correction_s())
        .key("windows", &config.windows);
    for (place, (path, hash)) in config.pedr.files.iter().zip(hashes).enumerate() {
        // The order of the files is the order of the footprints.
        parts = parts.file("pedr", &file_name(path), &format!("{}: {hash}", place + 1));
    }
    parts
}

/// Footprints as read, and whether the clock correction turns Mars.
pub(super) fn convert_datum(config: &SiteConfig, found: Option<&str>) -> Parts {
    Parts::new(METHOD)
        .key("mola_clock (correction)", &config.mola_clock.correction_s())
        .key("mola_clock.scope", &config.mola_clock.scope)
        .output("search_footprints", found)
}

/// Footprints, names of windows, image times.
pub(super) fn group_profiles(
    config: &SiteConfig,
    converted: Option<&str>,
    images: Option<&str>,
) -> Parts {
    let windows: Vec<&str> = config.windows.iter().map(|window| &*window.id).collect();
    Parts::new(METHOD)
        .key("windows (names)", &windows)
        .output("convert_datum", converted)
        .output("tag_times", images)
}

/// The positions that are needed, and of every set, by its name, what its trajectory and its clocks
/// come from.
pub(super) fn choose_kernels(config: &SiteConfig, wanted: &Wanted, rivals: &[RivalSet]) -> Parts {
    let names: Vec<&str> = rivals.iter().map(|rival| &*rival.id).collect();
    let mut parts = Parts::new(METHOD)
        .key("kernels.sets (names)", &names)
        .key("images (any)", &!config.images.is_empty())
        .key("positions", &wanted.positions);
    for rival in rivals {
        let kernels = rival.kernels.kernels().iter();
        let of_trajectory =
            kernels.filter(|kernel| !matches!(kernel.role, KernelRole::Ck | KernelRole::Ik));
        for (place, kernel) in of_trajectory.enumerate() {
            let value = format!("{}: {}", place + 1, kernel.blake3);
            let sort = format!("kernel of set {}", rival.id);
            parts = parts.file(&sort, &kernel.file_name(), &value);
        }
    }
    parts
}

/// Footprints, profiles, limits, the clock correction, the ephemerides and their frames.
pub(super) fn check_ranges(
    config: &SiteConfig,
    kernels: &KernelSet,
    converted: Option<&str>,
    profiles: Option<&str>,
) -> Parts {
    let parts = Parts::new(METHOD)
        .key("range_check", &config.range_check)
        .key("mola_clock (correction)", &config.mola_clock.correction_s())
        .key("mola_clock.scope", &config.mola_clock.scope)
        .output("convert_datum", converted)
        .output("group_profiles", profiles);
    // Segments may be given in frames that text kernels define.
    with_kernels(parts, kernels, |role| {
        matches!(role, KernelRole::Spk | KernelRole::Pck | KernelRole::Fk)
    })
}

/// The image's times, pointing bias, sampling, and all kernels: attitude may pass through any frame.
pub(super) fn sample_orientation(
    config: &SiteConfig,
    kernels: &KernelSet,
    image: &ImageTimes,
) -> Parts {
    let parts = Parts::new(METHOD)
        .key("image times", image)
        .key("pointing.ck_bias_s", &config.pointing.ck_bias)
        .key("kernels.ck_tolerance_s", &config.kernels.ck_tolerance_s)
        .key("kernels.padding_s", &config.kernels.padding_s)
        .key("orientation.intervals", &config.orientation.intervals);
    with_kernels(parts, kernels, |_| true)
}

/// The samples and the limits.
pub(super) fn fit_sensor_model(
    config: &SiteConfig,
    image: &str,
    orientation: Option<&str>,
) -> Parts {
    Parts::new(METHOD)
        .key("orientation", &config.orientation)
        .output(&format!("sample_orientation/{image}"), orientation)
}

/// The image, its orientation and model, footprints and profiles.
pub(super) fn register(
    config: &SiteConfig,
    image: &ImageTimes,
    [orientation, model, converted, profiles]: [Option<&str>; 4],
) -> Parts {
    let id = &image.id;
    Parts::new(METHOD)
        .key("image times", image)
        .key("registration", &config.registration)
        .output(&format!("sample_orientation/{id}"), orientation)
        .output(&format!("fit_sensor_model/{id}"), model)
        .output("convert_datum", converted)
        .output("group_profiles", profiles)
}

/// Tie point files (by their hashes), and the names that they have for the images.
pub(super) fn read_ties(config: &SiteConfig, hashes: &[String]) -> Parts {
    let names: Vec<[&str; 2]> = config
        .images
        .iter()
        .map(|image| [image.name_in_ties(), image.id.as_str()])
        .collect();
    let mut parts = Parts::new(METHOD).key("images (names in tie points)", &names);
    for (place, (path, hash)) in config.ties.files.iter().zip(hashes).enumerate() {
        // The order of the files is the order of the points.
        parts = parts.file("ties", &file_name(path), &format!("{}: {hash}", place + 1));
    }
    parts
}

/// Hashes of the prepared data; what is not known yet has none.
#[derive(Default)]
pub(super) struct Hashes<'a> {
    pub(super) images: Option<&'a str>,
    pub(super) converted: Option<&'a str>,
    pub(super) profiles: Option<&'a str>,
    /// One entry for each image here and below.
    pub(super) orientations: Vec<Option<&'a str>>,
    pub(super) models: Vec<Option<&'a str>>,
    pub(super) registrations: Vec<Option<&'a str>>,
}

impl Hashes<'_> {
    fn parts(&self, config: &SiteConfig) -> Parts {
        let mut parts = Parts::new(METHOD)
            .key("registration.model", &config.registration.model)
            .output("tag_times", self.images)
            .output("convert_datum", self.converted)
            .output("group_profiles", self.profiles);
        for (stage, outputs) in [
            ("sample_orientation", &self.orientations),
            ("fit_sensor_model", &self.models),
            ("register", &self.registrations),
        ] {
            for (image, output) in config.images.iter().zip(outputs) {
                parts = parts.output(&format!("{stage}/{}", image.id), *output);
            }
        }
        parts
    }
}

/// The prepared data and the tie points.
pub(super) fn intersect(config: &SiteConfig, prepared: &Hashes<'_>, ties: Option<&str>) -> Parts {
    let parts = prepared.parts(config);
    parts
        .key("intersection", &config.intersection)
        .output("read_ties", ties)
}

/// The prepared data, the tie points and their ground points.
pub(super) fn adjust(
    config: &SiteConfig,
    prepared: &Hashes<'_>,
    [ties, intersected]: [Option<&str>; 2],
) -> Parts {
    let parts = prepared.parts(config);
    parts
        .key("adjustment", &config.adjustment)
        .output("read_ties", ties)
        .output("intersect", intersected)
}

/// The prepared data, the tie points and what the adjustment adds to the orientations.
pub(super) fn apply_adjustment(
    config: &SiteConfig,
    prepared: &Hashes<'_>,
    [ties, adjusted]: [Option<&str>; 2],
) -> Parts {
    let parts = prepared.parts(config);
    parts
        .key("orientation", &config.orientation)
        .key("registration", &config.registration)
        .key("intersection", &config.intersection)
        .output("read_ties", ties)
        .output("adjust", adjusted)
}

/// The configuration, all kernels and where they lie from `folder`, and every earlier output.
pub(super) fn publish(
    config: &SiteConfig,
    kernels: &KernelSet,
    folder: &Path,
    outputs: impl IntoIterator<Item = (String, Option<String>)>,
) -> Parts {
    let mut parts = Parts::new(METHOD)
        .key("configuration", &config.blake3)
        .key("configuration (file name)", &file_name(&config.file))
        .key("kernels (places)", &kernels.metakernel_text(Some(folder)))
        .key("kernels (selection)", &kernels.explanation());
    for (stage, output) in outputs {
        parts = parts.output(&stage, output.as_deref());
    }
    with_kernels(parts, kernels, |_| true)
}

fn with_kernels(mut parts: Parts, kernels: &KernelSet, wanted: fn(KernelRole) -> bool) -> Parts {
    let mut place = 0;
    for kernel in kernels
        .kernels()
        .iter()
        .filter(|kernel| wanted(kernel.role))
    {
        place += 1;
        let value = format!("{place}: {}", kernel.blake3);
        parts = parts.file("kernel", &kernel.file_name(), &value);
    }
    parts
}
