//! Pieces of HTML; `html!` escapes every text.

use std::borrow::Cow;

use maud::DOCTYPE;
pub(super) use maud::{Markup, PreEscaped, html};

use super::numbers::whole;

/// Style of all pages. Reports have no scripts; plots take their colours from here, so that they follow light and dark.
pub use areograph_base::style::STYLE;

/// Letters up to which a cell stays on one line.
const SHORT: usize = 28;
/// Rows up to which a table is not broken between two sheets of paper.
const ROWS_TOGETHER: usize = 10;
/// Columns up to which a long table is set beside itself on paper.
const COLUMNS_NARROW: usize = 2;

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
    body: Markup,
    /// How it is folded, if it is.
    fold: Option<Fold>,
}

/// A section that is unfolded on request, and on paper.
struct Fold {
    /// Stands beside the heading.
    note: Markup,
    /// Whether it is unfolded from the start.
    is_open: bool,
}

impl Section {
    /// A section named after its heading in links.
    pub(super) fn new(heading: &'static str, body: Markup) -> Self {
        Self::named(&slug(heading), heading, body)
    }

    /// A section with its own name in links.
    pub(super) fn named(anchor: &str, heading: impl Into<Cow<'static, str>>, body: Markup) -> Self {
        Self {
            anchor: anchor.to_owned(),
            heading: heading.into(),
            body,
            fold: None,
        }
    }

    /// The section, to be folded under its heading and a note; `is_open` from the start or not.
    pub(super) fn folded(mut self, note: Markup, is_open: bool) -> Self {
        self.fold = Some(Fold { note, is_open });
        self
    }

    fn html(&self) -> Markup {
        let Self {
            anchor,
            heading,
            body,
            fold,
        } = self;
        html! {
            section id=(anchor) {
                @match fold {
                    None => { h2 { (heading) } (body) }
                    Some(Fold { note, is_open }) => {
                        details.more.whole open[*is_open] { summary { h2 { (heading) } " " (note) } (body) }
                    }
                }
            }
        }
    }
}

/// The page: title, lead, then the sections that are not empty.
pub(super) fn page(title: &str, lead: &Markup, sections: &[Section]) -> String {
    let shown = sections.iter().filter(|section| !section.body.0.is_empty());
    let shown: Vec<&Section> = shown.collect();
    let page = html! {
        (DOCTYPE) "\n"
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                link rel="icon" href="data:,";
                title { (title) " – areograph" }
                (embedded_style())
            }
            body {
                header { h1 { (title) } }
                main {
                    (lead)
                    // Folded sections are their own list of contents.
                    @if shown.iter().any(|section| section.fold.is_none()) {
                        nav aria-label="Contents" {
                            ul { @for section in &shown { li { (link(&format!("#{}", section.anchor), &section.heading)) } } }
                        }
                    }
                    @for section in &shown { "\n" (section.html()) }
                }
                "\n" footer { "Made by areograph " (env!("CARGO_PKG_VERSION")) "." }
            }
        }
        "\n"
    };
    page.into_string()
}

/// The style inside a page.
pub(super) fn embedded_style() -> Markup {
    html! { style { "\n" (PreEscaped(STYLE)) } "\n" }
}

/// The box that is read first: a headline, then paragraphs and lists.
pub(super) fn verdict(tone: Tone, headline: &str, body: &Markup) -> Markup {
    html! { div.verdict.(tone.class()) { p { strong { (headline) } } (body) } }
}

/// A part that is unfolded on request, and on paper: evidence rather than result. Empty for an empty one.
pub(super) fn folded(title: &str, body: &Markup) -> Markup {
    folded_unless(false, title, body)
}

/// A folded part, unfolded from the start where it `matters`.
#[must_use]
pub fn folded_unless(matters: bool, title: &str, body: &Markup) -> Markup {
    html! {
        @if !body.0.is_empty() {
            details.more open[matters] { summary { (title) } (body) }
        }
    }
}

/// A paragraph of text; empty for an empty one.
#[must_use]
pub fn paragraph(text: &str) -> Markup {
    html! { @if !text.is_empty() { p { (text) } } }
}

/// A link to `place` named `text`.
#[must_use]
pub fn link(place: &str, text: &str) -> Markup {
    html! { a href=(place) { (text) } }
}

