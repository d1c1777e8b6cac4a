//! The last step: products are staged, read back, named, and explained by the manifest.

use std::path::{Path, PathBuf};

use super::{
    PUBLISH,
    driver::{Ledger, MadeFrom, Publication},
    evidence::{complaints, complaints_of_pixels, judged, notes, rejected, warnings},
    manifest::{Account, manifest},
    outputs::Site,
    read_back::read_back,
};
use crate::{
    config::SiteConfig,
    error::{Error, Result},
    files::file_name,
    products::{
        AdjustmentProducts, GeometricProducts, ImageProducts, Pages, Program, SiteProducts,
        error::ProductError, write_products,
    },
    report,
    spice::{KernelSet, KernelView, Session},
    stage::{Input, Inputs, Output, Reason, Round},
    stages::{
        convert_datum::Converted, describe_kernels::KernelDescription, judge::Verdict,
        rectify_images::Orthoimage, site_image::SiteImage,
    },
    store::{
        cache::StageCache,
        manifest::Manifest,
        publish::{
            MANIFEST, damaged_product, entries, publish as publish_files, read_manifest, staging,
        },
    },
};

/// Raised when the layout of products changes.
const METHOD: u32 = 28;

/// The products of a site.
pub(super) struct SitePublication<'a> {
    pub(super) config: &'a SiteConfig,
    pub(super) site: &'a Site,
}

impl Publication for SitePublication<'_> {
    fn inputs(&self, folder: &Path, ledger: &Ledger) -> Inputs {
        inputs(self.config, self.site, folder, ledger)
    }

    fn verdict(&self) -> Result<Verdict> {
        let (config, site) = (self.config, self.site);
        Ok(judged(config, site, &warnings(config, site)?, &complaints(site)?)?.0)
    }

    fn publish(&self, from: &MadeFrom<'_>) -> Result<Manifest> {
        publish(self.config, self.site, from)
    }
}

/// The configuration as written, the outlines that it names, all kernels and their paths relative to `folder`, and
/// the inputs of every stage.
fn inputs(config: &SiteConfig, site: &Site, folder: &Path, ledger: &Ledger) -> Inputs {
    let mut inputs = Inputs::new(METHOD);
    for (key, value) in &config.keys {
        inputs.setting(key, value);
    }
    inputs.setting("(file name)", &file_name(&config.file));
    inputs.setting("windows (outlines)", &config.windows);
    inputs.setting("altimeter (file)", &config.altimeter);
    (&KernelView::all(site.kernels.as_ref())).add_to("kernels", &mut inputs);
    if let Some(kernels) = &site.kernels {
        inputs.setting("kernels (places)", &kernels.metakernel_text(Some(folder)));
        inputs.setting("kernels (selection)", kernels.explanation());
    }
    for (label, provenance) in ledger {
        let provenance = provenance.as_ref();
        inputs.output(label, provenance.map(|of| &*of.blake3));
        inputs.fingerprint_of(label, provenance.map(|of| &*of.fingerprint));
    }
    if let Some(failure) = &site.adjustment_failure {
        inputs.setting("(failed adjustment)", &failure.to_string());
    }
    inputs
}

/// The existing products of these inputs, or the reason why they must be made.
pub(super) fn standing(
    folder: &Path,
    cache: &StageCache,
    inputs: &Inputs,
) -> std::result::Result<Manifest, Reason> {
    let stored: Output<String> = cache.load(PUBLISH, inputs)?;
    let changed = |what: &str| Reason::Changed(vec![format!("{what} is missing or was changed")]);
    let manifest = stored
        .get()
        .and_then(|text| serde_json::from_str(text).ok());
    let manifest: Manifest = manifest.ok_or(Reason::Damaged)?;
    if read_manifest(folder).as_ref() != Some(&manifest) {
        return Err(changed(MANIFEST));
    }
    match damaged_product(folder, &manifest, cache.own()) {
        Some(path) => Err(changed(&path)),
        None => Ok(manifest),
    }
}

/// Keeps the published manifest for the next run, as JSON: the format of stage outputs cannot omit unknown values.
///
/// # Errors
/// Write errors.
pub(super) fn keep(cache: &StageCache, inputs: Inputs, manifest: &Manifest) -> Result<()> {
    let text = serde_json::to_string(manifest).map_err(ProductError::refused("encode JSON"))?;
    cache.store(PUBLISH, inputs, text).map(|_| ())
}

