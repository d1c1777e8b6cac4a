//! Uncertainty budget of ground points from two images, from the residuals of their intersection.
//!
//! # Source
//! Shan et al. 2005, eq. 5 to 9. Its equation 7 sums the squares of both images; along the track the paper does so,
//! across the track it takes their average, which reduces height uncertainties by √2. Both readings are given.

#[cfg(feature = "schema")]
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use areograph_base::error::Cause;

/// Mean and standard deviation of the reprojection residuals of one image.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(JsonSchema))]
pub struct ResidualMoments {
    /// Mean along the track, lines.
    pub mean_x: f64,
    /// Standard deviation along the track, lines.
    pub deviation_x: f64,
    /// Mean across the track, pixels.
    pub mean_y: f64,
    /// Standard deviation across the track, pixels.
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

/// Input of the budget.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct BudgetInput {
    /// Residuals of the two images of each site.
    pub sites: Vec<[ResidualMoments; 2]>,
    /// Distance of neighbouring MOLA footprints, metres: the discrepancy of a footprint's two projections.
    pub mola_spacing_m: f64,
    /// Ground size of a pixel, metres.
    pub pixel_size_m: f64,
    /// Flying height over base.
    pub height_over_base: f64,
}

/// Planimetric and height uncertainty from one reading of the across-track input.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(JsonSchema))]
pub struct PointUncertainty {
    /// Across-track discrepancy due to orientation, pixels.
    pub across_px: f64,
    /// Planimetric uncertainty, eq. 8, pixels.
    pub planimetric_px: f64,
    /// The same, metres.
    pub planimetric_m: f64,
    /// Height uncertainty, eq. 9, pixels.
    pub height_px: f64,
    /// The same, metres.
    pub height_m: f64,
}

/// The contribution of the ground points themselves along the track.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum GroundPart {
    /// The rest of the discrepancy of footprints, pixels.
    Resolved {
        /// Pixels.
        along_px: f64,
    },
    /// Orientation explains more than the whole discrepancy.
    NotResolvable,
}

