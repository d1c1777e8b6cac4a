//! The page: its parts for readers, its style, its script and its values.

use base64::{Engine as _, engine::general_purpose::STANDARD};
use maud::{DOCTYPE, Markup, PreEscaped, html};
use sha2::{Digest as _, Sha256};

use super::data::Data;
use crate::{
    error::Result,
    products::{SiteProducts, error::ProductError},
    report::{
        STYLE,
        parts::{globe, window_outlines},
    },
};

/// Leaflet 1.9.4 as published, and its licence, which every copy must contain.
const LEAFLET: &str = include_str!("leaflet/leaflet.js");
const LEAFLET_STYLE: &str = include_str!("leaflet/leaflet.css");
const LEAFLET_LICENCE: &str = include_str!("../../../licences/leaflet.txt");
const OWN_STYLE: &str = include_str!("page/explore.css");
/// Files of the script, in order.
const SCRIPTS: [&str; 6] = [
    include_str!("page/values.js"),
    include_str!("page/layers.js"),
    include_str!("page/map.js"),
    include_str!("page/strip.js"),
    include_str!("page/profile.js"),
    include_str!("page/explore.js"),
];

/// The page, and the number of footprints on it.
///
/// # Errors
/// An output that cannot be read; a picture that the library rejects.
pub(super) fn page(site: &SiteProducts) -> Result<(String, u64)> {
    let data = Data::of(site)?;
    let footprints = data.footprints.count as u64;
    let values = serde_json::to_string(&data).map_err(ProductError::refused("encode JSON"))?;
    // The end of a script element within a text would end the values.
    let values = values.replace('<', "\\u003c");
    let script = script();
    let hash = STANDARD.encode(Sha256::digest(script.as_bytes()));
    let policy = format!(
        "default-src 'none'; script-src 'sha256-{hash}'; style-src 'unsafe-inline'; img-src 'self' file: data:"
    );
    let title = format!("{}: explore", site.config.site);
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta http-equiv="Content-Security-Policy" content=(policy);
                meta name="viewport" content="width=device-width, initial-scale=1";
                title { (title) }
                style { (PreEscaped(STYLE)) (PreEscaped(LEAFLET_STYLE)) (PreEscaped(OWN_STYLE)) }
            }
            body.explore {
                (body(site, &globe(site.config.body, data.map.middle_rad())?))
                script type="application/json" id="values" { (PreEscaped(values)) }
                (PreEscaped(format!("<!--\nLeaflet 1.9.4\n{LEAFLET_LICENCE}-->\n")))
                script { (PreEscaped(script)) }
            }
        }
    };
    Ok((page.into_string(), footprints))
}

/// The script of the page.
fn script() -> String {
    // The map of Leaflet's source is not part of the page.
    let leaflet = LEAFLET
        .split("//# sourceMappingURL")
        .next()
        .unwrap_or_default();
    format!(
        "{leaflet}\n(() => {{\n'use strict';\n{}}})();\n",
        SCRIPTS.concat()
    )
}

fn body(site: &SiteProducts, globe: &Markup) -> Markup {
    let has_adjustment = site.adjustment().is_some();
    let has_windows = !window_outlines(site).is_empty();
    html! {
        header.opening {
            div {
                h1 { (site.config.site) }
                p.about {
                    a href="index.html" { "Report of the site" }
                    " · " a href="#keys" { "Keys" }
                }
            }
            (globe)
            noscript { p.verdict.remarks { "This page needs scripts, which this browser or this server does not run. \
                Open report/explore.html from the folder of the products." } }
        }
        main {
            section.map-part aria-labelledby="map-title" {
                div.bar {
                    h2 id="map-title" { "Map" }
                    label { "left " select id="left" {} }
                    label { "right " select id="right" {} }
                }
                div.stage {
                    div id="map" role="application" aria-label="Map of the site" {}
                    input id="swipe" type="range" min="0" max="1000" value="500" aria-label="Boundary between the left and the right picture";
                }
                div.bar { (check("relief", "relief", true)) (check("footprints", "footprints", true)) (check("outlines", "outlines of images", true))
                    @if has_windows { (check("windows", "search windows", true)) }
                    (check("ties", "tie points", false)) (check("residuals", "residuals", false))
                    span id="arrow-words" {} }
                div.ramp { span id="ramp-low" {} i id="ramp" {} span id="ramp-high" {} }
            }
            section.image-part aria-labelledby="strip-title" {
                div.bar {
                    h2 id="strip-title" { "Image" }
                    label { span.hidden { "image " } select id="image" {} }
                }
                div.stage { div id="strip" role="application" aria-label="Image with its footprints" {} }
                div.bar {
                    (check("before", "footprints by the kernels", true))
                    @if has_adjustment { (check("after", "adjusted", true)) }
                    (check("curve", "elevation profile", true)) (check("distances", "distances of footprints", false))
                    (check("measured", "tie points", false))
                }
                p.note id="strip-words" {}
            }
            section.profile-part aria-labelledby="profile-title" {
                div.bar {
                    h2 id="profile-title" { "Profile" }
                    label { span.hidden { "profile " } select id="profile" {} }
                    button type="button" id="nearer" aria-label="Lengthen the axis of distances" { "+" }
                    button type="button" id="farther" aria-label="Shorten the axis of distances" { "−" }
                }
                canvas id="graph" tabindex="0" role="slider" aria-label="Footprint along the profile" aria-valuemin="1" aria-valuemax="1" aria-valuenow="1" {}
                p.note id="profile-words" {}
            }
            section.values-part aria-labelledby="values-title" {
                h2 id="values-title" { "Values" }
                div id="chosen" role="status" { p { "Point at a footprint or a tie point, or select one along the profile." } }
            }
        }
        section id="keys" aria-labelledby="keys-title" {
            h2 id="keys-title" { "Keys" }
            (keys())
        }
    }
}

fn check(id: &str, words: &str, is_on: bool) -> Markup {
    html! { label.check { input type="checkbox" id=(id) checked[is_on]; i.swatch {} (words) } }
}

fn keys() -> Markup {
    let keys = [
        (
            "arrow keys",
            "pan the map or the image; on the profile, go to the next footprint",
        ),
        (
            "+ and −",
            "zoom the map or the image; lengthen or shorten the profile",
        ),
        ("Home and End", "first and last footprint of the profile"),
        ("Page Up and Page Down", "ten footprints along the profile"),
        (
            "arrow keys on the boundary",
            "move the boundary between the two pictures",
        ),
    ];
    html! { dl.keys-of-page { @for (key, words) in keys { div { dt { (key) } dd { (words) } } } } }
}
