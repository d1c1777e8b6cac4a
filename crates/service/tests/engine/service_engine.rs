//! The engine when files change, workers die, people send requests and folders vanish; its workers are simulated.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "helpers of tests may fail loudly"
)]

use crate::fake;

use std::sync::{Arc, atomic::Ordering};

use areograph_service::{
    clock::minute_text,
    database::{CauseKind, CauseRow, JobRequest, Priority, enqueue, request_cancel, waits::waits},
    state::JobState,
};
use fake::{Fate, Life, World};

/// 2026-05-01T12:00:00Z.
const NOON_MS: i64 = 1_777_636_800_000;
const MORE: &str =
    "[changes]\nscan_interval_s = 60.0\nquiet_period_s = 600.0\n[workers]\nmin_free_mib = 0\n";

/// Sites `a` and `b` share a kernel, each has a further one, and all have run.
fn two_sites(more: &str) -> (Arc<World>, Life) {
    let world = World::new(NOON_MS, &format!("{MORE}{more}"));
    for kernel in ["both.bc", "a.bsp", "b.bsp"] {
        world.put(&format!("kernels/{kernel}"), "first");
    }
    world.put("kernels/unused.bc", "first");
    // So many that one less does not exceed the allowed loss.
    for number in 0..10 {
        world.put(&format!("kernels/other{number}.bc"), "first");
    }
    world.site("a", &["both.bc", "a.bsp"]);
    world.site("b", &["both.bc", "b.bsp"]);
    world.later(3600);
    let life = Life::begin(&world);
    life.settle();
    life.go_on(&world, 60, 2);
    let mut states = life.states();
    states.sort();
    let both = ["a", "b"].map(|site| (site.to_owned(), JobState::Succeeded));
    assert_eq!(states, both);
    assert_eq!(world.current("a"), world.clean("a"));
    (world, life)
}

/// Sites and states of the jobs after the first two.
fn later_jobs(life: &Life) -> Vec<(String, JobState)> {
    life.states().split_off(2)
}

#[test]
fn only_the_sites_that_read_a_changed_kernel_run_and_the_reason_is_kept() {
    let (world, life) = two_sites("");
    let plans = world.started("plan");
    life.go_on(&world, 60, 3);
    assert_eq!(
        world.started("plan"),
        plans,
        "nothing changed, nothing was planned"
    );
    world.put("kernels/a.bsp", "second");
    // Five minutes later it is still being written: it is quiet only ten minutes after that.
    life.go_on(&world, 60, 5);
    world.put("kernels/a.bsp", "third");
    life.go_on(&world, 60, 9);
    assert_eq!(later_jobs(&life), []);
    assert!(world.current("a").unwrap().contains("first"));
    let stale = life.ask("SELECT stale_because FROM site WHERE name = 'a'");
    assert!(
        stale[0].contains("`a.bsp` changed")
            && stale[0].contains("the quiet period ends at 2026-05-01T13:20:00"),
        "{stale:?}"
    );
    life.go_on(&world, 60, 2);
    assert_eq!(later_jobs(&life), [("a".to_owned(), JobState::Succeeded)]);
    assert_eq!(world.current("a"), world.clean("a"));
    let causes = life.ask("SELECT kind || ' ' || detail FROM cause WHERE job = 3");
    assert_eq!(
        causes,
        ["kernel_changed `a.bsp` changed; stage publish run"]
    );
    let fresh = life.ask("SELECT name FROM site WHERE stale_since_ms IS NULL");
    assert_eq!(fresh, ["a", "b"]);
    assert_eq!(
        life.ask("SELECT moved FROM run WHERE moved IS NOT NULL")
            .len(),
        1
    );
}

#[test]
fn a_site_file_is_used_when_two_polls_find_it_unchanged() {
    let (world, life) = two_sites("");
    let text = world.text("sites/b.toml").unwrap();
    for minute in 0..3 {
        world.put("sites/b.toml", &text[..text.len() / 2 + minute]);
        life.go_on(&world, 60, 1);
        assert_eq!(later_jobs(&life), [], "still being written");
    }
    world.site("b", &["both.bc", "unused.bc"]);
    life.go_on(&world, 60, 2);
    assert_eq!(later_jobs(&life), [("b".to_owned(), JobState::Succeeded)]);
    assert_eq!(world.current("b"), world.clean("b"));
}

