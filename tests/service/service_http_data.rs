//! Data over HTTP: products under the hash that they have, the status of database and products.
#![allow(
    clippy::disallowed_methods,
    clippy::unwrap_used,
    clippy::panic,
    reason = "helpers of tests damage files and may fail loudly"
)]

use crate::world;

use std::{fs, path::Path, thread::sleep, time::Duration};

use serde_json::{Value, json};
use world::{BEFORE, RUN, World};

const CSV: &str = "tables/footprints.csv";
/// Longer than the time for which a file must be unchanged until its hash is kept, 2 s.
const STEADY: Duration = Duration::from_millis(2100);

fn product(world: &World, run: &str) -> std::path::PathBuf {
    world.path(&format!("products/alpha/runs/{run}/{CSV}"))
}

/// Changes one bit and restores the time of the content.
fn flip(path: &Path) {
    let modified = fs::metadata(path).unwrap().modified().unwrap();
    let mut bytes = fs::read(path).unwrap();
    bytes[100] ^= 1;
    fs::write(path, bytes).unwrap();
    let file = fs::File::options().write(true).open(path).unwrap();
    file.set_modified(modified).unwrap();
}

fn alerts(world: &World) -> i64 {
    let count = "SELECT count(*) FROM event WHERE kind = 'alert' AND json_extract(data, '$.alert') = 'product_damaged'";
    world.number(count)
}

#[test]
fn a_damaged_product_is_withheld_and_reported_once_in_any_run() {
    let world = World::new();
    sleep(STEADY);
    for (number, run) in [RUN, BEFORE].into_iter().enumerate() {
        let address = format!("/api/v1/runs/{run}/files/{CSV}");
        let path = product(&world, run);
        let whole = world.get(&address);
        assert_eq!(whole.status, 200, "{}", whole.text());
        let hash = blake3::hash(&whole.body).to_hex();
        assert_eq!(whole.header("etag"), Some(&*format!("\"{hash}\"")));
        flip(&path);
        for headers in [
            vec![],
            vec!["Range: bytes=0-9".to_owned()],
            vec![format!("If-None-Match: \"{hash}\"")],
        ] {
            let headers: Vec<&str> = headers.iter().map(|header| &**header).collect();
            let answer = world.request("GET", &address, &headers, "");
            assert_eq!(answer.status, 409, "{headers:?}: {}", answer.text());
            assert_eq!(
                answer.header("content-type"),
                Some("application/problem+json")
            );
            assert_eq!(answer.header("etag"), None);
            let problem = answer.json();
            let detail = problem["detail"].as_str().unwrap();
            assert!(
                detail.contains(&format!("`{CSV}` does not match its manifest")),
                "{detail}"
            );
        }
        assert_eq!(alerts(&world), i64::try_from(number).unwrap() + 1);
        // Other products of the run are given out.
        let other = world.get(&format!("/api/v1/runs/{run}/files/report/index.html"));
        assert_eq!(other.status, 200);
        // Mended: the next request finds it whole.
        flip(&path);
        assert_eq!(world.get(&address).status, 200);
    }
    // A current run is made again.
    let asked = "SELECT count(*) FROM job j JOIN cause c ON c.job = j.id WHERE j.site = 'alpha' AND j.state = 'queued' AND c.kind = 'product_damaged'";
    assert_eq!(world.number(asked), 1);
    let run = world.get(&format!("/api/v1/runs/{RUN}")).json();
    assert_eq!(run["damaged"], 1);
    let status = world.get("/api/v1/status").json();
    assert_eq!(status["products"]["runs"], 4);
    assert_eq!(status["products"]["runs_damaged"], 2);
    assert_eq!(status["products"]["damaged"][0]["run"], RUN);
    let metrics = world.get("/metrics").text();
    for line in ["areograph_runs_damaged 2", "areograph_runs_scrub_due 4"] {
        assert!(metrics.contains(line), "{line}: {metrics}");
    }
    let home = world.get("/").text();
    for part in ["do not match their manifests and are withheld", RUN, BEFORE] {
        assert!(home.contains(part), "{part}: {home}");
    }
}

#[test]
fn shots_of_damaged_footprints_are_withheld() {
    let world = World::new();
    let folder = world.path(&format!("products/alpha/runs/{RUN}"));
    let manifest = folder.join("manifest.json");
    let text = fs::read_to_string(&manifest).unwrap();
    let text = text.replace("tables/footprints.csv", "footprints.parquet");
    fs::write(&manifest, &text).unwrap();
    fs::write(folder.join("footprints.parquet"), "damaged").unwrap();
    let hash = blake3::hash(text.as_bytes()).to_hex();
    world.sql(&format!(
        "UPDATE run SET manifest_blake3 = '{hash}' WHERE id = '{RUN}'"
    ));
    let found = world.get("/api/v1/shots?bbox=350,-5,10,5");
    assert_eq!(found.status, 409, "{}", found.text());
    let problem = found.json();
    let detail = problem["detail"].as_str().unwrap();
    assert!(
        detail.contains(RUN) && detail.contains("footprints.parquet"),
        "{detail}"
    );
    assert_eq!(alerts(&world), 1);
}

