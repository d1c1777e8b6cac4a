//! The service over HTTP as programs and people meet it, over loopback with the real loop of connections.
#![allow(
    clippy::disallowed_methods,
    clippy::unwrap_used,
    clippy::panic,
    reason = "helpers of tests work in temporary folders and may fail loudly"
)]

use crate::world;

use std::{
    io::{Read as _, Write as _},
    thread::sleep,
    time::{Duration, Instant},
};

use serde_json::{Value, json};
use world::{BEFORE, KERNEL, NOW_MS, RUN, World};

/// Every answer has these, whatever it says.
const HEADERS: [(&str, &str); 5] = [
    ("x-content-type-options", "nosniff"),
    ("x-frame-options", "DENY"),
    ("cross-origin-opener-policy", "same-origin"),
    ("cross-origin-resource-policy", "same-origin"),
    ("cache-control", "no-store"),
];

#[test]
fn programs_get_documents_without_places_of_the_machine() {
    let world = World::new();
    let secret = world.folder.path().display().to_string();
    for (path, expected) in [
        ("/api/v1/sites", "/items/0/name=alpha"),
        ("/api/v1/sites/alpha", "/verdict=valid with remarks"),
        (
            "/api/v1/sites/beta",
            "/stale_because=kernels/mgs_sc_ext1.bc changed; waiting for the quiet period",
        ),
        ("/api/v1/sites/alpha/runs", &format!("/items/0/id={RUN}")),
        (
            &*format!("/api/v1/runs/{RUN}"),
            "/moved/headline=Footprints moved by at most 31 m",
        ),
        ("/api/v1/jobs", "/items/0/state=failed"),
        (
            "/api/v1/jobs?state=blocked",
            "/items/0/outcome/text=kernels/mgs_sc_ext1.bc does not cover image E02-01453",
        ),
        ("/api/v1/jobs/4", "/causes/0/file=kernels/mgs_sc_ext1.bc"),
        ("/api/v1/jobs/4/log", "/attempt=1"),
        ("/api/v1/nights", "/items/0/how=due"),
        ("/api/v1/nights/1", "/night/zone=Europe/Berlin"),
        ("/api/v1/kernels", "/items/0/file=kernels/ck/mgs_sc_ext1.bc"),
        (
            &*format!("/api/v1/kernels/{KERNEL}"),
            "/attitude/gaps/0/start_et_s=-10000000.0",
        ),
        ("/readyz", "/ready=true"),
        ("/openapi.json", "/openapi=3.1.0"),
    ] {
        let answer = world.get(path);
        assert_eq!(answer.status, 200, "{path}: {}", answer.text());
        assert_eq!(
            answer.header("content-type"),
            Some("application/json"),
            "{path}"
        );
        for (name, value) in HEADERS {
            assert_eq!(answer.header(name), Some(value), "{path}");
        }
        let (pointer, value) = expected.split_once('=').unwrap();
        let found = answer.json().pointer(pointer).cloned().unwrap_or_default();
        let found = found
            .as_str()
            .map_or_else(|| found.to_string(), str::to_owned);
        assert_eq!(found, value, "{path}: {}", answer.text());
        assert!(
            !answer.text().contains(&secret),
            "{path}: {}",
            answer.text()
        );
        let head = world.request("HEAD", path, &[], "");
        assert_eq!((head.status, head.body.len()), (200, 0), "HEAD {path}");
    }
    let instant = &world.get("/api/v1/sites/alpha").json()["current_since_utc"];
    assert_eq!(instant, "2026-02-28T02:30:00.000Z");
    assert_eq!(world.get("/healthz").text(), "ok\n");
    let metrics = world.get("/metrics").text();
    for line in [
        "areograph_jobs{state=\"running\"} 1",
        "areograph_sites 3",
        "areograph_sites_stale 1",
        "route=\"/api/v1/sites/{site}\"",
        "# EOF",
    ] {
        assert!(metrics.contains(line), "{line}: {metrics}");
    }
    assert!(!metrics.contains("alpha"), "{metrics}");
}

