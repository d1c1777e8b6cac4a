//! The data flow: kernels → times → footprints → IAU 2000 → ranges → orientation → model → registration →
//! adjustment → products.
//!
//! `flow/site.rs` is one description of it, read top to bottom. A driver decides on each stage: a run computes or
//! keeps its output, a plan determines whether it would be kept, a check runs the stages that determine whether a run
//! can succeed. Nets, calibrations, laser matches and archives are descriptions for the same drivers (`flow/task.rs`).

mod answers;
mod archive;
mod boresight;
mod bounds;
mod calibrated_images;
mod calibration;
mod calibration_rounds;
mod campaign;
mod check;
mod choice;
mod compare;
mod driver;
mod evidence;
mod export;
mod kernels;
mod laser_match;
mod manifest;
mod needs;
mod net;
mod observer;
mod out;
mod outline;
mod outputs;
mod overlays;
mod page;
mod plan;
mod publish;
mod read_back;
mod readings;
mod registered;
mod result;
mod run;
mod series;
mod shot_search;
mod shot_tables;
mod site;
mod sites;
mod surface;
mod task;
mod triangulate;

pub use answers::{check_answer, plan_answer, run_answer};
pub use archive::{
    ArchiveFile, ArchiveRequest, ArchiveTask, ArchiveWorkers, archive_filter, archive_limits,
};
pub use boresight::{EstimatedBoresight, estimate_boresight, usual_boresight_sigma_rad};
pub use campaign::{
    CAMPAIGN, Campaign, CampaignAnswer, CampaignSite, Costs, End, InputSize, LeftOut, PlannedSite,
    SITES, SiteEnd, SiteTask, publish_results, run_site_file, select_campaign,
};
pub use check::{Checked, Extent, FoundProducts, check_site, required_by_site, rival_sets};
pub use choice::{ChooseKernels, KernelChoice, RivalKernelSets};
pub use compare::{
    Answer, Compared, EPOCHS_MAX, Request, RivalSet, Uncovered, compare_kernels, comparison_schema,
    require_different,
};
pub use driver::StageReason;
pub use export::{Exported, export_site};
pub use needs::{Needs, shots_of_box};
pub use observer::{Observer, StageEvent};
pub use out::{OutError, check_out};
pub use page::{PageAgain, page_again};
pub use plan::{RunPlan, plan_site, plan_task};
pub use readings::{compare_readings, readings_answer, readings_decision, usual_sigmas};
pub use run::{Ending, RunOptions, RunOutcome, run_site, run_task};
pub use series::{calibration_series, series_answer};
pub use shot_search::{COMPLAINTS_MAX, ShotAnswer, ShotRequest, ShotSearch, ShotSink};
pub use shot_tables::{
    instant_of_table, leap_second_clock, refuse_tables, state_nadir_by_range, tables_among,
};
pub use site::STAGES;
pub use sites::publish_sites;
pub use task::Task;

/// Name of the step that chooses, reads and hashes kernels.
pub const LOAD_KERNELS: &str = "load_kernels";
/// Name of the step that puts products under their final names.
pub const PUBLISH: &str = "publish";
