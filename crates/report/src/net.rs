//! The page of a triangulated net: verdict, bricks, blunders, controls, and vectors of all of them on a map.

use super::{
    checks,
    html::{
        Cell, Column, Markup, Section, Table, Tone, counted, html, list, page, paragraph, verdict,
    },
    net_pictures,
    plots::{
        Arrow, Arrows, Extent, GREY, Panel, Plot, Series, figure, label, magnification, thinned,
    },
};
use areograph_base::{error::Result, units::METRES_PER_KM};
use areograph_config::{Method, NetConfig};
use areograph_stages::{
    map_pictures::PicturesOnMap,
    triangulate::{ControlResult, MeasurementResult, ShrinkageResult, Triangulation},
};

/// Number of deviations listed.
const LISTED: usize = 25;
/// Number of vectors and points drawn.
const DRAWN: usize = 3_000;
/// Number of pictures listed.
const LISTED_CONTROLS: usize = 100;
/// Share of the map for the longest vector.
const VECTOR_ROOM: f64 = 0.12;
/// Width of the axes in a plot's own units, about: both axes are drawn to one scale.
const AXIS_WIDTH: f64 = 880.0;

/// The page of a net.
///
/// # Errors
/// A plot that cannot be drawn, which is a bug in areograph.
pub fn net_page(
    config: &NetConfig,
    net: &Triangulation,
    mosaic: Option<&PicturesOnMap>,
) -> Result<String> {
    let sections = [
        Section::new("Deviations of the ties", deviations(net)?),
        Section::new("Bricks", bricks(net)),
        Section::new("Blunders and largest deviations", blunders(net)),
        Section::new("Controls", controls(net)?),
        Section::new("Precision and redundancy", precision(config, net)),
        Section::new("Pictures", net_pictures::pictures(net)),
        Section::new("Mosaic", net_pictures::mosaic(mosaic)?),
    ];
    Ok(page(&config.net, &lead(config, net), &sections))
}

fn lead(config: &NetConfig, net: &Triangulation) -> Markup {
    let (tone, word) = Tone::of(net.verdict.valid, !net.verdict.remarks.is_empty());
    let totals = &net.totals;
    let headline = format!(
        "{word}: {}, {}, {} kept.",
        counted(net.pictures.len(), "picture"),
        counted(net.points.len(), "point"),
        counted(
            net.controls.iter().filter(|control| control.kept).count(),
            "control"
        ),
    );
    let [x, y] = totals.deviation_rms_m;
    let [east, north] = totals.control_rms_m;
    let mut words = format!(
        "{} Root mean square distances: images of ties {x:.1} m (east) and {y:.1} m (north) from their means; controls \
         {east:.1} m and {north:.1} m from their given positions.",
        way(config)
    );
    if !config.description.is_empty() {
        words = format!("{}. {words}", config.description);
    }
    let body = html! { p { (words) } (list(&net.verdict.reasons)) (list(&net.verdict.remarks)) };
    html! {
        (verdict(tone, &headline, &body))
        (checks::untested(&net.verdict.untested))
        (checks::listed(&net.verdict.checks))
    }
}

/// Steps of the method, by the paper's names.
fn way(config: &NetConfig) -> String {
    let way = &config.triangulation;
    let local = if way.local { ", LOCAL" } else { "" };
    match way.method {
        Method::Scale => format!("BRICK, EXTEND, SCALE{local}: the figure keeps its shape."),
        Method::Mortar => format!(
            "BRICK, EXTEND, MORTAR, SCALE{local}: bricks are adjusted to the controls according to their weights."
        ),
        Method::OneShot => "All pictures and controls at once, then SCALE.".to_owned(),
    }
}

fn km(of_m: [f64; 2]) -> (f64, f64) {
    (of_m[0] / METRES_PER_KM, of_m[1] / METRES_PER_KM)
}

