//! A campaign on four virtual nodes of Slurm whose daemons are killed: the products are those of one machine.

#![allow(
    clippy::unwrap_used,
    clippy::disallowed_methods,
    reason = "helpers of tests work in temporary folders and may fail loudly"
)]

use crate::common;

use std::{
    fs,
    path::Path,
    process::Child,
    thread,
    time::{Duration, Instant},
};

use common::{
    long_test,
    mission::{areograph, products, succeed},
    slurm::virtual_cluster,
};
use rustix::process::{Pid, Signal, kill_process};

/// Pairs and single images of the campaign, and daemons that are killed while it runs.
const CAMPAIGN: [&str; 4] = ["--pairs", "30", "--singles", "20"];
const KILLED: [&str; 5] = ["n2", "slurmctld", "n2", "slurmctld", "n3"];
/// The campaign takes about a minute; a task that Slurm holds delays it by minutes.
const LONGEST: Duration = Duration::from_mins(20);

/// Kills a daemon of the virtual cluster in this folder, and waits for its end.
pub(crate) fn kill_daemon(cluster: &Path, name: &str) {
    let number = fs::read_to_string(cluster.join(format!("run/{name}.pid"))).unwrap();
    let number: i32 = number.trim().parse().unwrap();
    let command_line = || fs::read(format!("/proc/{number}/cmdline")).unwrap_or_default();
    let is_own = String::from_utf8_lossy(&command_line()).contains(cluster.to_str().unwrap());
    assert!(is_own, "{name} does not run");
    kill_process(Pid::from_raw(number).unwrap(), Signal::KILL).unwrap();
    let begun = Instant::now();
    while !command_line().is_empty() {
        assert!(begun.elapsed() < Duration::from_secs(10), "{name}");
        thread::sleep(Duration::from_millis(10));
    }
}

/// Waits for a campaign to end.
fn ended(campaign: &mut Child) -> Option<i32> {
    let begun = Instant::now();
    while begun.elapsed() < LONGEST {
        if let Some(status) = campaign.try_wait().unwrap() {
            return status.code();
        }
        thread::sleep(Duration::from_secs(1));
    }
    campaign.kill().unwrap();
    None
}

#[test]
fn killed_daemons_of_a_cluster_change_no_product() {
    if !long_test("killed_daemons_of_a_cluster_change_no_product") {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    succeed(
        areograph()
            .args(["--quiet", "scene", "campaign"])
            .args(CAMPAIGN)
            .arg(path("scene")),
    );
    let file = path("scene/campaign.toml");
    let run = |out: &str| {
        let mut campaign = areograph();
        campaign.args(["--quiet", "campaign"]).arg(&file);
        campaign.arg("--out").arg(path(out));
        campaign.env("SLURM_CONF", path("cluster/slurm.conf"));
        campaign.spawn().unwrap()
    };
    // 5: the scene misplaces some profiles.
    assert!(matches!(ended(&mut run("local")), Some(0 | 5)));
    let text = fs::read_to_string(&file).unwrap();
    let executor = "[executor]\nkind = \"slurm\"\nsites_per_task = 2\nmemory_mb = 500\n\n[kernels]";
    fs::write(&file, text.replace("[kernels]", executor)).unwrap();
    virtual_cluster("start", &path("cluster"));
    let mut campaign = run("far");
    for daemon in KILLED {
        thread::sleep(Duration::from_secs(4));
        kill_daemon(&path("cluster"), daemon);
        thread::sleep(Duration::from_secs(4));
        virtual_cluster("start", &path("cluster"));
    }
    let code = ended(&mut campaign);
    virtual_cluster("stop", &path("cluster"));
    assert!(matches!(code, Some(0 | 5)), "{code:?}");
    let [local, far] = ["local", "far"].map(|out| {
        let mut found = products(&path(out));
        // Times.
        found.remove(Path::new("sites/costs.json"));
        found
    });
    let other: Vec<_> = local
        .iter()
        .filter(|(path, bytes)| far.get(*path) != Some(bytes))
        .collect();
    assert!(
        other.is_empty() && local.len() == far.len(),
        "{:?}",
        other.first().map(|of| of.0)
    );
}
