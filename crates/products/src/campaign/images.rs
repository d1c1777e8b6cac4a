//! Images of a campaign.

use super::{WriteCampaign, phase_column, write_csv, write_parts};
use crate::{
    product::{Content, Declaration, Role},
    table::{Column, Unit, column, meanings},
};
use areograph_base::units::{RADIANS_PER_ARCSECOND, RADIANS_PER_DEGREE, SECONDS_PER_MS};
use areograph_stages::pool_sites::{ImageRow, OrientedImageRow};

pub(super) static TABLE: Declaration<WriteCampaign> = Declaration {
    path: "images/phase=<phase>/part-0.parquet",
    what: "every image of every site, with the values of Tables 2 and 4 of Shan et al. 2005, by mission phase",
    readers: "scripts, DuckDB, Polars, `areograph pedr sql`",
    rows: "images of sites",
    role: Role::Data,
    content: Content::Table(|| meanings(&columns())),
    write: |folder, of| write_parts(folder, "images", columns, &of.rows.images, |row| &row.phase),
    uses: &[],
};

pub(super) static CSV: Declaration<WriteCampaign> = Declaration {
    path: "images.csv",
    what: "the images as CSV, with their phases",
    readers: "spreadsheets, scripts",
    rows: "images of sites",
    role: Role::Data,
    content: Content::Foreign,
    write: |folder, of| write_csv(folder, CSV.path, columns(), &of.rows.images),
    uses: &[],
};

fn columns<'a>() -> Vec<Column<&'a ImageRow>> {
    [exposure(), results(), polynomials()]
        .into_iter()
        .flatten()
        .collect()
}

fn exposure<'a>() -> Vec<Column<&'a ImageRow>> {
    type Row<'a> = &'a ImageRow;
    let degrees = |radians: f64| radians / RADIANS_PER_DEGREE;
    vec![
        phase_column(|row: &ImageRow| &row.phase),
        column("site", Unit::None, "identifier of the site", |row: &Row| {
            row.site.clone()
        }),
        column(
            "verdict",
            Unit::None,
            "verdict of the site in words; empty without usable products",
            |row: &Row| row.verdict.to_owned(),
        ),
        column(
            "is_valid",
            Unit::None,
            "whether the site is valid: only such rows are pooled",
            |row: &Row| row.is_valid,
        ),
        column(
            "is_repeated",
            Unit::None,
            "whether an earlier row of a valid site is of the same image: an image is pooled once",
            |row: &Row| row.is_repeated,
        ),
        column(
            "image",
            Unit::None,
            "identifier of the image",
            |row: &Row| row.image.clone(),
        ),
        column(
            "orbit",
            Unit::None,
            "number of the orbit in the mission phase, by the index of images",
            |row: &Row| row.orbit.map(f64::from),
        ),
        column(
            "utc_start",
            Unit::None,
            "UTC of the first line, as label or index write it",
            |row: &Row| row.utc_start.clone(),
        ),
        column("camera", Unit::None, "camera", |row: &Row| {
            row.camera.clone()
        }),
        column(
            "crosstrack_summing",
            Unit::None,
            "pixels summed across the track; 0 where unknown",
            |row: &Row| row.summing[0],
        ),
        column(
            "downtrack_summing",
            Unit::None,
            "pixels summed along the track; 0 where unknown",
            |row: &Row| row.summing[1],
        ),
        column(
            "exposure_ms",
            Unit::Millisecond,
            "exposure of one detector line",
            |row: &Row| row.exposure_s.map(|seconds| seconds / SECONDS_PER_MS),
        ),
        column(
            "emission_deg",
            Unit::Degree,
            "emission angle at the centre, from the orientation, or else from the index of images",
            move |row: &Row| row.emission_rad.map(degrees),
        ),
        column(
            "incidence_deg",
            Unit::Degree,
            "incidence angle at the centre, from the index of images",
            move |row: &Row| row.incidence_rad.map(degrees),
        ),
        column(
            "off_nadir_deg",
            Unit::Degree,
            "angle between boresight and the direction to the centre of the body in the middle of the image",
            move |row: &Row| row.off_nadir_rad.map(degrees),
        ),
        column(
            "longitude_deg",
            Unit::Degree,
            "east longitude of the centre, from the orientation, or else from the index of images",
            move |row: &Row| row.place_rad.map(|of| degrees(of[0])),
        ),
        column(
            "latitude_deg",
            Unit::Degree,
            "areocentric latitude of the centre, from the same source",
            move |row: &Row| row.place_rad.map(|of| degrees(of[1])),
        ),
    ]
}

