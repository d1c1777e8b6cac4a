//! Footprints: the columns of a shot, declared once for all formats.

use super::{
    SiteProducts,
    coordinates::{bounding_box_deg, degrees, frame, signed_longitude_deg},
    geojson,
    geoparquet::{geo_metadata, well_known_binary},
    gis::Features,
    parquet, pds4_label,
    product::{Content, Declaration, Program, Role, Use, Write},
    table::{Column, Meaning, Table, Unit, column, meanings},
    text_table,
};
use areograph_base::{footprints::Footprints, frames::BodyFixed, schema::DocumentSchema, utc::Utc};
use areograph_config::ShotFormat;
use areograph_geom::{
    ellipsoid::{AreocentricLatitude, spherical_to_xyz_m},
    range_residuals::states_spacecraft,
};

pub(super) static CSV: Declaration = Declaration {
    path: "footprints.csv",
    what: "laser shots inside the windows, {frame}",
    readers: "scripts",
    rows: "shots",
    role: Role::Data,
    content: Content::Table(text_columns),
    write: Write::Footprints(ShotFormat::Csv, |path, of| {
        text_table::write(path, table(of.site))
    }),
    uses: &[],
};

pub(super) static LABEL: Declaration = Declaration {
    path: "footprints.xml",
    what: "label of footprints.csv in the style of PDS4",
    readers: "archives",
    rows: "shots",
    role: Role::Metadata,
    content: Content::Foreign,
    write: Write::Footprints(ShotFormat::Csv, |path, of| {
        pds4_label::write(path, &path.with_extension("csv"), table(of.site), of.site)
    }),
    uses: &[],
};

pub(super) static PARQUET: Declaration = Declaration {
    path: "footprints.parquet",
    what: "laser shots inside the windows as GeoParquet 1.1",
    readers: "scripts, GIS",
    rows: "shots",
    role: Role::Data,
    content: Content::Table(|| meanings(&columns())),
    write: Write::Site(|path, of| {
        let bounds = bounding_box_deg(&points_deg(of.site));
        let mut metadata = vec![
            (
                "geo",
                geo_metadata(of.site.config.body, bounds, None).to_string(),
            ),
            ("frame", frame(of.site.config.body).to_owned()),
        ];
        let choice = of.site.footprints.ground_choice();
        metadata.extend(choice.map(|of| ("ground_radius", of.words().to_owned())));
        parquet::write(path, &table(of.site), metadata).map(Some)
    }),
    uses: &[Use {
        program: Program::Gis,
        lines: "python3 -c 'import geopandas; print(geopandas.read_parquet(\"../footprints.parquet\"))'",
    }],
};

pub(super) static GEOJSON: Declaration = Declaration {
    path: "footprints.geojson",
    what: "laser shots inside the windows as two-dimensional points",
    readers: "GIS, web maps",
    rows: "shots",
    role: Role::Data,
    content: Content::Document(schema),
    write: Write::Footprints(ShotFormat::Geojson, |path, of| {
        geojson::write(path, features(of.site))
    }),
    uses: &[Use {
        program: Program::Gis,
        lines: "ogrinfo -al -so ../footprints.geojson            two-dimensional",
    }],
};

/// A footprint with its names.
#[derive(Clone, Copy)]
pub(super) struct Shot<'a> {
    footprints: &'a Footprints<BodyFixed>,
    names: &'a dyn ShotNames,
    row: usize,
}

/// Texts of footprints.
pub(super) trait ShotNames: Sync {
    /// Identifiers of the windows that hold the shot in this row, separated by semicolons.
    fn windows(&self, row: usize) -> String;

    /// Its UTC; of sources without it, for tables without this column, an arbitrary instant.
    fn utc(&self, _row: usize) -> Utc {
        Utc::from_microseconds(0)
    }
}

