//! Missions with drawn errors, run and held against their truth: what every stated number is tested by.

use std::{
    collections::BTreeMap,
    path::Path,
    sync::{Mutex, atomic::AtomicUsize, atomic::Ordering},
    thread,
};

use areograph::{
    geom::pushbroom::ExteriorOrientation as _,
    scene::{Roughness, SceneErrors, SceneOptions, write_scene},
};
use arrow_array::{RecordBatch, cast::AsArray, types::Float64Type};
use nalgebra::Vector3;
use serde_json::Value;

use super::{
    Judged, SITES,
    common::{case::Case, json},
    local,
    misregistration::{true_camera, true_footprints_m},
    run_of, table, texts, vector,
};

/// Errors of one kind of point of a site, towards east, north and up, metres.
pub(super) struct Errors {
    /// Of each point, and what is stated of it.
    pub(super) single: Vec<[Vector3<f64>; 2]>,
    /// The same of the error that the points share: of their mean.
    pub(super) shared: [Vector3<f64>; 2],
    /// Of each point without it.
    pub(super) relative: Vec<[Vector3<f64>; 2]>,
}

/// An error, and what is stated of it.
pub(super) type Pair = [f64; 2];

/// What a run states of a site, against truth.
pub(super) struct Site {
    pub(super) name: String,
    /// The verdict of its manifest; null where its input was refused.
    pub(super) verdict: Value,
    /// Whether a profile of the site lies elsewhere, which no default value describes.
    pub(super) has_misplaced_profile: bool,
    /// Number of misplaced further passes and of those that are rejected; the same of correctly placed ones.
    pub(super) further: [[usize; 2]; 2],
    /// Shifts of correctly placed further passes by crossovers, east, north and height: errors over stated standard deviations.
    pub(super) shifts: Vec<[f64; 3]>,
    /// What the adjustment states; nothing where there is none.
    pub(super) stated: Option<Stated>,
}

/// What the adjustment of a site states, against truth.
pub(super) struct Stated {
    pub(super) judged: Judged,
    /// By profile.
    pub(super) footprints: Vec<Errors>,
    pub(super) ties: Errors,
    /// Position of each camera at the exposure of its middle line, X, Y and Z.
    pub(super) cameras: Vec<[Pair; 3]>,
    /// Clock corrections by profiles at nadir, and by others.
    pub(super) clocks: [Vec<Pair>; 2],
    /// Remarks of the verdict.
    pub(super) remarks: String,
    /// The adjustment as stated.
    pub(super) adjustment: Value,
}

impl Site {
    pub(super) fn is_valid(&self) -> bool {
        self.verdict["valid"] == true
    }

    /// Texts of a list of the verdict.
    pub(super) fn list(&self, list: &str) -> String {
        self.verdict[list].to_string()
    }
}

fn column<'a>(of: &'a RecordBatch, name: &str) -> &'a arrow_array::Float64Array {
    of.column_by_name(name)
        .unwrap()
        .as_primitive::<Float64Type>()
}

/// A row of three columns.
fn three(of: &RecordBatch, prefix: &str, row: usize) -> Vector3<f64> {
    let axes = ["east", "north", "up"].map(|axis| format!("{prefix}_{axis}_m"));
    Vector3::from(axes.map(|name| column(of, &name).value(row)))
}

impl Errors {
    /// Errors with their standard deviations, those without the shared error, and that of the shared one.
    fn of(
        single: Vec<[Vector3<f64>; 2]>,
        relative_m: &[Vector3<f64>],
        shared_m: Vector3<f64>,
    ) -> Self {
        let errors_m = single.iter().map(|[error_m, _]| error_m);
        let mean_m = errors_m.sum::<Vector3<f64>>() / single.len() as f64;
        let relative = single.iter().zip(relative_m);
        Self {
            relative: relative
                .map(|([error_m, _], sigma_m)| [error_m - mean_m, *sigma_m])
                .collect(),
            shared: [mean_m, shared_m],
            single,
        }
    }
}

