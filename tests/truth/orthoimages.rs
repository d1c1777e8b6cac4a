//! Orthoimages of a pair before and after the adjustment of a known misregistration, and their mosaics.

#![allow(
    clippy::cast_possible_wrap,
    clippy::disallowed_methods,
    clippy::panic,
    clippy::print_stdout,
    clippy::unwrap_used,
    reason = "tests work in temporary folders with small maps, and may fail loudly"
)]

use std::{fs, fs::File, path::Path};

use areograph::{
    config::{Document as _, SiteConfig},
    flow::Task,
};
use serde_json::{Value, json};
use tiff::{
    decoder::{Decoder, DecodingResult},
    tags::Tag,
};

use crate::common::{
    self,
    flows::run_into,
    pair::{write_pair, write_pair_on_shots},
    readers,
};

/// Distance by which the support data of the second image, which looks down, are displaced along its flight, metres.
const ALONG_M: f64 = 300.0;

/// A raster as another program reads it.
struct Raster {
    size: [usize; 2],
    /// Columns eastwards and rows southwards of its corner from 0° E 0° N.
    corner: [i64; 2],
    bytes: Vec<u8>,
}

impl Raster {
    fn read(path: &Path) -> Self {
        let mut decoder = Decoder::new(File::open(path).unwrap()).unwrap();
        let (columns, rows) = decoder.dimensions().unwrap();
        let corner_m = decoder.get_tag_f64_vec(Tag::ModelTiepointTag).unwrap();
        let cell_m = decoder.get_tag_f64_vec(Tag::ModelPixelScaleTag).unwrap()[0];
        let DecodingResult::U8(bytes) = decoder.read_image().unwrap() else {
            panic!("other numbers");
        };
        #[allow(clippy::cast_possible_truncation, reason = "cells of a map")]
        let corner = [corner_m[3], -corner_m[4]].map(|at| (at / cell_m).round() as i64);
        Self {
            size: [rows as usize, columns as usize],
            corner,
            bytes,
        }
    }

    /// The value of the cell at this row and column of `other`; 0 outside.
    fn at_cell_of(&self, other: &Self, [row, column]: [usize; 2]) -> u8 {
        let place = |axis: usize, at: usize| {
            usize::try_from(at as i64 + other.corner[axis] - self.corner[axis]).ok()
        };
        let (row, column) = (place(1, row), place(0, column));
        let inside = row
            .zip(column)
            .filter(|(row, column)| *row < self.size[0] && *column < self.size[1]);
        inside.map_or(0, |(row, column)| self.bytes[row * self.size[1] + column])
    }
}

/// Displaces the positions of support data, which the scene writes in km, along the flight.
pub(crate) fn displace(path: &Path) {
    let mut isd = common::json(path);
    let of = &mut isd["instrument_position"];
    let velocities = of["velocities"].as_array().unwrap().clone();
    for (place, velocity) in of["positions"]
        .as_array_mut()
        .unwrap()
        .iter_mut()
        .zip(velocities)
    {
        let axes: Vec<f64> = velocity
            .as_array()
            .unwrap()
            .iter()
            .map(common::number)
            .collect();
        let speed = axes.iter().map(|of| of * of).sum::<f64>().sqrt();
        for (axis, along) in place.as_array_mut().unwrap().iter_mut().zip(axes) {
            *axis = json!(common::number(axis) + 1e-3 * ALONG_M * along / speed);
        }
    }
    fs::write(path, isd.to_string()).unwrap();
}

/// Every cell of a mosaic is that of the orthoimage that the sources identify, and no cell is invented or left out.
fn is_of_its_sources(products: &Path, [mosaic, sources, orthoimage]: [&str; 3], images: &[Value]) {
    let [mosaic, sources] = [mosaic, sources].map(|name| Raster::read(&products.join(name)));
    let orthoimages = images.iter().map(|of| {
        let id = of["image"].as_str().unwrap();
        Raster::read(&products.join(format!("images/{id}/{orthoimage}")))
    });
    let orthoimages: Vec<Raster> = orthoimages.collect();
    let mut taken = vec![0_u64; orthoimages.len()];
    for (at, (brightness, source)) in mosaic.bytes.iter().zip(&sources.bytes).enumerate() {
        let cell = [at / mosaic.size[1], at % mosaic.size[1]];
        let of = |index: usize| orthoimages[index].at_cell_of(&mosaic, cell);
        match usize::from(*source).checked_sub(1) {
            Some(index) => {
                taken[index] += 1;
                assert!(*brightness > 0 && *brightness == of(index), "{cell:?}");
            }
            None => assert!(*brightness == 0 && (0..taken.len()).all(|index| of(index) == 0)),
        }
    }
    assert!(taken.iter().all(|cells| *cells > 1_000), "{taken:?}");
}

