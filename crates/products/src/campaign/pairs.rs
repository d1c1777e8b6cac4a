//! Pairs of images of a campaign.

use super::{WriteCampaign, phase_column, write_csv, write_parts};
use crate::{
    product::{Content, Declaration, Role},
    table::{Column, Unit, column, meanings},
};
use areograph_base::units::RADIANS_PER_DEGREE;
use areograph_geom::uncertainty::{GroundPart, UncertaintyBudget};
use areograph_stages::pool_sites::{PairHeights, PairMisregistration, PairRow, PairState};

pub(super) static TABLE: Declaration<WriteCampaign> = Declaration {
    path: "pairs/phase=<phase>/part-0.parquet",
    what: "every pair of images with common tie points: residuals (Table 5 of Shan et al. 2005), misregistration, heights and \
           budget before and after the adjustment, by the mission phase of the first image",
    readers: "scripts, DuckDB, Polars, `areograph pedr sql`",
    rows: "pairs of images",
    role: Role::Data,
    content: Content::Table(|| meanings(&columns())),
    write: |folder, of| {
        write_parts(folder, "pairs", columns, &of.rows.pairs, |row| {
            &row.phases[0]
        })
    },
    uses: &[],
};

pub(super) static CSV: Declaration<WriteCampaign> = Declaration {
    path: "pairs.csv",
    what: "the pairs as CSV, with their phases",
    readers: "spreadsheets, scripts",
    rows: "pairs of images",
    role: Role::Data,
    content: Content::Foreign,
    write: |folder, of| write_csv(folder, CSV.path, columns(), &of.rows.pairs),
    uses: &[],
};

fn columns<'a>() -> Vec<Column<&'a PairRow>> {
    [names(), geometry(), before(), after(), budget()]
        .into_iter()
        .flatten()
        .collect()
}

fn names<'a>() -> Vec<Column<&'a PairRow>> {
    type Row<'a> = &'a PairRow;
    vec![
        phase_column(|row: &PairRow| &row.phases[0]),
        column("site", Unit::None, "identifier of the site", |row: &Row| {
            row.site.clone()
        }),
        column(
            "verdict",
            Unit::None,
            "verdict of the site in words",
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
            "whether an earlier row is of the same two images: a pair is pooled once",
            |row: &Row| row.is_repeated,
        ),
        column(
            "first_image",
            Unit::None,
            "first image, in the order of the site",
            |row: &Row| row.images[0].clone(),
        ),
        column("second_image", Unit::None, "second image", |row: &Row| {
            row.images[1].clone()
        }),
        column(
            "second_phase",
            Unit::None,
            "mission phase of the second image; empty where unknown",
            |row: &Row| row.phases[1].clone(),
        ),
        column(
            "first_utc_start",
            Unit::None,
            "UTC of the first line of the first image",
            |row: &Row| row.utc_start[0].clone(),
        ),
        column(
            "second_utc_start",
            Unit::None,
            "UTC of the first line of the second image",
            |row: &Row| row.utc_start[1].clone(),
        ),
        column(
            "first_summing",
            Unit::None,
            "pixels of the first image summed across the track; 0 where unknown",
            |row: &Row| row.summing[0],
        ),
        column(
            "second_summing",
            Unit::None,
            "pixels of the second image summed across the track; 0 where unknown",
            |row: &Row| row.summing[1],
        ),
        column(
            "kernel_set",
            Unit::None,
            "identifier of the chosen kernel set, or else the names of the SPK files in use",
            |row: &Row| row.kernels.name.clone(),
        ),
        column(
            "kernels_blake3",
            Unit::None,
            "BLAKE3 over role and hash of every kernel in use, in load order",
            |row: &Row| row.kernels.blake3.clone(),
        ),
    ]
}

fn geometry<'a>() -> Vec<Column<&'a PairRow>> {
    type Row<'a> = &'a PairRow;
    let degrees = |radians: f64| radians / RADIANS_PER_DEGREE;
    vec![
        column(
            "first_emission_deg",
            Unit::Degree,
            "emission angle of the first image at its centre",
            move |row: &Row| row.emission_rad[0].map(degrees),
        ),
        column(
            "second_emission_deg",
            Unit::Degree,
            "emission angle of the second image at its centre",
            move |row: &Row| row.emission_rad[1].map(degrees),
        ),
        column(
            "latitude_deg",
            Unit::Degree,
            "areocentric latitude of the centre of the first image",
            move |row: &Row| row.latitude_rad.map(degrees),
        ),
        column(
            "convergence_deg",
            Unit::Degree,
            "median angle between the rays of a tie point",
            move |row: &Row| degrees(row.convergence_rad),
        ),
        column(
            "height_over_base",
            Unit::None,
            "flying height over base, median over the tie points",
            |row: &Row| row.height_over_base,
        ),
        column(
            "line_spacing_m",
            Unit::Metre,
            "mean distance of successive lines of both images on the ground: the pixel of the budget",
            |row: &Row| row.pixel_size_m,
        ),
        column(
            "shot_spacing_m",
            Unit::Metre,
            "median distance of successive footprints (MOLA GSD of Shan et al. 2005)",
            |row: &Row| row.shot_spacing_m,
        ),
        column(
            "sense",
            Unit::None,
            "1 if the second image has the larger emission, −1 if the first has, missing if equal or unknown: a misregistration, \
             second minus first, times this is that of the image with the larger emission minus that of the other",
            |row: &Row| row.sense(),
        ),
        column(
            "clock_m",
            Unit::Metre,
            "displacement of the tie points along the flight, first minus second image, per second of an offset of the attitude \
             clock; missing where images are not flown in one direction, or not apart across the track",
            |row: &Row| row.clock_m_s,
        ),
    ]
}

