//! What each stage depends on. The lists are the method's dependencies, read beside [`super::run_site`].

use std::path::Path;

use crate::{
    config::SiteConfig,
    error::Result,
    files::{file_name, hash_file},
    spice::{KernelRole, KernelSet},
    stages::tag_times::ImageTimes,
    store::fingerprint::Parts,
};

/// Image keys, label files and the kernels that convert times.
pub(super) fn tag_times(config: &SiteConfig, kernels: &KernelSet) -> Result<Parts> {
    let mut parts = Parts::new();
    for image in &config.images {
        parts = parts.key(&format!("images.{}", image.id), &image.fields);
        if let Some(label) = &image.label {
            parts = parts.file("label", &image.id, &hash_file(label)?.0);
        }
    }
    Ok(with_kernels(parts, kernels, |role| {
        matches!(role, KernelRole::Lsk | KernelRole::Sclk)
    }))
}

/// PEDR files and filters, windows, and the clock correction.
pub(super) fn search_footprints(config: &SiteConfig) -> Result<Parts> {
    let mut parts = Parts::new()
        .key("pedr.datum", &config.pedr.datum)
        .key("pedr.filter", &config.pedr.filter)
        .key("mola_clock (correction)", &config.mola_clock.correction_s())
        .key("windows", &config.windows);
    for path in &config.pedr.files {
        parts = parts.file("pedr", &file_name(path), &hash_file(path)?.0);
    }
    Ok(parts)
}

/// Footprints as read, and whether the clock correction turns Mars.
pub(super) fn convert_datum(config: &SiteConfig, found: Option<&str>) -> Parts {
    Parts::new()
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
    Parts::new()
        .key("windows (names)", &windows)
        .output("convert_datum", converted)
        .output("tag_times", images)
}

/// Footprints, profiles, limits, the clock correction and the ephemerides.
pub(super) fn check_ranges(
    config: &SiteConfig,
    kernels: &KernelSet,
    converted: Option<&str>,
    profiles: Option<&str>,
) -> Parts {
    let parts = Parts::new()
        .key("range_check", &config.range_check)
        .key("mola_clock (correction)", &config.mola_clock.correction_s())
        .key("mola_clock.scope", &config.mola_clock.scope)
        .output("convert_datum", converted)
        .output("group_profiles", profiles);
    with_kernels(parts, kernels, |role| role == KernelRole::Spk)
}

/// The image's times, pointing bias, sampling, and all kernels: attitude may pass through any frame.
pub(super) fn sample_orientation(
    config: &SiteConfig,
    kernels: &KernelSet,
    image: &ImageTimes,
) -> Parts {
    let parts = Parts::new()
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
    Parts::new()
        .key("orientation", &config.orientation)
        .output(&format!("sample_orientation/{image}"), orientation)
}

/// The configuration, all kernels and where they lie from `folder`, and every earlier output.
pub(super) fn publish(
    config: &SiteConfig,
    kernels: &KernelSet,
    folder: &Path,
    outputs: impl IntoIterator<Item = (String, Option<String>)>,
) -> Parts {
    let mut parts = Parts::new()
        .key("configuration", &config.blake3)
        .key("places of kernels", &kernels.metakernel_text(Some(folder)));
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
