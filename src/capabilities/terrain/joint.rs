//! The terrain model of several pairs, and the model with filled holes.

use std::path::Path;

use super::products::{
    ABOVE_AREOID, Band, above, has_model, reference_file, significant, write_map,
};
use crate::{
    error::Result,
    products::{Content, Context, Declaration, GeoTiff, Role, SiteProducts, Write, write_raster},
    report::parts::{Cell, Column, Table, label, signed, whole},
    stages::{
        map_surface::{Joint, Surface, SurfaceModel},
        rectify_images::bridged,
    },
    units::RADIANS_PER_DEGREE,
};
use maud::{Markup, html};

/// Sites with a filled model.
const FILLED: &str = "a site with a terrain model and `surface.filled`";

pub(super) static PAIRS: Declaration = Declaration {
    path: "surface_pairs.tif",
    what: "pairs of images that contribute to each height of the terrain model (cloud-optimised GeoTIFF): the sum of 2^bit over the \
           pairs, with the bits that surface.json states; 0 in cells without a height",
    readers: "GIS",
    rows: "cells with a height",
    role: Role::Data,
    content: Content::Foreign,
    write: Write::Where {
        sites: "a site with a terrain model from several pairs",
        has: |site| has_model(site) && !matches!(joint(site), Ok(None)),
        write: |path, of| {
            let Some(model) = significant(of.site)? else {
                return Ok(0);
            };
            let file = GeoTiff {
                grid: &model.heights,
                parallel_rad: model.parallel_rad,
                body: of.site.config.body,
                conformal: None,
                what: "contributing pairs, sum of 2^bit as in surface.json",
                unit: "",
                vertical: "",
                numbers: &model.pairs,
            };
            write_raster(path, &file)
        },
    },
    uses: &[],
};

pub(super) static FILLED_ABOVE_SPHERE: Declaration = Declaration {
    path: "surface_filled_above_sphere.tif",
    what: "the terrain model with interpolated heights in holes of up to 16 cells (cloud-optimised GeoTIFF): heights above the \
           sphere of the body's maps, metres; -32768 in cells without a height",
    readers: "GIS",
    rows: "cells with a height",
    role: Role::Data,
    content: Content::Foreign,
    write: Write::Where {
        sites: FILLED,
        has: is_filled,
        write: |path, of| {
            let band = Band {
                what: "height above the map sphere, holes filled",
                unit: "m",
            };
            write_filled(path, of, band, |model| &model.heights.heights_m)
        },
    },
    uses: &[],
};

pub(super) static FILLED_ABOVE_AREOID: Declaration = Declaration {
    path: "surface_filled_above_areoid.tif",
    what: "the same heights above the areoid, metres (cloud-optimised GeoTIFF)",
    readers: "GIS",
    rows: "cells with a height",
    role: Role::Data,
    content: Content::Foreign,
    write: Write::Where {
        sites: "a site with a terrain model, shots with areoid radii and `surface.filled`",
        has: |site| {
            let reference = reference_file(site);
            let has_areoid = reference.is_some_and(|(_, of)| of.path == ABOVE_AREOID.path);
            is_filled(site) && has_areoid
        },
        write: |path, of| {
            let Some(model) = significant(of.site)? else {
                return Ok(0);
            };
            above(path, of, "areoid", &bridged(model))
        },
    },
    uses: &[],
};

pub(super) static FILLED_SIGMAS: Declaration = Declaration {
    path: "surface_filled_sigma.tif",
    what: "standard deviations of the heights in surface_filled_above_sphere.tif about their common offset, metres; those of interpolated \
           heights contain the change of known heights over the distance to the nearest of them",
    readers: "GIS",
    rows: "cells with a height",
    role: Role::Data,
    content: Content::Foreign,
    write: Write::Where {
        sites: FILLED,
        has: is_filled,
        write: |path, of| {
            let band = Band {
                what: "standard deviation of the height about the common offset, holes filled",
                unit: "m",
            };
            write_filled(path, of, band, |model| &model.sigmas_m)
        },
    },
    uses: &[],
};

