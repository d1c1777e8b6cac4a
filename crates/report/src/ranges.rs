//! The range check: Table 3 and figure 2 of Shan et al. 2005, and the residuals beside them.

mod plots;

use super::{
    html::{Cell, Column, Markup, Table, folded, folded_unless, html, paragraph},
    numbers::{number, whole},
    plots::label,
    section::Section,
    source::traced,
};
use areograph_base::{error::Result, verdict::CheckKind};
use areograph_geom::statistics::Summary;
use areograph_products::SiteProducts;
use areograph_stages::check_ranges::ProfileRanges;

pub(super) use plots::{many, plotted};

pub(super) const SECTION: Section = Section {
    title: "Range check",
    anchor: "range-check",
    checks: &[
        CheckKind::RangeMean,
        CheckKind::OrbitsApart,
        CheckKind::Decoding,
        CheckKind::RangeOutliers,
        CheckKind::Shots,
    ],
    appears: |site| site.config.has_shots(),
    write,
};

fn write(site: &SiteProducts) -> Result<Markup> {
    if site.profiles.is_empty() {
        return Ok(paragraph("No profile."));
    }
    if site
        .ranges
        .profiles
        .iter()
        .all(|profile| !profile.is_tested())
    {
        return Ok(untested(site));
    }
    let figures = html! { div.plots { (plots::figures(site)?) } };
    if many(site) {
        let title = format!("Tables of all {} profiles", whole(site.profiles.len()));
        let tables = html! { (statistics(site)) (limits(site)) (three_ways(site)) };
        return Ok(html! { (all_profiles(site)) (figures) (folded(&title, &tables)) });
    }
    let profiles = &site.ranges.profiles;
    let invalid = profiles
        .iter()
        .any(|profile| !profile.invalid_because.is_empty());
    Ok(html! {
        (statistics(site))
        (folded_unless(invalid, "Limits, and three ways to check a range", &html! {
            (limits(site))
            (three_ways(site))
        }))
        h3 { "Along the profiles" }
        (figures)
    })
}

/// Statement where no range is compared with anything.
fn untested(site: &SiteProducts) -> Markup {
    let mut table = Table::new(
        "Profiles whose ranges are not tested",
        &[
            Column::Number("profiles"),
            Column::Number("shots in profiles"),
        ],
    );
    let shots: usize = site.profiles.iter().map(|profile| profile.rows.len()).sum();
    table.row(
        true,
        [whole(site.profiles.len()).into(), whole(shots).into()],
    );
    html! {
        p {
            "The ranges are not tested: the tables contain no spacecraft position, and no kernels cover the shots. The \
             spacecraft is placed on the radius through the footprint (nadir by range), so that its distance from the \
             footprint equals the range."
        }
        (table.finish())
    }
}

/// Millimetres suffice for ranges recorded in centimetres.
pub(super) fn metres(value: f64) -> String {
    label(value, 3)
}

/// All profiles in one row.
fn all_profiles(site: &SiteProducts) -> Markup {
    let mut table = Table::new(
        "Range − distance of all profiles, metres",
        &[
            Column::Number("profiles"),
            Column::Number("invalid"),
            Column::Number("shots"),
            Column::Number("outliers"),
            Column::Number("mean of the means"),
            Column::Number("std of the means"),
            Column::Number("least mean"),
            Column::Number("largest mean"),
            Column::Number("std within profiles"),
        ],
    );
    let profiles = &site.ranges.profiles;
    let measured = profiles.iter().filter(|profile| profile.measured() > 0);
    let means: Vec<f64> = measured
        .map(|profile| profile.mean_without_outliers_m)
        .collect();
    let means = Summary::of(&means);
    let invalid = profiles
        .iter()
        .filter(|profile| !profile.invalid_because.is_empty())
        .count();
    let shots: u64 = profiles
        .iter()
        .map(|profile| u64::from(profile.range_minus_distance_m.n))
        .sum();
    let outliers: u64 = profiles
        .iter()
        .map(|profile| u64::from(profile.outliers))
        .sum();
    let (squares, freedom) = profiles.iter().fold((0.0, 0.0), |(squares, freedom), of| {
        let own = f64::from(of.range_minus_distance_m.n.saturating_sub(1));
        let variance_m2 = of.range_minus_distance_m.standard_deviation.powi(2);
        (squares + own * variance_m2, freedom + own)
    });
    table.row(
        invalid == 0,
        [
            whole(profiles.len()).into(),
            whole(invalid).into(),
            whole(shots).into(),
            whole(outliers).into(),
            metres(means.mean).into(),
            metres(means.standard_deviation).into(),
            metres(means.min).into(),
            metres(means.max).into(),
            metres((squares / f64::max(freedom, 1.0)).sqrt()).into(),
        ],
    );
    table.finish()
}

