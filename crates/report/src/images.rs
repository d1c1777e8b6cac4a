//! Exterior orientation: Table 4 and figure 3 of Shan et al. 2005.

use super::{
    html::{Cell, Column, Markup, Table, folded_unless, html, paragraph},
    many,
    numbers::whole,
    plots::{GREY, Panel, Plot, Series, figure, label},
    section::Section,
    sky,
};
use areograph_base::{
    error::Result,
    units::{METRES_PER_KM, RADIANS_PER_ARCSECOND, RADIANS_PER_DEGREE},
    verdict::CheckKind,
};
use areograph_geom::{light_time::LightTime, polynomial::Fit, pushbroom::CameraModel};
use areograph_products::{ImageProducts, SiteProducts};
use areograph_stages::{
    fit_sensor_model::EulerModel,
    sample_orientation::{BoresightGround, OtherConvention},
    tag_times::ImageTimes,
};

pub(super) const SECTION: Section = Section {
    title: "Exterior orientation",
    anchor: "exterior-orientation",
    checks: &[
        CheckKind::PositionRmse,
        CheckKind::PointingRmse,
        CheckKind::TableError,
        CheckKind::BoresightMeets,
    ],
    appears: |site| !site.images.is_empty(),
    write,
};

fn write(site: &SiteProducts) -> Result<Markup> {
    let evidence = html! {
        (light_time(site))
        (models(site))
        div.plots { @for (_, image) in many::shown(site) { (figure(&residual_plot(image))?) } }
    };
    let invalid = site
        .images
        .iter()
        .any(|image| !image.invalid_because().is_empty());
    Ok(html! {
        (many::overview(site)?)
        (taken(site))
        (sky::figure(site)?)
        (folded_unless(invalid, "Light time, orientation polynomials, and residuals", &evidence))
    })
}

/// Times and geometry of the images: Table 2.
fn taken(site: &SiteProducts) -> Markup {
    let mut table = Table::new(
        "Images (Table 2 of Shan et al. 2005)",
        &[
            Column::Text("image"),
            Column::Text("start (UTC)"),
            Column::Number("lines exposed"),
            Column::Number("delivered"),
            Column::Number("samples"),
            Column::Number("summing, along × across"),
            Column::Number("line period, ms"),
            Column::Number("duration, s"),
            Column::Number("range at the middle, km"),
            Column::Number("emission, degrees"),
        ],
    );
    for (_, image) in many::shown(site) {
        let times = image.times;
        let samples = &image.orientation.samples;
        let middle = samples
            .get(samples.len() / 2)
            .and_then(|sample| sample.boresight);
        let seen = |number: fn(&BoresightGround) -> String| -> Cell {
            middle
                .as_ref()
                .map_or_else(|| "–".to_owned(), number)
                .into()
        };
        table.row_of(
            &format!("{}/times", place(&times.id)),
            true,
            [
                (&times.id).into(),
                (&times.utc_start).into(),
                Cell::from(whole(times.line_times.lines())).traced("/lines_header"),
                Cell::from(whole(times.lines_delivered)).traced("/lines_delivered"),
                Cell::from(times.samples.to_string()).traced("/samples_per_line"),
                Cell::from(format!(
                    "{} × {}",
                    times.downtrack_summing, times.crosstrack_summing
                ))
                .traced("/downtrack_summing /crosstrack_summing"),
                periods_ms(times),
                format!("{:.2}", times.duration_s()).into(),
                seen(|ground| format!("{:.1}", ground.range_m / METRES_PER_KM)),
                seen(|ground| format!("{:.2}", ground.emission_rad / RADIANS_PER_DEGREE)),
            ],
        );
    }
    table.finish()
}

