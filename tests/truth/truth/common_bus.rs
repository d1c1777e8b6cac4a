//! Camera and laser on one bus: where the mounting has the laser in an image that was exposed meanwhile tells the place
//! across the flight, and what is stated of place, boresight and profiles holds; mistakes of it are noticed.

use std::{
    fs,
    ops::RangeInclusive,
    path::{Path, PathBuf},
};

use areograph::pds::pedr::{LABEL_BYTES, RECORD_BYTES, Record};
use nalgebra::Vector3;

use super::{
    Judged, SITES,
    common::{json, long_test, mission::succeed},
    is_within,
    relief::drawn_shift_m,
    root_mean_square, run, scene, seeds, vector,
};

const KEYS: &str = "common_bus = \"yes\"\n";
/// Relief would determine the position as well.
const ALONE: &str = "relief_for_plan = \"no\"\n";

/// A site run without the laser's place in images and with it.
struct Both {
    plain: Judged,
    bus: Judged,
    /// Angles of the boresight: found minus drawn, over what is stated.
    angles: [f64; 2],
    /// Shifts of profiles, likewise.
    shifts: Vec<Vector3<f64>>,
}

/// Adds keys to the adjustment of every site of a mission.
fn configure(mission: &Path, keys: &str) {
    for site in SITES {
        let path = mission.join(format!("sites/{site}.toml"));
        let text = fs::read_to_string(&path).unwrap();
        assert!(text.contains("[adjustment]\n"), "{text}");
        let text = text.replacen("[adjustment]\n", &format!("[adjustment]\n{keys}"), 1);
        fs::write(&path, text).unwrap();
    }
}

fn both_ways(folder: &Path, seed: u32, options: &[&str], keys: &str) -> Vec<Both> {
    let mission = scene(folder, seed, options);
    let [plain, bus] = ["plain", "bus"].map(|way| folder.join(way));
    configure(&mission, ALONE);
    succeed(&mut run(&mission, &plain));
    for site in SITES {
        let path = mission.join(format!("sites/{site}.toml"));
        let text = fs::read_to_string(&path).unwrap();
        fs::write(&path, text.replacen(ALONE, "", 1)).unwrap();
    }
    configure(&mission, keys);
    succeed(&mut run(&mission, &bus));
    let truth = json(&mission.join("truth.json"));
    let drawn = &truth["errors_drawn"][0]["boresight_rad"];
    let both = SITES.map(|site| {
        let document = json(&bus.join(site).join("adjustment.json"));
        let found = &document["adjustment"]["boresight"];
        let angle = |axis: usize| {
            let number = |of: &serde_json::Value| of[axis].as_f64().unwrap();
            (number(&found["angles_rad"]) - number(drawn)) / number(&found["sigma_rad"])
        };
        let shifts = found["profile_shifts"].as_array().unwrap().iter();
        Both {
            plain: Judged::of(&mission, &plain, site),
            bus: Judged::of(&mission, &bus, site),
            angles: [0, 1].map(angle),
            shifts: shifts
                .map(|shift| {
                    let off_m = vector(&shift["shift_m"])
                        - drawn_shift_m(&truth, shift["profile"].as_str().unwrap());
                    off_m.component_div(&vector(&shift["sigma_m"]))
                })
                .collect(),
        }
    });
    for folder in [plain, bus, mission] {
        fs::remove_dir_all(folder).unwrap();
    }
    both.into()
}

/// A test of what is stated with some keys.
struct Trial<'a> {
    seeds: RangeInclusive<u32>,
    /// How many seeds are in every run.
    few: usize,
    /// Of the mission.
    options: &'a [&'a str],
    keys: &'a str,
    /// Axes towards which the place becomes better known: 0 east, nearly across the flight, 1 north.
    better: &'a [usize],
    /// Root mean squares of so many values over their standard deviations lie within these by chance.
    limits: [f64; 2],
}

/// Across the flight alone, as without knowledge of line times.
const ACROSS: Trial<'_> = Trial {
    seeds: 401..=412,
    few: 12,
    options: &["--realistic"],
    keys: "common_bus = \"yes\"\nrelief_for_plan = \"no\"\n",
    better: &[0],
    limits: [0.75, 1.3],
};

