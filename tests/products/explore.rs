//! The page to explore a site: complete without a network, the same every time, and with the values of the tables.

#![allow(clippy::unwrap_used, reason = "helpers of tests may fail loudly")]

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
};

use areograph::{
    capabilities::write_products,
    footprints::Footprints,
    frames::BodyFixed,
    geom::height_grid::HeightGrid,
    products::SiteProducts,
    stage::Round,
    stages::{
        map_surface::{Surface, SurfaceModel},
        rectify_images::Orthoimage,
    },
};
use base64::{Engine as _, engine::general_purpose::STANDARD};
use serde_json::Value;
use sha2::{Digest as _, Sha256};

use crate::{
    common::{files_below, mission::site_run, products_site::Site},
    orthoimages::{orthoimage, output, surface},
};

const MISSING: i32 = i32::MIN;

fn page_of(folder: &Path) -> String {
    fs::read_to_string(folder.join("report/explore.html")).unwrap()
}

/// The text between two others.
fn between<'a>(text: &'a str, start: &str, end: &str) -> &'a str {
    let (_, rest) = text.split_once(start).unwrap();
    rest.split_once(end).unwrap().0
}

fn values(page: &str) -> Value {
    let json = between(
        page,
        "<script type=\"application/json\" id=\"values\">",
        "</script>",
    );
    serde_json::from_str(json).unwrap()
}

/// Whole numbers of a column, and its decimals.
fn column(of: &Value) -> (Vec<i32>, i32) {
    let bytes = STANDARD.decode(of["base64"].as_str().unwrap()).unwrap();
    let numbers = bytes.chunks_exact(4);
    let numbers = numbers.map(|bytes| i32::from_le_bytes(bytes.try_into().unwrap()));
    let decimals = of["decimals"].as_i64().unwrap();
    (numbers.collect(), i32::try_from(decimals).unwrap())
}

fn rows(path: &Path) -> Vec<BTreeMap<String, String>> {
    let mut file = csv::Reader::from_path(path).unwrap();
    file.deserialize().map(Result::unwrap).collect()
}

/// Checks a column of the page against the texts of a table, empty where there is no value.
fn assert_same(of: &Value, texts: &[&str], what: &str) {
    let (numbers, decimals) = column(of);
    if texts.iter().all(|text| text.is_empty()) {
        assert!(numbers.is_empty(), "{what}");
        return;
    }
    assert_eq!(numbers.len(), texts.len(), "{what}");
    for (number, text) in numbers.iter().zip(texts) {
        if text.is_empty() {
            assert_eq!(*number, MISSING, "{what}");
            continue;
        }
        let expected: f64 = text.parse().unwrap();
        let apart = (f64::from(*number) - expected * 10_f64.powi(decimals)).abs();
        // Half of the last digit, and the rounding of the table.
        assert!(apart <= 0.5 + 1e-5, "{what}: {number} and {text}");
    }
}

