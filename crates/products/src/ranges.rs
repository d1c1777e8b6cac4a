//! The range check: residuals per shot as Parquet, statistics and verdicts as JSON.

use std::borrow::Cow;

use schemars::JsonSchema;
use serde::Serialize;

use super::{
    files::write_json,
    parquet,
    product::{Content, Declaration, Role, Write},
    site::SiteProducts,
    table::{Column, Table, Unit, column, meanings},
};
use areograph_base::{
    altimetry::MolaClock, body::Body, column::Column as Values, footprints::Footprints,
    frames::BodyFixed, packed::Packed, schema::DocumentSchema, season::solar_longitude_rad,
};
use areograph_config::RangeCheckConfig;
use areograph_geom::{
    range_residuals::states_spacecraft,
    statistics::{Summary, Trend},
};
use areograph_stages::{
    check_ranges::{BiasScan, ProfileRanges, ScannedRadius, ShotResiduals},
    group_profiles::Profile,
};

/// Definitions of the residuals, for readers of the files.
const DEFINITIONS: [(&str, &str); 7] = [
    (
        "range_minus_distance",
        "measured range minus distance from the spacecraft (kernels) to the footprint (raw radius), both in {frame}, \
         as in Table 3 of Shan et al. 2005; the sign is a convention of areograph",
    ),
    (
        "range_minus_distance_crossover",
        "measured range minus distance from the spacecraft (kernels) to the footprint (crossover-corrected radius)",
    ),
    (
        "decoding",
        "measured range minus distance from the spacecraft ({shot_file}) to the footprint (raw radius): a test, \
         without kernels, that the file is read correctly",
    ),
    (
        "spacecraft_radial, _along, _cross",
        "difference of spacecraft positions, {shot_file} minus kernels: away from {body} (radial), along the flight \
         (along), and along the orbital angular momentum (cross)",
    ),
    (
        "trend",
        "slope of range_minus_distance over time, with its standard uncertainty from the scatter about the line; this \
         uncertainty includes the correlation between neighbouring shots",
    ),
    (
        "bias_scan",
        "spread of range_minus_distance as a function of an assumed correction of the time tags. Scatter and orbit limit \
        the accuracy of best_s: uncertainty_s uses the mean difference of the two orbits as the error of either (one \
        metre along the flight is 0.3 ms), and contains the slope of this difference and of the radius correction \
        along the profile",
    ),
    (
        "summary",
        "all shots of the site, each counted once, even if the shot lies in several windows; the standard deviation \
         includes differences between profiles, which the standard deviations of single profiles do not",
    ),
];

/// Whether each of `rows` of so many footprints occurs there first.
fn each_once(rows: &Values<u32>, footprints: usize) -> Vec<bool> {
    let mut seen = vec![false; footprints];
    let mut is_first = |row: u32| {
        let seen = seen.get_mut(row as usize);
        seen.is_some_and(|seen| !std::mem::replace(seen, true))
    };
    rows.iter().map(&mut is_first).collect()
}

#[derive(Serialize, JsonSchema)]
#[schemars(
    title = "Range check of a site",
    description = "ranges.json of areograph: residuals of measured ranges per profile (Table 3 of Shan et al. 2005), their \
                   limits and verdicts. Metres and seconds; unknown values are omitted."
)]
struct Document<'a> {
    #[schemars(extend("const" = "areograph ranges 1"))]
    format: &'static str,
    site: &'a str,
    valid: bool,
    invalid_because: &'a [String],
    units: &'static str,
    #[schemars(length(min = 1))]
    definitions: Vec<Definition>,
    mola_clock: Clock<'a>,
    limits: &'a RangeCheckConfig,
    #[schemars(range(min = 0.0))]
    trajectory_error_m: f64,
    summary: SiteSummary,
    profiles: Vec<ProfileDocument<'a>>,
}

#[derive(Serialize, JsonSchema)]
struct Definition {
    residual: &'static str,
    is: Cow<'static, str>,
}

#[derive(Serialize, JsonSchema)]
struct Clock<'a> {
    #[serde(flatten)]
    configured: &'a MolaClock,
    correction_s: f64,
}

#[derive(Serialize, JsonSchema)]
struct SiteSummary {
    profiles: usize,
    profiles_valid: usize,
    shots: usize,
    outliers: u64,
    range_minus_distance_m: Summary,
}

/// An image that was exposed during a profile.
#[derive(Serialize, JsonSchema)]
struct SimultaneousImage<'a> {
    /// Image identifier.
    image: &'a str,
    /// Number of shots of the profile that were fired while the image was exposed.
    shots: u32,
}

