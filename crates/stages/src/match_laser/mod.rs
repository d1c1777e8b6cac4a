//! Laser profiles against a terrain model: units of shots with relief, each matched to the heights of the model and
//! validated by held-out shots; a control point of every kept unit.
//!
//! | file | content |
//! |---|---|
//! | `shots` | shots over the model, each once; tracks, segments, relief |
//! | `clusters` | k-means with its own seeds, sums in the order of the points |
//! | `search` | similarity of all shifts by whole cells; the weights of each shot are computed once |
//! | `settle` | the place between cells by a quadratic and least squares |
//! | `units` | the result of the withheld shots |
//! | `scatter` | scatter of units about a plane, which widens standard deviations |
//! | `judge` | the verdict |
//! | `images` | lines and samples in the images |
//! | `surface` | similarities of a unit: a byte per shift, at most 141 by 141 |
//! | `curves`, `pass` | heights of laser, model and shifted model along every pass |
//!
//! The bias found by correlation selects the measure. Disagreement reveals shifts by chance: units far from the median
//! of all are rejected; where fewer than half agree, the match is rejected.
//!
//! # Source
//! Li et al. 2023, sections 2.2.2 and 2.2.3: segments, relief filter, clusters, similarity (eq. 16–18). Points that the paper leaves
//! open and departures from it are documented at the constants.

mod clusters;
mod curves;
mod error;
mod images;
mod judge;
mod model;
mod pass;
mod result;
mod scatter;
mod search;
mod settle;
mod shots;
mod similarity;
mod surface;
mod survey;
mod units;

use std::{collections::BTreeMap, path::PathBuf, sync::atomic::AtomicBool};

use nalgebra::Vector3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use self::{
    clusters::clusters,
    images::{enter, unseen},
    judge::{Evidence, bias_limit_m, judge, pooled},
    result::{HeldBackGround, ModelRequest},
    scatter::widen,
    shots::{Shot, is_kept, shots_over},
    units::{Unit, refuse_lonely},
};
pub use self::{
    error::MatchError,
    model::{LaserKeys, MatchModel, ModelMatch},
    pass::{Pass, PassShot},
    result::{
        HeldOut, LaserMatch, MatchImage, MatchOptions, MatchRequest, MatchSigma, MatchedPoint,
        UnitMatch, UnitResult, Widened,
    },
    similarity::{Moments, Similarity},
    surface::SimilaritySurface,
    survey::{ShotKeys, Survey, SurveyLines},
};
use super::{convert_datum::ConvertDatum, line_camera::LineCamera};
use areograph_base::{
    altimetry::{GroundRadius, ShotFilter},
    error::{Result, Stopped},
};
use areograph_geom::{ellipsoid::spherical_to_xyz_m, height_grid::HeightGrid, statistics::Summary};
use areograph_pds::terrain_model::{HeightsAbove, read_terrain_model};
use areograph_store::{
    files::HashedFile,
    stage::{Called, InOrder, Stage, called},
    stage_inputs,
};

stage_inputs! {
    /// Request of a match, and its files.
    pub struct MatchLaser<'a> {
        /// The request.
        pub request: &'a MatchRequest,
        /// Its files with their hashes: the model, support data of images, PEDR files.
        pub files: InOrder<'a, HashedFile>,
    }
}

impl Stage for MatchLaser<'_> {
    const NAME: &'static str = "match_laser";
    const METHOD: u32 = 11;
    const CALLS: &'static [Called] = &[called::<ConvertDatum<'_>>()];
    type Output = LaserMatch;
    stage_inputs!(fingerprint);

    fn run(&self, stop: &AtomicBool) -> Result<LaserMatch> {
        match_laser(self.request, stop)
    }
}

/// Every file of a request, in order.
#[must_use]
pub fn match_files(of: &MatchRequest) -> Vec<PathBuf> {
    let images = of.images.iter().map(|image| image.isd.clone());
    let model = std::iter::once(of.model.clone());
    model.chain(images).chain(of.pedr.clone()).collect()
}

