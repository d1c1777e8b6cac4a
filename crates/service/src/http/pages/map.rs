//! Maps of the sites, one of each body: from 0° to 360° E, equidistant cylindrical, Mars over its relief.

use maud::{Markup, html};

use super::{layout::RELIEF_PATH, parts::tone};
use areograph_base::body::Body;

use crate::{database::shown::Site, words::counted};

/// Units of the picture per degree.
const SCALE: f64 = 2.0;
/// Space for the labels of parallels and meridians.
const LEFT: f64 = 64.0;
const TOP: f64 = 10.0;
const RIGHT: f64 = 22.0;
/// Smallest drawn size of a window.
const LEAST: f64 = 9.0;
/// Largest number of names without overlaps.
const NAMES: usize = 30;
/// Width of a letter and height of a line of the names.
const LETTER: f64 = 9.0;
const LINE: f64 = 18.0;

/// A map of each body with sites, that of Mars even without any.
pub(super) fn maps(sites: &[Site]) -> Markup {
    let placed = |body: Body| -> Vec<(&Site, [f64; 4])> {
        let on_it = sites.iter().filter(|site| site.body == body);
        on_it
            .filter_map(|site| Some((site, site.bounds_deg?)))
            .collect()
    };
    let others = sites.iter().filter(|site| site.bounds_deg.is_none());
    let has_others = others.count() > 0;
    html! {
        @for (_, body) in Body::WORDS {
            @let placed = placed(body);
            @if body == Body::Mars || !placed.is_empty() { (map(body, &placed)) }
        }
        @if has_others { p { "The windows of the other sites are not known yet." } }
    }
}

/// The map of a body, and its description.
fn map(body: Body, placed: &[(&Site, [f64; 4])]) -> Markup {
    let (width, height) = (360.0 * SCALE, 180.0 * SCALE);
    let names = names(placed, width);
    html! {
        figure class="map" {
            svg viewBox={ "0 0 " (LEFT + width + RIGHT) " " (TOP + height + 28.0) } role="group" aria-label={ "Map of the sites on " (body) } {
                // The picture has the layout of the map.
                @if body.relief().is_some() {
                    image href=(RELIEF_PATH) x=(LEFT) y=(TOP) width=(width) height=(height) preserveAspectRatio="none" {}
                }
                @for k in 0..=12_u32 {
                    @let longitude = f64::from(30 * k);
                    @let x = LEFT + longitude * SCALE;
                    line x1=(x) y1=(TOP) x2=(x) y2=(TOP + height) stroke="#E2E2E2" stroke-opacity="0.5" {}
                    @if k % 2 == 0 { text x=(x) y=(TOP + height + 22.0) text-anchor="middle" font-size="17" fill="#222222" { (longitude) "°" } }
                }
                @for k in 0..=6_u32 {
                    @let latitude = 90.0 - f64::from(30 * k);
                    @let y = TOP + (90.0 - latitude) * SCALE;
                    line x1=(LEFT) y1=(y) x2=(LEFT + width) y2=(y) stroke="#E2E2E2" stroke-opacity="0.5" {}
                    text x=(LEFT - 6.0) y=(y + 6.0) text-anchor="end" font-size="17" fill="#222222" { (latitude_name(latitude)) }
                }
                @for (site, bounds_deg) in placed {
                    @let waits = site.waits_for.is_some();
                    a href={ "/sites/" (site.name) }
                        aria-label={ (site.name) ": " (site.verdict.as_deref().unwrap_or("no run yet")) @if waits { ", waits" } } {
                        @for [x, y, wide, high] in rectangles(*bounds_deg) {
                            rect class={ "site " (tone(site.verdict.as_deref())) @if waits { " waits" } } x=(x) y=(y) width=(wide) height=(high) {}
                        }
                    }
                }
                @for name in &names {
                    text x=(name.x) y=(name.y) text-anchor=(name.anchor) font-size="17" fill="#222222" { (name.text) }
                }
            }
            figcaption {
                (counted(placed.len(), "site")) " with windows on " (body) "; east longitude and areocentric latitude. The colour shows the verdict."
                @if placed.iter().any(|(site, _)| site.waits_for.is_some()) { " A site with a dashed frame waits for an input." }
                @if body.relief().is_some() { " Ground: MOLA heights, shaded (MEGDR, NASA PDS)." }
            }
        }
    }
}

/// A name beside its window.
struct Name<'a> {
    text: &'a str,
    x: f64,
    y: f64,
    anchor: &'static str,
}

