//! Spacing of the shots of a profile, and the gaps in it: a complete capability in one file, the worked example of
//! CONTRIBUTING.
//!
//! Between shots the ground is interpolated. Clouds, saturated returns, lost packets and `pedr.filter` leave gaps of
//! kilometres that a map of dots hides. Shan et al. 2005 (figure 5) label the distances between footprints on an image.
//!
//! The altimeter fires at a constant rate. The period is the lower decile of the intervals between neighbouring shots,
//! so that it holds while up to nine tenths of the shots are missing at random.

use std::sync::atomic::AtomicBool;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Capability;
use crate::{
    config::SiteConfig,
    error::Result,
    footprints::Footprints,
    frames::BodyFixed,
    geom::{ellipsoid::spherical_to_xyz_m, statistics::median},
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

/// Share of missing shots above which a profile receives a remark: most of its relief is then interpolated.
const MISSING_SHARE_MAX: f64 = 0.5;
/// Shots closer in time than this are spots of one pulse, seconds.
const SAME_PULSE_S: f64 = 1e-3;

pub(super) static CAPABILITY: Capability = Capability {
    products: &[&DOCUMENT],
    section: SECTION,
    judge: Some(findings),
    count: None,
};

stage_inputs! {
    /// Footprints and their profiles.
    pub struct MeasureSpacing<'a> {
        /// Footprints in the frame of the products.
        pub converted: &'a Output<Converted>,
        /// Profiles.
        pub profiles: &'a Output<Vec<Profile>>,
    }
}

impl Stage for MeasureSpacing<'_> {
    const NAME: &'static str = "measure_spacing";
    type Output = Vec<ProfileSpacing>;
    stage_inputs!(fingerprint);

    fn run(&self, _stop: &AtomicBool) -> Result<Vec<ProfileSpacing>> {
        let footprints = &self.converted.value()?.footprints;
        let profiles = self.profiles.value()?.iter();
        Ok(profiles.map(|of| spacing(footprints, &of.rows)).collect())
    }
}

/// Spacing of the shots of a profile.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ProfileSpacing {
    /// Shots; spots of one pulse count once.
    pub shots: u32,
    /// Shots that are missing between the first and the last one.
    pub missing: u32,
    /// Times and distances; `None` for a single shot.
    pub between: Option<Neighbours>,
}

/// Intervals between neighbouring shots.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Neighbours {
    /// Period of the altimeter, seconds.
    pub period_s: f64,
    /// Median distance on the ground between shots of consecutive pulses, metres.
    pub spacing_m: f64,
    /// Largest distance on the ground between neighbouring shots, metres.
    pub gap_m: f64,
}

impl ProfileSpacing {
    /// Share of the pulses between the first and the last shot that have no shot.
    #[must_use]
    pub fn missing_share(&self) -> f64 {
        f64::from(self.missing) / f64::from((self.shots + self.missing).max(1))
    }
}

/// Spacing of the shots with these rows, which are in the order of time.
fn spacing(footprints: &Footprints<BodyFixed>, rows: &[u32]) -> ProfileSpacing {
    let et_s = |row: &u32| footprints.et_s[*row as usize];
    let mut rows = rows.to_vec();
    rows.dedup_by(|later, earlier| et_s(later) - et_s(earlier) < SAME_PULSE_S);
    let shots = u32::try_from(rows.len()).unwrap_or(u32::MAX);
    let place = |row: &u32| {
        let row = *row as usize;
        spherical_to_xyz_m(
            footprints.longitude_rad[row],
            footprints.latitude_rad[row],
            footprints.radius_m[row],
        )
    };
    // Time, and distance along the arc at the mean radius of two neighbours.
    let intervals: Vec<(f64, f64)> = rows
        .windows(2)
        .map(|pair| {
            let [one, other] = [place(&pair[0]), place(&pair[1])];
            let radius_m = f64::midpoint(one.norm(), other.norm());
            (
                et_s(&pair[1]) - et_s(&pair[0]),
                one.angle(&other) * radius_m,
            )
        })
        .collect();
    let mut times_s: Vec<f64> = intervals.iter().map(|(time_s, _)| *time_s).collect();
    times_s.sort_by(f64::total_cmp);
    let Some(&period_s) = times_s.get(times_s.len() / 10) else {
        return ProfileSpacing {
            shots,
            missing: 0,
            between: None,
        };
    };
    let pulses = |time_s: f64| (time_s / period_s).round().max(1.0);
    let missing: f64 = times_s.iter().map(|time_s| pulses(*time_s) - 1.0).sum();
    let consecutive = intervals
        .iter()
        .filter(|(time_s, _)| pulses(*time_s) <= 1.0);
    let mut spacings_m: Vec<f64> = consecutive.map(|(_, distance_m)| *distance_m).collect();
    let distances_m = intervals.iter().map(|(_, distance_m)| *distance_m);
    ProfileSpacing {
        shots,
        missing: missing as u32,
        between: Some(Neighbours {
            period_s,
            spacing_m: median(&mut spacings_m),
            gap_m: distances_m.fold(0.0, f64::max),
        }),
    }
}

/// The profiles of a site with their spacing.
fn spacings<'a>(site: &SiteProducts<'a>) -> Result<Vec<(&'a Profile, &'a ProfileSpacing)>> {
    let found = site.find::<Vec<ProfileSpacing>>()?;
    let found = found.into_iter().flatten();
    Ok(site.profiles.iter().zip(found).collect())
}

