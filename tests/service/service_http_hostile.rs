//! Requests that nobody of good will sends: all refused, and nothing told.
#![allow(
    clippy::disallowed_methods,
    clippy::unwrap_used,
    clippy::panic,
    reason = "helpers of tests work in temporary folders and may fail loudly"
)]
#![allow(dead_code, reason = "another test program uses the rest of the world")]

use crate::world;

use std::{
    io::{Read as _, Write as _},
    thread::sleep,
    time::{Duration, Instant},
};

use serde_json::json;
use world::{Answer, RUN, World};

/// A request as bytes; `HOST` stands for the right host and port.
struct Hostile {
    what: &'static str,
    request: String,
    /// Statuses that refuse it; 0 is a connection that is closed without an answer.
    refused: &'static [u16],
}

fn hostile(what: &'static str, request: impl Into<String>, refused: &'static [u16]) -> Hostile {
    Hostile {
        what,
        request: request.into(),
        refused,
    }
}

fn get(path: &str) -> String {
    format!("GET {path} HTTP/1.1\r\nHost: HOST\r\nConnection: close\r\n\r\n")
}

fn with(path: &str, headers: &str) -> String {
    format!("GET {path} HTTP/1.1\r\nHost: HOST\r\nConnection: close\r\n{headers}\r\n\r\n")
}

fn send(method: &str, path: &str, headers: &str, body: &str) -> String {
    format!(
        "{method} {path} HTTP/1.1\r\nHost: HOST\r\nConnection: close\r\n{headers}Content-Length: {}\r\n\r\n{body}",
        body.len()
    )
}

/// Names that are not ours, in every place where a host can stand.
fn forged_hosts(_: &World) -> Vec<Hostile> {
    let host = |host: &str| format!("GET / HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n");
    vec![
        hostile("another name", host("evil.example"), &[421]),
        hostile(
            "another name with our port",
            host("evil.example:80"),
            &[421],
        ),
        hostile("our name without the port", host("localhost"), &[421]),
        hostile("our name with another port", host("localhost:1"), &[421]),
        hostile(
            "a name that ends like ours",
            host("evil.localhost:PORT"),
            &[421],
        ),
        hostile(
            "a name that begins like ours",
            host("127.0.0.1.evil.example:PORT"),
            &[421],
        ),
        hostile("an empty host", host(""), &[421, 400]),
        hostile(
            "no host",
            "GET / HTTP/1.1\r\nConnection: close\r\n\r\n",
            &[421, 400],
        ),
        hostile(
            "HTTP/1.0 without a host",
            "GET / HTTP/1.0\r\n\r\n",
            &[421, 400],
        ),
        hostile(
            "two hosts",
            "GET / HTTP/1.1\r\nHost: HOST\r\nHost: evil.example\r\nConnection: close\r\n\r\n",
            &[421, 400],
        ),
        hostile(
            "another host in the target",
            "GET http://evil.example/ HTTP/1.1\r\nHost: HOST\r\nConnection: close\r\n\r\n",
            &[421],
        ),
        hostile(
            "our host in the target alone",
            "GET http://HOST/ HTTP/1.1\r\nHost: evil.example\r\nConnection: close\r\n\r\n",
            &[421],
        ),
        hostile(
            "a user before the host",
            host("evil@127.0.0.1:PORT"),
            &[421, 400],
        ),
        hostile(
            "another host for a change",
            "POST /api/v1/jobs HTTP/1.1\r\nHost: evil.example\r\nContent-Length: 0\r\nConnection: close\r\n\r\n",
            &[421],
        ),
    ]
}