#[test]
fn values_are_those_of_the_tables() {
    let folder = site_run("gusev_crater");
    let values = values(&page_of(&folder));
    let footprints = rows(&folder.join("footprints.csv"));
    let of_page = &values["footprints"];
    assert_eq!(of_page["count"], footprints.len());
    let texts = |name: &str| -> Vec<&str> { footprints.iter().map(|row| &*row[name]).collect() };
    for name in [
        "longitude_deg",
        "latitude_deg",
        "topography_m",
        "record",
        "shot",
    ] {
        assert_same(&of_page[name], &texts(name), name);
    }
    // The search window, as its file states it: 175.05 to 175.55 degrees east, 15.1 to 14.1 degrees south.
    let windows = values["windows"].as_array().unwrap();
    assert_eq!(
        (windows.len(), &windows[0]["id"]),
        (1, &"gusev_crater".into())
    );
    let ring = windows[0]["ring_deg"].as_array().unwrap();
    for (axis, [least, most]) in [[175.05, 175.55], [-15.1, -14.1]].into_iter().enumerate() {
        let of = ring.iter().map(|corner| corner[axis].as_f64().unwrap());
        let ends = of.fold((f64::MAX, f64::MIN), |ends, value| {
            (ends.0.min(value), ends.1.max(value))
        });
        // Degrees: rounded to the sixth decimal.
        assert!(
            (ends.0 - least).abs() < 1e-6 && (ends.1 - most).abs() < 1e-6,
            "{ends:?}"
        );
    }
    let registered = rows(&folder.join("registered_footprints.csv"));
    for image in values["registered"].as_array().unwrap() {
        let id =
            &values["images"][usize::try_from(image["image"].as_u64().unwrap()).unwrap()]["id"];
        let own: Vec<_> = registered
            .iter()
            .filter(|row| *id == row["image"].as_str())
            .collect();
        let texts = |name: &str| -> Vec<&str> { own.iter().map(|row| &*row[name]).collect() };
        let places = [
            "before_line",
            "before_sample",
            "adjusted_line",
            "adjusted_sample",
            "moved_px",
        ];
        for name in places {
            assert_same(&image[name], &texts(name), name);
        }
        assert_same(
            &image["footprint"],
            &texts("footprint_row"),
            "footprint_row",
        );
        for (axis, name) in ["sigma_east_m", "sigma_north_m", "sigma_up_m"]
            .into_iter()
            .enumerate()
        {
            assert_same(&image["sigma_m"][axis], &texts(name), name);
        }
        let inside = column(&image["inside"]).0;
        let expected = own.iter().map(|row| {
            i32::from(row["before_inside"] == "true")
                + 2 * i32::from(row["adjusted_inside"] == "true")
        });
        assert_eq!(inside, expected.collect::<Vec<i32>>());
    }
    let residuals = fs::read_to_string(folder.join("exchange/tie_residuals.geojson")).unwrap();
    let residuals: Value = serde_json::from_str(&residuals).unwrap();
    let mut expected: BTreeMap<(String, String), [f64; 2]> = BTreeMap::new();
    for of in residuals["features"].as_array().unwrap() {
        let of = &of["properties"];
        let [tie, image] = ["tie", "image"].map(|name| of[name].as_str().unwrap().to_owned());
        let line_and_sample =
            ["residual_line", "residual_sample"].map(|name| of[name].as_f64().unwrap());
        expected.insert((tie, image), line_and_sample);
    }
    let measures = &values["measures"];
    let names = ["tie", "image", "residual_line", "residual_sample"];
    let [ties, images, lines, samples] = names.map(|name| column(&measures[name]).0);
    let mut compared = 0;
    for (at, tie) in ties.iter().enumerate() {
        let index = |number: i32| usize::try_from(number).unwrap();
        let tie = values["ties"]["ids"][index(*tie)]
            .as_str()
            .unwrap()
            .to_owned();
        let image = values["images"][index(images[at])]["id"]
            .as_str()
            .unwrap()
            .to_owned();
        if let Some([line, sample]) = expected.get(&(tie, image)) {
            // Lines and samples: half of the third decimal.
            assert!((f64::from(lines[at]) / 1e3 - line).abs() <= 0.000_500_1);
            assert!((f64::from(samples[at]) / 1e3 - sample).abs() <= 0.000_500_1);
            compared += 1;
        }
    }
    assert_eq!(compared, expected.len());
    assert!(compared > 100, "{compared}");
}

/// The map of the small site with a terrain model of one height around its footprints, and an orthoimage.
fn with_terrain<T>(folder: &Path, then: impl FnOnce(&SiteProducts) -> T) -> T {
    let model = |footprints: &Footprints<BodyFixed>| SurfaceModel {
        heights: level(footprints),
        sigmas_m: vec![2.0; 4],
        ..surface().model
    };
    with_surface(folder, (model, false), vec![orthoimage()], then)
}

/// The small site with this terrain model, which may be withheld, and orthoimages.
fn with_surface<T>(
    folder: &Path,
    (model, is_refused): (impl Fn(&Footprints<BodyFixed>) -> SurfaceModel, bool),
    orthoimages: Vec<Orthoimage>,
    then: impl FnOnce(&SiteProducts) -> T,
) -> T {
    Site::small().with(true, |site| {
        let mut book = site.book.clone();
        let Surface { mut account, .. } = surface();
        account.is_refused = is_refused;
        let model = model(site.footprints);
        let surface = output(Surface { account, model });
        book.enter_heavy(Round::Initial, surface, Surface::without_model)
            .unwrap();
        let shown = |of: &Vec<Orthoimage>| of.iter().map(Orthoimage::without_cells).collect();
        book.enter_heavy(Round::Initial, output(orthoimages), shown)
            .unwrap();
        let site = SiteProducts {
            book: &book,
            ..*site
        };
        write_products(folder, &site, "").unwrap();
        then(&site)
    })
}

#[test]
fn a_withheld_terrain_model_without_cells_is_not_drawn() {
    let folder = tempfile::tempdir().unwrap();
    let empty = |footprints: &Footprints<BodyFixed>| SurfaceModel {
        heights: HeightGrid {
            size: [0, 0],
            heights_m: Vec::new(),
            ..level(footprints)
        },
        sigmas_m: Vec::new(),
        parallel_rad: 0.0,
        ..surface().model
    };
    with_surface(folder.path(), (empty, true), Vec::new(), |_| ());
    let values = values(&page_of(folder.path()));
    assert_eq!(values["terrain"], Value::Array(Vec::new()));
    let layers = values["layers"].as_array().unwrap().iter();
    let titles: Vec<&str> = layers.filter_map(|layer| layer["title"].as_str()).collect();
    assert!(
        !titles.iter().any(|title| title.contains("errain")),
        "{titles:?}"
    );
}

const HEIGHT_M: f32 = 100.0;
const RADIUS_M: f64 = 3_396_190.0;

