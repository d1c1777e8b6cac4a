//! Footprints as GeoParquet, CSV and GeoJSON.

use serde_json::{Value, json};

use super::{
    Writer,
    coordinates::{FRAME, bounding_box_deg, column_deg, signed_longitude_deg},
    geojson, parquet, pds4_label,
    site::SiteProducts,
    table::{Column, Table, Values},
    text_table,
};
use crate::{
    constants::MARS_IAU2000,
    error::Result,
    geom::ellipsoid::{AreocentricLatitude, spherical_to_xyz_m},
};

pub(super) fn write(written: &mut Writer, site: &SiteProducts) -> Result<()> {
    let points = points_deg(site);
    let mut table = Table::new(columns(site))?;
    let csv = written.directory.join("footprints.csv");
    written.add("footprints.csv", |path| text_table::write(path, &table))?;
    if table.rows() > 0 {
        written.add("footprints.xml", |path| {
            pds4_label::write(path, &csv, &table, site)
        })?;
    }
    table.columns.push(Column::new(
        "geometry",
        "point, longitude (-180..180) and areocentric latitude in degrees, well-known binary",
        Values::Binary(points.iter().map(well_known_binary).collect()),
    ));
    let metadata = vec![
        ("geo", geo_metadata(&points).to_string()),
        ("frame", FRAME.to_owned()),
    ];
    written.add("footprints.parquet", |path| {
        parquet::write(path, &table, metadata)
    })?;
    drop(table);
    written.add("footprints.geojson", |path| {
        geojson::write(path, site, &points)
    })
}

/// Longitude (-180..180) and latitude of every footprint, degrees.
pub(super) fn points_deg(site: &SiteProducts) -> Vec<[f64; 2]> {
    let shots = site.footprints;
    shots
        .longitude_rad
        .iter()
        .zip(column_deg(&shots.latitude_rad))
        .map(|(longitude_rad, latitude_deg)| [signed_longitude_deg(*longitude_rad), latitude_deg])
        .collect()
}

/// Areographic latitudes, degrees, of areocentric ones in radians.
fn areographic_deg(latitude_rad: &[f64]) -> Vec<f64> {
    let areographic = |latitude: &f64| {
        AreocentricLatitude(*latitude)
            .to_areographic(&MARS_IAU2000)
            .0
    };
    let latitudes: Vec<f64> = latitude_rad.iter().map(areographic).collect();
    column_deg(&latitudes)
}

fn columns(site: &SiteProducts) -> Vec<Column> {
    let mut columns = identity(site);
    columns.extend(quality(site));
    columns.push(windows(site));
    columns.extend(ground(site));
    columns.extend(spacecraft(site));
    columns
}

/// When and where in its file a shot was taken.
fn identity(site: &SiteProducts) -> Vec<Column> {
    let shots = site.footprints;
    let source = shots
        .file
        .iter()
        .map(|file| site.file_name(*file))
        .collect();
    vec![
        Column::new(
            "et_tag_s",
            "time tag of the shot in the file, TDB seconds past J2000",
            Values::F64(shots.et_tag_s.clone()),
        ),
        Column::new(
            "et_s",
            "time of the shot after the MOLA clock correction, TDB seconds past J2000",
            Values::F64(shots.et_s.clone()),
        ),
        Column::new(
            "orbit",
            "orbit number of the frame",
            Values::U32(shots.orbit.clone()),
        ),
        Column::new("source_file", "PEDR file", Values::Text(source)),
        Column::new(
            "record",
            "record of that file, counted from 1 with its label records",
            Values::U32(shots.record.clone()),
        ),
        Column::new(
            "shot",
            "shot in the frame, 1 to 20",
            Values::U32(shots.shot.iter().copied().map(u32::from).collect()),
        ),
    ]
}

/// What the file says of how good a shot is.
fn quality(site: &SiteProducts) -> Vec<Column> {
    let shots = site.footprints;
    let wide = |codes: &[u16]| Values::U32(codes.iter().copied().map(u32::from).collect());
    vec![
        Column::new(
            "channel",
            "trigger channel",
            Values::U32(shots.channel.iter().copied().map(u32::from).collect()),
        ),
        Column::new(
            "class",
            "classification: 1 ground, 0 cloud or noise",
            Values::I32(shots.class.iter().copied().map(i32::from).collect()),
        ),
        Column::new(
            "attitude_flag",
            "0 attitude known, 2 known for part of the frame, 3 unknown",
            wide(&shots.attitude_flag),
        ),
        Column::new(
            "orbit_quality",
            "0 orbit from JPL, 1 or more: MOLA team's gravity model number",
            wide(&shots.orbit_quality),
        ),
    ]
}

fn windows(site: &SiteProducts) -> Column {
    let masks = site.footprints.windows.iter();
    Column::new(
        "windows",
        "identifiers of the windows that hold the shot, separated by semicolons",
        Values::Text(masks.map(|mask| site.window_ids(*mask)).collect()),
    )
}

