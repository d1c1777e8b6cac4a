//! Adjusted coordinates with their standard deviations.

use super::{NetProducts, WriteNet, write_csv, write_parquet};
use crate::{
    coordinates::degrees,
    exchange::geopackage,
    geojson,
    gis::Features,
    product::{Content, Declaration, Role},
    table::{Column, Table, Unit, column, meanings},
};
use areograph_base::{body::Body, schema::DocumentSchema};
use areograph_stages::triangulate::PointResult;

pub(super) static TABLE: Declaration<WriteNet> = Declaration {
    path: "points.parquet",
    what: "adjusted coordinates of all points, with standard deviations",
    readers: "scripts",
    rows: "points",
    role: Role::Data,
    content: Content::Table(|| meanings(&columns())),
    write: |path, of| write_parquet(path, of, &table(of)),
    uses: &[],
};

pub(super) static CSV: Declaration<WriteNet> = Declaration {
    path: "points.csv",
    what: "adjusted coordinates of all points, as CSV",
    readers: "spreadsheets, scripts",
    rows: "points",
    role: Role::Data,
    content: Content::Table(|| meanings(&columns())),
    write: |path, of| write_csv(path, table(of)),
    uses: &[],
};

pub(super) static GEOJSON: Declaration<WriteNet> = Declaration {
    path: "points.geojson",
    what: "the points on the sphere as GeoJSON",
    readers: "GIS",
    rows: "points",
    role: Role::Data,
    content: Content::Document(schema),
    write: |path, of| geojson::write(path, features(of)),
    uses: &[],
};

pub(super) static GEOPACKAGE: Declaration<WriteNet> = Declaration {
    path: "exchange/points.gpkg",
    what: "the points on the sphere as GeoPackage 1.3",
    readers: "GIS",
    rows: "points",
    role: Role::Data,
    content: Content::Foreign,
    write: |path, of| geopackage::write(path, features(of)),
    uses: &[],
};

fn table<'a>(of: &NetProducts<'a>) -> Table<'a> {
    Table::new(columns(), of.result.points.iter().collect())
}

fn features<'a>(of: &NetProducts<'a>) -> Features<'a> {
    let points = of.result.points.iter().map(|point| {
        let [longitude, latitude] = point.place_rad;
        [degrees(longitude), degrees(latitude), 0.0]
    });
    Features {
        name: &of.config.net,
        table: "points",
        // A net has no date; the machine's clock would give different bytes each time.
        newest_utc: "1970-01-01T00:00:00.000".to_owned(),
        body: Body::Mars,
        frame: "Mars body-fixed, areocentric latitude, east longitude, in the frame of the controls",
        z: "z: 0, because a plane triangulation has no heights".to_owned(),
        points: points.collect(),
        attributes: table(of),
    }
}

fn schema() -> DocumentSchema {
    let table = Table::new(columns(), Vec::new()).for_gis();
    let schema = geojson::schema(
        "Points of a net as GeoJSON",
        "points.geojson of areograph: adjusted points of a plane triangulation, Mars sphere, areocentric; west > east \
         in bbox when it crosses the antimeridian.",
        &table.columns().cloned().collect::<Vec<_>>(),
    );
    DocumentSchema {
        name: "net_points",
        schema,
    }
}

fn columns<'a>() -> Vec<Column<&'a PointResult>> {
    vec![
        column(
            "point",
            Unit::None,
            "name of the point",
            |row: &&PointResult| row.point.clone(),
        )
        .in_gis(),
        column(
            "pictures",
            Unit::None,
            "number of pictures that determine the position of the point",
            |row: &&PointResult| row.pictures,
        )
        .in_gis(),
        column(
            "is_control",
            Unit::None,
            "whether the point is a control that was kept",
            |row: &&PointResult| row.is_control,
        )
        .in_gis(),
        column(
            "x_m",
            Unit::Metre,
            "east coordinate on the map, metres",
            |row: &&PointResult| row.place_m[0],
        )
        .in_gis(),
        column(
            "y_m",
            Unit::Metre,
            "north coordinate on the map, metres",
            |row: &&PointResult| row.place_m[1],
        )
        .in_gis(),
        column(
            "sigma_m",
            Unit::Metre,
            "standard deviation of x_m and of y_m, metres on the map; missing if it is not determined",
            |row: &&PointResult| row.sigma_m,
        )
        .in_gis(),
        column(
            "longitude_deg",
            Unit::Degree,
            "east longitude, -180 to 180 degrees, in the frame of the controls",
            |row: &&PointResult| degrees(row.place_rad[0]),
        ),
        column(
            "latitude_deg",
            Unit::Degree,
            "areocentric latitude, degrees",
            |row: &&PointResult| degrees(row.place_rad[1]),
        ),
    ]
}
