//! A terrain model of a pair of images, and its statistics.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use areograph_base::ties::Unmatched;
use areograph_geom::{
    height_grid::HeightGrid, reference_surface::ReferenceSurface, statistics::Summary,
};

/// A terrain model with its statistics.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Surface {
    /// Statistics.
    pub account: SurfaceAccount,
    /// The model itself.
    pub model: SurfaceModel,
}

/// Heights and their standard deviations, cell by cell.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SurfaceModel {
    /// Heights above the sphere of the body's maps, NaN where there is none.
    pub heights: HeightGrid,
    /// Latitude at which cells are as wide as high, radians.
    pub parallel_rad: f64,
    /// Standard deviation of every height about the common error, metres, NaN where there is no height: by the match, by
    /// jitter, and by the size of the compared square.
    pub sigmas_m: Vec<f32>,
    /// Pairs that contribute to every height, by their bits ([`JoinedPair::bit`]); empty for the model of a single pair.
    pub pairs: Vec<u32>,
}

/// Statistics of a terrain model, for several pairs the sums and means over all of them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SurfaceAccount {
    /// Indices of the images; of the first of several pairs.
    pub images: [usize; 2],
    /// Directions of their rays in the middle, body-fixed, of unit length.
    pub directions: [[f64; 3]; 2],
    /// Edge of a cell, and of the samples of the ground on which images were compared, metres.
    pub cell_m: f64,
    /// See `cell_m`.
    pub sample_m: f64,
    /// Edge of the square that was compared for one height, metres.
    pub compared_m: f64,
    /// Cells that both images show.
    pub cells: u32,
    /// Number of these with a height.
    pub filled: u32,
    /// Numbers of cells without a height, by reason.
    pub unfilled: BTreeMap<Unmatched, u32>,
    /// Whether too few cells were found to be significant; no height is then used.
    pub is_refused: bool,
    /// Angle between the rays of both images in the middle, radians.
    pub convergence_rad: f64,
    /// Height per pixel of parallax in the coarser image, metres.
    pub height_of_pixel_m: f64,
    /// Root mean square of the standard deviations of all heights about the common error, metres.
    pub sigma_m: f64,
    /// The part of these by jitter of the images against each other, as the shifts across the parallax show it, metres.
    pub jitter_m: f64,
    /// The part by the size of the compared square, by the relief of the model, metres.
    pub smoothing_m: f64,
    /// Median correlation.
    pub correlation: f64,
    /// Median distance of the images across the parallax, metres on the ground: residual orientation errors.
    pub aside_m: f64,
    /// Standard deviation of the common error of all heights, by the adjustment, metres; `None` where it is not known.
    pub common_sigma_m: Option<f64>,
    /// Whether the shots controlled heights of the adjustment and are therefore not independent.
    pub shots_take_part: bool,
    /// The areoid over it, or the ellipsoid where shots have no areoid; `None` without a shot.
    pub reference: Option<ReferenceSurface>,
    /// The altimeter's shots on it.
    pub shots: ShotComparison,
    /// The model in larger cells, for display.
    pub look: SurfaceLook,
    /// How the models of several pairs were joined; `None` for a single pair.
    pub joint: Option<Joint>,
}

/// Terrain models of several pairs as one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Joint {
    /// The pairs.
    pub pairs: Vec<JoinedPair>,
    /// Their overlaps.
    pub seams: Vec<Seam>,
    /// Number of cells with a height.
    pub filled: u32,
    /// Number of these with heights of several pairs.
    pub several: u32,
}

/// A pair of a joined model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct JoinedPair {
    /// Indices of the images.
    pub images: [usize; 2],
    /// Its bit among the pairs of a cell; `None` for a pair without a model.
    pub bit: Option<u32>,
    /// Cells that both images show, and number of these with a height.
    pub cells: u32,
    /// See `cells`.
    pub filled: u32,
    /// Angle between the rays of both images, radians.
    pub convergence_rad: f64,
    /// Root mean square of the standard deviations of its heights about their common error, metres.
    pub sigma_m: f64,
    /// Its level above that of all pairs, which was subtracted, and its standard deviation, metres.
    pub offset_m: f64,
    /// See `offset_m`.
    pub offset_sigma_m: f64,
    /// Median of the altimeter above it before the subtraction, and its standard deviation, metres; `None` with too few
    /// shots.
    pub shots_above_m: Option<[f64; 2]>,
}

