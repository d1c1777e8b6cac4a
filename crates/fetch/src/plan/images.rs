//! Images by the cumulative index.

use areograph_pds::{
    image_index::{ImageIndex, IndexedImage},
    product_named,
};

use super::{FileKind, ImagePlace, ImageWish, Plan, PlannedFile, Span};
use crate::{archives::ImageArchive, safe::is_path, utc::Utc};

/// Length of an image whose lines the index leaves open, seconds.
const UNKNOWN_S: f64 = 60.0;

/// The files of images, and their times.
pub(crate) fn find_images(
    wishes: &[ImageWish],
    index: &ImageIndex,
    archive: &ImageArchive,
) -> (Plan, Vec<Span>) {
    let (mut plan, mut spans) = (Plan::default(), Vec::new());
    for wish in wishes {
        let product = product_named(&wish.product);
        let mut images = index.images.iter();
        let of_product = |image: &&IndexedImage| {
            product.is_some() && product_named(&image.product_id) == product
        };
        let Some(image) = images.find(of_product) else {
            let lack = format!("image {}: not in the image index", wish.product);
            plan.lacks.push(lack);
            continue;
        };
        match span_of(image) {
            Some(utc) => spans.push(Span {
                utc,
                what: format!("image {}", image.product_id),
            }),
            None => plan.lacks.push(format!(
                "image {}: the index states no start time; the kernels for the image are unknown",
                image.product_id
            )),
        }
        if wish.place == ImagePlace::Nowhere {
            continue;
        }
        let below =
            format!("{}/{}", image.volume, image.file.trim_start_matches('/')).to_ascii_lowercase();
        if image.volume.is_empty() || !is_path(&below) {
            let lack = format!(
                "image {}: the index states no usable path ({below:?})",
                image.product_id
            );
            plan.lacks.push(lack);
            continue;
        }
        let name = below.rsplit('/').next().unwrap_or(&below);
        let paths = match &wish.place {
            ImagePlace::Nowhere => Vec::new(),
            ImagePlace::Files(paths) => paths.clone(),
            ImagePlace::Folder(folder) => vec![folder.join(name)],
        };
        plan.files.extend(paths.into_iter().map(|path| PlannedFile {
            kind: FileKind::Image,
            url: format!("{}{below}", archive.url),
            path,
            bytes: None,
            is_exact: false,
            md5: None,
            why: format!(
                "image {} of {}, {} lines of {} samples",
                image.product_id, image.utc_start, image.size[1], image.size[0]
            ),
            shot_box: None,
        }));
    }
    (plan, spans)
}

/// Start and stop of its exposures.
fn span_of(image: &IndexedImage) -> Option<[Utc; 2]> {
    let start = Utc::from(image.utc()?);
    let summing = image.summing[1].unwrap_or(1);
    let length_s = image.exposure_s.map_or(UNKNOWN_S, |exposure_s| {
        f64::from(image.size[1]) * exposure_s * f64::from(summing)
    });
    Some([start, start.plus(length_s)])
}
