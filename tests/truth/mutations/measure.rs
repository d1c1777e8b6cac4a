//! The result of a run against the truth, and what is stated of it.

use std::{collections::BTreeMap, fs::File, path::Path};

use arrow_array::{Array as _, RecordBatch, cast::AsArray as _, types::Float64Type};
use nalgebra::Vector3;
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use serde_json::Value;

use super::{
    common::{
        camera_files::Pushbroom,
        case::Case,
        json,
        mission::{mission, site_run},
        number,
    },
    start::IMAGES,
};
use crate::truth::{local, table, vector};

/// Most stated standard deviations of the error that all points share.
const MOST: f64 = 3.0;
/// The same of the worst of some hundred single points.
const MOST_SINGLE: f64 = 5.0;
/// A time of a shot may differ by as much as a clock's correction, seconds.
const TIME_S: f64 = 0.5;

/// True error and stated standard deviation where their ratio is largest.
#[derive(Debug, Clone, Copy)]
pub(super) struct Measured {
    /// Error that all points share, metres: the mean in a site, the root mean square in a net and a calibration.
    pub(super) error_m: f64,
    /// What is stated of it; nothing of an orientation that is not adjusted.
    pub(super) sigma_m: Option<f64>,
    /// The largest error of a single point, in its stated standard deviations.
    pub(super) single: Option<f64>,
    /// The largest error of a time of a shot, seconds.
    pub(super) time_s: f64,
}

impl Measured {
    /// The error in stated standard deviations.
    pub(super) fn ratio(&self) -> Option<f64> {
        self.sigma_m.map(|sigma_m| self.error_m / sigma_m)
    }

    /// Whether what is stated holds.
    pub(super) fn is_within(&self) -> bool {
        self.ratio().is_some_and(|ratio| ratio <= MOST)
            && self.single.is_some_and(|single| single <= MOST_SINGLE)
            && self.time_s <= TIME_S
    }

    /// The axis with the largest ratio.
    fn of_axes(axes: impl Iterator<Item = (f64, f64)>, single: f64) -> Self {
        let ratio = |(error_m, sigma_m): &(f64, f64)| error_m / sigma_m;
        let worst = axes.max_by(|a, b| ratio(a).total_cmp(&ratio(b)));
        let (error_m, sigma_m) = worst.unwrap();
        Self {
            error_m,
            sigma_m: Some(sigma_m),
            single: Some(single),
            time_s: 0.0,
        }
    }
}

/// Numbers of some columns in a row; nothing if one is not there.
fn numbers<const N: usize>(table: &RecordBatch, names: [&str; N], row: usize) -> Option<[f64; N]> {
    let values = names.map(|name| {
        let column = table.column_by_name(name).unwrap();
        let column = column.as_primitive::<Float64Type>();
        (!column.is_null(row)).then(|| column.value(row))
    });
    values
        .iter()
        .all(Option::is_some)
        .then(|| values.map(Option::unwrap))
}

/// The truth of the site.
fn truth() -> Value {
    let truth = json(&mission().join("truth.json"));
    let mut sites = truth["ties"].as_array().unwrap().iter();
    sites.find(|of| of["site"] == "isidis").unwrap().clone()
}

/// Adjusted tie points of a site, or its images where no tie points were adjusted.
pub(super) fn site(case: &Case) -> Option<Measured> {
    let out = case.path("out/isidis");
    if !out.join("manifest.json").exists() {
        return None;
    }
    let measured = if out.join("adjustment.json").exists() {
        adjusted(&out)
    } else {
        images(&out)
    };
    measured.map(|measured| Measured {
        time_s: times_s(&out),
        ..measured
    })
}

