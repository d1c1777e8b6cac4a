//! The pictures of a net on its page: a table, their mosaic, and offsets between them.

use super::{
    grey::{grey, stretched},
    html::{Cell, Column, Markup, Table, folded, html, link, paragraph},
    numbers::{signed, whole},
    overlays::picture_of,
    plots::label,
};
use areograph_base::{error::Result, units::METRES_PER_KM};
use areograph_stages::{map_pictures::PicturesOnMap, triangulate::Triangulation};

/// Number of pictures listed.
const PICTURES: usize = 100;

/// A table of the pictures.
pub(super) fn pictures(net: &Triangulation) -> Markup {
    let mut table = Table::new(
        "Pictures; full list in pictures.csv",
        &[
            Column::Text("picture"),
            Column::Text("brick"),
            Column::Number("metres per unit"),
            Column::Number("angle, °"),
            Column::Number("X, km"),
            Column::Number("Y, km"),
            Column::Number("±, m"),
            Column::Number("ties"),
            Column::Number("rms, m"),
            Column::Number("floor, m"),
        ],
    );
    for of in net.pictures.iter().take(PICTURES) {
        let [x, y] = of.centre_m.map(|of| of / METRES_PER_KM);
        let cells: [Cell; 10] = [
            (&of.picture).into(),
            (&of.brick).into(),
            label(of.coefficients[0].hypot(of.coefficients[1]), 4).into(),
            label(of.angle_rad.to_degrees(), 3).into(),
            label(x, 3).into(),
            label(y, 3).into(),
            of.sigma_m
                .map_or_else(String::new, |sigma_m| label(sigma_m, 1))
                .into(),
            of.ties.to_string().into(),
            label(of.deviation_rms_m, 1).into(),
            label(of.projection_floor_m, 2).into(),
        ];
        table.row(true, cells);
    }
    table.finish()
}

/// The mosaic, its pictures, and their offsets.
///
/// # Errors
/// A picture that the library rejects, which is a bug in areograph.
pub(super) fn mosaic(made: Option<&PicturesOnMap>) -> Result<Markup> {
    let Some(made) = made else {
        return Ok(paragraph(
            "No picture has an image: the tables of pictures name none in the column image.",
        ));
    };
    let account = &made.mosaic.account;
    let look = &account.look;
    let pixels = grey(&look.brightness, stretched(&look.brightness));
    let picture = picture_of(&pixels, look.size, "Mosaic of the pictures, north up")?;
    let name = |picture: usize| &*made.pictures[picture].picture;
    let mut pictures = Table::new(
        "Pictures of the mosaic",
        &[
            Column::Number("number"),
            Column::Text("picture"),
            Column::Number("pixel, m"),
            Column::Number("cells"),
            Column::Number("gain"),
            Column::Number("offset"),
        ],
    );
    for (index, of) in account.images.iter().enumerate() {
        let cells: [Cell; 6] = [
            (index + 1).to_string().into(),
            name(of.image).into(),
            label(made.pictures[of.image].pixel_m, 1).into(),
            whole(of.cells).into(),
            label(of.tone[0], 3).into(),
            signed(of.tone[1], 1).into(),
        ];
        pictures.row(true, cells);
    }
    let mut pairs = Table::new(
        "Offsets between pictures after the adjustment",
        &[
            Column::Text("pictures"),
            Column::Number("compared squares"),
            Column::Number("matching"),
            Column::Number("rms, m"),
            Column::Number("rms, cells"),
            Column::Number("median: east, north, m"),
        ],
    );
    for of in &made.offsets {
        let median = of.summaries_m().map(|of| signed(of.median, 1)).join(", ");
        let rms = |scale: f64, decimals: usize| {
            let rms_m = of.rms_m();
            rms_m.map_or_else(|| "–".to_owned(), |rms_m| label(rms_m / scale, decimals))
        };
        let is_known = !of.places.is_empty();
        let cells: [Cell; 6] = [
            of.images.map(name).join(", ").into(),
            whole(of.squares).into(),
            of.places.len().to_string().into(),
            rms(1.0, 1).into(),
            rms(account.cell_m, 2).into(),
            if is_known {
                median.into()
            } else {
                "–".into()
            },
        ];
        pairs.row(is_known, cells);
    }
    Ok(html! {
        p {
            "Each cell of " (label(account.cell_m, 1)) " m is taken from one picture, by the adjusted similarity transformation of that picture. Seams follow the ground on which overlapping pictures differ \
             least, and a gain and an offset for each picture balance the tones. The pictures have no positions before the adjustment, so \
             that there is no uncontrolled mosaic. Squares of one picture are searched in the other by cross-correlation; no offset takes part in another product. Files: "
            (link("../mosaic.tif", "mosaic.tif")) ", " (link("../mosaic_source.tif", "mosaic_source.tif")) ", "
            (link("../mosaic.json", "mosaic.json")) "."
        }
        div.pieces.one { div { (picture) p { "Mosaic, north up" } } }
        (folded("Pictures of the mosaic, and offsets between them", &html! {
            (pictures.finish())
            @if !made.offsets.is_empty() { (pairs.finish()) }
        }))
    })
}
