//! The tables of a net, its names turned into indices and its film corrected.

use std::{
    collections::{BTreeMap, BTreeSet},
    path::Path,
};

use super::error::{NetError, film};
use areograph_base::{
    error::{Locate as _, Result},
    units::RADIANS_PER_DEGREE,
};
use areograph_config::{NetConfig, YAxis};
use areograph_geom::plane::{Control, CornerZero, FourCorners, Measurement, Net, Place};
use areograph_pds::{
    plane_tables::{
        CORNER_TICKS, ControlPlace, EDGE_TICKS, PictureRow, TickRow, read_controls,
        read_measurements, read_pictures, read_ticks,
    },
    table_rows::Rows,
};
use areograph_store::files::file_name;

/// Maximum number of complaints that are kept with their text; all are counted.
const COMPLAINTS_MAX: usize = 1_000;

/// A net as read from its tables.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct NetData {
    /// Names of the pictures, in the order of their first measurement.
    pub pictures: Vec<String>,
    /// Names of the points, in the order of their first measurement.
    pub points: Vec<String>,
    /// Name of the brick of every picture, empty where the table has no name.
    pub bricks: Vec<String>,
    /// Size of a unit of every picture on the ground, where it is known.
    pub metres_per_unit: Vec<Option<f64>>,
    /// Measurements, y upwards, film corrected; controls with weight 1, metres on the map.
    pub net: Net,
    /// Standard deviation of every control, where the table has one, metres.
    pub control_sigma_m: Vec<Option<f64>>,
    /// Rows that were left out, one sentence each; at most 1000 are kept.
    pub complaints: Vec<String>,
    /// Number of all complaints.
    pub complaint_count: u64,
    /// Remarks for the reader, one sentence each.
    pub remarks: Vec<String>,
}

/// Reads the tables of a net.
///
/// # Errors
/// A table that cannot be read; [`NetError`] for a net without measurements, controls off the map and ticks that give
/// no correction.
pub fn read_net(config: &NetConfig) -> Result<NetData> {
    let mut data = NetData::default();
    let mut index = Index::default();
    let films = films(config, &mut data)?;
    for path in &config.measurements.files {
        let rows = data.take(path, read_measurements(path)?);
        for row in rows {
            let corrected = match films.get(&row.picture) {
                Some(film) => film.correct(row.at),
                None if films.is_empty() => row.at,
                None => {
                    let picture = row.picture;
                    return Err(NetError::NoTicks { picture }).in_file(path);
                }
            };
            let at = match config.measurements.y_axis {
                YAxis::Up => corrected,
                YAxis::Down => corrected.conj(),
            };
            let picture = index.picture(&row.picture, &mut data);
            let point = index.point(&row.point, &mut data);
            if index.measured.insert((picture, point)) {
                data.net
                    .measurements
                    .push(Measurement { picture, point, at });
            } else {
                let text = format!(
                    "point {} is measured twice in picture {}",
                    row.point, row.picture
                );
                data.complain(format!("{}: {text}; the first is used", file_name(path)));
            }
        }
    }
    if data.net.measurements.is_empty() {
        return Err(NetError::NoMeasurement.into());
    }
    read_pictures_of(config, &index, &mut data)?;
    read_controls_of(config, &index, &mut data)?;
    data.net.pictures = data.pictures.len();
    data.net.points = data.points.len();
    Ok(data)
}

/// Names read so far.
#[derive(Default)]
struct Index {
    pictures: BTreeMap<String, usize>,
    points: BTreeMap<String, usize>,
    measured: BTreeSet<(usize, usize)>,
}

impl Index {
    fn picture(&mut self, name: &str, data: &mut NetData) -> usize {
        if let Some(index) = self.pictures.get(name) {
            return *index;
        }
        let index = data.pictures.len();
        self.pictures.insert(name.to_owned(), index);
        data.pictures.push(name.to_owned());
        data.bricks.push(String::new());
        data.metres_per_unit.push(None);
        index
    }

    fn point(&mut self, name: &str, data: &mut NetData) -> usize {
        if let Some(index) = self.points.get(name) {
            return *index;
        }
        let index = data.points.len();
        self.points.insert(name.to_owned(), index);
        data.points.push(name.to_owned());
        index
    }
}

impl NetData {
    fn complain(&mut self, text: String) {
        self.complaint_count += 1;
        if self.complaints.len() < COMPLAINTS_MAX {
            self.complaints.push(text);
        }
    }

    /// The rows of a table; skipped rows become complaints.
    fn take<T>(&mut self, path: &Path, table: Rows<T>) -> Vec<T> {
        for (line, text) in table.complaints {
            self.complain(format!("{} line {line}: {text}", file_name(path)));
        }
        table.rows
    }
}

fn read_pictures_of(config: &NetConfig, index: &Index, data: &mut NetData) -> Result<()> {
    let mut unmeasured = Vec::new();
    for path in &config.pictures.files {
        for row in data.take(path, read_pictures(path)?) {
            let PictureRow {
                picture,
                brick,
                metres_per_unit,
                ..
            } = row;
            if let Some(&at) = index.pictures.get(&picture) {
                data.bricks[at] = brick;
                data.metres_per_unit[at] = metres_per_unit;
            } else {
                unmeasured.push(picture);
            }
        }
    }
    if let Some(first) = unmeasured.first() {
        let text = format!(
            "{} pictures have no measurements, for example {first}",
            unmeasured.len()
        );
        data.remarks.push(text);
    }
    Ok(())
}

