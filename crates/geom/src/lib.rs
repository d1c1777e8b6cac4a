//! Pure geometry of photogrammetry at Mars: no files, no clocks, no SPICE.
//!
//! | to | use |
//! |---|---|
//! | project ground points into a pushbroom image | [`pushbroom`] |
//! | intersect rays, adjust a block | [`intersection`], [`bundle`] |
//! | triangulate pictures in the plane | [`plane`] |
//! | calibrate the lines of a camera | [`calibration`] |
//! | convert datums and coordinates | [`body_rotation`], [`ellipsoid`], [`map_projection`] |
//! | test which shots lie in a window | [`window`] |
//! | match patches of pixels | [`imaging`] |
//!
//! It also has attitude, polynomials, Chebyshev pieces, interpolation, statistics, random numbers, heights on a grid,
//! the areoid over a site, the ground between shots, and the uncertainty budget. `imaging` covers texture, correlation and least-squares
//! matching.
//!
//! ```
//! use areograph_geom::ellipsoid::{Spherical, spherical_to_xyz_m};
//!
//! // Gusev crater: east longitude and areocentric latitude, radians; radius, metres.
//! let (longitude_rad, latitude_rad) = (175.5_f64.to_radians(), -14.6_f64.to_radians());
//! let xyz_m = spherical_to_xyz_m(longitude_rad, latitude_rad, 3_393_000.0);
//! let back = Spherical::from_xyz_m(&xyz_m);
//! assert!((back.longitude_rad - longitude_rad).abs() < 1e-12);
//! assert!((back.latitude.0 - latitude_rad).abs() < 1e-12);
//! ```

pub mod attitude;
pub mod block_equations;
mod blocked_cholesky;
pub mod body_rotation;
pub mod boresight;
pub mod bundle;
pub mod calibration;
pub mod chebyshev;
pub mod collinearity;
pub mod conformal_map;
pub mod contours;
pub mod convex;
pub mod ellipsoid;
pub mod height_grid;
pub mod image_outline;
pub mod imaging;
pub mod intersection;
pub mod lagrange;
pub mod light_time;
pub mod longitude_ring;
pub mod map_projection;
pub mod misregistration;
pub mod nearby_angle;
pub mod orbit_axes;
pub mod oriented_camera;
pub mod plane;
pub mod polynomial;
pub mod pushbroom;
pub mod random;
pub mod range_residuals;
pub mod readings;
pub mod reference_surface;
pub mod robust;
pub mod robust_mean;
pub mod scattered_heights;
pub mod slopes;
pub mod statistics;
pub mod surface;
pub mod uncertainty;
pub mod window;
