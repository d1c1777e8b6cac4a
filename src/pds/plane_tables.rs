//! Tables of a net of rectified pictures: measurements, controls, pictures, ticks of the film.

use std::{fs, path::Path};

use crate::{
    error::{Cause, IoError, Kind, Locate, Result},
    geom::plane::{Place, box_centre},
    units::METRES_PER_KM,
};

/// Ticks at the corners of a picture, in the order in which [`TickRow::tick`] counts them.
pub const CORNER_TICKS: [&str; 4] = ["lower_left", "lower_right", "upper_right", "upper_left"];
/// Ticks at the middles of its edges, which follow.
pub const EDGE_TICKS: [&str; 4] = ["lower", "upper", "left", "right"];

/// A point in a picture.
#[derive(Debug, Clone, PartialEq)]
pub struct MeasurementRow {
    /// Name of the picture.
    pub picture: String,
    /// Name of the point.
    pub point: String,
    /// Where, in the units of the picture; of a boxed crater the middle.
    pub at: Place,
}

/// A point on the map.
#[derive(Debug, Clone, PartialEq)]
pub struct ControlRow {
    /// Name of the point.
    pub point: String,
    /// Where.
    pub at: ControlPlace,
    /// Standard deviation of a coordinate, metres.
    pub sigma_m: Option<f64>,
}

/// The place of a control as given.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ControlPlace {
    /// On the map, metres.
    Map(Place),
    /// East longitude and areocentric latitude, degrees.
    Sphere {
        /// East longitude.
        longitude_deg: f64,
        /// Areocentric latitude.
        latitude_deg: f64,
    },
}

/// A picture.
#[derive(Debug, Clone, PartialEq)]
pub struct PictureRow {
    /// Its name.
    pub picture: String,
    /// Name of its brick, empty where it is put into one by areograph.
    pub brick: String,
    /// Size of a unit on the ground.
    pub metres_per_unit: Option<f64>,
}

/// A tick of the film.
#[derive(Debug, Clone, PartialEq)]
pub struct TickRow {
    /// Name of the picture.
    pub picture: String,
    /// Index among [`CORNER_TICKS`], then [`EDGE_TICKS`].
    pub tick: usize,
    /// Measured place.
    pub measured: Place,
    /// Where it is known to be.
    pub known: Place,
}

/// Rows of a file, and what was not taken.
#[derive(Debug, Clone, PartialEq)]
pub struct Rows<T> {
    /// Rows in order.
    pub rows: Vec<T>,
    /// Rows that are not what they should be: line of the file from 1, and what was expected.
    pub complaints: Vec<(u64, String)>,
}

/// A file that is no such table.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
enum TableError {
    #[error("column {column} is missing; expected the columns {expected}")]
    Column {
        column: &'static str,
        expected: &'static str,
    },
    #[error("the unit of column {column} is not known; expected the columns {expected}")]
    Unit {
        column: String,
        expected: &'static str,
    },
    #[error("the table cannot be read: {0}")]
    Table(String),
    #[error("not one of its rows can be read ({rows} in all); line {line}: {text}")]
    Unreadable {
        rows: usize,
        line: u64,
        text: String,
    },
}

impl Cause for TableError {
    fn kind(&self) -> Kind {
        Kind::Input
    }

    fn advice(&self) -> String {
        match self {
            Self::Unit { .. } => "give the coordinates in one of these units, which the names of the columns tell",
            _ => "give a comma-separated table with a header line; config/nets/example.toml tells its columns",
        }
        .to_owned()
    }
}

