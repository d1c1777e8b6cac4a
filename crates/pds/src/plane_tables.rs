//! Tables of a net of rectified pictures: measurements, controls, pictures, film ticks.

use std::path::Path;

use super::table_rows::{Rows, TableError, columns, name, numbers, read_rows};
use areograph_base::{error::Result, units::METRES_PER_KM};
use areograph_geom::plane::{Place, box_centre};

/// File that describes the columns.
const EXAMPLE: &str = "config/nets/example.toml";
/// Names required in every row.
const NAMED: &str = "a picture and a point must have names";

/// Ticks at the corners of a picture, in the order in which [`TickRow::tick`] counts them.
pub const CORNER_TICKS: [&str; 4] = ["lower_left", "lower_right", "upper_right", "upper_left"];
/// Ticks at the middles of its edges, counted after the corners.
pub const EDGE_TICKS: [&str; 4] = ["lower", "upper", "left", "right"];

/// A point in a picture.
#[derive(Debug, Clone, PartialEq)]
pub struct MeasurementRow {
    /// Name of the picture.
    pub picture: String,
    /// Name of the point.
    pub point: String,
    /// Position, in the units of the picture; the middle of a boxed crater.
    pub at: Place,
}

/// A point on the map.
#[derive(Debug, Clone, PartialEq)]
pub struct ControlRow {
    /// Name of the point.
    pub point: String,
    /// Its position.
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
    /// Name of its brick; empty where areograph assigns it.
    pub brick: String,
    /// Size of a unit on the ground.
    pub metres_per_unit: Option<f64>,
    /// Its pixels, where there are some.
    pub image: Option<ImageOfPicture>,
}

/// The pixels of a picture, and where they lie in its coordinates.
#[derive(Debug, Clone, PartialEq)]
pub struct ImageOfPicture {
    /// Path of the file, as the table states it.
    pub file: String,
    /// Coordinates of the outer corner of its first pixel; `None` for a corner of the image at the origin.
    pub corner: Option<Place>,
    /// Edge of a pixel, units of the picture.
    pub pixel_units: f64,
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
    /// Known place.
    pub known: Place,
}

/// Reads a table of measurements.
///
/// # Errors
/// The file cannot be read; missing columns; a table without a readable row.
pub fn read_measurements(path: &Path) -> Result<Rows<MeasurementRow>> {
    const COLUMNS: &str = "picture and point, with x and y, or with x_upper_right, y_upper_right, x_lower_left and \
        y_lower_left";
    read_rows(path, EXAMPLE, |header| {
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
            let values: Vec<f64> = numbers(row, &places)?;
            let at = match values[..] {
                [x, y] => Place::new(x, y),
                [right, upper, left, lower] => {
                    box_centre(Place::new(right, upper), Place::new(left, lower))
                }
                _ => return Err("two or four coordinates".to_owned()),
            };
            Ok(MeasurementRow {
                picture: name(row, picture, NAMED)?,
                point: name(row, point, NAMED)?,
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
    const COLUMNS: &str =
        "point, with x_m and y_m, x_km and y_km, or longitude_deg and latitude_deg";
    read_rows(path, EXAMPLE, |header| {
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
            .find_map(|(name, unit_m)| {
                Some((
                    header.iter().position(|column_name| column_name == name)?,
                    unit_m,
                ))
            });
        Ok(move |row: &csv::StringRecord| {
            let values = numbers(row, &places)?;
            let at = match unit_m {
                Some(unit_m) => ControlPlace::Map(Place::new(values[0], values[1]) * unit_m),
                None if values[0] >= -180.0 && values[0] <= 360.0 && values[1].abs() <= 90.0 => {
                    ControlPlace::Sphere {
                        longitude_deg: values[0],
                        latitude_deg: values[1],
                    }
                }
                None => {
                    return Err(format!(
                        "longitude_deg {}, latitude_deg {}: expected -180 to 360 and -90 to 90 degrees",
                        values[0], values[1]
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
                point: name(row, point, NAMED)?,
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
    const COLUMNS: &str =
        "picture, and optionally brick, metres_per_unit, image, image_x, image_y and pixel_units";
    read_rows(path, EXAMPLE, |header| {
        let [picture] = columns(header, ["picture"], COLUMNS)?;
        let place = |name: &str| header.iter().position(|column_name| column_name == name);
        let (brick, size) = (place("brick"), place("metres_per_unit"));
        let image = place("image");
        let of_image = ["image_x", "image_y", "pixel_units"].map(place);
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
            let number = |column: Option<usize>| {
                let column = column.filter(|_| !text(column).is_empty());
                let found = column.map(|column| numbers(row, &[column]));
                Ok::<_, String>(found.transpose()?.map(|found| found[0]))
            };
            let [x, y, pixel_units] = of_image;
            let corner = match (number(x)?, number(y)?) {
                (Some(x), Some(y)) => Some(Place::new(x, y)),
                (None, None) => None,
                _ => return Err("both image_x and image_y, or neither".to_owned()),
            };
            let pixel_units = number(pixel_units)?.unwrap_or(1.0);
            if !(pixel_units > 0.0) {
                return Err("pixel_units above 0".to_owned());
            }
            let file = text(image);
            Ok(PictureRow {
                picture: name(row, picture, NAMED)?,
                brick: text(brick).to_owned(),
                metres_per_unit,
                image: (!file.is_empty()).then(|| ImageOfPicture {
                    file: file.to_owned(),
                    corner,
                    pixel_units,
                }),
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
    read_rows(path, EXAMPLE, |header| {
        let [picture, tick] = columns(header, ["picture", "tick"], COLUMNS)?;
        let places = columns(header, ["x", "y", "known_x", "known_y"], COLUMNS)?;
        Ok(move |row: &csv::StringRecord| {
            let values = numbers(row, &places)?;
            let written = row.get(tick).unwrap_or_default();
            let mut known = CORNER_TICKS.iter().chain(&EDGE_TICKS);
            let index = known.position(|known| *known == written).ok_or_else(|| {
                let all = [CORNER_TICKS, EDGE_TICKS].concat().join(", ");
                format!("tick {written:?}: expected one of {all}")
            })?;
            Ok(TickRow {
                picture: name(row, picture, NAMED)?,
                tick: index,
                measured: Place::new(values[0], values[1]),
                known: Place::new(values[2], values[3]),
            })
        })
    })
}
