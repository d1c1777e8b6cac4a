//! Declaration of a section of a site's page.

use super::{
    html::{self, Markup},
    outcome::outcomes,
};
use areograph_base::{error::Result, verdict::CheckKind};
use areograph_products::SiteProducts;

/// A section of the page of one site. Its file declares it as `SECTION`; it is listed once, with the other sections or
/// by its capability, and order and contents of the page follow.
#[derive(Debug, Clone, Copy)]
pub struct Section {
    /// Its heading.
    pub title: &'static str,
    /// Its name in links, unique on the page.
    pub anchor: &'static str,
    /// Kinds of checks whose details it has.
    pub checks: &'static [CheckKind],
    /// Whether the page of this site has it.
    pub appears: fn(&SiteProducts) -> bool,
    /// Its body; fails if a plot cannot be drawn.
    pub write: fn(&SiteProducts) -> Result<Markup>,
}

impl Section {
    /// The section of this site, if it has one: folded under its heading unless one of its checks fails or warns.
    ///
    /// # Errors
    /// A plot that cannot be drawn, which is a bug in areograph.
    pub(super) fn of(&self, site: &SiteProducts) -> Result<Option<html::Section>> {
        if !(self.appears)(site) {
            return Ok(None);
        }
        let terms = site.config.terms();
        let title = terms.fill(self.title);
        let checks = site.verdict.checks.iter();
        let own = checks.filter(|check| self.checks.contains(&check.kind));
        let (note, all_pass) = outcomes(own);
        let section = html::Section::named(self.anchor, title, (self.write)(site)?);
        Ok(Some(section.folded(note, !all_pass)))
    }
}
