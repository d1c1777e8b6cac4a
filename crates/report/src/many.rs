//! Sites of many images: the selection with separate rows and plots, and a summary of all.
//!
//! The selection is made with the products ([`SiteProducts::shown_images`]), because the data of the page contain
//! the points of no others.

use super::{
    html::{Cell, Column, Markup, Table, folded, html, link},
    numbers::whole,
    plots::{GREY, Panel, Plot, Series, Style, figure, label, thinned},
};
use areograph_base::{error::Result, units::RADIANS_PER_ARCSECOND};
use areograph_geom::statistics::Summary;
use areograph_products::{IMAGES_SHOWN, ImageProducts, SiteProducts};

/// Largest number of images drawn on the map and the sky plot besides those shown; an outline with its data has about a
/// kilobyte.
const OUTLINES: usize = 100;
/// Largest number of points of the plot over all images.
const POINTS: usize = 500;

/// The images with separate rows and plots, with their indices: all of a few.
pub(super) fn shown<'a>(site: &SiteProducts<'a>) -> Vec<(usize, &'a ImageProducts<'a>)> {
    let shown = site.shown_images().into_iter();
    shown.map(|index| (index, &site.images[index])).collect()
}

/// Whether the page shows only some of the images.
pub(super) const fn are_many(site: &SiteProducts) -> bool {
    site.images.len() > IMAGES_SHOWN
}

/// An image on the map and the sky plot.
pub(super) struct DrawnImage<'a> {
    pub(super) image: &'a ImageProducts<'a>,
    /// Whether its name is beside it.
    pub(super) is_named: bool,
}

/// The images on the map and the sky plot: those shown, by name, and so many of the others that the page stays small.
pub(super) fn drawn<'a>(site: &SiteProducts<'a>) -> Vec<DrawnImage<'a>> {
    let shown = site.shown_images();
    let is_shown = |index: &usize| shown.binary_search(index).is_ok();
    let others: Vec<usize> = (0..site.images.len())
        .filter(|index| !is_shown(index))
        .collect();
    let mut drawn = thinned(&others, OUTLINES);
    drawn.extend(&shown);
    drawn.sort_unstable();
    let drawn = drawn.into_iter().map(|index| DrawnImage {
        image: &site.images[index],
        is_named: is_shown(&index),
    });
    drawn.collect()
}

/// Images that a drawing shows; empty where it shows all.
pub(super) fn drawn_in_words(site: &SiteProducts) -> String {
    if !are_many(site) {
        return String::new();
    }
    format!(
        " Of {} images, {} are drawn; images with individual plots are named.",
        whole(site.images.len()),
        whole(drawn(site).len())
    )
}

/// A paragraph that states that rows and plots of a section are of some images only; empty where they are of all.
pub(super) fn some_of_all(site: &SiteProducts) -> Markup {
    html! {
        @if are_many(site) {
            p {
                "Rows and plots show " (IMAGES_SHOWN) " of " (whole(site.images.len())) " images, chosen under "
                (link("#exterior-orientation", "Exterior orientation")) "."
            }
        }
    }
}

/// For many images: the choice of those shown, a table and a plot over all, and links to the files of each; empty for a
/// few.
///
/// # Errors
/// A plot that cannot be drawn.
pub(super) fn overview(site: &SiteProducts) -> Result<Markup> {
    if !are_many(site) {
        return Ok(Markup::default());
    }
    let words = format!(
        "Rows and plots on this page show {} of {} images: first invalid images, then images with the largest residuals. \
         The files of every image contain the same numbers, and this section summarises all images.",
        IMAGES_SHOWN,
        whole(site.images.len())
    );
    let quantities = quantities(site);
    Ok(html! {
        p { (words) }
        (table(site, &quantities))
        div.plots { (figure(&plot(site, &quantities))?) }
        (files(site))
    })
}

/// A number of every image.
struct Quantity {
    name: &'static str,
    values: Vec<f64>,
    decimals: usize,
    /// Its place in the products of an image, if they contain it.
    place: &'static str,
}

