//! The configuration of a net of rectified pictures: `areograph triangulate`.

use std::{collections::BTreeMap, path::PathBuf};

use serde::Serialize;

use areograph_base::{body::MARS_IAU2000, units::RADIANS_PER_DEGREE};
use areograph_geom::conformal_map::{ConformalMap, Projection};

use super::{
    declare::{Declare as _, Keys, declare_table, group, key, of_the_file, table},
    document::{Document, with_file},
    forms::{above_to, any_text, from_to, lower_case_identifier, whole_from_to, words, yes_or_no},
    paths::Globs,
};

declare_table! {
    /// Everything that `areograph triangulate` needs to know about a net: every value checked, metres and radians
    /// inside.
    pub struct NetConfig {
        /// Identifier of the net, and name of its products folder.
        net: String = key(lower_case_identifier()).required().example(r#""tertiary""#),
        /// Free text for the report.
        description: String = key(any_text()).or(String::new())
            .example(r#""Viking pictures of Arthur & McMacken 1977, tertiary net""#),
        /// The file it was read from.
        file: PathBuf = of_the_file(),
        /// BLAKE3, hexadecimal, of the keys and values as written.
        blake3: String = of_the_file(),
        /// The same keys and values one by one.
        keys: BTreeMap<String, String> = of_the_file(),
        /// Points in pictures.
        measurements: MeasurementsConfig = table(),
        /// Points on the map.
        controls: ControlsConfig = table(),
        /// Pictures; empty without a table of them.
        pictures: PicturesConfig = table(),
        /// Corrections of the film.
        film: FilmConfig = table(),
        /// The map.
        map: MapConfig = table(),
        /// Solution of the net.
        triangulation: TriangulationConfig = table(),
    }
    check across_tables
}

impl Document for NetConfig {
    const EXAMPLE: &'static str = "config/nets/example.toml";
    const HEADER: &'static str = "\
# Net of rectified pictures for `areograph triangulate`: every key with its unit, range and default.
#
# Only `net`, [measurements] and [controls] are required; an omitted key has the default given here.
# Relative paths are relative to the folder of this file. Schema: ../schema/net.schema.json

";
    const SCHEMA: [&'static str; 2] = [
        "Net of rectified pictures for areograph",
        "The TOML file of one net as JSON. areograph checks more than a schema can: the existence of files and the \
         agreement between keys.",
    ];

    with_file!();
}

/// Required entries, and entries that are never used.
fn across_tables(net: &NetConfig, keys: &mut Keys<'_, '_>) {
    keys.rule(|| serde_json::json!({"required": ["measurements", "controls"]}));
    for (name, files) in [
        ("measurements", &net.measurements.files),
        ("controls", &net.controls.files),
    ] {
        if files.is_empty() && keys.span_of(name).is_none() {
            keys.missing(name, &format!("a table {name} with files"));
        }
    }
}

declare_table! {
    /// Points in pictures.
    pub struct MeasurementsConfig {
        /// Paths or globs of tables (.csv), one row per measurement: `picture`, `point`, `x`, `y`; y increases upwards
        /// as on a map, unless `y_axis` is "down". A crater enclosed by two settings of a cross has `x_upper_right`,
        /// `y_upper_right`, `x_lower_left`, `y_lower_left` instead of `x`, `y`. Each picture may have its own units.
        #[serde(skip)]
        files: Vec<PathBuf> = key(Globs(&["csv"]))
            .required_as("paths or globs of tables of measurements")
            .example(r#"["measurements.csv"]"#),
        /// Direction of y in all pictures.
        y_axis: YAxis = key(words([
            ("up", YAxis::Up, "as on a map"),
            ("down", YAxis::Down, "like image lines"),
        ])).or(YAxis::Up),
    }
}

/// Direction of y.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum YAxis {
    /// As on a map.
    Up,
    /// As lines of an image.
    Down,
}

declare_table! {
    /// Points with known positions.
    pub struct ControlsConfig {
        /// Paths or globs of tables (.csv), one row per control: `point` with map coordinates (`x_m`, `y_m` or `x_km`,
        /// `y_km`) or with `longitude_deg` (east) and `latitude_deg` (areocentric); `sigma_m` or `sigma_km` for a
        /// control with an individual standard deviation.
        #[serde(skip)]
        files: Vec<PathBuf> = key(Globs(&["csv"]))
            .required_as("paths or globs of tables of controls")
            .example(r#"["controls.csv"]"#),
        /// Standard deviation of a control coordinate, including the uncertainty of its measurement in the pictures, if
        /// missing from the table. Without this key, this standard deviation is estimated from the residuals of SCALE
        /// at the controls.
        sigma_m: Option<f64> = key(above_to(0.0, 1e7)).unused("2000.0"),
        /// Residual, in standard deviations of SCALE, beyond which a control is rejected. Two blunders that mask each
        /// other are also detected, by least median of squares; fewer than five controls cannot be tested.
        limit: f64 = key(from_to(2.5, 1e6)).or(4.0),
    }
}

declare_table! {
    /// A priori data of the pictures. Without this table, the measurements define the pictures.
    pub struct PicturesConfig {
        /// Paths or globs of tables (.csv), one row per picture: `picture` and, where known, `brick` (name of the
        /// brick) and `metres_per_unit` (size of a coordinate unit on the ground). This size tests the scale of the
        /// controls: if the adjusted size differs by more than 2 %, the net is invalid. Pictures with an `image` (path of a
        /// file relative to the table: PNG, TIFF, ISIS cube, or archived image) form a mosaic on the map. `image_x` and `image_y` are the coordinates of the
        /// outer corner of its first pixel, the upper left one, in the coordinates of the measurements; `pixel_units` is the edge of a pixel in their units (default
        /// 1). Without `image_x` and `image_y`, the lower left corner of the image (the upper left one if `y_axis` is "down")
        /// is the origin.
        #[serde(skip)]
        files: Vec<PathBuf> = key(Globs(&["csv"])).or(Vec::new()).unused(r#"["pictures.csv"]"#),
    }
}

declare_table! {
    /// Film corrections, applied before all other steps.
    pub struct FilmConfig {
        /// Paths or globs of tables (.csv) of ticks, one row per tick: `picture`, `tick`, measured `x`, `y`, known
        /// `known_x`, `known_y`. The ticks `upper_left`, `upper_right`, `lower_left` and `lower_right` permit linear
        /// double interpolation (drum scanners). With `upper`, `lower`, `left` and `right`, the middles of the edges, a
        /// quadratic term that is 0 at the corners is added (cathode-ray recorders).
        #[serde(skip)]
        files: Vec<PathBuf> = key(Globs(&["csv"])).or(Vec::new()).unused(r#"["ticks.csv"]"#),
    }
}

declare_table! {
    /// Map: pictures are fitted by similarity transformations to a conformal projection of a sphere.
    pub struct MapConfig {
        /// The projection.
        map: ConformalMap = group::<MapKeys>().map(MapKeys::map),
        /// Edge of a cell of the mosaic on the map. The default is the median size of the pixels of the images on the map.
        #[serde(skip)]
        cell_m: Option<f64> = key(above_to(0.0, 1e7)).unused("100.0"),
    }
}

declare_table! {
    /// Map: pictures are fitted by similarity transformations to a conformal projection of a sphere.
    struct MapKeys {
        /// The projection.
        projection: Projection = key(words([
            ("mercator", Projection::Mercator, "as in Arthur & McMacken 1977; away from the poles"),
            ("stereographic", Projection::Stereographic, "centred on any point"),
        ])).or(Projection::Mercator),
        /// East longitude of the central meridian (Mercator) or of the projection centre (stereographic).
        longitude_rad as "longitude_deg": f64 =
            key(from_to(-180.0, 360.0)).or(0.0).map(|degrees| degrees * RADIANS_PER_DEGREE),
        /// Areocentric latitude of true scale (Mercator) or of the projection centre (stereographic).
        latitude_rad as "latitude_deg": f64 =
            key(from_to(-90.0, 90.0)).or(0.0).map(|degrees| degrees * RADIANS_PER_DEGREE),
        /// Radius of the sphere. The default is the equatorial radius of the IAU 2000 ellipsoid.
        radius_m: f64 = key(above_to(0.0, 1e9)).or(MARS_IAU2000.equatorial_radius_m),
    }
    check mercator_has_an_equator
}

impl MapKeys {
    fn map(self) -> ConformalMap {
        ConformalMap {
            projection: self.projection,
            longitude_rad: self.longitude_rad,
            latitude_rad: self.latitude_rad,
            radius_m: self.radius_m,
        }
    }
}

fn mercator_has_an_equator(map: &MapKeys, keys: &mut Keys<'_, '_>) {
    if map.projection == Projection::Mercator && map.latitude_rad.cos() < 1e-3 {
        keys.refuse(
            "latitude_deg",
            "a latitude away from the poles, or the stereographic projection",
        );
    }
}

declare_table! {
    /// Solution of the net, after the programs of Arthur & McMacken 1977.
    pub struct TriangulationConfig {
        /// Method that positions the pictures on the map.
        method: Method = key(words([
            ("scale", Method::Scale, "BRICK, EXTEND, SCALE: bricks keep their shapes, which may be distorted where \
                ties are few"),
            ("mortar", Method::Mortar, "BRICK, EXTEND, MORTAR, SCALE: weighted adaptation of bricks to the controls"),
            ("one_shot", Method::OneShot, "weighted adjustment of all pictures and controls at once"),
        ])).or(Method::OneShot),
        /// Whether LOCAL evens out the seams between bricks afterwards.
        local: bool = key(yes_or_no("seams remain unchanged", "pictures of a brick adapt to neighbouring bricks")).or(false),
        /// Number of pictures in a brick, if the table of pictures names no bricks.
        brick_pictures: u32 = key(whole_from_to(2, 100)).or(8),
        /// Treatment of blunders: measurements whose standardised deviation in the adjustment of the whole net exceeds
        /// a limit. In one of a hundred nets without blunders, the largest deviation exceeds this limit by chance.
        blunders: Blunders = key(words([
            ("remove", Blunders::Remove, "rejected and reported"),
            ("report", Blunders::Report, "flagged and used"),
        ])).or(Blunders::Remove),
        /// Standard deviation of a measured coordinate on the map. Without this key, it is estimated from the
        /// deviations within bricks.
        tie_sigma_m: Option<f64> = key(above_to(0.0, 1e7)).unused("50.0"),
    }
    check seams_need_bricks
}

fn seams_need_bricks(written: &TriangulationConfig, keys: &mut Keys<'_, '_>) {
    if written.method == Method::OneShot && written.local {
        keys.refuse(
            "local",
            "\"no\", or method = \"scale\": one_shot has no bricks whose seams could be evened out",
        );
    }
}

/// Method that positions the pictures on the map.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// BRICK, EXTEND, SCALE.
    Scale,
    /// BRICK, EXTEND, MORTAR, SCALE.
    Mortar,
    /// All pictures and controls at once.
    OneShot,
}

/// Treatment of blunders.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Blunders {
    /// Left out.
    Remove,
    /// Flagged and used.
    Report,
}