#[test]
fn a_failed_search_for_shots_states_its_reason() {
    let world = World::new();
    let folder = world.path(&format!("products/alpha/runs/{RUN}"));
    let path = folder.join("manifest.json");
    let mut manifest: Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
    let products = manifest["products"].as_array_mut().unwrap();
    let mut products = products.iter_mut();
    let product = products.find(|product| product["path"] == "tables/footprints.csv");
    let product = product.unwrap();
    // As published, but not Parquet.
    let content = "not Parquet";
    product["path"] = json!("footprints.parquet");
    product["bytes"] = json!(content.len());
    product["blake3"] = json!(blake3::hash(content.as_bytes()).to_hex().as_str());
    fs::write(folder.join("footprints.parquet"), content).unwrap();
    let text = manifest.to_string();
    fs::write(&path, &text).unwrap();
    let hash = blake3::hash(text.as_bytes()).to_hex();
    world.sql(&format!(
        "UPDATE run SET manifest_blake3 = '{hash}' WHERE id = '{RUN}'"
    ));
    let found = world.get("/api/v1/shots?bbox=350,-5,10,5");
    assert_eq!(found.status, 409, "{}", found.text());
    let problem = found.json();
    let detail = problem["detail"].as_str().unwrap();
    let secret = world.folder.path().display().to_string();
    assert!(
        detail.contains("cannot be read as Parquet") && !detail.contains(&secret),
        "{detail}"
    );
}

#[test]
fn a_service_that_makes_a_lost_database_again_is_not_ready_and_states_the_loss_afterwards() {
    let world = World::new();
    assert_eq!(
        world.get("/api/v1/status").json()["database_loss"],
        json!(null)
    );
    world.shared.set_recovering(true);
    let ready = world.get("/readyz");
    assert_eq!((ready.status, &ready.json()["runs"]), (503, &json!(false)));
    assert_eq!(world.get("/api/v1/status").json()["recovering"], true);
    assert!(world.get("/").text().contains("The database was lost"));
    // A site that is not recorded yet is not unknown.
    let missing = world.get("/api/v1/sites/omega/current/footprints.csv");
    assert_eq!(missing.status, 503, "{}", missing.text());
    assert!(missing.header("retry-after").is_some());
    world.shared.set_recovering(false);
    assert_eq!(world.get("/readyz").status, 200);
    world.sql(
        "INSERT INTO fact VALUES ('recovered_ms', '1772332200000'), ('recovered_sites', '1'), ('recovered_runs', '4')",
    );
    let status = world.get("/api/v1/status").json();
    assert_eq!(
        status["database_loss"]["at_utc"],
        "2026-03-01T02:30:00.000Z"
    );
    for text in [
        status["database_loss"]["text"].as_str().unwrap().to_owned(),
        world.get("/").text(),
    ] {
        for part in [
            "1 site, 4 runs",
            "Earlier tokens",
            "audit records",
            "token add",
        ] {
            assert!(text.contains(part), "{part}: {text}");
        }
    }
    let metrics = world.get("/metrics").text();
    assert!(
        metrics.contains("areograph_database_lost_seconds 1772332200"),
        "{metrics}"
    );
}

#[test]
fn wrong_tokens_do_not_lock_out_right_ones_of_the_same_address() {
    let world = World::with("open_reading = \"no\"");
    let with = |token: &str| {
        let header = format!("Authorization: Bearer {token}");
        world.request("GET", "/api/v1/sites", &[&header], "").status
    };
    let log_in = |token: &str| {
        let form = ["Content-Type: application/x-www-form-urlencoded"];
        let body = format!("token={token}");
        world.request("POST", "/login", &form, &body).status
    };
    let id = world.tokens.read.split('_').nth(1).unwrap();
    let wrong = [
        format!("areo_00000000_{}", "0".repeat(64)),
        format!("areo_{id}_{}", "0".repeat(64)),
        world.tokens.revoked.clone(),
        "nonsense".to_owned(),
    ];
    let mut limited = 0;
    for round in 0..15 {
        for token in &wrong {
            for status in [with(token), log_in(token)] {
                assert!([401, 429].contains(&status), "{token}: {status}");
                limited += usize::from(status == 429);
            }
        }
        assert_eq!(with(&world.tokens.read), 200, "round {round}");
        assert_eq!(with(&world.tokens.operate), 200, "round {round}");
        if round < 10 {
            assert_eq!(log_in(&world.tokens.operate), 303, "round {round}");
        }
    }
    // 120 wrong ones, of which 10 at once and one every 5 s get another answer.
    assert!(limited >= 90, "{limited}");
}