fn read_controls_of(config: &NetConfig, index: &Index, data: &mut NetData) -> Result<()> {
    let map = &config.map.map;
    // Half way round the sphere at the equator of Mercator's map; on a stereographic one the scale is 3.5 there.
    let limit_m = std::f64::consts::PI * map.radius_m;
    let (mut given, mut unseen) = (BTreeSet::new(), Vec::new());
    for path in &config.controls.files {
        for row in data.take(path, read_controls(path)?) {
            let at = match row.at {
                ControlPlace::Map(at) => at,
                ControlPlace::Sphere {
                    longitude_deg,
                    latitude_deg,
                } => {
                    let [longitude, latitude] =
                        [longitude_deg, latitude_deg].map(|degrees| degrees * RADIANS_PER_DEGREE);
                    let place = map.project(longitude, latitude);
                    let (x, y) = place.ok_or_else(|| NetError::NotOnTheMap {
                        point: row.point.clone(),
                    })?;
                    Place::new(x, y)
                }
            };
            if at.re.abs() > limit_m || at.im.abs() > limit_m {
                return Err(NetError::BeyondTheMap {
                    point: row.point,
                    x_m: at.re,
                    y_m: at.im,
                    limit_m,
                }
                .into());
            }
            let Some(&point) = index.points.get(&row.point) else {
                unseen.push(row.point);
                continue;
            };
            if !given.insert(point) {
                let text = format!("control {} is given twice; the first is used", row.point);
                data.complain(format!("{}: {text}", file_name(path)));
                continue;
            }
            let weight = 1.0;
            data.net.controls.push(Control { point, at, weight });
            data.control_sigma_m.push(row.sigma_m);
        }
    }
    if let Some(first) = unseen.first() {
        let text = format!(
            "{} controls are not measured in any picture, for example {first}",
            unseen.len()
        );
        data.remarks.push(text);
    }
    Ok(())
}

/// The correction of one picture's film.
struct Film {
    corners: FourCorners,
    bend: Option<CornerZero>,
}

impl Film {
    fn correct(&self, measured: Place) -> Place {
        let seen = self.corners.correct(measured);
        self.bend.map_or(seen, |bend| bend.correct(seen))
    }
}

/// The corrections of all pictures with ticks.
fn films(config: &NetConfig, data: &mut NetData) -> Result<BTreeMap<String, Film>> {
    let mut ticks: BTreeMap<String, (&Path, Vec<TickRow>)> = BTreeMap::new();
    let mut skipped: BTreeMap<&Path, String> = BTreeMap::new();
    for path in &config.film.files {
        let table = read_ticks(path)?;
        if let Some((line, text)) = table.complaints.first() {
            skipped.insert(path, format!("; line {line} was skipped: {text}"));
        }
        for row in data.take(path, table) {
            let of_picture = ticks.entry(row.picture.clone());
            let (_, rows) = of_picture.or_insert_with(|| (path, Vec::new()));
            rows.push(row);
        }
    }
    let films = ticks.into_iter().map(|(picture, (path, ticks))| {
        let skipped = skipped.get(path).map_or("", String::as_str);
        let film = film_of(&picture, &ticks, skipped).in_file(path)?;
        Ok((picture, film))
    });
    films.collect()
}

/// The correction of a picture by its ticks, each given once; `skipped` describes rows that could not be read.
fn film_of(picture: &str, ticks: &[TickRow], skipped: &str) -> std::result::Result<Film, NetError> {
    let tick = |index: usize| {
        let problem = |what: &str| NetError::Film {
            picture: picture.to_owned(),
            problem: format!("tick {} {what}", [CORNER_TICKS, EDGE_TICKS].concat()[index]),
        };
        let mut found = ticks.iter().filter(|tick| tick.tick == index);
        match (found.next(), found.next()) {
            (Some(tick), None) => Ok(tick),
            (Some(_), Some(_)) => Err(problem("has two rows")),
            (None, _) => Err(problem(&format!("is missing{skipped}"))),
        }
    };
    let corners = [tick(0)?, tick(1)?, tick(2)?, tick(3)?];
    let known = corners.map(|tick| tick.known);
    let mapping = FourCorners::new(&corners.map(|tick| tick.measured), &known)
        .map_err(|problem| film(picture, problem))?;
    let bend = if ticks.iter().any(|tick| tick.tick >= 4) {
        let [lower, upper, left, right] = [tick(4)?, tick(5)?, tick(6)?, tick(7)?];
        let rest = |tick: &TickRow| mapping.correct(tick.measured) - tick.known;
        let size = known[2] - known[0];
        let rests = [
            [rest(lower).re, rest(upper).re],
            [rest(left).im, rest(right).im],
        ];
        let bend = CornerZero::new(known[0], size.re, size.im, rests);
        Some(bend.map_err(|problem| film(picture, problem))?)
    } else {
        None
    };
    Ok(Film {
        corners: mapping,
        bend,
    })
}
