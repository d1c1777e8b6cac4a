//! Registered footprints: one table with every footprint that an image shows, on the ground and in the image, before and
//! after the adjustment.
//!
//! The other tables are complete and separate: all footprints (`footprints`), all of them in all images
//! (`registration`), those in the adjustment (`adjusted_footprints`). Users who place footprints in images need columns of
//! all three.

use std::collections::BTreeMap;

use super::{
    coordinates::{bounding_box_deg, degrees, frame, signed_longitude_deg},
    exchange::geopackage,
    geoparquet::{geo_metadata, well_known_binary},
    gis::Features,
    parquet,
    product::{Content, Context, Declaration, Program, Role, Use, Write},
    registration,
    site::{ImageProducts, SiteProducts},
    table::{Column, Meaning, Table, Unit, column, meanings},
    text_table,
};
use areograph_config::ShotFormat;
use areograph_stages::{
    adjust::{CorrectedPoint, PointKind},
    register::RegisteredPoints,
};

/// Sites with these products.
const SITES: &str = "a site with footprints inside its images";
/// Table of the GeoPackage.
pub(super) const LAYER: &str = "registered_footprints";
const WHAT: &str = "footprints inside images: ground coordinates, and image coordinates before and after the adjustment";

pub(super) static PARQUET: Declaration = Declaration {
    path: "registered_footprints.parquet",
    what: WHAT,
    readers: "scripts, GIS",
    rows: "footprints inside images",
    role: Role::Data,
    content: Content::Table(|| meanings(&columns())),
    write: Write::Where {
        sites: SITES,
        has,
        write: |path, of| {
            let rows = registered_footprints(of.site);
            let points: Vec<[f64; 2]> = rows.iter().map(Row::point_deg).collect();
            let body = of.site.config.body;
            let bounds = bounding_box_deg(points.iter().copied());
            let metadata = vec![
                ("geo", geo_metadata(body, bounds, None).to_string()),
                ("frame", frame(body).to_owned()),
            ];
            parquet::write(path, &table(of.site, rows), metadata)
        },
    },
    uses: &[Use {
        program: Program::Gis,
        lines: "python3 -c 'import geopandas; print(geopandas.read_parquet(\"../registered_footprints.parquet\"))'",
    }],
};

pub(super) static CSV: Declaration = Declaration {
    path: "registered_footprints.csv",
    what: WHAT,
    readers: "scripts",
    rows: "footprints inside images",
    role: Role::Data,
    content: Content::Table(text_columns),
    write: Write::Where {
        sites: "a site with footprints inside its images, format `csv`",
        has: |site| site.has_footprints_in(ShotFormat::Csv) && has(site),
        write: |path, of| text_table::write(path, table(of.site, registered_footprints(of.site))),
    },
    uses: &[],
};

pub(crate) static GEOPACKAGE: Declaration = Declaration {
    path: "exchange/registered_footprints.gpkg",
    what: WHAT,
    readers: "GIS",
    rows: "footprints inside images",
    role: Role::Data,
    content: Content::Foreign,
    write: Write::Where {
        sites: SITES,
        has,
        write: |path, of| geopackage::write(path, features(of, registered_footprints(of.site))),
    },
    uses: &[Use {
        program: Program::Gis,
        lines: "ogrinfo -al -so registered_footprints.gpkg       footprints inside images",
    }],
};

/// Whether a footprint is inside an image.
fn has(site: &SiteProducts) -> bool {
    let adjusted = site.adjustment().map(|(_, of)| of.images);
    let mut images = site.images.iter().chain(adjusted.unwrap_or_default());
    let has_inside = |image: &ImageProducts| {
        let mut profiles = image.registration.profiles.iter();
        profiles.any(|profile| profile.inside > 0)
    };
    !site.footprints.is_empty() && images.any(has_inside)
}

/// The column `height_m`: heights above the sphere of the maps, metres.
pub(super) fn heights_m<'a>(site: &'a SiteProducts<'a>) -> impl Iterator<Item = f64> {
    registered_footprints(site)
        .into_iter()
        .map(|row| row.height_m())
}

