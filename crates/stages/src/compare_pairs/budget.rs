//! Input of the uncertainty budget of a pair.

use super::{FootprintsByTies, over_footprints};
use crate::intersect::{IntersectedPoint, MeasureResidual};
use areograph_geom::{
    statistics::Summary,
    uncertainty::{BudgetInput, Misregistration, PairResiduals, ResidualMoments},
};

/// A pixel of the budget is the mean line spacing of both images along the flight.
pub(super) fn budget_input(
    residuals: PairResiduals,
    footprints: Option<&FootprintsByTies>,
    line_spacing_m: [f64; 2],
    height_over_base: f64,
) -> BudgetInput {
    BudgetInput {
        sites: vec![residuals],
        misregistration: footprints
            .and_then(|footprints| misregistration(footprints, line_spacing_m[1])),
        pixel_size_m: mean(line_spacing_m),
        height_over_base,
    }
}

/// Residuals of the first image minus residuals of the second (eq. 5), in mean line spacings of both.
pub(super) fn apart(
    points: &[(&IntersectedPoint, [MeasureResidual; 2])],
    line_spacing_m: [f64; 2],
    pixel_size_m: [f64; 2],
) -> ResidualMoments {
    let of = |pick: fn(&MeasureResidual) -> f64, unit_m: [f64; 2]| {
        let apart = points.iter().map(|(_, [first, second])| {
            (pick(first) * unit_m[0] - pick(second) * unit_m[1]) / mean(line_spacing_m)
        });
        Summary::of(&apart.collect::<Vec<f64>>())
    };
    moments_of(
        &of(|m| m.reprojection_lines, line_spacing_m),
        &of(|m| m.reprojection_px, pixel_size_m),
    )
}

pub(super) const fn moments_of(along: &Summary, across: &Summary) -> ResidualMoments {
    ResidualMoments {
        mean_x: along.mean,
        deviation_x: along.standard_deviation,
        mean_y: across.mean,
        deviation_y: across.standard_deviation,
    }
}

/// The observed along-track misregistration over the footprints of all profiles, in metres: lines times the line spacing of the second image.
fn misregistration(footprints: &FootprintsByTies, line_spacing_m: f64) -> Option<Misregistration> {
    let profiles = &footprints.profiles;
    let mean_lines = over_footprints(profiles, |of| of.lines.mean)?;
    let square = over_footprints(profiles, |of| {
        of.lines.mean.powi(2) + of.lines.standard_deviation.powi(2)
    })?;
    Some(Misregistration {
        mean_m: mean_lines * line_spacing_m,
        rms_m: square.sqrt() * line_spacing_m,
    })
}

pub(super) fn mean([first, second]: [f64; 2]) -> f64 {
    0.5 * (first + second)
}