/// Footprints of the adjustment against where the shots truly fell, by profile.
fn footprints(truth: &Value, folder: &Path) -> Vec<Errors> {
    let true_m = true_footprints_m(truth, &table(&folder.join("footprints.parquet")));
    let adjusted = table(&folder.join("adjusted_footprints.parquet"));
    let mut profiles: BTreeMap<String, Vec<[Vector3<f64>; 4]>> = BTreeMap::new();
    for (row, name) in texts(&adjusted, "footprint").into_iter().enumerate() {
        let (profile, footprint) = name.rsplit_once(':').unwrap();
        let Some(true_m) = true_m.get(&footprint.parse().unwrap()) else {
            continue;
        };
        let axes = ["adjusted_x_m", "adjusted_y_m", "adjusted_z_m"];
        let adjusted_m = Vector3::from(axes.map(|axis| column(&adjusted, axis).value(row)));
        let found = [
            local(true_m) * (adjusted_m - true_m),
            three(&adjusted, "sigma", row),
            three(&adjusted, "relative_sigma", row),
            three(&adjusted, "shared_sigma", row),
        ];
        profiles.entry(profile.to_owned()).or_default().push(found);
    }
    let of_profile = |found: Vec<[Vector3<f64>; 4]>| {
        let single = found.iter().map(|of| [of[0], of[1]]).collect();
        let relative_m: Vec<Vector3<f64>> = found.iter().map(|of| of[2]).collect();
        Errors::of(single, &relative_m, found[0][3])
    };
    // A profile that hardly touches an image has no mean of its own.
    let profiles = profiles.into_values().filter(|found| found.len() >= 20);
    profiles.map(of_profile).collect()
}

/// Tie points without blunders.
fn ties(mission: &Path, out: &Path, site: &str) -> Errors {
    let judged = Judged::of(mission, out, site);
    let single = judged.errors_m.iter().zip(&judged.sigmas_m);
    let single = single.map(|(error_m, sigma_m)| [*error_m, *sigma_m]);
    Errors::of(single.collect(), &judged.relative_m, judged.mean_sigmas_m)
}

/// Cameras at the exposure of the middle line.
fn cameras(own: &Value, document: &Value, folder: &Path) -> Vec<[Pair; 3]> {
    let images = document["adjustment"]["images"].as_array().unwrap();
    let cameras = images.iter().zip(own["cameras"].as_array().unwrap());
    let of_image = |(image, truth): (&Value, &Value)| {
        let id = image["image"].as_str().unwrap();
        assert_eq!(truth["image"], id);
        let found = table(&folder.join(format!("images/{id}/adjusted_orientation.parquet")));
        let offsets = column(&found, "line_offset");
        let middle = (0..found.num_rows())
            .find(|row| offsets.value(*row).abs() < 1e-6)
            .unwrap();
        let position_m =
            Vector3::from(["x_m", "y_m", "z_m"].map(|axis| column(&found, axis).value(middle)));
        let off_m = position_m - true_camera(truth).0.pose(0.0).position_m;
        [0, 1, 2].map(|axis| [off_m[axis], image["sigmas"][3 * axis].as_f64().unwrap()])
    };
    cameras.map(of_image).collect()
}

/// Clock corrections by the ranges of profiles, nadir ones first.
fn clocks(truth: &Value, folder: &Path) -> [Vec<Pair>; 2] {
    let true_s = -truth["biases"]["mola_clock_bias_s"].as_f64().unwrap();
    let images = truth["images"].as_array().unwrap();
    let mut found = [Vec::new(), Vec::new()];
    let document = json(&folder.join("ranges.json"));
    for profile in document["profiles"].as_array().unwrap() {
        let scan = &profile["bias_scan"];
        let numbers = ["best_s", "uncertainty_s"].map(|name| scan[name].as_f64());
        let ([Some(best_s), Some(uncertainty_s)], Some(image)) = (
            numbers,
            profile["simultaneous"].get(0).map(|of| &of["image"]),
        ) else {
            continue;
        };
        let look = &images.iter().find(|of| of["id"] == *image).unwrap()["look"];
        let way = usize::from(look != "nadir");
        found[way].push([best_s - true_s, uncertainty_s]);
    }
    found
}

