//! Movement and rotation of cameras.

use std::path::Path;

use nalgebra::{Matrix3, Vector3};
use schemars::JsonSchema;
use serde::Serialize;

use super::{
    changes::{self, Change},
    movement::{Component, Size},
    places::Moved,
};
use areograph_base::{body::Body, error::Result, units::RADIANS_PER_ARCSECOND};
use areograph_geom::{
    attitude::{matrix_of_spice_quaternion, rotation_vector},
    body_rotation::body_rotation,
    orbit_axes::radial_along_cross,
};
use areograph_products::read::{ImageDocument, SampleRow, read_samples};

/// Samples are matched when their lines agree to this: an ET of these years is good to 1e-8 s, which
/// is 2e-5 of the shortest line.
const SAME_LINE: f64 = 1e-3;

/// An image in one or both runs.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct ImageDifference {
    /// Image identifier, followed by `, adjusted` for the adjusted orientation.
    pub image: String,
    /// Whether the sensor model is within the limits in the first run; missing if the image is absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub valid_in_a: Option<bool>,
    /// Whether the sensor model is within the limits in the second run; missing if the image is absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub valid_in_b: Option<bool>,
    /// Differing image times and camera keys.
    pub times: Vec<Change>,
    /// Differing statistics of the polynomial models.
    pub models: Vec<Change>,
    /// Number of samples only in the first run; `movement` contains the samples of both runs.
    pub samples_only_in_a: usize,
    /// Number of samples only in the second run.
    pub samples_only_in_b: usize,
    /// Movement of the samples in both runs; missing if there are none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub movement: Option<ImageMovement>,
}

impl ImageDifference {
    /// Whether it moved or turned by more than rounding, or has other samples.
    #[must_use]
    pub fn differs(&self) -> bool {
        let moved = |of: &ImageMovement| {
            of.distance_m.moved() || of.turn_arcsec.moved() || of.time_s.moved()
        };
        self.movement.as_ref().is_none_or(moved)
            || self.samples_only_in_a + self.samples_only_in_b > 0
    }
}

/// Movement of the camera at the samples of both runs, matched by image line.
///
/// Radial, along and cross are orbit axes of the first run: away from Mars, along the flight in inertial space, and along
/// the angular momentum of the orbit. Rotations about the camera axes x, y and z are right-handed; a rotation about z, the
/// boresight, does not move the middle of the image.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct ImageMovement {
    /// Change of the epoch of a line.
    pub time_s: Component,
    /// Distance between the perspective centres.
    pub distance_m: Size,
    /// Shift of the perspective centre away from Mars.
    pub radial_m: Component,
    /// Shift of the perspective centre along the flight.
    pub along_m: Component,
    /// Shift of the perspective centre along the angular momentum of the orbit.
    pub cross_m: Component,
    /// Angle of the total rotation.
    pub turn_arcsec: Size,
    /// Rotation about the camera's x axis.
    pub about_x_arcsec: Component,
    /// Rotation about the camera's y axis.
    pub about_y_arcsec: Component,
    /// Rotation about the boresight.
    pub about_z_arcsec: Component,
    /// Change of the boresight direction times the range: the displacement on the ground across the line of sight.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pointing_ground_m: Option<Size>,
    /// Distance between the intersections of both boresights with the ellipsoid: position and rotation together.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub boresight_ground_m: Option<Size>,
    /// Samples in the order of image lines.
    #[schemars(length(min = 1))]
    pub samples: Vec<SampleMovement>,
}

