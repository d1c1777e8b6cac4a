//! A stereo pair of the Moon with the laser shots of its spacecraft (ISIS test data).

use std::{fs, path::Path};

use areograph_base::{
    frames::{Frame, Position},
    units::{METRES_PER_KM, RADIANS_PER_DEGREE},
};
use areograph_geom::{
    attitude::matrix_of_spice_quaternion,
    ellipsoid::spherical_to_xyz_m,
    pushbroom::{Detector, Distortion, Pose, Projector, SampledOrientation},
};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use serde_json::Value;

pub const FOLDER: &str = "isis_lidar/lidarObservationPair";

/// The images of the pair, as named in the files.
pub const SERIALS: [&str; 2] = ["LRO/1/286265995:36824/NACL", "LRO/1/286272781:34203/NACL"];

pub fn read_json(path: &Path) -> Value {
    serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap()
}

/// Moon mean-Earth frame of the LOLA file.
#[derive(Debug, Clone, Copy)]
pub struct MoonFixed;
impl Frame for MoonFixed {
    const NAME: &'static str = "MOON_ME";
}

pub struct Shot {
    pub et_s: f64,
    pub range_m: f64,
    pub footprint: Position<MoonFixed>,
    pub spacecraft: Position<MoonFixed>,
}

pub fn shots(path: &Path) -> Vec<Shot> {
    let mut reader = csv::ReaderBuilder::new()
        .has_headers(false)
        .trim(csv::Trim::All)
        .from_path(path)
        .unwrap();
    let records = reader.records().map(|record| {
        let record = record.unwrap();
        // Columns counted from 1, as in the data's description.
        let number = |column: usize| record[column - 1].parse::<f64>().unwrap();
        let position = |longitude: usize, radius_km: f64| {
            Position::new(spherical_to_xyz_m(
                number(longitude) * RADIANS_PER_DEGREE,
                number(longitude + 1) * RADIANS_PER_DEGREE,
                radius_km * METRES_PER_KM,
            ))
        };
        Shot {
            et_s: number(16),
            range_m: number(5) * METRES_PER_KM,
            footprint: position(2, number(4)),
            spacecraft: position(19, number(21)),
        }
    });
    records.collect()
}

pub fn vectors(value: &Value) -> Vec<Vec<f64>> {
    let numbers = |row: &Value| {
        row.as_array()
            .unwrap()
            .iter()
            .map(|n| n.as_f64().unwrap())
            .collect()
    };
    value.as_array().unwrap().iter().map(numbers).collect()
}

pub fn times(table: &Value) -> Vec<f64> {
    let times = table["ephemeris_times"].as_array().unwrap();
    times.iter().map(|time| time.as_f64().unwrap()).collect()
}

/// Cubic Hermite interpolation of the support data's positions and velocities, metres, J2000.
pub fn inertial_position(table: &Value, et_s: f64) -> Vector3<f64> {
    let times = times(table);
    let after = times
        .partition_point(|time| *time <= et_s)
        .clamp(1, times.len() - 1);
    let (t0, step) = (times[after - 1], times[after] - times[after - 1]);
    let read = |key: &str, row: usize| {
        METRES_PER_KM * Vector3::from_vec(vectors(&table[key])[row].clone())
    };
    let [p0, p1] = [read("positions", after - 1), read("positions", after)];
    let [v0, v1] = [read("velocities", after - 1), read("velocities", after)];
    let u = (et_s - t0) / step;
    let (u2, u3) = (u * u, u * u * u);
    p0 * (2.0 * u3 - 3.0 * u2 + 1.0)
        + v0 * step * (u3 - 2.0 * u2 + u)
        + p1 * (3.0 * u2 - 2.0 * u3)
        + v1 * step * (u3 - u2)
}

/// J2000 to the Moon frame: the two tabulated rotations, interpolated on the arc between them.
pub fn moon_matrix(table: &Value, et_s: f64) -> Matrix3<f64> {
    let times = times(table);
    let quaternion = |row: usize| {
        let components = vectors(&table["quaternions"])[row].clone();
        let matrix = matrix_of_spice_quaternion(components.try_into().unwrap());
        UnitQuaternion::from_matrix(&matrix)
    };
    let u = (et_s - times[0]) / (times[1] - times[0]);
    let constant: Vec<f64> = table["constant_rotation"]
        .as_array()
        .unwrap()
        .iter()
        .map(|n| n.as_f64().unwrap())
        .collect();
    Matrix3::from_row_slice(&constant)
        * quaternion(0)
            .slerp(&quaternion(1), u)
            .to_rotation_matrix()
            .into_inner()
}

/// J2000 to the camera: the tabulated attitudes, interpolated on the arc between two neighbours.
pub fn attitude(table: &Value, et_s: f64) -> Matrix3<f64> {
    let times = times(table);
    let after = times
        .partition_point(|time| *time <= et_s)
        .clamp(1, times.len() - 1);
    let quaternion = |row: usize| {
        let components = vectors(&table["quaternions"])[row].clone();
        let matrix = matrix_of_spice_quaternion(components.try_into().unwrap());
        UnitQuaternion::from_matrix(&matrix)
    };
    let u = (et_s - times[after - 1]) / (times[after] - times[after - 1]);
    quaternion(after - 1)
        .slerp(&quaternion(after), u)
        .to_rotation_matrix()
        .into_inner()
}

/// One image of the pair with its support data.
pub struct Image {
    pub orientation: SampledOrientation,
    pub detector: Detector,
    pub lines: f64,
    pub start_s: f64,
    pub period_s: f64,
    distortion_per_mm2: f64,
    pixels_per_mm: f64,
}