/// Number of rows of the table that match in both states, and their root mean square offsets before and after, metres.
fn of_both(products: &Path) -> (usize, [f64; 2]) {
    let table = fs::read_to_string(products.join("orthoimage_offsets.csv")).unwrap();
    let mut rows = table.lines().map(|row| row.split(',').collect::<Vec<_>>());
    let head = rows.next().unwrap();
    let columns = [
        "before_east_m",
        "before_north_m",
        "after_east_m",
        "after_north_m",
    ];
    let columns = columns.map(|name| head.iter().position(|of| *of == name).unwrap());
    let offsets = rows.filter_map(|row| {
        let offsets: Vec<f64> = columns
            .iter()
            .filter_map(|of| row[*of].parse().ok())
            .collect();
        <[f64; 4]>::try_from(offsets).ok()
    });
    let offsets: Vec<[f64; 4]> = offsets.collect();
    let rms = |from: usize| {
        let squares = offsets
            .iter()
            .map(|of| of[from].powi(2) + of[from + 1].powi(2));
        (squares.sum::<f64>() / offsets.len() as f64).sqrt()
    };
    (offsets.len(), [rms(0), rms(2)])
}

/// The offsets before and after the adjustment are over the squares that match in both.
fn is_over_common_squares(products: &Path, pair: &Value) {
    let (in_both, rms_m) = of_both(products);
    assert_eq!(pair["places_in_both"], json!(in_both));
    for (state, rms_m) in ["before", "after"].iter().zip(rms_m) {
        let stated_m = common::number(&pair[state]["rms_m"]);
        // Rounding of the table.
        assert!(
            (stated_m - rms_m).abs() < 1e-3 * rms_m,
            "{stated_m} {rms_m}"
        );
    }
}

/// Every raster is valid as a cloud-optimised file, and has the cells that Rasterio reads.
fn are_cloud_optimised(products: &Path) {
    let Some(rasters) = readers::cloud_optimised(products) else {
        return;
    };
    let rasters = rasters.as_object().unwrap();
    assert!(rasters.len() >= 12, "{:?}", rasters.keys());
    for (name, raster) in rasters {
        assert!(common::number(&raster[2]) > 0.0, "{name}: {raster}");
    }
    for name in ["mosaic.tif", "mosaic_source.tif", "mosaic_before.tif"] {
        let Raster { size, bytes, .. } = Raster::read(&products.join(name));
        let shown = bytes.iter().filter(|byte| **byte > 0).count();
        assert_eq!(rasters[name], json!([size[0], size[1], shown, true]));
    }
}

/// GDAL reads the mosaics with their sizes and empty cells.
fn are_read_by_gdal(products: &Path) {
    for name in ["mosaic.tif", "mosaic_source.tif", "mosaic_before.tif"] {
        let Some(mut gdal) = readers::program("gdalinfo", "mosaics in GDAL") else {
            return;
        };
        let path = products.join(name);
        let found = readers::output(gdal.args(["-json", "-checksum"]).arg(&path));
        let found: Value = serde_json::from_str(&found).unwrap();
        let band = &found["bands"][0];
        assert_eq!(
            (&band["type"], &band["noDataValue"]),
            (&json!("Byte"), &json!(0.0))
        );
        let Raster {
            size: [rows, columns],
            ..
        } = Raster::read(&path);
        assert_eq!(found["size"], json!([columns, rows]));
        assert!(common::number(&band["checksum"]) > 0.0);
    }
}

