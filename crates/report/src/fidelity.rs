//! The page that compares every number of the papers with areograph's.

use super::html::{Cell, Column, Markup, Section, Table, embedded_style, html, page, paragraph};

/// The page of this version, which `tests/products/fidelity.rs` makes and checks; it has the style of all pages, by a
/// link.
const FIDELITY_PAGE: &str = include_str!("../../../docs/fidelity.html");
/// From `docs/` to the style of all pages.
const LINKED_STYLE: &str = "<link rel=\"stylesheet\" href=\"../crates/base/src/style.css\">\n";
/// File of the page, in the folder that holds the sites' folders.
pub const FIDELITY_FILE: &str = "fidelity.html";

/// Contents of the page.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Fidelity {
    /// Introduction to the list, by paragraphs.
    pub rules: Vec<String>,
    /// Each kind of row with its counts, the strongest first.
    pub kinds: Vec<FidelityKind>,
    /// The papers.
    pub papers: Vec<FidelityPaper>,
}

/// A kind of row.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FidelityKind {
    /// The word.
    pub name: &'static str,
    /// Its meaning.
    pub meaning: &'static str,
    /// The word for agreement in a row of this kind; only evidence is met.
    pub agrees: &'static str,
    /// Rows that agree, that agree in part, that are explained, and without an areograph number.
    pub counts: [usize; 4],
}

impl FidelityKind {
    /// All its rows.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.counts.iter().sum()
    }
}

/// A paper.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FidelityPaper {
    /// Authors and year.
    pub name: &'static str,
    /// Subject and reference.
    pub citation: &'static str,
    /// Its published numbers, in its order.
    pub rows: Vec<FidelityRow>,
}

/// Numbers that a paper publishes in one place.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FidelityRow {
    /// Identifier.
    pub id: &'static str,
    /// The kind of number that stands beside the published ones.
    pub kind: &'static str,
    /// Section or table of the paper.
    pub place: &'static str,
    /// Description of the published numbers.
    pub what: &'static str,
    /// Its numbers, each with the published one, areograph's and the tolerance in a line.
    pub numbers: Vec<String>,
    /// Numbers that the paper does not publish, in the same form.
    pub derived: Vec<String>,
    /// Source of areograph's numbers.
    pub from: String,
    /// The verdict.
    pub verdict: &'static str,
    /// Remarks.
    pub note: &'static str,
}

/// The page for the folder of the page of all sites: in one file.
#[must_use]
pub fn published_fidelity_page() -> String {
    FIDELITY_PAGE.replacen(LINKED_STYLE, &embedded_style().0, 1)
}

/// The page for `docs/`.
#[must_use]
pub fn fidelity_page(fidelity: &Fidelity) -> String {
    let sections: Vec<Section> = fidelity.papers.iter().map(section).collect();
    let lead = html! {
        @for rule in &fidelity.rules { (paragraph(rule)) }
        (kinds(fidelity))
    };
    let page = page("Fidelity to the papers", &lead, &sections);
    page.replacen(&embedded_style().0, LINKED_STYLE, 1)
}

fn kinds(fidelity: &Fidelity) -> Markup {
    let mut table = Table::new(
        "Rows by kind",
        &[
            Column::Text("kind"),
            Column::Number("rows"),
            Column::Number("agree"),
            Column::Number("in part"),
            Column::Number("explained"),
            Column::Number("not computed"),
            Column::Text("meaning"),
        ],
    );
    for kind in &fidelity.kinds {
        let [agree, in_part, explained, without] = kind.counts;
        table.row(
            true,
            [
                kind.name.into(),
                kind.rows().to_string().into(),
                format!("{agree} {}", kind.agrees).into(),
                in_part.to_string().into(),
                explained.to_string().into(),
                without.to_string().into(),
                kind.meaning.into(),
            ],
        );
    }
    let all: usize = fidelity.kinds.iter().map(FidelityKind::rows).sum();
    table.row(true, ["all".into(), all.to_string().into()]);
    html! { div.stacked { (table.finish()) } }
}

fn section(paper: &FidelityPaper) -> Section {
    let mut table = Table::new(
        paper.name,
        &[
            Column::Text("row"),
            Column::Text("kind: verdict"),
            Column::Text("place"),
            Column::Text("what"),
            Column::Text("published; computed (tolerance)"),
            Column::Text("not published (derived, or from another paper); computed"),
            Column::Text("source of the computed value"),
            Column::Text("notes"),
        ],
    );
    for row in &paper.rows {
        table.row(
            true,
            [
                row.id.into(),
                labelled("kind: verdict", &format!("{}: {}", row.kind, row.verdict)),
                row.place.into(),
                row.what.into(),
                lines("", &row.numbers),
                lines("not published", &row.derived),
                labelled("computed from", &row.from),
                row.note.into(),
            ],
        );
    }
    // On a narrow screen the cells of a row are stacked.
    let body = html! { (paragraph(paper.citation)) div.stacked.columns { (table.finish()) } };
    Section::new(paper.name, body)
}

/// A cell with a line for each number.
fn lines(label: &str, numbers: &[String]) -> Cell {
    html! {
        @if !label.is_empty() && !numbers.is_empty() { span.label { (label) ": " } }
        @for (place, number) in numbers.iter().enumerate() { @if place > 0 { br; } (number) }
    }
    .into()
}

/// A cell with a label for layouts without column heads.
fn labelled(label: &str, text: &str) -> Cell {
    html! { @if !text.is_empty() { span.label { (label) ": " } (text) } }.into()
}
