//! Files of archives: which ones a site needs, and their transfer, complete or not at all.
//!
//! | to | use |
//! |---|---|
//! | know the archives and their hosts | [`Archives`] |
//! | read indexes of archives | [`index`] |
//! | find the files that times, orbits, images and windows need | [`plan`] |
//! | transfer them, resumed and verified | [`Filling`] |
//! | examine a filled folder | [`audit`] |
//! | read an archive on its server without downloading it | [`remote`] |
//!
//! A file is identified by size and hash, never by a date or a similar name. Instants are UTC as indexes state them:
//! coverage is determined before any leap seconds or clocks are available.
//!
//! ```
//! use areograph_fetch::{Archives, Utc};
//!
//! let archives = Archives::built_in()?;
//! let start = Utc::parse("2001-03-17T20:53:12").unwrap();
//! // Orbits of the laser around the time of an image.
//! let [first, last] = archives.pedr.orbits_of([start, start]).unwrap();
//! assert!((19_000..19_100).contains(&first) && last - first < 10);
//! # Ok::<(), areograph_base::error::Error>(())
//! ```

mod address;
mod answer;
mod archives;
pub mod audit;
mod cache;
mod client;
mod error;
mod examined;
mod filling;
mod folder;
mod hashed;
mod headers;
pub mod index;
mod object_store;
mod outcome;
mod page;
mod part;
pub mod plan;
pub mod remote;
mod safe;
mod state;
mod table;
mod transfer;
mod utc;

pub use archives::{
    Archives, GenericArchive, ImageArchive, KernelArchive, Network, PedrArchive, ShotService,
};
pub use cache::Indexes;
pub use error::FetchError;
pub use filling::Filling;
pub use outcome::{Done, Outcome, Standing};
pub use state::{Record, State, Verified};
pub use utc::Utc;
