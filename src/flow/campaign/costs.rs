//! Costs of the sites of a campaign that have been processed, from which those of the others are estimated.

use std::{fs, path::Path};

use serde::{Deserialize, Serialize};

use super::{SITES, selection::Campaign};
use crate::{
    error::{Locate as _, Result},
    files::{Mark, MarkAt, require_own},
    pds::pedr::{RECORD_BYTES, SHOTS},
    store::atomic,
};

/// File of the costs, beside the site files.
const COSTS: &str = "costs.json";
/// Recognises such a file.
const OWN: Mark = Mark {
    what: "costs that a campaign wrote",
    at: MarkAt::Start(b"{\"campaign_costs\":"),
};

/// Costs of processed images.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Costs {
    /// Images of the sites that were processed.
    pub images: u64,
    /// Time that these sites took, summed over sites that ran at the same time, seconds.
    pub seconds: f64,
    /// Size of their products.
    pub bytes: u64,
    /// Footprints in their windows.
    pub footprints: u64,
}

/// The form of the file.
#[derive(Serialize, Deserialize)]
struct Stored {
    campaign_costs: Costs,
}

/// Size of the input files of a campaign.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct InputSize {
    /// Files with labels or pixels of the selected images, and their size.
    pub image_files: u64,
    /// Size of these files.
    pub image_bytes: u64,
    /// PEDR files.
    pub pedr_files: u64,
    /// Size of these files.
    pub pedr_bytes: u64,
    /// Shots in these files at most.
    pub shots: u64,
}

impl Costs {
    /// The costs of the newest run of the campaign in `out` that processed a site; `None` if there is none.
    #[must_use]
    pub fn read(out: &Path) -> Option<Self> {
        let bytes = fs::read(out.join(SITES).join(COSTS)).ok()?;
        let stored: Stored = serde_json::from_slice(&bytes).ok()?;
        Some(stored.campaign_costs).filter(|costs| costs.images > 0)
    }

    /// Keeps the costs for later plans.
    ///
    /// # Errors
    /// A foreign file in place; a folder that cannot be written.
    pub fn keep(self, out: &Path) -> Result<()> {
        let path = out.join(SITES).join(COSTS);
        require_own(&path, &OWN)?;
        let stored = Stored {
            campaign_costs: self,
        };
        let bytes = serde_json::to_vec(&stored)
            .map_err(|error| crate::error::IoError {
                action: "write",
                source: error.into(),
            })
            .in_file(&path)?;
        atomic::replace(&path, &bytes, OWN)
    }

    /// Adds a site.
    pub fn add(&mut self, other: Self) {
        self.images += other.images;
        self.seconds += other.seconds;
        self.bytes += other.bytes;
        self.footprints += other.footprints;
    }
}

impl Campaign {
    /// The size of the input files, as the file system states it; files that have vanished count 0.
    #[must_use]
    pub fn input_size(&self) -> InputSize {
        let size = |path: &Path| fs::metadata(path).map_or(0, |found| found.len());
        let entries = self.sites.iter().flat_map(|site| &site.entries);
        let mut files: Vec<&Path> = entries
            .flat_map(|entry| [&entry.label, &entry.pixels])
            .flatten()
            .map(std::path::PathBuf::as_path)
            .collect();
        files.sort();
        files.dedup();
        let pedr = &self.config.pedr.files;
        let pedr_bytes: u64 = pedr.iter().map(|path| size(path)).sum();
        InputSize {
            image_files: files.len() as u64,
            image_bytes: files.iter().map(|path| size(path)).sum(),
            pedr_files: pedr.len() as u64,
            pedr_bytes,
            shots: pedr_bytes / RECORD_BYTES as u64 * SHOTS as u64,
        }
    }
}
