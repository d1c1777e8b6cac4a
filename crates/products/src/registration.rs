//! Registration: line and sample of every footprint in every image as Parquet, statistics as JSON.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::Serialize;

use super::{
    files::write_json,
    light_time, parquet,
    product::{Content, Declaration, Role, Write},
    site::{ImageProducts, SiteProducts},
    table::{Column, Table, Unit, column, meanings},
};
use areograph_base::{
    altimetry::GroundRadius, column::Column as Values, packed::Packed, schema::DocumentSchema,
};
use areograph_config::RegistrationConfig;
use areograph_geom::{pushbroom::CameraModel, statistics::Summary};
use areograph_stages::{
    group_profiles::Profile,
    register::{MethodRun, ModelDifference, ProfileOnImage, RegisteredPoints},
    sample_orientation::LightTimeEffect,
};

/// Definitions of the numbers, for readers of the files.
const DEFINITIONS: [(&str, &str); 7] = [
    (
        "line, sample",
        "image coordinate of the footprint: 0 at the outer edge of the first line or sample of the header image, 0.5 \
         at its centre; by the light-time convention of the run",
    ),
    (
        "points",
        "footprints with the radius that ground_radius names (x, y, z of footprints.parquet), every profile in every image",
    ),
    (
        "light_time",
        "light-time convention of the camera positions to which lines and samples refer; for each other convention, \
         the offset of the ground in the middle of the image, positive towards later lines and larger samples",
    ),
    (
        "methods",
        "published iterations for the points within the image's lines: frame_first (Konecny et al. 1987, \
        Wang 1990; with first_order: Shan, Lee & Yoon 2002) and fixed_point (eq. 4 of Shan et al. 2005)",
    ),
    (
        "evaluations",
        "number of evaluations of a method's formula until a step fell below the tolerance; for Newton's method, \
         number of evaluations of the orientation",
    ),
    (
        "mean_step_lines",
        "mean |step| of each iteration over the points with a result, where the step of a converged point counts as \
         0, as in Figure 4 of Shan et al. 2005",
    ),
    (
        "difference_lines",
        "line found by the iteration minus the line found by Newton's method with the same model",
    ),
];

/// Meaning of a line of ISIS.
pub(super) const ISIS_LINE: &str = "line in ISIS (qview, campt), 1 at the centre of the first line of the image file; \
                                    before the adjustment, with the original kernels (or support data) and the \
                                    pointing bias of the site; after it, with the kernels and the bias of \
                                    exchange/centre; missing outside the file";
/// Meaning of a sample of ISIS.
pub(super) const ISIS_SAMPLE: &str = "sample in ISIS (qview, campt), 1 at the centre of the first sample; before the \
                                      adjustment, with the original kernels (or support data) and the pointing bias of \
                                      the site; after it, with the kernels and the bias of exchange/centre; missing \
                                      outside the file";

/// A line or sample of ISIS, if there is one.
pub(super) fn isis(place: f64) -> Option<f64> {
    (place > 0.0).then_some(place)
}

#[derive(Serialize, JsonSchema)]
#[schemars(
    title = "Registration of a site",
    description = "registration.json of areograph: footprints in every image, the cost of the published iterations, and the effect of the camera model. Lines, samples and image pixels; unknown values are omitted."
)]
struct Document<'a> {
    #[schemars(extend("const" = "areograph registration 1"))]
    format: &'static str,
    site: &'a str,
    #[schemars(length(min = 1))]
    definitions: Vec<Definition>,
    /// Ground radius that all stages use; omitted if the shots have one radius.
    #[serde(skip_serializing_if = "Option::is_none")]
    ground_radius: Option<GroundRadius>,
    configured: Configured,
    images: Vec<ImageDocument<'a>>,
}

/// Keys of `[registration]`.
#[derive(Serialize, JsonSchema)]
struct Configured {
    /// Form of orientation, if the configuration requires one; otherwise each image states its form.
    #[serde(skip_serializing_if = "Option::is_none")]
    model: Option<CameraModel>,
    /// Convergence limit of the published iterations.
    tolerance_lines: f64,
    /// Maximum number of steps of the published iterations.
    steps_max: u32,
}

impl Configured {
    const fn of(registration: &RegistrationConfig) -> Self {
        Self {
            model: registration.model,
            tolerance_lines: registration.tolerance_lines,
            steps_max: registration.steps_max,
        }
    }
}

#[derive(Serialize, JsonSchema)]
struct Definition {
    of: &'static str,
    is: &'static str,
}

