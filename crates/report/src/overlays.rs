//! Images with footprints and tie points on them: a separate page, and a section that links to it.

use std::fmt::Write as _;

use base64::{Engine as _, engine::general_purpose::STANDARD};

use super::{
    html::{self, Markup, html, link, list},
    many,
    map::relief,
    numbers::whole,
    plots::label,
    section::Section,
};
use areograph_base::error::Result;
use areograph_products::{Picture, SiteProducts, anaglyph, error::ProductError, piece, strip};
use areograph_stages::lay_overlays::{
    CHIP_EDGE, Mark, Overlays, Place, PlaceView, ShownImage, Subject,
};

/// Pixels of all complete images on the page: with the pieces, the page stays below 5 MB for any contents.
const STRIP_PIXELS: u64 = 2_300_000;

pub(super) const SECTION: Section = Section {
    title: "Images and footprints",
    anchor: "overlays",
    checks: &[],
    appears: |site| site.overlays.is_some(),
    write,
};

/// Contents of the other page, and the position of each image on it.
fn write(site: &SiteProducts) -> Result<Markup> {
    let Some(overlays) = site.overlays else {
        return Ok(Markup::default());
    };
    let words = format!(
        "{} with footprints and tie points marked on the pixels, before and after the adjustment, and {} on the \
         ground as pairs of images show them: ",
        html::counted(overlays.images.len(), "image"),
        html::counted(overlays.places.len(), "place"),
    );
    let own = site.shown_images();
    let images = overlays.images.iter();
    let images = images.filter(|shown| own.binary_search(&shown.image).is_ok());
    let ids = images.map(|shown| &site.images[shown.image].times.id);
    Ok(html! {
        p { (words) (link("overlays.html", "overlays.html")) "." }
        (many::some_of_all(site))
        ul {
            @for id in ids {
                li {
                    (id) ": " (link(&format!("../images/{id}/overlay.png"), "picture")) ", "
                    (link(&format!("../images/{id}/overlay.geojson"), "marks as a layer"))
                }
            }
        }
        @if let Some(place) = overlays.places.first() { (figure(site, place)?) }
    })
}

/// The page of a site whose images have pixels; `None` without any.
///
/// # Errors
/// A picture that cannot be drawn, which is a bug in areograph.
pub fn overlays_page(site: &SiteProducts) -> Result<Option<String>> {
    let Some(overlays) = site.overlays else {
        return Ok(None);
    };
    let is_tie = |place: &&Place| matches!(place.subject, Subject::Tie { .. });
    let figures =
        |places: Vec<&Place>| Result::Ok(html! { @for place in places { (figure(site, place)?) } });
    let (ties, footprints): (Vec<&Place>, Vec<&Place>) = overlays.places.iter().partition(is_tie);
    let sections = [
        html::Section::new("Images", images(site, overlays)?),
        html::Section::new("Footprints", figures(footprints)?),
        html::Section::new("Tie points", figures(ties)?),
    ];
    let title = format!("{}: images and footprints", site.config.site);
    Ok(Some(html::page(&title, &lead(site), &sections)))
}

fn lead(site: &SiteProducts) -> Markup {
    let mut keys = vec!["blue circle: the point computed with the orientation from the kernels"];
    if site.adjustment().is_some() {
        keys.push("orange upright cross: the point computed with the adjusted orientation");
        keys.push("yellow diagonal cross: a measured tie point");
    } else if site.geometric.is_some() {
        keys.push("yellow diagonal cross: a measured tie point");
    }
    html! {
        p.about { (link("index.html", "Report of the site")) }
        (list(&keys))
        p {
            "Numbers count the shots of a profile, from 1. The middle of each mark is open. Image patches show the \
             same ground at the same position, north up; dark violet marks areas beyond the image or without data. In \
             composites of two images, the first is red and the second cyan, so that coincident ground is grey."
        }
    }
}

fn images(site: &SiteProducts, overlays: &Overlays) -> Result<Markup> {
    let each = STRIP_PIXELS / overlays.images.len().max(1) as u64;
    Ok(html! {
        div.strips {
            @for shown in &overlays.images {
                @if let Some(picture) = strip(site, shown.image, each)? { (strip_figure(site, shown, &picture)) }
            }
        }
    })
}

