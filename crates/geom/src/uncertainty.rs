//! Uncertainty budget of ground points from two images, from the residuals of their intersection.
//!
//! # Source
//! Shan et al. 2005, eq. 5 to 9. Its equation 7 sums the squares of both images; along the track the paper does so,
//! across the track it takes their average, which reduces height uncertainties by √2. Both readings are given.
//!
//! Equation 7 adds the means of both images in quadrature, although by equation 5 (`Δ = Δ1 − Δ2`) means of opposite
//! sign add up. Equation 6 then assigns the remaining misregistration to the footprints. The budget by equation
//! 5 stands beside the paper's.

#[cfg(feature = "schema")]
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use areograph_base::error::Cause;

/// Mean and standard deviation of the reprojection residuals of one image.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(JsonSchema))]
pub struct ResidualMoments {
    /// Mean residual along the track, lines.
    pub mean_x: f64,
    /// Standard deviation of residuals along the track, lines.
    pub deviation_x: f64,
    /// Mean residual across the track, pixels.
    pub mean_y: f64,
    /// Standard deviation of residuals across the track, pixels.
    pub deviation_y: f64,
}

impl ResidualMoments {
    /// `D_x = sqrt(M² + σ²)`, lines.
    #[must_use]
    pub fn size_x(&self) -> f64 {
        self.mean_x.hypot(self.deviation_x)
    }

    /// `D_y = sqrt(M² + σ²)`, pixels.
    #[must_use]
    pub fn size_y(&self) -> f64 {
        self.mean_y.hypot(self.deviation_y)
    }
}

/// Residuals of a stereo pair.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PairResiduals {
    /// In the two images.
    pub images: [ResidualMoments; 2],
    /// Residuals of the first minus residuals of the second image, point by point (eq. 5).
    pub apart: ResidualMoments,
}

impl PairResiduals {
    /// A pair of which the points are not given. Two rays leave one residual for each point, which they share with
    /// opposite signs: the correlation of the images is −1, and their standard deviations add up.
    #[must_use]
    pub fn of_images(images: [ResidualMoments; 2]) -> Self {
        let [first, second] = images;
        Self {
            images,
            apart: ResidualMoments {
                mean_x: first.mean_x - second.mean_x,
                deviation_x: first.deviation_x + second.deviation_x,
                mean_y: first.mean_y - second.mean_y,
                deviation_y: first.deviation_y + second.deviation_y,
            },
        }
    }
}

/// Observed misregistration of the footprints of a pair along the track, second image minus first by tie points.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Misregistration {
    /// Mean, metres.
    pub mean_m: f64,
    /// Root mean square, metres.
    pub rms_m: f64,
}

/// Input of the budget.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct BudgetInput {
    /// Residuals of the pair of each site.
    pub sites: Vec<PairResiduals>,
    /// The misregistration of footprints; `None` where no footprint is in both images.
    pub misregistration: Option<Misregistration>,
    /// Ground size of a pixel, metres.
    pub pixel_size_m: f64,
    /// Flying height over base.
    pub height_over_base: f64,
}

/// Planimetric and height uncertainty for one treatment of the across-track residuals.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(JsonSchema))]
pub struct PointUncertainty {
    /// Across-track discrepancy due to orientation, pixels.
    pub across_px: f64,
    /// Planimetric uncertainty, eq. 8, pixels.
    pub planimetric_px: f64,
    /// Planimetric uncertainty, metres.
    pub planimetric_m: f64,
    /// Height uncertainty, eq. 9, pixels.
    pub height_px: f64,
    /// Height uncertainty, metres.
    pub height_m: f64,
}

/// Along-track contribution of the ground points.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum GroundPart {
    /// Remainder of the footprint discrepancy, pixels.
    Resolved {
        /// Pixels.
        along_px: f64,
    },
    /// The orientation explains more than the entire discrepancy.
    NotResolvable,
    /// No footprint is in both images.
    NotObserved,
}