/// Matches laser profiles with a terrain model.
///
/// # Errors
/// Files that cannot be read; no shot on the model; shots that two files hold; [`Stopped`].
pub fn match_laser(request: &MatchRequest, stop: &AtomicBool) -> Result<LaserMatch> {
    let above = HeightsAbove {
        radius_m: request.radius_m,
        apart: request.heights_apart,
    };
    let cameras = request
        .images
        .iter()
        .map(|image| LineCamera::read(&image.isd, &image.name, request.body));
    let cameras = cameras.collect::<Result<Vec<_>>>()?;
    let grid = read_terrain_model(&request.model, request.body, above)?;
    let asked = Asked {
        grid: &grid,
        pedr: &request.pedr,
        cameras: &cameras,
        options: &request.options,
        held_back: None,
        radius_is_stated: request.radius_m.is_some(),
    };
    Ok(matched(&asked, None, stop)?.0)
}

/// The shots of each unit, by name: units from one model can be matched with another.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
struct UnitShots(Vec<(bool, Vec<String>)>);

impl UnitShots {
    fn of(units: &[Unit<'_>]) -> Self {
        let named = units.iter().map(|unit| (unit.judges(), unit.names()));
        Self(named.collect())
    }

    /// The units of `shots`, which are in the order of time; those without a shot are left out.
    fn units<'a>(&self, grid: &HeightGrid, shots: &'a [Shot]) -> Vec<Unit<'a>> {
        let numbered = self.0.iter().enumerate();
        let of_name: BTreeMap<&str, usize> = numbered
            .flat_map(|(unit, (_, names))| names.iter().map(move |name| (&**name, unit)))
            .collect();
        let mut members: Vec<Vec<&Shot>> = vec![Vec::new(); self.0.len()];
        for shot in shots {
            if let Some(unit) = of_name.get(&*shot.name) {
                members[*unit].push(shot);
            }
        }
        let members = members.iter().zip(&self.0).enumerate();
        members
            .filter(|(_, (shots, _))| !shots.is_empty())
            .map(|(unit, (shots, (judges, _)))| Unit::of(grid, unit + 1, *judges, shots))
            .collect()
    }
}

/// Matches laser profiles with a terrain model in memory, part of the ground withheld; returns the shots of each unit
/// too.
///
/// * `units` – units of an earlier model; without them segments and clusters are made anew
///
/// # Errors
/// Files that cannot be read; no shot on the model; shots that two files hold; [`Stopped`].
fn match_model(
    request: &ModelRequest<'_>,
    units: Option<&UnitShots>,
    stop: &AtomicBool,
) -> Result<(LaserMatch, UnitShots)> {
    let asked = Asked {
        grid: request.model,
        pedr: request.pedr,
        cameras: request.images,
        options: request.options,
        held_back: Some(request.held_back),
        // Its cameras define the reference of its heights.
        radius_is_stated: true,
    };
    matched(&asked, units, stop)
}

/// Body-fixed positions, metres, of at most `most` shots, evenly selected from all between west, south, east and north.
///
/// # Errors
/// Files that cannot be read; no shot there; shots that two files hold; [`Stopped`].
fn shots_within(
    edges_rad: [f64; 4],
    pedr: &[PathBuf],
    ground: GroundRadius,
    filter: &ShotFilter,
    most: usize,
    stop: &AtomicBool,
) -> Result<Vec<Vector3<f64>>> {
    let [west, south, east, north] = edges_rad;
    let cell_rad = [east - west, north - south];
    let grid = HeightGrid {
        size: [1, 1],
        first_rad: [west + 0.5 * cell_rad[0], north - 0.5 * cell_rad[1]],
        cell_rad,
        radius_m: 0.0,
        heights_m: vec![f32::NAN],
    };
    let shots = shots_over(&grid, pedr, ground, filter, stop)?.shots;
    if shots.is_empty() {
        return Err(no_shots("the ground of the images", edges_rad).into());
    }
    let places = shots.iter().step_by(shots.len().div_ceil(most.max(1)));
    Ok(places
        .map(|shot| spherical_to_xyz_m(shot.longitude_rad, shot.latitude_rad, shot.radius_m))
        .collect())
}