/// A map of `arrows` over `series`, both axes to one scale.
fn map(title: &str, caption: &str, mut arrows: Vec<Arrows>, series: Vec<Series>) -> Result<Markup> {
    let mut panel = Panel::of("north, km", series);
    let mut plot = Plot::of(title.to_owned(), caption.to_owned(), "east, km", Vec::new());
    let points = || panel.series.iter().flat_map(|series| &series.points);
    plot.x = Extent::of(points().map(|point| point.0));
    panel.y = Extent::of(points().map(|point| point.1));
    let width = plot.x.high - plot.x.low;
    for of in &mut arrows {
        of.magnification = magnification(&of.each, (VECTOR_ROOM * width, VECTOR_ROOM * width));
        let tips = || of.each.iter().map(|arrow| of.tip(arrow));
        plot.x = plot.x.with(tips().map(|tip| tip.0));
        panel.y = panel.y.with(tips().map(|tip| tip.1));
    }
    let (width, height) = (plot.x.high - plot.x.low, panel.y.high - panel.y.low);
    panel.height = (AXIS_WIDTH * height / width).clamp(300.0, 1_400.0) as u32;
    panel.arrows = arrows
        .into_iter()
        .filter(|arrow| !arrow.each.is_empty())
        .collect();
    plot.panels.push(panel);
    Ok(html! { div.plots { (figure(&plot)?) } })
}

fn deviations(net: &Triangulation) -> Result<Markup> {
    let tied: Vec<&MeasurementResult> = net
        .measurements
        .iter()
        .filter(|measurement| shown(measurement))
        .collect();
    if tied.is_empty() {
        return Ok(paragraph("No point is on several pictures."));
    }
    let arrow = |of: &&&MeasurementResult| {
        let deviation = of.in_brick.unwrap_or(of.deviation);
        Arrow {
            from: km(of.place_m),
            by: km([deviation.x_m, deviation.y_m]),
        }
    };
    let used: Vec<Arrow> = tied
        .iter()
        .filter(|of| !of.removed)
        .map(|of| arrow(&of))
        .collect();
    let removed: Vec<Arrow> = tied
        .iter()
        .filter(|of| of.removed)
        .map(|of| arrow(&of))
        .collect();
    let used = thinned(&used, DRAWN);
    let centres = net
        .pictures
        .iter()
        .map(|picture| km(picture.centre_m))
        .collect();
    let places: Vec<(f64, f64)> = net.points.iter().map(|point| km(point.place_m)).collect();
    let caption = "Deviations of the images of ties from their mean within the brick, drawn at the map position of the \
                   point. Thinned for display.";
    map(
        "Vectors of deviations",
        caption,
        vec![
            arrows("deviation in use", 0, used),
            arrows("rejected as a blunder", 1, removed),
        ],
        vec![
            Series::dots("points", GREY, thinned(&places, DRAWN)),
            Series::dots("middles of pictures", 2, centres),
        ],
    )
}

/// Whether a measurement has a deviation within its brick, or was rejected.
fn shown(of: &MeasurementResult) -> bool {
    of.in_brick.is_some() || of.removed
}

fn arrows(label: &str, colour: usize, each: Vec<Arrow>) -> Arrows {
    Arrows {
        label: label.to_owned(),
        colour,
        magnification: 1.0,
        each,
    }
}

fn metres(value: f64) -> Cell {
    label(value, 1).into()
}

