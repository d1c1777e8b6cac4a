//! Tables and labels as text, and what is done to their numbers.

use serde::Deserialize;

/// A change of a number: multiplied, then added to; or another one in its place.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Number {
    #[serde(default = "one")]
    pub(super) multiply: f64,
    #[serde(default)]
    pub(super) add: f64,
    #[serde(default)]
    pub(super) set: Option<f64>,
}

const fn one() -> f64 {
    1.0
}

impl Number {
    pub(super) fn of(self, value: f64) -> f64 {
        self.set.unwrap_or(value * self.multiply + self.add)
    }
}

/// Rows of a table of text, all by default.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Rows {
    /// Those with this text in this column.
    #[serde(default)]
    of: Option<[String; 2]>,
    /// One in so many of them.
    #[serde(default)]
    one_in: Option<usize>,
    /// Only so many.
    #[serde(default)]
    first: Option<usize>,
}

/// A table of text with a head.
pub(super) struct Table {
    head: Vec<String>,
    pub(super) rows: Vec<Vec<String>>,
}

impl Table {
    pub(super) fn of(text: &str) -> Self {
        let cells = |line: &str| line.split(',').map(str::to_owned).collect::<Vec<_>>();
        let mut lines = text.lines().map(cells);
        Self {
            head: lines.next().unwrap(),
            rows: lines.collect(),
        }
    }

    pub(super) fn text(&self) -> String {
        let lines = std::iter::once(&self.head).chain(&self.rows);
        lines.map(|cells| cells.join(",") + "\n").collect()
    }

    pub(super) fn column(&self, name: &str) -> usize {
        let column = self.head.iter().position(|of| of == name);
        column.unwrap_or_else(|| panic!("no column {name} in {:?}", self.head))
    }

    /// Numbers of the chosen rows.
    pub(super) fn chosen(&self, chosen: &Rows) -> Vec<usize> {
        let of = chosen.of.as_ref();
        let of = of.map(|[column, text]| (self.column(column), text));
        let all = 0..self.rows.len();
        let all =
            all.filter(|row| of.is_none_or(|(column, text)| self.rows[*row][column] == *text));
        let all = all.step_by(chosen.one_in.unwrap_or(1));
        all.take(chosen.first.unwrap_or(usize::MAX)).collect()
    }
}

/// First number after a text and what is around it.
pub(super) fn number_after<'a>(text: &'a str, after: &str) -> [&'a str; 3] {
    let start = text.find(after).unwrap_or_else(|| panic!("no {after:?}")) + after.len();
    let is_part = |of: char| of.is_ascii_digit() || "+-.eEdD".contains(of);
    let start = start
        + text[start..]
            .find(|of: char| of.is_ascii_digit() || "+-.".contains(of))
            .unwrap();
    let length = text[start..]
        .find(|of| !is_part(of))
        .unwrap_or(text.len() - start);
    [
        &text[..start],
        &text[start..start + length],
        &text[start + length..],
    ]
}

/// Lines of a label with its times changed.
pub(super) fn with_times(text: &str, seconds: i64, utc_alone: bool) -> String {
    let line = |line: &str| match line.split('=').next().unwrap().trim() {
        "SPACECRAFT_CLOCK_START_COUNT" if !utc_alone => {
            let (key, count) = line.split_once('"').unwrap();
            let (clock, ticks) = count.split_once(':').unwrap();
            format!("{key}\"{}:{ticks}", clock.parse::<i64>().unwrap() + seconds)
        }
        "START_TIME" | "STOP_TIME" | "IMAGE_TIME" => {
            let (day, time) = line.rsplit_once('T').unwrap();
            let parts = time[..8]
                .split(':')
                .map(|part| part.parse::<i64>().unwrap());
            let late = parts.fold(0, |sum, part| 60 * sum + part) + seconds;
            assert!((0..86_400).contains(&late), "{line}");
            let (hours, minutes) = (late / 3_600, late / 60 % 60);
            format!(
                "{day}T{hours:02}:{minutes:02}:{:02}{}",
                late % 60,
                &time[8..]
            )
        }
        _ => line.to_owned(),
    };
    text.lines().map(|of| line(of) + "\r\n").collect()
}
