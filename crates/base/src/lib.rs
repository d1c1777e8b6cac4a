//! The vocabulary of areograph: units, instants, frames, bodies, instruments, footprints, errors and verdicts.
//!
//! Numbers are `f64`: metres, radians, and seconds of ephemeris time (TDB) past J2000. A position carries its frame as a
//! type, a number its unit in its name.
//!
//! ```
//! use areograph_base::{body::Body, time::Et, units::RADIANS_PER_DEGREE};
//!
//! let launch = Et::from_seconds(-99_403_140.0);
//! assert!(launch.seconds() < 0.0);
//! // IAU 2000: 3396.19 km at the equator.
//! assert!((Body::Mars.model().equatorial_radius_m - 3_396_190.0).abs() < 1e-6);
//! assert!((180.0 * RADIANS_PER_DEGREE - std::f64::consts::PI).abs() < 1e-15);
//! ```

// The derive of causes names this crate, inside it too.
extern crate self as areograph_base;

pub mod altimetry;
pub mod body;
pub mod column;
pub mod constants;
pub mod error;
pub mod footprints;
pub mod frames;
pub mod image;
pub mod instruments;
pub mod kernel_names;
pub mod kernel_source;
pub mod line_times;
pub mod minus;
pub mod packed;
#[cfg(feature = "schema")]
pub mod schema;
pub mod season;
pub mod stored;
pub mod style;
pub mod terms;
pub mod ties;
pub mod time;
pub mod units;
pub mod utc;
pub mod verdict;
pub mod watch;
