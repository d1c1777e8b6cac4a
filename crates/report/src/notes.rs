//! Notes, and problems in the input.

use super::{
    html::{heading, list, paragraph},
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

fn write(site: &SiteProducts) -> String {
    let notes = &site.notes[..site.notes.len().min(NOTES_SHOWN)];
    let mut body = list(notes);
    if notes.len() < site.notes.len() {
        body += &paragraph(&format!(
            "{} of {} shown; manifest.json has all.",
            notes.len(),
            whole(site.notes.len())
        ));
    }
    if !site.complaints.is_empty() {
        let shown = &site.complaints[..site.complaints.len().min(COMPLAINTS_SHOWN)];
        body += &heading("Problems in the input");
        body += &list(shown);
        body += &paragraph(&format!(
            "{} of {} shown.",
            shown.len(),
            site.complaints.len()
        ));
    }
    body
}
