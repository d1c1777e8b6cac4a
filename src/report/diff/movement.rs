//! Movements in tables and plots.

use crate::{
    difference::{
        FootprintsMovement, ImageDifference, ImageMovement, RunDifference, SampleMovement, quantity,
    },
    error::Result,
    report::{
        html::{Table, paragraph},
        plots::{Extent, Plot, Series, Style, figure},
    },
};

/// Footprints, then cameras.
pub(super) fn tables(site: &RunDifference) -> String {
    let mut body = footprints(site);
    if !site.images.is_empty() {
        body += &positions(&site.images);
        body += &pointing(&site.images);
        body += &paragraph(
            "Samples are matched by image line. Radial, along and cross are the axes of A's orbit: away from Mars, \
             along the flight, along the angular momentum; their columns are means with sign. Turns are about the \
             camera's own axes; one about z, the boresight, does not move the ground point. On the ground, pointing \
             alone is turn × range across the line of sight; the ground point of the boresight on the ellipsoid feels \
             position and turn together.",
        );
    }
    body
}

fn footprints(site: &RunDifference) -> String {
    let found = &site.footprints;
    let heads = [
        "footprints in both",
        "only in A",
        "only in B",
        "moved",
        "mean, m",
        "max, m",
        "height mean, m",
        "height max, m",
        "time max, s",
    ];
    let mut table = Table::new(&heads, &[true; 9]);
    let movement = |value: fn(&FootprintsMovement) -> String| {
        let movement = found.movement.as_ref();
        movement.map_or_else(|| "–".to_owned(), value)
    };
    table.row(
        true,
        &[
            found.matched.to_string(),
            found.only_in_a.to_string(),
            found.only_in_b.to_string(),
            movement(|m| m.moved.to_string()),
            movement(|m| quantity(m.distance_m.mean)),
            movement(|m| quantity(m.distance_m.max)),
            movement(|m| quantity(m.topography_m.mean)),
            movement(|m| quantity(m.topography_m.max_abs)),
            movement(|m| quantity(m.time_s.max_abs)),
        ],
    );
    table.finish()
}

/// Name and number of samples of an image.
fn image_cells(image: &ImageDifference) -> [String; 4] {
    let both = image.movement.as_ref().map_or(0, |m| m.samples.len());
    [
        image.image.clone(),
        both.to_string(),
        image.samples_only_in_a.to_string(),
        image.samples_only_in_b.to_string(),
    ]
}

fn positions(images: &[ImageDifference]) -> String {
    let heads = [
        "camera of image",
        "samples in both",
        "only in A",
        "only in B",
        "mean, m",
        "max, m",
        "radial, m",
        "along, m",
        "cross, m",
        "line times, max, s",
    ];
    let numbers: &'static [bool] = &[false, true, true, true, true, true, true, true, true, true];
    let mut table = Table::new(&heads, numbers);
    for image in images {
        let mut cells = image_cells(image).to_vec();
        if let Some(m) = &image.movement {
            cells.extend(
                [
                    m.distance_m.mean,
                    m.distance_m.max,
                    m.radial_m.mean,
                    m.along_m.mean,
                    m.cross_m.mean,
                    m.time_s.max_abs,
                ]
                .map(quantity),
            );
        }
        table.row(true, &cells);
    }
    table.finish()
}

fn pointing(images: &[ImageDifference]) -> String {
    let heads = [
        "pointing of image",
        "turn mean, ″",
        "max, ″",
        "about x, ″",
        "about y, ″",
        "about z, ″",
        "pointing alone on the ground: mean, m",
        "max, m",
        "ground point: mean, m",
        "max, m",
    ];
    let numbers: &'static [bool] = &[false, true, true, true, true, true, true, true, true, true];
    let mut table = Table::new(&heads, numbers);
    for image in images {
        let Some(m) = &image.movement else { continue };
        let mut cells = vec![image.image.clone()];
        cells.extend(
            [
                m.turn_arcsec.mean,
                m.turn_arcsec.max,
                m.about_x_arcsec.mean,
                m.about_y_arcsec.mean,
                m.about_z_arcsec.mean,
            ]
            .map(quantity),
        );
        for size in [m.pointing_ground_m, m.boresight_ground_m] {
            let cell = |value: Option<f64>| value.map_or_else(|| "–".to_owned(), quantity);
            cells.push(cell(size.map(|size| size.mean)));
            cells.push(cell(size.map(|size| size.max)));
        }
        table.row(true, &cells);
    }
    table.finish()
}

/// A curve of a plot: its name and its value at a sample.
type Curve = (&'static str, fn(&SampleMovement) -> f64);

/// Movement along each image that moved.
pub(super) fn plots(site: &RunDifference) -> Result<String> {
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
    let mut figures = String::new();
    for image in &site.images {
        let Some(movement) = &image.movement else {
            continue;
        };
        if movement.distance_m.moved() {
            let caption = format!("Image {}: movement of the camera, B − A.", image.image);
            figures += &figure(&plot(movement, "position, m", POSITION, caption))?;
        }
        if movement.turn_arcsec.moved() {
            let caption = format!("Image {}: turn of the camera, B − A.", image.image);
            figures += &figure(&plot(movement, "pointing, arcsec", POINTING, caption))?;
        }
    }
    Ok(figures)
}

fn plot(
    movement: &ImageMovement,
    y_label: &'static str,
    curves: [Curve; 3],
    caption: String,
) -> Plot {
    let samples = &movement.samples;
    let series: Vec<Series> = curves
        .into_iter()
        .enumerate()
        .map(|(colour, (name, value))| Series {
            label: name.to_owned(),
            style: Style::Line,
            colour,
            points: samples.iter().map(|s| (s.line_offset, value(s))).collect(),
        })
        .collect();
    let points = || series.iter().flat_map(|series| series.points.iter());
    Plot {
        x_label: "lines from the middle of the header image",
        y_label,
        x: Extent::of(points().map(|point| point.0)),
        y: Extent::of(points().map(|point| point.1)),
        x_turns: false,
        height: 240,
        marks: Vec::new(),
        caption,
        series,
    }
}
