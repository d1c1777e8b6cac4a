//! Pieces of HTML: every text passes through [`escape`].

use std::{borrow::Cow, fmt::Write as _};

use super::numbers::whole;

/// Style of all pages. Reports have no scripts; plots take their colours from here, so that they follow light and dark.
pub use areograph_base::style::STYLE;

/// Letters up to which a cell stays on one line.
const SHORT: usize = 28;
/// Rows up to which a table is not broken between two sheets of paper.
const ROWS_TOGETHER: usize = 10;
/// Columns up to which a long table is set beside itself on paper.
const COLUMNS_NARROW: usize = 2;

/// `text` with the five characters that HTML reads as markup replaced.
#[must_use]
pub fn escape(text: &str) -> String {
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

/// Rating, for colours; words state the same.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Tone {
    Good,
    Remarks,
    Bad,
}

impl Tone {
    /// The rating of a verdict, and the word for it.
    pub(super) const fn of(is_valid: bool, has_remarks: bool) -> (Self, &'static str) {
        match (is_valid, has_remarks) {
            (false, _) => (Self::Bad, "Invalid"),
            (true, true) => (Self::Remarks, "Valid with remarks"),
            (true, false) => (Self::Good, "Valid"),
        }
    }

    pub(super) const fn class(self) -> &'static str {
        match self {
            Self::Good => "valid",
            Self::Remarks => "remarks",
            Self::Bad => "invalid",
        }
    }
}

/// A section of a page, and its name in the list of contents.
pub(super) struct Section {
    /// Name in links.
    anchor: String,
    heading: Cow<'static, str>,
    body: String,
}

impl Section {
    /// A section with `body` as HTML, named after its heading in links.
    pub(super) fn new(heading: &'static str, body: String) -> Self {
        Self::named(&slug(heading), heading, body)
    }

    /// A section with its own name in links.
    pub(super) fn named(anchor: &str, heading: impl Into<Cow<'static, str>>, body: String) -> Self {
        Self {
            anchor: anchor.to_owned(),
            heading: heading.into(),
            body,
        }
    }
}

/// The page: title, lead (HTML), then the sections that are not empty.
pub(super) fn page(title: &str, lead: &str, sections: &[Section]) -> String {
    let title = escape(title);
    let version = env!("CARGO_PKG_VERSION");
    let shown = || sections.iter().filter(|section| !section.body.is_empty());
    let contents: String = shown()
        .map(|section| {
            format!(
                "<li><a href=\"#{}\">{}</a></li>\n",
                section.anchor,
                escape(&section.heading)
            )
        })
        .collect();
    let body: String = shown()
        .map(|section| {
            format!(
                "<section id=\"{}\">\n<h2>{}</h2>\n{}</section>\n",
                section.anchor,
                escape(&section.heading),
                section.body
            )
        })
        .collect();
    let nav = if contents.is_empty() {
        String::new()
    } else {
        format!("<nav aria-label=\"Contents\"><ul>\n{contents}</ul></nav>\n")
    };
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <link rel=\"icon\" href=\"data:,\">\n\
         <title>{title} – areograph</title>\n<style>\n{STYLE}</style>\n</head>\n<body>\n\
         <header>\n<h1>{title}</h1>\n</header>\n<main>\n{lead}{nav}{body}</main>\n\
         <footer>Made by areograph {version}.</footer>\n</body>\n</html>\n"
    )
}

/// The box that is read first: a headline, then paragraphs and lists as HTML.
pub(super) fn verdict(tone: Tone, headline: &str, body: &str) -> String {
    format!(
        "<div class=\"verdict {}\">\n<p><strong>{}</strong></p>\n{body}</div>\n",
        tone.class(),
        escape(headline)
    )
}

/// A heading inside a section.
pub(super) fn heading(text: &str) -> String {
    format!("<h3>{}</h3>\n", escape(text))
}

/// HTML that is unfolded on request, and on paper: evidence rather than result. Empty for empty HTML.
pub(super) fn folded(title: &str, html: &str) -> String {
    folded_unless(false, title, html)
}

/// A folded section, unfolded from the start where it `matters`.
#[must_use]
pub fn folded_unless(matters: bool, title: &str, html: &str) -> String {
    if html.is_empty() {
        return String::new();
    }
    let open = if matters { " open" } else { "" };
    format!(
        "<details class=\"more\"{open}><summary>{}</summary>\n{html}</details>\n",
        escape(title)
    )
}

/// A paragraph of text.
#[must_use]
pub fn paragraph(text: &str) -> String {
    if text.is_empty() {
        return String::new();
    }
    format!("<p>{}</p>\n", escape(text))
}

