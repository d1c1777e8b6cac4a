//! What an image truly shows, and the row of the index that states it.

use nalgebra::Vector3;

use super::{
    super::{
        error::SceneError,
        plan::PlannedImage,
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

/// Columns of a row, in order.
type Values = Vec<(&'static str, Value)>;

/// What an image truly shows; positions and directions in IAU 2000, metres.
pub(super) struct Seen<'a> {
    image: &'a TrueImage<'a>,
    centre_m: Vector3<f64>,
    /// First line, first and last sample; last line, first and last sample.
    corners_m: [Vector3<f64>; 4],
    /// From the first to the last sample in the middle, and from the first to the last line.
    across_m: Vector3<f64>,
    along_m: Vector3<f64>,
    craft_m: Vector3<f64>,
    /// Towards the Sun.
    sun: Vector3<f64>,
    middle: Et,
}

impl<'a> Seen<'a> {
    /// What `image` shows.
    ///
    /// # Errors
    /// An image that does not see the ground.
    pub(super) fn of(image: &'a TrueImage<'_>, terrain: &Terrain) -> Result<Self> {
        let camera = &image.oriented_camera;
        let [lines, samples] = [camera.lines(), camera.detector.samples];
        let ground = |line: f64, sample: f64| {
            let seen_m = image.ground_m(terrain, line, sample);
            seen_m.ok_or_else(|| SceneError::NoCamera {
                image: camera.id.clone(),
                error: format!("line {line}, sample {sample} is not on the ground"),
            })
        };
        let exposed = image.flown.arc.exposed;
        let middle = exposed.start.plus(0.5 * exposed.duration_s());
        Ok(Self {
            image,
            centre_m: ground(0.5 * lines, 0.5 * samples)?,
            corners_m: [
                ground(0.0, 0.0)?,
                ground(0.0, samples)?,
                ground(lines, 0.0)?,
                ground(lines, samples)?,
            ],
            across_m: ground(0.5 * lines, samples)? - ground(0.5 * lines, 0.0)?,
            along_m: ground(lines, 0.5 * samples)? - ground(0.0, 0.5 * samples)?,
            craft_m: camera.orientation.pose(0.0).position_m,
            sun: towards_sun(middle),
            middle,
        })
    }

    /// The row of the index.
    pub(super) fn row(&self, mission_phase: &str) -> Row {
        let parts = [
            self.product(),
            self.angles(),
            self.places(),
            self.exposure(mission_phase),
            self.distances(),
            self.directions(),
            self.season(),
        ];
        Row::new(parts.concat())
    }

    fn planned(&self) -> &PlannedImage<'a> {
        self.image.flown.arc.image
    }

    /// Width of a pixel and distance of lines on the ground.
    fn pixel_m(&self) -> [f64; 2] {
        let camera = &self.image.oriented_camera;
        [
            self.across_m.norm() / camera.detector.samples,
            self.along_m.norm() / camera.lines(),
        ]
    }

    fn product(&self) -> Values {
        let planned = self.planned();
        let (phase, number) = planned.id.split_once('-').unwrap_or((planned.id, ""));
        let folder = number.get(..3).unwrap_or(number);
        let file = format!("{phase}{folder}/{phase}{number}.IMQ");
        let summing = Value::Number(f64::from(planned.summing));
        vec![
            ("VOLUME_ID", text(VOLUME)),
            ("FILE_SPECIFICATION_NAME", Value::Text(file)),
            ("PRODUCT_ID", Value::Text(planned.id.replace('-', "/"))),
            ("IMAGE_TIME", text(planned.utc_start)),
            (
                "INSTRUMENT_NAME",
                text(&usual_instrument().label.instrument),
            ),
            ("FILTER_NAME", text("N/A")),
            ("LINE_SAMPLES", Value::Number(f64::from(planned.samples()))),
            ("LINES", Value::Number(f64::from(planned.lines_header))),
            ("CROSSTRACK_SUMMING", summing.clone()),
            ("DOWNTRACK_SUMMING", summing),
        ]
    }

    fn angles(&self) -> Values {
        let up = self.centre_m.normalize();
        let to_craft_m = self.craft_m - self.centre_m;
        let [pixel_m, line_m] = self.pixel_m();
        let angle =
            |one: &Vector3<f64>, other| Value::Number(one.angle(other) / RADIANS_PER_DEGREE);
        vec![
            ("SCALED_PIXEL_WIDTH", Value::Number(pixel_m)),
            ("PIXEL_ASPECT_RATIO", Value::Number(line_m / pixel_m)),
            ("EMISSION_ANGLE", angle(&up, &to_craft_m)),
            ("INCIDENCE_ANGLE", angle(&up, &self.sun)),
            ("PHASE_ANGLE", angle(&to_craft_m, &self.sun)),
        ]
    }

    fn places(&self) -> Values {
        let [upper_left, upper_right, lower_left, lower_right] = &self.corners_m;
        [
            in_columns(["CENTER_LONGITUDE", "CENTER_LATITUDE"], &self.centre_m),
            in_columns(["UPPER_LEFT_LONGITUDE", "UPPER_LEFT_LATITUDE"], upper_left),
            in_columns(
                ["UPPER_RIGHT_LONGITUDE", "UPPER_RIGHT_LATITUDE"],
                upper_right,
            ),
            in_columns(["LOWER_LEFT_LONGITUDE", "LOWER_LEFT_LATITUDE"], lower_left),
            in_columns(
                ["LOWER_RIGHT_LONGITUDE", "LOWER_RIGHT_LATITUDE"],
                lower_right,
            ),
        ]
        .concat()
    }

    fn exposure(&self, mission_phase: &str) -> Values {
        let planned = self.planned();
        vec![
            ("MISSION_PHASE_NAME", text(mission_phase)),
            ("TARGET_NAME", text("MARS")),
            ("SPACECRAFT_CLOCK_START_COUNT", text(planned.sclk_start)),
            ("FOCAL_PLANE_TEMPERATURE", Value::Number(TEMPERATURE_K)),
            ("LINE_EXPOSURE_DURATION", Value::Number(planned.exposure_ms)),
            ("GAIN_MODE_ID", text("6A")),
            ("OFFSET_MODE_ID", text("30")),
            ("EDIT_MODE_ID", Value::Number(0.0)),
            ("ENCODING_TYPE", text("MOC-PRED-X-5")),
        ]
    }

    fn distances(&self) -> Values {
        let kilometres = |metres: f64| Value::Number(metres / METRES_PER_KM);
        let (altitude_m, _) = height_m(Body::Mars.model(), &self.craft_m);
        let slant_m = (self.craft_m - self.centre_m).norm();
        vec![
            ("SCALED_IMAGE_WIDTH", kilometres(self.across_m.norm())),
            ("SCALED_IMAGE_HEIGHT", kilometres(self.along_m.norm())),
            ("SPACECRAFT_ALTITUDE", kilometres(altitude_m)),
            ("TARGET_CENTER_DISTANCE", kilometres(self.craft_m.norm())),
            ("SLANT_DISTANCE", kilometres(slant_m)),
        ]
    }

    fn directions(&self) -> Values {
        let axes = local_axes(&self.centre_m);
        let [north, up] = [1, 2].map(|axis| axes.row(axis).transpose());
        let (right, down) = (self.across_m.normalize(), self.along_m.normalize());
        // Clockwise from the last sample in the image as stored.
        let azimuth = |towards: &Vector3<f64>| {
            let angle_rad = towards.dot(&down).atan2(towards.dot(&right));
            Value::Number((angle_rad / RADIANS_PER_DEGREE).rem_euclid(360.0))
        };
        let sun_on_ground = self.sun - up * self.sun.dot(&up);
        let mut values = vec![
            ("NORTH_AZIMUTH", azimuth(&north)),
            ("SUB_SOLAR_AZIMUTH", azimuth(&sun_on_ground)),
        ];
        let sun = ["SUB_SOLAR_LONGITUDE", "SUB_SOLAR_LATITUDE"];
        values.extend(in_columns(sun, &self.sun));
        let craft = ["SUB_SPACECRAFT_LONGITUDE", "SUB_SPACECRAFT_LATITUDE"];
        values.extend(in_columns(craft, &self.craft_m));
        values
    }

    fn season(&self) -> Values {
        let planned = self.planned();
        let [sun_rad, own_rad] = [&self.sun, &self.centre_m]
            .map(|direction| Spherical::from_xyz_m(direction).longitude_rad);
        let local_time_h = 12.0 + wrap_pi(own_rad - sun_rad) / RADIANS_PER_DEGREE / 15.0;
        let distance_km = mars_from_sun_m(self.middle).norm() / METRES_PER_KM;
        let skew_deg = self.across_m.angle(&self.along_m) / RADIANS_PER_DEGREE;
        let rationale = format!("SYNTHETIC {}", planned.site.name);
        let orbit = f64::from(planned.pedr_number - 10_000);
        vec![
            ("SOLAR_DISTANCE", Value::Number(distance_km)),
            (
                "SOLAR_LONGITUDE",
                Value::Number(solar_longitude_deg(self.middle)),
            ),
            ("LOCAL_TIME", Value::Number(local_time_h)),
            ("IMAGE_SKEW_ANGLE", Value::Number(skew_deg)),
            ("RATIONALE_DESC", Value::Text(rationale)),
            ("DATA_QUALITY_DESC", text("OK")),
            ("ORBIT_NUMBER", Value::Number(orbit)),
        ]
    }
}

fn text(text: &str) -> Value {
    Value::Text(text.to_owned())
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
