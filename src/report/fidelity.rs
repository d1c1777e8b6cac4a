//! The page that compares every number of the papers with areograph's.

use super::html::{Cell, Column, STYLE, Section, Table, escape, page, paragraph};

/// The page of this version, which `tests/products/fidelity.rs` makes and checks; its style is that of all pages, by a
/// link.
const FIDELITY_PAGE: &str = include_str!("../../docs/fidelity.html");
/// From `docs/` to the style of all pages.
const LINKED_STYLE: &str = "<link rel=\"stylesheet\" href=\"../crates/base/src/style.css\">\n";
/// File of the page, in the folder that holds the sites' folders.
pub const FIDELITY_FILE: &str = "fidelity.html";

/// Contents of the page.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Fidelity {
    /// Introduction to the list, by paragraphs.
    pub rules: Vec<String>,
    /// Each verdict: the word, its number of rows, its meaning.
    pub verdicts: Vec<(&'static str, usize, &'static str)>,
    /// The papers.
    pub papers: Vec<FidelityPaper>,
}

/// A paper.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FidelityPaper {
    /// Authors and year.
    pub name: &'static str,
    /// Subject and reference.
    pub citation: &'static str,
    /// Its printed numbers, in its order.
    pub rows: Vec<FidelityRow>,
}

/// Numbers that a paper prints in one place.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FidelityRow {
    /// Identifier.
    pub id: &'static str,
    /// Section or table of the paper.
    pub place: &'static str,
    /// Description of the printed numbers.
    pub what: &'static str,
    /// Its numbers, each with the printed one, ours and the tolerance in a line.
    pub numbers: Vec<String>,
    /// Source of ours.
    pub from: String,
    /// The verdict.
    pub verdict: &'static str,
    /// Remarks.
    pub note: &'static str,
}

/// The page for the folder of the page of all sites: in one file.
#[must_use]
pub fn published_fidelity_page() -> String {
    FIDELITY_PAGE.replacen(LINKED_STYLE, &embedded_style(), 1)
}

fn embedded_style() -> String {
    format!("<style>\n{STYLE}</style>\n")
}

/// The page for `docs/`.
#[must_use]
pub fn fidelity_page(fidelity: &Fidelity) -> String {
    let rules: String = fidelity.rules.iter().map(|rule| paragraph(rule)).collect();
    let sections: Vec<Section> = fidelity.papers.iter().map(section).collect();
    let lead = rules + &verdicts(fidelity);
    let page = page("Fidelity to the papers", &lead, &sections);
    page.replacen(&embedded_style(), LINKED_STYLE, 1)
}

fn verdicts(fidelity: &Fidelity) -> String {
    let mut table = Table::new(
        "Rows by verdict",
        &[
            Column::Text("verdict"),
            Column::Number("rows"),
            Column::Text("meaning"),
        ],
    );
    let mut all = 0;
    for (word, rows, meaning) in &fidelity.verdicts {
        all += rows;
        table.row(
            true,
            [(*word).into(), rows.to_string().into(), (*meaning).into()],
        );
    }
    table.row(true, ["all".into(), all.to_string().into()]);
    format!("<div class=\"stacked\">\n{}</div>\n", table.finish())
}

fn section(paper: &FidelityPaper) -> Section {
    let mut table = Table::new(
        paper.name,
        &[
            Column::Text("row"),
            Column::Text("place"),
            Column::Text("what"),
            Column::Text("printed; ours (tolerance)"),
            Column::Text("verdict"),
            Column::Text("ours from"),
            Column::Text("notes"),
        ],
    );
    for row in &paper.rows {
        let numbers: Vec<String> = row.numbers.iter().map(|number| escape(number)).collect();
        table.row(
            true,
            [
                row.id.into(),
                row.place.into(),
                row.what.into(),
                Cell::Html(numbers.join("<br>")),
                labelled("verdict", row.verdict),
                labelled("ours from", &row.from),
                row.note.into(),
            ],
        );
    }
    // On a narrow screen the cells of a row are stacked.
    let rows = format!(
        "<div class=\"stacked columns\">\n{}</div>\n",
        table.finish()
    );
    Section::new(paper.name, paragraph(paper.citation) + &rows)
}

/// A cell with a label for layouts without column heads.
fn labelled(label: &str, text: &str) -> Cell {
    Cell::Html(if text.is_empty() {
        String::new()
    } else {
        format!("<span class=\"label\">{label}: </span>{}", escape(text))
    })
}