fn bricks(net: &Triangulation) -> Markup {
    let mut table = Table::new(
        "Deviations within each brick and between them, as in table 1 of Arthur & McMacken 1977",
        &[
            Column::Text("brick"),
            Column::Number("pictures"),
            Column::Number("ties"),
            Column::Number("redundancy"),
            Column::Number("max δX, m"),
            Column::Number("max δY, m"),
            Column::Number("rms δX, m"),
            Column::Number("rms δY, m"),
            Column::Number("rejected"),
            Column::Number("flagged"),
        ],
    );
    for brick in &net.bricks {
        let mut cells: Vec<Cell> = vec![(&brick.brick).into()];
        cells
            .extend([brick.pictures, brick.ties, brick.redundancy].map(|of| of.to_string().into()));
        cells.extend(
            [brick.largest_m, brick.rms_m]
                .concat()
                .into_iter()
                .map(metres),
        );
        cells.extend([brick.removed, brick.flagged].map(|of| of.to_string().into()));
        table.row(true, cells);
    }
    if let Some(seams) = &net.seams {
        let mut row = |name: &str, largest_m: Option<[f64; 2]>, rms_m: [f64; 2]| {
            let mut cells: Vec<Cell> = vec![
                name.into(),
                "".into(),
                seams.points.to_string().into(),
                "".into(),
            ];
            let largest: Vec<Cell> = largest_m.map_or_else(
                || vec!["".into(), "".into()],
                |largest_m| largest_m.map(metres).to_vec(),
            );
            cells.extend(largest);
            cells.extend(rms_m.map(metres));
            cells.extend(["".into(), "".into()]);
            table.row(true, cells);
        };
        row("brick to brick", Some(seams.largest_m), seams.rms_m);
        if let Some(rms_m) = seams.local_rms_m {
            row("brick to brick, after LOCAL", None, rms_m);
        }
    }
    let of_bricks = net
        .bricks
        .iter()
        .filter_map(|brick| Some((format!("brick {}", brick.brick), brick.shrinkage?)));
    let of_seams = net
        .seams
        .iter()
        .filter_map(|seams| Some(("the bricks tied together".to_owned(), seams.shrinkage?)));
    let strongest = of_bricks
        .chain(of_seams)
        .min_by(|(_, a), (_, b)| a.factor.total_cmp(&b.factor));
    let words = strongest.map(|(what, ShrinkageResult { factor, law })| {
        paragraph(&format!(
            "Two controls without redundancy shrink the figure between them, because tie residuals shrink with it. \
             The largest effect is at {what}: {:.1} parts per million; the law L′/L = 1 / (1 + 2T / (w L²)) gives \
             {:.1}. The shrinkage is removed everywhere before SCALE.",
            1e6 * (1.0 - factor),
            1e6 * (1.0 - law)
        ))
    });
    html! { (table.finish()) (words.unwrap_or_default()) }
}

fn blunders(net: &Triangulation) -> Markup {
    let mut worst: Vec<&MeasurementResult> = net
        .measurements
        .iter()
        .filter(|measurement| shown(measurement))
        .collect();
    // One reference for all: rejected measurements have no deviation within their brick.
    let length_m = |of: &MeasurementResult| of.deviation.x_m.hypot(of.deviation.y_m);
    worst.sort_by(|a, b| {
        b.removed
            .cmp(&a.removed)
            .then(length_m(b).total_cmp(&length_m(a)))
    });
    let mut table = Table::new(
        "Rejected measurements, then largest deviations from the mean of the point over all pictures; full list in \
         deviations.csv",
        &[
            Column::Text("point"),
            Column::Text("picture"),
            Column::Number("δX, m"),
            Column::Number("δY, m"),
            Column::Number("length, m"),
            Column::Text("verdict"),
        ],
    );
    for of in worst.iter().take(LISTED) {
        let verdict = match (of.removed, of.flagged) {
            (true, _) => "rejected",
            (false, true) => "flagged, in use",
            (false, false) => "in use",
        };
        let cells: [Cell; 6] = [
            (&of.point).into(),
            (&of.picture).into(),
            metres(of.deviation.x_m),
            metres(of.deviation.y_m),
            metres(length_m(of)),
            verdict.into(),
        ];
        table.row(!of.removed, cells);
    }
    let on_two = |of: &&MeasurementResult| {
        let same = net
            .measurements
            .iter()
            .filter(|other| other.point == of.point);
        of.removed && same.count() == 2
    };
    let both_go = if worst.iter().copied().any(|of| on_two(&of)) {
        " For a point on two pictures, the erroneous measurement cannot be identified; both measurements are rejected."
    } else {
        ""
    };
    let words = "Flagged measurements deviate by more than 3.5 robust standard deviations, computed from the median \
                 of their brick. A measurement is rejected when its deviation in the adjustment of the whole net, \
                 divided by its standard deviation, exceeds a value that the largest of a net exceeds by \
                 chance in only one net in a hundred.";
    html! { (table.finish()) p { (words) (both_go) } }
}