#[test]
fn lists_go_on_where_they_ended() {
    let world = World::new();
    for path in [
        "/api/v1/sites",
        "/api/v1/jobs",
        "/api/v1/nights",
        "/api/v1/kernels",
        "/api/v1/sites/alpha/runs",
    ] {
        let all = world.get(&format!("{path}?limit=200")).json();
        let (mut found, mut after) = (Vec::new(), String::new());
        loop {
            let piece = world.get(&format!("{path}?limit=1{after}")).json();
            found.extend(piece["items"].as_array().unwrap().clone());
            match piece["next"].as_str() {
                Some(next) => after = format!("&after={next}"),
                None => break,
            }
        }
        assert_eq!(all["items"], Value::Array(found), "{path}");
        assert_eq!(all["next"], Value::Null);
    }
}

#[test]
fn products_have_tags_ranges_and_no_scripts() {
    let world = World::new();
    let csv = format!("/api/v1/runs/{RUN}/files/tables/footprints.csv");
    let whole = world.get(&csv);
    let content = "orbit,shot,range_m\n10001,1,400000.25\n".repeat(500);
    assert_eq!(whole.status, 200);
    assert!(whole.text() == content);
    let tag = format!("\"{}\"", blake3::hash(content.as_bytes()).to_hex());
    assert_eq!(whole.header("etag"), Some(&*tag));
    assert_eq!(
        whole.header("content-disposition"),
        Some("attachment; filename=\"footprints.csv\"")
    );
    assert!(whole.header("cache-control").unwrap().contains("immutable"));
    assert!(
        whole
            .header("content-security-policy")
            .unwrap()
            .starts_with("sandbox allow-same-origin allow-downloads;")
    );
    let head = world.request("HEAD", &csv, &[], "");
    assert_eq!((head.status, head.body.len()), (200, 0));
    assert_eq!(
        head.header("content-length"),
        Some(&*content.len().to_string())
    );
    for (header, status, expected) in [
        ("Range: bytes=0-4", 206, "orbit"),
        ("Range: bytes=-3", 206, "25\n"),
        ("Range: bytes=99999999-", 416, ""),
        (&*format!("If-None-Match: {tag}"), 304, ""),
        ("If-None-Match: \"other\"", 200, &content),
        ("If-Match: \"other\"", 412, ""),
        (&*format!("If-Match: {tag}"), 200, &content),
    ] {
        let answer = world.request("GET", &csv, &[header], "");
        assert_eq!(answer.status, status, "{header}");
        if status < 400 {
            assert!(answer.text() == expected, "{header}");
            assert_eq!(answer.header("etag"), Some(&*tag), "{header}");
        }
    }
    let current = world.get("/api/v1/sites/alpha/current/report/index.html");
    assert_eq!(current.status, 307);
    let page = world.get(current.header("location").unwrap());
    assert_eq!(
        (page.status, page.header("content-disposition")),
        (200, None)
    );
    assert!(
        page.header("content-security-policy")
            .unwrap()
            .contains("default-src 'none'")
    );
    // Not what the manifest says: neither the file nor, when that is changed, anything.
    let damaged = world.get(&format!("/api/v1/runs/{RUN}/files/damaged.json"));
    assert_eq!(damaged.status, 409, "{}", damaged.text());
    std::fs::write(
        world.path(&format!("products/alpha/runs/{BEFORE}/manifest.json")),
        "{}",
    )
    .unwrap();
    assert_eq!(
        world
            .get(&format!(
                "/api/v1/runs/{BEFORE}/files/tables/footprints.csv"
            ))
            .status,
        409
    );
    world.sql(&format!(
        "UPDATE run SET removed_ms = 1 WHERE id = '{BEFORE}'"
    ));
    assert_eq!(
        world
            .get(&format!(
                "/api/v1/runs/{BEFORE}/files/tables/footprints.csv"
            ))
            .status,
        410
    );
}

