//! Spacing of the shots of a profile, and the gaps in it: a complete capability in one file, the worked example of
//! CONTRIBUTING.
//!
//! Between shots the ground is interpolated. Clouds, saturated returns, lost packets and `pedr.filter` cause gaps of
//! several kilometres that a map of points does not show. Shan et al. 2005 (figure 5) label the distances between
//! footprints on an image.
//!
//! The altimeter fires at a constant rate: MOLA ten times a second (PEDR software interface specification). Tables of shots
//! do not state the period; it is then estimated from the intervals between the shots of a table. Only pulses inside the
//! window count, since a track may leave a window and return.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "pulse counts reach three thousand in the longest pause, and casts of floats saturate"
)]

#[cfg(test)]
mod tests;

use std::{collections::BTreeMap, f64::consts::TAU, sync::atomic::AtomicBool};

use maud::{Markup, html};
use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Capability;
use crate::{
    config::{SiteConfig, WindowConfig},
    error::Result,
    footprints::Footprints,
    frames::BodyFixed,
    geom::{
        ellipsoid::spherical_to_xyz_m,
        statistics::median,
        window::{Region, WindowShape},
    },
    products::{Content, Declaration, Role, SiteProducts, Write, write_json},
    report::{
        Section,
        parts::{Cell, Column, Table, folded_unless, label, paragraph, whole},
    },
    schema::DocumentSchema,
    stage::{Output, Stage},
    stage_inputs,
    stages::{convert_datum::Converted, group_profiles::Profile, judge::Findings},
    store::book::Book,
    verdict::{Check, CheckKind, CheckOutcome::Warning},
};

/// Period of MOLA, seconds.
const PEDR_PERIOD_S: f64 = 0.1;
/// Shots closer in time than this are spots of one pulse, seconds.
const SAME_PULSE_S: f64 = 1e-3;
/// Fewest intervals from which a period is estimated.
const INTERVALS_MIN: usize = 20;
/// Intervals within this share of their lower decile are those of consecutive pulses.
const CONSECUTIVE: f64 = 0.1;

pub(super) static CAPABILITY: Capability = Capability {
    products: &[&DOCUMENT],
    section: SECTION,
    judge: Some(findings),
    count: None,
};

stage_inputs! {
    /// Footprints, their profiles, and the windows.
    pub struct MeasureSpacing<'a> {
        /// Footprints in the frame of the products.
        pub converted: &'a Output<Converted>,
        /// Profiles.
        pub profiles: &'a Output<Vec<Profile>>,
        /// Windows in the order of the footprints' bits.
        pub windows: &'a [WindowConfig],
        /// Whether shots come from tables, whose period is not known.
        pub has_tables: &'a bool,
    }
}

impl Stage for MeasureSpacing<'_> {
    const NAME: &'static str = "measure_spacing";
    const METHOD: u32 = 2;
    type Output = Vec<ProfileSpacing>;
    stage_inputs!(fingerprint);

    fn run(&self, _stop: &AtomicBool) -> Result<Vec<ProfileSpacing>> {
        let footprints = &self.converted.value()?.footprints;
        let profiles = self.profiles.value()?;
        let periods_s = if *self.has_tables {
            periods_s(footprints, profiles)
        } else {
            let files = profiles.iter().filter_map(|of| file(footprints, of));
            files.map(|file| (file, PEDR_PERIOD_S)).collect()
        };
        let spacings = profiles.iter().map(|of| {
            let seen_in = footprints.windows_of(&of.rows);
            let windows = self.windows.iter().enumerate();
            let own = windows.filter(|(bit, _)| seen_in >> bit & 1 == 1);
            let regions: Option<Vec<Region>> =
                own.map(|(_, window)| region(&window.shape)).collect();
            let period_s = file(footprints, of).and_then(|file| periods_s.get(&file).copied());
            spacing(footprints, &of.rows, period_s, regions.as_deref())
        });
        Ok(spacings.collect())
    }
}