/// Movement of one sample; see [`ImageMovement`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct SampleMovement {
    /// Line offset from the middle of the image as exposed, lines.
    pub line_offset: f64,
    /// Change of the epoch.
    pub time_s: f64,
    /// Distance between the perspective centres.
    #[schemars(range(min = 0.0))]
    pub distance_m: f64,
    /// Shift of the perspective centre away from Mars.
    pub radial_m: f64,
    /// Shift of the perspective centre along the flight.
    pub along_m: f64,
    /// Shift of the perspective centre along the angular momentum of the orbit.
    pub cross_m: f64,
    /// Angle of the total rotation.
    #[schemars(range(min = 0.0))]
    pub turn_arcsec: f64,
    /// Rotation about the camera's x axis.
    pub about_x_arcsec: f64,
    /// Rotation about the camera's y axis.
    pub about_y_arcsec: f64,
    /// Rotation about the boresight.
    pub about_z_arcsec: f64,
    /// Change of the boresight direction times the range.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0))]
    pub pointing_ground_m: Option<f64>,
    /// Distance between the ground points of both boresights.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0))]
    pub boresight_ground_m: Option<f64>,
    /// The boresight's ground points.
    #[serde(skip)]
    pub grounds: Option<Moved>,
}

impl ImageDifference {
    /// Whether the camera moved or turned, or cannot be compared: in one run only, or without a common line.
    ///
    /// Samples of one run only are not a movement where others can be compared: the path was sampled at
    /// other lines.
    #[must_use]
    pub fn moved(&self) -> bool {
        self.movement.as_ref().is_none_or(ImageMovement::moved)
    }

    /// Whether the image is in one run only.
    #[must_use]
    pub const fn only_in_one(&self) -> bool {
        self.valid_in_a.is_some() != self.valid_in_b.is_some()
    }
}

impl ImageMovement {
    /// Whether the camera moved or turned, or saw its lines at other times.
    #[must_use]
    pub fn moved(&self) -> bool {
        self.time_s.moved() || self.distance_m.moved() || self.turn_arcsec.moved()
    }
}

/// Orientations of an image: file name, and suffix of the identifier.
pub(super) const ORIENTATIONS: [(&str, &str); 2] =
    [("orientation", ""), ("adjusted_orientation", ", adjusted")];

/// Compares one image of `body`; a document is missing if its folder does not have the image.
pub(super) fn between(
    image: &str,
    (orientation, which): (&str, &str),
    folders: [&Path; 2],
    documents: &[Option<ImageDocument>; 2],
    body: Body,
) -> Result<ImageDifference> {
    let rows = |there: bool, folder: &Path| -> Result<Vec<SampleRow>> {
        let file = folder.join(format!("images/{image}/{orientation}.parquet"));
        if there {
            read_samples(&file)
        } else {
            Ok(Vec::new())
        }
    };
    let [a, b] = documents;
    let rows_a = rows(a.is_some(), folders[0])?;
    let rows_b = rows(b.is_some(), folders[1])?;
    let pairs = matched(&rows_a, &rows_b);
    let (times, models) = match (a, b) {
        (Some(a), Some(b)) => (
            changes::between(&a.times, &b.times),
            changes::between(&a.models(), &b.models()),
        ),
        _ => (Vec::new(), Vec::new()),
    };
    Ok(ImageDifference {
        image: format!("{image}{which}"),
        valid_in_a: a.as_ref().map(|document| document.valid),
        valid_in_b: b.as_ref().map(|document| document.valid),
        times,
        models,
        samples_only_in_a: rows_a.len() - pairs.len(),
        samples_only_in_b: rows_b.len() - pairs.len(),
        movement: movement(body, &rows_a, &rows_b, &pairs),
    })
}

/// Rows of the samples at the same lines.
fn matched(a: &[SampleRow], b: &[SampleRow]) -> Vec<(usize, usize)> {
    let (mut first, mut second) = (0, 0);
    let mut pairs = Vec::new();
    while first < a.len() && second < b.len() {
        let ahead = a[first].line_offset - b[second].line_offset;
        if ahead.abs() <= SAME_LINE {
            pairs.push((first, second));
            first += 1;
            second += 1;
        } else if ahead < 0.0 {
            first += 1;
        } else {
            second += 1;
        }
    }
    pairs
}

