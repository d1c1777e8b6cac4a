//! Windows and filters, and the shots that they rejected.

use super::{
    html::{Cell, Column, Markup, Table, html, paragraph},
    numbers::{number, whole},
    section::Section,
    source::member,
};
use areograph_base::{
    body::Body,
    units::{METRES_PER_KM, RADIANS_PER_DEGREE},
    verdict::CheckKind,
};
use areograph_config::WindowConfig;
use areograph_geom::window::WindowShape;
use areograph_products::SiteProducts;

pub(super) const SECTION: Section = Section {
    title: "Selection of shots",
    anchor: "selection-of-shots",
    checks: &[CheckKind::Footprints],
    appears: |site| site.config.has_shots(),
    write: |site| Ok(write(site)),
};

const AT_MARS: [Column; 3] = columns("outline (IAU 2000, areocentric, east)");
const AT_THE_MOON: [Column; 3] = columns("outline (mean Earth/polar axis, east)");

const fn columns(outline: &'static str) -> [Column; 3] {
    [
        Column::Text("window"),
        Column::Text(outline),
        Column::Number("shots"),
    ]
}

fn write(site: &SiteProducts) -> Markup {
    let columns = match site.config.body {
        Body::Mars => &AT_MARS,
        Body::Moon => &AT_THE_MOON,
    };
    let mut windows = Table::new("Windows", columns);
    for (bit, window) in site.config.windows.iter().enumerate() {
        let masks = site.footprints.windows.iter();
        let shots = masks.filter(|mask| mask >> bit & 1 == 1).count();
        windows.row(
            true,
            [
                (&window.id).into(),
                outline(window).into(),
                whole(shots).into(),
            ],
        );
    }
    html! { (windows.finish()) p { (filter(site)) } (rejects(site)) }
}

fn filter(site: &SiteProducts) -> String {
    if !site.config.shots.is_empty() {
        return "Shots in tables are kept if they lie in a window; duplicate rows are counted once.".to_owned();
    }
    let filter = &site.config.pedr.filter;
    let join = |values: Vec<String>| values.join(", ");
    format!(
        "Kept: class {}, trigger channel {}, attitude flag {}, at most {:.1}° off nadir{}.",
        join(filter.classes.iter().map(ToString::to_string).collect()),
        join(filter.channels.iter().map(ToString::to_string).collect()),
        join(
            filter
                .attitude_flags
                .iter()
                .map(ToString::to_string)
                .collect()
        ),
        filter.off_nadir_max_rad / RADIANS_PER_DEGREE,
        if filter.has_season() {
            let edges = filter.solar_longitude_rad;
            let [first, last] = edges.map(|edge| number(edge / RADIANS_PER_DEGREE, 1));
            format!(", season Ls {first}° to {last}°")
        } else {
            String::new()
        }
    )
}

fn rejects(site: &SiteProducts) -> Markup {
    if site.rejected.is_empty() {
        return paragraph("No shot inside a window was rejected.");
    }
    let left_out: u64 = site.rejected.values().sum();
    let all = left_out + site.footprints.len() as u64;
    let mut table = Table::new(
        "Rejected shots inside a window",
        &[
            Column::Text("reason"),
            Column::Number("shots"),
            Column::Number("share of the shots in windows"),
        ],
    );
    for (reason, shots) in site.rejected {
        let share = 100.0 * *shots as f64 / all as f64;
        table.row(
            true,
            [
                reason.into(),
                Cell::from(whole(*shots))
                    .traced(format!("manifest.json#/rejected/{}", member(reason))),
                format!("{share:.1} %").into(),
            ],
        );
    }
    table.finish()
}

fn outline(window: &WindowConfig) -> String {
    match &window.shape {
        WindowShape::Box {
            west_rad,
            east_rad,
            south_rad,
            north_rad,
        } => {
            let [west, east, south, north] = [west_rad, east_rad, south_rad, north_rad]
                .map(|angle| number(angle / RADIANS_PER_DEGREE, 4));
            format!("longitude {west}° to {east}°, latitude {south}° to {north}°")
        }
        WindowShape::Polygons { polygons } => {
            let vertices: usize = polygons.iter().flatten().map(Vec::len).sum();
            format!("{} polygons with {vertices} vertices", polygons.len())
        }
        WindowShape::Image { image, margin_m } => {
            format!(
                "ground shown by image {image}, with a margin of {:.1} km",
                margin_m / METRES_PER_KM
            )
        }
    }
}
