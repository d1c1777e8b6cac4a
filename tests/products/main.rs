//! Products, pages, configuration and documents: what is written, and who can read it.

mod architecture;
mod campaign;
#[path = "../common/mod.rs"]
mod common;
mod config_arbitrary;
mod config_bad;
mod config_valid;
mod exchange_readers;
mod explore;
mod fidelity;
mod generated;
mod methods;
mod orthoimages;
mod products_site;
mod qgis;
mod registered_footprints;
mod report_geometric;
mod report_many;
mod report_page;
mod report_products;
mod spacing;
mod terrain;
