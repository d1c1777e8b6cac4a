//! Three lines of a camera in one orbit with their pixels, laser passes over the ground in two directions, and true
//! values: the input of `areograph calibrate` from pixels.

use std::{collections::BTreeMap, path::Path};

use serde::Serialize;

use super::{
    calibration::drawn_offset,
    error_sources::{Relief, Roughness},
    files::{Draft, put},
    line_images::LineImages,
    mission::TrueGround,
    passes::Passes,
    pushbroom_pair::{Orbit, OrbitError, StereoLine},
    terrain::Terrain,
};
use areograph_base::{
    error::{Locate as _, Result},
    units::RADIANS_PER_DEGREE,
    watch::Watch,
};

const README: &str = "Three lines of a camera in one orbit: support data (isd/), pixels (images/), PEDR files of laser passes in two\n\
    directions over the same ground (pedr/) and a calibration file. The lines are mounted askew, and the orbit is wrong by\n\
    hundreds of metres; truth.json states these errors and the true image coordinates of ground points.\n\
    Next: areograph calibrate calibration.toml\n";

/// Middle of the ground.
const LONGITUDE_DEG: f64 = -63.13;
const LATITUDE_DEG: f64 = -33.0;
/// Lines and samples of an image: 65 by 22 km.
const SIZE: [u32; 2] = [2_400, 800];
/// Laser passes over that ground: those of one direction are 1.4 km apart; both together are as dense as the 126 over a
/// whole swath in Li et al. 2023.
const PASSES: Passes = Passes {
    longitude_rad: LONGITUDE_DEG * RADIANS_PER_DEGREE,
    latitude_rad: LATITUDE_DEG * RADIANS_PER_DEGREE,
    of_direction: 17,
    half_width_m: 12_000.0,
    half_s: 12.0,
};
/// Points along and across the ground with true image coordinates, and the share of the swath that they cover.
const CHECKED: [u32; 2] = [19, 7];
const CHECKED_SHARE: [f64; 2] = [0.84, 0.9];

/// A scene of three lines and the ground that they see.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LineScene {
    /// Seed of the ground and of noise.
    pub seed: u64,
    /// Lines and samples of an image.
    pub size: [u32; 2],
    /// Whether support data have errors of the mounting and the orbit; otherwise they are exact.
    pub is_wrong: bool,
}

impl LineScene {
    /// The ground of the scene.
    #[must_use]
    pub fn ground(&self) -> TrueGround {
        let middle = orbit(self).ground(0.5, 0.0).normalize();
        let relief = Relief::SelfAffine(Roughness::Rough);
        TrueGround(Terrain::new(self.seed, &[middle], relief))
    }

    /// Images of 65 by 22 km, support data with errors.
    #[must_use]
    pub const fn of_seed(seed: u64) -> Self {
        Self {
            seed,
            size: SIZE,
            is_wrong: true,
        }
    }

    /// Passes of the same density over less ground.
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "some passes"
    )]
    fn passes(&self) -> Passes {
        let [along, across] = [0, 1].map(|axis| f64::from(self.size[axis]) / f64::from(SIZE[axis]));
        Passes {
            of_direction: (f64::from(PASSES.of_direction) * across).ceil() as u32,
            half_width_m: PASSES.half_width_m * across,
            half_s: PASSES.half_s * along,
            ..PASSES
        }
    }
}

/// The true lines: drawn offsets, the errors of the paper's synthetic case, and a third line between them.
fn lines(scene: &LineScene) -> [StereoLine; 3] {
    let wrong = if scene.is_wrong { 1.0 } else { 0.0 };
    let offset = |line, angles_deg: [f64; 3]| {
        drawn_offset(scene.seed, line, angles_deg.map(|angle| wrong * angle))
    };
    let half = 0.5 * f64::from(scene.size[1]);
    let errors = |sense: f64| {
        let sense = wrong * sense;
        let [m1, n1, n2] = [2e-7 * half, 1e-7 * half, 1e-11 * half * half];
        [sense * m1, sense * n1, sense * n2]
    };
    [
        StereoLine {
            name: "s1",
            pitch_deg: 18.9,
            offset: offset("s1", [0.055, 0.020, 0.030]),
            errors: errors(1.0),
        },
        StereoLine {
            name: "nd",
            pitch_deg: 0.0,
            offset: offset("nd", [0.010, -0.012, 0.015]),
            errors: errors(0.5),
        },
        StereoLine {
            name: "s2",
            pitch_deg: -18.9,
            offset: offset("s2", [-0.050, -0.015, -0.020]),
            errors: errors(-1.0),
        },
    ]
}

fn orbit(scene: &LineScene) -> Orbit {
    let wrong = if scene.is_wrong { 1.0 } else { 0.0 };
    Orbit {
        name: "i864".to_owned(),
        start_et_s: 596_764_800.0,
        longitude_deg: LONGITUDE_DEG,
        latitude_deg: LATITUDE_DEG,
        size: scene.size,
        is_steered: true,
        error: OrbitError {
            bias_m: [350.0, 500.0, -420.0].map(|of| wrong * of),
            drift_m_per_line: [0.006, -0.006, 0.006].map(|of| wrong * of),
        },
    }
}

