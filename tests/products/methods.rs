//! METHOD cannot be forgotten: `docs/methods.csv` holds what every stage computes of fixed scenes, and under which number.
//!
//! A stored output is used again while the inputs of its stage are the same, the number of its method among them. Where a stage
//! computes something else and keeps its number, old answers are taken as unchanged. Here every stage runs on small scenes:
//!
//! | what differs from the ledger | what follows |
//! |---|---|
//! | the output, of the same inputs under the same METHOD | fails; METHOD has to rise |
//! | METHOD, inputs, or a row that is new or gone | fails until the ledger is written anew |
//!
//! `SNAPSHOTS=overwrite cargo test --locked --test products methods` writes the ledger, and refuses the first of these. The scene `loop`
//! takes longer and runs, and is written, with `AREOGRAPH_LONG=1` alone; the number of its METHOD is always compared.
//!
//! Numbers depend on the mathematical library and the processor. The ledger has a fingerprint of the arithmetic that it was
//! made with; on a machine with another one outputs cannot be compared, the test is counted as skipped, and no ledger is written.
//! To begin a new one there, remove the file first.
//!
//! What it cannot see: a change that these scenes do not reach, and a change of a stage whose inputs change at the same time,
//! since then another output is expected.
#![allow(
    clippy::disallowed_methods,
    clippy::unwrap_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "tests work in temporary folders and may fail loudly"
)]

mod arithmetic;
mod cache;
mod ledger;
mod scenes;
mod sources;

use std::{
    env, fs,
    path::{Path, PathBuf},
    sync::LazyLock,
    time::Instant,
};

use crate::{architecture::uses, common::outside};
use areograph::store::publish::CACHE;
use ledger::{Ledger, Row, Standing};
use scenes::{LONG, SHORT, Scene};
use sources::Declared;
use uses::Sources;

const LEDGER: &str = "docs/methods.csv";
const WRITE: &str = "SNAPSHOTS=overwrite cargo test --locked --test products methods";

/// The short scenes, run once.
static RUNS: LazyLock<Vec<Run>> = LazyLock::new(|| SHORT.iter().map(Run::of).collect());

/// A scene that was run.
struct Run {
    scene: &'static Scene,
    folder: tempfile::TempDir,
    cache: PathBuf,
}

impl Run {
    fn of(scene: &'static Scene) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let begun = Instant::now();
        (scene.write)(folder.path());
        let written_s = begun.elapsed().as_secs_f64();
        let cache = (scene.run)(folder.path()).join(CACHE);
        println!(
            "{}: written in {written_s:.1} s, all in {:.1} s",
            scene.name,
            begun.elapsed().as_secs_f64()
        );
        Self {
            scene,
            folder,
            cache,
        }
    }

    fn rows(&self, declared: &[Declared]) -> Vec<Row> {
        let behind = |stage: &str| {
            let here = self.scene.declared.iter().find(|(name, _)| *name == stage);
            if let Some((_, declared)) = here {
                return (*declared).to_owned();
            }
            let mut of_name = declared
                .iter()
                .filter(|of| of.stage.as_deref() == Some(stage));
            let (Some(only), None) = (of_name.next(), of_name.next()) else {
                panic!(
                    "{stage}: which type is it in the scene {}?",
                    self.scene.name
                )
            };
            only.declared.clone()
        };
        cache::rows(self.scene.name, self.folder.path(), &self.cache, &behind)
    }
}

fn is_on(variable: &str, value: &str) -> bool {
    env::var(variable).is_ok_and(|of| of == value)
}

fn path() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(LEDGER)
}

fn committed() -> Ledger {
    fs::read_to_string(path()).map_or_else(
        |_| Ledger {
            arithmetic: arithmetic::fingerprint(),
            rows: Vec::new(),
        },
        |text| Ledger::read(&text),
    )
}

