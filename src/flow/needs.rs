//! Files that a site needs from the archives of the mission.

mod shots;

use std::path::{Path, PathBuf};

use crate::{
    config::{ImageConfig, ShotLayout, SiteConfig, Unfilled, built_in_instruments, load_unfilled},
    error::{Cause, Error, Locate as _, Result},
    fetch::plan::{ImagePlace, ImageWish, KernelWish, Wish},
    kernel_source::{KernelList, KernelSource},
    pds::{product_named, read_label},
};

pub use shots::of_box as shots_of_box;

/// Ambiguities of the site file.
#[derive(Debug, thiserror::Error, Cause)]
#[cause(Configuration)]
enum Unclear {
    #[error("pedr.files is {0}; expected a pattern whose folder contains no wildcard")]
    #[cause("write the folder of the PEDR files in full, such as \"../pedr/*.b\"")]
    PedrFolder(String),
}

/// Requested files, and notes for the reader of a plan.
#[derive(Debug, Default)]
pub struct Needs {
    /// The files.
    pub wish: Wish,
    /// Needs that no archive meets.
    pub notes: Vec<String>,
}

impl Needs {
    /// Adds the needs of the site file `path`, whose inputs may be missing.
    ///
    /// # Errors
    /// A site file that cannot be read or is ambiguous; a label that cannot be read.
    pub fn add_site(&mut self, path: &Path) -> Result<()> {
        self.add(load_unfilled(path)?).in_file(path)
    }

    /// Adds the needs of a site; a need that no archive meets becomes a note.
    fn add(&mut self, unfilled: Unfilled) -> Result<()> {
        let Unfilled {
            site,
            mut absent,
            shot_globs,
        } = unfilled;
        self.add_kernels(&site, &mut absent);
        if let Some(first) = site.pedr.files.first() {
            let folder = first.parent().unwrap_or(Path::new("."));
            if folder.to_string_lossy().contains(['*', '?', '[']) {
                let pattern = first.display().to_string();
                return Err(Error::from(Unclear::PedrFolder(pattern)));
            }
            absent.retain(|path| !site.pedr.files.contains(path));
            self.wish.pedr = Some(folder.to_owned());
        }
        for image in site.images.iter().filter(|image| image.support().is_none()) {
            self.add_image(image, &mut absent)?;
        }
        let (shots, notes) = shots::wishes(&site, &shot_globs)?;
        self.wish.shots.extend(shots);
        self.notes.extend(notes);
        for table in &site.shots {
            if table.layout == Some(ShotLayout::OdePedr) {
                absent.retain(|path| !table.files.contains(path));
            }
        }
        let others = absent.iter().map(|path| {
            format!(
                "{}: no archive contains this file; provide it yourself",
                path.display()
            )
        });
        self.notes.extend(others);
        Ok(())
    }

    fn add_kernels(&mut self, site: &SiteConfig, absent: &mut Vec<PathBuf>) {
        let mut listed: Vec<PathBuf> = Vec::new();
        let mut add = |list: &KernelList| match list {
            KernelList::Files(files) => {
                let files = files.iter().filter(|path| absent.contains(path));
                listed.extend(files.cloned());
            }
            KernelList::Metakernel(_) => {}
        };
        match &site.kernels.source {
            KernelSource::Root(selection) => {
                absent.retain(|path| *path != selection.root);
                self.wish.kernels = Some(KernelWish {
                    folder: selection.root.clone(),
                    spk_family: selection.spk_family.clone(),
                    ck_quality: selection.ck_quality.clone(),
                    pinned: selection.pinned.clone(),
                    listed: Vec::new(),
                });
                return;
            }
            KernelSource::Listed(list) => add(list),
            KernelSource::Sets(sets) => sets.iter().for_each(|set| add(&set.list)),
        }
        if listed.is_empty() {
            return;
        }
        absent.retain(|path| !listed.contains(path));
        let kernels = self.wish.kernels.get_or_insert_with(|| KernelWish {
            folder: PathBuf::from("."),
            spk_family: "nav".to_owned(),
            ck_quality: Vec::new(),
            pinned: Vec::new(),
            listed: Vec::new(),
        });
        kernels.listed.extend(listed);
    }

    fn add_image(&mut self, image: &ImageConfig, absent: &mut Vec<PathBuf>) -> Result<()> {
        let mut files: Vec<PathBuf> = [&image.label, &image.pixels]
            .into_iter()
            .flatten()
            .cloned()
            .collect();
        files.sort();
        files.dedup();
        files.retain(|path| absent.contains(path));
        absent.retain(|path| !files.contains(path));
        let named = product_named(&image.id);
        let by_label = image
            .label
            .as_ref()
            .filter(|label| named.is_none() && label.is_file());
        let product = match by_label {
            Some(label) => read_label(label, built_in_instruments())?.product_id,
            None => named,
        };
        match product {
            Some(product) => self.wish.images.push(ImageWish {
                product,
                place: if files.is_empty() {
                    ImagePlace::Nowhere
                } else {
                    ImagePlace::Files(files)
                },
            }),
            None => self.notes.push(format!(
                "image {}: the identifier matches no product in the index; times and files are unknown",
                image.id
            )),
        }
        Ok(())
    }
}
