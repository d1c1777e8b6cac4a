//! Wrong but plausible inputs: rows of `mutations/*.toml`, each with a change of sound inputs and the answer that is expected.
//!
//! A row starts from files whose truth is known, changes them, runs the program as its user does, and compares the result with
//! the truth. Every run has the rows that are marked `short`; the long run has all of them. Both hold their lines of the page
//! `docs/guide/src/wrong_inputs.md`, which the long run writes with `SNAPSHOTS=overwrite`. Whoever finds another wrong input
//! adds a row; nothing is built for it.
#![allow(
    clippy::disallowed_methods,
    clippy::unwrap_used,
    clippy::panic,
    reason = "helpers of tests work in temporary folders and may fail loudly"
)]

mod change;
mod kernels;
mod measure;
mod page;
mod rows;
mod start;
mod text;

use std::{
    collections::BTreeMap,
    panic::{AssertUnwindSafe, catch_unwind},
    sync::{
        Mutex,
        atomic::{AtomicUsize, Ordering},
    },
};

use serde::Deserialize;
use serde_json::Value;

use crate::common::{self, case::Case, json};
use change::Change;
use measure::Measured;
use rows::{Answer, Row};
use start::Start;

/// A row after its run.
struct Judged<'a> {
    row: &'a Row,
    measured: Option<Measured>,
}

/// Exit code and everything printed, and the verdict if products were written.
struct Ending {
    printed: String,
    verdict: Value,
}

impl Ending {
    fn of(case: &Case, row: &Row) -> Self {
        let printed = case.outcome(row.start.command(case));
        let manifest = case.path(&format!("out/{}/manifest.json", row.start.name()));
        let verdict = if manifest.exists() {
            json(&manifest)["verdict"].clone()
        } else {
            Value::Null
        };
        Self { printed, verdict }
    }

    fn exit(&self) -> i32 {
        let first = self.printed.lines().next().unwrap();
        first.strip_prefix("exit ").unwrap().parse().unwrap()
    }

    /// Whether an entry of this list of the verdict contains the phrase.
    fn lists(&self, list: &str, phrase: &str) -> bool {
        let entries = self.verdict[list].as_array();
        entries.is_some_and(|entries| {
            let mut texts = entries.iter().map(|entry| entry.as_str().unwrap());
            texts.any(|text| text.contains(phrase))
        })
    }
}

/// Makes `changes = […]` of a row in the folder of a case.
pub(crate) fn make_changes(case: &Case, changes: &str) {
    #[derive(Deserialize)]
    struct Changes {
        changes: Vec<Change>,
    }
    let parsed: Changes = toml::from_str(changes).unwrap();
    for change in parsed.changes {
        change.make(case, changes);
    }
}

/// Remarks of the sound inputs, which identify no mistake.
fn sound_remarks(row: &Row) -> Value {
    static REMARKS: Mutex<BTreeMap<Start, Value>> = Mutex::new(BTreeMap::new());
    let mut remarks = REMARKS.lock().unwrap();
    let of_start = remarks.entry(row.start).or_insert_with(|| {
        let ending = Ending::of(&row.start.case(), row);
        ending.verdict["remarks"].clone()
    });
    of_start.clone()
}

/// Why the answer is not that of the row, if so.
fn differs(row: &Row, ending: &Ending, measured: Option<&Measured>) -> Option<String> {
    let exit = ending.exit();
    let phrase = &row.phrase;
    let is_within = measured.is_some_and(Measured::is_within);
    let is_met = match row.answer {
        Answer::Refused => {
            exit == row.exit
                && ending.printed.contains("\nerror: ")
                && ending.printed.contains(phrase)
        }
        Answer::Invalid => exit == 5 && ending.lists("reasons", phrase),
        Answer::Named => {
            let sound = sound_remarks(row).to_string();
            exit == 0 && ending.lists("remarks", phrase) && !sound.contains(phrase)
        }
        Answer::NotTested => exit == 0 && ending.lists("untested", phrase),
        Answer::Inside => exit == 0 && is_within && ending.printed.contains(phrase),
        Answer::Silent => exit == 0 && !is_within,
    };
    let needs_phrase = !matches!(row.answer, Answer::Inside | Answer::Silent);
    let is_complete = !phrase.is_empty() || !needs_phrase;
    (!is_met || !is_complete).then(|| {
        format!(
            "{}: expected {:?} with {phrase:?}; found {measured:?}\n{}\n  reasons {:#}\n  remarks {:#}\n  untested {:#}",
            row.name,
            row.answer,
            ending.printed,
            ending.verdict["reasons"],
            ending.verdict["remarks"],
            ending.verdict["untested"],
        )
    })
}