fn ground(site: &SiteProducts) -> Vec<Column> {
    let shots = site.footprints;
    let xyz: Vec<[f64; 3]> = (0..shots.len())
        .map(|row| {
            let shot = shots.row(row);
            spherical_to_xyz_m(shot.longitude_rad, shot.latitude_rad, shot.radius_m).into()
        })
        .collect();
    let axis = |axis: usize| Values::F64(xyz.iter().map(|xyz| xyz[axis]).collect());
    vec![
        Column::new(
            "longitude_deg",
            "east longitude, 0..360 degrees, IAU 2000",
            Values::F64(column_deg(&shots.longitude_rad)),
        ),
        Column::new(
            "latitude_deg",
            "areocentric latitude, degrees, IAU 2000",
            Values::F64(column_deg(&shots.latitude_rad)),
        ),
        Column::new(
            "latitude_areographic_deg",
            "areographic latitude, degrees, IAU 2000 radii; as older maps count",
            Values::F64(areographic_deg(&shots.latitude_rad)),
        ),
        Column::new(
            "radius_m",
            "planetary radius before the crossover correction, metres",
            Values::F64(shots.radius_m.clone()),
        ),
        Column::new(
            "radius_crossover_m",
            "planetary radius after the crossover correction, metres",
            Values::F64(shots.radius_crossover_m.clone()),
        ),
        Column::new(
            "areoid_radius_m",
            "areoid radius, metres",
            Values::F64(shots.areoid_radius_m.clone()),
        ),
        Column::new(
            "topography_m",
            "radius after the crossover correction minus areoid radius, metres",
            Values::F64(shots.topography_m()),
        ),
        Column::new(
            "x_m",
            "IAU 2000 body-fixed X of the point with radius_m, metres",
            axis(0),
        ),
        Column::new(
            "y_m",
            "IAU 2000 body-fixed Y of the point with radius_m, metres",
            axis(1),
        ),
        Column::new(
            "z_m",
            "IAU 2000 body-fixed Z of the point with radius_m, metres",
            axis(2),
        ),
    ]
}

fn spacecraft(site: &SiteProducts) -> Vec<Column> {
    let shots = site.footprints;
    vec![
        Column::new(
            "range_m",
            "one-way range to the spacecraft's centre of mass, metres",
            Values::F64(shots.range_m.clone()),
        ),
        Column::new(
            "spacecraft_longitude_deg",
            "east longitude of the spacecraft, the file's orbit, IAU 2000",
            Values::F64(column_deg(&shots.spacecraft_longitude_rad)),
        ),
        Column::new(
            "spacecraft_latitude_deg",
            "areocentric latitude of the spacecraft, the file's orbit",
            Values::F64(column_deg(&shots.spacecraft_latitude_rad)),
        ),
        Column::new(
            "spacecraft_radius_m",
            "distance of the spacecraft from the centre of Mars, the file's orbit",
            Values::F64(shots.spacecraft_radius_m.clone()),
        ),
        Column::new(
            "off_nadir_deg",
            "off-nadir angle of the laser, degrees",
            Values::F64(column_deg(&shots.off_nadir_rad)),
        ),
    ]
}

/// Little-endian well-known binary of a point (OGC 06-103r4, 8.2).
fn well_known_binary(point: &[f64; 2]) -> Vec<u8> {
    const LITTLE_ENDIAN: u8 = 1;
    const POINT: u32 = 1;
    let mut bytes = vec![LITTLE_ENDIAN];
    bytes.extend(POINT.to_le_bytes());
    bytes.extend(point[0].to_le_bytes());
    bytes.extend(point[1].to_le_bytes());
    bytes
}

/// The `geo` key of GeoParquet 1.1.0.
fn geo_metadata(points: &[[f64; 2]]) -> Value {
    let mut column = json!({
        "encoding": "WKB",
        "geometry_types": ["Point"],
        "crs": mars_sphere(),
    });
    if let Some(bounds) = bounding_box_deg(points) {
        column["bbox"] = json!(bounds);
    }
    json!({
        "version": "1.1.0",
        "primary_column": "geometry",
        "columns": { "geometry": column },
    })
}

/// PROJJSON of `IAU_2015:49900`, which stands for the sphere; [`FRAME`] says whose longitudes these are. Coordinates are (longitude, latitude) all the same, as GeoParquet says.
///
/// Source: IAU coordinate systems of the OGC Planetary working group, radius of Archinal et al. 2018.
fn mars_sphere() -> Value {
    let axis = |name: &str, abbreviation: &str, direction: &str| json!({ "name": name, "abbreviation": abbreviation, "direction": direction, "unit": "degree" });
    json!({
        "$schema": "https://proj.org/schemas/v0.7/projjson.schema.json",
        "type": "GeographicCRS",
        "name": "Mars (2015) - Sphere / Ocentric",
        "datum": {
            "type": "GeodeticReferenceFrame",
            "name": "Mars (2015) - Sphere",
            "anchor": "Viking 1 lander: 47.95137 W",
            "ellipsoid": { "name": "Mars (2015) - Sphere", "radius": MARS_IAU2000.equatorial_radius_m },
            "prime_meridian": { "name": "Reference Meridian", "longitude": 0 },
        },
        "coordinate_system": {
            "subtype": "ellipsoidal",
            "axis": [
                axis("Geodetic latitude", "Lat", "north"),
                axis("Geodetic longitude", "Lon", "east"),
            ],
        },
        "id": { "authority": "IAU", "code": 49900, "version": 2015 },
    })
}
