//! Points or lines as a GeoPackage (OGC 12-128r18, version 1.3): three-dimensional points, or lines, in one table.
//!
//! SQLite itself writes the file. There is no spatial index: it is an extension, and readers make their own.

use std::path::Path;

use rusqlite::{Connection, OpenFlags, params, params_from_iter, types::Value};

use crate::{
    error::ProductError,
    files::{create, finish},
    footprints::features,
    gis::{Features, crs_wkt},
    product::{Content, Declaration, Program, Role, Use, Write},
    table::{Kind, Meaning, Table, Values},
};
use areograph_base::{
    body::Body,
    error::{Error, IoError, Locate, Result},
};
use areograph_config::ShotFormat;

pub(crate) static GEOPACKAGE: Declaration = Declaration {
    path: "exchange/footprints.gpkg",
    what: "the footprints as GeoPackage 1.3",
    readers: "GIS",
    rows: "shots",
    role: Role::Data,
    content: Content::Foreign,
    write: Write::Footprints(ShotFormat::Gpkg, |path, of| write(path, features(of.site))),
    uses: &[Use {
        program: Program::Gis,
        lines: "ogrinfo -al -so footprints.gpkg                  GeoPackage, all columns",
    }],
};

/// Tables required by the standard; `application_id` spells "GPKG".
const LAYOUT: &str = "
    PRAGMA page_size = 4096;
    PRAGMA journal_mode = OFF;
    PRAGMA synchronous = OFF;
    PRAGMA application_id = 0x47504B47;
    PRAGMA user_version = 10300;
    BEGIN;
    CREATE TABLE gpkg_spatial_ref_sys (
        srs_name TEXT NOT NULL, srs_id INTEGER NOT NULL PRIMARY KEY, organization TEXT NOT NULL,
        organization_coordsys_id INTEGER NOT NULL, definition TEXT NOT NULL, description TEXT);
    CREATE TABLE gpkg_contents (
        table_name TEXT NOT NULL PRIMARY KEY, data_type TEXT NOT NULL, identifier TEXT UNIQUE,
        description TEXT DEFAULT '', last_change DATETIME NOT NULL, min_x DOUBLE, min_y DOUBLE,
        max_x DOUBLE, max_y DOUBLE, srs_id INTEGER,
        FOREIGN KEY (srs_id) REFERENCES gpkg_spatial_ref_sys(srs_id));
    CREATE TABLE gpkg_geometry_columns (
        table_name TEXT NOT NULL, column_name TEXT NOT NULL, geometry_type_name TEXT NOT NULL,
        srs_id INTEGER NOT NULL, z TINYINT NOT NULL, m TINYINT NOT NULL,
        PRIMARY KEY (table_name, column_name), UNIQUE (table_name),
        FOREIGN KEY (table_name) REFERENCES gpkg_contents(table_name),
        FOREIGN KEY (srs_id) REFERENCES gpkg_spatial_ref_sys(srs_id));
";
/// The Earth's system that every GeoPackage must list.
const WGS84_WKT: &str = "GEOGCS[\"WGS 84\",DATUM[\"WGS_1984\",SPHEROID[\"WGS 84\",6378137,298.257223563]],\
    PRIMEM[\"Greenwich\",0],UNIT[\"degree\",0.0174532925199433],AUTHORITY[\"EPSG\",\"4326\"]]";

/// Geometries of a table.
pub(crate) enum Geometries {
    /// Longitude (-180..180), latitude, degrees, and height.
    Points(Vec<[f64; 3]>),
    /// Longitude, of any turn, and latitude, degrees.
    Lines(Vec<Vec<[f64; 2]>>),
}

