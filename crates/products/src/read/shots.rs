//! Columns of shots that are read from the tables instead of the page data.

use std::{collections::BTreeMap, ops::Range, path::Path};

use super::{
    ReadError,
    columns::{self, Batch},
};
use areograph_base::error::Result;
use areograph_stages::{check_ranges::ShotResiduals, register::RegisteredPoints};

/// Index of each text of a column.
type Indices<'a> = BTreeMap<&'a str, u32>;

/// The index of each of `texts`.
fn indices(texts: &[String]) -> Indices<'_> {
    texts.iter().map(String::as_str).zip(0..).collect()
}

/// The index of a text; an error if it has none.
fn index(
    indices: &Indices,
    name: &'static str,
    text: &str,
    expected: &'static str,
) -> std::result::Result<u32, ReadError> {
    let found = || ReadError::Column {
        name,
        found: text.to_owned(),
        expected,
    };
    indices.get(text).copied().ok_or_else(found)
}

/// Ensures that all of `rows` are rows of so many footprints.
fn require_rows(rows: &[u32], footprints: usize) -> std::result::Result<(), ReadError> {
    let beyond = rows.iter().find(|row| **row as usize >= footprints);
    beyond.map_or(Ok(()), |row| {
        Err(ReadError::Column {
            name: "footprint_row",
            found: row.to_string(),
            expected: "rows of footprints.parquet",
        })
    })
}

/// Reads `ranges.parquet` of a site with so many footprints and these profiles, identified in order.
///
/// # Errors
/// As [`super::read_footprints`]; a profile or a footprint that the site does not have.
pub(crate) fn read_residuals(
    path: &Path,
    profiles: &[String],
    footprints: usize,
) -> Result<ShotResiduals> {
    let profiles = indices(profiles);
    let mut shots = ShotResiduals::default();
    let names = [
        "profile",
        "footprint_row",
        "range_minus_distance_m",
        "range_minus_distance_crossover_m",
        "decoding_m",
        "spacecraft_radial_m",
        "spacecraft_along_m",
        "spacecraft_cross_m",
        "outlier",
    ];
    columns::read(path, &names, |batch| {
        for profile in batch.texts("profile")?.iter().flatten() {
            let profile = index(&profiles, "profile", profile, "a profile of the site")?;
            shots.profile.push(profile);
        }
        let rows = batch.counts("footprint_row")?.values();
        require_rows(rows, footprints)?;
        shots.row.extend(rows);
        let residuals = [
            ("range_minus_distance_m", &mut shots.range_minus_distance_m),
            (
                "range_minus_distance_crossover_m",
                &mut shots.range_minus_distance_crossover_m,
            ),
            ("decoding_m", &mut shots.decoding_m),
            ("spacecraft_radial_m", &mut shots.spacecraft_radial_m),
            ("spacecraft_along_m", &mut shots.spacecraft_along_m),
            ("spacecraft_cross_m", &mut shots.spacecraft_cross_m),
        ];
        for (name, column) in residuals {
            let values = batch.optional_numbers(name)?.iter();
            column.extend(values.map(|value| value.unwrap_or(f64::NAN)));
        }
        shots
            .outlier
            .extend(batch.flags("outlier")?.iter().flatten());
        Ok(())
    })?;
    Ok(shots)
}

/// Reads `registration.parquet`, or the table of the same columns after the adjustment, of a site with these images and
/// profiles, identified in order; points of images not listed in `wanted` are omitted.
///
/// # Errors
/// As [`super::read_footprints`]; an image, profile or footprint that the site does not have.
pub(crate) fn read_points(
    path: &Path,
    images: &[String],
    profiles: &[String],
    footprints: usize,
    wanted: &[usize],
) -> Result<Vec<RegisteredPoints>> {
    let (profiles, of_images) = (indices(profiles), indices(images));
    let mut points = vec![RegisteredPoints::default(); images.len()];
    let names = [
        "image",
        "profile",
        "footprint_row",
        "line",
        "sample",
        "line_offset",
        "y_px",
        "range_m",
        "residual_px",
        "step_lines",
        "evaluations",
        "evaluations_frame_first",
        "evaluations_fixed_point",
        "inside",
        "extrapolated",
    ];
    columns::read(path, &names, |batch| {
        require_rows(batch.counts("footprint_row")?.values(), footprints)?;
        let image: Vec<&str> = batch.texts("image")?.iter().flatten().collect();
        let mut start = 0;
        for same in image.chunk_by(|one, next| one == next) {
            let rows = start..start + same.len();
            start = rows.end;
            let image = index(&of_images, "image", same[0], "an image of the site")? as usize;
            if wanted.binary_search(&image).is_ok() {
                append(&mut points[image], batch, rows, &profiles)?;
            }
        }
        Ok(())
    })?;
    Ok(points)
}

/// Appends these rows of a table to the points of their image.
fn append(
    points: &mut RegisteredPoints,
    batch: &Batch,
    rows: Range<usize>,
    profiles: &Indices,
) -> std::result::Result<(), ReadError> {
    let names = batch.texts("profile")?;
    for row in rows.clone() {
        let profile = index(
            profiles,
            "profile",
            names.value(row),
            "a profile of the site",
        )?;
        points.profile.push(profile);
    }
    let numbers = [
        ("line", &mut points.line),
        ("sample", &mut points.sample),
        ("line_offset", &mut points.line_offset),
        ("y_px", &mut points.y_px),
        ("range_m", &mut points.range_m),
        ("residual_px", &mut points.residual_px),
        ("step_lines", &mut points.step_lines),
    ];
    for (name, column) in numbers {
        column.extend(&batch.numbers(name)?.values()[rows.clone()]);
    }
    let counts = [
        ("footprint_row", &mut points.row),
        ("evaluations", &mut points.evaluations),
        (
            "evaluations_frame_first",
            &mut points.evaluations_frame_first,
        ),
        (
            "evaluations_fixed_point",
            &mut points.evaluations_fixed_point,
        ),
    ];
    for (name, column) in counts {
        column.extend(&batch.counts(name)?.values()[rows.clone()]);
    }
    for (name, column) in [
        ("inside", &mut points.inside),
        ("extrapolated", &mut points.extrapolated),
    ] {
        let flags = batch.flags(name)?;
        column.extend(rows.clone().map(|row| flags.value(row)));
    }
    Ok(())
}
