//! Notes, and problems in the input.

use super::{
    html::{Markup, html, list},
    numbers::whole,
    section::Section,
};
use areograph_base::verdict::CheckKind;
use areograph_products::SiteProducts;

/// Number of notes shown; the rest are counted.
const NOTES_SHOWN: usize = 50;
/// Number of problems shown; the rest are counted.
const COMPLAINTS_SHOWN: usize = 50;

pub(super) const SECTION: Section = Section {
    title: "Notes",
    anchor: "notes",
    checks: &[CheckKind::SkippedRecords],
    appears: |site| !site.notes.is_empty() || !site.complaints.is_empty(),
    write: |site| Ok(write(site)),
};

fn write(site: &SiteProducts) -> Markup {
    let notes = &site.notes[..site.notes.len().min(NOTES_SHOWN)];
    let shown = &site.complaints[..site.complaints.len().min(COMPLAINTS_SHOWN)];
    html! {
        (list(notes))
        @if notes.len() < site.notes.len() {
            p { (notes.len()) " of " (whole(site.notes.len())) " shown; manifest.json lists all." }
        }
        @if !shown.is_empty() {
            h3 { "Problems in the input" }
            (list(shown))
            p { (shown.len()) " of " (site.complaints.len()) " shown." }
        }
    }
}
