//! The page over all sites of an output folder, rebuilt after every run.
//!
//! `fidelity.html` beside it is `docs/fidelity.html`, which the program contains.

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
};

use serde::Deserialize as _;

use super::campaign::is_of_campaign;
use crate::{
    body::Body,
    error::{IoError, Locate, Result},
    geom::uncertainty::UncertaintyBudget,
    products::ADJUSTMENT,
    report::{Earlier, FIDELITY_FILE, SiteLine, SiteSummary, published_fidelity_page, sites_page},
    stages::judge::CheckKind,
    store::{
        atomic,
        manifest::{Manifest, figures},
        page::{PAGE, SITES_PAGE},
        publish::{PREVIOUS, has_work, last_failure, read_manifest, read_previous},
    },
};

/// Writes the page over the sites whose folders are in `out`, and the page that it links to; returns the path of the
/// former.
///
/// # Errors
/// The folder cannot be read, the page cannot be written.
pub fn publish_sites(out: &Path) -> Result<PathBuf> {
    let mut lines = BTreeMap::new();
    let entries = fs::read_dir(out)
        .map_err(IoError::on("list"))
        .in_file(out)?;
    for entry in entries {
        let folder = entry.map_err(IoError::on("list")).in_file(out)?.path();
        let name = folder.file_name().unwrap_or_default().to_string_lossy();
        let manifest = read_manifest(&folder);
        if manifest.as_ref().is_some_and(is_of_campaign) {
            continue;
        }
        let failure = last_failure(&folder);
        // Folders in which no run ever worked are ignored.
        if manifest.is_some() || has_work(&folder) {
            let products = manifest.as_ref().map(|manifest| SiteSummary {
                budgets: budgets(&folder),
                earlier: read_previous(&folder)
                    .as_ref()
                    .map(|manifest| earlier(manifest, &name)),
                ..summary(manifest)
            });
            lines.insert(name.into_owned(), (products, failure));
        }
    }
    let lines: Vec<SiteLine> = lines
        .into_iter()
        .map(|(folder, (products, failure))| SiteLine {
            folder,
            products,
            failure,
        })
        .collect();
    put(&out.join(FIDELITY_FILE), &published_fidelity_page())?;
    let page = out.join(SITES_PAGE);
    put(&page, &sites_page(&lines)?)?;
    Ok(page)
}

/// The budgets of the pairs before the adjustment by the products in `folder`; products of an earlier version, or
/// without an adjustment, have none.
fn budgets(folder: &Path) -> Vec<UncertaintyBudget> {
    let document = fs::read(folder.join(ADJUSTMENT)).ok();
    let document: Option<serde_json::Value> =
        document.and_then(|bytes| serde_json::from_slice(&bytes).ok());
    let pairs = document
        .as_ref()
        .and_then(|of| of["before"]["pairs"].as_array());
    let budgets = pairs.into_iter().flatten().map(|pair| &pair["budget"]);
    budgets
        .filter_map(|budget| UncertaintyBudget::deserialize(budget).ok())
        .collect()
}

/// Writes a page, unless the file holds it: a folder in which nothing changes may be read-only.
fn put(path: &Path, page: &str) -> Result<()> {
    if fs::read(path).is_ok_and(|found| found == page.as_bytes()) {
        return Ok(());
    }
    atomic::replace(path, page.as_bytes(), PAGE)
}

/// The body of the site; Mars if its file does not name one.
fn body(keys: &BTreeMap<String, String>) -> Body {
    let word = keys.get("body");
    word.and_then(|word| serde_json::from_str(word).ok())
        .unwrap_or_default()
}

/// The middle of the first window that is a box.
fn place_deg(keys: &BTreeMap<String, String>) -> Option<(f64, f64)> {
    let ends = |key: &str| -> Option<[f64; 2]> { serde_json::from_str(keys.get(key)?).ok() };
    let mut boxes = keys.keys().filter_map(|key| {
        let window = key
            .strip_prefix("windows.")?
            .strip_suffix(".longitude_deg")?;
        let [west, east] = ends(key)?;
        let [south, north] = ends(&format!("windows.{window}.latitude_deg"))?;
        // A box that crosses the prime meridian runs eastward as well.
        let width = (east - west).rem_euclid(360.0);
        Some((
            (west + 0.5 * width).rem_euclid(360.0),
            f64::midpoint(south, north),
        ))
    });
    boxes.next()
}

