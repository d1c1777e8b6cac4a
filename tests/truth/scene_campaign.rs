//! The synthetic campaign: read by the program, and compared with its truth.

#![allow(
    clippy::disallowed_methods,
    clippy::unwrap_used,
    reason = "helpers of tests may panic, and files in a temporary folder need no atomic writer"
)]

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::{Path, PathBuf},
    sync::atomic::AtomicBool,
};

use areograph::{
    pds::image_index::{IndexedImage, read_index},
    scene::{CampaignOptions, write_campaign},
    units::RADIANS_PER_DEGREE,
    watch::Watch,
};
use serde_json::Value;

use crate::common::{
    json, long,
    mission::{areograph, once, products, succeed},
};

/// Pairs and single images of the campaign of these tests.
const PAIRS: usize = 5;
const SINGLES: usize = 2;

/// A campaign, to read only.
fn campaign() -> PathBuf {
    once("campaign", |folder| {
        let [pairs, singles] = [PAIRS, SINGLES].map(|count| count.to_string());
        let mut scene = areograph();
        scene.args([
            "--quiet",
            "scene",
            "campaign",
            "--pairs",
            &pairs,
            "--singles",
            &singles,
        ]);
        succeed(scene.arg(folder));
    })
}

fn rows<'a>(truth: &'a Value, of: &str) -> &'a [Value] {
    truth[of].as_array().unwrap()
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

fn text(value: &Value) -> &str {
    value.as_str().unwrap()
}

/// The images of the index that `truth.json` does not list as rejected, by their identifiers.
fn images(folder: &Path, truth: &Value) -> BTreeMap<String, IndexedImage> {
    let index = read_index(&folder.join("index/cumindex.tab")).unwrap();
    let rejected: BTreeSet<&str> = rows(truth, "rejected")
        .iter()
        .map(|row| text(&row["product_id"]))
        .collect();
    let images = index.images.into_iter();
    let own = images.filter(|image| !rejected.contains(&*image.product_id));
    own.map(|image| (image.product_id.replace('/', "-"), image))
        .collect()
}

#[test]
fn the_same_seed_gives_the_same_campaign_with_any_number_of_threads() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, seed: u64, threads: usize| {
        let options = CampaignOptions {
            seed,
            pairs: 2,
            singles: 1,
        };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        let place = folder.path().join(name);
        let write = || write_campaign(&place, &options, Watch::from(&AtomicBool::new(false)));
        pool.build().unwrap().install(write).unwrap();
        products(&place)
    };
    let (one, two, other) = (write("one", 3, 1), write("two", 3, 3), write("other", 4, 2));
    assert!(one.len() > 20, "{}", one.len());
    assert_eq!(
        one.keys().collect::<Vec<_>>(),
        two.keys().collect::<Vec<_>>()
    );
    for (path, bytes) in &one {
        assert!(*bytes == two[path], "{}", path.display());
    }
    assert_ne!(one[Path::new("truth.json")], other[Path::new("truth.json")]);
}

