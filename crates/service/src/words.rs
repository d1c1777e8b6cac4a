//! Counts and lists in sentences.

use std::fmt;

/// A count with its noun: `1 run`, `2 runs`.
#[must_use]
pub fn counted(count: impl fmt::Display, noun: &str) -> String {
    let count = count.to_string();
    let plural = if count == "1" { "" } else { "s" };
    format!("{count} {noun}{plural}")
}

/// Names in a sentence: `a`, `a and b`, `a, b and c`; empty without names.
#[must_use]
pub fn sentence(names: &[impl AsRef<str>]) -> String {
    let mut text = String::new();
    for (place, name) in names.iter().enumerate() {
        if place > 0 {
            let is_last = place + 1 == names.len();
            text.push_str(if is_last { " and " } else { ", " });
        }
        text.push_str(name.as_ref());
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_have_their_number() {
        assert_eq!(counted(0, "run"), "0 runs");
        assert_eq!(counted(1_i64, "run"), "1 run");
        assert_eq!(counted(11_usize, "run"), "11 runs");
    }

    #[test]
    fn lists_end_with_and() {
        assert_eq!(sentence(&[""; 0]), "");
        assert_eq!(sentence(&["a"]), "a");
        assert_eq!(sentence(&["a", "b"]), "a and b");
        assert_eq!(
            sentence(&["a".to_owned(), "b".to_owned(), "c".to_owned()]),
            "a, b and c"
        );
    }
}
