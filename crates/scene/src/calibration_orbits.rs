//! A synthetic camera of two stereo lines that ages over several orbits, with orbit errors, tie points and laser errors of
//! the sizes that Li et al. 2023 state, and true values.

use std::{collections::BTreeMap, fmt::Write as _, path::Path};

use nalgebra::Vector3;
use serde::Serialize;

use super::{
    calibration::{degrees, drawn_offset},
    files::{Draft, put},
    pushbroom_pair::{LONG, Orbit, OrbitError, StereoLine},
    random::Random,
};
use areograph_base::{
    error::{Locate as _, Result},
    units::SECONDS_PER_DAY,
};
use areograph_geom::ellipsoid::local_axes;

const README: &str = "Two stereo lines of a camera in several orbits: for each orbit, support data, tie points, laser control and a\n\
    calibration file. The lines are mounted askew and age, and every orbit and attitude has errors of its own; truth.json states\n\
    these errors, the true look directions and all true positions.\n\
    Next: areograph calibrate each o*.toml --out out, then areograph calibrate series out/o01 out/o02 …\n";

/// Time between two orbits, days.
const APART_DAYS: f64 = 91.0;
/// Days of a year.
const YEAR_DAYS: f64 = 365.25;
/// Standard deviations of the errors of an orbit: each coordinate, metres, its drift, metres per line, and the attitude about
/// each axis, degrees.
///
/// # Source
/// Li et al. 2023, Table 2.
const ORBIT_M: f64 = 1_000.0;
const DRIFT_M_PER_LINE: f64 = 0.01;
const ATTITUDE_DEG: f64 = 0.025;
/// Noise of tie points, pixels: the residuals that the paper's calibration leaves (Table 5).
const TIE_PX: f64 = 0.3;
/// Noise of control in images, pixels.
const CONTROL_PX: f64 = 1.0;
/// Errors of the laser, metres, in plan along each axis and in radius: those that a profile shares, and those of single shots.
/// Together they are 100 and 10 metres.
const SHARED_M: [f64; 2] = [60.0, 6.0];
const SINGLE_M: [f64; 2] = [80.0, 8.0];
/// Tie points; profiles over an image, and control points of each.
const TIES: usize = 206;
const PROFILES: usize = 20;
const OF_PROFILE: usize = 24;
/// Share of the swath that points are drawn from.
const SWATH: f64 = 0.92;

/// Options of a scene of several orbits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OrbitsScene {
    /// Seed of all errors.
    pub seed: u64,
    /// Orbits, a quarter of a year apart.
    pub orbits: u32,
    /// Errors of orbits and attitudes over those of Li et al. 2023, Table 2.
    pub orbit_errors: f64,
    /// Change of the roll of the second line relative to the first, pixels per year; scale and yaw change by half of this at the
    /// edge of the image.
    pub ageing_px_per_year: f64,
}

/// The file of true values.
#[derive(Serialize)]
struct Truth {
    seed: u64,
    ageing_px_per_year: f64,
    orbits: BTreeMap<String, TrueOrbit>,
}

/// True values of an orbit.
#[derive(Serialize)]
struct TrueOrbit {
    /// Years after the first orbit.
    years: f64,
    /// Bias, true minus support data, Mars-fixed metres.
    bias_m: [f64; 3],
    /// Drift, metres a line.
    drift_m_per_line: [f64; 3],
    /// Error of the attitude, degrees, about the axes along, across and down; included in the true lines.
    attitude_deg: [f64; 3],
    /// φ, ω and κ of every line with the error of the attitude, degrees.
    angles_deg: BTreeMap<&'static str, [f64; 3]>,
    /// Roll, pitch, yaw, scale and bends of every line without the error of the attitude, tangents.
    looks: BTreeMap<&'static str, [f64; 6]>,
    /// True positions of the points, Mars-fixed metres.
    points_m: BTreeMap<String, [f64; 3]>,
}

