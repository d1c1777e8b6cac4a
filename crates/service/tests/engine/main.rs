//! The engine of the service with simulated workers: changes, jobs, nights.

mod fake;
mod service_data;
mod service_engine;
mod service_jobs;
mod service_nights;
mod service_scale;
