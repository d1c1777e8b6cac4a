//! The service: sites are run again when their inputs change, one worker process per site.
//!
//! Manifests on the disk are authoritative for products; the database is compared with the disk at every start. Files
//! are listed, not watched. A job brings one site up to date, an attempt is one worker process, a run is the
//! publication of one attempt.
//!
//! The service is independent of the pipeline: it exchanges lines of JSON with worker processes ([`worker::protocol`]).
//!
//! `engine` detects changes and manages affected sites, jobs, nights and retention; `database` stores its state;
//! `worker` controls worker processes from outside; `http` has pages and interface. Only this crate uses axum, the
//! network of tokio, and SQLite for the service.
//!
//! ```
//! use areograph_service::worker::protocol::{Line, PROTOCOL};
//!
//! assert!(serde_json::from_str::<Line>("not a line of a worker").is_err());
//! assert!(PROTOCOL > 0);
//! ```

pub mod audit;
pub mod check;
pub mod clock;
pub mod contents;
pub mod database;
pub mod engine;
pub mod http;
pub mod instant;
pub mod lock;
pub mod private;
pub mod random;
pub mod rebuild;
pub mod record;
pub mod recover;
pub mod sessions;
pub mod shared;
pub mod start;
pub mod state;
pub mod tokens;
pub mod words;
pub mod worker;
