//! A net from its tables to its products.

use std::{
    path::{Path, PathBuf},
    sync::atomic::AtomicBool,
};

use super::{
    PUBLISH,
    out::check_out_path,
    publish::{keep, standing},
};
use crate::{
    config::NetConfig,
    error::{Locate, Result},
    files::{InputFiles, file_name},
    products::{NetProducts, write_net_products},
    report::net_page,
    stage::{Inputs, Output, Provenance, Stage},
    stages::triangulate::{NetFiles, NetKeys, Triangulate, Triangulation, net_files},
    store::{
        cache::StageCache,
        lock::SiteLock,
        manifest::{Complaints, ConfigurationEntry, Manifest, StageEntry, figures},
        publish::{CACHE, entries, note_failure, publish, read_manifest, staging},
    },
};

/// Raised when the products of a net are laid out anew.
const METHOD: u32 = 1;
/// Complaints that the manifest quotes; all are counted.
const COMPLAINTS_QUOTED: usize = 100;

/// What a run of a net did.
#[derive(Debug)]
pub struct NetOutcome {
    /// Folder of the products.
    pub folder: PathBuf,
    /// The manifest of the products.
    pub manifest: Manifest,
    /// Whether the products stood already.
    pub unchanged: bool,
}

/// Triangulates a net and publishes its products in `<out>/<net>`, when something has changed since the last time.
///
/// # Errors
/// Tables that cannot be read, a net without a solution, a disk that refuses; what stood before stands then.
pub fn run_net(config: &NetConfig, out: &Path, force: bool) -> Result<NetOutcome> {
    check_out_path(out)?;
    let folder = out.join(&config.net);
    let ran = run(config, &folder, force).in_site(&config.net);
    if folder.is_dir() {
        let failure = ran.as_ref().err().map(ToString::to_string);
        note_failure(&folder, failure.as_deref());
    }
    let (manifest, unchanged) = ran?;
    Ok(NetOutcome {
        folder,
        manifest,
        unchanged,
    })
}

fn run(config: &NetConfig, folder: &Path, force: bool) -> Result<(Manifest, bool)> {
    let stop = AtomicBool::new(false);
    let files = InputFiles::default();
    let hashed = files.hash_all(&net_files(config), &stop)?;
    let _lock = SiteLock::take(folder)?;
    let cache = StageCache::new(&folder.join(CACHE), force);
    let stage = Triangulate {
        net: NetKeys(config),
        files: NetFiles(&hashed),
    };
    let output = triangulated(&stage, &cache, &stop)?;
    files.verify_all()?;
    let inputs = publish_inputs(config, &output);
    match standing(folder, &cache, &inputs) {
        Ok(manifest) => return Ok((manifest, true)),
        Err(reason) => tracing::info!(stage = PUBLISH, %reason, "running"),
    }
    let manifest = publish_net(config, folder, output.value()?, &output, &inputs);
    let manifest = manifest.in_stage(PUBLISH)?;
    keep(&cache, inputs, &manifest).in_stage(PUBLISH)?;
    Ok((manifest, false))
}

fn triangulated(
    stage: &Triangulate,
    cache: &StageCache,
    stop: &AtomicBool,
) -> Result<Output<Triangulation>> {
    let inputs = stage.inputs();
    match cache.load(Triangulate::NAME, &inputs) {
        Ok(output) => Ok(output),
        Err(reason) => {
            tracing::info!(stage = Triangulate::NAME, %reason, "running");
            let result = stage.run(stop).in_stage(Triangulate::NAME)?;
            cache.store(Triangulate::NAME, inputs, result)
        }
    }
}

/// The configuration as written, and the result.
fn publish_inputs(config: &NetConfig, output: &Output<Triangulation>) -> Inputs {
    let mut inputs = Inputs::new(METHOD);
    for (key, value) in &config.keys {
        inputs.setting(key, value);
    }
    inputs.setting("(file name)", &file_name(&config.file));
    let provenance: Option<&Provenance> = output.provenance();
    inputs.output(Triangulate::NAME, provenance.map(|of| &*of.blake3));
    inputs.fingerprint_of(Triangulate::NAME, provenance.map(|of| &*of.fingerprint));
    inputs
}

fn publish_net(
    config: &NetConfig,
    folder: &Path,
    result: &Triangulation,
    output: &Output<Triangulation>,
    inputs: &Inputs,
) -> Result<Manifest> {
    let staging = staging(folder)?;
    let page = net_page(config, result)?;
    let net = NetProducts {
        config,
        result,
        page: &page,
    };
    let files: Vec<(PathBuf, u64)> = write_net_products(&staging, &net)?
        .into_iter()
        .map(|product| (product.path, product.rows))
        .collect();
    let manifest = Manifest {
        products: entries(&staging, &files)?,
        stages: stages(output, inputs),
        ..manifest(config, result)
    };
    publish(folder, &staging, &manifest)?;
    tracing::info!(
        stage = PUBLISH,
        products = manifest.products.len(),
        "published"
    );
    Ok(read_manifest(folder).unwrap_or(manifest))
}

fn stages(output: &Output<Triangulation>, inputs: &Inputs) -> Vec<StageEntry> {
    let entry = |name: &str, fingerprint: String| StageEntry {
        name: name.to_owned(),
        fingerprint,
    };
    let triangulated = output
        .provenance()
        .map(|of| entry(Triangulate::NAME, of.fingerprint.clone()));
    triangulated
        .into_iter()
        .chain([entry(PUBLISH, inputs.fingerprint())])
        .collect()
}

/// What the manifest says of a net but for products and stages.
fn manifest(config: &NetConfig, result: &Triangulation) -> Manifest {
    let totals = &result.totals;
    let counts = [
        ("pictures", result.pictures.len() as u64),
        ("points", result.points.len() as u64),
        ("measurements", result.measurements.len() as u64),
        ("controls", result.controls.len() as u64),
        ("redundancy", totals.redundancy),
        ("blunders", totals.removed),
        ("rejected_controls", totals.rejected_controls),
    ];
    let largest = |of: [f64; 2]| of[0].max(of[1]);
    let figures = [
        (
            figures::TIE_DEVIATION_RMS_M,
            largest(totals.deviation_rms_m),
        ),
        (
            figures::CONTROL_RESIDUAL_RMS_M,
            largest(totals.control_rms_m),
        ),
    ];
    Manifest {
        tool: "areograph".to_owned(),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        site: config.net.clone(),
        verdict: result.verdict.clone(),
        configuration: ConfigurationEntry {
            file_name: file_name(&config.file),
            blake3: config.blake3.clone(),
            keys: config.keys.clone(),
        },
        biases: Vec::new(),
        kernels: Vec::new(),
        kernel_choice: Vec::new(),
        stages: Vec::new(),
        products: Vec::new(),
        counts: counts.map(|(name, count)| (name.to_owned(), count)).into(),
        figures: figures
            .map(|(name, figure)| (name.to_owned(), figure))
            .into(),
        rejected: std::collections::BTreeMap::new(),
        complaints: Complaints {
            count: result.complaint_count,
            texts: result
                .complaints
                .iter()
                .take(COMPLAINTS_QUOTED)
                .cloned()
                .collect(),
        },
        notes: Vec::new(),
        finished_utc: chrono::Utc::now().format("%Y-%m-%dT%H:%M:%SZ").to_string(),
    }
}
