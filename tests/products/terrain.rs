//! Files of the terrain model of a small site, as other programs read them.

#![allow(
    clippy::panic,
    clippy::unwrap_used,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::cast_precision_loss,
    reason = "helpers of tests may fail loudly; cells of a small grid"
)]

use std::{collections::BTreeMap, fs::File, path::Path};

use areograph::{
    body::Body,
    capabilities::{self, write_products},
    geom::{contours::generalised, height_grid::HeightGrid, reference_surface::ReferenceSurface},
    pds::terrain_model::{HeightsAbove, read_terrain_model},
    products::{SiteProducts, listed},
    stage::{Output, Provenance, Round},
    stages::map_surface::{
        JoinedPair, Joint, Seam, ShotComparison, Surface, SurfaceAccount, SurfaceModel,
    },
};
use serde_json::Value;
use tiff::decoder::{Decoder, DecodingResult};

use crate::common::{
    json,
    products_site::Site,
    readers::{output, program},
};

const SIZE: [usize; 2] = [60, 45];
const CELL_M: f64 = 100.0;
const RADIUS_M: f64 = 3_396_190.0;
/// Radius that all shots of the site state of the areoid, metres.
const AREOID_M: f64 = 3_395_500.0;
/// Parallel of the map, radians, near the shots of the site.
const PARALLEL_RAD: f64 = -0.0975;
/// Rows and columns without heights: a hole, and a corner.
fn is_hole([row, column]: [usize; 2]) -> bool {
    (20..30).contains(&row) && (15..24).contains(&column) || row + column < 12
}

/// Hills above the map sphere, with slopes of up to 20 degrees.
fn model() -> SurfaceModel {
    let north_rad = CELL_M / RADIUS_M;
    let height_m = |at: usize| {
        let cell = [at / SIZE[1], at % SIZE[1]];
        let [row, column] = cell.map(|of| of as f64);
        let hill_m = 150.0 * (row / 7.0).sin() + 90.0 * ((column + 0.5 * row) / 5.0).cos();
        if is_hole(cell) {
            f32::NAN
        } else {
            (hill_m - 400.0) as f32
        }
    };
    let heights_m: Vec<f32> = (0..SIZE[0] * SIZE[1]).map(height_m).collect();
    SurfaceModel {
        sigmas_m: heights_m.iter().map(|of| of * 0.0 + 4.0).collect(),
        heights: HeightGrid {
            size: SIZE,
            first_rad: [std::f64::consts::PI - 6e-4, PARALLEL_RAD + 9e-4],
            cell_rad: [north_rad / PARALLEL_RAD.cos(), north_rad],
            radius_m: RADIUS_M,
            heights_m,
        },
        parallel_rad: PARALLEL_RAD,
        pairs: Vec::new(),
    }
}

fn surface(site: &SiteProducts) -> Surface {
    let model = model();
    let shots = (0..site.footprints.len()).map(|at| {
        let of = &site.footprints;
        let place_rad = [of.longitude_rad.at(at), of.latitude_rad.at(at)];
        (place_rad, of.areoid_radius_m.at(at))
    });
    let [west, south, east, north] = model.heights.edges_rad();
    let corners_rad = [[west, south], [east, north]];
    let reference = ReferenceSurface::fitted(Body::Mars, &corners_rad, shots);
    Surface {
        account: SurfaceAccount {
            images: [0, 0],
            directions: [[0.0; 3]; 2],
            cell_m: CELL_M,
            sample_m: 20.0,
            compared_m: 340.0,
            cells: 2_700,
            filled: 2_500,
            unfilled: BTreeMap::new(),
            is_refused: false,
            convergence_rad: 0.3,
            height_of_pixel_m: 12.0,
            sigma_m: 4.0,
            jitter_m: 1.0,
            smoothing_m: 0.5,
            correlation: 0.9,
            aside_m: 0.1,
            common_sigma_m: Some(1.5),
            shots_take_part: true,
            reference,
            joint: None,
            shots: ShotComparison::default(),
            look: model.look(480),
        },
        model,
    }
}

/// Writes the products of the site; returns its page.
fn written(folder: &Path) -> String {
    written_with(folder, false, surface)
}

