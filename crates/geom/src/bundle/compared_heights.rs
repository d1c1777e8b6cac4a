//! Heights of points above the surface, used in the adjustment or not: each independently, so that there may be many.

use nalgebra::Vector3;
use rayon::prelude::*;

use super::{
    HeightControl, HeightResidual,
    layout::{Layout, Linearised},
    point_rows::PointRows,
};
use crate::pushbroom::ExteriorOrientation;

/// Points whose surface is predicted together; the covariance between them is not used.
const TOGETHER: usize = 64;

impl HeightResidual {
    /// Standard deviation of the height above the surface from the point's own rays, metres.
    #[must_use]
    pub fn sigma_m(&self) -> f64 {
        self.surface_sigma_m.hypot(self.ray_sigma_m)
    }
}

/// Every compared point of `control` that is determined at this state.
pub(super) fn compared<M: ExteriorOrientation>(
    layout: &Layout<'_, M>,
    at: &Linearised,
    control: &HeightControl,
    is_active: impl Fn(usize) -> bool + Sync,
) -> Vec<HeightResidual> {
    let points: Vec<usize> = control
        .compared
        .iter()
        .copied()
        .filter(|of| is_active(*of))
        .collect();
    let pieces: Vec<Vec<HeightResidual>> = points
        .par_chunks(TOGETHER)
        .map_init(PointRows::default, |rows, points| {
            let places_m: Vec<Vector3<f64>> =
                points.iter().map(|of| at.state.points_m[*of]).collect();
            let surface = control.surface.predict(&places_m);
            let residual = |(index, point): (usize, &usize)| {
                layout.fill(rows, at, *point).ok()?;
                let triangle = rows.eliminate();
                let (height_m, by_point) = control.surface.height_m(&places_m[index]);
                let turned = triangle.tr_solve_upper_triangular(&by_point)?;
                Some(HeightResidual {
                    point: *point,
                    above_m: height_m - surface.heights_m[index],
                    surface_sigma_m: surface.sigma_m(index),
                    ray_sigma_m: turned.norm(),
                    nearest_shot_m: surface.nearest_m[index],
                    weight_factor: 1.0,
                    redundancy: 0.0,
                })
            };
            points.iter().enumerate().filter_map(residual).collect()
        })
        .collect();
    pieces.into_iter().flatten().collect()
}
