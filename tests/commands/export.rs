//! `areograph export`: the files of a run, from the products of another one.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "helpers of tests may fail loudly"
)]

use crate::common;

use std::fs;

use common::{case::Case, mission::succeed};

#[test]
fn exported_files_are_those_of_a_run_with_these_formats() {
    let case = Case::new();
    succeed(&mut case.run());
    let lean = ["footprints.csv", "exchange/footprints.gpkg"];
    assert!(
        lean.iter()
            .all(|name| !case.path("out/case").join(name).exists())
    );
    let mut command = case.areograph();
    command.args(["export", "out/case", "--to", "gis/here"]);
    command.args(["csv", "geojson", "gpkg", "shp", "lola", "ode"]);
    let printed = String::from_utf8(succeed(&mut command).stdout).unwrap();
    assert!(printed.contains("gis/here/footprints.shp (") && printed.contains("footprints.prj\n"));
    let exported: Vec<_> = fs::read_dir(case.path("gis/here"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    // Table and label, GeoJSON, GeoPackage, the five files of a shapefile, two tables and their descriptions.
    assert_eq!(
        (exported.len(), printed.lines().count()),
        (13, 13),
        "{exported:?}"
    );

    case.replace(
        "site.toml",
        "[[windows]]",
        "[products]\nformats = [\"csv\", \"geojson\", \"gpkg\", \"shp\", \"lola\", \"ode\"]\n[[windows]]",
    );
    assert_eq!(case.stages_run(), ["publish"]);
    for name in exported {
        let published = [
            format!("out/case/{name}"),
            format!("out/case/exchange/{name}"),
        ]
        .into_iter()
        .find(|path| case.path(path).exists())
        .unwrap();
        assert!(
            case.read(&format!("gis/here/{name}")) == case.read(&published),
            "{name}"
        );
    }
}
