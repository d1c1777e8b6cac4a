//! Opens kernels one by one and reads their coverage.

use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use super::Worker;
use crate::{
    config::built_in_instruments,
    error::{Error, Kind, Result, Stopped},
    files::InputFiles,
    kernel_source::KernelSelection,
    service::worker::protocol::Probed,
    spice::{Kernel, KernelRole, KernelSet, RequiredCoverage, Session},
    time::Intervals,
};

impl Worker {
    /// Opens every kernel; each is announced to the service first, which can so identify a kernel that ends the
    /// worker.
    pub(super) fn probe(&self, files: &[PathBuf]) -> Result<Vec<Probed>> {
        let run = self.hashes.files().within(&self.roots);
        let mut clocks: Option<KernelSet> = None;
        let mut probed = Vec::with_capacity(files.len());
        for path in files {
            Stopped::check(&self.stop)?;
            self.reporter.stage(
                &path.to_string_lossy(),
                "running",
                "opened with CSPICE",
                0.0,
            );
            let opened = Kernel::inspect(path, &run).and_then(|kernel| {
                let clocks = match kernel.role {
                    KernelRole::Ck => clocks
                        .get_or_insert_with(|| self.clocks(path, files, &run))
                        .clone(),
                    _ => KernelSet::default(),
                };
                open(clocks, kernel)
            });
            let (problem, coverage) = match opened {
                Ok(coverage) => (None, coverage),
                Err(failure) if failure.kind() == Kind::Interrupted => return Err(failure),
                Err(failure) => (Some(without_file(&failure)), Value::Null),
            };
            probed.push(Probed {
                path: path.clone(),
                blake3: run.hash(path).map(|file| file.blake3).unwrap_or_default(),
                problem,
                coverage,
            });
        }
        self.hashes.keep(&run);
        Ok(probed)
    }

    /// Leap seconds and the spacecraft clock, without which CSPICE cannot convert the times of a C-kernel: the kernels
    /// of the task, or the latest ones of the folder that contains the C-kernel.
    fn clocks(&self, kernel: &Path, files: &[PathBuf], run: &InputFiles) -> KernelSet {
        let is_clock = |role| matches!(role, KernelRole::Lsk | KernelRole::Sclk);
        let given = files
            .iter()
            .filter_map(|path| Kernel::inspect(path, run).ok());
        let given: Vec<Kernel> = given.filter(|kernel| is_clock(kernel.role)).collect();
        let has = |role| given.iter().any(|kernel| kernel.role == role);
        if has(KernelRole::Lsk) && has(KernelRole::Sclk) {
            return given
                .into_iter()
                .fold(KernelSet::default(), KernelSet::with);
        }
        let leads_to = kernel.canonicalize().unwrap_or_else(|_| kernel.to_owned());
        let root = self.roots.iter().find(|root| leads_to.starts_with(root));
        let selection = KernelSelection {
            root: root.map_or_else(
                || leads_to.parent().unwrap_or(Path::new("/")).to_owned(),
                Clone::clone,
            ),
            spk_family: String::new(),
            ck_quality: Vec::new(),
            pinned: Vec::new(),
        };
        let selected = KernelSet::select_of(
            run,
            &selection,
            built_in_instruments(),
            &RequiredCoverage::default(),
        );
        selected.map_or_else(|_| KernelSet::default(), |set| set.of_roles(is_clock))
    }
}

/// Coverage of a kernel, opened by CSPICE; null for kinds without coverage and for C-kernels without clocks.
fn open(clocks: KernelSet, kernel: Kernel) -> Result<Value> {
    let role = kernel.role;
    // A metakernel is a list that CSPICE would follow.
    if role == KernelRole::Meta {
        return Ok(Value::Null);
    }
    let without_clocks = clocks.kernels().is_empty();
    let session = Session::open(&clocks.with(kernel))?;
    if !matches!(role, KernelRole::Spk | KernelRole::Ck) || role == KernelRole::Ck && without_clocks
    {
        return Ok(Value::Null);
    }
    let coverage = session.coverage()?;
    // Coverage of this kernel only; the clocks have none.
    let own = coverage.per_kernel.first().map(|(_, own)| own.clone());
    let own = own.unwrap_or_default();
    let nothing = Intervals::default();
    let (position, attitude) = if role == KernelRole::Spk {
        (&own, &nothing)
    } else {
        (&nothing, &own)
    };
    Ok(json!({ "position": position, "attitude": attitude }))
}

/// A failure without the file name, which is reported beside it.
fn without_file(failure: &Error) -> String {
    failure.cause.to_string()
}
