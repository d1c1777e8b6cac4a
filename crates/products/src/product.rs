//! Declaration of a product: its file, its readers, its conditions and its writer.

use std::{
    fmt,
    path::{Path, PathBuf},
};

use super::{
    site::{AdjustmentProducts, GeometricProducts, ImageProducts, SiteProducts},
    table::Meaning,
};
use areograph_base::{
    error::{Locate as _, Result},
    schema::DocumentSchema,
};
use areograph_config::ShotFormat;

/// A file that was written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Product {
    /// Path below the site's folder, for example `images/m0402852/isd.json`.
    pub path: PathBuf,
    /// Number of items in the file: shots, samples, profiles, table nodes; 0 for plain text.
    pub rows: u64,
}

/// Writes every product below `directory` by `write`, which returns its number of rows.
pub(super) fn write_each<W>(
    directory: &Path,
    declarations: &[&Declaration<W>],
    write: impl Fn(&W, &Path) -> Result<u64>,
) -> Result<Vec<Product>> {
    let products = declarations.iter().map(|declaration| {
        let path = directory.join(declaration.path);
        let rows = write(&declaration.write, &path).in_file(&path)?;
        Ok(Product {
            path: declaration.path.into(),
            rows,
        })
    });
    products.collect()
}

/// A product, declared once: the files, the STAC item, `exchange/README.txt` and `docs/products.md` follow. `W` is how
/// it is written: for a site by [`Write`].
#[derive(Clone, Copy)]
pub struct Declaration<W = Write> {
    /// Path below the site's folder; `<image>` stands for an image's identifier.
    pub path: &'static str,
    /// Contents of the file.
    pub what: &'static str,
    /// Readers of it.
    pub readers: &'static str,
    /// Meaning of its rows; empty for a file without rows.
    pub rows: &'static str,
    /// Its role in a catalogue.
    pub role: Role,
    /// Columns or schema.
    pub content: Content,
    /// Its writer, and the sites that have it.
    pub write: W,
    /// Instructions for reading it in other programs.
    pub uses: &'static [Use],
}

impl<W> Declaration<W> {
    /// The declaration without its writer.
    const fn described(&self) -> Declaration<()> {
        Declaration {
            path: self.path,
            what: self.what,
            readers: self.readers,
            rows: self.rows,
            role: self.role,
            content: self.content,
            write: (),
            uses: self.uses,
        }
    }

    /// The report of a flow, written by `write`.
    pub(super) const fn report(what: &'static str, write: W) -> Self {
        Self {
            path: "report/index.html",
            what,
            readers: "people",
            rows: "",
            role: Role::Overview,
            content: Content::Foreign,
            write,
            uses: &[],
        }
    }
}

/// Products of a flow other than the flow of sites.
pub(super) struct Group {
    /// Heading of the group in the documentation.
    pub(super) heading: &'static str,
    /// Command and folder.
    pub(super) source: &'static str,
    /// Precedes the paths of its tables in headings.
    pub(super) prefix: &'static str,
    /// Explanation of placeholders in paths; empty without any.
    pub(super) placeholders: &'static str,
    /// The products, in the order of the documentation.
    pub(super) products: Vec<Declaration<()>>,
}

/// Declarations without their writers.
pub(super) fn described<W>(declarations: &[&Declaration<W>]) -> Vec<Declaration<()>> {
    declarations.iter().map(|of| of.described()).collect()
}

/// Placeholder of an image in paths and commands.
pub(super) const IMAGE: &str = "<image>";

/// Roles of STAC assets.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// Data.
    Data,
    /// Data about data.
    Metadata,
    /// A picture or page.
    Overview,
}

impl Role {
    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::Data => "data",
            Self::Metadata => "metadata",
            Self::Overview => "overview",
        }
    }
}

/// Description of the structure of a file.
#[derive(Clone, Copy)]
pub enum Content {
    /// A table with these columns.
    Table(fn() -> Vec<Meaning>),
    /// A document of this schema.
    Document(fn() -> DocumentSchema),
    /// An external format.
    Foreign,
}

/// Writer of a product. The functions return its number of rows, or `None` if there was nothing to write.
pub enum Write {
    /// For every site.
    Site(fn(&Path, &Context) -> Result<Option<u64>>),
    /// In this format for a site with footprints: GIS readers reject tables without a row, or guess their types.
    Footprints(ShotFormat, WriteFootprints),
    /// For every image.
    Image(fn(&Path, &Context, &ImageProducts) -> Result<u64>),
    /// For sites, and for images by their index, that have what the product shows.
    Where {
        /// These sites, in words.
        sites: &'static str,
        /// Whether the site has it.
        has: fn(&SiteProducts) -> bool,
        /// Its writer.
        write: fn(&Path, &Context) -> Result<u64>,
    },
    /// See [`Self::Where`].
    ImageWhere {
        /// These images, in words.
        images: &'static str,
        /// Whether the image with this index has it.
        has: fn(&SiteProducts, usize) -> bool,
        /// Its writer.
        write: fn(&Path, &Context, usize) -> Result<u64>,
    },
    /// For a site with tie points.
    Ties(fn(&Path, &Context, &GeometricProducts) -> Result<u64>),
    /// For a site with tie points that were matched.
    Matched(fn(&Path, &Context, &GeometricProducts) -> Result<u64>),
    /// For a site with an adjustment.
    Adjustment(fn(&Path, &Context, &GeometricProducts, &AdjustmentProducts) -> Result<Option<u64>>),
    /// For every image of a site with an adjustment.
    AdjustedImage(fn(&Path, &Context, &ImageProducts) -> Result<u64>),
    /// For every image of a site with an adjustment, by the product that writes several.
    WithAnother,
    /// As many as there are of something.
    Many {
        /// Of these, in words.
        files: &'static str,
        /// Writes all of them.
        write: fn(&Context) -> Result<Vec<Written>>,
    },
    /// For a site with an adjustment, others with it.
    Several(fn(&Context, &AdjustmentProducts) -> Result<Vec<Written>>),
}

