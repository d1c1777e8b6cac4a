//! Results of the check of an archive, and the verdict on it.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::Serialize;

use super::{ArchiveProfile, FileRanges, OffNadirBin};
use crate::judge::Verdict;
use areograph_base::altimetry::{MolaClock, ShotFilter};
use areograph_config::RangeCheckConfig;
use areograph_pds::archive::{UNUSABLE_MAX, UNUSABLE_SHARE_MAX};
use areograph_store::files::Identity;

/// Profiles that the verdict names; all are counted.
const NAMED: usize = 10;

/// A file that was checked.
#[derive(Debug, Clone, PartialEq)]
pub struct CheckedFile {
    /// Its path, as requested.
    pub path: PathBuf,
    /// Its identity in the file system.
    pub identity: Identity,
    /// Results of its check.
    pub found: FileRanges,
}

/// A file that could not be checked.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, JsonSchema)]
pub struct FileFailure {
    /// File name without folders.
    pub file: String,
    /// The reason.
    pub why: String,
}

/// A file that is identical to another file.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, JsonSchema)]
pub struct FileCopy {
    /// Its path, as requested.
    pub file: String,
    /// Path of the identical file that was used.
    pub of: String,
}

/// A kernel on which positions may depend.
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

/// Results of the check of an archive.
#[derive(Debug, Clone, PartialEq)]
pub struct ArchiveRanges {
    /// The files, in the order of their first shots.
    pub files: Vec<CheckedFile>,
    /// Copies of them, which are not counted.
    pub copies: Vec<FileCopy>,
    /// Files that could not be checked, by name.
    pub failures: Vec<FileFailure>,
    /// Whether shots without a position in the kernels leave the archive valid.
    pub allow_uncovered: bool,
    /// The clock of MOLA.
    pub clock: MolaClock,
    /// Limits, and settings for the scan of clock biases.
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

    /// The worst of the judged profiles with their files: those that break a limit first, then by the largest share of one;
    /// those that cannot be compared come before others.
    #[must_use]
    pub fn worst(&self, count: usize) -> Vec<(&CheckedFile, &ArchiveProfile)> {
        let of_file = |file: &'_ CheckedFile| file.found.profiles.len();
        let mut all = Vec::with_capacity(self.files.iter().map(of_file).sum());
        for file in &self.files {
            for profile in &file.found.profiles {
                let is_within = profile.invalid_because.is_empty();
                all.extend(
                    profile
                        .share_of_limits
                        .map(|share| (is_within, share, file, profile)),
                );
            }
        }
        // The order of `total_cmp` has NaN above all numbers; the sort is stable.
        all.sort_by(|a, b| a.0.cmp(&b.0).then(b.1.total_cmp(&a.1)));
        let worst = all.into_iter().map(|(.., file, profile)| (file, profile));
        worst.take(count).collect()
    }

    /// Profiles with shots, but too few of them to be judged.
    #[must_use]
    pub fn too_short(&self) -> usize {
        let short = |of: &&ArchiveProfile| of.shots > 0 && !of.is_judged();
        self.profiles().filter(short).count()
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
        let without = self.profiles().filter(|profile| profile.shots == 0).count();
        let partly = |of: &&ArchiveProfile| of.shots > 0 && of.not_covered > 0;
        [without, self.profiles().filter(partly).count()]
    }

    /// Whether every file could be read, and every profile is covered by the kernels and within the limits.
    #[must_use]
    pub fn verdict(&self) -> Verdict {
        let mut remarks = Vec::new();
        let mut reasons = self.beyond_limits();
        reasons.extend(self.unread());
        let uncovered = self.uncovered();
        if self.allow_uncovered {
            remarks.extend(uncovered);
        } else {
            reasons.extend(uncovered);
        }
        let short = self.too_short();
        if short > 0 {
            let least = self.limits.shots_min;
            remarks.push(format!(
                "profiles with fewer than {least} shots, which are not judged: {short}"
            ));
        }
        if !self.copies.is_empty() {
            let count = self.copies.len();
            remarks.push(format!("copies of other files, counted once: {count}"));
        }
        reasons.extend(self.damaged());
        let complaints = self.sum(|file| file.complaint_count);
        if complaints > 0 {
            remarks.push(format!(
                "{complaints} complaints about records and labels; the data concerned were skipped"
            ));
        }
        Verdict {
            valid: reasons.is_empty(),
            reasons,
            remarks,
            untested: Vec::new(),
            checks: Vec::new(),
        }
    }