impl ShotNames for SiteProducts<'_> {
    fn windows(&self, row: usize) -> String {
        self.window_ids(self.footprints.windows[row])
    }

    fn utc(&self, row: usize) -> Utc {
        self.utc[row]
    }
}

impl<'a> Shot<'a> {
    /// All of a site.
    pub(super) fn all(site: &'a SiteProducts<'a>) -> Vec<Self> {
        Self::all_of(site.footprints, site)
    }

    /// All of these footprints.
    pub(super) fn all_of(
        footprints: &'a Footprints<BodyFixed>,
        names: &'a dyn ShotNames,
    ) -> Vec<Self> {
        let shot = |row| Self {
            footprints,
            names,
            row,
        };
        (0..footprints.len()).map(shot).collect()
    }

    /// Name of the PEDR file.
    fn file_name(&self) -> String {
        let file = usize::from(self.get(|of| &of.file));
        let source = self.footprints.files.get(file);
        source.map_or_else(String::new, |source| source.name.clone())
    }

    /// The column of footprints that `of` picks, in the shot's row.
    pub(super) fn get<T: Copy>(&self, of: fn(&Footprints<BodyFixed>) -> &Vec<T>) -> T {
        of(self.footprints)[self.row]
    }

    pub(super) fn utc(&self) -> Utc {
        self.names.utc(self.row)
    }

    /// Height above the areoid, after the crossover correction, metres.
    pub(super) fn topography_m(&self) -> f64 {
        self.footprints.topography_of_m(self.row)
    }

    fn areographic_deg(&self) -> f64 {
        let latitude = AreocentricLatitude(self.get(|of| &of.latitude_rad));
        degrees(latitude.to_areographic(self.footprints.body.model()).0)
    }

    fn xyz_m(&self, axis: usize) -> f64 {
        let longitude_rad = self.get(|of| &of.longitude_rad);
        let latitude_rad = self.get(|of| &of.latitude_rad);
        let radius_m = self.footprints.ground_radius_m(self.row);
        spherical_to_xyz_m(longitude_rad, latitude_rad, radius_m)[axis]
    }

    pub(super) fn point_deg(&self) -> [f64; 2] {
        [
            signed_longitude_deg(self.get(|of| &of.longitude_rad)),
            degrees(self.get(|of| &of.latitude_rad)),
        ]
    }
}

/// All footprints of a site.
pub(super) fn table<'a>(site: &'a SiteProducts<'a>) -> Table<'a> {
    let footprints = site.footprints;
    let shot = |row| Shot {
        footprints,
        names: site,
        row,
    };
    Table::of(columns(), footprints.len(), shot).in_terms(&site.config.terms())
}

/// The footprints of a site for GIS.
pub(super) fn features<'a>(site: &'a SiteProducts<'a>) -> Features<'a> {
    let body = site.config.body;
    let point = |shot: &Shot| {
        let [east_deg, north_deg] = shot.point_deg();
        let height_m = shot.get(|footprints| &footprints.radius_crossover_m) - body.map().radius_m;
        [east_deg, north_deg, height_m]
    };
    Features::of_footprints(
        body,
        &site.config.site,
        site.newest_utc(),
        Shot::all(site).iter().map(point).collect(),
        table(site),
    )
}

/// The columns of the CSV file.
fn text_columns() -> Vec<Meaning> {
    let table = Table::new(columns(), Vec::new()).for_text();
    table.columns().cloned().collect()
}

/// Schema of the GeoJSON file.
pub(super) fn schema() -> DocumentSchema {
    let table = Table::new(columns(), Vec::new()).for_gis();
    let schema = geojson::schema(
        "Footprints as GeoJSON",
        "footprints.geojson of areograph: laser shots inside the windows, on the sphere of the body, with latitudes at its \
         centre; west > east in a bbox that crosses the antimeridian.",
        &table.columns().cloned().collect::<Vec<_>>(),
    );
    DocumentSchema {
        name: "footprints",
        schema,
    }
}