/// Makes the products and gives them their final names.
///
/// # Errors
/// A product that cannot be read back, write errors.
fn publish(config: &SiteConfig, site: &Site, from: &MadeFrom<'_>) -> Result<Manifest> {
    let MadeFrom {
        folder,
        ledger,
        methods,
        inputs,
    } = *from;
    let none = KernelSet::default();
    let kernels = site.kernels.as_ref().unwrap_or(&none);
    let book = &site.book;
    let described = book.of::<KernelDescription>()?;
    let (notes, mut complaints, rejected) =
        (notes(config, site)?, complaints(site)?, rejected(site)?);
    let warnings = warnings(config, site)?;
    for warning in &warnings {
        tracing::warn!("{warning}");
    }
    let (verdict, images_agree) = judged(config, site, &warnings, &complaints)?;
    // Complaints about pixels are no skipped records; the verdict receives them through the warnings.
    complaints.extend(complaints_of_pixels(site)?.0);
    let images = image_products(&site.images)?;
    let adjusted_images = site.adjusted_images.as_deref().unwrap_or_default();
    let adjusted_images = image_products(adjusted_images)?;
    let tables = book.parts(Round::Adjusted)?;
    let adjustment = book.find(Round::Initial)?.map(|adjusted| {
        Ok::<_, Error>(AdjustmentProducts {
            kernels,
            folder,
            adjusted,
            heights: book.require(Round::Adjusted)?.value()?,
            images: &adjusted_images,
            tables: &tables,
            intersected: book.require(Round::Adjusted)?.value()?,
            pairs: book.require::<Vec<_>>(Round::Adjusted)?.value()?,
            images_agree,
        })
    });
    let adjustment = adjustment.transpose()?;
    let geometric = book.find(Round::Initial)?.map(|intersected| {
        Ok::<_, Error>(GeometricProducts {
            ties: book.of()?,
            intersected,
            pairs: book.of::<Vec<_>>()?,
            heights: book.of()?,
            adjustment,
        })
    });
    let converted = book.of::<Converted>()?;
    let orthoimages = book.find::<Vec<Orthoimage>>(Round::Initial)?;
    let products = SiteProducts {
        config,
        kernels: &described.kernels,
        metakernel: &kernels.metakernel_text(Some(folder)),
        required: &site.required.clone().unwrap_or_default(),
        images: &images,
        conversions: &converted.files,
        footprints: &converted.footprints,
        utc: book.of::<Vec<_>>()?,
        profiles: book.of::<Vec<_>>()?,
        profile_check: book.of()?,
        ranges: book.of()?,
        rejected: &rejected,
        complaints: &complaints,
        notes: &notes,
        verdict: &verdict,
        geometric: geometric.transpose()?,
        overlays: book.find(Round::Initial)?,
        surface: book.find(Round::Initial)?,
        orthoimages: orthoimages.map_or(&[], Vec::as_slice),
        program: &Program {
            cspice: Session::version_of_cspice()?,
            methods: methods.to_vec(),
        },
    };
    let (report, overlays) = (report::page(&products)?, report::overlays_page(&products)?);
    let pages = Pages {
        report: &report,
        overlays: overlays.as_deref(),
    };
    let staging = staging(folder)?;
    let files: Vec<(PathBuf, u64)> = write_products(&staging, &products, pages)?
        .into_iter()
        .map(|product| (product.path, product.rows))
        .collect();
    read_back(config, site, kernels, &staging)?;
    let account = Account {
        verdict,
        products: entries(&staging, &files)?,
        notes,
        complaints,
        rejected,
    };
    let manifest = manifest(config, site, account, ledger, inputs)?;
    publish_files(folder, &staging, &manifest)?;
    tracing::info!(
        stage = PUBLISH,
        products = manifest.products.len(),
        "published"
    );
    Ok(manifest)
}

/// The images in the form that products require.
fn image_products(images: &[SiteImage]) -> Result<Vec<ImageProducts<'_>>> {
    let images = images.iter().map(|image| {
        Ok(ImageProducts {
            times: image.times.value()?,
            orientation: image.orientation.value()?,
            model: image.model.value()?,
            registration: image.registration.value()?,
        })
    });
    images.collect()
}
