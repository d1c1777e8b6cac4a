//! Control networks of ISIS in binary form, version 5, with the content of the text form.

use std::path::Path;

use nalgebra::{Matrix3, Vector3};
use prost::Message as _;

use super::control_network::{
    ControlNetwork, EDGE_TO_ISIS, Lines, NetworkMeasure, NetworkPoint, quoted, refused,
};
use crate::{error::ProductError, files::write_checked};
use areograph_base::error::{Locate, Result};
use areograph_pds::ties::messages::{
    HeaderV5, LABEL_BYTES, MeasureEntry, PointEntry, REGISTERED_SUB_PIXEL, VERSION, apriori_source,
    point_type,
};

/// Name of the program in networks.
const USER: &str = "areograph";

/// Writes `network` to `path`; returns the number of its points.
///
/// # Errors
/// [`Kind::Bug`](areograph_base::error::Kind::Bug) for numbers that are not finite, and texts that the label cannot hold;
/// [`Kind::Io`](areograph_base::error::Kind::Io).
pub fn write_binary_network(path: &Path, network: &ControlNetwork) -> Result<u64> {
    let bytes = encode(network).in_file(path)?;
    write_checked(path, &bytes)?;
    Ok(network.points.len() as u64)
}

fn encode(network: &ControlNetwork) -> std::result::Result<Vec<u8>, ProductError> {
    let header = header(network).encode_to_vec();
    let mut points = Vec::new();
    for point in &network.points {
        let entry = point_entry(point)?.encode_to_vec();
        let size = u32::try_from(entry.len());
        let size = size.map_err(|_| refused(format!("point {} is too large", point.id)))?;
        points.extend(size.to_le_bytes());
        points.extend(entry);
    }
    let mut bytes = label(network, header.len(), points.len())?.into_bytes();
    if bytes.len() > LABEL_BYTES {
        let found = bytes.len();
        return Err(refused(format!(
            "a label of {found} bytes; expected at most {LABEL_BYTES}"
        )));
    }
    bytes.resize(LABEL_BYTES, 0);
    bytes.extend(header);
    bytes.extend(points);
    Ok(bytes)
}

fn header(network: &ControlNetwork) -> HeaderV5 {
    HeaderV5 {
        network_id: network.id.to_owned(),
        target_name: network.body.names().name.clone(),
        created: Some(network.created_utc.clone()),
        last_modified: Some(network.created_utc.clone()),
        description: Some(network.description.clone()),
        user_name: Some(USER.to_owned()),
    }
}

/// The label, which states where header and points are.
fn label(
    network: &ControlNetwork,
    header_bytes: usize,
    points_bytes: usize,
) -> std::result::Result<String, ProductError> {
    let measures: usize = network
        .points
        .iter()
        .map(|point| point.measures.len())
        .sum();
    let mut lines = Lines::default();
    lines.open("Object", "ProtoBuffer");
    lines.open("Object", "Core");
    for (key, value) in [
        ("HeaderStartByte", LABEL_BYTES),
        ("HeaderBytes", header_bytes),
        ("PointsStartByte", LABEL_BYTES + header_bytes),
        ("PointsBytes", points_bytes),
    ] {
        lines.key(key, &value.to_string());
    }
    lines.close("End_Object");
    lines.open("Group", "ControlNetworkInfo");
    lines.key("NetworkId", &quoted(network.id)?);
    lines.key("TargetName", &network.body.names().name);
    lines.key("UserName", USER);
    lines.key("Created", &network.created_utc);
    lines.key("LastModified", &network.created_utc);
    lines.key("Description", &quoted(&network.description)?);
    lines.key("NumberOfPoints", &network.points.len().to_string());
    lines.key("NumberOfMeasures", &measures.to_string());
    lines.key("Version", &VERSION.to_string());
    lines.close("End_Group");
    lines.close("End_Object");
    lines.line("End");
    Ok(lines.text)
}