/// The overlap of two pairs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Seam {
    /// Indices of the pairs.
    pub pairs: [usize; 2],
    /// Number of cells with heights of both.
    pub cells: u32,
    /// The first above the second before and after the adjustment of offsets, metres.
    pub before_m: f64,
    /// See `before_m`.
    pub after_m: f64,
    /// Standard deviation of this difference, by its scatter along the overlap, metres.
    pub sigma_m: f64,
    /// Robust spread of the differences of cells about their mean, in their standard deviations.
    pub spread_sigmas: f64,
}

impl JoinedPair {
    /// The statistics of its model, before it is joined.
    pub(crate) const fn of(account: &SurfaceAccount) -> Self {
        Self {
            images: account.images,
            bit: None,
            cells: account.cells,
            filled: account.filled,
            convergence_rad: account.convergence_rad,
            sigma_m: account.sigma_m,
            offset_m: 0.0,
            offset_sigma_m: 0.0,
            shots_above_m: None,
        }
    }
}

/// Fewer shots do not validate a terrain model.
pub const SHOTS_MIN: u32 = 10;

/// The altimeter's shots against a terrain model.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct ShotComparison {
    /// Every shot on it, profile by profile.
    pub shots: Vec<ShotOnSurface>,
    /// Heights of shots minus heights of the model, metres: of profiles at nadir, or of all profiles where fewer than
    /// [`SHOTS_MIN`] shots of these lie on it.
    pub above_m: Summary,
    /// Largest [`ProfileOnSurface::attitude_sigma_m`] of these profiles, metres; 0 at nadir.
    pub attitude_sigma_m: f64,
    /// Root mean square of the standard deviations of these differences about their common part, metres.
    pub sigma_m: f64,
    /// Robust spread of the differences about their median in these standard deviations.
    pub spread_sigmas: f64,
    /// Comparison by profile, for profiles with shots on the model.
    pub profiles: Vec<ProfileOnSurface>,
}

/// A shot on a terrain model.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ShotOnSurface {
    /// Index of its profile.
    pub profile: usize,
    /// Row of the footprints.
    pub row: u32,
    /// East longitude and latitude, radians.
    pub place_rad: [f64; 2],
    /// Its height minus the model's, metres.
    pub above_m: f64,
    /// Standard deviation of the difference about the common part of all differences, metres.
    pub sigma_m: f64,
}

/// A profile on a terrain model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ProfileOnSurface {
    /// Its identifier.
    pub profile: String,
    /// Standard deviation of the height error that all shots of the profile share due to attitude errors, metres: 0 at
    /// nadir where the attitude is known.
    pub attitude_sigma_m: f64,
    /// Heights of the profile's shots minus heights of the terrain model, metres.
    pub above_m: Summary,
}

/// A terrain model in larger cells.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SurfaceLook {
    /// Mean heights, NaN where there is none.
    pub heights: HeightGrid,
    /// Root mean squares of standard deviations, metres, NaN where there is none.
    pub sigmas_m: Vec<f32>,
}

impl Surface {
    /// The model; `None` where too few cells matched, so that it is withheld.
    #[must_use]
    pub const fn model(&self) -> Option<&SurfaceModel> {
        if self.account.is_refused {
            return None;
        }
        Some(&self.model)
    }

    /// That of a pair without common ground, or without convergence.
    pub(crate) fn withheld(images: [usize; 2], cell_m: f64) -> Self {
        let model = SurfaceModel::nothing();
        let account = SurfaceAccount {
            images,
            directions: [[0.0; 3]; 2],
            cell_m,
            sample_m: 0.0,
            compared_m: 0.0,
            cells: 0,
            filled: 0,
            unfilled: BTreeMap::new(),
            is_refused: true,
            convergence_rad: 0.0,
            height_of_pixel_m: 0.0,
            sigma_m: 0.0,
            jitter_m: 0.0,
            smoothing_m: 0.0,
            correlation: 0.0,
            aside_m: 0.0,
            common_sigma_m: None,
            shots_take_part: false,
            reference: None,
            shots: ShotComparison::default(),
            look: model.look(1),
            joint: None,
        };
        Self { account, model }
    }