/// Budget from equation 5, with signs.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(JsonSchema))]
pub struct SignedBudget {
    /// Along-track discrepancy due to orientation, root mean square of `Δx1 − Δx2`, pixels.
    pub along_px: f64,
    /// Part of the mean misregistration of the footprints that the mean discrepancy does not explain, pixels; missing
    /// where no footprint is in both images. A planimetric footprint error moves both projections alike and is not
    /// visible.
    #[serde(default, skip_serializing_if = "areograph_base::stored::is_left_out")]
    pub unexplained_px: Option<f64>,
    /// Point uncertainty, eq. 8 and 9, from the discrepancies with signs.
    pub point: PointUncertainty,
}

/// The budget.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(JsonSchema))]
pub struct UncertaintyBudget {
    /// Along-track discrepancy due to orientation, eq. 7, pixels.
    pub along_px: f64,
    /// Observed along-track misregistration of the footprints, root mean square, pixels; missing where no footprint is
    /// in both images.
    #[serde(default, skip_serializing_if = "areograph_base::stored::is_left_out")]
    pub total_along_px: Option<f64>,
    /// Contribution of the footprints to the misregistration, eq. 6.
    pub ground: GroundPart,
    /// Point uncertainty, eq. 8 and 9, with the average of the across-track residuals of both images, as in Shan et al. 2005.
    pub paper_average: PointUncertainty,
    /// Point uncertainty, eq. 8 and 9, with the sum of squares of both images, as in eq. 7 of Shan et al. 2005.
    pub equation_7: PointUncertainty,
    /// Budget from equation 5, where means of opposite sign add up.
    pub equation_5: SignedBudget,
    /// Ground size of a pixel, metres.
    pub pixel_size_m: f64,
    /// Flying height over base.
    pub height_over_base: f64,
}

impl UncertaintyBudget {
    /// The budget of all pairs, as the paper pools its three sites: squares averaged, across the track its averages. The
    /// pixel and the geometry are the means of all. `None` without a budget.
    #[must_use]
    pub fn pooled(budgets: &[Self]) -> Option<Self> {
        let mean =
            |of: &dyn Fn(&Self) -> f64| budgets.iter().map(of).sum::<f64>() / budgets.len() as f64;
        let root = |of: &dyn Fn(&Self) -> f64| mean(&|budget| of(budget).powi(2)).sqrt();
        let all_have = |of: fn(&Self) -> Option<f64>| {
            let known = budgets.iter().all(|budget| of(budget).is_some());
            known.then(|| root(&|budget| of(budget).unwrap_or_default()))
        };
        if budgets.is_empty() {
            return None;
        }
        let pixel_size_m = mean(&|of| of.pixel_size_m);
        let height_over_base = mean(&|of| of.height_over_base);
        let along_px = root(&|of| of.along_px);
        let total_along_px = all_have(|of| of.total_along_px);
        let signed_px = root(&|of| of.equation_5.along_px);
        let point = |along_px: f64, across_px: f64| {
            point_uncertainty(along_px, across_px, height_over_base, pixel_size_m)
        };
        Some(Self {
            along_px,
            total_along_px,
            ground: ground_part(total_along_px, along_px),
            paper_average: point(along_px, mean(&|of| of.paper_average.across_px)),
            equation_7: point(along_px, root(&|of| of.equation_7.across_px)),
            equation_5: SignedBudget {
                along_px: signed_px,
                unexplained_px: all_have(|of| of.equation_5.unexplained_px),
                point: point(signed_px, root(&|of| of.equation_5.point.across_px)),
            },
            pixel_size_m,
            height_over_base,
        })
    }
}

/// Equations 8 and 9.
fn point_uncertainty(
    along_px: f64,
    across_px: f64,
    height_over_base: f64,
    pixel_size_m: f64,
) -> PointUncertainty {
    let planimetric_px = along_px.hypot(across_px);
    let height_px = height_over_base * across_px;
    PointUncertainty {
        across_px,
        planimetric_px,
        planimetric_m: planimetric_px * pixel_size_m,
        height_px,
        height_m: height_px * pixel_size_m,
    }
}

/// Invalid input.
#[derive(Debug, Clone, PartialEq, thiserror::Error, Cause)]
#[cause(Input)]
pub enum BudgetError {
    /// No site.
    #[error("no stereo pair has residuals; expected at least one")]
    #[cause("intersect tie points of at least one stereo pair first")]
    NoSites,
    /// A number outside its range.
    #[error("{what} is {value}; expected {expected}")]
    #[cause("check the geometry and the residuals of the stereo pairs")]
    Value {
        /// The number.
        what: &'static str,
        /// Its value.
        value: f64,
        /// The expected value.
        expected: &'static str,
    },
}

