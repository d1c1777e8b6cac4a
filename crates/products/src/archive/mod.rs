//! Products of the check of an archive: a row per profile, shots of the worst profiles, a document, the page.

mod document;
mod profiles;
mod shots;

use std::path::Path;

use super::{
    files::write_text,
    product::{Declaration, Group, Product, described, write_each},
};
use areograph_base::error::Result;
use areograph_stages::{
    check_archive::{ArchiveProfile, ArchiveRanges, CheckedFile},
    judge::Verdict,
};

pub use shots::{profile_name, write_profile_shots};

/// Inputs of the products of an archive.
#[derive(Debug, Clone, Copy)]
pub struct ArchiveProducts<'a> {
    /// The result.
    pub ranges: &'a ArchiveRanges,
    /// The verdict on it.
    pub verdict: &'a Verdict,
    /// The page.
    pub page: &'a str,
}

/// One of the worst profiles.
#[derive(Debug, Clone)]
pub struct WorstProfile<'a> {
    /// Its file.
    pub file: &'a CheckedFile,
    /// The profile.
    pub profile: &'a ArchiveProfile,
    /// Path of its shots, below the folder of the products; `None` for a file that could not be read again.
    pub shots: Option<String>,
    /// UTC of its first shot; `None` without leap seconds.
    pub start_utc: Option<String>,
}

/// Writer of a product of an archive; returns its number of rows.
pub(super) type WriteArchive = fn(&Path, &ArchiveProducts) -> Result<u64>;

/// The products of an archive, in the order in which they are written; shots of the worst profiles come before.
static PRODUCTS: &[&Declaration<WriteArchive>] = &[
    &profiles::TABLE,
    &profiles::CSV,
    &document::DOCUMENT,
    &REPORT,
];

static REPORT: Declaration<WriteArchive> =
    Declaration::report("the report of the archive", |path, of| {
        write_text(path, of.page).map(|()| 0)
    });

/// The products in the documentation.
pub(super) fn group() -> Group {
    Group {
        heading: "Archives of PEDR files",
        source: "`areograph pedr qa`, in the folder `--out`",
        prefix: "archive",
        placeholders: "",
        products: [described(&[&shots::SHOTS]), described(PRODUCTS)].concat(),
    }
}

/// Writes every product of an archive except shots below `directory`, and reads each of them back.
///
/// # Errors
/// [`Kind::Io`](areograph_base::error::Kind::Io) for errors of the disk; [`Kind::Bug`](areograph_base::error::Kind::Bug) for numbers that
/// are not finite and files that read back differently.
pub fn write_archive_products(directory: &Path, archive: &ArchiveProducts) -> Result<Vec<Product>> {
    write_each(directory, PRODUCTS, |write, path| write(path, archive))
}
