//! The page of a calibration: verdict, figures of every step, directions not determined by tie points, cameras, other orbits.

use super::{
    calibration_rounds::rounds as rounds_of,
    checks,
    html::{
        Cell, Column, Markup, Section, Table, Tone, counted, html, list, page, paragraph, verdict,
    },
    numbers::signed,
    plots::{Panel, Plot, Series, figure, label, thinned},
};
use areograph_base::error::Result;
use areograph_config::{CalibrationConfig, CalibrationMode};
use areograph_products::CalibrationModel;
use areograph_stages::calibrate::{
    Calibration, ControlFigures, Figures, HeldBack, PointKind, Scattered, Value,
};

/// Number of points drawn.
const DRAWN: usize = 3_000;

/// The page of a calibration.
///
/// # Errors
/// A plot that cannot be drawn, which is a bug in areograph.
pub fn calibration_page(
    config: &CalibrationConfig,
    of: &Calibration,
    model: Option<&CalibrationModel<'_>>,
) -> Result<String> {
    let rounds = of.rounds.as_ref();
    let rounds = rounds.map(|result| -> Result<Section> {
        let section = rounds_of(result, &of.cameras, model)?;
        Ok(Section::new("From round to round", section))
    });
    let rounds: Option<Section> = rounds.transpose()?;
    let sections = [
        Section::new("From step to step", steps(of)),
        Section::new("Residuals", residuals(of)?),
        Section::new("Not determined by tie points", sight(of)),
        Section::new("The lines of the camera", cameras(of)),
        Section::new("Other orbits", validation(of)),
    ];
    let sections: Vec<Section> = rounds.into_iter().chain(sections).collect();
    Ok(page(&config.calibration, &lead(config, of), &sections))
}

fn lead(config: &CalibrationConfig, of: &Calibration) -> Markup {
    let (tone, word) = Tone::of(of.verdict.valid, !of.verdict.remarks.is_empty());
    let headline = format!(
        "{word}: {}, {}.",
        counted(of.cameras.len(), "line"),
        counted(of.points.len(), "point")
    );
    let accuracy = of.held_back.as_ref().map_or_else(
        || "Absolute pointing is not determined: no laser control.".to_owned(),
        stated,
    );
    let mode = match config.solution.mode {
        CalibrationMode::Differential => "",
        CalibrationMode::AsPublished => {
            " All angles were estimated from tie points only, as published. This method can displace the camera by \
             large amounts: see the residuals after step ties."
        }
    };
    let mut words = accuracy + mode;
    if !config.description.is_empty() {
        words = format!("{}. {words}", config.description);
    }
    let body = html! { p { (words) } (list(&of.verdict.reasons)) (list(&of.verdict.remarks)) };
    html! {
        (verdict(tone, &headline, &body))
        (checks::untested(&of.verdict.untested))
        (checks::listed(&of.verdict.checks))
    }
}

fn stated(of: &HeldBack) -> String {
    let metres = |of: Option<f64>| of.map_or_else(|| "–".to_owned(), |of| format!("{of:.1} m"));
    let times =
        |of: Option<Scattered>| of.map_or_else(|| "–".to_owned(), |of| format!("{:.2}", of.sigmas));
    format!(
        "The root mean square standard deviation of tie points is {} in plan and {} in height. Validation by {}, \
         withheld: root mean square residuals are {} times their expected value in plan and {} times in height. \
         For the {} points in two lines or more, the root mean square difference from the laser is {} in plan \
         and {} in height, including laser errors.",
        metres(of.accuracy_plane_m),
        metres(of.accuracy_height_m),
        counted(
            usize::try_from(of.points).unwrap_or(usize::MAX),
            "laser point"
        ),
        times(of.scatter.plane),
        times(of.scatter.height),
        of.intersected,
        metres(of.plane_m),
        metres(of.height_m)
    )
}

fn text(value: Option<f64>, decimals: usize) -> String {
    value.map_or_else(|| "–".to_owned(), |value| label(value, decimals))
}

/// Largest of the cameras across and along, then pixels, metres, height of control.
fn figure_cells(figures: &Figures, kind: PointKind) -> Vec<Cell> {
    let worst = |axis: usize| {
        let of = figures.ties.cameras_px.iter().filter_map(|of| of[axis]);
        text(of.reduce(f64::max), 3).into()
    };
    let mut cells = vec![worst(0), worst(1)];
    match figures.of(kind) {
        Some(control) => cells.extend(control_cells(control)),
        None => cells.extend(["", "", ""].map(Cell::from)),
    }
    cells
}