/// The file of true values.
#[derive(Serialize)]
struct Truth {
    made_by: &'static str,
    synthetic: &'static str,
    seed: u64,
    /// φ, ω and κ of every line, degrees.
    angles_deg: BTreeMap<&'static str, [f64; 3]>,
    /// Bias of the orbit, true minus support data, Mars-fixed metres.
    orbit_bias_m: [f64; 3],
    /// Its drift, metres a line.
    orbit_drift_m_per_line: [f64; 3],
    /// Ground points that all lines see.
    checked: Vec<Checked>,
}

/// A ground point and its true image coordinates in the lines.
#[derive(Serialize)]
struct Checked {
    /// Mars-fixed metres.
    place_m: [f64; 3],
    /// Line and sample.
    seen: BTreeMap<&'static str, [f64; 2]>,
}

/// Writes three lines with their pixels and laser passes into `directory`, replacing an older scene unless files were
/// added or changed. The same seed gives the same bytes.
///
/// # Errors
/// [`SceneError`](super::SceneError) when the folder holds something else; errors of writing.
pub fn write_calibration_loop_scene(
    directory: &Path,
    seed: u64,
    watch: Watch<'_>,
) -> Result<String> {
    write_line_scene(directory, &LineScene::of_seed(seed), watch)
}

/// Writes such a scene of another size, or one with exact support data.
///
/// # Errors
/// Those of [`write_calibration_loop_scene`].
pub fn write_line_scene(directory: &Path, scene: &LineScene, watch: Watch<'_>) -> Result<String> {
    let seed = scene.seed;
    let draft = Draft::begin(directory, README)?;
    let [isd, images, pedr] = ["isd", "images", "pedr"].map(|folder| draft.folder(folder));
    let (isd, images, pedr) = (isd?, images?, pedr?);
    let (lines, orbit, passes) = (lines(scene), orbit(scene), scene.passes());
    let TrueGround(terrain) = scene.ground();
    let rendered = LineImages {
        orbit: &orbit,
        terrain: &terrain,
        seed,
    };
    watch.announce(lines.len() * orbit.size[0] as usize);
    for line in &lines {
        let path = isd.join(format!("{}.json", line.name));
        put(&path, &orbit.support_data(line)).in_file(&path)?;
        let path = images.join(format!("{}.tif", line.name));
        rendered.write(&path, line, watch).in_file(&path)?;
    }
    passes.write(&pedr, &terrain, seed)?;
    let truth = Truth {
        made_by: "areograph scene",
        synthetic: "not from mission data",
        seed,
        angles_deg: (lines.iter())
            .map(|line| {
                let of = &line.offset;
                let angles = [of.phi_rad, of.omega_rad, of.kappa_rad];
                (line.name, angles.map(f64::to_degrees))
            })
            .collect(),
        orbit_bias_m: orbit.error.bias_m,
        orbit_drift_m_per_line: orbit.error.drift_m_per_line,
        checked: checked(&orbit, &lines, &terrain),
    };
    let truth = serde_json::to_string_pretty(&truth).unwrap_or_default() + "\n";
    for (name, text) in [("truth.json", &*truth), ("calibration.toml", CALIBRATION)] {
        let path = draft.root().join(name);
        put(&path, text).in_file(&path)?;
    }
    draft.finish()?;
    Ok(format!(
        "{}: three lines with pixels, {} laser passes over the same ground; next: areograph calibrate {}",
        directory.display(),
        passes.count(),
        directory.join("calibration.toml").display()
    ))
}

/// Ground points on a regular grid that all lines see.
fn checked(orbit: &Orbit, lines: &[StereoLine], terrain: &Terrain) -> Vec<Checked> {
    let [along, across] = CHECKED;
    let share = |at: u32, of: u32| f64::from(at) / f64::from(of - 1) - 0.5;
    let all = (0..along).flat_map(|row| (0..across).map(move |column| [row, column]));
    let checked = all.filter_map(|[row, column]| {
        let along = 0.5 + CHECKED_SHARE[0] * share(row, along);
        let across = 2.0 * CHECKED_SHARE[1] * share(column, across);
        let direction = orbit.ground(along, across).normalize();
        let place_m = direction * terrain.radius_m(&direction);
        let seen = lines
            .iter()
            .map(|line| Some((line.name, orbit.sees(line, &place_m)?)));
        Some(Checked {
            place_m: place_m.into(),
            seen: seen.collect::<Option<_>>()?,
        })
    });
    checked.collect()
}

const CALIBRATION: &str = "\
calibration = \"synthetic_loop\"
description = \"Three synthetic lines from their pixels, after Li et al. 2023\"

[[cameras]]
id = \"s1\"
isd = \"isd/s1.json\"
pixels = \"images/s1.tif\"

[[cameras]]
id = \"nd\"
isd = \"isd/nd.json\"
pixels = \"images/nd.tif\"

[[cameras]]
id = \"s2\"
isd = \"isd/s2.json\"
pixels = \"images/s2.tif\"

[ties]
match = true

[laser]
files = [\"pedr/*.b\"]
cell_m = 100
search_cells = 30

[control]
sigma_px = 0.03
sigma_horizontal_m = 1.0
sigma_vertical_m = 1.0

[a_priori]
control_angle_deg = 0.3
look_px = 10.0
";
