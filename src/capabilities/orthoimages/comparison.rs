//! Orthoimages against each other, and their mosaic, on the page.

use maud::{Markup, html};

use super::{
    mosaic,
    products::{self, Offsets, Pair, offsets},
};
use crate::{
    error::Result,
    products::SiteProducts,
    report::{
        self,
        parts::{Cell, Column, Table, grey, label, link, picture_of, signed, stretched, whole},
    },
    stage::Round,
    stages::mosaic_images::{MosaicAccount, MosaicDetail},
    style::IMAGE_COLOURS,
    units::METRES_PER_KM,
};

/// Indices of colours of offsets before and after.
const BEFORE: usize = 1;
const AFTER: usize = 0;
/// Rows at the upper and lower edge of a detail on which the images are marked.
const MARKED: usize = 8;

/// Offsets of every pair: a sentence, a table and a map; empty without overlapping orthoimages.
pub(super) fn compared(site: &SiteProducts) -> Result<Markup> {
    let pairs = products::pairs(site)?;
    if pairs.is_empty() {
        return Ok(Markup::default());
    }
    Ok(html! {
        p {
            @for pair in &pairs { (sentence(pair)) " " }
            "Squares of the first orthoimage are searched in the second by cross-correlation on an even grid; no offset takes part \
             in another product. "
            @if pairs.iter().any(|pair| pair.places_in_both.is_some_and(|places| places > 0)) {
                "Offsets before and after the adjustment are over the squares that match in both. "
            }
            "Every place: " (link("../orthoimage_offsets.csv", "orthoimage_offsets.csv")) "."
        }
        (table(&pairs))
        div.plots { (arrows(site)?) }
    })
}

/// The offsets of a pair in words.
fn sentence(pair: &Pair<'_>) -> String {
    let [one, other] = pair.images;
    let of = |of: &Option<Offsets>| {
        let of = of.as_ref()?;
        let cells = label(of.rms_cells?, 2);
        let places = whole(
            pair.places_in_both
                .filter(|of| *of > 0)
                .unwrap_or(of.places),
        );
        Some(format!(
            "{cells} cells ({} m, {places} places)",
            label(of.rms_m?, 1),
        ))
    };
    let both = format!("The orthoimages of {one} and {other} differ by");
    match (of(&pair.before), of(&pair.after)) {
        (Some(before), Some(after)) => {
            format!(
                "{both} {before} before the adjustment and by {after} after it, root mean square."
            )
        }
        (Some(before), None) => {
            format!("{both} {before} with the orientation from the kernels, root mean square.")
        }
        (None, Some(after)) => format!("{both} {after} after the adjustment, root mean square."),
        (None, None) => format!("No square of the orthoimages of {one} and {other} matches."),
    }
}