impl Image {
    pub fn read(path: &Path) -> Self {
        let support = read_json(path);
        let number = |pointer: &str| support.pointer(pointer).unwrap().as_f64().unwrap();
        let (start_s, period_s) = (
            number("/starting_ephemeris_time"),
            number("/line_scan_rate/0/2"),
        );
        let lines = number("/image_lines");
        let pointing = &support["instrument_pointing"];
        let samples: Vec<(f64, Pose)> = times(pointing)
            .iter()
            .map(|et_s| {
                let to_moon = moon_matrix(&support["body_rotation"], *et_s);
                let pose = Pose {
                    position_m: to_moon * inertial_position(&support["instrument_position"], *et_s),
                    mars_to_camera: attitude(pointing, *et_s) * to_moon.transpose(),
                };
                ((et_s - start_s) / period_s - 0.5 * lines, pose)
            })
            .collect();
        let pixels_per_mm = number("/focal2pixel_samples/2");
        Self {
            orientation: SampledOrientation::new(&samples).unwrap(),
            detector: Detector {
                focal_length_px: number("/focal_length_model/focal_length") * pixels_per_mm,
                // The centre of the first pixel is 0.5 in both conventions.
                boresight_sample: number("/detector_center/sample"),
                sample_sense: -1.0,
                samples: number("/image_samples"),
                distortion: Distortion::NONE,
            },
            lines,
            start_s,
            period_s,
            distortion_per_mm2: number("/optical_distortion/lrolrocnac/coefficients/0"),
            pixels_per_mm,
        }
    }

    /// Line and sample as ISIS counts them: 1 at the centre of the first pixel.
    pub fn place(&self, point_m: &Vector3<f64>) -> [f64; 2] {
        let projector = Projector::new(&self.orientation, self.lines).unwrap();
        let solution = projector.project(point_m).unwrap();
        let y_px = self.detector.focal_px(&solution.camera_m).unwrap().y;
        // The camera's own distortion: undistorted = distorted / (1 + k · distorted²), in millimetres.
        let ideal_mm = y_px / self.pixels_per_mm;
        let distorted_mm = (0..20).fold(ideal_mm, |seen: f64, _| {
            ideal_mm * (1.0 + self.distortion_per_mm2 * seen * seen)
        });
        let sample = self.detector.sample(distorted_mm * self.pixels_per_mm);
        [solution.x + 0.5 * self.lines + 0.5, sample + 0.5]
    }

    /// Position in a camera without distortion that corresponds to `sample` of this one; both 0 at the outer edge.
    pub fn ideal_sample(&self, sample: f64) -> f64 {
        let distorted_mm = self.detector.place_px(sample).y / self.pixels_per_mm;
        let ideal_mm = distorted_mm / (1.0 + self.distortion_per_mm2 * distorted_mm * distorted_mm);
        self.detector.sample(ideal_mm * self.pixels_per_mm)
    }

    /// Lines from the middle of the image at an instant.
    pub fn x_lines(&self, et_s: f64) -> f64 {
        (et_s - self.start_s) / self.period_s - 0.5 * self.lines
    }

    pub fn shows(&self, [line, sample]: [f64; 2]) -> bool {
        (0.5..=self.lines + 0.5).contains(&line)
            && (0.5..=self.detector.samples + 0.5).contains(&sample)
    }
}

/// Both images, from the folder of all real data.
pub fn images(root: &Path) -> [Image; 2] {
    ["lidarObservationImage1.isd", "lidarObservationImage2.isd"]
        .map(|name| Image::read(&root.join(FOLDER).join(name)))
}

/// A shot as ISIS's lidar data describe it.
pub struct LidarPoint {
    pub id: String,
    pub et_s: f64,
    pub range_m: f64,
    pub range_sigma_m: f64,
    /// Moon-fixed.
    pub ground_m: Vector3<f64>,
    /// To the north, to the east, upwards.
    pub ground_sigma_m: [f64; 3],
    /// Simultaneous images.
    pub simultaneous: Vec<String>,
    /// Image with line and sample as ISIS counts them.
    pub measures: Vec<(usize, [f64; 2])>,
}

pub fn lidar_points(path: &Path) -> Vec<LidarPoint> {
    let document = read_json(path);
    let points = document["points"].as_array().unwrap();
    points.iter().map(lidar_point).collect()
}

fn lidar_point(point: &Value) -> LidarPoint {
    let number = |key: &str| point[key].as_f64().unwrap();
    let (longitude_rad, latitude_rad, radius_m) = (
        number("longitude") * RADIANS_PER_DEGREE,
        number("latitude") * RADIANS_PER_DEGREE,
        number("radius") * METRES_PER_KM,
    );
    // The upper triangle by rows: latitude and longitude in radians, radius in metres.
    let root = |at: usize| point["aprioriMatrix"][at].as_f64().unwrap().sqrt();
    let measure = |measure: &Value| {
        let serial = measure["serialNumber"].as_str().unwrap();
        let image = SERIALS.iter().position(|known| *known == serial).unwrap();
        let read = |key: &str| measure[key].as_f64().unwrap();
        (image, [read("line"), read("sample")])
    };
    let array = |key: &str| point[key].as_array().unwrap();
    LidarPoint {
        id: point["id"].as_str().unwrap().to_owned(),
        et_s: number("time"),
        range_m: number("range") * METRES_PER_KM,
        range_sigma_m: number("sigmaRange"),
        ground_m: spherical_to_xyz_m(longitude_rad, latitude_rad, radius_m),
        ground_sigma_m: [
            root(0) * radius_m,
            root(3) * radius_m * latitude_rad.cos(),
            root(5),
        ],
        simultaneous: array("simultaneousImages")
            .iter()
            .map(|serial| serial.as_str().unwrap().to_owned())
            .collect(),
        measures: array("measures").iter().map(measure).collect(),
    }
}
