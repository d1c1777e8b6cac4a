//! Web pages and other texts in place of files, as messages quote them.

/// Most characters that a message quotes.
const QUOTED_MAX: usize = 240;

/// Whether bytes are the start of a web page, as hosts and networks send in place of a file.
pub(crate) fn is_page(start: &[u8]) -> bool {
    let start = start.strip_prefix(b"\xef\xbb\xbf").unwrap_or(start);
    let start = start.trim_ascii_start();
    let is = |word: &[u8]| {
        start
            .get(..word.len())
            .is_some_and(|start| start.eq_ignore_ascii_case(word))
    };
    is(b"<!doctype html") || is(b"<html")
}

/// The title of a page, else the start of a text, on one line.
pub(crate) fn excerpt(text: &str) -> String {
    let lower = text.to_ascii_lowercase();
    let title = lower.find("<title>").and_then(|at| {
        let start = at + "<title>".len();
        let end = lower.get(start..)?.find("</title>")?;
        text.get(start..start + end)
    });
    let words: Vec<&str> = title.unwrap_or(text).split_whitespace().collect();
    let line: String = words.join(" ");
    let mut quoted: String = line
        .chars()
        .filter(|letter| !letter.is_control())
        .take(QUOTED_MAX)
        .collect();
    if line.chars().count() > QUOTED_MAX {
        quoted.push('…');
    }
    quoted
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pages_are_known_by_their_start_and_quoted_by_their_title() {
        assert!(is_page(b"\xef\xbb\xbf \r\n<!DOCTYPE HTML PUBLIC>") && is_page(b"<HTML>"));
        assert!(!is_page(b"long_East,lat_North") && !is_page(b"<ht"));
        assert_eq!(
            excerpt("<html><TITLE> 503\n Service </title>x"),
            "503 Service"
        );
        assert_eq!(excerpt("a\u{7}b \u{1b}[2J"), "ab [2J");
        let long = excerpt(&"ä".repeat(1_000));
        assert_eq!(long.chars().count(), QUOTED_MAX + 1);
        // A title without an end.
        assert_eq!(excerpt("<title>a"), "<title>a");
    }
}
