//! Heights of points above the surface, used in the adjustment or not: each independently, so that there may be many.

use nalgebra::Vector3;
use rayon::prelude::*;

use super::{
    HeightControl, HeightResidual,
    layout::{Layout, Linearised, OF_A_TASK},
    point_rows::PointRows,
};
use crate::pushbroom::ExteriorOrientation;

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
    let places_m: Vec<Vector3<f64>> = points.iter().map(|of| at.state.points_m[*of]).collect();
    let surface = control.surface.predict_each(&places_m);
    let residual = |rows: &mut PointRows, index: usize| {
        let (point, here) = (points[index], &surface[index]);
        layout.fill(rows, at, point).ok()?;
        let triangle = rows.eliminate();
        let (height_m, by_point) = control.surface.height_m(&places_m[index]);
        let turned = triangle.tr_solve_upper_triangular(&by_point)?;
        Some(HeightResidual {
            point,
            above_m: height_m - here.height_m,
            surface_sigma_m: here.sigma_m,
            ray_sigma_m: turned.norm(),
            nearest_shot_m: here.nearest_m,
            weight_factor: 1.0,
            redundancy: 0.0,
        })
    };
    let residuals = (0..points.len()).into_par_iter();
    let residuals = residuals.with_min_len(OF_A_TASK);
    let residuals = residuals.map_init(PointRows::default, residual);
    residuals
        .collect::<Vec<_>>()
        .into_iter()
        .flatten()
        .collect()
}