/// Changes from pages of other sites.
fn forged_origins(world: &World) -> Vec<Hostile> {
    let token = format!(
        "Authorization: Bearer {}\r\nContent-Type: application/json\r\n",
        world.tokens.operate
    );
    let form = "Content-Type: application/x-www-form-urlencoded\r\n";
    vec![
        hostile(
            "a form of another site",
            send(
                "POST",
                "/login",
                &format!("{form}Origin: https://evil.example\r\n"),
                "token=a",
            ),
            &[403],
        ),
        hostile(
            "a form of no origin",
            send(
                "POST",
                "/login",
                &format!("{form}Origin: null\r\n"),
                "token=a",
            ),
            &[403],
        ),
        hostile(
            "a form of our name on another port",
            send(
                "POST",
                "/login",
                &format!("{form}Origin: http://127.0.0.1:1\r\n"),
                "token=a",
            ),
            &[403],
        ),
        hostile(
            "a fetch of another site",
            send(
                "POST",
                "/api/v1/jobs",
                &format!("{token}Sec-Fetch-Site: cross-site\r\n"),
                "{\"sites\":\"all\"}",
            ),
            &[403],
        ),
        hostile(
            "a fetch of a sister site",
            send(
                "POST",
                "/api/v1/jobs",
                &format!("{token}Sec-Fetch-Site: same-site\r\n"),
                "{\"sites\":\"all\"}",
            ),
            &[403],
        ),
        hostile(
            "a form as JSON's text/plain",
            send(
                "POST",
                "/api/v1/jobs",
                &format!(
                    "Authorization: Bearer {}\r\nContent-Type: text/plain\r\n",
                    world.tokens.operate
                ),
                "{\"sites\":\"all\"}",
            ),
            &[415],
        ),
        hostile(
            "a form for programs",
            send(
                "POST",
                "/api/v1/jobs",
                &format!("Authorization: Bearer {}\r\n{form}", world.tokens.operate),
                "all=true",
            ),
            &[415],
        ),
        hostile(
            "a question before a cross-origin request",
            "OPTIONS /api/v1/jobs HTTP/1.1\r\nHost: HOST\r\nOrigin: https://evil.example\r\nAccess-Control-Request-Method: POST\r\nConnection: close\r\n\r\n",
            &[405],
        ),
        hostile(
            "a button without a session",
            send("POST", "/jobs/4/cancel", form, "form_token=a"),
            &[401],
        ),
    ]
}

/// Ways out of folders, in every parameter.
fn traversals(_: &World) -> Vec<Hostile> {
    let file = |path: &str| get(&format!("/api/v1/runs/{RUN}/files/{path}"));
    let mut all = vec![
        hostile("up", file("../manifest.json"), &[404]),
        hostile("far up", file("../../../../../../etc/passwd"), &[404]),
        hostile("up, encoded", file("%2e%2e/%2e%2e/areograph.toml"), &[404]),
        hostile(
            "up, twice encoded",
            file("%252e%252e%252fmanifest.json"),
            &[404],
        ),
        hostile(
            "up, in the manifest",
            file("../../../../areograph.toml"),
            &[404, 409],
        ),
        hostile(
            "absolute, in the manifest",
            file("/etc/passwd"),
            &[404, 409],
        ),
        hostile("absolute, encoded", file("%2fetc%2fpasswd"), &[404, 409]),
        hostile("a product that is a link", file("link.csv"), &[409]),
        hostile("a product below a link", file("etc/passwd"), &[409]),
        hostile("a file that no manifest names", file("../run.json"), &[404]),
        hostile("a folder", file("tables"), &[404]),
        hostile("a folder with its slash", file("tables/"), &[404]),
        hostile("nothing", file(""), &[404]),
        hostile("a zero byte", file("report/index.html%00.csv"), &[404]),
        hostile("a backslash", file("..%5c..%5cmanifest.json"), &[404]),
        hostile("a byte that is no text", file("%ff%fe"), &[400, 404]),
        hostile(
            "a run that leads up",
            get("/api/v1/runs/..%2f..%2fbeta/files/manifest.json"),
            &[404],
        ),
        hostile("a run of dots", get("/api/v1/runs/%2e%2e"), &[404]),
        hostile(
            "a site that leads up",
            get("/api/v1/sites/..%2f..%2fstate"),
            &[404],
        ),
        hostile(
            "a current product that leads up",
            get("/api/v1/sites/alpha/current/..%2f..%2f..%2fstate%2fareograph.db"),
            &[404],
        ),
        hostile(
            "a current product on another host",
            get("/api/v1/sites/alpha/current/%0d%0aLocation:%20http://evil.example"),
            &[404],
        ),
        hostile(
            "a kernel by its path",
            get("/api/v1/kernels/..%2f..%2fetc%2fpasswd"),
            &[404],
        ),
        hostile("a job by a path", get("/api/v1/jobs/..%2f1/log"), &[404]),
        hostile(
            "a log that lies elsewhere",
            get("/api/v1/jobs/7/log?attempt=3&after=0&path=/etc/passwd"),
            &[400],
        ),
        hostile(
            "SQL as a name",
            get("/api/v1/sites/a'%20OR%201=1--"),
            &[404],
        ),
        hostile(
            "SQL as a state",
            get("/api/v1/jobs?state=x'%20OR%201=1--"),
            &[400],
        ),
        hostile(
            "SQL as a cursor",
            get("/api/v1/jobs?after=1;DROP%20TABLE%20job"),
            &[400],
        ),
        hostile(
            "a script as a name",
            get("/sites/%3Cscript%3Ealert(1)%3C%2Fscript%3E"),
            &[404],
        ),
        hostile(
            "a script in a page's parameter",
            get("/jobs?site=%3Cscript%3E"),
            &[404],
        ),
        hostile("the database", get("/state/areograph.db"), &[404]),
    ];
    for path in [
        "/..",
        "/../../etc/passwd",
        "//etc/passwd",
        "/.git/config",
        "/areograph.toml",
    ] {
        all.push(hostile("a path of the machine", get(path), &[404, 400]));
    }
    all
}

