//! `areograph image search`.

mod arguments;
mod by_kernels;
mod pairs;
mod show;

use std::path::Path;

pub(super) use self::arguments::Arguments;
use self::{
    arguments::{Format, cameras_of},
    pairs::{Pair, pairs},
};
use crate::{
    cli::output,
    config::WindowConfig,
    constants::MARS_NAME,
    error::Result,
    geom::{
        image_outline::{INDEX_LATITUDE_RAD, INDEX_LONGITUDE_RAD, ImageOutline},
        window::Region,
    },
    pds::image_index::{ImageIndex, IndexedImage, read_index},
    units::RADIANS_PER_DEGREE,
};

/// An image that was found.
#[derive(Debug)]
struct Found {
    image: IndexedImage,
    centre_rad: [f64; 2],
    outline: ImageOutline,
    /// Identifiers of the windows that it intersects.
    windows: Vec<String>,
    /// Largest distance of a corner from its position according to the kernels, metres; `None` if unknown.
    off_kernels_m: Option<f64>,
}

/// Mean radius of Mars, metres; converts kilometres to angles where an image has no corners.
const RADIUS_M: f64 = 3_389_500.0;

pub(super) fn run(arguments: &Arguments) -> Result<()> {
    arguments.check_cameras()?;
    let windows = arguments.windows()?;
    let regions: Vec<(String, Region)> = windows
        .into_iter()
        .map(|window| (window.id, Region::new(&window.shape)))
        .collect();
    let mut found = Vec::new();
    for path in &arguments.indexes {
        let index = read_index(path)?;
        tell_index(path, &index);
        found.extend(found_in(
            path,
            index,
            |image| arguments.wants(image),
            &regions,
        ));
    }
    // The index of a volume contains all earlier images: duplicates are merged.
    found.sort_by(|a, b| a.image.product_id.cmp(&b.image.product_id));
    found.dedup_by(|a, b| a.image.product_id == b.image.product_id);
    if let Some(metakernel) = &arguments.kernels {
        by_kernels::compare(&mut found, metakernel)?;
    }
    let pairs = pairs(&found);
    let undecided = pairs.iter().filter(|pair| !pair.is_known_apart).count();
    if undecided > 0 {
        tracing::warn!(
            "{undecided} pairs may be from one orbit: the index does not state the orbits or the times of both images"
        );
    }
    let format = if arguments.json {
        Format::Geojson
    } else {
        arguments.format
    };
    match format {
        Format::Table => show::table(&found, &pairs),
        Format::Csv => show::csv(&found),
        Format::Pairs => show::pairs_csv(&pairs),
        Format::Geojson => output::json(&show::geojson(&found, &pairs)),
        Format::Toml => show::toml(&found),
    }
    Ok(())
}

/// An image for a new site.
#[derive(Debug)]
pub(in crate::cli) struct Proposed {
    /// Identifier as in site files.
    pub(in crate::cli) id: String,
    /// Name of its file in the archive, lower case.
    pub(in crate::cli) file: String,
    /// Reason why it is proposed.
    pub(in crate::cli) why: String,
}

/// The images of the best pairs over a window, or without a pair the sharpest image.
///
/// * `pixel_max_m` – largest width of a pixel on the ground
pub(in crate::cli) fn propose(
    index_path: &Path,
    window: &WindowConfig,
    pairs_max: usize,
    pixel_max_m: f64,
) -> Result<Vec<Proposed>> {
    let index = read_index(index_path)?;
    tell_index(index_path, &index);
    let region = (window.id.clone(), Region::new(&window.shape));
    let is_sharp =
        |image: &IndexedImage| image.pixel_m.is_none_or(|pixel_m| pixel_m <= pixel_max_m);
    let mut found = found_in(index_path, index, is_sharp, &[region]);
    found.sort_by(|a, b| a.image.product_id.cmp(&b.image.product_id));
    found.dedup_by(|a, b| a.image.product_id == b.image.product_id);
    let mut proposed: Vec<Proposed> = Vec::new();
    let mut add = |one: &Found, why: String| {
        let id = one.image.product_id.replace('/', "-");
        if !proposed.iter().any(|earlier| earlier.id == id) {
            let file = one.image.file.rsplit('/').next().unwrap_or_default();
            let file = file.to_ascii_lowercase();
            proposed.push(Proposed { id, file, why });
        }
    };
    for pair in pairs(&found).iter().take(pairs_max) {
        for (one, other) in [(0, 1), (1, 0)] {
            let partner = &pair.images[other].image.product_id;
            let convergence = pair.convergence_rad.map_or_else(
                || "unknown convergence".to_owned(),
                |angle| format!("convergence {:.1}°", angle / RADIANS_PER_DEGREE),
            );
            let overlap = 100.0 * pair.overlap;
            add(
                pair.images[one],
                format!("pair with {partner}: overlap {overlap:.0} %, {convergence}"),
            );
        }
    }
    if found.iter().any(|one| one.image.pixel_m.is_some()) && pairs(&found).is_empty() {
        let width_m = |one: &&Found| one.image.pixel_m.unwrap_or(f64::INFINITY);
        let sharpest = found
            .iter()
            .min_by(|a, b| width_m(a).total_cmp(&width_m(b)));
        if let Some(one) = sharpest {
            add(one, "sharpest image; no pair covers the window".to_owned());
        }
    }
    Ok(proposed)
}

fn tell_index(path: &Path, index: &ImageIndex) {
    if !index.has_label {
        tracing::warn!(
            "{}: no .lbl file beside this index; the columns of the mapping mission are assumed",
            path.display()
        );
    }
    if let Some(row) = index.bad_rows.first() {
        tracing::warn!(
            "{}: {} rows are skipped, the first in line {}: {}",
            path.display(),
            index.bad_rows.len(),
            row.line,
            row.text
        );
    }
}

/// The requested images of an index that intersect a window; values that the index lacks are reported.
fn found_in(
    path: &Path,
    index: ImageIndex,
    wants: impl Fn(&IndexedImage) -> bool,
    regions: &[(String, Region)],
) -> Vec<Found> {
    let (mut found, mut without_target) = (Vec::new(), 0_usize);
    let (mut without_place, mut of_no_camera) = (Vec::new(), Vec::new());
    for image in index.images {
        match image.target.as_deref() {
            Some(target) if !target.eq_ignore_ascii_case(MARS_NAME) => continue,
            Some(_) => {}
            None => without_target += 1,
        }
        if cameras_of(&image).next().is_none() {
            of_no_camera.push(image.product_id);
        } else if wants(&image) {
            match place(&image) {
                Some((centre_rad, outline)) => {
                    found.extend(meeting(image, centre_rad, outline, regions));
                }
                None => without_place.push(image.product_id),
            }
        }
    }
    if without_target > 0 {
        tracing::warn!(
            "{}: {without_target} images have no TARGET_NAME; they are assumed to show {MARS_NAME}",
            path.display()
        );
    }
    for (left_out, what) in [
        (of_no_camera, "are from an unknown camera and are omitted"),
        (
            without_place,
            "could not be tested: no centre, or neither corners nor size on the ground",
        ),
    ] {
        if let Some(first) = left_out.first() {
            let (file, count) = (path.display(), left_out.len());
            tracing::warn!("{file}: {count} images (the first is {first}) {what}");
        }
    }
    tracing::info!("{}: {} images", path.display(), found.len());
    found
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