#[test]
fn jobs_are_asked_for_once_cancelled_and_tried_again() {
    let world = World::new();
    let body = json!({ "sites": ["alpha"], "reason": "a new calibration" }).to_string();
    let key = ["Idempotency-Key: abc-1"];
    let first = world.operate("POST", "/api/v1/jobs", &key, &body);
    assert_eq!(first.status, 202, "{}", first.text());
    let job = first.json()["jobs"][0]["job"].as_i64().unwrap();
    assert_eq!(
        first.header("location"),
        Some(&*format!("/api/v1/jobs/{job}"))
    );
    let again = world.operate("POST", "/api/v1/jobs", &key, &body);
    assert_eq!(
        (again.status, again.json()["jobs"][0]["job"].as_i64()),
        (200, Some(job))
    );
    let other = json!({ "sites": ["gamma"] }).to_string();
    assert_eq!(
        world.operate("POST", "/api/v1/jobs", &key, &other).status,
        409
    );
    // Without a key it joins the job that waits.
    let joined = world.operate("POST", "/api/v1/jobs", &[], &body);
    assert_eq!(
        (joined.status, joined.json()["jobs"][0]["joined"].as_bool()),
        (200, Some(true))
    );
    let detail = world.get(&format!("/api/v1/jobs/{job}")).json();
    assert_eq!(detail["job"]["state"], "queued");
    assert_eq!(detail["causes"][0]["detail"], "a new calibration");
    assert_eq!(
        world
            .operate("POST", &format!("/api/v1/jobs/{job}/cancel"), &[], "")
            .json()["state"],
        "cancelled"
    );
    assert_eq!(
        world
            .operate("POST", &format!("/api/v1/jobs/{job}/cancel"), &[], "")
            .status,
        200
    );
    // At work: it is asked to stop.
    assert_eq!(
        world
            .operate("POST", "/api/v1/jobs/4/cancel", &[], "")
            .json()["state"],
        "cancelling"
    );
    assert_eq!(
        world
            .operate("POST", "/api/v1/jobs/1/cancel", &[], "")
            .status,
        409
    );
    assert_eq!(
        world
            .operate("POST", "/api/v1/jobs/1/retry", &[], "")
            .status,
        409
    );
    assert_eq!(
        world
            .operate("POST", "/api/v1/jobs/6/retry", &[], "")
            .json()["state"],
        "queued"
    );
    let retried = world
        .operate("POST", &format!("/api/v1/jobs/{job}/retry"), &[], "")
        .json();
    assert!(retried["id"].as_i64().unwrap() > job);
    assert_eq!(
        world
            .operate("POST", "/api/v1/jobs/99/cancel", &[], "")
            .status,
        404
    );
    let pinned = world.operate(
        "PATCH",
        &format!("/api/v1/runs/{RUN}"),
        &[],
        "{\"pinned\": true}",
    );
    assert_eq!(pinned.json()["pinned"], true);
    let all = world
        .operate("POST", "/api/v1/jobs", &[], "{\"sites\": \"all\"}")
        .json();
    let sites: Vec<&Value> = all["jobs"]
        .as_array()
        .unwrap()
        .iter()
        .map(|job| &job["site"])
        .collect();
    assert_eq!(sites, ["alpha", "beta", "gamma"]);
    // Who asked for what is kept.
    let id = world.tokens.operate.split('_').nth(1).unwrap().to_owned();
    assert_eq!(
        world.number(&format!("SELECT count(*) FROM audit WHERE who = '{id}'")),
        10
    );
    assert_eq!(world.number("SELECT count(*) FROM audit"), 10);
}

#[test]
fn events_go_on_after_the_last_one_seen() {
    let mut world = World::new();
    let open = |header: &str| {
        let mut stream = world.connect();
        stream
            .set_read_timeout(Some(Duration::from_millis(200)))
            .unwrap();
        let request = format!(
            "GET /api/v1/events HTTP/1.1\r\nHost: {}\r\n{header}\r\n",
            world.address
        );
        stream.write_all(request.as_bytes()).unwrap();
        stream
    };
    let read_until = |stream: &mut std::net::TcpStream, wanted: &str| {
        let (mut text, began) = (String::new(), Instant::now());
        while !text.contains(wanted) && began.elapsed() < Duration::from_secs(10) {
            let mut bytes = [0; 4096];
            if let Ok(read) = stream.read(&mut bytes) {
                text += &String::from_utf8_lossy(&bytes[..read]);
            }
        }
        assert!(text.contains(wanted), "{wanted}: {text}");
        text
    };
    let mut resumed = open("Last-Event-ID: 1\r\n");
    // Not its number: the identifier of the request in the header may begin with the same digit.
    let text = read_until(&mut resumed, "\"kernels/naif0012.tls\"");
    assert!(!text.contains("id: 1\n"), "{text}");
    assert!(
        text.contains("event: run") && text.contains("id: 2\n"),
        "{text}"
    );
    assert!(text.contains("text/event-stream"), "{text}");
    let mut fresh = open("");
    read_until(&mut fresh, "200 OK");
    world.operate("POST", "/api/v1/jobs", &[], "{\"sites\": [\"alpha\"]}");
    for stream in [&mut fresh, &mut resumed] {
        let text = read_until(stream, "\"state\":\"queued\"");
        assert!(
            text.contains("event: job") && text.contains("id: 3\n"),
            "{text}"
        );
    }
    // Events that are no longer kept are told of.
    world.sql("DELETE FROM event WHERE seq < 3");
    read_until(&mut open("Last-Event-ID: 1\r\n"), "event: lost");
    // A token that is revoked ends its stream; the end of the service ends all.
    drop(fresh);
    let took = world.end();
    assert!(took < Duration::from_secs(5), "{took:?}");
    let mut rest = Vec::new();
    resumed
        .set_read_timeout(Some(Duration::from_secs(5)))
        .unwrap();
    resumed.read_to_end(&mut rest).unwrap();
}

