//! Products of a site from the book of its outputs: the one place where outputs become [`SiteProducts`].

use std::{collections::BTreeMap, path::Path};

use serde::{Deserialize, Serialize};

use super::{
    listed::listed,
    product::Declaration,
    site::{AdjustmentProducts, GeometricProducts, ImageProducts, Program, SiteProducts},
};
use areograph_base::error::Result;
use areograph_config::SiteConfig;
use areograph_spice::KernelSet;
use areograph_stages::{
    adjust::Adjusted, compare_pairs::PairComparison, convert_datum::Converted,
    describe_kernels::KernelDescription, intersect::IntersectedTies, judge::Verdict,
    tag_utc::ShotTimes,
};
use areograph_store::{book::Book, stage::Round};

/// A site whose outputs are complete.
#[derive(Debug, Clone, Copy)]
pub struct SiteBook<'a> {
    /// The configuration.
    pub config: &'a SiteConfig,
    /// The outputs, with [`SiteStatements`] and the instants at which the site needs kernels.
    pub book: &'a Book,
    /// Its kernels.
    pub kernels: &'a KernelSet,
    /// Folder of the site's products.
    pub folder: &'a Path,
    /// All products that a site may have, in order.
    pub declarations: &'a [&'static Declaration],
}

/// Statements about a site that follow from all its outputs; entered last.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct SiteStatements {
    /// The verdict.
    pub verdict: Verdict,
    /// Whether the images of every pair place their tie points together after the adjustment.
    pub images_agree: bool,
    /// Rejected shots by reason.
    pub rejected: BTreeMap<String, u64>,
    /// Errors of skipped records, one sentence each.
    pub complaints: Vec<String>,
    /// Notes for the reader, one sentence each.
    pub notes: Vec<String>,
    /// Software that computed the products.
    pub program: Program,
}

impl SiteBook<'_> {
    /// Calls `with` on the site as products and pages require it.
    ///
    /// # Errors
    /// An output that is missing or cannot be read; what `with` returns.
    pub fn with<T>(&self, with: impl FnOnce(&SiteProducts) -> Result<T>) -> Result<T> {
        let book = self.book;
        let images = images_of(book, Round::Initial)?;
        let adjusted_images = images_of(book, Round::Adjusted)?;
        let tables = book.parts(Round::Adjusted)?;
        let statements = book.of::<SiteStatements>()?;
        let adjustment = match book.find::<Adjusted>(Round::Initial)? {
            None => None,
            Some(adjusted) => Some(AdjustmentProducts {
                kernels: self.kernels,
                folder: self.folder,
                adjusted,
                heights: book.require(Round::Adjusted)?.value()?,
                images: &adjusted_images,
                tables: &tables,
                intersected: book.require(Round::Adjusted)?.value()?,
                pairs: book
                    .require::<Vec<PairComparison>>(Round::Adjusted)?
                    .value()?,
                images_agree: statements.images_agree,
            }),
        };
        let geometric = match book.find::<IntersectedTies>(Round::Initial)? {
            None => None,
            Some(intersected) => Some(GeometricProducts {
                ties: book.of()?,
                intersected,
                pairs: book.of::<Vec<PairComparison>>()?,
                heights: book.of()?,
                adjustment,
            }),
        };
        let converted = book.of::<Converted>()?;
        let site = SiteProducts {
            config: self.config,
            book,
            listed: &[],
            kernels: &book.of::<KernelDescription>()?.kernels,
            metakernel: &self.kernels.metakernel_text(Some(self.folder)),
            required: book.of()?,
            images: &images,
            conversions: &converted.files,
            footprints: &converted.footprints,
            utc: &book.of::<ShotTimes>()?.0,
            profiles: book.of::<Vec<_>>()?,
            profile_check: book.of()?,
            ranges: book.of()?,
            rejected: &statements.rejected,
            complaints: &statements.complaints,
            notes: &statements.notes,
            verdict: &statements.verdict,
            geometric,
            overlays: book.find(Round::Initial)?,
            program: &statements.program,
        };
        let listed = &*listed(&site, self.declarations);
        with(&SiteProducts { listed, ..site })
    }
}

/// The images with the orientation of this round, in the order of the configuration.
fn images_of(book: &Book, round: Round) -> Result<Vec<ImageProducts<'_>>> {
    let times = book.parts(Round::Initial)?.into_iter();
    let orientations = book.parts(round)?.into_iter();
    let (models, registrations) = (book.parts(round)?, book.parts(round)?);
    let oriented = times.zip(orientations).zip(models).zip(registrations);
    let images = oriented.map(
        |(((times, orientation), model), registration)| ImageProducts {
            times,
            orientation,
            model,
            registration,
        },
    );
    Ok(images.collect())
}
