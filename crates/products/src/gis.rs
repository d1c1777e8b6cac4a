//! Points with attributes, for the formats of GIS.

use super::{coordinates::frame, table::Table};
use areograph_base::body::Body;

/// The coordinate system of maps of `body` as text for GIS; [`frame`] describes the frame of the coordinates.
pub(super) fn crs_wkt(body: Body) -> String {
    let map = body.map();
    format!(
        "GEOGCS[\"{}\",DATUM[\"{datum}\",SPHEROID[\"{datum}\",{},0]],PRIMEM[\"Reference Meridian\",0],\
         UNIT[\"degree\",0.0174532925199433],AUTHORITY[\"IAU_2015\",\"{}\"]]",
        map.crs,
        map.radius_m,
        map.code,
        datum = map.datum
    )
}

/// The coordinate system of maps of `body` as named in catalogues.
pub(super) fn crs_code(body: Body) -> String {
    format!("IAU_2015:{}", body.map().code)
}

/// Definition of the third coordinate of footprints on `body`.
pub(super) fn point_z_height(body: Body) -> String {
    format!(
        "z: radius after the crossover correction minus {} m, metres",
        body.map().radius_m
    )
}

/// Points with attributes.
pub(super) struct Features<'a> {
    /// Name of the set of points.
    pub(super) name: &'a str,
    /// Name of the points, in the plural: the table of a GeoPackage.
    pub(super) table: &'static str,
    /// UTC of the newest, for formats that hold a date: a clock would give different bytes each time.
    pub(super) newest_utc: String,
    /// The body.
    pub(super) body: Body,
    /// Frame of longitudes and latitudes.
    pub(super) frame: &'static str,
    /// Definition of the third coordinate.
    pub(super) z: String,
    /// Longitude (-180..180), areocentric latitude, degrees, and `z`.
    pub(super) points: Vec<[f64; 3]>,
    /// A row per point.
    pub(super) attributes: Table<'a>,
}

impl<'a> Features<'a> {
    /// Footprints on `body` by longitude, latitude and height.
    pub(super) fn of_footprints(
        body: Body,
        name: &'a str,
        newest_utc: String,
        points: Vec<[f64; 3]>,
        attributes: Table<'a>,
    ) -> Self {
        Self {
            name,
            table: "footprints",
            newest_utc,
            body,
            frame: frame(body),
            z: point_z_height(body),
            points,
            attributes,
        }
    }

    /// Longitudes and latitudes, degrees.
    pub(super) fn points_deg(&self) -> Vec<[f64; 2]> {
        let points = self.points.iter();
        points.map(|[east, north, _]| [*east, *north]).collect()
    }
}

#[cfg(test)]
pub(super) mod tests {
    use areograph_base::utc::Utc;

    use super::*;
    use crate::table::{Unit, column};

    /// Two points with a time, the square root of 1 and of 2, a number and texts.
    pub(crate) fn example() -> Features<'static> {
        let columns = vec![
            column("et_s", Unit::Second, "", |shot: &f64| shot.sqrt())
                .in_gis()
                .in_dbase("et_s", 20, 6),
            column("utc", Unit::None, "", |_: &f64| {
                Utc::from_microseconds(935_503_933_000_000)
            })
            .in_gis()
            .in_dbase("utc", 0, 0),
            column("orbit", Unit::None, "", |_: &f64| 9019_u32)
                .in_gis()
                .in_dbase("orbit", 10, 0),
            column("source_file", Unit::None, "", |_: &f64| {
                "å\n\"b\" 'c'.b".to_owned()
            })
            .in_gis()
            .in_dbase("file", 0, 0),
            column("longitude_deg", Unit::Degree, "", |shot: &f64| {
                175.312_345_678_9 + shot
            })
            .in_dbase("lon_deg", 14, 9),
        ];
        Features {
            name: "a",
            table: "footprints",
            body: Body::Mars,
            frame: "a frame",
            z: point_z_height(Body::Mars),
            newest_utc: "1999-08-24T14:12:13.000".to_owned(),
            points: vec![[0.1 + 0.2, -0.0, -1950.25], [2.0, -0.0, -1950.25]],
            attributes: Table::new(columns, vec![1.0, 2.0]),
        }
    }
}
