//! Tables of points, assembled by point and camera.

use std::{
    collections::{BTreeMap, BTreeSet},
    path::{Path, PathBuf},
};

use nalgebra::{Matrix3, Vector3};

use super::error::CalibrateError;
use areograph_base::{
    error::{Locate as _, Result},
    units::RADIANS_PER_DEGREE,
};
use areograph_geom::{
    calibration::{KnownPlace, SharedError},
    ellipsoid::{local_axes, spherical_to_xyz_m},
};
use areograph_pds::{
    calibration_tables::{ControlRow, ImageRow, read_control, read_ties},
    table_rows::Rows,
};
use areograph_store::files::file_name;

/// Maximum number of complaints that are kept with their text; all are counted.
const COMPLAINTS_MAX: usize = 1_000;

/// Minimum distance of different laser shots, metres: they are hundreds of metres apart.
const SAME_PLACE_M: f64 = 1.0;

/// Rows and points that were left out, in words.
#[derive(Default)]
pub(super) struct Complaints {
    pub(super) texts: Vec<String>,
    pub(super) count: u64,
}

impl Complaints {
    pub(super) fn tell(&mut self, text: String) {
        self.count += 1;
        if self.texts.len() < COMPLAINTS_MAX {
            self.texts.push(text);
        }
    }

    fn take<T>(&mut self, path: &Path, table: Rows<T>) -> Vec<T> {
        for (line, text) in table.complaints {
            self.tell(format!("{} line {line}: {text}", file_name(path)));
        }
        table.rows
    }
}

/// A place in an image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Measured {
    pub(super) camera: usize,
    /// Line and sample.
    pub(super) place: [f64; 2],
    /// Their standard deviations, pixels.
    pub(super) sigma_px: [f64; 2],
}

/// A point with its places in images, in the order of the cameras.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct MeasuredPoint {
    pub(super) name: String,
    pub(super) measured: Vec<Measured>,
    pub(super) known: Option<KnownPlace>,
}

/// The cameras of an orbit for its tables.
pub(super) struct Cameras<'a> {
    pub(super) names: &'a [String],
    /// Lines and samples of their images.
    pub(super) sizes: &'a [[f64; 2]],
}

impl Cameras<'_> {
    /// The measurement in a row of a table, or why it is not inside the image.
    fn measured(
        &self,
        row: &ImageRow,
        sigma_px: f64,
    ) -> std::result::Result<std::result::Result<Measured, String>, CalibrateError> {
        let camera = self.names.iter().position(|name| *name == row.camera);
        let camera = camera.ok_or_else(|| CalibrateError::UnknownCamera {
            point: row.point.clone(),
            camera: row.camera.clone(),
            expected: self.names.join(", "),
        })?;
        let place = [row.line, row.sample];
        let inside = place
            .iter()
            .zip(self.sizes[camera])
            .all(|(at, size)| (0.0..=size).contains(at));
        Ok(if inside {
            Ok(Measured {
                camera,
                place,
                sigma_px: row.sigma_px.map(|sigma| sigma.unwrap_or(sigma_px)),
            })
        } else {
            let [lines, samples] = self.sizes[camera];
            Err(format!(
                "point {} is at line {}, sample {} of camera {}; expected a position within its {lines} lines and \
                 {samples} samples",
                row.point, row.line, row.sample, row.camera
            ))
        })
    }
}

/// Points in the order of their first row.
#[derive(Default)]
struct Points {
    points: Vec<MeasuredPoint>,
    index: BTreeMap<String, usize>,
    seen: BTreeSet<(usize, usize)>,
}

impl Points {
    fn add(&mut self, name: &str, measured: Measured) -> (usize, bool) {
        let next = self.points.len();
        let at = *self.index.entry(name.to_owned()).or_insert(next);
        if at == next {
            self.points.push(MeasuredPoint {
                name: name.to_owned(),
                measured: Vec::new(),
                known: None,
            });
        }
        let new = self.seen.insert((at, measured.camera));
        if new {
            self.points[at].measured.push(measured);
            self.points[at].measured.sort_by_key(|of| of.camera);
        }
        (at, new)
    }
}

fn twice(row: &ImageRow) -> String {
    format!(
        "point {} occurs twice in camera {}; the first is used",
        row.point, row.camera
    )
}