    /// Its statistics, which a page shows.
    #[must_use]
    pub fn without_model(&self) -> Self {
        Self {
            account: self.account.clone(),
            model: SurfaceModel::nothing(),
        }
    }
}

impl SurfaceModel {
    /// A model without cells, for statistics without a model.
    #[must_use]
    pub const fn nothing() -> Self {
        Self {
            heights: HeightGrid {
                size: [0, 0],
                first_rad: [0.0; 2],
                cell_rad: [0.0; 2],
                radius_m: 0.0,
                heights_m: Vec::new(),
            },
            parallel_rad: 0.0,
            sigmas_m: Vec::new(),
            pairs: Vec::new(),
        }
    }

    /// The model in cells so large that no side has more than `side` of them.
    #[must_use]
    pub fn look(&self, side: usize) -> SurfaceLook {
        let [rows, columns] = self.heights.size;
        let step = rows.max(columns).div_ceil(side.max(1)).max(1);
        let size = [rows.div_ceil(step), columns.div_ceil(step)];
        let mut sums = vec![[0.0_f64; 3]; size[0] * size[1]];
        let known = self.heights.heights_m.iter().zip(&self.sigmas_m);
        for (at, (height_m, sigma_m)) in known.enumerate() {
            if !height_m.is_nan() {
                let cell = at / columns / step * size[1] + at % columns / step;
                let [height_m, sigma_m] = [height_m, sigma_m].map(|of| f64::from(*of));
                for (sum, term) in sums[cell]
                    .iter_mut()
                    .zip([height_m, sigma_m * sigma_m, 1.0])
                {
                    *sum += term;
                }
            }
        }
        #[allow(
            clippy::cast_possible_truncation,
            reason = "planetary heights keep millimetre precision"
        )]
        let mean = |of: usize, root: fn(f64) -> f64| -> Vec<f32> {
            // A cell without a number has 0/0.
            let means = sums.iter().map(|sums| root(sums[of] / sums[2]) as f32);
            means.collect()
        };
        let [of_step, half] = [step as f64, 0.5 * (step as f64 - 1.0)];
        let heights = &self.heights;
        SurfaceLook {
            heights: HeightGrid {
                size,
                first_rad: [
                    heights.first_rad[0] + half * heights.cell_rad[0],
                    heights.first_rad[1] - half * heights.cell_rad[1],
                ],
                cell_rad: heights.cell_rad.map(|cell_rad| cell_rad * of_step),
                radius_m: heights.radius_m,
                heights_m: mean(0, std::convert::identity),
            },
            sigmas_m: mean(1, f64::sqrt),
        }
    }
}

impl SurfaceAccount {
    /// A grid of the model with its heights above the areoid, or the ellipsoid; above the sphere where neither is known.
    #[must_use]
    pub fn above_reference(&self, grid: &HeightGrid) -> HeightGrid {
        let heights_m = self.reference.as_ref().map(|of| of.heights_m(grid));
        HeightGrid {
            heights_m: heights_m.unwrap_or_else(|| grid.heights_m.clone()),
            ..grid.clone()
        }
    }

    /// Cells with texture that were searched in both images.
    #[must_use]
    pub fn searched(&self) -> u32 {
        let not_searched = [Unmatched::Flat, Unmatched::Missing, Unmatched::Edge];
        let not_searched = not_searched.iter().filter_map(|why| self.unfilled.get(why));
        self.cells - not_searched.sum::<u32>()
    }

    /// Share of the cells in both images that have a height.
    #[must_use]
    pub fn filled_share(&self) -> f64 {
        f64::from(self.filled) / f64::from(self.cells.max(1))
    }
}