/// The lines after some years.
fn lines(scene: &OrbitsScene, years: f64) -> [StereoLine; 2] {
    let half = 0.5 * f64::from(LONG[1]);
    let line = |name, pitch_deg: f64, angles_deg| {
        let sense = pitch_deg.signum();
        let [m1, n1, n2] = [2e-7 * half, 1e-7 * half, 1e-11 * half * half];
        let mut line = StereoLine {
            name,
            pitch_deg,
            offset: drawn_offset(scene.seed, name, angles_deg),
            errors: [sense * m1, sense * n1, sense * n2],
        };
        line.age(scene.ageing_px_per_year * years * StereoLine::pixel(), half);
        line
    };
    [
        line("s1", 18.9, [0.055, 0.020, 0.030]),
        line("s2", -18.9, [-0.050, -0.015, -0.020]),
    ]
}

/// One of several orbits, with errors of its own, over ground of its own.
pub(super) fn drawn_orbit(
    scene: &OrbitsScene,
    number: u32,
    size: [u32; 2],
    is_steered: bool,
) -> Orbit {
    let mut random = Random::new(scene.seed, &format!("errors of orbit {number}"));
    let [bias_m, drift_m_per_line] = [ORBIT_M, DRIFT_M_PER_LINE]
        .map(|sigma| [0; 3].map(|_| scene.orbit_errors * sigma * random.normal()));
    Orbit {
        name: format!("o{:02}", number + 1),
        start_et_s: 596_764_800.0 + f64::from(number) * APART_DAYS * SECONDS_PER_DAY,
        longitude_deg: random.between(-180.0, 180.0),
        latitude_deg: random.between(-50.0, 50.0),
        size,
        is_steered,
        error: OrbitError {
            bias_m,
            drift_m_per_line,
        },
    }
}

/// Years of an orbit after the first one.
pub(super) fn years_after(number: u32) -> f64 {
    f64::from(number) * APART_DAYS / YEAR_DAYS
}

/// Error of the attitude of an orbit, degrees about the axes along the flight, across it and down.
pub(super) fn drawn_attitude_deg(scene: &OrbitsScene, number: u32) -> [f64; 3] {
    let mut random = Random::new(scene.seed, &format!("attitude of orbit {number}"));
    [0; 3].map(|_| scene.orbit_errors * ATTITUDE_DEG * random.normal())
}

/// Writes a camera in several orbits into `directory`, replacing an older scene unless files were added or changed. The same
/// options give the same bytes.
///
/// # Errors
/// [`SceneError`](super::SceneError) when the folder holds something else; errors of writing.
pub fn write_calibration_orbits(directory: &Path, scene: &OrbitsScene) -> Result<String> {
    let draft = Draft::begin(directory, README)?;
    let isd = draft.folder("isd")?;
    let mut truth = Truth {
        seed: scene.seed,
        ageing_px_per_year: scene.ageing_px_per_year,
        orbits: BTreeMap::new(),
    };
    for number in 0..scene.orbits {
        let orbit = drawn_orbit(scene, number, LONG, false);
        let years = years_after(number);
        let mut lines = lines(scene, years);
        let looks = lines.each_ref().map(|line| {
            let looks = line.truth(orbit.samples()).look_parameters();
            (line.name, looks)
        });
        let attitude_deg = drawn_attitude_deg(scene, number);
        for line in &mut lines {
            line.turn(attitude_deg);
            let path = isd.join(format!("{}_{}.json", orbit.name, line.name));
            put(&path, &orbit.support_data(line)).in_file(&path)?;
        }
        let tables = tables(&orbit, &lines, scene.seed);
        let name = &orbit.name;
        for (file, text) in [
            (format!("{name}_ties.csv"), tables.ties),
            (format!("{name}_control.csv"), tables.control),
            (format!("{name}.toml"), CALIBRATION.replace("ORBIT", name)),
        ] {
            let path = draft.root().join(file);
            put(&path, &text).in_file(&path)?;
        }
        let angles_deg = lines.each_ref().map(|line| {
            let of = &line.offset;
            let angles = [of.phi_rad, of.omega_rad, of.kappa_rad];
            (line.name, angles.map(f64::to_degrees))
        });
        truth.orbits.insert(
            orbit.name.clone(),
            TrueOrbit {
                years,
                bias_m: orbit.error.bias_m,
                drift_m_per_line: orbit.error.drift_m_per_line,
                attitude_deg,
                angles_deg: angles_deg.into(),
                looks: looks.into(),
                points_m: tables.points_m,
            },
        );
    }
    let path = draft.root().join("truth.json");
    let truth = serde_json::to_string_pretty(&truth).unwrap_or_default() + "\n";
    put(&path, &truth).in_file(&path)?;
    draft.finish()?;
    Ok(format!(
        "{}: two stereo lines in {} orbits, {TIES} tie points and {} laser points each; next: areograph calibrate {}",
        directory.display(),
        scene.orbits,
        PROFILES * OF_PROFILE,
        directory.join("o01.toml").display()
    ))
}

