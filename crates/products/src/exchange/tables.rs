//! Footprints as CSV files that ISIS and Ames Stereo Pipeline read, each with a document of its columns.

use std::borrow::Cow;

use schemars::JsonSchema;
use serde::Serialize;

use super::{DEGREE_DECIMALS, KM_DECIMALS, METRE_DECIMALS, SECOND_DECIMALS};
use crate::{
    SiteProducts,
    coordinates::{degrees, frame},
    files::write_json,
    footprints::Shot,
    product::{Content, Declaration, Program, Role, Use, Write},
    table::{Column, Table, Unit, column, meanings},
    text_table,
};
use areograph_base::{schema::DocumentSchema, units::METRES_PER_KM};
use areograph_config::ShotFormat;

pub(crate) static LOLA_LIKE: Declaration = Declaration {
    path: "exchange/lola_like.csv",
    what: "footprints in the format of LOLA's reduced data records: UTC, longitude, latitude, radius in km, range in \
           km, ...",
    readers: "ISIS, Ames Stereo Pipeline",
    rows: "shots",
    role: Role::Data,
    content: Content::Table(|| meanings(&lola_like())),
    write: Write::Footprints(ShotFormat::Lola, |path, of| {
        text_table::write(path, table(of.site, lola_like()))
    }),
    uses: &[
        Use {
            program: Program::StereoPipeline,
            lines: "pc_align --max-displacement 1000 --csv-format '2:lon 3:lat 4:radius_km' --datum {asp_datum} \\\n  \
                    dem.tif lola_like.csv -o run/out",
        },
        Use {
            program: Program::Isis,
            lines: "lrolola2isis from=lola_like.csv cubes=cubes.lis pointid={altimeter}???? to=lidar.json\n\
                    # Lidar points of ISIS need the line and sample at which each image sees the shot, which lrolola2isis\n\
                    # computes (lidar.json contains both for a site with tie points). The program reads column 4, the radius\n\
                    # after the crossover correction; the range in column 5 refers to column 6, the radius before the\n\
                    # correction. For range constraints, first exchange columns 4 and 6:\n\
                    awk -F, -v OFS=, '{ t = $4; $4 = $6; $6 = t; print }' lola_like.csv > lola_raw.csv",
        },
    ],
};

pub(crate) static LOLA_LIKE_SIDECAR: Declaration = Declaration {
    path: "exchange/lola_like.csv.json",
    what: "columns, --csv-format and radii of lola_like.csv",
    readers: "scripts",
    rows: "",
    role: Role::Metadata,
    content: Content::Document(schema),
    write: Write::Footprints(ShotFormat::Lola, |path, of| {
        let sidecar = Sidecar::new(
            of.site,
            "lola_like.csv",
            "2:lon 3:lat 4:radius_km",
            LOLA_LIKE_RADIUS,
            &lola_like(),
        );
        write_json(path, &sidecar).map(|()| 0)
    }),
    uses: &[],
};

pub(crate) static ODE: Declaration = Declaration {
    path: "exchange/ode_pts.csv",
    what: "footprints in the point format of the Orbital Data Explorer",
    readers: "Ames Stereo Pipeline",
    rows: "shots",
    role: Role::Data,
    content: Content::Table(|| meanings(&ode_points())),
    write: Write::Footprints(ShotFormat::Ode, |path, of| {
        text_table::write(path, table(of.site, ode_points()))
    }),
    uses: &[Use {
        program: Program::StereoPipeline,
        lines: "pc_align --max-displacement 1000 --csv-format '1:lon 2:lat 5:radius_m' --datum {asp_datum} \\\n  \
                dem.tif ode_pts.csv -o run/out",
    }],
};

pub(crate) static ODE_SIDECAR: Declaration = Declaration {
    path: "exchange/ode_pts.csv.json",
    what: "columns, --csv-format and radii of ode_pts.csv",
    readers: "scripts",
    rows: "",
    role: Role::Metadata,
    content: Content::Document(schema),
    write: Write::Footprints(ShotFormat::Ode, |path, of| {
        let sidecar = Sidecar::new(
            of.site,
            "ode_pts.csv",
            "1:lon 2:lat 5:radius_m",
            ODE_RADIUS,
            &ode_points(),
        );
        write_json(path, &sidecar).map(|()| 0)
    }),
    uses: &[],
};

const LOLA_LIKE_RADIUS: &str = "column 4, for heights, is the distance from the centre of {body} after the crossover correction, \
     kilometres; column 6, for range constraints, is this distance before the correction, to which the range in \
     column 5 refers; no column contains heights";
const ODE_RADIUS: &str = "column 5 is the distance from the centre of {body} after the crossover correction, metres; \
     column 3 is this distance minus the radius of the {areoid}, not a height above a sphere";

/// Description of a CSV file for its readers.
#[derive(Serialize, JsonSchema)]
#[schemars(title = "Columns of a CSV file")]
struct Sidecar {
    /// Name of the described file.
    file: &'static str,
    /// Options for `pc_align` of Ames Stereo Pipeline.
    csv_format: &'static str,
    #[schemars(extend("enum" = ["D_MARS", "D_MOON"]))]
    datum: &'static str,
    #[schemars(extend("exclusiveMinimum" = 0))]
    datum_radius_m: f64,
    /// Definition of the radii.
    radius: Cow<'static, str>,
    /// Reference frame of the longitudes and latitudes.
    frame: &'static str,
    #[schemars(extend("const" = "east, 0..360"))]
    longitudes: &'static str,
    #[schemars(extend("const" = 1))]
    header_lines: u32,
    #[schemars(length(min = 1))]
    columns: Vec<SidecarColumn>,
}

