//! Adjusted points in the files of ISIS and Ames Stereo Pipeline, beside real ones and read as their readers do.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "helpers of tests may fail loudly"
)]

use crate::common::{self, readers};

use std::{fs, path::PathBuf};

use areograph::{
    body::Body,
    config::ImageConfig,
    error::Kind,
    frames::Position,
    geom::ellipsoid::{Spherical, spherical_to_xyz_m},
    pds::ties::read_ties,
    products::{
        ControlMeasure, ControlNetwork, ControlPoint, GroundEstimate, ImageMeasure, LidarPoint,
        NetworkMeasure, NetworkPoint, ProfileShift, SharedSigmas, write_binary_network,
        write_control_network, write_gcp, write_lidar_data,
    },
    spice::{KernelSet, Session},
    stages::tag_times::tag_times,
    ties::KnownGround,
    time::Et,
    units::{METRES_PER_KM, RADIANS_PER_DEGREE},
};
use nalgebra::{Matrix3, Vector3};
use serde_json::Value;

fn ground(xyz_m: Vector3<f64>, covariance_m2: Matrix3<f64>) -> GroundEstimate {
    GroundEstimate {
        position: Position::new(xyz_m),
        covariance_m2,
    }
}

/// A point near Gusev crater whose coordinates are correlated.
fn gusev() -> GroundEstimate {
    let xyz_m = spherical_to_xyz_m(
        175.48 * RADIANS_PER_DEGREE,
        -14.57 * RADIANS_PER_DEGREE,
        3.3921e6,
    );
    let covariance_m2 = Matrix3::new(90.0, 20.0, -12.0, 20.0, 60.0, 7.0, -12.0, 7.0, 110.0);
    ground(xyz_m, covariance_m2)
}

fn seen(image: &str, line: f64, sample: f64) -> ImageMeasure<'_> {
    ImageMeasure {
        image,
        line,
        sample,
    }
}

fn shot<'a>() -> LidarPoint<'a> {
    let serial = "MGS/610472061:131/MOC-NA/BROAD_BAND";
    LidarPoint {
        id: "ap19215-000041-07",
        et: Et::from_seconds(3.7e7),
        range_m: 389_123.25,
        range_sigma_m: 7.5,
        apriori: gusev(),
        adjusted: None,
        simultaneous_images: vec![serial],
        measures: vec![seen(serial, 0.5, 671.25)],
    }
}

fn lidar_json(points: &[LidarPoint]) -> Value {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("exchange/lidar.json");
    assert_eq!(
        write_lidar_data(&path, &[], points).unwrap(),
        points.len() as u64
    );
    serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap()
}

/// The same members everywhere, and numbers that agree to rounding.
fn assert_alike(ours: &Value, theirs: &Value, at: &str) {
    match (ours, theirs) {
        (Value::Object(a), Value::Object(b)) => {
            assert_eq!(
                a.keys().collect::<Vec<_>>(),
                b.keys().collect::<Vec<_>>(),
                "{at}"
            );
            for (key, value) in a {
                assert_alike(value, &b[key], &format!("{at}/{key}"));
            }
        }
        (Value::Array(a), Value::Array(b)) => {
            assert_eq!(a.len(), b.len(), "{at}");
            for (index, (a, b)) in a.iter().zip(b).enumerate() {
                assert_alike(a, b, &format!("{at}/{index}"));
            }
        }
        (Value::Number(a), Value::Number(b)) => {
            let (a, b) = (a.as_f64().unwrap(), b.as_f64().unwrap());
            // Coordinates go through Cartesian ones, which costs some 1e-16 of them; covariances that ISIS has as
            // 0 come out as that share of 1e-4 rad·m.
            assert!((a - b).abs() <= 1e-13 * b.abs() + 1e-18, "{at}: {a} {b}");
        }
        _ => assert_eq!(ours, theirs, "{at}"),
    }
}

