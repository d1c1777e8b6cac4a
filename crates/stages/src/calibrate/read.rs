//! Images and points of an orbit; those that the uncalibrated cameras cannot have seen are left out.

use std::path::PathBuf;

use super::{
    error::CalibrateError,
    geometry::{CameraImage, Laboratory, Orbit},
    given::{self, GivenPoints},
    result::PointKind,
    tables::{Cameras, Complaints, ControlSigma, Measured, MeasuredPoint, control, ties},
};
use areograph_base::error::Result;
use areograph_config::CalibrationConfig;
use areograph_geom::calibration::{CalibrationState, GroundPoint};

/// Share of points that do not fit above which the input is rejected.
const MISFITS_MAX: f64 = 0.5;
/// Largest height of the ground above or below the equatorial radius, metres: the poles lie 20 km lower, mountains 22
/// km higher.
const HEIGHT_MAX_M: f64 = 50_000.0;

/// A point of an orbit.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct OrbitPoint {
    pub(super) name: String,
    pub(super) kind: PointKind,
    pub(super) measured: Vec<Measured>,
    pub(super) point: GroundPoint,
    pub(super) left_out: bool,
    /// Whether it is a tie point where ties are wrong along the flight, and the ground would not reveal an error of
    /// this one.
    pub(super) may_be_off: bool,
}

impl OrbitPoint {
    /// Whether it is of this kind and in use.
    pub(super) fn is(&self, kind: PointKind) -> bool {
        self.kind == kind && !self.left_out
    }
}

/// Source of the points of an orbit.
pub(super) enum PointSource<'a> {
    /// Tables.
    Tables {
        ties: &'a [PathBuf],
        control: &'a [PathBuf],
        /// Every *n*-th control point is withheld; `None` in other orbits.
        held_back_every: Option<u32>,
    },
    /// Points that were measured in this run.
    Given(&'a GivenPoints),
}

/// The points of an orbit.
pub(super) fn points_of(
    config: &CalibrationConfig,
    names: &[String],
    orbit: &Orbit,
    laboratory: &Laboratory,
    source: &PointSource<'_>,
    complaints: &mut Complaints,
) -> Result<Vec<OrbitPoint>> {
    let sizes: Vec<[f64; 2]> = orbit.images.iter().map(CameraImage::size).collect();
    let cameras = Cameras {
        names,
        sizes: &sizes,
    };
    let sigma = ControlSigma {
        image_px: config.control.sigma_px,
        horizontal_m: config.control.sigma_horizontal_m,
        vertical_m: config.control.sigma_vertical_m,
    };
    let tie_px = config.ties.sigma_px;
    let (tied, controlled, judging) = match source {
        PointSource::Tables {
            ties: of_ties,
            control: of_control,
            ..
        } => (
            ties(of_ties, tie_px, &cameras, complaints)?,
            control(of_control, sigma, &cameras, complaints)?,
            Vec::new(),
        ),
        PointSource::Given(given) => (
            given::ties(&given.ties, tie_px),
            given::control(&given.control, sigma),
            given::control(&given.held_back, sigma),
        ),
    };
    let state = &laboratory.state;
    let make = |kind: PointKind, of: Vec<MeasuredPoint>| -> Vec<OrbitPoint> {
        let point = |of: MeasuredPoint| {
            let sights = of.measured.iter().map(|measured| {
                orbit.sight(state, measured.camera, measured.place, measured.sigma_px)
            });
            OrbitPoint {
                point: GroundPoint {
                    sights: sights.collect(),
                    known: of.known,
                },
                name: of.name,
                kind,
                measured: of.measured,
                left_out: false,
                may_be_off: false,
            }
        };
        of.into_iter().map(point).collect()
    };
    let mut tied = make(PointKind::Tie, tied);
    let mut controlled = make(PointKind::Control, controlled);
    controlled.extend(make(PointKind::HeldBack, judging));
    let pixels: Vec<f64> = orbit.images.iter().map(CameraImage::pixel).collect();
    let limits = [
        (&mut tied, "tie points", config.ties.limit_px),
        (&mut controlled, "control points", config.control.limit_px),
    ];
    for (points, what, limit_px) in limits {
        let expected = Expected {
            state,
            pixels: &pixels,
            radius_m: orbit.radius_m,
            limit_px,
        };
        leave_out(points, what, &expected, complaints)?;
    }
    if let PointSource::Tables {
        held_back_every: Some(every),
        ..
    } = source
    {
        hold_back(&mut controlled, *every as usize);
    }
    tied.append(&mut controlled);
    Ok(tied)
}

/// Withholds every *n*-th point along the flight.
fn hold_back(points: &mut [OrbitPoint], every: usize) {
    let mut order: Vec<usize> = (0..points.len())
        .filter(|index| !points[*index].left_out)
        .collect();
    let line = |index: &usize| points[*index].measured[0].place[0];
    order.sort_by(|a, b| line(a).total_cmp(&line(b)));
    for index in order.into_iter().skip(every / 2).step_by(every) {
        points[index].kind = PointKind::HeldBack;
    }
}

/// The expectation against which points are checked before the calibration.
struct Expected<'a> {
    state: &'a CalibrationState,
    /// Tangent of a pixel of every camera.
    pixels: &'a [f64],
    /// Radius of the ground, metres.
    radius_m: f64,
    limit_px: f64,
}

/// Marks points that do not fit; if most do not, the input is wrong, not the points.
fn leave_out(
    points: &mut [OrbitPoint],
    what: &'static str,
    expected: &Expected<'_>,
    complaints: &mut Complaints,
) -> std::result::Result<(), CalibrateError> {
    let (mut misfits, mut example) = (0, None);
    for of in points.iter_mut() {
        let Err(why) = fits(&of.point, expected) else {
            continue;
        };
        of.left_out = true;
        misfits += 1;
        complaints.tell(format!("{}: {why}; left out", of.name));
        example.get_or_insert((of.name.clone(), why));
    }
    let all = points.len();
    match example {
        Some((point, why)) if misfits as f64 > MISFITS_MAX * all as f64 => {
            Err(CalibrateError::Misfit {
                what,
                misfits,
                all,
                point,
                why,
            })
        }
        _ => Ok(()),
    }
}

/// Whether the uncalibrated cameras can have seen a point, or why they cannot.
fn fits(point: &GroundPoint, expected: &Expected<'_>) -> std::result::Result<(), String> {
    let Expected {
        state,
        pixels,
        radius_m,
        limit_px,
    } = *expected;
    let place_m = match &point.known {
        Some(known) => known.place_m,
        None => point.place(state).map_err(|why| why.to_string())?,
    };
    let height_m = place_m.norm() - radius_m;
    if !(height_m.abs() <= HEIGHT_MAX_M) {
        return Err(format!(
            "it lies {:.1} km above the equatorial radius",
            height_m / 1e3
        ));
    }
    let residuals = point
        .residuals(state, &place_m)
        .map_err(|why| why.to_string())?;
    for (sight, residual) in point.sights.iter().zip(residuals) {
        let off_px = residual.norm() / pixels[sight.camera];
        if !(off_px <= limit_px) {
            return Err(format!(
                "its measurement is {off_px:.0} px away from its position according to the support data; expected at \
                 most {limit_px} px"
            ));
        }
    }
    Ok(())
}
