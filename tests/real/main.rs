//! Real kernels, shots, cubes, labels and camera files, against what other programs make of them.

mod archives;
#[path = "../common/mod.rs"]
mod common;
mod exchange_isd;
mod hrsc_calibration;
mod hrsc_images;
mod hrsc_orientation;
mod kernels_from_folder;
mod ode_tables;
mod oriented_cube;
mod real_adjustment;
mod real_map;
mod real_orientation;
mod real_ranges;
mod real_registration;
mod real_site;
mod real_ties;
mod relief;
mod support_data;
mod table_shots;
mod usgscsm;
