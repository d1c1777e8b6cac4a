//! Movements in tables and plots.

use crate::{
    difference::{
        FootprintsMovement, ImageDifference, ImageMovement, Limits, RunDifference, SampleMovement,
        quantity,
    },
    html::{Cell, Column, Markup, Table, html},
    plots::{Panel, Plot, Series, figure},
};
use areograph_base::error::Result;

/// Footprints, then cameras.
pub(super) fn tables(site: &RunDifference) -> Markup {
    let images: Vec<&ImageDifference> =
        site.images.iter().filter(|image| image.differs()).collect();
    html! {
        @if site.footprints.moved() { (footprints(site)) }
        @if !images.is_empty() {
            (positions(&images, &site.limits))
            (pointing(&images, &site.limits))
            p {
                "Samples are matched by image line. Radial (up), along (flight) and cross (angular momentum) are axes of the \
                 orbit in A; signed columns are means. Rotations are about the camera axes; z is the boresight. Pointing alone: \
                 rotation × range. Ground point: intersection of the boresight with the ellipsoid."
            }
        }
    }
}

fn unknown() -> Cell {
    "–".into()
}

/// A value for which a limit may be set.
fn limited(value: f64, limit: Option<f64>) -> Cell {
    match limit {
        None => quantity(value).into(),
        Some(limit) => Cell::Limited(quantity(value), Limits::share(value, limit)),
    }
}

fn footprints(site: &RunDifference) -> Markup {
    let found = &site.footprints;
    let mut table = Table::new(
        "Footprints, matched by file, orbit, record and shot",
        &[
            Column::Number("in both"),
            Column::Number("only in A"),
            Column::Number("only in B"),
            Column::Number("moved"),
            Column::Number("mean, m"),
            Column::Number("max, m"),
            Column::Number("height mean, m"),
            Column::Number("height max, m"),
            Column::Number("time max, s"),
        ],
    );
    let movement = |value: &dyn Fn(&FootprintsMovement) -> Cell| {
        found.movement.as_ref().map_or_else(unknown, value)
    };
    table.row(
        true,
        [
            found.matched.to_string().into(),
            found.only_in_a.to_string().into(),
            found.only_in_b.to_string().into(),
            movement(&|m| m.moved.to_string().into()),
            movement(&|m| quantity(m.distance_m.mean).into()),
            movement(&|m| limited(m.distance_m.max, site.limits.movement_m)),
            movement(&|m| quantity(m.topography_m.mean).into()),
            movement(&|m| quantity(m.topography_m.max_abs).into()),
            movement(&|m| quantity(m.time_s.max_abs).into()),
        ],
    );
    table.finish()
}

fn positions(images: &[&ImageDifference], limits: &Limits) -> Markup {
    let mut table = Table::new(
        "Camera positions",
        &[
            Column::Text("image"),
            Column::Number("samples in both"),
            Column::Number("only in A"),
            Column::Number("only in B"),
            Column::Number("mean, m"),
            Column::Number("max, m"),
            Column::Number("radial, m"),
            Column::Number("along, m"),
            Column::Number("cross, m"),
            Column::Number("line times max, s"),
        ],
    );
    for image in images {
        let both = image.movement.as_ref().map_or(0, |m| m.samples.len());
        let mut cells: Vec<Cell> = vec![
            (&image.image).into(),
            both.to_string().into(),
            image.samples_only_in_a.to_string().into(),
            image.samples_only_in_b.to_string().into(),
        ];
        match &image.movement {
            None => cells.extend((0..6).map(|_| unknown())),
            Some(m) => cells.extend([
                quantity(m.distance_m.mean).into(),
                limited(m.distance_m.max, limits.movement_m),
                quantity(m.radial_m.mean).into(),
                quantity(m.along_m.mean).into(),
                quantity(m.cross_m.mean).into(),
                quantity(m.time_s.max_abs).into(),
            ]),
        }
        table.row(image.movement.is_some(), cells);
    }
    table.finish()
}

fn pointing(images: &[&ImageDifference], limits: &Limits) -> Markup {
    let mut table = Table::new(
        "Camera pointing",
        &[
            Column::Text("image"),
            Column::Number("rotation mean, ″"),
            Column::Number("rotation max, ″"),
            Column::Number("about x, ″"),
            Column::Number("about y, ″"),
            Column::Number("about z, ″"),
            Column::Number("pointing alone mean, m"),
            Column::Number("max, m"),
            Column::Number("ground point mean, m"),
            Column::Number("max, m"),
        ],
    );
    for image in images {
        let Some(m) = &image.movement else { continue };
        let ground = m.boresight_ground_m;
        table.row(
            true,
            [
                (&image.image).into(),
                quantity(m.turn_arcsec.mean).into(),
                limited(m.turn_arcsec.max, limits.pointing_arcsec),
                quantity(m.about_x_arcsec.mean).into(),
                quantity(m.about_y_arcsec.mean).into(),
                quantity(m.about_z_arcsec.mean).into(),
                m.pointing_ground_m
                    .map_or_else(unknown, |size| quantity(size.mean).into()),
                m.pointing_ground_m
                    .map_or_else(unknown, |size| quantity(size.max).into()),
                ground.map_or_else(unknown, |size| quantity(size.mean).into()),
                ground.map_or_else(unknown, |size| limited(size.max, limits.movement_m)),
            ],
        );
    }
    table.finish()
}

/// A curve of a plot: its name and its value at a sample.
type Curve = (&'static str, fn(&SampleMovement) -> f64);

const POSITION: [Curve; 3] = [
    ("radial", |s| s.radial_m),
    ("along", |s| s.along_m),
    ("cross", |s| s.cross_m),
];
const POINTING: [Curve; 3] = [
    ("about x", |s| s.about_x_arcsec),
    ("about y", |s| s.about_y_arcsec),
    ("about z", |s| s.about_z_arcsec),
];

/// Movement along each image that moved.
pub(super) fn plots(site: &RunDifference) -> Result<Markup> {
    let mut figures = Vec::new();
    for image in &site.images {
        let Some(movement) = &image.movement else {
            continue;
        };
        let mut panels = Vec::new();
        if movement.distance_m.moved() {
            panels.push(panel("camera movement, m", movement, POSITION, 0));
        }
        if movement.turn_arcsec.moved() {
            // Other colours, since the legend is common to both panels.
            panels.push(panel("camera rotation, arcsec", movement, POINTING, 3));
        }
        if !panels.is_empty() {
            figures.push(figure(&Plot::of(
                format!("{}: image {}", site.site, image.image),
                "Movement of the camera, B − A, at the samples that both runs have.".to_owned(),
                "lines from the middle of the header image",
                panels,
            ))?);
        }
    }
    Ok(html! {
        @if !figures.is_empty() { div.plots { @for figure in figures { (figure) } } }
    })
}

fn panel(
    y_label: &'static str,
    movement: &ImageMovement,
    curves: [Curve; 3],
    first_colour: usize,
) -> Panel {
    let curves = curves.into_iter().zip(first_colour..);
    let series = curves.map(|((name, value), colour)| {
        let samples = movement.samples.iter();
        let points = samples.map(|s| (s.line_offset, value(s))).collect();
        Series::line(name, colour, points)
    });
    Panel::of(y_label, series.collect())
}
