//! Texts for readers: the words of other bodies and altimeters, and the minus sign of their numbers.
//!
//! Texts are written for MOLA at Mars; [`Wording`] adapts them to the site. Numbers that programs read keep their
//! hyphen.
//!
//! `judge` adapts reasons, remarks and checks, `Table::in_words` the descriptions of columns, and the page its
//! sections. Text from a user or a file is unchanged.
//!
//! ```
//! use areograph_base::{body::Body, wording::{Wording, with_minus}};
//!
//! let lunar = Wording { body: Body::Moon, altimeter: "LOLA", has_tables: true, has_areoid: false };
//! assert_eq!(lunar.of("tie points above the MOLA surface"), "tie points above the LOLA surface");
//! assert_eq!(with_minus("-1.2 m along E02-00665"), "−1.2 m along E02-00665");
//! ```

use std::borrow::Cow;

use crate::body::Body;

/// The minus sign of all texts.
pub const MINUS: char = '\u{2212}';

/// The altimeter for which texts are written.
const ALTIMETER: &str = "MOLA";

/// Replacements in texts if shots come from tables, which are not PEDR files.
const TABLES: [(&str, &str); 4] = [
    ("PEDR files", "tables of shots"),
    ("PEDR file", "table of shots"),
    ("the PEDR", "the table of shots"),
    ("PEDR", "table of shots"),
];
/// Replacements if these contain no areoid.
const NO_AREOID: [(&str, &str); 2] = [
    ("the areoid", "the ellipsoid"),
    ("areoid radius", "radius of the ellipsoid"),
];

/// The words of a site.
#[derive(Debug, Clone, Copy)]
pub struct Wording<'a> {
    /// The body.
    pub body: Body,
    /// Name of the altimeter.
    pub altimeter: &'a str,
    /// Whether shots come from tables.
    pub has_tables: bool,
    /// Whether shots have heights above the areoid.
    pub has_areoid: bool,
}

impl Wording<'_> {
    /// `text` in these words; parts of longer names (a file, an identifier, a picture in a page) are kept.
    #[must_use]
    pub fn of<'a>(&self, text: impl Into<Cow<'a, str>>) -> Cow<'a, str> {
        let mut text = text.into();
        let mut say = |at_mars: &str, here: &str| {
            if let Some(said) = replaced(&text, at_mars, here) {
                text = Cow::Owned(said);
            }
        };
        if self.has_tables {
            for (at_mars, here) in TABLES {
                say(at_mars, here);
            }
        }
        if !self.has_areoid {
            for (at_mars, here) in NO_AREOID {
                say(at_mars, here);
            }
        }
        if self.altimeter != ALTIMETER {
            say(ALTIMETER, self.altimeter);
        }
        if self.body != Body::Mars {
            let names = self.body.names();
            say("areocentric", "planetocentric");
            say("areographic", "planetographic");
            say("IAU 2000", &names.short_frame);
            say("Mars-fixed", &format!("{}-fixed", names.name));
            say("Mars body-fixed", &format!("{} body-fixed", names.name));
            for before in ["of", "from", "to", "on", "around"] {
                let here = format!("{before} {}", names.in_text);
                say(&format!("{before} Mars"), &here);
            }
        }
        text
    }
}

/// `text` with `words` replaced wherever they occur as separate words; `None` if they do not.
fn replaced(text: &str, words: &str, by: &str) -> Option<String> {
    let of_name = |letter: char| letter.is_ascii_alphanumeric() || "_/+=".contains(letter);
    let (mut said, mut told) = (String::new(), 0);
    for (start, _) in text.match_indices(words) {
        let end = start + words.len();
        let before = text[..start].chars().next_back();
        let mut after = text[end..].chars();
        let joined_before = before.is_some_and(|letter| of_name(letter) || "-.".contains(letter));
        let joined_after = after.next().is_some_and(|letter| {
            let joins = "-.".contains(letter) && after.next().is_some_and(of_name);
            of_name(letter) || joins
        });
        if !joined_before && !joined_after {
            said.push_str(&text[told..start]);
            said.push_str(by);
            told = end;
        }
    }
    (told > 0).then(|| said + &text[told..])
}

