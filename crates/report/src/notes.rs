//! Notes, and problems in the input.

use super::{
    html::{heading, list, paragraph},
    section::Section,
};
use areograph_products::SiteProducts;

/// Number of problems shown; the rest are counted.
const COMPLAINTS_SHOWN: usize = 50;

pub(super) const SECTION: Section = Section {
    title: "Notes",
    anchor: "notes",
    appears: |site| !site.notes.is_empty() || !site.complaints.is_empty(),
    write: |site| Ok(write(site)),
};

fn write(site: &SiteProducts) -> String {
    let mut body = list(site.notes);
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
