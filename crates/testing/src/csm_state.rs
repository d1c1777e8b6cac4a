//! States of line scanners of usgscsm, made of support data for tests, from the description of `constructStateFromIsd`: positions and
//! attitudes in the frame of the body, at uniform epochs from the middle of the image.

use nalgebra::{Matrix3, Quaternion, Rotation3, UnitQuaternion, Vector3};
use serde_json::{Value, json};

/// A list of numbers.
pub fn numbers(value: &Value) -> Vec<f64> {
    value
        .as_array()
        .unwrap()
        .iter()
        .map(crate::number)
        .collect()
}

/// Rotations from J2000 of a table of support data, followed by its constant one.
struct Turning {
    et_s: Vec<f64>,
    rows: Vec<UnitQuaternion<f64>>,
    rates_rad_s: Vec<Vector3<f64>>,
    constant: UnitQuaternion<f64>,
}

impl Turning {
    fn of(table: &Value) -> Self {
        let rows = table["quaternions"].as_array().unwrap().iter();
        let rates = table["angular_velocities"].as_array().unwrap().iter();
        let constant = table.get("constant_rotation").map(|matrix| {
            let matrix = Matrix3::from_row_slice(&numbers(matrix));
            UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(matrix))
        });
        Self {
            et_s: numbers(&table["ephemeris_times"]),
            rows: rows
                .map(|row| {
                    let q = numbers(row);
                    UnitQuaternion::from_quaternion(Quaternion::new(q[0], q[1], q[2], q[3]))
                })
                .collect(),
            rates_rad_s: rates
                .map(|row| Vector3::from_column_slice(&numbers(row)))
                .collect(),
            constant: constant.unwrap_or_default(),
        }
    }

    /// On the arc between the rows around an instant.
    fn at(&self, et_s: f64) -> UnitQuaternion<f64> {
        let last = self.et_s.len() - 1;
        let after = self.et_s.partition_point(|row| *row <= et_s);
        let row = after.clamp(1, last) - 1;
        let share = (et_s - self.et_s[row]) / (self.et_s[row + 1] - self.et_s[row]);
        let turned = self.rows[row].rotation_to(&self.rows[row + 1]);
        self.constant * turned.powf(share) * self.rows[row]
    }
}

/// The state of a line scanner with these support data.
pub fn state_of_isd(isd: &Value) -> Value {
    let centre_s = crate::number(&isd["center_ephemeris_time"]);
    let body = Turning::of(&isd["body_rotation"]);
    let pointing = Turning::of(&isd["instrument_pointing"]);
    // Body-fixed metres and metres per second; the velocity by the rotation of the table.
    let states = |table: &Value| {
        let et_s = numbers(&table["ephemeris_times"]);
        let (mut places, mut velocities) = (Vec::new(), Vec::new());
        for (row, et_s) in et_s.iter().enumerate() {
            let [place, velocity] = ["positions", "velocities"]
                .map(|key| 1e3 * Vector3::from_column_slice(&numbers(&table[key][row])));
            let to_body = body.at(*et_s);
            places.extend((to_body * place).iter().copied());
            let carried = body.rates_rad_s[0].cross(&place);
            velocities.extend((to_body * (velocity - carried)).iter().copied());
        }
        (et_s, places, velocities)
    };
    let step = |et_s: &[f64]| (et_s[et_s.len() - 1] - et_s[0]) / (et_s.len() - 1) as f64;
    let (position_et_s, positions, velocities) = states(&isd["instrument_position"]);
    let (_, sun, sun_velocities) = states(&isd["sun_position"]);
    let step_s = step(&pointing.et_s);
    let quaternions = (0..pointing.et_s.len()).flat_map(|row| {
        let et_s = pointing.et_s[0] + row as f64 * step_s;
        let to_body = body.at(et_s) * pointing.at(et_s).inverse();
        [to_body.i, to_body.j, to_body.k, to_body.w]
    });
    let quaternions: Vec<f64> = quaternions.collect();
    let rates = isd["line_scan_rate"].as_array().unwrap();
    let of_rows = |at: usize| rates.iter().map(|row| &row[at]).collect::<Vec<_>>();
    let distortion = isd["optical_distortion"].as_object().unwrap();
    let (kind, coefficients) = distortion.iter().next().unwrap();
    let as_real = |key: &str| crate::number(&isd[key]);
    let radius_m = |key: &str| {
        let unit = if isd["radii"]["unit"] == "m" {
            1.0
        } else {
            1e3
        };
        unit * crate::number(&isd["radii"][key])
    };
    json!({
        "m_modelName": isd["name_model"],
        "m_imageIdentifier": isd.get("image_identifier").unwrap_or(&json!("UNKNOWN")),
        "m_sensorName": isd["name_sensor"],
        "m_sensorIdentifier": isd["name_sensor"],
        "m_platformIdentifier": isd["name_platform"],
        "m_platformFlag": 1,
        "m_ikCode": 0,
        "m_zDirection": 1.0,
        "m_nLines": isd["image_lines"],
        "m_nSamples": isd["image_samples"],
        "m_focalLength": isd["focal_length_model"]["focal_length"],
        "m_iTransL": isd["focal2pixel_lines"],
        "m_iTransS": isd["focal2pixel_samples"],
        "m_distortionType": if kind == "radial" { 0 } else { 4 },
        "m_opticalDistCoeffs": coefficients["coefficients"],
        "m_detectorSampleSumming": as_real("detector_sample_summing"),
        "m_detectorLineSumming": as_real("detector_line_summing"),
        "m_startingDetectorSample": as_real("starting_detector_sample"),
        "m_startingDetectorLine": as_real("starting_detector_line"),
        "m_detectorSampleOrigin": isd["detector_center"]["sample"],
        "m_detectorLineOrigin": isd["detector_center"]["line"],
        "m_centerEphemerisTime": centre_s,
        "m_startingEphemerisTime": isd["starting_ephemeris_time"],
        "m_intTimeLines": of_rows(0),
        "m_intTimeStartTimes": of_rows(1),
        "m_intTimes": of_rows(2),
        "m_majorAxis": radius_m("semimajor"),
        "m_minorAxis": radius_m("semiminor"),
        "m_dtEphem": step(&position_et_s),
        "m_t0Ephem": position_et_s[0] - centre_s,
        "m_numPositions": positions.len(),
        "m_positions": positions,
        "m_velocities": velocities,
        "m_dtQuat": step_s,
        "m_t0Quat": pointing.et_s[0] - centre_s,
        "m_numQuaternions": quaternions.len(),
        "m_quaternions": quaternions,
        "m_sunPosition": sun,
        "m_sunVelocity": sun_velocities,
        "m_currentParameterValue": vec![0.0; 16],
    })
}

/// The state as text, as newer versions of usgscsm write it: the name of the model, then JSON.
pub fn state_text(state: &Value) -> String {
    let name = state["m_modelName"].as_str().unwrap();
    format!("{name}\n{}", serde_json::to_string_pretty(state).unwrap())
}
