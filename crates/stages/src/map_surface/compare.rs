//! The altimeter's shots against a terrain model.

use super::result::{ProfileOnSurface, SHOTS_MIN, ShotComparison, ShotOnSurface, SurfaceModel};
use crate::group_profiles::Profile;
use areograph_base::{footprints::Footprints, frames::BodyFixed};
use areograph_geom::{
    height_grid::HeightGrid,
    reference_surface::ReferenceSurface,
    statistics::Summary,
    surface::{SurfaceOptions, attitude_sigma_m},
};

/// Slopes are differences over this distance to both sides, metres: about a footprint of the laser.
const SLOPE_STEP_M: f64 = 100.0;

impl ShotComparison {
    /// Every shot of the profiles on a model against its height there.
    pub(crate) fn of(
        model: &SurfaceModel,
        footprints: &Footprints<BodyFixed>,
        profiles: &[Profile],
        options: &SurfaceOptions,
    ) -> Self {
        compare(model, footprints, profiles, options)
    }
}

impl SurfaceModel {
    /// The areoid over the model, by the shots.
    pub(crate) fn reference(&self, footprints: &Footprints<BodyFixed>) -> Option<ReferenceSurface> {
        let shots = (0..footprints.len()).map(|at| {
            let place_rad = [
                footprints.longitude_rad.at(at),
                footprints.latitude_rad.at(at),
            ];
            (place_rad, footprints.areoid_radius_m.at(at))
        });
        let [west, south, east, north] = self.heights.edges_rad();
        let corners_rad = [[west, south], [east, south], [west, north], [east, north]];
        ReferenceSurface::fitted(footprints.body, &corners_rad, shots)
    }
}

/// Every shot of the profiles on a model against its height there.
///
/// The statistics of all shots refer to profiles at nadir, whose heights do not depend on the attitude (decision 0028). Only
/// where these have too few shots on the model do they refer to all profiles, each with the error due to its attitude.
fn compare(
    model: &SurfaceModel,
    footprints: &Footprints<BodyFixed>,
    profiles: &[Profile],
    options: &SurfaceOptions,
) -> ShotComparison {
    let attitude_m = profiles.iter().map(|profile| {
        let off_nadir_rad = profile.off_nadir_rad(footprints);
        let is_known = profile.attitude_is_known(footprints);
        attitude_sigma_m(is_known, off_nadir_rad, options.profile_sigma_m)
    });
    let attitude_m: Vec<f64> = attitude_m.collect();
    let mut shots = Vec::new();
    let mut by_profile = Vec::new();
    for (index, profile) in profiles.iter().enumerate() {
        let first = shots.len();
        for row in &profile.rows {
            let at = *row as usize;
            let place_rad = [
                footprints.longitude_rad.at(at),
                footprints.latitude_rad.at(at),
            ];
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
                attitude_sigma_m: attitude_m[index],
                above_m: summary(&shots[first..]),
            });
        }
    }
    let of_shot_m = |shot: &ShotOnSurface| attitude_m[shot.profile];
    let at_nadir = shots.iter().filter(|shot| of_shot_m(shot) == 0.0);
    let tested: Vec<&ShotOnSurface> = if at_nadir.clone().count() < SHOTS_MIN as usize {
        shots.iter().collect()
    } else {
        at_nadir.collect()
    };
    let above_m = summary(tested.iter().copied());
    let attitude_sigma_m = tested
        .iter()
        .map(|shot| of_shot_m(shot))
        .fold(0.0, f64::max);
    // An attitude error shifts all shots of a profile.
    let of_profile = |shot: &ShotOnSurface| {
        let id = &profiles[shot.profile].id;
        by_profile.iter().find(|of| of.profile == *id)
    };
    let middle_m = |shot: &ShotOnSurface| {
        let own = (attitude_sigma_m > 0.0).then(|| of_profile(shot)).flatten();
        own.map_or(above_m.median, |of: &ProfileOnSurface| of.above_m.median)
    };
    let normalised = tested.iter();
    let normalised = normalised.map(|shot| (shot.above_m - middle_m(shot)) / shot.sigma_m);
    let square = tested.iter().map(|shot| shot.sigma_m * shot.sigma_m);
    let square = square.sum::<f64>();
    ShotComparison {
        attitude_sigma_m,
        sigma_m: (square / tested.len().max(1) as f64).sqrt(),
        spread_sigmas: Summary::of(&normalised.collect::<Vec<f64>>()).nmad,
        above_m,
        profiles: by_profile,
        shots,
    }
}

