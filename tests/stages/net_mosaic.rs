//! The mosaic of a synthetic net, whose ground has a known brightness at every place of the map.
#![allow(
    clippy::format_push_string,
    clippy::too_many_lines,
    clippy::disallowed_methods,
    clippy::unwrap_used,
    clippy::panic,
    reason = "helpers of tests work in temporary folders and may fail loudly"
)]

use std::{fs, path::Path, sync::LazyLock};

use areograph::{
    config::{Document as _, NetConfig},
    error::Error,
    flow::{RunOutcome, Task},
    scene::write_plane_scene,
};
use serde_json::{Value, json};
use tiff::{
    decoder::{Decoder, DecodingResult},
    encoder::{TiffEncoder, colortype::Gray8},
    tags::Tag,
};

use crate::common::{
    assert_keeps_schema,
    flows::run_into,
    golden::assert_messages,
    json, number,
    readers::{cloud_optimised, program},
};

const SEED: u64 = 3;
/// Cells between compared places of a picture, cells to either side, and cells of a compared square.
const APART: usize = 40;
const REACH: i64 = 10;
const HALF: i64 = 6;

/// The scene, written once.
static SCENE: LazyLock<tempfile::TempDir> = LazyLock::new(|| {
    let folder = tempfile::tempdir().unwrap();
    write_plane_scene(&folder.path().join("net"), SEED).unwrap();
    folder
});

/// A copy of the scene.
fn scene() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir_all(folder.path().join("net/images")).unwrap();
    for below in ["net", "net/images"] {
        for entry in fs::read_dir(SCENE.path().join(below)).unwrap() {
            let path = entry.unwrap().path();
            if path.is_file() {
                let to = folder.path().join(below).join(path.file_name().unwrap());
                fs::copy(&path, to).unwrap();
            }
        }
    }
    folder
}

fn run(folder: &Path) -> Result<RunOutcome, Error> {
    let net = NetConfig::load(&folder.join("net/net.toml"))?.config;
    run_into(Task::Net(&net), &folder.join("out"), false)
}

/// The table of pictures with every row replaced by what `change` returns for its fields.
fn change_pictures(folder: &Path, change: impl Fn(&mut Vec<String>)) {
    let path = folder.join("net/pictures.csv");
    let text = fs::read_to_string(&path).unwrap();
    let rows = text.lines().enumerate().map(|(index, row)| {
        let mut fields: Vec<String> = row.split(',').map(str::to_owned).collect();
        if index > 0 {
            change(&mut fields);
        }
        fields.join(",") + "\n"
    });
    fs::write(path, rows.collect::<String>()).unwrap();
}

/// A raster on the map.
struct OnMap {
    cells: Vec<u8>,
    size: [usize; 2],
    cell_m: f64,
    /// Western and northern edge.
    edges_m: [f64; 2],
}

impl OnMap {
    fn of(path: &Path) -> Self {
        let mut decoder = Decoder::new(fs::File::open(path).unwrap()).unwrap();
        let (columns, rows) = decoder.dimensions().unwrap();
        let scale = decoder.get_tag_f64_vec(Tag::ModelPixelScaleTag).unwrap();
        let corner = decoder.get_tag_f64_vec(Tag::ModelTiepointTag).unwrap();
        let DecodingResult::U8(cells) = decoder.read_image().unwrap() else {
            panic!("other numbers");
        };
        Self {
            cells,
            size: [rows as usize, columns as usize],
            cell_m: scale[0],
            edges_m: [corner[3], corner[4]],
        }
    }

    fn at(&self, [row, column]: [i64; 2]) -> u8 {
        let [row, column] = [row, column].map(|at| usize::try_from(at).unwrap());
        self.cells[row * self.size[1] + column]
    }
}

/// The true brightness of the ground.
struct Ground {
    mean_dn: f64,
    /// Amplitude, numbers of radians per metre towards east and north, phase.
    waves: Vec<[f64; 4]>,
}