fn control_cells(of: &ControlFigures) -> [Cell; 3] {
    let each = |value: fn(&areograph_stages::calibrate::PixelsAndMetres) -> Option<f64>,
                decimals: usize| {
        let values = of
            .cameras
            .iter()
            .map(|camera| text(value(camera), decimals));
        Cell::from(values.collect::<Vec<_>>().join(" / "))
    };
    [
        each(|of| of.plane_px, 2),
        each(|of| of.plane_m, 0),
        text(of.height_m, 1).into(),
    ]
}

fn steps(of: &Calibration) -> Markup {
    let mut table = Table::new(
        "Root mean square residuals, as in table 5 of Li et al. 2023: tie points in the worst line, control in each \
         line",
        &[
            Column::Text("after"),
            Column::Text("control"),
            Column::Number("ties across, px"),
            Column::Number("ties along, px"),
            Column::Number("control, px"),
            Column::Number("control, m"),
            Column::Number("height, m"),
        ],
    );
    for step in &of.steps {
        for (kind, what) in [
            (PointKind::Control, "used"),
            (PointKind::HeldBack, "withheld"),
        ] {
            if kind == PointKind::HeldBack && step.figures.of(kind).is_none() {
                continue;
            }
            let mut cells: Vec<Cell> = vec![(&step.step).into(), what.into()];
            cells.extend(figure_cells(&step.figures, kind));
            table.row(true, cells);
        }
    }
    html! {
        (table.finish())
        ul { @for step in &of.steps { li { (step.step) ": adjusted " (step.free) } } }
    }
}

fn residuals(of: &Calibration) -> Result<Markup> {
    let dots = |kind: PointKind, after: bool| -> Vec<(f64, f64)> {
        let images = of
            .images
            .iter()
            .filter(|image| image.kind == kind && !image.left_out);
        let all: Vec<(f64, f64)> = images
            .filter_map(|image| {
                let px = if after {
                    image.after_px
                } else {
                    image.before_px
                };
                px.map(|px| (image.place[0], px[0]))
            })
            .collect();
        thinned(&all, DRAWN)
    };
    let panel = |label: &'static str, kind: PointKind| {
        let of = |name: &str, colour, after| Series::dots(name, colour, dots(kind, after));
        let panel = Panel::of(
            label,
            vec![of("before", 1, false), of("after the calibration", 0, true)],
        );
        (!panel.series.iter().all(|series| series.points.is_empty())).then_some(panel)
    };
    let panels = [
        panel("ties, px", PointKind::Tie),
        panel("withheld control, px", PointKind::HeldBack),
    ];
    let plot = Plot::of(
        "Residuals across the flight".to_owned(),
        "Projected minus measured position. Tie points show inter-line error; withheld laser points show absolute error."
            .to_owned(),
        "line",
        panels.into_iter().flatten().collect(),
    );
    Ok(html! { div.plots { (figure(&plot)?) } })
}

fn sight(of: &Calibration) -> Markup {
    let unseen = usize::try_from(of.tie_sight.unseen).unwrap_or(usize::MAX);
    let words = format!(
        "Tie points leave {} of the {} offset angles undetermined: {}. A priori values constrain these combinations; \
         without these constraints, an adjustment leaves them arbitrary.",
        counted(unseen, "combination"),
        3 * of.cameras.len(),
        of.tie_sight.unseen_words()
    );
    let mut table = Table::new(
        "Combinations of the offset angles from tie points only, least determined first",
        &[
            Column::Text("combination, with components"),
            Column::Number("standard deviation, °"),
        ],
    );
    for direction in &of.tie_sight.directions {
        let shares = direction.shares.iter();
        let shares: Vec<String> = shares
            .map(|(name, share)| format!("{} {}", signed(*share, 2), name.words()))
            .collect();
        let sigma = match direction.sigma_rad {
            Some(sigma_rad) => significant(sigma_rad.to_degrees()),
            None => "unbounded".to_owned(),
        };
        table.row(true, [shares.join(" ").into(), sigma.into()]);
    }
    html! { p { (words) } (table.finish()) (on_ground(of)) }
}