/// The tie points of tables that are in two cameras or more.
pub(super) fn ties(
    files: &[PathBuf],
    sigma_px: f64,
    cameras: &Cameras<'_>,
    complaints: &mut Complaints,
) -> Result<Vec<MeasuredPoint>> {
    let mut points = Points::default();
    for path in files {
        for row in complaints.take(path, read_ties(path)?) {
            match cameras.measured(&row, sigma_px).in_file(path)? {
                Err(outside) => complaints.tell(format!("{}: {outside}", file_name(path))),
                Ok(measured) => {
                    if !points.add(&row.point, measured).1 {
                        complaints.tell(format!("{}: {}", file_name(path), twice(&row)));
                    }
                }
            }
        }
    }
    let alone = |point: &MeasuredPoint| point.measured.len() < 2;
    for point in points.points.iter().filter(|point| alone(point)) {
        complaints.tell(format!("tie point {} is in one camera only", point.name));
    }
    points.points.retain(|point| !alone(point));
    Ok(points.points)
}

/// Standard deviations for rows that state no values.
#[derive(Clone, Copy)]
pub(super) struct ControlSigma {
    pub(super) image_px: f64,
    pub(super) horizontal_m: f64,
    pub(super) vertical_m: f64,
}

/// The control points of tables.
pub(super) fn control(
    files: &[PathBuf],
    sigma: ControlSigma,
    cameras: &Cameras<'_>,
    complaints: &mut Complaints,
) -> Result<Vec<MeasuredPoint>> {
    let mut points = Points::default();
    let mut profiles: BTreeMap<String, usize> = BTreeMap::new();
    for path in files {
        for row in complaints.take(path, read_control(path)?) {
            let measured = cameras.measured(&row.image, sigma.image_px).in_file(path)?;
            let measured = match measured {
                Ok(measured) => measured,
                Err(outside) => {
                    complaints.tell(format!("{}: {outside}", file_name(path)));
                    continue;
                }
            };
            let (at, new) = points.add(&row.image.point, measured);
            if !new {
                complaints.tell(format!("{}: {}", file_name(path), twice(&row.image)));
            }
            let mut known = known(&row, sigma);
            let next = profiles.len();
            known.shared = row.profile.map(|profile| SharedError {
                group: *profiles.entry(profile).or_insert(next),
                sigma_m: row.shared_m.map(Option::unwrap_or_default),
            });
            let point = &mut points.points[at];
            if point.known.is_some_and(|of| of.place_m != known.place_m) {
                return Err(CalibrateError::TwoPlaces {
                    point: row.image.point,
                })
                .in_file(path);
            }
            point.known = Some(known);
        }
    }
    let mut points = points.points;
    let repeated = repeated(&points);
    for (point, first) in &repeated {
        complaints.tell(format!(
            "control point {} is less than {SAME_PLACE_M} m from control point {} and duplicates it; rejected",
            points[*point].name, points[*first].name
        ));
    }
    let mut index = 0..;
    points.retain(|_| {
        index
            .next()
            .is_none_or(|index| !repeated.contains_key(&index))
    });
    Ok(points)
}

/// Points at the position of an earlier one, paired with it: if one were withheld, it would validate a result of the
/// other.
fn repeated(points: &[MeasuredPoint]) -> BTreeMap<usize, usize> {
    let places = points.iter().enumerate();
    let mut places: Vec<(usize, Vector3<f64>)> = places
        .filter_map(|(index, point)| point.known.map(|known| (index, known.place_m)))
        .collect();
    places.sort_by(|(_, a), (_, b)| a.z.total_cmp(&b.z));
    let mut repeated = BTreeMap::new();
    for (at, (one, one_m)) in places.iter().enumerate() {
        let near = places[at + 1..].iter();
        for (other, other_m) in near.take_while(|(_, of)| of.z - one_m.z < SAME_PLACE_M) {
            if (other_m - one_m).norm() < SAME_PLACE_M {
                let first = repeated.entry(*one.max(other)).or_insert(usize::MAX);
                *first = (*first).min(*one.min(other));
            }
        }
    }
    repeated
}

fn known(row: &ControlRow, sigma: ControlSigma) -> KnownPlace {
    let place_m = spherical_to_xyz_m(
        row.longitude_deg * RADIANS_PER_DEGREE,
        row.latitude_deg * RADIANS_PER_DEGREE,
        row.radius_m,
    );
    let laser_m = [sigma.horizontal_m, sigma.vertical_m];
    let sigma_m = [0, 1].map(|axis| {
        let laser_m = row.sigma_m[axis].unwrap_or(laser_m[axis]);
        laser_m.hypot(row.matching_m[axis].unwrap_or_default())
    });
    known_place(place_m, sigma_m)
}

/// A place with its standard deviations in plan and in height, metres.
pub(super) fn known_place(
    place_m: Vector3<f64>,
    [horizontal_m, vertical_m]: [f64; 2],
) -> KnownPlace {
    let over = Vector3::new(horizontal_m, horizontal_m, vertical_m).map(f64::recip);
    KnownPlace {
        place_m,
        whitening: Matrix3::from_diagonal(&over) * local_axes(&place_m),
        shared: None,
    }
}
