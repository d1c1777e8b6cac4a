//! Pointing of a laser on the bus of the cameras, in the document of an adjustment.

use schemars::JsonSchema;
use serde::Serialize;

use areograph_base::schema::{at, none_negative};
use areograph_geom::statistics::Summary;
use areograph_stages::adjust::{BoresightSummary, ProfileOffset, SpotsOfImage};

/// [`BoresightSummary`] without unknown values.
#[derive(Serialize, JsonSchema)]
pub(super) struct BoresightDocument<'a> {
    /// Angles from the given laser direction: towards X of the bus, and perpendicular to X and the beam.
    angles_rad: [f64; 2],
    #[schemars(transform = none_negative)]
    sigma_rad: [f64; 2],
    /// Covariance of the angles, rad².
    covariance_rad2: [[f64; 2]; 2],
    prior: PriorDocument<'a>,
    /// Statement of the observations of this site about the angles, without a priori values; omitted where an angle is held.
    #[serde(skip_serializing_if = "Option::is_none")]
    information: Option<InformationDocument>,
    images: Vec<SpotsDocument<'a>>,
    /// Offset of each recorded profile from its adjusted position.
    profile_shifts: &'a [ProfileOffset],
    /// Images without a simultaneous profile.
    without: &'a [String],
    /// The unknown with the largest standardised residual of its a priori value, and this residual.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(transform = at("/prefixItems/1", "minimum", 0))]
    farthest: Option<&'a (String, f64)>,
}

/// A priori values of the angles.
#[derive(Serialize, JsonSchema)]
struct PriorDocument<'a> {
    angles_rad: [f64; 2],
    #[schemars(transform = none_negative)]
    sigma_rad: [f64; 2],
    /// Sites of `adjustment.boresight` whose statements they contain.
    sites: &'a [String],
    /// Sites of that file that share an image or an orbit with this site, and are not used.
    left_out: &'a [String],
    /// Sites of that file that contradict the others, and are not used.
    contradicting: &'a [String],
}

/// Normal equations of the two angles.
#[derive(Serialize, JsonSchema)]
struct InformationDocument {
    /// Matrix, per rad²: first angle, both, second angle.
    matrix: [f64; 3],
    /// Right-hand side, per radian.
    vector: [f64; 2],
}

#[derive(Serialize, JsonSchema)]
struct SpotsDocument<'a> {
    image: &'a str,
    spots: usize,
    /// Delay of the image lines relative to the shots, with its standard deviation, if this delay is an unknown.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(transform = at("/prefixItems/1", "minimum", 0))]
    line_time_s: Option<(f64, f64)>,
    /// Image positions of footprints from the initial orientation minus positions from the laser mounting: along the
    /// track in lines, across the track in focal-plane pixels.
    footprints_off: &'a [Summary; 2],
    /// Direction of the laser by the mounting, components in the camera.
    beam: [f64; 3],
}

impl<'a> BoresightDocument<'a> {
    pub(super) fn of(found: &'a BoresightSummary) -> Self {
        let spots = |of: &'a SpotsOfImage| SpotsDocument {
            image: &of.image,
            spots: of.spots,
            line_time_s: of.line_time_s,
            footprints_off: &of.footprints_off,
            beam: of.beam,
        };
        Self {
            angles_rad: found.angles_rad,
            sigma_rad: found.sigma_rad,
            covariance_rad2: found.covariance_rad2.into(),
            prior: PriorDocument {
                angles_rad: found.prior.angles.angles_rad.into(),
                sigma_rad: found.prior.angles.sigmas_rad(),
                sites: &found.prior.sites,
                left_out: &found.prior.left_out,
                contradicting: &found.prior.contradicting,
            },
            information: found.information.map(|of| InformationDocument {
                matrix: of.matrix_terms(),
                vector: of.vector.into(),
            }),
            images: found.images.iter().map(spots).collect(),
            profile_shifts: &found.profile_shifts,
            without: &found.without,
            farthest: found.farthest.as_ref(),
        }
    }
}
