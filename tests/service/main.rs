//! The service with its worker processes: commands, pages, interface.

#[path = "../common/mod.rs"]
mod common;
mod service_check;
mod service_cluster;
mod service_commands;
mod service_data;
mod service_fetch;
mod service_http;
mod service_http_data;
mod service_http_hostile;
mod service_http_many;
mod service_monitoring;
mod service_run;
mod service_upgrade;
mod worker;
mod world;