/// A sentence with the minus sign before its numbers; hyphens in names, dates and exponents are kept.
#[must_use]
pub fn with_minus(sentence: &str) -> String {
    let mut written = String::with_capacity(sentence.len());
    let mut letters = sentence.chars().peekable();
    let mut before = ' ';
    while let Some(letter) = letters.next() {
        let is_sign = letter == '-'
            && matches!(before, ' ' | '(' | '[')
            && letters.peek().is_some_and(char::is_ascii_digit);
        written.push(if is_sign { MINUS } else { letter });
        before = letter;
    }
    written
}

/// A number with its sign and this number of decimals, for sentences; a value that rounds to zero has no sign.
#[must_use]
pub fn signed(value: f64, decimals: usize) -> String {
    let size = format!("{:.decimals$}", value.abs());
    let is_zero = !size.contains(|digit| matches!(digit, '1'..='9'));
    match value {
        _ if is_zero => size,
        value if value < 0.0 => format!("{MINUS}{size}"),
        _ => format!("+{size}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LUNAR: Wording = Wording {
        body: Body::Moon,
        altimeter: "LOLA",
        has_tables: true,
        has_areoid: false,
    };

    #[test]
    fn a_text_says_the_body_the_altimeter_and_where_shots_are_from() {
        for (at_mars, here) in [
            (
                "distance of the spacecraft from the centre of Mars, the file's orbit",
                "distance of the spacecraft from the centre of the Moon, the file's orbit",
            ),
            (
                "areocentric latitude, degrees, IAU 2000",
                "planetocentric latitude, degrees, mean Earth/polar axis",
            ),
            (
                "Orbit of the PEDR against kernels",
                "Orbit of the table of shots against kernels",
            ),
            (
                "radius minus areoid radius, metres",
                "radius minus radius of the ellipsoid, metres",
            ),
            ("areoid_radius_m", "areoid_radius_m"),
            (
                "PEDR_7.csv: 3 PEDR files of MOLA, image MOLA-7, <img src=\"data:a+MOLA/PEDR=\">, to Mars.",
                "PEDR_7.csv: 3 tables of shots of LOLA, image MOLA-7, <img src=\"data:a+MOLA/PEDR=\">, to the Moon.",
            ),
        ] {
            assert_eq!(LUNAR.of(at_mars), here);
            let at_mars_too = Wording {
                body: Body::Mars,
                altimeter: "MOLA",
                has_tables: false,
                has_areoid: true,
            };
            assert!(matches!(at_mars_too.of(at_mars), Cow::Borrowed(_)));
        }
        // A table of another altimeter at Mars.
        let table = Wording {
            body: Body::Mars,
            altimeter: "ALT",
            has_tables: true,
            has_areoid: false,
        };
        assert_eq!(
            table.of("MOLA, areocentric, IAU 2000"),
            "ALT, areocentric, IAU 2000"
        );
    }

    #[test]
    fn what_rounds_to_zero_has_no_sign() {
        let texts = [-0.4, 0.4, -1.15, 1.15].map(|value| signed(value, 0));
        assert_eq!(texts, ["0", "0", "−1", "+1"]);
        assert_eq!(signed(-0.117, 3), "−0.117");
    }

    #[test]
    fn sentences_have_one_minus_and_names_keep_their_hyphens() {
        assert_eq!(
            with_minus("E02-00665: 4 m off (-33 m up, -0.5 m across) - see 1999-05-04, 2e-9"),
            "E02-00665: 4 m off (−33 m up, −0.5 m across) - see 1999-05-04, 2e-9"
        );
    }
}