/// Tokens that are none, or no longer, or in the wrong place.
fn tokens(world: &World) -> Vec<Hostile> {
    let bearer = |token: &str| with("/api/v1/sites", &format!("Authorization: Bearer {token}"));
    let operate = &world.tokens.operate;
    let flipped = operate.get(..operate.len() - 1).unwrap().to_owned()
        + if operate.ends_with('0') { "1" } else { "0" };
    let jobs = |authorization: &str| {
        send(
            "POST",
            "/api/v1/jobs",
            &format!("Content-Type: application/json\r\n{authorization}"),
            "{\"sites\":\"all\"}",
        )
    };
    vec![
        hostile(
            "a token that was never made",
            bearer(&format!("areo_00000000_{}", "0".repeat(64))),
            &[401],
        ),
        hostile("a token with another last digit", bearer(&flipped), &[401]),
        hostile(
            "a token that has expired",
            bearer(&world.tokens.expired),
            &[401],
        ),
        hostile(
            "a token that was revoked",
            bearer(&world.tokens.revoked),
            &[401],
        ),
        hostile("an empty token", bearer(""), &[401]),
        hostile(
            "another scheme",
            with("/api/v1/sites", "Authorization: Basic YTpi"),
            &[401],
        ),
        hostile(
            "a very long token",
            bearer(&"a".repeat(20_000)),
            &[401, 431],
        ),
        hostile(
            "a token in the query",
            get(&format!("/api/v1/sites?token={operate}")),
            &[400],
        ),
        hostile(
            "a token in the query of a page",
            get(&format!("/?access_token={operate}")),
            &[400],
        ),
        hostile(
            "a token in the path",
            get(&format!("/sites/{operate}")),
            &[400],
        ),
        hostile("a change without a token", jobs(""), &[401]),
        hostile(
            "a change with a token for reading",
            jobs(&format!("Authorization: Bearer {}\r\n", world.tokens.read)),
            &[403],
        ),
        hostile(
            "a change with an expired token",
            jobs(&format!(
                "Authorization: Bearer {}\r\n",
                world.tokens.expired
            )),
            &[401, 429],
        ),
        hostile(
            "a forged session",
            send(
                "POST",
                "/jobs/4/cancel",
                &format!(
                    "Content-Type: application/x-www-form-urlencoded\r\nCookie: areograph={}\r\n",
                    "0".repeat(64)
                ),
                "form_token=a",
            ),
            &[401],
        ),
    ]
}

