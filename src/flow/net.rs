//! A net from its tables to its products.
//!
//! A net of pictures is not a site: it has no images with times, no kernels and no `[plane]` table in a site file. One
//! stage leads from its tables to the result, and another one puts pictures with images on the map. Since its folder has a manifest like a site's, the page over all sites
//! and the checks of published products apply to it too.

use std::path::PathBuf;

use super::{
    driver::{Driver, Flow},
    result::{ManifestEntry, ResultPublication, Written},
};
use crate::{
    config::NetConfig,
    products::{NetProducts, write_net_products},
    report::net_page,
    stage::{Output, Stage as _},
    stages::{
        map_pictures::{MapPictures, PictureImages, PicturesOnMap, picture_images},
        triangulate::{NetFiles, NetKeys, Triangulate, Triangulation, net_files},
    },
    store::manifest::figures,
};

/// Raised when the layout of the products of a net changes.
const METHOD: u32 = 12;

/// Triangulates a net and publishes its products.
pub(super) fn net<D: Driver>(flow: &mut D, config: &NetConfig) -> Flow<()> {
    let files = flow.hash(Triangulate::NAME, &net_files(config))?;
    let result = flow.stage(&Triangulate {
        net: NetKeys(config),
        files: NetFiles(&files),
    })?;
    let mosaic = mosaic(flow, config, &result)?;
    flow.publish(&ResultPublication {
        written: Written {
            name: &config.net,
            file: &config.file,
            blake3: &config.blake3,
            keys: &config.keys,
            method: METHOD,
        },
        result: &result,
        has_further_stages: false,
        write: |staging: &_, result: &_| {
            let mosaic = mosaic.as_ref().map(Output::value).transpose()?;
            let mosaic = mosaic.and_then(Option::as_ref);
            let page = net_page(config, result, mosaic)?;
            let net = NetProducts {
                config,
                result,
                mosaic,
                page: &page,
            };
            write_net_products(staging, &net)
        },
        entry: manifest_entry,
    })
}

/// The pictures on the map; `None` without tables of pictures.
fn mosaic<D: Driver>(
    flow: &mut D,
    config: &NetConfig,
    triangulation: &Output<Triangulation>,
) -> Flow<Option<Output<Option<PicturesOnMap>>>> {
    if config.pictures.files.is_empty() {
        return Ok(None);
    }
    let images = flow.attempt(MapPictures::NAME, |_| picture_images(config))?;
    let images = images.unwrap_or_default();
    let paths: Vec<PathBuf> = images.iter().map(|image| image.path.clone()).collect();
    let files = flow.hash(MapPictures::NAME, &paths)?;
    let made = flow.stage(&MapPictures {
        triangulation,
        images: PictureImages(&images, &files, config.measurements.y_axis),
        cell_m: &config.map.cell_m,
    })?;
    Ok(Some(made))
}

/// Content of the manifest of a net.
fn manifest_entry(result: &Triangulation) -> ManifestEntry<'_> {
    let totals = &result.totals;
    let largest = |of: [f64; 2]| of[0].max(of[1]);
    ManifestEntry {
        verdict: &result.verdict,
        counts: vec![
            ("pictures", result.pictures.len() as u64),
            ("points", result.points.len() as u64),
            ("measurements", result.measurements.len() as u64),
            ("controls", result.controls.len() as u64),
            ("redundancy", totals.redundancy),
            ("blunders", totals.removed),
            ("rejected_controls", totals.rejected_controls),
        ],
        figures: vec![
            (
                figures::TIE_DEVIATION_RMS_M,
                largest(totals.deviation_rms_m),
            ),
            (
                figures::CONTROL_RESIDUAL_RMS_M,
                largest(totals.control_rms_m),
            ),
        ],
        complaints: (&result.complaints, result.complaint_count),
    }
}