fn point_entry(point: &NetworkPoint) -> std::result::Result<PointEntry, ProductError> {
    let is_constrained = point
        .known
        .is_some_and(|known| known.covariance_m2.is_some());
    let known_m = point.known.map(|known| known.ground.xyz_m);
    let apriori_m = known_m.or(point.initial_m);
    let source = match point.known {
        Some(_) => apriori_source::USER,
        None => apriori_source::AVERAGE_OF_MEASURES,
    };
    let covariance_m2 = point.known.and_then(|known| known.covariance_m2);
    let adjusted_m = point.adjusted.as_ref().map(|ground| ground.position.xyz_m);
    let [apriori_x_m, apriori_y_m, apriori_z_m] = coordinates(apriori_m)?;
    let [adjusted_x_m, adjusted_y_m, adjusted_z_m] = coordinates(adjusted_m)?;
    let measures = point.measures.iter();
    let measures = measures.map(|measure| measure_entry(measure, point.is_rejected));
    Ok(PointEntry {
        id: point.id.as_bytes().to_vec(),
        point_type: match point.known {
            None => point_type::FREE,
            Some(_) if is_constrained => point_type::CONSTRAINED,
            Some(_) => point_type::FIXED,
        },
        ignore: None,
        jigsaw_rejected: point.is_rejected.then_some(true),
        apriori_source: apriori_m.map(|_| source),
        apriori_radius_source: apriori_m.map(|_| source),
        latitude_constrained: is_constrained.then_some(true),
        longitude_constrained: is_constrained.then_some(true),
        radius_constrained: is_constrained.then_some(true),
        apriori_x_m,
        apriori_y_m,
        apriori_z_m,
        apriori_covariance_m2: triangle(covariance_m2.as_ref())?,
        adjusted_x_m,
        adjusted_y_m,
        adjusted_z_m,
        adjusted_covariance_m2: triangle(
            point.adjusted.as_ref().map(|ground| &ground.covariance_m2),
        )?,
        measures: measures.collect::<std::result::Result<_, _>>()?,
    })
}

fn measure_entry(
    of: &NetworkMeasure,
    is_rejected: bool,
) -> std::result::Result<MeasureEntry, ProductError> {
    let pair = |values: Option<[f64; 2]>| -> std::result::Result<_, ProductError> {
        let [line, sample] = values.map_or([None; 2], |values| values.map(Some));
        Ok([finite(line)?, finite(sample)?])
    };
    let [line, sample] = pair(Some([of.measure.line, of.measure.sample]))?;
    let [line_sigma_px, sample_sigma_px] = pair(of.sigma_px)?;
    let [line_residual_px, sample_residual_px] = pair(of.residual_px)?;
    Ok(MeasureEntry {
        serial_number: of.measure.image.as_bytes().to_vec(),
        measure_type: REGISTERED_SUB_PIXEL,
        sample: sample.map(|edge| edge + EDGE_TO_ISIS),
        line: line.map(|edge| edge + EDGE_TO_ISIS),
        sample_residual_px,
        line_residual_px,
        ignore: None,
        jigsaw_rejected: is_rejected.then_some(true),
        sample_sigma_px,
        line_sigma_px,
    })
}

fn coordinates(xyz_m: Option<Vector3<f64>>) -> std::result::Result<[Option<f64>; 3], ProductError> {
    let axis = |axis: usize| finite(xyz_m.map(|xyz_m| xyz_m[axis]));
    Ok([axis(0)?, axis(1)?, axis(2)?])
}

/// The upper triangle, row by row; nothing without a matrix.
fn triangle(matrix: Option<&Matrix3<f64>>) -> std::result::Result<Vec<f64>, ProductError> {
    let Some(matrix) = matrix else {
        return Ok(Vec::new());
    };
    let numbers = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)].map(|at| matrix[at]);
    for number in numbers {
        finite(Some(number))?;
    }
    Ok(numbers.to_vec())
}

/// # Errors
/// A number that is not finite.
fn finite(value: Option<f64>) -> std::result::Result<Option<f64>, ProductError> {
    match value {
        Some(value) if !value.is_finite() => Err(refused(format!(
            "a value is {value}; expected a finite number"
        ))),
        value => Ok(value),
    }
}
