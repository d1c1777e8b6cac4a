//! Sections in words and tables: verdict, selection, corrections, provenance, notes.

use super::{
    html::{Cell, Column, Table, Tone, counted, heading, list, paragraph, verdict},
    misregistration::BeforeAfter,
    plots::label,
};
use crate::{
    altimetry::{BiasScope, DatumChoice, TagSign},
    config::WindowConfig,
    geom::window::WindowShape,
    products::SiteProducts,
    units::RADIANS_PER_DEGREE,
};

/// Reasons, and remarks, in the verdict; the rest is counted.
const REASONS_SHOWN: usize = 12;
/// Complaints shown; the rest is counted.
const COMPLAINTS_SHOWN: usize = 50;

/// Valid or not, why, and what to weigh: the first lines of the page.
pub(super) fn lead(site: &SiteProducts) -> String {
    let (reasons, remarks) = (site.invalid_because(), site.remarks());
    let (tone, headline) = match (reasons.len(), remarks.len()) {
        (0, 0) => (
            Tone::Good,
            "Valid: every profile and image keeps the limits of the configuration.".to_owned(),
        ),
        (0, 1) => (Tone::Remarks, "Valid, with one remark:".to_owned()),
        (0, count) => (Tone::Remarks, format!("Valid, with {count} remarks:")),
        (1, _) => (Tone::Bad, "Invalid, for one reason:".to_owned()),
        (count, _) => (Tone::Bad, format!("Invalid, for {count} reasons:")),
    };
    let mut body = first_of(&reasons);
    if !reasons.is_empty() && !remarks.is_empty() {
        body += &paragraph("Also:");
    }
    body += &first_of(&remarks);
    body += &paragraph(&counts(site));
    body += &paragraph(&together(site));
    paragraph(&site.config.description) + &verdict(tone, &headline, &body)
}

fn counts(site: &SiteProducts) -> String {
    let mut text = format!(
        "{} in {}; {}.",
        counted(site.footprints.len(), "footprint"),
        counted(site.profiles.len(), "profile"),
        counted(site.images.len(), "image")
    );
    // Of an invalid site the reasons say what is beyond its limit, and by how much.
    let nearest = nearest_limit(site).filter(|_| site.invalid_because().is_empty());
    if let Some((share, what)) = nearest {
        text += &format!(
            " Nearest to its limit: {what}, at {:.0} % of it.",
            100.0 * share
        );
    }
    text
}

/// How far apart the images see the same ground, before and after the adjustment; nothing without tie points.
fn together(site: &SiteProducts) -> String {
    let Some(geometric) = &site.geometric else {
        return String::new();
    };
    let pairs = BeforeAfter::all(geometric);
    let words = BeforeAfter::worst(&pairs).map_or_else(String::new, |pair| {
        let others = match pairs.len() {
            1 => String::new(),
            count => format!(" It is the worst of {}.", counted(count, "pair")),
        };
        pair.sentence() + &others
    });
    let sigma0 = label(geometric.adjusted.summary.sigma0, 2);
    format!("{words} σ0 of the adjustment: {sigma0}.")
        .trim_start()
        .to_owned()
}

/// As many sentences as leave the verdict on one screen; the manifest has all.
fn first_of(sentences: &[String]) -> String {
    let shown = &sentences[..sentences.len().min(REASONS_SHOWN)];
    let mut html = list(shown);
    if shown.len() < sentences.len() {
        let more = sentences.len() - shown.len();
        html += &paragraph(&format!(
            "And {more} more, all of them in ../manifest.json."
        ));
    }
    html
}