#[test]
fn a_touch_hashes_a_file_and_runs_nothing() {
    let (world, life) = two_sites("");
    world.put("kernels/both.bc", "first");
    let (plans, hashes) = (world.started("plan"), world.started("hash"));
    life.go_on(&world, 60, 15);
    assert_eq!(later_jobs(&life), []);
    assert_eq!(
        (world.started("plan"), world.started("hash")),
        (plans, hashes + 1)
    );
    let detail = life.ask("SELECT detail FROM file_version WHERE path LIKE '%both.bc'");
    assert_eq!(detail, ["touched; content unchanged"]);
}

#[test]
fn a_file_that_no_site_reads_is_looked_at_and_noted_as_such() {
    let (world, life) = two_sites("");
    world.put("kernels/unused.bc", "second");
    world.put(
        "sites/a.toml",
        &(world.text("sites/a.toml").unwrap() + "# a remark\n"),
    );
    life.go_on(&world, 60, 15);
    // The simulated plan treats a comment as another configuration: nothing has to run for it.
    assert_eq!(later_jobs(&life), []);
    let note = life.ask("SELECT last_note FROM site WHERE name = 'a'");
    assert_eq!(
        note,
        ["`a.toml` changed; no stage reads the changed inputs"]
    );
}

#[test]
fn a_folder_that_vanishes_runs_nothing_and_is_told_once() {
    let (world, life) = two_sites("[[hooks]]\ncommand = [\"true\"]\n");
    world.mount("kernels", false);
    life.go_on(&world, 60, 5);
    let held = ask_for(&life, "a");
    life.go_on(&world, 60, 5);
    assert_eq!(later_jobs(&life), [("a".to_owned(), JobState::Held)]);
    assert_eq!(world.current("a"), world.clean("a").or(world.current("a")));
    let told = |kind: &str| {
        life.ask(&format!("SELECT body FROM outbox WHERE kind = '{kind}'"))
            .len()
    };
    assert_eq!((told("root_unavailable"), told("root_back")), (1, 0));
    world.mount("kernels", true);
    life.go_on(&world, 60, 3);
    // A person requested a job: the products were up to date.
    assert_eq!(later_jobs(&life), [("a".to_owned(), JobState::Unchanged)]);
    assert_eq!(held, 3);
    assert_eq!((told("root_unavailable"), told("root_back")), (1, 1));
    let open = life.ask("SELECT kind FROM outbox WHERE delivered_ms IS NULL");
    assert_eq!(open, [""; 0]);
}

fn ask_for(life: &Life, site: &str) -> i64 {
    let now_ms = life.shared.now_ms();
    let cause = CauseRow::plain(CauseKind::Requested, "a test", now_ms);
    let asked = life.shared.write(|transaction| {
        enqueue(
            transaction,
            now_ms,
            &JobRequest {
                site,
                priority: Priority::Requested,
                force: false,
                night: None,
                asked_by: Some("test"),
                ready: true,
                causes: &[cause],
            },
        )
    });
    asked.unwrap().job
}

#[test]
fn a_kernel_that_is_not_whole_or_crashes_cspice_is_named_and_the_site_keeps_its_products() {
    let (world, life) = two_sites("");
    world.put("kernels/a.bsp", "half");
    world.put("kernels/b.bsp", "crashes CSPICE");
    life.go_on(&world, 60, 15);
    assert_eq!(later_jobs(&life), []);
    let bad = life.ask("SELECT detail FROM file_version WHERE state = 'bad' ORDER BY path");
    assert_eq!(bad, ["it is not whole", "the worker was ended by signal 9"]);
    let stale = life.ask("SELECT stale_because FROM site WHERE name = 'a'");
    assert_eq!(stale, ["`a.bsp` cannot be used: it is not whole"]);
    assert!(world.current("a").unwrap().contains("first"));
    world.put("kernels/a.bsp", "whole");
    life.go_on(&world, 60, 15);
    assert_eq!(later_jobs(&life), [("a".to_owned(), JobState::Succeeded)]);
}