#[test]
fn a_known_misregistration_is_measured_before_the_adjustment_and_gone_after_it() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    write_pair(folder);
    displace(&folder.join("second/isd/nd.json"));
    let site = folder.join("pair.toml");
    let text = fs::read_to_string(&site).unwrap();
    // Cells of about a pixel, and brightness as in the images.
    let [was, is] = [
        "orthoimage_cell_m = 50.0",
        "orthoimage_cell_m = 25.0\nmosaic_balance = false",
    ];
    assert!(text.contains(was));
    fs::write(&site, text.replace(was, is)).unwrap();
    let config = SiteConfig::load(&site).unwrap().config;
    let products = run_into(Task::Site(&config), &folder.join("out"), false)
        .unwrap()
        .folder;

    let document = common::json(&products.join("orthoimages.json"));
    let pair = &document["pairs"][0];
    println!("{pair:#}");
    let number = |place: &str| common::number(pair.pointer(place).unwrap());
    let pixel_m = common::number(&document["orthoimages"][0]["pixel_m"]);
    for state in ["before", "after"] {
        let [squares, places] = ["squares", "places"].map(|of| number(&format!("/{state}/{of}")));
        assert!(
            places >= 8.0 && places >= 0.8 * squares,
            "{state}: {places} of {squares}"
        );
    }
    let median_m = number("/before/median_m/0").hypot(number("/before/median_m/1"));
    // A third of a pixel: rays of a camera displaced along level ground are displaced as far.
    assert!((median_m - ALONG_M).abs() < 0.3 * pixel_m, "{median_m}");
    assert!((number("/before/rms_m") - ALONG_M).abs() < 0.3 * pixel_m);
    assert!(number("/after/rms_m") <= 0.3 * pixel_m);

    is_over_common_squares(&products, pair);
    let mosaic = common::json(&products.join("mosaic.json"));
    let [seams, before] = ["seams", "seams_before"].map(|of| &mosaic[of][0]["places"]);
    assert!(seams == before && common::number(seams) <= number("/places_in_both"));
    let images = mosaic["images"].as_array().unwrap();
    assert!(
        images
            .iter()
            .all(|of| of["gain"] == json!(1.0) && of["offset"] == json!(0.0))
    );
    is_of_its_sources(
        &products,
        ["mosaic.tif", "mosaic_source.tif", "orthoimage.tif"],
        images,
    );
    let before = [
        "mosaic_before.tif",
        "mosaic_before_source.tif",
        "orthoimage_before.tif",
    ];
    is_of_its_sources(&products, before, images);
    for (seams, least_m, most_m) in [
        ("seams_before", 0.9 * ALONG_M, 1.1 * ALONG_M),
        // A tenth of a pixel more than the limit of all places: few lie at a seam.
        ("seams", 0.0, 0.4 * pixel_m),
    ] {
        let rms_m = common::number(&mosaic[seams][0]["rms_m"]);
        assert!((least_m..=most_m).contains(&rms_m), "{seams}: {rms_m}");
    }
    let report = fs::read_to_string(products.join("report/index.html")).unwrap();
    assert!(report.contains("The orthoimages of s1 and nd differ by"));
    assert!(report.contains("At the seam of s1 and nd, the images differ by"));
    are_read_by_gdal(&products);
    are_cloud_optimised(&products);
}

/// Root mean square distance between the orthoimages of the two images of a pair on the ground between shots that are this much too
/// high, metres, and the products.
fn apart_on_shots(folder: &Path, too_high_m: f64) -> (f64, Value) {
    write_pair_on_shots(folder);
    let site = folder.join("pair.toml");
    let shots = folder.join("shots.csv");
    let table = fs::read_to_string(&shots).unwrap();
    let (head, rows) = table.split_once('\n').unwrap();
    let head: Vec<&str> = head.split(',').collect();
    let raised = rows.lines().map(|row| {
        let cells = row.split(',').zip(&head).map(|(cell, name)| match *name {
            "radius_m" | "radius_crossover_m" => {
                (cell.parse::<f64>().unwrap() + too_high_m).to_string()
            }
            _ => cell.to_owned(),
        });
        cells.collect::<Vec<_>>().join(",")
    });
    let raised: Vec<String> = raised.collect();
    fs::write(
        &shots,
        format!("{}\n{}\n", head.join(","), raised.join("\n")),
    )
    .unwrap();
    let config = SiteConfig::load(&site).unwrap().config;
    let outcome = run_into(Task::Site(&config), &folder.join("out"), false).unwrap();
    let document = common::json(&outcome.folder.join("orthoimages.json"));
    assert!(outcome.folder.join("mosaic.tif").exists());
    assert!(!outcome.folder.join("surface_above_sphere.tif").exists());
    let images = document["orthoimages"].as_array().unwrap();
    let names = ["mosaic.tif", "mosaic_source.tif", "orthoimage.tif"];
    is_of_its_sources(&outcome.folder, names, images);
    (
        common::number(&document["pairs"][0]["before"]["rms_m"]),
        document,
    )
}

/// Both images show the same ground, with the true orientation: where heights are right, their orthoimages agree.
#[test]
fn orthoimages_on_the_ground_between_shots_agree() {
    let [right, wrong] = [0.0, 600.0].map(|too_high_m| {
        let folder = tempfile::tempdir().unwrap();
        let (apart_m, document) = apart_on_shots(folder.path(), too_high_m);
        println!("shots {too_high_m} m too high: orthoimages {apart_m:.1} m apart");
        for image in document["orthoimages"].as_array().unwrap() {
            println!("{image}");
            // Support data state no accuracy.
            for name in ["shared_sigma_m", "image_sigma_m", "drift_m"] {
                assert!(image.get(name).is_none(), "{name}");
            }
        }
        apart_m
    });
    // Metres: the standard deviation that the heights give the image that looks aside; 600 m displace it by more than ten times as much.
    assert!(right < 18.0 && wrong > 180.0, "{right} {wrong}");
}