#[derive(Serialize, JsonSchema)]
struct ImageDocument<'a> {
    image: &'a str,
    model: CameraModel,
    light_time: &'a LightTimeEffect,
    points: usize,
    inside: usize,
    extrapolated: usize,
    rejected: &'a BTreeMap<String, u64>,
    evaluations_newton: Summary,
    residual_px: Summary,
    profiles: Vec<ProfileDocument<'a>>,
    methods: &'a [MethodRun],
    models: &'a [ModelDifference],
}

#[derive(Serialize, JsonSchema)]
struct ProfileDocument<'a> {
    id: &'a str,
    points: u32,
    inside: u32,
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0))]
    shot_spacing_lines: Option<f64>,
}

pub(super) static TABLE: Declaration = Declaration {
    path: "registration.parquet",
    what: "line and sample of every footprint in every image",
    readers: "scripts, `areograph report`",
    rows: "footprints in images",
    role: Role::Data,
    content: Content::Table(|| meanings(&columns())),
    write: Write::Site(|path, of| {
        let metadata = light_time::metadata(of.site);
        parquet::write(path, &table(of.site, of.site.images), metadata).map(Some)
    }),
    uses: &[],
};

pub(super) static DOCUMENT: Declaration = Declaration {
    path: "registration.json",
    what: "convergence of the published iterations for the footprints, and the effect of the camera model",
    readers: "scripts",
    rows: "images",
    role: Role::Data,
    content: Content::Document(schema),
    write: Write::Site(|path, of| {
        write_json(path, &document(of.site))?;
        Ok(Some(of.site.images.len() as u64))
    }),
    uses: &[],
};

pub(super) static ADJUSTED: Declaration = Declaration {
    path: "registration_adjusted.parquet",
    what: "line and sample of every footprint with the adjusted orientation",
    readers: "scripts, `areograph report`",
    rows: "footprints in images",
    role: Role::Data,
    content: Content::Table(|| meanings(&columns())),
    write: Write::Adjustment(|path, of, _, adjustment| {
        let table = table(of.site, adjustment.images);
        parquet::write(path, &table, light_time::metadata(of.site)).map(Some)
    }),
    uses: &[],
};

/// A footprint in an image.
struct Registered<'a> {
    site: &'a SiteProducts<'a>,
    image: &'a ImageProducts<'a>,
    at: usize,
}

impl Registered<'_> {
    /// The column that `of` picks, in the footprint's row.
    fn get<T: Packed>(&self, of: fn(&RegisteredPoints) -> &Values<T>) -> T {
        of(&self.image.registration.points).at(self.at)
    }

    fn profile(&self) -> String {
        let index = self.get(|points| &points.profile);
        let profile = self.site.profiles.get(index as usize);
        profile.map_or_else(String::new, |profile| profile.id.clone())
    }
}

