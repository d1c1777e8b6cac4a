//! The stages of the flow: plain functions from typed input to typed output.
//!
//! No stage calls another, writes to the terminal, or knows another's files. The flow of the program puts them in
//! order. Modules that serve several stages are in `shared`.
//!
//! `read_ties` and `group_profiles` find the images of measurements and profiles once. From there on, images, profiles,
//! tie points and footprints are indices in the order of the site; identifiers are for messages and products.

pub mod adjust;
pub mod calibrate;
pub mod check_archive;
pub mod check_beam;
pub mod check_heights;
pub mod check_profiles;
pub mod check_ranges;
pub mod compare_kernels;
pub mod compare_orthoimages;
pub mod compare_pairs;
pub mod convert_datum;
pub mod describe_kernels;
pub mod fit_sensor_model;
pub mod group_profiles;
pub mod interpolate_shots;
pub mod intersect;
pub mod join_surfaces;
pub mod judge;
pub mod lay_overlays;
pub mod map_pictures;
pub mod map_surface;
pub mod match_laser;
pub mod match_ties;
pub mod mosaic_images;
pub mod outline_windows;
pub mod pool_sites;
pub mod read_shots;
pub mod read_ties;
pub mod rectify_images;
pub mod register;
pub mod reorient;
pub mod sample_orientation;
pub mod search_footprints;
pub mod select_images;
mod shared;
pub mod tabulate_kernels;
pub mod tag_times;
pub mod tag_utc;
pub mod triangulate;

use shared::{calibrated_camera, ground, image_view, raster, spacecraft_grid, turn};
pub use shared::{
    camera_lines, image_pixels, line_camera, look, mola_surface, orientation, oriented,
    shot_heights, site_image,
};
#[cfg(test)]
use shared::{invented_orthoimage, invented_pair};
