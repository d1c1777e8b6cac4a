//! The last step: products are staged, read back, named, and explained by the manifest.

use std::path::{Path, PathBuf};

use super::{
    PUBLISH,
    driver::{Ledger, MadeFrom, Publication},
    evidence::{complaints, complaints_of_pixels, judged, notes, rejected, warnings},
    manifest::manifest,
    outputs::Site,
    read_back::read_back,
};
use crate::{
    capabilities::{declarations, page, write_products},
    config::SiteConfig,
    error::Result,
    files::file_name,
    products::{Pages, Program, SiteBook, SiteStatements, error::ProductError},
    report,
    spice::{KernelSet, KernelView, Session},
    stage::{Input, Inputs, Output, Reason},
    stages::judge::Verdict,
    store::{
        cache::StageCache,
        manifest::Manifest,
        publish::{
            MANIFEST, damaged_product, entries, publish as publish_files, read_manifest, staging,
        },
    },
};

/// Raised when the layout of products changes.
const METHOD: u32 = 46;

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
        ..
    } = *from;
    let none = KernelSet::default();
    let kernels = site.kernels.as_ref().unwrap_or(&none);
    let statements = statements(config, site, methods)?;
    let mut book = site.book.clone();
    book.enter_value("required", site.required.clone().unwrap_or_default())?;
    book.enter_value("statements", statements.clone())?;
    let products = SiteBook {
        config,
        book: &book,
        kernels,
        folder,
        declarations: declarations(),
    };
    let staging = staging(folder)?;
    let files = products.with(|products| {
        let (report, overlays) = (page(products)?, report::overlays_page(products)?);
        let pages = Pages {
            report: &report,
            overlays: overlays.as_deref(),
        };
        write_products(&staging, products, pages)
    })?;
    let files: Vec<(PathBuf, u64)> = files
        .into_iter()
        .map(|product| (product.path, product.rows))
        .collect();
    read_back(config, site, kernels, &staging)?;
    let products = entries(&staging, &files)?;
    let manifest = manifest(config, site, (statements, products), ledger, inputs)?;
    publish_files(folder, &staging, &manifest)?;
    tracing::info!(
        stage = PUBLISH,
        products = manifest.products.len(),
        "published"
    );
    Ok(manifest)
}

/// The verdict, and what follows from all outputs.
fn statements(
    config: &SiteConfig,
    site: &Site,
    methods: &[(String, u32)],
) -> Result<SiteStatements> {
    let mut complaints = complaints(site)?;
    let warnings = warnings(config, site)?;
    for warning in &warnings {
        tracing::warn!("{warning}");
    }
    let (verdict, images_agree) = judged(config, site, &warnings, &complaints)?;
    // Complaints about pixels are no skipped records; the verdict receives them through the warnings.
    complaints.extend(complaints_of_pixels(site)?.0);
    Ok(SiteStatements {
        verdict,
        images_agree,
        rejected: rejected(site)?,
        complaints,
        notes: notes(site)?,
        program: Program {
            cspice: Session::version_of_cspice()?,
            methods: methods.to_vec(),
        },
    })
}
