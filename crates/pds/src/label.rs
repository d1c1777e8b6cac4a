//! Labels in the Object Description Language of PDS3 and its PVL dialect of ISIS: `KEY = value`,
//! `OBJECT = …`/`END_OBJECT`, `GROUP = …`/`END_GROUP`, `END`.
//!
//! The parser is tolerant: text that is not an assignment is set aside, so that binary data may follow a label and the
//! valid part of a damaged one is kept.

mod scanner;

use areograph_base::error::Cause;
use scanner::Scanner;

/// Bytes of a file that are parsed; labels have a few kilobytes.
pub const LABEL_BYTES_MAX: usize = 1 << 20;
/// Lines without an assignment that are kept.
const UNREAD_MAX: usize = 8;
/// Start of the mark of an SFDU, which precedes some labels.
const SFDU: &str = "CCSD";

/// One `KEY = value` of a label.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Entry {
    /// Name of the enclosing object or group, upper case; empty outside of any.
    pub group: String,
    /// Number of that object or group, counted from 1 in the order of their openings; 0 outside of any.
    pub block: usize,
    /// The keyword in upper case.
    pub key: String,
    /// The value without quotes and unit, white space across line ends reduced to one blank.
    pub value: String,
    /// The unit in `<>`, lower case.
    pub unit: Option<String>,
}

impl Entry {
    /// The value with its unit, as written.
    #[must_use]
    pub fn written(&self) -> String {
        match &self.unit {
            Some(unit) => format!("{} <{unit}>", self.value),
            None => self.value.clone(),
        }
    }
}

/// A parsed label.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Label {
    /// The assignments in the order of the file.
    pub entries: Vec<Entry>,
    /// Whether the statement `END` follows them.
    pub ended: bool,
    /// The first lines before it with text that is not a statement.
    pub unread: Vec<UnreadLine>,
}

/// Text in a label that is not a statement.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct UnreadLine {
    /// Its line, from 1.
    pub line: usize,
    /// The text up to the end of the line, shortened.
    pub text: String,
}

/// An invalid label.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error, Cause)]
#[cause(Input)]
pub enum LabelError {
    /// No assignment.
    #[error(
        "no label found: expected lines of the form KEY = value in the first {LABEL_BYTES_MAX} bytes"
    )]
    #[cause("give a PDS3 label (.lbl, .imq) or an ISIS label (.lbl, .cub)")]
    NoLabel,
    /// An invalid value.
    #[error("{key} is {value:?}; expected {expected}")]
    #[cause("correct the label, or add the key to the image's table in the configuration")]
    Value {
        /// The keyword.
        key: String,
        /// Its value.
        value: String,
        /// Expected value.
        expected: &'static str,
    },
    /// No statement marks the end of the label.
    #[error("the label has no END; expected this statement after the last line")]
    #[cause("fetch the file again: its label is truncated or damaged")]
    NoEnd,
    /// Two values under one keyword.
    #[error("{key} appears in the label as {first:?} and as {second:?}; expected one value")]
    #[cause("determine the correct value, and keep only this value in the label")]
    Twice {
        /// The keyword.
        key: String,
        /// Its first value.
        first: String,
        /// The first one that differs from it.
        second: String,
    },
    /// An image of another mission or target, or one that is map-projected.
    #[error("{key} is {value:?}; expected {expected}")]
    #[cause(
        "give the label of an unprojected image of Mars that was taken by the camera's spacecraft"
    )]
    OtherImage {
        /// The keyword.
        key: String,
        /// Its value.
        value: String,
        /// Expected value.
        expected: &'static str,
    },
    /// Two values that belong to different images.
    #[error("{} is {:?}, but {} is {:?}; expected values of one image", .keys[0], .values[0], .keys[1], .values[1])]
    #[cause(
        "check that files and labels are not exchanged or renamed; one of them belongs to another image"
    )]
    Contradiction {
        /// Their keywords.
        keys: [String; 2],
        /// The values.
        values: [String; 2],
    },
    /// Another instrument's image.
    #[error("instrument is {found:?}; expected {}", listed(known))]
    #[cause(
        "give an image of a camera known to areograph; in a site, `instrument` in the image's table can also name an \
         instrument file"
    )]
    Instrument {
        /// Instrument and filter of the label.
        found: String,
        /// Instruments of the known cameras.
        known: Vec<String>,
    },
}

