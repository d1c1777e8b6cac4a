//! Corrections of the adjustment to each image's orientation, to ranges and to biases.

use std::collections::BTreeMap;

use nalgebra::Vector3;

use super::{
    html::{Cell, Column, Markup, Table, html, paragraph},
    many,
    plots::label,
};
use areograph_base::units::{RADIANS_PER_ARCSECOND, SECONDS_PER_MS};
use areograph_geom::{orbit_axes::radial_along_cross, statistics::Summary};
use areograph_products::{ImageProducts, SiteProducts};
use areograph_stages::adjust::{Adjusted, CorrectedImage};

/// Corrections at the middle of each image, ranges, biases.
pub(super) fn tables(site: &SiteProducts, adjusted: &Adjusted) -> Markup {
    html! {
        (positions(site, adjusted))
        (rotations(site, adjusted))
        (ranges(site, adjusted))
        (biases(adjusted))
        (attitude_clock(adjusted))
    }
}

/// Coefficients of power 0 from quantity `first` on, with their standard deviations.
fn constants(image: &CorrectedImage, first: usize) -> [(f64, f64); 3] {
    [0, 1, 2].map(|axis| {
        let index = 3 * (first + axis);
        (image.correction[index], image.sigmas[index])
    })
}

fn with_sigma((value, sigma): (f64, f64), decimals: usize) -> Cell {
    format!("{} ± {}", label(value, decimals), label(sigma, decimals)).into()
}

/// Place in the products of the coefficient of power 0 of a quantity, and its standard deviation, in a different unit.
fn place(quantity: usize, unit: &str) -> String {
    let index = 3 * quantity;
    format!("/correction/{index}{unit} /sigmas/{index}{unit}")
}

/// Place of an image in the products.
fn of_image(index: usize) -> String {
    format!("adjustment.json#/adjustment/images/{index}")
}

fn positions(site: &SiteProducts, adjusted: &Adjusted) -> Markup {
    let mut table = Table::new(
        "Shift of the camera at the middle of the image, metres",
        &[
            Column::Text("image"),
            Column::Number("X"),
            Column::Number("Y"),
            Column::Number("Z"),
            Column::Number("along track, body-fixed"),
            Column::Number("cross track"),
            Column::Number("radial"),
        ],
    );
    let mut all = adjusted.images.iter();
    let starts_at_pedr = all.any(|corrected| corrected.pedr_orbit_m().is_some());
    for (index, image) in many::shown(site) {
        let Some(corrected) = adjusted.images.get(index) else {
            continue;
        };
        let position_m = constants(corrected, 0);
        let in_orbit = orbit_axes(image, Vector3::from(position_m.map(|(value, _)| value)));
        let mut cells: Vec<Cell> = vec![(&corrected.id).into()];
        let axes = position_m.into_iter().enumerate();
        cells.extend(axes.map(|(axis, value)| with_sigma(value, 1).traced(place(axis, ""))));
        cells.extend([1, 2, 0].map(|axis| {
            let component = in_orbit.map(|shift_m| label(shift_m[axis], 1));
            Cell::from(component.unwrap_or_else(|| "–".to_owned()))
        }));
        table.row_of(&of_image(index), true, cells);
    }
    html! {
        (table.finish())
        (line_times(adjusted))
        @if starts_at_pedr {
            p {
                "Shifts are relative to the orbit in the kernels; with a simultaneous profile, the a priori orbit is \
                 the orbit of the shots (adjustment.orbit_of_pedr)."
            }
        }
    }
}

/// Contribution of line times to the standard deviations of positions.
fn line_times(adjusted: &Adjusted) -> Markup {
    let largest_s = adjusted.images.iter().map(|image| image.line_time_sigma_s);
    let largest_s = largest_s.fold(0.0, f64::max);
    html! {
        @if largest_s > 0.0 {
            p {
                "±: a posteriori σ of the camera position at the exposure of a line. Line times are known to ±"
                (label(largest_s / SECONDS_PER_MS, 0)) " ms; along the track they cannot be \
                 separated from position and rotation, which must be used together."
            }
        }
    }
}

/// Radial, along the flight over the turning planet, and across it.
fn orbit_axes(image: &ImageProducts, shift_m: Vector3<f64>) -> Option<Vector3<f64>> {
    let samples = &image.orientation.samples;
    let middle = samples.len() / 2;
    let position_m = |index: usize| Some(samples.get(index)?.position.xyz_m);
    let (before, after) = (position_m(middle.checked_sub(1)?)?, position_m(middle)?);
    let advance_m = after - before;
    let axes = radial_along_cross(&after, &advance_m);
    (advance_m.norm() > 0.0).then(|| axes.transpose() * shift_m)
}

