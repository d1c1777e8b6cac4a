//! Images of the mission's cumulative index: those that may show ground in a window, and pairs of them.
//!
//! Latitudes and prime meridian of the index are uncertain (see [`INDEX_LATITUDE_RAD`], [`INDEX_LONGITUDE_RAD`]): an image
//! is selected if its outline, widened by this uncertainty, meets a window.

mod pairs;

use areograph_base::{constants::MARS_NAME, instruments::Instrument};
use areograph_config::built_in_instruments;
use areograph_geom::{
    image_outline::{INDEX_LATITUDE_RAD, INDEX_LONGITUDE_RAD, ImageOutline},
    window::Region,
};
use areograph_pds::image_index::{ImageIndex, IndexedImage};

pub use pairs::{Pair, PairLimits, best_pairs, pairs};

/// Mean radius of Mars, metres; converts lengths to angles where an image has no corners.
pub const RADIUS_M: f64 = 3_389_500.0;

/// An image that was found.
#[derive(Debug, Clone)]
pub struct Found {
    /// Its row of the index.
    pub image: IndexedImage,
    /// (longitude, latitude) of its centre, radians.
    pub centre_rad: [f64; 2],
    /// Its outline by the corners of the index.
    pub outline: ImageOutline,
    /// Identifiers of the windows that it intersects.
    pub windows: Vec<String>,
    /// Largest distance of a corner from its position according to kernels, metres; `None` if not compared.
    pub off_kernels_m: Option<f64>,
}

/// The images of an index that were found, and what prevented a test of others.
#[derive(Debug, Clone, Default)]
pub struct Selection {
    /// Images in the order of the index.
    pub found: Vec<Found>,
    /// Products at Mars of a known camera that are not as requested, or outside all windows.
    pub excluded: Vec<String>,
    /// Sentences on images that could not be tested, and on assumptions.
    pub remarks: Vec<String>,
}

/// The identifier of an image in site files.
#[must_use]
pub fn identifier(image: &IndexedImage) -> String {
    image.product_id.replace('/', "-")
}

/// The cameras that may have taken an image, by the names in the index; several if names are missing.
pub fn cameras_of(image: &IndexedImage) -> impl Iterator<Item = &'static Instrument> + '_ {
    let [instrument, filter] = &image.instrument;
    let may_be = |own: &str, found: &str| found.is_empty() || own == found;
    built_in_instruments().iter().filter(move |camera| {
        let own_filter = camera.label.filter.as_deref();
        may_be(&camera.label.instrument, instrument)
            && own_filter.is_none_or(|own| may_be(own, filter))
    })
}

/// The camera of an image, if the index identifies it.
#[must_use]
pub fn camera_of(image: &IndexedImage) -> Option<&'static Instrument> {
    let mut cameras = cameras_of(image);
    cameras.next().filter(|_| cameras.next().is_none())
}

/// The requested images of an index that intersect a window.
///
/// * `regions` – windows with their identifiers
#[must_use]
pub fn select_images(
    index: ImageIndex,
    wants: impl Fn(&IndexedImage) -> bool,
    regions: &[(String, Region)],
) -> Selection {
    let (mut selection, mut without_target) = (Selection::default(), 0_usize);
    let (mut without_place, mut of_no_camera) = (Vec::new(), Vec::new());
    if !index.has_label {
        let assumed =
            "no .lbl file beside this index; the columns of the mapping mission are assumed";
        selection.remarks.push(assumed.to_owned());
    }
    if let Some(row) = index.bad_rows.first() {
        selection.remarks.push(format!(
            "{} rows are skipped, the first in line {}: {}",
            index.bad_rows.len(),
            row.line,
            row.text
        ));
    }
    for image in index.images {
        match image.target.as_deref() {
            Some(target) if !target.eq_ignore_ascii_case(MARS_NAME) => continue,
            Some(_) => {}
            None => without_target += 1,
        }
        if cameras_of(&image).next().is_none() {
            of_no_camera.push(image.product_id);
        } else if !wants(&image) {
            selection.excluded.push(image.product_id);
        } else if let Some((centre_rad, outline)) = place(&image) {
            let product_id = image.product_id.clone();
            match meeting(image, centre_rad, outline, regions) {
                Some(found) => selection.found.push(found),
                None => selection.excluded.push(product_id),
            }
        } else {
            without_place.push(image.product_id);
        }
    }
    if without_target > 0 {
        selection.remarks.push(format!(
            "{without_target} images have no TARGET_NAME; they are assumed to show {MARS_NAME}"
        ));
    }
    for (left_out, what) in [
        (of_no_camera, "omitted, because the camera is unknown"),
        (
            without_place,
            "not tested: no centre, or neither corners nor size on the ground",
        ),
    ] {
        if let Some(first) = left_out.first() {
            let count = left_out.len();
            let noun = if count == 1 { "image" } else { "images" };
            let remark = format!("{count} {noun} (first: {first}) {what}");
            selection.remarks.push(remark);
        }
    }
    selection
}

/// Images of several indexes in the order of their products: the index of a volume contains all earlier images, of which
/// one is kept.
pub fn merge(found: &mut Vec<Found>) {
    found.sort_by_cached_key(|found| identifier(&found.image));
    found.dedup_by_key(|found| identifier(&found.image));
}

/// Centre and outline of an image; `None` without a centre, or without both corners and size.
fn place(image: &IndexedImage) -> Option<([f64; 2], ImageOutline)> {
    let centre_rad = image.centre_rad?;
    let [width_m, height_m] = image.extent_m;
    let diagonal_m = width_m
        .zip(height_m)
        .map(|(width, height)| width.hypot(height));
    let half_diagonal_rad = diagonal_m.map(|diagonal_m| 0.5 * diagonal_m / RADIUS_M);
    let outline = ImageOutline::new(image.corners_rad, centre_rad, half_diagonal_rad)?;
    Some((centre_rad, outline))
}

/// The image, if it may show ground inside a window.
fn meeting(
    image: IndexedImage,
    centre_rad: [f64; 2],
    outline: ImageOutline,
    regions: &[(String, Region)],
) -> Option<Found> {
    let ground = outline.widened(INDEX_LATITUDE_RAD, INDEX_LONGITUDE_RAD);
    let met = regions
        .iter()
        .filter(|(_, region)| region.intersects(&ground));
    let windows: Vec<String> = met.map(|(id, _)| id.clone()).collect();
    (!windows.is_empty()).then_some(Found {
        image,
        centre_rad,
        outline,
        windows,
        off_kernels_m: None,
    })
}
