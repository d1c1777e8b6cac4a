//! The check of an archive as JSON.

use schemars::JsonSchema;
use serde::Serialize;

use super::WriteArchive;
use crate::{
    archive::ArchiveProducts,
    files::write_json,
    product::{Content, Declaration, Role},
};
use areograph_base::{altimetry::MolaClock, schema::DocumentSchema};
use areograph_config::RangeCheckConfig;
use areograph_stages::{
    check_archive::{FileCopy, FileFailure, FileRanges, KernelUsed, TRAJECTORY_TOLERANCE_M},
    judge::Verdict,
};

pub(super) static DOCUMENT: Declaration<WriteArchive> = Declaration {
    path: "archive.json",
    what: "verdict, limits, files with their problems, statistics by off-nadir angle, and interpolation errors of \
           positions",
    readers: "scripts",
    rows: "files",
    role: Role::Metadata,
    content: Content::Document(schema),
    write: |path, of| {
        write_json(path, &Document::of(of))?;
        Ok(of.ranges.files.len() as u64)
    },
    uses: &[],
};

/// The document.
#[derive(Serialize, JsonSchema)]
#[schemars(
    title = "Range check of an archive",
    description = "archive.json of areograph: comparison of every shot of the PEDR files with the kernels."
)]
struct Document<'a> {
    /// Always `areograph archive ranges 1`.
    #[schemars(extend("const" = "areograph archive ranges 1"))]
    format: &'static str,
    /// Whether every file could be read, and every profile is covered by the kernels and within the limits.
    verdict: &'a Verdict,
    /// Limits, and settings for the scan of clock biases.
    limits: &'a RangeCheckConfig,
    /// The clock of MOLA.
    mola_clock: &'a MolaClock,
    /// Kernels in load order.
    kernels: &'a [KernelUsed],
    /// Interpolation accuracy of spacecraft positions from the kernels.
    positions: Positions,
    /// Shots of profiles within the limits, by off-nadir angle, without outliers.
    off_nadir: Vec<OffNadirDocument>,
    /// Files that were checked.
    files: Vec<FileDocument<'a>>,
    /// Copies of checked files, which are not counted.
    copies: &'a [FileCopy],
    /// Files that could not be checked, or could not be read again for the products.
    failures: &'a [FileFailure],
}

/// Accuracy of tabulated positions.
#[derive(Serialize, JsonSchema)]
struct Positions {
    /// Tolerance of the tabulated positions, metres.
    tolerance_m: f64,
    /// Largest distance from CSPICE positions at instants not used for the tables, metres.
    #[schemars(range(min = 0.0))]
    largest_error_m: f64,
}

/// Shots within an interval of off-nadir angles.
#[derive(Serialize, JsonSchema)]
struct OffNadirDocument {
    /// Lower limit of the angles, degrees.
    from_deg: f64,
    /// Upper limit of the angles, degrees; absent for the last interval.
    #[serde(skip_serializing_if = "Option::is_none")]
    to_deg: Option<f64>,
    /// Shots.
    shots: u64,
    /// Mean of range minus distance, metres; absent for fewer than two shots.
    #[serde(skip_serializing_if = "Option::is_none")]
    mean_m: Option<f64>,
    /// Standard deviation of range minus distance, metres.
    #[serde(skip_serializing_if = "Option::is_none")]
    standard_deviation_m: Option<f64>,
}

/// A file.
#[derive(Serialize, JsonSchema)]
struct FileDocument<'a> {
    /// File name without folders; the path if files in several folders have the same name.
    file: &'a str,
    /// BLAKE3 of its bytes.
    #[schemars(regex(pattern = "^[0-9a-f]{64}$"))]
    blake3: &'a str,
    /// Data records.
    records: u64,
    /// Profiles.
    profiles: usize,
    /// Number of shots that were checked.
    shots: u64,
    /// Number of shots without a spacecraft position in the kernels.
    not_covered: u64,
    /// Number of problems in the records and the label.
    complaint_count: u64,
    /// First problems in the records and the label.
    complaints: &'a [String],
}

impl<'a> Document<'a> {
    fn of(archive: &ArchiveProducts<'a>) -> Self {
        let ranges = archive.ranges;
        let off_nadir = ranges.off_nadir().into_iter().map(|bin| {
            let figures = bin.mean_and_deviation_m();
            OffNadirDocument {
                from_deg: bin.from_deg,
                to_deg: bin.to_deg.is_finite().then_some(bin.to_deg),
                shots: bin.shots,
                mean_m: figures.map(|of| of[0]),
                standard_deviation_m: figures.map(|of| of[1]),
            }
        });
        Self {
            format: "areograph archive ranges 1",
            verdict: archive.verdict,
            limits: &ranges.limits,
            mola_clock: &ranges.clock,
            kernels: &ranges.kernels,
            positions: Positions {
                tolerance_m: TRAJECTORY_TOLERANCE_M,
                largest_error_m: ranges.trajectory_error_m(),
            },
            off_nadir: off_nadir.collect(),
            files: ranges.files.iter().map(|of| file(&of.found)).collect(),
            copies: &ranges.copies,
            failures: &ranges.failures,
        }
    }
}

fn file(found: &FileRanges) -> FileDocument<'_> {
    FileDocument {
        file: &found.file,
        blake3: &found.blake3,
        records: found.records,
        profiles: found.profiles.len(),
        shots: found.shots,
        not_covered: found.not_covered,
        complaint_count: found.complaint_count,
        complaints: &found.complaints,
    }
}

fn schema() -> DocumentSchema {
    DocumentSchema::of::<Document>("archive_ranges")
}
