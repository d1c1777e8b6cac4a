//! The datum defect of tie points: which offset angles they determine, and which they do not.

use nalgebra::DMatrix;
#[cfg(feature = "schema")]
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{
    camera::CalibrationState,
    elimination::{Triangle, reduced_rows},
    freedom::{Freedom, Parameter, contrasts},
    sight::GroundPoint,
    solve::CalibrationError,
};
use areograph_base::units::RADIANS_PER_DEGREE;

/// A combination with a larger standard deviation is not determined: no offset of a camera is as large.
const SEEN_RAD: f64 = RADIANS_PER_DEGREE;
/// Share of a named combination that must lie in the undetermined space for it to be reported.
const SHARE_MIN: f64 = 0.9;
/// Singular values below this share of the largest are rounding.
const ROUNDING: f64 = 1e-13;

/// An axis of the spacecraft.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum Axis {
    /// φ.
    Roll,
    /// ω.
    Pitch,
    /// κ.
    Yaw,
}

/// Common angle of the cameras, or a difference between them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum Combination {
    /// The same for all cameras.
    Common,
    /// The first camera against the second.
    Differential,
    /// The mean of the first cameras against a further one, which is counted from 1.
    Against(u32),
}

/// An angle of the cameras together.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(JsonSchema))]
pub struct AngleCombination {
    /// Common or differential.
    pub combination: Combination,
    /// The angle.
    pub axis: Axis,
}

impl AngleCombination {
    /// In words.
    #[must_use]
    pub fn words(self) -> String {
        let axis = match self.axis {
            Axis::Roll => "roll",
            Axis::Pitch => "pitch",
            Axis::Yaw => "yaw",
        };
        match self.combination {
            Combination::Common => format!("common {axis}"),
            Combination::Differential => format!("differential {axis}"),
            Combination::Against(camera) => format!("differential {axis} of camera {camera}"),
        }
    }
}

/// A combination of all offset angles, and its standard deviation from ties.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TieDirection {
    /// Standard deviation from the tie points only, radians; `None` where they do not determine it.
    pub sigma_rad: Option<f64>,
    /// Components along the named combinations, which have unit length, the largest first; those above a tenth.
    pub shares: Vec<(AngleCombination, f64)>,
}

/// The offset angles as determined by tie points only.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TieSight {
    /// Orthonormal combinations, the least determined first.
    pub directions: Vec<TieDirection>,
    /// Number of undetermined combinations: known to worse than a degree.
    pub unseen: u32,
    /// Named combinations in the undetermined space.
    pub unseen_names: Vec<AngleCombination>,
}

impl TieSight {
    /// The undetermined combinations, in words.
    #[must_use]
    pub fn unseen_words(&self) -> String {
        let names: Vec<String> = self.unseen_names.iter().map(|of| of.words()).collect();
        match (names.is_empty(), self.unseen) {
            (false, _) => names.join(", "),
            (true, 0) => "nothing".to_owned(),
            (true, _) => "mixtures of several angles".to_owned(),
        }
    }
}

/// The offset angles that `ties` determine at a state, without a priori knowledge.
///
/// # Errors
/// A point without a position.
pub fn tie_sight(
    ties: &[GroundPoint],
    state: &CalibrationState,
) -> Result<TieSight, CalibrationError> {
    let layout = state.layout();
    let angles = Freedom::each(layout, |_| 1.0, |of| matches!(of, Parameter::Angle { .. }));
    let mut triangle = Triangle::new(angles.len());
    for (point, tie) in ties.iter().enumerate() {
        let rows = tie
            .place(state)
            .and_then(|place_m| reduced_rows(tie, state, &angles, &place_m));
        triangle.add(rows.map_err(|why| CalibrationError::Point { point, why })?);
    }
    let (triangle, _, _) = triangle.finish();
    let svd = triangle.svd(false, true);
    let largest = svd.singular_values.max();
    let names = names(layout.cameras);
    let Some(vectors) = svd.v_t else {
        return Err(CalibrationError::Singular);
    };
    let mut order: Vec<usize> = (0..angles.len()).collect();
    order.sort_by(|a, b| svd.singular_values[*a].total_cmp(&svd.singular_values[*b]));
    let mut within = vec![0.0; names.len()];
    let mut unseen = 0;
    let directions = order.into_iter().map(|index| {
        let vector = vectors.row(index);
        let value = svd.singular_values[index];
        let mut shares: Vec<(AngleCombination, f64)> = (names.iter())
            .map(|(name, of)| (*name, vector.dot(&of.transpose())))
            .collect();
        if value * SEEN_RAD < 1.0 {
            unseen += 1;
            for (sum, (_, share)) in within.iter_mut().zip(&shares) {
                *sum += share * share;
            }
        }
        shares.retain(|(_, share)| share.abs() > 0.1);
        shares.sort_by(|a, b| b.1.abs().total_cmp(&a.1.abs()));
        TieDirection {
            sigma_rad: (value > ROUNDING * largest).then(|| value.recip()),
            shares,
        }
    });
    let directions = directions.collect();
    let unseen_names = names.iter().zip(within);
    Ok(TieSight {
        directions,
        unseen,
        unseen_names: unseen_names
            .filter(|(_, within)| within.sqrt() > SHARE_MIN)
            .map(|((name, _), _)| *name)
            .collect(),
    })
}

/// The named combinations as unit vectors over the angles, camera by camera.
fn names(cameras: usize) -> Vec<(AngleCombination, nalgebra::DVector<f64>)> {
    let common = vec![1.0 / (cameras as f64).sqrt(); cameras];
    let combinations = std::iter::once((Combination::Common, common)).chain(
        (0_u32..).zip(contrasts(cameras)).map(|(index, contrast)| {
            let name = match index {
                0 => Combination::Differential,
                _ => Combination::Against(index + 2),
            };
            (name, contrast)
        }),
    );
    let named = combinations.flat_map(|(combination, shares)| {
        [Axis::Roll, Axis::Pitch, Axis::Yaw].map(|axis| {
            let place = match axis {
                Axis::Roll => 0,
                Axis::Pitch => 1,
                Axis::Yaw => 2,
            };
            let mut of = DMatrix::zeros(3, cameras);
            for (camera, share) in shares.iter().enumerate() {
                of[(place, camera)] = *share;
            }
            let vector = nalgebra::DVector::from_column_slice(of.as_slice());
            (AngleCombination { combination, axis }, vector)
        })
    });
    named.collect()
}
