//! Data of the engine: lost databases, those of other services, and products that change on the disk.
#![allow(
    clippy::disallowed_methods,
    clippy::unwrap_used,
    clippy::panic,
    reason = "helpers of tests damage files and may fail loudly"
)]

use crate::fake;

use std::{fs, process::Command, sync::Arc};

use areograph_base::error::Kind;
use areograph_service::{
    database::{DATABASE, Database},
    rebuild::rebuild,
    recover::make_again,
    state::JobState,
};
use fake::{Life, World};

/// 2026-05-01T12:00:00Z.
const NOON_MS: i64 = 1_777_636_800_000;
const MORE: &str =
    "[changes]\nscan_interval_s = 60.0\nquiet_period_s = 600.0\n[workers]\nmin_free_mib = 0\n";
const DAY_S: i64 = 86_400;

/// A site with two runs, the second with another kernel than the first.
fn two_runs() -> (Arc<World>, Life) {
    let world = World::new(NOON_MS, MORE);
    world.put("kernels/a.bsp", "first");
    world.put("kernels/other.bsp", "first");
    world.site("a", &["a.bsp"]);
    world.later(3600);
    let life = Life::start(&world).unwrap();
    life.settle();
    life.go_on(&world, 60, 2);
    world.put("kernels/a.bsp", "second");
    life.go_on(&world, 60, 13);
    assert_eq!(
        life.states(),
        vec![("a".to_owned(), JobState::Succeeded); 2]
    );
    (world, life)
}

/// The runs of the site, the oldest first.
fn runs(life: &Life) -> Vec<String> {
    life.ask("SELECT id FROM run ORDER BY published_ms, id")
}

/// Changes one bit of a product and restores the time of its content.
fn flip(world: &World, run: &str) {
    let path = world.path(&format!("products/a/runs/{run}/product.txt"));
    let modified = fs::metadata(&path).unwrap().modified().unwrap();
    let mut bytes = fs::read(&path).unwrap();
    bytes[0] ^= 1;
    fs::write(&path, bytes).unwrap();
    let file = fs::File::options().write(true).open(path).unwrap();
    file.set_modified(modified).unwrap();
}

fn remove_database(world: &World) {
    for ending in ["", "-wal", "-shm"] {
        let _ = fs::remove_file(world.path(&format!("state/{DATABASE}{ending}")));
    }
}

/// Alerts that concern data, the oldest first.
fn alerts(life: &Life) -> Vec<String> {
    life.ask(
        "SELECT json_extract(data, '$.alert') AS alert FROM event
         WHERE kind = 'alert' AND alert IN ('product_damaged', 'database_lost') ORDER BY seq",
    )
}

#[test]
fn a_lost_or_empty_database_is_made_again_from_the_products() {
    for empty in [false, true] {
        let (world, life) = two_runs();
        let (before, current) = (runs(&life), world.current("a"));
        life.kill();
        remove_database(&world);
        if empty {
            fs::write(world.path(&format!("state/{DATABASE}")), "").unwrap();
        }
        let life = Life::start(&world).unwrap();
        assert!(!life.shared.is_recovering());
        assert_eq!(runs(&life), before);
        let site = "SELECT s.current_run || ' ' || r.verdict FROM site s JOIN run r ON r.id = s.current_run";
        assert_eq!(life.ask(site), [format!("{} valid", before[1])]);
        assert_eq!(alerts(&life), ["database_lost"]);
        // The site is compared, and nothing runs.
        life.go_on(&world, 60, 13);
        assert_eq!(life.ask("SELECT name FROM site WHERE enabled"), ["a"]);
        assert_eq!(life.states(), []);
        assert_eq!(world.current("a"), current);
        // The next start has nothing to make again.
        life.kill();
        let life = Life::start(&world).unwrap();
        assert_eq!(alerts(&life), ["database_lost"]);
        // Numbers of jobs are not used twice.
        world.put("kernels/a.bsp", "third");
        life.go_on(&world, 60, 13);
        assert_eq!(life.jobs()[0].id, 3);
        assert_eq!(runs(&life).len(), 3);
    }
}

#[test]
fn a_site_that_an_old_copy_of_the_database_does_not_know_comes_back() {
    let (world, life) = two_runs();
    let before = runs(&life);
    life.kill();
    let path = world.path(&format!("state/{DATABASE}"));
    let database = rusqlite::Connection::open(path).unwrap();
    let forget = "DELETE FROM site; DELETE FROM run; DELETE FROM job";
    database.execute_batch(forget).unwrap();
    drop(database);
    let life = Life::start(&world).unwrap();
    assert_eq!(runs(&life), before);
    assert_eq!(
        life.ask("SELECT current_run FROM site"),
        [before[1].clone()]
    );
    assert_eq!(alerts(&life), [""; 0]);
}

#[test]
fn a_loss_of_which_the_recovery_was_interrupted_is_recovered_at_the_next_start() {
    let (world, life) = two_runs();
    let before = runs(&life);
    life.kill();
    remove_database(&world);
    // A service that is told to end at once.
    let started = areograph_service::start::start(world.config(), "serve", world.clock.clone());
    let started = started.unwrap();
    assert!(started.shared.is_recovering());
    started.shared.ending.cancel();
    areograph_service::recover::recover(&started.shared).unwrap();
    assert!(started.shared.is_recovering());
    drop(started);
    let life = Life::start(&world).unwrap();
    assert_eq!(runs(&life), before);
    assert_eq!(alerts(&life), ["database_lost"]);
}

