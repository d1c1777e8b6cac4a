//! Pure geometry: no files, no clocks, no SPICE.

pub mod attitude;
pub mod block_equations;
pub mod bundle;
pub mod chebyshev;
pub mod collinearity;
pub mod conformal_map;
pub mod ellipsoid;
pub mod image_outline;
pub mod intersection;
pub mod lagrange;
pub mod light_time;
pub mod map_projection;
pub mod mars_rotation;
pub mod misregistration;
pub mod orbit_axes;
pub mod oriented_camera;
pub mod plane;
pub mod polynomial;
pub mod pushbroom;
pub mod range_residuals;
pub mod robust;
pub mod statistics;
pub mod surface;
pub mod uncertainty;
pub mod window;
