//! The minus sign of numbers in texts; numbers that programs read keep their hyphen.
//!
//! ```
//! use areograph_base::minus::with_minus;
//!
//! assert_eq!(with_minus("-1.2 m along E02-00665"), "−1.2 m along E02-00665");
//! ```

/// The minus sign of all texts.
pub const MINUS: char = '\u{2212}';

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
