//! Table and plots of the sensor models.

use super::{
    html::{Table, paragraph, section},
    plots::{Extent, Plot, Series, Style, figure},
};
use crate::{
    error::Result,
    geom::polynomial::Fit,
    products::{ImageProducts, SiteProducts},
    stages::fit_sensor_model::EulerModel,
    units::RADIANS_PER_ARCSECOND,
};

/// RMSE per image: Table 4 of Shan et al. 2005.
pub(super) fn models(site: &SiteProducts) -> String {
    if site.images.is_empty() {
        return String::new();
    }
    let heads = [
        "image",
        "start (UTC)",
        "lines",
        "line period, ms",
        "order",
        "X, m",
        "Y, m",
        "Z, m",
        "ω, ″",
        "φ, ″",
        "κ, ″",
        "verdict",
    ];
    let numbers: &'static [bool] = &[
        false, false, true, true, true, true, true, true, true, true, true, false,
    ];
    let mut table = Table::new(&heads, numbers);
    for image in site.images {
        let model = image.model;
        let valid = model.invalid_because.is_empty();
        let mut verdict = if valid {
            "valid".to_owned()
        } else {
            model.invalid_because.join("; ")
        };
        if model.near_gimbal_lock {
            verdict += "; near gimbal lock, use the rotation-vector form";
        }
        let times = image.times;
        let first = [
            times.id.clone(),
            times.utc_start.clone(),
            times.lines_header.to_string(),
            format!("{:.4}", 1e3 * times.line_period_s),
            "1".to_owned(),
        ];
        table.row(
            valid,
            &[&first[..], &rmse(&model.first_order), &[String::new()]].concat(),
        );
        let second = [
            String::new(),
            String::new(),
            String::new(),
            String::new(),
            "2".to_owned(),
        ];
        table.row(
            valid,
            &[&second[..], &rmse(&model.second_order), &[verdict]].concat(),
        );
    }
    let words = paragraph(
        "RMSE of the polynomials over all samples (Table 4 of Shan et al. 2005): position in metres, pointing angles in \
         arcseconds.",
    );
    section("Exterior orientation", &(table.finish() + &words))
}

fn rmse(model: &EulerModel) -> Vec<String> {
    let position = model
        .position_m
        .iter()
        .map(|fit| format!("{:.4}", fit.rmse));
    let angles = model
        .angles_rad
        .iter()
        .map(|fit| format!("{:.3}", fit.rmse / RADIANS_PER_ARCSECOND));
    position.chain(angles).collect()
}

/// Residuals of the second-order models along the images.
pub(super) fn residual_plots(site: &SiteProducts) -> Result<String> {
    let mut figures = String::new();
    for image in site.images {
        let model = &image.model.second_order;
        figures += &figure(&residual_plot(
            image,
            "position, mm",
            &model.position_m,
            ["X", "Y", "Z"],
            1e3,
        ))?;
        let arcseconds = RADIANS_PER_ARCSECOND.recip();
        figures += &figure(&residual_plot(
            image,
            "pointing, arcsec",
            &model.angles_rad,
            ["ω", "φ", "κ"],
            arcseconds,
        ))?;
    }
    if figures.is_empty() {
        return Ok(figures);
    }
    Ok(section("Residuals of the second-order models", &figures))
}

fn residual_plot(
    image: &ImageProducts,
    y_label: &'static str,
    fits: &[Fit; 3],
    names: [&str; 3],
    scale: f64,
) -> Plot {
    let lines: Vec<f64> = image
        .orientation
        .samples
        .iter()
        .map(|sample| sample.line_offset)
        .collect();
    let series: Vec<Series> = fits
        .iter()
        .zip(names)
        .enumerate()
        .map(|(colour, (fit, name))| Series {
            label: name.to_owned(),
            style: Style::Line,
            colour,
            points: lines
                .iter()
                .copied()
                .zip(fit.residuals.iter().map(|residual| residual * scale))
                .collect(),
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
        caption: format!("Image {}.", image.times.id),
        series,
    }
}
