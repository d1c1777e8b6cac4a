//! A page to explore a site (`report/explore.html`): map, images, profiles and their values, linked to each other.
//!
//! The page is one file with its script (Leaflet 1.9.4 and the files in `page/`), its style and its values. It loads only the
//! pictures in `report/explore`, as images, because a page that is opened from a folder cannot read other files.

mod columns;
mod data;
mod frame;
mod html;
mod layers;
mod pictures;
mod terrain;

use std::path::PathBuf;

use maud::{Markup, html};
use rayon::prelude::*;

use self::{columns::has_places, layers::layers};
use super::Capability;
use crate::{
    error::{Locate as _, Result},
    products::{
        Content, Context, Declaration, Product, Role, Write, Written, error::ProductError,
        read_bytes, write_bytes,
    },
    report::{Section, parts::link},
};

pub(super) static CAPABILITY: Capability = Capability {
    products: &[&PAGE, &PICTURE],
    section: SECTION,
    judge: None,
    count: None,
};

/// The page below the folder of a site, and the folder of its pictures.
const PATH: &str = "report/explore.html";
const FOLDER: &str = "report/explore";

static PAGE: Declaration = Declaration {
    path: PATH,
    what: "map, images and profiles to explore in a browser, with values of footprints and tie points; reads nothing from a network",
    readers: "people",
    rows: "footprints",
    role: Role::Overview,
    content: Content::Foreign,
    write: Write::Where {
        sites: "a site with footprints or images",
        has: has_places,
        write: |path, of| {
            let (page, footprints) = html::page(of.site)?;
            write_read_back(path, page.as_bytes())?;
            Ok(footprints)
        },
    },
    uses: &[],
};

static PICTURE: Declaration = Declaration {
    path: "report/explore/<picture>.png",
    what: "a picture of report/explore.html: shaded ground, an orthoimage or an image, or a tile of these at full resolution",
    readers: "report/explore.html",
    rows: "",
    role: Role::Overview,
    content: Content::Foreign,
    write: Write::Many {
        files: "every picture of report/explore.html",
        write: write_pictures,
    },
    uses: &[],
};

const SECTION: Section = Section {
    title: "Explore",
    anchor: "explore",
    checks: &[],
    appears: has_places,
    write: |_| Ok(paragraph()),
};

fn paragraph() -> Markup {
    html! {
        p {
            (link("explore.html", "explore.html")) " shows this site on a map, in its images and along its profiles. It gives \
             the values of every footprint and tie point, zooms to the pixels of the images and compares two pictures of the \
             ground."
        }
    }
}

fn write_read_back(path: &std::path::Path, bytes: &[u8]) -> Result<()> {
    write_bytes(path, bytes)?;
    if read_bytes(path)? == bytes {
        return Ok(());
    }
    let what = format!("{} bytes of a page to explore", bytes.len());
    Err(ProductError::ReadBack { what }).in_file(path)
}

/// Writes the pictures of all layers.
fn write_pictures(of: &Context) -> Result<Vec<Written>> {
    if !has_places(of.site) {
        return Ok(Vec::new());
    }
    let layers = layers(of.site)?;
    let parts = layers
        .iter()
        .flat_map(|layer| layer.parts().into_iter().map(move |part| (layer, part)));
    let parts: Vec<_> = parts.collect();
    let written = parts.par_iter().map(|(layer, part)| {
        let path = PathBuf::from(FOLDER).join(&part.file);
        write_read_back(&of.directory.join(&path), &layer.png(part)?)?;
        Ok((Product { path, rows: 0 }, &PICTURE))
    });
    written.collect()
}
