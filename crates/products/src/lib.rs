//! Writes rows to the files of other tools; every file is read back before it is accepted.
//!
//! A product is a `Declaration` in its file and a line of the registry; files, manifest entries, the STAC item,
//! `exchange/README.txt` and `docs/products.md` follow from it.
//!
//! No clock is read here.
//!
//! A `Declaration` has the path, the content, the readers, the sites it applies to, its columns or schema, the function
//! that writes it, and the commands that read it. A table is a list of `column(name, unit, meaning, value of a row)`
//! (`table.rs`): Parquet, CSV and their sidecars, `GeoJSON`, `GeoPackage`, dBASE and the PDS4 label take the column
//! from there, a piece of the rows at a time, and read it back the same way. `.in_gis()` and `.in_dbase(…)` select the
//! columns of those formats. JSON documents are types: the document and its schema in `config/schema` come from one
//! `struct` (`schema.rs`). `tests/products/generated.rs` fails when `docs/products.md` is stale.
//!
//! The same input gives the same bytes, for any number of threads; `finished_utc` in the manifest is the
//! exception. Formats that hold a date (`GeoPackage`, dBASE) carry the date of the newest shot.

mod adjusted_footprints;
mod adjusted_kernels;
mod adjustment;
mod archive;
mod calibration;
mod campaign;
mod control_points;
mod coordinates;
mod correlations;
pub mod error;
mod exchange;
mod figures;
mod files;
mod footprints;
mod found_shots;
mod generated;
mod geojson;
mod geoparquet;
mod geotiff;
mod gis;
mod heights;
mod isd;
mod kernel_report;
mod laser_match;
mod light_time;
mod listed;
mod net;
mod orientation;
mod orthoimage_offsets;
mod overlays;
mod page;
mod page_data;
mod parquet;
mod parquet_file;
mod pds4_label;
mod picture;
mod product;
mod profile_check;
mod ranges;
mod raster_label;
pub mod read;
mod registered_footprints;
mod registration;
mod registry;
mod rows_file;
#[cfg(feature = "sql")]
mod shot_columns;
mod shown;
mod site;
mod site_book;
mod table;
mod text_table;
mod ties;

use std::path::Path;

pub use adjusted_kernels::{AdjustedImage, AdjustedKernels, KernelReaders, write_adjusted_kernels};
pub use adjustment::ADJUSTMENT;
pub use archive::{
    ArchiveProducts, WorstProfile, profile_name, write_archive_products, write_profile_shots,
};
pub use calibration::{
    CalibrationModel, CalibrationProducts, PublishedCalibration, PublishedLine,
    write_calibration_products,
};
pub use campaign::{
    CAMPAIGN_PAGE, CampaignProducts, CampaignTable, is_campaign, read_campaign_tables,
    write_campaign_products,
};
pub use exchange::{
    ContourLayer, ControlMeasure, ControlNetwork, ControlPoint, GroundEstimate, ImageMeasure,
    LidarPoint, NetworkMeasure, NetworkPoint, ProfileShift, SharedSigmas, on_ground_m,
    tie_residuals, write_binary_network, write_contours, write_control_network, write_gcp,
    write_lidar_data,
};
pub use files::{read_bytes, write_bytes, write_json};
pub use found_shots::{ShotBatches, ShotsFile};
pub use generated::{documentation, schemas};
pub use geotiff::{GeoTiff, Number, write_raster};
pub use laser_match::{MatchProducts, write_match_products};
pub use listed::listed;
pub use net::{NetProducts, write_net_products};
pub use orthoimage_offsets::ORTHOIMAGE_OFFSETS;
pub use overlays::{Picture, anaglyph, piece, strip};
pub use page::REPORT;
pub use page_data::{PAGE_DATA, PageData};
pub use picture::{PictureFile, PictureFormat, PictureHead};
pub use product::{
    Content, Context, Declaration, Pages, Product, Program as ReadingProgram, Role, Use, Write,
    Written,
};
pub use raster_label::Label;
pub use registered_footprints::{Place, RegisteredFootprint, registered_footprints};
pub use registry::declarations;
pub use rows_file::{Out, RowsFormat, RowsWriter, SQL};
#[cfg(feature = "sql")]
pub use shot_columns::ShotColumns;
pub use shown::IMAGES_SHOWN;
pub use site::{
    AdjustmentProducts, GeometricProducts, ImageProducts, Listed, Program, SiteProducts,
};
pub use site_book::{SiteBook, SiteStatements};

use rayon::prelude::*;

use areograph_base::error::{Locate, Result};
use areograph_config::ShotFormat;
use product::Scope;

