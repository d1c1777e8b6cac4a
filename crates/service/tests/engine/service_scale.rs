//! A thousand sites and ten thousand kernels, and many kills; the short run has only fifty of these.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    clippy::print_stderr,
    reason = "helpers of tests may fail loudly, and measurements are told"
)]

use crate::fake;

use areograph_testing as common;

use std::{
    collections::BTreeSet,
    fs,
    path::Path,
    time::{Duration, Instant},
};

use fake::{Fate, Life, World};

/// 2026-05-01T12:00:00Z.
const NOON_MS: i64 = 1_777_636_800_000;
const SITES: usize = 1000;
const KERNELS: usize = 10_000;
/// Kernels that each site reads.
const READ: usize = 20;

#[test]
fn nothing_changed_for_a_thousand_sites() {
    if !common::long_test("1,000 sites and 10,000 kernels, a minute") {
        return;
    }
    let more = "[changes]\nquiet_period_s = 0.0\n[workers]\nmin_free_mib = 0\ncount = 2\n[retention]\nevents = 1000\n";
    let world = World::new(NOON_MS, more);
    for number in 0..KERNELS {
        world.put(&format!("kernels/k{number:05}.bc"), &number.to_string());
    }
    for site in 0..SITES {
        let names: Vec<String> = (0..READ)
            .map(|read| format!("k{:05}.bc", (site * 7 + read * 501) % KERNELS))
            .collect();
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        world.site(&format!("s{site:04}"), &names);
    }
    let life = Life::begin(&world);
    let begun = Instant::now();
    life.settle();
    life.go_on(&world, 60, 2);
    eprintln!(
        "first runs of {SITES} sites: {:.1} s",
        begun.elapsed().as_secs_f64()
    );
    assert_eq!(
        life.ask("SELECT CAST(count(*) AS TEXT) FROM run"),
        [SITES.to_string()]
    );
    let plans = world.started("plan");
    // Hourly and half-minute work is not part of a poll.
    life.go_on(&world, 60, 1);
    let begun = Instant::now();
    life.go_on(&world, 60, 10);
    let poll_s = begun.elapsed().as_secs_f64() / 10.0;
    let begun = Instant::now();
    let night = life.engine.begin_night().unwrap().unwrap();
    life.settle();
    life.go_on(&world, 60, 1);
    let night_s = begun.elapsed().as_secs_f64();
    let night = life.engine.night(night).unwrap().unwrap();
    assert_eq!(
        (night.sites_checked, night.runs),
        (i64::try_from(SITES).unwrap(), 0)
    );
    assert!(night.ended_utc.is_some());
    assert_eq!(world.started("plan"), plans);
    // Reported, not judged: the time depends on what else the machine does. No plan was made, which is what costs.
    eprintln!("poll {poll_s:.2} s, night {night_s:.2} s");
    let size = world.path("state/areograph.db").metadata().unwrap().len();
    eprintln!("database {} KiB", size >> 10);
}

/// Memory of this process, size of the database and number of files of products and state.
fn held(world: &World) -> (u64, u64, usize) {
    fn files(folder: &Path) -> usize {
        let entries = fs::read_dir(folder).into_iter().flatten().flatten();
        entries
            .map(|entry| {
                if entry.file_type().is_ok_and(|kind| kind.is_dir()) {
                    files(&entry.path())
                } else {
                    1
                }
            })
            .sum()
    }
    let status = fs::read_to_string("/proc/self/status").unwrap();
    let memory = status.lines().find(|line| line.starts_with("VmRSS"));
    let kib = memory.unwrap().split_whitespace().nth(1).unwrap();
    let database = world.path("state/areograph.db").metadata().unwrap().len();
    let files = files(&world.path("state")) + files(&world.path("products"));
    (kib.parse().unwrap(), database >> 10, files)
}

