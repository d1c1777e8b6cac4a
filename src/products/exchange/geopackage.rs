//! Footprints as a GeoPackage (OGC 12-128r18, version 1.3): three-dimensional points, one table.
//!
//! SQLite itself writes the file. There is no spatial index: it is an extension, and readers make their own.

use std::path::Path;

use rusqlite::{Connection, OpenFlags, Row, params};

use super::{CRS_NAME, CRS_WKT, POINT_Z_HEIGHT, SPHERE_RADIUS_M};
use crate::{
    error::{Failure, IoFault, Place, Result},
    products::{
        coordinates::FRAME,
        fault::ProductFault,
        files::{create, finish, open},
        site::SiteProducts,
    },
};

/// Identifies the coordinate system inside the file, and with the organization `IAU_2015`.
const SRS_ID: i32 = 49_900;

/// What the standard asks for; `application_id` spells "GPKG".
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
    CREATE TABLE footprints (
        fid INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, geom POINT NOT NULL, et_s DOUBLE NOT NULL,
        utc TEXT NOT NULL, orbit INTEGER NOT NULL, source_file TEXT NOT NULL, record INTEGER NOT NULL,
        shot INTEGER NOT NULL, radius_m DOUBLE NOT NULL, radius_crossover_m DOUBLE NOT NULL,
        topography_m DOUBLE NOT NULL, range_m DOUBLE NOT NULL, windows TEXT NOT NULL);
";
/// The Earth's system that every GeoPackage must list.
const WGS84_WKT: &str = "GEOGCS[\"WGS 84\",DATUM[\"WGS_1984\",SPHEROID[\"WGS 84\",6378137,298.257223563]],\
    PRIMEM[\"Greenwich\",0],UNIT[\"degree\",0.0174532925199433],AUTHORITY[\"EPSG\",\"4326\"]]";

/// A row of the table `footprints` but for its number.
#[derive(Debug, PartialEq)]
struct Shot {
    geometry: Vec<u8>,
    et_s: f64,
    utc: String,
    orbit: u32,
    source_file: String,
    record: u32,
    shot: u8,
    radius_m: f64,
    radius_crossover_m: f64,
    topography_m: f64,
    range_m: f64,
    windows: String,
}

/// What the file says of its table.
struct Contents {
    site: String,
    /// That of the newest shot, as a clock would give other bytes each time.
    last_change: String,
    longitude_deg: [f64; 2],
    latitude_deg: [f64; 2],
}

impl Contents {
    fn of(site: &SiteProducts, points: &[[f64; 2]]) -> Self {
        let newest = site.utc.iter().max().map_or("", String::as_str);
        Self {
            site: site.config.site.clone(),
            last_change: format!("{newest}Z"),
            longitude_deg: ends(points.iter().map(|point| point[0])),
            latitude_deg: ends(points.iter().map(|point| point[1])),
        }
    }
}

/// Writes the footprints, which lie at `points` (degrees), and reads them back.
///
/// # Errors
/// What the disk or SQLite refuses; rows that come back different.
pub(super) fn write(path: &Path, site: &SiteProducts, points: &[[f64; 2]]) -> Result<u64> {
    let shots = || (points.iter().enumerate()).map(|(row, point)| shot(site, row, point));
    // Makes the folder and an empty file, which SQLite takes for a new database.
    finish(path, create(path)?)?;
    let contents = Contents::of(site, points);
    fill(path, &contents, shots()).in_file(path)?;
    open(path)?
        .sync_all()
        .map_err(IoFault::on("write"))
        .in_file(path)?;
    read_back(path, shots()).in_file(path)?;
    Ok(points.len() as u64)
}

/// The disk's refusal, or SQLite's.
fn refused(error: rusqlite::Error) -> Failure {
    use rusqlite::ErrorCode::{CannotOpen, DiskFull, PermissionDenied, ReadOnly, SystemIoFailure};
    match error.sqlite_error_code() {
        Some(CannotOpen | DiskFull | PermissionDenied | ReadOnly | SystemIoFailure) => {
            IoFault::on("write")(std::io::Error::other(error)).into()
        }
        _ => ProductFault::refused("write GeoPackage")(error).into(),
    }
}

