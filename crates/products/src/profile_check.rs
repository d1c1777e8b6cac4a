//! `profiles.json`: the profiles against each other, and the surface between them tested on withheld profiles.

use schemars::JsonSchema;
use serde::Serialize;

use super::{
    files::write_json,
    product::{Content, Declaration, Role, Write},
    site::SiteProducts,
};
use areograph_base::{altimetry::GroundRadius, schema::DocumentSchema};
use areograph_geom::{ellipsoid::Spherical, statistics::Summary, surface::WithheldScore};
use areograph_stages::check_profiles::{LeftOutProfile, ShiftedProfile, WithheldStretch};

pub(super) static DOCUMENT: Declaration = Declaration {
    path: "profiles.json",
    what: "crossovers of the profiles, profile shifts, profiles that contradict the others, and predictions of each \
           profile by the surface between the shots of the other profiles",
    readers: "scripts",
    rows: "crossovers",
    role: Role::Data,
    content: Content::Document(|| DocumentSchema::of::<Document>("profiles")),
    write: Write::Site(|path, of| {
        write_json(path, &Document::of(of.site))?;
        Ok(Some(of.site.profile_check.crossovers.len() as u64))
    }),
    uses: &[],
};

/// Definitions of the numbers, for readers of the file.
const DEFINITIONS: [(&str, &str); 5] = [
    (
        "crossovers",
        "places where two profiles measured the same ground, each interpolated between two shots; sigma_m: standard \
         deviation due to the noise of the four shots and to the ground between them",
    ),
    (
        "differences_m",
        "height from the first profile minus height from the second, for profiles that are not rejected",
    ),
    (
        "shifts",
        "east, north and upward shift of a recorded profile from its true position, according to its crossovers and the a priori \
         standard deviations (profile_plan_sigma_m, profile_sigma_m), with its covariance",
    ),
    (
        "left_out",
        "profiles that lie above or below three or more others by a constant of more than five standard deviations, \
         and misplaced profiles, whose misfit at crossovers is too large; the surface between shots does not use \
         these profiles",
    ),
    (
        "withheld",
        "stretches of up to 60 shots, predicted from the shots of all other profiles: mean of measured minus predicted heights, its \
         stated standard deviation, and the shares inside the stated intervals of 68.27, 95 and 99.7 % (Student's distribution \
         with three degrees of freedom)",
    ),
];

#[derive(Serialize, JsonSchema)]
#[schemars(
    title = "Profiles of a site",
    description = "profiles.json of areograph: comparison of the altimeter's profiles at their crossovers, and test of the \
                   surface between shots on withheld profiles. Metres and degrees; unknown values are omitted."
)]
struct Document<'a> {
    #[schemars(extend("const" = "areograph profiles 1"))]
    format: &'static str,
    site: &'a str,
    definitions: Vec<Definition>,
    /// Ground radius that all stages use; omitted if the shots have one radius.
    #[serde(skip_serializing_if = "Option::is_none")]
    ground_radius: Option<GroundRadius>,
    /// Standard deviation of the radial error that the shots of a profile share, from crossovers and the a priori
    /// value.
    #[schemars(range(min = 0.0))]
    profile_sigma_m: f64,
    differences_m: Summary,
    crossovers: Vec<Crossover<'a>>,
    shifts: &'a [ShiftedProfile],
    left_out: &'a [LeftOutProfile],
    withheld: Withheld<'a>,
}

#[derive(Serialize, JsonSchema)]
struct Definition {
    of: &'static str,
    is: String,
}

#[derive(Serialize, JsonSchema)]
struct Crossover<'a> {
    profiles: [&'a str; 2],
    longitude_deg: f64,
    latitude_deg: f64,
    difference_m: f64,
    #[schemars(range(min = 0.0))]
    sigma_m: f64,
}

#[derive(Serialize, JsonSchema)]
struct Withheld<'a> {
    #[serde(skip_serializing_if = "Option::is_none")]
    score: Option<WithheldScore>,
    stretches: &'a [WithheldStretch],
}

impl<'a> Document<'a> {
    fn of(site: &SiteProducts<'a>) -> Self {
        let check = site.profile_check;
        let terms = site.config.terms();
        let crossovers = check.crossovers.iter().map(|crossover| {
            let place = Spherical::from_xyz_m(&crossover.ground.xyz_m);
            Crossover {
                profiles: crossover
                    .profiles
                    .map(|profile| &*site.profiles[profile].id),
                longitude_deg: place.longitude_rad.to_degrees().rem_euclid(360.0),
                latitude_deg: place.latitude.0.to_degrees(),
                difference_m: crossover.difference_m,
                sigma_m: crossover.sigma_m,
            }
        });
        Self {
            format: "areograph profiles 1",
            site: &site.config.site,
            definitions: DEFINITIONS
                .iter()
                .map(|(of, is)| Definition {
                    of,
                    is: terms.fill(is).into_owned(),
                })
                .collect(),
            ground_radius: site.footprints.ground_choice(),
            profile_sigma_m: check.profile_sigma_m,
            differences_m: check.differences_m,
            crossovers: crossovers.collect(),
            shifts: &check.shifts,
            left_out: &check.left_out,
            withheld: Withheld {
                score: check.score,
                stretches: &check.stretches,
            },
        }
    }
}
