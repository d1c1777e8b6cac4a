//! A campaign: images of an index, selected by rule, become sites; sites run like any other.
//!
//! `selection` applies the rules of the campaign file, `files` finds the files of the images, `site_files` writes the site
//! files, `costs` remembers what they cost, and `ended` runs one of them.

mod costs;
mod ended;
mod files;
mod selection;
mod site_files;

pub use costs::{Costs, InputSize};
pub use ended::{End, SiteEnd, SiteTask, run_site_file};
pub use selection::{Campaign, LeftOut, PlannedSite, select_campaign};
