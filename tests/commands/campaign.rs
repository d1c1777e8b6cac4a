//! `areograph campaign`: selection, runs, and tasks on a cluster.

#![allow(
    clippy::unwrap_used,
    clippy::disallowed_methods,
    reason = "helpers of tests work in temporary folders and may fail loudly"
)]

use crate::common;

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::{Path, PathBuf},
    process::Command,
};

use common::{
    case::Case,
    daf::{segment_words, set_word, word},
    files_below,
    golden::assert_messages,
    mission::{once, products, succeed},
    slurm::{cluster, with_programs},
};
use serde_json::Value;

/// Pairs and single images of the campaign of these tests.
const PAIRS: usize = 3;
const SINGLES: usize = 2;

/// A copy of a small campaign in the folder `scene`.
fn campaign() -> Case {
    let scene = once("small-campaign", |folder| {
        let mut scene = common::mission::areograph();
        scene.args(["--quiet", "scene", "campaign", "--seed", "5"]);
        scene.args([
            "--pairs",
            &PAIRS.to_string(),
            "--singles",
            &SINGLES.to_string(),
        ]);
        succeed(scene.arg(folder));
    });
    let case = Case::empty();
    for file in files_below(&scene) {
        let to = case.path("scene").join(file.strip_prefix(&scene).unwrap());
        fs::create_dir_all(to.parent().unwrap()).unwrap();
        fs::copy(&file, to).unwrap();
    }
    case
}

fn command(case: &Case, out: &str) -> Command {
    let mut command = case.areograph();
    command.args(["--quiet", "campaign", "scene/campaign.toml", "--out", out]);
    command
}

/// The answer of a campaign whose sites need not be valid.
fn answer(command: &mut Command) -> Value {
    let output = command.arg("--json").output().unwrap();
    assert!(matches!(output.status.code(), Some(0 | 5)), "{output:?}");
    serde_json::from_slice(&output.stdout).unwrap()
}

/// The sites that were processed, not kept.
fn processed(answer: &Value) -> BTreeSet<String> {
    let sites = answer["sites"].as_array().unwrap().iter();
    let processed = sites.filter(|of| of["end"]["products"]["unchanged"] == Value::Bool(false));
    processed
        .map(|of| of["site"].as_str().unwrap().to_owned())
        .collect()
}

/// States of the sites by the table of sites.
fn states(case: &Case, out: &str) -> BTreeMap<String, String> {
    let table = case.path(&format!("{out}/campaign/sites.csv"));
    let mut rows = csv::Reader::from_path(table).unwrap();
    let rows = rows.deserialize().map(|row| {
        let row: BTreeMap<String, String> = row.unwrap();
        (row["site"].clone(), row["state"].clone())
    });
    rows.collect()
}

/// Products of all sites and of the campaign, without the costs, which are times.
fn all_products(case: &Case, out: &str) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut found = products(&case.path(out));
    found.remove(Path::new("sites/costs.json"));
    found
}

#[test]
fn a_changed_kernel_touches_the_sites_of_its_phase() {
    let case = campaign();
    let plan = answer(command(&case, "out").arg("--plan"));
    assert_eq!(plan["pairs"], PAIRS);
    assert_eq!(plan["single_images"], SINGLES);
    assert!(plan["processed"].is_null() && !case.path("out").exists());
    let first = answer(&mut command(&case, "out"));
    let sites = processed(&first);
    assert_eq!(sites.len(), PAIRS + SINGLES);
    assert_eq!(first["left_out"], Value::Array(Vec::new()));

    // A site of the campaign is a site like any other.
    let site = sites.iter().find(|site| site.contains('_')).unwrap();
    let mut run = case.areograph();
    let file = format!("out/sites/{site}.toml");
    let again = run.args(["--quiet", "run", &file, "--out", "out"]).output();
    let again = String::from_utf8(again.unwrap().stdout).unwrap();
    assert!(again.contains("nothing changed"), "{again}");

    let before = all_products(&case, "out");
    let again = answer(&mut command(&case, "out"));
    assert!(processed(&again).is_empty(), "{again}");
    assert_eq!(all_products(&case, "out"), before);
    let plan = answer(command(&case, "out").arg("--plan"));
    assert_eq!(plan["processed"]["images"], 2 * PAIRS + SINGLES);

    // One number of the attitude in one phase.
    let phase = &site[..3];
    let kernel = format!("scene/kernels/mgs_sc_{phase}.bc");
    let mut bytes = case.read(&kernel);
    let (start, _) = segment_words(&bytes)[0];
    let rate = start + 4;
    let changed = word(&bytes, rate) + 1e-9;
    set_word(&mut bytes, rate, changed);
    case.write(&kernel, bytes);
    let of_phase: BTreeSet<String> = sites
        .iter()
        .filter(|site| site.starts_with(phase))
        .cloned()
        .collect();
    let changed = answer(&mut command(&case, "out"));
    assert_eq!(processed(&changed), of_phase);
    assert!(of_phase.len() < sites.len());

    // Another solution of the orbit in another phase.
    let other = sites.iter().find(|site| !site.starts_with(phase)).unwrap();
    let other = &other[..3];
    fs::copy(
        case.path(&format!("scene/kernels/mgs_gsfc_{other}.bsp")),
        case.path(&format!("scene/kernels/mgs_nav_{other}.bsp")),
    )
    .unwrap();
    let changed = answer(&mut command(&case, "out"));
    assert!(
        processed(&changed)
            .iter()
            .all(|site| site.starts_with(other))
    );
    assert!(!processed(&changed).is_empty());

    // Products of another campaign file and of a failed site are not pooled.
    case.replace(
        "scene/campaign.toml",
        "[pedr]",
        "[limits]\nties_min = 2\n\n[pedr]",
    );
    let one = answer(command(&case, "out").args(["--only", site]));
    assert_eq!(processed(&one), [site.clone()].into());
    let states = states(&case, "out");
    assert_eq!(states[site], "published");
    assert!(
        sites
            .iter()
            .filter(|of| *of != site)
            .all(|of| states[of] == "unusable"),
        "{states:?}"
    );
    case.write(&file, "site = \"mine\"\n");
    let failed = command(&case, "out")
        .args(["--only", site])
        .output()
        .unwrap();
    assert_eq!(failed.status.code(), Some(2), "{failed:?}");
    assert_eq!(self::states(&case, "out")[site], "failed");
    case.replace("scene/campaign.toml", "\"synthetic\"", "\"other\"");
    let other = command(&case, "out").output().unwrap();
    let other = String::from_utf8(other.stderr).unwrap();
    assert!(
        other.contains("the results of the campaign \"synthetic\""),
        "{other}"
    );
}