/// Methods and documents that nothing takes.
#[allow(clippy::too_many_lines, reason = "a table")]
fn documents(world: &World) -> Vec<Hostile> {
    let json = "Content-Type: application/json\r\n";
    let token = format!("Authorization: Bearer {}\r\n{json}", world.tokens.operate);
    let shots = |body: &str| send("POST", "/api/v1/shots", &token, body);
    let ring = |corners: usize| {
        let corners: Vec<[f64; 2]> = (0..corners)
            .map(|k| [k as f64 * 1e-3, (k % 2) as f64])
            .collect();
        json!({ "type": "Polygon", "coordinates": [corners] }).to_string()
    };
    let deep = "[".repeat(60_000);
    vec![
        hostile(
            "a method that nobody takes",
            get("/api/v1/sites").replace("GET", "DELETE"),
            &[405],
        ),
        hostile(
            "a method of our own",
            get("/").replace("GET", "BREW"),
            &[405],
        ),
        hostile("TRACE", get("/").replace("GET", "TRACE"), &[405]),
        hostile(
            "a tunnel",
            "CONNECT evil.example:443 HTTP/1.1\r\nHost: HOST\r\nConnection: close\r\n\r\n",
            &[421, 400, 404, 405],
        ),
        hostile("no JSON", send("POST", "/api/v1/jobs", &token, "{"), &[400]),
        hostile(
            "an unknown field",
            send(
                "POST",
                "/api/v1/jobs",
                &token,
                "{\"sites\":[\"alpha\"],\"path\":\"/etc\"}",
            ),
            &[400],
        ),
        hostile(
            "a site that is a path",
            send(
                "POST",
                "/api/v1/jobs",
                &token,
                "{\"sites\":[\"../../etc\"]}",
            ),
            &[404],
        ),
        hostile(
            "a site that is disabled",
            send("POST", "/api/v1/jobs", &token, "{\"sites\":[\"retired\"]}"),
            &[404],
        ),
        hostile(
            "no sites",
            send("POST", "/api/v1/jobs", &token, "{\"sites\":[]}"),
            &[400],
        ),
        hostile(
            "a reason with lines for the log",
            send(
                "POST",
                "/api/v1/jobs",
                &token,
                "{\"sites\":\"all\",\"reason\":\"a\\n[ERROR] b\"}",
            ),
            &[400],
        ),
        hostile(
            "a key with lines",
            send(
                "POST",
                "/api/v1/jobs",
                &format!("{token}Idempotency-Key: a b\r\n"),
                "{\"sites\":\"all\"}",
            ),
            &[400],
        ),
        hostile(
            "deep JSON",
            send("POST", "/api/v1/jobs", &token, &deep),
            &[400],
        ),
        hostile(
            "a huge document",
            send("POST", "/api/v1/jobs", &token, &"a".repeat(100_000)),
            &[413],
        ),
        hostile(
            "a huge document that is only promised",
            format!(
                "POST /api/v1/jobs HTTP/1.1\r\nHost: HOST\r\n{token}Content-Length: 99999999999\r\nConnection: close\r\n\r\n{{"
            ),
            &[413, 408],
        ),
        hostile(
            "a box without an inside",
            get("/api/v1/shots?bbox=10,5,20,-5"),
            &[400],
        ),
        hostile(
            "a box of no numbers",
            get("/api/v1/shots?bbox=NaN,0,inf,1"),
            &[400],
        ),
        hostile(
            "a box and a file",
            get("/api/v1/shots?bbox=1,1,2,2&into=/etc/passwd"),
            &[400],
        ),
        hostile("two corners", shots(&ring(2)), &[400]),
        hostile("too many corners", shots(&ring(10_001)), &[400]),
        hostile("a huge polygon", shots(&ring(200_000)), &[413, 429]),
        hostile(
            "corners off the globe",
            shots("{\"type\":\"Polygon\",\"coordinates\":[[[0,0],[1e300,0],[0,1e300]]]}"),
            &[400, 429],
        ),
        hostile(
            "corners of another kind",
            shots("{\"type\":\"Polygon\",\"coordinates\":[[[\"a\",0],[1,0],[0,1]]]}"),
            &[400, 429],
        ),
        hostile(
            "another geometry",
            shots("{\"type\":\"Point\",\"coordinates\":[[[0,0],[1,0],[0,1]]]}"),
            &[400, 429],
        ),
        hostile(
            "an unknown form of shots",
            with("/api/v1/shots?bbox=1,1,2,2", "Accept: application/x-sh"),
            &[406],
        ),
        hostile(
            "a list without an end",
            get("/api/v1/jobs?limit=1000000"),
            &[400],
        ),
        hostile("a negative list", get("/api/v1/jobs?limit=-1"), &[400]),
        hostile(
            "a number beyond all",
            get("/api/v1/jobs/99999999999999999999999"),
            &[404],
        ),
        hostile(
            "an event before the first",
            with("/api/v1/events", "Last-Event-ID: -5"),
            &[400],
        ),
        hostile(
            "an event that is no number",
            with("/api/v1/events", "Last-Event-ID: a"),
            &[400],
        ),
    ]
}