/// Reads a table of measurements.
///
/// # Errors
/// The system's refusal to read; columns that are missing; a table of which no row can be read.
pub fn read_measurements(path: &Path) -> Result<Rows<MeasurementRow>> {
    const COLUMNS: &str =
        "picture, point, x, y or x_upper_right, y_upper_right, x_lower_left, y_lower_left";
    read(path, |header| {
        let [picture, point] = columns(header, ["picture", "point"], COLUMNS)?;
        let boxed = columns(
            header,
            [
                "x_upper_right",
                "y_upper_right",
                "x_lower_left",
                "y_lower_left",
            ],
            COLUMNS,
        );
        let places = match boxed {
            Ok(four) => four.to_vec(),
            Err(_) => columns(header, ["x", "y"], COLUMNS)?.to_vec(),
        };
        Ok(move |row: &csv::StringRecord| {
            let of: Vec<f64> = numbers(row, &places)?;
            let at = match of[..] {
                [x, y] => Place::new(x, y),
                [right, upper, left, lower] => {
                    box_centre(Place::new(right, upper), Place::new(left, lower))
                }
                _ => return Err("two or four coordinates".to_owned()),
            };
            Ok(MeasurementRow {
                picture: name(row, picture)?,
                point: name(row, point)?,
                at,
            })
        })
    })
}