impl Ground {
    fn of(truth: &Value) -> Self {
        let names = [
            "amplitude_dn",
            "east_rad_per_m",
            "north_rad_per_m",
            "phase_rad",
        ];
        let waves = truth["ground"]["waves"].as_array().unwrap().iter();
        Self {
            mean_dn: number(&truth["ground"]["mean_dn"]),
            waves: waves
                .map(|wave| names.map(|name| number(&wave[name])))
                .collect(),
        }
    }

    fn brightness_dn(&self, [east_m, north_m]: [f64; 2]) -> f64 {
        let waves = self
            .waves
            .iter()
            .map(|[amplitude_dn, east, north, phase_rad]| {
                amplitude_dn * (east * east_m + north * north_m + phase_rad).cos()
            });
        self.mean_dn + waves.sum::<f64>()
    }
}

fn correlation(pairs: &[[f64; 2]]) -> f64 {
    let count = pairs.len() as f64;
    let mean = [0, 1].map(|of: usize| pairs.iter().map(|pair| pair[of]).sum::<f64>() / count);
    let product = |a: usize, b: usize| {
        let terms = pairs
            .iter()
            .map(|pair| (pair[a] - mean[a]) * (pair[b] - mean[b]));
        terms.sum::<f64>()
    };
    product(0, 1) / (product(0, 0) * product(1, 1)).sqrt()
}

/// For every picture, its mean error towards east and north at the places that it alone shows, metres, and the number of places: the shift at which a square
/// correlates best with the true ground.
fn errors_m(
    mosaic: &OnMap,
    sources: &OnMap,
    ground: &Ground,
    count: usize,
) -> Vec<([f64; 2], usize)> {
    let span = HALF + REACH;
    let mut sums = vec![([0.0; 2], 0); count];
    for row in (0..mosaic.size[0]).step_by(APART) {
        for column in (0..mosaic.size[1]).step_by(APART) {
            let middle = [row, column].map(|at| i64::try_from(at).unwrap());
            let is_inside = (0..2).all(|axis| {
                middle[axis] >= HALF
                    && middle[axis] + HALF < i64::try_from(mosaic.size[axis]).unwrap()
            });
            let square = || {
                let rows = middle[0] - HALF..=middle[0] + HALF;
                rows.flat_map(move |row| {
                    (middle[1] - HALF..=middle[1] + HALF).map(move |column| [row, column])
                })
            };
            let source = sources.at(middle);
            if !is_inside || source == 0 || square().any(|cell| sources.at(cell) != source) {
                continue;
            }
            // The true ground around, cell by cell.
            let edge = 2 * span + 1;
            let mut around = Vec::new();
            for down in -span..=span {
                for right in -span..=span {
                    let east_m =
                        mosaic.edges_m[0] + ((middle[1] + right) as f64 + 0.5) * mosaic.cell_m;
                    let north_m =
                        mosaic.edges_m[1] - ((middle[0] + down) as f64 + 0.5) * mosaic.cell_m;
                    around.push(ground.brightness_dn([east_m, north_m]));
                }
            }
            let at_shift = |shift: [i64; 2]| {
                let pairs = square().map(|cell| {
                    let [down, right] =
                        [0, 1].map(|axis| cell[axis] - middle[axis] + shift[axis] + span);
                    let there = around[usize::try_from(down * edge + right).unwrap()];
                    [f64::from(mosaic.at(cell)), there]
                });
                correlation(&pairs.collect::<Vec<_>>())
            };
            let shifts =
                (-REACH..=REACH).flat_map(|down| (-REACH..=REACH).map(move |right| [down, right]));
            let best = shifts
                .max_by(|one, other| at_shift(*one).total_cmp(&at_shift(*other)))
                .unwrap();
            assert!(
                at_shift(best) > 0.85,
                "{middle:?} of {source}: {best:?} {}",
                at_shift(best)
            );
            let (sum_m, places) = &mut sums[usize::from(source) - 1];
            // The ground of a cell lies `best` cells farther: the mosaic shows it too far the other way.
            sum_m[0] -= best[1] as f64 * mosaic.cell_m;
            sum_m[1] += best[0] as f64 * mosaic.cell_m;
            *places += 1;
        }
    }
    let mean =
        |(sum_m, places): ([f64; 2], usize)| (sum_m.map(|of| of / places.max(1) as f64), places);
    sums.into_iter().map(mean).collect()
}