/// A list of texts; empty for no texts.
pub(super) fn list<T: AsRef<str>>(items: &[T]) -> Markup {
    html! { @if !items.is_empty() { ul { @for item in items { li { (item.as_ref()) } } } } }
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
    /// Other elements.
    Html(Markup),
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

impl From<Markup> for Cell {
    fn from(html: Markup) -> Self {
        Self::Html(html)
    }
}

/// A table being filled row by row; the first cell of a row is its head.
pub struct Table {
    caption: String,
    columns: &'static [Column],
    rows: Vec<Markup>,
    /// Whether cells carry their heads, for stacked layouts.
    cards: bool,
}

impl Table {
    /// A table with a caption and column heads.
    #[must_use]
    pub fn new(caption: &str, columns: &'static [Column]) -> Self {
        Self {
            caption: caption.to_owned(),
            columns,
            rows: Vec::new(),
            cards: false,
        }
    }

    /// A table whose rows become cards on a narrow screen.
    pub(super) fn of_cards(caption: &str, columns: &'static [Column]) -> Self {
        Self {
            cards: true,
            ..Self::new(caption, columns)
        }
    }

    /// Adds a row, tinted when it is not `valid`.
    pub fn row(&mut self, valid: bool, cells: impl IntoIterator<Item = Cell>) {
        self.row_of("", valid, cells);
    }

    /// Adds a row whose cells are from `place` in the products.
    pub fn row_of(&mut self, place: &str, valid: bool, cells: impl IntoIterator<Item = Cell>) {
        let within = Some(place).filter(|place| !place.is_empty());
        let class = (!valid).then_some("invalid");
        self.rows.push(html! {
            tr class=[class] data-in=[within] {
                @for (place, cell) in cells.into_iter().enumerate() { (self.cell(place, cell, None)) }
            }
        });
    }

    /// A cell, with the places of its numbers in the products.
    fn cell(&self, place: usize, cell: Cell, from: Option<&str>) -> Markup {
        let column = self.columns.get(place);
        let mut class = match column {
            Some(Column::Number(_)) => "number".to_owned(),
            _ => String::new(),
        };
        let mut style = None;
        let body = match cell {
            // Nested marks count once.
            Cell::Traced(cell, places) => return self.cell(place, *cell, from.or(Some(&places))),
            Cell::Html(html) => html,
            Cell::Plain(text) => {
                // Times and names are hard to read when broken; sentences must break.
                if text.chars().count() <= SHORT {
                    class += " short";
                }
                html! { (text) }
            }
            // Written so that NaN is beyond.
            Cell::Limited(text, share) if share <= 1.0 => {
                class += " limited";
                style = Some(format!("--share:{}%", (100.0 * share.max(0.0)).round()));
                html! { (text) }
            }
            Cell::Limited(text, _) => {
                class += " beyond";
                html! { span.hidden { "beyond the limit: " } "✗ " (text) }
            }
        };
        let head = column.filter(|_| self.cards);
        let head = head.map(|(Column::Text(head) | Column::Number(head))| head);
        html! {
            @if place == 0 {
                th scope="row" class=(class) data-from=[from] style=[style] { (body) }
            } @else {
                td data-head=[head] class=(class) data-from=[from] style=[style] { (body) }
            }
        }
    }

    /// The finished table.
    #[must_use]
    pub fn finish(self) -> Markup {
        let is_long = self.rows.len() > ROWS_TOGETHER;
        let is_narrow = is_long && self.columns.len() <= COLUMNS_NARROW;
        html! {
            // Scrolling elements must be reachable by keyboard, and then need a name.
            div.wide.brief[!is_long].narrow[is_narrow].cards[self.cards]
                tabindex="0" role="region" aria-label=(self.caption) {
                table {
                    caption { (self.caption) }
                    thead {
                        tr {
                            @for column in self.columns {
                                @match column {
                                    Column::Text(head) => { th scope="col" { (head) } }
                                    Column::Number(head) => { th.number scope="col" { (head) } }
                                }
                            }
                        }
                    }
                    tbody { @for row in self.rows { "\n" (row) } }
                }
            }
        }
    }
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
        let html = table.finish().0;
        assert!(!html.contains("<script") && !html.contains("<b>") && !html.contains("<i>"));
        assert!(html.contains("&lt;script&gt;alert('&amp;&quot;')&lt;/script&gt;"));
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
        let html = table.finish().0;
        assert_eq!(html.matches("beyond the limit").count(), 2);
        assert_eq!(html.matches("--share:50%").count(), 1);
    }

    #[test]
    fn evidence_is_folded_unless_it_matters() {
        let body = html! { p { "c" } };
        assert_eq!(folded("Tables", &Markup::default()).0, "");
        let folded = folded("a & b", &body).0;
        assert!(folded.starts_with("<details class=\"more\"><summary>a &amp; b"));
        let unfolded = folded_unless(true, "a", &body).0;
        assert!(unfolded.starts_with("<details class=\"more\" open>"));
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
            Section::new("One", html! { p { "1" } }),
            Section::new("Two words", Markup::default()),
        ];
        let page = page("T", &Markup::default(), &sections);
        assert!(page.contains("href=\"#one\"") && !page.contains("two-words"));
    }
}
