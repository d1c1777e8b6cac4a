//! Modules that serve several stages: images with their orientation and pixels, and the ground that they show.

pub(crate) mod calibrated_camera;
pub mod camera_lines;
pub(crate) mod ground;
pub mod image_pixels;
pub(crate) mod image_view;
#[cfg(test)]
pub(crate) mod invented_orthoimage;
#[cfg(test)]
pub(crate) mod invented_pair;
pub mod line_camera;
pub mod look;
pub mod mola_surface;
pub mod orientation;
pub mod oriented;
pub(crate) mod raster;
pub mod shot_heights;
pub mod site_image;
pub(crate) mod spacecraft_grid;
pub(crate) mod turn;
