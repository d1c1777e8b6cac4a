//! A run that is killed leaves nothing half-made, and the next one ends with the same bytes, in an
//! empty folder as over a published site.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "helpers of tests may fail loudly"
)]

mod common;

use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
    thread::sleep,
    time::{Duration, Instant},
};

use common::{
    case::Case,
    mission::{areograph, mission, products, succeed},
};

/// Moments at which a run is killed.
const KILLS: u32 = 20;
fn run(site: &Path, out: &Path, threads: &str) -> std::process::Command {
    let mut command = areograph();
    command
        .args(["--quiet", "run"])
        .arg(site)
        .arg("--out")
        .arg(out)
        .args(["--threads", threads]);
    command.stdout(std::process::Stdio::null());
    command
}

#[test]
fn killed_at_twenty_moments() {
    let site = mission().join("sites/isidis.toml");
    let folder = tempfile::tempdir().unwrap();
    let undisturbed_out = folder.path().join("undisturbed");
    let started = Instant::now();
    succeed(&mut run(&site, &undisturbed_out, "2"));
    let whole_run = started.elapsed();
    let undisturbed = products(&undisturbed_out);
    assert!(undisturbed.len() > 10);
    let mut killed = 0;
    for moment in 0..KILLS {
        let out = folder.path().join(format!("killed-{moment}"));
        let mut child = run(&site, &out, "2").spawn().unwrap();
        // Moments over the whole run, shifted by a golden-ratio sequence so that they never line up.
        let share =
            (f64::from(moment) + (f64::from(moment) * 0.618_034).fract()) / f64::from(KILLS);
        sleep(Duration::from_secs_f64(whole_run.as_secs_f64() * share));
        child.kill().unwrap();
        killed += u32::from(!child.wait().unwrap().success());
        for (path, bytes) in products(&out) {
            assert!(
                undisturbed.get(&path) == Some(&bytes),
                "half-made {} after kill {moment}",
                path.display()
            );
        }
        succeed(&mut run(&site, &out, "2"));
        assert!(
            products(&out) == undisturbed,
            "products differ after kill {moment}"
        );
    }
    assert!(
        killed >= KILLS / 2,
        "only {killed} runs were killed before they ended"
    );
}

/// Adds a second image, the same label under another name, or takes it away.
fn change(case: &Case, second_image: bool) {
    let second = "[[images]]\nid = \"second\"\nlabel = \"image.lbl\"\n";
    if second_image {
        let text = String::from_utf8(case.read("site.toml")).unwrap();
        case.write("site.toml", text + second);
    } else {
        case.replace("site.toml", second, "");
    }
}

/// Starts a run, waits until `begun`, and kills it this long after; whether it was still running.
fn kill(case: &Case, begun: impl Fn() -> bool, after: Duration) -> bool {
    let mut child = case.run().spawn().unwrap();
    while !begun() && child.try_wait().unwrap().is_none() {
        sleep(Duration::from_micros(20));
    }
    sleep(after);
    child.kill().unwrap();
    !child.wait().unwrap().success()
}

/// Paths that the manifest lists, and its own.
fn listed(case: &Case) -> BTreeSet<PathBuf> {
    let manifest: serde_json::Value =
        serde_json::from_slice(&case.read("out/case/manifest.json")).unwrap();
    manifest["products"]
        .as_array()
        .unwrap()
        .iter()
        .map(|product| product["path"].as_str().unwrap())
        .chain(["manifest.json"])
        .map(PathBuf::from)
        .collect()
}

/// Kills runs over a published site at 0 to `last` after something of theirs has begun, each followed by
/// a run to the end. By turns they add the second image and take it away, and by turns the run to the
/// end is of the new configuration and of the one before.
fn kill_republishing(kills: u32, last: Duration, begins: fn(&Case) -> Box<dyn Fn() -> bool>) {
    let case = Case::new();
    let undisturbed = [false, true].map(|second_image| {
        if second_image {
            change(&case, true);
        }
        succeed(&mut case.run());
        let found = products(&case.path("out/case"));
        fs::remove_dir_all(case.path("out")).unwrap();
        found
    });
    assert!(undisturbed[1].len() > undisturbed[0].len());
    succeed(&mut case.run());
    let (mut second_image, mut killed) = (true, 0);
    for attempt in 0..kills {
        second_image = !second_image;
        change(&case, second_image);
        let after = last * attempt / (kills - 1);
        killed += u32::from(kill(&case, begins(&case), after));
        if attempt % 2 == 1 {
            second_image = !second_image;
            change(&case, second_image);
        }
        succeed(&mut case.run());
        let found = products(&case.path("out/case"));
        let files: BTreeSet<PathBuf> = found.keys().cloned().collect();
        assert_eq!(files, listed(&case), "kill {attempt}, after {after:?}");
        assert!(
            found == undisturbed[usize::from(second_image)],
            "products differ after kill {attempt}, after {after:?}"
        );
    }
    assert!(killed > 0, "no run was killed before it ended");
}

#[test]
fn killed_while_staging_over_a_published_site() {
    kill_republishing(12, Duration::from_millis(30), |case| {
        let staging = case.path("out/case/.staging");
        assert!(!staging.exists(), "the run before left its staging folder");
        Box::new(move || staging.exists())
    });
}

#[test]
fn killed_while_publishing_over_a_published_site() {
    // Publishing some twenty files takes a few milliseconds; the first of them is this one.
    kill_republishing(12, Duration::from_millis(4), |case| {
        let path = case.path("out/case/exchange/README.txt");
        let written = move || fs::metadata(&path).and_then(|file| file.modified()).ok();
        let before = written();
        Box::new(move || written() != before)
    });
}

#[test]
fn killed_when_an_image_has_just_come_or_gone() {
    kill_republishing(12, Duration::from_micros(500), |case| {
        let path = case.path("out/case/images/second/isd.json");
        let before = path.exists();
        Box::new(move || path.exists() != before)
    });
}

/// Ctrl-C while forty large PEDR files are hashed and searched: the run ends soon, says where, and the
/// next run begins where it was.
#[test]
#[cfg(unix)]
fn an_interrupt_leaves_the_search_and_keeps_finished_stages() {
    let case = Case::new();
    let large = mission().join("pedr/ap18933l.b");
    for number in 0..40 {
        let link = case.path(&format!("pedr/link{number:02}.b"));
        std::os::unix::fs::symlink(&large, link).unwrap();
    }
    let mut command = case.run();
    let child = command
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    let begun = Instant::now();
    while !case.path("out/case/.cache/tag_times+image").exists() {
        assert!(begun.elapsed() < Duration::from_mins(1), "never begun");
        sleep(Duration::from_millis(1));
    }
    succeed(std::process::Command::new("kill").args(["-INT", &child.id().to_string()]));
    let output = child.wait_with_output().unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(130), "{said}");
    assert!(
        said.contains("case/search_footprints: stopped before its end"),
        "{said}"
    );
    assert!(case.path("out/case/.cache/tag_times+image").exists());
    assert!(!case.path("out/case/.cache/search_footprints").exists());
}

#[test]
fn one_and_eight_threads_give_the_same_bytes() {
    let site = mission().join("sites/gusev_crater.toml");
    let folder = tempfile::tempdir().unwrap();
    let outs = ["1", "8"].map(|threads| {
        let out = folder.path().join(threads);
        succeed(&mut run(&site, &out, threads));
        products(&out)
    });
    assert!(!outs[0].is_empty() && outs[0] == outs[1]);
}
