//! A small site of two images by support data with their pixels, and of the shots of passes over them in a table: seconds from
//! pixels to products.

use std::{fs, path::Path, process::Command, sync::atomic::AtomicBool};

use areograph::{
    scene::{LineScene, write_line_scene},
    watch::Watch,
};

use super::mission::{areograph, succeed};

const LEAP_SECONDS: &str = include_str!("../../kernels.example/leapseconds.tls");

const PAIR: &str = r#"site = "pair"
kernels.files = ["leapseconds.tls"]
[[shots]]
files = ["shots.csv"]
layout = "areograph"
[[windows]]
id = "pair"
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
[ties]
match = true
[surface]
cell_m = 200.0
orthoimage_cell_m = 50.0
orthoimages_before = true
mosaic = true
images = ["s1", "nd"]
[registration]
model = "samples"
"#;

/// Writes `pair.toml` and its files.
pub(crate) fn write_pair(folder: &Path) {
    // Files of pixels without labels differ by their sizes; the ground is the same.
    for (name, lines) in [("first", 400), ("second", 390)] {
        let scene = LineScene {
            seed: 1,
            size: [lines, 240],
            is_wrong: false,
        };
        write_line_scene(
            &folder.join(name),
            &scene,
            Watch::from(&AtomicBool::new(false)),
        )
        .unwrap();
    }
    let mut search: Command = areograph();
    search.args(["--quiet", "pedr", "search"]);
    search.arg(folder.join("first/pedr"));
    search.args(["--box=-64.0,-62.0,-34.0,-32.0", "--out"]);
    succeed(search.arg(folder.join("shots.csv")));
    fs::write(folder.join("leapseconds.tls"), LEAP_SECONDS).unwrap();
    fs::write(folder.join("pair.toml"), PAIR).unwrap();
}