fn controls(net: &Triangulation) -> Result<Markup> {
    let mut table = Table::new(
        "Controls: given minus computed",
        &[
            Column::Text("point"),
            Column::Number("X, km"),
            Column::Number("Y, km"),
            Column::Number("δX, m"),
            Column::Number("δY, m"),
            Column::Number("by SCALE δX, m"),
            Column::Number("by SCALE δY, m"),
            Column::Text("verdict"),
        ],
    );
    let mut sorted: Vec<&ControlResult> = net.controls.iter().collect();
    let length = |of: &ControlResult| of.scale_residual_m[0].hypot(of.scale_residual_m[1]);
    sorted.sort_by(|a, b| length(b).total_cmp(&length(a)));
    for of in sorted.iter().take(LISTED_CONTROLS) {
        let (x, y) = km(of.given_m);
        let mut cells: Vec<Cell> = vec![(&of.point).into(), label(x, 3).into(), label(y, 3).into()];
        cells.extend(
            [of.residual_m, of.scale_residual_m]
                .concat()
                .into_iter()
                .map(metres),
        );
        cells.push(if of.kept { "kept" } else { "rejected" }.into());
        table.row(of.kept, cells);
    }
    let vectors = |kept: bool| -> Vec<Arrow> {
        let of = net.controls.iter().filter(|control| control.kept == kept);
        of.map(|control| Arrow {
            from: km(control.given_m),
            by: km(control.scale_residual_m),
        })
        .collect()
    };
    let places = net
        .controls
        .iter()
        .map(|control| km(control.given_m))
        .collect();
    let figure = map(
        "Vectors of residuals at the controls",
        "Given minus computed positions, from SCALE of the free figure. Blunders are identified by least median of squares \
         over the similarities through each pair of controls.",
        vec![
            arrows("kept", 0, vectors(true)),
            arrows("rejected", 1, vectors(false)),
        ],
        vec![Series::dots("controls", GREY, places)],
    )?;
    Ok(html! { (table.finish()) (figure) })
}

fn precision(config: &NetConfig, net: &Triangulation) -> Markup {
    let totals = &net.totals;
    let sigma = match totals.tie_sigma_m {
        None => "The standard deviation of an image coordinate is not determined: there is no redundancy."
            .to_owned(),
        Some(sigma_m) => {
            let source = if totals.tie_sigma_given {
                "as given"
            } else {
                "from the deviations in bricks"
            };
            let largest = totals.largest_sigma_m.map_or_else(String::new, |of| {
                format!(" The largest standard deviation of a point is ±{of:.1} m.")
            });
            format!(
                "An image coordinate has a standard deviation of {sigma_m:.2} m, {source}.{largest}"
            )
        }
    };
    let scale = totals.scale_sigma_m.map_or_else(String::new, |of| {
        format!(" Controls differ from the free figure by {of:.1} m (standard deviation of a coordinate).")
    });
    let redundancy = format!(
        "Equations: {} of ties (2(r − 1) for a point on r pictures), {} of controls; unknowns: {}; redundancy {}.",
        totals.tie_equations, totals.control_equations, totals.unknowns, totals.redundancy
    );
    let floor = format!(
        "Pictures are treated as parts of a conformal map. An orthographic picture departs from a similarity on this map \
         by up to \
         {:.2} m here: a systematic lower limit of the deviations for any adjustment.",
        totals.projection_floor_m
    );
    let sigmas = if config.triangulation.method == Method::OneShot {
        ""
    } else {
        " Standard deviations of points come from the simultaneous weighted adjustment of all pictures and kept controls."
    };
    html! { p { (sigma) (scale) (sigmas) } p { (redundancy) } p { (floor) } }
}
