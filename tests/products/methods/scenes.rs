//! The scenes: small inputs that are the same everywhere, and what runs on them.

use std::{
    fs,
    path::{Path, PathBuf},
    sync::atomic::AtomicBool,
};

use areograph::{
    altimetry::{BiasScope, GroundRadius, MolaClock, TagSign},
    body::Body,
    config::{CalibrationConfig, Document as _, NetConfig, SiteConfig},
    flow::{ArchiveRequest, PUBLISH, Task, archive_filter},
    scene::{
        SceneOptions, write_calibration_loop_scene, write_calibration_scene, write_plane_scene,
        write_scene, write_terrain_model_scene,
    },
    stages::match_laser::{MatchImage, MatchOptions, MatchRequest},
    watch::Watch,
};

use crate::common::{
    flows::run_into,
    pair::{write_pair_on_shots, write_three_images},
};

/// Inputs and a flow over them.
pub(crate) struct Scene {
    /// Its name in the ledger.
    pub(crate) name: &'static str,
    /// Writes the inputs into a folder.
    pub(crate) write: fn(&Path),
    /// Runs the flow in a folder with inputs; where its outputs are stored.
    pub(crate) run: fn(&Path) -> PathBuf,
    /// Of stages that share a name, and of steps that are no stages, the type or the file that is behind a name here.
    pub(crate) declared: &'static [(&'static str, &'static str)],
}

/// Scenes that take seconds. The last one, whose pixels are matched, takes most.
pub(crate) static SHORT: [Scene; 7] = [
    Scene {
        name: "mission",
        write: write_mission,
        run: run_mission,
        declared: &[
            ("search_footprints", "SearchFootprints"),
            ("check_ranges", "CheckRanges"),
            ("match_ties", "MatchTies"),
            (PUBLISH, "flow/publish.rs"),
        ],
    },
    Scene {
        name: "archive",
        write: write_mission,
        run: run_archive,
        declared: &[
            ("check_archive", "stages/check_archive/mod.rs"),
            (PUBLISH, "flow/archive.rs"),
        ],
    },
    Scene {
        name: "net",
        write: |folder| {
            write_plane_scene(&folder.join("net"), 1).unwrap();
        },
        run: |folder| {
            let net = NetConfig::load(&folder.join("net/net.toml"))
                .unwrap()
                .config;
            run(folder, Task::Net(&net))
        },
        declared: &[(PUBLISH, "flow/net.rs")],
    },
    Scene {
        name: "tables",
        write: |folder| {
            write_calibration_scene(&folder.join("lines"), 1).unwrap();
        },
        run: calibrated,
        declared: &[("calibrate", "Calibrate"), (PUBLISH, "flow/calibration.rs")],
    },
    Scene {
        name: "model",
        write: |folder| {
            write_terrain_model_scene(&folder.join("scene"), 1).unwrap();
        },
        run: run_model,
        declared: &[
            ("match_laser", "MatchLaser"),
            (PUBLISH, "flow/laser_match.rs"),
        ],
    },
    Scene {
        name: "on_shots",
        write: write_pair_on_shots,
        run: |folder| run_site_in(folder, "pair.toml"),
        declared: &[
            ("search_footprints", "ReadShots"),
            ("check_ranges", "CheckTableRanges"),
            (PUBLISH, "flow/publish.rs"),
        ],
    },
    Scene {
        name: "pair",
        write: |folder| write_three_images(folder, 1),
        run: |folder| run_site_in(folder, "pair.toml"),
        declared: &[
            ("search_footprints", "ReadShots"),
            ("check_ranges", "CheckTableRanges"),
            ("match_ties", "MatchTies"),
            ("map_surface", "MapSurface"),
            ("join_surfaces", "JoinSurfaces"),
            (PUBLISH, "flow/publish.rs"),
        ],
    },
];

