//! Data for pages and the interface for programs: rows of the tables, read only, in lists of bounded length.

mod inputs;
mod nights;
mod runs;
mod sites;
mod status;
mod work;

pub use super::{
    attempts::{Attempt, attempts},
    nights::{Night, night},
    runs::{Run, run},
    waits::{Wait, waits},
};
pub use inputs::{KernelFile, RootFolder, kernel_by_hash, kernels, roots, used_by};
pub use nights::nights;
pub use runs::{pin_run, runs_of_job, runs_of_night, runs_of_site};
pub use sites::{Site, count_sites, current_runs, site, site_file, sites};
pub use status::{DamagedRun, DataStatus, DatabaseLoss, ProductStatus, Scrub, data_status};
pub use work::{Standing, Totals, jobs_of_night, last_complete_night_ms, standing, totals};