/// The table of a file.
pub(crate) struct Layer<'a> {
    /// Name of the layer.
    pub(crate) name: &'a str,
    /// Name of the table.
    pub(crate) table: &'static str,
    /// Description of the layer.
    pub(crate) description: String,
    /// UTC of the newest data: a clock would give different bytes each time.
    pub(crate) newest_utc: String,
    pub(crate) body: Body,
    /// Frame of longitudes and latitudes.
    pub(crate) frame: &'static str,
    pub(crate) geometries: Geometries,
    /// A row per geometry.
    pub(crate) attributes: Table<'a>,
}

impl<'a> Layer<'a> {
    fn of_points(features: Features<'a>) -> Self {
        Self {
            name: features.name,
            table: features.table,
            description: features.z,
            newest_utc: features.newest_utc,
            body: features.body,
            frame: features.frame,
            geometries: Geometries::Points(features.points),
            attributes: features.attributes.for_gis(),
        }
    }
}

/// Writes the points and reads them back.
///
/// # Errors
/// As [`write_layer`].
pub(crate) fn write(path: &Path, features: Features) -> Result<u64> {
    write_layer(path, &Layer::of_points(features))
}

/// Writes a layer and reads it back.
///
/// # Errors
/// Numbers that are not finite; errors of the disk or SQLite; rows that are read back differently.
pub(crate) fn write_layer(path: &Path, layer: &Layer) -> Result<u64> {
    // Makes the folder and an empty file, which SQLite takes for a new database.
    finish(path, create(path)?)?;
    fill(path, layer).in_file(path)?;
    read_back(path, layer).in_file(path)?;
    Ok(layer.geometries.len() as u64)
}

/// The statement that makes the table of the geometries.
fn create_table(layer: &Layer) -> String {
    let column = |column: &Meaning| {
        let kind = match column.kind {
            Kind::Real => "DOUBLE",
            Kind::Natural | Kind::Integer => "INTEGER",
            Kind::Flag => "BOOLEAN",
            Kind::Time => "DATETIME",
            Kind::Text | Kind::List => "TEXT",
            Kind::Bytes => "BLOB",
        };
        let missing = if column.optional { "" } else { " NOT NULL" };
        format!(", {} {kind}{missing}", column.name)
    };
    let columns: String = layer.attributes.columns().map(column).collect();
    format!(
        "CREATE TABLE {} (fid INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, geom {} NOT NULL{columns})",
        layer.table,
        layer.geometries.kind()
    )
}

/// The columns of the table as statements list them.
fn names(attributes: &Table) -> String {
    let names = attributes.columns().map(|column| column.name);
    ["geom"]
        .into_iter()
        .chain(names)
        .collect::<Vec<_>>()
        .join(", ")
}

/// A value for SQLite.
fn value(values: &Values, row: usize) -> Value {
    match values {
        Values::Real(of) => Value::Real(of[row]),
        Values::OptionalReal(of) => of[row].map_or(Value::Null, Value::Real),
        Values::Natural(of) => Value::Integer(of[row].into()),
        Values::Integer(of) => Value::Integer(of[row].into()),
        Values::Flag(of) => Value::Integer(of[row].into()),
        Values::Time(of) => Value::Text(
            of[row]
                .calendar()
                .format("%Y-%m-%dT%H:%M:%S%.3fZ")
                .to_string(),
        ),
        Values::Text(of) => Value::Text(of.value(row).to_owned()),
        Values::Bytes(of) => Value::Blob(of.value(row).to_owned()),
    }
}

/// Calls `take` with every row, its geometry first.
fn each(layer: &Layer, mut take: impl FnMut(Vec<Value>) -> Result<()>) -> Result<()> {
    for rows in layer.attributes.pieces() {
        let values = layer.attributes.values(rows.clone())?;
        for (row, at) in rows.enumerate() {
            let geometry = Value::Blob(layer.geometries.encoded(layer.body, at));
            let attributes = values.iter().map(|of| value(of, row));
            take([geometry].into_iter().chain(attributes).collect())?;
        }
    }
    Ok(())
}