#[test]
fn a_real_file_of_isis_is_written_again() {
    let Some(path) = common::real_data("isis_lidar/LidarNetwork/lidarData.json", "lidar data")
    else {
        return;
    };
    let theirs: Value = serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap();
    let number = |value: &Value| value.as_f64().unwrap();
    let texts = |value: &Value| -> Vec<String> {
        let texts = value.as_array().unwrap().iter();
        texts
            .map(|text| text.as_str().unwrap().to_owned())
            .collect()
    };
    let points = theirs["points"].as_array().unwrap();
    assert_eq!(points.len(), 52);
    let images: Vec<Vec<String>> = points
        .iter()
        .map(|p| texts(&p["simultaneousImages"]))
        .collect();
    let ours: Vec<LidarPoint> = points
        .iter()
        .zip(&images)
        .map(|(point, images)| {
            let xyz_m = spherical_to_xyz_m(
                number(&point["longitude"]) * RADIANS_PER_DEGREE,
                number(&point["latitude"]) * RADIANS_PER_DEGREE,
                number(&point["radius"]) * METRES_PER_KM,
            );
            let measures = point["measures"].as_array().unwrap().iter();
            LidarPoint {
                id: point["id"].as_str().unwrap(),
                et: Et::from_seconds(number(&point["time"])),
                range_m: number(&point["range"]) * METRES_PER_KM,
                range_sigma_m: number(&point["sigmaRange"]),
                // 10 m in each direction, as lrolola2isis was told.
                apriori: ground(xyz_m, 100.0 * Matrix3::identity()),
                adjusted: None,
                simultaneous_images: images.iter().map(String::as_str).collect(),
                measures: measures
                    .map(|measure| {
                        let serial = measure["serialNumber"].as_str().unwrap();
                        // ISIS has the middle of the first pixel at 1, we have it at 0.5.
                        seen(
                            serial,
                            number(&measure["line"]) - 0.5,
                            number(&measure["sample"]) - 0.5,
                        )
                    })
                    .collect(),
            }
        })
        .collect();
    assert_alike(&lidar_json(&ours), &theirs, "");
}

#[test]
fn covariances_of_latitude_longitude_and_radius_are_those_of_the_coordinates() {
    let adjusted = ground(
        gusev().position.xyz_m + Vector3::new(8.0, -5.0, 3.0),
        0.5 * gusev().covariance_m2,
    );
    let json = lidar_json(&[LidarPoint {
        adjusted: Some(adjusted),
        ..shot()
    }]);
    let point = &json["points"][0];
    let coordinates = |xyz_m: Vector3<f64>| {
        let spherical = Spherical::from_xyz_m(&xyz_m);
        Vector3::new(
            spherical.latitude.0,
            spherical.longitude_rad,
            spherical.radius_m,
        )
    };
    for (estimate, prefix, matrix) in [
        (gusev(), "", "aprioriMatrix"),
        (adjusted, "adjusted", "adjustedMatrix"),
    ] {
        let xyz_m = estimate.position.xyz_m;
        let columns = [0, 1, 2].map(|axis| {
            let mut step = Vector3::zeros();
            step[axis] = 10.0;
            (coordinates(xyz_m + step) - coordinates(xyz_m - step)) / 20.0
        });
        let partials = Matrix3::from_columns(&columns);
        let expected = partials * estimate.covariance_m2 * partials.transpose();
        let places = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];
        for (index, place) in places.into_iter().enumerate() {
            let found = point[matrix][index].as_f64().unwrap();
            let size = (expected[(place.0, place.0)] * expected[(place.1, place.1)]).sqrt();
            // Differences of angles of 1e-6 rad hold ten digits.
            assert!(
                (found - expected[place]).abs() < 1e-8 * size,
                "{matrix} {place:?}: {found}"
            );
        }
        let key = |name: &str| {
            let camel = name[..1].to_uppercase() + &name[1..];
            if prefix.is_empty() {
                name.to_owned()
            } else {
                prefix.to_owned() + &camel
            }
        };
        let value = |name: &str| point[key(name)].as_f64().unwrap();
        let found = spherical_to_xyz_m(
            value("longitude") * RADIANS_PER_DEGREE,
            value("latitude") * RADIANS_PER_DEGREE,
            value("radius") * METRES_PER_KM,
        );
        assert!((found - xyz_m).norm() < 1e-7); // rounding of degrees and kilometres, metres
    }
    assert_eq!(point["measures"][0]["line"], 1.0);
    assert_eq!(point["measures"][0]["sample"], 671.75);
    assert_eq!(point["range"], 389.123_25);
}