/// Heads that are no heads.
fn heads(_: &World) -> Vec<Hostile> {
    let many: Vec<String> = (0..200).map(|k| format!("X-{k}: a\r\n")).collect();
    let many = many.concat();
    vec![
        hostile("many headers", with("/", many.trim_end()), &[431, 400]),
        hostile(
            "a huge header",
            with("/", &format!("X: {}", "a".repeat(200_000))),
            &[431, 400, 0],
        ),
        hostile(
            "a huge target",
            get(&format!("/{}", "a".repeat(100_000))),
            &[414, 431, 400, 0],
        ),
        hostile(
            "no HTTP",
            "\x16\x03\x01\x02\x00\x01\x00\x01\r\n\r\n",
            &[400, 0],
        ),
        hostile(
            "another version",
            "GET / HTTP/9.9\r\nHost: HOST\r\n\r\n",
            &[400, 0],
        ),
        hostile("a header with a zero byte", with("/", "X: a\0b"), &[400, 0]),
        hostile(
            "a header over two lines",
            with("/", "X: a\r\n b"),
            &[400, 0],
        ),
        hostile(
            "two lengths",
            "POST /login HTTP/1.1\r\nHost: HOST\r\nContent-Length: 1\r\nContent-Length: 9\r\nConnection: close\r\n\r\na",
            &[400, 0],
        ),
        hostile(
            "a length and chunks",
            "POST /login HTTP/1.1\r\nHost: HOST\r\nContent-Length: 4\r\nTransfer-Encoding: chunked, identity\r\nConnection: close\r\n\r\n0\r\n\r\n",
            &[400, 0],
        ),
        hostile(
            "a chunk of a wrong size",
            "POST /login HTTP/1.1\r\nHost: HOST\r\nContent-Type: application/x-www-form-urlencoded\r\nTransfer-Encoding: chunked\r\nConnection: close\r\n\r\nzz\r\n",
            &[400, 413, 0],
        ),
        hostile(
            "HTTP/2 from the start",
            "PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n",
            &[400, 0],
        ),
    ]
}

/// What no client may read.
fn tells(world: &World, answer: &Answer) -> Option<String> {
    let text = format!("{}{}", answer.head, answer.text());
    let place = world.folder.path().display().to_string();
    let secret = world.tokens.operate.rsplit('_').next().unwrap().to_owned();
    let words = [
        &*place,
        &secret,
        "root:x:",
        "SELECT",
        "sqlite",
        "panicked",
        "crates/service/src",
        "rusqlite",
        "[inputs]",
        "<script>alert",
        "Access-Control",
        "/etc/passwd:",
        "os error",
    ];
    let told = words
        .into_iter()
        .find(|word| text.to_lowercase().contains(&word.to_lowercase()));
    told.map(str::to_owned)
}

type Kind = fn(&World) -> Vec<Hostile>;

/// Jobs and audited actions. A product that is a link is damage, for which its site runs again: that is no change by the
/// request.
const CHANGES: &str = "SELECT 1000 * (SELECT count(*) FROM job WHERE id NOT IN
    (SELECT job FROM cause WHERE kind = 'product_damaged')) + (SELECT count(*) FROM audit)";