/// Further passes over a site: names of their profiles, and their true shifts.
fn passes<'a>(truth: &'a Value, site: &'a str) -> impl Iterator<Item = (String, &'a Value)> {
    let profiles = truth["profiles"].as_array().unwrap().iter();
    profiles.filter_map(move |profile| {
        let shift = &profile["profile_shift"];
        if profile["window"] != site || shift.is_null() || profile["et_s"][0].is_null() {
            return None;
        }
        // `ap20001l.b` holds orbit 10001.
        let number: u32 = profile["file"].as_str().unwrap()[2..7].parse().unwrap();
        Some((format!("{site}/{}", number - 10_000), shift))
    })
}

/// Misplaced further passes over a site, and correctly placed ones: their number, and how many the profile check rejects.
fn further(truth: &Value, folder: &Path, site: &str) -> [[usize; 2]; 2] {
    let checked = json(&folder.join("profiles.json"));
    let rejected = checked["left_out"].as_array().unwrap();
    let mut counts = [[0; 2]; 2];
    for (name, shift) in passes(truth, site) {
        let [all, found] = &mut counts[usize::from(shift["is_misplaced"] != true)];
        *all += 1;
        *found += usize::from(rejected.iter().any(|of| of["profile"] == *name));
    }
    counts
}

/// Shifts of correctly placed further passes as stated, against the truth.
fn shifts(truth: &Value, folder: &Path, site: &str) -> Vec<[f64; 3]> {
    let checked = json(&folder.join("profiles.json"));
    let stated = checked["shifts"].as_array().unwrap();
    let placed = passes(truth, site).filter(|(_, shift)| shift["is_misplaced"] != true);
    let of_pass =
        placed.filter_map(|(name, shift)| {
            let own = stated.iter().find(|of| of["profile"] == *name)?;
            let true_m = vector(&shift["east_north_radial_m"]);
            let off_m = vector(&own["shift_m"]) - true_m;
            Some([0, 1, 2].map(|axis| {
                off_m[axis] / own["covariance_m2"][axis][axis].as_f64().unwrap().sqrt()
            }))
        });
    of_pass.collect()
}

/// Sizes of the errors of a mission.
#[derive(Clone, Copy)]
pub(super) enum Sizes {
    /// Those that areograph assumes.
    Cited,
    /// Drawn over the range of their sources, with errors that areograph does not model.
    Drawn,
}

/// A mission to fly.
#[derive(Clone, Copy)]
pub(super) struct Plan<'a> {
    pub(super) seed: u32,
    pub(super) ground: Roughness,
    /// Noise of tie points as the site files state it, pixels.
    pub(super) noise_px: f64,
    pub(super) sizes: Sizes,
    /// Image pairs of each site.
    pub(super) pairs: u32,
    /// Further laser passes over each site.
    pub(super) passes: u32,
    /// Whether sites have tie points at laser shots.
    pub(super) ties_at_shots: bool,
    /// Further keys of the adjustment.
    pub(super) keys: &'a str,
    /// Changes the errors.
    pub(super) errors: fn(&mut SceneErrors),
    /// Changes the files of the mission of a seed.
    pub(super) files: fn(&Case, u32),
    /// Sites that are run, of the mission's three.
    pub(super) sites: &'a [&'static str],
    /// Whether these files may be refused.
    pub(super) may_be_refused: bool,
}