/// A link to `place` named `text`, as HTML.
#[must_use]
pub fn link(place: &str, text: &str) -> String {
    format!("<a href=\"{}\">{}</a>", escape(place), escape(text))
}

/// A list of texts; an empty string for an empty list.
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

/// Letters and digits of `text` in lower case, the rest as hyphens: a name inside a page or file.
pub(super) fn slug(text: &str) -> String {
    let words = text.split(|character: char| !character.is_alphanumeric());
    let words: Vec<String> = words
        .filter(|word| !word.is_empty())
        .map(str::to_lowercase)
        .collect();
    words.join("-")
}

/// A column of a table.
#[derive(Debug, Clone, Copy)]
pub enum Column {
    /// Words, flush left.
    Text(&'static str),
    /// Numbers, flush right.
    Number(&'static str),
}

/// Contents of a cell.
#[derive(Debug, Clone)]
pub enum Cell {
    /// Words or a number.
    Plain(String),
    /// A value with a limit: the used share of it, above 1 (or NaN) beyond it.
    Limited(String, f64),
    /// HTML.
    Html(String),
    /// A cell whose numbers are from products, see `source.rs`.
    Traced(Box<Self>, String),
}

impl Cell {
    /// The cell with the places of its numbers in the products, below the place of its row.
    #[must_use]
    pub fn traced(self, places: impl Into<String>) -> Self {
        Self::Traced(Box::new(self), places.into())
    }
}

impl From<&str> for Cell {
    fn from(text: &str) -> Self {
        Self::Plain(text.to_owned())
    }
}

impl From<&String> for Cell {
    fn from(text: &String) -> Self {
        Self::Plain(text.clone())
    }
}

impl From<String> for Cell {
    fn from(text: String) -> Self {
        Self::Plain(text)
    }
}

/// A table being filled row by row; the first cell of a row is its head.
pub struct Table {
    html: String,
    columns: &'static [Column],
    rows: usize,
    /// Whether cells carry their heads, for stacked layouts.
    cards: bool,
}

impl Table {
    /// A table with a caption and column heads.
    #[must_use]
    pub fn new(caption: &str, columns: &'static [Column]) -> Self {
        let heads: String = columns
            .iter()
            .map(|column| match column {
                Column::Text(head) => format!("<th scope=\"col\">{}</th>", escape(head)),
                Column::Number(head) => {
                    format!("<th scope=\"col\" class=\"number\">{}</th>", escape(head))
                }
            })
            .collect();
        let caption = escape(caption);
        // Scrolling elements must be reachable by keyboard, and then need a name.
        let html = format!(
            "<div class=\"wide\" tabindex=\"0\" role=\"region\" aria-label=\"{caption}\"><table>\n\
             <caption>{caption}</caption>\n<thead><tr>{heads}</tr></thead>\n<tbody>\n"
        );
        Self {
            html,
            columns,
            rows: 0,
            cards: false,
        }
    }

    /// A table whose rows become cards on a narrow screen.
    pub(super) fn of_cards(caption: &str, columns: &'static [Column]) -> Self {
        let mut table = Self::new(caption, columns);
        table.html = table
            .html
            .replacen("class=\"wide\"", "class=\"wide cards\"", 1);
        table.cards = true;
        table
    }

    /// Adds a row, tinted when it is not `valid`.
    pub fn row(&mut self, valid: bool, cells: impl IntoIterator<Item = Cell>) {
        self.row_of("", valid, cells);
    }

    /// Adds a row whose cells are from `place` in the products.
    pub fn row_of(&mut self, place: &str, valid: bool, cells: impl IntoIterator<Item = Cell>) {
        self.rows += 1;
        let class = if valid { "" } else { " class=\"invalid\"" };
        let class = class.to_owned() + &within(place);
        let cells: String = cells
            .into_iter()
            .enumerate()
            .map(|(place, cell)| match cell {
                Cell::Traced(cell, places) => self.cell(place, *cell, &from_places(&places)),
                cell => self.cell(place, cell, ""),
            })
            .collect();
        // Writing to a string cannot fail.
        let _ = writeln!(self.html, "<tr{class}>{cells}</tr>");
    }

    /// A cell, with the attribute that gives the source of its numbers.
    fn cell(&self, place: usize, cell: Cell, from: &str) -> String {
        let class = match self.columns.get(place) {
            Some(Column::Number(_)) => "number",
            _ => "",
        };
        let (tag, mut scope) = if place == 0 {
            ("th", " scope=\"row\"".to_owned())
        } else {
            ("td", String::new())
        };
        if let Some(Column::Text(head) | Column::Number(head)) =
            self.columns.get(place).filter(|_| self.cards && place > 0)
        {
            scope = format!(" data-head=\"{}\"", escape(head));
        }
        match cell {
            Cell::Limited(text, share) => limited(class, from, &text, share),
            Cell::Html(html) => format!("<{tag}{scope} class=\"{class}\"{from}>{html}</{tag}>"),
            Cell::Plain(text) => {
                // Times and names are hard to read when broken; sentences must break.
                let short = if text.chars().count() <= SHORT {
                    " short"
                } else {
                    ""
                };
                format!(
                    "<{tag}{scope} class=\"{class}{short}\"{from}>{}</{tag}>",
                    escape(&text)
                )
            }
            // Nested marks count once.
            Cell::Traced(cell, _) => self.cell(place, *cell, from),
        }
    }

    /// The finished table.
    #[must_use]
    pub fn finish(self) -> String {
        let html = self.html + "</tbody>\n</table></div>\n";
        let kind = match (
            self.rows > ROWS_TOGETHER,
            self.columns.len() > COLUMNS_NARROW,
        ) {
            (false, _) => "brief",
            (true, false) => "narrow",
            (true, true) => return html,
        };
        html.replacen("class=\"wide", &format!("class=\"wide {kind}"), 1)
    }
}

fn limited(class: &str, from: &str, text: &str, share: f64) -> String {
    let text = escape(text);
    // Written so that NaN is beyond.
    if share <= 1.0 {
        let per_cent = (100.0 * share.max(0.0)).round();
        format!("<td class=\"{class} limited\"{from} style=\"--share:{per_cent}%\">{text}</td>")
    } else {
        format!(
            "<td class=\"{class} beyond\"{from}><span class=\"hidden\">beyond the limit: </span>✗ {text}</td>"
        )
    }
}

/// The attribute of an element whose numbers are those at `places` of the products; see `source.rs`.
pub(super) fn from_places(places: &str) -> String {
    format!(" data-from=\"{}\"", escape(places))
}

/// The attribute of a row whose cells are from `place`; empty without a place.
fn within(place: &str) -> String {
    if place.is_empty() {
        return String::new();
    }
    format!(" data-in=\"{}\"", escape(place))
}

/// A number of things, in the plural where there are several.
pub(super) fn counted(count: usize, what: &str) -> String {
    let plural = match count {
        1 => "",
        _ if what.ends_with('s') => "es",
        _ => "s",
    };
    format!("{} {what}{plural}", whole(count))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_stays_text() {
        let mut table = Table::new("<i>", &[Column::Number("<b>")]);
        table.row(false, ["<script>alert('&\"')</script>".into()]);
        let html = table.finish();
        assert!(!html.contains("<script") && !html.contains("<b>") && !html.contains("<i>"));
        assert!(html.contains("&lt;script&gt;alert(&#39;&amp;&quot;&#39;)&lt;/script&gt;"));
        assert!(html.contains("<tr class=\"invalid\">"));
    }

    #[test]
    fn a_figure_beyond_its_limit_is_marked_and_said() {
        let columns = &[Column::Text("profile"), Column::Number("mean, m")];
        let mut table = Table::new("ranges", columns);
        let cells = |share| ["a".into(), Cell::Limited("12.3".to_owned(), share)];
        table.row(true, cells(0.5));
        table.row(false, cells(1.01));
        table.row(false, cells(f64::NAN));
        let html = table.finish();
        assert_eq!(html.matches("beyond the limit").count(), 2);
        assert_eq!(html.matches("--share:50%").count(), 1);
    }

    #[test]
    fn evidence_is_folded_unless_it_matters() {
        assert_eq!(folded("Tables", ""), "");
        assert!(
            folded("a & b", "<p>c</p>").starts_with("<details class=\"more\"><summary>a &amp; b")
        );
        assert!(folded_unless(true, "a", "<p>c</p>").starts_with("<details class=\"more\" open>"));
    }

    #[test]
    fn several_things_are_in_the_plural() {
        assert_eq!(counted(1, "pass"), "1 pass");
        assert_eq!(counted(2, "pass"), "2 passes");
        assert_eq!(counted(0, "shot"), "0 shots");
    }

    #[test]
    fn empty_sections_are_not_listed() {
        let sections = [
            Section::new("One", "<p>1</p>".to_owned()),
            Section::new("Two words", String::new()),
        ];
        let page = page("T", "", &sections);
        assert!(page.contains("href=\"#one\"") && !page.contains("two-words"));
    }
}