#[test]
fn every_stage_computes_what_the_ledger_says() {
    let ledger = committed();
    if ledger.arithmetic != arithmetic::fingerprint() {
        let why = format!("{LEDGER} was made with another arithmetic (library or processor)");
        assert!(
            !is_on("SNAPSHOTS", "overwrite"),
            "{why}: nothing is written"
        );
        outside::skipped("outputs of all stages", &why);
        return;
    }
    outside::found("outputs of all stages");
    let declared = sources::declared();
    let mut rows: Vec<Row> = RUNS.iter().flat_map(|run| run.rows(&declared)).collect();
    let mut names: Vec<&str> = SHORT.iter().map(|scene| scene.name).collect();
    if is_on("AREOGRAPH_LONG", "1") {
        for run in LONG.iter().map(Run::of) {
            assert_eq!(inputs_that_are_methods(&run, &declared), 8);
            rows.extend(run.rows(&declared));
        }
        names.extend(LONG.iter().map(|scene| scene.name));
    }
    if is_on("SNAPSHOTS", "overwrite") {
        match ledger.with(&rows, &names) {
            Ok(ledger) => fs::write(path(), ledger.written()).unwrap(),
            Err(why) => panic!("{LEDGER} stays as it is:\n{}", why.join("\n")),
        }
        return;
    }
    let (mut forgotten, mut anew) = (Vec::new(), Vec::new());
    for standing in ledger.compare(&rows, &names) {
        match standing {
            Standing::Same => {}
            Standing::Anew(why) => anew.push(why),
            Standing::Forgotten(why) => forgotten.push(why),
        }
    }
    assert!(forgotten.is_empty(), "{}", forgotten.join("\n"));
    assert!(
        anew.is_empty(),
        "write {LEDGER} anew (`{WRITE}`) and read the difference:\n{}",
        anew.join("\n")
    );
}

