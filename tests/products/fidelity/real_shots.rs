//! Real shots of MOLA (PEDR, as the Mars Orbital Data Explorer writes them): data that took no part in anything here.

use std::{collections::BTreeMap, fs, sync::LazyLock};

use areograph::{
    geom::{ellipsoid::spherical_to_xyz_m, statistics::Summary},
    units::RADIANS_PER_DEGREE,
};
use areograph_testing::real_data;
use chrono::NaiveDateTime;
use nalgebra::Vector3;

const FOLDER: &str = "mola_ode";
/// The window at Gusev, a smooth one in Elysium, one in Meridiani, and one at the equator.
const WINDOWS: [&str; 4] = [
    "spirit_topography.csv",
    "insight_topography.csv",
    "opportunity_topography.csv",
    "weak_negative_2.csv",
];
/// Successive shots are 0.1 s apart; with one missing it is twice that.
const SUCCESSIVE_S: f64 = 0.15;
/// Shots farther apart leave the ground between them open.
const NEAR_S: f64 = 0.35;

/// A shot.
#[derive(Debug, Clone, Copy)]
struct Shot {
    longitude_deg: f64,
    latitude_deg: f64,
    /// Radius minus that of the areoid, metres.
    topography_m: f64,
    range_m: f64,
    radius_m: f64,
    /// Ephemeris time, seconds.
    et_s: f64,
    /// Seconds of UTC since 1970.
    utc_s: f64,
}

impl Shot {
    fn place_m(&self) -> Vector3<f64> {
        spherical_to_xyz_m(
            self.longitude_deg * RADIANS_PER_DEGREE,
            self.latitude_deg * RADIANS_PER_DEGREE,
            self.radius_m,
        )
    }
}

/// The shots of each orbit in a window, in the order of time.
type Passes = BTreeMap<u32, Vec<Shot>>;

static TABLES: LazyLock<[Passes; 4]> = LazyLock::new(|| WINDOWS.map(passes));

/// Whether the tables are at hand.
pub(crate) fn are_at_hand() -> bool {
    WINDOWS
        .iter()
        .all(|window| real_data(&format!("{FOLDER}/{window}"), "fidelity").is_some())
}

fn passes(window: &str) -> Passes {
    let path = real_data(&format!("{FOLDER}/{window}"), "fidelity").unwrap();
    let text = fs::read_to_string(path).unwrap();
    let mut passes = Passes::new();
    for line in text.lines().skip(1) {
        let cells: Vec<&str> = line.split(',').map(str::trim).collect();
        let number = |at: usize| -> f64 { cells[at].parse().unwrap() };
        let utc = NaiveDateTime::parse_from_str(cells[8], "%Y-%m-%dT%H:%M:%S%.f").unwrap();
        let shot = Shot {
            longitude_deg: number(0),
            latitude_deg: number(1),
            topography_m: number(2),
            range_m: number(3),
            radius_m: number(4),
            et_s: number(7),
            utc_s: utc.and_utc().timestamp_millis() as f64 / 1e3,
        };
        passes
            .entry(cells[9].parse().unwrap())
            .or_default()
            .push(shot);
    }
    for shots in passes.values_mut() {
        shots.sort_by(|one, other| one.et_s.total_cmp(&other.et_s));
    }
    passes
}

/// The pass at Gusev that follows an image.
pub(crate) struct Pass {
    pub(crate) orbit: u32,
    /// From the end of the image to the first shot, seconds.
    pub(crate) after_s: f64,
    /// Ephemeris time of the first shot, seconds.
    pub(crate) start_s: f64,
    /// Time between successive shots, mean, seconds.
    pub(crate) interval_s: f64,
    /// Distance of successive footprints, median, metres.
    pub(crate) spacing_m: f64,
    /// Speed over the ground from the first to the last shot, metres per second.
    pub(crate) speed_m_s: f64,
    /// Range, mean, metres.
    pub(crate) range_m: f64,
}