#[test]
fn streams_of_events_are_counted() {
    let world = World::new();
    let request = format!(
        "GET /api/v1/events HTTP/1.1\r\nHost: {}\r\n\r\n",
        world.address
    );
    let mut open = Vec::new();
    for _ in 0..64 {
        let mut stream = world.connect();
        stream.write_all(request.as_bytes()).unwrap();
        let mut head = [0; 12];
        stream.read_exact(&mut head).unwrap();
        assert_eq!(&head, b"HTTP/1.1 200");
        open.push(stream);
    }
    let refused = world.get("/api/v1/events");
    assert_eq!(
        (refused.status, refused.header("retry-after")),
        (503, Some("10"))
    );
    drop(open);
    let began = Instant::now();
    while world
        .get("/metrics")
        .text()
        .contains("areograph_event_streams_open 64")
    {
        assert!(began.elapsed() < Duration::from_secs(10));
        sleep(Duration::from_millis(50));
    }
}

/// The value of a cookie, or of a field of a form.
fn between(text: &str, before: &str, after: char) -> String {
    let start = text
        .find(before)
        .unwrap_or_else(|| panic!("no {before} in {text}"))
        + before.len();
    text[start..].split(after).next().unwrap().to_owned()
}

#[test]
#[allow(
    clippy::too_many_lines,
    reason = "one visit, told from login to logout"
)]
fn people_log_in_change_something_and_log_out() {
    let world = World::with("open_reading = \"no\"");
    let form = ["Content-Type: application/x-www-form-urlencoded"];
    let away = world.get("/jobs/4?a=b");
    assert_eq!(
        (away.status, away.header("location")),
        (303, Some("/login?next=/jobs/4%3Fa%3Db"))
    );
    assert!(
        world
            .get("/login?next=/jobs/4")
            .text()
            .contains("value=\"/jobs/4\"")
    );
    assert_eq!(
        world
            .request("POST", "/login", &form, "token=areo_00000000_00")
            .status,
        401
    );
    let entered = world.request(
        "POST",
        "/login",
        &form,
        &format!("token={}&next=/jobs/4", world.tokens.operate),
    );
    assert_eq!(
        (entered.status, entered.header("location")),
        (303, Some("/jobs/4"))
    );
    let cookie = entered.header("set-cookie").unwrap();
    for part in ["HttpOnly", "SameSite=Strict", "Path=/", "Max-Age=43200"] {
        assert!(cookie.contains(part), "{cookie}");
    }
    let reference = between(cookie, "areograph=", ';');
    assert_eq!(reference.len(), 64);
    let session = format!("Cookie: areograph={reference}");
    let page = world.request("GET", "/jobs/4", &[&session], "");
    assert_eq!(page.status, 200, "{}", page.text());
    let token = between(&page.text(), "name=\"form_token\" value=\"", '"');
    // A session changes nothing by the interface for programs, nor without the form's token, nor from elsewhere.
    let json = ["Content-Type: application/json", &session];
    assert_eq!(
        world
            .request("POST", "/api/v1/jobs", &json, "{\"sites\": \"all\"}")
            .status,
        401
    );
    let with_session = [form[0], &session];
    assert_eq!(
        world
            .request("POST", "/jobs/4/cancel", &with_session, "form_token=")
            .status,
        403
    );
    let foreign = [
        form[0],
        &session,
        "Sec-Fetch-Site: cross-site",
        "Origin: https://evil.example",
    ];
    assert_eq!(
        world
            .request(
                "POST",
                "/jobs/4/cancel",
                &foreign,
                &format!("form_token={token}")
            )
            .status,
        403
    );
    assert_eq!(world.number("SELECT cancel_asked FROM job WHERE id = 4"), 0);
    let done = world.request(
        "POST",
        "/jobs/4/cancel",
        &with_session,
        &format!("form_token={token}"),
    );
    assert_eq!(
        (done.status, done.header("location")),
        (303, Some("/jobs/4"))
    );
    assert_eq!(world.number("SELECT cancel_asked FROM job WHERE id = 4"), 1);
    let run = world.request(
        "POST",
        "/sites/alpha/run",
        &with_session,
        &format!("form_token={token}&reason=&force=true"),
    );
    assert_eq!(run.status, 303, "{}", run.text());
    let pin = world.request(
        "POST",
        &format!("/runs/{RUN}/pin"),
        &with_session,
        &format!("form_token={token}&pinned=true"),
    );
    assert_eq!(pin.status, 303);
    let left = world.request(
        "POST",
        "/logout",
        &with_session,
        &format!("form_token={token}"),
    );
    assert_eq!(left.status, 303);
    assert_eq!(world.request("GET", "/jobs/4", &[&session], "").status, 303);
    // Another one ends by itself after an hour without use.
    let entered = world.request(
        "POST",
        "/login",
        &form,
        &format!("token={}", world.tokens.read),
    );
    let session = format!(
        "Cookie: areograph={}",
        between(entered.header("set-cookie").unwrap(), "areograph=", ';')
    );
    let page = world.request("GET", "/jobs/4", &[&session], "");
    assert_eq!(page.status, 200);
    assert!(
        !page.text().contains("/jobs/4/cancel"),
        "a reader sees no button"
    );
    world.clock.set(NOW_MS + 3_600_001);
    assert_eq!(world.request("GET", "/jobs/4", &[&session], "").status, 303);
}