/// The site's convention of camera positions, and the offsets of the others.
fn light_time(site: &SiteProducts) -> Markup {
    let convention = site.config.orientation.light_time;
    if site
        .images
        .iter()
        .all(|image| image.times.support.is_some())
    {
        return Markup::default();
    }
    let effects = site
        .images
        .iter()
        .map(|image| &image.orientation.light_time);
    let others: Vec<OtherConvention> = effects.flat_map(|of| of.others.iter().copied()).collect();
    let mut words = format!(
        "Light time ({}): camera positions are {}.",
        convention.word(),
        convention.positions()
    );
    for (word, other) in LightTime::WORDS {
        let of_images = || others.iter().filter(|of| of.convention == other);
        let span = |value: fn(&OtherConvention) -> f64, decimals: usize| {
            let low = of_images().map(value).fold(f64::INFINITY, f64::min);
            let high = of_images().map(value).fold(f64::NEG_INFINITY, f64::max);
            let [low, high] = [low, high].map(|end| label(end, decimals));
            if low == high {
                low
            } else {
                format!("{low} to {high}")
            }
        };
        if of_images().next().is_some() {
            words += &format!(
                " With convention {word}, the view shifts by {} m on the ground, and a ground point shifts by {} \
                 lines in the image.",
                span(|of| of.ground_m, 1),
                span(|of| of.lines, 2)
            );
        }
    }
    words +=
        " Files in exchange/centre follow the convention of ISIS and ALE (centre) in every run.";
    paragraph(&words)
}

/// The line period; all of them if it changes inside the image.
fn periods_ms(times: &ImageTimes) -> Cell {
    let periods = times
        .line_times
        .pieces()
        .map(|piece| format!("{:.4}", 1e3 * piece.period_s));
    let periods: Vec<String> = periods.collect();
    let pieces = (0..periods.len()).map(|piece| format!("/line_pieces/{piece}/line_period_s*1000"));
    let places: Vec<String> = match periods.len() {
        1 => vec!["/line_period_s*1000".to_owned()],
        _ => pieces.collect(),
    };
    Cell::from(periods.join(", ")).traced(places.join(" "))
}

/// Place of an image in the products.
fn place(image: &str) -> String {
    format!("images/{image}/orientation.json#")
}

/// RMSE per image: Table 4.
fn models(site: &SiteProducts) -> Markup {
    let limits = &site.config.orientation;
    let mut table = Table::new(
        "RMSE of the polynomials over all samples (Table 4 of Shan et al. 2005)",
        &[
            Column::Text("image"),
            Column::Number("order"),
            Column::Number("X, m"),
            Column::Number("Y, m"),
            Column::Number("Z, m"),
            Column::Number("position, m"),
            Column::Number("ω, ″"),
            Column::Number("φ, ″"),
            Column::Number("κ, ″"),
            Column::Number("pointing, ″"),
            Column::Number("pointing on the ground, m"),
            Column::Text("verdict"),
        ],
    );
    for (_, image) in many::shown(site) {
        let (model, id) = (image.model, &image.times.id);
        let valid = image.invalid_because().is_empty();
        let judged = [
            Cell::Plain(format!("{:.4}", model.first_order.position_rmse_m()))
                .traced("/position_rmse_m"),
            "–".into(),
            "".into(),
        ];
        let [first, second] =
            ["first_order", "second_order"].map(|order| format!("{}/{order}", place(id)));
        table.row_of(&first, valid, row(id, "1", &model.first_order, judged));
        let rmse_rad = model.rotation_vector.rmse_rad();
        let position_m = model.second_order.position_rmse_m();
        // The limits apply to the form in use.
        let limited = |text: String, share: f64| match model.model {
            CameraModel::Samples => Cell::Plain(text),
            CameraModel::FirstOrder | CameraModel::SecondOrder | CameraModel::RotationVector => {
                Cell::Limited(text, share)
            }
        };
        let judged = [
            limited(
                format!("{position_m:.4}"),
                position_m / limits.position_rmse_max_m,
            )
            .traced("/position_rmse_m"),
            limited(
                format!("{:.3}", rmse_rad / RADIANS_PER_ARCSECOND),
                rmse_rad / limits.pointing_rmse_max_rad,
            ),
            if valid { "valid" } else { "invalid" }.into(),
        ];
        table.row_of(&second, valid, row(id, "2", &model.second_order, judged));
    }
    let mut words = format!(
        "Limits for order 2: position {} m, pointing {}″ (largest component of the rotation vector). On the ground: RMS \
         shift of the boresight.",
        limits.position_rmse_max_m,
        // As written: conversion to radians and back adds digits.
        (1e6 * limits.pointing_rmse_max_rad / RADIANS_PER_ARCSECOND).round() / 1e6
    );
    for (_, image) in many::shown(site) {
        let (model, misfit) = (image.model, image.model.misfit);
        if model.model == CameraModel::Samples {
            words += &format!(
                " Image {} uses interpolation between its samples, not a polynomial; the interpolation error halfway \
                 between samples is {:.4} m and {:.3}″ (RMS).",
                image.times.id,
                misfit.position_rmse_m,
                misfit.pointing_rmse_rad / RADIANS_PER_ARCSECOND
            );
        }
    }
    html! { (table.finish()) p { (words) } }
}

