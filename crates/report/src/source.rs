//! Sources of the numbers of a page: marks in its HTML, by which a test compares each number with its product.
//!
//! An element with `data-from` lists, for each number of its text in order, a place in the products beside the
//! page: `<document>#<JSON pointer>`, or the pointer alone, below the `data-in` of the table's row. A leading `|`
//! stands for the size of the value, a trailing `*<factor>` for another unit. A missing value is a dash.

use super::html::{Cell, Markup, html};

/// `text`, whose numbers are those at `places`.
pub(super) fn traced(text: &str, places: &str) -> Markup {
    html! { span data-from=(places) { (text) } }
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
