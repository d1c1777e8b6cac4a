//! What an image truly shows, and the row of the index that states it.

use nalgebra::Vector3;

use super::{
    super::{
        error::SceneError,
        sun::{mars_from_sun_m, mars_state_from_sun},
        terrain::Terrain,
        ties::TrueImage,
    },
    index::{Row, Value},
    plan::towards_sun,
};
use areograph_base::{
    body::{Body, MARS_IAU2000},
    error::Result,
    time::Et,
    units::{METRES_PER_KM, RADIANS_PER_DEGREE, wrap_pi},
};
use areograph_config::usual_instrument;
use areograph_geom::{
    body_rotation::body_matrix,
    ellipsoid::{Spherical, height_m, local_axes},
    pushbroom::ExteriorOrientation as _,
};

/// Temperature of the focal plane, kelvin, the same in all rows; invented.
const TEMPERATURE_K: f64 = 245.0;
/// Volume of the archive, invented.
const VOLUME: &str = "MGSC_9001";

/// The row of the index for an image, from the ground that it truly shows.
///
/// # Errors
/// An image that does not see the ground.
pub(super) fn row(image: &TrueImage<'_>, terrain: &Terrain, mission_phase: &str) -> Result<Row> {
    let planned = image.flown.arc.image;
    let camera = &image.oriented_camera;
    let [lines, samples] = [camera.lines(), camera.detector.samples];
    let ground = |line: f64, sample: f64| {
        let seen_m = image.ground_m(terrain, line, sample);
        seen_m.ok_or_else(|| SceneError::NoCamera {
            image: planned.id.to_owned(),
            error: format!("line {line}, sample {sample} is not on the ground"),
        })
    };
    let centre_m = ground(0.5 * lines, 0.5 * samples)?;
    let (up_left_m, up_right_m) = (ground(0.0, 0.0)?, ground(0.0, samples)?);
    let (low_left_m, low_right_m) = (ground(lines, 0.0)?, ground(lines, samples)?);
    let across_m = ground(0.5 * lines, samples)? - ground(0.5 * lines, 0.0)?;
    let along_m = ground(lines, 0.5 * samples)? - ground(0.0, 0.5 * samples)?;
    let (right, down) = (across_m.normalize(), along_m.normalize());
    let exposed = image.flown.arc.exposed;
    let middle = exposed.start.plus(0.5 * exposed.duration_s());
    let craft_m = camera.orientation.pose(0.0).position_m;
    let to_craft_m = craft_m - centre_m;
    let sun = towards_sun(middle);
    let [_, north, up] = [0, 1, 2].map(|axis| local_axes(&centre_m).row(axis).transpose());
    let azimuth_deg = |towards: &Vector3<f64>| {
        let angle_rad = towards.dot(&down).atan2(towards.dot(&right));
        (angle_rad / RADIANS_PER_DEGREE).rem_euclid(360.0)
    };
    let pixel_m = across_m.norm() / samples;
    let line_m = along_m.norm() / lines;
    let degrees = |angle_rad: f64| angle_rad / RADIANS_PER_DEGREE;
    let kilometres = |metres: f64| metres / METRES_PER_KM;
    let sun_longitude_rad = Spherical::from_xyz_m(&sun).longitude_rad;
    let own_longitude_rad = Spherical::from_xyz_m(&centre_m).longitude_rad;
    let local_time_h = 12.0 + degrees(wrap_pi(own_longitude_rad - sun_longitude_rad)) / 15.0;

    let (phase, number) = planned.id.split_once('-').unwrap_or((planned.id, ""));
    let folder = number.get(..3).unwrap_or(number);
    let text = |text: &str| Value::Text(text.to_owned());
    let mut values = vec![
        ("VOLUME_ID", text(VOLUME)),
        (
            "FILE_SPECIFICATION_NAME",
            Value::Text(format!("{phase}{folder}/{phase}{number}.IMQ")),
        ),
        ("PRODUCT_ID", Value::Text(planned.id.replace('-', "/"))),
        ("IMAGE_TIME", text(planned.utc_start)),
        (
            "INSTRUMENT_NAME",
            text(&usual_instrument().label.instrument),
        ),
        ("FILTER_NAME", text("N/A")),
        ("LINE_SAMPLES", Value::Number(f64::from(planned.samples()))),
        ("LINES", Value::Number(f64::from(planned.lines_header))),
        (
            "CROSSTRACK_SUMMING",
            Value::Number(f64::from(planned.summing)),
        ),
        (
            "DOWNTRACK_SUMMING",
            Value::Number(f64::from(planned.summing)),
        ),
        ("SCALED_PIXEL_WIDTH", Value::Number(pixel_m)),
        ("PIXEL_ASPECT_RATIO", Value::Number(line_m / pixel_m)),
        (
            "EMISSION_ANGLE",
            Value::Number(degrees(up.angle(&to_craft_m))),
        ),
        ("INCIDENCE_ANGLE", Value::Number(degrees(up.angle(&sun)))),
        (
            "PHASE_ANGLE",
            Value::Number(degrees(to_craft_m.angle(&sun))),
        ),
    ];
    values.extend(in_columns(
        ["CENTER_LONGITUDE", "CENTER_LATITUDE"],
        &centre_m,
    ));
    values.extend(in_columns(
        ["UPPER_LEFT_LONGITUDE", "UPPER_LEFT_LATITUDE"],
        &up_left_m,
    ));
    values.extend(in_columns(
        ["UPPER_RIGHT_LONGITUDE", "UPPER_RIGHT_LATITUDE"],
        &up_right_m,
    ));
    values.extend(in_columns(
        ["LOWER_LEFT_LONGITUDE", "LOWER_LEFT_LATITUDE"],
        &low_left_m,
    ));
    values.extend(in_columns(
        ["LOWER_RIGHT_LONGITUDE", "LOWER_RIGHT_LATITUDE"],
        &low_right_m,
    ));
    values.extend([
        ("MISSION_PHASE_NAME", text(mission_phase)),
        ("TARGET_NAME", text("MARS")),
        ("SPACECRAFT_CLOCK_START_COUNT", text(planned.sclk_start)),
        ("FOCAL_PLANE_TEMPERATURE", Value::Number(TEMPERATURE_K)),
        ("LINE_EXPOSURE_DURATION", Value::Number(planned.exposure_ms)),
        ("GAIN_MODE_ID", text("6A")),
        ("OFFSET_MODE_ID", text("30")),
        ("EDIT_MODE_ID", Value::Number(0.0)),
        ("ENCODING_TYPE", text("MOC-PRED-X-5")),
        (
            "SCALED_IMAGE_WIDTH",
            Value::Number(kilometres(across_m.norm())),
        ),
        (
            "SCALED_IMAGE_HEIGHT",
            Value::Number(kilometres(along_m.norm())),
        ),
        (
            "SPACECRAFT_ALTITUDE",
            Value::Number(kilometres(height_m(Body::Mars.model(), &craft_m).0)),
        ),
        (
            "TARGET_CENTER_DISTANCE",
            Value::Number(kilometres(craft_m.norm())),
        ),
        (
            "SLANT_DISTANCE",
            Value::Number(kilometres(to_craft_m.norm())),
        ),
        ("NORTH_AZIMUTH", Value::Number(azimuth_deg(&north))),
        (
            "SUB_SOLAR_AZIMUTH",
            Value::Number(azimuth_deg(&(sun - up * sun.dot(&up)))),
        ),
    ]);
    values.extend(in_columns(
        ["SUB_SOLAR_LONGITUDE", "SUB_SOLAR_LATITUDE"],
        &sun,
    ));
    values.extend(in_columns(
        ["SUB_SPACECRAFT_LONGITUDE", "SUB_SPACECRAFT_LATITUDE"],
        &craft_m,
    ));
    values.extend([
        (
            "SOLAR_DISTANCE",
            Value::Number(kilometres(mars_from_sun_m(middle).norm())),
        ),
        (
            "SOLAR_LONGITUDE",
            Value::Number(solar_longitude_deg(middle)),
        ),
        ("LOCAL_TIME", Value::Number(local_time_h)),
        (
            "IMAGE_SKEW_ANGLE",
            Value::Number(degrees(right.angle(&down))),
        ),
        (
            "RATIONALE_DESC",
            Value::Text(format!("SYNTHETIC {}", planned.site.name)),
        ),
        ("DATA_QUALITY_DESC", text("OK")),
        (
            "ORBIT_NUMBER",
            Value::Number(f64::from(planned.pedr_number - 10_000)),
        ),
    ]);
    Ok(Row::new(values))
}