fn no_shots(ground: &'static str, edges_rad: [f64; 4]) -> MatchError {
    let [west, south, east, north] = edges_rad.map(f64::to_degrees);
    MatchError::NoShots {
        ground,
        west,
        south,
        east,
        north,
    }
}

/// Input of a match.
struct Asked<'a> {
    grid: &'a HeightGrid,
    pedr: &'a [PathBuf],
    cameras: &'a [LineCamera],
    options: &'a MatchOptions,
    held_back: Option<HeldBackGround>,
    /// Whether the reference radius of the model's heights is stated.
    radius_is_stated: bool,
}

fn matched(
    asked: &Asked<'_>,
    known: Option<&UnitShots>,
    stop: &AtomicBool,
) -> Result<(LaserMatch, UnitShots)> {
    let (grid, options) = (asked.grid, asked.options);
    let shots = shots_over(grid, asked.pedr, options.ground, &options.filter, stop)?;
    if shots.shots.is_empty() {
        return Err(no_shots("the model", grid.edges_rad()).into());
    }
    let [down_m, right_m] = grid.cell_m();
    let length = shots.segment_length(options, down_m.min(right_m));
    let segments = shots.segments(length, asked.held_back);
    let kept: Vec<&[Shot]> = segments
        .iter()
        .copied()
        .filter(|segment| is_kept(grid, segment, length, options.least_variance_m2))
        .collect();
    let units = known.map_or_else(
        || units_of(grid, &kept, asked.held_back, options.seed),
        |known| known.units(grid, &shots.shots),
    );
    Stopped::check(stop)?;
    let mut search = searched(grid, &units, options);
    let matching = refuse_lonely(&mut search.units, options.search_cells);
    let widened = widen(&mut search.units, grid.cell_m());
    Stopped::check(stop)?;
    enter_surfaces(grid, &units, &mut search, options.search_cells);
    let passes = curves::passes(grid, &shots.shots, &units, &search.units);
    let points = units.iter().zip(&search.units);
    let points = points.filter(|(_, result)| result.is_kept());
    let mut points: Vec<MatchedPoint> = points
        .filter_map(|(unit, result)| unit.point(grid, result))
        .collect();
    enter(asked.cameras, &mut points)?;
    let images: Vec<String> = asked
        .cameras
        .iter()
        .map(|camera| camera.camera.id.clone())
        .collect();
    let mut complaints = shots.complaints.clone();
    let unseen = unseen(&images, &points);
    let complaint_count = shots.complaint_count + unseen.len() as u64;
    complaints.extend(unseen);
    let used: Vec<UnitResult> = search
        .units
        .iter()
        .filter(|unit| !unit.judges)
        .cloned()
        .collect();
    let (bias_m, held_out) = (median_bias_m(&used), pooled(&used));
    let verdict = judge(&Evidence {
        units: &used,
        matching,
        similarity: search.measure,
        located_m: search.located_m,
        is_auto: options.similarity.is_none(),
        held_out,
        widened,
        limit_m: options.limit_m,
        radius_is_stated: asked.radius_is_stated,
        complaints: complaint_count,
    });
    let result = LaserMatch {
        radius_m: grid.radius_m,
        cell_m: grid.cell_m(),
        shots: shots.shots.len(),
        tracks: shots.tracks,
        segments: segments.len(),
        segments_kept: kept.len(),
        similarity: search.measure,
        located_bias_m: search.located_m.map(|[bias_m, _]| bias_m),
        bias_m,
        held_out,
        widened,
        units: search.units,
        passes,
        points,
        images,
        verdict,
        complaints,
        complaint_count,
    };
    Ok((result, UnitShots::of(&units)))
}

