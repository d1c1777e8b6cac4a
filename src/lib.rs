//! areograph: Mars Global Surveyor data preparation, from SPICE kernels, MOLA shots and MOC images
//! to validated, photogrammetry-ready products.
//!
//! [`flow::run_site`] runs a site; `flow/site.rs` shows how, read top to bottom; `ARCHITECTURE.md` is the map. The
//! layers below the stages are separate crates, under their names here.
//!
//! The root names these crates by their rooms: `crate::geom` is `areograph_geom`.

pub mod capabilities;
pub mod cli;
pub mod flow;
pub mod worker;

pub use areograph_base::{
    altimetry, body, column, constants, error, footprints, frames, image, instruments,
    kernel_names, kernel_source, line_times, minus, schema, stored, style, terms, ties, time,
    units, utc, verdict, watch,
};
#[cfg(feature = "cluster")]
pub use areograph_cluster as cluster;
pub use areograph_config as config;
pub use areograph_fetch as fetch;
pub use areograph_geom::{self as geom, imaging};
pub use areograph_pds as pds;
pub use areograph_products as products;
pub use areograph_report::{self as report, difference};
pub use areograph_scene as scene;
pub use areograph_service as service;
pub use areograph_spice as spice;
#[cfg(feature = "sql")]
pub use areograph_sql as sql;
pub use areograph_stages as stages;
pub use areograph_store::{self as store, files, stage, stage_inputs};