/// A row: image, order, six RMSE including those with limits.
fn row(
    image: &str,
    order: &str,
    model: &EulerModel,
    [position, pointing, verdict]: [Cell; 3],
) -> Vec<Cell> {
    let mut cells: Vec<Cell> = vec![image.into(), order.into()];
    let axes = model.position_m.iter().zip(["x", "y", "z"]);
    cells.extend(axes.map(|(fit, axis)| {
        Cell::from(format!("{:.4}", fit.rmse)).traced(format!("/{axis}_m/rmse"))
    }));
    cells.push(position);
    let angles = model.angles_rad.iter().zip(["omega", "phi", "kappa"]);
    cells.extend(angles.map(|(fit, angle)| {
        let arcseconds = format!("{:.3}", fit.rmse / RADIANS_PER_ARCSECOND);
        Cell::from(arcseconds).traced(format!("/{angle}_rad/rmse_arcsec"))
    }));
    cells.push(pointing);
    let ground = model.pointing_ground_rmse_m();
    let ground = ground.map_or_else(|| "–".to_owned(), |metres| format!("{metres:.3}"));
    cells.push(Cell::from(ground).traced("/pointing_ground_rmse_m"));
    cells.push(verdict);
    cells
}

/// Residuals below this, millimetres, arcseconds and metres, round to zero in the caption and have no axis.
const LEAST: f64 = 5e-4;

/// Figure 3: residuals of the second-order model at every sample, and their effect on the ground.
fn residual_plot(image: &ImageProducts) -> Plot {
    let model = &image.model.second_order;
    let lines: Vec<f64> = image
        .orientation
        .samples
        .iter()
        .map(|sample| sample.line_offset)
        .collect();
    let over_lines = |values: &[f64], scale: f64| {
        let values = values.iter().map(|value| value * scale);
        lines.iter().copied().zip(values).collect::<Vec<_>>()
    };
    let three = |fits: &[Fit; 3], names: [&str; 3], scale: f64| {
        let series = fits.iter().zip(names).enumerate();
        series
            .map(|(axis, (fit, name))| Series::line(name, axis, over_lines(&fit.residuals, scale)))
            .collect::<Vec<_>>()
    };
    let mut panels = vec![
        Panel::of(
            "position, mm",
            three(&model.position_m, ["X, ω", "Y, φ", "Z, κ"], 1e3),
        ),
        Panel::of(
            "pointing, arcsec",
            three(
                &model.angles_rad,
                ["X, ω", "Y, φ", "Z, κ"],
                RADIANS_PER_ARCSECOND.recip(),
            ),
        ),
    ];
    if let Some(ground_m) = &model.pointing_ground_m {
        let series = Series::line("on the ground", GREY, over_lines(ground_m, 1.0));
        panels.push(Panel::of("pointing, m", vec![series]));
    }
    for panel in &mut panels {
        panel.height = 250;
        panel.least = LEAST;
    }
    Plot::of(
        format!("Residuals of {}", image.times.id),
        words(image),
        "lines from the middle of the image",
        panels,
    )
}

fn words(image: &ImageProducts) -> String {
    let model = &image.model.second_order;
    let largest = |fits: &[Fit; 3]| {
        let residuals = fits.iter().flat_map(|fit| &fit.residuals);
        residuals.fold(0.0, |most: f64, value| most.max(value.abs()))
    };
    let ground = model
        .pointing_ground_m
        .iter()
        .flatten()
        .copied()
        .fold(0.0, f64::max);
    let mut text = format!(
        "{} epochs; largest residuals {:.2} mm and {:.3}″",
        image.orientation.samples.len(),
        1e3 * largest(&model.position_m),
        largest(&model.angles_rad) / RADIANS_PER_ARCSECOND
    );
    text += &if model.pointing_ground_m.is_some() {
        format!(", {ground:.3} m on the ground.")
    } else {
        "; the boresight misses the ground.".to_owned()
    };
    text
}