#[test]
fn a_kernel_whose_check_was_interrupted_is_checked_again() {
    let (world, life) = two_sites("");
    world.put("kernels/a.bsp", "another");
    // With others, then alone.
    world.lost.store(2, Ordering::SeqCst);
    life.go_on(&world, 60, 30);
    assert_eq!(world.lost.load(Ordering::SeqCst), 0);
    let bad = life.ask("SELECT path FROM file_version WHERE state = 'bad'");
    assert_eq!(bad, [""; 0]);
    assert_eq!(later_jobs(&life), [("a".to_owned(), JobState::Succeeded)]);
    assert_eq!(world.current("a"), world.clean("a"));
}

#[test]
fn a_lost_file_holds_its_site_until_it_comes() {
    let (world, life) = two_sites("");
    let left = minute_text(world.clock.now_ms() + 60_000);
    world.remove("kernels/a.bsp");
    life.go_on(&world, 60, 15);
    assert_eq!(later_jobs(&life), [("a".to_owned(), JobState::Held)]);
    let text = life.ask("SELECT outcome FROM job WHERE state = 'held'");
    assert!(
        text[0].contains(&format!("`a.bsp` disappeared from kernels/ at {left}")),
        "{text:?}"
    );
    assert!(world.current("a").is_some(), "products stay served");
    life.go_on(&world, 3600, 3);
    assert_eq!(life.jobs()[2].attempt, 0, "no attempt");
    world.put("kernels/a.bsp", "again");
    life.go_on(&world, 60, 15);
    assert_eq!(later_jobs(&life), [("a".to_owned(), JobState::Succeeded)]);
    // The waiting job was superseded when the inputs reverted.
    world.remove("kernels/b.bsp");
    life.go_on(&world, 60, 15);
    world.put("kernels/b.bsp", "first");
    life.go_on(&world, 60, 15);
    let last = later_jobs(&life).pop().unwrap();
    assert_eq!(last, ("b".to_owned(), JobState::Superseded));
    let why = life.ask("SELECT outcome FROM job WHERE state = 'superseded'");
    assert!(why[0].contains("`b.bsp` is back"), "{why:?}");
}

#[test]
fn a_lost_file_of_several_sites_is_one_alert_and_a_site_may_cease_to_read_it() {
    let (world, life) = two_sites("");
    world.remove("kernels/both.bc");
    life.go_on(&world, 60, 15);
    let held = |site: &str| (site.to_owned(), JobState::Held);
    let mut jobs = later_jobs(&life);
    jobs.sort();
    assert_eq!(jobs, [held("a"), held("b")]);
    let alerts = life.ask(
        "SELECT json_extract(data, '$.alert') || ': ' || json_extract(data, '$.text') FROM event WHERE kind = 'alert'",
    );
    assert_eq!(alerts.len(), 1, "{alerts:?}");
    assert!(
        alerts[0].starts_with(
            "input_lost: 2 sites wait: `both.bc` disappeared from kernels/ at 2026-05-01 13:0"
        ),
        "{alerts:?}"
    );
    let waiting = |life: &Life| life.shared.read(waits).unwrap();
    assert_eq!(waiting(&life)[0].sites, ["a", "b"]);
    // The night plans nothing, and the site that no longer names the file is run.
    let night = life.engine.begin_night().unwrap().unwrap();
    life.settle();
    assert!(
        life.engine
            .night(night)
            .unwrap()
            .unwrap()
            .ended_utc
            .is_some()
    );
    world.site("a", &["a.bsp"]);
    life.go_on(&world, 60, 15);
    assert_eq!(world.current("a"), world.clean("a"));
    assert_eq!(waiting(&life)[0].sites, ["b"]);
    // A service that starts again knows the cause, and reports it no second time.
    life.kill();
    let life = Life::begin(&world);
    life.go_on(&world, 60, 2);
    world.put("kernels/both.bc", "second");
    life.go_on(&world, 60, 15);
    assert_eq!(world.current("b"), world.clean("b"));
    assert_eq!(waiting(&life), []);
    let alerts = life
        .ask("SELECT json_extract(data, '$.alert') FROM event WHERE kind = 'alert' ORDER BY seq");
    assert_eq!(alerts, ["input_lost", "night_complete", "recovered"]);
}