/// Columns of a state; the names of the columns begin with it.
macro_rules! state_columns {
    ($prefix:literal, $state:expr) => {{
        fn state(row: &PairRow) -> Option<&PairState> {
            let of: fn(&PairRow) -> Option<&PairState> = $state;
            of(row)
        }
        fn number<'a>(
            name: &'static str,
            unit: Unit,
            description: &'static str,
            of: fn(&PairState) -> Option<f64>,
        ) -> Column<&'a PairRow> {
            column(name, unit, description, move |row: &&PairRow| of(state(row)?))
        }
        fn misregistered(of: &PairState) -> Option<&PairMisregistration> {
            of.misregistration.as_ref()
        }
        fn heights(of: &PairState) -> Option<&PairHeights> {
            of.heights.as_ref()
        }
        vec![
            column(
                concat!($prefix, "_ties"),
                Unit::None,
                "intersected tie points of both images; 0 without this orientation",
                |row: &&PairRow| state(row).map_or(0, |of| of.ties),
            ),
            column(
                concat!($prefix, "_footprints"),
                Unit::None,
                "footprints in both images; 0 without any, or without this orientation",
                |row: &&PairRow| state(row).and_then(misregistered).map_or(0, |of| of.footprints),
            ),
            number(
                concat!($prefix, "_along_lines"),
                Unit::Line,
                "misregistration along the track: mean position of the footprints in the second image, transferred from the \
                 first by tie points, minus their projected position",
                |of| Some(misregistered(of)?.along_lines),
            ),
            number(
                concat!($prefix, "_along_m"),
                Unit::Metre,
                "the same on the ground",
                |of| Some(misregistered(of)?.along_m.value),
            ),
            number(
                concat!($prefix, "_along_sigma_m"),
                Unit::Metre,
                "its standard deviation from the scatter of the tie points",
                |of| misregistered(of)?.along_m.sigma,
            ),
            number(
                concat!($prefix, "_along_spacings"),
                Unit::None,
                "the same in distances of successive footprints (MOLA GSD)",
                |of| misregistered(of)?.along_spacings,
            ),
            number(
                concat!($prefix, "_across_px"),
                Unit::Pixel,
                "misregistration across the track, in the same sense; relief between tie points and footprints moves it",
                |of| Some(misregistered(of)?.across_px),
            ),
            number(
                concat!($prefix, "_across_m"),
                Unit::Metre,
                "the same at the distance of the ground",
                |of| Some(misregistered(of)?.across_m.value),
            ),
            number(
                concat!($prefix, "_across_sigma_m"),
                Unit::Metre,
                "its standard deviation from the scatter of the tie points, which includes that due to relief",
                |of| misregistered(of)?.across_m.sigma,
            ),
            number(
                concat!($prefix, "_ties_along_m"),
                Unit::Metre,
                "displacement of the tie points along the flight, first minus second image; missing where images are not flown \
                 in one direction, or not apart across the track",
                |of| Some(of.ties_along_m?.value),
            ),
            number(
                concat!($prefix, "_ties_along_sigma_m"),
                Unit::Metre,
                "its standard deviation from the scatter of the tie points",
                |of| of.ties_along_m?.sigma,
            ),
            number(
                concat!($prefix, "_parallax_m"),
                Unit::Metre,
                "mean displacement of the tie points along the flight, without its sign",
                |of| Some(of.along_track_parallax_m),
            ),
            number(
                concat!($prefix, "_first_mean_lines"),
                Unit::Line,
                "mean reprojection residual of the tie points along the track in the first image (Table 5 of Shan et al. 2005)",
                |of| Some(of.residuals[0].mean_x),
            ),
            number(
                concat!($prefix, "_first_deviation_lines"),
                Unit::Line,
                "their standard deviation",
                |of| Some(of.residuals[0].deviation_x),
            ),
            number(
                concat!($prefix, "_first_mean_px"),
                Unit::Pixel,
                "mean residual across the track in the first image",
                |of| Some(of.residuals[0].mean_y),
            ),
            number(
                concat!($prefix, "_first_deviation_px"),
                Unit::Pixel,
                "their standard deviation",
                |of| Some(of.residuals[0].deviation_y),
            ),
            number(
                concat!($prefix, "_second_mean_lines"),
                Unit::Line,
                "mean residual along the track in the second image",
                |of| Some(of.residuals[1].mean_x),
            ),
            number(
                concat!($prefix, "_second_deviation_lines"),
                Unit::Line,
                "their standard deviation",
                |of| Some(of.residuals[1].deviation_x),
            ),
            number(
                concat!($prefix, "_second_mean_px"),
                Unit::Pixel,
                "mean residual across the track in the second image",
                |of| Some(of.residuals[1].mean_y),
            ),
            number(
                concat!($prefix, "_second_deviation_px"),
                Unit::Pixel,
                "their standard deviation",
                |of| Some(of.residuals[1].deviation_y),
            ),
            column(
                concat!($prefix, "_heights"),
                Unit::None,
                "tie points of both images that are compared with the laser surface",
                |row: &&PairRow| state(row).and_then(heights).map_or(0, |of| of.n),
            ),
            number(
                concat!($prefix, "_height_mean_m"),
                Unit::Metre,
                "mean height of these tie points above the laser surface",
                |of| Some(heights(of)?.mean_m),
            ),
            number(
                concat!($prefix, "_height_rms_m"),
                Unit::Metre,
                "root mean square of these heights",
                |of| Some(heights(of)?.rms_m),
            ),
            number(
                concat!($prefix, "_height_mean_sigma_m"),
                Unit::Metre,
                "standard deviation of the mean of all tie points of the site due to the surface",
                |of| Some(heights(of)?.mean_sigma_m),
            ),
        ]
    }};
}