/// An error of the disk or of SQLite.
fn refused(error: rusqlite::Error) -> Error {
    use rusqlite::ErrorCode::{CannotOpen, DiskFull, PermissionDenied, ReadOnly, SystemIoFailure};
    match error.sqlite_error_code() {
        Some(CannotOpen | DiskFull | PermissionDenied | ReadOnly | SystemIoFailure) => {
            IoError::on("write")(std::io::Error::other(error)).into()
        }
        _ => ProductError::refused("write GeoPackage")(error).into(),
    }
}

fn fill(path: &Path, layer: &Layer) -> Result<()> {
    let database = Connection::open(path).map_err(refused)?;
    database.execute_batch(LAYOUT).map_err(refused)?;
    let table = create_table(layer);
    database.execute_batch(&table).map_err(refused)?;
    describe(&database, layer).map_err(refused)?;
    let names = names(&layer.attributes);
    let places = names
        .split(", ")
        .map(|_| "?")
        .collect::<Vec<_>>()
        .join(", ");
    let mut insert = database
        .prepare(&format!(
            "INSERT INTO {} ({names}) VALUES ({places})",
            layer.table
        ))
        .map_err(refused)?;
    each(layer, |row| {
        insert.execute(params_from_iter(row)).map_err(refused)?;
        Ok(())
    })?;
    drop(insert);
    database.execute_batch("COMMIT").map_err(refused)?;
    database.close().map_err(|(_, error)| refused(error))
}

/// Fills the tables of contents.
fn describe(database: &Connection, layer: &Layer) -> rusqlite::Result<()> {
    let (map, wkt) = (layer.body.map(), crs_wkt(layer.body));
    let systems = "INSERT INTO gpkg_spatial_ref_sys VALUES (?, ?, ?, ?, ?, ?)";
    for (name, id, organization, definition, description) in [
        ("Undefined Cartesian SRS", -1, "NONE", "undefined", ""),
        ("Undefined geographic SRS", 0, "NONE", "undefined", ""),
        ("WGS 84 geodetic", 4326, "EPSG", WGS84_WKT, "the Earth"),
        // Its code identifies it inside the file, and with the organization.
        (
            &*map.crs,
            i64::from(map.code),
            "IAU_2015",
            &*wkt,
            layer.frame,
        ),
    ] {
        let row = params![name, id, organization, id, definition, description];
        database.execute(systems, row)?;
    }
    let [[west, east], [south, north]] = [0, 1].map(|axis| layer.geometries.ends(axis));
    database.execute(
        "INSERT INTO gpkg_contents VALUES (?, 'features', ?, ?, ?, ?, ?, ?, ?, ?)",
        params![
            layer.table,
            layer.name,
            layer.description,
            format!("{}Z", layer.newest_utc),
            west,
            south,
            east,
            north,
            map.code
        ],
    )?;
    database.execute(
        "INSERT INTO gpkg_geometry_columns VALUES (?, 'geom', ?, ?, ?, 0)",
        params![
            layer.table,
            layer.geometries.kind(),
            map.code,
            layer.geometries.has_heights()
        ],
    )?;
    Ok(())
}

/// Least and greatest.
fn ends(values: impl Iterator<Item = f64>) -> [f64; 2] {
    values.fold(
        [f64::INFINITY, f64::NEG_INFINITY],
        |[least, greatest], value| [least.min(value), greatest.max(value)],
    )
}

impl Geometries {
    const fn len(&self) -> usize {
        match self {
            Self::Points(points) => points.len(),
            Self::Lines(lines) => lines.len(),
        }
    }