/// By the sources alone, and so also for what takes long and on every machine.
#[test]
fn every_method_of_the_sources_has_a_row() {
    if is_on("SNAPSHOTS", "overwrite") {
        // The ledger is being written.
        return;
    }
    let declared = sources::declared();
    let stages = declared.iter().filter(|of| of.stage.is_some()).count();
    assert!(stages >= 28, "only {stages} stages were found");
    let ledger = committed();
    let mut wrong = Vec::new();
    for of in &declared {
        let rows = ledger.rows.iter().filter(|row| row.declared == of.declared);
        let numbers: Vec<u32> = rows.map(|row| row.method).collect();
        let (what, file, method) = (&of.declared, &of.file, of.method);
        if numbers.is_empty() {
            wrong.push(format!(
                "{what} ({file}) has no row: let a scene of tests/methods/scenes.rs run it"
            ));
        } else if numbers.iter().any(|number| *number != method) {
            wrong.push(format!(
                "{what} ({file}): METHOD is {method}, {LEDGER} has {numbers:?}: write it anew (`{WRITE}`, scenes that take \
                 long with AREOGRAPH_LONG=1)"
            ));
        }
    }
    for row in &ledger.rows {
        if declared.iter().all(|of| of.declared != row.declared) {
            wrong.push(format!(
                "{} is in {LEDGER} and not in the sources",
                row.declared
            ));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Hashes are of what was computed, not of where and when; the longest of the short scenes is run twice where time does not matter.
fn folder_and_time_do_not_enter(is_meant: impl Fn(usize) -> bool) {
    let declared = sources::declared();
    let runs = RUNS.len() - usize::from(!is_on("AREOGRAPH_LONG", "1"));
    let runs = RUNS[..runs].iter().enumerate();
    for (_, run) in runs.filter(|(number, _)| is_meant(*number)) {
        let (from, to) = (run.folder.path(), tempfile::tempdir().unwrap());
        // Of another length, so that an absolute path cannot hide.
        let other = to.path().join("elsewhere");
        copy(from, &other);
        let cache = (run.scene.run)(&other).join(CACHE);
        let again = cache::rows(run.scene.name, &other, &cache, &|stage| {
            let rows = run.rows(&declared);
            let row = rows.into_iter().find(|row| row.stage == stage);
            row.unwrap().declared
        });
        assert_eq!(again, run.rows(&declared), "{}", run.scene.name);
    }
}

#[test]
fn folder_and_time_do_not_enter_the_first_scene() {
    folder_and_time_do_not_enter(|number| number == 0);
}

#[test]
fn folder_and_time_do_not_enter_the_other_scenes() {
    folder_and_time_do_not_enter(|number| number > 0);
}

/// Copies input files: products and stored outputs stay behind.
fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap() {
        let (path, name) = {
            let entry = entry.unwrap();
            (entry.path(), entry.file_name())
        };
        if path.is_dir() && name != "out" {
            copy(&path, &to.join(name));
        } else if path.is_file() {
            fs::copy(&path, to.join(name)).unwrap();
        }
    }
}

/// Whether a text calls a function of a type.
fn calls_function_of(text: &str, name: &str) -> bool {
    let path = format!("{name}::");
    text.match_indices(&*path).any(|(at, _)| {
        let is_whole = !text[..at].ends_with(|last: char| last.is_alphanumeric());
        let behind = &text[at + path.len()..];
        is_whole && behind.starts_with(|first: char| first.is_ascii_lowercase())
    })
}

/// What calls functions of a stage lists that stage, whose method then is an input.
#[test]
fn what_calls_functions_of_stages_lists_them() {
    let (sources, declared) = (Sources::of_the_program(), sources::declared());
    let by_room = |room: &[String]| {
        let of_room = declared.iter().filter(|of| of.room() == room);
        of_room.filter(|of| of.stage.is_some()).collect::<Vec<_>>()
    };
    let mut missing = Vec::new();
    for of in &declared {
        let room = of.room();
        if of.stage.is_none() && room[0] == "flow" {
            // Products are made again when the fingerprint of a stage changes.
            continue;
        }
        for module in sources.modules().filter(|module| module.starts_with(&room)) {
            let path = sources::path_of(module);
            let text = fs::read_to_string(path.with_extension("rs"))
                .or_else(|_| fs::read_to_string(path.join("mod.rs")))
                .unwrap();
            let is_code = |line: &&str| !line.trim_start().starts_with("//");
            let text: String = text.split_inclusive('\n').filter(is_code).collect();
            for used in sources.uses(module) {
                let (Some(item), Some(other)) = (&used.item, used.file.get(..2)) else {
                    continue;
                };
                let called = by_room(other);
                let calls = item.starts_with(|first: char| first.is_ascii_lowercase())
                    || calls_function_of(&text, item);
                if other != room
                    && calls
                    && !called.is_empty()
                    && called
                        .iter()
                        .all(|stage| !of.calls.contains(&stage.declared))
                {
                    let path = module.join("/");
                    missing.push(format!(
                        "{}: {path} calls {item} of {}",
                        of.declared,
                        other.join("/")
                    ));
                }
            }
        }
    }
    // What these call in turn.
    for of in &declared {
        let called = declared
            .iter()
            .filter(|called| of.calls.contains(&called.declared));
        for inner in called.flat_map(|called| &called.calls) {
            if !of.calls.contains(inner) {
                missing.push(format!(
                    "{}: {inner}, which what it calls calls",
                    of.declared
                ));
            }
        }
    }
    assert!(missing.is_empty(), "not in CALLS:\n{}", missing.join("\n"));
    let lines = declared.iter().find(|of| of.declared == "MatchModel");
    assert_eq!(lines.unwrap().calls.len(), 2);
}

/// Methods that are called are inputs with their present number; how many such inputs there are.
fn inputs_that_are_methods(run: &Run, declared: &[Declared]) -> usize {
    let stored = cache::inputs(&run.cache);
    let mut count = 0;
    for row in run.rows(declared) {
        let of = declared.iter().find(|of| of.declared == row.declared);
        for called in &of.unwrap().calls {
            let called = declared.iter().find(|of| of.declared == *called).unwrap();
            let name = format!("method of {}", called.stage.as_ref().unwrap());
            let mut of_stage = stored.iter().filter(|stored| stored.stage == row.stage);
            let method = called.method.to_string();
            assert!(
                of_stage.all(|stored| stored.inputs[&name] == method),
                "{}: {name}",
                row.declared
            );
            count += 1;
        }
    }
    count
}

/// The calibration from pixels, which calls most, runs with the long scenes.
#[test]
fn methods_that_are_called_are_inputs() {
    let declared = sources::declared();
    let counts = RUNS
        .iter()
        .map(|run| inputs_that_are_methods(run, &declared));
    // Two of the check of archives, one of the match with the laser, one of the joined terrain models, two of the mosaic of a net.
    assert_eq!(counts.sum::<usize>(), 6);
}

/// What the ledger lets pass and what it refuses, on rows that are invented.
#[test]
fn another_output_needs_another_number() {
    let row = |method, inputs: &str, output: &str| Row {
        stage: "adjust".to_owned(),
        declared: "Adjust".to_owned(),
        scene: "mission".to_owned(),
        method,
        inputs: inputs.to_owned(),
        output: output.to_owned(),
    };
    let ledger = Ledger {
        arithmetic: "a".to_owned(),
        rows: vec![row(3, "in", "out")],
    };
    assert_eq!(Ledger::read(&ledger.written()), ledger);
    let with = |row| ledger.with(&[row], &["mission"]);
    assert_eq!(with(row(3, "in", "out")).unwrap(), ledger);
    // The output changed and the number did not, or fell.
    for (method, what) in [(3, "raise METHOD of Adjust to 4"), (2, "lower than 3")] {
        let why = with(row(method, "in", "other")).unwrap_err();
        assert!(why[0].contains(what), "{why:?}");
    }
    // A number that rose, other inputs.
    for row in [
        row(4, "in", "other"),
        row(4, "in", "out"),
        row(3, "others", "other"),
    ] {
        assert!(matches!(
            row.against(ledger.rows.first()),
            Standing::Anew(_)
        ));
        assert_eq!(with(row.clone()).unwrap().rows, [row]);
    }
    // New rows are taken in, rows of scenes that did not run are kept, those that nothing makes go.
    let new = Row {
        scene: "pair".to_owned(),
        ..row(1, "in", "out")
    };
    let both = ledger.with(std::slice::from_ref(&new), &["pair"]).unwrap();
    assert_eq!(both.rows, [row(3, "in", "out"), new]);
    assert_eq!(ledger.with(&[], &["mission"]).unwrap().rows, []);
    assert_eq!(ledger.compare(&[], &["mission"]).len(), 1);
}

/// The sources are read as they are written.
#[test]
fn methods_are_found_in_the_sources() {
    let text = "pub const METHOD: u32 = 5;\nimpl Stage for Adjust<'_> {\n    const NAME: &'static str = \"adjust\";\n    \
                const METHOD: u32 = 7;\n    const CALLS: &'static [Called] = &[called::<Register<'_>>()];\n}\n\
                impl Stage for Read {\n    const NAME: &'static str = \"read\";\n}\n";
    let found = sources::of_text("stages/adjust/stage.rs", text);
    let found: Vec<_> = found
        .iter()
        .map(|of| {
            (
                of.stage.as_deref(),
                &*of.declared,
                of.method,
                of.calls.len(),
            )
        })
        .collect();
    let expected = [
        (None, "stages/adjust/stage.rs", 5, 1),
        (Some("adjust"), "Adjust", 7, 1),
        (Some("read"), "Read", 1, 0),
    ];
    assert_eq!(found, expected);
}