#[test]
fn behind_a_proxy_cookies_are_for_this_host_alone_and_nothing_is_open() {
    let world =
        World::with("public_url = \"https://mars.example.org\"\nbehind_tls_proxy = \"yes\"");
    let raw = |text: &str| world.raw(text.as_bytes());
    let host = "Host: mars.example.org\r\nX-Forwarded-For: 192.0.2.7\r\nConnection: close\r\n";
    assert_eq!(
        raw(&format!("GET /api/v1/sites HTTP/1.1\r\n{host}\r\n")).status,
        401
    );
    assert_eq!(world.get("/api/v1/sites").status, 401);
    let body = format!("token={}", world.tokens.read);
    let entered = raw(&format!(
        "POST /login HTTP/1.1\r\n{host}Content-Type: application/x-www-form-urlencoded\r\nContent-Length: {}\r\n\r\n{body}",
        body.len()
    ));
    let cookie = entered.header("set-cookie").unwrap();
    assert!(
        cookie.starts_with("__Host-areograph=") && cookie.ends_with("; Secure"),
        "{cookie}"
    );
    let session = between(cookie, "__Host-areograph=", ';');
    let page = raw(&format!(
        "GET / HTTP/1.1\r\n{host}Cookie: __Host-areograph={session}\r\n\r\n"
    ));
    assert_eq!(page.status, 200);
}