/// Reads a table of controls.
///
/// # Errors
/// As [`read_measurements`]; coordinates in an unknown unit.
pub fn read_controls(path: &Path) -> Result<Rows<ControlRow>> {
    const COLUMNS: &str = "point and x_m, y_m or x_km, y_km or longitude_deg, latitude_deg";
    read(path, |header| {
        let [point] = columns(header, ["point"], COLUMNS)?;
        let pair = |names: [&'static str; 2]| columns(header, names, COLUMNS);
        let (places, unit_m) = if let Ok(places) = pair(["longitude_deg", "latitude_deg"]) {
            (places, None)
        } else if let Ok(places) = pair(["x_km", "y_km"]) {
            (places, Some(METRES_PER_KM))
        } else {
            let places = pair(["x_m", "y_m"]).map_err(|missing| {
                let unit =
                    |name: &&str| *name == "x" || name.starts_with("x_") || name.starts_with("lon");
                let odd = header.iter().find(unit).filter(|name| *name != "x_m");
                odd.map_or(missing, |column| TableError::Unit {
                    column: column.to_owned(),
                    expected: COLUMNS,
                })
            })?;
            (places, Some(1.0))
        };
        let sigma = [("sigma_m", 1.0), ("sigma_km", METRES_PER_KM)]
            .into_iter()
            .find_map(|(name, unit_m)| Some((header.iter().position(|of| of == name)?, unit_m)));
        Ok(move |row: &csv::StringRecord| {
            let of = numbers(row, &places)?;
            let at = match unit_m {
                Some(unit_m) => ControlPlace::Map(Place::new(of[0], of[1]) * unit_m),
                None if of[0] >= -180.0 && of[0] <= 360.0 && of[1].abs() <= 90.0 => {
                    ControlPlace::Sphere {
                        longitude_deg: of[0],
                        latitude_deg: of[1],
                    }
                }
                None => {
                    return Err(format!(
                        "longitude_deg {}, latitude_deg {}: expected -180 to 360 and -90 to 90 degrees",
                        of[0], of[1]
                    ));
                }
            };
            let sigma_m = match sigma {
                Some((column, unit_m)) if !row.get(column).unwrap_or_default().is_empty() => {
                    let sigma_m = numbers(row, &[column])?[0] * unit_m;
                    if !(sigma_m > 0.0) {
                        return Err("a standard deviation above 0".to_owned());
                    }
                    Some(sigma_m)
                }
                _ => None,
            };
            Ok(ControlRow {
                point: name(row, point)?,
                at,
                sigma_m,
            })
        })
    })
}

/// Reads a table of pictures.
///
/// # Errors
/// As [`read_measurements`].
pub fn read_pictures(path: &Path) -> Result<Rows<PictureRow>> {
    const COLUMNS: &str = "picture, and where known brick and metres_per_unit";
    read(path, |header| {
        let [picture] = columns(header, ["picture"], COLUMNS)?;
        let place = |name: &str| header.iter().position(|of| of == name);
        let (brick, size) = (place("brick"), place("metres_per_unit"));
        Ok(move |row: &csv::StringRecord| {
            let text =
                |column: Option<usize>| column.and_then(|at| row.get(at)).unwrap_or_default();
            let metres_per_unit = match size {
                Some(column) if !text(size).is_empty() => {
                    let found = numbers(row, &[column])?[0];
                    if !(found > 0.0) {
                        return Err("metres_per_unit above 0".to_owned());
                    }
                    Some(found)
                }
                _ => None,
            };
            Ok(PictureRow {
                picture: name(row, picture)?,
                brick: text(brick).to_owned(),
                metres_per_unit,
            })
        })
    })
}

/// Reads a table of ticks.
///
/// # Errors
/// As [`read_measurements`].
pub fn read_ticks(path: &Path) -> Result<Rows<TickRow>> {
    const COLUMNS: &str = "picture, tick, x, y, known_x, known_y";
    read(path, |header| {
        let [picture, tick] = columns(header, ["picture", "tick"], COLUMNS)?;
        let places = columns(header, ["x", "y", "known_x", "known_y"], COLUMNS)?;
        Ok(move |row: &csv::StringRecord| {
            let of = numbers(row, &places)?;
            let written = row.get(tick).unwrap_or_default();
            let mut known = CORNER_TICKS.iter().chain(&EDGE_TICKS);
            let index = known.position(|of| *of == written).ok_or_else(|| {
                let all = [CORNER_TICKS, EDGE_TICKS].concat().join(", ");
                format!("tick {written:?}: expected one of {all}")
            })?;
            Ok(TickRow {
                picture: name(row, picture)?,
                tick: index,
                measured: Place::new(of[0], of[1]),
                known: Place::new(of[2], of[3]),
            })
        })
    })
}

/// Reads a table whose rows `take`, made from the header, turns into values.
fn read<T, F>(
    path: &Path,
    take: impl Fn(&csv::StringRecord) -> std::result::Result<F, TableError>,
) -> Result<Rows<T>>
where
    F: Fn(&csv::StringRecord) -> std::result::Result<T, String>,
{
    let bytes = fs::read(path).map_err(IoError::on("read")).in_file(path)?;
    parse(&bytes, take).in_file(path)
}

fn parse<T, F>(
    bytes: &[u8],
    take: impl Fn(&csv::StringRecord) -> std::result::Result<F, TableError>,
) -> std::result::Result<Rows<T>, TableError>
where
    F: Fn(&csv::StringRecord) -> std::result::Result<T, String>,
{
    let mut reader = csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .comment(Some(b'#'))
        .from_reader(bytes);
    let header = reader
        .headers()
        .map_err(|error| TableError::Table(error.to_string()))?;
    let take = take(&header.clone())?;
    let (mut rows, mut complaints) = (Vec::new(), Vec::new());
    for record in reader.into_records() {
        let (line, taken) = match &record {
            Ok(record) => (record.position(), take(record)),
            Err(error) => (error.position(), Err(error.to_string())),
        };
        match taken {
            Ok(row) => rows.push(row),
            Err(text) => complaints.push((line.map_or(0, csv::Position::line), text)),
        }
    }
    match complaints.first() {
        Some((line, text)) if rows.is_empty() => Err(TableError::Unreadable {
            rows: complaints.len(),
            line: *line,
            text: text.clone(),
        }),
        _ => Ok(Rows { rows, complaints }),
    }
}

/// Where the header has these columns.
fn columns<const N: usize>(
    header: &csv::StringRecord,
    names: [&'static str; N],
    expected: &'static str,
) -> std::result::Result<[usize; N], TableError> {
    let mut places = [0; N];
    for (place, column) in places.iter_mut().zip(names) {
        let found = header.iter().position(|of| of == column);
        *place = found.ok_or(TableError::Column { column, expected })?;
    }
    Ok(places)
}

fn name(row: &csv::StringRecord, column: usize) -> std::result::Result<String, String> {
    match row.get(column) {
        Some(name) if !name.is_empty() => Ok(name.to_owned()),
        _ => Err("a picture and a point must have names".to_owned()),
    }
}

fn numbers(row: &csv::StringRecord, columns: &[usize]) -> std::result::Result<Vec<f64>, String> {
    let number = |column: &usize| {
        let text = row.get(*column).unwrap_or_default();
        let number = text.parse().ok().filter(|number: &f64| number.is_finite());
        number.ok_or_else(|| format!("{text:?} is no number"))
    };
    columns.iter().map(number).collect()
}