/// As [`written`], for another model, and with filled holes.
fn written_with(
    folder: &Path,
    filled: bool,
    surface: impl FnOnce(&SiteProducts) -> Surface,
) -> String {
    Site::small().with(true, |site| {
        let nowhere = Provenance {
            blake3: String::new(),
            fingerprint: String::new(),
        };
        let surface = Output::known(String::new(), surface(site), nowhere);
        let mut book = site.book.clone();
        book.enter_heavy(Round::Initial, surface, Surface::without_model)
            .unwrap();
        let mut config = site.config.clone();
        config.surface.filled = filled;
        let site = SiteProducts {
            book: &book,
            config: &config,
            ..*site
        };
        let listed = listed(&site, capabilities::declarations());
        let site = SiteProducts {
            listed: &listed,
            ..site
        };
        write_products(folder, &site, "").unwrap();
        capabilities::page(&site).unwrap()
    })
}

/// Numbers of a raster; NaN where there is none.
fn numbers(path: &Path) -> Vec<f32> {
    let mut decoder = Decoder::new(File::open(path).unwrap()).unwrap();
    assert_eq!(
        decoder.dimensions().unwrap(),
        (SIZE[1] as u32, SIZE[0] as u32)
    );
    match decoder.read_image().unwrap() {
        DecodingResult::F32(numbers) => numbers
            .into_iter()
            .map(|of| if of < -9_000.0 { f32::NAN } else { of })
            .collect(),
        DecodingResult::U8(numbers) => numbers
            .into_iter()
            .map(|of| if of == 0 { f32::NAN } else { f32::from(of) })
            .collect(),
        other => panic!("{other:?}"),
    }
}

#[test]
fn heights_name_their_reference_surface() {
    let folder = tempfile::tempdir().unwrap();
    let page = written(folder.path());
    let path = |name: &str| folder.path().join(name);
    let [above_sphere, above_areoid] = ["surface_above_sphere.tif", "surface_above_areoid.tif"];
    for name in [
        "surface_above_ellipsoid.tif",
        "surface_pairs.tif",
        "surface_filled_above_sphere.tif",
        "surface_filled_above_areoid.tif",
    ] {
        assert!(!path(name).exists(), "{name}");
    }
    let expected_m = model().heights.heights_m;
    let written_m = numbers(&path(above_areoid));
    for (at, (of_sphere, of_areoid)) in numbers(&path(above_sphere))
        .into_iter()
        .zip(written_m)
        .enumerate()
    {
        assert_eq!(of_sphere.is_nan(), expected_m[at].is_nan());
        assert_eq!(of_areoid.is_nan(), expected_m[at].is_nan());
        // A slanted profile gives the areoid a gradient across it, 0.02 m/km here, over 2 km.
        let off_m = f64::from(of_areoid - of_sphere) - (RADIUS_M - AREOID_M);
        assert!(of_sphere.is_nan() || off_m.abs() < 0.1, "{off_m}");
    }
    // Programs that expect heights above the sphere do not take others for them.
    let refused = read_terrain_model(&path(above_areoid), Body::Mars, HeightsAbove::default());
    let refused = refused.unwrap_err().to_string();
    assert!(refused.contains("states a vertical system"), "{refused}");
    read_terrain_model(&path(above_sphere), Body::Mars, HeightsAbove::default()).unwrap();

    let document = json(&path("surface.json"));
    assert_eq!(document["heights"]["reference"], "areoid");
    let section = page.split("id=\"terrain-model\"").nth(1).unwrap();
    assert!(section.contains("height above the areoid, m"));
    assert!(section.contains("../surface_above_areoid.tif"));
    assert!(!section.contains("height above the sphere"));

    for (name, band, unit, vertical) in [
        (above_sphere, "height above the map sphere", "m", false),
        (above_areoid, "height above the areoid", "m", true),
        (
            "surface_sigma.tif",
            "standard deviation of the height about the common offset",
            "m",
            false,
        ),
        ("surface_slope.tif", "slope", "deg", false),
    ] {
        let Some(mut gdalinfo) = program("gdalinfo", "references of heights in GDAL") else {
            return;
        };
        let text = output(gdalinfo.arg("-json").arg(path(name)));
        let found: Value = serde_json::from_str(&text).unwrap();
        let of_band = &found["bands"][0];
        assert_eq!(
            (&of_band["description"], &of_band["unit"]),
            (&band.into(), &unit.into())
        );
        assert_eq!(of_band["noDataValue"], -32_768.0);
        let wkt = found["coordinateSystem"]["wkt"].as_str().unwrap();
        assert_eq!(
            wkt.contains("VERTCRS[\"height above the areoid\""),
            vertical,
            "{wkt}"
        );
        assert!(wkt.contains("ELLIPSOID[\"unnamed\",3396190,0"), "{wkt}");
    }
}