#[test]
fn pictures_lie_on_the_map_where_they_state() {
    let folder = scene();
    run(folder.path()).unwrap();
    let out = folder.path().join("out/synthetic_net");
    let [mosaic, sources] =
        ["mosaic.tif", "mosaic_source.tif"].map(|name| OnMap::of(&out.join(name)));
    let document = json(&out.join("mosaic.json"));
    assert_keeps_schema(&document, "net_mosaic");
    let pictures = document["pictures"].as_array().unwrap();
    assert_eq!(pictures.len(), 9);
    let truth = json(&folder.path().join("net/truth.json"));
    let errors = errors_m(&mosaic, &sources, &Ground::of(&truth), pictures.len());
    for ((error_m, places), picture) in errors.iter().zip(pictures) {
        let sigma_m = number(&picture["sigma_m"]);
        println!(
            "{}: {error_m:.0?} m at {places} places, stated {sigma_m:.0} m",
            picture["picture"]
        );
        assert!(*places >= 6);
        for error_m in error_m {
            // Shifts are whole cells.
            assert!(error_m.abs() <= 3.0 * sigma_m + 0.5 * mosaic.cell_m);
        }
    }
    // The pictures share the error of the controls; between pictures there is only that of the measurements.
    let pairs = document["pairs"].as_array().unwrap();
    assert!(pairs.len() >= 12);
    for pair in pairs.iter().filter(|pair| number(&pair["places"]) > 0.0) {
        let [east_m, north_m] = [0, 1].map(|axis| number(&pair["median_m"][axis]));
        assert!(east_m.hypot(north_m) < 0.5 * mosaic.cell_m, "{pair}");
    }
    assert!(!document["seams"].as_array().unwrap().is_empty());
    let page = fs::read_to_string(out.join("report/index.html")).unwrap();
    assert!(
        page.contains("Mosaic of the pictures, north up") && page.contains("mosaic_source.tif")
    );
    as_gdal_reads_it(&out.join("mosaic.tif"), &mosaic, &["Mercator"]);
    let Some(rasters) = cloud_optimised(&out) else {
        return;
    };
    for (name, raster) in [("mosaic.tif", &mosaic), ("mosaic_source.tif", &sources)] {
        let shown = raster.cells.iter().filter(|cell| **cell > 0).count();
        assert_eq!(
            rasters[name],
            json!([raster.size[0], raster.size[1], shown, true])
        );
    }
}

#[test]
fn a_stereographic_map_is_that_of_the_mosaic() {
    let folder = scene();
    let toml = folder.path().join("net/net.toml");
    let text = fs::read_to_string(&toml).unwrap();
    let (was, is) = (
        "[map]\nlatitude_deg = 0.0\nlongitude_deg = 0.0",
        "[map]\nprojection = \"stereographic\"\nlatitude_deg = -40.0\nlongitude_deg = 120.0\ncell_m = 500.0",
    );
    assert!(text.contains(was), "{text}");
    fs::write(&toml, text.replace(was, is)).unwrap();
    run(folder.path()).unwrap();
    let path = folder.path().join("out/synthetic_net/mosaic.tif");
    let mosaic = OnMap::of(&path);
    assert!((mosaic.cell_m - 500.0).abs() < 1e-6);
    let names = [
        "Stereographic",
        "\"Latitude of natural origin\",-40,",
        "\"Longitude of natural origin\",120,",
    ];
    as_gdal_reads_it(&path, &mosaic, &names);
}

