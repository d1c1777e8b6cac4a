//! Duplicate shots: which files contain the same shots, and which files are copies of others.
//!
//! Only this module decides whether shots of two files are the same shot. Within a file, its chronology
//! (`pedr/chronology.rs`) withholds records that repeat others.
//!
//! Two files with common shots are rejected unless one is a copy of the other; `pedr search` marks rows out of order.
//! Within a file, the longest chain of frames without a common shot is kept. Rows of tables that repeat a shot are
//! counted once (`table_rows.rs`).

mod table_rows;

use std::collections::BTreeMap;

use areograph_base::body::Datum;

pub use table_rows::{Repetition, TableRows};

/// Shots of two files at most this far apart are the same shot, seconds: half the 0.1 s between two shots of the laser,
/// plus half the microsecond resolution of PEDR times.
///
/// A distance of exactly half counts as the same shot: it is not nearer to any other shot, and a user can resolve a
/// rejection but cannot see a shot that is counted twice. The half microsecond makes the result independent of the
/// rounding of tag differences. Successive shots of a file never meet the limit: frames of the archive are 2 s apart to
/// within a microsecond, and the clock that separates their shots is accurate to 5e-4. A later version of a file may
/// have slightly shifted tags.
pub const SAME_SHOT_S: f64 = 0.050_000_5;

/// Longest pause within a span, seconds: one missing frame of 2 s leaves 2.1 s between two shots. Shots missing within
/// a frame had no return or were not requested; another version of that frame may contain them.
const PAUSE_S: f64 = 2.05;

/// Successive shots of a file without a missing frame between them; for a single shot both ends are its tag.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Span {
    /// Number of the file.
    pub file: usize,
    /// Time tag of the first shot, ET seconds.
    pub first_s: f64,
    /// Time tag of the last shot, ET seconds.
    pub last_s: f64,
}

impl Span {
    /// A span of a single shot.
    ///
    /// * `tag_s` – its time tag, ET seconds
    #[must_use]
    pub const fn of_shot(file: usize, tag_s: f64) -> Self {
        Self {
            file,
            first_s: tag_s,
            last_s: tag_s,
        }
    }

    /// Appends the next shot of the file, unless a frame is missing before it.
    ///
    /// * `tag_s` – its time tag, ET seconds
    fn extend(&mut self, tag_s: f64) -> bool {
        let goes_on = (0.0..=PAUSE_S).contains(&(tag_s - self.last_s));
        if goes_on {
            self.last_s = tag_s;
        }
        goes_on
    }
}

/// The spans of a file.
///
/// * `tags_s` – time tags of its shots in order, ET seconds
#[must_use]
pub fn spans(file: usize, tags_s: impl IntoIterator<Item = f64>) -> Vec<Span> {
    let mut spans: Vec<Span> = Vec::new();
    for tag_s in tags_s {
        if !spans.last_mut().is_some_and(|last| last.extend(tag_s)) {
            spans.push(Span::of_shot(file, tag_s));
        }
    }
    spans
}

/// Spans of all shots so far: a few per revolution, independent of the number of shots.
#[derive(Debug, Clone, Default)]
pub struct Seen {
    /// In order of time; spans of different files have no common shot.
    spans: Vec<Span>,
    /// Index of the span of the last shot.
    at: usize,
}

impl Seen {
    /// The file that also contains a shot of `span`; of several, the one with the earliest shots.
    #[must_use]
    pub fn holder(&self, span: &Span) -> Option<usize> {
        let end = (self.spans).partition_point(|other| other.first_s - span.last_s <= SAME_SHOT_S);
        let near = self.spans[..end].iter().rev();
        near.take_while(|other| span.first_s - other.last_s <= SAME_SHOT_S)
            .filter(|other| other.file != span.file)
            .last()
            .map(|other| other.file)
    }

    /// Adds a span without a [`holder`](Self::holder).
    pub fn add(&mut self, span: Span) {
        self.at = (self.spans).partition_point(|other| other.first_s <= span.first_s);
        self.spans.insert(self.at, span);
    }

