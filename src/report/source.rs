//! Where numbers of a page come from: marks in its HTML, by which a test holds each number against its product.
//!
//! An element with `data-from` lists, for each number of its text in their order, a place in the products beside the
//! page: `<document>#<JSON pointer>`, or the pointer alone, below the `data-in` of the table's row. A leading `|` stands
//! for the size of the value, a trailing `*<factor>` for another unit. Nothing at that place is a dash.

use super::html::{escape, from_places};

/// `text`, whose numbers are those at `places`, as HTML.
pub(super) fn told(text: &str, places: &str) -> String {
    format!("<span{}>{}</span>", from_places(places), escape(text))
}

/// A paragraph of `words` with a number at each `{}`, told by its place in the products; a number without a place is
/// a word.
pub(super) fn sentence(words: &str, numbers: &[(String, &str)]) -> String {
    format!("<p>{}</p>\n", filled(words, numbers))
}

/// The same as a part of a text, in HTML.
pub(super) fn filled(words: &str, numbers: &[(String, &str)]) -> String {
    let mut pieces = words.split("{}");
    let mut html = escape(pieces.next().unwrap_or_default());
    for (piece, (number, place)) in pieces.zip(numbers) {
        html += &match *place {
            "" => escape(number),
            place => told(number, place),
        };
        html += &escape(piece);
    }
    html
}

/// A member's name as a part of a JSON pointer; a space, which stands between places, as in addresses.
pub(super) fn member(name: &str) -> String {
    name.replace('~', "~0")
        .replace('/', "~1")
        .replace('%', "%25")
        .replace(' ', "%20")
}
