//! `areograph image search`.

mod arguments;
mod by_kernels;
mod show;

use std::path::Path;

pub(super) use self::arguments::Arguments;
use self::arguments::Format;
use crate::{
    cli::output,
    config::WindowConfig,
    error::Result,
    geom::window::Region,
    pds::image_index::{IndexedImage, read_index},
    stages::select_images::{Found, identifier, merge, pairs, select_images},
    units::RADIANS_PER_DEGREE,
};

pub(super) fn run(arguments: &Arguments) -> Result<()> {
    arguments.check_cameras()?;
    let windows = arguments.windows()?;
    let regions: Vec<(String, Region)> = windows
        .into_iter()
        .map(|window| (window.id, Region::new(&window.shape)))
        .collect();
    let mut found = Vec::new();
    for path in &arguments.indexes {
        found.extend(found_in(path, |image| arguments.wants(image), &regions)?);
    }
    merge(&mut found);
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
    let region = (window.id.clone(), Region::new(&window.shape));
    let is_sharp =
        |image: &IndexedImage| image.pixel_m.is_none_or(|pixel_m| pixel_m <= pixel_max_m);
    let mut found = found_in(index_path, is_sharp, &[region])?;
    merge(&mut found);
    let mut proposed: Vec<Proposed> = Vec::new();
    let mut add = |one: &Found, why: String| {
        let id = identifier(&one.image);
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

/// The requested images of an index that intersect a window; what could not be tested is reported.
fn found_in(
    path: &Path,
    wants: impl Fn(&IndexedImage) -> bool,
    regions: &[(String, Region)],
) -> Result<Vec<Found>> {
    let selection = select_images(read_index(path)?, wants, regions);
    for remark in &selection.remarks {
        tracing::warn!("{}: {remark}", path.display());
    }
    tracing::info!("{}: {} images", path.display(), selection.found.len());
    Ok(selection.found)
}