/// A number of an image with usable products.
fn result<'a>(
    name: &'static str,
    unit: Unit,
    description: &'static str,
    of: impl Fn(&OrientedImageRow) -> Option<f64> + Send + Sync + 'static,
) -> Column<&'a ImageRow> {
    column(name, unit, description, move |row: &&ImageRow| {
        row.oriented.as_ref().and_then(&of)
    })
}

/// A count of an image; 0 without usable products.
fn count<'a>(
    name: &'static str,
    description: &'static str,
    of: fn(&OrientedImageRow) -> u32,
) -> Column<&'a ImageRow> {
    column(name, Unit::None, description, move |row: &&ImageRow| {
        row.oriented.as_ref().map_or(0, of)
    })
}

fn text<'a>(
    name: &'static str,
    description: &'static str,
    of: fn(&OrientedImageRow) -> &String,
) -> Column<&'a ImageRow> {
    column(name, Unit::None, description, move |row: &&ImageRow| {
        row.oriented
            .as_ref()
            .map_or_else(String::new, |of_row| of(of_row).clone())
    })
}

fn results<'a>() -> Vec<Column<&'a ImageRow>> {
    vec![
        column(
            "lines",
            Unit::Line,
            "lines of the header image; 0, like all counts below, without usable products",
            |row: &&ImageRow| row.oriented.as_ref().map_or(0, |of| of.lines),
        ),
        count("samples", "samples of a line", |of| of.samples),
        result(
            "line_spacing_m",
            Unit::Metre,
            "mean distance of successive lines on the ground along the boresight (GSD of the images in Table 2 of Shan et al. 2005)",
            |of| of.line_spacing_m,
        ),
        result(
            "pixel_size_m",
            Unit::Metre,
            "width of a pixel at the distance of the ground, middle of the image",
            |of| of.pixel_size_m,
        ),
        count(
            "registered",
            "footprints with a line in the image or beyond its ends",
            |of| of.registered,
        ),
        count(
            "inside",
            "footprints that the delivered image shows",
            |of| of.inside,
        ),
        text(
            "simultaneous_profile",
            "profile with the most shots during the exposure; empty without any",
            |of| &of.simultaneous,
        ),
        count(
            "simultaneous_shots",
            "shots of this profile during the exposure",
            |of| of.simultaneous_shots,
        ),
        result(
            "shot_spacing_m",
            Unit::Metre,
            "median distance of successive footprints of this profile (MOLA GSD of Shan et al. 2005)",
            |of| of.shot_spacing_m,
        ),
        text(
            "invalid_because",
            "why the image is invalid; empty if it is valid",
            |of| &of.invalid_because,
        ),
    ]
}

fn polynomials<'a>() -> Vec<Column<&'a ImageRow>> {
    macro_rules! rmse {
        ($order:literal, $words:literal, $place:literal) => {
            [
                result(
                    concat!("order", $order, "_x_rmse_m"),
                    Unit::Metre,
                    concat!(
                        "root mean square residual of X about the polynomial of ",
                        $words,
                        " order (Table 4 of Shan et al. 2005)"
                    ),
                    |of| Some(of.rmse[$place].position_m[0]),
                ),
                result(
                    concat!("order", $order, "_y_rmse_m"),
                    Unit::Metre,
                    concat!(
                        "root mean square residual of Y about the polynomial of ",
                        $words,
                        " order"
                    ),
                    |of| Some(of.rmse[$place].position_m[1]),
                ),
                result(
                    concat!("order", $order, "_z_rmse_m"),
                    Unit::Metre,
                    concat!(
                        "root mean square residual of Z about the polynomial of ",
                        $words,
                        " order"
                    ),
                    |of| Some(of.rmse[$place].position_m[2]),
                ),
                result(
                    concat!("order", $order, "_omega_rmse_arcsec"),
                    Unit::Arcsecond,
                    concat!(
                        "root mean square residual of ω about the polynomial of ",
                        $words,
                        " order"
                    ),
                    |of| Some(of.rmse[$place].angles_rad[0] / RADIANS_PER_ARCSECOND),
                ),
                result(
                    concat!("order", $order, "_phi_rmse_arcsec"),
                    Unit::Arcsecond,
                    concat!(
                        "root mean square residual of φ about the polynomial of ",
                        $words,
                        " order"
                    ),
                    |of| Some(of.rmse[$place].angles_rad[1] / RADIANS_PER_ARCSECOND),
                ),
                result(
                    concat!("order", $order, "_kappa_rmse_arcsec"),
                    Unit::Arcsecond,
                    concat!(
                        "root mean square residual of κ about the polynomial of ",
                        $words,
                        " order"
                    ),
                    |of| Some(of.rmse[$place].angles_rad[2] / RADIANS_PER_ARCSECOND),
                ),
            ]
        };
    }
    let mut columns = Vec::from(rmse!("1", "first", 0));
    columns.extend(rmse!("2", "second", 1));
    columns
}
