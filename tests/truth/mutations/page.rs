//! The page of the guide: what each wrong input does.

use std::{collections::BTreeMap, fmt::Write as _, fs};

use super::{
    Judged, common,
    common::kept,
    measure::Measured,
    rows::{Answer, KINDS, Row},
};

const PAGE: &str = "docs/guide/src/wrong_inputs.md";

const INTRODUCTION: &str = "\
# Wrong inputs

A wrong input can be plausible: its format is correct, and the run completes.
This page lists such inputs and the answer of areograph to each.
A test derives every input from sound files whose truth is known, runs the program, and compares the result with the truth
(`tests/truth/mutations`, in the long run). The same test writes this page.

- *refused*: the run ends with an error and writes no products.
- *invalid*: the products are marked invalid with a reason. The exit code is 5.
- *remark*: the products are valid with a remark that identifies the mistake.
- *valid, inside*: the products are valid, and the error lies within three stated standard deviations.
- *stated as not tested*: the products are valid. The terminal, the page and the manifest list this error among those that the
  data of the site do not test.

The error is that of the mean position of the adjusted tie points on one axis: east, north or up, whichever has the largest ratio of
error to stated standard deviation. For nets and calibrations, it is the root mean square over all points. Without an adjustment, it is the mean
distance on the ground between the positions that the images give for known pixels and the true positions; no uncertainty is stated for this
distance. *Worst point* is the largest ratio of the error of a single point to its own stated standard deviation.
The table of sound inputs is for comparison.

The errors of products that are invalid, or that have a remark, can exceed the stated uncertainties. Scripts must check the exit code and the remarks.

To add an input, add a row to a file of `tests/truth/mutations` and run
`AREOGRAPH_LONG=1 SNAPSHOTS=overwrite cargo test --locked --test truth every_wrong_input`.
";

/// Three digits.
fn digits(value: f64) -> String {
    match value {
        value if value >= 100.0 => format!("{value:.0}"),
        value if value >= 10.0 => format!("{value:.1}"),
        _ => format!("{value:.2}"),
    }
}

/// Cells of error, stated standard deviation, ratio and worst point.
fn cells(measured: Option<&Measured>) -> [String; 4] {
    let cell = |value: Option<f64>| value.map_or_else(|| "–".to_owned(), digits);
    [
        measured.map(|of| of.error_m),
        measured.and_then(|of| of.sigma_m),
        measured.and_then(Measured::ratio),
        measured.and_then(|of| of.single),
    ]
    .map(cell)
}

/// The start of the line of a row, which does not depend on what was measured.
fn start(row: &Row) -> String {
    format!("| {} | {} |", row.mistake, row.answer.words())
}

fn line(judged: &Judged<'_>) -> String {
    // Products of an error are withheld.
    let measured = judged.measured.as_ref();
    format!("{} {} |", start(judged.row), cells(measured).join(" | "))
}

fn table<'a>(text: &mut String, rows: impl Iterator<Item = &'a Judged<'a>>) {
    text.push_str("\n| mistake | answer | error, m | stated, m | ratio | worst point, σ |\n|---|---|---:|---:|---:|---:|\n");
    for row in rows {
        let _infallible = writeln!(text, "{}", line(row));
    }
}

fn page(rows: &[Row], judged: &[Judged<'_>]) -> String {
    let by_name: BTreeMap<&str, &Judged<'_>> =
        judged.iter().map(|of| (&*of.row.name, of)).collect();
    let ordered: Vec<&Judged<'_>> = rows.iter().map(|row| by_name[&*row.name]).collect();
    let mut text = INTRODUCTION.to_owned();
    text.push_str("\n## Summary\n\n| answer | inputs |\n|---|---:|\n");
    for answer in [
        Answer::Refused,
        Answer::Invalid,
        Answer::Named,
        Answer::Inside,
        Answer::NotTested,
        Answer::Silent,
    ] {
        let count = rows.iter().filter(|row| row.answer == answer).count();
        let _infallible = writeln!(text, "| {} | {count} |", answer.words());
    }
    let silent: Vec<&Judged<'_>> = ordered
        .iter()
        .copied()
        .filter(|of| of.row.answer == Answer::Silent)
        .collect();
    if !silent.is_empty() {
        text.push_str(
            "\n## Not noticed\n\nThese inputs give valid products without a remark, and their result, or a statement about it, is wrong by more than is stated.\n",
        );
        table(&mut text, silent.iter().copied());
        text.push('\n');
        for of in &silent {
            let _infallible = writeln!(text, "- {} {}", of.row.mistake, of.row.because);
        }
    }
    for (kind, heading) in KINDS {
        let _infallible = writeln!(text, "\n## {heading}");
        table(
            &mut text,
            ordered.iter().copied().filter(|of| of.row.kind == kind),
        );
    }
    text
}

/// Fails unless the page is that of these rows, or writes it.
pub(super) fn is_up_to_date(rows: &[Row], judged: &[Judged<'_>]) {
    kept::is_up_to_date(PAGE, &page(rows, judged));
}

fn lines() -> Vec<String> {
    let text = fs::read_to_string(common::checkout().join(PAGE)).unwrap();
    text.lines().map(str::to_owned).collect()
}

/// Fails unless the page has the line of each of these rows as it is.
pub(super) fn has_lines_of(judged: &[Judged<'_>]) {
    let lines = lines();
    for of in judged {
        let line = line(of);
        assert!(lines.contains(&line), "{PAGE} has no line {line}");
    }
}

/// Fails unless the page has the answer of each row, and no other; what was measured is left to the long run.
pub(super) fn has_answers_of(rows: &[Row]) {
    let lines = lines();
    let mut starts: Vec<String> = rows.iter().map(start).collect();
    let silent = rows.iter().filter(|row| row.answer == Answer::Silent);
    starts.extend(silent.map(start));
    for start in &starts {
        let has = lines.iter().any(|line| line.starts_with(start));
        assert!(has, "{PAGE} has no line {start}");
    }
    let listed = lines.iter().filter(|line| line.matches('|').count() == 7);
    let heads =
        2 * (KINDS.len() + usize::from(rows.iter().any(|row| row.answer == Answer::Silent)));
    assert_eq!(
        listed.count(),
        starts.len() + heads,
        "{PAGE} has lines of no row"
    );
}