/// Summary of the preceding products.
fn earlier(manifest: &Manifest, folder: &str) -> Earlier {
    let SiteSummary {
        verdict,
        range_mean_m,
        images_apart_m: [_, apart_m],
        height_off_m: [_, off_m],
        finished_utc,
        ..
    } = summary(manifest);
    Earlier {
        verdict,
        figures_m: [off_m, apart_m, range_mean_m],
        finished_utc,
        manifest: format!("{folder}/{PREVIOUS}"),
    }
}

fn summary(manifest: &Manifest) -> SiteSummary {
    let count = |name: &str| manifest.counts.get(name).copied().unwrap_or(0);
    let figure = |name: &str| manifest.figures.get(name).copied();
    // Figures are magnitudes; the checks of the same numbers have signs.
    let signed = |name: &str, kind: CheckKind| {
        let mut checks = manifest.verdict.checks.iter();
        let value = checks.find(|check| check.kind == kind)?.value?;
        Some(figure(name)?.copysign(value))
    };
    let either = |name: &str, kind: CheckKind| signed(name, kind).or_else(|| figure(name));
    SiteSummary {
        verdict: manifest.verdict.word(),
        reasons: manifest.verdict.reasons.clone(),
        remarks: manifest.verdict.remarks.clone(),
        counts: ["footprints", "profiles", "images"].map(count),
        range_mean_m: either(figures::RANGE_MEAN_M, CheckKind::RangeMean),
        images_apart_m: [
            figures::ALONG_TRACK_PARALLAX_M,
            figures::ADJUSTED_ALONG_TRACK_PARALLAX_M,
        ]
        .map(figure),
        height_off_m: [
            either(figures::HEIGHT_OFF_SURFACE_M, CheckKind::HeightBefore),
            either(
                figures::ADJUSTED_HEIGHT_OFF_SURFACE_M,
                CheckKind::HeightAfter,
            ),
        ],
        body: body(&manifest.configuration.keys),
        place_deg: place_deg(&manifest.configuration.keys),
        budgets: Vec::new(),
        earlier: None,
        finished_utc: manifest.finished_utc.clone(),
        version: manifest.version.clone(),
    }
}

#[cfg(test)]
#[allow(clippy::disallowed_methods, reason = "files of a test")]
mod tests {
    use super::*;

    #[test]
    fn budgets_are_those_of_the_document_before_the_adjustment() {
        let point = serde_json::json!({
            "across_px": 1.0, "planimetric_px": 2.0, "planimetric_m": 10.0, "height_px": 2.5, "height_m": 12.5
        });
        let budget = serde_json::json!({
            "along_px": 41.0, "total_along_px": 74.0, "ground": {"resolved": {"along_px": 61.6}},
            "paper_average": point, "equation_7": point,
            "equation_5": {"along_px": 54.6, "unexplained_px": 0.3, "point": point},
            "pixel_size_m": 5.0, "height_over_base": 2.5
        });
        let document = serde_json::json!({
            "before": {"pairs": [{"budget": budget}, {"no_budget_because": "no pair"}]},
            "after": {"pairs": [{"budget": budget}]}
        });
        let folder = tempfile::tempdir().unwrap();
        assert!(budgets(folder.path()).is_empty());
        fs::write(folder.path().join(ADJUSTMENT), document.to_string()).unwrap();
        let found = budgets(folder.path());
        assert_eq!(found.len(), 1);
        assert_eq!(found[0].equation_5.unexplained_px, Some(0.3));
        // A document of an earlier version has no equation 5.
        let earlier = document.to_string().replace("equation_5", "equation");
        fs::write(folder.path().join(ADJUSTMENT), earlier).unwrap();
        assert!(budgets(folder.path()).is_empty());
    }
}