/// A footprint that an image shows.
#[derive(Clone, Copy)]
pub struct RegisteredFootprint<'a> {
    site: &'a SiteProducts<'a>,
    /// Its image.
    pub image: &'a ImageProducts<'a>,
    /// Row of the footprint.
    pub footprint: usize,
    profile: usize,
    /// Its place with the orientation from the kernels, and with the adjusted one.
    pub places: [Option<Place>; 2],
    /// The footprint after the adjustment.
    pub adjusted: Option<&'a CorrectedPoint>,
}

use RegisteredFootprint as Row;

/// A place in an image.
#[derive(Clone, Copy)]
pub struct Place {
    /// Line, 0 at the leading edge of the first one.
    pub line: f64,
    /// Sample, 0 at the outer edge of the first one.
    pub sample: f64,
    isis_line: Option<f64>,
    isis_sample: Option<f64>,
    /// Whether it lies inside the delivered image.
    pub inside: bool,
    extrapolated: bool,
}

impl Place {
    fn of(points: &RegisteredPoints, at: usize) -> Self {
        Self {
            line: points.line.at(at),
            sample: points.sample.at(at),
            isis_line: registration::isis(points.isis_line.at(at)),
            isis_sample: registration::isis(points.isis_sample.at(at)),
            inside: points.inside.at(at),
            extrapolated: points.extrapolated.at(at),
        }
    }
}

impl Row<'_> {
    fn point_deg(&self) -> [f64; 2] {
        let footprints = self.site.footprints;
        [
            signed_longitude_deg(footprints.longitude_rad.at(self.footprint)),
            degrees(footprints.latitude_rad.at(self.footprint)),
        ]
    }

    /// Height of the ground above the sphere of the body's maps, metres.
    fn height_m(&self) -> f64 {
        let radius_m = self.site.footprints.ground_radius_m(self.footprint);
        radius_m - self.site.config.body.map().radius_m
    }

    /// Shift in the image due to the adjustment, pixels.
    #[must_use]
    pub fn moved_px(&self) -> Option<f64> {
        let [before, after] = self.places;
        let (before, after) = (before?, after?);
        Some((after.line - before.line).hypot(after.sample - before.sample))
    }
}

/// The footprints inside images, image by image, in the order of the registration.
#[must_use]
pub fn registered_footprints<'a>(site: &'a SiteProducts<'a>) -> Vec<RegisteredFootprint<'a>> {
    let adjustment = site.adjustment().map(|(_, adjustment)| adjustment);
    let mut adjusted: BTreeMap<usize, &CorrectedPoint> = BTreeMap::new();
    if let Some(adjustment) = &adjustment {
        let points = adjustment.adjusted.points.iter();
        let shots = points.filter(|point| point.kind == PointKind::Shot);
        adjusted.extend(shots.map(|point| (point.index, point)));
    }
    let mut rows = Vec::new();
    for (index, image) in site.images.iter().enumerate() {
        let after = adjustment.as_ref().and_then(|of| of.images.get(index));
        for (footprint, (profile, places)) in places(image, after) {
            rows.push(Row {
                site,
                image,
                footprint,
                profile,
                places,
                adjusted: adjusted.get(&footprint).copied(),
            });
        }
    }
    rows
}