/// The pass whose first shot is next to the end of an image, seconds of UTC since 1970.
pub(crate) fn pass_after(image_end_s: f64) -> Pass {
    let apart_s = |shots: &[Shot]| shots[0].utc_s - image_end_s;
    let (orbit, shots) = TABLES[0]
        .iter()
        .min_by(|(_, one), (_, other)| apart_s(one).abs().total_cmp(&apart_s(other).abs()))
        .unwrap();
    let successive: Vec<[&Shot; 2]> = shots
        .windows(2)
        .map(|pair| [&pair[0], &pair[1]])
        .filter(|[one, next]| next.et_s - one.et_s < SUCCESSIVE_S)
        .collect();
    let mean_of = |values: Vec<f64>| Summary::of(&values).mean;
    let spacings_m: Vec<f64> = successive
        .iter()
        .map(|[one, next]| (next.place_m() - one.place_m()).norm())
        .collect();
    let (first, last) = (&shots[0], &shots[shots.len() - 1]);
    Pass {
        orbit: *orbit,
        after_s: apart_s(shots),
        start_s: first.et_s,
        interval_s: mean_of(
            successive
                .iter()
                .map(|[one, next]| next.et_s - one.et_s)
                .collect(),
        ),
        spacing_m: Summary::of(&spacings_m).median,
        speed_m_s: (last.place_m() - first.place_m()).norm() / (last.et_s - first.et_s),
        range_m: mean_of(shots.iter().map(|shot| shot.range_m).collect()),
    }
}

/// Radius of the areoid by the shots within 0.02° of the equator, mean, metres.
pub(crate) fn areoid_at_the_equator_m() -> f64 {
    let shots = TABLES[3].values().flatten();
    let near = shots.filter(|shot| shot.latitude_deg.abs() < 0.02 && shot.longitude_deg < 180.0);
    let radii: Vec<f64> = near.map(|shot| shot.radius_m - shot.topography_m).collect();
    Summary::of(&radii).mean
}

/// Where the segments from `a` to `b` and from `c` to `d` cross, as shares of both.
fn crossing([a, b]: [&Shot; 2], [c, d]: [&Shot; 2]) -> Option<[f64; 2]> {
    let by = |from: &Shot, to: &Shot| {
        [
            to.longitude_deg - from.longitude_deg,
            to.latitude_deg - from.latitude_deg,
        ]
    };
    let cross = |u: [f64; 2], v: [f64; 2]| u[0] * v[1] - u[1] * v[0];
    let (along, other, apart) = (by(a, b), by(c, d), by(a, c));
    let both = cross(along, other);
    let shares = [cross(apart, other) / both, cross(apart, along) / both];
    shares
        .iter()
        .all(|share| (0.0..=1.0).contains(share))
        .then_some(shares)
}

/// Standard deviation of the radius of one shot by the crossings of ascending and descending passes, metres: a window by
/// its place in the list, with the number of crossings.
fn repeatability_m(window: usize) -> (usize, f64) {
    let passes: Vec<&Vec<Shot>> = TABLES[window].values().collect();
    let rises = |shots: &[Shot]| shots[shots.len() - 1].latitude_deg > shots[0].latitude_deg;
    let (up, down): (Vec<&Vec<Shot>>, Vec<&Vec<Shot>>) =
        passes.into_iter().partition(|shots| rises(shots));
    let mut apart_m = Vec::new();
    for one in &up {
        for other in &down {
            let near = |pair: &&[Shot]| pair[1].et_s - pair[0].et_s < NEAR_S;
            let found = one.windows(2).filter(near).find_map(|first| {
                let (low, high) = (first[0].latitude_deg, first[1].latitude_deg);
                let mut others = other.windows(2).filter(near);
                others.find_map(|second| {
                    if second[0].latitude_deg < low || second[1].latitude_deg > high {
                        return None;
                    }
                    let shares = crossing([&first[0], &first[1]], [&second[0], &second[1]])?;
                    let at = |pair: &[Shot], share: f64| {
                        pair[0].radius_m + share * (pair[1].radius_m - pair[0].radius_m)
                    };
                    Some(at(first, shares[0]) - at(second, shares[1]))
                })
            });
            apart_m.extend(found);
        }
    }
    let sigma_m = Summary::of(&apart_m).nmad / std::f64::consts::SQRT_2;
    (apart_m.len(), sigma_m)
}

/// The two smooth windows: name, crossings, standard deviation of a shot, metres.
pub(crate) fn smooth_windows() -> [(&'static str, usize, f64); 2] {
    [("Elysium", 1), ("Meridiani", 2)].map(|(name, window)| {
        let (crossings, sigma_m) = repeatability_m(window);
        (name, crossings, sigma_m)
    })
}