    const fn kind(&self) -> &'static str {
        match self {
            Self::Points(_) => "POINT",
            Self::Lines(_) => "LINESTRING",
        }
    }

    const fn has_heights(&self) -> bool {
        matches!(self, Self::Points(_))
    }

    /// Least and greatest coordinate on an axis.
    fn ends(&self, axis: usize) -> [f64; 2] {
        match self {
            Self::Points(points) => ends(points.iter().map(|point| point[axis])),
            Self::Lines(lines) => ends(lines.iter().flatten().map(|point| point[axis])),
        }
    }

    /// `GeoPackageBinary` without an envelope (2.1.3), around the well-known binary of a geometry.
    fn encoded(&self, body: Body, at: usize) -> Vec<u8> {
        const VERSION: u8 = 0;
        const LITTLE_ENDIAN: u8 = 1;
        const POINT_Z: u32 = 1001;
        const LINE: u32 = 2;
        let mut bytes = vec![b'G', b'P', VERSION, LITTLE_ENDIAN];
        bytes.extend(body.map().code.to_le_bytes());
        bytes.push(LITTLE_ENDIAN);
        let coordinates: &[f64] = match self {
            Self::Points(points) => {
                bytes.extend(POINT_Z.to_le_bytes());
                &points[at]
            }
            Self::Lines(lines) => {
                bytes.extend(LINE.to_le_bytes());
                let count = u32::try_from(lines[at].len()).unwrap_or(u32::MAX);
                bytes.extend(count.to_le_bytes());
                lines[at].as_flattened()
            }
        };
        for coordinate in coordinates {
            bytes.extend(coordinate.to_le_bytes());
        }
        bytes
    }
}

fn read_back(path: &Path, layer: &Layer) -> Result<()> {
    let unreadable = |error: rusqlite::Error| Error::from(ProductError::unreadable(error));
    let differs = |what: String| Err(ProductError::ReadBack { what }.into());
    let database =
        Connection::open_with_flags(path, OpenFlags::SQLITE_OPEN_READ_ONLY).map_err(unreadable)?;
    let names = names(&layer.attributes);
    let columns = names.split(", ").count();
    let mut select = database
        .prepare(&format!("SELECT {names} FROM {} ORDER BY fid", layer.table))
        .map_err(unreadable)?;
    let mut found = select
        .query_map([], |row| {
            let values = (0..columns).map(|column| row.get(column));
            values.collect::<rusqlite::Result<Vec<Value>>>()
        })
        .map_err(unreadable)?;
    let mut rows = 0;
    each(layer, |expected| {
        rows += 1;
        if found.next().transpose().map_err(unreadable)? != Some(expected) {
            return differs(format!("row {rows} of {}", layer.table));
        }
        Ok(())
    })?;
    if found.next().is_some() {
        return differs(format!("more than {rows} {}", layer.table));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gis::tests::example;

    fn for_gis() -> Layer<'static> {
        Layer::of_points(example())
    }

    #[test]
    fn a_changed_row_is_noticed() {
        let folder = tempfile::tempdir().unwrap();
        for (number, (change, complaint)) in [
            (
                "UPDATE footprints SET et_s = 1.414213562373095 WHERE fid = 2",
                "row 2 of footprints",
            ),
            ("DELETE FROM footprints WHERE fid = 1", "row 1 of footprints"),
            ("DELETE FROM footprints WHERE fid = 2", "row 2 of footprints"),
            (
                "UPDATE footprints SET geom = substr(geom, 1, 30) WHERE fid = 1",
                "row 1 of footprints",
            ),
            (
                "INSERT INTO footprints SELECT 3, geom, et_s, utc, orbit, source_file FROM footprints WHERE fid = 1",
                "more than 2 footprints",
            ),
        ]
        .into_iter()
        .enumerate()
        {
            let path = folder.path().join(format!("{number}.gpkg"));
            fill(&path, &for_gis()).unwrap();
            read_back(&path, &for_gis()).unwrap();
            let changed = Connection::open(&path).unwrap().execute(change, []);
            assert_eq!(changed.unwrap(), 1);
            let failure = read_back(&path, &for_gis()).unwrap_err();
            assert_eq!(
                failure.cause.to_string(),
                format!("read back differently: {complaint}")
            );
        }
    }
}