#[test]
fn failures_are_tried_again_by_their_kind() {
    let (world, life) = two_sites("");
    *world.fates.lock().unwrap() = vec![Fate::Works, Fate::Io, Fate::Io];
    world.put("kernels/a.bsp", "second");
    life.go_on(&world, 60, 30);
    let job = life.jobs().pop().unwrap();
    assert_eq!(
        (job.state, job.attempt, job.failures),
        (JobState::Succeeded, 3, 2)
    );
    // A failing site does not delay the night.
    world
        .fate_of
        .lock()
        .unwrap()
        .insert("a".to_owned(), Fate::DiesEarly);
    world.put("kernels/both.bc", "second");
    life.go_on(&world, 60, 40);
    let jobs = life.jobs().split_off(3);
    let of = |site: &str| jobs.iter().find(|job| job.site == site).unwrap();
    assert_eq!((of("a").state, of("a").attempt), (JobState::Failed, 3));
    let text = of("a").outcome.as_ref().unwrap()["text"].as_str().unwrap();
    assert_eq!(
        text,
        "the worker crashed at stage publish: the worker was ended by signal 9"
    );
    assert_eq!(of("b").state, JobState::Succeeded);
    let alerts = life.ask("SELECT data FROM event WHERE kind = 'alert'");
    assert_eq!(alerts.len(), 1, "{alerts:?}");
    // It is retried at night, and its recovery is reported.
    world.fate_of.lock().unwrap().clear();
    let night = life.engine.begin_night().unwrap().unwrap();
    life.settle();
    life.go_on(&world, 60, 2);
    let night = life.engine.night(night).unwrap().unwrap();
    assert_eq!((night.sites_checked, night.runs, night.failures), (2, 1, 0));
    assert!(night.ended_utc.is_some());
    let alerts = life.ask("SELECT json_extract(data, '$.alert') FROM event WHERE kind = 'alert'");
    assert_eq!(alerts, ["failed", "recovered", "night_complete"]);
}

#[test]
fn what_a_dead_worker_published_is_used_and_not_made_twice() {
    let (world, life) = two_sites("");
    for fate in [Fate::DiesUnheard, Fate::DiesPublished] {
        *world.fates.lock().unwrap() = vec![fate];
        world.put("kernels/a.bsp", &format!("{fate:?}"));
        life.go_on(&world, 60, 30);
        assert_eq!(world.current("a"), world.clean("a"), "{fate:?}");
    }
    let jobs = life.jobs().split_off(2);
    let ended: Vec<(JobState, i64)> = jobs.iter().map(|job| (job.state, job.attempt)).collect();
    assert_eq!(ended, [(JobState::Succeeded, 1), (JobState::Succeeded, 2)]);
    // The sites' first jobs run side by side, and either may keep first.
    let mut kept = world.kept.lock().unwrap().clone();
    kept.sort_unstable();
    assert_eq!(kept, [(1, 1), (2, 1), (3, 1), (4, 2)]);
}

#[test]
fn what_a_dead_worker_made_is_kept_though_a_plan_finds_nothing_to_run() {
    let (world, life) = two_sites("");
    *world.fates.lock().unwrap() = vec![Fate::DiesPublished; 3];
    world.put("kernels/a.bsp", "second");
    life.go_on(&world, 60, 40);
    let job = life.jobs().pop().unwrap();
    assert_eq!((job.state, job.attempt), (JobState::Failed, 3));
    assert_ne!(world.current("a"), world.clean("a"));
    // No stage has to run: the products are in the working folder, but not yet published.
    life.engine.begin_night().unwrap();
    life.settle();
    life.go_on(&world, 60, 2);
    assert_eq!(world.current("a"), world.clean("a"));
    let why = life.ask("SELECT detail FROM cause ORDER BY rowid DESC LIMIT 1");
    assert_eq!(why, ["the products were published, but not kept as a run"]);
}