/// Pages, and parts of each.
const PAGES: &[(&str, &[&str])] = &[
    (
        "/",
        &[
            "<h1>Sites</h1>",
            "Stale since",
            "<svg",
            "href=\"/sites/alpha\"",
            "Night of",
            "03:30 CET",
        ],
    ),
    (
        "/sites/alpha",
        &[
            "valid with remarks",
            "range mean, m",
            "<svg",
            "mgs_sc_ext1.bc changed",
            RUN,
        ],
    ),
    (
        "/sites/gamma",
        &["is invalid and did not become current", "limit 50 m"],
    ),
    ("/jobs", &["crashed at stage register", "href=\"/jobs/4\""]),
    ("/jobs?state=running", &["beta"]),
    (
        "/jobs/4",
        &[
            "its coverage overlaps image E02-01453",
            "7 of 20",
            "&lt;script&gt;alert(1)",
            "<progress",
        ],
    ),
    ("/jobs/7", &["signal 11"]),
    (
        "/runs/20260301_010000_j2_a1",
        &[
            "Footprints moved by at most 31 m",
            "tables/footprints.csv",
            "changed",
            BEFORE,
        ],
    ),
    (
        "/kernels",
        &["ck/mgs_sc_ext1.bc", "with 1 gap", "href=\"/sites/beta\""],
    ),
    ("/nights", &["href=\"/nights/1\""]),
    ("/nights/1", &["Complete, with failures"]),
    (
        "/events",
        &[
            "succeeded",
            "href=\"/jobs/1\"",
            "href=\"/events?kind=alert\"",
        ],
    ),
    ("/events?kind=run&site=alpha", &[RUN, "value=\"alpha\""]),
    ("/events?kind=alert", &["None."]),
    (
        "/docs",
        &[
            "GET /api/v1/sites/{site}",
            "href=\"#document-Status\"",
            "id=\"document-Status\"",
            "href=\"/openapi.json\"",
        ],
    ),
    ("/login", &["type=\"password\""]),
];

#[test]
fn pages_are_whole_without_a_script() {
    let world = World::new();
    let secret = world.folder.path().display().to_string();
    for (path, expected) in PAGES {
        let answer = world.get(path);
        let text = answer.text();
        assert_eq!(answer.status, 200, "{path}: {text}");
        assert_eq!(
            answer.header("content-type"),
            Some("text/html; charset=utf-8")
        );
        for part in *expected {
            assert!(text.contains(part), "{path}: no {part} in {text}");
        }
        assert!(
            !text.contains(&secret) && !text.contains("root:"),
            "{path}: {text}"
        );
        assert!(
            !text.contains("<script>") && !text.contains(" style="),
            "{path}: {text}"
        );
        let policy = answer.header("content-security-policy").unwrap();
        assert!(
            policy.starts_with("default-src 'none'") && !policy.contains("unsafe"),
            "{policy}"
        );
    }
    let missing = world.get("/nothing");
    assert_eq!(
        (missing.status, missing.header("content-type")),
        (404, Some("text/html; charset=utf-8"))
    );
    let style = between(&world.get("/").text(), "rel=\"stylesheet\" href=\"", '"');
    assert_eq!(
        world.get(&style).header("content-type"),
        Some("text/css; charset=utf-8")
    );
}

#[test]
fn the_page_of_the_interface_names_every_operation() {
    let world = World::new();
    let docs = world.get("/docs").text();
    let described = world.get("/openapi.json").json();
    for (path, item) in described["paths"].as_object().unwrap() {
        for method in item
            .as_object()
            .unwrap()
            .keys()
            .filter(|key| *key != "parameters")
        {
            let operation = format!("<code>{} {path}</code>", method.to_uppercase());
            assert!(docs.contains(&operation), "no {operation}");
        }
    }
}

#[test]
fn a_service_that_cannot_work_says_so() {
    let world = World::new();
    world.sql(
        "UPDATE root SET state = 'unavailable', detail = 'it is empty' WHERE kind = 'kernels'",
    );
    let ready = world.get("/readyz");
    assert_eq!((ready.status, &ready.json()["roots"]), (503, &json!(false)));
    let home = world.get("/").text();
    assert!(
        home.contains("<code>kernels</code> has been unavailable since"),
        "{home}"
    );
    world.shared.set_problem(Some("line 3: cron".to_owned()));
    assert_eq!(world.get("/readyz").json()["configuration"], false);
    assert!(
        world
            .get("/")
            .text()
            .contains("The changed configuration was rejected")
    );
    assert_eq!(world.get("/healthz").status, 200);
}

#[test]
fn an_unknown_kind_of_events_is_refused() {
    let world = World::new();
    let refused = world.get("/events?kind=runs");
    assert_eq!(refused.status, 400);
    assert!(refused.text().contains("not a valid kind of event"));
    assert_eq!(world.get("/events?kind=").status, 200);
}