/// `a, b or c`.
fn listed(words: &[String]) -> String {
    match words {
        [] => "a picture or an ISIS cube, since no camera is known here".to_owned(),
        [first @ .., before, last] => [first, &[format!("{before} or {last}")]]
            .concat()
            .join(", "),
        _ => words.concat(),
    }
}

/// The label at the start of `bytes`, of which at most [`LABEL_BYTES_MAX`] are parsed.
///
/// # Errors
/// [`LabelError::NoLabel`] when there is no assignment.
pub fn parse(bytes: &[u8]) -> Result<Label, LabelError> {
    parse_whole(&bytes[..bytes.len().min(LABEL_BYTES_MAX)])
}

/// Parses text of any length, as control networks have.
///
/// # Errors
/// [`LabelError::NoLabel`] when there is no assignment.
pub fn parse_whole(bytes: &[u8]) -> Result<Label, LabelError> {
    let mut scanner = Scanner::new(bytes);
    let mut label = Label::default();
    let mut groups: Vec<(String, usize)> = Vec::new();
    let mut blocks = 0;
    // ISIS breaks long values after a hyphen.
    let mut is_broken = false;
    while let Some(word) = scanner.word() {
        let key = word.to_ascii_uppercase();
        let (before_word, after_word) = (scanner.word_at, scanner.at);
        if !(key.starts_with(|first: char| first.is_ascii_alphabetic() || first == '^')
            && scanner.take(b'='))
        {
            match key.as_str() {
                "END" => {
                    label.ended = true;
                    break;
                }
                "END_OBJECT" | "END_GROUP" | "ENDOBJECT" | "ENDGROUP" => drop(groups.pop()),
                // The rest of a value in nested brackets is left over as well.
                _ if key.starts_with(SFDU) || key.starts_with([',', ')', '}']) => {}
                _ if label.unread.len() < UNREAD_MAX => {
                    let (line, text) = scanner.line_at(before_word);
                    let goes_on = is_broken && text.ends_with('-');
                    if !is_broken {
                        label.unread.push(UnreadLine { line, text });
                    }
                    is_broken = goes_on;
                }
                _ => {}
            }
            // The rest of the line is no assignment either: the mark of an SFDU, or invalid text.
            scanner.at = after_word;
            scanner.skip_line();
            continue;
        }
        let (value, unit) = scanner.value();
        is_broken = value.ends_with('-');
        match key.as_str() {
            "OBJECT" | "GROUP" | "BEGIN_OBJECT" | "BEGIN_GROUP" => {
                // Every entry repeats its group's name, so invalid text must not lengthen it.
                let name: String = value.chars().take(64).collect();
                blocks += 1;
                groups.push((name.to_ascii_uppercase(), blocks));
            }
            "END_OBJECT" | "END_GROUP" | "ENDOBJECT" | "ENDGROUP" => drop(groups.pop()),
            _ => {
                let (group, block) = groups.last().cloned().unwrap_or_default();
                label.entries.push(Entry {
                    group,
                    block,
                    key,
                    value,
                    unit,
                });
            }
        }
    }
    if label.entries.is_empty() {
        return Err(LabelError::NoLabel);
    }
    Ok(label)
}

impl Label {
    /// The first entry with this keyword (upper case), in any object.
    #[must_use]
    pub fn find(&self, key: &str) -> Option<&Entry> {
        self.entries.iter().find(|entry| entry.key == key)
    }

    /// The only value with this keyword (upper case), in any object; it may occur several times.
    ///
    /// # Errors
    /// [`LabelError::Twice`] for another value under the same keyword.
    pub fn only(&self, key: &str) -> Result<Option<&Entry>, LabelError> {
        only(self.entries.iter().filter(|entry| entry.key == key))
    }

    /// The only entry of a keyword directly in objects or groups of this name (upper case too).
    ///
    /// # Errors
    /// [`LabelError::Twice`] for another value under the same keyword.
    pub fn only_in(&self, group: &str, key: &str) -> Result<Option<&Entry>, LabelError> {
        let entries = self.entries.iter();
        only(entries.filter(|entry| entry.key == key && entry.group == group))
    }
}

