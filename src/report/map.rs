//! Map of the footprints and of the images' boresights.

use super::{
    html::section,
    plots::{Extent, GREY, Plot, Series, Style, figure, thinned},
    ranges::PROFILES_APART,
};
use crate::{
    error::Result,
    products::SiteProducts,
    stages::group_profiles::Profile,
    units::{RADIANS_PER_DEGREE, wrap_two_pi},
};

/// Points of the map; about 90 bytes each.
const MAP_POINTS: usize = 8_000;

/// Where the shots and the boresights of the images lie.
pub(super) fn map(site: &SiteProducts) -> Result<String> {
    let shots = site.footprints;
    if shots.is_empty() && site.images.is_empty() {
        return Ok(String::new());
    }
    let view = View::of(site);
    let mut series = profile_tracks(site, &view);
    series.extend(boresight_tracks(site, &view));
    let points = || series.iter().flat_map(|series| series.points.iter());
    let thinned_out = if shots.len() > MAP_POINTS {
        " Every so many shots are drawn."
    } else {
        ""
    };
    let plot = Plot {
        x_label: "east longitude, degrees",
        y_label: "areocentric latitude, degrees",
        x: Extent::of(points().map(|point| point.0)),
        y: Extent::of(points().map(|point| point.1)),
        x_turns: true,
        height: 460,
        marks: Vec::new(),
        caption: format!("IAU 2000; the axes differ in scale.{thinned_out}"),
        series,
    };
    Ok(section("Footprints", &figure(&plot)?))
}

/// Longitudes counted onwards from the western edge, so that no site is cut by 0° or 180°.
struct View {
    west_rad: f64,
}

impl View {
    fn of(site: &SiteProducts) -> Self {
        let samples = site
            .images
            .iter()
            .flat_map(|image| &image.orientation.samples);
        let boresights = samples.filter_map(|sample| Some(sample.boresight?.longitude_rad));
        let shots = site.footprints.longitude_rad.iter().copied();
        let longitudes: Vec<f64> = shots.chain(boresights).collect();
        Self {
            west_rad: western_edge_rad(longitudes),
        }
    }

    /// Degrees of longitude, onwards from the western edge, and of latitude.
    fn place(&self, longitude_rad: f64, latitude_rad: f64) -> (f64, f64) {
        let east_rad = self.west_rad + wrap_two_pi(longitude_rad - self.west_rad);
        (
            east_rad / RADIANS_PER_DEGREE,
            latitude_rad / RADIANS_PER_DEGREE,
        )
    }
}

fn profile_tracks(site: &SiteProducts, view: &View) -> Vec<Series> {
    let shots = site.footprints;
    let share = (MAP_POINTS / site.profiles.len().max(1)).max(2);
    let track = |(colour, profile): (usize, &Profile)| {
        let place = |row: &u32| {
            let row = *row as usize;
            view.place(shots.longitude_rad[row], shots.latitude_rad[row])
        };
        // Legends name profiles as long as there are few.
        let named = site.profiles.len() <= PROFILES_APART;
        Series {
            label: if named {
                profile.id.clone()
            } else {
                String::new()
            },
            style: Style::Dots,
            colour,
            points: thinned(&profile.rows, share).iter().map(place).collect(),
        }
    };
    site.profiles.iter().enumerate().map(track).collect()
}

fn boresight_tracks(site: &SiteProducts, view: &View) -> impl Iterator<Item = Series> {
    site.images.iter().map(|image| {
        let grounds = image
            .orientation
            .samples
            .iter()
            .filter_map(|sample| sample.boresight);
        Series {
            label: format!("boresight of {}", image.times.id),
            style: Style::Line,
            colour: GREY,
            points: grounds
                .map(|ground| view.place(ground.longitude_rad, ground.latitude_rad))
                .collect(),
        }
    })
}

/// East end of the widest stretch of longitudes without points, radians; 0 without points.
fn western_edge_rad(mut longitudes_rad: Vec<f64>) -> f64 {
    longitudes_rad.sort_by(f64::total_cmp);
    let (Some(first), Some(last)) = (longitudes_rad.first(), longitudes_rad.last()) else {
        return 0.0;
    };
    let mut widest = (first + std::f64::consts::TAU - last, *first);
    for pair in longitudes_rad.windows(2) {
        if pair[1] - pair[0] > widest.0 {
            widest = (pair[1] - pair[0], pair[1]);
        }
    }
    widest.1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_view_is_not_cut_by_the_prime_meridian() {
        let view = View {
            west_rad: western_edge_rad(vec![0.02, 6.27, 0.01]),
        };
        let [west, east] = [6.27, 0.02].map(|longitude| view.place(longitude, 0.0).0);
        assert!(west < east && east - west < 2.0, "{west} {east}");
        assert!(western_edge_rad(vec![1.0, 2.0]) < 1.5);
        assert!(western_edge_rad(Vec::new()).abs() < f64::MIN_POSITIVE);
    }
}
