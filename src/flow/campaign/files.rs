//! Labels and pixels of images in the folder of an archive.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use crate::{
    config::{DEPTH_MAX, files_in},
    error::{IoError, Locate as _, Result},
    pds::product_named,
};

/// Endings of detached labels, and of image files with a label of their own.
const LABELS: [&str; 1] = ["lbl"];
const IMAGES: [&str; 3] = ["imq", "img", "cub"];

/// The files of an image.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct ImageFiles {
    label: Option<PathBuf>,
    image: Option<PathBuf>,
}

impl ImageFiles {
    /// The detached label, else the image file.
    pub(super) fn label(&self) -> Option<&PathBuf> {
        self.label.as_ref().or(self.image.as_ref())
    }

    /// The image file.
    pub(super) const fn image(&self) -> Option<&PathBuf> {
        self.image.as_ref()
    }
}

/// Files by product, as [`product_named`] writes it. Of several files of one kind, the first in the order of their paths is
/// taken.
///
/// # Errors
/// A folder that cannot be listed.
pub(super) fn files_by_product(folder: &Path) -> Result<BTreeMap<String, ImageFiles>> {
    let mut found: BTreeMap<String, ImageFiles> = BTreeMap::new();
    let endings = [&LABELS[..], &IMAGES[..]].concat();
    let files = files_in(folder, &endings, DEPTH_MAX)
        .map_err(IoError::on("list"))
        .in_file(folder)?;
    for path in files {
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        let Some(product) = product_named(&stem) else {
            continue;
        };
        let of_product = found.entry(product).or_default();
        let ending = path.extension().unwrap_or_default();
        let is_label = LABELS
            .iter()
            .any(|label| ending.eq_ignore_ascii_case(label));
        let place = if is_label {
            &mut of_product.label
        } else {
            &mut of_product.image
        };
        if place.is_none() {
            *place = Some(path);
        }
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_detached_label_precedes_the_image_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        std::fs::create_dir(path("volume")).unwrap();
        for name in [
            "volume/e0202855.imq",
            "E02-02855.LBL",
            "m0400001.img",
            "readme.lbl",
        ] {
            std::fs::File::create(path(name)).unwrap();
        }
        let found = files_by_product(folder.path()).unwrap();
        assert_eq!(found.len(), 2);
        let both = &found["E0202855"];
        assert_eq!(both.label(), Some(&path("E02-02855.LBL")));
        assert_eq!(both.image(), Some(&path("volume/e0202855.imq")));
        assert_eq!(found["M0400001"].label(), Some(&path("m0400001.img")));
        assert!(files_by_product(&path("none")).is_err());
    }
}
