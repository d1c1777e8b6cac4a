//! Registration: line and sample of every footprint in every image as Parquet, what it took as JSON.

use std::collections::BTreeMap;

use serde::Serialize;

use super::{
    Writer,
    files::write_json,
    parquet,
    site::{GeometricProducts, ImageProducts, SiteProducts},
    table::{Column, Table, Values},
};
use crate::{
    config::RegistrationConfig,
    error::Result,
    geom::{pushbroom::CameraModel, statistics::Summary},
    stages::{
        group_profiles::Profile,
        register::{MethodRun, ModelDifference, ProfileOnImage, RegisteredPoints},
    },
};

/// What the numbers are, for readers of the files.
const DEFINITIONS: [(&str, &str); 6] = [
    (
        "line, sample",
        "0 at the start of the first line and the outer edge of the first pixel, 0.5 at their centres; \
        lines of the header image. ISIS counts from 1 at the centre: add 0.5",
    ),
    (
        "points",
        "footprints with the radius before the crossover correction (x, y, z of footprints.parquet), \
        every profile in every image",
    ),
    (
        "methods",
        "the published iterations, on the points within the image's lines: frame_first (Konecny et al. 1987, \
        Wang 1990; with first_order: Shan, Lee & Yoon 2002) and fixed_point (eq. 4 of Shan et al. 2005)",
    ),
    (
        "evaluations",
        "evaluations of a method's formula until a step fell below the tolerance; of Newton's method: \
        evaluations of the orientation",
    ),
    (
        "mean_step_lines",
        "mean |step| of each iteration over the points with a result, a point that has ended counts as 0: \
        figure 4 of Shan et al. 2005",
    ),
    (
        "difference_lines",
        "line found by the iteration minus the one of Newton's method with the same model",
    ),
];

#[derive(Serialize)]
struct Document<'a> {
    format: &'static str,
    site: &'a str,
    definitions: Vec<Definition>,
    configured: &'a RegistrationConfig,
    images: Vec<ImageDocument<'a>>,
}

#[derive(Serialize)]
struct Definition {
    of: &'static str,
    is: &'static str,
}

#[derive(Serialize)]
struct ImageDocument<'a> {
    image: &'a str,
    model: CameraModel,
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

#[derive(Serialize)]
struct ProfileDocument<'a> {
    id: &'a str,
    points: u32,
    inside: u32,
    #[serde(skip_serializing_if = "Option::is_none")]
    shot_spacing_lines: Option<f64>,
}

pub(super) fn write(written: &mut Writer, site: &SiteProducts) -> Result<()> {
    let table = Table::new(columns(site, site.images))?;
    written.add("registration.parquet", |path| {
        parquet::write(path, &table, Vec::new())
    })?;
    written.add("registration.json", |path| {
        write_json(path, &document(site))?;
        Ok(site.images.len() as u64)
    })
}

/// Writes where the adjusted images have the footprints.
pub(super) fn write_adjusted(
    written: &mut Writer,
    site: &SiteProducts,
    geometric: &GeometricProducts,
) -> Result<()> {
    let table = Table::new(columns(site, geometric.adjusted_images))?;
    written.add("registration_adjusted.parquet", |path| {
        parquet::write(path, &table, Vec::new())
    })
}

