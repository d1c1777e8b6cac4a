//! The terrain model of three images, all pairs of which are joined, against the true ground.
#![allow(
    clippy::panic,
    clippy::unwrap_used,
    clippy::disallowed_methods,
    reason = "helpers of tests may fail loudly, and write site files"
)]

use std::{fs, fs::File, path::Path};

use areograph::scene::{LineErrors, LineScene};
use tiff::decoder::{Decoder, DecodingResult};

use crate::{
    common::{
        json,
        mission::{areograph, succeed},
        pair::write_three_images,
    },
    matched_ties::Points,
    orthoimages::displace,
};

const SEED: u64 = 7;

/// Runs a site of the folder, and returns its products.
fn products(folder: &Path, site: &str, text: &str) -> std::path::PathBuf {
    let file = folder.join(format!("{site}.toml"));
    fs::write(&file, text).unwrap();
    let out = folder.join("out");
    let mut run = areograph();
    run.args(["--quiet", "run"]).arg(file);
    succeed(run.arg("--out").arg(&out));
    out.join(site)
}

/// The third image has an error of 300 m of its own, which the adjustment of the others does not state.
#[test]
fn an_image_without_tie_points_enters_no_map() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    write_three_images(folder, SEED);
    displace(&folder.join("third/isd/s2.json"));
    let text = fs::read_to_string(folder.join("pair.toml")).unwrap();
    let [surface, third] = [text.find("[surface]"), text.rfind("[[images]]")].map(Option::unwrap);
    let first = text.find("[[images]]").unwrap();
    let two = format!("{}{}", &text[..surface], &text[first..third]);
    let tied = products(folder, "two", &two.replace("\"pair\"\n", "\"two\"\n"));
    fs::copy(
        tied.join("exchange/matched_ties.csv"),
        folder.join("ties.csv"),
    )
    .unwrap();
    assert!(text.contains("match = true"));
    let all = text.replace("match = true", "files = [\"ties.csv\"]");
    let products = products(folder, "pair", &all);

    let joint = json(&products.join("surface.json"))["joint"].clone();
    println!("{joint:#}");
    for pair in joint["pairs"].as_array().unwrap() {
        let is_tied = !pair["images"].as_array().unwrap().contains(&"s2".into());
        assert_eq!(pair.get("bit").is_some(), is_tied, "{pair}");
    }
    assert_eq!(joint["several"], 0);
    let images = |document: &str, list: &str| -> Vec<String> {
        let of = json(&products.join(document))[list].clone();
        let of = of.as_array().unwrap().iter();
        of.map(|of| of["image"].as_str().unwrap().to_owned())
            .collect()
    };
    assert_eq!(images("orthoimages.json", "orthoimages"), ["s1", "nd"]);
    assert_eq!(images("mosaic.json", "images"), ["s1", "nd"]);
    for file in ["orthoimage.tif", "orthoimage_before.tif"] {
        assert!(products.join("images/nd").join(file).exists());
        assert!(!products.join("images/s2").join(file).exists(), "{file}");
    }
}

#[test]
fn heights_of_all_pairs_are_within_what_they_state() {
    let folder = tempfile::tempdir().unwrap();
    write_three_images(folder.path(), SEED);
    let scene = LineScene {
        seed: SEED,
        size: [400, 240],
        errors: LineErrors::Exact,
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