fn rotations(site: &SiteProducts, adjusted: &Adjusted) -> Markup {
    let mut table = Table::new(
        "Rotation of the camera at the middle of the image, arcseconds",
        &[
            Column::Text("image"),
            Column::Number("about camera x"),
            Column::Number("about camera y"),
            Column::Number("about camera z"),
            Column::Number("time bias, ms"),
        ],
    );
    let per_arcsecond = format!("*{}", RADIANS_PER_ARCSECOND.recip());
    for (index, _) in many::shown(site) {
        let Some(image) = adjusted.images.get(index) else {
            continue;
        };
        let arcseconds = |(value, sigma): (f64, f64)| {
            (value / RADIANS_PER_ARCSECOND, sigma / RADIANS_PER_ARCSECOND)
        };
        let mut cells: Vec<Cell> = vec![(&image.id).into()];
        let rotation = constants(image, 3);
        cells.extend(rotation.into_iter().zip(3..).map(|(axis, quantity)| {
            with_sigma(arcseconds(axis), 1).traced(place(quantity, &per_arcsecond))
        }));
        cells.push(image.time_bias_s.map_or_else(
            || "not estimated".into(),
            |(bias_s, sigma_s)| {
                with_sigma((bias_s / SECONDS_PER_MS, sigma_s / SECONDS_PER_MS), 2)
                    .traced("/time_bias_s/0*1000 /time_bias_s/1*1000")
            },
        ));
        table.row_of(&of_image(index), true, cells);
    }
    let inseparable = if adjusted.summary.correlated.is_empty() {
        ""
    } else {
        " With a narrow field of view, position and rotation are nearly indistinguishable."
    };
    html! { (table.finish()) p { "±: a posteriori σ." (inseparable) } }
}

/// Range residuals of the same shots with the orbit of the kernels and after the adjustment.
fn ranges(site: &SiteProducts, adjusted: &Adjusted) -> Markup {
    if adjusted.ranges.is_empty() {
        return paragraph("No shot was fired during an exposure, so the adjustment uses no range.");
    }
    let before_m = checked_ranges(site);
    let mut groups: BTreeMap<(&str, usize), [Vec<f64>; 2]> = BTreeMap::new();
    let shown = site.shown_images();
    let ranges = adjusted.ranges.iter();
    for range in ranges.filter(|range| shown.binary_search(&range.image).is_ok()) {
        let profile = &*site.profiles[range.profile].id;
        let [before, after] = groups.entry((profile, range.image)).or_default();
        let shot = (range.profile, adjusted.points[range.point].index);
        before.extend(before_m.get(&shot));
        after.push(range.residual_m.value);
    }
    let mut table = Table::new(
        "Ranges of shots fired during an exposure: residuals in metres",
        &[
            Column::Text("profile"),
            Column::Text("image"),
            Column::Number("ranges"),
            Column::Number("before, mean"),
            Column::Number("std"),
            Column::Number("after, mean"),
            Column::Number("std"),
        ],
    );
    for ((profile, image), [before, after]) in groups {
        let mut cells: Vec<Cell> = vec![
            profile.into(),
            (&adjusted.images[image].id).into(),
            after.len().to_string().into(),
        ];
        for values in [before, after] {
            let found = Summary::of(&values);
            let numbers = [found.mean, found.standard_deviation].map(|value| label(value, 3));
            cells.extend(numbers.map(|text| {
                let text = if found.n == 0 { "–".to_owned() } else { text };
                Cell::from(text)
            }));
        }
        table.row(true, cells);
    }
    html! { (table.finish()) p { "Before: as in the range check." } }
}

/// Range − distance of the shots by profile and row.
fn checked_ranges(site: &SiteProducts) -> BTreeMap<(usize, usize), f64> {
    let shots = &site.ranges.shots;
    let of_shot = |index: usize| {
        let shot = (
            shots.profile.at(index) as usize,
            shots.row.at(index) as usize,
        );
        (shot, shots.range_minus_distance_m.at(index))
    };
    (0..shots.len()).map(of_shot).collect()
}

/// Offset of the attitude's clock, if it is an unknown.
fn attitude_clock(adjusted: &Adjusted) -> Markup {
    html! {
        @if let Some((offset_s, sigma_s)) = adjusted.attitude_clock_s {
            p {
                "Offset of the attitude clock, all images: " (label(offset_s, 3)) " ± " (label(sigma_s, 3))
                " s; the rotations above include this offset."
            }
        }
    }
}

fn biases(adjusted: &Adjusted) -> Markup {
    let biases = &adjusted.summary.range_biases_m;
    if biases.is_empty() {
        return Markup::default();
    }
    let columns = &[Column::Text("profile"), Column::Number("range bias, m")];
    let mut table = Table::new("Range biases", columns);
    for (index, (profile, value_m, sigma_m)) in biases.iter().enumerate() {
        table.row_of(
            &format!("adjustment.json#/adjustment/summary/range_biases_m/{index}"),
            true,
            [
                profile.into(),
                with_sigma((*value_m, *sigma_m), 3).traced("/1 /2"),
            ],
        );
    }
    table.finish()
}
