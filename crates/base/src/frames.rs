//! Reference frames as types: positions and rotations carry their frame.
//!
//! Types do not depend on time, so a [`Rotation`] carries its instant, and two rotations of different instants cannot
//! be combined.
//!
//! `Position<F>` and `Rotation<A, B>` carry their frames, and `Footprints<D>` their datum: only `convert_datum` turns
//! `AsRead` into `BodyFixed`, so that a second conversion does not compile. The body of a `BodyFixed` place is data
//! beside it (decision 0024). Stage outputs keep these types; plain numbers begin where a file is written.
//!
//! ```
//! use areograph_base::{
//!     body::Body,
//!     frames::{BodyFixed, J2000, Position, Rotation},
//!     time::Et,
//! };
//! use areograph_geom::body_rotation::body_rotation;
//! use nalgebra::Vector3;
//!
//! // A place of the ground a second later, seen from the stars: Mars turns to the east.
//! let et = Et::from_seconds(-20_723_097.688);
//! let ground: Position<BodyFixed> = Position::new(Vector3::new(3_396_190.0, 0.0, 0.0));
//! let [now, then]: [Position<J2000>; 2] = [et, et.plus(1.0)]
//!     .map(|et| body_rotation(Body::Mars, et).inverse().apply(&ground));
//!
//! // 241 m/s at the equator.
//! assert!((now.distance_m(&then) - 240.7).abs() < 0.1);
//! ```
//!
//! Two frames do not mix, neither in a distance
//!
//! ```compile_fail,E0308
//! use areograph_base::frames::{BodyFixed, J2000, Position};
//! use nalgebra::Vector3;
//!
//! let ground: Position<BodyFixed> = Position::new(Vector3::zeros());
//! let spacecraft: Position<J2000> = Position::new(Vector3::zeros());
//! ground.distance_m(&spacecraft);
//! ```
//!
//! nor in a product of rotations:
//!
//! ```compile_fail,E0277
//! use areograph_base::{body::Body, time::Et};
//! use areograph_geom::body_rotation::body_rotation;
//!
//! let et = Et::from_seconds(0.0);
//! let twice = body_rotation(Body::Mars, et) * body_rotation(Body::Mars, et);
//! ```

use std::{fmt, marker::PhantomData, ops::Mul};

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

use crate::time::Et;

/// A reference frame with right-handed axes.
pub trait Frame: Copy + fmt::Debug + Send + Sync + 'static {
    /// Name in messages and products.
    const NAME: &'static str;
}

macro_rules! frames {
    ($($(#[$doc:meta])* $frame:ident = $name:literal;)*) => {$(
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
        pub struct $frame;
        impl Frame for $frame { const NAME: &'static str = $name; }
    )*};
}

frames! {
    /// Inertial, Earth mean equator and equinox of J2000.
    J2000 = "J2000";
    /// Fixed to the body of the site, in the frame of its products: for Mars the frame of the IAU 2000 report (W₀ =
    /// 176.630°), for the Moon mean Earth/polar axis. The body is given by the accompanying [`crate::body::Body`].
    BodyFixed = "body-fixed";
    /// Bus of the spacecraft: +Z towards nadir, flight along −X.
    SpacecraftBus = "bus";
    /// A camera: +Z boresight, +Y along the detector.
    CameraFrame = "camera";
}

/// A position in frame `F`, metres from the centre of the body.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(transparent, bound = "")]
pub struct Position<F> {
    /// Components, metres.
    pub xyz_m: Vector3<f64>,
    frame: PhantomData<fn(F)>,
}

impl<F: Frame> Position<F> {
    /// The position with components `xyz_m`, metres.
    #[must_use]
    pub const fn new(xyz_m: Vector3<f64>) -> Self {
        Self {
            xyz_m,
            frame: PhantomData,
        }
    }

    /// Distance to `other`, metres.
    #[must_use]
    pub fn distance_m(&self, other: &Self) -> f64 {
        (self.xyz_m - other.xyz_m).norm()
    }
}

/// Transforms components in `A` to components in `B`; valid at one instant.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(bound = "")]
pub struct Rotation<A, B> {
    matrix: Matrix3<f64>,
    at: Et,
    frames: PhantomData<fn(A) -> B>,
}

impl<A: Frame, B: Frame> Rotation<A, B> {
    /// The rotation whose rows are the axes of `B` in components of `A`, at instant `at`.
    #[must_use]
    pub const fn new(matrix: Matrix3<f64>, at: Et) -> Self {
        Self {
            matrix,
            at,
            frames: PhantomData,
        }
    }

    /// The matrix that multiplies components in `A`.
    #[must_use]
    pub const fn matrix(&self) -> &Matrix3<f64> {
        &self.matrix
    }

    /// The instant of the rotation.
    #[must_use]
    pub const fn at(&self) -> Et {
        self.at
    }

    /// The rotation from `B` back to `A`.
    #[must_use]
    pub fn inverse(&self) -> Rotation<B, A> {
        Rotation::new(self.matrix.transpose(), self.at)
    }

    /// A position, with components transformed from `A` to `B`.
    #[must_use]
    pub fn apply(&self, position: &Position<A>) -> Position<B> {
        Position::new(self.matrix * position.xyz_m)
    }
}

impl<Start: Frame, Middle: Frame, End: Frame> Mul<Rotation<Start, Middle>>
    for Rotation<Middle, End>
{
    type Output = Rotation<Start, End>;

    /// First `first`, then `self`.
    ///
    /// # Panics
    /// If the two have different instants: this is an error of the program, not of its input.
    fn mul(self, first: Rotation<Start, Middle>) -> Rotation<Start, End> {
        assert!(
            self.at == first.at,
            "rotations at different instants, {} and {}",
            self.at,
            first.at
        );
        Rotation::new(self.matrix * first.matrix, self.at)
    }
}