#[test]
fn a_lost_kernel_is_one_line_and_its_sites_wait() {
    let world = World::new();
    let lost = "`mgs_sc_ext1.bc` disappeared from ck/ at 2026-03-01 01:30 UTC; restore it";
    world.sql(&format!(
        "UPDATE file_version SET state = 'gone' WHERE path LIKE '%mgs_sc_ext1.bc';
         UPDATE site_input SET blake3 = NULL;
         UPDATE site SET problem = '{lost}', stale_because = '{lost}', stale_since_ms = 1 WHERE name IN ('alpha', 'beta')",
    ));
    let home = world.get("/").text();
    assert_eq!(home.matches("disappeared from ck/ at").count(), 1, "{home}");
    let line = between(&home, "<code>mgs_sc_ext1.bc</code> disappeared", '\n');
    for part in [
        "2 sites wait for it: ",
        "href=\"/sites/alpha\"",
        "href=\"/sites/beta\"",
        "The products of 2026-02-28 02:30 UTC remain current.",
    ] {
        assert!(line.contains(part), "no {part} in {line}");
    }
    let headline =
        "4 sites: 2 stale, 2 waiting for an input, 1 with an invalid newest run, 1 without a run<";
    assert!(home.contains(headline), "{home}");
    let table = "waits</span> for <code>mgs_sc_ext1.bc</code>";
    assert_eq!(home.matches(table).count(), 2, "{home}");
    assert!(home.contains("class=\"site remarks waits\"") && home.contains("dashed frame"));
    assert!(home.contains("Next night: "));
    let site = world.get("/sites/alpha").text();
    assert!(site.contains("valid with remarks; waits for mgs_sc_ext1.bc"));
    let status = world.get("/api/v1/status").json();
    assert_eq!(status["waits"][0]["sites"], json!(["alpha", "beta"]));
    assert_eq!(status["next_night_utc"], "2026-03-02T01:30:00.000Z");
    let site = world.get("/api/v1/sites/beta").json();
    assert_eq!(site["waits_for"], "mgs_sc_ext1.bc");
}

#[test]
fn plans_and_shots_come_from_workers() {
    let world = World::new();
    let secret = world.folder.path().display().to_string();
    let begun = world.operate("POST", "/api/v1/sites/alpha/plan", &[], "");
    assert_eq!(
        (begun.status, &begun.json()["state"]),
        (202, &json!("running"))
    );
    let place = begun.header("location").unwrap().to_owned();
    let (mut plan, started) = (begun.json(), Instant::now());
    while plan["state"] == "running" && started.elapsed() < Duration::from_secs(20) {
        sleep(Duration::from_millis(50));
        plan = world.get(&place).json();
    }
    // The site file is not there, which is told without the folder that leads to it.
    assert_eq!(plan["state"], "failed");
    let problem = plan["problem"].as_str().unwrap();
    assert!(
        problem.contains("sites/alpha.toml") && !problem.contains(&secret),
        "{problem}"
    );
    // The run has no footprints to search.
    for (media, beginning) in [
        ("application/geo+json", "{\n\"type\": \"FeatureCollection\""),
        ("text/csv", ""),
        ("application/vnd.apache.parquet", "PAR1"),
    ] {
        let accept = format!("Accept: {media}");
        let found = world.request("GET", "/api/v1/shots?bbox=350,-5,10,5", &[&accept], "");
        assert_eq!(found.status, 200, "{}", found.text());
        assert_eq!(found.header("content-type"), Some(media));
        assert_eq!(found.header("areograph-complete"), Some("true"));
        assert_eq!(found.header("areograph-rows"), Some("0"));
        assert!(
            found.text().starts_with(beginning),
            "{media}: {}",
            found.text()
        );
    }
    let left = std::fs::read_dir(world.path("state/requests"))
        .unwrap()
        .count();
    assert_eq!(left, 0, "files of requests are removed");
}

/// Serves the filled database on a fixed port until it is ended, for looking at pages by hand and for `scripts/look`.
#[test]
#[ignore = "serves until it is ended: for scripts/look-service and scripts/hammer"]
fn serve_until_ended() {
    let now_ms = std::time::SystemTime::now()
        .duration_since(std::time::UNIX_EPOCH)
        .unwrap();
    let world = World::at(
        "127.0.0.1:8471",
        "open_reading = \"no\"",
        i64::try_from(now_ms.as_millis()).unwrap(),
    );
    println!("http://{} {}", world.address, world.tokens.operate);
    loop {
        sleep(Duration::from_mins(1));
    }
}
