//! The terrain model of three images, all pairs of which are joined, against the true ground.
#![allow(
    clippy::panic,
    clippy::unwrap_used,
    clippy::disallowed_methods,
    reason = "helpers of tests may fail loudly, and write site files"
)]

use std::{fs::File, path::Path};

use areograph::scene::LineScene;
use tiff::decoder::{Decoder, DecodingResult};

use crate::{
    common::{
        json,
        mission::{areograph, succeed},
        pair::write_three_images,
    },
    matched_ties::Points,
};

const SEED: u64 = 7;

#[test]
fn heights_of_all_pairs_are_within_what_they_state() {
    let folder = tempfile::tempdir().unwrap();
    write_three_images(folder.path(), SEED);
    let scene = LineScene {
        seed: SEED,
        size: [400, 240],
        is_wrong: false,
    };
    let out = folder.path().join("out");
    let mut run = areograph();
    run.args(["--quiet", "run"])
        .arg(folder.path().join("pair.toml"));
    succeed(run.arg("--out").arg(&out));
    let products = out.join("pair");
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