fn statistics(site: &SiteProducts) -> Markup {
    let limits = &site.config.range_check;
    let mut table = Table::new(
        "Range − distance per profile (Table 3 of Shan et al. 2005), metres",
        &[
            Column::Text("profile"),
            Column::Number("n"),
            Column::Number("mean"),
            Column::Number("std"),
            Column::Number("median"),
            Column::Number("NMAD"),
            Column::Number("min"),
            Column::Number("max"),
            Column::Number("outliers"),
            Column::Number("trend, mm/s"),
            Column::Text("simultaneous images"),
            Column::Text("verdict"),
        ],
    );
    for (index, (profile, ranges)) in site.profiles.iter().zip(&site.ranges.profiles).enumerate() {
        let main = &ranges.range_minus_distance_m;
        let outlier_share = f64::from(ranges.outliers) / f64::from(main.n.max(1));
        let images: Vec<String> = profile
            .simultaneous
            .iter()
            .filter_map(|of| {
                let image = site.images.get(of.image)?;
                Some(format!("{} ({} shots)", image.times.id, of.shots))
            })
            .collect();
        let valid = ranges.invalid_because.is_empty();
        let of_main = |value: f64, name: &str| match main.n {
            0 => Cell::from("–"),
            _ => Cell::from(metres(value)).traced(format!("/range_minus_distance_m/{name}")),
        };
        table.row_of(
            &place(index),
            valid,
            [
                (&profile.id).into(),
                Cell::from(whole(main.n)).traced("/range_minus_distance_m/n"),
                of_main(main.mean, "mean"),
                of_main(main.standard_deviation, "standard_deviation"),
                of_main(main.median, "median"),
                of_main(main.nmad, "nmad"),
                of_main(main.min, "min"),
                of_main(main.max, "max"),
                Cell::Limited(
                    whole(ranges.outliers),
                    used_share(outlier_share, limits.outlier_share_max),
                )
                .traced("/outliers"),
                trend(ranges),
                dash_for_none(images.join(", ")).into(),
                match (valid, ranges.is_judged(limits)) {
                    (false, _) => "invalid",
                    (true, false) => "not judged",
                    (true, true) => "valid",
                }
                .into(),
            ],
        );
    }
    table.finish()
}

/// Limits of the table of the profiles.
fn limits(site: &SiteProducts) -> Markup {
    let limits = &site.config.range_check;
    html! {
        p {
            "Judged: profiles with at least " (traced(&limits.shots_min.to_string(), "ranges.json#/limits/shots_min"))
            " shots. Limits: at most "
            (traced(&number(100.0 * limits.outlier_share_max, 1), "ranges.json#/limits/outlier_share_max*100"))
            " % outliers (more than " (traced(&limits.outlier_sigma.to_string(), "ranges.json#/limits/outlier_sigma"))
            " robust σ from the median). Bars: used share of a limit."
        }
    }
}

/// Used share of a limit that may be 0: then 0 uses nothing of it, and all other values are beyond it.
fn used_share(value: f64, limit: f64) -> f64 {
    if value <= 0.0 { 0.0 } else { value / limit }
}

fn dash_for_none(text: String) -> String {
    if text.is_empty() {
        "–".to_owned()
    } else {
        text
    }
}

