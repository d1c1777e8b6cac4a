//! The last step: products staged, read back, named, and explained by the manifest.

use std::path::{Path, PathBuf};

use super::{
    PUBLISH,
    driver::Ledger,
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
    stage::{Input, Inputs, Output, Reason},
    stages::site_image::SiteImage,
    store::{
        cache::StageCache,
        manifest::Manifest,
        publish::{
            MANIFEST, damaged_product, entries, publish as publish_files, read_manifest, staging,
        },
    },
};

/// Raised when products are laid out anew.
const METHOD: u32 = 16;

/// The configuration as written, the outlines that it names, all kernels and where they lie from `folder`, and
/// every stage with what it was made from.
pub(super) fn inputs(config: &SiteConfig, site: &Site, folder: &Path, ledger: &Ledger) -> Inputs {
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

/// The products that stand for these inputs, or why they have to be made.
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
    match damaged_product(folder, &manifest) {
        Some(path) => Err(changed(&path)),
        None => Ok(manifest),
    }
}

/// Keeps what was published for the next run, as the text that a manifest is: the form of stage outputs cannot leave out
/// what is unknown.
///
/// # Errors
/// A disk that refuses.
pub(super) fn keep(cache: &StageCache, inputs: Inputs, manifest: &Manifest) -> Result<()> {
    let text = serde_json::to_string(manifest).map_err(ProductError::refused("encode JSON"))?;
    cache.store(PUBLISH, inputs, text).map(|_| ())
}

/// Makes the products and puts them under their final names.
///
/// # Errors
/// A product that does not read back, a disk that refuses.
pub(super) fn publish(
    config: &SiteConfig,
    site: &Site,
    folder: &Path,
    ledger: &Ledger,
    methods: &[(String, u32)],
    inputs: &Inputs,
) -> Result<Manifest> {
    let none = KernelSet::default();
    let kernels = site.kernels.as_ref().unwrap_or(&none);
    let described = site.described.value()?;
    let (notes, mut complaints, rejected) =
        (notes(config, site)?, complaints(site)?, rejected(site)?);
    let warnings = warnings(config, site)?;
    for warning in &warnings {
        tracing::warn!("{warning}");
    }
    let (verdict, images_agree) = judged(config, site, &warnings, &complaints)?;
    // Those of pixels are no skipped records; the verdict has them from the warnings.
    complaints.extend(complaints_of_pixels(site)?.0);
    let images = image_products(&site.images)?;
    let adjusted_images = site
        .adjustment
        .as_ref()
        .map(|of| image_products(&of.images));
    let adjusted_images = adjusted_images.transpose()?.unwrap_or_default();
    let tables = site.adjustment.iter().flat_map(|of| &of.tables);
    let tables = tables.map(Output::value).collect::<Result<Vec<_>>>()?;
    let adjustment = site.adjustment.as_ref().map(|adjustment| {
        Ok::<_, Error>(AdjustmentProducts {
            kernels,
            folder,
            adjusted: adjustment.adjusted.value()?,
            heights: adjustment.intersection.heights.value()?,
            images: &adjusted_images,
            tables: &tables,
            intersected: adjustment.intersection.intersected.value()?,
            pairs: adjustment.intersection.pairs.value()?,
            images_agree,
        })
    });
    let converted = site.converted.value()?;
    let products = SiteProducts {
        config,
        kernels: &described.kernels,
        metakernel: &kernels.metakernel_text(Some(folder)),
        required: &site.required.clone().unwrap_or_default(),
        images: &images,
        conversions: &converted.files,
        footprints: &converted.footprints,
        utc: site.utc.value()?,
        profiles: site.profiles.value()?,
        ranges: site.ranges.value()?,
        rejected: &rejected,
        complaints: &complaints,
        notes: &notes,
        verdict: &verdict,
        geometric: geometric_products(site, adjustment.transpose()?)?,
        overlays: site.overlays.as_ref().map(Output::value).transpose()?,
        surface: site.surface.as_ref().map(Output::value).transpose()?,
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

/// The images as products want them.
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

/// What tie points make of the site; nothing where they could not be intersected.
fn geometric_products<'a>(
    site: &'a Site,
    adjustment: Option<AdjustmentProducts<'a>>,
) -> Result<Option<GeometricProducts<'a>>> {
    let (Some(ties), Some(initial)) = (&site.ties, &site.intersection) else {
        return Ok(None);
    };
    Ok(Some(GeometricProducts {
        ties: ties.value()?,
        intersected: initial.intersected.value()?,
        pairs: initial.pairs.value()?,
        heights: initial.heights.value()?,
        adjustment,
    }))
}