#[test]
fn lidar_data_state_the_shift_that_points_of_a_profile_share() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("lidar.json");
    let shift = ProfileShift {
        profile: "gusev_crater/9043",
        apriori_sigma_m: [70.0, 70.0, 1.0],
        adjusted_sigma_m: [39.0, 67.0, 0.75],
    };
    write_lidar_data(&path, &[shift], &[shot()]).unwrap();
    let json: Value = serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap();
    let shared = &json["sharedErrors"][0];
    assert_eq!(shared["profile"], "gusev_crater/9043");
    assert_eq!(
        shared["aprioriSigmaEastNorthUp"],
        serde_json::json!([70.0, 70.0, 1.0])
    );
    assert_eq!(
        shared["adjustedSigmaEastNorthUp"],
        serde_json::json!([39.0, 67.0, 0.75])
    );
    assert!(
        shared["meaning"]
            .as_str()
            .unwrap()
            .contains("does not average out")
    );
}

#[test]
fn serial_numbers_are_those_of_a_real_network() {
    let name = "MOC serial numbers";
    let files: Option<Vec<PathBuf>> = ["mgs_text/naif0012.tls", "mgs_text/MGS_SCLKSCET.00061.tsc"]
        .iter()
        .map(|file| common::real_data(file, name))
        .collect();
    let (Some(files), Some(label), Some(network)) = (
        files,
        common::real_data("asp_moc/M0100115.imq", name),
        common::real_data("asp_moc/control_net_measures.csv", name),
    ) else {
        return;
    };
    let session = Session::open(&KernelSet::from_files(&files).unwrap()).unwrap();
    let image = ImageConfig {
        id: "m01-00115".to_owned(),
        label: Some(label),
        ..ImageConfig::default()
    };
    let mut times = tag_times(&[image], &session).unwrap().remove(0);
    let serial = times.isis_serial_number().unwrap();
    let network = fs::read_to_string(network).unwrap();
    assert!(network.contains(&format!(",{serial},")), "{serial}");
    times.sclk_start = None;
    assert_eq!(times.isis_serial_number(), None);
}

#[test]
fn lidar_points_that_isis_would_refuse_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |points: &[LidarPoint]| {
        let failure = write_lidar_data(&folder.path().join("lidar.json"), &[], points).unwrap_err();
        assert_eq!(failure.kind(), Kind::Bug);
        failure.cause.to_string()
    };
    let changed = |change: fn(&mut LidarPoint)| {
        let mut point = shot();
        change(&mut point);
        refused(&[point])
    };
    assert_eq!(
        changed(|point| point.range_m = 0.0),
        "cannot write a point: range of ap19215-000041-07, metres, is 0; expected a number above 0"
    );
    assert!(
        changed(|point| point.range_sigma_m = f64::NAN)
            .contains("range of ap19215-000041-07, metres, is NaN")
    );
    assert!(
        changed(|point| point.apriori.covariance_m2.fill(0.0)).contains("variance of latitude")
    );
    let on_the_axis = |point: &mut LidarPoint| {
        point.apriori.position = Position::new(Vector3::new(0.0, 0.0, 3.376e6));
    };
    assert!(changed(on_the_axis).contains("variance of latitude, longitude or radius"));
    assert!(
        changed(|point| point.measures[0].line = f64::INFINITY)
            .contains("/points/0/measures/0/line")
    );
    assert!(refused(&[shot(), shot()]).contains("two points have the identifier"));
}

