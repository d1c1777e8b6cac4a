//! Sources of the numbers of a page: marks in its HTML, by which a test compares each number with its product.
//!
//! An element with `data-from` lists, for each number of its text in their order, a place in the products beside the
//! page: `<document>#<JSON pointer>`, or the pointer alone, below the `data-in` of the table's row. A leading `|`
//! stands for the size of the value, a trailing `*<factor>` for another unit. A missing value is a dash.

use maud::{Markup, html};

use super::html::Cell;

/// `text`, whose numbers are those at `places`.
pub(super) fn traced(text: &str, places: &str) -> Markup {
    html! { span data-from=(places) { (text) } }
}

/// A paragraph of `words` with a number at each `{}`, with its place in the products; a number without a place is
/// a word.
pub(super) fn sentence(words: &str, numbers: &[(String, &str)]) -> Markup {
    html! { p { (filled(words, numbers)) } }
}

/// A sentence as a part of a text.
pub(super) fn filled(words: &str, numbers: &[(String, &str)]) -> Markup {
    let mut pieces = words.split("{}");
    html! {
        (pieces.next().unwrap_or_default())
        @for (piece, (number, place)) in pieces.zip(numbers) {
            @if place.is_empty() { (number) } @else { (traced(number, place)) }
            (piece)
        }
    }
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