/// Spacing of the shots of a profile.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ProfileSpacing {
    /// Shots; spots of one pulse count once.
    pub shots: u32,
    /// What the period of the altimeter shows; `None` where it is not known.
    pub by_period: Option<ByPeriod>,
    /// Largest distance on the ground between consecutive shots, as far as it is inside the window, metres; `None` for a
    /// single shot.
    pub gap_m: Option<f64>,
}

/// Pulses of a profile.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ByPeriod {
    /// Period of the altimeter, seconds.
    pub period_s: f64,
    /// Pulses inside the window, between the first and the last shot, that have no shot.
    pub missing: u32,
    /// Median distance on the ground between shots of consecutive pulses, metres; `None` without such shots.
    pub spacing_m: Option<f64>,
}

impl ProfileSpacing {
    /// Share of the pulses inside the window, between the first and the last shot, that have no shot; 0 where the period is
    /// not known.
    #[must_use]
    pub fn missing_share(&self) -> f64 {
        let missing = self.by_period.map_or(0, |of| of.missing);
        f64::from(missing) / f64::from((self.shots + missing).max(1))
    }
}

/// The ground of a window; `None` for the outline of an image, which a track crosses once.
fn region(shape: &WindowShape) -> Option<Region> {
    let is_of_image = matches!(shape, WindowShape::Image { .. });
    (!is_of_image).then(|| Region::new(shape))
}

/// Index of the file of a profile.
fn file(footprints: &Footprints<BodyFixed>, profile: &Profile) -> Option<u16> {
    let first = profile.rows.first()?;
    Some(footprints.file.at(*first as usize))
}

/// Rows of a profile, one per pulse.
fn pulses(footprints: &Footprints<BodyFixed>, rows: &[u32]) -> Vec<usize> {
    let mut pulses: Vec<usize> = rows.iter().map(|row| *row as usize).collect();
    let et_s = &footprints.et_s;
    pulses.dedup_by(|later, earlier| (et_s.at(*later) - et_s.at(*earlier)).abs() < SAME_PULSE_S);
    pulses
}

/// The period of every table of shots with enough of them, by its index.
fn periods_s(footprints: &Footprints<BodyFixed>, profiles: &[Profile]) -> BTreeMap<u16, f64> {
    let mut intervals_s: BTreeMap<u16, Vec<f64>> = BTreeMap::new();
    for profile in profiles {
        let Some(file) = file(footprints, profile) else {
            continue;
        };
        let pulses = pulses(footprints, &profile.rows);
        let et_s = |row: usize| footprints.et_s.at(row);
        let of_profile = pulses.windows(2).map(|pair| et_s(pair[1]) - et_s(pair[0]));
        intervals_s.entry(file).or_default().extend(of_profile);
    }
    let period_s = |mut intervals_s: Vec<f64>| {
        intervals_s.sort_by(f64::total_cmp);
        let decile_s = *intervals_s.get(intervals_s.len() / 10)?;
        let is_consecutive = |of: &f64| (of / decile_s - 1.0).abs() < CONSECUTIVE;
        let consecutive: Vec<f64> = intervals_s.iter().copied().filter(is_consecutive).collect();
        let mean_s = consecutive.iter().sum::<f64>() / consecutive.len() as f64;
        (consecutive.len() >= INTERVALS_MIN).then_some(mean_s)
    };
    let each = intervals_s.into_iter();
    each.filter_map(|(file, intervals_s)| Some((file, period_s(intervals_s)?)))
        .collect()
}