#[test]
fn a_control_network_is_read_again_as_it_was_written() {
    let serials = [
        "MGS/610472061:131/MOC-NA/BROAD_BAND",
        "MGS/669329623:36/MOC-NA/BROAD_BAND",
    ];
    let measure = |image: usize, line: f64, sample: f64| NetworkMeasure {
        measure: seen(serials[image], line, sample),
        sigma_px: Some([0.3, 0.2 + image as f64]),
        residual_px: Some([-0.125, 1e-7]),
    };
    let measures = vec![measure(0, 0.1 + 0.2, 671.25), measure(1, 4863.75, 0.0)];
    let known = |covariance_m2| KnownGround {
        ground: gusev().position,
        covariance_m2,
    };
    let point = |id, known: Option<KnownGround>| NetworkPoint {
        id,
        known,
        initial_m: Some(gusev().position.xyz_m),
        adjusted: Some(gusev()),
        is_rejected: false,
        measures: measures.clone(),
    };
    let points = vec![
        point("free", None),
        point("held, or \"fixed\"", Some(known(None))),
        point("it's constrained", Some(known(Some(gusev().covariance_m2)))),
        NetworkPoint {
            adjusted: None,
            initial_m: None,
            is_rejected: true,
            ..point("rejected", None)
        },
    ];
    let network = ControlNetwork {
        id: "gusev",
        body: Body::Mars,
        description: "made for a test".to_owned(),
        created_utc: "1999-05-06T15:33:58.130".to_owned(),
        points,
    };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("exchange/adjusted.pvl");
    assert_eq!(write_control_network(&path, &network).unwrap(), 4);
    let file = read_ties(&path).unwrap();
    // As in jigsaw, the next adjustment tries a rejected point again.
    assert_eq!((file.ignored, file.complaints.len()), (0, 0));
    assert_eq!(file.ties.len(), 4);
    for (read, written) in file.ties.iter().zip(&network.points) {
        assert_eq!((&*read.id, read.known), (written.id, written.known));
        assert_eq!(read.measures.len(), 2);
        for (read, written) in read.measures.iter().zip(&written.measures) {
            assert_eq!(read.image, written.measure.image);
            assert_eq!(read.sigma_px, written.sigma_px);
            // Half a pixel there and back costs rounding of 5000.
            assert!((read.line - written.measure.line).abs() < 1e-12);
            assert!((read.sample - written.measure.sample).abs() < 1e-12);
        }
    }
    let binary = folder.path().join("exchange/adjusted.net");
    assert_eq!(write_binary_network(&binary, &network).unwrap(), 4);
    assert_eq!(read_ties(&binary).unwrap(), file);
    let name = "a_network_is_read_as_written";
    if let Some(mut reader) = readers::python("read_network.py", name) {
        let read = readers::output(reader.arg(&binary).arg(&path));
        assert_eq!(read, "4 points, 8 measures\n");
    }
    let text = fs::read_to_string(&path).unwrap();
    assert!(!text.contains("Ignore"), "a user's decision");
    for line in [
        "    PointType = Constrained\n    PointId = \"it's constrained\"\n",
        "    PointId = \"rejected\"\n    JigsawRejected = True\n",
        "      JigsawRejected = True\n",
        "      LineResidual = -0.125 <pixels>\n",
        "    AdjustedCovarianceMatrix = (9e1, 2e1, -1.2e1, 6e1, 7e0, 1.1e2)\n",
    ] {
        assert!(text.contains(line), "{line} in\n{text}");
    }
    let unnamed = ControlNetwork {
        points: vec![point("\"'", None)],
        ..network
    };
    let failure = write_control_network(&path, &unnamed).unwrap_err();
    assert_eq!(failure.kind(), Kind::Bug);
}

fn control(id: &str, ground: GroundEstimate) -> ControlPoint<'_> {
    let measure = |image, line, sample, sigma_px| ControlMeasure {
        measure: seen(image, line, sample),
        sigma_px,
    };
    ControlPoint {
        id,
        ground,
        relative_sigma_m: None,
        measures: vec![
            measure("E02-00665.cub", 1_204.5, 0.5, [0.5, 0.75]),
            measure("E02-01453.cub", 88.062_5, 671.375, [1e-5, 2.0]),
        ],
    }
}