/// Names of the sites from north to south; one that would overlap another moves below it. Empty if there are too many.
fn names<'a>(placed: &[(&'a Site, [f64; 4])], width: f64) -> Vec<Name<'a>> {
    if placed.len() > NAMES {
        return Vec::new();
    }
    let beside = |(site, bounds_deg): &(&'a Site, [f64; 4])| {
        let [x, y, wide, high] = rectangles(*bounds_deg)[0];
        let (x, anchor) = if x + wide > LEFT + 0.8 * width {
            (x - 4.0, "end")
        } else {
            (x + wide + 4.0, "start")
        };
        Name {
            text: &site.name,
            x,
            y: y + high / 2.0 + 6.0,
            anchor,
        }
    };
    let mut names: Vec<Name> = placed.iter().map(beside).collect();
    names.sort_by(|one, other| one.y.total_cmp(&other.y));
    for index in 1..names.len() {
        let (above, below) = names.split_at_mut(index);
        let name = &mut below[0];
        for other in above {
            let wide = LETTER * other.text.len().max(name.text.len()) as f64;
            if (name.x - other.x).abs() < wide && name.y - other.y < LINE {
                name.y = other.y + LINE;
            }
        }
    }
    names
}

fn latitude_name(latitude_deg: f64) -> String {
    let side = if latitude_deg > 0.0 {
        " N"
    } else if latitude_deg < 0.0 {
        " S"
    } else {
        ""
    };
    format!("{}°{side}", latitude_deg.abs())
}

/// A window on the map as left, top, width, height; one across the prime meridian is in two parts.
fn rectangles([west, south, east, north]: [f64; 4]) -> Vec<[f64; 4]> {
    let (west, mut east) = (west.rem_euclid(360.0), east.rem_euclid(360.0));
    if east <= west {
        east += 360.0;
    }
    let spans = if east > 360.0 {
        vec![(west, 360.0), (0.0, east - 360.0)]
    } else {
        vec![(west, east)]
    };
    let high = ((north - south) * SCALE).max(LEAST);
    let middle = TOP + (90.0 - f64::midpoint(north, south)) * SCALE;
    let one = |(west, east): (f64, f64)| {
        let wide = ((east - west) * SCALE).max(LEAST);
        let x = LEFT + f64::midpoint(west, east) * SCALE - wide / 2.0;
        [x, middle - high / 2.0, wide, high]
    };
    spans.into_iter().map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_window_across_the_prime_meridian_lies_at_both_edges() {
        let parts = rectangles([350.0, -10.0, 10.0, 10.0]);
        assert_eq!(parts.len(), 2);
        for (part, middle_deg) in parts.iter().zip([355.0, 5.0]) {
            let middle = LEFT + middle_deg * SCALE;
            assert!((part[0] + part[2] / 2.0 - middle).abs() < 1e-9); // rounding
            assert!((part[2] - 20.0).abs() < 1e-9);
        }
        assert_eq!(rectangles([355.0, 0.0, 360.0, 1.0]).len(), 1);
    }

    #[test]
    fn sites_of_each_body_have_their_own_map() {
        let site = |name: &str, body: Body| Site {
            name: name.to_owned(),
            bounds_deg: Some([10.0, 0.0, 11.0, 1.0]),
            body,
            ..Site::default()
        };
        let both = [site("gusev", Body::Mars), site("tycho", Body::Moon)];
        let page = maps(&both).0;
        let (mars, moon) = page.split_once("</figure>").unwrap();
        assert!(mars.contains("/sites/gusev") && !mars.contains("/sites/tycho"));
        assert!(mars.contains("<image ") && mars.contains("MEGDR"));
        assert!(moon.contains("/sites/tycho") && !moon.contains("<image "));
        assert_eq!(maps(&both[..1]).0.matches("<figure").count(), 1);
    }

    #[test]
    fn names_of_neighbours_stand_below_each_other() {
        let site = |name: &str| Site {
            name: name.to_owned(),
            ..Site::default()
        };
        let sites = ["gusev_context", "gusev_crater", "isidis"].map(site);
        let bounds = [
            [173.8, -15.6, 176.8, -13.6],
            [175.0, -15.1, 175.6, -14.1],
            [87.7, 4.0, 88.3, 5.0],
        ];
        let placed: Vec<(&Site, [f64; 4])> = sites.iter().zip(bounds).collect();
        let names = names(&placed, 360.0 * SCALE);
        assert_eq!(names.len(), 3);
        let apart = names[2].y - names[1].y;
        assert!((apart - LINE).abs() < 1e-9 || apart > LINE, "{apart}"); // rounding
    }
}