/// Longitude and latitude of a place in the columns of these names.
fn in_columns(names: [&'static str; 2], place_m: &Vector3<f64>) -> [(&'static str, Value); 2] {
    let [west_deg, latitude_deg] = west_and_latitude_deg(place_m);
    [
        (names[0], Value::Number(west_deg)),
        (names[1], Value::Number(latitude_deg)),
    ]
}

/// West longitude, 0 to 360, and latitude, degrees.
fn west_and_latitude_deg(place_m: &Vector3<f64>) -> [f64; 2] {
    let place = Spherical::from_xyz_m(place_m);
    let west_deg = (-place.longitude_rad / RADIANS_PER_DEGREE).rem_euclid(360.0);
    // Two digits of 359.996 are those of 0.
    let west_deg = if west_deg >= 359.995 { 0.0 } else { west_deg };
    [west_deg, place.latitude.0 / RADIANS_PER_DEGREE]
}

/// Solar longitude of Mars, degrees: the angle of the Sun in the plane of the orbit from where it crosses the equator to the north.
fn solar_longitude_deg(et: Et) -> f64 {
    let state = mars_state_from_sun(et);
    let normal = state.position_m.cross(&state.velocity_m_s).normalize();
    let pole = body_matrix(&MARS_IAU2000, et).row(2).transpose();
    let node = pole.cross(&normal).normalize();
    let sun = -state.position_m;
    let angle_rad = normal.cross(&node).dot(&sun).atan2(node.dot(&sun));
    (angle_rad / RADIANS_PER_DEGREE).rem_euclid(360.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use areograph_base::units::SECONDS_PER_DAY;

    #[test]
    fn seasons_begin_on_their_days() {
        // Northern spring began on 2000-05-31 and northern autumn on 2001-06-17: 151.5 and 533.5 days after J2000.
        for (days, expected_deg) in [(151.5, 0.0), (533.5, 180.0)] {
            let found_deg = solar_longitude_deg(Et::from_seconds(days * SECONDS_PER_DAY));
            let off_deg = (found_deg - expected_deg + 180.0).rem_euclid(360.0) - 180.0;
            // The Sun moves by half a degree in a day.
            assert!(off_deg.abs() < 0.6, "{found_deg}");
        }
    }
}
