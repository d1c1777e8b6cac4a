//! A synthetic camera of two stereo lines in two orbits, with its support data, tie points, laser control and true
//! values.

use std::{collections::BTreeMap, fmt::Write as _, path::Path};

use nalgebra::Vector3;
use serde::Serialize;

use super::{
    files::{Draft, put},
    pushbroom_pair::{LONG, Orbit, OrbitError, StereoLine},
    random::Random,
};
use areograph_base::error::{Locate as _, Result};
use areograph_geom::{calibration::Offset, ellipsoid::local_axes};

const README: &str = "Two stereo lines of a camera in two orbits: support data, tie points, laser control and a calibration\n\
    file. The lines are mounted askew, and the orbits are wrong by hundreds of metres; truth.json states these errors and\n\
    all true positions.\n\
    Next: areograph calibrate calibration.toml\n";

/// Noise: tie points and control in images, pixels; control on the ground, metres.
const TIE_PX: f64 = 0.2;
const CONTROL_PX: f64 = 1.0;
const HORIZONTAL_M: f64 = 100.0;
const VERTICAL_M: f64 = 10.0;
/// Points of the calibration orbit (those of Li et al. 2023), and of the other one.
const POINTS: [[usize; 2]; 2] = [[206, 476], [80, 160]];
/// Share of the swath that points are drawn from, the middle.
const SWATH: f64 = 0.92;

/// The true lines. Sample errors are those of the paper's synthetic case: 2e-7 and 1e-7 a pixel, 1e-11 a pixel squared.
fn lines(seed: u64) -> [StereoLine; 2] {
    let offset = |line, angles_deg| drawn_offset(seed, line, angles_deg);
    let half = 0.5 * f64::from(LONG[1]);
    let errors = |sense: f64| {
        [
            sense * 2e-7 * half,
            sense * 1e-7 * half,
            sense * 1e-11 * half * half,
        ]
    };
    [
        StereoLine {
            name: "s1",
            pitch_deg: 18.9,
            offset: offset("s1", [0.055, 0.020, 0.030]),
            errors: errors(1.0),
        },
        StereoLine {
            name: "s2",
            pitch_deg: -18.9,
            offset: offset("s2", [-0.050, -0.015, -0.020]),
            errors: errors(-1.0),
        },
    ]
}

/// A mounting with these angles φ, ω and κ, each times a drawn factor from 0.5 to 1.5.
pub(super) fn drawn_offset(seed: u64, line: &str, angles_deg: [f64; 3]) -> Offset {
    let mut random = Random::new(seed, &format!("mounting of line {line}"));
    let [phi_rad, omega_rad, kappa_rad] =
        angles_deg.map(|angle_deg| (random.between(0.5, 1.5) * angle_deg).to_radians());
    Offset {
        phi_rad,
        omega_rad,
        kappa_rad,
    }
}

/// The orbits: that of the calibration, and another one, whose error in its own axes differs from the first by a fifth.
fn orbits() -> [Orbit; 2] {
    [
        Orbit {
            name: "i864".to_owned(),
            start_et_s: 596_764_800.0,
            longitude_deg: -63.13,
            latitude_deg: -33.0,
            size: LONG,
            is_steered: false,
            error: OrbitError {
                bias_m: [350.0, 500.0, -420.0],
                drift_m_per_line: [0.006, -0.006, 0.006],
            },
        },
        Orbit {
            name: "i818".to_owned(),
            start_et_s: 595_641_600.0,
            longitude_deg: -45.31,
            latitude_deg: -30.0,
            size: LONG,
            is_steered: false,
            error: OrbitError {
                bias_m: [150.0, 470.0, -340.0],
                drift_m_per_line: [-0.004, 0.003, 0.004],
            },
        },
    ]
}

/// The file of true values.
#[derive(Serialize)]
struct Truth<'a> {
    seed: u64,
    /// φ, ω and κ of every line, degrees.
    angles_deg: BTreeMap<&'static str, [f64; 3]>,
    /// Bias of every orbit, true minus support data, Mars-fixed metres.
    orbit_bias_m: BTreeMap<&'a str, [f64; 3]>,
    /// Its drift, metres a line.
    orbit_drift_m_per_line: BTreeMap<&'a str, [f64; 3]>,
    /// True positions of the points of every orbit, Mars-fixed metres.
    points_m: BTreeMap<&'a str, BTreeMap<String, [f64; 3]>>,
}

/// Tables of an orbit, and the true positions of its points.
struct Tables {
    ties: String,
    control: String,
    points_m: BTreeMap<String, [f64; 3]>,
}