/// Profile and places of every footprint that the image shows before or after the adjustment, by its row. A footprint in
/// several windows has the first of its profiles.
fn places(
    before: &ImageProducts,
    after: Option<&ImageProducts>,
) -> BTreeMap<usize, (usize, [Option<Place>; 2])> {
    let rounds = [Some(before), after];
    let rounds = rounds.map(|image| image.map(|image| &image.registration.points));
    let mut places: BTreeMap<usize, (usize, [Option<Place>; 2])> = BTreeMap::new();
    // Only rows with a point inside an image are needed, and these are few.
    for points in rounds.into_iter().flatten() {
        let inside = (0..points.len()).filter(|at| points.inside.at(*at));
        places.extend(inside.map(|at| (points.row.at(at) as usize, (usize::MAX, [None; 2]))));
    }
    for (round, points) in rounds.into_iter().enumerate() {
        let Some(points) = points else { continue };
        for at in 0..points.len() {
            if let Some((profile, of_rounds)) = places.get_mut(&(points.row.at(at) as usize)) {
                *profile = (*profile).min(points.profile.at(at) as usize);
                of_rounds[round].get_or_insert(Place::of(points, at));
            }
        }
    }
    places
}

fn table<'a>(site: &SiteProducts<'a>, rows: Vec<Row<'a>>) -> Table<'a> {
    Table::new(columns(), rows).in_terms(&site.config.terms())
}

/// The columns of the CSV file.
fn text_columns() -> Vec<Meaning> {
    let table = Table::new(columns(), Vec::new()).for_text();
    table.columns().cloned().collect()
}

fn features<'a>(of: &Context<'a>, rows: Vec<Row<'a>>) -> Features<'a> {
    let site = of.site;
    let body = site.config.body;
    let points = rows.iter().map(|row| {
        let [east_deg, north_deg] = row.point_deg();
        [east_deg, north_deg, row.height_m()]
    });
    let points = points.collect();
    let newest_utc = site.newest_utc();
    let name = &site.config.site;
    Features {
        table: LAYER,
        z: format!(
            "z: radius of the ground minus {} m, metres",
            body.map().radius_m
        ),
        ..Features::of_footprints(body, name, newest_utc, points, table(site, rows))
    }
}

fn columns<'a>() -> Vec<Column<Row<'a>>> {
    let mut columns = shot();
    columns.extend(ground());
    columns.extend(image());
    columns.extend(adjusted());
    let columns = columns.into_iter().map(Column::in_gis);
    let mut columns: Vec<Column<Row>> = columns.collect();
    columns.push(column(
        "geometry",
        Unit::None,
        "point, longitude (-180..180) and {latitude} latitude in degrees, well-known binary",
        |row: &Row| well_known_binary(row.point_deg()),
    ));
    columns
}

/// Names and time of the shot.
fn shot<'a>() -> Vec<Column<Row<'a>>> {
    vec![
        column("image", Unit::None, "image identifier", |row: &Row| {
            row.image.times.id.clone()
        }),
        column(
            "profile",
            Unit::None,
            "identifier of the profile: window, orbit and crossing; for a footprint in several windows, the profile \
             in the first window",
            |row: &Row| {
                let profile = row.site.profiles.get(row.profile);
                profile.map_or_else(String::new, |profile| profile.id.clone())
            },
        ),
        column(
            "orbit",
            Unit::None,
            "orbit number of the frame",
            |row: &Row| row.site.footprints.orbit.at(row.footprint),
        ),
        column("record", Unit::None, "{record}", |row: &Row| {
            row.site.footprints.record.at(row.footprint)
        }),
        column(
            "shot",
            Unit::None,
            "number of the shot in its frame, 1 to 20",
            |row: &Row| u32::from(row.site.footprints.shot.at(row.footprint)),
        )
        .between(1, 20),
        column(
            "return_class",
            Unit::None,
            "class of the return: 1 ground, 0 cloud or noise",
            |row: &Row| i32::from(row.site.footprints.class.at(row.footprint)),
        ),
        column(
            "footprint_row",
            Unit::None,
            "row of the footprint in footprints.parquet, counted from 0",
            |row: &Row| u32::try_from(row.footprint).unwrap_or(u32::MAX),
        ),
        column("utc", Unit::None, "et_s as UTC, ISO 8601", |row: &Row| {
            row.site.utc.at(row.footprint)
        }),
        column(
            "et_s",
            Unit::Second,
            "time of the shot after the {altimeter} clock correction, TDB seconds past J2000",
            |row: &Row| row.site.footprints.et_s.at(row.footprint),
        ),
    ]
}

