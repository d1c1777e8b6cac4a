//! The data flow: kernels → times → footprints → IAU 2000 → ranges → orientation → model → registration →
//! adjustment → products.
//!
//! `flow/site.rs` is one description of it, read top to bottom. A driver says what becomes of each stage: a run makes or
//! keeps its output, a plan looks whether it would be kept, a check runs what tells whether a run can succeed.

mod check;
mod choice;
mod compare;
mod driver;
mod evidence;
mod kernels;
mod manifest;
mod out;
mod outputs;
mod plan;
mod publish;
mod read_back;
mod run;
mod site;
mod sites;

pub use check::{Checked, check_site, required_by_site, rival_sets};
pub use choice::{ChooseKernels, KernelChoice, RivalKernelSets};
pub use compare::{
    Answer, Compared, EPOCHS_MAX, Request, RivalSet, Uncovered, compare_kernels, comparison_schema,
    require_different,
};
pub use driver::StageReason;
pub use out::{OutError, check_out};
pub use plan::plan_site;
pub use run::{Ending, RunOptions, SiteOutcome, run_site};
pub use sites::publish_sites;

use crate::{
    stage::Stage,
    stages::{
        adjust::Adjust, check_ranges::CheckRanges, compare_pairs::ComparePairs,
        convert_datum::ConvertDatum, describe_kernels::DescribeKernels,
        fit_sensor_model::FitSensorModel, group_profiles::GroupProfiles, intersect::Intersect,
        read_ties::ReadTies, register::Register, reorient::Reorient,
        sample_orientation::SampleOrientation, search_footprints::SearchFootprints,
        tabulate_kernels::TabulateKernels, tag_times::TagTimes, tag_utc::TagUtc,
    },
};

/// Name of the step that chooses, reads and hashes kernels.
pub const LOAD_KERNELS: &str = "load_kernels";
/// Name of the step that puts products under their final names.
pub const PUBLISH: &str = "publish";

/// The names of the stages in the order of the flow, for `--until`.
pub const STAGES: [&str; 19] = [
    LOAD_KERNELS,
    TagTimes::NAME,
    SearchFootprints::NAME,
    ConvertDatum::NAME,
    TagUtc::NAME,
    GroupProfiles::NAME,
    ChooseKernels::NAME,
    CheckRanges::NAME,
    SampleOrientation::NAME,
    DescribeKernels::NAME,
    FitSensorModel::NAME,
    Register::NAME,
    ReadTies::NAME,
    Intersect::NAME,
    ComparePairs::NAME,
    Adjust::NAME,
    Reorient::NAME,
    TabulateKernels::NAME,
    PUBLISH,
];
