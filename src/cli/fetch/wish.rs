//! Requested files, by site files and options.

use std::path::{Path, PathBuf};

use super::{Arguments, Kind, shots};
use crate::{
    config::{ImageConfig, ShotLayout, SiteConfig, Unfilled, built_in_instruments, load_unfilled},
    error::{Cause, Error, Locate as _, Result},
    fetch::{
        FetchError, Utc,
        plan::{ImagePlace, ImageWish, KernelWish, Span, Wish},
    },
    kernel_source::{CkQuality, KernelList, KernelSource},
    pds::{product_named, read_label},
};

/// Seconds of a day.
const DAY_S: f64 = 86_400.0;

/// Ambiguities of the site file.
#[derive(Debug, thiserror::Error, Cause)]
#[cause(Configuration)]
enum Unclear {
    #[error("pedr.files is {0}; expected a pattern whose folder contains no wildcard")]
    #[cause("write the folder of the PEDR files in full, such as \"../pedr/*.b\"")]
    PedrFolder(String),
}

/// The request, and notes for the reader of the plan.
pub(super) struct Wanted {
    pub(super) wish: Wish,
    pub(super) notes: Vec<String>,
}

/// First and last day of an option.
pub(super) fn days(text: &str) -> std::result::Result<[Utc; 2], String> {
    let expected =
        || format!("{text:?}; expected two days in order, such as 2001-03-01,2001-03-09");
    let (first, last) = text.split_once(',').ok_or_else(expected)?;
    let days = Utc::parse(first).zip(Utc::parse(last));
    let (first, last) = days
        .filter(|(first, last)| first <= last)
        .ok_or_else(expected)?;
    // The last day is included completely.
    Ok([first, last.plus(DAY_S)])
}

/// First and last orbit of an option.
pub(super) fn orbits(text: &str) -> std::result::Result<[u32; 2], String> {
    let expected = || format!("{text:?}; expected two orbits in order, such as 18933,18945");
    let (first, last) = text.split_once(',').ok_or_else(expected)?;
    let orbit = |text: &str| text.trim().parse::<u32>().map_err(|_| expected());
    let [first, last] = [orbit(first)?, orbit(last)?];
    if first <= last {
        Ok([first, last])
    } else {
        Err(expected())
    }
}

impl Wanted {
    pub(super) fn of(arguments: &Arguments) -> Result<Self> {
        let spans = arguments.dates.iter().map(|utc| Span {
            utc: *utc,
            what: format!("--dates {} to {}", utc[0], utc[1]),
        });
        let mut wanted = Self {
            wish: Wish {
                generic: arguments.generic_kernels.clone(),
                orbits: arguments.orbits.clone(),
                spans: spans.collect(),
                ..Wish::default()
            },
            notes: Vec::new(),
        };
        let into = arguments.folder();
        for product in &arguments.images {
            wanted.wish.images.push(ImageWish {
                product: product.clone(),
                place: ImagePlace::Folder(into.join("images")),
            });
        }
        for path in &arguments.sites {
            wanted.add(load_unfilled(path)?).in_file(path)?;
        }
        if let Some(edges_deg) = arguments.edges_deg {
            let table = shots::of_box(&into.join("shots"), edges_deg);
            wanted.wish.shots.push(table);
        }
        if arguments.sites.is_empty() {
            if wanted.wish.is_empty() && !arguments.index {
                return Err(FetchError::Nothing.into());
            }
            // A box and generic kernels have no times, by which kernels and files of the laser are chosen.
            let has_others = wanted.wish.generic.is_some() || !wanted.wish.shots.is_empty();
            if !has_others || wanted.wish.has_times() {
                wanted.wish.kernels = Some(KernelWish {
                    folder: into.join("kernels"),
                    spk_family: "nav".to_owned(),
                    ck_quality: vec![CkQuality::Reconstructed, CkQuality::Nominal],
                    pinned: Vec::new(),
                    listed: Vec::new(),
                });
                wanted.wish.pedr = Some(into.join("pedr"));
            }
        }
        if !arguments.takes(Kind::Kernels) {
            wanted.wish.kernels = None;
        }
        if !arguments.takes(Kind::Pedr) {
            wanted.wish.pedr = None;
        }
        if !arguments.takes(Kind::Images) {
            for image in &mut wanted.wish.images {
                image.place = ImagePlace::Nowhere;
            }
        }
        if !arguments.takes(Kind::Shots) {
            wanted.wish.shots.clear();
        }
        Ok(wanted)
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
                "image {}: the identifier matches no product of the index; times and files are not known",
                image.id
            )),
        }
        Ok(())
    }
}