fn trend(ranges: &ProfileRanges) -> Cell {
    let text = ranges.trend_m_s.map_or_else(
        || "–".to_owned(),
        |trend| {
            format!(
                "{} ± {}",
                label(1e3 * trend.slope, 2),
                label(1e3 * trend.uncertainty, 2)
            )
        },
    );
    Cell::from(text).traced("/trend_m_s/slope*1000 /trend_m_s/uncertainty*1000")
}

/// Place of a profile in the products.
pub(super) fn place(profile: usize) -> String {
    format!("ranges.json#/profiles/{profile}")
}

/// A mean in the table of three ways; a dash without values.
fn known(of: &Summary, name: &str) -> Cell {
    match of.n {
        0 => Cell::from("–"),
        _ => Cell::from(metres(of.mean)).traced(format!("/{name}/mean")),
    }
}

fn three_ways(site: &SiteProducts) -> Markup {
    let limits = &site.config.range_check;
    let mut table = Table::new(
        "The three ways to check a range, means in metres",
        &[
            Column::Text("profile"),
            Column::Number("range − distance, kernels"),
            Column::Number("without outliers"),
            Column::Number("with crossover radius"),
            Column::Number("range − distance, orbit of the shots"),
            Column::Number("without outliers"),
            Column::Number("shots − kernels, radial"),
            Column::Number("along-track"),
            Column::Number("cross-track"),
        ],
    );
    for (index, ranges) in site.ranges.profiles.iter().enumerate() {
        let mean_m = ranges.mean_without_outliers_m;
        let decoding_m = ranges.decoding_without_outliers_m;
        let [radial, along, cross] = [(0, "radial"), (1, "along"), (2, "cross")]
            .map(|(at, axis)| known(&ranges.spacecraft_m[at], &format!("spacecraft_{axis}_m")));
        let limited = |of: &Summary, mean_m: f64, limit_m: f64, name: &str| match of.n {
            0 => Cell::from("–"),
            _ => Cell::Limited(metres(mean_m), mean_m.abs() / limit_m).traced(format!("/{name}")),
        };
        let (by_kernels, by_own) = (&ranges.range_minus_distance_m, &ranges.decoding_m);
        table.row_of(
            &place(index),
            true,
            [
                (&ranges.profile).into(),
                known(by_kernels, "range_minus_distance_m"),
                limited(
                    by_kernels,
                    mean_m,
                    ranges.mean_max_m(limits),
                    "mean_without_outliers_m",
                ),
                known(
                    &ranges.range_minus_distance_crossover_m,
                    "range_minus_distance_crossover_m",
                ),
                known(by_own, "decoding_m"),
                limited(
                    by_own,
                    decoding_m,
                    limits.decoding_max_m,
                    "decoding_without_outliers_m",
                ),
                radial,
                along,
                cross,
            ],
        );
    }
    let error_m = site.ranges.trajectory_error_m;
    html! {
        (table.finish())
        ul {
            li { "Limits apply to means without outliers." }
            @if site.config.shots.is_empty() {
                li { "Crossover radius: from the MOLA team's adjustment, which changes radii of footprints, not \
                      ranges." }
            }
            li {
                "Orbit of the shots: the orbit in the " (site.config.terms().shot_source()) ", without kernels; a mean beyond ±"
                (traced(&limits.decoding_max_m.to_string(), "ranges.json#/limits/decoding_max_m"))
                " m indicates a reading error."
            }
            li {
                "Shots − kernels: difference of spacecraft positions, inertial axes; more than "
                (traced(&limits.orbit_max_m.to_string(), "ranges.json#/limits/orbit_max_m"))
                " m indicates a different orbit, clock or datum."
                // A table's own spacecraft and the spacecraft of support data are not tabulated.
                @if error_m > 0.0 {
                    " Trajectory tabulated to "
                    (traced(&number(1e3 * error_m, 3), "ranges.json#/trajectory_error_m*1000")) " mm."
                }
            }
        }
    }
}