/// Longitude (-180..180) and latitude of every footprint, degrees.
pub(super) fn points_deg(site: &SiteProducts) -> Vec<[f64; 2]> {
    Shot::all(site).iter().map(Shot::point_deg).collect()
}

pub(super) fn columns<'a>() -> Vec<Column<Shot<'a>>> {
    let mut columns = identity();
    columns.extend(quality());
    columns.extend(ground());
    columns.extend(heights());
    columns.extend(spacecraft());
    columns.push(column(
        "geometry",
        Unit::None,
        "point, longitude (-180..180) and {latitude} latitude in degrees, well-known binary",
        |shot: &Shot| well_known_binary(shot.point_deg()),
    ));
    columns
}

/// Time of a shot and its place in the file.
fn identity<'a>() -> Vec<Column<Shot<'a>>> {
    vec![
        column(
            "et_tag_s",
            Unit::Second,
            "time tag of the shot in the file, TDB seconds past J2000",
            |shot: &Shot| shot.get(|footprints| &footprints.et_tag_s),
        ),
        column(
            "et_s",
            Unit::Second,
            "time of the shot after the {altimeter} clock correction, TDB seconds past J2000",
            |shot: &Shot| shot.get(|footprints| &footprints.et_s),
        )
        .in_gis()
        .in_dbase("et_s", 20, 6),
        column("utc", Unit::None, "et_s as UTC, ISO 8601", Shot::utc)
            .in_gis()
            .in_dbase("utc", 0, 0),
        column(
            "orbit",
            Unit::None,
            "orbit number of the frame",
            |shot: &Shot| shot.get(|footprints| &footprints.orbit),
        )
        .in_gis()
        .in_dbase("orbit", 10, 0),
        column("source_file", Unit::None, "{shot_file}", |shot: &Shot| {
            shot.file_name()
        })
        .in_gis()
        .in_dbase("file", 0, 0),
        column("record", Unit::None, "{record}", |shot: &Shot| {
            shot.get(|footprints| &footprints.record)
        })
        .in_gis()
        .in_dbase("record", 10, 0),
        column(
            "shot",
            Unit::None,
            "number of the shot in its frame, 1 to 20",
            |shot: &Shot| u32::from(shot.get(|footprints| &footprints.shot)),
        )
        .between(1, 20)
        .in_gis()
        .in_dbase("shot", 3, 0),
    ]
}

/// Quality flags of a shot in its file, and the windows that hold it.
fn quality<'a>() -> Vec<Column<Shot<'a>>> {
    vec![
        column("channel", Unit::None, "trigger channel", |shot: &Shot| {
            u32::from(shot.get(|footprints| &footprints.channel))
        }),
        column(
            "class",
            Unit::None,
            "classification: 1 ground, 0 cloud or noise",
            |shot: &Shot| i32::from(shot.get(|footprints| &footprints.class)),
        ),
        column(
            "attitude_flag",
            Unit::None,
            "attitude: 0 known, 2 known for part of the frame, 3 unknown",
            |shot: &Shot| u32::from(shot.get(|footprints| &footprints.attitude_flag)),
        ),
        column(
            "orbit_quality",
            Unit::None,
            "source of the orbit: 0 for JPL, otherwise the number of the gravity model",
            |shot: &Shot| u32::from(shot.get(|footprints| &footprints.orbit_quality)),
        ),
        column(
            "windows",
            Unit::None,
            "identifiers of the windows that contain the shot, separated by semicolons",
            |shot: &Shot| shot.names.windows(shot.row),
        )
        .last_in_gis(),
    ]
}