#[test]
fn every_image_is_in_the_index_and_has_its_files() {
    let folder = campaign();
    let truth = json(&folder.join("truth.json"));
    let index = read_index(&folder.join("index/cumindex.tab")).unwrap();
    assert!(index.has_label);
    let images = images(&folder, &truth);
    assert_eq!(images.len(), 2 * PAIRS + SINGLES);
    let bad = rows(&truth, "rejected").iter();
    let bad = bad.filter(|row| text(&row["reason"]).starts_with("bad row"));
    assert_eq!(index.bad_rows.len(), bad.count());
    assert_eq!(
        index.images.len() + index.bad_rows.len(),
        images.len() + rows(&truth, "rejected").len()
    );
    let mut phases = BTreeSet::new();
    for image in rows(&truth, "images") {
        let id = text(&image["image"]);
        let row = &images[id];
        phases.insert(text(&image["phase"]));
        assert!(id.starts_with(text(&image["phase"])), "{id}");
        assert!(folder.join(format!("labels/{id}.lbl")).is_file(), "{id}");
        let orbit = row.orbit.as_ref().unwrap().1;
        let pedr =
            ["k", "l"].map(|version| folder.join(format!("pedr/ap{}{version}.b", 10_000 + orbit)));
        assert!(pedr.iter().any(|file| file.is_file()), "{id} {orbit}");
        // Taken by day, from the height of the mapping orbit.
        let [emission_rad, incidence_rad, phase_rad] = row.angles_rad.map(Option::unwrap);
        assert!(
            emission_rad / RADIANS_PER_DEGREE < 26.0 && incidence_rad / RADIANS_PER_DEGREE < 80.0,
            "{id}"
        );
        assert!(phase_rad <= emission_rad + incidence_rad + 1e-3, "{id}");
        assert!((3.6e5..4.5e5).contains(&row.altitude_m.unwrap()), "{id}");
        let pixel_m = row.pixel_m.unwrap() / f64::from(row.summing[0].unwrap());
        assert!((1.3..1.9).contains(&pixel_m), "{id} {pixel_m}");
        // North is down in an image that is flown northwards by day, and the second corner is west of the first.
        let [first, second, third, _] = row.corners_rad.map(Option::unwrap);
        let west_rad = (first[0] - second[0]).rem_euclid(std::f64::consts::TAU);
        assert!(west_rad < 0.1 && third[1] > second[1], "{id}");
    }
    assert_eq!(phases.len(), 5);
    let tables = fs::read_dir(folder.join("ties")).unwrap().count();
    assert_eq!(tables, PAIRS);
}

#[test]
fn a_search_finds_every_image_where_the_kernels_have_it() {
    let folder = campaign();
    let truth = json(&folder.join("truth.json"));
    let index = folder.join("index/cumindex.tab");
    for (id, image) in images(&folder, &truth) {
        let [longitude_deg, latitude_deg] =
            image.centre_rad.unwrap().map(|of| of / RADIANS_PER_DEGREE);
        let place = format!(
            "{longitude_deg},{},{latitude_deg},{}",
            longitude_deg + 0.01,
            latitude_deg + 0.01
        );
        let mut search = areograph();
        search.args([
            "--quiet", "image", "search", "--format", "csv", "--camera", "moc_na",
        ]);
        search.args(["--emission-max-deg", "30", "--incidence-max-deg", "85"]);
        search.arg(format!("--box={place}")).arg(&index);
        let answer = succeed(search.arg("--kernels").arg(folder.join("kernels/nav.tm")));
        let answer = String::from_utf8(answer.stdout).unwrap();
        let mut table = csv::Reader::from_reader(answer.as_bytes());
        let head = table.headers().unwrap().clone();
        let column = |name: &str| head.iter().position(|of| of == name).unwrap();
        let found: Vec<csv::StringRecord> = table.records().map(Result::unwrap).collect();
        let row = found
            .iter()
            .find(|row| row[column("product_id")] == *image.product_id);
        let row = row.unwrap_or_else(|| panic!("{id} is not found at {place}: {answer}"));
        // Half a unit of the last digit is 0.3 km in each direction; relief of some kilometres moves oblique corners by a fifth of it.
        let off_km: f64 = row[column("off_kernels_km")].parse().unwrap();
        println!("{id}: corners within {off_km} km");
        assert!(off_km < 1.5, "{id} {off_km}");
        // Rejected rows lie at the same places.
        let by_angle = |row: &&Value| matches!(text(&row["reason"]), "emission" | "incidence");
        for row in rows(&truth, "rejected").iter().filter(by_angle) {
            assert!(!answer.contains(text(&row["product_id"])), "{answer}");
        }
    }
}

