//! A small site of two or three images by support data with their pixels, and of the shots of passes over them in a table: seconds from
//! pixels to products.

use std::{fmt::Write as _, fs, path::Path, process::Command, sync::atomic::AtomicBool};

use areograph::{
    scene::{LineErrors, LineScene, write_line_scene},
    watch::Watch,
};

use super::mission::{areograph, succeed};

const LEAP_SECONDS: &str = include_str!("../../kernels.example/leapseconds.tls");

/// Images with their folders and numbers of lines. Files of pixels without labels differ by their sizes; the ground is the same.
const IMAGES: [(&str, &str, u32); 3] = [
    ("s1", "first", 400),
    ("nd", "second", 390),
    ("s2", "third", 380),
];

const SITE: &str = r#"site = "pair"
kernels.files = ["leapseconds.tls"]
[[shots]]
files = ["shots.csv"]
layout = "areograph"
[[windows]]
id = "pair"
longitude_deg = [296.0, 298.0]
latitude_deg = [-34.0, -32.0]
[ties]
match = true
[registration]
model = "samples"
[surface]
cell_m = 200.0
orthoimage_cell_m = 50.0
orthoimages_before = true
mosaic = true
"#;

/// Writes `pair.toml` and its files: two images, and the terrain model of this pair.
pub(crate) fn write_pair(folder: &Path) {
    write(folder, 1, &IMAGES[..2], "images = [\"s1\", \"nd\"]\n");
}

/// Writes `pair.toml` and its files: two images without tie points, and their orthoimages on the ground between shots.
pub(crate) fn write_pair_on_shots(folder: &Path) {
    write_pair(folder);
    let path = folder.join("pair.toml");
    let mut site = fs::read_to_string(&path).unwrap();
    for (was, is) in [
        ("[ties]\nmatch = true\n", ""),
        ("cell_m = 200.0\n", ""),
        ("orthoimages_before = true\n", ""),
        ("images = [\"s1\", \"nd\"]\n", ""),
        // Brightness as in the images.
        ("mosaic = true\n", "mosaic = true\nmosaic_balance = false\n"),
    ] {
        assert!(site.contains(was), "{was}");
        site = site.replace(was, is);
    }
    fs::write(path, site).unwrap();
}

/// Writes `pair.toml` and its files: three images, and the terrain model of all pairs with filled holes.
pub(crate) fn write_three_images(folder: &Path, seed: u64) {
    write(folder, seed, &IMAGES, "filled = true\n");
}

fn write(folder: &Path, seed: u64, images: &[(&str, &str, u32)], surface: &str) {
    let mut site = format!("{SITE}{surface}");
    for (id, name, lines) in images {
        let scene = LineScene {
            seed,
            size: [*lines, 240],
            errors: LineErrors::Exact,
        };
        let stop = AtomicBool::new(false);
        write_line_scene(&folder.join(name), &scene, Watch::from(&stop)).unwrap();
        writeln!(
            site,
            "[[images]]\nid = \"{id}\"\nisd = \"{name}/isd/{id}.json\"\npixels = \"{name}/images/{id}.tif\""
        )
        .unwrap();
    }
    let mut search: Command = areograph();
    search.args(["--quiet", "pedr", "search"]);
    search.arg(folder.join("first/pedr"));
    search.args(["--box=-64.0,-62.0,-34.0,-32.0", "--out"]);
    succeed(search.arg(folder.join("shots.csv")));
    fs::write(folder.join("leapseconds.tls"), LEAP_SECONDS).unwrap();
    fs::write(folder.join("pair.toml"), site).unwrap();
}
