//! The book of a site's outputs as a product: the page can be regenerated from it without other files.
//!
//! Tables and documents are written for their readers, with the digits and the selection that these need. The page
//! shows more: surfaces, histograms, spans of kernels. The outputs are therefore kept completely. Camera tables and map
//! pixels, which no page shows, are omitted. So are the points of images without plots: at a site of a thousand images
//! they amounted to a quarter of a gigabyte.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::{
    error::ProductError,
    files::{create, finish},
    product::{self, Content, Declaration, Role},
    read::ReadError,
    site::SiteProducts,
    site_book::SiteBook,
};
use areograph_base::error::{Locate, Result};
use areograph_config::SiteConfig;
use areograph_spice::KernelSet;
use areograph_stages::{
    orientation::Orientation, register::ImageRegistration, search_footprints::SearchResult,
    tabulate_kernels::KernelTables,
};
use areograph_store::{
    book::Book,
    files::{file_name, hash_file},
};

/// Types of the outputs and their layout. The number is raised when one of them changes without a new version.
const LAYOUT: &str = concat!("version ", env!("CARGO_PKG_VERSION"), ", layout 2");

/// Its path below a site's folder.
pub const PAGE_DATA: &str = "report/page.postcard";

pub(super) static DATA: Declaration = Declaration {
    path: PAGE_DATA,
    what: "all data of the report, unrounded, in the layout of this version of areograph; BLAKE3 in the manifest",
    readers: "`areograph report`",
    rows: "",
    role: Role::Metadata,
    content: Content::Foreign,
    write: product::Write::Site(|path, of| write(path, of.site).map(|()| Some(0))),
    uses: &[],
};

/// The configuration of a site as its page needs it; of paths only file names.
#[derive(Debug, Serialize, Deserialize)]
struct PageConfig {
    /// In TOML: postcard cannot represent infinite or absent values.
    config: String,
    /// Names of the PEDR files, which the serialised configuration omits.
    pedr_files: Vec<String>,
}

/// The data of a page, read from their product.
#[derive(Debug)]
pub struct PageData {
    book: Book,
    config: SiteConfig,
}

impl PageData {
    /// Opens it in the folder of a site.
    ///
    /// # Errors
    /// A file of kind input that this version did not write; an error of the disk.
    pub fn read(site_folder: &Path) -> Result<Self> {
        let path = site_folder.join(PAGE_DATA);
        let book = Book::open(&path, LAYOUT)?;
        let stored = book.of::<PageConfig>().in_file(&path)?;
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
    };
    let shown = site.shown_images();
    let mut book = site.book.lightened()?;
    book.enter_value("configuration", stored)?;
    book.leave_out::<SearchResult>();
    book.leave_out::<KernelTables>();
    book.change(|_, orientation: &Orientation| Some(orientation.without_tables()))?;
    book.change(|index, registration: &ImageRegistration| {
        let is_shown = shown.binary_search(&index).is_ok();
        (!is_shown).then(|| registration.without_points())
    })?;
    Ok(book)
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