fn table(pairs: &[Pair<'_>]) -> Markup {
    let mut table = Table::new(
        "Offsets between orthoimages",
        &[
            Column::Text("images"),
            Column::Text("orientation"),
            Column::Number("compared squares"),
            Column::Number("matching"),
            Column::Number("matching in both"),
            Column::Number("rms (m)"),
            Column::Number("rms (cells)"),
            Column::Number("median: east, north (m)"),
            Column::Number("σ: east, north (m)"),
        ],
    );
    for (index, pair) in pairs.iter().enumerate() {
        let before = if pair.after.is_some() {
            "before the adjustment"
        } else {
            "from the kernels"
        };
        let states = [
            ("before", before, &pair.before),
            ("after", "after the adjustment", &pair.after),
        ];
        let in_both = || {
            let known = pair.places_in_both.map(whole).map(Cell::from);
            let place = format!("orthoimages.json#/pairs/{index}/places_in_both");
            known.map_or_else(|| Cell::from("–"), |of| of.traced(&place))
        };
        for (name, words, of) in states {
            let Some(of) = of else { continue };
            let optional = |value: Option<f64>, place: &str| {
                let known = value.map(|value| Cell::from(label(value, 2)).traced(place));
                known.unwrap_or_else(|| Cell::from("not known"))
            };
            let two = |[east, north]: [f64; 2], form: fn(f64, usize) -> String, place: &str| {
                let places = format!("{place}/0 {place}/1");
                Cell::from(format!("{}, {}", form(east, 2), form(north, 2))).traced(&places)
            };
            table.row_of(
                &format!("orthoimages.json#/pairs/{index}/{name}"),
                true,
                [
                    pair.images.join(", ").into(),
                    words.into(),
                    Cell::from(whole(of.squares)).traced("/squares"),
                    Cell::from(whole(of.places)).traced("/places"),
                    in_both(),
                    optional(of.rms_m, "/rms_m"),
                    optional(of.rms_cells, "/rms_cells"),
                    two(of.median_m, signed, "/median_m"),
                    two(of.sigma_m, label, "/sigma_m"),
                ],
            );
        }
    }
    table.finish()
}

/// Offsets of all pairs on a map.
fn arrows(site: &SiteProducts) -> Result<Markup> {
    let [before, after] = [Round::Initial, Round::Adjusted].map(|round| offsets(site, round));
    let kinds = [("before", BEFORE, before?), ("after", AFTER, after?)];
    let places = || {
        kinds
            .iter()
            .flat_map(|(.., pairs)| *pairs)
            .flat_map(|pair| &pair.places)
    };
    let count = places().count() as f64;
    if count == 0.0 {
        return Ok(Markup::default());
    }
    let middle_rad = [0, 1].map(|axis| places().map(|of| of.place_rad[axis]).sum::<f64>() / count);
    let radius_m = site.config.body.map().radius_m;
    let place_m = |[longitude_rad, latitude_rad]: [f64; 2]| {
        let east_rad = (longitude_rad - middle_rad[0]) * middle_rad[1].cos();
        [
            east_rad * radius_m,
            (latitude_rad - middle_rad[1]) * radius_m,
        ]
    };
    let kinds = kinds.iter().filter_map(|(name, colour, pairs)| {
        let places = pairs.iter().flat_map(|pair| &pair.places);
        let each = places.map(|of| [place_m(of.place_rad), of.offset_m]);
        let each: Vec<_> = each.collect();
        (!each.is_empty()).then_some(report::Offsets {
            label: name,
            colour: *colour,
            each,
        })
    });
    report::offset_arrows(
        "Offsets between orthoimages".to_owned(),
        "Position of the ground in the second orthoimage minus that in the first. Axes: distance from the middle.",
        &kinds.collect::<Vec<_>>(),
    )
}

/// The mosaic, before the adjustment too if it was requested; empty without one.
pub(super) fn mosaic(site: &SiteProducts) -> Result<Markup> {
    let Some(best) = mosaic::best(site)? else {
        return Ok(Markup::default());
    };
    let before = mosaic::before(site)?;
    let after = if before.is_some() {
        " after the adjustment"
    } else {
        ""
    };
    let before = before.map(|of| (" before the adjustment", "mosaic_before", &of.account));
    let [seams_before, seams_after] = mosaic::seams(site)?;
    let seams = [
        (" before the adjustment", &seams_before),
        (after, &seams_after),
    ];
    let states = before.into_iter().chain([(after, "mosaic", &best.account)]);
    let states: Vec<(&str, &str, &MosaicAccount)> = states.collect();
    let look = &best.account.look;
    let whole = picture_of(
        &grey(&look.brightness, stretched(&look.brightness)),
        look.size,
        "Mosaic, north up",
    )?;
    Ok(html! {
        h3 { "Mosaic" }
        p {
            "Each cell is taken from one image. Seams follow the ground on which overlapping images differ least. "
            @if site.config.surface.mosaic_balance {
                "A gain and an offset for each image balance the tones. "
            }
            @for (state, seams) in seams { @for seam in seams { (of_seam(state, seam)) " " } }
        }
        div.pieces {
            @for (state, name, of) in &states { (detail(site, state, name, of)?) }
            div { (whole) p { "Mosaic" (after) ", north up" } }
        }
    })
}

/// The offsets along a seam in words.
fn of_seam(state: &str, seam: &mosaic::Seam<'_>) -> String {
    let [one, other] = seam.images;
    format!(
        "At the seam of {one} and {other}, the images differ by {} m{state} (root mean square, {} places).",
        label(seam.rms_m, 1),
        whole(seam.places)
    )
}

/// A detail at a seam, with links to the files of the mosaic.
fn detail(site: &SiteProducts, state: &str, name: &str, account: &MosaicAccount) -> Result<Markup> {
    let [image, sources] = ["", "_source"].map(|end| {
        let file = format!("{name}{end}.tif");
        link(&format!("../{file}"), &file)
    });
    let files = html! { "Mosaic" (state) ": " (image) "; image of each cell: " (sources) "." };
    let Some(of) = &account.detail else {
        return Ok(html! { div { p { (files) " It has no seam." } } });
    };
    let width_km = of.size[1] as f64 * account.cell_m / METRES_PER_KM;
    let alt = format!("Mosaic{state}, detail at a seam, north up");
    let picture = picture_of(&marked(of), of.size, &alt)?;
    let edges = numbers(of).map(|at| {
        let id = &site.images[account.images[at].image].times.id;
        format!("{}: {id}", IMAGE_COLOURS[at % IMAGE_COLOURS.len()].0)
    });
    let edges: Vec<String> = edges.collect();
    Ok(html! {
        div {
            (picture)
            p {
                (files) " The detail is " (label(width_km, 1)) " km wide; colours at its upper and lower edge identify the image ("
                (edges.join(", ")) ")."
            }
        }
    })
}

/// Indices of the images of a detail, in the order of the mosaic.
fn numbers(detail: &MosaicDetail) -> impl Iterator<Item = usize> {
    let has = |number: u8| detail.sources.contains(&number);
    (1..=u8::MAX)
        .filter(move |number| has(*number))
        .map(|number| usize::from(number) - 1)
}

/// A detail in grey, its images in colours at the upper and lower edge.
fn marked(detail: &MosaicDetail) -> Vec<u8> {
    let [rows, columns] = detail.size;
    let mut pixels = grey(&detail.brightness, stretched(&detail.brightness));
    for (at, pixel) in pixels.chunks_exact_mut(4).enumerate() {
        let row = at / columns.max(1);
        let source = detail.sources[at];
        if source > 0 && (row < MARKED || row + MARKED >= rows) {
            let (_, colour) = IMAGE_COLOURS[usize::from(source - 1) % IMAGE_COLOURS.len()];
            pixel[..3].copy_from_slice(&colour);
        }
    }
    pixels
}