#[test]
fn slopes_and_shading_are_those_of_gdal() {
    let folder = tempfile::tempdir().unwrap();
    written(folder.path());
    // Slopes in degrees; grey values.
    for (mode, name, allowed) in [
        ("slope", "surface_slope.tif", 0.01),
        ("hillshade", "surface_hillshade.tif", 1.0),
    ] {
        let Some(mut gdaldem) = program("gdaldem", "slopes and shading by GDAL") else {
            return;
        };
        let theirs = folder.path().join(format!("gdal_{name}"));
        let above = folder.path().join("surface_above_areoid.tif");
        output(gdaldem.arg(mode).arg(above).arg(&theirs));
        let (ours, theirs) = (numbers(&folder.path().join(name)), numbers(&theirs));
        for (at, (ours, theirs)) in ours.iter().zip(&theirs).enumerate() {
            assert_eq!(ours.is_nan(), theirs.is_nan(), "{mode} {at}");
            // Rounding, and the change of the cells' width over 0.1 degrees of latitude.
            assert!(
                ours.is_nan() || (ours - theirs).abs() <= allowed,
                "{ours} {theirs}"
            );
        }
    }
}

#[test]
fn contours_have_their_heights_and_cross_no_hole() {
    let folder = tempfile::tempdir().unwrap();
    written(folder.path());
    let interval_m = json(&folder.path().join("surface.json"))["heights"]["contour_interval_m"]
        .as_f64()
        .unwrap();
    // 3.29 times 4 m, and 1/25 of 480 m, in steps of 1, 2 and 5.
    assert!((interval_m - 20.0).abs() < 1e-9, "{interval_m}");
    let Some(mut ogr2ogr) = program("ogr2ogr", "contours in GDAL") else {
        return;
    };
    let contours = folder.path().join("exchange/surface_contours.gpkg");
    let text = output(ogr2ogr.args(["-f", "GeoJSON", "/vsistdout/"]).arg(contours));
    let found: Value = serde_json::from_str(&text).unwrap();
    let features = found["features"].as_array().unwrap();
    assert!(features.len() > 20);
    // Means over three cells by three, the compared square.
    let grid = generalised(&model().heights, 1);
    let (mut places, mut index) = (0, 0);
    for feature in features {
        let height_m = feature["properties"]["height_m"].as_f64().unwrap();
        let intervals = height_m / interval_m;
        assert!((intervals - intervals.round()).abs() < 1e-9);
        let is_index = feature["properties"]["is_index"].as_bool().unwrap();
        assert_eq!(is_index, intervals.round() as i64 % 5 == 0);
        index += usize::from(is_index);
        for place in feature["geometry"]["coordinates"].as_array().unwrap() {
            let place_rad = [0, 1].map(|axis| place[axis].as_f64().unwrap().to_radians());
            let cell = grid.cell_of(place_rad[0], place_rad[1]);
            // Degrees are written in full; a crossing lies between two cells.
            let at = cell.map(|of| (of * 1e6).round() / 1e6);
            let ends =
                [at.map(f64::floor), at.map(f64::ceil)].map(|cell| cell.map(|of| of as usize));
            for cell in ends {
                assert!(!is_hole(cell), "{cell:?}");
            }
            let of = |[row, column]: [usize; 2]| f64::from(grid.heights_m[row * SIZE[1] + column]);
            let share = (at[0] - at[0].floor()).max(at[1] - at[1].floor());
            let between_m = of(ends[0]) + share * (of(ends[1]) - of(ends[0]));
            let above_m = between_m + RADIUS_M - AREOID_M;
            // The areoid as above, metres.
            assert!((above_m - height_m).abs() < 0.1, "{above_m} {height_m}");
            places += 1;
        }
    }
    assert!(places > 1_000 && index > 0);
}