#[test]
fn a_search_finds_the_pairs() {
    let folder = campaign();
    let truth = json(&folder.join("truth.json"));
    let images = images(&folder, &truth);
    let mut search = areograph();
    search.args([
        "--quiet",
        "image",
        "search",
        "--format",
        "pairs",
        "--box",
        "0,360,-90,90",
    ]);
    search.args([
        "--camera",
        "moc_na",
        "--emission-max-deg",
        "30",
        "--incidence-max-deg",
        "85",
    ]);
    let answer = succeed(search.arg(folder.join("index/cumindex.tab")));
    let mut table = csv::Reader::from_reader(&answer.stdout[..]);
    let found: BTreeMap<[String; 2], [f64; 4]> = table
        .records()
        .map(|row| {
            let row = row.unwrap();
            let ids = [0, 1].map(|at| row[at].replace('/', "-"));
            (ids, [2, 3, 4, 5].map(|at| row[at].parse().unwrap()))
        })
        .collect();
    for pair in rows(&truth, "pairs") {
        let ids = [0, 1].map(|at| text(&pair["images"][at]).to_owned());
        let site = format!("{}_{}", ids[0], ids[1]).to_lowercase();
        assert_eq!(text(&pair["site"]), site);
        let [overlap, convergence_deg, pixel_ratio, sun_deg] = found[&ids];
        println!(
            "{site}: overlap {overlap}, convergence {convergence_deg}, pixels {pixel_ratio}, Sun {sun_deg}"
        );
        // As campaign.toml asks.
        assert!(
            overlap >= 0.3 && (4.0..60.0).contains(&convergence_deg),
            "{site}"
        );
        assert!(pixel_ratio <= 2.0 && sun_deg <= 40.0, "{site}");
        // The first image is at nadir: the angle between the rays is the emission angle of the second.
        let [emission_rad, ..] = images[&ids[1]].angles_rad.map(Option::unwrap);
        let off_deg = convergence_deg - emission_rad / RADIANS_PER_DEGREE;
        assert!(off_deg.abs() < 0.6, "{site} {off_deg}");
    }
}

#[test]
fn the_truth_agrees_with_itself_and_shows_the_clock_of_each_phase() {
    let truth = json(&campaign().join("truth.json"));
    let of_image = |id: &Value| {
        let mut images = rows(&truth, "images").iter();
        images.find(|image| image["image"] == *id).unwrap()
    };
    for pair in rows(&truth, "pairs") {
        let site = text(&pair["site"]);
        let [first, second] = [0, 1].map(|at| of_image(&pair["images"][at]));
        let along_m = [first, second].map(|image| number(&image["misregistration"]["along_m"]));
        let off_m = number(&pair["along_m"]) - (along_m[0] - along_m[1]);
        println!(
            "{site}: {:.1} m, by its images {off_m:.2} m more",
            number(&pair["along_m"])
        );
        // Means over the tie points and over the images, which drift by 1e-5 rad, 4 m.
        assert!(off_m.abs() < 8.0, "{site} {off_m}");
        // A bus at nadir turns by 0.0509 degrees a second, 0.34 km at 380 km; one that is held does not turn.
        let clock_s = number(&first["errors"]["attitude_clock_s"]);
        assert!((0.15..0.45).contains(&clock_s.abs()), "{clock_s}");
        let moved = [first, second]
            .map(|image| number(&image["misregistration"]["clock_along_m"]) / clock_s);
        println!("  clock {clock_s:.3} s: {moved:.1?} m/s");
        assert!(
            (300.0..400.0).contains(&moved[0].abs()) && moved[1].abs() < 0.1,
            "{moved:?}"
        );
        let same = of_image(&pair["images"][1])["errors"]["attitude_clock_s"].clone();
        assert!((number(&same) - clock_s).abs() <= 0.0);
    }
    for phase in rows(&truth, "phases") {
        let images = rows(&truth, "images").iter();
        let own = images.filter(|image| image["phase"] == phase["phase"]);
        assert_eq!(phase["images"].as_u64(), Some(own.count() as u64));
    }
}

/// Results of a campaign: its summary, and the rows of its pairs by their sites.
fn results(folder: &Path) -> (Value, BTreeMap<String, BTreeMap<String, String>>) {
    let out = tempfile::tempdir().unwrap();
    let mut campaign = areograph();
    campaign
        .args(["--quiet", "campaign"])
        .arg(folder.join("campaign.toml"));
    let answer = campaign.arg("--out").arg(out.path()).output().unwrap();
    // 5: the scene misplaces some profiles.
    assert!(matches!(answer.status.code(), Some(0 | 5)), "{answer:?}");
    let results = out.path().join("campaign");
    let mut pairs = csv::Reader::from_path(results.join("pairs.csv")).unwrap();
    let pairs = pairs.deserialize().map(|row| {
        let row: BTreeMap<String, String> = row.unwrap();
        (row["site"].clone(), row)
    });
    (json(&results.join("summary.json")), pairs.collect())
}