/// Four cells around all footprints, which lie on both sides of the antimeridian.
fn level(footprints: &Footprints<BodyFixed>) -> HeightGrid {
    let half_turn = std::f64::consts::PI;
    let from_antimeridian = footprints.longitude_rad.iter().map(|of| of - half_turn);
    let (west_rad, east_rad) = from_antimeridian.fold((0.0_f64, 0.0_f64), |(west, east), of| {
        (west.min(of), east.max(of))
    });
    let latitudes = footprints.latitude_rad.iter();
    let (south_rad, north_rad) = latitudes.fold((1.0_f64, -1.0_f64), |(south, north), of| {
        (south.min(of), north.max(of))
    });
    let size_rad = f64::max(east_rad - west_rad, north_rad - south_rad) + 0.001;
    HeightGrid {
        size: [2, 2],
        first_rad: [half_turn + west_rad - 0.0005, north_rad + 0.0005],
        cell_rad: [size_rad; 2],
        radius_m: RADIUS_M,
        heights_m: vec![HEIGHT_M; 4],
    }
}

#[test]
fn the_page_is_complete_without_a_network_and_the_same_every_time() {
    let folder = tempfile::tempdir().unwrap();
    with_terrain(folder.path(), |_| ());
    let page = page_of(folder.path());
    // It names no resource but its pictures, and its policy allows no other script than its own.
    let script = between(&page, "<script>", "</script>");
    let hash = STANDARD.encode(Sha256::digest(script.as_bytes()));
    assert!(page.contains(&format!("default-src 'none'; script-src 'sha256-{hash}';")));
    // The picture of the globe is in the page.
    let parts = page
        .replace(script, "")
        .replace("src=\"data:image/png;base64,", "");
    for resource in ["src=", "<link", "@import", "http:", "<iframe"] {
        assert!(!parts.contains(resource), "{resource}");
    }
    // The licence of Leaflet in the page and in its style names its home; nothing is loaded from there.
    for address in parts.split("https:").skip(1) {
        assert!(!address.starts_with("//unpkg") && !address.starts_with("//cdn"));
    }
    let licence = include_str!("../../licences/leaflet.txt");
    assert!(page.contains(licence));
    let values = values(&page);
    let mut named: Vec<PathBuf> = Vec::new();
    for layer in values["layers"].as_array().unwrap() {
        let parts = layer["parts"].as_array().unwrap().iter();
        named.extend(parts.map(|part| part["file"].as_str().unwrap().into()));
    }
    named.sort();
    let pictures = folder.path().join("report/explore");
    let mut written: Vec<PathBuf> = files_below(&pictures)
        .into_iter()
        .map(|path| path.strip_prefix(&pictures).unwrap_or(&path).to_owned())
        .collect();
    written.sort();
    assert_eq!(named, written);
    assert_eq!(named.len(), 3, "{named:?}");

    let again = tempfile::tempdir().unwrap();
    with_terrain(again.path(), |_| ());
    for path in files_below(&folder.path().join("report")) {
        let path = path.strip_prefix(folder.path()).unwrap_or(&path).to_owned();
        let [one, other] = [&folder, &again].map(|of| fs::read(of.path().join(&path)).unwrap());
        assert!(one == other, "{}", path.display());
    }
}

#[test]
fn the_terrain_line_is_the_model_above_the_areoid_of_the_footprints() {
    let folder = tempfile::tempdir().unwrap();
    let areoid_m: Vec<f64> = with_terrain(folder.path(), |site| {
        let rows = site.profiles[0].rows.iter();
        let areoid = &site.footprints.areoid_radius_m;
        rows.map(|row| areoid.at(*row as usize)).collect()
    });
    let values = values(&page_of(folder.path()));
    let line = &values["terrain"][0];
    let steps = usize::try_from(line["steps"].as_u64().unwrap()).unwrap();
    let (heights, decimals) = column(&line["heights_m"]);
    assert_eq!((line["first"].as_u64(), decimals), (Some(0), 2));
    assert_eq!(heights.len(), (areoid_m.len() - 1) * steps + 1);
    for (at, areoid_m) in areoid_m.iter().enumerate() {
        let height_m = f64::from(heights[at * steps]) / 100.0;
        let expected_m = RADIUS_M + f64::from(HEIGHT_M) - areoid_m;
        // Metres: half of the last digit.
        assert!(
            (height_m - expected_m).abs() <= 0.005_001,
            "{height_m} {expected_m}"
        );
    }
    // Numbers of the profile's graph and of its footprints have one order.
    let profile = column(&values["footprints"]["profile"]).0;
    let own = profile.iter().filter(|profile| **profile == 0).count();
    assert_eq!(own, areoid_m.len());
}

#[test]
fn sites_about_a_pole_and_without_footprints_have_a_page() {
    for (site, polar) in [(Site::polar(), true), (Site::empty(), false)] {
        let folder = tempfile::tempdir().unwrap();
        site.with(true, |site| {
            write_products(folder.path(), site, "").unwrap()
        });
        let values = values(&page_of(folder.path()));
        assert_eq!(values["map"]["polar"], polar);
        assert_eq!(values["footprints"]["count"], site.footprints.len());
    }
    let folder = tempfile::tempdir().unwrap();
    Site::empty().with(false, |site| {
        write_products(folder.path(), site, "").unwrap()
    });
    assert!(!folder.path().join("report/explore.html").exists());
    assert!(!folder.path().join("report/explore").exists());
}
