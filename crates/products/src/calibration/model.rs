//! Terrain model, laser units, elevation curves and measured points of the last round of a calibration from pixels.

use super::{CalibrationProducts, WriteCalibration, write_csv, write_parquet};
use crate::{
    geotiff::{GeoTiff, write_raster},
    laser_match::{control, curves, score_maps, units},
    parquet,
    product::{Content, Declaration, Role},
    table::{Column, Table, Unit, column, meanings},
};
use areograph_base::ties::{TieMeasure, TiePoint};
use areograph_stages::{map_surface::SurfaceModel, match_laser::LaserMatch};

/// Evidence of a calibration from pixels, beside its points.
#[derive(Debug, Clone, Copy)]
pub struct CalibrationModel<'a> {
    /// The terrain model of the last round, by the cameras that agree at tie points of this round.
    pub surface: &'a SurfaceModel,
    /// Match of the laser with the model of the first round.
    pub first: &'a LaserMatch,
    /// Match of the laser with the model of the last round.
    pub last: &'a LaserMatch,
    /// Tie points of the last round.
    pub ties: &'a [TiePoint],
}

/// Products of calibrations from pixels.
pub(super) static PRODUCTS: [&Declaration<WriteCalibration>; 8] = [
    &HEIGHTS, &SIGMAS, &UNITS, &UNITS_CSV, &CURVES, &SCORES, &TIES, &CONTROL,
];

static HEIGHTS: Declaration<WriteCalibration> = Declaration {
    path: "surface_above_sphere.tif",
    what: "calibrations from pixels: terrain model of the last round (cloud-optimised GeoTIFF): heights above the sphere of the \
           body's maps, metres; -32768 in cells without a height",
    readers: "GIS, Ames Stereo Pipeline, `areograph pedr match`",
    rows: "cells with a height",
    role: Role::Data,
    content: Content::Foreign,
    write: |path, of| {
        raster(of, "height above the map sphere", |model| {
            &model.heights.heights_m
        })
        .map_or(Ok(0), |file| write_raster(path, &file))
    },
    uses: &[],
};

static SIGMAS: Declaration<WriteCalibration> = Declaration {
    path: "surface_sigma.tif",
    what: "calibrations from pixels: standard deviations of the heights in surface_above_sphere.tif about their common error, metres",
    readers: "GIS",
    rows: "cells with a height",
    role: Role::Data,
    content: Content::Foreign,
    write: |path, of| {
        raster(of, "standard deviation of height", |model| &model.sigmas_m)
            .map_or(Ok(0), |file| write_raster(path, &file))
    },
    uses: &[],
};

static UNITS: Declaration<WriteCalibration> = Declaration {
    path: "units.parquet",
    what: units::WHAT,
    readers: "scripts",
    rows: "units",
    role: Role::Data,
    content: Content::Table(units::meaning),
    write: |path, of| {
        let model = of.model;
        model.map_or(Ok(0), |model| {
            write_parquet(path, of, &units::table(model.last))
        })
    },
    uses: &[],
};

static UNITS_CSV: Declaration<WriteCalibration> = Declaration {
    path: "units.csv",
    what: "units of laser shots, as CSV",
    readers: "spreadsheets, scripts",
    rows: "units",
    role: Role::Data,
    content: Content::Table(units::meaning),
    write: |path, of| {
        let model = of.model;
        model.map_or(Ok(0), |model| write_csv(path, units::table(model.last)))
    },
    uses: &[],
};

static CURVES: Declaration<WriteCalibration> = Declaration {
    path: "elevation_curves.parquet",
    what: "calibrations from pixels: heights of the laser and of the terrain models of the first and the last round at every \
           shot within the extent of the model of the last round, with distances along the pass (Li et al. 2023, figures 8 and 9)",
    readers: "scripts",
    rows: "shots",
    role: Role::Data,
    content: Content::Table(curves::meaning_of_rounds),
    write: |path, of| {
        let Some(model) = of.model else { return Ok(0) };
        let rows = curves::rows(model.last, Some(model.first));
        let table = Table::new(curves::columns_of_rounds(), rows);
        let about = vec![
            ("calibration", of.config.calibration.clone()),
            ("heights_above_m", model.last.radius_m.to_string()),
        ];
        parquet::write(path, &table, about)
    },
    uses: &[],
};

