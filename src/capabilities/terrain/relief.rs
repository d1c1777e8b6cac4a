//! The relief of a terrain model for maps: shading, slopes and contours.

use super::{
    contour_interval::contour_interval_m,
    products::{Band, WITH_A_MODEL, has_model, reference_file, significant_surface},
};
use crate::{
    error::Result,
    geom::{
        contours::{Contour, contours, generalised},
        height_grid::HeightGrid,
        slopes::{Light, shading, slopes_deg},
    },
    products::{
        Content, Context, ContourLayer, Declaration, GeoTiff, Number, ReadingProgram, Role,
        SiteProducts, Use, Write, write_contours, write_raster,
    },
    stages::map_surface::Surface,
    units::RADIANS_PER_DEGREE,
};

/// Direction to the light of the shading, degrees: the convention of maps, from the upper left.
const AZIMUTH_DEG: f64 = 315.0;
const ALTITUDE_DEG: f64 = 45.0;

pub(super) static HILLSHADE: Declaration = Declaration {
    path: "surface_hillshade.tif",
    what: "shading of the terrain model (cloud-optimised GeoTIFF): brightness 1 to 255 of a Lambertian surface with light at \
           azimuth 315° and altitude 45°, heights not exaggerated, gradients after Horn (1981); 0 in cells that lack a height or have a \
           neighbour without one",
    readers: "GIS",
    rows: "cells with a brightness",
    role: Role::Overview,
    content: Content::Foreign,
    write: Write::Where {
        sites: WITH_A_MODEL,
        has: has_model,
        write: |path, of| {
            let light = Light {
                azimuth_rad: AZIMUTH_DEG * RADIANS_PER_DEGREE,
                altitude_rad: ALTITUDE_DEG * RADIANS_PER_DEGREE,
            };
            let band = Band {
                what: "shading, light at azimuth 315 degrees and altitude 45 degrees",
                unit: "",
            };
            write_of(path, of, &band, |grid| shading(grid, light))
        },
    },
    uses: &[],
};

pub(super) static SLOPES: Declaration = Declaration {
    path: "surface_slope.tif",
    what: "slopes of the terrain model against the areoid (the ellipsoid or the map sphere without areoid radii), degrees \
           (cloud-optimised GeoTIFF), gradients after Horn (1981) over three cells; -32768 in cells that lack a height or have a \
           neighbour without one; the model is smoothed by the compared square, so that slopes over shorter distances are larger",
    readers: "GIS",
    rows: "cells with a slope",
    role: Role::Data,
    content: Content::Foreign,
    write: Write::Where {
        sites: WITH_A_MODEL,
        has: has_model,
        write: |path, of| {
            let band = Band {
                what: "slope",
                unit: "deg",
            };
            write_of(path, of, &band, slopes_deg)
        },
    },
    uses: &[],
};

pub(super) static CONTOURS: Declaration = Declaration {
    path: "exchange/surface_contours.gpkg",
    what: "contours of the terrain model as GeoPackage: lines with their heights above the areoid (the ellipsoid or the map \
           sphere without areoid radii), metres, of the mean over the compared square, at the interval that surface.json states; they \
           end at cells without a height; closed lines narrower than this square are omitted",
    readers: "GIS",
    rows: "contours",
    role: Role::Data,
    content: Content::Foreign,
    write: Write::Where {
        sites: WITH_A_MODEL,
        has: has_model,
        write: |path, of| {
            let Some(relief) = Relief::of(of.site)? else {
                return Ok(0);
            };
            let account = &relief.surface.account;
            let interval_m = contour_interval_m(account);
            let compared = account.compared_m / account.cell_m;
            #[allow(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "a few cells"
            )]
            let grid = generalised(&relief.grid, (0.5 * compared) as usize);
            let mut contours = contours(&grid, interval_m);
            contours.retain(|contour: &Contour| !contour.is_islet(compared));
            let layer = ContourLayer {
                grid: &grid,
                contours: &contours,
                interval_m,
                surface: relief.above,
            };
            write_contours(path, of, &layer)
        },
    },
    uses: &[Use {
        program: ReadingProgram::Gis,
        lines: "ogrinfo -al -so surface_contours.gpkg            contours of the terrain model",
    }],
};

/// A model with its heights above the surface to which figures refer.
struct Relief<'a> {
    surface: &'a Surface,
    /// This surface.
    above: &'static str,
    grid: HeightGrid,
}

impl<'a> Relief<'a> {
    fn of(site: &SiteProducts<'a>) -> Result<Option<Self>> {
        Ok(significant_surface(site)?.map(|surface| {
            let grid = surface.account.above_reference(&surface.model.heights);
            let above = reference_file(site).map_or("map sphere", |(above, _)| above);
            Self {
                surface,
                above,
                grid,
            }
        }))
    }
}

/// Writes numbers that follow from the heights above the reference surface.
fn write_of<N: Number + Send + Sync>(
    path: &std::path::Path,
    of: &Context,
    band: &Band<'_>,
    numbers: impl FnOnce(&HeightGrid) -> Vec<N>,
) -> Result<u64> {
    let Some(relief) = Relief::of(of.site)? else {
        return Ok(0);
    };
    let file = GeoTiff {
        grid: &relief.grid,
        parallel_rad: relief.surface.model.parallel_rad,
        body: of.site.config.body,
        conformal: None,
        what: band.what,
        unit: band.unit,
        vertical: "",
        numbers: &numbers(&relief.grid),
    };
    write_raster(path, &file)
}
