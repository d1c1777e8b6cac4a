//! The worst profiles, and commands that find their shots.

use crate::{
    html::{Cell, Column, Markup, Table, html, link, paragraph},
    numbers::whole,
    plots::label,
};
use areograph_base::units::RADIANS_PER_DEGREE;
use areograph_products::{WorstProfile, profile_name};
use areograph_stages::check_archive::{ArchiveProfile, ArchiveRanges};

/// The worst profiles in a table, each with a link to its shots.
pub(super) fn worst_profiles(ranges: &ArchiveRanges, worst: &[WorstProfile<'_>]) -> Markup {
    if worst.is_empty() {
        return paragraph("No profile was checked.");
    }
    let mut table = Table::new(
        "Profiles, sorted by the largest share of a limit; each links to its shots (Parquet)",
        &[
            Column::Text("profile"),
            Column::Text("begins"),
            Column::Number("shots"),
            Column::Number("mean, m"),
            Column::Number("NMAD, m"),
            Column::Number("outliers"),
            Column::Number("to own spacecraft, m"),
            Column::Number("orbits apart, m"),
            Column::Number("off nadir, at most °"),
            Column::Number("best correction, s"),
        ],
    );
    let limits = &ranges.limits;
    for of in worst {
        let profile = of.profile;
        let [x, y, z] = profile.spacecraft_m;
        let apart_m = x.hypot(y).hypot(z);
        let n = f64::from(profile.shots.max(1));
        let outlier_share = f64::from(profile.outliers) / n / limits.outlier_share_max;
        let limited = |value: f64, limit: f64| Cell::Limited(label(value, 2), value.abs() / limit);
        let cells = [
            named(of),
            begins(of).into(),
            whole(profile.shots).into(),
            limited(profile.mean_without_outliers_m, limits.mean_max_m),
            label(profile.range_minus_distance_m.nmad, 2).into(),
            Cell::Limited(whole(profile.outliers), outlier_share),
            limited(profile.decoding_without_outliers_m, limits.decoding_max_m),
            limited(apart_m, limits.orbit_max_m),
            label(profile.off_nadir_rad[1] / RADIANS_PER_DEGREE, 2).into(),
            correction(profile).into(),
        ];
        table.row(profile.invalid_because.is_empty(), cells);
    }
    let words = "Outliers are excluded from both means of range − distance: with spacecraft positions from the \
                 kernels (mean), and from the file itself (to own spacecraft). Orbits apart is the length of the mean \
                 difference of spacecraft positions, file minus kernels; it reveals a different orbit, clock or \
                 datum. The best time-tag correction minimises the spread of range − distance, with raw or \
                 crossover-corrected radii. All profiles are in profiles.parquet and profiles.csv.";
    html! { (table.finish()) p { (words) } (commands(worst)) }
}

/// The profile, with a link if its shots could be written.
fn named(of: &WorstProfile<'_>) -> Cell {
    let id = of.profile.id();
    match &of.shots {
        Some(shots) => link(&format!("../{shots}"), &id).into(),
        None => id.into(),
    }
}

fn begins(of: &WorstProfile<'_>) -> String {
    let et_s = of.profile.start_et_s;
    match &of.start_utc {
        Some(utc) => utc.split('.').next().unwrap_or(utc).replace('T', " "),
        None => format!("ET {et_s:.0} s"),
    }
}

fn correction(profile: &ArchiveProfile) -> String {
    match (profile.best_correction_s, profile.correction_uncertainty_s) {
        (Some(best_s), Some(sigma_s)) => format!("{} ± {sigma_s:.3}", label(best_s, 3)),
        (Some(best_s), None) => label(best_s, 3),
        _ => String::new(),
    }
}

/// Command lines that find the shots of profiles.
fn commands(worst: &[WorstProfile<'_>]) -> Markup {
    let lines: Vec<String> = worst.iter().map(command).collect();
    html! {
        details {
            summary { "Commands that find these shots in the archive" }
            div.wide tabindex="0" role="region" aria-label="Commands" { pre { (lines.join("\n")) } }
        }
    }
}

/// The command line that finds the shots of a profile, without clouds.
fn command(of: &WorstProfile<'_>) -> String {
    let [start_s, stop_s] = of.profile.tags_et_s;
    let name = profile_name(of.file, of.profile);
    format!(
        "areograph pedr search '{}' --box 0,360,-90,90 --time={:.3}..{:.3} --format parquet --out {name}.parquet",
        of.file.path.display(),
        start_s - 0.01,
        stop_s + 0.01,
    )
}
