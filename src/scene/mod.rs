//! A synthetic mission with known truth: kernels, PEDR files, labels and site configurations.

mod arc;
mod attitude;
mod error;
mod orbit;
mod plan;
mod random;
mod sun;
mod terrain;

pub use error::SceneError;
