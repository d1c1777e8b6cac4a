//! Copies of indexes in the folder of a fetch.

use std::{fs, io::ErrorKind};

use crate::{
    archives::Archives,
    client::Client,
    error::FetchError,
    folder::Folder,
    index::{Checksums, KernelRow, Listed, checksums, kernel_rows, listing},
    transfer::{Receiver, refresh},
};
use areograph_base::error::{IoError, Locate as _, Result};
use areograph_pds::image_index::{ImageIndex, read_index};

/// Requested indexes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[allow(clippy::struct_excessive_bools, reason = "one for each index")]
pub struct Indexes {
    /// Coverage and checksums of kernels.
    pub kernels: bool,
    /// Listings of kernels of no mission.
    pub generic: bool,
    /// Listings of files of the laser.
    pub pedr: bool,
    /// The cumulative index of images.
    pub images: bool,
}

/// An index: where the archive has it, and its copy.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Copy {
    name: String,
    url: String,
    /// A listing of a folder.
    is_page: bool,
    /// Whether all goes without it.
    is_optional: bool,
}

impl Copy {
    fn of(name: &str, url: String) -> Self {
        let name = name.to_owned();
        Self {
            name,
            url,
            is_page: false,
            is_optional: false,
        }
    }

    fn optional(self) -> Self {
        Self {
            is_optional: true,
            ..self
        }
    }
}

/// The label beside a table.
fn label_of(table: &str) -> String {
    match table.rsplit_once('.') {
        Some((stem, "TAB")) => format!("{stem}.LBL"),
        Some((stem, _)) => format!("{stem}.lbl"),
        None => format!("{table}.lbl"),
    }
}

const KERNEL_INDEX: &str = "kernels.tab";
const KERNEL_LABEL: &str = "kernels.lbl";
const CHECKSUMS: &str = "kernels_checksum.tab";
const IMAGE_INDEX: &str = "images.tab";
const IMAGE_LABEL: &str = "images.lbl";

fn of_kernels(archives: &Archives) -> [Copy; 3] {
    let of = &archives.kernels;
    [
        Copy::of(KERNEL_INDEX, format!("{}{}", of.url, of.index)),
        Copy::of(KERNEL_LABEL, format!("{}{}", of.url, label_of(&of.index))),
        Copy::of(CHECKSUMS, format!("{}{}", of.url, of.checksums)),
    ]
}

fn of_images(archives: &Archives) -> [Copy; 2] {
    let of = &archives.images;
    [
        Copy::of(IMAGE_INDEX, format!("{}{}", of.url, of.index)),
        Copy::of(IMAGE_LABEL, format!("{}{}", of.url, label_of(&of.index))).optional(),
    ]
}

fn of_pedr(archives: &Archives) -> Vec<Copy> {
    let of = &archives.pedr;
    let folders = of.folders.iter();
    folders
        .map(|folder| page("pedr", &of.url, folder))
        .collect()
}

fn of_generic(archives: &Archives) -> Vec<Copy> {
    let of = &archives.generic;
    let folders = of.latest.iter();
    folders
        .map(|[folder, ..]| page("generic", &of.url, folder))
        .collect()
}

/// The listing of a folder.
fn page(kind: &str, url: &str, folder: &str) -> Copy {
    let name = format!("{kind}_{}.html", folder.replace('/', "_"));
    Copy {
        is_page: true,
        ..Copy::of(&name, format!("{url}{folder}/"))
    }
}

impl Indexes {
    fn copies(self, archives: &Archives) -> Vec<Copy> {
        let mut copies = Vec::new();
        if self.kernels {
            copies.extend(of_kernels(archives));
        }
        if self.images {
            copies.extend(of_images(archives));
        }
        if self.generic {
            copies.extend(of_generic(archives));
            // Several kernels of one folder.
            copies.dedup();
        }
        if self.pedr {
            copies.extend(of_pedr(archives));
        }
        copies
    }
}

/// The copies in a folder.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Cache<'a> {
    pub(crate) archives: &'a Archives,
    pub(crate) folder: &'a Folder,
}

impl Cache<'_> {
    /// Brings the copies up to date; the number of those that have changed.
    ///
    /// # Errors
    /// As [`Receiver::receive`].
    pub(crate) fn refresh(&self, indexes: Indexes, receiver: &Receiver<'_>) -> Result<usize> {
        let mut changed = 0;
        for copy in indexes.copies(self.archives) {
            let path = self.folder.index(&copy.name);
            match refresh(receiver, &copy.url, &path, copy.is_page) {
                Ok(is_new) => changed += usize::from(is_new),
                Err(failure) if copy.is_optional => {
                    tracing::warn!("{}: not fetched: {}", copy.url, failure.cause);
                }
                Err(failure) => return Err(failure),
            }
        }
        Ok(changed)
    }

    fn read(&self, copy: &Copy) -> Result<Vec<u8>> {
        let path = self.folder.index(&copy.name);
        fs::read(&path).map_err(|error| match error.kind() {
            ErrorKind::NotFound => {
                let (name, url) = (copy.name.clone(), copy.url.clone());
                FetchError::NoIndex { name, url }.into()
            }
            _ => areograph_base::error::Error::from(IoError::on("read")(error)).in_file(&path),
        })
    }

    /// Kernels with their coverage, and checksums of the volume.
    ///
    /// # Errors
    /// [`FetchError::NoIndex`]; [`FetchError::Index`].
    pub(crate) fn kernels(&self) -> Result<(Vec<KernelRow>, Checksums)> {
        let [table, label, sums] = of_kernels(self.archives);
        let (rows, label) = (self.read(&table)?, self.read(&label)?);
        let rows = kernel_rows(&rows, &label).in_file(self.folder.index(&table.name))?;
        let sums_path = self.folder.index(&sums.name);
        let sums = checksums(&self.read(&sums)?).in_file(sums_path)?;
        Ok((rows, sums))
    }

    /// Files of the laser by folder.
    ///
    /// # Errors
    /// [`FetchError::NoIndex`].
    pub(crate) fn pedr(&self) -> Result<Vec<(String, Vec<Listed>)>> {
        let folders = self.archives.pedr.folders.iter();
        let pages = folders.zip(of_pedr(self.archives));
        pages
            .map(|(folder, copy)| Ok((folder.clone(), self.listed(&copy)?)))
            .collect()
    }

    /// Files beside each kernel of no mission.
    ///
    /// # Errors
    /// [`FetchError::NoIndex`].
    pub(crate) fn generic(&self) -> Result<Vec<Vec<Listed>>> {
        let pages = of_generic(self.archives).into_iter();
        pages.map(|copy| self.listed(&copy)).collect()
    }

    fn listed(&self, page: &Copy) -> Result<Vec<Listed>> {
        let page = self.read(page)?;
        Ok(listing(&String::from_utf8_lossy(&page)))
    }

    /// Images of the mission.
    ///
    /// # Errors
    /// [`FetchError::NoIndex`]; the index is malformed.
    pub(crate) fn images(&self) -> Result<ImageIndex> {
        let [table, _] = of_images(self.archives);
        self.read(&table)?;
        read_index(&self.folder.index(&table.name))
    }

    pub(crate) fn client(&self) -> Client {
        Client::of(self.archives)
    }
}