#[test]
fn the_database_of_another_service_is_refused_and_a_rebuilt_one_accepted() {
    let (world, life) = two_runs();
    let before = runs(&life);
    life.kill();
    let (other, life) = two_runs();
    life.kill();
    remove_database(&world);
    for ending in ["", "-wal"] {
        let name = format!("state/{DATABASE}{ending}");
        let _ = fs::copy(other.path(&name), world.path(&name));
    }
    let refused = Life::start(&world).map(|_| ()).unwrap_err();
    assert_eq!(refused.kind(), Kind::Input);
    let text = refused.to_string();
    for part in [
        "it may belong to another service",
        "areograph service rebuild",
    ] {
        assert!(text.contains(part), "{text}");
    }
    let found = rebuild(
        &world.path("state"),
        &world.path("products"),
        world.clock.now_ms(),
    );
    assert_eq!(found.unwrap().runs, 2);
    let life = Life::start(&world).unwrap();
    assert_eq!(runs(&life), before);
}

#[test]
fn a_rebuild_that_was_interrupted_is_completed_at_the_next_start() {
    let (world, life) = two_runs();
    let before = runs(&life);
    life.kill();
    remove_database(&world);
    let database = Database::open(&world.path("state")).unwrap();
    let found = make_again(
        &database,
        &world.path("products"),
        || world.clock.now_ms(),
        || true,
        |_| panic!("the loss is recorded before the runs"),
    );
    assert_eq!(found.unwrap(), None);
    drop(database);
    let life = Life::start(&world).unwrap();
    assert_eq!(runs(&life), before);
    assert_eq!(alerts(&life), ["database_lost"]);
}

/// Copies the products of site `a` to the folder of site `b`, with the older run as the current one.
fn copy_to_b(world: &World, older: &str) {
    let [from, to] = ["a", "b"].map(|site| world.path(&format!("products/{site}")));
    let _ = fs::remove_dir_all(&to);
    let copied = Command::new("cp").arg("-a").arg(from).arg(&to).status();
    assert!(copied.unwrap().success());
    fs::remove_file(to.join("current")).unwrap();
    std::os::unix::fs::symlink(format!("runs/{older}"), to.join("current")).unwrap();
}

#[test]
fn a_copied_folder_does_not_count_as_runs_of_its_site() {
    let (world, life) = two_runs();
    let before = runs(&life);
    life.kill();
    copy_to_b(&world, &before[0]);
    remove_database(&world);
    let life = Life::start(&world).unwrap();
    assert_eq!(runs(&life), before);
    let current = "SELECT name || ' ' || current_run FROM site ORDER BY name";
    assert_eq!(life.ask(current), [format!("a {}", before[1])]);
    let found =
        "SELECT value FROM fact WHERE name IN ('recovered_runs', 'recovered_sites') ORDER BY name";
    assert_eq!(life.ask(found), ["2", "1"]);
}

#[test]
fn the_link_of_a_copied_folder_is_not_followed() {
    let (world, life) = two_runs();
    let older = runs(&life).remove(0);
    world.site("b", &["other.bsp"]);
    life.go_on(&world, 60, 15);
    let current = "SELECT current_run FROM site WHERE name = 'b'";
    let own = life.ask(current);
    assert!(own.len() == 1 && !own[0].is_empty(), "{own:?}");
    life.kill();
    copy_to_b(&world, &older);
    let life = Life::start(&world).unwrap();
    assert_eq!(life.ask(current), own);
}

#[test]
fn damage_of_an_older_run_is_found_after_a_night_and_its_end_as_well() {
    let (world, life) = two_runs();
    let older = runs(&life).remove(0);
    flip(&world, &older);
    let night = |life: &Life| {
        life.go_on(&world, 8 * DAY_S, 1);
        life.go_on(&world, 60, 2);
    };
    night(&life);
    let damaged = "SELECT id || ' ' || damaged FROM run WHERE damaged > 0";
    assert_eq!(life.ask(damaged), [format!("{older} 1")]);
    assert_eq!(alerts(&life), ["product_damaged"]);
    let last = "SELECT value FROM fact WHERE name = 'scrub_damaged_runs'";
    assert_eq!(life.ask(last), ["1"]);
    let checked = "SELECT id FROM run WHERE checked_ms > published_ms + 86400000 ORDER BY id";
    assert_eq!(life.ask(checked).len(), 2);
    // Reported once; an older run is not made again.
    night(&life);
    assert_eq!(alerts(&life), ["product_damaged"]);
    assert_eq!(life.states().len(), 2);
    // Restored from a copy.
    flip(&world, &older);
    night(&life);
    assert_eq!(life.ask(damaged), [""; 0]);
    flip(&world, &older);
    night(&life);
    assert_eq!(alerts(&life), ["product_damaged"; 2]);
}

#[test]
fn products_that_are_not_there_are_not_damaged() {
    let (world, life) = two_runs();
    fs::rename(world.path("products"), world.path("away")).unwrap();
    fs::create_dir(world.path("products")).unwrap();
    life.go_on(&world, 8 * DAY_S, 1);
    let damaged = "SELECT id FROM run WHERE damaged > 0";
    assert_eq!(life.ask(damaged), [""; 0]);
    // A service does not start beside an empty folder, and does not create one.
    life.kill();
    let refused = Life::start(&world).err().unwrap().to_string();
    assert!(
        refused
            .contains("the database records 2 runs, but the folder of the products contains none"),
        "{refused}"
    );
    fs::remove_dir_all(world.path("products")).unwrap();
    assert!(Life::start(&world).is_err());
    assert!(!world.path("products").exists());
    fs::rename(world.path("away"), world.path("products")).unwrap();
    let life = Life::start(&world).unwrap();
    life.go_on(&world, 8 * DAY_S, 1);
    assert_eq!(life.ask(damaged), [""; 0]);
    assert!(!alerts(&life).contains(&"product_damaged".to_owned()));
}
