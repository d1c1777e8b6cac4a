//! Nights on a simulated clock, in three time zones around both clock changes, with changes of kernels, failures, and
//! killed workers and services: every night ends as a clean run would.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "helpers of tests may fail loudly"
)]

use crate::fake;

use std::{collections::BTreeSet, sync::Arc, time::Duration};

use chrono::DateTime;
use fake::{Fate, Life, World};

/// Sites, and the kernels that each reads of those below.
const SITES: [(&str, &[&str]); 4] = [
    ("argyre", &["clock.tsc", "mgs1.bsp", "mgs1.bc"]),
    ("eos", &["clock.tsc", "mgs2.bsp", "mgs1.bc"]),
    ("gusev", &["clock.tsc", "mgs2.bsp", "mgs2.bc"]),
    ("isidis", &["clock.tsc", "mgs1.bsp", "mgs2.bc"]),
];
const KERNELS: [&str; 5] = ["clock.tsc", "mgs1.bsp", "mgs2.bsp", "mgs1.bc", "mgs2.bc"];
/// Nights around each clock change.
const NIGHTS: i64 = 4;
const HOUR_S: i64 = 3600;

/// Reproducible random numbers.
struct Dice(u64);

impl Dice {
    fn below(&mut self, count: usize) -> usize {
        // Knuth's linear congruential generator; its upper bits are more random.
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        usize::try_from(self.0 >> 33).unwrap() % count
    }
}

fn at(text: &str) -> i64 {
    DateTime::parse_from_rfc3339(text)
        .unwrap()
        .timestamp_millis()
}

/// A random change of kernels.
fn change(world: &World, dice: &mut Dice, number: usize) {
    let kernel = format!("kernels/{}", KERNELS[dice.below(KERNELS.len())]);
    match dice.below(4) {
        // A touch, or a mirror that restores the same content.
        0 => {
            let text = world.text(&kernel).unwrap();
            world.put(&kernel, &text);
        }
        _ => world.put(&kernel, &format!("version {number}")),
    }
}

/// Turns for a moment of real time, in which the service may be killed.
fn for_a_moment(life: &Life, dice: &mut Dice) {
    for _ in 0..dice.below(12) {
        life.turn();
        std::thread::sleep(Duration::from_micros(500));
    }
}

/// A day in steps of an hour; returns the service that runs at its end.
fn day(world: &Arc<World>, mut life: Life, dice: &mut Dice, number: usize) -> Life {
    let mut away = false;
    for hour in 0..24 {
        world.later(HOUR_S);
        if away {
            world.mount("kernels", true);
            away = false;
        } else if dice.below(5) == 0 {
            change(world, dice, 100 * number + hour);
        } else if dice.below(16) == 0 {
            world.mount("kernels", false);
            away = true;
        }
        if dice.below(6) == 0 {
            let fates = [
                Fate::DiesEarly,
                Fate::DiesPublished,
                Fate::DiesUnheard,
                Fate::Io,
            ];
            let fate = fates[dice.below(fates.len())];
            // A job whose workers die three times fails, as intended: no job meets more than two.
            let met = life.ask("SELECT site FROM job WHERE failures > 0 AND ended_ms IS NULL");
            let mut waiting = world.fates.lock().unwrap();
            if met.is_empty() && waiting.len() < 2 {
                waiting.push(fate);
            }
        }
        if dice.below(8) == 0 {
            for_a_moment(&life, dice);
            life.kill();
            // Down for some hours, at times during the night.
            world.later(HOUR_S * i64::try_from(dice.below(2)).unwrap());
            life = Life::begin(world);
        }
        life.settle();
    }
    world.mount("kernels", true);
    life
}

/// Lets all work finish: no more failures, all quiet.
fn calm(world: &World, life: &Life) {
    world.fates.lock().unwrap().clear();
    life.settle();
    life.go_on(world, 1800, 6);
}

/// What the database says of a site: its row, folders, files, last jobs and events.
fn account(life: &Life, site: &str) -> String {
    let questions = [
        format!("SELECT format('site round %d, stale since %d: %s; %s', round, stale_since_ms, stale_because, last_note) FROM site WHERE name = '{site}'"),
        "SELECT format('root %s %s since %d: %s', path, state, since_ms, detail) FROM root".to_owned(),
        "SELECT format('file %s %s round %d changed %d: %s %s', path, state, round, changed_ms, substr(blake3, 1, 8), detail) FROM file_version".to_owned(),
        format!("SELECT format('input %s %s', path, substr(blake3, 1, 8)) FROM site_input WHERE site = '{site}'"),
        format!("SELECT format('job %d %s created %d ended %d, not before %d: %s', id, state, created_ms, ended_ms, not_before_ms, outcome) FROM job WHERE site = '{site}' AND id > (SELECT max(id) FROM job) - 40"),
        "SELECT format('event %d at %d: %s %s %d %s', seq, at_ms, kind, site, job, data) FROM event WHERE seq > (SELECT max(seq) FROM event) - 80".to_owned(),
        "SELECT format('fact %s = %s', name, value) FROM fact".to_owned(),
    ];
    let answers = questions.iter().flat_map(|question| life.ask(question));
    answers.collect::<Vec<_>>().join("\n")
}

