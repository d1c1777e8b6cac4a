//! Meridians and parallels of a map, and the part of it that a picture shows.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use super::plots::{Extent, Frame};
use areograph_base::units::{RADIANS_PER_DEGREE, wrap_pi, wrap_two_pi};
use areograph_geom::map_projection::MapProjection;

/// Readable steps, degrees.
const STEPS_DEG: [f64; 12] = [
    0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 15.0, 30.0, 45.0,
];
/// Number of points of a line.
const LINE_POINTS: u32 = 90;
/// Points along each side of the view, from which its range of coordinates is found.
const SIDE_POINTS: u32 = 24;
/// Parts of the view's height between two parallels, about.
const LINES: f64 = 5.0;

/// A rectangle of the map, metres.
#[derive(Debug, Clone, Copy)]
pub(super) struct View {
    pub(super) west_m: f64,
    pub(super) east_m: f64,
    pub(super) south_m: f64,
    pub(super) north_m: f64,
}

impl View {
    /// All of `places` with a margin; a kilometre about the centre without any.
    pub(super) fn of(places: impl Iterator<Item = (f64, f64)>) -> Self {
        let start = [
            f64::INFINITY,
            f64::NEG_INFINITY,
            f64::INFINITY,
            f64::NEG_INFINITY,
        ];
        let [west, east, south, north] =
            places.fold(start, |[west, east, south, north], (x, y)| {
                [west.min(x), east.max(x), south.min(y), north.max(y)]
            });
        if west > east {
            return Self::of([(-1e3, -1e3), (1e3, 1e3)].into_iter());
        }
        let margin_m = 0.06 * (east - west).max(north - south).max(1e3);
        Self {
            west_m: west - margin_m,
            east_m: east + margin_m,
            south_m: south - margin_m,
            north_m: north + margin_m,
        }
    }

    pub(super) fn width_m(&self) -> f64 {
        self.east_m - self.west_m
    }

    pub(super) fn height_m(&self) -> f64 {
        self.north_m - self.south_m
    }

    /// A view with the same centre, wider or higher so that height is `ratio` times width.
    pub(super) fn with_ratio(self, ratio: f64) -> Self {
        let more_width_m = (self.height_m() / ratio - self.width_m()).max(0.0) / 2.0;
        let more_height_m = (self.width_m() * ratio - self.height_m()).max(0.0) / 2.0;
        Self {
            west_m: self.west_m - more_width_m,
            east_m: self.east_m + more_width_m,
            south_m: self.south_m - more_height_m,
            north_m: self.north_m + more_height_m,
        }
    }

    pub(super) fn contains(&self, (x, y): (f64, f64)) -> bool {
        (self.west_m..=self.east_m).contains(&x) && (self.south_m..=self.north_m).contains(&y)
    }

    /// The part of a segment inside the view.
    fn clip(&self, from: (f64, f64), to: (f64, f64)) -> Option<[(f64, f64); 2]> {
        let extent = |low, high| Extent { low, high };
        let frame = Frame {
            x: extent(self.west_m, self.east_m),
            y: extent(self.south_m, self.north_m),
        };
        frame.clip(from, to)
    }
}

/// A meridian or parallel inside the view: its pieces, and its name.
pub(super) struct GridLine {
    pub(super) segments: Vec<[(f64, f64); 2]>,
    pub(super) name: String,
    pub(super) is_parallel: bool,
}

/// The lines in a view.
pub(super) fn graticule(map: &MapProjection, view: &View) -> Vec<GridLine> {
    let shown = Shown::of(map, view);
    let height_rad = shown.height_rad(map, view);
    let step_rad = step(height_rad / LINES);
    let meridian_step_rad = if shown.pole {
        30.0 * RADIANS_PER_DEGREE
    } else {
        let width_rad = height_rad * view.width_m() / view.height_m();
        step(width_rad / LINES / map.latitude_rad().cos())
    };
    let turns = shown.turn_rad;
    let latitudes = shown.latitude_rad;
    let parallels = multiples(latitudes, step_rad)
        .filter(|latitude| latitude.abs() < FRAC_PI_2 - 1e-9)
        .map(|latitude| {
            let points = between(turns).map(|turn| (map.longitude_rad() + turn, latitude));
            line(map, view, points, latitude_name(latitude, step_rad), true)
        });
    let first = map.longitude_rad() + turns.0;
    let meridians = multiples((first, map.longitude_rad() + turns.1), meridian_step_rad)
        .filter(move |longitude| longitude - first < TAU - 1e-9)
        .map(|longitude| {
            let points = between(latitudes).map(|latitude| (longitude, latitude));
            let name = longitude_name(longitude, meridian_step_rad);
            line(map, view, points, name, false)
        });
    parallels
        .chain(meridians)
        .filter(|line| !line.segments.is_empty())
        .collect()
}

/// The range of coordinates of a view.
struct Shown {
    latitude_rad: (f64, f64),
    /// East longitudes from the centre.
    turn_rad: (f64, f64),
    /// Whether a pole is among them.
    pole: bool,
}

