//! The rounds of a calibration from pixels: tables and figures.

use super::{
    elevation_curves,
    html::{Cell, Column, Markup, Table, html, link},
    laser_match::similarity,
    numbers::signed,
    plots::{Panel, Plot, Series, figure, label},
};
use areograph_base::error::Result;
use areograph_geom::statistics::median;
use areograph_products::CalibrationModel;
use areograph_stages::calibrate::{CalibrationRound, CameraResult, Rounds, Scatter, Scattered};

/// The rounds of these lines.
///
/// # Errors
/// A plot that cannot be drawn, which is a bug in areograph.
pub(super) fn rounds(
    of: &Rounds,
    cameras: &[CameraResult],
    model: Option<&CalibrationModel<'_>>,
) -> Result<Markup> {
    let words = format!(
        "A round measures tie points, makes the lines consistent with them, and matches a terrain model with cells of {} m to \
         the laser. Tie points and laser points then calibrate the cameras from which the next round starts. Rounds end when \
         half of the units are shifted by less than {} cells, all units together by less than {} cells (half a cell and the laser errors, in \
         quadrature), and control residuals change by less than 2 %, or after {} rounds. After a round with shifts of more than five cells, units \
         are selected again.",
        label(of.cell_m, 0),
        label(of.shift_limit_cells(), 2),
        label(of.common_limit_cells(), 2),
        of.rounds_max
    );
    Ok(html! {
        p { (words) }
        (numbers(of))
        (angles(of, cameras))
        (plot(of)?)
        @if let Some(model) = model {
            (concordances(model))
            h3 { "Elevation curves" }
            (elevation_curves::of_rounds(model.first, model.last)?)
            h3 { "Similarity" }
            (similarity::pictures(model.last)?)
        }
    })
}

/// Number of units in the table of concordances.
const UNITS_SHOWN: usize = 12;

/// Concordance of terrain models and laser before and after the calibration, unit by unit.
fn concordances(of: &CalibrationModel<'_>) -> Markup {
    let both = of.last.concordances_after(of.first);
    if both.is_empty() {
        return Markup::default();
    }
    let median_of =
        |at: usize| median(&mut both.iter().map(|(_, of)| of[at]).collect::<Vec<f64>>());
    let mut table = Table::new(
        "Concordance of terrain model and laser heights at withheld shots, without any shift",
        &[
            Column::Number("unit"),
            Column::Number("first round"),
            Column::Number("last round"),
        ],
    );
    let mut row = |name: String, [before, after]: [f64; 2]| {
        let numbers = [before, after].map(|of| text(Some(of), 3));
        let [before, after] = numbers;
        table.row(true, [name.into(), before, after]);
    };
    for (unit, of) in both.iter().take(UNITS_SHOWN) {
        row(unit.to_string(), *of);
    }
    row(
        "median of all kept units".to_owned(),
        [median_of(0), median_of(1)],
    );
    let words = "Every fourth shot of a unit takes no part in the search for its shift. The concordance (Li et al. 2023, eq. 18 and \
                 Table 4) is 1 only for equal heights. The model of the first round contains the errors of orbit and mounting; \
                 that of the last round is made with the cameras of the preceding round. All units: ";
    html! { p { (words) (link("../units.csv", "units.csv")) "." } (table.finish()) }
}

fn text(value: Option<f64>, decimals: usize) -> Cell {
    value
        .map_or_else(|| "–".to_owned(), |value| label(value, decimals))
        .into()
}

fn numbers(of: &Rounds) -> Markup {
    let mut table = Table::new(
        "All rounds: root mean square residuals of control, and of tie points in the worst line",
        &[
            Column::Number("round"),
            Column::Number("ties"),
            Column::Number("ties, px"),
            Column::Number("units kept"),
            Column::Number("units rejected"),
            Column::Number("shift of units (median), cells"),
            Column::Number("model − laser (median), m"),
            Column::Number("control, px"),
            Column::Number("withheld control, px"),
            Column::Number("withheld, RMS / expected, plane"),
            Column::Number("RMS / expected, height"),
        ],
    );
    for round in &of.rounds {
        let [kept, refused] = [0, 1].map(|at| round.units[at] + round.judging[at]);
        let bias = round
            .bias_m
            .map_or_else(|| "–".to_owned(), |bias_m| signed(bias_m, 1));
        let scatter = |of: fn(Scatter) -> Option<Scattered>| {
            round.held_back_scatter.and_then(of).map(|of| of.sigmas)
        };
        table.row(
            true,
            [
                round.round.to_string().into(),
                round.ties.to_string().into(),
                text(round.tie_px, 3),
                kept.to_string().into(),
                refused.to_string().into(),
                text(Some(round.shift_cells).filter(|of| of.is_finite()), 2),
                bias.into(),
                text(round.control.plane_px, 3),
                text(round.held_back.plane_px, 3),
                text(scatter(|of| of.plane), 2),
                text(scatter(|of| of.height), 2),
            ],
        );
    }
    table.finish()
}

fn angles(of: &Rounds, cameras: &[CameraResult]) -> Markup {
    let mut table = Table::new(
        "Offset angles after every round",
        &[
            Column::Number("round"),
            Column::Text("line"),
            Column::Number("φ (roll), °"),
            Column::Number("ω (pitch), °"),
            Column::Number("κ (yaw), °"),
        ],
    );
    for round in &of.rounds {
        for (camera, angles_rad) in cameras.iter().zip(&round.angles_rad) {
            let mut cells: Vec<Cell> =
                vec![round.round.to_string().into(), (&camera.camera).into()];
            cells.extend(angles_rad.map(|of| Cell::from(signed(of.to_degrees(), 4))));
            table.row(true, cells);
        }
    }
    table.finish()
}

fn plot(of: &Rounds) -> Result<Markup> {
    let dots = |value: &dyn Fn(&CalibrationRound) -> Option<f64>| -> Vec<(f64, f64)> {
        let rounds = of.rounds.iter();
        let dots = rounds.filter_map(|round| Some((f64::from(round.round), value(round)?)));
        dots.filter(|(_, value)| value.is_finite()).collect()
    };
    let panels = vec![
        Panel::of(
            "units shifted, cells",
            vec![Series::dots(
                "median of the units used as control",
                0,
                dots(&|round| Some(round.shift_cells)),
            )],
        ),
        Panel::of(
            "control, px",
            vec![
                Series::dots("used", 0, dots(&|round| round.control.plane_px)),
                Series::dots("withheld", 1, dots(&|round| round.held_back.plane_px)),
            ],
        ),
    ];
    let plot = Plot::of(
        "From round to round".to_owned(),
        "Offset of the terrain model from the laser before the calibration of a round, and control residuals after it."
            .to_owned(),
        "round",
        panels,
    );
    Ok(html! { div.plots { (figure(&plot)?) } })
}
