//! Archive files that times, orbits, images and windows need, and the reasons.

mod generic;
mod images;
mod kernels;
mod pedr;
mod shots;

use std::path::PathBuf;

use areograph_base::kernel_source::CkQuality;

use crate::utc::Utc;

pub(crate) use self::{
    generic::plan_generic, images::find_images, kernels::plan_kernels, pedr::plan_pedr,
    shots::plan_shots,
};

/// Needs of a site.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Wish {
    /// Kernels, by the times of images and [`Self::spans`]; `None` for no kernels.
    pub kernels: Option<KernelWish>,
    /// Folder for the latest kernels of no mission; `None` for none of them.
    pub generic: Option<PathBuf>,
    /// Folder for files of the laser, by [`Self::orbits`], [`Self::spans`] and images; `None` for none of them.
    pub pedr: Option<PathBuf>,
    /// Images.
    pub images: Vec<ImageWish>,
    /// Tables of shots.
    pub shots: Vec<ShotWish>,
    /// Further times.
    pub spans: Vec<Span>,
    /// First and last orbit of the laser.
    pub orbits: Vec<[u32; 2]>,
}

impl Wish {
    /// Whether nothing is wanted.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        !self.has_times() && self.shots.is_empty() && self.generic.is_none()
    }

    /// Whether anything states a time: an image, a span or orbits.
    #[must_use]
    pub fn has_times(&self) -> bool {
        !(self.images.is_empty() && self.spans.is_empty() && self.orbits.is_empty())
    }
}

/// A time, and its purpose.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Span {
    /// Start and stop.
    pub utc: [Utc; 2],
    /// Such as `image E02-00665`.
    pub what: String,
}

/// Requested kernels, and their folder.
#[derive(Debug, Clone, PartialEq)]
pub struct KernelWish {
    /// Their folder.
    pub folder: PathBuf,
    /// Orbit solution.
    pub spk_family: String,
    /// Qualities of attitude.
    pub ck_quality: Vec<CkQuality>,
    /// Text kernels that are taken whatever their version.
    pub pinned: Vec<String>,
    /// Files that the site lists one by one; then only these.
    pub listed: Vec<PathBuf>,
}

/// An image, and where its file is put.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ImageWish {
    /// Product, in any spelling: `E02/00665`, `e0200665`.
    pub product: String,
    /// Destination of its file.
    pub place: ImagePlace,
}

/// Destination of the file of an image.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum ImagePlace {
    /// Nowhere: only its time is wanted.
    Nowhere,
    /// At these paths.
    Files(Vec<PathBuf>),
    /// Into this folder, with its name in the archive in lower case.
    Folder(PathBuf),
}

/// Tables of shots of one entry of a site.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ShotWish {
    /// One for each box.
    pub tables: Vec<ShotTable>,
    /// Whether the site has none yet; else only tables that a fetch brought are planned, and those beside them.
    pub is_absent: bool,
}

/// A table of shots.
#[derive(Debug, Clone, PartialEq)]
pub struct ShotTable {
    /// Its destination.
    pub path: PathBuf,
    /// Its ground.
    pub of: ShotBox,
}

/// A box of shots.
#[derive(Debug, Clone, PartialEq)]
pub struct ShotBox {
    /// West, east, south and north edge, degrees; 0 ≤ west < east ≤ 360.
    pub edges_deg: [f64; 4],
    /// The window of a site, or the option, whose ground it is, all or a part of it; unique in a fetch.
    pub whole: String,
}

impl ShotBox {
    /// Reason why its table is needed.
    pub(crate) fn why(&self) -> String {
        let [west, east, south, north] = self.edges_deg;
        format!(
            "shots of {}, {west} to {east} east, {south} to {north} north",
            self.whole
        )
    }
}

/// Kind of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum FileKind {
    /// Kernel.
    Kernel,
    /// Shots.
    Pedr,
    /// Image with its label.
    Image,
    /// Table of shots, made for a box.
    Shots,
}

impl FileKind {
    /// Its word in listings.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Kernel => "kernel",
            Self::Pedr => "pedr",
            Self::Image => "image",
            Self::Shots => "shots",
        }
    }
}

/// A file to fetch.
#[derive(Debug, Clone, PartialEq)]
pub struct PlannedFile {
    /// Kind.
    pub kind: FileKind,
    /// Its source; for a table of shots, the query.
    pub url: String,
    /// Its destination.
    pub path: PathBuf,
    /// Size, where an index states it.
    pub bytes: Option<u64>,
    /// Whether that is the size to the byte.
    pub is_exact: bool,
    /// MD5 by the archive, hexadecimal.
    pub md5: Option<String>,
    /// Reason why it is needed.
    pub why: String,
    /// Box of a table of shots.
    pub shot_box: Option<ShotBox>,
}

/// Files to fetch, and needs that no archive meets.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Plan {
    /// Files in order of kind and path.
    pub files: Vec<PlannedFile>,
    /// Needs that no index contains.
    pub lacks: Vec<String>,
    /// Notes for the reader of the plan.
    pub notes: Vec<String>,
}

impl Plan {
    pub(crate) fn add(&mut self, other: Self) {
        self.files.extend(other.files);
        self.lacks.extend(other.lacks);
        self.notes.extend(other.notes);
    }

    pub(crate) fn in_order(mut self) -> Self {
        self.files
            .sort_by(|one, other| (one.kind, &one.path).cmp(&(other.kind, &other.path)));
        self.files.dedup_by(|one, other| one.path == other.path);
        self
    }

    /// Sum of known sizes, and the number of files of unknown size.
    #[must_use]
    pub fn bytes(&self) -> (u64, usize) {
        let known = self.files.iter().filter_map(|file| file.bytes);
        let unknown = self.files.iter().filter(|file| file.bytes.is_none());
        (known.sum(), unknown.count())
    }
}

/// Reasons as one text, a few of many.
fn reasons(reasons: &[&str]) -> String {
    const SHOWN: usize = 3;
    match reasons.len().checked_sub(SHOWN) {
        Some(more @ 1..) => format!("{} and {more} more", reasons[..SHOWN].join(", ")),
        _ => reasons.join(", "),
    }
}
