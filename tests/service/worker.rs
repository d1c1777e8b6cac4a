//! The worker process over its pipes, and the service's side of it.
#![cfg(target_os = "linux")]
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    clippy::disallowed_methods,
    reason = "helpers of tests may fail loudly, and write input"
)]

use crate::common;

use std::{
    fs,
    io::{BufRead as _, BufReader, Write as _},
    os::unix::fs::{MetadataExt, PermissionsExt, symlink},
    path::{Path, PathBuf},
    process::{Child, ChildStdin, ChildStdout, Stdio},
    time::{Duration, Instant},
};

use areograph::{
    body::Body,
    service::worker::{
        parent::{Ended, Heard, How, Times, WorkerLimits, work},
        process::ProcessIdentity,
        protocol::{
            Answer, Cancel, CancelWhy, Failure, LINE_MAX, Line, Listed, PROTOCOL, PlanAnswer,
            RunAnswer, Task, What,
        },
        run_folder::{RUN_RECORD, newest, read_record, remove},
    },
    store::lock::SiteLock,
};
use common::{
    case::Case,
    daf::{segment_words, set_word},
    mission::{areograph, products, succeed},
};
use tokio::sync::watch;

fn task(case: &Case, what: What) -> Task {
    Task {
        v: PROTOCOL,
        job: 7,
        attempt: 2,
        what,
        hashes_file: case.path("hashes"),
        roots: Vec::new(),
        threads: 2,
        memory_mib: 4096,
    }
}

/// A worker that the test drives itself.
struct Driven {
    child: Child,
    input: Option<ChildStdin>,
    output: BufReader<ChildStdout>,
}

impl Driven {
    fn start() -> Self {
        Self::start_with(&["--parent", &std::process::id().to_string()])
    }

    fn start_with(arguments: &[&str]) -> Self {
        let mut child = areograph()
            .arg("worker")
            .args(arguments)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        Self {
            input: child.stdin.take(),
            output: BufReader::new(child.stdout.take().unwrap()),
            child,
        }
    }

    fn say(&mut self, text: &str) {
        let input = self.input.as_mut().unwrap();
        input.write_all(text.as_bytes()).unwrap();
        input.flush().unwrap();
    }

    fn next(&mut self) -> Option<Line> {
        let mut line = String::new();
        self.output.read_line(&mut line).unwrap();
        assert!(line.len() <= LINE_MAX);
        (!line.is_empty()).then(|| serde_json::from_str(&line).unwrap())
    }

    /// Its last line, and its exit code.
    fn end(mut self) -> (Option<Line>, Option<i32>) {
        let mut last = None;
        while let Some(line) = self.next() {
            if !matches!(line, Line::Beat { .. }) {
                last = Some(line);
            }
        }
        (last, self.child.wait().unwrap().code())
    }
}

fn text(task: &Task) -> String {
    serde_json::to_string(task).unwrap() + "\n"
}

const LIMITS: WorkerLimits = WorkerLimits {
    deadline_s: 120.0,
    silence_s: 30.0,
    log_max_kib: 64,
    times: Times::USUAL,
};

/// The same with a tenth of the service's patience: what is waited for is seen as well, and sooner.
const HASTY: WorkerLimits = WorkerLimits {
    times: Times {
        hello: Duration::from_secs(2),
        patience: [Duration::from_secs(1), Duration::from_secs(2)],
        ..Times::USUAL
    },
    ..LIMITS
};

#[test]
fn the_service_waits_twenty_seconds_for_a_hello_and_for_an_end() {
    let times = Times::default();
    assert_eq!(times.hello, Duration::from_secs(20));
    assert_eq!(times.patience, [10, 20].map(Duration::from_secs));
}

/// Has a task done through the service's side.
fn done(task: &Task) -> (Ended, Vec<Line>) {
    let folder = tempfile::tempdir().unwrap();
    let mut lines = Vec::new();
    let (_cancel, cancelled) = watch::channel(None);
    let ended = runtime().block_on(work(
        Path::new(env!("CARGO_BIN_EXE_areograph")),
        task,
        &LIMITS,
        &folder.path().join("log"),
        cancelled,
        |heard| {
            if let Heard::Line(line) = heard {
                lines.push(line.clone());
            }
        },
    ));
    let log = fs::read_to_string(folder.path().join("log")).unwrap();
    for line in log.lines().filter(|_| ended.how == How::Exited(0)) {
        assert!(
            serde_json::from_str::<serde_json::Value>(line).is_ok(),
            "{line}"
        );
    }
    (ended, lines)
}