#[derive(Serialize, JsonSchema)]
struct ProfileDocument<'a> {
    id: &'a str,
    window: &'a str,
    orbit: u32,
    et_start_s: f64,
    et_stop_s: f64,
    /// Areocentric longitude of the Sun at the start of the profile: the season of Mars.
    #[serde(skip_serializing_if = "Option::is_none")]
    solar_longitude_deg: Option<f64>,
    simultaneous: Vec<SimultaneousImage<'a>>,
    /// Whether the profile has enough shots for a comparison with the limits.
    judged: bool,
    valid: bool,
    invalid_because: &'a [String],
    /// Number of shots of tables without a position of the spacecraft: the position is assumed on the radius through
    /// the footprint, at the measured range from it, so that the test does not apply.
    shots_nadir_by_range: u32,
    range_minus_distance_m: Summary,
    /// Mean without outliers, for comparison with the limit.
    mean_without_outliers_m: f64,
    range_minus_distance_crossover_m: Summary,
    decoding_m: Summary,
    /// Mean of the decoding residuals without the outliers of the range residuals, for comparison with the limit.
    decoding_without_outliers_m: f64,
    spacecraft_radial_m: Summary,
    spacecraft_along_m: Summary,
    spacecraft_cross_m: Summary,
    #[serde(skip_serializing_if = "Option::is_none")]
    trend_m_s: Option<Trend>,
    outliers: u32,
    #[serde(skip_serializing_if = "Option::is_none")]
    bias_scan: Option<Scan<'a>>,
}

/// A scan without unknown members.
#[derive(Serialize, JsonSchema)]
struct Scan<'a> {
    /// Footprint radius of the scan: crossover-corrected if this radius reduces the least spread by more than 2 %,
    /// otherwise raw.
    radius: ScannedRadius,
    correction_s: &'a [f64],
    spread_m: &'a [f64],
    #[serde(skip_serializing_if = "Option::is_none")]
    best_s: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    uncertainty_s: Option<f64>,
}

pub(super) static TABLE: Declaration = Declaration {
    path: "ranges.parquet",
    what: "residuals of the range check per shot",
    readers: "scripts, `areograph report`",
    rows: "shots in profiles",
    role: Role::Data,
    content: Content::Table(|| meanings(&columns())),
    write: Write::Site(|path, of| {
        let site = of.site;
        let shots = site.ranges.shots.len();
        let table = Table::of(columns(), shots, |at| RangedShot { site, at })
            .in_terms(&of.site.config.terms());
        parquet::write(path, &table, Vec::new()).map(Some)
    }),
    uses: &[],
};

pub(super) static DOCUMENT: Declaration = Declaration {
    path: "ranges.json",
    what: "statistics of the residuals per profile, limits and verdicts",
    readers: "scripts",
    rows: "profiles",
    role: Role::Data,
    content: Content::Document(schema),
    write: Write::Site(|path, of| {
        write_json(path, &document(of.site))?;
        Ok(Some(of.site.profiles.len() as u64))
    }),
    uses: &[],
};

/// A shot of a profile, by its place among the residuals.
struct RangedShot<'a> {
    site: &'a SiteProducts<'a>,
    at: usize,
}

impl RangedShot<'_> {
    fn row(&self) -> u32 {
        self.site.ranges.shots.row.at(self.at)
    }

    /// The value of this shot in the footprint column that `of` selects.
    fn footprint<T: Packed>(&self, of: fn(&Footprints<BodyFixed>) -> &Values<T>) -> T {
        of(self.site.footprints).at(self.row() as usize)
    }

    fn profile(&self) -> String {
        let index = self.site.ranges.shots.profile.at(self.at);
        let profile = self.site.profiles.get(index as usize);
        profile.map_or_else(String::new, |profile| profile.id.clone())
    }
}

fn columns<'a>() -> Vec<Column<RangedShot<'a>>> {
    fn residual<'a>(
        name: &'static str,
        description: &'static str,
        of: fn(&ShotResiduals) -> &Values<f64>,
    ) -> Column<RangedShot<'a>> {
        column(name, Unit::Metre, description, move |shot: &RangedShot| {
            of(&shot.site.ranges.shots).at(shot.at)
        })
    }
    /// A column whose values exist where the file has a spacecraft.
    fn own<'a>(
        name: &'static str,
        description: &'static str,
        of: fn(&ShotResiduals) -> &Values<f64>,
    ) -> Column<RangedShot<'a>> {
        column(name, Unit::Metre, description, move |shot: &RangedShot| {
            Some(of(&shot.site.ranges.shots).at(shot.at)).filter(|of| !of.is_nan())
        })
    }
    let definition = |index: usize| DEFINITIONS[index].1;
    vec![
        column(
            "profile",
            Unit::None,
            "identifier of the profile: window, orbit and crossing",
            RangedShot::profile,
        ),
        column(
            "footprint_row",
            Unit::None,
            "row of the footprint in footprints.parquet, counted from 0",
            RangedShot::row,
        ),
        column(
            "et_s",
            Unit::Second,
            "time of the shot after the {altimeter} clock correction, TDB seconds past J2000",
            |shot: &RangedShot| shot.footprint(|of| &of.et_s),
        ),
        column("orbit", Unit::None, "orbit number", |shot: &RangedShot| {
            shot.footprint(|of| &of.orbit)
        }),
        residual("range_minus_distance_m", definition(0), |shots| {
            &shots.range_minus_distance_m
        }),
        residual("range_minus_distance_crossover_m", definition(1), |shots| {
            &shots.range_minus_distance_crossover_m
        }),
        own("decoding_m", definition(2), |shots| &shots.decoding_m),
        own("spacecraft_radial_m", definition(3), |shots| {
            &shots.spacecraft_radial_m
        }),
        own("spacecraft_along_m", definition(3), |shots| {
            &shots.spacecraft_along_m
        }),
        own("spacecraft_cross_m", definition(3), |shots| {
            &shots.spacecraft_cross_m
        }),
        column(
            "outlier",
            Unit::None,
            "whether range_minus_distance_m is an outlier of its profile",
            |shot: &RangedShot| shot.site.ranges.shots.outlier.at(shot.at),
        ),
    ]
}