fn movement(
    body: Body,
    a: &[SampleRow],
    b: &[SampleRow],
    pairs: &[(usize, usize)],
) -> Option<ImageMovement> {
    if pairs.is_empty() {
        return None;
    }
    let samples: Vec<SampleMovement> = pairs
        .iter()
        .map(|(first, second)| of_sample(&a[*first], &b[*second], &orbit_axes(body, a, *first)))
        .collect();
    let all = |value: fn(&SampleMovement) -> f64| samples.iter().map(value);
    Some(ImageMovement {
        time_s: Component::of(all(|s| s.time_s)),
        distance_m: Size::of(all(|s| s.distance_m)),
        radial_m: Component::of(all(|s| s.radial_m)),
        along_m: Component::of(all(|s| s.along_m)),
        cross_m: Component::of(all(|s| s.cross_m)),
        turn_arcsec: Size::of(all(|s| s.turn_arcsec)),
        about_x_arcsec: Component::of(all(|s| s.about_x_arcsec)),
        about_y_arcsec: Component::of(all(|s| s.about_y_arcsec)),
        about_z_arcsec: Component::of(all(|s| s.about_z_arcsec)),
        pointing_ground_m: Size::of_known(samples.iter().map(|s| s.pointing_ground_m)),
        boresight_ground_m: Size::of_known(samples.iter().map(|s| s.boresight_ground_m)),
        samples,
    })
}

fn of_sample(a: &SampleRow, b: &SampleRow, axes: &Matrix3<f64>) -> SampleMovement {
    let moved_m = b.position.xyz_m - a.position.xyz_m;
    let [radial_m, along_m, cross_m] = (axes.transpose() * moved_m).into();
    let [from_a, from_b] = [a, b].map(|row| matrix_of_spice_quaternion(row.camera_to_mars));
    let turn = from_a.transpose() * from_b;
    let turn_rad = rotation_vector(&turn);
    let [about_x_arcsec, about_y_arcsec, about_z_arcsec] =
        (turn_rad / RADIANS_PER_ARCSECOND).into();
    let boresight_turn_rad = boresight(&turn).angle(&Vector3::z());
    let ground = |row: &SampleRow, camera_to_mars: &Matrix3<f64>| {
        let range_m = row.boresight_range_m?;
        Some(row.position.xyz_m + range_m * boresight(camera_to_mars))
    };
    let grounds = ground(a, &from_a).zip(ground(b, &from_b));
    SampleMovement {
        line_offset: a.line_offset,
        time_s: b.et.since(a.et),
        distance_m: moved_m.norm(),
        radial_m,
        along_m,
        cross_m,
        turn_arcsec: turn_rad.norm() / RADIANS_PER_ARCSECOND,
        about_x_arcsec,
        about_y_arcsec,
        about_z_arcsec,
        pointing_ground_m: a
            .boresight_range_m
            .map(|range_m| range_m * boresight_turn_rad),
        boresight_ground_m: grounds.map(|(ground_a, ground_b)| (ground_b - ground_a).norm()),
        grounds: grounds.map(<[_; 2]>::from),
    }
}

/// Direction of the camera's z axis under a matrix.
fn boresight(from_camera: &Matrix3<f64>) -> Vector3<f64> {
    from_camera.column(2).into_owned()
}

/// The three axes of the orbit at row `index`, as columns in Mars-fixed components; there are at least two rows.
///
/// The direction of flight is taken in inertial space: in the Mars-fixed frame, it would deviate by up to 4 degrees.
fn orbit_axes(body: Body, rows: &[SampleRow], index: usize) -> Matrix3<f64> {
    let inertial = |index: usize| {
        let row = &rows[index];
        body_rotation(body, row.et)
            .inverse()
            .apply(&row.position)
            .xyz_m
    };
    let flight = inertial((index + 1).min(rows.len() - 1)) - inertial(index.saturating_sub(1));
    body_rotation(body, rows[index].et).matrix() * radial_along_cross(&inertial(index), &flight)
}

