//! What the relief of a site says of the place.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::network::Assembled;
use crate::{geom::bundle::Adjustment, schema::none_negative};

/// What relief says of the place, whether it is used for it or not.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ReliefSummary {
    /// Whether heights on slopes were used for the place.
    pub used: bool,
    /// Standard deviations towards east and north to which relief alone tells where the images lie against the MOLA
    /// surface, metres.
    #[schemars(transform = none_negative)]
    pub sigma_m: [f64; 2],
    /// Where it is used: how far each profile of the surface is recorded from where it lies.
    pub profile_shifts: Vec<ProfileOffset>,
}

/// How far a profile is recorded from where it lies.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ProfileOffset {
    /// Identifier of the profile.
    pub profile: String,
    /// Towards east, north and up, metres.
    pub shift_m: [f64; 3],
    /// Standard deviations of these, metres.
    #[schemars(transform = none_negative)]
    pub sigma_m: [f64; 3],
}

/// The relief under the tie points, where it has slopes.
pub(super) fn relief<M>(
    assembled: &Assembled<M>,
    adjustment: &Adjustment,
    variance_factor: f64,
    profiles: &[String],
) -> Option<ReliefSummary> {
    let control = assembled.network.heights.as_ref()?;
    let relief = adjustment.relief.as_ref()?;
    let root = variance_factor.sqrt();
    let shifts = relief.profiles.iter().map(|shift| ProfileOffset {
        profile: profiles[shift.profile].clone(),
        shift_m: shift.shift_m,
        sigma_m: shift.root_cofactors_m.map(|root_m| root_m * root),
    });
    Some(ReliefSummary {
        used: control.surface.uses_relief(),
        sigma_m: relief.sigma_m,
        profile_shifts: shifts.collect(),
    })
}
