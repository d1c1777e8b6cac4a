//! Reference frames as types: positions and rotations say which frame they belong to.
//!
//! Types do not see time, so a [`Rotation`] carries the instant at which it holds, and two rotations
//! of different instants do not combine.
//!
//! ```
//! use areograph::{
//!     frames::{MarsIau1991, MarsIau2000, Position, Rotation},
//!     geom::mars_rotation::mars_rotation,
//!     time::Et,
//! };
//! use nalgebra::Vector3;
//!
//! // The same point of the ground in the frames of two IAU reports, through J2000.
//! let et = Et::from_seconds(-20_723_097.688);
//! let old_to_new: Rotation<MarsIau1991, MarsIau2000> =
//!     mars_rotation::<MarsIau2000>(et) * mars_rotation::<MarsIau1991>(et).inverse();
//! let old: Position<MarsIau1991> = Position::new(Vector3::new(3_396_190.0, 0.0, 0.0));
//! let new: Position<MarsIau2000> = old_to_new.apply(&old);
//!
//! // The reports' meridians are 0.238° apart, which is 14 km on the equator.
//! let longitude_deg = new.xyz_m.y.atan2(new.xyz_m.x).to_degrees();
//! assert!((longitude_deg - 0.238).abs() < 1e-3); // the poles differ too
//! ```
//!
//! Two frames do not mix, neither in a distance
//!
//! ```compile_fail,E0308
//! use areograph::frames::{MarsIau1991, MarsIau2000, Position};
//! use nalgebra::Vector3;
//!
//! let old: Position<MarsIau1991> = Position::new(Vector3::zeros());
//! let new: Position<MarsIau2000> = Position::new(Vector3::zeros());
//! old.distance_m(&new);
//! ```
//!
//! nor in a product of rotations:
//!
//! ```compile_fail,E0277
//! use areograph::{
//!     frames::{MarsIau1991, MarsIau2000},
//!     geom::mars_rotation::mars_rotation,
//!     time::Et,
//! };
//!
//! let et = Et::from_seconds(0.0);
//! let old_to_new = mars_rotation::<MarsIau2000>(et) * mars_rotation::<MarsIau1991>(et);
//! ```

use std::{fmt, marker::PhantomData, ops::Mul};

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

use crate::{
    constants::{MARS_IAU1991, MARS_IAU1994, MARS_IAU2000, MarsModel},
    time::Et,
};

/// A reference frame with right-handed axes.
pub trait Frame: Copy + fmt::Debug + Send + Sync + 'static {
    /// Name as messages and products write it.
    const NAME: &'static str;
}

/// A frame fixed to the body of Mars by one IAU report.
pub trait MarsFixed: Frame {
    /// Rotation and shape of that report.
    fn model() -> &'static MarsModel;
}

macro_rules! frames {
    ($($(#[$doc:meta])* $frame:ident = $name:literal $(: $model:expr)?;)*) => {$(
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
        pub struct $frame;
        impl Frame for $frame { const NAME: &'static str = $name; }
        $(impl MarsFixed for $frame { fn model() -> &'static MarsModel { &$model } })?
    )*};
}

frames! {
    /// Inertial, Earth mean equator and equinox of J2000.
    J2000 = "J2000";
    /// Mars body-fixed, IAU 1991 report (W₀ = 176.868°).
    MarsIau1991 = "IAU_MARS (1991)": MARS_IAU1991;
    /// Mars body-fixed, IAU 1994 report (W₀ = 176.901°).
    MarsIau1994 = "IAU_MARS (1994)": MARS_IAU1994;
    /// Mars body-fixed, IAU 2000 report (W₀ = 176.630°); the frame of every product.
    MarsIau2000 = "IAU_MARS (2000)": MARS_IAU2000;
    /// Bus of the spacecraft: +Z towards nadir, flight along −X.
    SpacecraftBus = "bus";
    /// A camera: +Z boresight, +Y along the detector.
    CameraFrame = "camera";
}

/// Which IAU report a file's Mars-fixed coordinates follow, known only when the file is read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum MarsDatum {
    /// W₀ = 176.868°.
    Iau1991,
    /// W₀ = 176.901°.
    Iau1994,
    /// W₀ = 176.630°.
    Iau2000,
}

impl MarsDatum {
    /// Rotation and shape of the report.
    #[must_use]
    pub fn model(self) -> &'static MarsModel {
        match self {
            Self::Iau1991 => &MARS_IAU1991,
            Self::Iau1994 => &MARS_IAU1994,
            Self::Iau2000 => &MARS_IAU2000,
        }
    }
}

impl fmt::Display for MarsDatum {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.model().name)
    }
}

/// A position in frame `F`, metres from the centre of Mars.
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

/// Takes components in `A` to components in `B`; holds at one instant.
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

    /// The instant at which the rotation holds.
    #[must_use]
    pub const fn at(&self) -> Et {
        self.at
    }

    /// The rotation from `B` back to `A`.
    #[must_use]
    pub fn inverse(&self) -> Rotation<B, A> {
        Rotation::new(self.matrix.transpose(), self.at)
    }

    /// A position, its components taken from `A` to `B`.
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
    /// When the two hold at different instants: that is an error of the program, not of its input.
    fn mul(self, first: Rotation<Start, Middle>) -> Rotation<Start, End> {
        assert!(
            self.at == first.at,
            "rotations of two instants, {} and {}",
            self.at,
            first.at
        );
        Rotation::new(self.matrix * first.matrix, self.at)
    }
}