/// Runs a row; the result, or the difference from what is expected.
fn judged(row: &Row) -> Result<Judged<'_>, String> {
    let case = row.start.case();
    for change in &row.changes {
        change.make(&case, &row.name);
    }
    let ending = Ending::of(&case, row);
    // What is refused or invalid is withheld or marked; its error is of interest where there is one.
    let measured = (ending.exit() != row.exit || row.answer != Answer::Refused)
        .then(|| row.start.measured(&case))
        .flatten();
    differs(row, &ending, measured.as_ref()).map_or(Ok(Judged { row, measured }), Err)
}

/// Every row of a list, on all processors; fails with all differences.
#[allow(clippy::print_stdout, reason = "what was measured is worth reading")]
fn all_judged<'a>(rows: &[&'a Row]) -> Vec<Judged<'a>> {
    let next = AtomicUsize::new(0);
    let results = Mutex::new(Vec::new());
    let work = || {
        while let Some(row) = rows.get(next.fetch_add(1, Ordering::Relaxed)) {
            let result = catch_unwind(AssertUnwindSafe(|| judged(row)));
            let result = result.unwrap_or_else(|_| Err(format!("{}: panicked", row.name)));
            results.lock().unwrap().push(result);
        }
    };
    let workers = std::thread::available_parallelism().map_or(1, usize::from);
    std::thread::scope(|scope| {
        for _ in 0..workers.min(rows.len()) {
            scope.spawn(work);
        }
    });
    let mut judged = Vec::new();
    let mut differing = Vec::new();
    for result in results.into_inner().unwrap() {
        match result {
            Ok(row) => judged.push(row),
            Err(difference) => differing.push(difference),
        }
    }
    for of in &judged {
        println!("{}: {:?} {:?}", of.row.name, of.row.answer, of.measured);
    }
    assert!(
        differing.is_empty(),
        "{} of {} rows differ:\n{}",
        differing.len(),
        rows.len(),
        differing.join("\n\n")
    );
    judged
}

/// Rows in the order of their files, with names that differ.
#[test]
fn rows_of_wrong_inputs_are_complete() {
    let rows = rows::all();
    let mut names: Vec<&str> = rows.iter().map(|row| &*row.name).collect();
    names.sort_unstable();
    names.dedup();
    assert_eq!(names.len(), rows.len(), "two rows have one name");
    let short = rows.iter().filter(|row| row.short).count();
    assert!((10..=14).contains(&short), "{short} rows are short");
    for row in &rows {
        row.assert_is_complete();
    }
}

#[test]
fn wrong_inputs_of_each_kind_are_answered_as_listed() {
    let rows = rows::all();
    let short: Vec<&Row> = rows.iter().filter(|row| row.short).collect();
    if common::long() {
        // The test of all rows has them.
        return;
    }
    let judged = all_judged(&short);
    page::has_lines_of(&judged);
}

#[test]
fn every_wrong_input_is_answered_as_listed() {
    let rows = rows::all();
    if !common::long_test("all wrong inputs, some minutes") {
        page::has_answers_of(&rows);
        return;
    }
    // One kind or one row, while rows are written: the page is then left alone.
    let only = std::env::var("AREOGRAPH_MUTATIONS").ok();
    let is_chosen = |row: &&Row| {
        only.as_deref().is_none_or(|only| {
            let mut parts = only.split(',');
            parts.any(|part| row.name.starts_with(part) || row.kind == part)
        })
    };
    let chosen: Vec<&Row> = rows.iter().filter(is_chosen).collect();
    let judged = all_judged(&chosen);
    if only.is_none() {
        page::is_up_to_date(&rows, &judged);
    }
}
