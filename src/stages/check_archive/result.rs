//! What the check of an archive found, and the verdict on it.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::Serialize;

use super::{ArchiveProfile, FileRanges, OffNadirBin};
use crate::{
    altimetry::{MolaClock, ShotFilter},
    config::RangeCheckConfig,
    files::Identity,
    stages::judge::Verdict,
};

/// Profiles that the verdict names; all are counted.
const NAMED: usize = 10;

/// A file that was checked.
#[derive(Debug, Clone, PartialEq)]
pub struct CheckedFile {
    /// Where it lies, as it was asked for.
    pub path: PathBuf,
    /// What the file system said of it.
    pub identity: Identity,
    /// What was found.
    pub found: FileRanges,
}

/// A file that could not be checked.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, JsonSchema)]
pub struct FileFailure {
    /// File name without folders.
    pub file: String,
    /// Why.
    pub why: String,
}

/// A kernel that positions may depend on.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, JsonSchema)]
pub struct KernelUsed {
    /// File name without folders.
    pub name: String,
    /// Role by content.
    pub role: String,
    /// Size.
    pub bytes: u64,
    /// BLAKE3 of the file, hexadecimal.
    pub blake3: String,
}

/// What the check of an archive found.
#[derive(Debug, Clone, PartialEq)]
pub struct ArchiveRanges {
    /// The files, in the order of their first shots.
    pub files: Vec<CheckedFile>,
    /// Files that could not be checked, by name.
    pub failures: Vec<FileFailure>,
    /// The clock of MOLA.
    pub clock: MolaClock,
    /// Limits and the scan of clock biases.
    pub limits: RangeCheckConfig,
    /// Shots that were checked.
    pub filter: ShotFilter,
    /// Kernels in load order.
    pub kernels: Vec<KernelUsed>,
}

impl ArchiveRanges {
    /// All profiles, in the order of files and records.
    pub fn profiles(&self) -> impl Iterator<Item = &ArchiveProfile> {
        self.files.iter().flat_map(|file| &file.found.profiles)
    }

    /// The worst profiles with their files, by the largest share of a limit: those that cannot be compared come first.
    #[must_use]
    pub fn worst(&self, count: usize) -> Vec<(&CheckedFile, &ArchiveProfile)> {
        let of_file = |file: &'_ CheckedFile| file.found.profiles.len();
        let mut all = Vec::with_capacity(self.files.iter().map(of_file).sum());
        for file in &self.files {
            let checked = file.found.profiles.iter().filter(|of| of.shots > 0);
            all.extend(checked.map(|profile| (file, profile)));
        }
        // The order of `total_cmp` has NaN above all numbers; the sort is stable.
        all.sort_by(|a, b| b.1.share_of_limits.total_cmp(&a.1.share_of_limits));
        all.truncate(count);
        all
    }

    /// Sum of a count over all files.
    #[must_use]
    pub fn sum(&self, of: impl Fn(&FileRanges) -> u64) -> u64 {
        self.files.iter().map(|file| of(&file.found)).sum()
    }

    /// Shots of profiles within the limits by off-nadir angle.
    #[must_use]
    pub fn off_nadir(&self) -> Vec<OffNadirBin> {
        let mut sums = OffNadirBin::all();
        for file in &self.files {
            for (sum, bin) in sums.iter_mut().zip(&file.found.off_nadir) {
                sum.add(bin);
            }
        }
        sums
    }

    /// Largest error of tabulated trajectories against the kernels, metres.
    #[must_use]
    pub fn trajectory_error_m(&self) -> f64 {
        let errors = self.files.iter().map(|file| file.found.trajectory_error_m);
        errors.fold(0.0, f64::max)
    }

    /// Profiles of which no shot, or not every shot, has a position in the kernels.
    #[must_use]
    pub fn not_covered(&self) -> [usize; 2] {
        let without = self.profiles().filter(|of| of.shots == 0).count();
        let partly = |of: &&ArchiveProfile| of.shots > 0 && of.not_covered > 0;
        [without, self.profiles().filter(partly).count()]
    }

    /// Whether every profile that could be checked keeps the limits; what else must be weighed is a remark.
    #[must_use]
    pub fn verdict(&self) -> Verdict {
        let mut reasons = Vec::new();
        let mut remarks = Vec::new();
        if self.sum(|file| file.shots) == 0 {
            reasons.push("no shot could be checked against the kernels".to_owned());
        }
        let beyond: Vec<&ArchiveProfile> = self
            .profiles()
            .filter(|profile| !profile.invalid_because.is_empty())
            .collect();
        let all = self.profiles().count();
        if !beyond.is_empty() {
            reasons.push(format!(
                "{} of {all} profiles break a limit, first of all these:",
                beyond.len()
            ));
        }
        let named = self.worst(beyond.len().min(NAMED));
        let named = named
            .iter()
            .filter(|(_, of)| !of.invalid_because.is_empty());
        reasons
            .extend(named.map(|(_, of)| format!("{}: {}", of.id(), of.invalid_because.join("; "))));
        let [without, partly] = self.not_covered();
        if without + partly > 0 {
            remarks.push(format!(
                "the kernels have no position for {} shots: {without} of {all} profiles could not be checked, {partly} in part",
                self.sum(|file| file.not_covered)
            ));
        }
        if !self.failures.is_empty() {
            let count = self.failures.len();
            remarks.push(format!("{count} files could not be checked"));
        }
        let complaints = self.sum(|file| file.complaint_count);
        if complaints > 0 {
            remarks.push(format!(
                "{complaints} complaints of records and labels; what they name was left out"
            ));
        }
        Verdict {
            valid: reasons.is_empty(),
            reasons,
            remarks,
            checks: Vec::new(),
        }
    }
}
