//! The book of a site's outputs as a product: the page can be regenerated from it and the tables beside it.
//!
//! Documents are written for their readers, with the digits and the selection that these need. The page shows more:
//! surfaces, histograms, spans of kernels. The outputs are therefore kept, except values that a table contains unrounded:
//! residuals of the range check and places of footprints in images. Camera tables and map pixels, which no page shows,
//! are omitted. A page needs the places in images with plots alone.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::{
    error::ProductError,
    files::{create, finish},
    product::{self, Content, Declaration, Role},
    ranges,
    read::{ReadError, read_points, read_residuals},
    registration,
    site::SiteProducts,
    site_book::SiteBook,
};
use areograph_base::error::{Locate, Result};
use areograph_config::SiteConfig;
use areograph_spice::KernelSet;
use areograph_stages::{
    adjust::Adjusted,
    check_ranges::{RangeCheck, ShotResiduals},
    convert_datum::Converted,
    group_profiles::Profile,
    orientation::Orientation,
    register::{ImageRegistration, RegisteredPoints},
    search_footprints::SearchResult,
    tabulate_kernels::AdjustedTables,
};
use areograph_store::{
    book::Book,
    files::{file_name, hash_file},
    stage::Round,
};

/// Types of the outputs and their layout. The number is raised when one of them changes without a new version.
const LAYOUT: &str = concat!("version ", env!("CARGO_PKG_VERSION"), ", layout 4");

/// Its path below a site's folder.
pub const PAGE_DATA: &str = "report/page.postcard";

pub(super) static DATA: Declaration = Declaration {
    path: PAGE_DATA,
    what: "data of the report that no table contains, unrounded, in the layout of this version of areograph; BLAKE3 in the manifest",
    readers: "`areograph report`, `areograph export`",
    rows: "",
    role: Role::Metadata,
    content: Content::Foreign,
    write: product::Write::Site(|path, of| write(path, of.site).map(|()| Some(0))),
    uses: &[],
};

/// The configuration of a site as its page needs it; of paths only file names.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct PageConfig {
    /// In TOML: postcard cannot represent infinite or absent values.
    config: String,
    /// Names of the PEDR files, which the serialised configuration omits.
    pedr_files: Vec<String>,
    /// Indices of the images with plots.
    shown: Vec<usize>,
}

/// The data of a page, read from their product.
#[derive(Debug)]
pub struct PageData {
    book: Book,
    config: SiteConfig,
}

impl PageData {
    /// Opens it in the folder of a site, with the values of the tables there.
    ///
    /// # Errors
    /// A file of kind input that this version did not write; tables that do not belong to it; an error of the disk.
    pub fn read(site_folder: &Path) -> Result<Self> {
        let mut data = Self::without_tables(site_folder)?;
        let shown = data.book.of::<PageConfig>()?.shown.clone();
        fill(&mut data.book, site_folder, &shown)?;
        Ok(data)
    }

    /// Opens it in the folder of a site, without residuals of ranges and points in images.
    ///
    /// # Errors
    /// A file of kind input that this version did not write; an error of the disk.
    pub fn without_tables(site_folder: &Path) -> Result<Self> {
        let path = site_folder.join(PAGE_DATA);
        let book = Book::open(&path, LAYOUT)?;
        let stored: PageConfig = book.of::<PageConfig>().in_file(&path)?.clone();
        let mut config: SiteConfig = toml::from_str(&stored.config)
            .map_err(ReadError::unreadable("a configuration"))
            .in_file(&path)?;
        config.pedr.files = stored.pedr_files.iter().map(PathBuf::from).collect();
        Ok(Self { book, config })
    }