/// Runs both ways, and holds what is stated against truth.
#[allow(clippy::print_stdout, reason = "what was measured is worth reading")]
fn holds(trial: Trial<'_>) {
    let folder = tempfile::tempdir().unwrap();
    let limits = trial.limits;
    let sites: Vec<Both> = seeds(trial.seeds, trial.few)
        .into_iter()
        .flat_map(|seed| both_ways(folder.path(), seed, trial.options, trial.keys))
        .collect();
    let within = |value: f64| is_within(value, limits, sites.len());
    for site in &sites {
        let [plain, bus] = [&site.plain, &site.bus].map(|of| (of.mean_m(), of.mean_sigmas_m));
        println!(
            "{:26} {:6.1} {:6.1} {:5.1} ± {:.0} {:.0} {:.1} m without, {:6.1} {:6.1} {:5.1} ± {:.0} {:.0} {:.1} m with it; angles {:.2} {:.2} of what is stated",
            site.bus.name,
            plain.0.x,
            plain.0.y,
            plain.0.z,
            plain.1.x,
            plain.1.y,
            plain.1.z,
            bus.0.x,
            bus.0.y,
            bus.0.z,
            bus.1.x,
            bus.1.y,
            bus.1.z,
            site.angles[0],
            site.angles[1],
        );
        assert_eq!(site.bus.kept_blunders, [""; 0], "{}", site.bus.name);
    }
    for (axis, name) in ["east", "north", "up"].into_iter().enumerate() {
        let rms = |of: fn(&Both) -> &Judged, over: bool| {
            root_mean_square(sites.iter().map(|site| {
                let judged = of(site);
                let sigma = if over {
                    judged.mean_sigmas_m[axis]
                } else {
                    1.0
                };
                judged.mean_m()[axis] / sigma
            }))
        };
        let [plain_m, bus_m] = [rms(|of| &of.plain, false), rms(|of| &of.bus, false)];
        let [plain, bus] = [rms(|of| &of.plain, true), rms(|of| &of.bus, true)];
        println!(
            "{name}: {plain_m:.1} m without ({plain:.2} of what is stated), {bus_m:.1} m with it ({bus:.2})"
        );
        assert!(within(bus), "{name}: {bus}");
    }
    // Better known, and stated so.
    for axis in trial.better {
        for site in &sites {
            let [plain_m, bus_m] = [&site.plain, &site.bus].map(|of| of.mean_sigmas_m[*axis]);
            let name = &site.bus.name;
            assert!(bus_m < 0.75 * plain_m, "{name}: {bus_m} {plain_m}");
        }
    }
    for axis in 0..2 {
        let angles = root_mean_square(sites.iter().map(|site| site.angles[axis]));
        println!("angle {axis} of the boresight: {angles:.2} of what is stated");
        // One draw a mission, which its three sites share.
        assert!(angles < 2.0, "{axis}: {angles}");
    }
    for axis in 0..3 {
        let shifts: Vec<f64> = sites
            .iter()
            .flat_map(|site| site.shifts.iter().map(|shift| shift[axis]))
            .collect();
        let shifts = root_mean_square(shifts.into_iter());
        println!("shifts of profiles, axis {axis}: {shifts:.2} of what is stated");
        assert!(within(shifts), "{axis}: {shifts}");
    }
}

#[test]
fn the_laser_tells_the_place_across_the_flight() {
    // 6 values: chance gives 0.33 to 1.76 in 99 of 100 cases.
    holds(Trial {
        seeds: 401..=402,
        few: 1,
        limits: [0.33, 1.76],
        ..ACROSS
    });
}

/// Over more missions, decision 0021 states the result.
#[test]
fn the_place_by_the_laser_holds_over_36_sites() {
    if !long_test("the place by the laser over 36 sites, four minutes") {
        return;
    }
    holds(ACROSS);
}

#[test]
fn the_place_by_laser_and_relief_holds_over_36_sites() {
    if !long_test("the place by laser and relief over 36 sites, four minutes") {
        return;
    }
    let keys = format!("{KEYS}relief_for_plan = \"yes\"\n");
    holds(Trial {
        keys: &keys,
        ..ACROSS
    });
}

#[test]
fn where_line_times_are_right_the_laser_tells_the_place_along_the_flight_too() {
    // Attitudes that were read at the wrong time, by which nadir images are off: the prior alone does not know.
    holds(Trial {
        seeds: 421..=422,
        few: 1,
        options: &["--realistic", "--attitude-clock"],
        keys: &format!("{KEYS}{ALONE}boresight_line_time_sigma_ms = 0.0\n"),
        better: &[0, 1],
        limits: [0.2, 1.76],
    });
}

/// What one site of a mission with a mistake ends in: its exit code, what is told, and its output.
fn ending(mission: &Path, name: &str, change: impl Fn(String) -> String) -> (i32, String, PathBuf) {
    let text = fs::read_to_string(mission.join("sites/isidis.toml")).unwrap();
    let text = change(text.replacen("[adjustment]\n", &format!("[adjustment]\n{KEYS}{ALONE}"), 1));
    let path = mission.join(format!("sites/{name}.toml"));
    fs::write(&path, text).unwrap();
    let out = mission.join(name);
    let mut run = super::common::mission::areograph();
    run.args(["--quiet", "run"])
        .arg(path)
        .arg("--out")
        .arg(&out);
    let output = run.output().unwrap();
    let manifest = fs::read_to_string(out.join("isidis/manifest.json")).unwrap();
    (output.status.code().unwrap(), manifest, out)
}