/// Site `a` is active, until it is stopped.
fn at_work() -> (Arc<World>, Life) {
    let (world, life) = two_sites("");
    let lasts = ("a".to_owned(), Fate::Lasts);
    world.fate_of.lock().unwrap().extend([lasts]);
    world.put("kernels/both.bc", "second");
    for _ in 0..12 {
        world.later(60);
        for _ in 0..100 {
            life.turn();
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
    }
    (world, life)
}

#[test]
fn a_person_cancels_a_job_at_work_and_one_that_waits() {
    let (_world, life) = at_work();
    let job = life
        .jobs()
        .into_iter()
        .find(|job| job.state == JobState::Running)
        .unwrap();
    assert_eq!(job.site, "a");
    let waits = ask_for(&life, "a");
    let cancel = |id| {
        let now_ms = life.shared.now_ms();
        let state = life
            .shared
            .write(|transaction| request_cancel(transaction, now_ms, id));
        state.unwrap().unwrap()
    };
    assert_eq!(cancel(waits), JobState::Cancelled);
    assert_eq!(cancel(job.id), JobState::Cancelling);
    life.settle();
    let ended = life
        .jobs()
        .into_iter()
        .find(|found| found.id == job.id)
        .unwrap();
    assert_eq!((ended.state, ended.failures), (JobState::Cancelled, 0));
}

#[test]
fn a_killed_service_leaves_no_job_at_work_and_counts_no_attempt() {
    let (world, life) = at_work();
    assert!(life.states().contains(&("a".to_owned(), JobState::Running)));
    life.kill();
    world.fate_of.lock().unwrap().clear();
    let life = Life::begin(&world);
    let job = life
        .jobs()
        .into_iter()
        .find(|job| job.site == "a" && job.id > 2)
        .unwrap();
    assert_eq!((job.state, job.failures), (JobState::Queued, 0));
    life.settle();
    life.go_on(&world, 60, 3);
    assert_eq!(world.current("a"), world.clean("a"));
    let how = life.ask(
        "SELECT how FROM attempt WHERE job = (SELECT max(job) FROM attempt WHERE n = 2) ORDER BY n",
    );
    assert_eq!(how, ["the worker was stopped", "done"]);
}

#[test]
fn a_backfill_leaves_room_and_the_link_on_the_disk_wins() {
    let (world, life) = two_sites("");
    let first = life.ask("SELECT current_run FROM site WHERE name = 'a'");
    world.put("kernels/a.bsp", "second");
    life.go_on(&world, 60, 15);
    let second = life.ask("SELECT current_run FROM site WHERE name = 'a'");
    assert_ne!(first, second);
    life.kill();
    // The preceding run was restored.
    let link = world.path("products/a/current");
    std::fs::remove_file(&link).unwrap();
    std::os::unix::fs::symlink(format!("runs/{}", first[0]), &link).unwrap();
    // Incomplete runs are removed.
    let partial = world.path("products/a/runs/20270101_000000_j9_a1.partial");
    std::fs::create_dir_all(&partial).unwrap();
    let life = Life::begin(&world);
    assert_eq!(
        life.ask("SELECT current_run FROM site WHERE name = 'a'"),
        first
    );
    assert!(!partial.exists());
}

#[test]
fn a_new_site_runs_and_one_whose_file_is_gone_does_not() {
    let (world, life) = two_sites("");
    world.site("c", &["both.bc"]);
    life.go_on(&world, 60, 15);
    assert_eq!(later_jobs(&life), [("c".to_owned(), JobState::Succeeded)]);
    let why = life.ask("SELECT kind FROM cause WHERE job = 3");
    assert_eq!(why, ["first"]);
    world.remove("sites/c.toml");
    std::fs::remove_file(world.path("sites/c.toml")).unwrap();
    life.go_on(&world, 60, 15);
    // One of three files exceeds the allowed loss: the mount could be incomplete.
    assert_eq!(
        life.ask("SELECT state FROM root WHERE kind = 'sites'"),
        ["unavailable"]
    );
}

#[test]
fn a_new_version_plans_every_site_and_runs_those_of_which_something_changed() {
    let (world, life) = two_sites("");
    life.shared
        .write(|transaction| {
            transaction.execute("UPDATE fact SET value = '0.0.1' WHERE name = 'version'", [])?;
            transaction.execute("UPDATE run SET version = '0.0.1'", [])?;
            Ok(())
        })
        .unwrap();
    life.kill();
    std::fs::remove_file(world.path("products/a/working/a/manifest.json")).unwrap();
    let plans = world.started("plan");
    let life = Life::begin(&world);
    life.settle();
    life.go_on(&world, 60, 2);
    assert_eq!(world.started("plan"), plans + 2);
    assert_eq!(later_jobs(&life), [("a".to_owned(), JobState::Succeeded)]);
    assert_eq!(life.jobs()[2].priority, Priority::Backfill);
    let why = life.ask("SELECT kind FROM cause WHERE job = 3");
    assert_eq!(why, ["tool_changed"]);
}

#[test]
fn a_plan_without_a_change_names_another_program_only_if_there_is_one() {
    for (prepared, expected) in [
        (
            "UPDATE fact SET value = 'another build' WHERE name = 'version'",
            "tool_changed",
        ),
        // A site that is enabled again, or whose file has another name.
        ("UPDATE site SET round = 0 WHERE name = 'a'", "retry_of"),
    ] {
        let (world, life) = two_sites("");
        let prepare = |transaction: &rusqlite::Transaction<'_>| {
            transaction.execute(prepared, [])?;
            Ok(())
        };
        life.shared.write(prepare).unwrap();
        life.kill();
        std::fs::remove_file(world.path("products/a/working/a/manifest.json")).unwrap();
        let life = Life::begin(&world);
        life.settle();
        life.go_on(&world, 60, 2);
        let why = life.ask("SELECT kind FROM cause WHERE job = 3");
        assert_eq!(why, [expected], "{prepared}");
    }
}