fn adjusted(out: &Path) -> Option<Measured> {
    let truth = truth();
    let true_m: BTreeMap<&str, (Vector3<f64>, bool)> = truth["ties"]
        .as_array()
        .unwrap()
        .iter()
        .map(|tie| {
            let place_m = vector(&tie["ground_iau2000_m"]);
            (
                tie["id"].as_str().unwrap(),
                (place_m, tie["blunder"].is_null()),
            )
        })
        .collect();
    let found = table(&out.join("ties.parquet"));
    let names = found.column_by_name("tie").unwrap().as_string::<i32>();
    let mut points = BTreeMap::new();
    for row in 0..found.num_rows() {
        let adjusted = numbers(
            &found,
            ["adjusted_x_m", "adjusted_y_m", "adjusted_z_m"],
            row,
        );
        let sigmas = numbers(&found, ["sigma_east_m", "sigma_north_m", "sigma_up_m"], row);
        let (Some(adjusted), Some(sigmas)) = (adjusted, sigmas) else {
            continue;
        };
        if let Some((true_m, is_sound)) = true_m.get(names.value(row)) {
            let error_m = local(true_m) * (Vector3::from(adjusted) - true_m);
            points.insert(
                names.value(row),
                (error_m, Vector3::from(sigmas), *is_sound),
            );
        }
    }
    if points.is_empty() {
        return None;
    }
    let largest = points
        .values()
        .map(|(error_m, sigma_m, _)| error_m.component_div(sigma_m).amax());
    let single = largest.fold(0.0, f64::max);
    let sound: Vec<_> = points.values().filter(|(.., is_sound)| *is_sound).collect();
    let mean_m = sound
        .iter()
        .map(|(error_m, ..)| error_m)
        .sum::<Vector3<f64>>()
        / sound.len() as f64;
    let document = json(&out.join("adjustment.json"));
    let sigma_m = &document["adjustment"]["heights"]["mean_sigma_m"];
    // Without a surface nothing is stated of the mean: then the mean of what is stated of points.
    let sigma_m = if sigma_m.is_array() {
        vector(sigma_m)
    } else {
        sound
            .iter()
            .map(|(_, sigma_m, _)| sigma_m)
            .sum::<Vector3<f64>>()
            / sound.len() as f64
    };
    let axes = (0..3).map(|axis| (mean_m[axis].abs(), sigma_m[axis]));
    Some(Measured::of_axes(axes, single))
}

/// The ground that each image shows at the true pixels of the tie points, by its support data; the largest of the images' mean
/// errors. The sphere through the true points stands for the ground, to within some metres.
fn images(out: &Path) -> Option<Measured> {
    let truth = truth();
    let true_m: BTreeMap<&str, Vector3<f64>> = truth["ties"]
        .as_array()
        .unwrap()
        .iter()
        .filter(|tie| tie["blunder"].is_null())
        .map(|tie| {
            let place_m = vector(&tie["ground_iau2000_m"]);
            (tie["id"].as_str().unwrap(), place_m)
        })
        .collect();
    let measurements = csv(&mission().join("ties/isidis.csv"));
    let mut error_m = 0.0_f64;
    for image in IMAGES {
        let path = out.join(format!("images/{image}/isd.json"));
        if !path.exists() {
            return None;
        }
        let radii_m = true_m.values().map(Vector3::norm);
        let radius_m = radii_m.sum::<f64>() / true_m.len() as f64;
        let mut isd = json(&path);
        for axis in ["semimajor", "semiminor"] {
            isd["radii"][axis] = Value::from(radius_m / 1e3);
        }
        let camera = Pushbroom::new(isd);
        let (mut sum_m, mut count) = (Vector3::zeros(), 0.0);
        for of in measurements
            .iter()
            .filter(|of| of["serial_number"] == image)
        {
            let Some(true_m) = true_m.get(&*of["point_id"]) else {
                continue;
            };
            let [line, sample] = ["line", "sample"].map(|name| of[name].parse::<f64>().unwrap());
            sum_m += camera.ground(line, sample) * 1e3 - true_m.normalize() * radius_m;
            count += 1.0;
        }
        let mean_m = (sum_m / count).norm();
        // A look past the body errs by no less than the body.
        error_m = error_m.max(if mean_m.is_finite() { mean_m } else { radius_m });
    }
    Some(Measured {
        error_m,
        sigma_m: None,
        single: None,
        time_s: 0.0,
    })
}

/// Columns of a table of text by name.
fn csv(path: &Path) -> Vec<BTreeMap<String, String>> {
    let mut reader = csv::Reader::from_path(path).unwrap();
    reader.deserialize().map(Result::unwrap).collect()
}