#[test]
fn missing_files_leave_sites_out_and_wrong_campaigns_are_refused() {
    let case = campaign();
    let plan = answer(command(&case, "out").arg("--plan"));
    let sites: Vec<&str> = plan["sites"]
        .as_array()
        .unwrap()
        .iter()
        .map(|site| site["site"].as_str().unwrap())
        .collect();
    let pair = sites.iter().find(|site| site.contains('_')).unwrap();
    let single = sites.iter().find(|site| !site.contains('_')).unwrap();
    fs::remove_file(case.path(&format!("scene/ties/{pair}.csv"))).unwrap();
    let label = format!("scene/labels/{}.lbl", single.to_ascii_uppercase());
    fs::remove_file(case.path(&label)).unwrap();
    let plan = answer(command(&case, "out").arg("--plan"));
    let left_out = plan["left_out"].as_array().unwrap();
    let left_out: BTreeSet<&str> = left_out
        .iter()
        .map(|of| of["site"].as_str().unwrap())
        .collect();
    assert_eq!(left_out, [*pair, *single].into());
    assert_eq!(plan["sites"].as_array().unwrap().len(), sites.len() - 2);

    let mut told = Vec::new();
    let mut refused = |name: &str, command: &mut Command| {
        let shown = case.outcome(std::mem::replace(command, Command::new("true")));
        told.push((name.to_owned(), shown));
    };
    refused(
        "an unknown site",
        command(&case, "out").args(["--only", "m99-00001"]),
    );
    fs::create_dir_all(case.path("foreign/sites")).unwrap();
    let valid = sites
        .iter()
        .find(|site| !left_out.contains(**site))
        .unwrap();
    case.write(&format!("foreign/sites/{valid}.toml"), "site = \"mine\"\n");
    let failed = command(&case, "foreign")
        .args(["--only", valid])
        .output()
        .unwrap();
    let failed = String::from_utf8(failed.stderr).unwrap();
    assert!(
        failed.contains("a site file that a campaign wrote"),
        "{failed}"
    );
    case.replace(
        "scene/campaign.toml",
        "emission_max_deg = 30.0",
        "emission_max_deg = 0.0",
    );
    refused("no image", &mut command(&case, "out"));
    case.replace(
        "scene/campaign.toml",
        "emission_max_deg = 0.0",
        "emission_max_deg = 30.0",
    );
    case.replace(
        "scene/campaign.toml",
        "overlap_min = 0.3",
        "overlap_min = 1.0\nsingles = false",
    );
    refused("no pair", &mut command(&case, "out"));
    case.replace("scene/campaign.toml", "overlap_min = 1.0", "overlap = 1.0");
    refused("a misspelt key", &mut command(&case, "out"));
    let mut run = case.areograph();
    run.args(["--quiet", "run", "scene/campaign.toml"]);
    refused("run of a campaign file", &mut run);
    fs::remove_file(case.path("scene/index/cumindex.tab")).unwrap();
    refused("no index", &mut command(&case, "out"));
    assert_messages("campaign_refused", &told);
}

#[test]
fn tasks_of_a_cluster_give_the_products_of_one_machine_and_lost_tasks_are_repeated() {
    let case = campaign();
    let local = answer(&mut command(&case, "local"));
    let settings = "[executor]\nkind = \"slurm\"\nsites_per_task = 2\nmemory_mb = 300\n\n[kernels]";
    case.replace("scene/campaign.toml", "[kernels]", settings);
    let cluster = cluster(&case.path("cluster"));
    let mut far = with_programs(command(&case, "far"), &cluster);
    let far = answer(&mut far);
    assert_eq!(far["counts"], local["counts"]);
    assert_eq!(processed(&far), processed(&local));
    assert_eq!(all_products(&case, "far"), all_products(&case, "local"));
    // The lost task was submitted again, with twice the memory; then the folder of tasks is removed.
    let read = |name: &str| fs::read_to_string(cluster.join(name)).unwrap();
    assert_eq!(read("memory"), "300M\n600M\n");
    assert_eq!(read("jobs"), "2\n");
    assert!(!case.path("far/.tasks").exists());

    // Without a cluster, the message states what to do.
    let mut alone = command(&case, "far");
    alone.env("PATH", case.path("scene"));
    let failed = alone.output().unwrap();
    let text = String::from_utf8(failed.stderr).unwrap();
    assert_eq!(failed.status.code(), Some(6), "{text}");
    assert!(text.contains("cannot start sbatch"), "{text}");
}
