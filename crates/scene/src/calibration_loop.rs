//! Three lines of a camera in one orbit with their pixels, laser passes over the ground in two directions, and true
//! values: the input of `areograph calibrate` from pixels.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use serde::Serialize;

use super::{
    calibration::drawn_offset,
    calibration_orbits::{OrbitsScene, drawn_attitude_deg, drawn_orbit, years_after},
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
pub(super) const SIZE: [u32; 2] = [2_400, 800];
/// Laser passes over that ground: those of one direction are 1.4 km apart; both together are as dense as the 126 over a
/// whole swath in Li et al. 2023.
const OF_DIRECTION: u32 = 17;
const HALF_WIDTH_M: f64 = 12_000.0;
const HALF_S: f64 = 12.0;
/// Orbits between the passes over the ground of one orbit and those of the next.
const ORBITS_APART: u32 = 100;
/// Standard deviations of the position of a pass, metres: towards the east and the north each, and radially.
///
/// # Source
/// 100 m in the horizontal and 1 m radially: Neumann et al. 2001, as Shan et al. 2005 cite them.
const PASS_SIGMA_M: [f64; 2] = [70.0, 1.0];
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
    /// Errors of support data, images and laser passes.
    pub errors: LineErrors,
}

/// Errors of a scene of three lines.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LineErrors {
    /// Support data are exact; images have noise.
    Exact,
    /// Mounting and orbit are wrong by certain amounts; images have noise.
    Certain,
    /// Errors of one of several orbits, of its images and of its laser passes.
    Drawn(OneOfOrbits),
}

/// One of several orbits of an ageing camera.
///
/// Every laser pass has an error in its position. Images have shadows, light that depends on the look direction and moves with the Sun,
/// another response in every line, and loss by compression.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OneOfOrbits {
    /// Number of the orbit, from 0.
    pub number: u32,
    /// All orbits; their seed is that of the scene.
    pub of: OrbitsScene,
}

impl LineScene {
    /// The ground of the scene.
    #[must_use]
    pub fn ground(&self) -> TrueGround {
        let middle = self.orbit().ground(0.5, 0.0).normalize();
        let relief = Relief::SelfAffine(Roughness::Rough);
        TrueGround(Terrain::new(self.seed, &[middle], relief))
    }