fn fill(path: &Path, contents: &Contents, shots: impl Iterator<Item = Shot>) -> Result<()> {
    let database = Connection::open(path).map_err(refused)?;
    database.execute_batch(LAYOUT).map_err(refused)?;
    describe(&database, contents).map_err(refused)?;
    let mut insert = database
        .prepare(
            "INSERT INTO footprints (geom, et_s, utc, orbit, source_file, record, shot, radius_m, \
             radius_crossover_m, topography_m, range_m, windows) VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
        )
        .map_err(refused)?;
    for shot in shots {
        insert
            .execute(params![
                shot.geometry,
                shot.et_s,
                shot.utc,
                shot.orbit,
                shot.source_file,
                shot.record,
                shot.shot,
                shot.radius_m,
                shot.radius_crossover_m,
                shot.topography_m,
                shot.range_m,
                shot.windows,
            ])
            .map_err(refused)?;
    }
    drop(insert);
    database.execute_batch("COMMIT").map_err(refused)?;
    database.close().map_err(|(_, error)| refused(error))
}

/// Fills the tables of contents.
fn describe(database: &Connection, contents: &Contents) -> rusqlite::Result<()> {
    let systems = "INSERT INTO gpkg_spatial_ref_sys VALUES (?, ?, ?, ?, ?, ?)";
    for (name, id, organization, definition, description) in [
        ("Undefined Cartesian SRS", -1, "NONE", "undefined", ""),
        ("Undefined geographic SRS", 0, "NONE", "undefined", ""),
        ("WGS 84 geodetic", 4326, "EPSG", WGS84_WKT, "the Earth"),
        (CRS_NAME, SRS_ID, "IAU_2015", CRS_WKT, FRAME),
    ] {
        let row = params![name, id, organization, id, definition, description];
        database.execute(systems, row)?;
    }
    let ([west, east], [south, north]) = (contents.longitude_deg, contents.latitude_deg);
    database.execute(
        "INSERT INTO gpkg_contents VALUES ('footprints', 'features', ?, ?, ?, ?, ?, ?, ?, ?)",
        params![
            contents.site,
            POINT_Z_HEIGHT,
            contents.last_change,
            west,
            south,
            east,
            north,
            SRS_ID
        ],
    )?;
    database.execute(
        "INSERT INTO gpkg_geometry_columns VALUES ('footprints', 'geom', 'POINT', ?, 1, 0)",
        params![SRS_ID],
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

fn shot(site: &SiteProducts, row: usize, point: &[f64; 2]) -> Shot {
    let shot = site.footprints.row(row);
    Shot {
        geometry: geometry(point, shot.radius_crossover_m - SPHERE_RADIUS_M),
        et_s: shot.et_s,
        utc: site.utc[row].clone(),
        orbit: shot.orbit,
        source_file: site.file_name(shot.file),
        record: shot.record,
        shot: shot.shot,
        radius_m: shot.radius_m,
        radius_crossover_m: shot.radius_crossover_m,
        topography_m: shot.radius_crossover_m - shot.areoid_radius_m,
        range_m: shot.range_m,
        windows: site.window_ids(shot.windows),
    }
}

/// `GeoPackageBinary` without an envelope (2.1.3), around the well-known binary of a point with a height.
fn geometry([longitude_deg, latitude_deg]: &[f64; 2], height_m: f64) -> Vec<u8> {
    const VERSION: u8 = 0;
    const LITTLE_ENDIAN: u8 = 1;
    const POINT_Z: u32 = 1001;
    let mut bytes = vec![b'G', b'P', VERSION, LITTLE_ENDIAN];
    bytes.extend(SRS_ID.to_le_bytes());
    bytes.push(LITTLE_ENDIAN);
    bytes.extend(POINT_Z.to_le_bytes());
    for coordinate in [longitude_deg, latitude_deg, &height_m] {
        bytes.extend(coordinate.to_le_bytes());
    }
    bytes
}

fn read_back(path: &Path, shots: impl Iterator<Item = Shot>) -> Result<()> {
    let unreadable = |error: rusqlite::Error| Failure::from(ProductFault::unreadable(error));
    let database =
        Connection::open_with_flags(path, OpenFlags::SQLITE_OPEN_READ_ONLY).map_err(unreadable)?;
    let mut select = database
        .prepare(
            "SELECT geom, et_s, utc, orbit, source_file, record, shot, radius_m, radius_crossover_m, \
             topography_m, range_m, windows FROM footprints ORDER BY fid",
        )
        .map_err(unreadable)?;
    let mut found = select.query_map([], from_row).map_err(unreadable)?;
    let differs = |what: String| Err(ProductFault::ReadBack { what }.into());
    let mut rows = 0;
    for expected in shots {
        rows += 1;
        if found.next().transpose().map_err(unreadable)? != Some(expected) {
            return differs(format!("footprint {rows}"));
        }
    }
    if found.next().is_some() {
        return differs(format!("more than {rows} footprints"));
    }
    Ok(())
}

fn from_row(row: &Row) -> rusqlite::Result<Shot> {
    Ok(Shot {
        geometry: row.get(0)?,
        et_s: row.get(1)?,
        utc: row.get(2)?,
        orbit: row.get(3)?,
        source_file: row.get(4)?,
        record: row.get(5)?,
        shot: row.get(6)?,
        radius_m: row.get(7)?,
        radius_crossover_m: row.get(8)?,
        topography_m: row.get(9)?,
        range_m: row.get(10)?,
        windows: row.get(11)?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shots() -> impl Iterator<Item = Shot> {
        [1_u8, 2].into_iter().map(|shot| Shot {
            geometry: geometry(&[175.3, -14.6], -1_950.25),
            et_s: 2.0_f64.sqrt(),
            utc: "1999-08-24T14:12:13.000".to_owned(),
            orbit: 9019,
            source_file: "a 'b'.b".to_owned(),
            record: 11,
            shot,
            radius_m: 3_394_000.12,
            radius_crossover_m: 3_394_001.37,
            topography_m: -1_498.63,
            range_m: 380_000.1,
            windows: String::new(),
        })
    }

    #[test]
    fn a_changed_row_is_noticed() {
        let folder = tempfile::tempdir().unwrap();
        let contents = Contents {
            site: "a".to_owned(),
            last_change: "1999-08-24T14:12:13.000Z".to_owned(),
            longitude_deg: [175.3; 2],
            latitude_deg: [-14.6; 2],
        };
        for (number, (change, complaint)) in [
            (
                "UPDATE footprints SET et_s = 1.414213562373095 WHERE fid = 2",
                "footprint 2",
            ),
            ("DELETE FROM footprints WHERE fid = 1", "footprint 1"),
            ("DELETE FROM footprints WHERE fid = 2", "footprint 2"),
            (
                "UPDATE footprints SET geom = substr(geom, 1, 30) WHERE fid = 1",
                "footprint 1",
            ),
        ]
        .into_iter()
        .enumerate()
        {
            let path = folder.path().join(format!("{number}.gpkg"));
            fill(&path, &contents, shots()).unwrap();
            read_back(&path, shots()).unwrap();
            let longer = read_back(&path, shots().take(1)).unwrap_err();
            assert!(longer.fault.to_string().ends_with("more than 1 footprints"));
            Connection::open(&path)
                .unwrap()
                .execute(change, [])
                .unwrap();
            let failure = read_back(&path, shots()).unwrap_err();
            assert_eq!(
                failure.fault.to_string(),
                format!("read back differently: {complaint}")
            );
        }
    }
}