#[cfg(test)]
mod tests {
    use super::*;
    use areograph_base::{frames::Position, time::Et};
    use areograph_geom::attitude::{matrix_of_rotation_vector, spice_quaternion};

    /// Samples at these lines of a camera over the equator that flies north in inertial space and looks down.
    fn rows(lines: &[f64]) -> Vec<SampleRow> {
        let down = Matrix3::from_columns(&[Vector3::z(), Vector3::y(), -Vector3::x()]);
        let sample = |line: &f64| {
            let et = Et::from_seconds(4e7 + 1e-3 * line);
            let angle_rad = 3_400.0 / 3.77e6 * 1e-3 * line;
            let inertial = 3.77e6 * Vector3::new(angle_rad.cos(), 0.0, angle_rad.sin());
            let to_mars = body_rotation(Body::Mars, et);
            SampleRow {
                et,
                line_offset: *line,
                position: Position::new(to_mars.matrix() * inertial),
                camera_to_mars: spice_quaternion(&(to_mars.matrix() * down)),
                boresight_range_m: Some(375e3),
            }
        };
        lines.iter().map(sample).collect()
    }

    #[test]
    fn samples_are_matched_by_line() {
        let (coarse, fine) = (
            rows(&[-10.0, 0.0, 10.0]),
            rows(&[-10.0, -5.0, 0.000_01, 5.0, 12.0]),
        );
        assert_eq!(matched(&coarse, &fine), [(0, 0), (1, 2)]);
        assert!(movement(Body::Mars, &coarse, &rows(&[1.0, 2.0]), &[]).is_none());
    }

    #[test]
    fn movements_are_stated_along_the_orbit_and_turns_about_the_camera() {
        let a = rows(&[-10.0, 0.0, 10.0]);
        let mut b = a.clone();
        // North is along the flight, up is radial; radial × along is west of a polar orbit flown north.
        let turn = 10.0 * RADIANS_PER_ARCSECOND * Vector3::new(2.0, -1.0, 5.0);
        for row in &mut b {
            let to_mars = *body_rotation(Body::Mars, row.et).matrix();
            row.position.xyz_m += to_mars * Vector3::new(3.0, 2.0, 1.0);
            let turned =
                matrix_of_spice_quaternion(row.camera_to_mars) * matrix_of_rotation_vector(&turn);
            row.camera_to_mars = spice_quaternion(&turned);
        }
        let movement = movement(Body::Mars, &a, &b, &[(0, 0), (1, 1), (2, 2)]).unwrap();
        let middle = movement.samples[1];
        // Coordinates are good to 1e-9 m; the chord over two neighbours is parallel to the flight.
        for (found, expected_m) in [
            (middle.radial_m, 3.0),
            (middle.along_m, 1.0),
            (middle.cross_m, -2.0),
        ] {
            assert!((found - expected_m).abs() < 1e-6, "{found} {expected_m} m");
        }
        // 1e-8 arcsec is rounding of the quaternions.
        for (found, expected_arcsec) in [
            (middle.about_x_arcsec, 20.0),
            (middle.about_y_arcsec, -10.0),
            (middle.about_z_arcsec, 50.0),
        ] {
            assert!(
                (found - expected_arcsec).abs() < 1e-6,
                "{found} {expected_arcsec} arcsec"
            );
        }
        // Only the turn about x and y moves the boresight: 22.4 arcsec at 375 km.
        let expected_m = 500_f64.sqrt() * RADIANS_PER_ARCSECOND * 375e3;
        let ground_m = middle.pointing_ground_m.unwrap();
        assert!((ground_m / expected_m - 1.0).abs() < 1e-6, "{ground_m} m"); // the sines of small angles
        assert!((movement.turn_arcsec.max - 3_000_f64.sqrt()).abs() < 1e-6);
    }
}
