//! Elevation curves: heights of laser, terrain model and shifted model along passes; of a few units and one pass.

use std::collections::BTreeMap;

use super::{
    html::{Markup, counted, html, link},
    numbers::signed,
    plots::{Panel, Plot, Series, figure, label},
};
use areograph_base::{error::Result, units::METRES_PER_KM};
use areograph_stages::match_laser::{LaserMatch, Pass, PassShot, UnitResult};

/// Successive shots farther apart than this many usual spacings have no line between them.
const GAP: f64 = 3.0;
const ALONG: &str = "distance along the pass, km";
const HEIGHT: &str = "height above the sphere, m";
const LASER: &str = "laser";
const SHIFTED: &str = "terrain model, shifted";

/// The curves of a match.
///
/// # Errors
/// A plot that cannot be drawn, which is a bug in areograph.
pub(super) fn of_match(of: &LaserMatch) -> Result<Markup> {
    let plot = of.longest_pass().map(|pass| {
        let shots: Vec<&PassShot> = pass.shots.iter().collect();
        let mut series = vec![laser(&shots)];
        series.extend(models(&shots));
        Plot {
            title: format!("Pass {}", pass.pass),
            caption: format!(
                "All {} of the pass with the most shots that have a shifted height. {} The shifted model is drawn inside kept units, each \
                 with its own shift.",
                counted(pass.shots.len(), "shot"),
                reference(of)
            ),
            ..plotted(series)
        }
    });
    curves(of, plot.as_ref())
}

/// The curves of the last round of a calibration, and the model of the first round.
///
/// # Errors
/// A plot that cannot be drawn, which is a bug in areograph.
pub(super) fn of_rounds(first: &LaserMatch, last: &LaserMatch) -> Result<Markup> {
    let plot = last.longest_pass().map(|pass| {
        let shots: Vec<&PassShot> = pass.shots.iter().collect();
        let before = first.passes.iter().flat_map(|pass| &pass.shots);
        let before: BTreeMap<&str, f64> = before
            .filter_map(|shot| Some((&*shot.name, shot.model_m?)))
            .collect();
        let mut series = vec![laser(&shots)];
        let of_first = pieces(&shots, |shot| before.get(&*shot.name).copied());
        series.extend(lines("model of the first round", 1, of_first));
        let of_last = pieces(&shots, |shot| shot.model_m);
        series.extend(lines("model of the last round", 2, of_last));
        Plot {
            title: format!("Pass {}, before and after the calibration", pass.pass),
            caption: format!(
                "All {} of the pass with the most shots that have a shifted height, and the terrain models of the first and the last round \
                 at the laser's positions, without any shift. {}",
                counted(pass.shots.len(), "shot"),
                reference(last)
            ),
            ..plotted(series)
        }
    });
    curves(last, plot.as_ref())
}

fn curves(of: &LaserMatch, longest: Option<&Plot>) -> Result<Markup> {
    let examples = of.examples();
    let named: &[&str] = match examples.len() {
        0 => return Ok(Markup::default()),
        1 => &["the only kept unit"],
        2 => &["lowest similarity", "highest similarity"],
        _ => &[
            "lowest similarity",
            "median similarity",
            "highest similarity",
        ],
    };
    let units = named.iter().zip(&examples);
    let units: Vec<Plot> = units
        .filter_map(|(name, unit)| of_unit(of, unit, name))
        .collect();
    Ok(html! {
        p {
            "Heights of the laser, of the terrain model at the laser's positions before the match, and of the model at these \
             positions plus the shift that the match found. A correct shift makes the curve of the shifted model parallel to the laser; their distance is the bias of the model. All passes: "
            (link("../elevation_curves.parquet", "elevation_curves.parquet")) "."
        }
        div.plots {
            @for plot in &units { (figure(plot)?) }
            @if let Some(plot) = longest { (figure(plot)?) }
        }
    })
}

/// The pass over a unit with the most of its shots.
fn of_unit(of: &LaserMatch, unit: &UnitResult, name: &str) -> Option<Plot> {
    let found = unit.found.as_ref()?;
    let is_member = |shot: &&PassShot| shot.unit == Some(unit.unit);
    let members = |pass: &Pass| pass.shots.iter().filter(is_member).count();
    let pass = of.passes.iter().rev().max_by_key(|pass| members(pass))?;
    let shots: Vec<&PassShot> = pass.shots.iter().filter(is_member).collect();
    let mut series = vec![laser(&shots)];
    series.extend(models(&shots));
    let [east, north] = found.shift_cells;
    Some(Plot {
        title: format!("Unit {}: {name}", unit.unit),
        caption: format!(
            "Pass {}, {} of the unit's {}. Similarity {}, shift {} cells east and {} cells north, model minus laser {} m. {}",
            pass.pass,
            shots.len(),
            counted(unit.shots, "shot"),
            label(found.score, 3),
            signed(east, 1),
            signed(north, 1),
            signed(found.bias_m, 1),
            reference(of)
        ),
        ..plotted(series)
    })
}

fn reference(of: &LaserMatch) -> String {
    format!("Heights are above the sphere of {} m.", of.radius_m)
}

fn plotted(series: Vec<Series>) -> Plot {
    let panel = Panel::of(HEIGHT, series);
    Plot::of(String::new(), String::new(), ALONG, vec![panel])
}

fn laser(shots: &[&PassShot]) -> Series {
    let points = shots.iter().map(|shot| (along_km(shot), shot.laser_m));
    Series::dots(LASER, 0, points.collect())
}

fn models(shots: &[&PassShot]) -> Vec<Series> {
    let mut series = lines("terrain model", 1, pieces(shots, |shot| shot.model_m));
    // Every unit has its own shift.
    let of_units = shots.chunk_by(|one, next| one.unit == next.unit);
    let of_units = of_units.flat_map(|shots| pieces(shots, |shot| shot.shifted_model_m));
    series.extend(lines(SHIFTED, 2, of_units.collect()));
    series
}

fn lines(name: &str, colour: usize, pieces: Vec<Vec<(f64, f64)>>) -> Vec<Series> {
    let lines = pieces.into_iter();
    lines
        .map(|points| Series::line(name, colour, points))
        .collect()
}

/// Points of a line through the heights of a model: interrupted where it has none, and at gaps of the pass.
fn pieces(
    shots: &[&PassShot],
    height_m: impl Fn(&PassShot) -> Option<f64>,
) -> Vec<Vec<(f64, f64)>> {
    let steps_m = shots
        .windows(2)
        .map(|pair| pair[1].distance_m - pair[0].distance_m);
    let mut steps_m: Vec<f64> = steps_m.collect();
    steps_m.sort_unstable_by(f64::total_cmp);
    let gap_m = GAP * steps_m.get(steps_m.len() / 2).copied().unwrap_or_default();
    let joined = |one: &&PassShot, next: &&PassShot| {
        next.distance_m - one.distance_m <= gap_m
            && height_m(one).is_some() == height_m(next).is_some()
    };
    let pieces = shots.chunk_by(joined).map(|piece| {
        let points = piece
            .iter()
            .filter_map(|shot| Some((along_km(shot), height_m(shot)?)));
        points.collect::<Vec<_>>()
    });
    pieces.filter(|points| !points.is_empty()).collect()
}

fn along_km(shot: &PassShot) -> f64 {
    shot.distance_m / METRES_PER_KM
}