fn runtime() -> tokio::runtime::Runtime {
    tokio::runtime::Runtime::new().unwrap()
}

fn answered(task: &Task) -> Answer {
    let (ended, lines) = done(task);
    assert_eq!(ended.how, How::Exited(0), "{:?}", ended.answer);
    assert!(matches!(lines[0], Line::Hello { v: PROTOCOL, .. }));
    assert!(ended.rss_peak_kib > 1_000);
    ended.answer.unwrap().unwrap()
}

fn failed(task: &Task) -> Failure {
    let (ended, _) = done(task);
    let failure = ended.answer.unwrap().unwrap_err();
    assert_eq!(ended.how, How::Exited(i32::from(failure.code)));
    failure
}

fn plan(case: &Case) -> PlanAnswer {
    let what = What::Plan {
        site_file: case.path("site.toml"),
        out: case.path("work"),
    };
    match answered(&task(case, what)) {
        Answer::Plan(plan) => plan,
        other => panic!("{other:?}"),
    }
}

fn run_task(case: &Case, run: &str, config_blake3: &str) -> Task {
    task(
        case,
        What::Run {
            site_file: case.path("site.toml"),
            config_blake3: config_blake3.to_owned(),
            out: case.path("work"),
            runs: case.path("runs"),
            run: run.to_owned(),
            force: false,
        },
    )
}

