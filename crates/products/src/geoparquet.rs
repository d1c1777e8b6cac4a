//! Requirements of GeoParquet 1.1.0 beside columns: geometries, and metadata that describe them.

use serde_json::{Value, json};

use areograph_base::body::Body;

/// Byte order and type of a point in little-endian well-known binary.
const POINT: [u8; 5] = [1, 1, 0, 0, 0];

/// Little-endian well-known binary of a point (OGC 06-103r4, 8.2).
pub(super) fn well_known_binary(point: [f64; 2]) -> [u8; 21] {
    let mut bytes = [0; 21];
    bytes[..5].copy_from_slice(&POINT);
    bytes[5..13].copy_from_slice(&point[0].to_le_bytes());
    bytes[13..].copy_from_slice(&point[1].to_le_bytes());
    bytes
}

/// The coordinates of such a point.
pub(super) fn point_of(bytes: &[u8]) -> Option<[f64; 2]> {
    let (head, bytes) = bytes.split_at_checked(5)?;
    let (axes, _) = bytes.as_chunks();
    let point = axes.iter().map(|axis| f64::from_le_bytes(*axis));
    let point: [f64; 2] = point.collect::<Vec<_>>().try_into().ok()?;
    (head == POINT).then_some(point)
}

/// The `geo` key of a table of points on `body` within a box (west, south, east, north, degrees).
///
/// * `covering` – where each row has its own box, if it has one
pub(super) fn geo_metadata(
    body: Body,
    bounds_deg: Option<[f64; 4]>,
    covering: Option<Value>,
) -> Value {
    let mut column = json!({
        "encoding": "WKB",
        "geometry_types": ["Point"],
        "crs": sphere(body),
    });
    if let Some(covering) = covering {
        column["covering"] = covering;
    }
    if let Some(bounds) = bounds_deg {
        column["bbox"] = json!(bounds);
    }
    json!({
        "version": "1.1.0",
        "primary_column": "geometry",
        "columns": { "geometry": column },
    })
}

/// PROJJSON of the sphere of `body` in `IAU_2015`; [`frame`](super::coordinates::frame) describes its frame.
/// Coordinates are (longitude, latitude) all the same, as GeoParquet requires.
///
/// Source: IAU coordinate systems of the OGC Planetary working group, radius of Archinal et al. 2018.
fn sphere(body: Body) -> Value {
    let map = body.map();
    let axis = |name: &str, abbreviation: &str, direction: &str| json!({ "name": name, "abbreviation": abbreviation, "direction": direction, "unit": "degree" });
    let mut datum = json!({
        "type": "GeodeticReferenceFrame",
        "name": map.datum,
        "ellipsoid": { "name": map.datum, "radius": map.radius_m },
        "prime_meridian": { "name": "Reference Meridian", "longitude": 0 },
    });
    if let Some(anchor) = &map.anchor {
        datum["anchor"] = json!(anchor);
    }
    json!({
        "$schema": "https://proj.org/schemas/v0.7/projjson.schema.json",
        "type": "GeographicCRS",
        "name": map.crs,
        "datum": datum,
        "coordinate_system": {
            "subtype": "ellipsoidal",
            "axis": [
                axis("Geodetic latitude", "Lat", "north"),
                axis("Geodetic longitude", "Lon", "east"),
            ],
        },
        "id": { "authority": "IAU", "code": map.code, "version": 2015 },
    })
}