/// The budget.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(JsonSchema))]
pub struct UncertaintyBudget {
    /// Along-track discrepancy due to orientation, eq. 7, pixels.
    pub along_px: f64,
    /// Along-track discrepancy of MOLA footprints, pixels.
    pub total_along_px: f64,
    /// Contribution of the footprints to it, eq. 6.
    pub ground: GroundPart,
    /// Eq. 8 and 9 with the average of the images' across-track residuals, as the paper computes.
    pub paper_average: PointUncertainty,
    /// Eq. 8 and 9 with the sum of squares of both images, as in the paper's eq. 7.
    pub equation_7: PointUncertainty,
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
    #[error("{what} is {value}, expected {expected}")]
    #[cause("check the geometry and the residuals of the stereo pairs")]
    Value {
        /// Which number.
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
    let summed = |size: fn(&ResidualMoments) -> f64| {
        let squares = input
            .sites
            .iter()
            .flatten()
            .map(|image| size(image).powi(2));
        (squares.sum::<f64>() / sites).sqrt()
    };
    let sizes_y = input.sites.iter().flatten().map(ResidualMoments::size_y);
    let average_y = sizes_y.sum::<f64>() / (2.0 * sites);
    let along_px = summed(ResidualMoments::size_x);
    let total_along_px = input.mola_spacing_m / input.pixel_size_m;
    let ground_square = total_along_px.powi(2) - along_px.powi(2);
    let uncertainty = |across_px: f64| {
        let planimetric_px = along_px.hypot(across_px);
        let height_px = input.height_over_base * across_px;
        PointUncertainty {
            across_px,
            planimetric_px,
            planimetric_m: planimetric_px * input.pixel_size_m,
            height_px,
            height_m: height_px * input.pixel_size_m,
        }
    };
    Ok(UncertaintyBudget {
        along_px,
        total_along_px,
        ground: if ground_square >= 0.0 {
            GroundPart::Resolved {
                along_px: ground_square.sqrt(),
            }
        } else {
            GroundPart::NotResolvable
        },
        paper_average: uncertainty(average_y),
        equation_7: uncertainty(summed(ResidualMoments::size_y)),
    })
}

fn check(input: &BudgetInput) -> Result<(), BudgetError> {
    if input.sites.is_empty() {
        return Err(BudgetError::NoSites);
    }
    for (what, value) in [
        ("the spacing of footprints, metres,", input.mola_spacing_m),
        ("the size of a pixel, metres,", input.pixel_size_m),
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
    for image in input.sites.iter().flatten() {
        for (what, value) in [
            ("a residual along the track", image.size_x()),
            ("a residual across the track", image.size_y()),
        ] {
            if !value.is_finite() {
                return Err(BudgetError::Value {
                    what,
                    value,
                    expected: "a finite number",
                });
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Table 5 of Shan et al. 2005: Eos, Gusev, Isidis.
    fn table_5() -> BudgetInput {
        let image = |mean_x, deviation_x, mean_y, deviation_y| ResidualMoments {
            mean_x,
            deviation_x,
            mean_y,
            deviation_y,
        };
        BudgetInput {
            sites: vec![
                [
                    image(-33.82, 17.34, 2.86, 1.36),
                    image(20.52, 10.17, -1.61, 0.76),
                ],
                [
                    image(-26.25, 0.66, 3.63, 0.27),
                    image(23.55, 0.59, -2.62, 0.23),
                ],
                [
                    image(34.29, 0.96, -2.57, 0.22),
                    image(-25.48, 0.72, 2.88, 0.24),
                ],
            ],
            mola_spacing_m: 325.0,
            pixel_size_m: 4.4,
            height_over_base: 385.0 / 155.0,
        }
    }

    /// Two or three printed decimals of the sheet's arithmetic.
    fn close(value: f64, expected: f64) {
        assert!((value - expected).abs() < 0.005, "{value} {expected}");
    }

    #[test]
    fn sizes_of_table_5() {
        let expected = [
            [(38.006, 3.167), (22.902, 1.780)],
            [(26.258, 3.640), (23.557, 2.630)],
            [(34.303, 2.579), (25.490, 2.890)],
        ];
        for (site, expected) in table_5()
            .sites
            .iter()
            .flatten()
            .zip(expected.iter().flatten())
        {
            close(site.size_x(), expected.0);
            close(site.size_y(), expected.1);
        }
    }

    #[test]
    fn the_budget_of_the_paper() {
        let budget = uncertainty_budget(&table_5()).unwrap();
        close(budget.along_px, 40.987);
        close(budget.total_along_px, 73.86);
        let GroundPart::Resolved { along_px } = budget.ground else {
            panic!("{budget:?}");
        };
        close(along_px, 61.45);
        close(budget.paper_average.across_px, 2.781);
        close(budget.equation_7.across_px, 4.015);
        // 385/155 times the two readings, and the planimetric sums of squares.
        close(budget.paper_average.height_px, 385.0 / 155.0 * 2.7806);
        close(budget.equation_7.height_px, 9.973);
        close(budget.equation_7.height_m, 43.88);
        close(budget.equation_7.planimetric_px, 41.183);
        close(budget.equation_7.planimetric_m, 181.21);
    }

    #[test]
    fn what_has_no_answer_says_so() {
        let dense = BudgetInput {
            mola_spacing_m: 100.0,
            ..table_5()
        };
        let budget = uncertainty_budget(&dense).unwrap();
        assert_eq!(budget.ground, GroundPart::NotResolvable);
        let refused = |change: fn(&mut BudgetInput)| {
            let mut input = table_5();
            change(&mut input);
            uncertainty_budget(&input).unwrap_err()
        };
        assert_eq!(refused(|input| input.sites.clear()), BudgetError::NoSites);
        for error in [
            refused(|input| input.pixel_size_m = 0.0),
            refused(|input| input.height_over_base = f64::NAN),
            refused(|input| input.sites[1][0].mean_y = f64::NAN),
        ] {
            assert!(matches!(error, BudgetError::Value { .. }), "{error}");
        }
    }
}