/// The largest difference of a time from those of a sound run, where the number of shots is the same.
fn times_s(out: &Path) -> f64 {
    let [found, sound] = [out, &site_run("isidis")].map(|out| {
        let file = File::open(out.join("footprints.parquet")).unwrap();
        let rows = ParquetRecordBatchReaderBuilder::try_new(file).unwrap();
        let mut times = Vec::new();
        for batch in rows.build().unwrap().map(Result::unwrap) {
            let of_batch = batch.column_by_name("et_s").unwrap();
            times.extend_from_slice(of_batch.as_primitive::<Float64Type>().values());
        }
        times
    });
    if found.len() != sound.len() {
        return 0.0;
    }
    let differences = found.iter().zip(&sound).map(|(a, b)| (a - b).abs());
    differences.fold(0.0, f64::max)
}

fn root_mean_square(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), of| (sum + of * of, count + 1.0));
    (sum / count).sqrt()
}

/// Errors of points with their stated standard deviations, axis by axis; of those of which something is stated, if any.
fn of_points(points: &[Vec<(f64, Option<f64>)>]) -> Option<Measured> {
    let stated = points.iter().filter_map(|point| {
        let axes = point
            .iter()
            .map(|(error_m, sigma_m)| Some((*error_m, (*sigma_m)?)));
        axes.collect::<Option<Vec<_>>>()
    });
    let stated: Vec<Vec<(f64, f64)>> = stated.collect();
    let axes = 0..points.first()?.len();
    if stated.is_empty() {
        let error_m = |axis: usize| root_mean_square(points.iter().map(|point| point[axis].0));
        return Some(Measured {
            error_m: axes.map(error_m).fold(0.0, f64::max),
            sigma_m: None,
            single: None,
            time_s: 0.0,
        });
    }
    let single = stated.iter().flatten();
    let single = single.map(|(error_m, sigma_m)| (error_m / sigma_m).abs());
    let single = single.fold(0.0, f64::max);
    let axes = axes.map(|axis| {
        let errors_m = stated.iter().map(|point| point[axis].0);
        let sigmas_m = stated.iter().map(|point| point[axis].1);
        (root_mean_square(errors_m), root_mean_square(sigmas_m))
    });
    Some(Measured::of_axes(axes, single))
}

/// Points of a net; its figure as a whole is as well known as its controls.
pub(super) fn net(case: &Case) -> Option<Measured> {
    let path = case.path("out/synthetic_net/points.csv");
    let truth = json(&case.path("truth.json"));
    let rows = if path.exists() {
        csv(&path)
    } else {
        Vec::new()
    };
    let points = rows.iter().filter_map(|row| {
        let place_m = truth["points_m"].get(&row["point"])?;
        let sigma_m = row["sigma_m"].parse().ok();
        let axes = ["x_m", "y_m"].into_iter().enumerate();
        let axes = axes.map(|(axis, name)| {
            let found_m: f64 = row[name].parse().unwrap();
            (found_m - number(&place_m[axis]), sigma_m)
        });
        Some(axes.collect())
    });
    of_points(&points.collect::<Vec<_>>())
}

/// Tie points of a calibration.
pub(super) fn calibration(case: &Case) -> Option<Measured> {
    let path = case.path("out/synthetic_lines/points.csv");
    let truth = json(&case.path("truth.json"));
    let rows = if path.exists() {
        csv(&path)
    } else {
        Vec::new()
    };
    let points = rows.iter().filter_map(|row| {
        if row["kind"] != "tie" || row["left_out"] != "false" {
            return None;
        }
        let true_m = vector(truth["points_m"]["i864"].get(&row["point"])?);
        let value = |name: &str| row[name].parse::<f64>().ok();
        let [longitude, latitude] =
            [value("longitude_deg")?, value("latitude_deg")?].map(f64::to_radians);
        let found_m = Vector3::new(
            latitude.cos() * longitude.cos(),
            latitude.cos() * longitude.sin(),
            latitude.sin(),
        ) * value("radius_m")?;
        let error_m = local(&true_m) * (found_m - true_m);
        let sigmas = ["sigma_east_m", "sigma_north_m", "sigma_up_m"].map(value);
        let axes = (0..3).map(|axis| (error_m[axis], sigmas[axis]));
        Some(axes.collect())
    });
    of_points(&points.collect::<Vec<_>>())
}
