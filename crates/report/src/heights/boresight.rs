//! Position by a laser on the bus of the cameras.

use super::{
    super::{
        html::{Cell, Column, Markup, Table, counted, html, paragraph},
        plots::label,
    },
    relief::profiles,
};
use areograph_base::units::SECONDS_PER_MS;
use areograph_stages::adjust::{Adjusted, BoresightSummary, SpotsOfImage};

const MRAD_PER_RADIAN: f64 = 1e3;

/// Pointing of the laser in simultaneous images, if requested.
pub(super) fn boresight(adjusted: &Adjusted) -> Markup {
    match &adjusted.boresight {
        None => Markup::default(),
        Some(Err(reason)) => paragraph(&format!("adjustment.common_bus has no effect: {reason}.")),
        Some(Ok(found)) => {
            let caption = "Recorded positions of the profiles minus their positions from laser and images, metres";
            html! { (words(found)) (table(&found.images)) (profiles(caption, &found.profile_shifts)) }
        }
    }
}

fn words(found: &BoresightSummary) -> Markup {
    let angle = |axis: usize| {
        let [value, sigma] = [found.angles_rad[axis], found.sigma_rad[axis]]
            .map(|radians| label(MRAD_PER_RADIAN * radians, 3));
        format!("{value} ± {sigma} mrad")
    };
    let farthest = found.farthest.as_ref().map(|(unknown, sigmas)| {
        format!(
            " Largest contradiction: the {unknown}, {} σ.",
            label(*sigmas, 1)
        )
    });
    let prior = &found.prior.angles;
    let before = |axis: usize| {
        let [value, sigma] = [prior.angles_rad[axis], prior.sigmas_rad()[axis]]
            .map(|radians| label(MRAD_PER_RADIAN * radians, 3));
        format!("{value} ± {sigma} mrad")
    };
    let by = match found.prior.sites.len() {
        0 => String::new(),
        count => format!(
            ", by {} (adjustment.boresight)",
            counted(count, "other site")
        ),
    };
    paragraph(&format!(
        "Camera and laser share a bus: in a simultaneous image, the mounting determines the spot of each shot, \
         independently of the attitude (adjustment.common_bus). The laser direction differs from the nominal \
         direction by {} towards X and {} towards Y of the bus; a priori {} and {}{by}.{}",
        angle(0),
        angle(1),
        before(0),
        before(1),
        farthest.unwrap_or_default()
    ))
}

fn table(images: &[SpotsOfImage]) -> Markup {
    let mut table = Table::new(
        "Shots in simultaneous images: footprints from the kernels minus spots from the mounting",
        &[
            Column::Text("image"),
            Column::Number("shots"),
            Column::Number("lines late, ms"),
            Column::Number("footprints along, lines"),
            Column::Number("across, px"),
        ],
    );
    for image in images {
        let late = image.line_time_s.map_or_else(
            || "–".to_owned(),
            |(late_s, sigma_s)| {
                let [late_ms, sigma_ms] =
                    [late_s, sigma_s].map(|seconds| label(seconds / SECONDS_PER_MS, 0));
                format!("{late_ms} ± {sigma_ms}")
            },
        );
        let mut cells: Vec<Cell> = vec![(&image.image).into()];
        cells.push(image.spots.to_string().into());
        cells.push(late.into());
        let off = image.footprints_off.iter();
        cells.extend(off.map(|axis| Cell::from(label(axis.mean, 1))));
        table.row(true, cells);
    }
    table.finish()
}