/// Units of the points of segments, in the order of their first points; then units of withheld ground.
fn units_of<'a>(
    grid: &HeightGrid,
    segments: &[&'a [Shot]],
    held_back: Option<HeldBackGround>,
    seed: u64,
) -> Vec<Unit<'a>> {
    let mut units = Vec::new();
    for judges in [false, true] {
        // All shots of a segment are on one side.
        let of_side = segments.iter().copied().filter(|segment| {
            segment
                .first()
                .is_some_and(|shot| shot.is_held_back(held_back))
                == judges
        });
        let points: Vec<&Shot> = of_side.flatten().collect();
        let places_m: Vec<[f64; 2]> = points.iter().map(|shot| shot.plan_m).collect();
        let mut members: BTreeMap<usize, Vec<&Shot>> = BTreeMap::new();
        let mut order = Vec::new();
        for (shot, cluster) in points.into_iter().zip(clusters(&places_m, seed)) {
            let of_cluster = members.entry(cluster).or_default();
            if of_cluster.is_empty() {
                order.push(cluster);
            }
            of_cluster.push(shot);
        }
        for cluster in &order {
            units.push(Unit::of(grid, units.len() + 1, judges, &members[cluster]));
        }
    }
    units
}

/// Result of the search of all units.
struct Searched {
    units: Vec<UnitResult>,
    measure: Similarity,
    /// Median of model minus laser by correlation, and the largest bias at which concordance is usable, metres.
    located_m: Option<[f64; 2]>,
}

/// Searches all units by the requested measure. Correlation, which is insensitive to bias, estimates the bias of the
/// model; without a requested measure it is kept where the bias is too large for concordance.
fn searched(grid: &HeightGrid, units: &[Unit<'_>], options: &MatchOptions) -> Searched {
    let by = |measure: Similarity| -> Vec<UnitResult> {
        units
            .par_iter()
            .map(|unit| unit.matched(grid, measure, options))
            .collect()
    };
    let located = by(Similarity::Pearson);
    let located_m = median_bias_m(&located).map(|bias_m| {
        let kept = located.iter().filter(|unit| unit.is_kept() && !unit.judges);
        let reliefs_m: Vec<f64> = kept.map(|unit| unit.relief_m).collect();
        [bias_m, bias_limit_m(Summary::of(&reliefs_m).median)]
    });
    let is_off = located_m.is_some_and(|[bias_m, limit_m]| bias_m.abs() > limit_m);
    let measure = match options.similarity {
        Some(measure) => measure,
        None if is_off => Similarity::Pearson,
        None => Similarity::Ccc,
    };
    let units = if measure == Similarity::Pearson {
        located
    } else {
        by(measure)
    };
    Searched {
        units,
        measure,
        located_m,
    }
}

/// Enters similarities at all shifts by the measure that ran, of every searched unit, or of those `shown`. They are
/// computed separately, since most searches, in a calibration's rounds or by another measure, are not shown on a page.
fn enter_surfaces(grid: &HeightGrid, units: &[Unit<'_>], search: &mut Searched, reach: u32) {
    let measure = search.measure;
    let each = units.par_iter().zip(&mut search.units);
    each.filter(|(_, result)| result.found.is_some())
        .for_each(|(unit, result)| {
            result.similarity = Some(unit.surface(grid, measure, reach));
        });
}

/// Median of model minus laser over the kept units that are not withheld, metres.
fn median_bias_m(units: &[UnitResult]) -> Option<f64> {
    let kept = units.iter().filter(|unit| unit.is_kept() && !unit.judges);
    let biases_m: Vec<f64> = kept.filter_map(|unit| Some(unit.found?.bias_m)).collect();
    (!biases_m.is_empty()).then(|| Summary::of(&biases_m).median)
}
