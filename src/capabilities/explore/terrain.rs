//! The terrain model along the profiles of the altimeter.

use serde::Serialize;

use super::columns::Packed;
use crate::{
    capabilities::terrain::significant_surface, error::Result, geom::height_grid::HeightGrid,
    products::SiteProducts, units::wrap_pi,
};

/// Samples of the terrain model from one footprint to the next: 40 m where footprints are 300 m apart.
const STEPS: usize = 8;

/// Heights of the terrain model along a profile.
#[derive(Debug, Serialize)]
pub(super) struct TerrainLine {
    profile: usize,
    /// Place among the footprints of the profile at which the heights begin.
    first: usize,
    /// Number of heights from one footprint to the next.
    steps: usize,
    /// Heights above the areoid, as those of the shots, metres; every `steps`-th is at a footprint.
    heights_m: Packed,
}

/// The terrain model along every profile on it, whose footprints are in `rows`.
///
/// # Errors
/// A terrain model that cannot be read.
pub(super) fn lines(site: &SiteProducts, profiles: &[Vec<usize>]) -> Result<Vec<TerrainLine>> {
    let Some(surface) = significant_surface(site)? else {
        return Ok(Vec::new());
    };
    let grid = &surface.model.heights;
    let lines = profiles.iter().enumerate().filter_map(|(profile, rows)| {
        let heights_m = along(site, grid, rows);
        let is_known = |from: usize| {
            let to = heights_m.len().min(from + STEPS + 1);
            heights_m[from..to].iter().any(Option::is_some)
        };
        let known = || (0..rows.len()).filter(|at| is_known(at * STEPS));
        let (first, last) = (known().next()?, known().next_back()?);
        let end = heights_m.len().min((last + 1) * STEPS + 1);
        let part = heights_m[first * STEPS..end].iter().copied();
        Some(TerrainLine {
            profile,
            first,
            steps: STEPS,
            heights_m: Packed::of(2, part),
        })
    });
    Ok(lines.collect())
}

/// Heights at the footprints in `rows`, and between each and the next.
fn along(site: &SiteProducts, grid: &HeightGrid, rows: &[usize]) -> Vec<Option<f64>> {
    let footprints = site.footprints;
    let height_m = |from: usize, to: usize, share: f64| {
        let between = |column: &dyn Fn(usize) -> f64| {
            let (start, end) = (column(from), column(to));
            start + share * (end - start)
        };
        let longitude_rad = footprints.longitude_rad.at(from);
        let ahead_rad = wrap_pi(footprints.longitude_rad.at(to) - longitude_rad);
        let latitude_rad = between(&|row| footprints.latitude_rad.at(row));
        let areoid_m = between(&|row| footprints.areoid_radius_m.at(row));
        let cell = grid.cell_of(longitude_rad + share * ahead_rad, latitude_rad);
        Some(grid.radius_m + grid.height_m(cell)? - areoid_m)
    };
    let mut heights_m: Vec<Option<f64>> = rows
        .windows(2)
        .flat_map(|pair| {
            let shares = (0..STEPS).map(|step| step as f64 / STEPS as f64);
            shares.map(|share| height_m(pair[0], pair[1], share))
        })
        .collect();
    heights_m.extend(rows.last().map(|row| height_m(*row, *row, 0.0)));
    heights_m
}