impl Shown {
    fn of(map: &MapProjection, view: &View) -> Self {
        let poles = [FRAC_PI_2, -FRAC_PI_2].map(|pole| {
            map.project(0.0, pole)
                .is_some_and(|place| view.contains(place))
        });
        let sides = (0..=SIDE_POINTS).flat_map(|k| {
            let share = f64::from(k) / f64::from(SIDE_POINTS);
            let x = view.west_m + share * view.width_m();
            let y = view.south_m + share * view.height_m();
            [
                (x, view.south_m),
                (x, view.north_m),
                (view.west_m, y),
                (view.east_m, y),
            ]
        });
        let everything = Self {
            latitude_rad: (-FRAC_PI_2, FRAC_PI_2),
            turn_rad: (-PI, PI),
            pole: true,
        };
        let mut latitudes = (map.latitude_rad(), map.latitude_rad());
        let mut turns = (0.0_f64, 0.0_f64);
        for place in sides {
            let Some((longitude_rad, latitude_rad)) = map.unproject(place) else {
                return everything;
            };
            let turn_rad = wrap_pi(longitude_rad - map.longitude_rad());
            latitudes = (latitudes.0.min(latitude_rad), latitudes.1.max(latitude_rad));
            turns = (turns.0.min(turn_rad), turns.1.max(turn_rad));
        }
        let [north, south] = poles;
        Self {
            latitude_rad: (
                if south { -FRAC_PI_2 } else { latitudes.0 },
                if north { FRAC_PI_2 } else { latitudes.1 },
            ),
            turn_rad: if north || south { (-PI, PI) } else { turns },
            pole: north || south,
        }
    }

    /// Height of the view as an angle, about.
    fn height_rad(&self, map: &MapProjection, view: &View) -> f64 {
        let ends = [view.south_m, view.north_m].map(|y| map.unproject((0.0, y)));
        match ends {
            [Some(south), Some(north)] if !self.pole => (north.1 - south.1).abs(),
            _ => (self.latitude_rad.1 - self.latitude_rad.0).max(RADIANS_PER_DEGREE),
        }
    }
}

/// The readable step nearest above `angle_rad`.
fn step(angle_rad: f64) -> f64 {
    let angle_deg = angle_rad / RADIANS_PER_DEGREE;
    let step_deg = STEPS_DEG.iter().find(|step| **step >= angle_deg);
    step_deg.copied().unwrap_or(45.0) * RADIANS_PER_DEGREE
}

/// Multiples of `step_rad` inside a range.
fn multiples((low, high): (f64, f64), step_rad: f64) -> impl Iterator<Item = f64> {
    let (first, last) = (
        (low / step_rad).ceil() as i64,
        (high / step_rad).floor() as i64,
    );
    (first..=last).map(move |k| k as f64 * step_rad)
}

fn between((low, high): (f64, f64)) -> impl Iterator<Item = f64> {
    (0..=LINE_POINTS).map(move |k| low + (high - low) * f64::from(k) / f64::from(LINE_POINTS))
}

fn line(
    map: &MapProjection,
    view: &View,
    points: impl Iterator<Item = (f64, f64)>,
    name: String,
    is_parallel: bool,
) -> GridLine {
    let places: Vec<Option<(f64, f64)>> = points
        .map(|(longitude, latitude)| map.project(longitude, latitude))
        .collect();
    let pairs = places.windows(2);
    GridLine {
        segments: pairs
            .filter_map(|pair| view.clip(pair[0]?, pair[1]?))
            .collect(),
        name,
        is_parallel,
    }
}

/// Decimals that distinguish multiples of a step.
fn decimals(step_rad: f64) -> usize {
    let step_deg = step_rad / RADIANS_PER_DEGREE;
    if step_deg >= 0.999 {
        0
    } else if step_deg >= 0.099 {
        1
    } else {
        2
    }
}

fn latitude_name(latitude_rad: f64, step_rad: f64) -> String {
    let decimals = decimals(step_rad);
    let text = format!("{:.decimals$}°", (latitude_rad / RADIANS_PER_DEGREE).abs());
    if latitude_rad.abs() < 0.5 * step_rad {
        text
    } else if latitude_rad > 0.0 {
        text + " N"
    } else {
        text + " S"
    }
}

fn longitude_name(longitude_rad: f64, step_rad: f64) -> String {
    let decimals = decimals(step_rad);
    let text = format!(
        "{:.decimals$}",
        wrap_two_pi(longitude_rad) / RADIANS_PER_DEGREE
    );
    // An angle just below a full turn rounds up to it.
    if text.parse() == Ok(360.0) {
        format!("{:.decimals$}° E", 0.0)
    } else {
        text + "° E"
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(longitude_deg: f64, latitude_deg: f64, half_m: f64) -> Vec<String> {
        let [longitude_rad, latitude_rad] =
            [longitude_deg, latitude_deg].map(|angle| angle * RADIANS_PER_DEGREE);
        let map = MapProjection::about(longitude_rad, latitude_rad, 3_396_190.0);
        let view = View::of([(-half_m, -half_m), (half_m, half_m)].into_iter());
        let lines = graticule(&map, &view);
        lines.into_iter().map(|line| line.name).collect()
    }

    #[test]
    fn lines_run_on_across_the_prime_meridian() {
        let names = names(0.0, 10.0, 60_000.0);
        assert!(names.contains(&"0.0° E".to_owned()), "{names:?}");
        assert!(names.contains(&"359.5° E".to_owned()), "{names:?}");
        assert!(names.contains(&"10.0° N".to_owned()), "{names:?}");
        assert!(names.len() < 16, "{names:?}");
    }

    #[test]
    fn a_pole_has_meridians_all_round() {
        let names = names(123.0, 90.0, 300_000.0);
        let meridians = names.iter().filter(|name| name.ends_with('E')).count();
        assert_eq!(meridians, 12, "{names:?}");
        assert!(names.iter().any(|name| name.ends_with('N')), "{names:?}");
    }

    #[test]
    fn the_whole_globe_has_lines_too() {
        let names = names(0.0, 0.0, 8e6);
        assert!(names.len() >= 12 && names.len() < 40, "{names:?}");
    }
}
