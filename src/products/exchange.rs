//! Products in the forms of other programs: ISIS, Ames Stereo Pipeline, GIS, catalogues.

mod adjusted;
mod gcp;
mod geopackage;
mod lidar_data;
mod points;
mod readme;
mod shapefile;
mod stac;

pub use gcp::{ControlMeasure, ControlPoint, write_gcp};
pub use lidar_data::{LidarPoint, moc_serial_number, write_lidar_data};
pub use points::{GroundEstimate, ImageMeasure};
use serde_json::{Value, json};

use super::{
    Writer,
    coordinates::{FRAME, column_deg},
    files::{write_json, write_text},
    footprints::points_deg,
    kernel_report,
    site::SiteProducts,
    table::{Column, Table, Values},
    text_table,
};
use crate::{error::Result, units::METRES_PER_KM};

/// Decimals of degrees: 1e-9° are 0.06 mm on the ground.
const DEGREE_DECIMALS: usize = 9;
/// Decimals of kilometres: millimetres.
const KM_DECIMALS: usize = 6;
/// Decimals of metres: millimetres.
const METRE_DECIMALS: usize = 3;
/// Decimals of ephemeris seconds: microseconds.
const SECOND_DECIMALS: usize = 6;

/// What `pc_align` of Ames Stereo Pipeline must be told.
const LOLA_LIKE_FORMAT: &str = "2:lon 3:lat 4:radius_km";
const ODE_FORMAT: &str = "1:lon 2:lat 5:radius_m";

/// The sphere of the CRS, and of `D_MARS` in Ames Stereo Pipeline, metres.
const SPHERE_RADIUS_M: f64 = 3_396_190.0;
/// `IAU_2015:49900` as text for GIS; [`FRAME`] says whose longitudes the coordinates are.
const CRS_NAME: &str = "Mars (2015) - Sphere / Ocentric";
const CRS_WKT: &str = "GEOGCS[\"Mars (2015) - Sphere / Ocentric\",DATUM[\"Mars (2015) - Sphere\",\
    SPHEROID[\"Mars (2015) - Sphere\",3396190,0]],PRIMEM[\"Reference Meridian\",0],\
    UNIT[\"degree\",0.0174532925199433],AUTHORITY[\"IAU_2015\",\"49900\"]]";
/// What the third coordinate of points in GIS files is.
const POINT_Z_HEIGHT: &str = "z: radius after the crossover correction minus 3396190 m, metres";

/// Writes what goes into the folder `exchange`. A site without footprints gets no files of them: GIS readers
/// refuse tables without a row, or guess their types.
pub(super) fn write(written: &mut Writer, site: &SiteProducts) -> Result<()> {
    let points = points_deg(site);
    if !points.is_empty() {
        write_csv(written, &LOLA_LIKE, lola_like(site))?;
        write_csv(written, &ODE, ode_points(site))?;
        written.add("exchange/footprints.gpkg", |path| {
            geopackage::write(path, site, &points)
        })?;
        written.add("exchange/footprints.shp", |path| {
            shapefile::write(path, site, &points)
        })?;
        for extension in shapefile::COMPANIONS {
            // Written with the points.
            written.add(format!("exchange/footprints.{extension}"), |_| Ok(0))?;
        }
    }
    if let Some(geometric) = &site.geometric {
        adjusted::write(written, site, geometric)?;
    }
    written.add("exchange/kernels.json", |path| {
        write_json(path, &kernel_report::report(site))?;
        Ok(site.kernels.len() as u64)
    })?;
    written.add("exchange/README.txt", |path| {
        write_text(path, &readme::text(site))?;
        Ok(0)
    })?;
    if let Some(item) = stac::item(written.directory, &written.products, site, &points)? {
        written.add("exchange/stac_item.json", |path| {
            write_json(path, &item)?;
            Ok(0)
        })?;
    }
    Ok(())
}

/// A CSV file and what its readers must be told.
struct CsvFile {
    name: &'static str,
    csv_format: &'static str,
    radius: &'static str,
}

const LOLA_LIKE: CsvFile = CsvFile {
    name: "lola_like.csv",
    csv_format: LOLA_LIKE_FORMAT,
    radius: "column 4 is the distance from the centre of Mars after the crossover correction, kilometres: for heights; \
             the range of column 5 belongs to the radius before it, column 6: for range constraints; \
             column 6 the same before it; no column is a height",
};
const ODE: CsvFile = CsvFile {
    name: "ode_pts.csv",
    csv_format: ODE_FORMAT,
    radius: "column 5 is the distance from the centre of Mars after the crossover correction, metres; \
             column 3 is that minus the radius of the areoid, no height above a sphere",
};

