//! Ground control points in extracted pictures: as GDAL reads them, and tables that are refused.

use std::{collections::BTreeMap, fs, path::Path, process::Command};

use tiff::{decoder::Decoder, tags::Tag};

use super::{areograph, stdout, text, write_image};
use crate::common::{
    mission::{mission, site_run},
    readers::{output, program},
};

const HEADER: &str = "body,image,line,sample,longitude_deg,latitude_deg,height_m";
/// Corners of the image of `write_image`, whose label states M01/00123.
const CORNERS: [&str; 4] = [
    "mars,M01-00123,0,0,175.5,-14.5,-1200.5",
    "mars,M01-00123,0,640,175.4,-14.51,-1200.5",
    "mars,M01-00123,320,0,175.49,-14.4,-1210",
    "mars,M01-00123,320,640,175.39,-14.41,-1190",
];

fn table(rows: &[&str]) -> String {
    format!("{HEADER}\n{}\n", rows.join("\n"))
}

#[test]
fn control_points_are_those_of_the_table() {
    let folder = tempfile::tempdir().unwrap();
    let (image, _) = write_image(folder.path());
    let [control, picture] = ["control.csv", "image.tif"].map(|name| folder.path().join(name));
    fs::write(&control, table(&CORNERS)).unwrap();
    let extract = [
        "extract",
        text(&image),
        "--out",
        text(&picture),
        "--control",
        text(&control),
    ];
    stdout(&areograph(&extract));
    let expected: Vec<f64> = CORNERS
        .iter()
        .flat_map(|row| {
            let numbers: Vec<f64> = row
                .split(',')
                .skip(2)
                .map(|text| text.parse().unwrap())
                .collect();
            // Samples come first, and a third coordinate.
            [
                numbers[1], numbers[0], 0.0, numbers[2], numbers[3], numbers[4],
            ]
        })
        .collect();
    let mut decoder = Decoder::new(fs::File::open(&picture).unwrap()).unwrap();
    assert_eq!(
        decoder.get_tag_f64_vec(Tag::ModelTiepointTag).unwrap(),
        expected
    );
    let Some(mut gdalinfo) = program("gdalinfo", "control points in GDAL") else {
        return;
    };
    let info: serde_json::Value =
        serde_json::from_str(&output(gdalinfo.arg("-json").arg(&picture))).unwrap();
    let points = info["gcps"]["gcpList"].as_array().unwrap();
    assert_eq!(points.len(), CORNERS.len());
    for (point, expected) in points.iter().zip(expected.chunks(6)) {
        let numbers = ["pixel", "line", "x", "y", "z"].map(|key| point[key].as_f64().unwrap());
        for (number, at) in numbers.iter().zip([0, 1, 3, 4, 5]) {
            assert!((number - expected[at]).abs() < 1e-9, "{point}");
        }
    }
    let system = info["gcps"]["coordinateSystem"]["wkt"].to_string();
    assert!(
        system.contains("Mars") && system.contains("3396190,0"),
        "{system}"
    );
}

#[test]
fn tables_that_do_not_fit_the_image_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let (image, _) = write_image(folder.path());
    let control = folder.path().join("control.csv");
    let with = |row: &'static str| [&CORNERS[..3], &[row]].concat();
    let cases: [(&str, String, &str); 14] = [
        (
            "image.png",
            table(&CORNERS),
            "PNG files have no ground control points",
        ),
        (
            "image.tif",
            table(&CORNERS).replace("M01-00123", "M01-00124"),
            "its points are in the image M01-00124, and the label states M01/00123",
        ),
        (
            "image.tif",
            table(&CORNERS[..3]),
            "the table contains 3 points; expected 4 to 10000",
        ),
        (
            "image.tif",
            table(&with("mars,M01-00123,321,0,175,-14,0")),
            "a point is at line 321 and sample 0; expected 0 to 320 and 0 to 640",
        ),
        (
            "image.tif",
            table(&with("mars,M01-00123,32o,0,175,-14,0")),
            "line 5: \"32o\" is not a number",
        ),
        (
            "image.tif",
            table(&with("mars,M01-00123,320,0,175,-94,0")),
            "line 5: latitude_deg is -94; expected -90 to 90",
        ),
        (
            "image.tif",
            table(&with("mars,M01-00123,320,0,175,-14,3389000")),
            "line 5: height_m is 3389000; expected -100000 to 100000",
        ),
        (
            "image.tif",
            table(&with("moon,M01-00123,320,0,175,-14,0")),
            "it has points on two bodies; expected one",
        ),
        (
            "image.tif",
            table(&with("mars,M01-00125,320,0,175,-14,0")),
            "it has points of the images M01-00123 and M01-00125; expected one image",
        ),
        (
            "image.tif",
            table(&with("mars,M01-00123,320,0,175,-14,0")),
            "two points are at line 320 and sample 0",
        ),
        (
            "image.tif",
            table(&CORNERS).replace(",640,", ",0.1,"),
            "all points lie on a line of the image",
        ),
        (
            "image.tif",
            table(&with("mars,M01-00123,320,640,-175.6,-14,0")),
            "longitudes span 351.1",
        ),
        (
            "image.tif",
            table(&CORNERS).replace("mars", "moon"),
            "its points are on the body moon, and the image shows mars",
        ),
        (
            "image.tif",
            table(&CORNERS).replace("height_m", "radius_m"),
            "column height_m is missing",
        ),
    ];
    for (out, rows, expected) in cases {
        fs::write(&control, rows).unwrap();
        let out = folder.path().join(out);
        let extract = [
            "extract",
            text(&image),
            "--out",
            text(&out),
            "--control",
            text(&control),
        ];
        let refused = areograph(&extract);
        let message = String::from_utf8_lossy(&refused.stderr).into_owned();
        assert!(matches!(refused.status.code(), Some(2 | 3)), "{message}");
        assert!(
            message.contains(expected) && message.contains("what to do"),
            "{message}"
        );
        assert!(!out.exists());
    }
}

