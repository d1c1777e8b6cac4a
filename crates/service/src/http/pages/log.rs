//! The log of an attempt as a table: one row per stage with its time, one row per other event; the lines of a text that
//! is no event, such as the last words of a process, stay together.

use maud::{Markup, html};
use serde::Deserialize;

use super::parts::log_rows;

/// A line of a log, as far as it is shown.
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct Line {
    timestamp: String,
    level: String,
    message: String,
    stage: Option<String>,
    seconds: Option<f64>,
    products: Option<u64>,
    cut_bytes: Option<u64>,
}

/// A row of the table.
#[derive(Debug, Default, PartialEq)]
struct Row {
    /// Time of day, UTC.
    time: String,
    stage: Option<String>,
    seconds: Option<f64>,
    text: String,
    /// `warning` or `error`.
    level: Option<&'static str>,
    /// Whether it is a stage that has not ended yet.
    runs: bool,
}

/// The rows of a piece of a log; the rest of a line whose start is missing is dropped.
fn rows(text: &str, from_start: bool) -> Vec<Row> {
    let text = match text.split_once('\n') {
        Some((_, whole)) if !from_start => whole,
        _ => text,
    };
    let mut rows: Vec<Row> = Vec::new();
    let mut in_plain_text = false;
    for line in text.lines() {
        let Ok(line) = serde_json::from_str::<Line>(line) else {
            match rows.last_mut().filter(|_| in_plain_text) {
                Some(row) => row.text = format!("{}\n{line}", row.text),
                None if line.is_empty() => continue,
                None => rows.push(Row {
                    text: line.to_owned(),
                    ..Row::default()
                }),
            }
            in_plain_text = true;
            continue;
        };
        in_plain_text = false;
        if let (Some(stage), Some(seconds)) = (&line.stage, line.seconds) {
            let is_it = |row: &&mut Row| row.runs && row.stage.as_ref() == Some(stage);
            if let Some(row) = rows.iter_mut().rev().find(is_it) {
                (row.seconds, row.runs) = (Some(seconds), false);
                continue;
            }
        }
        rows.push(row(line));
    }
    rows
}

fn row(line: Line) -> Row {
    let reason = line.message.strip_prefix("running: ");
    let mut text = match (line.cut_bytes, reason) {
        (Some(bytes), _) => format!("{bytes} bytes of the log were not kept"),
        (None, Some(reason)) => reason.to_owned(),
        (None, None) => line.message.clone(),
    };
    if let Some(products) = line.products {
        text = format!("{text}: {products} products");
    }
    Row {
        time: line.timestamp.get(11..19).unwrap_or_default().to_owned(),
        runs: reason.is_some() && line.stage.is_some(),
        stage: line.stage,
        seconds: line.seconds,
        text,
        level: match &*line.level {
            "WARN" => Some("warning"),
            "ERROR" => Some("error"),
            _ => None,
        },
    }
}

/// The table of a piece of a log.
pub(super) fn log_table(text: &str, from_start: bool, ended: bool) -> Markup {
    let rows = rows(text, from_start);
    html! {
        @if rows.is_empty() { p { "The log is empty." } } @else {
            (log_rows("Stages and messages", &["Began, UTC", "Stage", "Seconds", "Message"], &html! {
                @for row in &rows {
                    tr {
                        td { (row.time) }
                        th scope="row" { (row.stage.as_deref().unwrap_or("–")) }
                        td class="number" {
                            @match row.seconds { Some(seconds) => (format!("{seconds:.2}")), None if row.runs && !ended => "runs", None => "–" }
                        }
                        td class="long lines" { @if let Some(level) = row.level { span class=(if level == "error" { "word invalid" } else { "word remarks" }) { (level) " " } } (row.text) }
                    }
                }
            }))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stage_is_one_row_and_the_lines_of_a_text_stay_together() {
        let text = concat!(
            "e\":\"cut off\"}\n",
            r#"{"timestamp":"2026-03-01T01:00:00.1Z","level":"INFO","message":"running: no earlier output","stage":"register/E02-00665"}"#,
            "\n",
            r#"{"timestamp":"2026-03-01T01:00:02.5Z","level":"INFO","message":"done","stage":"register/E02-00665","seconds":2.4}"#,
            "\n",
            r#"{"timestamp":"2026-03-01T01:00:03Z","level":"WARN","message":"first\nsecond"}"#,
            "\n",
            r#"{"timestamp":"2026-03-01T01:00:04Z","level":"ERROR","message":"lost"}"#,
            "\nthread panicked\n  at line 1\n{\"cut_bytes\":70}\n",
        );
        let rows = rows(text, false);
        let found: Vec<(&str, Option<f64>, Option<&str>)> = rows
            .iter()
            .map(|row| (&*row.text, row.seconds, row.level))
            .collect();
        assert_eq!(
            found,
            [
                ("no earlier output", Some(2.4), None),
                ("first\nsecond", None, Some("warning")),
                ("lost", None, Some("error")),
                ("thread panicked\n  at line 1", None, None),
                ("70 bytes of the log were not kept", None, None),
            ]
        );
        assert_eq!(
            (&*rows[0].time, rows[0].stage.as_deref(), rows[0].runs),
            ("01:00:00", Some("register/E02-00665"), false)
        );
    }
}
