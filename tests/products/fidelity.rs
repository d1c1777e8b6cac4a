//! Every printed number of the five papers beside areograph's, in one list; `docs/fidelity.md` and the page of the
//! report are made from it.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "helpers of tests may fail loudly"
)]

use areograph_testing::eos_2002;
use areograph_testing::kept;
use areograph_testing::recipe;
use areograph_testing::scene;

mod arthur_1977;
mod document;
mod li_2023;
mod pairs;
mod real_shots;
mod row;
mod shan_2002;
mod shan_2005;
mod table_2;
mod yoon_2004;

use std::{fmt::Write as _, fs, path::Path};

use areograph::report::fidelity_page;
use kept::is_up_to_date;
use row::{Account, Outcome, Paper, Row};

/// The papers in the order of the page.
const PAPERS: [&Paper; 5] = [
    &shan_2005::PAPER,
    &shan_2002::PAPER,
    &yoon_2004::PAPER,
    &li_2023::PAPER,
    &arthur_1977::PAPER,
];

/// Rows whose numbers come from the real shots of `AREOGRAPH_DATA`: without these only their texts are checked.
const OF_REAL_SHOTS: [&str; 9] = [
    "S05-64", "S05-65", "S05-66", "S05-67", "S05-68", "S05-69", "S05-70", "S02-07", "L23-21",
];

/// The rows of all papers.
fn all_rows() -> impl Iterator<Item = &'static Row> {
    let lists = PAPERS.into_iter().flat_map(|paper| paper.rows.iter());
    lists.flat_map(|rows| rows.iter())
}

fn outcomes(paper: &Paper) -> Vec<Outcome> {
    let rows = paper.rows.iter().flat_map(|rows| rows.iter());
    rows.map(Outcome::of).collect()
}

#[test]
fn every_row_stands_once_in_its_order() {
    for paper in PAPERS {
        let rows = paper.rows.iter().flat_map(|rows| rows.iter());
        let found: Vec<&str> = rows.map(|row| row.id).collect();
        let numbers = 1..=paper.count;
        let expected: Vec<String> = numbers
            .map(|number| format!("{}-{number:02}", paper.prefix))
            .collect();
        assert_eq!(found, expected, "{}", paper.name);
    }
}

#[test]
fn every_row_comes_out_as_declared() {
    if !real_shots::are_at_hand() {
        let others = all_rows().filter(|row| !OF_REAL_SHOTS.contains(&row.id));
        let complaints: String = others.map(|row| Outcome::of(row).complaint()).collect();
        assert!(complaints.is_empty(), "{complaints}");
        return;
    }
    let papers = PAPERS.map(|paper| (paper, outcomes(paper)));
    let outcomes = papers.iter().flat_map(|(_, outcomes)| outcomes);
    let complaints: String = outcomes.map(Outcome::complaint).collect();
    let fidelity = document::fidelity(&papers);
    let mut counts = String::new();
    for kind in &fidelity.kinds {
        let [agree, in_part, explained, without] = kind.counts;
        write!(
            counts,
            "{}: {agree} {}, {in_part} in part, {explained} explained, {without} without ours; ",
            kind.name, kind.agrees
        )
        .unwrap();
    }
    println!("fidelity: {}", counts.trim_end_matches("; "));
    assert!(complaints.is_empty(), "{complaints}");
    is_up_to_date("docs/fidelity.md", &document::markdown(&fidelity));
    is_up_to_date("docs/fidelity.html", &fidelity_page(&fidelity));
}

/// The page of real shots cannot be made without data; a text that was changed must not wait for them.
#[test]
fn texts_of_rows_of_real_shots_are_those_of_the_page() {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/fidelity.md");
    let page = fs::read_to_string(page).unwrap();
    for id in OF_REAL_SHOTS {
        let row = all_rows().find(|row| row.id == id).unwrap();
        let start = format!("| {id} |");
        let line = page.lines().find(|line| line.starts_with(&start)).unwrap();
        let from = row.account.inputs();
        for text in [row.kind.words(), row.place, row.what, &from, row.note] {
            let cell = format!("| {} |", text.replace('|', "\\|"));
            assert!(line.contains(&cell), "docs/fidelity.md, {id}: no {cell}");
        }
    }
}

#[test]
fn tests_that_inputs_name_exist() {
    for row in all_rows() {
        if let Account::Input { test, .. } = row.account {
            let (file, name) = test.split_once("::").unwrap();
            let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(file);
            let text = fs::read_to_string(&path).unwrap_or_default();
            assert!(
                text.contains(&format!("fn {name}(")),
                "{}: no {test}",
                row.id
            );
        }
    }
}