/// A column of a CSV file.
#[derive(Serialize, JsonSchema)]
struct SidecarColumn {
    name: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    unit: Option<&'static str>,
    meaning: String,
}

impl Sidecar {
    fn new(
        site: &SiteProducts,
        file: &'static str,
        csv_format: &'static str,
        radius: &'static str,
        columns: &[Column<Shot>],
    ) -> Self {
        let (body, terms) = (site.config.body, site.config.terms());
        let columns = meanings(columns).into_iter().map(|column| SidecarColumn {
            name: column.name,
            unit: column.unit.symbol(),
            meaning: terms.fill(&column.description).into_owned(),
        });
        Self {
            file,
            csv_format,
            datum: &body.map().asp_datum,
            datum_radius_m: body.map().radius_m,
            radius: terms.fill(radius),
            frame: frame(body),
            longitudes: "east, 0..360",
            header_lines: 1,
            columns: columns.collect(),
        }
    }
}

/// Schema of the documents beside the files.
pub(crate) fn schema() -> DocumentSchema {
    DocumentSchema::of::<Sidecar>("csv_columns")
}

fn table<'a>(site: &'a SiteProducts<'a>, columns: Vec<Column<Shot<'a>>>) -> Table<'a> {
    let shot = |row| Shot::of(site, row);
    Table::of(columns, site.footprints.len(), shot).in_terms(&site.config.terms())
}

/// Columns 1 to 5, in the order that ISIS `lrolola2isis` reads.
fn lola_like<'a>() -> Vec<Column<Shot<'a>>> {
    vec![
        column(
            "utc",
            Unit::None,
            "corrected time of the shot, UTC",
            |shot: &Shot| shot.utc().to_string(),
        ),
        column(
            "longitude_deg",
            Unit::Degree,
            "east longitude, degrees",
            |shot: &Shot| degrees(shot.get(|footprints| &footprints.longitude_rad)),
        )
        .decimals(DEGREE_DECIMALS),
        column(
            "latitude_deg",
            Unit::Degree,
            "{latitude} latitude, degrees",
            |shot: &Shot| degrees(shot.get(|footprints| &footprints.latitude_rad)),
        )
        .decimals(DEGREE_DECIMALS),
        column(
            "radius_crossover_km",
            Unit::Kilometre,
            "radius after the crossover correction, kilometres",
            |shot: &Shot| shot.get(|footprints| &footprints.radius_crossover_m) / METRES_PER_KM,
        )
        .decimals(KM_DECIMALS),
        column(
            "range_km",
            Unit::Kilometre,
            "one-way range, kilometres",
            |shot: &Shot| shot.get(|footprints| &footprints.range_m) / METRES_PER_KM,
        )
        .decimals(KM_DECIMALS),
        column(
            "radius_km",
            Unit::Kilometre,
            "radius before the crossover correction, kilometres",
            |shot: &Shot| shot.get(|footprints| &footprints.radius_m) / METRES_PER_KM,
        )
        .decimals(KM_DECIMALS),
        column(
            "et_s",
            Unit::Second,
            "corrected time of the shot, TDB seconds past J2000",
            |shot: &Shot| shot.get(|footprints| &footprints.et_s),
        )
        .decimals(SECOND_DECIMALS),
        column(
            "orbit",
            Unit::None,
            "orbit number of the frame",
            |shot: &Shot| shot.get(|footprints| &footprints.orbit),
        ),
    ]
}

/// Columns and units of the PEDR point files of the Orbital Data Explorer.
fn ode_points<'a>() -> Vec<Column<Shot<'a>>> {
    vec![
        column(
            "LONG_EAST",
            Unit::Degree,
            "east longitude, degrees",
            |shot: &Shot| degrees(shot.get(|footprints| &footprints.longitude_rad)),
        )
        .decimals(DEGREE_DECIMALS),
        column(
            "LAT_NORTH",
            Unit::Degree,
            "{latitude} latitude, degrees",
            |shot: &Shot| degrees(shot.get(|footprints| &footprints.latitude_rad)),
        )
        .decimals(DEGREE_DECIMALS),
        column(
            "TOPOGRAPHY",
            Unit::Metre,
            "radius after the crossover correction minus the radius of the {areoid}, metres",
            Shot::topography_m,
        )
        .decimals(METRE_DECIMALS),
        column(
            "RANGE",
            Unit::Metre,
            "one-way range, metres",
            |shot: &Shot| shot.get(|footprints| &footprints.range_m),
        )
        .decimals(METRE_DECIMALS),
        column(
            "PLANET_RAD",
            Unit::Metre,
            "radius after the crossover correction, metres",
            |shot: &Shot| shot.get(|footprints| &footprints.radius_crossover_m),
        )
        .decimals(METRE_DECIMALS),
        column(
            "EPHEMERIS_TIME",
            Unit::Second,
            "corrected time of the shot, TDB seconds past J2000",
            |shot: &Shot| shot.get(|footprints| &footprints.et_s),
        )
        .decimals(SECOND_DECIMALS),
        column(
            "ORBIT",
            Unit::None,
            "orbit number of the frame",
            |shot: &Shot| shot.get(|footprints| &footprints.orbit),
        ),
    ]
}
