//! Footprints: the columns of a shot, declared once for all formats.

mod columns;

use std::fmt;

use rayon::prelude::*;

pub(super) use columns::columns;

use super::{
    SiteProducts,
    coordinates::{bounding_box_deg, degrees, frame, signed_longitude_deg},
    geojson,
    geoparquet::geo_metadata,
    gis::Features,
    parquet, pds4_label,
    product::{Content, Declaration, Program, Role, Use, Write},
    table::{Meaning, Table, meanings},
    text_table,
};
use areograph_base::{
    column::Column, footprints::Footprints, frames::BodyFixed, packed::Packed,
    schema::DocumentSchema, utc::Utc,
};
use areograph_config::ShotFormat;
use areograph_geom::ellipsoid::{AreocentricLatitude, spherical_to_xyz_m};

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
    what: "PDS4-style label of footprints.csv",
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
        let bounds = bounding_box_deg(points_deg(of.site));
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
    /// The ground point, body-fixed.
    xyz_m: [f64; 3],
}

/// Texts of footprints.
pub(super) trait ShotNames: Sync {
    /// Writes the identifiers of the windows that hold the shot in this row, separated by semicolons.
    fn write_windows(&self, row: usize, out: &mut dyn fmt::Write) -> fmt::Result;

    /// Its UTC; unknown for shots of tables without this column.
    fn utc(&self, _row: usize) -> Utc {
        Utc::UNKNOWN
    }
}

impl ShotNames for SiteProducts<'_> {
    fn write_windows(&self, row: usize, out: &mut dyn fmt::Write) -> fmt::Result {
        let mask = self.footprints.windows.at(row);
        let windows = self.config.windows.iter().enumerate();
        let held = windows.filter(|(bit, _)| mask >> bit & 1 == 1);
        write_list(held.map(|(_, window)| window.id.as_str()), out)
    }

    fn utc(&self, row: usize) -> Utc {
        self.utc.at(row)
    }
}

/// Writes texts separated by semicolons.
pub(super) fn write_list<'a>(
    texts: impl Iterator<Item = &'a str>,
    out: &mut dyn fmt::Write,
) -> fmt::Result {
    for (place, text) in texts.enumerate() {
        if place > 0 {
            out.write_char(';')?;
        }
        out.write_str(text)?;
    }
    Ok(())
}

impl<'a> Shot<'a> {
    fn new(footprints: &'a Footprints<BodyFixed>, names: &'a dyn ShotNames, row: usize) -> Self {
        let (longitude_rad, latitude_rad) = (
            footprints.longitude_rad.at(row),
            footprints.latitude_rad.at(row),
        );
        let radius_m = footprints.ground_radius_m(row);
        Self {
            footprints,
            names,
            row,
            xyz_m: spherical_to_xyz_m(longitude_rad, latitude_rad, radius_m).into(),
        }
    }

    /// The shot in this row of a site's footprints.
    pub(super) fn of(site: &'a SiteProducts<'a>, row: usize) -> Self {
        Self::new(site.footprints, site, row)
    }

    /// All of these footprints.
    pub(super) fn all_of(
        footprints: &'a Footprints<BodyFixed>,
        names: &'a dyn ShotNames,
    ) -> Vec<Self> {
        let rows = (0..footprints.len()).into_par_iter();
        rows.map(|row| Self::new(footprints, names, row)).collect()
    }

    /// Name of the PEDR file.
    fn file_name(&self) -> &'a str {
        let file = usize::from(self.get(|of| &of.file));
        let source = self.footprints.files.get(file);
        source.map_or("", |source| &source.name)
    }

    /// The column of footprints that `of` picks, in the shot's row.
    pub(super) fn get<T: Packed>(&self, of: fn(&Footprints<BodyFixed>) -> &Column<T>) -> T {
        of(self.footprints).at(self.row)
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

    pub(super) fn point_deg(&self) -> [f64; 2] {
        point_deg(self.footprints, self.row)
    }
}

/// Longitude (-180..180) and latitude of the footprint in this row, degrees.
pub(super) fn point_deg(footprints: &Footprints<BodyFixed>, row: usize) -> [f64; 2] {
    [
        signed_longitude_deg(footprints.longitude_rad.at(row)),
        degrees(footprints.latitude_rad.at(row)),
    ]
}

/// All footprints of a site.
pub(super) fn table<'a>(site: &'a SiteProducts<'a>) -> Table<'a> {
    let shot = |row| Shot::of(site, row);
    Table::of(columns(), site.footprints.len(), shot).in_terms(&site.config.terms())
}

/// The footprints of a site for GIS.
pub(super) fn features<'a>(site: &'a SiteProducts<'a>) -> Features<'a> {
    let body = site.config.body;
    let point = |row: usize| {
        let [east_deg, north_deg] = point_deg(site.footprints, row);
        let height_m = site.footprints.radius_crossover_m.at(row) - body.map().radius_m;
        [east_deg, north_deg, height_m]
    };
    let rows = 0..site.footprints.len();
    Features::of_footprints(
        body,
        &site.config.site,
        site.newest_utc(),
        rows.map(point).collect(),
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
        "footprints.geojson of areograph: laser shots inside the windows, on the sphere of the body, with \
         planetocentric latitudes; west > east in a bbox that crosses the antimeridian.",
        &table.columns().cloned().collect::<Vec<_>>(),
    );
    DocumentSchema {
        name: "footprints",
        schema,
    }
}

/// Longitude (-180..180) and latitude of every footprint, degrees.
pub(super) fn points_deg<'a>(
    site: &'a SiteProducts<'a>,
) -> impl Iterator<Item = [f64; 2]> + Clone + 'a {
    let rows = 0..site.footprints.len();
    rows.map(|row| point_deg(site.footprints, row))
}
