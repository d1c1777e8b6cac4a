//! Reads a report page back: sections, tables and the data of plots.

use std::collections::BTreeSet;

/// What a person sees first.
pub(crate) fn lead(page: &str) -> &str {
    page.split("<section").next().unwrap()
}

/// The section called `id`, as HTML.
pub(crate) fn section<'a>(page: &'a str, id: &str) -> &'a str {
    let start = page.split(&format!("<section id=\"{id}\">")).nth(1);
    start.unwrap().split("</section>").next().unwrap()
}

/// Rows of the table whose caption starts with `caption`, as text.
pub(crate) fn table(page: &str, caption: &str) -> Vec<Vec<String>> {
    let start = page.split(&format!("<caption>{caption}")).nth(1);
    let body = start.unwrap().split("<tbody>").nth(1).unwrap();
    let rows = body.split("</tbody>").next().unwrap().lines();
    rows.filter(|row| row.starts_with("<tr"))
        .map(|row| {
            let ends = row.replace("</th>", "\u{0}").replace("</td>", "\u{0}");
            let mut cells: Vec<String> = ends.split('\u{0}').map(text).collect();
            cells.pop();
            cells
        })
        .collect()
}

/// What stands between the tags.
pub(crate) fn text(html: &str) -> String {
    let (before, tags) = html.split_at(html.find('<').unwrap_or(html.len()));
    let outside = tags.split('<').map(|part| part.split_once('>'));
    let outside = outside.map(|part| part.map_or("", |(_, text)| text));
    [before].into_iter().chain(outside).collect()
}

/// A number of a page, whose minus is a proper one.
pub(crate) fn number(text: &str) -> f64 {
    text.replace('−', "-")
        .replace('\u{202f}', "")
        .parse()
        .unwrap()
}

/// The data of the plot called `id`, row by row.
pub(crate) fn csv(page: &str, id: &str) -> Vec<Vec<String>> {
    let start = format!("download=\"{id}.csv\" href=\"data:text/csv;charset=utf-8,");
    let encoded = page.split(&start).skip(1);
    let encoded = encoded.map(|rest| rest.split('"').next().unwrap());
    let encoded = encoded.collect::<Vec<_>>();
    assert_eq!(encoded.len(), 1, "{id}");
    let mut bytes = Vec::new();
    for (part, piece) in encoded[0].split('%').enumerate() {
        let rest = if part == 0 {
            piece
        } else {
            bytes.push(u8::from_str_radix(&piece[..2], 16).unwrap());
            &piece[2..]
        };
        bytes.extend(rest.bytes());
    }
    let text = String::from_utf8(bytes).unwrap();
    text.lines()
        .map(|line| line.split(',').map(str::to_owned).collect())
        .collect()
}

/// Names are unique, links lead somewhere, and every plot has words and data.
pub(crate) fn assert_complete(page: &str) {
    let between = |start: &'static str| {
        page.split(start)
            .skip(1)
            .map(|rest| rest.split('"').next().unwrap())
    };
    let ids: Vec<&str> = between(" id=\"").collect();
    let unique: BTreeSet<&str> = ids.iter().copied().collect();
    assert_eq!(ids.len(), unique.len(), "names inside the page are unique");
    for id in between("aria-labelledby=\"").flat_map(|ids| ids.split(' ')) {
        assert!(unique.contains(id), "{id}");
    }
    for anchor in between("href=\"#") {
        assert!(unique.contains(anchor), "{anchor}");
    }
    let plots = page.matches("<svg").count();
    assert_eq!(page.matches("<svg role=\"img\"").count(), plots);
    assert_eq!(page.matches("href=\"data:text/csv").count(), plots);
}