/// The footprints in `images`.
fn table<'a>(site: &'a SiteProducts<'a>, images: &'a [ImageProducts<'a>]) -> Table<'a> {
    let ends = images.iter().scan(0, |end, image| {
        *end += image.registration.points.len();
        Some(*end)
    });
    let ends: Vec<usize> = ends.collect();
    let count = ends.last().copied().unwrap_or_default();
    let point = move |row| {
        let of = ends.partition_point(|end| *end <= row);
        let before = of.checked_sub(1).map_or(0, |before| ends[before]);
        let (image, at) = (&images[of], row - before);
        Registered { site, image, at }
    };
    Table::of(columns(), count, point).in_terms(&site.config.terms())
}

fn columns<'a>() -> Vec<Column<Registered<'a>>> {
    [names(), places(), searches()]
        .into_iter()
        .flatten()
        .collect()
}

/// Names of the image and the footprint.
fn names<'a>() -> Vec<Column<Registered<'a>>> {
    vec![
        column(
            "image",
            Unit::None,
            "image identifier",
            |point: &Registered| point.image.times.id.clone(),
        ),
        column(
            "profile",
            Unit::None,
            "identifier of the profile: window, orbit and crossing",
            Registered::profile,
        ),
        column(
            "footprint_row",
            Unit::None,
            "row of the footprint in footprints.parquet, counted from 0",
            |point: &Registered| point.get(|points| &points.row),
        ),
    ]
}

/// Coordinates in the image.
fn places<'a>() -> Vec<Column<Registered<'a>>> {
    vec![
        column(
            "line",
            Unit::Line,
            DEFINITIONS[0].1,
            |point: &Registered| point.get(|points| &points.line),
        ),
        column(
            "sample",
            Unit::Pixel,
            DEFINITIONS[0].1,
            |point: &Registered| point.get(|points| &points.sample),
        ),
        column("isis_line", Unit::Line, ISIS_LINE, |point: &Registered| {
            isis(point.get(|points| &points.isis_line))
        }),
        column(
            "isis_sample",
            Unit::Pixel,
            ISIS_SAMPLE,
            |point: &Registered| isis(point.get(|points| &points.isis_sample)),
        ),
        column(
            "line_offset",
            Unit::Line,
            "line offset from the middle of the header image, x of the papers",
            |point: &Registered| point.get(|points| &points.line_offset),
        ),
        column(
            "y_px",
            Unit::Pixel,
            "across-track focal-plane coordinate from the boresight, image pixels, y of the papers (opposite to the \
            samples)",
            |point: &Registered| point.get(|points| &points.y_px),
        ),
        column(
            "range_m",
            Unit::Metre,
            "distance from the camera to the footprint, metres",
            |point: &Registered| point.get(|points| &points.range_m),
        ),
    ]
}

/// The search for the line, and what it found.
fn searches<'a>() -> Vec<Column<Registered<'a>>> {
    vec![
        column(
            "residual_px",
            Unit::Pixel,
            "along-track focal-plane coordinate at the solution, image pixels: the residual of the iteration",
            |point: &Registered| point.get(|points| &points.residual_px),
        ),
        column(
            "step_lines",
            Unit::Line,
            "last step of Newton's method, lines",
            |point: &Registered| point.get(|points| &points.step_lines),
        ),
        column(
            "evaluations",
            Unit::None,
            "number of evaluations of the orientation in Newton's method",
            |point: &Registered| point.get(|points| &points.evaluations),
        ),
        column(
            "evaluations_frame_first",
            Unit::None,
            "number of evaluations in the frame-first iteration with the second-order model; 0 outside the image's \
             lines, and where the iteration does not converge",
            |point: &Registered| point.get(|points| &points.evaluations_frame_first),
        ),
        column(
            "evaluations_fixed_point",
            Unit::None,
            "number of evaluations in the iteration of eq. 4 of Shan et al. 2005 with the second-order model; 0 \
             outside the image's lines, and where the iteration does not converge",
            |point: &Registered| point.get(|points| &points.evaluations_fixed_point),
        ),
        column(
            "inside",
            Unit::None,
            "whether the delivered image shows the footprint",
            |point: &Registered| point.get(|points| &points.inside),
        ),
        column(
            "extrapolated",
            Unit::None,
            "whether the footprint lies beyond the first or last header line, where the orientation is extrapolated",
            |point: &Registered| point.get(|points| &points.extrapolated),
        ),
    ]
}

/// Schema of the document.
pub(super) fn schema() -> DocumentSchema {
    let keys = "/$defs/Configured/properties";
    DocumentSchema::of::<Document>("registration")
        .with(&format!("{keys}/tolerance_lines"), "exclusiveMinimum", 0)
        .with(&format!("{keys}/steps_max"), "minimum", 1)
}

fn document<'a>(site: &SiteProducts<'a>) -> Document<'a> {
    Document {
        format: "areograph registration 1",
        site: &site.config.site,
        definitions: DEFINITIONS
            .iter()
            .map(|(of, is)| Definition { of, is })
            .collect(),
        ground_radius: site.footprints.ground_choice(),
        configured: Configured::of(&site.config.registration),
        images: site
            .images
            .iter()
            .map(|image| image_document(image, site.profiles))
            .collect(),
    }
}

fn image_document<'a>(image: &ImageProducts<'a>, profiles: &'a [Profile]) -> ImageDocument<'a> {
    let registration = image.registration;
    let points = &registration.points;
    let evaluations = || points.evaluations.iter().map(f64::from);
    let profile = |(profile, on_image): (&'a Profile, &ProfileOnImage)| ProfileDocument {
        id: &profile.id,
        points: on_image.points,
        inside: on_image.inside,
        shot_spacing_lines: on_image.shot_spacing_lines,
    };
    ImageDocument {
        image: &registration.image,
        model: registration.model,
        light_time: &image.orientation.light_time,
        points: points.len(),
        inside: points.inside_count(),
        extrapolated: points.extrapolated.iter().filter(|beyond| *beyond).count(),
        rejected: &registration.rejected,
        evaluations_newton: Summary::over(evaluations),
        residual_px: Summary::over(|| points.residual_px.iter()),
        profiles: profiles
            .iter()
            .zip(&registration.profiles)
            .map(profile)
            .collect(),
        methods: &registration.methods,
        models: &registration.models,
    }
}
