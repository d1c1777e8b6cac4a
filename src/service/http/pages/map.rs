//! Where the sites lie: Mars from 0° to 360° E, equidistant cylindrical.

use maud::{Markup, html};

use super::parts::{counted, tone};
use crate::service::database::shown::Site;

/// Units of the picture for a degree.
const SCALE: f64 = 2.0;
/// Room for the names of parallels and meridians.
const LEFT: f64 = 64.0;
const TOP: f64 = 10.0;
const RIGHT: f64 = 22.0;
/// Windows smaller than this are drawn so large.
const LEAST: f64 = 9.0;
/// More names than this would lie over each other.
const NAMES: usize = 30;

/// The map, and what it shows in words.
pub(super) fn map(sites: &[Site]) -> Markup {
    let placed: Vec<(&Site, [f64; 4])> = sites
        .iter()
        .filter_map(|site| Some((site, site.bounds_deg?)))
        .collect();
    let (width, height) = (360.0 * SCALE, 180.0 * SCALE);
    html! {
        figure class="map" {
            svg viewBox={ "0 0 " (LEFT + width + RIGHT) " " (TOP + height + 28.0) } role="group" aria-label="Map of the sites" {
                @for k in 0..=12_u32 {
                    @let longitude = f64::from(30 * k);
                    @let x = LEFT + longitude * SCALE;
                    line x1=(x) y1=(TOP) x2=(x) y2=(TOP + height) stroke="#E2E2E2" {}
                    @if k % 2 == 0 { text x=(x) y=(TOP + height + 22.0) text-anchor="middle" font-size="17" fill="#222222" { (longitude) "°" } }
                }
                @for k in 0..=6_u32 {
                    @let latitude = 90.0 - f64::from(30 * k);
                    @let y = TOP + (90.0 - latitude) * SCALE;
                    line x1=(LEFT) y1=(y) x2=(LEFT + width) y2=(y) stroke="#E2E2E2" {}
                    text x=(LEFT - 6.0) y=(y + 6.0) text-anchor="end" font-size="17" fill="#222222" { (latitude_name(latitude)) }
                }
                @for (site, bounds_deg) in &placed {
                    a href={ "/sites/" (site.name) } aria-label={ (site.name) ": " (site.verdict.as_deref().unwrap_or("no run yet")) } {
                        @for [x, y, wide, high] in rectangles(*bounds_deg) {
                            rect class={ "site " (tone(site.verdict.as_deref())) } x=(x) y=(y) width=(wide) height=(high) {}
                        }
                        @if placed.len() <= NAMES {
                            @let [x, y, wide, high] = rectangles(*bounds_deg)[0];
                            @let east = x + wide > LEFT + width * 0.8;
                            text x=(if east { x - 4.0 } else { x + wide + 4.0 }) y=(y + high / 2.0 + 6.0)
                                text-anchor=(if east { "end" } else { "start" }) font-size="17" fill="#222222" { (site.name) }
                        }
                    }
                }
            }
            figcaption {
                (counted(placed.len(), "site")) " with windows; east longitude and areocentric latitude. The colour is that of the verdict."
                @if sites.len() > placed.len() { " The windows of the others are not known yet." }
            }
        }
    }
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
}