/// The valid figure that uses most of its limit.
fn nearest_limit(site: &SiteProducts) -> Option<(f64, String)> {
    let limits = &site.config.range_check;
    let means = site.ranges.profiles.iter().flat_map(|ranges| {
        let share = |mean_m: f64, limit_m: f64| mean_m.abs() / limit_m;
        [
            (
                share(ranges.range_minus_distance_m.mean, limits.mean_max_m),
                format!("the mean range residual of profile {}", ranges.profile),
            ),
            (
                share(ranges.decoding_m.mean, limits.decoding_max_m),
                format!("the decoding residual of profile {}", ranges.profile),
            ),
        ]
    });
    let limits = &site.config.orientation;
    let images = site.images.iter().flat_map(|image| {
        let id = &image.times.id;
        [
            (
                image.model.second_order.position_rmse_m() / limits.position_rmse_max_m,
                format!("the position RMSE of image {id}"),
            ),
            (
                image.model.rotation_vector.rmse_rad() / limits.pointing_rmse_max_rad,
                format!("the pointing RMSE of image {id}"),
            ),
        ]
    });
    means
        .chain(images)
        .filter(|(share, _)| *share <= 1.0)
        .max_by(|a, b| a.0.total_cmp(&b.0))
}

/// Windows, filters, and what they left out.
pub(super) fn selection(site: &SiteProducts) -> String {
    if site.config.pedr.files.is_empty() {
        return String::new();
    }
    let mut windows = Table::new(
        "Windows",
        &[
            Column::Text("window"),
            Column::Text("outline (IAU 2000, areocentric, east)"),
            Column::Number("shots"),
        ],
    );
    for (bit, window) in site.config.windows.iter().enumerate() {
        let masks = site.footprints.windows.iter();
        let shots = masks.filter(|mask| **mask >> bit & 1 == 1).count();
        windows.row(
            true,
            [
                (&window.id).into(),
                outline(window).into(),
                shots.to_string().into(),
            ],
        );
    }
    windows.finish() + &paragraph(&filter(site)) + &rejects(site)
}

fn filter(site: &SiteProducts) -> String {
    let filter = &site.config.pedr.filter;
    let join = |values: Vec<String>| values.join(", ");
    format!(
        "A shot is kept when its class is one of {}, its trigger channel one of {}, its attitude flag one of {} and \
         its off-nadir angle at most {:.1}°.",
        join(filter.classes.iter().map(ToString::to_string).collect()),
        join(filter.channels.iter().map(ToString::to_string).collect()),
        join(
            filter
                .attitude_flags
                .iter()
                .map(ToString::to_string)
                .collect()
        ),
        filter.off_nadir_max_rad / RADIANS_PER_DEGREE
    )
}

fn rejects(site: &SiteProducts) -> String {
    if site.rejected.is_empty() {
        return paragraph("No shot inside a window was left out.");
    }
    let left_out: u64 = site.rejected.values().sum();
    let all = left_out + site.footprints.len() as u64;
    let mut table = Table::new(
        "Shots inside a window that were left out",
        &[
            Column::Text("reason"),
            Column::Number("shots"),
            Column::Number("share of the shots in windows"),
        ],
    );
    for (reason, shots) in site.rejected {
        let share = 100.0 * *shots as f64 / all as f64;
        table.row(
            true,
            [
                reason.into(),
                shots.to_string().into(),
                format!("{share:.1} %").into(),
            ],
        );
    }
    table.finish()
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
    biases(site) + &datum(site)
}

fn biases(site: &SiteProducts) -> String {
    let (clock, pointing) = (&site.config.mola_clock, &site.config.pointing);
    let sign = match clock.sign {
        TagSign::Late => "tags are late",
        TagSign::Early => "tags are early",
    };
    let scope = match clock.scope {
        BiasScope::SpkLookup => "the spacecraft's position in the range check",
        BiasScope::Rotation => "the rotation of Mars into IAU 2000",
        BiasScope::Both => "the spacecraft's position in the range check and the rotation of Mars",
        BiasScope::None => "nothing (switched off)",
    };
    let mut table = Table::new(
        "Clock corrections",
        &[
            Column::Text("bias"),
            Column::Number("correction, s"),
            Column::Text("of what"),
            Column::Text("source"),
        ],
    );
    table.row(
        true,
        [
            "attitude (CK)".into(),
            format!("{:+.3}", pointing.ck_bias.seconds()).into(),
            "the time at which attitude is read; position and Mars stay at the exposure".into(),
            (&pointing.source).into(),
        ],
    );
    table.row(
        true,
        [
            "MOLA clock".into(),
            format!("{:+.3}", clock.correction_s()).into(),
            format!("{scope}; {:.3} s, {sign}", clock.bias_s).into(),
            (&clock.source).into(),
        ],
    );
    table.finish()
}