/// Spacing of the shots with these rows, which are in the order of time, in a window with this region.
fn spacing(
    footprints: &Footprints<BodyFixed>,
    rows: &[u32],
    period_s: Option<f64>,
    regions: Option<&[Region]>,
) -> ProfileSpacing {
    let rows = pulses(footprints, rows);
    let place = |row: usize| {
        spherical_to_xyz_m(
            footprints.longitude_rad.at(row),
            footprints.latitude_rad.at(row),
            footprints.radius_m.at(row),
        )
    };
    let (mut missing, mut gap_m, mut spacings_m) = (0, None, Vec::new());
    for pair in rows.windows(2) {
        let [one, other] = [place(pair[0]), place(pair[1])];
        // Along the arc at the mean radius.
        let distance_m = one.angle(&other) * f64::midpoint(one.norm(), other.norm());
        let time_s = footprints.et_s.at(pair[1]) - footprints.et_s.at(pair[0]);
        let pulses = period_s.map_or(1.0, |period_s| (time_s / period_s).round().max(1.0));
        let lost = pulses as u32 - 1;
        let inside = (1..=lost).filter(|pulse| {
            let at = one.lerp(&other, f64::from(*pulse) / pulses);
            regions.is_none_or(|regions| regions.iter().any(|region| contains(region, &at)))
        });
        let inside = u32::try_from(inside.count()).unwrap_or(u32::MAX);
        if lost == 0 {
            spacings_m.push(distance_m);
        }
        missing += inside;
        let inside_m = distance_m * f64::from(inside + 1) / pulses;
        gap_m = Some(gap_m.map_or(inside_m, |gap_m: f64| gap_m.max(inside_m)));
    }
    ProfileSpacing {
        shots: u32::try_from(rows.len()).unwrap_or(u32::MAX),
        by_period: period_s.map(|period_s| ByPeriod {
            period_s,
            missing,
            spacing_m: (!spacings_m.is_empty()).then(|| median(&mut spacings_m)),
        }),
        gap_m,
    }
}

/// Whether a region contains the point below or above `place`.
fn contains(region: &Region, place: &Vector3<f64>) -> bool {
    let longitude_rad = place.y.atan2(place.x).rem_euclid(TAU);
    region.contains(longitude_rad, (place.z / place.norm()).asin())
}

/// The profiles of a site with their spacing.
fn spacings<'a>(site: &SiteProducts<'a>) -> Result<Vec<(&'a Profile, &'a ProfileSpacing)>> {
    let found = site.find::<Vec<ProfileSpacing>>()?;
    let found = found.into_iter().flatten();
    Ok(site.profiles.iter().zip(found).collect())
}

static DOCUMENT: Declaration = Declaration {
    path: "spacing.json",
    what: "shot spacing, largest gap and number of missing shots of every profile",
    readers: "scripts",
    rows: "profiles",
    role: Role::Metadata,
    content: Content::Document(|| DocumentSchema::of::<Document>("spacing")),
    write: Write::Where {
        sites: "a site with profiles",
        has: |site| !site.profiles.is_empty() && site.has::<Vec<ProfileSpacing>>(),
        write: |path, of| {
            let document = Document::of(of.site)?;
            write_json(path, &document)?;
            Ok(document.profiles.len() as u64)
        },
    },
    uses: &[],
};

/// `spacing.json`.
#[derive(Serialize, JsonSchema)]
#[schemars(
    deny_unknown_fields,
    title = "spacing.json",
    description = "spacing.json of areograph: shot spacing of every profile. Metres and seconds; unknown values are omitted."
)]
struct Document<'a> {
    #[schemars(extend("const" = "areograph spacing 1"))]
    format: &'static str,
    site: &'a str,
    profiles: Vec<Entry<'a>>,
}

/// A profile.
#[derive(Serialize, JsonSchema)]
struct Entry<'a> {
    /// Identifier of the profile.
    profile: &'a str,
    /// Number of shots; spots of one pulse are counted once.
    shots: u32,
    /// Number of pulses inside the window, between the first and the last shot, that have no shot in the products; omitted
    /// if the period is not known.
    #[serde(skip_serializing_if = "Option::is_none")]
    missing: Option<u32>,
    /// Interval between pulses: from the specification for MOLA, estimated from the shots for other altimeters.
    #[serde(skip_serializing_if = "Option::is_none")]
    period_s: Option<f64>,
    /// Median distance on the ground between shots of consecutive pulses.
    #[serde(skip_serializing_if = "Option::is_none")]
    spacing_m: Option<f64>,
    /// Largest distance on the ground between consecutive shots of the profile; only the part inside the window counts.
    #[serde(skip_serializing_if = "Option::is_none")]
    gap_m: Option<f64>,
}