/// The budget of one or more stereo pairs; intermediate results are not rounded.
///
/// # Errors
/// No pair; numbers that are not finite or not positive where they must be.
pub fn uncertainty_budget(input: &BudgetInput) -> Result<UncertaintyBudget, BudgetError> {
    check(input)?;
    let sites = input.sites.len() as f64;
    // Squares are averaged over the sites, then summed over the two images.
    let images = || input.sites.iter().flat_map(|site| &site.images);
    let summed = |size: fn(&ResidualMoments) -> f64| {
        let squares = images().map(|image| size(image).powi(2));
        (squares.sum::<f64>() / sites).sqrt()
    };
    let apart = |size: fn(&ResidualMoments) -> f64| {
        let squares = input.sites.iter().map(|site| size(&site.apart).powi(2));
        (squares.sum::<f64>() / sites).sqrt()
    };
    let average_y = images().map(ResidualMoments::size_y).sum::<f64>() / (2.0 * sites);
    let along_px = summed(ResidualMoments::size_x);
    let point = |along_px: f64, across_px: f64| {
        point_uncertainty(
            along_px,
            across_px,
            input.height_over_base,
            input.pixel_size_m,
        )
    };
    let of_pixel = |metres: f64| metres / input.pixel_size_m;
    let total_along_px = input
        .misregistration
        .map(|misregistration| of_pixel(misregistration.rms_m));
    let signed_px = apart(ResidualMoments::size_x);
    let mean_x = input
        .sites
        .iter()
        .map(|site| site.apart.mean_x)
        .sum::<f64>()
        / sites;
    Ok(UncertaintyBudget {
        along_px,
        total_along_px,
        ground: ground_part(total_along_px, along_px),
        paper_average: point(along_px, average_y),
        equation_7: point(along_px, summed(ResidualMoments::size_y)),
        equation_5: SignedBudget {
            along_px: signed_px,
            // The misregistration refers to the second image against the first.
            unexplained_px: input
                .misregistration
                .map(|misregistration| of_pixel(misregistration.mean_m) + mean_x),
            point: point(signed_px, apart(ResidualMoments::size_y)),
        },
        pixel_size_m: input.pixel_size_m,
        height_over_base: input.height_over_base,
    })
}

/// Equation 6.
fn ground_part(total_px: Option<f64>, orientation_px: f64) -> GroundPart {
    let Some(total_px) = total_px else {
        return GroundPart::NotObserved;
    };
    let square = total_px.powi(2) - orientation_px.powi(2);
    if square >= 0.0 {
        GroundPart::Resolved {
            along_px: square.sqrt(),
        }
    } else {
        GroundPart::NotResolvable
    }
}

fn check(input: &BudgetInput) -> Result<(), BudgetError> {
    if input.sites.is_empty() {
        return Err(BudgetError::NoSites);
    }
    for (what, value) in [
        ("the pixel size in metres", input.pixel_size_m),
        ("height over base", input.height_over_base),
    ] {
        if !(value > 0.0 && value.is_finite()) {
            return Err(BudgetError::Value {
                what,
                value,
                expected: "a positive number",
            });
        }
    }
    let of_sites = input.sites.iter().flat_map(|site| {
        let [first, second] = &site.images;
        [first, second, &site.apart].map(|of| {
            [
                ("a residual along the track", of.size_x()),
                ("a residual across the track", of.size_y()),
            ]
        })
    });
    let observed = input.misregistration.iter().map(|misregistration| {
        [
            (
                "the mean misregistration of footprints in metres",
                misregistration.mean_m,
            ),
            (
                "the RMS misregistration of footprints in metres",
                misregistration.rms_m,
            ),
        ]
    });
    for (what, value) in of_sites.chain(observed).flatten() {
        if !value.is_finite() {
            return Err(BudgetError::Value {
                what,
                value,
                expected: "a finite number",
            });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests;