/// Scenes that take a minute and more.
pub(crate) static LONG: [Scene; 1] = [Scene {
    name: "loop",
    write: write_loop,
    run: calibrated,
    declared: &[
        ("match_ties", "MatchLines"),
        ("map_surface", "MapLines"),
        ("match_laser", "MatchModel"),
        ("calibrate", "CalibrateLines"),
        (PUBLISH, "flow/calibration.rs"),
    ],
}];

/// The site with most stages: wide-angle images, rival kernels, tie points; here also a window that is what an image sees.
const MISSION_SITE: &str = "gusev_context";

fn write_mission(folder: &Path) {
    let options = SceneOptions {
        day_s: 600.0,
        ..SceneOptions::default()
    };
    write_scene(&folder.join("mission"), &options).unwrap();
}

fn run_mission(folder: &Path) -> PathBuf {
    let sites = folder.join("mission/sites");
    let text = fs::read_to_string(sites.join(format!("{MISSION_SITE}.toml"))).unwrap();
    let (_, first) = text.split_once("[[images]]\nid = ").unwrap();
    let image = first.lines().next().unwrap().to_owned();
    let text = format!("{text}\n[[windows]]\nid = \"outline\"\nimage = {image}\n");
    fs::write(sites.join("site.toml"), text).unwrap();
    run_site_in(&sites, "site.toml")
}

fn run_archive(folder: &Path) -> PathBuf {
    let mission = folder.join("mission");
    let request = ArchiveRequest {
        paths: &[mission.join("pedr")],
        kernels: &mission.join("kernels/nav.tm"),
        clock: MolaClock {
            bias_s: 0.117,
            sign: TagSign::Late,
            scope: BiasScope::SpkLookup,
            source: "the scene".to_owned(),
        },
        allow_uncovered: true,
        workers: None,
    };
    run(folder, Task::Archive(&request))
}

/// The folder of the products of a run.
fn run(folder: &Path, task: Task<'_>) -> PathBuf {
    let outcome = run_into(task, &folder.join("out"), false).unwrap();
    assert!(outcome.left_out.is_empty(), "{:?}", outcome.left_out);
    outcome.folder
}

/// Runs a site whose file lies in `folder`.
fn run_site_in(folder: &Path, file: &str) -> PathBuf {
    let config = SiteConfig::load(&folder.join(file)).unwrap().config;
    run(folder, Task::Site(&config))
}

fn calibrated(folder: &Path) -> PathBuf {
    let config = CalibrationConfig::load(&folder.join("lines/calibration.toml"));
    let config = config.unwrap().config;
    run(folder, Task::Calibration(&config))
}

/// Smaller ground has too few places for shots that judge; two rounds call all that more of them call.
fn write_loop(folder: &Path) {
    write_calibration_loop_scene(
        &folder.join("lines"),
        1,
        Watch::from(&AtomicBool::new(false)),
    )
    .unwrap();
    let path = folder.join("lines/calibration.toml");
    let text = fs::read_to_string(&path).unwrap();
    let (was, is) = ("search_cells = 30", "search_cells = 30\nrounds_max = 2");
    assert!(text.contains(was));
    fs::write(path, text.replace(was, is)).unwrap();
}

fn run_model(folder: &Path) -> PathBuf {
    let scene = folder.join("scene");
    let image = |name: &str| MatchImage {
        name: name.to_owned(),
        isd: scene.join(format!("isd/{name}.json")),
    };
    let request = MatchRequest {
        options: MatchOptions {
            segment_points: 15,
            segment_drift: None,
            least_variance_m2: 1_000.0,
            similarity: None,
            search_cells: 15,
            least_score: 0.9,
            least_contrast: 1.0,
            limit_m: 60.0,
            seed: 1,
            ground: GroundRadius::Corrected,
            filter: archive_filter(),
        },
        body: Body::Mars,
        radius_m: None,
        heights_apart: false,
        model: scene.join("model.tif"),
        pedr: vec![scene.join("pedr")],
        images: vec![image("s1"), image("s2")],
    };
    run(folder, Task::Match(&request))
}
