//! Ground control points of every image, for programs that place images on maps without a camera model.
//!
//! A grid over the image is carried to the ground by the best orientation. Between its points, an image placed by them follows
//! neither relief nor the curvature of the orientation; orthoimages do.

use nalgebra::Vector3;

use super::{
    coordinates::{degrees, signed_longitude_deg},
    product::{Content, Context, Declaration, Program, Role, Use, Write},
    site::{ImageProducts, SiteProducts},
    table::{Column, Table, Unit, column, meanings},
    text_table,
};
use areograph_base::{
    body::Body,
    error::Result,
    units::{RADIANS_PER_DEGREE, wrap_pi},
};
use areograph_geom::{
    ellipsoid::{Spherical, spherical_to_xyz_m},
    height_grid::HeightGrid,
};
use areograph_stages::{
    map_surface::Surface, oriented::OrientedImage, rectify_images::GroundModel,
    shot_heights::Heights,
};

/// Points along the lines and the samples of an image: narrow images are long.
const POINTS: [u32; 2] = [17, 5];
/// Steps of the search for the height on a ray; each decreases its error by the slope of the ground times the tangent of the emission
/// angle.
const HEIGHT_STEPS: u32 = 8;

pub(super) static TABLE: Declaration = Declaration {
    path: "images/<image>/control_points.csv",
    what: "ground control points of the image: a grid of image coordinates with their ground coordinates by the best \
           orientation, for `areograph image extract --control`; heights are those on which orthoimages lie, else those of near shots inside \
           the image, else those of the ellipsoid",
    readers: "GIS",
    rows: "points",
    role: Role::Data,
    content: Content::Table(|| meanings(&columns())),
    write: Write::ImageWhere {
        images: "every image whose edges show the ground, between 80° south and 80° north",
        has,
        write,
    },
    uses: &[Use {
        program: Program::Gis,
        lines: "areograph image extract FILE --out image.tif --control ../images/<image>/control_points.csv\n\
                gdalwarp -tps image.tif map.tif                  FILE on a map, without a terrain model",
    }],
};

/// Largest latitude of an image with control points, radians: nearer to a pole, longitudes do not measure distances.
const LATITUDE_MAX_RAD: f64 = 80.0 * RADIANS_PER_DEGREE;

/// Whether the edges of an image show the ground, away from the poles.
fn has(site: &SiteProducts, image: usize) -> bool {
    let outline = site.images[image].orientation.outline.as_ref();
    outline.is_some_and(|outline| {
        let mut places = outline.iter();
        places.all(|place| place.latitude_rad.abs() <= LATITUDE_MAX_RAD)
    })
}

/// A place in an image and on the ground.
struct ControlPoint<'a> {
    body: Body,
    image: &'a str,
    line: f64,
    sample: f64,
    /// Within half a turn of the first point, which lies between −180 and 180.
    longitude_deg: f64,
    ground: Spherical,
    height_sigma_m: f64,
}

fn columns<'a>() -> Vec<Column<ControlPoint<'a>>> {
    vec![
        column("body", Unit::None, "body", |point: &ControlPoint| {
            point.body.word().to_owned()
        }),
        column(
            "image",
            Unit::None,
            "image identifier",
            |point: &ControlPoint| point.image.to_owned(),
        ),
        column(
            "line",
            Unit::Line,
            "line, 0 at the outer edge of the first",
            |point: &ControlPoint| point.line,
        ),
        column(
            "sample",
            Unit::Pixel,
            "sample, 0 at the outer edge of the first",
            |point: &ControlPoint| point.sample,
        ),
        column(
            "longitude_deg",
            Unit::Degree,
            "east longitude, continuous over the image",
            |point: &ControlPoint| point.longitude_deg,
        ),
        column(
            "latitude_deg",
            Unit::Degree,
            "{latitude} latitude",
            |point: &ControlPoint| degrees(point.ground.latitude.0),
        ),
        column(
            "height_m",
            Unit::Metre,
            "height above the sphere of the body's maps",
            |point: &ControlPoint| point.ground.radius_m - point.body.map().radius_m,
        ),
        column(
            "height_sigma_m",
            Unit::Metre,
            "standard deviation of the height; an error of the height displaces the point by its product with the tangent of the \
             emission angle. Errors of the orientation are not included",
            |point: &ControlPoint| point.height_sigma_m,
        ),
    ]
}

