//! The range check: residuals per shot as Parquet, statistics and verdicts as JSON.

use std::collections::HashSet;

use serde::Serialize;

use super::{
    Writer,
    files::write_json,
    parquet,
    site::SiteProducts,
    table::{Column, Table, Values},
};
use crate::{
    altimetry::MolaClock,
    config::RangeCheckConfig,
    error::Result,
    geom::statistics::{Summary, Trend},
    stages::{
        check_ranges::{BiasScan, ProfileRanges},
        group_profiles::Profile,
    },
};

/// What each residual is, for readers of the files.
const DEFINITIONS: [(&str, &str); 7] = [
    (
        "range_minus_distance",
        "measured range minus |spacecraft in the kernels - footprint with the raw radius|, \
        both in IAU 2000; the paper's Table 3, its sign chosen here",
    ),
    (
        "range_minus_distance_crossover",
        "the same with the crossover-corrected radius",
    ),
    (
        "decoding",
        "measured range minus |spacecraft in the PEDR file - footprint with the raw radius|: tests \
        the reading of the file, no kernel is involved",
    ),
    (
        "spacecraft_radial, _along, _cross",
        "spacecraft in the PEDR file minus spacecraft in the kernels: away \
        from Mars, along the flight, along the orbit's angular momentum",
    ),
    (
        "trend",
        "slope of range_minus_distance over time, with its standard uncertainty from the scatter about \
        the line, correlated neighbours counted",
    ),
    (
        "bias_scan",
        "spread of range_minus_distance against an assumed correction of the time tags; best_s is known \
        as well as its scatter and the orbit allow: uncertainty_s takes the mean difference of the two \
        orbits for what either may be off, a metre along the flight being 0.3 ms",
    ),
    (
        "summary",
        "all shots of the site, each once, also when it lies in several windows; its standard deviation holds what \
        profiles differ by, which those of the profiles do not",
    ),
];

/// Places at which rows of footprints come for the first time.
fn each_once(rows: &[u32]) -> Vec<usize> {
    let mut seen = HashSet::with_capacity(rows.len());
    let places = rows.iter().enumerate();
    places
        .filter(|(_, row)| seen.insert(**row))
        .map(|(place, _)| place)
        .collect()
}

#[derive(Serialize)]
struct Document<'a> {
    format: &'static str,
    site: &'a str,
    valid: bool,
    invalid_because: Vec<String>,
    units: &'static str,
    definitions: Vec<Definition>,
    mola_clock: Clock<'a>,
    limits: &'a RangeCheckConfig,
    trajectory_error_m: f64,
    summary: SiteSummary,
    profiles: Vec<ProfileDocument<'a>>,
}

#[derive(Serialize)]
struct Definition {
    residual: &'static str,
    is: &'static str,
}

#[derive(Serialize)]
struct Clock<'a> {
    #[serde(flatten)]
    configured: &'a MolaClock,
    correction_s: f64,
}

#[derive(Serialize)]
struct SiteSummary {
    profiles: usize,
    profiles_valid: usize,
    shots: usize,
    outliers: u64,
    range_minus_distance_m: Summary,
}

/// An image that was exposed during a profile.
#[derive(Serialize)]
struct Simultaneous<'a> {
    image: &'a str,
    shots: u32,
}

#[derive(Serialize)]
struct ProfileDocument<'a> {
    id: &'a str,
    window: &'a str,
    orbit: u32,
    et_start_s: f64,
    et_stop_s: f64,
    simultaneous: Vec<Simultaneous<'a>>,
    valid: bool,
    invalid_because: &'a [String],
    range_minus_distance_m: Summary,
    range_minus_distance_crossover_m: Summary,
    decoding_m: Summary,
    spacecraft_radial_m: Summary,
    spacecraft_along_m: Summary,
    spacecraft_cross_m: Summary,
    #[serde(skip_serializing_if = "Option::is_none")]
    trend_m_s: Option<Trend>,
    outliers: u32,
    #[serde(skip_serializing_if = "Option::is_none")]
    bias_scan: Option<Scan<'a>>,
}

/// A scan without the members that are not known.
#[derive(Serialize)]
struct Scan<'a> {
    correction_s: &'a [f64],
    spread_m: &'a [f64],
    #[serde(skip_serializing_if = "Option::is_none")]
    best_s: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    uncertainty_s: Option<f64>,
}

pub(super) fn write(written: &mut Writer, site: &SiteProducts) -> Result<()> {
    let table = Table::new(columns(site))?;
    written.add("ranges.parquet", |path| {
        parquet::write(path, &table, Vec::new())
    })?;
    written.add("ranges.json", |path| {
        write_json(path, &document(site))?;
        Ok(site.profiles.len() as u64)
    })
}