/// A raster of the terrain model.
fn raster<'a>(
    of: &CalibrationProducts<'a>,
    what: &'static str,
    numbers: fn(&SurfaceModel) -> &Vec<f32>,
) -> Option<GeoTiff<'a, f32>> {
    let surface = of.model?.surface;
    Some(GeoTiff {
        grid: &surface.heights,
        parallel_rad: surface.parallel_rad,
        body: of.config.body,
        conformal: None,
        what,
        unit: "m",
        vertical: "",
        numbers: numbers(surface),
    })
}

static SCORES: Declaration<WriteCalibration> = Declaration {
    path: "score_maps.parquet",
    what: "calibrations from pixels: similarity of the heights of laser and terrain model of the last round over the shifts of every \
           searched unit (Li et al. 2023, figure 7)",
    readers: "scripts",
    rows: "shifts",
    role: Role::Data,
    content: Content::Table(score_maps::meaning),
    write: |path, of| {
        let model = of.model;
        model.map_or(Ok(0), |model| {
            write_parquet(path, of, &score_maps::table(model.last))
        })
    },
    uses: &[],
};

static TIES: Declaration<WriteCalibration> = Declaration {
    path: "ties.csv",
    what: "calibrations from pixels: measured tie points, for `[ties] files` and `[[validation]] ties` of other calibrations",
    readers: "areograph calibrate",
    rows: "image positions",
    role: Role::Data,
    content: Content::Table(|| meanings(&tie_columns())),
    write: |path, of| {
        let Some(model) = of.model else { return Ok(0) };
        let points = model.ties.iter();
        let rows = points.flat_map(|point| {
            point.measures.iter().map(|measure| TieRow {
                point: &point.id,
                camera: &of.config.cameras[measure.image].id,
                measure,
            })
        });
        write_csv(path, Table::new(tie_columns(), rows.collect()))
    },
    uses: &[],
};

static CONTROL: Declaration<WriteCalibration> = Declaration {
    path: "control.csv",
    what: "calibrations from pixels: laser points of the last round, used and withheld, for `[control] files` and `[[validation]] \
           control` of other calibrations",
    readers: "areograph calibrate",
    rows: "image positions",
    role: Role::Data,
    content: Content::Table(control::meaning),
    write: |path, of| {
        let model = of.model;
        model.map_or(Ok(0), |model| write_csv(path, control::table(model.last)))
    },
    uses: &[],
};

/// A tie point in a line.
struct TieRow<'a> {
    point: &'a str,
    camera: &'a str,
    measure: &'a TieMeasure,
}

fn tie_columns<'a>() -> Vec<Column<TieRow<'a>>> {
    let sigma = |axis: usize| move |row: &TieRow| row.measure.sigma_px.map(|sigma| sigma[axis]);
    vec![
        column("point", Unit::None, "name of the point", |row: &TieRow| {
            row.point.to_owned()
        }),
        column(
            "camera",
            Unit::None,
            "line of the camera",
            |row: &TieRow| row.camera.to_owned(),
        ),
        column(
            "line",
            Unit::Line,
            "measured line coordinate, 0 at the outer edge of the first line",
            |row: &TieRow| row.measure.line,
        ),
        column(
            "sample",
            Unit::Pixel,
            "measured sample coordinate, 0 at the outer edge of the first sample",
            |row: &TieRow| row.measure.sample,
        ),
        column(
            "sigma_line",
            Unit::Line,
            "standard deviation of the line coordinate",
            sigma(0),
        ),
        column(
            "sigma_sample",
            Unit::Pixel,
            "standard deviation of the sample coordinate",
            sigma(1),
        ),
    ]
}
