//! The altimeter's shots against a terrain model.

use super::result::{ProfileOnSurface, ShotComparison, ShotOnSurface, SurfaceModel};
use crate::group_profiles::Profile;
use areograph_base::{footprints::Footprints, frames::BodyFixed};
use areograph_geom::{
    height_grid::HeightGrid,
    statistics::Summary,
    surface::{NADIR_MAX_RAD, SurfaceOptions},
};

/// Slopes are differences over this distance to both sides, metres: about a footprint of the laser.
const SLOPE_STEP_M: f64 = 100.0;

/// Every shot of the profiles on a model against its height there.
///
/// Profiles off nadir do not control heights (decision 0028) and do not test them either: the statistics of all shots
/// refer to profiles at nadir.
pub(super) fn compare(
    model: &SurfaceModel,
    footprints: &Footprints<BodyFixed>,
    profiles: &[Profile],
    options: &SurfaceOptions,
) -> ShotComparison {
    let mut shots = Vec::new();
    let mut at_nadir = Vec::new();
    let mut by_profile = Vec::new();
    for (index, profile) in profiles.iter().enumerate() {
        let first = shots.len();
        let is_at_nadir = profile.off_nadir_rad(footprints) <= NADIR_MAX_RAD;
        for row in &profile.rows {
            let at = *row as usize;
            let place_rad = [footprints.longitude_rad[at], footprints.latitude_rad[at]];
            let found = on_model(model, place_rad, footprints.ground_radius_m(at), options);
            shots.extend(found.map(|(above_m, sigma_m)| ShotOnSurface {
                profile: index,
                row: *row,
                place_rad,
                above_m,
                sigma_m,
            }));
        }
        if shots.len() > first {
            by_profile.push(ProfileOnSurface {
                profile: profile.id.clone(),
                is_at_nadir,
                above_m: summary(&shots[first..]),
            });
        }
        if is_at_nadir {
            at_nadir.extend_from_slice(&shots[first..]);
        }
    }
    let above_m = summary(&at_nadir);
    let normalised = at_nadir
        .iter()
        .map(|shot| (shot.above_m - above_m.median) / shot.sigma_m);
    let normalised: Vec<f64> = normalised.collect();
    let square = at_nadir
        .iter()
        .map(|shot| shot.sigma_m * shot.sigma_m)
        .sum::<f64>();
    ShotComparison {
        sigma_m: (square / at_nadir.len().max(1) as f64).sqrt(),
        spread_sigmas: Summary::of(&normalised).nmad,
        above_m,
        profiles: by_profile,
        shots,
    }
}

fn summary(shots: &[ShotOnSurface]) -> Summary {
    let above_m: Vec<f64> = shots.iter().map(|shot| shot.above_m).collect();
    Summary::of(&above_m)
}

/// Height of a shot above the model and its standard deviation: of the shot, of the model, and of the horizontal
/// position times the slope there.
fn on_model(
    model: &SurfaceModel,
    [longitude_rad, latitude_rad]: [f64; 2],
    radius_m: f64,
    options: &SurfaceOptions,
) -> Option<(f64, f64)> {
    let grid = &model.heights;
    let cell = grid.cell_of(longitude_rad, latitude_rad);
    let height_m = grid.height_m(cell)?;
    let sigma_m = nearest(grid, &model.sigmas_m, cell)?;
    let slope = slope(grid, cell);
    let plan_m = options.plan_sigma_m * slope;
    let variance_m2 = [
        sigma_m,
        options.shot_sigma_m,
        options.profile_sigma_m,
        plan_m,
    ]
    .iter()
    .map(|sigma_m| sigma_m * sigma_m)
    .sum::<f64>();
    Some((radius_m - grid.radius_m - height_m, variance_m2.sqrt()))
}

/// The number of the nearest cell.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "places on the grid, where its height is known"
)]
fn nearest(grid: &HeightGrid, numbers: &[f32], cell: [f64; 2]) -> Option<f64> {
    let [row, column] = cell.map(|at| at.round().max(0.0) as usize);
    let number = numbers.get(row * grid.size[1] + column).copied()?;
    (!number.is_nan()).then(|| f64::from(number))
}

/// Root mean square slope on an axis about a place; of one axis where the other has no heights, 0 without any.
fn slope(grid: &HeightGrid, [row, column]: [f64; 2]) -> f64 {
    let steps = grid.cell_m().map(|cell_m| (SLOPE_STEP_M / cell_m).max(1.0));
    let difference = |down: f64, right: f64| {
        let ahead_m = grid.height_m([row + down, column + right])?;
        let back_m = grid.height_m([row - down, column - right])?;
        Some(ahead_m - back_m)
    };
    let [east_m, north_m] = grid.cell_m();
    let slopes = [
        difference(0.0, steps[0]).map(|rise_m| rise_m / (2.0 * steps[0] * east_m)),
        difference(steps[1], 0.0).map(|rise_m| rise_m / (2.0 * steps[1] * north_m)),
    ];
    let known: Vec<f64> = slopes.into_iter().flatten().collect();
    let square = known.iter().map(|slope| slope * slope).sum::<f64>();
    (square / known.len().max(1) as f64).sqrt()
}
