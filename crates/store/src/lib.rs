//! Files known by their hashes, the definition of a stage, and the contents of a site's output folder besides the
//! products: stage outputs with their fingerprints, the manifest, the lock; and how files receive their final names.
//!
//! ```
//! use areograph_store::stage::Inputs;
//!
//! let fingerprint = |exposure_ms: f64| {
//!     let mut inputs = Inputs::new(1);
//!     inputs.setting("exposure_ms", &exposure_ms);
//!     inputs
//! };
//! // Equal inputs have equal fingerprints; a stage whose fingerprint is known does not run again.
//! assert_eq!(fingerprint(0.5), fingerprint(0.5));
//! assert_ne!(fingerprint(0.5), fingerprint(0.6));
//! ```

pub mod atomic;
pub mod book;
pub mod cache;
pub mod files;
mod hashed;
pub mod hashes;
pub mod lock;
pub mod manifest;
pub mod page;
pub mod publish;
pub mod published;
pub mod stage;