fn datum(site: &SiteProducts) -> String {
    if site.footprints.files.is_empty() {
        return String::new();
    }
    let decided = match site.config.pedr.datum {
        DatumChoice::Auto => "by version letter and label".to_owned(),
        DatumChoice::Stated(datum) => format!("stated in the configuration: {datum}"),
    };
    let mut table = Table::new(
        "Datum of the PEDR coordinates",
        &[
            Column::Text("PEDR file"),
            Column::Text("version"),
            Column::Text("datum of the file"),
            Column::Number("W0, degrees"),
            Column::Text("done"),
            Column::Number("shots"),
            Column::Number("mean shift, m"),
            Column::Number("mean change of longitude, degrees"),
        ],
    );
    for (file, conversion) in site.footprints.files.iter().zip(site.conversions) {
        let moved = conversion.shift_m.max > 0.0;
        let number = |text: String| if moved { text } else { "–".to_owned() };
        table.row(
            true,
            [
                (&file.name).into(),
                file.version
                    .map_or_else(|| "–".to_owned(), String::from)
                    .into(),
                file.datum.to_string().into(),
                format!("{:.3}", file.datum.model().meridian_deg).into(),
                if moved {
                    "through J2000 to IAU 2000"
                } else {
                    "left alone"
                }
                .into(),
                conversion.shots.to_string().into(),
                number(format!("{:.1}", conversion.shift_m.mean)).into(),
                number(format!("{:+.5}", conversion.longitude_shift_deg.mean)).into(),
            ],
        );
    }
    let words = format!(
        "Decided {decided}. Products are in IAU 2000, W0 = {:.3}°.",
        crate::constants::MARS_IAU2000.meridian_deg
    );
    table.finish() + &paragraph(&words)
}

/// Program, configuration, files.
pub(super) fn provenance(site: &SiteProducts) -> String {
    let config = site.config;
    let words = format!(
        "areograph {}; configuration {}, BLAKE3 of its keys {}. ../manifest.json lists every product with its hash, and \
         every stage with its fingerprint; ../kernels.tm loads the same kernels in the same order.",
        env!("CARGO_PKG_VERSION"),
        crate::files::file_name(&config.file),
        config.blake3
    );
    let mut files = Table::new(
        "Files that were read",
        &[
            Column::Text("file, kernels in load order"),
            Column::Text("role"),
            Column::Number("bytes"),
            Column::Text("BLAKE3"),
        ],
    );
    for kernel in site.kernels {
        files.row(
            true,
            [
                (&kernel.name).into(),
                (&kernel.role).into(),
                kernel.bytes.to_string().into(),
                hash(&kernel.blake3),
            ],
        );
    }
    for file in &site.footprints.files {
        files.row(
            true,
            [
                (&file.name).into(),
                "PEDR".into(),
                "–".into(),
                hash(&file.blake3),
            ],
        );
    }
    paragraph(&words) + &files.finish()
}

/// A hash in letters of one width.
fn hash(blake3: &str) -> Cell {
    Cell::Html(format!(
        "<span class=\"hash\">{}</span>",
        super::html::escape(blake3)
    ))
}

/// Notes and complaints.
pub(super) fn notes(site: &SiteProducts) -> String {
    let mut body = list(site.notes);
    if !site.complaints.is_empty() {
        let shown = &site.complaints[..site.complaints.len().min(COMPLAINTS_SHOWN)];
        body += &heading("Complaints about input");
        body += &list(shown);
        body += &paragraph(&format!(
            "{} of {} shown.",
            shown.len(),
            site.complaints.len()
        ));
    }
    body
}