/// One column over all images.
fn all<T>(
    images: &[ImageProducts],
    of: impl Fn(&ImageProducts<'_>, &RegisteredPoints) -> Vec<T>,
) -> Vec<T> {
    let images = images.iter();
    images
        .flat_map(|image| of(image, &image.registration.points))
        .collect()
}

fn columns(site: &SiteProducts, images: &[ImageProducts]) -> Vec<Column> {
    let number = |name, description, of: fn(&RegisteredPoints) -> &Vec<f64>| {
        let values = all(images, |_, points| of(points).clone());
        Column::new(name, description, Values::F64(values))
    };
    let count = |name, description, of: fn(&RegisteredPoints) -> &Vec<u32>| {
        let values = all(images, |_, points| of(points).clone());
        Column::new(name, description, Values::U32(values))
    };
    let flag = |name, description, of: fn(&RegisteredPoints) -> &Vec<bool>| {
        let values = all(images, |_, points| of(points).clone());
        Column::new(name, description, Values::Bool(values))
    };
    let ids = all(images, |image, points| {
        vec![image.times.id.clone(); points.len()]
    });
    let profiles = all(images, |_, points| {
        let id = |index: &u32| {
            let profile = site.profiles.get(*index as usize);
            profile.map_or_else(String::new, |profile| profile.id.clone())
        };
        points.profile.iter().map(id).collect()
    });
    vec![
        Column::new("image", "image identifier", Values::Text(ids)),
        Column::new(
            "profile",
            "profile: window, orbit and crossing",
            Values::Text(profiles),
        ),
        count(
            "footprint_row",
            "row of the footprint in footprints.parquet, counted from 0",
            |points| &points.row,
        ),
        number("line", DEFINITIONS[0].1, |points| &points.line),
        number("sample", DEFINITIONS[0].1, |points| &points.sample),
        number(
            "line_offset",
            "lines from the middle of the header image, x of the papers",
            |points| &points.line_offset,
        ),
        number(
            "y_px",
            "across-track focal-plane coordinate from the boresight, image pixels, y of the papers \
            (against the samples)",
            |points| &points.y_px,
        ),
        number(
            "range_m",
            "distance from the camera's position to the footprint, metres",
            |points| &points.range_m,
        ),
        number(
            "residual_px",
            "along-track focal-plane coordinate at the solution, image pixels: what the iteration leaves",
            |points| &points.residual_px,
        ),
        number(
            "step_lines",
            "last step of Newton's method, lines",
            |points| &points.step_lines,
        ),
        count(
            "evaluations",
            "evaluations of the orientation by Newton's method",
            |points| &points.evaluations,
        ),
        count(
            "evaluations_frame_first",
            "evaluations of the frame-first iteration with the second-order model; 0 outside the image's \
            lines, and where it does not converge",
            |points| &points.evaluations_frame_first,
        ),
        count(
            "evaluations_fixed_point",
            "the same of eq. 4 of Shan et al. 2005",
            |points| &points.evaluations_fixed_point,
        ),
        flag(
            "inside",
            "whether the delivered image shows the footprint",
            |points| &points.inside,
        ),
        flag(
            "extrapolated",
            "whether it lies beyond the first or last header line, where the orientation is extrapolated",
            |points| &points.extrapolated,
        ),
    ]
}

fn document<'a>(site: &SiteProducts<'a>) -> Document<'a> {
    Document {
        format: "areograph registration 1",
        site: &site.config.site,
        definitions: DEFINITIONS
            .iter()
            .map(|(of, is)| Definition { of, is })
            .collect(),
        configured: &site.config.registration,
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
    let evaluations: Vec<f64> = points.evaluations.iter().map(|n| f64::from(*n)).collect();
    let profile = |(profile, on_image): (&'a Profile, &ProfileOnImage)| ProfileDocument {
        id: &profile.id,
        points: on_image.points,
        inside: on_image.inside,
        shot_spacing_lines: on_image.shot_spacing_lines,
    };
    ImageDocument {
        image: &registration.image,
        model: registration.model,
        points: points.len(),
        inside: points.inside_count(),
        extrapolated: points.extrapolated.iter().filter(|beyond| **beyond).count(),
        rejected: &registration.rejected,
        evaluations_newton: Summary::of(&evaluations),
        residual_px: Summary::of(&points.residual_px),
        profiles: profiles
            .iter()
            .zip(&registration.profiles)
            .map(profile)
            .collect(),
        methods: &registration.methods,
        models: &registration.models,
    }
}