    /// Appends the next shot, file by file, and returns the earlier file that also contains it.
    ///
    /// * `tag_s` – its time tag, ET seconds
    pub fn take(&mut self, file: usize, tag_s: f64) -> Option<usize> {
        // Nearly every shot continues the current span.
        let next_s = (self.spans.get(self.at + 1)).map_or(f64::INFINITY, |next| next.first_s);
        if let Some(last) = self.spans.get_mut(self.at)
            && last.file == file
            && next_s - tag_s > SAME_SHOT_S
            && last.extend(tag_s)
        {
            return None;
        }
        let shot = Span::of_shot(file, tag_s);
        let holder = self.holder(&shot);
        if holder.is_some() {
            return holder;
        }
        let after = (self.spans).partition_point(|other| other.first_s <= tag_s);
        let own = after.checked_sub(1).filter(|at| {
            let before = &mut self.spans[*at];
            // Files whose records are out of order return to earlier spans.
            before.file == file && (tag_s <= before.last_s || before.extend(tag_s))
        });
        match own {
            Some(at) => self.at = at,
            None => self.add(shot),
        }
        None
    }

    /// Appends the next shots of a file until an earlier file also contains one of them; returns its row, counted from
    /// 0, and that file.
    ///
    /// * `tags_s` – their time tags, ET seconds
    pub fn take_all(
        &mut self,
        file: usize,
        tags_s: impl IntoIterator<Item = f64>,
    ) -> Option<(usize, usize)> {
        let mut rows = tags_s.into_iter().enumerate();
        rows.find_map(|(row, tag_s)| Some((row, self.take(file, tag_s)?)))
    }
}

/// The earliest file with the same bytes and the same datum.
#[derive(Debug, Clone, Default)]
pub struct Copies(BTreeMap<(String, Datum), usize>);

impl Copies {
    /// The earlier file that file `index` is a copy of.
    ///
    /// * `blake3` – hash of its bytes, hexadecimal
    /// * `datum` – datum of its coordinates
    pub fn original_of(&mut self, index: usize, blake3: &str, datum: Datum) -> Option<usize> {
        let first = *(self.0.entry((blake3.to_owned(), datum))).or_insert(index);
        (first != index).then_some(first)
    }
}

#[cfg(test)]
mod tests {
    use areograph_testing::shot_cases::CASES;

    use super::*;

    #[test]
    fn shots_one_by_one_and_spans_give_the_same() {
        for case in CASES {
            let mut files = 0..case.files.len();
            let mut seen = Seen::default();
            let shared = files.find_map(|file| {
                let (_, other) = seen.take_all(file, case.tags_s(file))?;
                Some([other, file])
            });
            assert_eq!(shared, case.shared, "{}: by shot", case.name);
            let files = 0..case.files.len();
            let mut seen = Seen::default();
            let shared = files
                .flat_map(|file| spans(file, case.tags_s(file)))
                .find_map(|span| {
                    let holder = seen.holder(&span);
                    if holder.is_none() {
                        seen.add(span);
                    }
                    Some([holder?, span.file])
                });
            assert_eq!(shared, case.shared, "{}: by span", case.name);
        }
    }

    #[test]
    fn an_archive_takes_few_spans() {
        let mut seen = Seen::default();
        for shot in 0..100_000_u32 {
            let file = usize::from(shot >= 50_000);
            assert_eq!(seen.take(file, f64::from(shot) * 0.1), None);
        }
        assert_eq!(seen.spans.len(), 2);
    }

    #[test]
    fn a_copy_has_the_bytes_and_the_datum_of_an_earlier_file() {
        let mut copies = Copies::default();
        let files = [
            ("aa", Datum::Iau1991, None),
            ("aa", Datum::Iau2000, None),
            ("bb", Datum::Iau2000, None),
            ("aa", Datum::Iau2000, Some(1)),
            ("aa", Datum::Iau1991, Some(0)),
        ];
        for (index, (blake3, datum, original)) in files.into_iter().enumerate() {
            assert_eq!(
                copies.original_of(index, blake3, datum),
                original,
                "{index}"
            );
        }
    }
}