/// The map and its extent, by GDAL where it is installed.
fn as_gdal_reads_it(path: &Path, mosaic: &OnMap, names: &[&str]) {
    let Some(mut gdalinfo) = program("gdalinfo", "the mosaic of a net in GDAL") else {
        return;
    };
    let text = gdalinfo.arg("-json").arg(path).output().unwrap().stdout;
    let text = String::from_utf8(text).unwrap();
    let found: Value = serde_json::from_str(&text).unwrap();
    let wkt = found["coordinateSystem"]["wkt"].as_str().unwrap();
    let has_names = names.iter().all(|name| wkt.contains(name));
    assert!(has_names && wkt.contains("3396190"), "{wkt}");
    let transform = found["geoTransform"].as_array().unwrap();
    let expected = [
        mosaic.edges_m[0],
        mosaic.cell_m,
        0.0,
        mosaic.edges_m[1],
        0.0,
        -mosaic.cell_m,
    ];
    for (found, expected) in transform.iter().zip(expected) {
        assert!((number(found) - expected).abs() < 1e-6, "{transform:?}");
    }
}

#[test]
fn the_direction_of_y_does_not_change_the_mosaic() {
    let [up, down] = [scene(), scene()];
    let measurements = down.path().join("net/measurements.csv");
    let text = fs::read_to_string(&measurements).unwrap();
    let negative = |y: &str| {
        y.strip_prefix('-')
            .map_or_else(|| format!("-{y}"), str::to_owned)
    };
    let rows = text.lines().enumerate().map(|(index, row)| {
        let (rest, y) = row.rsplit_once(',').unwrap();
        if index == 0 {
            format!("{row}\n")
        } else {
            format!("{rest},{}\n", negative(y))
        }
    });
    fs::write(&measurements, rows.collect::<String>()).unwrap();
    change_pictures(down.path(), |fields| {
        if !fields[5].is_empty() {
            fields[5] = negative(&fields[5]);
        }
    });
    let toml = down.path().join("net/net.toml");
    let text = fs::read_to_string(&toml).unwrap();
    fs::write(
        &toml,
        text.replace(
            "[\"measurements.csv\"]",
            "[\"measurements.csv\"]\ny_axis = \"down\"",
        ),
    )
    .unwrap();
    let bytes = [up, down].map(|folder| {
        run(folder.path()).unwrap();
        fs::read(folder.path().join("out/synthetic_net/mosaic.tif")).unwrap()
    });
    assert!(bytes[0] == bytes[1]);
}

/// The message for a net with a change in its folder.
fn refused(change: impl Fn(&Path)) -> String {
    let folder = scene();
    change(&folder.path().join("net"));
    let failure = run(folder.path()).unwrap_err();
    let path = format!("{}/", folder.path().join("net").display());
    failure.to_string().replace(&path, "")
}

/// With a field of the row of a picture replaced.
fn with_field(folder: &Path, picture: &str, at: usize, change: impl Fn(&str) -> String) {
    change_pictures(folder.parent().unwrap(), |fields| {
        if fields[0] == picture {
            fields[at] = change(&fields[at]);
        }
    });
}

fn in_net_file(folder: &Path, was: &str, is: &str) {
    let toml = folder.join("net.toml");
    let text = fs::read_to_string(&toml).unwrap();
    assert!(text.contains(was), "{text}");
    fs::write(&toml, text.replace(was, is)).unwrap();
}

/// The image of a picture cropped to some lines and samples.
fn crop(path: &Path, size: [usize; 2]) {
    let mut decoder = Decoder::new(fs::File::open(path).unwrap()).unwrap();
    let columns = decoder.dimensions().unwrap().0 as usize;
    let DecodingResult::U8(pixels) = decoder.read_image().unwrap() else {
        panic!("other numbers");
    };
    let lines = pixels.chunks(columns).take(size[0]);
    let cropped: Vec<u8> = lines.flat_map(|line| line[..size[1]].to_vec()).collect();
    let [lines, samples] = size.map(|of| u32::try_from(of).unwrap());
    let mut encoder = TiffEncoder::new(fs::File::create(path).unwrap()).unwrap();
    encoder
        .write_image::<Gray8>(samples, lines, &cropped)
        .unwrap();
}