/// Tables of an orbit, and the true positions of its points.
struct Tables {
    ties: String,
    control: String,
    points_m: BTreeMap<String, [f64; 3]>,
}

fn tables(orbit: &Orbit, lines: &[StereoLine; 2], seed: u64) -> Tables {
    let mut random = Random::new(seed, &format!("points of {}", orbit.name));
    let mut tables = Tables {
        ties: "point,camera,line,sample\n".to_owned(),
        control: "point,camera,line,sample,longitude_deg,latitude_deg,radius_m,profile,\
                  sigma_shared_horizontal_m,sigma_shared_vertical_m\n"
            .to_owned(),
        points_m: BTreeMap::new(),
    };
    let mut number = 0;
    while number < TIES {
        let place_m = orbit.ground(random.between(0.0, 1.0), random.between(-SWATH, SWATH));
        let name = format!("T{:03}", number + 1);
        if tables.see(orbit, lines, &name, &place_m, None, &mut random) {
            number += 1;
        }
    }
    for profile in 0..PROFILES {
        let across = random.between(-SWATH, SWATH);
        let shared_m = errors_m(SHARED_M, &mut random);
        let mut number = 0;
        while number < OF_PROFILE {
            let place_m = orbit.ground(random.between(0.0, 1.0), across);
            let off_m = shared_m + errors_m(SINGLE_M, &mut random);
            let laser_m = place_m + local_axes(&place_m).tr_mul(&off_m.xy().push(0.0));
            let laser_m = laser_m.normalize() * (place_m.norm() + off_m.z);
            let name = format!("L{:02}_{:02}", profile + 1, number + 1);
            let [plan_m, up_m] = SHARED_M;
            let laser = format!("{},P{:02},{plan_m},{up_m}", degrees(&laser_m), profile + 1);
            if tables.see(orbit, lines, &name, &place_m, Some(&laser), &mut random) {
                number += 1;
            }
        }
    }
    tables
}

/// Errors east, north and up, metres.
fn errors_m([plan_m, up_m]: [f64; 2], random: &mut Random) -> Vector3<f64> {
    Vector3::new(
        plan_m * random.normal(),
        plan_m * random.normal(),
        up_m * random.normal(),
    )
}

impl Tables {
    /// Adds a point if both lines see it; a laser point with the columns of the laser.
    fn see(
        &mut self,
        orbit: &Orbit,
        lines: &[StereoLine; 2],
        name: &str,
        place_m: &Vector3<f64>,
        laser: Option<&str>,
        random: &mut Random,
    ) -> bool {
        let seen = lines.each_ref().map(|line| orbit.sees(line, place_m));
        let [Some(first), Some(second)] = seen else {
            return false;
        };
        let noise_px = if laser.is_some() { CONTROL_PX } else { TIE_PX };
        for (line, place) in lines.iter().zip([first, second]) {
            let at = place.map(|at| at + noise_px * random.normal());
            let image = format!("{name},{},{:.4},{:.4}", line.name, at[0], at[1]);
            // Writing to a string cannot fail.
            let _infallible = match laser {
                None => writeln!(self.ties, "{image}"),
                Some(laser) => writeln!(self.control, "{image},{laser}"),
            };
        }
        self.points_m.insert(name.to_owned(), (*place_m).into());
        true
    }
}

const CALIBRATION: &str = "\
calibration = \"ORBIT\"
description = \"Two synthetic stereo lines in orbit ORBIT\"

[[cameras]]
id = \"s1\"
isd = \"isd/ORBIT_s1.json\"

[[cameras]]
id = \"s2\"
isd = \"isd/ORBIT_s2.json\"

[ties]
files = [\"ORBIT_ties.csv\"]
sigma_px = 0.3

[control]
files = [\"ORBIT_control.csv\"]
sigma_px = 1.0
sigma_horizontal_m = 100.0
sigma_vertical_m = 10.0
limit_px = 500.0
";