fn write(path: &std::path::Path, of: &Context, image: usize) -> Result<u64> {
    let points = control_points(of.site, image)?;
    let table = Table::new(columns(), points).in_terms(&of.site.config.terms());
    text_table::write(path, table)
}

/// The points whose rays meet the ground.
fn control_points<'a>(site: &SiteProducts<'a>, index: usize) -> Result<Vec<ControlPoint<'a>>> {
    let adjusted = site.adjustment().map(|(_, adjusted)| adjusted.images);
    let image = &adjusted.unwrap_or(site.images)[index];
    let oriented = OrientedImage::of(image.times, image.orientation, image.model)?;
    let camera = oriented.oriented_camera();
    let ground = Ground::of(site, image)?;
    let steps = |count: u32, size: f64| {
        (0..count).map(move |at| size * f64::from(at) / f64::from(count - 1))
    };
    let [lines, samples] = [image.times.lines_delivered, image.times.samples].map(f64::from);
    let places = steps(POINTS[0], lines)
        .flat_map(|line| steps(POINTS[1], samples).map(move |sample| (line, sample)));
    let point = |(line, sample)| {
        let (mut radius_m, mut sigma_m) = ground.radius_m(&camera.orientation.pose(0.0).position_m);
        let mut place_m = camera.on_sphere_m(line, sample, radius_m)?;
        for _ in 0..HEIGHT_STEPS {
            (radius_m, sigma_m) = ground.radius_m(&place_m);
            place_m = camera.on_sphere_m(line, sample, radius_m)?;
        }
        Some(ControlPoint {
            body: site.config.body,
            image: &image.times.id,
            line,
            sample,
            longitude_deg: 0.0,
            ground: Spherical::from_xyz_m(&place_m),
            height_sigma_m: sigma_m,
        })
    };
    let mut points: Vec<ControlPoint<'_>> = places.filter_map(point).collect();
    let first_rad = points.first().map(|point| point.ground.longitude_rad);
    let first_rad = first_rad.unwrap_or_default();
    for point in &mut points {
        let from_first_rad = wrap_pi(point.ground.longitude_rad - first_rad);
        point.longitude_deg = signed_longitude_deg(first_rad) + degrees(from_first_rad);
    }
    Ok(points)
}

/// The ground of an image: that of the orthoimages, and near shots where it has no height.
struct Ground<'a> {
    /// Heights, and their standard deviations, which all share a common one, metres.
    model: Option<(&'a HeightGrid, HeightGrid, f64)>,
    heights: Heights,
}

impl<'a> Ground<'a> {
    fn of(site: &SiteProducts<'a>, image: &ImageProducts) -> Result<Self> {
        let terrain = site.find::<Surface>()?;
        let common_m = terrain.and_then(|terrain| terrain.account.common_sigma_m);
        let model = GroundModel::of(site.book)?;
        let model = model.map(|model| {
            let sigmas = HeightGrid {
                heights_m: model.sigmas_m.clone(),
                ..model.heights.clone()
            };
            (&model.heights, sigmas, common_m.unwrap_or_default())
        });
        let points = &image.registration.points;
        let footprints = site.footprints;
        let inside = (0..points.len()).filter(|at| !footprints.is_empty() && points.inside.at(*at));
        let shots_m = inside.map(|at| {
            let row = points.row.at(at) as usize;
            spherical_to_xyz_m(
                footprints.longitude_rad.at(row),
                footprints.latitude_rad.at(row),
                footprints.ground_radius_m(row),
            )
        });
        Ok(Self {
            model,
            heights: Heights::at(site.config.body, shots_m.collect()),
        })
    }

    /// Radius of the ground in the direction of a place, and its standard deviation, metres.
    fn radius_m(&self, place_m: &Vector3<f64>) -> (f64, f64) {
        let of_model = self.model.as_ref().and_then(|(grid, sigmas, common_m)| {
            let place = Spherical::from_xyz_m(place_m);
            let cell = grid.cell_of(place.longitude_rad, place.latitude.0);
            let height_m = grid.height_m(cell)?;
            let sigma_m = sigmas.height_m(cell)?.hypot(*common_m);
            Some((grid.radius_m + height_m, sigma_m))
        });
        of_model.unwrap_or_else(|| {
            let near = self.heights.near(place_m);
            (near.radius_m, near.sigma_m)
        })
    }
}
