//! Products in the forms of other programs: ISIS, Ames Stereo Pipeline, GIS, catalogues.

pub(super) mod adjusted;
mod binary_network;
mod bundleout;
mod contours;
mod control_network;
mod gcp;
pub(super) mod geopackage;
pub(super) mod jigsaw;
mod lidar_data;
pub(super) mod matched;
mod points;
pub(super) mod qgis;
pub(super) mod readme;
pub(super) mod shapefile;
pub(super) mod stac;
pub(super) mod tables;

pub use binary_network::write_binary_network;
pub use contours::{ContourLayer, write_contours};
pub use control_network::{ControlNetwork, NetworkMeasure, NetworkPoint, write_control_network};
pub use gcp::{ControlMeasure, ControlPoint, write_gcp};
pub use lidar_data::{LidarPoint, ProfileShift, write_lidar_data};
pub use points::{GroundEstimate, ImageMeasure, SharedSigmas};
pub use qgis::{on_ground_m, tie_residuals};

/// Decimals of degrees: 1e-9° are 0.06 mm on the ground.
const DEGREE_DECIMALS: usize = 9;
/// Decimals of kilometres: millimetres.
const KM_DECIMALS: usize = 6;
/// Decimals of metres: millimetres.
const METRE_DECIMALS: usize = 3;
/// Decimals of ephemeris seconds: microseconds.
const SECOND_DECIMALS: usize = 6;