/// Schema of the document.
pub(super) fn schema() -> DocumentSchema {
    DocumentSchema::of::<Document>("ranges")
}

fn document<'a>(site: &SiteProducts<'a>) -> Document<'a> {
    let ranges = site.ranges;
    let once = each_once(&ranges.shots.row, site.footprints.len());
    // Shots of several windows repeat.
    let counted = || {
        (0..ranges.shots.len())
            .zip(&once)
            .filter(|(_, once)| **once)
    };
    let residual_m = |(shot, _)| ranges.shots.range_minus_distance_m.at(shot);
    let valid = |profile: &&ProfileRanges| profile.invalid_because.is_empty();
    Document {
        format: "areograph ranges 1",
        site: &site.config.site,
        valid: site.verdict.valid,
        invalid_because: &site.verdict.reasons,
        units: "metres, seconds, metres per second; angles in limits in radians",
        definitions: DEFINITIONS
            .iter()
            .map(|(residual, is)| Definition {
                residual,
                is: site.config.terms().fill(is),
            })
            .collect(),
        mola_clock: Clock {
            configured: &site.config.altimeter_clock,
            correction_s: site.config.altimeter_clock.correction_s(),
        },
        limits: &site.config.range_check,
        trajectory_error_m: ranges.trajectory_error_m,
        summary: SiteSummary {
            profiles: site.profiles.len(),
            profiles_valid: ranges.profiles.iter().filter(valid).count(),
            shots: counted().count(),
            outliers: counted()
                .filter(|(shot, _)| ranges.shots.outlier.at(*shot))
                .count() as u64,
            range_minus_distance_m: Summary::over(|| counted().map(residual_m)),
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
        solar_longitude_deg: (site.footprints.body == Body::Mars)
            .then(|| solar_longitude_rad(profile.interval.start).to_degrees()),
        simultaneous: profile
            .simultaneous
            .iter()
            .filter_map(|of| {
                Some(SimultaneousImage {
                    image: &site.images.get(of.image)?.times.id,
                    shots: of.shots,
                })
            })
            .collect(),
        judged: ranges.is_judged(&site.config.range_check),
        valid: ranges.invalid_because.is_empty(),
        invalid_because: &ranges.invalid_because,
        shots_nadir_by_range: nadir_by_range(site, profile),
        range_minus_distance_m: ranges.range_minus_distance_m,
        mean_without_outliers_m: ranges.mean_without_outliers_m,
        range_minus_distance_crossover_m: ranges.range_minus_distance_crossover_m,
        decoding_m: ranges.decoding_m,
        decoding_without_outliers_m: ranges.decoding_without_outliers_m,
        spacecraft_radial_m: radial,
        spacecraft_along_m: along,
        spacecraft_cross_m: cross,
        trend_m_s: ranges.trend_m_s,
        outliers: ranges.outliers,
        bias_scan: ranges.scan.as_ref().map(scan_document),
    }
}

/// Shots whose file does not state the position of the spacecraft: shots of tables, never of a PEDR file.
fn nadir_by_range(site: &SiteProducts, profile: &Profile) -> u32 {
    let rows = profile.rows.iter();
    let without = rows
        .filter(|row| !states_spacecraft(site.footprints, **row as usize))
        .count();
    u32::try_from(without).unwrap_or(u32::MAX)
}

fn scan_document(scan: &BiasScan) -> Scan<'_> {
    Scan {
        radius: scan.radius,
        correction_s: &scan.correction_s,
        spread_m: &scan.spread_m,
        best_s: scan.best_s,
        uncertainty_s: scan.uncertainty_s,
    }
}
