//! areograph: Mars Global Surveyor data preparation, from SPICE kernels, MOLA shots and MOC images
//! to validated, photogrammetry-ready products.
//!
//! [`flow::run_site`] runs a site; `flow/site.rs` tells how, read top to bottom; `ARCHITECTURE.md` is the map.

pub mod altimetry;
pub mod body;
pub mod cli;
pub mod config;
pub mod constants;
pub mod difference;
pub mod error;
pub mod files;
pub mod flow;
pub mod footprints;
pub mod frames;
pub mod geom;
pub mod image;
pub mod imaging;
pub mod instruments;
pub mod kernel_source;
pub mod line_times;
pub mod pds;
pub mod products;
pub mod report;
pub mod scene;
pub mod schema;
pub mod service;
pub mod spice;
#[cfg(feature = "sql")]
pub mod sql;
pub mod stage;
pub mod stages;
pub mod store;
pub mod ties;
pub mod time;
pub mod units;
pub mod watch;
pub mod wording;