fn only<'a>(mut entries: impl Iterator<Item = &'a Entry>) -> Result<Option<&'a Entry>, LabelError> {
    let first = entries.next();
    let differs = |entry: &&Entry| {
        first.is_some_and(|first| first.value != entry.value || first.unit != entry.unit)
    };
    match (first, entries.find(differs)) {
        (Some(first), Some(second)) => Err(LabelError::Twice {
            key: first.key.clone(),
            first: first.written(),
            second: second.written(),
        }),
        _ => Ok(first),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn entry(label: &Label, key: &str) -> (String, Option<String>) {
        let entry = label.find(key).unwrap();
        (entry.value.clone(), entry.unit.clone())
    }

    #[test]
    fn units_quotes_comments_and_nesting_are_understood() {
        let text = b"CCSD3ZF0000100000001NJPL3IF0PDSX00000001\r\n/* a comment = no */\r\n\
            A = 1.5 <MILLISECONDS> /* more */\r\nB = \"two\r\n   lines\"\r\n# C = 1\nC=(1, 2)\n\
            Object = IsisCube\n Group = Dimensions\n  Lines = 12\n End_Group\n D = 4<km>\nEnd_Object\n\
            E = '5'\nEND\nF = 6\n";
        let label = parse(text).unwrap();
        assert_eq!(
            entry(&label, "A"),
            ("1.5".into(), Some("milliseconds".into()))
        );
        assert_eq!(entry(&label, "B"), ("two lines".into(), None));
        assert_eq!(entry(&label, "C"), ("1, 2".into(), None));
        assert_eq!(entry(&label, "D"), ("4".into(), Some("km".into())));
        assert_eq!(entry(&label, "E"), ("5".into(), None));
        assert_eq!(label.find("F"), None);
        let lines = label.only_in("DIMENSIONS", "LINES").unwrap().unwrap();
        assert_eq!(lines.value, "12");
        assert_eq!(label.only_in("ISISCUBE", "LINES"), Ok(None));
        assert!(label.ended);
        let blocks = ["A", "LINES", "D", "E"].map(|key| label.find(key).unwrap().block);
        assert_eq!(blocks, [0, 2, 1, 0]);
        assert_eq!(label.unread, []);
    }

    #[test]
    fn text_that_is_no_statement_is_kept_with_its_line() {
        let label = parse(
            b"A = 1\r\nCLOCK ? \"6:028\"\r\nB = 2 metres\nC = ((1, 2), (3, 4))\nD = a-\n  b-\n  c\nEND\nD\n",
        );
        let unread = |line, text: &str| UnreadLine {
            line,
            text: text.to_owned(),
        };
        let expected = [unread(2, "CLOCK ? \"6:028\""), unread(3, "metres")];
        assert_eq!(label.unwrap().unread, expected);
    }

    #[test]
    fn what_is_no_label_is_refused() {
        for bytes in [&b""[..], b"END", b"\xFF\xD8\xFF\xE0\0\x10JFIF\0", b"= = ="] {
            assert_eq!(parse(bytes), Err(LabelError::NoLabel));
        }
        assert_eq!(parse(b"no assignment\nat all"), Err(LabelError::NoLabel));
    }

    #[test]
    fn one_keyword_has_one_value_and_a_whole_label_an_end() {
        let label = parse(b"A = 1\nOBJECT = X\nA = 1\nB = 2\nEND_OBJECT\nB = 3 <km>\n").unwrap();
        assert!(!label.ended);
        assert_eq!(label.only("A").unwrap().unwrap().value, "1");
        assert_eq!(label.only_in("X", "B").unwrap().unwrap().value, "2");
        assert_eq!(label.only("C"), Ok(None));
        assert_eq!(
            label.only("B").unwrap_err().to_string(),
            "B appears in the label as \"2\" and as \"3 <km>\"; expected one value"
        );
    }

    proptest! {
        #[test]
        fn any_bytes_are_parsed_or_refused(
            bytes in proptest::collection::vec(any::<u8>(), 0..600)
        ) {
            let _ = parse(&bytes);
        }

        #[test]
        fn any_mixture_of_label_pieces_is_parsed_or_refused(
            pieces in proptest::collection::vec(
                proptest::sample::select(vec![
                    "OBJECT", "END_OBJECT", "GROUP", "=", "\"", "'", "(", ")", "<", ">", "/*", "*/",
                    "#", "\n", "\r\n", " ", "KEY", "1.0", "END", "\0", "{", "}",
                ]),
                0..60,
            )
        ) {
            let _ = parse(pieces.concat().as_bytes());
        }
    }
}
