//! Laser profiles matched with a terrain model, from files to products.
//!
//! This flow has one stage, `stages/match_laser`. `pds/terrain_model` reads a `GeoTIFF` into a grid
//! (`geom/height_grid`, at most 134 million cells).

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use super::{
    driver::{Driver, Flow},
    result::{ManifestEntry, ResultPublication, Written},
};
use crate::{
    error::{Cause, Result},
    pds::archive::Listing,
    products::{MatchProducts, write_match_products},
    report::match_page,
    stage::{InOrder, Stage as _},
    stages::match_laser::{LaserMatch, MatchLaser, MatchRequest, match_files},
    store::manifest::figures,
};

/// Raised when the layout of the products of a match changes.
const METHOD: u32 = 12;
/// Stands for the name of a site in messages and in the manifest.
pub(super) const NAME: &str = "pedr_match";

/// No file to search.
#[derive(Debug, thiserror::Error, Cause)]
#[error("no PEDR file (*.b) to search")]
#[cause(Input: "name PEDR files (AP#####v.B), or folders that contain them")]
struct NoFiles;

/// Matches laser profiles with a terrain model and publishes the products. `request.pedr` may name folders too.
pub(super) fn laser_match<D: Driver>(flow: &mut D, request: &MatchRequest) -> Flow<()> {
    let pedr = flow.attempt(MatchLaser::NAME, |_| listed(request))?;
    let request = MatchRequest {
        pedr: pedr.unwrap_or_default(),
        ..request.clone()
    };
    let files = flow.hash(MatchLaser::NAME, &match_files(&request))?;
    let result = flow.stage(&MatchLaser {
        request: &request,
        files: InOrder(&files),
    })?;
    let keys = keys(&request);
    flow.publish(&ResultPublication {
        written: Written {
            name: NAME,
            file: Path::new(""),
            blake3: &blake3::hash(format!("{keys:?}").as_bytes()).to_hex(),
            keys: &keys,
            method: METHOD,
        },
        result: &result,
        has_further_stages: false,
        write: |staging: &_, result: &_| {
            let page = match_page(result)?;
            let products = MatchProducts {
                result,
                page: &page,
            };
            write_match_products(staging, &products)
        },
        entry: manifest_entry,
    })
}

/// The PEDR files of a request.
fn listed(request: &MatchRequest) -> Result<Vec<PathBuf>> {
    let Listing { paths, failures } = Listing::of(&request.pedr);
    match failures.into_iter().next() {
        Some(failure) => Err(failure),
        None if paths.is_empty() => Err(NoFiles.into()),
        None => Ok(paths),
    }
}

/// The request, as in the manifest.
fn keys(request: &MatchRequest) -> BTreeMap<String, String> {
    let options = &request.options;
    let name = |path: &Path| crate::files::file_name(path);
    let images = request.images.iter();
    let images: Vec<String> = images
        .map(|image| format!("{}={}", image.name, name(&image.isd)))
        .collect();
    let radius = request.radius_m.map(|of| of.to_string());
    let similarity = options.similarity.map_or("auto", |of| of.word());
    let keys = [
        ("model", name(&request.model)),
        ("isd", images.join(" ")),
        ("radius_m", radius.unwrap_or_default()),
        ("heights_apart", request.heights_apart.to_string()),
        ("segment_points", options.segment_points.to_string()),
        ("least_variance_m2", options.least_variance_m2.to_string()),
        ("similarity", similarity.to_owned()),
        ("search_cells", options.search_cells.to_string()),
        ("least_score", options.least_score.to_string()),
        ("least_contrast", options.least_contrast.to_string()),
        ("limit_m", options.limit_m.to_string()),
        ("seed", options.seed.to_string()),
        ("crossover", options.ground.word().to_owned()),
    ];
    keys.map(|(key, value)| (key.to_owned(), value)).into()
}

/// Content of the manifest of a match.
fn manifest_entry(result: &LaserMatch) -> ManifestEntry<'_> {
    let kept = result.units.iter().filter(|unit| unit.is_kept());
    let held_out = result.held_out.as_ref();
    ManifestEntry {
        verdict: &result.verdict,
        counts: vec![
            ("shots", result.shots as u64),
            ("tracks", result.tracks as u64),
            ("segments", result.segments as u64),
            ("segments_kept", result.segments_kept as u64),
            ("units", result.units.len() as u64),
            ("units_kept", kept.count() as u64),
            ("held_out_shots", held_out.map_or(0, |of| of.shots as u64)),
        ],
        figures: held_out
            .map(|of| (figures::HELD_OUT_RMS_M, of.after_m))
            .into_iter()
            .collect(),
        complaints: (&result.complaints, result.complaint_count),
    }
}