/// The model as that of two pairs, and of a third without a model.
fn joined_surface(site: &SiteProducts) -> Surface {
    let mut surface = surface(site);
    let pair = |bit: Option<u32>, offset_m: f64| JoinedPair {
        images: [0, 0],
        bit,
        cells: 1_600,
        filled: 1_500,
        convergence_rad: 0.3,
        sigma_m: 4.5,
        offset_m,
        offset_sigma_m: 0.25,
        shots_above_m: bit.map(|_| [1.25, 0.5]),
    };
    surface.account.joint = Some(Joint {
        pairs: vec![pair(Some(0), 6.125), pair(Some(1), -6.375), pair(None, 0.0)],
        seams: vec![Seam {
            pairs: [0, 1],
            cells: 500,
            before_m: 12.75,
            after_m: 0.25,
            sigma_m: 0.5,
            spread_sigmas: 1.25,
        }],
        filled: 2_500,
        several: 500,
    });
    surface.model.pairs = (0..SIZE[0] * SIZE[1]).map(bits).collect();
    surface
}

/// Pairs of a cell: the first in the west, the second in the east.
fn bits(at: usize) -> u32 {
    let [row, column] = [at / SIZE[1], at % SIZE[1]];
    if is_hole([row, column]) {
        return 0;
    }
    u32::from(column < 25) | (u32::from(column >= 15) << 1)
}

#[test]
fn pairs_are_identified_and_holes_are_filled_where_requested() {
    let folder = tempfile::tempdir().unwrap();
    let page = written_with(folder.path(), true, joined_surface);
    let path = |name: &str| folder.path().join(name);
    let mut decoder = Decoder::new(File::open(path("surface_pairs.tif")).unwrap()).unwrap();
    let DecodingResult::U32(found) = decoder.read_image().unwrap() else {
        panic!("other numbers");
    };
    assert_eq!(found, (0..SIZE[0] * SIZE[1]).map(bits).collect::<Vec<_>>());
    if let Some(mut gdalinfo) = program("gdalinfo", "pairs in GDAL") {
        let text = output(gdalinfo.arg("-json").arg(path("surface_pairs.tif")));
        let found: Value = serde_json::from_str(&text).unwrap();
        assert_eq!(found["bands"][0]["type"], "UInt32");
        assert_eq!(found["bands"][0]["noDataValue"], 0.0);
    }

    let document = json(&path("surface.json"));
    assert_eq!(document["joint"]["pairs"][0]["bit"], 0);
    assert_eq!(document["joint"]["pairs"][2]["bit"], Value::Null);
    assert_eq!(document["joint"]["seams"][0]["before_m"], 12.75);
    let section = page.split("id=\"terrain-model\"").nth(1).unwrap();
    let seams = section.rsplit("Seams: heights").next().unwrap();
    let seams = seams.split("</table>").next().unwrap();
    for number in ["500", "+12.75", "+0.25", "0.50", "1.25"] {
        assert!(seams.contains(&format!(">{number}<")), "{number}: {seams}");
    }
    assert!(section.contains("no model"));

    let known = model().heights.heights_m;
    let filled = numbers(&path("surface_filled_above_sphere.tif"));
    let of_areoid = numbers(&path("surface_filled_above_areoid.tif"));
    let sigmas = numbers(&path("surface_filled_sigma.tif"));
    for at in 0..known.len() {
        let [row, column] = [at / SIZE[1], at % SIZE[1]];
        // The hole inside is nine cells wide; the corner of the model is no hole.
        assert_eq!(filled[at].is_nan(), row + column < 12, "{row} {column}");
        assert_eq!(
            [of_areoid[at], sigmas[at]].map(f32::is_nan),
            [filled[at].is_nan(); 2]
        );
        if filled[at].is_nan() {
            continue;
        }
        if known[at].is_nan() {
            // Hills of 20 degrees change by more than 4 m over a cell of 100 m.
            assert!(sigmas[at] > 8.0, "{}", sigmas[at]);
        } else {
            assert!((filled[at] - known[at]).abs() < 1e-6 && (sigmas[at] - 4.0).abs() < 1e-6);
        }
    }
    // The model itself keeps its hole.
    assert!(numbers(&path("surface_above_areoid.tif"))[25 * SIZE[1] + 20].is_nan());
}
