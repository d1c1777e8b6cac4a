//! Orthoimages: their cells, the uncertainty of positions in them, and pictures.

use maud::{Markup, html};

use super::{
    comparison,
    products::{has_orthoimages, orthoimages},
};
use crate::{
    error::Result,
    products::SiteProducts,
    report::{
        Section,
        parts::{Cell, Column, Table, grey, label, link, picture_of, stretched, whole},
    },
    stages::{
        interpolate_shots::ShotModel,
        rectify_images::{Orthoimage, OrthoimageAccount},
    },
};

pub(super) const SECTION: Section = Section {
    title: "Orthoimages",
    anchor: "orthoimages",
    checks: &[],
    appears: has_orthoimages,
    write,
};

fn write(site: &SiteProducts) -> Result<Markup> {
    let orthoimages = orthoimages(site)?;
    let is_between_shots = site.has::<ShotModel>();
    let is_adjusted = site.adjustment().is_some();
    let altimeter = site.config.terms().altimeter;
    Ok(html! {
        (table(site, orthoimages))
        p {
            @if is_between_shots {
                "Heights are those of the ground between the shots of " (altimeter) ", because the site requests no terrain \
                 model. Cells are empty farther than 3 km from every shot, on ground that relief hides from the camera, and \
                 where pixels are missing. "
            } @else {
                "Cells are empty in wide holes of the terrain model, on ground that relief hides from the camera, and where \
                 pixels are missing. Heights in narrow holes are interpolated, which increases σ off nadir. "
            }
            "σ is the standard deviation of the horizontal position of a cell, both axes together, without the shared error. \
             It contains height errors, jitter (where the scatter of tie points shows it), and drift (orientation errors that \
             change along the image). "
            @if is_adjusted {
                "The adjustment states the σ of the shared error on each axis. Images without tie points are not rectified in an \
                 adjusted site."
            } @else {
                "Without an adjustment, drift and the σ of the error that a whole image shares follow from the usual errors of \
                 kernels (adjustment.position_sigma_m and rotation_sigma_arcsec), not those of support data; jitter is not known."
            }
        }
        (comparison::compared(site)?)
        div.pieces { @for of in orthoimages { (picture(site, &of.account)?) } }
        (comparison::mosaic(site)?)
    })
}

fn table(site: &SiteProducts, orthoimages: &[Orthoimage]) -> Markup {
    let mut table = Table::new(
        "Orthoimages",
        &[
            Column::Text("image"),
            Column::Number("cell (m)"),
            Column::Number("pixel (m)"),
            Column::Number("filled cells"),
            Column::Number("cells with missing pixels"),
            Column::Number("cells with a height in the image"),
            Column::Number("hidden cells"),
            Column::Number("interpolated cells"),
            Column::Number("σ (m)"),
            Column::Number("σ, jitter (m)"),
            Column::Number("σ, drift (m)"),
            Column::Number("σ, shared: east, north (m)"),
        ],
    );
    for (index, of) in orthoimages.iter().enumerate() {
        let of = &of.account;
        let number = |value: f64, decimals: usize, place: &str| {
            Cell::from(label(value, decimals)).traced(place)
        };
        let count = |count: u32, place: &str| Cell::from(whole(count)).traced(place);
        let (shared_m, name) = match of.image_sigma_m {
            Some(image_m) => (Some(image_m), "image_sigma_m"),
            None => (of.shared_sigma_m, "shared_sigma_m"),
        };
        let shared = shared_m.map_or_else(
            || Cell::from("not known"),
            |[east_m, north_m]| {
                Cell::from(format!("{}, {}", label(east_m, 0), label(north_m, 0)))
                    .traced(format!("/{name}/0 /{name}/1"))
            },
        );
        let of_adjustment = |value: Option<f64>, place: &str| {
            let known = value.map(|value| number(value, 2, place));
            known.unwrap_or_else(|| Cell::from("not known"))
        };
        table.row_of(
            &format!("orthoimages.json#/orthoimages/{index}"),
            true,
            [
                (*site.images[of.image].times.id).into(),
                number(of.cell_m, 2, "/cell_m"),
                number(of.pixel_m, 2, "/pixel_m"),
                count(of.filled, "/filled"),
                count(of.without_pixels, "/without_pixels"),
                count(of.terrain_cells, "/terrain_cells"),
                count(of.hidden, "/hidden"),
                count(of.interpolated, "/interpolated"),
                number(of.sigma_m, 2, "/sigma_m"),
                of_adjustment(of.jitter_m, "/jitter_m"),
                of_adjustment(of.drift_m, "/drift_m"),
                shared,
            ],
        );
    }
    table.finish()
}

/// An orthoimage, north up, with links to its files.
fn picture(site: &SiteProducts, of: &OrthoimageAccount) -> Result<Markup> {
    let id = &site.images[of.image].times.id;
    let alt = format!("Orthoimage of {id}, north up");
    let picture = picture_of(
        &grey(&of.look.brightness, stretched(&of.look.brightness)),
        of.look.size,
        &alt,
    )?;
    let [image, sigma] = ["orthoimage.tif", "orthoimage_sigma.tif"].map(|name| {
        let path = format!("../images/{id}/{name}");
        link(&path, name)
    });
    Ok(html! { div { (picture) p { (id) ": " (image) ", " (sigma) } } })
}
