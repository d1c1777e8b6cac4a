//! Footprints in the formats that ISIS and Ames Stereo Pipeline read.

use serde_json::json;

use super::{
    Writer,
    coordinates::{FRAME, column_deg},
    files::{write_json, write_text},
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

pub(super) fn write(written: &mut Writer, site: &SiteProducts) -> Result<()> {
    written.add("exchange/lola_like.csv", |path| {
        text_table::write(path, &Table::new(lola_like(site))?)
    })?;
    written.add("exchange/ode_pts.csv", |path| {
        text_table::write(path, &Table::new(ode_points(site))?)
    })?;
    written.add("exchange/formats.json", |path| {
        write_json(path, &formats())?;
        Ok(0)
    })?;
    written.add("exchange/README.txt", |path| {
        write_text(path, &readme())?;
        Ok(0)
    })
}

fn fixed(name: &'static str, values: Vec<f64>, decimals: usize) -> Column {
    Column::new(name, "", Values::Fixed(values, decimals))
}

fn km(values_m: &[f64]) -> Vec<f64> {
    values_m.iter().map(|value| value / METRES_PER_KM).collect()
}

/// Columns 1 to 5 as ISIS `lrolola2isis` reads them.
fn lola_like(site: &SiteProducts) -> Vec<Column> {
    let shots = site.footprints;
    vec![
        Column::new("utc", "", Values::Text(site.utc.to_vec())),
        fixed(
            "longitude_deg",
            column_deg(&shots.longitude_rad),
            DEGREE_DECIMALS,
        ),
        fixed(
            "latitude_deg",
            column_deg(&shots.latitude_rad),
            DEGREE_DECIMALS,
        ),
        fixed(
            "radius_crossover_km",
            km(&shots.radius_crossover_m),
            KM_DECIMALS,
        ),
        fixed("range_km", km(&shots.range_m), KM_DECIMALS),
        fixed("radius_km", km(&shots.radius_m), KM_DECIMALS),
        fixed("et_s", shots.et_s.clone(), SECOND_DECIMALS),
        Column::new("orbit", "", Values::U32(shots.orbit.clone())),
    ]
}

/// Columns and units of the PEDR point files of the Orbital Data Explorer.
fn ode_points(site: &SiteProducts) -> Vec<Column> {
    let shots = site.footprints;
    vec![
        fixed(
            "LONG_EAST",
            column_deg(&shots.longitude_rad),
            DEGREE_DECIMALS,
        ),
        fixed(
            "LAT_NORTH",
            column_deg(&shots.latitude_rad),
            DEGREE_DECIMALS,
        ),
        fixed("TOPOGRAPHY", shots.topography_m(), METRE_DECIMALS),
        fixed("RANGE", shots.range_m.clone(), METRE_DECIMALS),
        fixed(
            "PLANET_RAD",
            shots.radius_crossover_m.clone(),
            METRE_DECIMALS,
        ),
        fixed("EPHEMERIS_TIME", shots.et_s.clone(), SECOND_DECIMALS),
        Column::new("ORBIT", "", Values::U32(shots.orbit.clone())),
    ]
}

fn formats() -> serde_json::Value {
    json!({
        "frame": "Mars body-fixed, IAU 2000; areocentric latitude, east longitude 0..360",
        "files": {
            "lola_like.csv": {
                "csv_format": LOLA_LIKE_FORMAT,
                "datum": "D_MARS",
                "heights": "planetary radius after the crossover correction (column 4); before it in column 6",
            },
            "ode_pts.csv": {
                "csv_format": ODE_FORMAT,
                "datum": "D_MARS",
                "heights": "planetary radius after the crossover correction; TOPOGRAPHY is above the areoid",
            },
        },
        "datum_radius_m": 3_396_190,
    })
}

fn readme() -> String {
    format!(
        "Footprints for other programs: Mars body-fixed, IAU 2000, areocentric latitude, east longitude 0..360.\n\
         The first line of each CSV file names its columns. Times are corrected shot times.\n\
         \n\
         Frame: {FRAME}.\n\
         \n\
         Ames Stereo Pipeline (radii, so that the choice of datum does not matter; D_MARS is a sphere of 3396190 m):\n\
         \x20 pc_align --csv-format '{LOLA_LIKE_FORMAT}' --datum D_MARS ... lola_like.csv\n\
         \x20 pc_align --csv-format '{ODE_FORMAT}' --datum D_MARS ... ode_pts.csv\n\
         \n\
         ISIS (columns UTC, longitude, latitude, radius in km, range in km; cubes need spiceinit first):\n\
         \x20 lrolola2isis from=lola_like.csv cubes=cubes.lis pointid=MOLA???? to=lidar.json\n\
         \n\
         There is no ready lidar file for ISIS here: its points need the line and sample at which each image\n\
         sees the shot, and ISIS itself leaves out points without any. lrolola2isis computes them.\n"
    )
}