impl Plan<'_> {
    /// With sizes that areograph does not know.
    pub(super) fn drawn(seed: u32, ground: Roughness, noise_px: f64) -> Self {
        Self {
            seed,
            ground,
            noise_px,
            sizes: Sizes::Drawn,
            pairs: 1,
            passes: 0,
            ties_at_shots: false,
            keys: "",
            errors: |_| {},
            files: |_, _| {},
            sites: &SITES,
            may_be_refused: false,
        }
    }

    fn write(&self, case: &Case) {
        // CSPICE serves one thread.
        static ONE: Mutex<()> = Mutex::new(());
        let cited = SceneErrors::realistic(self.ground);
        let mut errors = SceneErrors {
            tie_noise_px: self.noise_px,
            ..match self.sizes {
                Sizes::Cited => cited,
                Sizes::Drawn => cited.with_drawn_sizes(self.seed.into()),
            }
        };
        (self.errors)(&mut errors);
        let options = SceneOptions {
            seed: self.seed.into(),
            day_s: 600.0,
            pairs: self.pairs,
            passes: self.passes,
            ties: 154,
            ties_at_shots: self.ties_at_shots,
            errors,
        };
        {
            let _one = ONE.lock().unwrap();
            write_scene(&case.path(""), &options).unwrap();
        }
        for site in SITES {
            let path = format!("sites/{site}.toml");
            let text = String::from_utf8(case.read(&path)).unwrap();
            let keys = format!("[adjustment]\n{}", self.keys);
            let mut text = text.replacen("[adjustment]\n", &keys, 1);
            if matches!(self.sizes, Sizes::Cited) {
                // Four standard deviations of the cited radial error of orbits, which real profiles do not reach.
                text += "\n[range_check]\nmean_max_m = 20.0\n";
            }
            case.write(&path, text);
        }
        (self.files)(case, self.seed);
    }

    /// Writes, runs and removes the mission.
    fn flown(&self) -> Vec<Site> {
        let case = Case::empty();
        let (mission, out) = (case.path(""), case.path("out"));
        self.write(&case);
        let output = run_of(self.sites, &mission, &out).output().unwrap();
        // 5: a site is invalid.
        let code = output.status.code();
        assert!(
            matches!(code, Some(0 | 5)) || self.may_be_refused,
            "seed {}: {code:?} {}",
            self.seed,
            String::from_utf8_lossy(&output.stderr)
        );
        let truth = json(&mission.join("truth.json"));
        let sites = self.sites.iter();
        let sites = sites.map(|site| self.site(&mission, &out, &truth, site));
        sites.collect()
    }

    fn site(&self, mission: &Path, out: &Path, truth: &Value, site: &str) -> Site {
        let folder = out.join(site);
        let mut sites = truth["ties"].as_array().unwrap().iter();
        let own = sites.find(|of| of["site"] == site).unwrap();
        let is_of_site = |image: &Value| {
            let mut cameras = own["cameras"].as_array().unwrap().iter();
            cameras.any(|camera| camera["image"] == *image)
        };
        let mut drawn = truth["errors_drawn"].as_array().unwrap().iter();
        let has_misplaced_profile = drawn.any(|drawn| {
            drawn["profile_shift"]["is_misplaced"] == true && is_of_site(&drawn["image"])
        });
        let path = folder.join("adjustment.json");
        let document = if path.exists() {
            json(&path)
        } else {
            Value::Null
        };
        let is_adjusted = document["adjustment"]["heights"].is_object();
        let manifest = folder.join("manifest.json");
        let verdict = if manifest.exists() {
            json(&manifest)["verdict"].clone()
        } else {
            Value::Null
        };
        let is_published = !verdict.is_null();
        let stated = is_adjusted.then(|| Stated {
            remarks: verdict["remarks"].to_string(),
            judged: Judged::of(mission, out, site),
            footprints: footprints(truth, &folder),
            ties: ties(mission, out, site),
            cameras: cameras(own, &document, &folder),
            clocks: clocks(truth, &folder),
            adjustment: document["adjustment"].clone(),
        });
        Site {
            name: format!("{} {site}", self.seed),
            verdict,
            has_misplaced_profile,
            further: if is_published {
                further(truth, &folder, site)
            } else {
                [[0; 2]; 2]
            },
            shifts: if is_published {
                shifts(truth, &folder, site)
            } else {
                Vec::new()
            },
            stated,
        }
    }
}

/// The sites of all missions, as many at a time as there are processors.
pub(super) fn flown(plans: &[Plan<'_>]) -> Vec<Site> {
    let next = AtomicUsize::new(0);
    let sites: Mutex<BTreeMap<usize, Vec<Site>>> = Mutex::new(BTreeMap::new());
    let fly = || {
        loop {
            let index = next.fetch_add(1, Ordering::Relaxed);
            let Some(plan) = plans.get(index) else { break };
            let flown = plan.flown();
            sites.lock().unwrap().insert(index, flown);
        }
    };
    let workers = thread::available_parallelism().map_or(1, usize::from);
    thread::scope(|scope| {
        for _ in 0..workers.min(plans.len()) {
            scope.spawn(fly);
        }
    });
    let sites = sites.into_inner().unwrap();
    sites.into_values().flatten().collect()
}
