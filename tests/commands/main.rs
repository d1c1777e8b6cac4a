//! The commands as a user types them: their results, messages and exit codes.

mod bad_input;
#[path = "../common/mod.rs"]
mod common;
mod compare_kernels;
mod contradictions;
mod contradictions_attitude;
mod damaged_kernels;
mod example_kernels;
mod geometric;
mod guide;
mod hash_cache;
mod image_commands;
mod init;
mod mission;
mod pds_archive_index;
mod pds_records;
mod pedr_qa;
mod pedr_search;
mod pedr_table;
mod report_diff;
mod report_diff_refused;
mod rerun;
mod words;