/// Position of the footprint.
fn ground<'a>() -> Vec<Column<Shot<'a>>> {
    vec![
        column(
            "longitude_deg",
            Unit::Degree,
            "east longitude, 0..360 degrees, {frame}",
            |shot: &Shot| degrees(shot.get(|footprints| &footprints.longitude_rad)),
        )
        .in_dbase("lon_deg", 14, 9),
        column(
            "latitude_deg",
            Unit::Degree,
            "{latitude} latitude, degrees, {frame}",
            |shot: &Shot| degrees(shot.get(|footprints| &footprints.latitude_rad)),
        )
        .in_dbase("lat_deg", 14, 9),
        column(
            "latitude_areographic_deg",
            Unit::Degree,
            "{latitude_of_maps} latitude, degrees, {frame} radii; convention of older maps",
            Shot::areographic_deg,
        ),
    ]
}

/// Its height.
fn heights<'a>() -> Vec<Column<Shot<'a>>> {
    vec![
        column(
            "radius_m",
            Unit::Metre,
            "planetary radius before the crossover correction, metres",
            |shot: &Shot| shot.get(|footprints| &footprints.radius_m),
        )
        .in_gis()
        .in_dbase("radius_m", 12, 3),
        column(
            "radius_crossover_m",
            Unit::Metre,
            "planetary radius after the crossover correction, metres",
            |shot: &Shot| shot.get(|footprints| &footprints.radius_crossover_m),
        )
        .in_gis()
        .in_dbase("radius_x_m", 12, 3),
        column(
            "areoid_radius_m",
            Unit::Metre,
            "radius of the {areoid}, metres",
            |shot: &Shot| shot.get(|footprints| &footprints.areoid_radius_m),
        ),
        column(
            "topography_m",
            Unit::Metre,
            "radius after the crossover correction minus the radius of the {areoid}, metres",
            Shot::topography_m,
        )
        .in_gis()
        .in_dbase("topo_m", 12, 3),
        column(
            "x_m",
            Unit::Metre,
            "{frame} body-fixed X of the ground point, with the radius that all stages use, metres",
            |shot: &Shot| shot.xyz_m(0),
        ),
        column(
            "y_m",
            Unit::Metre,
            "{frame} body-fixed Y of the ground point, with the radius that all stages use, metres",
            |shot: &Shot| shot.xyz_m(1),
        ),
        column(
            "z_m",
            Unit::Metre,
            "{frame} body-fixed Z of the ground point, with the radius that all stages use, metres",
            |shot: &Shot| shot.xyz_m(2),
        ),
    ]
}

fn spacecraft<'a>() -> Vec<Column<Shot<'a>>> {
    vec![
        column(
            "range_m",
            Unit::Metre,
            "one-way range to the spacecraft's centre of mass, metres",
            |shot: &Shot| shot.get(|footprints| &footprints.range_m),
        )
        .in_gis()
        .in_dbase("range_m", 12, 3),
        column(
            "spacecraft_longitude_deg",
            Unit::Degree,
            "east longitude of the spacecraft from the orbit in the file, degrees, {frame}",
            |shot: &Shot| degrees(shot.get(|footprints| &footprints.spacecraft_longitude_rad)),
        ),
        column(
            "spacecraft_latitude_deg",
            Unit::Degree,
            "{latitude} latitude of the spacecraft from the orbit in the file, degrees",
            |shot: &Shot| degrees(shot.get(|footprints| &footprints.spacecraft_latitude_rad)),
        ),
        column(
            "spacecraft_radius_m",
            Unit::Metre,
            "distance of the spacecraft from the centre of {body}, from the orbit in the file, metres",
            |shot: &Shot| shot.get(|footprints| &footprints.spacecraft_radius_m),
        ),
        column(
            "off_nadir_deg",
            Unit::Degree,
            "off-nadir angle of the laser, degrees",
            |shot: &Shot| degrees(shot.get(|footprints| &footprints.off_nadir_rad)),
        ),
        column(
            "nadir_by_range",
            Unit::None,
            "whether the file lacks spacecraft positions: the position is then on the radius through the footprint, at \
             range_m",
            |shot: &Shot| !states_spacecraft(shot.footprints, shot.row),
        ),
    ]
}