fn run(case: &Case, run: &str) -> RunAnswer {
    let blake3 = plan(case).config_blake3;
    match answered(&run_task(case, run, &blake3)) {
        Answer::Run(run) => run,
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_run_is_kept_once() {
    let case = Case::new();
    let planned = plan(&case);
    assert!(planned.stages.iter().all(|stage| stage.runs));
    let first = run(&case, "0001");
    assert_eq!(first.run.as_deref(), Some("0001"));
    assert!(first.valid);
    assert_eq!(first.ran.len(), planned.stages.len());
    let folder = case.path("runs/0001");
    assert_eq!(newest(&case.path("runs")), Some(folder.clone()));
    let record = read_record(&folder).unwrap();
    assert_eq!((record.job, record.attempt), (7, 2));
    assert_eq!(record.manifest_blake3, first.manifest_blake3);
    // The products themselves, not copies of them.
    let inode = |path: &str| case.path(path).metadata().unwrap().ino();
    assert_eq!(
        inode("work/case/footprints.parquet"),
        inode("runs/0001/footprints.parquet")
    );
    assert_eq!(
        folder.metadata().unwrap().permissions().mode() & 0o777,
        0o555
    );
    let kept = products(&folder);
    let mut expected = products(&case.path("work/case"));
    expected.insert(RUN_RECORD.into(), case.read("runs/0001/run.json"));
    assert!(kept == expected);
    // Nothing changed: no further run.
    let second = run(&case, "0002");
    assert_eq!(second.run, None);
    assert_eq!(second.manifest_blake3, first.manifest_blake3);
    assert_eq!(second.ran, []);
    assert!(!case.path("runs/0002").exists());
    // What was published and not kept, since the worker was killed in between, is kept by the next; what it had begun goes.
    remove(&folder).unwrap();
    fs::create_dir_all(case.path("runs/0002.partial/report")).unwrap();
    let third = run(&case, "0003");
    assert_eq!(third.run.as_deref(), Some("0003"));
    assert_eq!(third.manifest_blake3, first.manifest_blake3);
    let names = fs::read_dir(case.path("runs")).unwrap();
    let names: Vec<_> = names.map(|entry| entry.unwrap().file_name()).collect();
    assert_eq!(names, ["0003"]);
    // Another run leaves the one before as it is.
    case.replace(
        "site.toml",
        "[[images]]",
        "[range_check]\nmean_max_m = 9.0\n[[images]]",
    );
    let before = products(&case.path("runs/0003"));
    let fourth = run(&case, "0004");
    assert_eq!(fourth.run.as_deref(), Some("0004"));
    assert_eq!(fourth.ran.len(), 2);
    assert!(products(&case.path("runs/0003")) == before);
    assert!(products(&case.path("runs/0004")) != before);
}

#[test]
fn a_plan_tells_all_files_and_where_the_windows_lie() {
    let case = Case::new();
    let planned = plan(&case);
    assert_eq!(planned.body, Body::Mars);
    let [west, south, east, north] = planned.bounds_deg.unwrap();
    for (found, expected) in [(west, 87.5), (south, 4.0), (east, 88.5), (north, 5.0)] {
        // Rounding of radians.
        assert!((found - expected).abs() < 1e-9, "{found}");
    }
    let names = |plan: &PlanAnswer| -> Vec<String> {
        let files = plan.files.iter().map(|file| {
            assert_eq!(file.blake3.len(), 64);
            areograph::files::file_name(&file.path)
        });
        files.collect()
    };
    let found = names(&planned);
    for name in [
        "ap19117l.b",
        "image.lbl",
        "leapseconds.tls",
        "mgs_clock.tsc",
        "mgs_nav_scene.bsp",
        "mgs_sc_scene.bc",
        "nav.tm",
    ] {
        assert_eq!(
            found.iter().filter(|of| *of == name).count(),
            1,
            "{name} in {found:?}"
        );
    }
    run(&case, "0001");
    let again = plan(&case);
    assert!(again.stages.iter().all(|stage| !stage.runs));
    assert_eq!(names(&again), found);
}

#[test]
fn a_site_may_name_files_below_the_roots_only() {
    let case = Case::new();
    let outside = Case::new();
    let blake3 = plan(&case).config_blake3;
    let within = |roots: &[&str]| Task {
        roots: roots.iter().map(|root| case.path(root)).collect(),
        ..run_task(&case, "0001", &blake3)
    };
    let label = case.path("image.lbl").canonicalize().unwrap();
    let refused = failed(&within(&["kernels", "pedr"]));
    assert_eq!(refused.code, 2);
    assert!(
        refused
            .text
            .contains("site.toml:12:9: images.label is \"image.lbl\"; expected a path below "),
        "{}",
        refused.text
    );
    assert!(
        refused.text.contains(&label.display().to_string()),
        "{}",
        refused.text
    );
    // A link leads where it leads.
    fs::remove_file(&label).unwrap();
    symlink(outside.path("image.lbl"), &label).unwrap();
    let refused = failed(&within(&["."]));
    assert!(refused.text.contains("images.label"), "{}", refused.text);
    fs::remove_file(&label).unwrap();
    fs::copy(outside.path("image.lbl"), &label).unwrap();
    let shots = case.path("pedr/ap19117l.b");
    fs::rename(&shots, case.path("pedr/moved.b")).unwrap();
    symlink(outside.path("pedr/ap19117l.b"), &shots).unwrap();
    let refused = failed(&within(&["."]));
    assert!(refused.text.contains("pedr.files"), "{}", refused.text);
    fs::remove_file(&shots).unwrap();
    // What a metakernel lists is no key of the site file.
    let kernel = case.path("kernels/mgs_nav_scene.bsp");
    fs::remove_file(&kernel).unwrap();
    symlink(outside.path("kernels/mgs_nav_scene.bsp"), &kernel).unwrap();
    let refused = failed(&within(&["."]));
    assert_eq!((refused.code, refused.busy), (2, false));
    assert_eq!(refused.site.as_deref(), Some("case"));
    assert_eq!(refused.file.as_deref(), Some(&*kernel));
    assert!(
        refused
            .text
            .contains("lies outside the permitted folders; expected a path below"),
        "{}",
        refused.text
    );
    // Without links all is well, and a root may be a link itself.
    fs::remove_file(&kernel).unwrap();
    fs::copy(outside.path("kernels/mgs_nav_scene.bsp"), &kernel).unwrap();
    symlink(case.path(""), outside.path("link")).unwrap();
    let linked = Task {
        roots: vec![outside.path("link")],
        ..run_task(&case, "0001", &blake3)
    };
    answered(&linked);
    // The root folder of a selection is looked through: links in it as well.
    case.replace(
        "site.toml",
        "metakernel = \"kernels/nav.tm\"",
        "root = \"kernels\"",
    );
    symlink("/etc/hostname", case.path("kernels/hostname")).unwrap();
    let selected = Task {
        what: What::Plan {
            site_file: case.path("site.toml"),
            out: case.path("work"),
        },
        ..within(&["."])
    };
    let refused = failed(&selected);
    assert!(refused.text.contains("hostname"), "{}", refused.text);
}

#[test]
fn other_keys_and_a_busy_site_are_of_distinct_images() {
    let case = Case::new();
    let changed = failed(&run_task(&case, "0001", &"0".repeat(64)));
    assert_eq!((changed.code, changed.busy), (3, false));
    assert!(
        changed.text.contains("which the service recorded"),
        "{}",
        changed.text
    );
    let blake3 = plan(&case).config_blake3;
    let _lock = SiteLock::take(&case.path("work/case")).unwrap();
    let busy = failed(&run_task(&case, "0001", &blake3));
    assert_eq!((busy.code, busy.busy), (6, true));
    assert!(!case.path("runs").exists());
}

#[test]
fn two_runs_are_compared() {
    let case = Case::new();
    run(&case, "0001");
    fs::copy(
        case.path("kernels/mgs_ipng_scene.bsp"),
        case.path("kernels/mgs_nav_scene.bsp"),
    )
    .unwrap();
    run(&case, "0002");
    let what = |limit_m| What::Diff {
        before: case.path("runs/0001"),
        after: case.path("runs/0002"),
        page: Some(case.path("diff.html")),
        limit_m,
        limit_arcsec: 60.0,
    };
    for (limit_m, beyond) in [(1e4, false), (1e-6, true)] {
        let Answer::Diff {
            headline,
            sentences,
            beyond_limit,
        } = answered(&task(&case, what(limit_m)))
        else {
            panic!("no difference");
        };
        assert_eq!(beyond_limit, beyond, "{headline}");
        assert!(
            sentences.iter().any(|of| of.contains("mgs_nav_scene.bsp")),
            "{sentences:?}"
        );
    }
    assert!(case.read("diff.html").starts_with(b"<!DOCTYPE html>"));
}

#[test]
fn kernels_are_opened_and_damaged_ones_are_told() {
    let case = Case::new();
    let mut bytes = case.read("kernels/mgs_nav_scene.bsp");
    let (_, last) = segment_words(&bytes)[0];
    set_word(&mut bytes, last, 1e300);
    case.write("kernels/damaged.bsp", bytes);
    case.write(
        "kernels/cut.bc",
        &case.read("kernels/mgs_sc_scene.bc")[..5_000],
    );
    case.write("kernels/page.bsp", "<html>");
    let names = [
        "mgs_nav_scene.bsp",
        "damaged.bsp",
        "mgs_sc_scene.bc",
        "cut.bc",
        "leapseconds.tls",
        "nav.tm",
        "page.bsp",
        "missing.bc",
    ];
    let paths = names.map(|name| case.path("kernels").join(name));
    let (ended, lines) = done(&task(
        &case,
        What::Probe {
            files: paths.to_vec(),
        },
    ));
    let Some(Ok(Answer::Probe { kernels })) = ended.answer else {
        panic!("{ended:?}");
    };
    let begun: Vec<&str> = lines
        .iter()
        .filter_map(|line| match line {
            Line::Stage { stage, .. } => Some(&**stage),
            _ => None,
        })
        .collect();
    assert_eq!(begun, paths.each_ref().map(|path| path.to_str().unwrap()));
    let problem = |index: usize| kernels[index].problem.as_deref().unwrap_or_default();
    for (index, expected) in [
        (0, ""),
        (1, "its number of states is 1e300"),
        (2, ""),
        (3, "bytes; its file record states"),
        (4, ""),
        (5, ""),
        (6, "a web page"),
        (7, "No such file"),
    ] {
        let told = problem(index);
        assert!(
            told.contains(expected) && (expected.is_empty() == told.is_empty()),
            "{}: {told}",
            names[index]
        );
    }
    // Mars is known from another kernel: what this one holds of the spacecraft, and with that one what the site has.
    assert!(
        !kernels[0].coverage["position"]
            .as_array()
            .unwrap()
            .is_empty()
    );
    assert_eq!(kernels[0].coverage["attitude"], serde_json::json!([]));
    let mut command = case.areograph();
    let clocks = ["kernels/leapseconds.tls", "kernels/mgs_clock.tsc"];
    command
        .args(["kernels", "coverage", "--json"])
        .args(clocks)
        .arg("kernels/mgs_sc_scene.bc");
    let coverage: serde_json::Value =
        serde_json::from_slice(&succeed(&mut command).stdout).unwrap();
    assert_eq!(kernels[2].coverage, coverage);
    // The clocks come from the folder of the C-kernel, or from the task.
    assert!(
        !kernels[2].coverage["attitude"]
            .as_array()
            .unwrap()
            .is_empty()
    );
    assert!(kernels[4].coverage.is_null());
}

#[test]
fn folders_are_listed_without_transfers_under_way() {
    let case = Case::new();
    for name in [".mgs.bsp.Xy12", "new.bsp.part", "a.tmp", "b.partial"] {
        case.write(&format!("kernels/{name}"), "half");
    }
    symlink("nothing", case.path("kernels/dangling")).unwrap();
    symlink(case.path("pedr"), case.path("kernels/folder")).unwrap();
    symlink(case.path("image.lbl"), case.path("kernels/linked.lbl")).unwrap();
    let what = What::List {
        roots: vec![case.path("kernels"), case.path("gone"), case.path("pedr")],
        into: case.path("list"),
    };
    let Answer::List { files } = answered(&task(&case, what)) else {
        panic!("no list");
    };
    let text = fs::read_to_string(case.path("list")).unwrap();
    let listed: Vec<Listed> = text
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    let found: Vec<&Path> = listed
        .iter()
        .filter_map(|of| match of {
            Listed::File { path, identity } => {
                assert_eq!(identity.bytes, path.metadata().unwrap().len());
                Some(&**path)
            }
            _ => None,
        })
        .collect();
    assert_eq!(found.len() as u64, files);
    let there = fs::read_dir(case.path("kernels")).unwrap().count();
    // Four half-copied files, a dangling link and a folder; and the one file of shots.
    assert_eq!(found.len(), there - 6 + 1);
    assert!(found.contains(&&*case.path("kernels/linked.lbl")));
    let unreadable: Vec<_> = listed
        .iter()
        .filter(|of| matches!(of, Listed::Unreadable { .. }))
        .collect();
    assert_eq!(unreadable.len(), 1, "{unreadable:?}");
    let roots: Vec<_> = listed
        .iter()
        .filter_map(|of| match of {
            Listed::Root {
                device,
                files,
                problem,
                ..
            } => Some((device.is_some(), *files, problem.is_some())),
            _ => None,
        })
        .collect();
    assert_eq!(
        roots,
        [(true, files - 1, false), (false, 0, true), (true, 1, false)]
    );
}

#[test]
fn shots_within_a_polygon_are_found_in_all_formats() {
    let case = Case::new();
    case.replace(
        "site.toml",
        "[[windows]]",
        "[products]\nformats = [\"csv\"]\n[[windows]]",
    );
    run(&case, "0001");
    let search = |polygon: &[[f64; 2]], format: &str, rows_max| {
        let what = What::Shots {
            runs: vec![case.path("runs/0001")],
            polygon: polygon.to_vec(),
            rows_max,
            format: format.to_owned(),
            into: case.path("shots"),
        };
        match answered(&task(&case, what)) {
            Answer::Shots { rows, complete } => (rows, complete),
            other => panic!("{other:?}"),
        }
    };
    let mut reader = csv::Reader::from_path(case.path("runs/0001/footprints.csv")).unwrap();
    let headers = reader.headers().unwrap().clone();
    let column = |name: &str| headers.iter().position(|of| of == name).unwrap();
    let latitudes: Vec<f64> = reader
        .records()
        .map(|record| record.unwrap()[column("latitude_deg")].parse().unwrap())
        .collect();
    let within = latitudes
        .iter()
        .filter(|latitude| (4.2..=4.6).contains(*latitude))
        .count() as u64;
    assert!(within > 10 && within < latitudes.len() as u64);
    let polygon = [[80.0, 4.2], [90.0, 4.2], [90.0, 4.6], [80.0, 4.6]];
    assert_eq!(search(&polygon, "csv", 1_000_000), (within, true));
    let mut found = csv::Reader::from_path(case.path("shots")).unwrap();
    assert_eq!(&found.headers().unwrap()[0], "site");
    assert_eq!(found.records().count() as u64, within);
    assert_eq!(search(&polygon, "geojson", 1_000_000), (within, true));
    let found = common::json(&case.path("shots"));
    let features = found["features"].as_array().unwrap();
    assert_eq!(features.len() as u64, within);
    let latitude = features[0]["geometry"]["coordinates"][1].as_f64().unwrap();
    assert!((4.2..=4.6).contains(&latitude));
    assert_eq!(features[0]["properties"]["site"], "case");
    assert_eq!(search(&polygon, "parquet", 1_000_000), (within, true));
    let rows = areograph::products::read::read_footprints(&case.path("shots")).unwrap();
    assert_eq!(rows.len() as u64, within);
    // No more than asked for, and that is said.
    assert_eq!(search(&polygon, "csv", 5), (5, false));
    assert_eq!(search(&polygon, "csv", within), (within, true));
    // Nowhere.
    for format in ["csv", "geojson", "parquet"] {
        assert_eq!(
            search(&[[0.0, 80.0], [1.0, 80.0], [1.0, 81.0]], format, 10),
            (0, true)
        );
    }
    for (format, polygon) in [
        ("pdf", &polygon[..]),
        ("csv", &polygon[..2]),
        ("csv", &[[f64::MAX; 2]; 3]),
    ] {
        let what = What::Shots {
            runs: vec![case.path("runs/0001")],
            polygon: polygon.to_vec(),
            rows_max: 10,
            format: format.to_owned(),
            into: case.path("refused"),
        };
        assert_eq!(failed(&task(&case, what)).code, 2);
    }
    // A damaged manifest is not a missing one.
    for (damaged, expected) in [
        (true, "the manifest cannot be read"),
        (false, "contains no products"),
    ] {
        let run = case.path(if damaged { "damaged" } else { "missing" });
        fs::create_dir(&run).unwrap();
        if damaged {
            fs::write(run.join("manifest.json"), "{").unwrap();
        }
        let what = What::Shots {
            runs: vec![run],
            polygon: polygon.to_vec(),
            rows_max: 10,
            format: "csv".to_owned(),
            into: case.path("refused"),
        };
        let failure = failed(&task(&case, what));
        assert_eq!(failure.code, 3);
        assert!(failure.text.contains(expected), "{}", failure.text);
    }
    assert!(!case.path("refused").exists());
}

#[test]
fn a_worker_stops_when_it_is_told_or_alone() {
    let case = Case::new();
    let blake3 = plan(&case).config_blake3;
    let cancel = serde_json::to_string(&Cancel {
        cancel: CancelWhy::User,
    })
    .unwrap();
    for told in [true, false] {
        let mut worker = Driven::start();
        let task = text(&run_task(&case, "0001", &blake3));
        worker.say(&if told {
            format!("{task}{cancel}\n")
        } else {
            task
        });
        if !told {
            worker.input = None;
        }
        let begun = Instant::now();
        let (last, code) = worker.end();
        assert!(
            begun.elapsed() < Duration::from_secs(9),
            "{:?}",
            begun.elapsed()
        );
        let Some(Line::Failure(failure)) = last else {
            panic!("{last:?}");
        };
        assert_eq!((failure.code, code), (130, Some(130)), "{}", failure.text);
        assert!(!case.path("runs").exists());
    }
    let mut worker = Driven::start();
    worker.input = None;
    let (last, code) = worker.end();
    assert!(matches!(last, Some(Line::Hello { .. })));
    assert_eq!(code, Some(130));
}

#[test]
fn nonsense_is_no_task() {
    let case = Case::new();
    let of_the_future = Task {
        v: PROTOCOL + 1,
        ..task(&case, What::Probe { files: Vec::new() })
    };
    for nonsense in [
        "{}\n",
        "\u{0}\u{1}\n",
        "[1,2",
        "{\"v\":1,\"what\":{\"do\":\"sing\"}}\n",
        &text(&of_the_future),
    ] {
        let mut worker = Driven::start();
        worker.say(nonsense);
        worker.input = None;
        let (last, code) = worker.end();
        let Some(Line::Failure(failure)) = last else {
            panic!("{nonsense}: {last:?}");
        };
        assert_eq!((failure.code, code), (1, Some(1)), "{}", failure.text);
    }
    // A line that no service says does no harm.
    let mut worker = Driven::start();
    worker.say(&(text(&task(&case, What::Probe { files: Vec::new() })) + "go on\n"));
    assert!(matches!(worker.end(), (Some(Line::Answer(_)), Some(0))));
}

#[test]
fn another_parent_ends_a_worker() {
    let child = areograph()
        .args(["worker", "--parent", "1"])
        .stdin(Stdio::piped())
        .output()
        .unwrap();
    assert_eq!(child.status.code(), Some(130));
    assert!(child.stdout.is_empty());
}

#[test]
fn too_little_memory_ends_the_worker_and_not_the_service() {
    let case = Case::new();
    let blake3 = plan(&case).config_blake3;
    for memory_mib in [8, 32, 64] {
        let small = Task {
            memory_mib,
            ..run_task(&case, "0001", &blake3)
        };
        let (ended, _) = done(&small);
        let by_itself = matches!(ended.how, How::Signalled(_) | How::Exited(1..));
        let Some(Err(failure)) = &ended.answer else {
            panic!("{ended:?}");
        };
        // What to do is in the message.
        let named = format!("workers.memory_mib = {memory_mib}");
        assert!(by_itself && failure.text.contains(&named), "{ended:?}");
        assert!(!case.path("runs").exists());
    }
    answered(&run_task(&case, "0002", &blake3));
}

/// A program in place of a worker.
fn stand_in(folder: &Path, script: &str) -> PathBuf {
    let path = folder.join("stand-in");
    fs::write(&path, format!("#!/bin/sh\n{script}\n")).unwrap();
    fs::set_permissions(&path, fs::Permissions::from_mode(0o755)).unwrap();
    path
}

/// How a program that is no worker ends, and after how many seconds.
fn ended(
    script: &str,
    limits: WorkerLimits,
    cancel_after_s: Option<f64>,
) -> (Ended, f64, PathBuf, tempfile::TempDir) {
    let folder = tempfile::tempdir().unwrap();
    let program = stand_in(folder.path(), script);
    let log = folder.path().join("log");
    let case = Case::new();
    let (cancel, cancelled) = watch::channel(None);
    let begun = Instant::now();
    let ended = runtime().block_on(async {
        if let Some(seconds) = cancel_after_s {
            tokio::spawn(async move {
                tokio::time::sleep(Duration::from_secs_f64(seconds)).await;
                cancel.send(Some(CancelWhy::User)).unwrap();
                std::future::pending::<()>().await;
            });
        }
        let task = task(&case, What::Probe { files: Vec::new() });
        work(&program, &task, &limits, &log, cancelled, |_| {}).await
    });
    (ended, begun.elapsed().as_secs_f64(), log, folder)
}

fn hello() -> String {
    let version = env!("CARGO_PKG_VERSION");
    format!("echo '{{\"line\":\"hello\",\"v\":{PROTOCOL},\"version\":\"{version}\",\"pid\":1}}'")
}

#[test]
fn what_is_no_worker_is_ended() {
    let quick = WorkerLimits {
        silence_s: 1.0,
        ..LIMITS
    };
    let (silent, after_s, ..) = ended(&format!("{}\nsleep 60", hello()), quick, None);
    assert_eq!(silent.how, How::Silent);
    assert!((0.9..9.0).contains(&after_s), "{after_s}");
    let foreign = hello().replace(env!("CARGO_PKG_VERSION"), "9.9.9");
    let (foreign, ..) = ended(&format!("{foreign}\nsleep 60"), LIMITS, None);
    assert_eq!(foreign.how, How::ForeignVersion("9.9.9".to_owned()));
    for (said, why) in [
        ("echo Toolkit version N0067", "not a line of a worker"),
        ("head -c 100000 /dev/zero", "a line of more than"),
        (
            "echo '{\"line\":\"beat\",\"rss_kib\":1}'",
            "does not identify the worker",
        ),
    ] {
        let (garbled, ..) = ended(&format!("{said}\nsleep 60"), LIMITS, None);
        let How::Garbled(text) = garbled.how else {
            panic!("{said}: {garbled:?}");
        };
        assert!(text.contains(why), "{text}");
    }
    let (gone, ..) = ended("exit 3", LIMITS, None);
    assert_eq!((gone.how, gone.answer), (How::NoHello, None));
    let (exited, ..) = ended(&format!("{}\nexit 3", hello()), LIMITS, None);
    assert_eq!(exited.how, How::Exited(3));
    let (killed, ..) = ended(&format!("{}\nkill -SEGV $$", hello()), LIMITS, None);
    assert_eq!(killed.how, How::Signalled(11));
    let late = WorkerLimits {
        deadline_s: 0.5,
        ..LIMITS
    };
    // It obeys the line, and with it the task line comes first.
    let obeys = format!("{}\nread task\nread cancel\nexit 130", hello());
    let (late, after_s, ..) = ended(&obeys, late, None);
    assert_eq!(late.how, How::DeadlinePassed);
    assert!(after_s < 5.0, "{after_s}");
    let missing = runtime().block_on(async {
        let (_cancel, cancelled) = watch::channel(None);
        let case = Case::new();
        let task = task(&case, What::Probe { files: Vec::new() });
        let log = case.path("log");
        work(
            Path::new("/nowhere/areograph"),
            &task,
            &LIMITS,
            &log,
            cancelled,
            |_| {},
        )
        .await
    });
    assert!(matches!(missing.how, How::NotStarted(_)), "{missing:?}");
}

#[test]
fn a_worker_that_does_not_stop_is_ended_with_all_that_it_started() {
    let script = format!(
        "{}\ntrap '' TERM\nsleep 300 & \necho $! >&2\nwhile :; do sleep 1; done",
        hello()
    );
    let (ended, after_s, log, _folder) = ended(&script, HASTY, Some(0.2));
    assert_eq!(ended.how, How::Cancelled);
    // 1 s for the line, 1 s for the signal; the rest is for a busy machine.
    assert!((2.0..20.0).contains(&after_s), "{after_s}");
    let child: u32 = fs::read_to_string(log).unwrap().trim().parse().unwrap();
    let gone = || ProcessIdentity::of(child).is_none();
    // The grandchild is waited for by whoever inherits it.
    for _ in 0..50 {
        if gone() {
            return;
        }
        std::thread::sleep(Duration::from_millis(100));
    }
    let state = fs::read_to_string(format!("/proc/{child}/stat")).unwrap_or_default();
    assert!(state.contains(") Z "), "{state}");
}

#[test]
fn no_hello_for_so_long_is_enough() {
    let (ended, after_s, ..) = ended("sleep 60", HASTY, None);
    assert_eq!(ended.how, How::NoHello);
    // 2 s for the hello; the rest is for a busy machine.
    assert!((2.0..20.0).contains(&after_s), "{after_s}");
}

#[test]
fn a_killed_worker_is_told_by_its_signal_and_its_log_is_bounded() {
    let case = Case::new();
    let blake3 = plan(&case).config_blake3;
    let (_cancel, cancelled) = watch::channel(None);
    let mut started = None;
    let ended = runtime().block_on(work(
        Path::new(env!("CARGO_BIN_EXE_areograph")),
        &run_task(&case, "0001", &blake3),
        &LIMITS,
        &case.path("log"),
        cancelled,
        |heard| match heard {
            Heard::Started(process) => {
                assert!(process.is_there());
                started = Some(process.clone());
            }
            Heard::Line(Line::Stage { .. }) => {
                let _ = started.as_ref().unwrap().end();
            }
            Heard::Line(_) => {}
        },
    ));
    assert_eq!((ended.how, ended.answer), (How::Signalled(9), None));
    assert!(!started.unwrap().is_there());
    // The next one goes on.
    answered(&run_task(&case, "0002", &blake3));
    let chatter = format!("{}\nseq 1 100000 >&2", hello());
    let (_, _, log, _folder) = self::ended(&chatter, LIMITS, None);
    let log = fs::read_to_string(log).unwrap();
    assert!(log.starts_with("1\n2\n") && log.ends_with("99999\n100000\n"));
    assert!(
        log.contains("\n{\"cut_bytes\":") && log.len() < 66_000,
        "{}",
        log.len()
    );
}

/// A worker on a node whose connection was lost: its input neither ends nor says anything.
#[test]
fn a_worker_that_does_not_hear_the_service_for_its_lease_stops() {
    let case = Case::new();
    let folder = case.path("many");
    fs::create_dir(&folder).unwrap();
    for file in 0..2_000 {
        fs::write(folder.join(file.to_string()), "").unwrap();
    }
    // 400,000 files take longer than the lease.
    let list = What::List {
        roots: vec![folder; 200],
        into: case.path("list"),
    };
    let ended = |renewals: usize| {
        let mut worker = Driven::start_with(&["--lease-s", "0.2"]);
        worker.say(&text(&task(&case, list.clone())));
        let mut input = worker.input.take().unwrap();
        let service = std::thread::spawn(move || {
            for _ in 0..renewals {
                std::thread::sleep(Duration::from_millis(20));
                // The worker may have ended.
                let _ = input.write_all(b"{\"here\":true}\n");
            }
            input
        });
        let ended = worker.end();
        drop(service.join());
        ended
    };
    let (last, code) = ended(0);
    let Some(Line::Failure(failure)) = last else {
        panic!("{last:?}");
    };
    assert_eq!((failure.code, code), (130, Some(130)), "{}", failure.text);
    assert!(!case.path("list").exists());
    let (last, code) = ended(400);
    assert!(matches!(last, Some(Line::Answer(_))), "{last:?}");
    assert_eq!(code, Some(0));
}