fn nights_in(zone: &str, begin: &str, seed: u64) {
    let more = format!(
        "[schedule]\ncron = \"30 2 * * *\"\nzone = \"{zone}\"\n[changes]\nscan_interval_s = 1800.0\nquiet_period_s = 3600.0\n\
         [workers]\nmin_free_mib = 0\n[retention]\nruns = 3\nweeks = 0\n"
    );
    let world = World::new(at(begin), &more);
    for kernel in KERNELS {
        world.put(&format!("kernels/{kernel}"), "version 0");
    }
    for (site, kernels) in SITES {
        world.site(site, kernels);
    }
    let mut dice = Dice(seed);
    let mut life = Life::begin(&world);
    calm(&world, &life);
    let first_ms = world.clock.now_ms();
    for number in 1..=usize::try_from(NIGHTS).unwrap() {
        life = day(&world, life, &mut dice, number);
        calm(&world, &life);
        for (site, _) in SITES {
            assert_eq!(
                world.current(site),
                world.clean(site),
                "{zone}, night {number}, {site}\n{}",
                account(&life, site)
            );
        }
        let open: Vec<_> = life
            .states()
            .into_iter()
            .filter(|(_, state)| !state.is_final())
            .collect();
        assert_eq!(open, [], "{zone}, night {number}");
        let failed = life.ask("SELECT outcome FROM job WHERE state = 'failed'");
        assert_eq!(failed, [""; 0], "{zone}, night {number}");
    }
    // Every intended instant once, whether it was on time, caught up with or missed.
    let last_ms = world.clock.now_ms();
    let due = life.ask("SELECT CAST(due_ms AS TEXT) FROM night ORDER BY due_ms");
    let due: Vec<i64> = due.iter().map(|text| text.parse().unwrap()).collect();
    assert_eq!(due, instants(zone, first_ms, last_ms), "{zone}");
    assert_eq!(
        life.ask("SELECT how FROM night WHERE ended_ms IS NULL AND how <> 'missed'"),
        [""; 0]
    );
    let kept = world.kept.lock().unwrap().clone();
    let distinct: BTreeSet<_> = kept.iter().collect();
    assert_eq!(distinct.len(), kept.len(), "an attempt published twice");
    let noted = life.ask("SELECT CAST(count(*) AS TEXT) FROM run");
    assert_eq!(noted, [kept.len().to_string()], "a run was lost");
    // Only a limited number of runs of each site is kept.
    for (site, _) in SITES {
        let runs = std::fs::read_dir(world.path(&format!("products/{site}/runs"))).unwrap();
        assert!(runs.count() <= 4, "{site}");
    }
}

/// 02:30 local time, or the end of an omitted hour; of a repeated hour, the first.
fn instants(zone: &str, first_ms: i64, last_ms: i64) -> Vec<i64> {
    use chrono::{NaiveTime, TimeZone as _};
    let zone: chrono_tz::Tz = zone.parse().unwrap();
    let mut day = DateTime::from_timestamp_millis(first_ms)
        .unwrap()
        .date_naive()
        .pred_opt()
        .unwrap();
    let mut instants = Vec::new();
    loop {
        let local = day.and_time(NaiveTime::from_hms_opt(2, 30, 0).unwrap());
        let instant = zone
            .from_local_datetime(&local)
            .earliest()
            .unwrap_or_else(|| {
                let end = day.and_time(NaiveTime::from_hms_opt(3, 0, 0).unwrap());
                zone.from_local_datetime(&end).earliest().unwrap()
            });
        let instant_ms = instant.timestamp_millis();
        if instant_ms > last_ms {
            return instants;
        }
        if instant_ms > first_ms {
            instants.push(instant_ms);
        }
        day = day.succ_opt().unwrap();
    }
}

#[test]
fn berlin() {
    nights_in("Europe/Berlin", "2026-03-27T06:00:00Z", 1);
    nights_in("Europe/Berlin", "2026-10-23T06:00:00Z", 2);
}

#[test]
fn new_york() {
    nights_in("America/New_York", "2026-03-06T12:00:00Z", 3);
    nights_in("America/New_York", "2026-10-30T12:00:00Z", 4);
}

#[test]
fn sydney() {
    nights_in("Australia/Sydney", "2026-10-02T00:00:00Z", 5);
    nights_in("Australia/Sydney", "2026-04-03T00:00:00Z", 6);
}