/// Writes those of `declarations` that `site` has below `directory`, with `pages` (or one page as its report), and reads
/// each of them back.
///
/// # Errors
/// [`Kind::Io`](areograph_base::error::Kind::Io) for errors of the disk; [`Kind::Bug`](areograph_base::error::Kind::Bug)
/// for numbers that are not finite, inputs that do not belong together and files that read back
/// differently.
pub fn write_products<'a>(
    directory: &Path,
    site: &SiteProducts,
    declarations: &[&'static Declaration],
    pages: impl Into<Pages<'a>>,
) -> Result<Vec<Product>> {
    site.check()?;
    let pages = pages.into();
    let before = Context {
        site,
        pages,
        directory,
        declarations,
        written: &[],
    };
    let mut written: Vec<Written> = Vec::new();
    for group in declarations.chunk_by(|one, next| one.scope() == next.scope()) {
        let parts = || group.chunk_by(|one, next| one.is_apart() && next.is_apart());
        let images = match group[0].scope() {
            Scope::Site => {
                for part in parts() {
                    let files = write_part(part, &before.after(&written), None)?;
                    written.extend(files);
                }
                continue;
            }
            Scope::Image => site.images,
            Scope::AdjustedImage => site
                .adjustment()
                .map_or(&[][..], |(_, adjustment)| adjustment.images),
        };
        // Files of an image do not depend on those of other images.
        let context = before.after(&written);
        let of_image = |image| {
            let files = parts().map(|part| write_part(part, &context, Some(image)));
            files.collect::<Result<Vec<_>>>()
        };
        let files: Vec<Result<Vec<Vec<Written>>>> = images.par_iter().map(of_image).collect();
        for files in files {
            written.extend(files?.into_iter().flatten());
        }
    }
    Ok(written.into_iter().map(|(product, _)| product).collect())
}

/// Writes products that do not depend on each other.
fn write_part(
    part: &[&'static Declaration],
    of: &Context,
    image: Option<&ImageProducts>,
) -> Result<Vec<Written>> {
    let files: Vec<Result<Vec<Written>>> = part
        .par_iter()
        .map(|declaration| write(declaration, of, image))
        .collect();
    let files: Vec<Vec<Written>> = files.into_iter().collect::<Result<_>>()?;
    Ok(files.into_iter().flatten().collect())
}

/// Products of footprints in `formats`.
fn in_formats(
    formats: &[ShotFormat],
) -> impl Iterator<Item = (&'static str, product::WriteFootprints)> {
    declarations(&[])
        .into_iter()
        .filter_map(|declaration| match declaration.write {
            Write::Footprints(format, write) if formats.contains(&format) => {
                Some((declaration.path.trim_start_matches("exchange/"), write))
            }
            _ => None,
        })
}

/// Names of the files of [`export_footprints`].
pub fn exported_names(formats: &[ShotFormat]) -> impl Iterator<Item = &'static str> {
    in_formats(formats).map(|(name, _)| name)
}

/// Writes the footprints of `site`, which has some, into `directory` in each of `formats`, under the names of the products
/// without their folders, and reads them back.
///
/// # Errors
/// Those of [`write_products`].
pub fn export_footprints(
    directory: &Path,
    site: &SiteProducts,
    formats: &[ShotFormat],
) -> Result<Vec<Product>> {
    let context = Context {
        site,
        pages: Pages::from(""),
        directory,
        declarations: &[],
        written: &[],
    };
    let products = in_formats(formats).map(|(name, write)| {
        let path = directory.join(name);
        let rows = write(&path, &context).in_file(&path)?;
        Ok(Product {
            path: name.into(),
            rows,
        })
    });
    products.collect()
}

/// Writes one product, for an image if the product is per image.
fn write(
    declaration: &'static Declaration,
    of: &Context,
    image: Option<&ImageProducts>,
) -> Result<Vec<Written>> {
    let relative = image.map_or_else(
        || declaration.path.to_owned(),
        |image| declaration.path_of(&image.times.id),
    );
    let path = of.directory.join(&relative);
    let rows = match (&declaration.write, image, &of.site.geometric) {
        (Write::Site(write), ..) => write(&path, of),
        (Write::Many { write, .. }, ..) => return write(of),
        (Write::Footprints(format, write), ..) if of.site.has_footprints_in(*format) => {
            write(&path, of).map(Some)
        }
        (Write::Image(write) | Write::AdjustedImage(write), Some(image), _) => {
            write(&path, of, image).map(Some)
        }
        (Write::Where { has, write, .. }, ..) if has(of.site) => write(&path, of).map(Some),
        (Write::ImageWhere { has, write, .. }, Some(image), _) => {
            let mut all = of.site.images.iter();
            let index = all.position(|of| of.times.id == image.times.id);
            let index = index.filter(|index| has(of.site, *index));
            index.map(|index| write(&path, of, index)).transpose()
        }
        (Write::Ties(write), _, Some(geometric)) => write(&path, of, geometric).map(Some),
        (Write::Matched(write), _, Some(geometric)) if !geometric.ties.matched.is_empty() => {
            write(&path, of, geometric).map(Some)
        }
        (Write::Adjustment(write), _, Some(geometric)) => match &geometric.adjustment {
            Some(adjustment) => write(&path, of, geometric, adjustment),
            None => Ok(None),
        },
        (Write::Several(write), _, Some(geometric)) => match &geometric.adjustment {
            Some(adjustment) => return write(of, adjustment),
            None => Ok(None),
        },
        _ => Ok(None),
    };
    let product = rows.in_file(&path)?.map(|rows| Product {
        path: relative.into(),
        rows,
    });
    Ok(product
        .map(|product| (product, declaration))
        .into_iter()
        .collect())
}