fn strip_figure(site: &SiteProducts, shown: &ShownImage, picture: &Picture) -> Markup {
    let image = &site.images[shown.image];
    let id = &image.times.id;
    let inside = image.registration.points.inside_count();
    let mut words = format!(
        "{id}, {} lines of {} samples; one pixel of the picture is {} × {} pixels of the image; line 0 is at the top. \
         {} inside according to the kernels",
        whole(image.times.line_times.lines()),
        whole(image.times.samples),
        picture.reduction,
        picture.reduction,
        html::counted(inside, "footprint"),
    );
    if picture.step > 1 {
        let _infallible = write!(words, "; 1 in {} is marked", picture.step);
    }
    words.push('.');
    let look = &shown.quick_look;
    for (lines, what) in [
        (look.lines_missing, "missing"),
        (look.lines_suspect, "damaged or of uncertain position"),
    ] {
        if lines > 0 {
            let _infallible = write!(words, " {} {what}.", html::counted(lines as usize, "line"));
        }
    }
    let alt = format!("{id} with its footprints");
    html! {
        figure {
            div.strip tabindex="0" role="region" aria-label=(alt) { (img(picture, &alt)) }
            figcaption { (words) }
        }
    }
}

/// A place in its images, side by side and superposed.
fn figure(site: &SiteProducts, place: &Place) -> Result<Markup> {
    let id = |view: &PlaceView| &*site.images[view.image].times.id;
    let title = title(site, &place.subject);
    let mut cells = Vec::new();
    for view in &place.views {
        if let Some(chip) = view.chips.last() {
            let alt = format!("{title} in {}", id(view));
            cells.push((img(&piece(chip)?, &alt), id(view).to_owned()));
        }
    }
    if let [one, other] = &place.views[..] {
        for ((centre, first), second) in place.centres.iter().zip(&one.chips).zip(&other.chips) {
            let state = match centre {
                Mark::Before => "both, before the adjustment",
                Mark::After => "both, after the adjustment",
                Mark::Measured => "both, as measured",
            };
            let alt = format!(
                "{title} in {} (red) and {} (cyan), {state}",
                id(one),
                id(other)
            );
            cells.push((img(&anaglyph(first, second)?, &alt), state.to_owned()));
        }
    }
    Ok(html! {
        figure.place #(html::slug(&title)) {
            h3 { (title) }
            div.pieces { @for (img, words) in cells { div { (img) p { (words) } } } }
            figcaption { (caption(site, place)) }
        }
    })
}

fn title(site: &SiteProducts, subject: &Subject) -> String {
    match subject {
        Subject::Footprint {
            profile, number, ..
        } => format!(
            "Footprint {number} of profile {}",
            site.profiles[*profile].id
        ),
        Subject::Tie {
            id, is_rejected, ..
        } => {
            let rejected = if *is_rejected { ", rejected" } else { "" };
            format!("Tie point {id}{rejected}")
        }
    }
}

fn caption(site: &SiteProducts, place: &Place) -> String {
    let edge_m = place.pixel_m * CHIP_EDGE as f64;
    let mut words = match &place.subject {
        Subject::Footprint { row, .. } => format!("Row {row} of footprints.parquet. "),
        Subject::Tie { why, .. } => format!("Reason: {why}. "),
    };
    let _infallible = write!(
        words,
        "{} m per pixel, {} m from edge to edge.",
        label(place.pixel_m, 1),
        label(edge_m, 0)
    );
    let moved = place.views.iter().filter_map(|view| {
        let id = &site.images[view.image].times.id;
        Some(format!("by {} m in {id}", label(view.moved_m?, 1)))
    });
    let moved: Vec<String> = moved.collect();
    if !moved.is_empty() {
        let _infallible = write!(
            words,
            " The adjustment moved the point {}.",
            moved.join(", ")
        );
    }
    words
}

/// A picture of `size` rows and columns inside the page; `pixels` have four bytes, the last of them the opacity.
///
/// # Errors
/// A picture that the library rejects, which is a bug in areograph.
pub fn picture_of(pixels: &[u8], [rows, columns]: [usize; 2], alt: &str) -> Result<Markup> {
    let size = |of: usize| u32::try_from(of).unwrap_or(u32::MAX);
    let png = relief::png(pixels, size(columns), size(rows))
        .map_err(ProductError::refused("draw a picture"))?;
    let picture = Picture {
        width: size(columns),
        height: size(rows),
        reduction: 1,
        step: 1,
        png,
    };
    Ok(img(&picture, alt))
}

/// A picture inside the page.
fn img(picture: &Picture, alt: &str) -> Markup {
    let png = STANDARD.encode(&picture.png);
    html! {
        img src={ "data:image/png;base64," (png) } width=(picture.width) height=(picture.height) alt=(alt);
    }
}
