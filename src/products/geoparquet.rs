//! What GeoParquet 1.1.0 asks for beside columns: geometries, and metadata that say what they are.

use serde_json::{Value, json};

use crate::constants::MARS_IAU2000;

/// Little-endian well-known binary of a point (OGC 06-103r4, 8.2).
pub(super) fn well_known_binary(point: [f64; 2]) -> Vec<u8> {
    const LITTLE_ENDIAN: u8 = 1;
    const POINT: u32 = 1;
    let mut bytes = vec![LITTLE_ENDIAN];
    bytes.extend(POINT.to_le_bytes());
    bytes.extend(point[0].to_le_bytes());
    bytes.extend(point[1].to_le_bytes());
    bytes
}

/// The `geo` key of a table of points within a box (west, south, east, north, degrees).
///
/// * `covering` – where each row has its own box, if it has one
pub(super) fn geo_metadata(bounds_deg: Option<[f64; 4]>, covering: Option<Value>) -> Value {
    let mut column = json!({
        "encoding": "WKB",
        "geometry_types": ["Point"],
        "crs": mars_sphere(),
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

/// PROJJSON of `IAU_2015:49900`, which stands for the sphere; [`FRAME`](super::coordinates::FRAME) says whose longitudes these are. Coordinates are (longitude, latitude) all the same, as GeoParquet says.
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
