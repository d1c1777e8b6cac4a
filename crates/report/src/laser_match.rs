//! The page of a match of laser profiles with a terrain model: verdict, map of the shifts, withheld shots, elevation curves, every unit
//! and its similarities.

pub(super) mod similarity;

use super::{
    checks, elevation_curves,
    html::{
        Cell, Column, Markup, Section, Table, Tone, counted, folded, html, list, page, verdict,
    },
    numbers::signed,
    plots::{Arrow, Arrows, GREY, Panel, Plot, Series, figure, label, magnification},
};
use areograph_base::{error::Result, units::wrap_pi};
use areograph_stages::match_laser::{LaserMatch, MatchSigma, UnitResult};

/// Largest share of the map for the longest arrow.
const ARROW_SHARE: f64 = 0.15;

/// The page of a match.
///
/// # Errors
/// A plot that cannot be drawn, which is a bug in areograph.
pub fn match_page(of: &LaserMatch) -> Result<String> {
    let sections = [
        Section::new("Shifts", map(of)?),
        Section::new("Withheld shots", held_out(of)?),
        Section::new("Elevation curves", elevation_curves::of_match(of)?),
        Section::new("Units", units(of)),
        Section::new("Similarity", similarity::pictures(of)?),
        Section::new("Left out", list(&of.complaints)),
    ];
    Ok(page(
        "Laser control from a terrain model",
        &lead(of),
        &sections,
    ))
}

fn lead(of: &LaserMatch) -> Markup {
    let (tone, word) = Tone::of(of.verdict.valid, !of.verdict.remarks.is_empty());
    let headline = format!(
        "{word}: {} of {} kept.",
        counted(kept(of).count(), "unit"),
        of.units.len()
    );
    let judged = of.held_out.as_ref().map_or_else(
        || "No withheld shot validates the match.".to_owned(),
        |held_out| {
            format!(
                "{}, withheld from every search, differ from the model by {:.1} m without the shift of their unit and by {:.1} m \
                 with this shift (root mean square about the bias of the other shots).",
                counted(held_out.shots, "shot"),
                held_out.before_m,
                held_out.after_m
            )
        },
    );
    let bias = of.bias_m.map_or_else(String::new, |bias_m| {
        format!(
            " The model lies {} m above the laser (median).",
            signed(bias_m, 1)
        )
    });
    let known = of.widened.map_or_else(String::new, |widened| {
        format!(
            " Standard deviations from the omission of single shots are multiplied by {:.1} for shifts and by {:.1} for biases \
             to match the scatter of units about a plane.",
            widened.shift, widened.bias
        )
    });
    let [east_m, north_m] = of.cell_m;
    let made = format!(
        "{} in {}, {} of {} segments with relief, cells of {east_m:.1} by {north_m:.1} m, heights above a radius of {} m. \
         The measure of similarity was {}.",
        counted(of.shots, "shot"),
        counted(of.tracks, "pass"),
        of.segments_kept,
        of.segments,
        of.radius_m,
        of.similarity.word(),
    );
    let body = html! {
        p { (judged) (bias) (known) }
        p { (made) }
        (list(&of.verdict.reasons))
        (list(&of.verdict.remarks))
    };
    html! { (verdict(tone, &headline, &body)) (checks::listed(&of.verdict.checks)) }
}

fn kept(of: &LaserMatch) -> impl Iterator<Item = &UnitResult> {
    of.units.iter().filter(|unit| unit.is_kept())
}

/// East longitude and latitude, degrees; longitudes of one map do not jump.
fn place_deg(of: &LaserMatch, unit: &UnitResult) -> (f64, f64) {
    let first = of.units.first().map_or(0.0, |unit| unit.place_rad[0]);
    let longitude_rad = first + wrap_pi(unit.place_rad[0] - first);
    (longitude_rad.to_degrees(), unit.place_rad[1].to_degrees())
}