fn is_filled(site: &SiteProducts) -> bool {
    site.config.surface.filled && has_model(site)
}

fn write_filled(
    path: &Path,
    of: &Context,
    band: Band<'_>,
    numbers: fn(&SurfaceModel) -> &[f32],
) -> Result<u64> {
    let Some(model) = significant(of.site)? else {
        return Ok(0);
    };
    let model = bridged(model);
    let numbers = (band, numbers(&model));
    write_map(path, of, &model.heights, numbers, model.parallel_rad)
}

/// How the models of several pairs were joined; `None` for a single pair.
fn joint<'a>(site: &SiteProducts<'a>) -> Result<Option<&'a Joint>> {
    let surface = site.find::<Surface>()?;
    Ok(surface.and_then(|surface| surface.account.joint.as_ref()))
}

/// The pairs of a model, and their seams.
pub(super) fn tables(site: &SiteProducts, joint: &Joint, altimeter: &str) -> Markup {
    let mut pairs = Table::new(
        "Pairs of the terrain model",
        &[
            Column::Text("images"),
            Column::Number("with a height"),
            Column::Number("convergence (°)"),
            Column::Number("σ of a cell (m)"),
            Column::Number("offset (m)"),
            Column::Number("σ (m)"),
        ],
    );
    let name = |index: usize| {
        let images = joint.pairs[index].images;
        let [first, second] = images.map(|image| &site.images[image].times.id);
        format!("{first}, {second}")
    };
    let of =
        |value: f64, decimals: usize, place: &str| Cell::from(label(value, decimals)).traced(place);
    for (index, pair) in joint.pairs.iter().enumerate() {
        let source = format!("surface.json#/joint/pairs/{index}");
        if pair.bit.is_none() {
            let empty = || Cell::from("–");
            let cells = [
                name(index).into(),
                "no model".into(),
                empty(),
                empty(),
                empty(),
                empty(),
            ];
            pairs.row_of(&source, false, cells);
            continue;
        }
        let cells = [
            name(index).into(),
            Cell::from(whole(pair.filled)).traced("/filled"),
            of(
                pair.convergence_rad / RADIANS_PER_DEGREE,
                1,
                "/convergence_deg",
            ),
            of(pair.sigma_m, 2, "/sigma_m"),
            Cell::from(signed(pair.offset_m, 2)).traced("/offset_m"),
            of(pair.offset_sigma_m, 2, "/offset_sigma_m"),
        ];
        pairs.row_of(&source, true, cells);
    }
    let mut seams = Table::new(
        "Seams: heights of the first pair minus those of the second",
        &[
            Column::Text("first pair"),
            Column::Text("second pair"),
            Column::Number("cells"),
            Column::Number("before (m)"),
            Column::Number("after (m)"),
            Column::Number("σ (m)"),
            Column::Number("spread (σ)"),
        ],
    );
    for (index, seam) in joint.seams.iter().enumerate() {
        let cells = [
            name(seam.pairs[0]).into(),
            name(seam.pairs[1]).into(),
            Cell::from(whole(seam.cells)).traced("/cells"),
            Cell::from(signed(seam.before_m, 2)).traced("/before_m"),
            Cell::from(signed(seam.after_m, 2)).traced("/after_m"),
            of(seam.sigma_m, 2, "/sigma_m"),
            of(seam.spread_sigmas, 2, "/spread_sigmas"),
        ];
        seams.row_of(&format!("surface.json#/joint/seams/{index}"), true, cells);
    }
    html! {
        (pairs.finish())
        p {
            "An offset is the level of a pair above the mean level of all pairs. Least squares determine the offsets from \
             the overlaps and from " (altimeter) "; they were subtracted. The mean level remains that of the adjustment."
        }
        @if joint.seams.is_empty() { p { "No two pairs overlap." } } @else { (seams.finish()) }
    }
}