/// Writes a synthetic camera of two stereo lines into `directory`, replacing an older scene unless files were added or
/// changed. The same seed gives the same bytes.
///
/// # Errors
/// [`SceneError`](super::SceneError) when the folder holds something else; errors of writing.
pub fn write_calibration_scene(directory: &Path, seed: u64) -> Result<String> {
    let draft = Draft::begin(directory, README)?;
    let isd = draft.folder("isd")?;
    let (lines, orbits) = (lines(seed), orbits());
    let mut truth = Truth {
        seed,
        angles_deg: lines
            .iter()
            .map(|line| {
                let of = &line.offset;
                let angles = [of.phi_rad, of.omega_rad, of.kappa_rad];
                (line.name, angles.map(f64::to_degrees))
            })
            .collect(),
        orbit_bias_m: orbits
            .iter()
            .map(|of| (&*of.name, of.error.bias_m))
            .collect(),
        orbit_drift_m_per_line: (orbits.iter())
            .map(|of| (&*of.name, of.error.drift_m_per_line))
            .collect(),
        points_m: BTreeMap::new(),
    };
    for (orbit, counts) in orbits.iter().zip(POINTS) {
        for line in &lines {
            let path = isd.join(format!("{}_{}.json", orbit.name, line.name));
            put(&path, &orbit.support_data(line)).in_file(&path)?;
        }
        let tables = tables(orbit, &lines, counts, seed);
        for (kind, text) in [("ties", &tables.ties), ("control", &tables.control)] {
            let path = draft.root().join(format!("{}_{kind}.csv", orbit.name));
            put(&path, text).in_file(&path)?;
        }
        truth.points_m.insert(&orbit.name, tables.points_m);
    }
    let truth = serde_json::to_string_pretty(&truth).unwrap_or_default() + "\n";
    for (name, text) in [("truth.json", &*truth), ("calibration.toml", CALIBRATION)] {
        let path = draft.root().join(name);
        put(&path, text).in_file(&path)?;
    }
    draft.finish()?;
    let [ties, control] = POINTS[0];
    Ok(format!(
        "{}: two stereo lines in two orbits, {ties} tie points, {control} laser points; next: areograph calibrate {}",
        directory.display(),
        directory.join("calibration.toml").display()
    ))
}

fn tables(orbit: &Orbit, lines: &[StereoLine; 2], counts: [usize; 2], seed: u64) -> Tables {
    let mut random = Random::new(seed, &format!("calibration points of {}", orbit.name));
    let mut tables = Tables {
        ties: "point,camera,line,sample\n".to_owned(),
        control: "point,camera,line,sample,longitude_deg,latitude_deg,radius_m\n".to_owned(),
        points_m: BTreeMap::new(),
    };
    for (kind, count) in ["T", "L"].into_iter().zip(counts) {
        let mut number = 0;
        while number < count {
            let place_m = orbit.ground(random.between(0.0, 1.0), random.between(-SWATH, SWATH));
            let seen = lines.each_ref().map(|line| orbit.sees(line, &place_m));
            let [Some(first), Some(second)] = seen else {
                continue;
            };
            number += 1;
            let name = format!("{kind}{number:03}");
            let noise_px = if kind == "T" { TIE_PX } else { CONTROL_PX };
            let laser_m = laser(&place_m, &mut random);
            for (line, place) in lines.iter().zip([first, second]) {
                let at = place.map(|at| at + noise_px * random.normal());
                let image = format!("{name},{},{:.4},{:.4}", line.name, at[0], at[1]);
                // Writing to a string cannot fail.
                let _infallible = if kind == "T" {
                    writeln!(tables.ties, "{image}")
                } else {
                    writeln!(tables.control, "{image},{}", degrees(&laser_m))
                };
            }
            tables.points_m.insert(name, place_m.into());
        }
    }
    tables
}

/// The laser's measurement of a position.
fn laser(place_m: &Vector3<f64>, random: &mut Random) -> Vector3<f64> {
    let off_m = Vector3::new(
        HORIZONTAL_M * random.normal(),
        HORIZONTAL_M * random.normal(),
        0.0,
    );
    let moved_m = place_m + local_axes(place_m).tr_mul(&off_m);
    moved_m.normalize() * (place_m.norm() + VERTICAL_M * random.normal())
}

/// Longitude and latitude in degrees, radius in metres.
pub(super) fn degrees(place_m: &Vector3<f64>) -> String {
    let radius_m = place_m.norm();
    format!(
        "{:.9},{:.9},{radius_m:.4}",
        place_m.y.atan2(place_m.x).to_degrees(),
        (place_m.z / radius_m).asin().to_degrees()
    )
}

const CALIBRATION: &str = "\
calibration = \"synthetic_lines\"
description = \"Two synthetic stereo lines after Li et al. 2023\"

[[cameras]]
id = \"s1\"
isd = \"isd/i864_s1.json\"

[[cameras]]
id = \"s2\"
isd = \"isd/i864_s2.json\"

[ties]
files = [\"i864_ties.csv\"]
sigma_px = 0.2

[control]
files = [\"i864_control.csv\"]
sigma_px = 1.0
sigma_horizontal_m = 100.0
sigma_vertical_m = 10.0

[[validation]]
id = \"i818\"
isd = [\"isd/i818_*.json\"]
ties = [\"i818_ties.csv\"]
control = [\"i818_control.csv\"]
";
