//! Terrain model and laser units of the last round of a calibration from pixels.

use super::{CalibrationProducts, WriteCalibration, write_csv, write_parquet};
use crate::{
    geotiff::{GeoTiff, write_raster},
    laser_match::units,
    product::{Content, Declaration, Role},
};
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
}

/// Products of calibrations from pixels.
pub(super) static PRODUCTS: [&Declaration<WriteCalibration>; 4] =
    [&HEIGHTS, &SIGMAS, &UNITS, &UNITS_CSV];

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