fn summary<'a>(shots: impl IntoIterator<Item = &'a ShotOnSurface>) -> Summary {
    let above_m: Vec<f64> = shots.into_iter().map(|shot| shot.above_m).collect();
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
    reason = "positions on the grid with known heights"
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

#[cfg(test)]
mod tests {
    use super::*;
    use areograph_base::{
        altimetry::NO_ATTITUDE,
        body::Datum,
        footprints::{Footprint, SourceFile},
        time::{Et, Interval},
    };
    use areograph_geom::surface::turned_sigmas_m;

    /// The sphere, metres.
    const RADIUS_M: f64 = 3_396_190.0;
    const CELL_RAD: f64 = 1e-5;
    const CELLS: u32 = 40;
    const OFF_NADIR_RAD: f64 = 0.3;

    /// A model at the height of its sphere, 34 m from cell to cell.
    fn model() -> SurfaceModel {
        let size = [CELLS as usize; 2];
        SurfaceModel {
            heights: HeightGrid {
                size,
                first_rad: [1.0, 0.2],
                cell_rad: [CELL_RAD; 2],
                radius_m: RADIUS_M,
                heights_m: vec![0.0; size[0] * size[1]],
            },
            parallel_rad: 0.2,
            sigmas_m: vec![2.0; size[0] * size[1]],
            pairs: Vec::new(),
        }
    }

    /// Shots on the model, profile by profile: number, height above it, angle off nadir, and attitude flag.
    fn compared(profiles: &[(u32, f64, f64, u16)]) -> ShotComparison {
        let mut footprints = Footprints::<BodyFixed>::new(vec![SourceFile {
            name: "shots".to_owned(),
            version: None,
            datum: Datum::Iau2000,
            blake3: String::new(),
            is_table: false,
        }]);
        let mut grouped = Vec::new();
        for (column, (shots, above_m, off_nadir_rad, attitude_flag)) in (1_u32..).zip(profiles) {
            let first = u32::try_from(footprints.len()).unwrap();
            for shot in 1..=*shots {
                let radius_m = RADIUS_M + above_m;
                footprints.push(&Footprint {
                    et_tag_s: 0.0,
                    et_s: 0.0,
                    orbit: column,
                    file: 0,
                    record: shot,
                    shot: 1,
                    longitude_rad: 1.0 + f64::from(column) * CELL_RAD,
                    latitude_rad: 0.2 - f64::from(shot) * CELL_RAD,
                    radius_m,
                    radius_crossover_m: radius_m,
                    areoid_radius_m: RADIUS_M,
                    range_m: 380_000.0,
                    spacecraft_longitude_rad: 1.0,
                    spacecraft_latitude_rad: 0.2,
                    spacecraft_radius_m: radius_m + 380_000.0,
                    off_nadir_rad: *off_nadir_rad,
                    channel: 1,
                    class: 1,
                    attitude_flag: *attitude_flag,
                    orbit_quality: 1,
                    windows: 1,
                });
            }
            grouped.push(Profile {
                id: format!("a/{column}"),
                window: "a".to_owned(),
                orbit: column,
                rows: (first..first + shots).collect(),
                interval: Interval {
                    start: Et::from_seconds(0.0),
                    stop: Et::from_seconds(1.0),
                },
                simultaneous: Vec::new(),
            });
        }
        compare(&model(), &footprints, &grouped, &SurfaceOptions::default())
    }

    #[test]
    fn profiles_off_nadir_or_of_unknown_attitude_test_a_model_only_where_no_others_do() {
        let shots = SHOTS_MIN;
        let nadir = (shots, 1.0, 0.0, 0);
        let turned = (shots + 2, 60.0, OFF_NADIR_RAD, 0);
        let unknown = (shots + 2, -30.0, 0.0, NO_ATTITUDE);
        let [_, turned_m] = turned_sigmas_m(OFF_NADIR_RAD);

        let with_nadir = compared(&[turned, nadir, unknown]);
        assert_eq!(
            (with_nadir.above_m.n, with_nadir.above_m.median),
            (shots, 1.0)
        );
        let same = |one: f64, other: f64| (one - other).abs() < 1e-9;
        assert!(same(with_nadir.attitude_sigma_m, 0.0));
        let of_profiles = with_nadir.profiles.iter().map(|of| of.attitude_sigma_m);
        let of_profiles: Vec<f64> = of_profiles.collect();
        assert_eq!(of_profiles[..2], [turned_m, 0.0]);
        assert!(of_profiles[2] > 0.0);

        let without = compared(&[turned, (shots - 1, 1.0, 0.0, 0)]);
        assert_eq!(
            (without.above_m.n, without.above_m.median),
            (2 * shots + 1, 60.0)
        );
        assert!(same(without.attitude_sigma_m, turned_m));
        // Shots of a profile lie at one height, whatever the shift between the profiles.
        assert!(same(without.spread_sigmas, 0.0));

        let none_known = compared(&[unknown]);
        assert!(same(none_known.above_m.median, -30.0));
        assert!(same(none_known.attitude_sigma_m, of_profiles[2]));
    }
}
