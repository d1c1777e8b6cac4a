//! The service: sites are run again when what they read changes, one worker process a site.
//!
//! Truth about products is on the disk, in their manifests; the database remembers and is compared with the disk at
//! start. Files are listed, not watched. A job brings one site up to date, an attempt is one worker process, a run is what
//! one attempt published.
//!
//! The service does not know the pipeline: worker processes speak with it in lines of JSON ([`worker::protocol`]).
//!
//! `engine` finds changes, affected sites, jobs, nights and what is kept; `database` is its memory; `worker` sees
//! worker processes from outside; `http` has pages and interface. Only this crate uses axum, the network of tokio, and
//! SQLite for the service.
//!
//! ```
//! use areograph_service::worker::protocol::{Line, PROTOCOL};
//!
//! assert!(serde_json::from_str::<Line>("not a line of a worker").is_err());
//! assert!(PROTOCOL > 0);
//! ```

pub mod audit;
pub mod clock;
pub mod database;
pub mod engine;
pub mod http;
pub mod instant;
pub mod lock;
pub mod random;
pub mod rebuild;
pub mod sessions;
pub mod shared;
pub mod start;
pub mod state;
pub mod tokens;
pub mod worker;