#[test]
fn ground_control_is_read_as_ames_stereo_pipeline_reads_it() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("exchange/adjusted.gcp");
    let west = ground(
        spherical_to_xyz_m(-2.25, 1.1, 3.3785e6),
        Matrix3::from_diagonal(&Vector3::new(1e-9, 4.0, 25.0)),
    );
    let unmeasured = ControlPoint {
        measures: Vec::new(),
        ..control("seen by none", gusev())
    };
    let points = [
        ControlPoint {
            relative_sigma_m: Some([3.25, 3.5, 11.0]),
            ..control("tie-0001\n9", gusev())
        },
        unmeasured,
        control("ap19215-41-7", west),
    ];
    let mut shared = SharedSigmas {
        sigma_m: [103.04, 108.0, 1.75],
        of_all_sites_m: [25.0, 37.96, 0.0],
    };
    let written = write_gcp(&path, Body::Mars, Some(&shared), &points).unwrap();
    assert_eq!(written, 2);
    let text = fs::read_to_string(&path).unwrap();
    // Commas are blanks, lines that begin with # are comments, everything else is a point.
    let lines: Vec<Vec<String>> = text
        .lines()
        .filter(|line| !line.starts_with('#'))
        .map(|line| {
            line.replace(',', " ")
                .split_whitespace()
                .map(str::to_owned)
                .collect()
        })
        .collect();
    assert_eq!(lines.len(), 2);
    for (index, (fields, expected)) in lines.iter().zip([gusev(), west]).enumerate() {
        assert_eq!(fields.len(), 7 + 2 * 5);
        assert_eq!(fields[0], (index + 1).to_string());
        let number = |column: usize| fields[column].parse::<f64>().unwrap();
        let xyz_m = spherical_to_xyz_m(
            number(2) * RADIANS_PER_DEGREE,
            number(1) * RADIANS_PER_DEGREE,
            number(3) + 3_396_190.0, // D_MARS
        );
        // Nine decimals of a degree and three of a metre: 0.06 mm and 0.5 mm.
        assert!((xyz_m - expected.position.xyz_m).norm() < 6e-4);
        for axis in 0..3 {
            let variance_m2 = number(4 + axis).powi(2);
            let exact_m2 = expected.covariance_m2[(axis, axis)];
            assert!((variance_m2 / exact_m2 - 1.0).abs() < 1e-14); // rounding of a root
        }
        // The middle of the first pixel is 0.
        assert_eq!(
            fields[7..12],
            ["E02-00665.cub", "0.0000", "1204.0000", "0.5", "0.75"]
        );
        assert_eq!(
            fields[12..],
            ["E02-01453.cub", "670.8750", "87.5625", "0.00001", "2"]
        );
    }
    assert!(
        text.contains("\n# 1 is tie-0001 9: 3.250 3.500 11.000\n")
            && text.contains("\n# 2 is ap19215-41-7\n")
    );
    assert!(
        text.contains("# all points share an error with standard deviations of 103.0 m east, 108.0 m north and 1.8 m up; other sites share a part of it, 25.0 m east, 38.0 m north and 0.0 m up;")
    );
    shared.of_all_sites_m = [0.0; 3];
    let own = folder.path().join("own.gcp");
    write_gcp(&own, Body::Mars, Some(&shared), &points).unwrap();
    assert!(!fs::read_to_string(own).unwrap().contains("other sites"));
    write_gcp(&folder.path().join("alone.gcp"), Body::Mars, None, &points).unwrap();
    let text = fs::read_to_string(folder.path().join("alone.gcp")).unwrap();
    assert!(text.contains("# all points share the error of the a priori orientations"));
}

#[test]
fn ground_control_that_would_be_misread_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |change: fn(&mut ControlPoint)| {
        let mut point = control("tie", gusev());
        change(&mut point);
        let path = folder.path().join("a.gcp");
        let failure = write_gcp(&path, Body::Mars, None, &[point]).unwrap_err();
        assert_eq!(failure.kind(), Kind::Bug);
        failure.cause.to_string()
    };
    assert!(
        refused(|point| point.ground.covariance_m2[(1, 1)] = 0.0)
            .contains("standard deviation of tie")
    );
    assert!(
        refused(|point| point.measures[1].sigma_px[0] = 0.0)
            .contains("of tie in E02-01453.cub, pixels, is 0")
    );
    assert!(
        refused(|point| point.measures[0].measure.image = "a b.cub")
            .contains("a file without spaces")
    );
    assert!(refused(|point| point.measures[0].measure.line = f64::NAN).contains("at line NaN"));
    let nowhere = |point: &mut ControlPoint| {
        point.ground.position = Position::new(Vector3::new(f64::NAN, 0.0, 0.0));
    };
    assert!(refused(nowhere).contains("radius of tie, metres, is NaN"));
}