/// Columns of a table of footprints in an image, by GDAL's CSV of it: sample, line, longitude, latitude.
fn shots(products: &Path, image: &str) -> Option<Vec<[f64; 4]>> {
    let mut ogr2ogr = program("ogr2ogr", "shots placed by control points")?;
    let table = products.join("exchange/registered_footprints.gpkg");
    let text = output(ogr2ogr.args(["-f", "CSV", "/vsistdout/"]).arg(table).args([
        "-where",
        &format!("image = '{image}' AND adjusted_inside = 1"),
    ]));
    let mut rows = text.lines();
    let names: BTreeMap<&str, usize> = rows
        .next()?
        .split(',')
        .enumerate()
        .map(|(at, name)| (name, at))
        .collect();
    let columns = [
        "adjusted_sample",
        "adjusted_line",
        "longitude_deg",
        "latitude_deg",
    ]
    .map(|name| names[name]);
    let number = |row: &str, at: usize| row.split(',').nth(at).unwrap().parse().unwrap();
    Some(rows.map(|row| columns.map(|at| number(row, at))).collect())
}

/// Shots were placed in the image by its orientation and the radii of their own; GDAL places them on the ground by the control points.
#[test]
fn gdal_places_shots_where_they_are() {
    let products = site_run("gusev_crater");
    assert!(mission().exists());
    // The first image looks down, so that heights between the points have no effect; the second one looks aside by 17°, and 100 m of
    // relief are 30 m.
    for (image, limit_m) in [("E02-00665", 0.5), ("E02-01453", 60.0)] {
        let table = fs::read_to_string(products.join(format!("images/{image}/control_points.csv")))
            .unwrap();
        let rows: Vec<Vec<&str>> = table
            .lines()
            .skip(1)
            .map(|row| row.split(',').collect())
            .collect();
        assert_eq!(rows.len(), 85);
        let Some(shots) = shots(&products, image) else {
            return;
        };
        assert!(shots.len() > 100, "{}", shots.len());
        let mut gdaltransform = Command::new("gdaltransform");
        gdaltransform.arg("-tps");
        for row in &rows {
            gdaltransform.args(["-gcp", row[3], row[2], row[4], row[5], row[6]]);
        }
        let folder = tempfile::tempdir().unwrap();
        let places = folder.path().join("places.txt");
        let lines: Vec<String> = shots
            .iter()
            .map(|[sample, line, ..]| format!("{sample} {line}"))
            .collect();
        fs::write(&places, lines.join("\n")).unwrap();
        gdaltransform.stdin(fs::File::open(&places).unwrap());
        let placed = output(&mut gdaltransform);
        let mut largest_m: f64 = 0.0;
        for (row, [_, _, east_deg, north_deg]) in placed.lines().zip(&shots) {
            let at: Vec<f64> = row
                .split(' ')
                .map(|number| number.parse().unwrap())
                .collect();
            let metres_per_deg = 3_396_190.0_f64.to_radians();
            let east_m = (at[0] - east_deg) * metres_per_deg * north_deg.to_radians().cos();
            largest_m = largest_m.max(east_m.hypot((at[1] - north_deg) * metres_per_deg));
        }
        println!("{image}: {} shots, {largest_m:.2} m", shots.len());
        assert!(largest_m < limit_m, "{image}: {largest_m} m");
    }
}