fn before<'a>() -> Vec<Column<&'a PairRow>> {
    state_columns!("before", |row| Some(&row.before))
}

fn after<'a>() -> Vec<Column<&'a PairRow>> {
    state_columns!("after", |row| row.after.as_ref())
}

fn budget<'a>() -> Vec<Column<&'a PairRow>> {
    fn of<'a>(
        name: &'static str,
        unit: Unit,
        description: &'static str,
        of: fn(&UncertaintyBudget) -> Option<f64>,
    ) -> Column<&'a PairRow> {
        column(name, unit, description, move |row: &&PairRow| {
            row.budget.as_ref().ok().and_then(of)
        })
    }
    vec![
        of(
            "budget_total_along_px",
            Unit::Pixel,
            "observed misregistration of the footprints before the adjustment, root mean square (eq. 6 of Shan et al. 2005)",
            |of| of.total_along_px,
        ),
        of(
            "budget_along_px",
            Unit::Pixel,
            "along-track discrepancy due to orientation (eq. 7)",
            |of| Some(of.along_px),
        ),
        of(
            "budget_ground_along_px",
            Unit::Pixel,
            "remainder by eq. 6; missing where orientation explains more than is observed. Not the accuracy of the altimeter",
            |of| match of.ground {
                GroundPart::Resolved { along_px } => Some(along_px),
                _ => None,
            },
        ),
        of(
            "budget_planimetric_m",
            Unit::Metre,
            "eq. 8, with the average of the across-track residuals, as Shan et al. compute it",
            |of| Some(of.paper_average.planimetric_m),
        ),
        of(
            "budget_height_m",
            Unit::Metre,
            "eq. 9, in the same way",
            |of| Some(of.paper_average.height_m),
        ),
        of(
            "budget_equation_7_height_m",
            Unit::Metre,
            "eq. 9, with the sum of squares of the across-track residuals, as eq. 7 states",
            |of| Some(of.equation_7.height_m),
        ),
        of(
            "budget_equation_5_along_px",
            Unit::Pixel,
            "along-track discrepancy due to orientation from the differences at each tie point (eq. 5)",
            |of| Some(of.equation_5.along_px),
        ),
        of(
            "budget_equation_5_unexplained_px",
            Unit::Pixel,
            "mean misregistration of the footprints that these differences do not explain",
            |of| of.equation_5.unexplained_px,
        ),
        of(
            "budget_equation_5_planimetric_m",
            Unit::Metre,
            "eq. 8 from these differences",
            |of| Some(of.equation_5.point.planimetric_m),
        ),
        of(
            "budget_equation_5_height_m",
            Unit::Metre,
            "eq. 9 from these differences",
            |of| Some(of.equation_5.point.height_m),
        ),
        column(
            "no_budget_because",
            Unit::None,
            "why the pair has no budget; empty if it has",
            |row: &&PairRow| row.budget.as_ref().err().cloned().unwrap_or_default(),
        ),
    ]
}