#[test]
fn ten_thousand_jobs_leave_no_more_than_two_thousand() {
    const SITES: usize = 50;
    if !common::long_test("what 10,000 jobs leave behind, minutes") {
        return;
    }
    let more = "[changes]\nquiet_period_s = 0.0\n[workers]\nmin_free_mib = 0\ncount = 4\n\
                [retention]\nruns = 3\nweeks = 2\nevents = 2000\nlogs_days = 10.0\nhistory_days = 10.0\ncopies = 2\n";
    let world = World::new(NOON_MS, more);
    world.put("kernels/all.bc", "0");
    for site in 0..SITES {
        world.site(&format!("s{site}"), &["all.bc"]);
    }
    let life = Life::begin(&world);
    let mut early = (0, 0, 0);
    for day in 0..200 {
        world.put("kernels/all.bc", &day.to_string());
        life.go_on(&world, 14_400, 6);
        // The memory of the simulated world does not belong to the service.
        world.started.lock().unwrap().clear();
        world.kept.lock().unwrap().clear();
        if day == 40 {
            early = held(&world);
        }
    }
    let late = held(&world);
    let jobs = life.ask("SELECT CAST(max(id) AS TEXT) FROM job");
    eprintln!(
        "(memory KiB, database KiB, files) after 2,000 jobs {early:?}, after {jobs:?} {late:?}"
    );
    assert!(jobs[0].parse::<usize>().unwrap() >= 10_000);
    assert_eq!(world.current("s7"), world.clean("s7"));
    // A tenth is left for memory retained by the allocator and SQLite.
    assert!(late.0 <= early.0 * 11 / 10, "memory");
    assert!(late.1 <= early.1 * 11 / 10, "database");
    assert!(late.2 <= early.2 * 11 / 10, "files");
}

/// Kills a service under load repeatedly, and checks its invariants.
fn kills(count: usize) {
    let more = "[changes]\nscan_interval_s = 10.0\nquiet_period_s = 20.0\n[workers]\nmin_free_mib = 0\ncount = 4\nretry_s = 1.0\n";
    let world = World::new(NOON_MS, more);
    for site in 0..12 {
        world.put(&format!("kernels/k{site}.bc"), "0");
        world.site(&format!("s{site}"), &[&format!("k{site}.bc"), "k0.bc"]);
    }
    let mut life = Life::begin(&world);
    life.settle();
    life.go_on(&world, 30, 3);
    let mut at_work = 0;
    for kill in 0..count {
        // Every site reads the first one.
        let kernel = format!(
            "kernels/k{}.bc",
            if kill % 3 == 0 { 0 } else { kill * 5 % 12 }
        );
        world.put(&kernel, &kill.to_string());
        let fates = [Fate::DiesEarly, Fate::DiesPublished, Fate::DiesUnheard];
        world.fates.lock().unwrap().push(fates[kill % 3]);
        // Every second kill occurs at any moment, the others when a worker is active.
        let active = "SELECT site FROM job WHERE state IN ('starting', 'running')";
        for turn in 0..400 {
            if turn % 4 == 0 {
                world.later(15);
            }
            life.turn();
            std::thread::sleep(Duration::from_micros(700));
            let done = if kill % 2 == 0 {
                turn > kill % 23
            } else {
                !life.ask(active).is_empty()
            };
            if done {
                break;
            }
        }
        std::thread::sleep(Duration::from_micros(
            u64::try_from(kill * 37 % 1300).unwrap(),
        ));
        at_work += life.ask(active).len();
        life.kill();
        life = Life::begin(&world);
    }
    world.fates.lock().unwrap().clear();
    life.go_on(&world, 30, 6);
    for site in 0..12 {
        let site = format!("s{site}");
        assert_eq!(world.current(&site), world.clean(&site), "{site}");
    }
    let open = life
        .states()
        .into_iter()
        .filter(|(_, state)| !state.is_final());
    assert_eq!(open.count(), 0);
    let kept = world.kept.lock().unwrap().clone();
    let distinct: BTreeSet<_> = kept.iter().collect();
    assert_eq!(distinct.len(), kept.len(), "an attempt published twice");
    assert_eq!(
        life.ask("SELECT CAST(count(*) AS TEXT) FROM run"),
        [kept.len().to_string()]
    );
    assert_eq!(life.ask("PRAGMA integrity_check"), ["ok"]);
    assert!(
        at_work > count / 4,
        "hardly any kill met a worker: {at_work} of {count}"
    );
    eprintln!(
        "{count} kills of the service, {at_work} workers at work, {} jobs, {} runs",
        life.jobs().len(),
        kept.len()
    );
}

#[test]
fn fifty_kills_of_the_service_under_load() {
    kills(50);
}

#[test]
fn a_thousand_kills_of_the_service_under_load() {
    if !common::long_test("1,000 kills of the service, minutes") {
        return;
    }
    kills(1000);
}