/// Writer of a table of footprints.
pub(super) type WriteFootprints = fn(&Path, &Context) -> Result<u64>;

/// Unit that has a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Scope {
    Site,
    Image,
    AdjustedImage,
}

/// Pages that are made elsewhere.
#[derive(Debug, Clone, Copy)]
pub struct Pages<'a> {
    /// The report.
    pub report: &'a str,
    /// The images with footprints on them, if there are pixels.
    pub overlays: Option<&'a str>,
}

impl<'a, T: AsRef<str> + ?Sized> From<&'a T> for Pages<'a> {
    fn from(report: &'a T) -> Self {
        Self {
            report: report.as_ref(),
            overlays: None,
        }
    }
}

/// A file that was written, and its declaration.
pub type Written = (Product, &'static Declaration);

/// Inputs of products.
pub struct Context<'a> {
    /// The site.
    pub site: &'a SiteProducts<'a>,
    /// Its pages.
    pub pages: Pages<'a>,
    /// Folder that products are written to.
    pub directory: &'a Path,
    /// All products that a site may have, in order.
    pub declarations: &'a [&'static Declaration],
    /// Products written so far, with their declarations.
    pub(super) written: &'a [Written],
}

impl Context<'_> {
    /// The same after these products.
    pub(super) const fn after<'c>(&self, written: &'c [Written]) -> Context<'c>
    where
        Self: 'c,
    {
        Context { written, ..*self }
    }
}

/// A program, or kind of program, with a section in `exchange/README.txt`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Program {
    /// Ames Stereo Pipeline.
    StereoPipeline,
    /// ISIS.
    Isis,
    /// Geographic information systems.
    Gis,
    /// Readers of camera models.
    CameraModel,
    /// Readers of adjusted kernels.
    AdjustedKernels,
    /// Catalogues.
    Catalogue,
}

/// Use of a product by a program: lines for `exchange/README.txt`, equal for every image but for `<image>`.
pub struct Use {
    /// The program.
    pub program: Program,
    /// The lines.
    pub lines: &'static str,
}

impl Declaration {
    pub(super) const fn scope(&self) -> Scope {
        match self.write {
            Write::Image(_) | Write::ImageWhere { .. } => Scope::Image,
            Write::AdjustedImage(_) => Scope::AdjustedImage,
            _ => Scope::Site,
        }
    }

    /// Whether it is written only from the footprints, independent of other products. Only such products are written in the
    /// thread pool: adjusted kernels wait for CSPICE, whose holder may itself wait for the pool.
    pub(super) const fn is_apart(&self) -> bool {
        matches!(self.write, Write::Footprints(..))
    }

    /// Condition for the file, in words.
    pub(super) fn when(&self) -> String {
        let when = match self.write {
            Write::Footprints(format, _) => {
                return format!("a site with footprints, format `{}`", format.word());
            }
            Write::Site(_) => "every site",
            Write::Image(_) => "every image",
            Write::Where { sites: when, .. }
            | Write::ImageWhere { images: when, .. }
            | Write::Many { files: when, .. } => when,
            Write::Ties(_) => "a site with tie points",
            Write::Matched(_) => "a site with matched tie points",
            Write::Adjustment(_) | Write::Several(_) => "a site with an adjustment",
            Write::AdjustedImage(_) => "every image of a site with an adjustment",
            Write::WithAnother => "every image of a site with an adjustment, without support data",
        };
        when.to_owned()
    }

    /// The path of an image's file.
    pub(super) fn path_of(&self, image: &str) -> String {
        self.path.replace(IMAGE, image)
    }
}

impl<W> fmt::Debug for Declaration<W> {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        to.write_str(self.path)
    }
}

impl<W> Declaration<W> {
    /// Media type by the extension; `None` for formats without one.
    pub(super) fn media_type(&self) -> Option<&'static str> {
        Some(match self.path.rsplit_once('.')?.1 {
            "parquet" => "application/vnd.apache.parquet",
            "geojson" => "application/geo+json",
            "json" => "application/json",
            "csv" => "text/csv",
            "gpkg" => "application/geopackage+sqlite3",
            "shp" => "application/vnd.shp",
            "shx" => "application/vnd.shx",
            "dbf" => "application/vnd.dbf",
            "html" => "text/html",
            "png" => "image/png",
            "tif" => "image/tiff; application=geotiff; profile=cloud-optimized",
            "svg" => "image/svg+xml",
            "xml" => "application/xml",
            "txt" | "prj" | "cpg" | "tm" => "text/plain",
            _ => return None,
        })
    }
}