    /// Profiles that break limits, or the statement that none could be judged.
    fn beyond_limits(&self) -> Vec<String> {
        if self.sum(|file| file.shots) == 0 {
            return vec!["no shot could be checked against the kernels".to_owned()];
        }
        if !self.profiles().any(ArchiveProfile::is_judged) {
            return vec!["no profile has enough shots to be judged".to_owned()];
        }
        let is_beyond = |of: &&ArchiveProfile| !of.invalid_because.is_empty();
        let (beyond, all) = (
            self.profiles().filter(is_beyond).count(),
            self.profiles().count(),
        );
        let summary = format!("{beyond} of {all} profiles exceed a limit; the worst are:");
        let summary = (beyond > 0).then_some(summary).into_iter();
        let named = self.worst(beyond.min(NAMED)).into_iter();
        let named = named.map(|(_, of)| format!("{}: {}", of.id(), of.invalid_because.join("; ")));
        summary.chain(named).collect()
    }

    /// Files with too many complaints, which profiles of other files do not reveal.
    fn damaged(&self) -> impl Iterator<Item = String> {
        let files = self.files.iter().map(|file| &file.found);
        let damaged = files.filter(|file| {
            file.complaint_count as f64
                > UNUSABLE_SHARE_MAX * file.records as f64 + UNUSABLE_MAX as f64
        });
        damaged.take(NAMED).map(|file| {
            format!(
                "{}: {} complaints about {} records; expected at most {UNUSABLE_MAX} plus one per hundred records: the \
                 file was damaged in transfer",
                file.file, file.complaint_count, file.records
            )
        })
    }

    fn unread(&self) -> Option<String> {
        let names = self.failures.iter().map(|failure| failure.file.as_str());
        let names: Vec<&str> = names.take(NAMED).collect();
        let more = match self.failures.len().saturating_sub(NAMED) {
            0 => String::new(),
            more => format!(" and {more} more"),
        };
        (!names.is_empty()).then(|| {
            format!(
                "{} could not be read: {}{more}",
                match self.failures.len() {
                    1 => "1 file or folder".to_owned(),
                    count => format!("{count} files or folders"),
                },
                names.join(", ")
            )
        })
    }

    fn uncovered(&self) -> Option<String> {
        let [without, partly] = self.not_covered();
        let (shots, all) = (self.sum(|file| file.not_covered), self.profiles().count());
        (without + partly > 0).then(|| {
            format!(
                "the kernels contain no position for {shots} shots: {without} of {all} profiles could not be checked, \
                 and {partly} only in part"
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use areograph_base::altimetry::{BiasScope, TagSign};

    fn profile(orbit: u32, shots: u32, share: Option<f64>) -> ArchiveProfile {
        let is_beyond = share.is_some_and(|share| !(share <= 1.0));
        ArchiveProfile {
            file: "a.b".to_owned(),
            orbit,
            part: 1,
            shots,
            share_of_limits: share,
            invalid_because: is_beyond
                .then(|| "a limit".to_owned())
                .into_iter()
                .collect(),
            ..ArchiveProfile::default()
        }
    }

    fn ranges(profiles: Vec<ArchiveProfile>) -> ArchiveRanges {
        let shots = profiles
            .iter()
            .map(|profile| u64::from(profile.shots))
            .sum();
        ArchiveRanges {
            files: vec![CheckedFile {
                path: PathBuf::from("a.b"),
                identity: Identity {
                    device: 0,
                    inode: 0,
                    bytes: 0,
                    modified: [0; 2],
                    changed: [0; 2],
                },
                found: FileRanges {
                    profiles,
                    shots,
                    ..FileRanges::default()
                },
            }],
            copies: Vec::new(),
            failures: Vec::new(),
            allow_uncovered: false,
            clock: MolaClock {
                bias_s: 0.0,
                sign: TagSign::Late,
                scope: BiasScope::SpkLookup,
                source: String::new(),
            },
            limits: RangeCheckConfig::default(),
            filter: ShotFilter {
                classes: Vec::new(),
                channels: Vec::new(),
                attitude_flags: Vec::new(),
                off_nadir_max_rad: 0.0,
                solar_longitude_rad: ShotFilter::ALL_SEASONS,
            },
            kernels: Vec::new(),
        }
    }

    #[test]
    fn a_remnant_is_no_reason_and_broken_profiles_come_first() {
        let remnant = || profile(2, 5, None);
        let good = ranges(vec![profile(1, 900, Some(0.4)), remnant()]);
        let verdict = good.verdict();
        assert!(verdict.valid, "{:?}", verdict.reasons);
        assert!(verdict.remarks[0].starts_with("profiles with fewer than 20 shots"));
        assert!(!ranges(vec![remnant()]).verdict().valid);
        let bad = ranges(vec![
            remnant(),
            profile(3, 900, Some(0.9)),
            profile(4, 900, Some(1.5)),
            profile(5, 900, Some(f64::NAN)),
        ]);
        let orbits: Vec<u32> = bad.worst(9).iter().map(|(_, of)| of.orbit).collect();
        assert_eq!(orbits, [5, 4, 3]);
        let reasons = bad.verdict().reasons;
        assert_eq!(reasons[0], "2 of 4 profiles exceed a limit; the worst are:");
        assert_eq!(reasons[1..], ["a.b/5: a limit", "a.b/4: a limit"]);
    }
}
