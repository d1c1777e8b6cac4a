//! Offset angles and look angles of the lines of one camera, from tie points of several lines and from control points.
//!
//! The model follows Li et al. 2023, with its misprints corrected: `P = S + m · R · R_u · (tan ψx, tan ψy, 1)ᵀ`, with
//! the position `S` of the spacecraft, the rotation `R` from its axes to body-fixed ones, an offset rotation
//! `R_u = R_φ R_ω R_κ` and polynomials `tan ψx(s)`, `tan ψy(s)` of every line. Axes of the spacecraft: x across the
//! flight, y along it, z down. Residuals are tangents, `V = (XX/ZZ − tan ψx, YY/ZZ − tan ψy)` with
//! `(XX, YY, ZZ)ᵀ = R_uᵀ Rᵀ (P − S)`.
//!
//! Ground points are eliminated one by one by reflections of their rows. This preserves the null space of the points,
//! which normal equations would lose in rounding.
//!
//! Points are weighted by their own errors. The covariance of the parameters also contains errors that groups of control points
//! share (`shared`).
//!
//! Free parameters are a matrix of combinations in units of their a priori standard deviations (`freedom`). Adjustment
//! by tie points only can therefore free the two differences that they determine and no others (decision 0025). The orbit
//! drift is an unknown together with the camera; offsets absorb the constant part of the orbit error.

mod camera;
mod elimination;
mod freedom;
mod looks;
mod misfit;
mod null_space;
mod series;
mod shared;
mod sight;
mod solve;
#[cfg(test)]
mod tests;

pub use camera::{CalibrationState, LineCamera, LinePose, Offset};
pub use freedom::{Freedom, Layout, Parameter};
pub use looks::{LOOKS_AT, LookParameter, look_changes, orbit_in_looks};
pub use misfit::{Misfit, Missed, TookPart};
pub use null_space::{AngleCombination, Axis, Combination, TieDirection, TieSight, tie_sight};
pub use series::{
    Agreement, Drift, Estimate, Lines, ONE_SIGMAS, OrbitChange, OrbitLooks, RELEVANT_PX, Series,
    TOGETHER_SIGMAS, compare_orbits, parameters,
};
pub use sight::{GroundPoint, KnownPlace, SharedError, Sight, SightError};
pub use solve::{CalibrationError, Solved, Start, solve};
