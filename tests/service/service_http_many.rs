//! Pages and interface with a long history: 100,000 runs, as many jobs, 1,000 sites, 10,000 kernels.
#![allow(
    clippy::disallowed_methods,
    clippy::unwrap_used,
    clippy::panic,
    reason = "helpers of tests work in temporary folders and may fail loudly"
)]
#![allow(dead_code, reason = "another test program uses the rest of the world")]

use crate::world;

use std::time::{Duration, Instant};

use world::World;

/// Longest time for a page; people wait for nothing that is faster.
const LIMIT: Duration = Duration::from_millis(200);
/// The fastest of so many counts: other programs use the machine too.
const TRIES: usize = 7;

/// Half of the jobs are the site alpha's, the others those of a thousand sites; of every ten one failed.
fn fill(world: &World) {
    world.sql(
        "INSERT INTO night (id, due_ms, zone, started_ms, ended_ms, how)
           WITH RECURSIVE k (k) AS (SELECT 2 UNION ALL SELECT k + 1 FROM k WHERE k < 3000)
           SELECT k, 1600000000000 + k * 86400000, 'UTC', 1, 1, 'due' FROM k;
         INSERT INTO site (name, file, config_blake3, enabled, current_run, checked_ms, west_deg, south_deg, east_deg, north_deg)
           WITH RECURSIVE k (k) AS (SELECT 1 UNION ALL SELECT k + 1 FROM k WHERE k < 1000)
           SELECT 'site_' || k, 'a.toml', 'c', 1, '2020_' || (k * 2), 1600000000000, k % 359, k % 170 - 85, k % 359 + 1, k % 170 - 84 FROM k;
         INSERT INTO job (id, site, state, priority, attempt, night, created_ms, changed_ms, ended_ms, outcome)
           WITH RECURSIVE k (k) AS (SELECT 100 UNION ALL SELECT k + 1 FROM k WHERE k < 100100)
           SELECT k, CASE k % 2 WHEN 0 THEN 'alpha' ELSE 'site_' || (k % 1000 + 1) END, CASE k % 10 WHEN 0 THEN 'failed' ELSE 'succeeded' END,
             1, 1, k % 2998 + 2, 1600000000000 + k * 1000, 1600000000000 + k * 1000, 1600000000000 + k * 1000, '{\"text\": \"published\"}' FROM k;
         INSERT INTO run (id, site, job, attempt, version, manifest_blake3, valid, verdict, reasons, because, stages, counts, figures, kernels, published_ms)
           SELECT '2020_' || id, site, id, 1, '0.1.0', 'a', 1, 'valid', '[]', '[\"mgs_sc_ext1.bc changed\"]', '[]', '{}',
             '{\"range_mean_m\": ' || (id % 97) || '.5, \"position_rmse_m\": 0.02, \"pointing_rmse_rad\": 1e-7}',
             '[{\"name\": \"mgs_sc_ext1.bc\", \"role\": \"ck\", \"blake3\": \"' || (id % 5) || '\"}]', created_ms FROM job WHERE id >= 100;
         INSERT INTO cause (job, kind, path, detail, at_ms) SELECT id, 'kernel_changed', 'a.bc', 'changed', created_ms FROM job WHERE id >= 100;
         INSERT INTO attempt (job, n, started_ms, beat_ms, log) SELECT id, 1, created_ms, created_ms, 'logs/none' FROM job WHERE id >= 100;
         INSERT INTO event (at_ms, kind, site, job, data) SELECT created_ms, 'job', site, id, '{\"state\": \"succeeded\"}' FROM job WHERE id >= 100;",
    );
    let kernels = world.path("kernels").display().to_string();
    world.sql(&format!(
        "INSERT INTO file_version (path, device, inode, size, mtime_ns, ctime_ns, blake3, first_seen_ms, changed_ms, state)
           WITH RECURSIVE k (k) AS (SELECT 1 UNION ALL SELECT k + 1 FROM k WHERE k < 10000)
           SELECT '{kernels}/ck/' || k || '.bc', 1, k, 1, 1, 1, printf('%064d', k), 1, 1, 'ready' FROM k;
         INSERT INTO kernel_coverage (blake3, coverage)
           SELECT blake3, '{{\"position\": [], \"attitude\": [{{\"start\": ' || inode || '.5, \"stop\": ' || (inode + 10) || '.5}}]}}'
           FROM file_version WHERE inode > 10;"
    ));
}

#[test]
fn a_long_history_is_as_fast_as_a_short_one() {
    let world = World::new();
    fill(&world);
    assert!(world.number("SELECT count(*) FROM run") > 100_000);
    let mut slow = Vec::new();
    for path in [
        "/",
        "/sites/alpha",
        "/sites/alpha?after=2020_50000",
        "/sites/site_1",
        "/runs/2020_50000",
        "/jobs",
        "/jobs?after=500",
        "/jobs?state=running",
        "/jobs?state=held",
        "/jobs?state=failed",
        "/jobs?site=gamma&state=succeeded",
        "/jobs/50000",
        "/kernels",
        "/events",
        "/events?kind=alert&site=alpha",
        "/nights",
        "/nights/1500",
        "/api/v1/sites?limit=200",
        "/api/v1/sites/alpha/runs?limit=200",
        "/api/v1/sites/alpha/runs?limit=200&after=2020_200",
        "/api/v1/jobs?limit=200",
        "/api/v1/jobs?state=waiting",
        "/api/v1/jobs?site=gamma&limit=200",
        "/api/v1/jobs/50000",
        "/api/v1/nights?limit=200",
        "/api/v1/kernels?limit=200",
        "/api/v1/kernels?limit=200&after=9900",
        "/api/v1/kernels/0000000000000000000000000000000000000000000000000000000000005000",
        "/readyz",
        "/metrics",
    ] {
        let times = (0..TRIES).map(|_| {
            let began = Instant::now();
            let answer = world.get(path);
            assert_eq!(answer.status, 200, "{path}: {}", answer.text());
            began.elapsed()
        });
        let fastest = times.min().unwrap();
        println!("{:6.1} ms {path}", fastest.as_secs_f64() * 1e3);
        if fastest > LIMIT {
            slow.push(format!("{path}: {fastest:?}"));
        }
    }
    assert!(slow.is_empty(), "{slow:#?}");
}