static DOCUMENT: Declaration = Declaration {
    path: "spacing.json",
    what: "spacing of the shots of every profile, its largest gap, and the shots that are missing",
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
    description = "spacing.json of areograph: spacing of the shots of every profile. Metres and seconds; unknown values are omitted."
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
    /// Number of shots; spots of one pulse count once.
    shots: u32,
    /// Number of pulses without a shot between the first and the last one.
    missing: u32,
    /// Period of the altimeter.
    #[serde(skip_serializing_if = "Option::is_none")]
    period_s: Option<f64>,
    /// Median distance on the ground between shots of consecutive pulses.
    #[serde(skip_serializing_if = "Option::is_none")]
    spacing_m: Option<f64>,
    /// Largest distance on the ground between neighbouring shots.
    #[serde(skip_serializing_if = "Option::is_none")]
    gap_m: Option<f64>,
}

impl<'a> Document<'a> {
    fn of(site: &SiteProducts<'a>) -> Result<Self> {
        let profiles = spacings(site)?.into_iter().map(|(profile, of)| Entry {
            profile: &profile.id,
            shots: of.shots,
            missing: of.missing,
            period_s: of.between.map(|of| of.period_s),
            spacing_m: of.between.map(|of| of.spacing_m),
            gap_m: of.between.map(|of| of.gap_m),
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

fn write(site: &SiteProducts) -> Result<String> {
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
    let mut any = false;
    for (index, (profile, of)) in spacings(site)?.into_iter().enumerate() {
        let is_dense = of.missing_share() <= MISSING_SHARE_MAX;
        any |= !is_dense;
        let count = |count: u32, place: &str| Cell::from(whole(count)).traced(place);
        let metres = |value: Option<f64>, place: &str| {
            let known = value.map(|value| Cell::from(label(value, 0)).traced(place));
            known.unwrap_or_else(|| Cell::from("–"))
        };
        table.row_of(
            &format!("spacing.json#/profiles/{index}"),
            is_dense,
            [
                (*profile.id).into(),
                count(of.shots, "/shots"),
                count(of.missing, "/missing"),
                metres(of.between.map(|of| of.spacing_m), "/spacing_m"),
                metres(of.between.map(|of| of.gap_m), "/gap_m"),
            ],
        );
    }
    let words = paragraph(
        "Missing shots are pulses between the first and the last shot of the profile without a shot in the products. The \
         ground in a gap is interpolated.",
    );
    Ok(words + &folded_unless(any, "Profiles", &table.finish()))
}

/// The profile with the largest share of missing shots.
fn findings(_config: &SiteConfig, book: &Book) -> Result<Findings> {
    let profiles = book.of::<Vec<Profile>>()?.iter();
    let spacings = book.of::<Vec<ProfileSpacing>>()?;
    let checks = profiles.clone().zip(spacings).map(|(profile, of)| {
        let share = of.missing_share();
        Check::of_share(
            CheckKind::ShotsMissing,
            &*profile.id,
            share,
            MISSING_SHARE_MAX,
            Warning,
        )
    });
    let sparse = profiles.zip(spacings);
    let sparse = sparse.filter(|(_, of)| of.missing_share() > MISSING_SHARE_MAX);
    let remarks = sparse.map(|(profile, of)| {
        format!(
            "profile {}: {} of {} shots are missing, expected at most {:.0} %",
            profile.id,
            of.missing,
            of.shots + of.missing,
            100.0 * MISSING_SHARE_MAX
        )
    });
    Ok(Findings {
        remarks: remarks.collect(),
        checks: Check::worst(checks).into_iter().collect(),
        ..Findings::default()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const RADIUS_M: f64 = 3.396e6;

    /// Shots of these numbers of a pulse each 0.1 s, 300 m apart along a meridian of a sphere of 3,396 km.
    fn shots(pulses: &[u32]) -> (Footprints<BodyFixed>, Vec<u32>) {
        let mut footprints = Footprints::new(Vec::new());
        for pulse in pulses.iter().copied().map(f64::from) {
            footprints.et_s.push(0.1 * pulse);
            footprints.longitude_rad.push(0.0);
            footprints.latitude_rad.push(300.0 / RADIUS_M * pulse);
            footprints.radius_m.push(RADIUS_M);
        }
        let rows = 0..u32::try_from(pulses.len()).unwrap();
        (footprints, rows.collect())
    }

    #[test]
    fn missing_shots_are_counted_and_the_largest_gap_is_measured() {
        let (footprints, rows) = shots(&[0, 1, 2, 3, 7, 8, 10, 11, 12, 13]);
        let of = spacing(&footprints, &rows);
        assert_eq!((of.shots, of.missing), (10, 4));
        let between = of.between.unwrap();
        // Rounding of angles of 1e-4 rad times the radius, metres.
        assert!((between.spacing_m - 300.0).abs() < 1e-3);
        assert!((between.gap_m - 1_200.0).abs() < 1e-3);
        assert!((between.period_s - 0.1).abs() < 1e-9);
    }

    #[test]
    fn spots_of_a_pulse_count_once_and_a_single_shot_has_no_spacing() {
        let (footprints, rows) = shots(&[0, 0, 0, 1, 1, 2]);
        let of = spacing(&footprints, &rows);
        assert_eq!((of.shots, of.missing), (3, 0));
        let (footprints, rows) = shots(&[5]);
        let single = spacing(&footprints, &rows);
        assert_eq!((single.shots, single.between), (1, None));
        assert_eq!(spacing(&footprints, &[]).shots, 0);
    }

    #[test]
    fn the_period_holds_while_most_shots_are_missing() {
        // One shot in three, in pairs: 40 of 60 pulses are missing but for the end.
        let pulses: Vec<u32> = (0..60).filter(|pulse| pulse % 6 < 2).collect();
        let (footprints, rows) = shots(&pulses);
        let of = spacing(&footprints, &rows);
        assert_eq!((of.shots, of.missing), (20, 36));
        assert!(of.missing_share() > MISSING_SHARE_MAX);
    }
}