/// The test of tie points against the ground.
fn on_ground(of: &Calibration) -> Markup {
    let Some((ground, limit_m)) = of
        .tie_ground
        .and_then(|tie_ground| Some((tie_ground, tie_ground.limit_m?)))
    else {
        return paragraph(
            "Tie points do not reveal measurement errors along the flight, and their heights were not tested.",
        );
    };
    paragraph(&format!(
        "Tie points do not reveal measurement errors along the flight, which change heights. The heights of {} tie \
         points were \
         compared with the ground between laser points. Tie points more than {:.1} standard deviations (median \
         {limit_m:.0} m) above or below this ground were rejected; smaller errors are not identified.",
        ground.tested, ground.limit_sigmas
    ))
}

/// Three significant digits.
fn significant(value: f64) -> String {
    let decimals = (0..12).find(|decimals| value * 10_f64.powi(*decimals) >= 100.0);
    label(value, decimals.map_or(12, |of| of.unsigned_abs() as usize))
}

fn cameras(of: &Calibration) -> Markup {
    let mut table = Table::new(
        "Offset angles with standard deviations, and the effect of the calibration",
        &[
            Column::Text("line"),
            Column::Number("φ (roll), °"),
            Column::Number("ω (pitch), °"),
            Column::Number("κ (yaw), °"),
            Column::Number("image displacement, px"),
            Column::Number("support data residual, px"),
        ],
    );
    for camera in &of.cameras {
        let angle = |of: Value| -> Cell {
            let Value { value, sigma } = of;
            format!(
                "{} ± {:.4}",
                signed(value.to_degrees(), 4),
                sigma.to_degrees()
            )
            .into()
        };
        let mut cells: Vec<Cell> = vec![(&camera.camera).into()];
        cells.extend(camera.angles_rad.map(angle));
        cells.extend(
            [(camera.moved_px, 2), (camera.isd_left_px, 3)]
                .map(|(px, decimals)| label(px, decimals).into()),
        );
        table.row(true, cells);
    }
    let drift = of.drift_m_per_line.map(|drift_m_per_line| {
        let Value { value, sigma } = drift_m_per_line;
        format!("{} ± {sigma:.4}", signed(value, 4))
    });
    let words = format!(
        "Offset angles, constant look-angle terms and constant orbit errors are nearly indistinguishable, so their individual σ \
         are large; their combined effect is far better known. The correction of the given orbit changes by {} m per \
         image line along body-fixed X, Y, Z. Support data describe a straight line of equal samples; the last column \
         states the residual of this description.",
        drift.join(", ")
    );
    html! { (table.finish()) p { (words) } }
}

fn validation(of: &Calibration) -> Markup {
    if of.validation.is_empty() {
        return paragraph(
            "No other orbit was given ([[validation]]). An error common to all laser points is not detected.",
        );
    }
    let mut table = Table::new(
        "Other orbits without and with the calibration, as in tables 6 and 7 of Li et al. 2023",
        &[
            Column::Text("orbit"),
            Column::Text("calibration"),
            Column::Number("ties across, px"),
            Column::Number("ties along, px"),
            Column::Number("control, px"),
            Column::Number("control, m"),
            Column::Number("height, m"),
        ],
    );
    for orbit in &of.validation {
        for (what, figures) in [("before", &orbit.before), ("after", &orbit.after)] {
            let mut cells: Vec<Cell> = vec![(&orbit.orbit).into(), what.into()];
            cells.extend(figure_cells(figures, PointKind::Control));
            table.row(true, cells);
        }
    }
    html! { (table.finish()) (offsets(of)) }
}

/// Mean offsets of control, and the errors that they leave untested.
fn offsets(of: &Calibration) -> Markup {
    let mut table = Table::new(
        "Mean offset of control with the calibration",
        &[
            Column::Text("orbit"),
            Column::Text("control"),
            Column::Number("offset, m"),
            Column::Number("σ of the mean, m"),
            Column::Number("limit, m"),
        ],
    );
    for orbit in &of.validation {
        for offset in &orbit.offsets {
            let camera = offset.camera.as_ref();
            let what = camera.map_or_else(|| "height".to_owned(), |of| format!("plane, {of}"));
            let metres = [offset.offset_m, offset.mean_sigma_m, offset.limit_m];
            let mut cells: Vec<Cell> = vec![(&orbit.orbit).into(), what.into()];
            cells.extend(metres.map(|of| label(of, 1).into()));
            table.row(true, cells);
        }
    }
    let words = "The σ of the mean contains measurement and laser errors. The limit allows for constant orbit errors. This \
                 comparison does not detect an error common to the laser points of all orbits, for example from a different \
                 reference sphere.";
    html! { (table.finish()) p { (words) } }
}