fn quantities(site: &SiteProducts) -> Vec<Quantity> {
    let of_images = |of: fn(&ImageProducts) -> f64| site.images.iter().map(of).collect();
    let mut quantities = vec![
        Quantity {
            name: "position RMSE, m",
            values: of_images(|image| image.model.second_order.position_rmse_m()),
            decimals: 4,
            place: "orientation.json#/second_order/position_rmse_m",
        },
        Quantity {
            name: "pointing RMSE, arcsec",
            values: of_images(|image| {
                image.model.rotation_vector.rmse_rad() / RADIANS_PER_ARCSECOND
            }),
            decimals: 3,
            place: "",
        },
        Quantity {
            name: "footprints in the image",
            values: of_images(|image| {
                let profiles = image.registration.profiles.iter();
                profiles.map(|profile| f64::from(profile.inside)).sum()
            }),
            decimals: 0,
            place: "",
        },
    ];
    let ties_px = site.tie_rms_px();
    if !ties_px.is_empty() {
        quantities.push(Quantity {
            name: "tie points RMS, px",
            values: ties_px,
            decimals: 2,
            place: "",
        });
    }
    quantities
}

/// Least, median and largest number, and the image that has it.
fn table(site: &SiteProducts, quantities: &[Quantity]) -> Markup {
    let mut table = Table::new(
        "All images",
        &[
            Column::Text("quantity"),
            Column::Number("least"),
            Column::Number("median"),
            Column::Number("largest"),
            Column::Text("image with the largest"),
        ],
    );
    for of in quantities {
        let found = Summary::of(&of.values);
        let values = of.values.iter().enumerate();
        let largest = values.max_by(|one, other| one.1.total_cmp(other.1));
        let Some(image) = largest.and_then(|(index, _)| site.images.get(index)) else {
            continue;
        };
        let id = &image.times.id;
        let text = label(found.max, of.decimals);
        let largest = match of.place {
            "" => Cell::from(text),
            place => Cell::from(text).traced(format!("images/{id}/{place}")),
        };
        table.row(
            true,
            [
                of.name.into(),
                label(found.min, of.decimals).into(),
                label(found.median, of.decimals).into(),
                largest,
                id.into(),
            ],
        );
    }
    let invalid = site.images.iter();
    let invalid = invalid.filter(|image| !image.invalid_because().is_empty());
    let words = match invalid.count() {
        0 => "All images are valid.".to_owned(),
        count => format!(
            "Invalid images: {} of {}.",
            whole(count),
            whole(site.images.len())
        ),
    };
    html! { (table.finish()) p { (words) } }
}

/// The quantities over the number of the image.
fn plot(site: &SiteProducts, quantities: &[Quantity]) -> Plot {
    let shown = site.shown_images();
    let panels = quantities.iter().map(|of| {
        let at = |index: usize| (index as f64 + 1.0, of.values[index]);
        let all: Vec<(f64, f64)> = (0..of.values.len()).map(at).collect();
        let own = shown.iter().map(|index| at(*index)).collect();
        let series = vec![
            Series::line("all images", GREY, thinned(&all, POINTS)),
            Series {
                label: "images with individual plots".to_owned(),
                style: Style::Crosses,
                colour: 0,
                points: own,
            },
        ];
        Panel {
            height: 250,
            ..Panel::of(of.name, series)
        }
    });
    let mut words = "All images of the site, in the order of the configuration.".to_owned();
    if site.images.len() > POINTS {
        words += &format!(
            " The line shows 1 in {}.",
            site.images.len().div_ceil(POINTS)
        );
    }
    Plot::of(
        "All images of the site".to_owned(),
        words,
        "number of the image",
        panels.collect(),
    )
}

/// Links to the file of every image.
fn files(site: &SiteProducts) -> Markup {
    let ids = site.images.iter().map(|image| &image.times.id);
    let words = "Samples, polynomials and residuals of each image; registration.json contains the footprints:";
    let files = html! {
        p {
            (words)
            @for (place, id) in ids.enumerate() {
                @if place > 0 { "," } " " (link(&format!("../images/{id}/orientation.json"), id))
            }
            "."
        }
    };
    folded("Files of all images", &files)
}