    /// Images of 65 by 22 km, support data with errors.
    #[must_use]
    pub const fn of_seed(seed: u64) -> Self {
        Self {
            seed,
            size: SIZE,
            errors: LineErrors::Certain,
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
        let orbit = self.orbit();
        let (first_orbit, shift_sigma_m) = match self.errors {
            LineErrors::Drawn(of) => (1 + ORBITS_APART * of.number, PASS_SIGMA_M),
            LineErrors::Exact | LineErrors::Certain => (1, [0.0; 2]),
        };
        Passes {
            longitude_rad: orbit.longitude_deg * RADIANS_PER_DEGREE,
            latitude_rad: orbit.latitude_deg * RADIANS_PER_DEGREE,
            of_direction: (f64::from(OF_DIRECTION) * across).ceil() as u32,
            half_width_m: HALF_WIDTH_M * across,
            half_s: HALF_S * along,
            first_orbit,
            shift_sigma_m,
        }
    }

    /// Share of the errors of the mounting that the scene has.
    const fn wrong(&self) -> f64 {
        match self.errors {
            LineErrors::Exact => 0.0,
            LineErrors::Certain | LineErrors::Drawn(_) => 1.0,
        }
    }

    /// The true lines: drawn offsets, the errors of the paper's synthetic case, and a third line between them.
    fn lines(&self) -> [StereoLine; 3] {
        let wrong = self.wrong();
        let half = 0.5 * f64::from(self.size[1]);
        let line = |name, pitch_deg, angles_deg: [f64; 3], sense: f64| {
            let sense = wrong * sense;
            let [m1, n1, n2] = [2e-7 * half, 1e-7 * half, 1e-11 * half * half];
            let mut line = StereoLine {
                name,
                pitch_deg,
                offset: drawn_offset(self.seed, name, angles_deg.map(|angle| wrong * angle)),
                errors: [sense * m1, sense * n1, sense * n2],
            };
            if let LineErrors::Drawn(of) = self.errors {
                let roll_px = of.of.ageing_px_per_year * years_after(of.number);
                line.age(roll_px * StereoLine::pixel(), half);
                line.turn(drawn_attitude_deg(&of.of, of.number));
            }
            line
        };
        [
            line("s1", 18.9, [0.055, 0.020, 0.030], 1.0),
            line("nd", 0.0, [0.010, -0.012, 0.015], 0.5),
            line("s2", -18.9, [-0.050, -0.015, -0.020], -1.0),
        ]
    }

    fn orbit(&self) -> Orbit {
        let wrong = self.wrong();
        if let LineErrors::Drawn(of) = self.errors {
            return drawn_orbit(&of.of, of.number, self.size, true);
        }
        Orbit {
            name: "i864".to_owned(),
            start_et_s: 596_764_800.0,
            longitude_deg: LONGITUDE_DEG,
            latitude_deg: LATITUDE_DEG,
            size: self.size,
            is_steered: true,
            error: OrbitError {
                bias_m: [350.0, 500.0, -420.0].map(|of| wrong * of),
                drift_m_per_line: [0.006, -0.006, 0.006].map(|of| wrong * of),
            },
        }
    }
}

/// True values of an orbit.
#[derive(Serialize)]
pub(super) struct Truth {
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
    let draft = Draft::begin(directory, README)?;
    let folders = Folders::of(&draft)?;
    watch.announce(LINES * scene.size[0] as usize);
    let truth = folders.write(scene, "", watch)?;
    put_truth(&draft, &truth)?;
    let path = draft.root().join("calibration.toml");
    let calibration = [NAME, &CAMERAS.replace("PREFIX", ""), CONTROL].concat();
    put(&path, &calibration).in_file(&path)?;
    draft.finish()?;
    Ok(format!(
        "{}: three lines with pixels, {} laser passes over the same ground; next: areograph calibrate {}",
        directory.display(),
        scene.passes().count(),
        directory.join("calibration.toml").display()
    ))
}

/// Folders of a scene.
pub(super) struct Folders {
    isd: PathBuf,
    images: PathBuf,
    pedr: PathBuf,
}

impl Folders {
    pub(super) fn of(draft: &Draft) -> Result<Self> {
        let [isd, images, pedr] = ["isd", "images", "pedr"].map(|folder| draft.folder(folder));
        Ok(Self {
            isd: isd?,
            images: images?,
            pedr: pedr?,
        })
    }

    /// Writes the files of an orbit, whose names begin with `prefix`, and returns its true values.
    pub(super) fn write(&self, scene: &LineScene, prefix: &str, watch: Watch<'_>) -> Result<Truth> {
        let (seed, lines, orbit) = (scene.seed, scene.lines(), scene.orbit());
        let TrueGround(terrain) = scene.ground();
        let rendered = LineImages {
            orbit: &orbit,
            terrain: &terrain,
            seed,
            is_fair: matches!(scene.errors, LineErrors::Drawn(_)),
        };
        for line in &lines {
            let path = self.isd.join(format!("{prefix}{}.json", line.name));
            put(&path, &orbit.support_data(line)).in_file(&path)?;
            let path = self.images.join(format!("{prefix}{}.tif", line.name));
            rendered.write(&path, line, watch).in_file(&path)?;
        }
        scene.passes().write(&self.pedr, &terrain, seed)?;
        Ok(Truth {
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
        })
    }
}

pub(super) fn put_truth(draft: &Draft, truth: &impl Serialize) -> Result<()> {
    let path = draft.root().join("truth.json");
    let truth = serde_json::to_string_pretty(truth).unwrap_or_default() + "\n";
    put(&path, &truth).in_file(&path)?;
    Ok(())
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

/// Lines of the camera.
pub(super) const LINES: usize = 3;

/// The cameras of a calibration file, whose file names begin with PREFIX, and its other inputs.
pub(super) const CAMERAS: &str = "\
[[cameras]]
id = \"s1\"
isd = \"isd/PREFIXs1.json\"
pixels = \"images/PREFIXs1.tif\"

[[cameras]]
id = \"nd\"
isd = \"isd/PREFIXnd.json\"
pixels = \"images/PREFIXnd.tif\"

[[cameras]]
id = \"s2\"
isd = \"isd/PREFIXs2.json\"
pixels = \"images/PREFIXs2.tif\"

[ties]
match = true

";

const NAME: &str = "\
calibration = \"synthetic_loop\"
description = \"Three synthetic lines from their pixels, after Li et al. 2023\"

";

const CONTROL: &str = "\
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