/// Misregistrations and their means are those of the truth, whose scene shares no code with the measurement.
#[test]
fn pairs_and_phases_have_their_true_misregistration() {
    let folder = if long() {
        once("large-campaign", |folder| {
            let mut scene = areograph();
            scene.args(["--quiet", "scene", "campaign", "--seed", "7"]);
            succeed(scene.args(["--pairs", "100", "--singles", "0"]).arg(folder));
        })
    } else {
        campaign()
    };
    let truth = json(&folder.join("truth.json"));
    let (summary, found) = results(&folder);
    let mut valid: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
    for pair in rows(&truth, "pairs") {
        let row = &found[text(&pair["site"])];
        if row["is_valid"] != "true" {
            continue;
        }
        let [stated_m, sigma_m] =
            ["before_along_m", "before_along_sigma_m"].map(|of| row[of].parse::<f64>().unwrap());
        let true_m = number(&pair["along_m"]);
        // The profile is a line through the ground of the tie points; attitude drifts by up to 1e-5 rad over an image.
        assert!(
            (stated_m - true_m).abs() < 3.0 * sigma_m.hypot(4.0),
            "{pair}: {stated_m} ± {sigma_m} m"
        );
        valid.entry(text(&pair["phase"])).or_default().push(true_m);
    }
    let phases = rows(&summary, "phases");
    assert_eq!(phases.len(), valid.len());
    let mut offsets_found = 0;
    for phase in phases {
        let true_m = &valid[text(&phase["phase"])];
        let mean_m = true_m.iter().sum::<f64>() / true_m.len() as f64;
        let along = &phase["along_m"]["mean"];
        let sigma_m = along["sigma"].as_f64().unwrap_or_default();
        // As above; robust weights move the mean of many pairs by less than its standard deviation.
        assert!(
            (number(&along["value"]) - mean_m).abs() < sigma_m.max(3.0 * 4.0),
            "{phase}: {mean_m} m"
        );
        let of_truth = rows(&truth, "phases").iter();
        let mut of_truth = of_truth.filter(|of| of["phase"] == phase["phase"]);
        let clock_s = number(&of_truth.next().unwrap()["attitude_clock_s"]);
        let clock = &phase["attitude_clock_s"];
        if clock["differs_from_zero"] == Value::Bool(true) {
            offsets_found += 1;
            let off_s = number(&clock["mean"]["value"]) - clock_s;
            let sigma_s = number(&clock["mean"]["sigma"]);
            println!(
                "{}: clock off by {:.2} sigma",
                phase["phase"],
                off_s / sigma_s
            );
            assert!(off_s.abs() < 3.0 * sigma_s, "{phase}: {clock_s} s");
        }
    }
    // Offsets are 0.15 to 0.45 s; 20 pairs determine them to about 0.06 s.
    assert!(
        offsets_found >= if long() { 3 } else { 0 },
        "{offsets_found}"
    );
}

#[test]
fn what_the_campaign_did_not_write_is_kept() {
    let folder = tempfile::tempdir().unwrap();
    let place = folder.path().join("notes");
    fs::create_dir(&place).unwrap();
    fs::write(place.join("notes.txt"), "mine").unwrap();
    let mut scene = areograph();
    let refused = scene
        .args(["--quiet", "scene", "campaign", "--pairs", "1"])
        .arg(&place);
    let refused = refused.output().unwrap();
    assert_eq!(refused.status.code(), Some(2));
    let message = String::from_utf8(refused.stderr).unwrap();
    assert!(message.contains("contains no areograph scene"), "{message}");
    assert_eq!(fs::read_to_string(place.join("notes.txt")).unwrap(), "mine");
    // A mission is a scene of another kind.
    let mission = folder.path().join("mission");
    let mut scene = areograph();
    succeed(
        scene
            .args(["--quiet", "scene", "mission", "--day-s", "600"])
            .arg(&mission),
    );
    let mut scene = areograph();
    let refused = scene.args(["--quiet", "scene", "campaign"]).arg(&mission);
    let message = String::from_utf8(refused.output().unwrap().stderr).unwrap();
    assert!(message.contains("a scene of another kind"), "{message}");
}