/// Place on the ground.
fn ground<'a>() -> Vec<Column<Row<'a>>> {
    vec![
        column(
            "longitude_deg",
            Unit::Degree,
            "east longitude, 0..360 degrees, {frame}",
            |row: &Row| degrees(row.site.footprints.longitude_rad.at(row.footprint)),
        ),
        column(
            "latitude_deg",
            Unit::Degree,
            "{latitude} latitude, degrees, {frame}",
            |row: &Row| degrees(row.site.footprints.latitude_rad.at(row.footprint)),
        ),
        column(
            "ground_radius_m",
            Unit::Metre,
            "radius of the ground that all stages use, crossover-corrected or raw as configured, metres",
            |row: &Row| row.site.footprints.ground_radius_m(row.footprint),
        ),
        column(
            "height_m",
            Unit::Metre,
            "radius of the ground minus the radius of the map sphere, metres",
            Row::height_m,
        ),
        column(
            "topography_m",
            Unit::Metre,
            "planetary radius after the crossover correction minus the radius of the {areoid}, metres",
            |row: &Row| row.site.footprints.topography_of_m(row.footprint),
        ),
    ]
}

/// Place in the image.
fn image<'a>() -> Vec<Column<Row<'a>>> {
    type Of = fn(Place) -> Option<f64>;
    let of: [([&'static str; 2], Unit, Of, &'static str); 4] = [
        (
            ["before_line", "adjusted_line"],
            Unit::Line,
            |of| Some(of.line),
            "image line, 0 at the outer edge of the first line, 0.5 at its centre",
        ),
        (
            ["before_sample", "adjusted_sample"],
            Unit::Pixel,
            |of| Some(of.sample),
            "image sample, 0 at the outer edge of the first sample, 0.5 at its centre",
        ),
        (
            ["before_isis_line", "adjusted_isis_line"],
            Unit::Line,
            |of| of.isis_line,
            registration::ISIS_LINE,
        ),
        (
            ["before_isis_sample", "adjusted_isis_sample"],
            Unit::Pixel,
            |of| of.isis_sample,
            registration::ISIS_SAMPLE,
        ),
    ];
    let mut columns = Vec::new();
    for round in 0..2 {
        for (names, unit, of, meaning) in of {
            columns.push(column(names[round], unit, meaning, move |row: &Row| {
                of(row.places[round]?)
            }));
        }
    }
    let inside =
        |round: usize| move |row: &Row| row.places[round].is_some_and(|place| place.inside);
    columns.push(column(
        "before_inside",
        Unit::None,
        "whether the footprint lies inside the delivered image with the orientation from the kernels",
        inside(0),
    ));
    columns.push(column(
        "adjusted_inside",
        Unit::None,
        "whether the footprint lies inside the delivered image with the adjusted orientation; false without an adjustment",
        inside(1),
    ));
    columns.push(column(
        "extrapolated",
        Unit::None,
        "whether the line coordinate before or after the adjustment lies beyond the first or last header line, \
         where the orientation is extrapolated",
        |row: &Row| row.places.iter().flatten().any(|place| place.extrapolated),
    ));
    columns.push(column(
        "moved_px",
        Unit::Pixel,
        "distance between the image points before and after the adjustment, pixels",
        Row::moved_px,
    ));
    columns
}

/// Uncertainty on the ground.
fn adjusted<'a>() -> Vec<Column<Row<'a>>> {
    let names = ["sigma_east_m", "sigma_north_m", "sigma_up_m"];
    let columns = names.into_iter().enumerate().map(|(axis, name)| {
        let meaning = "standard deviation in east, north or height after the adjustment, including the uncertainty of \
                       the profile's shift, metres; missing for footprints that are not part of the adjustment";
        column(name, Unit::Metre, meaning, move |row: &Row| {
            Some(row.adjusted?.local_sigmas_m()[axis])
        })
    });
    columns.collect()
}