#[test]
fn hostile_requests_are_refused_and_told_nothing() {
    let kinds: [Kind; 6] = [
        forged_hosts,
        forged_origins,
        traversals,
        tokens,
        documents,
        heads,
    ];
    let (mut count, mut wrong) = (0, Vec::new());
    for kind in kinds {
        // A new service each, or the limits of rates would refuse first.
        let world = World::new();
        let before = world.number(CHANGES);
        for hostile in kind(&world) {
            let port = world.address.port().to_string();
            let request = hostile
                .request
                .replace("HOST", &world.address.to_string())
                .replace("PORT", &port);
            let answer = world.raw(request.as_bytes());
            if !hostile.refused.contains(&answer.status) {
                wrong.push(format!(
                    "{}: {} {}",
                    hostile.what,
                    answer.head.lines().next().unwrap_or("closed"),
                    answer.text()
                ));
            }
            if let Some(told) = tells(&world, &answer) {
                wrong.push(format!(
                    "{}: tells {told}: {}{}",
                    hostile.what,
                    answer.head,
                    answer.text()
                ));
            }
            let program = answer.header("content-type") == Some("application/problem+json");
            if program {
                let problem = answer.json();
                assert_eq!(problem["status"], answer.status, "{}", hostile.what);
                assert_eq!(
                    problem["request_id"].as_str(),
                    answer.header("x-request-id"),
                    "{}",
                    hostile.what
                );
            }
            count += 1;
        }
        let after = world.number(CHANGES);
        assert_eq!(before, after, "a hostile request changed something");
        assert_eq!(world.get("/healthz").status, 200);
    }
    assert!(
        wrong.is_empty(),
        "{} of {count}:\n{}",
        wrong.len(),
        wrong.join("\n")
    );
    assert!(count >= 60, "{count} hostile requests");
}

#[test]
fn half_sent_requests_and_floods_are_shed() {
    let world = World::new();
    let began = Instant::now();
    let mut half: Vec<_> = (0..300)
        .map(|k| {
            let mut stream = world.connect();
            let body = "POST /login HTTP/1.1\r\nHost: HOST\r\nContent-Type: application/x-www-form-urlencoded\r\nContent-Length: 50\r\n\r\ntoken=";
            let head = "GET / HTTP/1.1\r\nHost: HOST\r\nX-Slow: ";
            // Few documents: more from one address would be refused as too many.
            let text = if k % 20 == 0 { body } else { head };
            let _ = stream.write_all(text.replace("HOST", &world.address.to_string()).as_bytes());
            stream
        })
        .collect();
    // Beyond the places for connections, clients are told to come back.
    sleep(Duration::from_millis(300));
    let full = world.get("/healthz");
    assert_eq!(
        (full.status, full.header("retry-after")),
        (503, Some("5")),
        "{}",
        full.head
    );
    for stream in &mut half {
        let mut rest = Vec::new();
        let _ = stream.read_to_end(&mut rest);
        assert!(
            began.elapsed() < Duration::from_secs(15),
            "still open after {:?}",
            began.elapsed()
        );
    }
    let answer = world.get("/healthz");
    assert_eq!(answer.status, 200, "{}", answer.head);
}

#[test]
fn guessing_tokens_is_slowed_and_reading_too_often_refused() {
    let world = World::with("open_reading = \"no\"");
    let guess = |digit: usize| {
        let header = format!(
            "Authorization: Bearer areo_00000000_{}",
            digit.to_string().repeat(64)
        );
        world.request("GET", "/api/v1/sites", &[&header], "")
    };
    let statuses: Vec<u16> = (0..10).map(|digit| guess(digit).status).collect();
    assert_eq!(statuses, [401; 10]);
    let slowed = guess(1);
    assert_eq!(slowed.status, 429, "{}", slowed.text());
    assert!(
        slowed
            .header("retry-after")
            .unwrap()
            .parse::<u32>()
            .unwrap()
            >= 1
    );
    let world = World::new();
    let header = format!("Authorization: Bearer {}", world.tokens.read);
    let began = Instant::now();
    let refused = (0..400)
        .filter(|_| world.request("GET", "/healthz", &[&header], "").status == 429)
        .count();
    // 100 at once and 20 for each second.
    let allowed = 100.0 + 20.0 * began.elapsed().as_secs_f64() + 1.0;
    assert!(refused as f64 >= 400.0 - allowed, "{refused} refused");
    assert!(refused > 0, "400 requests took {:?}", began.elapsed());
}
