//! `areograph image search`.

mod arguments;
mod by_kernels;
mod pairs;
mod show;

pub(super) use self::arguments::Arguments;
use self::{
    arguments::Format,
    pairs::{Pair, pairs},
};
use crate::{
    cli::output,
    constants::MARS_NAME,
    error::Result,
    geom::{
        image_outline::{INDEX_LATITUDE_RAD, INDEX_LONGITUDE_RAD, ImageOutline},
        window::Region,
    },
    pds::image_index::{IndexedImage, read_index},
};

/// An image that was found.
#[derive(Debug)]
struct Found {
    image: IndexedImage,
    centre_rad: [f64; 2],
    outline: ImageOutline,
    /// Identifiers of the windows that it meets.
    windows: Vec<String>,
    /// How far its worst corner lies from where kernels have it, metres; `None` where nothing tells.
    off_kernels_m: Option<f64>,
}

/// Mean radius of Mars, metres: what turns kilometres into angles where an image has no corners.
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
        if !index.has_label {
            tracing::warn!(
                "{}: no .lbl beside it; its columns are taken to be those of the mapping mission",
                path.display()
            );
        }
        if let Some(row) = index.bad_rows.first() {
            tracing::warn!(
                "{}: {} rows are left out, the first in line {}: {}",
                path.display(),
                index.bad_rows.len(),
                row.line,
                row.text
            );
        }
        let (mut without_place, before) = (0, found.len());
        for image in index.images {
            if image.target != MARS_NAME || !arguments.wants(&image) {
                continue;
            }
            match place(&image) {
                Some((centre_rad, outline)) => {
                    found.extend(meeting(image, centre_rad, outline, &regions));
                }
                None => without_place += 1,
            }
        }
        if without_place > 0 {
            tracing::warn!(
                "{}: {without_place} images have no centre and could not be tested",
                path.display()
            );
        }
        tracing::info!("{}: {} images", path.display(), found.len() - before);
    }
    // Volumes have all images up to theirs: an image of two indexes is one.
    found.sort_by(|a, b| a.image.product_id.cmp(&b.image.product_id));
    found.dedup_by(|a, b| a.image.product_id == b.image.product_id);
    if let Some(metakernel) = &arguments.kernels {
        by_kernels::compare(&mut found, metakernel)?;
    }
    let pairs = pairs(&found);
    match arguments.format {
        Format::Table => show::table(&found, &pairs),
        Format::Csv => show::csv(&found),
        Format::Pairs => show::pairs_csv(&pairs),
        Format::Geojson => output::json(&show::geojson(&found, &pairs)),
        Format::Toml => show::toml(&found),
    }
    Ok(())
}

/// Centre and outline of an image; none of one without a centre.
fn place(image: &IndexedImage) -> Option<([f64; 2], ImageOutline)> {
    let centre_rad = image.centre_rad?;
    let [width_m, height_m] = image.extent_m.map(Option::unwrap_or_default);
    let half_diagonal_rad = 0.5 * width_m.hypot(height_m) / RADIUS_M;
    Some((
        centre_rad,
        ImageOutline::new(image.corners_rad, centre_rad, half_diagonal_rad),
    ))
}

/// The image, if it may show ground of a window.
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