impl<'a> Document<'a> {
    fn of(site: &SiteProducts<'a>) -> Result<Self> {
        let profiles = spacings(site)?.into_iter().map(|(profile, of)| Entry {
            profile: &profile.id,
            shots: of.shots,
            missing: of.by_period.map(|of| of.missing),
            period_s: of.by_period.map(|of| of.period_s),
            spacing_m: of.by_period.and_then(|of| of.spacing_m),
            gap_m: of.gap_m,
        });
        Ok(Self {
            format: "areograph spacing 1",
            site: &site.config.site,
            profiles: profiles.collect(),
        })
    }
}

const SECTION: Section = Section {
    title: "Spacing of shots",
    anchor: "spacing",
    checks: &[CheckKind::ShotsMissing],
    appears: |site| !site.profiles.is_empty() && site.has::<Vec<ProfileSpacing>>(),
    write,
};

fn write(site: &SiteProducts) -> Result<Markup> {
    let mut table = Table::new(
        "Shots of every profile",
        &[
            Column::Text("profile"),
            Column::Number("shots"),
            Column::Number("missing shots"),
            Column::Number("spacing (m)"),
            Column::Number("largest gap (m)"),
        ],
    );
    let limit = site.config.limits.missing_shots_max;
    let mut is_sparse = false;
    for (index, (profile, of)) in spacings(site)?.into_iter().enumerate() {
        is_sparse |= of.missing_share() > limit;
        let count = |count: u32, place: &str| Cell::from(whole(count)).traced(place);
        let missing = of.by_period.map(|of| count(of.missing, "/missing"));
        let metres = |value: Option<f64>, place: &str| {
            let known = value.map(|value| Cell::from(label(value, 0)).traced(place));
            known.unwrap_or_else(|| Cell::from("–"))
        };
        table.row_of(
            &format!("spacing.json#/profiles/{index}"),
            true,
            [
                (*profile.id).into(),
                count(of.shots, "/shots"),
                missing.unwrap_or_else(|| Cell::from("–")),
                metres(of.by_period.and_then(|of| of.spacing_m), "/spacing_m"),
                metres(of.gap_m, "/gap_m"),
            ],
        );
    }
    let words = paragraph(
        "A shot is missing if the products contain none for a pulse inside the window, between the first and the last shot \
         of the profile: the pulse had no return, or pedr.filter rejected the shot. Heights in a gap are interpolated \
         between its two edges.",
    );
    Ok(html! { (words) (folded_unless(is_sparse, "Profiles", &table.finish())) })
}

/// The profile with the largest share of missing shots.
fn findings(config: &SiteConfig, book: &Book) -> Result<Findings> {
    let limit = config.limits.missing_shots_max;
    let profiles = book.of::<Vec<Profile>>()?.iter();
    let all = profiles.zip(book.of::<Vec<ProfileSpacing>>()?);
    let checks = all.clone().map(|(profile, of)| {
        let share = of.missing_share();
        Check::of_share(CheckKind::ShotsMissing, &*profile.id, share, limit, Warning)
    });
    let by_share = |one: &&ProfileSpacing, other: &&ProfileSpacing| {
        one.missing_share().total_cmp(&other.missing_share())
    };
    let sparse = || all.clone().filter(|(_, of)| of.missing_share() > limit);
    let worst = sparse().max_by(|(_, one), (_, other)| by_share(one, other));
    let remark = worst.map(|(profile, of)| {
        let more = match sparse().count() {
            0 | 1 => String::new(),
            count => format!(" ({count} profiles exceed the limit)"),
        };
        let missing = of.by_period.map_or(0, |of| of.missing);
        format!(
            "profile {}: {:.0} % of the pulses have no shot ({missing} of {}); expected at most {:.0} %; check \
             pedr.filter and the outline of the window{more}",
            profile.id,
            100.0 * of.missing_share(),
            of.shots + missing,
            100.0 * limit
        )
    });
    Ok(Findings {
        remarks: remark.into_iter().collect(),
        checks: Check::worst(checks).into_iter().collect(),
        ..Findings::default()
    })
}
