//! Sections in words and tables: verdict, inputs, corrections, remarks.

use super::html::{Table, list, paragraph, section};
use crate::{
    config::{BiasScope, DatumChoice, TagSign, WindowConfig, WindowShape},
    products::SiteProducts,
    units::RADIANS_PER_DEGREE,
};

/// Complaints shown; the rest is counted.
const COMPLAINTS_SHOWN: usize = 50;
/// Hexadecimal digits of a hash that tell files apart on one page.
const HASH_DIGITS: usize = 12;

/// Valid or not, and why.
pub(super) fn verdict(site: &SiteProducts) -> String {
    let reasons = site.invalid_because();
    let (class, headline) = if reasons.is_empty() {
        (
            "valid",
            "Valid: every profile and image is within the limits of the configuration.".to_owned(),
        )
    } else {
        let limits = if reasons.len() == 1 {
            "reason"
        } else {
            "reasons"
        };
        (
            "invalid",
            format!("Invalid, for {} {limits}:", reasons.len()),
        )
    };
    let counts = format!(
        "Footprints: {}; profiles: {}; images: {}.",
        site.footprints.len(),
        site.profiles.len(),
        site.images.len()
    );
    format!(
        "{}<div class=\"verdict {class}\">\n{}{}{}</div>\n",
        paragraph(&site.config.description),
        paragraph(&headline),
        list(&reasons),
        paragraph(&counts)
    )
}

/// Windows, PEDR files and kernels.
pub(super) fn inputs(site: &SiteProducts) -> String {
    let mut windows = Table::new(
        &["window", "outline (IAU 2000, areocentric, east)"],
        &[false, false],
    );
    for window in &site.config.windows {
        windows.row(true, &[window.id.clone(), outline(window)]);
    }
    let mut files = Table::new(&["PEDR file", "version", "datum", "BLAKE3"], &[false; 4]);
    for file in &site.footprints.files {
        let version = file.version.map_or_else(|| "–".to_owned(), String::from);
        files.row(
            true,
            &[
                file.name.clone(),
                version,
                file.datum.to_string(),
                short(&file.blake3),
            ],
        );
    }
    let mut kernels = Table::new(
        &["kernel, in load order", "role", "bytes", "BLAKE3"],
        &[false, false, true, false],
    );
    for kernel in site.kernels {
        let cells = [
            &kernel.name,
            &kernel.role,
            &kernel.bytes.to_string(),
            &short(&kernel.blake3),
        ];
        kernels.row(true, &cells);
    }
    let body = [windows.finish(), files.finish(), kernels.finish()].concat();
    section("Windows, files and kernels", &body)
}

/// Enough of a hash to tell files apart on one page.
pub(super) fn short(hash: &str) -> String {
    hash.chars().take(HASH_DIGITS).collect()
}

fn outline(window: &WindowConfig) -> String {
    match &window.shape {
        WindowShape::Box {
            west_rad,
            east_rad,
            south_rad,
            north_rad,
        } => {
            let [west, east, south, north] =
                [west_rad, east_rad, south_rad, north_rad].map(|angle| angle / RADIANS_PER_DEGREE);
            format!("longitude {west:.4}° to {east:.4}°, latitude {south:.4}° to {north:.4}°")
        }
        WindowShape::Polygons { polygons } => {
            let vertices: usize = polygons.iter().flatten().map(Vec::len).sum();
            format!("{} polygons with {vertices} vertices", polygons.len())
        }
    }
}

/// The clock corrections and the datum as used, with their sources.
pub(super) fn corrections(site: &SiteProducts) -> String {
    let config = site.config;
    let clock = &config.mola_clock;
    let sign = match clock.sign {
        TagSign::Late => "tags are late",
        TagSign::Early => "tags are early",
    };
    let scope = match clock.scope {
        BiasScope::SpkLookup => "the spacecraft's position",
        BiasScope::Rotation => "the rotation of Mars",
        BiasScope::Both => "the spacecraft's position and the rotation of Mars",
        BiasScope::None => "nothing (switched off)",
    };
    let datum = match config.pedr.datum {
        DatumChoice::Auto => "by version letter and label".to_owned(),
        DatumChoice::Stated(datum) => format!("stated: {datum}"),
    };
    let mut table = Table::new(&["what", "as used", "source"], &[false; 3]);
    table.row(
        true,
        &[
            "attitude (CK) bias".to_owned(),
            format!(
                "{:+.3} s added to the exposure time when attitude is read; position unmoved",
                config.pointing.ck_bias.seconds()
            ),
            config.pointing.source.clone(),
        ],
    );
    table.row(
        true,
        &[
            "MOLA clock bias".to_owned(),
            format!(
                "{:.3} s, {sign}: correction {:+.3} s, for {scope}",
                clock.bias_s,
                clock.correction_s()
            ),
            clock.source.clone(),
        ],
    );
    table.row(
        true,
        &[
            "datum of PEDR coordinates".to_owned(),
            format!("{datum}; products are in IAU 2000"),
            "per file in the table above".to_owned(),
        ],
    );
    let limits = &config.range_check;
    let limits = format!(
        "Limits: mean range residual ±{} m, outliers beyond {} robust standard deviations and at most {} %, at least \
         {} shots, decoding residual ±{} m.",
        limits.mean_max_m,
        limits.outlier_sigma,
        100.0 * limits.outlier_share_max,
        limits.shots_min,
        limits.decoding_max_m
    );
    section(
        "Corrections and limits",
        &(table.finish() + &paragraph(&limits)),
    )
}

/// Whether `note` says no more than that a kernel was asked for by name, which the table of kernels shows.
fn repeats_kernel_table(site: &SiteProducts, note: &str) -> bool {
    site.kernels.iter().any(|kernel| {
        note.strip_prefix(&kernel.name)
            .is_some_and(|rest| rest == ": listed" || rest.starts_with(": listed by "))
    })
}

/// Notes, rejected shots and complaints.
pub(super) fn remarks(site: &SiteProducts) -> String {
    let mut sections = String::new();
    let mut notes: Vec<String> = site
        .notes
        .iter()
        .filter(|note| !repeats_kernel_table(site, note))
        .cloned()
        .collect();
    for image in site.images {
        notes.extend(
            image
                .times
                .notes
                .iter()
                .map(|note| format!("image {}: {note}", image.times.id)),
        );
    }
    if !notes.is_empty() {
        sections += &section("Notes", &list(&notes));
    }
    if !site.rejected.is_empty() {
        let mut table = Table::new(&["reason", "shots"], &[false, true]);
        for (reason, shots) in site.rejected {
            table.row(true, &[reason, &shots.to_string()]);
        }
        sections += &section("Rejected shots", &table.finish());
    }
    if !site.complaints.is_empty() {
        let shown = &site.complaints[..site.complaints.len().min(COMPLAINTS_SHOWN)];
        let count = format!("{} of {} shown.", shown.len(), site.complaints.len());
        sections += &section(
            "Complaints about input",
            &(list(shown) + &paragraph(&count)),
        );
    }
    sections
}
