//! Root mean squares of points under a calibration.

use super::{
    read::OrbitPoint,
    result::{ControlFigures, Figures, PixelsAndMetres, PointKind, TieFigures},
};
use areograph_geom::calibration::CalibrationState;

/// Figures of an orbit's points, `pixels` being the tangent of a pixel of every camera.
pub(super) fn figures(points: &[OrbitPoint], state: &CalibrationState, pixels: &[f64]) -> Figures {
    Figures {
        ties: ties(points, state, pixels),
        control: [PointKind::Control, PointKind::HeldBack]
            .into_iter()
            .filter_map(|kind| control(points, kind, state, pixels))
            .collect(),
    }
}

/// Sum and number of squares.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Squares {
    sum: f64,
    count: u64,
}

impl Squares {
    pub(super) fn add(&mut self, value: f64) {
        self.sum += value * value;
        self.count += 1;
    }

    /// The root of their mean; `None` without values.
    pub(super) fn rms(self) -> Option<f64> {
        (self.count > 0).then(|| (self.sum / self.count as f64).sqrt())
    }
}

fn ties(points: &[OrbitPoint], state: &CalibrationState, pixels: &[f64]) -> TieFigures {
    let mut squares = vec![[Squares::default(); 2]; pixels.len()];
    let mut count = 0;
    for of in points.iter().filter(|point| point.is(PointKind::Tie)) {
        let Ok(place_m) = of.point.place(state) else {
            continue;
        };
        let Ok(residuals) = of.point.residuals(state, &place_m) else {
            continue;
        };
        count += 1;
        for (sight, residual) in of.point.sights.iter().zip(residuals) {
            for (squares, axis) in squares[sight.camera].iter_mut().zip(0..2) {
                squares.add(residual[axis] / pixels[sight.camera]);
            }
        }
    }
    TieFigures {
        points: count,
        cameras_px: squares.into_iter().map(|of| of.map(Squares::rms)).collect(),
    }
}

fn control(
    points: &[OrbitPoint],
    kind: PointKind,
    state: &CalibrationState,
    pixels: &[f64],
) -> Option<ControlFigures> {
    let mut squares = vec![[Squares::default(); 2]; pixels.len()];
    let mut heights = Squares::default();
    let mut count = 0;
    for of in points.iter().filter(|point| point.is(kind)) {
        let Some(known) = &of.point.known else {
            continue;
        };
        let Ok(residuals) = of.point.residuals(state, &known.place_m) else {
            continue;
        };
        count += 1;
        for (sight, residual) in of.point.sights.iter().zip(residuals) {
            let [px, m] = &mut squares[sight.camera];
            px.add(residual.norm() / pixels[sight.camera]);
            if let Some(seen_m) = sight.at_radius(state, known.place_m.norm()) {
                m.add((seen_m - known.place_m).norm());
            }
        }
        if of.point.sights.len() > 1
            && let Ok(place_m) = of.point.unaided().place(state)
        {
            heights.add(place_m.norm() - known.place_m.norm());
        }
    }
    (count > 0).then(|| ControlFigures {
        kind,
        points: count,
        cameras: squares
            .into_iter()
            .map(|[px, m]| PixelsAndMetres {
                plane_px: px.rms(),
                plane_m: m.rms(),
            })
            .collect(),
        heights: heights.count,
        height_m: heights.rms(),
    })
}
