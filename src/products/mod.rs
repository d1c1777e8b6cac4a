//! Rows become the files that people's tools read; every file is read back before it counts.
//!
//! | file | for |
//! |---|---|
//! | `footprints.parquet`, `.csv`, `.geojson` | GIS and scripts: shots in the windows, IAU 2000 |
//! | `ranges.parquet`, `ranges.json` | range residuals per shot; statistics per profile |
//! | `registration.parquet`, `registration.json` | line and sample of every footprint in every image; how the iterations converge |
//! | `ties.parquet`, `adjusted_footprints.parquet`, `adjustment.json` | tie points and footprints in the adjustment; what it says of the site |
//! | `registration_adjusted.parquet` | line and sample of every footprint with the adjusted orientation |
//! | `images/<id>/adjusted_*`, `adjusted/…`, `adjusted.tm` | the adjusted orientation: samples, camera model, SPICE kernels |
//! | `images/<id>/orientation.parquet`, `.json` | orientation samples; polynomials with residuals |
//! | `images/<id>/isd.json` | camera models of the Community Sensor Model (`usgscsm`) |
//! | `footprints.xml` | a PDS4-style label of `footprints.csv` |
//! | `exchange/…` | ISIS, Ames Stereo Pipeline, GIS, STAC catalogues; see its `README.txt` |
//! | `kernels.tm` | SPICE: the same kernels in the same order |
//! | `report/index.html` | people |
//!
//! The same site gives the same bytes; nothing here looks at a clock.

mod adjusted_kernels;
mod adjustment;
mod coordinates;
mod exchange;
pub(crate) mod fault;
mod files;
mod footprints;
mod geojson;
mod isd;
mod kernel_report;
mod orientation;
mod parquet;
mod pds4_label;
mod ranges;
pub mod read;
mod registration;
mod shot;
mod site;
mod table;
mod text_table;
mod ties;

use std::path::{Path, PathBuf};

pub use adjusted_kernels::{
    AdjustedImage, AdjustedKernels, position_kernel, write_adjusted_kernels,
};
pub use exchange::{
    ControlMeasure, ControlPoint, GroundEstimate, ImageMeasure, LidarPoint, moc_serial_number,
    write_gcp, write_lidar_data,
};
pub use site::{GeometricProducts, ImageProducts, KernelLine, SiteProducts};

use crate::error::Result;

/// A file that was written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Product {
    /// Path below the site's folder, for example `images/m0402852/isd.json`.
    pub path: PathBuf,
    /// What the file has of what it is about: shots, samples, profiles, table nodes; 0 for plain text.
    pub rows: u64,
}

/// Writes every product of `site` below `directory`, with `page` as its report, and reads each of them back.
///
/// # Errors
/// [`Kind::Io`](crate::error::Kind::Io) for what the disk refuses; [`Kind::Bug`](crate::error::Kind::Bug)
/// for numbers that are not finite, inputs that do not belong together and files that read back
/// differently.
pub fn write_products(directory: &Path, site: &SiteProducts, page: &str) -> Result<Vec<Product>> {
    site.check()?;
    let mut written = Writer {
        directory,
        products: Vec::new(),
    };
    footprints::write(&mut written, site)?;
    ranges::write(&mut written, site)?;
    registration::write(&mut written, site)?;
    for image in site.images {
        orientation::write(&mut written, image, "")?;
        isd::write(&mut written, site, image)?;
    }
    if let Some(geometric) = &site.geometric {
        ties::write(&mut written, site, geometric)?;
        adjustment::write(&mut written, site, geometric)?;
        registration::write_adjusted(&mut written, site, geometric)?;
        for image in geometric.adjusted_images {
            orientation::write(&mut written, image, "adjusted_")?;
            isd::write_adjusted(&mut written, site, image)?;
        }
        adjusted_kernels::write(&mut written, site, geometric)?;
    }
    written.add("report/index.html", |path| {
        files::write_text(path, page)?;
        Ok(0)
    })?;
    written.add("kernels.tm", |path| {
        files::write_text(path, site.metakernel)?;
        Ok(0)
    })?;
    // Last, as its catalogue lists the others.
    exchange::write(&mut written, site)?;
    Ok(written.products)
}

/// Where products go, and what has been written.
struct Writer<'a> {
    directory: &'a Path,
    products: Vec<Product>,
}

impl Writer<'_> {
    /// Writes the product at `path` by a function that returns its rows.
    fn add(
        &mut self,
        path: impl Into<PathBuf>,
        write: impl FnOnce(&Path) -> Result<u64>,
    ) -> Result<()> {
        let path = path.into();
        let rows = write(&self.directory.join(&path))?;
        self.products.push(Product { path, rows });
        Ok(())
    }
}