/// A realistic mission, written for one test.
fn realistic() -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let mission = scene(folder.path(), 401, &["--realistic"]);
    (folder, mission)
}

const LASER: &str = include_str!("../../../config/altimeters/mola.toml");

/// How the site ends with another laser.
fn with_laser(mission: &Path, name: &str, file: &str) -> (i32, String, PathBuf) {
    assert!(file != LASER);
    fs::write(mission.join(format!("sites/{name}.laser.toml")), file).unwrap();
    ending(mission, name, |text| {
        format!("altimeter = \"{name}.laser.toml\"\n{text}")
    })
}

/// The camera is mounted 2.0 mrad from the beam across the flight and 1.3 mrad along it: with either sign turned.
#[test]
fn a_beam_with_a_turned_sign_contradicts_the_images() {
    let (_folder, mission) = realistic();
    let with_beam = |name: &str, beam: &str| {
        let file = LASER.replace("bus = [0.0, 0.0, 1.0]", &format!("bus = {beam}"));
        with_laser(&mission, name, &file)
    };
    let (code, told, _) = with_beam("across", "[0.0, -0.0039934, 1.0]");
    assert!(
        code == 5 && told.contains("laser and images contradict each other"),
        "{told}"
    );
    let (code, told, out) = with_beam("along", "[-0.0025126, 0.0, 1.0]");
    // Along the flight the laser shows nothing that line times would not hide: the place holds, or the contradiction is
    // reported.
    let site = Judged::of(&mission, &out, "isidis");
    let holds = (0..2).all(|axis| site.mean_m()[axis].abs() < 3.5 * site.mean_sigmas_m[axis]);
    println!("sign turned along the flight: exit {code}, place holds: {holds}");
    assert!(
        holds || (code == 5 && told.contains("laser and images contradict")),
        "{told}"
    );
}

/// Shots that are taken for simultaneous with what was exposed five seconds later; a day without a profile of one
/// image; and an altimeter whose beam nobody knows.
#[test]
fn shots_of_another_time_and_missing_ones_are_reported() {
    let (_folder, mission) = realistic();
    let (code, told, _) = ending(&mission, "late", |text| {
        text.replace("bias_s = 0.117", "bias_s = 5.0")
    });
    assert!(
        code == 5 && told.contains("laser and images contradict each other"),
        "{told}"
    );
    let (_, told, _) = ending(&mission, "one", |text| {
        let line = text
            .lines()
            .find(|line| line.starts_with("files = [\"../pedr"))
            .unwrap();
        let first = line.split(", ").next().unwrap();
        text.replacen(line, &format!("{first}]"), 1)
    });
    assert!(
        told.contains("adjustment.common_bus does not control E02-"),
        "{told}"
    );
    let (_, told, _) = with_laser(&mission, "unknown", &LASER[..LASER.find("[beam]").unwrap()]);
    assert!(
        told.contains("adjustment.common_bus has no effect: the altimeter file does not state"),
        "{told}"
    );
}

/// Every frame is recorded 59 m to either side in turn: together they state nothing wrong of laser and profile, and
/// every one contradicts them. Every fourth 440 m: the images would have to bend, and the network falls apart.
#[test]
fn frames_that_contradict_each_other_are_reported() {
    let (_folder, mission) = realistic();
    let remark = "image coordinates of laser spots exceed 3.29";
    let refused = "contradicts the rest of the network";
    let (_, told, _) = ending(&mission, "sound", |text| text);
    assert!(!told.contains(remark), "{told}");
    spoil_shots(&mission, 1, 1_000);
    let (_, told, _) = ending(&mission, "spoiled", |text| text);
    assert!(told.contains(remark) && !told.contains(refused), "{told}");
    spoil_shots(&mission, 1, -1_000);
    spoil_shots(&mission, 4, 7_500);
    let (_, told, _) = ending(&mission, "torn", |text| text);
    assert!(told.contains(refused), "{told}");
}

/// Records one of `every` so many frames of all PEDR files `step` microdegrees east or west of its place, in turn.
fn spoil_shots(mission: &Path, every: usize, step: i32) {
    const LONGITUDE: usize = std::mem::offset_of!(Record, ground_longitude_microdegrees);
    for entry in fs::read_dir(mission.join("pedr")).unwrap() {
        let path = entry.unwrap().path();
        let mut bytes = fs::read(&path).unwrap();
        for (number, record) in bytes[LABEL_BYTES..]
            .chunks_exact_mut(RECORD_BYTES)
            .enumerate()
        {
            if number % every == 0 {
                let field = &mut record[LONGITUDE..LONGITUDE + 4];
                let step = if number % (2 * every) == 0 {
                    step
                } else {
                    -step
                };
                let longitude = i32::from_be_bytes(field.try_into().unwrap()) + step;
                field.copy_from_slice(&longitude.to_be_bytes());
            }
        }
        fs::write(&path, bytes).unwrap();
    }
}