#[test]
fn a_damaged_product_is_made_again() {
    let (world, life) = two_sites("");
    let run = &life.ask("SELECT current_run FROM site WHERE name = 'a'")[0];
    let product = world.path(&format!("products/a/runs/{run}/product.txt"));
    std::fs::remove_file(&product).unwrap();
    std::fs::remove_file(world.path("products/a/working/a/manifest.json")).unwrap();
    // A week later, site by site.
    life.go_on(&world, 8 * 86_400, 3);
    life.go_on(&world, 60, 3);
    let why = life.ask("SELECT kind FROM cause WHERE job = 3");
    assert_eq!(why, ["product_damaged"]);
    assert_eq!(world.current("a"), world.clean("a"));
}

#[test]
fn products_are_not_read_while_a_site_runs() {
    let (world, life) = at_work();
    let run = &life.ask("SELECT current_run FROM site WHERE name = 'b'")[0];
    std::fs::remove_file(world.path(&format!("products/b/runs/{run}/product.txt"))).unwrap();
    world.later(8 * 86_400);
    for _ in 0..5 {
        world.later(60);
        for _ in 0..100 {
            life.turn();
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
    }
    let damaged = "SELECT id FROM run WHERE damaged > 0";
    assert_eq!(life.ask(damaged), [""; 0]);
    world.fate_of.lock().unwrap().clear();
    let mut jobs = life.jobs().into_iter();
    let job = jobs.find(|job| job.state == JobState::Running).unwrap();
    let now_ms = world.clock.now_ms();
    let cancelled = life
        .shared
        .write(|transaction| request_cancel(transaction, now_ms, job.id));
    cancelled.unwrap().unwrap();
    life.settle();
    life.go_on(&world, 60, 4);
    assert_eq!(life.ask(damaged), [run.as_str()]);
}
