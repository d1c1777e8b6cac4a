//! The commands as a user types them: their results, messages and exit codes.

mod advice;
mod bad_input;
mod camera_without_sight;
mod campaign;
#[path = "../common/mod.rs"]
mod common;
mod compare_kernels;
mod compare_readings;
mod contradictions;
mod contradictions_attitude;
mod corrections_over_isis;
mod crossover_choice;
mod damaged_kernels;
mod estimate_boresight;
mod example_kernels;
mod export;
mod fetch;
mod fetch_tables;
mod flows;
mod foreign_files;
mod geometric;
mod guide;
mod hash_cache;
mod image_commands;
mod init;
mod inputs_apart;
#[cfg(all(target_os = "linux", target_arch = "x86_64"))]
mod killed_writers;
mod mission;
mod networks;
mod pds_archive_index;
mod pds_records;
mod pedr_qa;
mod pedr_qa_cluster;
mod pedr_search;
mod pedr_table;
mod remote;
mod report_diff;
mod report_diff_refused;
mod rerun;
mod words;
