//! Pieces of HTML: every text passes through [`escape`].

use std::fmt::Write as _;

/// Colours, sizes and nothing else: the page has no scripts.
const STYLE: &str = "\
:root{color-scheme:light}\
body{margin:0 auto;max-width:1120px;padding:1rem;font:15px/1.5 system-ui,sans-serif;color:#222;background:#fff}\
h1{font-size:1.5rem;margin:.2rem 0}h2{font-size:1.15rem;margin:2rem 0 .5rem;border-bottom:1px solid #ddd}\
p,ul{margin:.4rem 0;max-width:52rem}\
.verdict{padding:.7rem 1rem;border-left:6px solid;margin:1rem 0;max-width:none}\
.valid{border-color:#2a7d46;background:#eef7f0}.invalid{border-color:#b3261e;background:#fbeeed}\
.wide{overflow-x:auto;margin:.6rem 0}\
table{border-collapse:collapse;font-size:.85rem;font-variant-numeric:tabular-nums}\
th,td{padding:.25rem .6rem;border-bottom:1px solid #e4e4e4;text-align:left;vertical-align:top}\
th{background:#f5f5f5;font-weight:600}td.number,th.number{text-align:right;white-space:nowrap}\
tr.invalid td{background:#fbeeed}\
figure{margin:1rem 0}svg{width:100%;max-width:900px;height:auto;border:1px solid #eee}\
figcaption{font-size:.85rem;color:#444}\
.key{white-space:nowrap;margin-right:1rem}.key i{display:inline-block;width:.7em;height:.7em;margin-right:.3em}\
footer{margin-top:3rem;font-size:.8rem;color:#666}";

/// `text` with the five characters that HTML reads as markup replaced.
pub(super) fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            '\'' => escaped.push_str("&#39;"),
            _ => escaped.push(character),
        }
    }
    escaped
}

/// The whole page; `body` is HTML.
pub(super) fn page(title: &str, body: &str) -> String {
    let title = escape(title);
    let version = env!("CARGO_PKG_VERSION");
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>{title} – areograph</title>\n<style>{STYLE}</style>\n</head>\n<body>\n\
         <h1>{title}</h1>\n{body}\
         <footer>areograph {version}; what was read and written, with hashes and time, is in \
         manifest.json beside this folder.</footer>\n</body>\n</html>\n"
    )
}

/// A section with a heading; `body` is HTML.
pub(super) fn section(heading: &str, body: &str) -> String {
    format!(
        "<section>\n<h2>{}</h2>\n{body}</section>\n",
        escape(heading)
    )
}

/// A paragraph of text.
pub(super) fn paragraph(text: &str) -> String {
    format!("<p>{}</p>\n", escape(text))
}

/// A list of texts; nothing for none.
pub(super) fn list<T: AsRef<str>>(items: &[T]) -> String {
    if items.is_empty() {
        return String::new();
    }
    let items: Vec<String> = items
        .iter()
        .map(|item| format!("<li>{}</li>\n", escape(item.as_ref())))
        .collect();
    format!("<ul>\n{}</ul>\n", items.concat())
}

/// A table being filled row by row; cells are text.
pub(super) struct Table {
    html: String,
    numbers: &'static [bool],
}

impl Table {
    /// A table with these column heads; `true` in `numbers` sets a column flush right.
    pub(super) fn new(heads: &[&str], numbers: &'static [bool]) -> Self {
        let mut table = Self {
            html: "<div class=\"wide\"><table>\n".to_owned(),
            numbers,
        };
        table.line("th", "", heads);
        table
    }

    fn line<T: AsRef<str>>(&mut self, tag: &str, class: &str, cells: &[T]) {
        let cells: Vec<String> = cells
            .iter()
            .enumerate()
            .map(|(column, cell)| {
                let number = self.numbers.get(column).copied().unwrap_or_default();
                let class = if number { " class=\"number\"" } else { "" };
                format!("<{tag}{class}>{}</{tag}>", escape(cell.as_ref()))
            })
            .collect();
        // Writing to a string cannot fail.
        let _ = writeln!(self.html, "<tr{class}>{}</tr>", cells.concat());
    }

    /// Adds a row, tinted when it is not `valid`.
    pub(super) fn row<T: AsRef<str>>(&mut self, valid: bool, cells: &[T]) {
        let class = if valid { "" } else { " class=\"invalid\"" };
        self.line("td", class, cells);
    }

    /// The finished table.
    pub(super) fn finish(self) -> String {
        self.html + "</table></div>\n"
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_stays_text() {
        let mut table = Table::new(&["<b>"], &[true]);
        table.row(false, &["<script>alert('&\"')</script>"]);
        assert_eq!(
            table.finish(),
            "<div class=\"wide\"><table>\n<tr><th class=\"number\">&lt;b&gt;</th></tr>\n\
             <tr class=\"invalid\"><td class=\"number\">&lt;script&gt;alert(&#39;&amp;&quot;&#39;)\
             &lt;/script&gt;</td></tr>\n</table></div>\n"
        );
    }
}