    /// Calls `with` on the site as the page needs it, which may have the products of `declarations`.
    ///
    /// # Errors
    /// An output that this version did not write; what `with` returns.
    pub fn with<T>(
        &self,
        declarations: &[&'static Declaration],
        with: impl FnOnce(&SiteProducts) -> Result<T>,
    ) -> Result<T> {
        let site = SiteBook {
            config: &self.config,
            book: &self.book,
            // The page shows neither these kernels nor their paths.
            kernels: &KernelSet::default(),
            folder: Path::new(""),
            declarations,
        };
        site.with(with)
    }
}

/// The book of `site` without the parts that its page does not show.
fn page_book(site: &SiteProducts) -> Result<Book> {
    let mut config = site.config.clone();
    config.file = PathBuf::from(file_name(&config.file));
    let config = toml::Table::try_from(&config).map_err(ProductError::refused("encode TOML"))?;
    let pedr_files = site.config.pedr.files.iter();
    let stored = PageConfig {
        config: config.to_string(),
        pedr_files: pedr_files.map(|path| file_name(path)).collect(),
        shown: site.shown_images(),
    };
    let mut book = site.book.lightened()?;
    book.enter_value("configuration", stored)?;
    book.leave_out::<SearchResult>();
    book.leave_out::<AdjustedTables>();
    for round in [Round::Initial, Round::Matching, Round::Adjusted] {
        book.change(round, |_, of: &Orientation| Some(of.without_tables()))?;
    }
    for (round, _) in registration_tables(&book) {
        book.change(round, |_, of: &ImageRegistration| Some(of.without_points()))?;
    }
    book.change(Round::Initial, |_, of: &RangeCheck| {
        Some(of.with_shots(ShotResiduals::default()))
    })?;
    Ok(book)
}

/// The tables of registered points, with their rounds.
fn registration_tables(book: &Book) -> Vec<(Round, &'static str)> {
    let mut tables = vec![(Round::Initial, registration::TABLE.path)];
    if book.has::<Adjusted>(Round::Initial) {
        tables.push((Round::Adjusted, registration::ADJUSTED.path));
    }
    tables
}

/// Restores the values that the book leaves to the tables of the site.
fn fill(book: &mut Book, site_folder: &Path, shown: &[usize]) -> Result<()> {
    let footprints = book.of::<Converted>()?.footprints.len();
    let profiles = book.of::<Vec<Profile>>()?.iter();
    let profiles: Vec<String> = profiles.map(|profile| profile.id.clone()).collect();
    let table = site_folder.join(ranges::TABLE.path);
    let mut residuals = Some(read_residuals(&table, &profiles, footprints)?);
    book.change(Round::Initial, |_, of: &RangeCheck| {
        residuals.take().map(|residuals| of.with_shots(residuals))
    })?;
    for (round, table) in registration_tables(book) {
        let table = site_folder.join(table);
        let registrations = book.parts::<ImageRegistration>(round)?;
        let images = registrations.iter().map(|of| of.image.clone());
        let images: Vec<String> = images.collect();
        let mut points = read_points(&table, &images, &profiles, footprints, shown)?;
        for image in shown {
            let registration = registrations.get(*image);
            let expected = registration.map_or(0, |of| {
                of.profiles.iter().map(|of| of.points as usize).sum()
            });
            let found = points.get(*image).map_or(0, RegisteredPoints::len);
            if found != expected {
                let reason = format!("{found} points of an image; expected {expected}");
                let mismatch = ReadError::unreadable("the table of these page data");
                return Err(mismatch(reason)).in_file(&table);
            }
        }
        book.change(round, |index, of: &ImageRegistration| {
            Some(of.with_points(std::mem::take(points.get_mut(index)?)))
        })?;
    }
    Ok(())
}

/// Writes the data of the page of `site`, and checks that the file holds them.
///
/// They are not decoded: of a million shots the decoded data would be the largest part of a run's memory.
fn write(path: &Path, site: &SiteProducts) -> Result<()> {
    let book = page_book(site).in_file(path)?;
    let mut file = create(path)?;
    let hash = book.write(LAYOUT, &mut file).in_file(path)?;
    finish(path, file)?;
    if hash_file(path)?.0 == *hash.to_hex() {
        return Ok(());
    }
    Err(ProductError::ReadBack {
        what: "the data of the report".to_owned(),
    })
    .in_file(path)
}
