//! The ways to name kernels: listed, chosen from a folder, or as rival sets.

use std::path::PathBuf;

use serde::Serialize;

/// The ways to name kernels.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum KernelSource {
    /// One list.
    Listed(KernelList),
    /// A folder to choose from.
    Root(KernelSelection),
    /// Rival sets, at least two: the one whose trajectory is closest to the mean of all is used.
    Sets(Vec<RivalKernels>),
}

impl Default for KernelSource {
    /// No kernels.
    fn default() -> Self {
        Self::Listed(KernelList::Files(Vec::new()))
    }
}

/// Kernels named one by one.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum KernelList {
    /// A metakernel; relative paths in it are relative to its folder.
    Metakernel(PathBuf),
    /// Files in load order (later ones win).
    Files(Vec<PathBuf>),
}

/// One of several complete kernel sets.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RivalKernels {
    /// Identifier, unique in the site, for example `nav`.
    pub id: String,
    /// Its kernels.
    pub list: KernelList,
}

/// Rules by which kernels are chosen from a folder.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct KernelSelection {
    /// The folder, searched with its subfolders.
    pub root: PathBuf,
    /// Orbit solution, for example `nav`, `gsfc` or `ipng`.
    pub spk_family: String,
    /// Attitude qualities that may be used, best first: `reconstructed`, `nominal`.
    pub ck_quality: Vec<CkQuality>,
    /// Text kernels pinned by file name, such as `pck00010.tpc`; of others the latest version is used.
    pub pinned: Vec<String>,
}

/// Origin of an attitude kernel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum CkQuality {
    /// From telemetry.
    Reconstructed,
    /// Commanded attitude that fills telemetry gaps (`mgs_ext_roto_all_v*`); loaded first, so that telemetry takes
    /// precedence.
    Nominal,
}