fn map(of: &LaserMatch) -> Result<Markup> {
    let arrow = |unit: &UnitResult| {
        let [east_rad, north_rad] = unit.found?.shift_rad;
        Some(Arrow {
            from: place_deg(of, unit),
            by: (east_rad.to_degrees(), north_rad.to_degrees()),
        })
    };
    let each: Vec<Arrow> = kept(of).filter_map(arrow).collect();
    let refused = of.units.iter().filter(|unit| !unit.is_kept());
    let refused = refused.map(|unit| place_deg(of, unit)).collect();
    let dots = kept(of).map(|unit| place_deg(of, unit)).collect();
    let series = vec![
        Series::dots("rejected units", GREY, refused),
        Series::dots("kept units", 0, dots),
    ];
    let mut plot = Plot::of(
        "Shifts of the model".to_owned(),
        "Arrows lead from the position of a unit according to the laser to its position in the model."
            .to_owned(),
        "east longitude, degrees",
        vec![Panel::of("latitude, degrees", series)],
    );
    let room = |low: f64, high: f64| ARROW_SHARE * (high - low);
    let y = plot.panels[0].y;
    let arrows = Arrows {
        label: "shift".to_owned(),
        colour: 1,
        magnification: magnification(&each, (room(plot.x.low, plot.x.high), room(y.low, y.high))),
        each,
    };
    let tips = || arrows.each.iter().map(|arrow| arrows.tip(arrow));
    plot.x = plot.x.with(tips().map(|tip| tip.0));
    plot.panels[0].y = y.with(tips().map(|tip| tip.1));
    plot.panels[0].arrows.push(arrows);
    plot.panels[0].height = 620;
    Ok(html! { div.plots { (figure(&plot)?) } })
}

fn held_out(of: &LaserMatch) -> Result<Markup> {
    let points = |after: bool| -> Vec<(f64, f64)> {
        let judged = kept(of).filter_map(|unit| Some((unit.unit, unit.held_out?)));
        judged
            .map(|(unit, of)| {
                let metres = if after { of.after_m } else { of.before_m };
                (unit as f64, metres)
            })
            .collect()
    };
    if points(true).is_empty() {
        return Ok(Markup::default());
    }
    let series = vec![
        Series::dots("without the shift", 1, points(false)),
        Series::dots("with the shift", 0, points(true)),
    ];
    let plot = Plot::of(
        "Model minus laser at withheld shots".to_owned(),
        "Root mean square over every fourth shot of each kept unit, about the bias of the other shots."
            .to_owned(),
        "unit",
        vec![Panel::of("root mean square, m", series)],
    );
    Ok(html! { div.plots { (figure(&plot)?) } })
}

fn units(of: &LaserMatch) -> Markup {
    let mut table = Table::new(
        "All units; shifts are offsets of the model from the laser",
        &[
            Column::Text("unit"),
            Column::Number("shots"),
            Column::Number("passes"),
            Column::Number("relief, m"),
            Column::Number("east, cells"),
            Column::Number("north, cells"),
            Column::Number("score"),
            Column::Number("bias, m"),
            Column::Number("σ east, m"),
            Column::Number("σ north, m"),
            Column::Number("σ bias, m"),
            Column::Number("withheld before, m"),
            Column::Number("after, m"),
            Column::Text("not kept because"),
        ],
    );
    for unit in &of.units {
        let found = |value: fn(&areograph_stages::match_laser::UnitMatch) -> String| -> Cell {
            unit.found
                .as_ref()
                .map_or_else(|| "–".to_owned(), value)
                .into()
        };
        let sigma = |value: fn(MatchSigma) -> f64| -> Cell {
            let sigma = unit.found.and_then(|found| found.sigma).map(value);
            sigma
                .map_or_else(|| "–".to_owned(), |sigma| label(sigma, 1))
                .into()
        };
        let judged = |value: Option<f64>| -> Cell {
            value
                .map_or_else(|| "–".to_owned(), |value| label(value, 1))
                .into()
        };
        table.row(
            unit.is_kept(),
            [
                unit.unit.to_string().into(),
                unit.shots.to_string().into(),
                unit.strips.to_string().into(),
                label(unit.relief_m, 0).into(),
                found(|of| signed(of.shift_cells[0], 2)),
                found(|of| signed(of.shift_cells[1], 2)),
                found(|of| label(of.score, 3)),
                found(|of| signed(of.bias_m, 1)),
                sigma(|of| of.shift_m[0]),
                sigma(|of| of.shift_m[1]),
                sigma(|of| of.bias_m),
                judged(unit.held_out.map(|held_out| held_out.before_m)),
                judged(unit.held_out.map(|held_out| held_out.after_m)),
                (&unit.refused_because).into(),
            ],
        );
    }
    folded(
        &format!("Table of {}", counted(of.units.len(), "unit")),
        &table.finish(),
    )
}