#[test]
fn images_that_do_not_fit_are_refused() {
    let number = |of: &str| of.parse::<f64>().unwrap();
    let told = [
        (
            "an image that is missing",
            refused(|net| with_field(net, "P02", 3, |_| "images/other.tif".to_owned())),
        ),
        (
            "a folder as an image",
            refused(|net| with_field(net, "P02", 3, |_| "images".to_owned())),
        ),
        (
            "two pictures with one image, by another path",
            refused(|net| with_field(net, "P02", 3, |_| "images/../images/P01.tif".to_owned())),
        ),
        (
            "a picture with two images",
            refused(|net| {
                let path = net.join("pictures.csv");
                let text = fs::read_to_string(&path).unwrap() + "P02,,,images/P01.tif,0,0,1\n";
                fs::write(&path, text).unwrap();
            }),
        ),
        (
            "a picture without measurements",
            refused(|net| {
                fs::copy(net.join("images/P01.tif"), net.join("images/P99.tif")).unwrap();
                let path = net.join("pictures.csv");
                let text = fs::read_to_string(&path).unwrap() + "P99,,,images/P99.tif,0,0,1\n";
                fs::write(&path, text).unwrap();
            }),
        ),
        (
            "a corner far away",
            refused(|net| with_field(net, "P03", 5, |of| (number(of) + 1e4).to_string())),
        ),
        (
            "pixels of half the size",
            refused(|net| with_field(net, "P03", 6, |of| (0.5 * number(of)).to_string())),
        ),
        (
            "an image of half the size",
            refused(|net| crop(&net.join("images/P07.tif"), [100, 100])),
        ),
        (
            "an image of another kind",
            refused(|net| fs::write(net.join("images/P07.tif"), "no image").unwrap()),
        ),
        (
            "half of a file",
            refused(|net| {
                let path = net.join("images/P07.tif");
                let bytes = fs::read(&path).unwrap();
                fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
            }),
        ),
        (
            "too many images",
            refused(|net| {
                let path = net.join("pictures.csv");
                let mut text = fs::read_to_string(&path).unwrap();
                for picture in 101..=156 {
                    let image = format!("images/P{picture}.tif");
                    fs::copy(net.join("images/P01.tif"), net.join(&image)).unwrap();
                    text += &format!("P{picture},,,{image},0,0,1\n");
                }
                fs::write(&path, text).unwrap();
            }),
        ),
        (
            "a mosaic that is too large",
            refused(|net| in_net_file(net, "[map]", "[map]\ncell_m = 0.5")),
        ),
        (
            "cells larger than pictures",
            refused(|net| in_net_file(net, "[map]", "[map]\ncell_m = 9.9e6")),
        ),
        (
            "cells of no size",
            refused(|net| in_net_file(net, "[map]", "[map]\ncell_m = 0")),
        ),
        (
            "images and a film correction",
            refused(|net| {
                let mut ticks = "picture,tick,x,y,known_x,known_y\n".to_owned();
                for picture in 1..=25 {
                    for (tick, x, y) in [
                        ("lower_left", -1, -1),
                        ("lower_right", 1, -1),
                        ("upper_right", 1, 1),
                        ("upper_left", -1, 1),
                    ] {
                        ticks += &format!("P{picture:02},{tick},{x},{y},{x},{y}\n");
                    }
                }
                fs::write(net.join("ticks.csv"), ticks).unwrap();
                in_net_file(net, "[map]", "[film]\nfiles = [\"ticks.csv\"]\n[map]");
            }),
        ),
    ];
    assert_messages("net_images_refused", &told);
}
