//! Sources of the numbers of a page: marks in its HTML, by which a test compares each number with its product.
//!
//! An element with `data-from` lists, for each number of its text in their order, a place in the products beside the
//! page: `<document>#<JSON pointer>`, or the pointer alone, below the `data-in` of the table's row. A leading `|`
//! stands for the size of the value, a trailing `*<factor>` for another unit. A missing value is a dash.

use super::html::{Cell, escape, from_places};

/// `text`, whose numbers are those at `places`, as HTML.
pub(super) fn traced(text: &str, places: &str) -> String {
    format!("<span{}>{}</span>", from_places(places), escape(text))
}

/// A paragraph of `words` with a number at each `{}`, with its place in the products; a number without a place is
/// a word.
pub(super) fn sentence(words: &str, numbers: &[(String, &str)]) -> String {
    format!("<p>{}</p>\n", filled(words, numbers))
}

/// A sentence as a part of a text, in HTML.
pub(super) fn filled(words: &str, numbers: &[(String, &str)]) -> String {
    let mut pieces = words.split("{}");
    let mut html = escape(pieces.next().unwrap_or_default());
    for (piece, (number, place)) in pieces.zip(numbers) {
        html += &match *place {
            "" => escape(number),
            place => traced(number, place),
        };
        html += &escape(piece);
    }
    html
}

/// `cell` without its places, for a number that no product has.
pub(super) fn untraced(cell: Cell) -> Cell {
    match cell {
        Cell::Traced(cell, _) => untraced(*cell),
        cell => cell,
    }
}

/// A member's name as a part of a JSON pointer; a space, which separates places, is encoded as in addresses.
pub(super) fn member(name: &str) -> String {
    name.replace('~', "~0")
        .replace('/', "~1")
        .replace('%', "%25")
        .replace(' ', "%20")
}