fn columns(site: &SiteProducts) -> Vec<Column> {
    let shots = &site.ranges.shots;
    let row = |row: &u32| site.footprints.row(*row as usize);
    let profile = |index: &u32| {
        let profile = site.profiles.get(*index as usize);
        profile.map_or_else(String::new, |profile| profile.id.clone())
    };
    let residual = |name, description, values: &[f64]| {
        Column::new(name, description, Values::F64(values.to_vec()))
    };
    vec![
        Column::new(
            "profile",
            "profile: window, orbit and crossing",
            Values::Text(shots.profile.iter().map(profile).collect()),
        ),
        Column::new(
            "footprint_row",
            "row of the footprint in footprints.parquet, counted from 0",
            Values::U32(shots.row.clone()),
        ),
        Column::new(
            "et_s",
            "time of the shot after the MOLA clock correction, TDB seconds past J2000",
            Values::F64(shots.row.iter().map(|index| row(index).et_s).collect()),
        ),
        Column::new(
            "orbit",
            "orbit number",
            Values::U32(shots.row.iter().map(|index| row(index).orbit).collect()),
        ),
        residual(
            "range_minus_distance_m",
            DEFINITIONS[0].1,
            &shots.range_minus_distance_m,
        ),
        residual(
            "range_minus_distance_crossover_m",
            DEFINITIONS[1].1,
            &shots.range_minus_distance_crossover_m,
        ),
        residual("decoding_m", DEFINITIONS[2].1, &shots.decoding_m),
        residual(
            "spacecraft_radial_m",
            DEFINITIONS[3].1,
            &shots.spacecraft_radial_m,
        ),
        residual(
            "spacecraft_along_m",
            DEFINITIONS[3].1,
            &shots.spacecraft_along_m,
        ),
        residual(
            "spacecraft_cross_m",
            DEFINITIONS[3].1,
            &shots.spacecraft_cross_m,
        ),
        Column::new(
            "outlier",
            "whether range_minus_distance_m is an outlier of its profile",
            Values::Bool(shots.outlier.clone()),
        ),
    ]
}

fn document<'a>(site: &SiteProducts<'a>) -> Document<'a> {
    let once = each_once(&site.ranges.shots.row);
    let residuals = once
        .iter()
        .map(|shot| site.ranges.shots.range_minus_distance_m[*shot]);
    let residuals_m: Vec<f64> = residuals.collect();
    let invalid_because = site.invalid_because();
    let ranges = site.ranges;
    let valid = |profile: &&ProfileRanges| profile.invalid_because.is_empty();
    Document {
        format: "areograph ranges 1",
        site: &site.config.site,
        valid: invalid_because.is_empty(),
        invalid_because,
        units: "metres, seconds, metres per second; angles in limits in radians",
        definitions: DEFINITIONS
            .iter()
            .map(|(residual, is)| Definition { residual, is })
            .collect(),
        mola_clock: Clock {
            configured: &site.config.mola_clock,
            correction_s: site.config.mola_clock.correction_s(),
        },
        limits: &site.config.range_check,
        trajectory_error_m: ranges.trajectory_error_m,
        summary: SiteSummary {
            profiles: site.profiles.len(),
            profiles_valid: ranges.profiles.iter().filter(valid).count(),
            shots: once.len(),
            outliers: once
                .iter()
                .filter(|shot| ranges.shots.outlier[**shot])
                .count() as u64,
            range_minus_distance_m: Summary::of(&residuals_m),
        },
        profiles: site
            .profiles
            .iter()
            .zip(&ranges.profiles)
            .map(|(profile, ranges)| profile_document(site, profile, ranges))
            .collect(),
    }
}

fn profile_document<'a>(
    site: &SiteProducts<'a>,
    profile: &'a Profile,
    ranges: &'a ProfileRanges,
) -> ProfileDocument<'a> {
    let [radial, along, cross] = ranges.spacecraft_m;
    ProfileDocument {
        id: &profile.id,
        window: &profile.window,
        orbit: profile.orbit,
        et_start_s: profile.interval.start.seconds(),
        et_stop_s: profile.interval.stop.seconds(),
        simultaneous: profile
            .simultaneous
            .iter()
            .map(|of| Simultaneous {
                image: &site.images[of.image].times.id,
                shots: of.shots,
            })
            .collect(),
        valid: ranges.invalid_because.is_empty(),
        invalid_because: &ranges.invalid_because,
        range_minus_distance_m: ranges.range_minus_distance_m,
        range_minus_distance_crossover_m: ranges.range_minus_distance_crossover_m,
        decoding_m: ranges.decoding_m,
        spacecraft_radial_m: radial,
        spacecraft_along_m: along,
        spacecraft_cross_m: cross,
        trend_m_s: ranges.trend_m_s,
        outliers: ranges.outliers,
        bias_scan: ranges.scan.as_ref().map(scan_document),
    }
}

fn scan_document(scan: &BiasScan) -> Scan<'_> {
    Scan {
        correction_s: &scan.correction_s,
        spread_m: &scan.spread_m,
        best_s: scan.best_s,
        uncertainty_s: scan.uncertainty_s,
    }
}
