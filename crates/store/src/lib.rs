//! What lies in a site's output folder besides the products: stage outputs with their fingerprints,
//! the manifest, the lock; and how files get under their final names.

pub mod atomic;
pub mod cache;
pub mod files;
pub mod hashes;
pub mod lock;
pub mod manifest;
pub mod page;
pub mod publish;
pub mod published;
pub mod stage;
