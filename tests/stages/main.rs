//! What stages compute, each by itself and in the flow: orientation, registration, intersection, adjustment, calibration.

mod adjust_stage;
mod adjusted_kernels;
mod adjusted_points;
mod attitude_edges;
mod calibrate;
mod calibration_images;
mod calibration_loop;
mod calibration_series;
#[path = "../common/mod.rs"]
mod common;
mod light_time;
mod line_times;
mod match_laser;
mod net_mosaic;
mod pds_search;
mod plane;
mod registration;
mod reorient;
mod stereo_intersection;
mod triangulate;
mod wide_angle;
