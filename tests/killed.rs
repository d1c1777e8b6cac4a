//! A run that is killed leaves nothing half-made, and the next one ends with the same bytes.

mod common;

use std::{
    path::Path,
    thread::sleep,
    time::{Duration, Instant},
};

use common::mission::{areograph, mission, products, succeed};

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
