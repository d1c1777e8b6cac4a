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
}

impl<'a> BoresightDocument<'a> {
    pub(super) fn of(found: &'a BoresightSummary) -> Self {
        let spots = |of: &'a SpotsOfImage| SpotsDocument {
            image: &of.image,
            spots: of.spots,
            line_time_s: of.line_time_s,
            footprints_off: &of.footprints_off,
        };
        Self {
            angles_rad: found.angles_rad,
            sigma_rad: found.sigma_rad,
            images: found.images.iter().map(spots).collect(),
            profile_shifts: &found.profile_shifts,
            without: &found.without,
            farthest: found.farthest.as_ref(),
        }
    }
}
