//! Biases of mission phases.

use std::{cmp::Ordering, collections::BTreeMap};

use schemars::JsonSchema;
use serde::Serialize;

use super::rows::PairRow;
use areograph_geom::robust_mean::{Observation, RobustMean};

/// A mean over the pairs of a phase, and what it decides.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct Quantity {
    /// The mean, or the slope.
    pub mean: RobustMean,
    /// Whether it is reported as different from zero; missing where the groups of pairs are too few for a decision.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub differs_from_zero: Option<bool>,
}

impl Quantity {
    fn of(observations: &[Observation]) -> Option<Self> {
        let mean = RobustMean::of(observations)?;
        Some(Self {
            mean,
            differs_from_zero: mean.differs_from_zero(),
        })
    }
}

/// The pairs of a mission phase, which is that of their first image, with the orientation from the kernels.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct PhaseSummary {
    /// The phase; `unknown` where no index states it.
    pub phase: String,
    /// Pairs of valid sites, each once.
    pub pairs: u32,
    /// Misregistration of the footprints along the track, image with the larger emission minus the other, metres; over pairs
    /// whose emissions are known and differ.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub along_m: Option<Quantity>,
    /// Misregistration across the track, in the same sense, metres.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub across_m: Option<Quantity>,
    /// Offset of the attitude clock that displacements of the tie points suggest, seconds: the slope of the displacements
    /// over those of one second. Only differences in how images turn reveal it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub attitude_clock_s: Option<Quantity>,
    /// Mean height of the tie points above the laser surface, metres.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub height_m: Option<Quantity>,
}

/// The phases in alphabetical order.
///
/// * `pairs` – with the group of each: pairs of different groups share neither an image nor an orbit
pub(super) fn phases(pairs: &[(&PairRow, usize)]) -> Vec<PhaseSummary> {
    let mut of_phases: BTreeMap<&str, Vec<(&PairRow, usize)>> = BTreeMap::new();
    for (pair, group) in pairs {
        let own = of_phases.entry(&pair.phases[0]).or_default();
        own.push((*pair, *group));
    }
    let summary = |(phase, pairs): (&str, Vec<(&PairRow, usize)>)| {
        let quantity = |of: &dyn Fn(&PairRow) -> Option<(f64, f64)>| {
            let each = pairs.iter().filter_map(|(pair, group)| {
                let (value, factor) = of(pair)?;
                Some(Observation {
                    value,
                    factor,
                    group: *group,
                })
            });
            Quantity::of(&each.collect::<Vec<_>>())
        };
        PhaseSummary {
            phase: phase_or_unknown(phase).to_owned(),
            pairs: u32::try_from(pairs.len()).unwrap_or(u32::MAX),
            along_m: quantity(&|pair| {
                let of = pair.before.misregistration?;
                Some((pair.sense()? * of.along_m.value, 1.0))
            }),
            across_m: quantity(&|pair| {
                let of = pair.before.misregistration?;
                Some((pair.sense()? * of.across_m.value, 1.0))
            }),
            attitude_clock_s: quantity(&|pair| {
                Some((pair.before.ties_along_m?.value, pair.clock_m_s?))
            }),
            height_m: quantity(&|pair| Some((pair.before.heights?.mean_m, 1.0))),
        }
    };
    of_phases.into_iter().map(summary).collect()
}

/// Name of a phase in folders and tables.
#[must_use]
pub fn phase_or_unknown(phase: &str) -> &str {
    if phase.is_empty() { "unknown" } else { phase }
}

impl PairRow {
    /// 1 where the second image has the larger emission, −1 where the first has: misregistrations, second minus first image,
    /// times this number are those of the image with the larger emission minus those of the other, and all pairs can be
    /// compared. `None` for equal or unknown emissions.
    #[must_use]
    pub fn sense(&self) -> Option<f64> {
        let [first, second] = self.emission_rad;
        match second?.partial_cmp(&first?)? {
            Ordering::Greater => Some(1.0),
            Ordering::Less => Some(-1.0),
            Ordering::Equal => None,
        }
    }
}