/// Writes a table, and beside it what its readers must be told.
fn write_csv(written: &mut Writer, file: &CsvFile, columns: Vec<Column>) -> Result<()> {
    let table = Table::new(columns)?;
    let sidecar = sidecar(file, &table);
    written.add(format!("exchange/{}", file.name), |path| {
        text_table::write(path, &table)
    })?;
    written.add(format!("exchange/{}.json", file.name), |path| {
        write_json(path, &sidecar)?;
        Ok(0)
    })
}

fn sidecar(file: &CsvFile, table: &Table) -> Value {
    let column = |column: &Column| json!({ "name": column.name, "meaning": column.description });
    json!({
        "file": file.name,
        "csv_format": file.csv_format,
        "datum": "D_MARS",
        "datum_radius_m": SPHERE_RADIUS_M,
        "radius": file.radius,
        "frame": FRAME,
        "longitudes": "east, 0..360",
        "header_lines": 1,
        "columns": table.columns.iter().map(column).collect::<Vec<_>>(),
    })
}

fn fixed(name: &'static str, meaning: &'static str, values: Vec<f64>, decimals: usize) -> Column {
    Column::new(name, meaning, Values::Fixed(values, decimals))
}

fn km(values_m: &[f64]) -> Vec<f64> {
    values_m.iter().map(|value| value / METRES_PER_KM).collect()
}

/// Columns 1 to 5 as ISIS `lrolola2isis` reads them.
fn lola_like(site: &SiteProducts) -> Vec<Column> {
    let shots = site.footprints;
    vec![
        Column::new(
            "utc",
            "corrected time of the shot, UTC",
            Values::Text(site.utc.to_vec()),
        ),
        fixed(
            "longitude_deg",
            "east longitude, degrees",
            column_deg(&shots.longitude_rad),
            DEGREE_DECIMALS,
        ),
        fixed(
            "latitude_deg",
            "areocentric latitude, degrees",
            column_deg(&shots.latitude_rad),
            DEGREE_DECIMALS,
        ),
        fixed(
            "radius_crossover_km",
            "radius after the crossover correction, kilometres",
            km(&shots.radius_crossover_m),
            KM_DECIMALS,
        ),
        fixed(
            "range_km",
            "one-way range, kilometres",
            km(&shots.range_m),
            KM_DECIMALS,
        ),
        fixed(
            "radius_km",
            "radius before the crossover correction, kilometres",
            km(&shots.radius_m),
            KM_DECIMALS,
        ),
        fixed(
            "et_s",
            "corrected time of the shot, TDB seconds past J2000",
            shots.et_s.clone(),
            SECOND_DECIMALS,
        ),
        Column::new(
            "orbit",
            "orbit number of the frame",
            Values::U32(shots.orbit.clone()),
        ),
    ]
}

/// Columns and units of the PEDR point files of the Orbital Data Explorer.
fn ode_points(site: &SiteProducts) -> Vec<Column> {
    let shots = site.footprints;
    vec![
        fixed(
            "LONG_EAST",
            "east longitude, degrees",
            column_deg(&shots.longitude_rad),
            DEGREE_DECIMALS,
        ),
        fixed(
            "LAT_NORTH",
            "areocentric latitude, degrees",
            column_deg(&shots.latitude_rad),
            DEGREE_DECIMALS,
        ),
        fixed(
            "TOPOGRAPHY",
            "radius after the crossover correction minus areoid radius, metres",
            shots.topography_m(),
            METRE_DECIMALS,
        ),
        fixed(
            "RANGE",
            "one-way range, metres",
            shots.range_m.clone(),
            METRE_DECIMALS,
        ),
        fixed(
            "PLANET_RAD",
            "radius after the crossover correction, metres",
            shots.radius_crossover_m.clone(),
            METRE_DECIMALS,
        ),
        fixed(
            "EPHEMERIS_TIME",
            "corrected time of the shot, TDB seconds past J2000",
            shots.et_s.clone(),
            SECOND_DECIMALS,
        ),
        Column::new(
            "ORBIT",
            "orbit number of the frame",
            Values::U32(shots.orbit.clone()),
        ),
    ]
}
