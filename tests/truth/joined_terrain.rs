//! The terrain model of three images, all pairs of which are joined, against the true ground.
#![allow(
    clippy::panic,
    clippy::unwrap_used,
    clippy::disallowed_methods,
    reason = "helpers of tests may fail loudly, and write site files"
)]

use std::{
    fs::{self, File},
    path::Path,
    sync::atomic::AtomicBool,
};

use areograph::{
    scene::{LineScene, write_line_scene},
    watch::Watch,
};
use tiff::decoder::{Decoder, DecodingResult};

use crate::{
    common::{
        json,
        mission::{areograph, succeed},
    },
    matched_ties::Points,
};

const SITE: &str = r#"site = "three"
kernels.files = ["leapseconds.tls"]
[[shots]]
files = ["shots.csv"]
layout = "areograph"
[[windows]]
id = "three"
longitude_deg = [296.0, 298.0]
latitude_deg = [-34.0, -32.0]
[[images]]
id = "s1"
isd = "first/isd/s1.json"
pixels = "first/images/s1.tif"
[[images]]
id = "nd"
isd = "second/isd/nd.json"
pixels = "second/images/nd.tif"
[[images]]
id = "s2"
isd = "third/isd/s2.json"
pixels = "third/images/s2.tif"
[ties]
match = true
[surface]
cell_m = 200.0
filled = true
[registration]
model = "samples"
"#;

const LEAP_SECONDS: &str = include_str!("../../kernels.example/leapseconds.tls");

/// Images of the same ground; files of pixels without labels differ by their sizes.
fn write(folder: &Path) -> LineScene {
    let scene = |lines: u32| LineScene {
        seed: 7,
        size: [lines, 240],
        is_wrong: false,
    };
    for (name, lines) in [("first", 400), ("second", 390), ("third", 380)] {
        let never = AtomicBool::new(false);
        write_line_scene(&folder.join(name), &scene(lines), Watch::from(&never)).unwrap();
    }
    let mut search = areograph();
    search.args(["--quiet", "pedr", "search"]);
    search.arg(folder.join("first/pedr"));
    search.args(["--box=-64.0,-62.0,-34.0,-32.0", "--out"]);
    succeed(search.arg(folder.join("shots.csv")));
    fs::write(folder.join("leapseconds.tls"), LEAP_SECONDS).unwrap();
    fs::write(folder.join("three.toml"), SITE).unwrap();
    scene(400)
}

#[test]
fn heights_of_all_pairs_are_within_what_they_state() {
    let folder = tempfile::tempdir().unwrap();
    let scene = write(folder.path());
    let out = folder.path().join("out");
    let mut run = areograph();
    run.args(["--quiet", "run"])
        .arg(folder.path().join("three.toml"));
    succeed(run.arg("--out").arg(&out));
    let products = out.join("three");
    let document = json(&products.join("surface.json"));
    println!("{}", document["joint"]);
    let pairs = document["joint"]["pairs"].as_array().unwrap();
    let of_pairs: Vec<&str> = pairs
        .iter()
        .flat_map(|of| of["images"].as_array().unwrap())
        .map(|of| of.as_str().unwrap())
        .collect();
    assert_eq!(of_pairs, ["s1", "nd", "s1", "s2", "nd", "s2"]);
    let seams = document["joint"]["seams"].as_array().unwrap();
    // Three pairs, of which every two overlap.
    assert_eq!(seams.len(), 3);
    for seam in seams {
        let of = |name: &str| seam[name].as_f64().unwrap();
        assert!(
            of("after_m").abs() <= of("before_m").abs() + of("sigma_m"),
            "{seam}"
        );
        assert!((0.4..1.6).contains(&of("spread_sigmas")), "{seam}");
    }
    let model = Points::of_terrain_model(&products);
    let (ratios, rms_m) = model.ratios(&scene.ground());
    let several = several(&products);
    assert_eq!(several.len(), ratios.len());
    let z = |of: &dyn Fn(bool) -> bool| {
        let chosen = ratios
            .iter()
            .zip(&several)
            .filter(|(_, several)| of(**several));
        let squares: Vec<f64> = chosen.map(|(ratio, _)| ratio * ratio).collect();
        (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
    };
    let (all, of_one, of_several) = (z(&|_| true), z(&|several| !several), z(&|several| several));
    println!(
        "{} cells, {rms_m:.1} m, z {all:.2}; of one pair {of_one:.2}, of several {of_several:.2}",
        ratios.len()
    );
    // Models of single pairs have 0.72 to 1.13 (`matched_ties.rs`); cells within a compared square are correlated.
    assert!(ratios.len() > 500 && (0.7..=1.25).contains(&all), "{all}");
    // Means of several pairs are as good as they state if the pairs are.
    assert!(
        (0.8..=1.25).contains(&(of_several / of_one)),
        "{of_several} {of_one}"
    );
}

/// For every cell with a height, whether several pairs contribute.
fn several(products: &Path) -> Vec<bool> {
    let file = File::open(products.join("surface_pairs.tif")).unwrap();
    let DecodingResult::U32(pairs) = Decoder::new(file).unwrap().read_image().unwrap() else {
        panic!("other numbers");
    };
    let known = pairs.into_iter().filter(|of| *of > 0);
    known.map(|of| of.count_ones() > 1).collect()
}
