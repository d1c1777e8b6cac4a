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
/// taken, and a sentence states the others.
///
/// # Errors
/// A folder that cannot be listed.
pub(super) fn files_by_product(
    folder: &Path,
) -> Result<(BTreeMap<String, ImageFiles>, Option<String>)> {
    let mut found: BTreeMap<String, ImageFiles> = BTreeMap::new();
    let mut repeated = Vec::new();
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
        match place {
            None => *place = Some(path),
            Some(_) => repeated.push(path),
        }
    }
    let remark = repeated.first().map(|first| {
        format!(
            "{}: {} files are not used, because an earlier path names the same image; the first is {}",
            folder.display(),
            repeated.len(),
            first.display()
        )
    });
    Ok((found, remark))
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
        let (found, remark) = files_by_product(folder.path()).unwrap();
        assert_eq!((found.len(), remark), (2, None));
        let both = &found["E0202855"];
        assert_eq!(both.label(), Some(&path("E02-02855.LBL")));
        assert_eq!(both.image(), Some(&path("volume/e0202855.imq")));
        assert_eq!(found["M0400001"].label(), Some(&path("m0400001.img")));
        std::fs::File::create(path("z-m0400001.img")).unwrap();
        std::fs::File::create(path("volume/m0400001.imq")).unwrap();
        let (found, remark) = files_by_product(folder.path()).unwrap();
        assert_eq!(found["M0400001"].label(), Some(&path("m0400001.img")));
        assert!(remark.unwrap().contains("volume/m0400001.imq"));
        assert!(files_by_product(&path("none")).is_err());
    }
}
