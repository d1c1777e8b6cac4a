//! Horizontal position from the relief of a site.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::network::Assembled;
use areograph_base::schema::none_negative;
use areograph_geom::bundle::Adjustment;

/// Horizontal position from relief, whether or not the adjustment uses relief.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ReliefSummary {
    /// Whether heights on slopes were used for the horizontal position.
    pub used: bool,
    /// Standard deviations of the position of the images relative to the MOLA surface, from relief only, east and
    /// north, metres.
    #[schemars(transform = none_negative)]
    pub sigma_m: [f64; 2],
    /// If relief is used: offset of the recorded from the true position of each profile of the surface.
    pub profile_shifts: Vec<ProfileOffset>,
    /// A priori standard deviation of these offsets in east and north, metres: the configured value, or a larger one if the
    /// offsets scatter more.
    #[schemars(range(min = 0.0))]
    pub profile_plan_sigma_m: f64,
    /// Reason why relief is used, or is not.
    pub choice: ReliefChoice,
}

/// Reason why relief is used for the horizontal position, or is not.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ReliefChoice {
    /// The configuration decides (`adjustment.relief_for_plan`).
    Configured,
    /// Relief alone is less precise than the position without relief on both axes.
    Imprecise,
    /// The mean position of the tie points was computed without and with relief.
    Compared(ReliefComparison),
    /// The adjustment with relief failed for this reason; the adjustment without relief replaces it.
    Failed(String),
}

/// Mean position of the tie points without and with relief.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ReliefComparison {
    /// Standard deviations without relief, east and north, metres.
    #[schemars(transform = none_negative)]
    pub without_sigma_m: [f64; 2],
    /// Standard deviations with relief, east and north, metres.
    #[schemars(transform = none_negative)]
    pub with_sigma_m: [f64; 2],
}

/// Offset of the recorded from the true position of a profile.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ProfileOffset {
    /// Identifier of the profile.
    pub profile: String,
    /// Offset in east, north and height, metres.
    pub shift_m: [f64; 3],
    /// Standard deviations of the offset in east, north and height, metres.
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
        profile_plan_sigma_m: control.surface.profile_plan_sigma_m(),
        choice: ReliefChoice::Configured,
    })
}
